"""What the converter leaves of Gaussian noise, and the noise that was there before it.

    DN = clip(round(mu + tau z), lowest, highest),      z ~ N(0, 1)

Two things happen. Clipping: where noise reaches DN 0, the mean comes out too large and the variance too small
(a censored normal distribution, Tobin 1958). Rounding: over pixels whose mu lie anywhere between integers,

    E Var(DN) = tau^2 + 1/12 - sum_n exp(-4 pi^2 n^2 tau^2) / (2 pi^2 n^2)

that is 1/12 DN^2 more above tau = 0.5 (Sheppard), and ever less below, until nothing is left of the noise
either (Widrow & Kollar, Quantization Noise, 2008, chapter 5). Pixels of one mu, as in dark frames, depend on
where it lies: all show 64, or 64 and 65 in turn. From mean and variance, mu and tau^2 follow again.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import least_squares
from scipy.special import ndtr, ndtri

from fsid.sensor.quantise import ROUNDING_DN2

_SURE_TAU2 = 1.0  # DN^2, above which rounding is white noise within 1e-17
_RARE_DN2 = 0.2  # variance below which a pixel shows one integer and, rarely, the two beside it
_HALF_SEEN = 0.5  # of an event; takes the place of none
_BY_CHANCE = 5.5  # events on one side and none on the other, up to which they may be equally likely
_INVERSIONS = 80
_REACH = 4.5  # sigmas from a limit at which clipping shows in no burst
_SIGNIFICANT = 4.0  # standard errors of the spread of the pixels' levels
PLACES = 32
_PIXELS = np.linspace(-4, 4, 161)  # places, in sigmas, of pixels with a fixed pattern
_PIXEL_SHARES = np.exp(-(_PIXELS**2) / 2) / np.exp(-(_PIXELS**2) / 2).sum()


@dataclass(frozen=True)
class DarkNoise:
    """Level and noise of dark pixels before the converter: DN, and DN^2 with the 1/12 of rounding.

    variance_error: standard error; infinite where the stored integers do not tell.
    """

    level: float
    variance: float
    variance_error: float


def before_rounding(variance: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(tau^2, d tau^2 / d variance), (n,) each, from the variance (n,) of stored noise over time, DN^2.

    places: (n, `PLACES`) shares of the pixels by the fraction of their mean over time: where they lie between
    two integers, as far as that can be seen.
    """
    tau2, table = _rounding_table()
    found, slope = variance - ROUNDING_DN2, np.ones_like(variance)
    for pool in np.flatnonzero(variance < _SURE_TAU2):
        stored = table @ places[pool]
        found[pool] = np.interp(variance[pool], stored, tau2)
        slope[pool] = np.interp(variance[pool], stored, np.gradient(tau2, stored))
    return found, slope


