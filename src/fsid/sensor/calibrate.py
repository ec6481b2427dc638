"""A camera's noise from repeated frames of a scene that stands still.

    Var(DN) = k_dn (E(DN) - black) + sigma2_dn,      one line per CFA site, mean and variance over time

Every pixel is its own experiment: its variance over the frames knows nothing of texture, vignetting or fixed
pattern. Pixels of like mean are pooled, and each pool weighs as much as its variance is certain: the variance
of the mean of N sample variances from n frames is 2 V^2 / (N (n - 1)). Unweighted, the bright pools drown the
intercept. Dark frames give black level and intercept directly; without them the black level must be known.

Excluded: pixels that touched 0 or white in any frame, means above 70 % of the range (EMVA 1288, 6.6), and
pixels whose variance no Gaussian noise explains (telegraph noise, something moved). sigma2_dn contains the
rounding of the converter, 1/12 DN^2, as in every published table. That sum holds only where noise spreads
over several integers: pools below `RESOLVED_DN2` say nothing, and no intercept is below 1/12 DN^2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from fsid.errors import FsidError
from fsid.sensor.quantise import ROUNDING_DN2
from fsid.sensor.temporal import TemporalStatistics

LINEAR_SHARE = 0.7  # of the range above black; beyond it sensors saturate softly
OUTLIER_PROBABILITY = 1e-6  # of Gaussian noise to look like a defective pixel
OUTLIER_SHARE = 0.05  # of the pixels, above which the scene moved: sensors have fewer defects
RESOLVED_DN2 = (
    0.5  # above it rounding adds its 1/12 DN^2 within 0.1 % of the variance, wherever between integers
)
_MAX_POOLS = 256  # in the range
_POOL_WIDTH = 8.0  # standard errors of a pixel's mean
_POOL_PIXELS = 200  # at least, but for the last one
_GUIDES = 64  # parts of the pixels that tell how noise depends on light before there are pools
_MIN_POOL_PIXELS = 50
_REWEIGHTINGS = 10


@dataclass(frozen=True)
class Samples:
    """Pooled pixels of one burst and one site.

    signal, variance: (m,) DN above black and DN^2. freedom: (m,) degrees of freedom. used: (m,) bool, False
    where the fit leaves the pool out (beyond the linear range, or below the resolution of the converter).
    """

    signal: np.ndarray
    variance: np.ndarray
    freedom: np.ndarray
    used: np.ndarray

    @staticmethod
    def joined(parts: Sequence[Samples]) -> Samples:
        """All pools of several bursts or sites."""
        names = ("signal", "variance", "freedom", "used")
        return Samples(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


@dataclass(frozen=True)
class NoiseFit:
    """The line in DN, its standard errors, the black level; (4,) each: R, Gr, Gb, B; (1,) without a CFA.

    samples: what the line was fitted to, one per site.
    """

    k_dn: np.ndarray
    sigma2_dn: np.ndarray
    k_dn_error: np.ndarray
    sigma2_dn_error: np.ndarray
    black: np.ndarray
    samples: tuple[Samples, ...]


def fit_noise(
    bursts: Sequence[TemporalStatistics],
    *,
    cfa: str | None,
    white_level: int,
    black_level: float | None = None,
    dark: TemporalStatistics | None = None,
) -> NoiseFit:
    """The noise line of one ISO from one or more bursts of any exposures.

    cfa: None for a monochrome sensor. black_level: DN, needed where there are no `dark` frames.
    """
    if dark is not None:
        black = black_of(dark, cfa)
    elif black_level is not None:
        black = np.full(1 if cfa is None else 4, float(black_level))
    else:
        raise FsidError("calibration needs dark frames or the black level in DN")
    groups = [*bursts, *([dark] if dark is not None else [])]
    return fit_samples([pool(group, cfa, black, white_level) for group in groups], black)


def black_of(dark: TemporalStatistics, cfa: str | None) -> np.ndarray:
    """Mean DN of each site of dark frames."""
    sites = [mean for mean, _ in dark.sites(cfa)]
    if min(mean.size for mean in sites) == 0:
        raise FsidError("the dark frames are clipped everywhere; check that the lens was covered")
    return np.array([mean.mean() for mean in sites])


def pool(
    burst: TemporalStatistics, cfa: str | None, black: np.ndarray, white_level: int
) -> tuple[Samples, ...]:
    """Pixels of like mean, one `Samples` per site; black: DN of each site. FsidError if the scene moved."""
    return tuple(
        _pool(mean, variance, burst.frames, float(site_black), white_level)
        for (mean, variance), site_black in zip(burst.sites(cfa), black, strict=True)
    )


def fit_samples(
    bursts: Sequence[tuple[Samples, ...]], black: np.ndarray, *, tie_greens: bool = False
) -> NoiseFit:
    """The noise line of one ISO from pooled bursts; tie_greens: one line through the samples of Gr and Gb."""
    sites = [Samples.joined(of_site) for of_site in zip(*bursts, strict=True)]
    if tie_greens and len(sites) == 4:
        sites[1] = sites[2] = Samples.joined(sites[1:3])
    k, sigma2, k_error, sigma2_error = np.array([_line(samples) for samples in sites]).T
    return NoiseFit(k, sigma2, k_error, sigma2_error, black, tuple(sites))


def _pool(mean: np.ndarray, variance: np.ndarray, frames: int, black: float, white: int) -> Samples:
    order = np.argsort(mean)
    signal, variance = mean[order] - black, variance[order]
    if signal.size < _MIN_POOL_PIXELS:
        return Samples(np.empty(0), np.empty(0), np.empty(0), np.empty(0, bool))
    starts = _starts(signal, variance, frames, white - black)
    sound = _sound(signal, variance, starts, frames)
    count = np.add.reduceat(sound, starts, dtype=np.int64)
    full = count >= _MIN_POOL_PIXELS
    signal, variance = (np.add.reduceat(v * sound, starts)[full] / count[full] for v in (signal, variance))
    used = (signal < LINEAR_SHARE * (white - black)) & (variance > RESOLVED_DN2)
    return Samples(signal, variance, count[full] * (frames - 1.0), used)


def _starts(signal: np.ndarray, variance: np.ndarray, frames: int, span: float) -> np.ndarray:
    """First index of each pool of the ascending `signal`.

    A pool is at least `_POOL_WIDTH` standard errors of a pixel's mean wide. Narrower ones would sort pixels
    by their noise and not by their light, and the slope would come out too small.
    """
    chunks = np.array_split(np.arange(signal.size), min(_GUIDES, signal.size // _MIN_POOL_PIXELS))
    middles = np.array([signal[chunk].mean() for chunk in chunks])
    errors = np.sqrt([np.median(variance[chunk]) / frames for chunk in chunks])
    starts = [0]
    while True:
        start = starts[-1]
        width = max(_POOL_WIDTH * float(np.interp(signal[start], middles, errors)), span / _MAX_POOLS)
        end = max(int(np.searchsorted(signal, signal[start] + width)), start + _POOL_PIXELS)
        if end > signal.size - _MIN_POOL_PIXELS:
            return np.array(starts)
        starts.append(end)


def _sound(signal: np.ndarray, variance: np.ndarray, starts: np.ndarray, frames: int) -> np.ndarray:
    """(n,) False for pixels that vary more than Gaussian noise of the usual variance at their signal."""
    ends = [*starts[1:], signal.size]
    medians = [np.median(variance[a:b]) for a, b in zip(starts, ends, strict=True)]
    middles = [signal[a:b].mean() for a, b in zip(starts, ends, strict=True)]
    largest = chi2.ppf(1 - OUTLIER_PROBABILITY, frames - 1) / chi2.median(frames - 1)
    sound = variance <= largest * np.maximum(np.interp(signal, middles, medians), RESOLVED_DN2)
    if sound.mean() < 1 - OUTLIER_SHARE:
        raise FsidError(
            f"{100 * (1 - sound.mean()):.0f} % of the pixels vary more than noise does: the scene or the "
            f"camera moved during the burst; use a tripod and a static scene"
        )
    return sound


def _line(samples: Samples) -> tuple[float, float, float, float]:
    """k, sigma2 and their standard errors; sigma2 is not below the rounding noise."""
    signal, variance, freedom = (v[samples.used] for v in (samples.signal, samples.variance, samples.freedom))
    if len(signal) < 2 or np.ptp(signal) <= 0:
        raise FsidError(
            "calibration found fewer than two light levels; add an exposure, a gradient or dark frames"
        )
    design = np.stack([signal, np.ones_like(signal)], axis=1)
    model = variance
    for _ in range(_REWEIGHTINGS):
        weight = freedom / (2 * np.maximum(model, 1e-3) ** 2)
        normal = design.T @ (design * weight[:, None])
        k, sigma2 = np.linalg.solve(normal, design.T @ (variance * weight))
        if sigma2 < ROUNDING_DN2:
            sigma2 = ROUNDING_DN2
            k = (weight * signal * (variance - sigma2)).sum() / normal[0, 0]
        model = design @ (k, sigma2)
    scatter = float((weight * (variance - model) ** 2).sum() / max(len(signal) - 2, 1))
    k_error, sigma2_error = np.sqrt(np.diag(np.linalg.inv(normal)) * max(scatter, 1.0))
    return float(k), float(sigma2), float(k_error), float(sigma2_error)
