"""A camera's noise from repeated frames of a scene that stands still.

    Var(DN) = k_dn (E(DN) - black) + sigma2_dn,      one line per CFA site, mean and variance over time

Every pixel is its own experiment: its variance over the frames knows nothing of texture, vignetting or fixed
pattern. Pixels of like mean are pooled, and each pool weighs as much as its variance is certain: the variance
of the mean of N sample variances from n frames is 2 V^2 / (N (n - 1)). Unweighted, the bright pools drown the
intercept. Dark frames give black level and intercept directly; without them the black level must be known.

Excluded: pixels that touched 0 or white in any frame, means above 70 % of the range (EMVA 1288, 6.6), and
pixels whose variance no Gaussian noise explains (telegraph noise, something moved). The level of each frame
is subtracted first, so that a lamp's flicker does not count as noise. sigma2_dn contains the rounding of the
converter, 1/12 DN^2, as in every published table; read noise below half a DN cannot be told through rounding,
and its sigma2_dn comes out too small.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from fsid.errors import FsidError
from fsid.sensor.mosaic import site_offsets

LINEAR_SHARE = 0.7  # of the range above black; beyond it sensors saturate softly
OUTLIER_PROBABILITY = 1e-6  # of Gaussian noise to look like a defective pixel
_POOLS = 256
_POOL_PIXELS = 200  # wanted in a pool on average
_MIN_POOL_PIXELS = 50
_REWEIGHTINGS = 10


@dataclass(frozen=True)
class NoiseFit:
    """The line in DN, its standard errors, the black level; (4,) each: R, Gr, Gb, B; (1,) without a CFA."""

    k_dn: np.ndarray
    sigma2_dn: np.ndarray
    k_dn_error: np.ndarray
    sigma2_dn_error: np.ndarray
    black: np.ndarray


class TemporalStatistics:
    """Mean and variance over time of every pixel of one burst, from one frame after the other.

    Memory: 19 bytes per pixel, however many frames. Sums count from the first frame, so that they stay small.
    """

    def __init__(self, white_level: int) -> None:
        self.frames = 0
        self._white_level = white_level
        self._first: np.ndarray | None = None

    def add(self, dn: np.ndarray) -> None:
        """One more frame, (H, W) integers, of the same size as the others."""
        if self._first is None:
            self._first = dn.astype(np.uint16)
            self._sum, self._squares = np.zeros(dn.shape), np.zeros(dn.shape)
            self._clipped = np.zeros(dn.shape, bool)
            self._levels = 0.0
        if dn.shape != self._first.shape:
            raise FsidError(f"a frame of the burst is {dn.shape}, the first one {self._first.shape} (H, W)")
        change = dn - self._first.astype(np.float64)
        level = change.mean()
        change -= level
        self._sum += change
        self._squares += change**2
        self._levels += level
        self._clipped |= (dn <= 0) | (dn >= self._white_level)
        self.frames += 1

    def sites(self, cfa: str | None) -> list[tuple[np.ndarray, np.ndarray]]:
        """(mean, variance) in DN of the unclipped pixels of each site; of all pixels if `cfa` is None."""
        if self._first is None or self.frames < 2:
            raise FsidError("a burst needs at least two frames: a single one has no variance over time")
        mean = self._first + (self._sum + self._levels) / self.frames
        variance = (self._squares - self._sum**2 / self.frames) / (self.frames - 1)
        places = [np.s_[:, :]] if cfa is None else [np.s_[r::2, c::2] for r, c in site_offsets(cfa)]
        kept = [~self._clipped[place] for place in places]
        return [(mean[p][keep], variance[p][keep]) for p, keep in zip(places, kept, strict=True)]


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
    groups = [*bursts, *([dark] if dark is not None else [])]
    samples = [group.sites(cfa) for group in groups]
    fits = []
    for of_site in zip(*samples, strict=True):
        if dark is not None and of_site[-1][0].size == 0:
            raise FsidError("the dark frames are clipped everywhere; check that the lens was covered")
        if dark is not None:
            black_level = float(of_site[-1][0].mean())
        if black_level is None:
            raise FsidError("calibration needs dark frames or the black level in DN")
        points = [
            _pool(mean, variance, group.frames, black_level, white_level)
            for (mean, variance), group in zip(of_site, groups, strict=True)
        ]
        fits.append((*_line(np.concatenate(points)), black_level))
    k, sigma2, k_error, sigma2_error, blacks = np.array(fits).T
    return NoiseFit(k, sigma2, k_error, sigma2_error, blacks)


def _pool(mean: np.ndarray, variance: np.ndarray, frames: int, black: float, white: int) -> np.ndarray:
    """Pixels of like mean as rows (signal above black, mean variance, degrees of freedom)."""
    limit = LINEAR_SHARE * (white - black)
    signal = mean - black
    linear = signal < limit
    signal, variance = signal[linear], variance[linear]
    if signal.size == 0:
        return np.empty((0, 3))
    pools = int(np.clip(signal.size // _POOL_PIXELS, 1, _POOLS))
    pool = np.clip((signal / limit * pools).astype(np.int64), -1, pools - 1) + 1
    ends = np.cumsum(np.bincount(pool, minlength=pools + 1))
    middles = (np.concatenate([[0], ends[:-1]]) + ends) // 2  # of each pool in ascending order of variance
    median = variance[np.lexsort((variance, pool))][np.minimum(middles, len(pool) - 1)]
    largest = chi2.ppf(1 - OUTLIER_PROBABILITY, frames - 1) / chi2.median(frames - 1)
    sound = variance <= largest * median[pool]
    pool, signal, variance = pool[sound], signal[sound], variance[sound]
    count = np.bincount(pool, minlength=pools + 1)
    full = count >= _MIN_POOL_PIXELS
    means = [np.bincount(pool, values, pools + 1)[full] / count[full] for values in (signal, variance)]
    return np.stack([*means, count[full] * (frames - 1)], axis=1)


def _line(points: np.ndarray) -> tuple[float, float, float, float]:
    """k, sigma2 and their standard errors from rows (signal, variance, degrees of freedom)."""
    if len(points) < 2 or np.ptp(points[:, 0]) <= 0:
        raise FsidError(
            "calibration found fewer than two light levels; add an exposure, a gradient or dark frames"
        )
    signal, variance, freedom = points.T
    design = np.stack([signal, np.ones_like(signal)], axis=1)
    model = variance
    for _ in range(_REWEIGHTINGS):
        weight = freedom / (2 * np.maximum(model, 1e-3) ** 2)
        normal = design.T @ (design * weight[:, None])
        k, sigma2 = np.linalg.solve(normal, design.T @ (variance * weight))
        model = design @ (k, sigma2)
    k_error, sigma2_error = np.sqrt(np.diag(np.linalg.inv(normal)))
    return float(k), float(sigma2), float(k_error), float(sigma2_error)
