"""A camera's noise from repeated frames of a scene that stands still.

    Var(DN) = k_dn (E(DN) - black) + sigma2_dn,      one line per CFA site, mean and variance over time

Each pool of pixels of like mean (`pools`) weighs as much as its variance is certain: the variance of the mean
of N sample variances from n frames is 2 V^2 / (N (n - 1)). Unweighted, the bright pools drown the intercept.
Dark pixels with noise of their row or column in common are fewer independent samples than N: that widens the
stated errors by as much as the lines are seen to scatter, and leaves the weights alone. Dark frames give
black level and intercept directly; without them the black level must be known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fsid.errors import FsidError
from fsid.sensor.black_levels import BlackLevels
from fsid.sensor.camera_profile import MONO
from fsid.sensor.defects import defective
from fsid.sensor.mosaic import pack
from fsid.sensor.pools import Samples, pool, pool_dark
from fsid.sensor.quantise import ROUNDING_DN2
from fsid.sensor.temporal import TemporalStatistics

_REWEIGHTINGS = 10
_CROOKED = 4.0  # times the squared scatter of pools around a straight line
_SURE = 4.0  # standard errors


@dataclass(frozen=True, eq=False)
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
    black_level: float | Sequence[float] | None = None,
    dark: TemporalStatistics | None = None,
) -> NoiseFit:
    """The noise line of one ISO, in DN, from one or more bursts of any exposures.

    cfa: None or "MONO" for a monochrome sensor. black_level: DN, of all pixels or of the sites R, Gr, Gb, B,
    needed where there are no `dark` frames. FsidError where neither is given, where there is no burst, or
    where the bursts show less than two light levels.
    """
    if not bursts:
        raise FsidError("calibration needs at least one burst of a lit scene")
    cfa = None if cfa == MONO else cfa
    left_out = None
    if dark is not None:
        left_out = defective(dark.mean())
        dark_samples, black = pool_dark(dark, cfa, white_level, left_out=left_out)
        pooled = [dark_samples]
    elif black_level is not None:
        tile = BlackLevels.stated(black_level, cfa, "black_level").tile
        black, pooled = (tile[0, :1] if cfa is None else pack(tile, cfa).ravel()), []
    else:
        raise FsidError("calibration needs dark frames or the black level in DN")
    lit = (pool(burst, cfa, black, white_level, left_out) for burst in bursts)
    return fit_samples([*pooled, *lit], black)


def fit_samples(
    bursts: Sequence[tuple[Samples, ...]], black: np.ndarray, *, tie_greens: bool = False
) -> NoiseFit:
    """The noise line of one ISO from pooled bursts; tie_greens: one line through the samples of Gr and Gb."""
    sites = [Samples.joined(of_site) for of_site in zip(*bursts, strict=True)]
    if tie_greens and len(sites) == 4:
        sites[1] = sites[2] = Samples.joined(sites[1:3])
    k, sigma2, k_error, sigma2_error = np.array([_line(samples) for samples in sites]).T
    lines = zip(sites, k, sigma2, strict=True)
    moved = tuple(replace(s, signal=s.signal_by(*line)) for s, *line in lines)
    return NoiseFit(k, sigma2, k_error, sigma2_error, black, moved)


def departure(fit: NoiseFit) -> float:
    """How far the pools lie from their line, relative, rms, beyond their own uncertainty: of the worst site.

    0 where that may be chance: below `_CROOKED` times the scatter that they should have.
    """
    return max(_departure(*site) for site in zip(fit.samples, fit.k_dn, fit.sigma2_dn, strict=True))


def black_too_low_dn(fit: NoiseFit) -> float:
    """DN by which the black level is too low at least, as a line shows that would need less noise than none
    at zero light: of the worst site. 0 where that may be chance."""
    return max(_too_low_dn(*site) for site in zip(fit.samples, fit.k_dn, fit.sigma2_dn, strict=True))


def _departure(samples: Samples, k: float, sigma2: float) -> float:
    signal, variance, freedom = samples.in_use()
    away = variance / np.maximum(k * signal + sigma2, 1e-3) - 1
    if _scatter(away, freedom / 2) < _CROOKED:
        return 0.0
    return float(np.sqrt(max((away**2).mean() - (2 / np.maximum(freedom, 1e-9)).mean(), 0.0)))


def _too_low_dn(samples: Samples, k: float, sigma2: float) -> float:
    signal, variance, freedom = samples.in_use()
    weight = freedom / (2 * np.maximum(k * signal + sigma2, 1e-3) ** 2)
    slope, intercept, error = _weighted_line(signal, variance, weight)
    missing = ROUNDING_DN2 - intercept
    scatter = _scatter(variance - slope * signal - intercept, weight)
    is_sure = missing > _SURE * error[1] * np.sqrt(max(scatter, 1.0))
    return missing / slope if slope > 0 and is_sure else 0.0


def _line(samples: Samples) -> tuple[float, float, float, float]:
    """k, sigma2 and their standard errors; sigma2 is not below the rounding noise."""
    signal, variance, freedom = samples.in_use()
    if len(signal) < 2 or np.ptp(signal) <= 0:
        raise FsidError(
            "calibration found fewer than two light levels; add an exposure, a gradient or dark frames"
        )
    model = variance
    for _ in range(_REWEIGHTINGS):
        weight = freedom / (2 * np.maximum(model, 1e-3) ** 2)
        k, sigma2, error = _weighted_line(signal, variance, weight)
        if sigma2 < ROUNDING_DN2:
            sigma2 = ROUNDING_DN2
            k = float((weight * signal * (variance - sigma2)).sum() / (weight * signal**2).sum())
        signal = samples.signal_by(k, sigma2)[samples.used]
        model = k * signal + sigma2
    error2 = error**2 * max(_scatter(variance - model, weight), 1.0)
    k_error, sigma2_error = np.sqrt(error2 + _by_banding(signal, weight, samples.banding[samples.used]))
    return k, sigma2, float(k_error), float(sigma2_error)


def _by_banding(signal: np.ndarray, weight: np.ndarray, banding: np.ndarray) -> np.ndarray:
    """(2,) squared errors of slope and intercept by those of the pools, `banding` in DN^4."""
    design = np.stack([signal, np.ones_like(signal)], axis=1)
    weighted = design.T * weight
    return np.linalg.solve(weighted @ design, weighted) ** 2 @ banding


def _scatter(residual: np.ndarray, weight: np.ndarray) -> float:
    """Mean square of residuals from a line, 1 where they are what the weights, inverse variances, say."""
    return float((weight * residual**2).sum() / max(len(residual) - 2, 1))


def _weighted_line(
    signal: np.ndarray, variance: np.ndarray, weight: np.ndarray
) -> tuple[float, float, np.ndarray]:
    """Slope, intercept, and the (2,) standard errors of both, of weights that are inverse variances."""
    design = np.stack([signal, np.ones_like(signal)], axis=1)
    normal = design.T @ (design * weight[:, None])
    slope, intercept = np.linalg.solve(normal, design.T @ (variance * weight))
    return float(slope), float(intercept), np.sqrt(np.diag(np.linalg.inv(normal)))