def before_clipping(
    mean: np.ndarray, variance: np.ndarray, lowest: float, highest: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(mu, tau^2, share clipped) from mean and variance of clipped noise, all (n,); in any unit."""
    mu, tau2 = mean.astype(np.float64), np.maximum(variance, 1e-15)
    share = np.zeros_like(mu)
    reached = np.minimum(mean - lowest, highest - mean) < _REACH * np.sqrt(tau2)
    for _ in range(_INVERSIONS if reached.any() else 0):
        below, above = ((limit - mu) / np.sqrt(tau2) for limit in (lowest, highest))
        shift, left, share = censored(below, above)
        mu = np.where(reached, mean - shift * np.sqrt(tau2), mu)
        tau2 = np.where(reached, variance / np.maximum(left, 1e-3), tau2)
    return mu, tau2, share


def dark_noise(means: np.ndarray, variances: np.ndarray, frames: int, white_level: int) -> DarkNoise:
    """Noise of dark pixels that are alike but for a fixed pattern.

    means, variances: (n,) over the `frames` of each pixel, DN and DN^2.
    """
    pixels = means.size
    mean, variance = float(means.mean()), float(variances.mean())
    errors = np.array([means.std(), variances.std(), means.var() * np.sqrt(2)]) / np.sqrt(pixels)
    spread2 = float(means.var()) - variance / frames
    fixed2 = spread2 if spread2 > _SIGNIFICANT * errors[2] else 0.0
    if mean < _REACH * np.sqrt(variance + fixed2):
        return _solved(np.array([mean, variance, fixed2]), errors, white_level)
    if variance > _SURE_TAU2:
        return DarkNoise(mean, variance, float(errors[1]))
    if variance < _RARE_DN2 and not fixed2:
        return _rare(mean, variance, pixels, frames)
    return _solved(np.array([mean, variance, fixed2]), errors, white_level)


def censored(below: np.ndarray, above: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean and variance of a normal number clipped to below..above, and the share that is clipped."""
    p, q = ndtr(below), ndtr(-above)
    f, g = (np.exp(-z * z / 2) / np.sqrt(2 * np.pi) for z in (below, above))
    mean = below * p + above * q + f - g
    square = below**2 * p + above**2 * q + 1 - p - q + below * f - above * g
    return mean, square - mean**2, p + q


def _rare(mean: float, variance: float, pixels: int, frames: int) -> DarkNoise:
    """Noise that seldom reaches the next integer: how often it does so on both sides says where mu is.

    A side that never shows bounds tau: tau^2 may be anything below, and mu is what the other side says of the
    middle of it; unless that one shows so seldom that the difference is chance.
    """
    samples, middle = pixels * frames, round(mean)
    off = mean - middle
    seen = samples * np.array([variance + off**2 + off, variance + off**2 - off]) / 2
    least = max(_HALF_SEEN, _SIGNIFICANT * variance * np.sqrt(pixels / 2))  # what their difference tells
    z = -ndtri(np.maximum(seen, least) / samples)
    tau = 1 / z.sum()
    tau2 = float(tau**2)
    if seen.max() < least:
        return DarkNoise(mean, tau2 / 2 + ROUNDING_DN2, tau2 / np.sqrt(12))
    if seen.min() < least and seen.max() > _BY_CHANCE:
        level = middle + np.copysign(0.5 - z.min() * tau / np.sqrt(2), off)
        return DarkNoise(float(level), tau2 / 2 + ROUNDING_DN2, tau2 / np.sqrt(12))
    z_error = np.sqrt(np.maximum(seen, 1)) / samples * np.sqrt(2 * np.pi) * np.exp(z * z / 2)
    error = 2 * tau**3 * np.hypot(*z_error)
    return DarkNoise(float(middle + 0.5 - z[0] * tau), tau2 + ROUNDING_DN2, float(error))


def _solved(found: np.ndarray, errors: np.ndarray, white_level: int) -> DarkNoise:
    """mu and tau of integers of this mean, variance over time and spread between pixels."""
    mean, variance, fixed2 = found
    size = 3 if fixed2 else 2
    scale = np.maximum(errors, 1e-9)[:size]

    def residual(unknown: np.ndarray) -> np.ndarray:
        fixed = np.exp(unknown[2]) if fixed2 else 0.0
        return (_stored(unknown[0], np.exp(unknown[1]), fixed, white_level) - found)[:size] / scale

    tau = np.sqrt(max(variance - ROUNDING_DN2, 0.01))
    start = np.array([mean, np.log(tau), 0.5 * np.log(max(fixed2, 1e-6))])[:size]
    best = least_squares(residual, start, x_scale=np.array([max(tau, 0.1), 0.1, 0.1])[:size])
    normal = best.jac.T @ best.jac
    tau2 = float(np.exp(2 * best.x[1]))
    sure = np.linalg.cond(normal) < 1e12
    error = 2 * tau2 * float(np.sqrt(np.linalg.inv(normal)[1, 1])) if sure else float("inf")
    return DarkNoise(float(best.x[0]), tau2 + ROUNDING_DN2, error)


def _stored(mu: float, tau: float, fixed: float, white_level: int) -> np.ndarray:
    """Mean, mean variance over time, and variance between pixels, of stored integers."""
    levels = mu + fixed * _PIXELS if fixed else np.array([mu])
    shares = _PIXEL_SHARES if fixed else np.ones(1)
    low = max(0, int(levels[0] - 8 * tau) - 1)
    high = min(white_level, int(levels[-1] + 8 * tau) + 2)
    dn = np.arange(low, high + 1)
    edges = np.concatenate([[-np.inf], dn[1:] - 0.5, [np.inf]])
    chance = np.diff(ndtr((edges - levels[:, None]) / tau), axis=1)
    means = chance @ dn
    variances = np.sum(chance * (dn - means[:, None]) ** 2, axis=1)
    mean = float(shares @ means)
    return np.array([mean, shares @ variances, shares @ (means - mean) ** 2])


@cache
def _rounding_table() -> tuple[np.ndarray, np.ndarray]:
    """tau^2 (m,), and the variance of stored noise (m, PLACES) for each place of the stored mean."""
    tau2 = np.geomspace(1e-3, 1.2 * _SURE_TAU2, 120)
    mu, places = np.linspace(0, 1, 4 * PLACES + 1), (np.arange(PLACES) + 0.5) / PLACES
    edges = np.arange(-8, 9) + 0.5
    variances = np.empty((len(tau2), PLACES))
    for row, tau in enumerate(np.sqrt(tau2)):
        beyond = ndtr((mu[:, None] - edges) / tau)  # share above each edge
        mean = beyond.sum(axis=1) - 8
        square = beyond @ (2 * np.arange(-8, 9) + 1) + 64
        variance = square - mean**2
        variances[row] = np.interp(np.interp(places, mean, mu), mu, variance)
    rising = np.maximum.accumulate(variances, axis=0)
    return tau2, rising + 1e-9 * np.arange(len(tau2))[:, None]
