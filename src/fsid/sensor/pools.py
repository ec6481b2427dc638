"""Pixels of like light together, of a burst: their mean and variance over time, one by one.

Every pixel is its own experiment: its variance over the frames knows nothing of texture, vignetting or fixed
pattern. Excluded: pixels that hardly ever left 0 or white, means above 70 % of the range (EMVA 1288, 6.6),
pixels whose variance no Gaussian noise explains (telegraph noise, something moved), and those that lie far
from their neighbours in dark frames (`defects`). What rounding and clipping make of noise is undone
(`stored_noise`): a pool's variance is that before the converter plus the 1/12 DN^2 that rounding adds
wherever noise spreads over several integers, as in every published table.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from scipy.special import gammaincinv

from fsid.errors import FsidError
from fsid.sensor.quantise import ROUNDING_DN2
from fsid.sensor.stored_noise import PLACES, before_clipping, before_rounding, dark_noise
from fsid.sensor.temporal import TemporalStatistics

LINEAR_SHARE = 0.7  # of the range above black; beyond it sensors saturate softly
OUTLIER_PROBABILITY = 1e-6  # of Gaussian noise to look like a defective pixel
OUTLIER_SHARE = 0.05  # of the pixels, above which the scene moved: sensors have fewer defects
RESOLVED_DN2 = (
    0.5  # above it rounding adds its 1/12 DN^2 within 0.1 % of the variance, wherever the mean lies
)
_LEAST_TAU2 = 0.08  # DN^2 of noise; with less, a pixel hardly ever leaves its integer
_STEEPEST = 2.0  # times the error of the stored variance that of the restored one may be
_LARGEST_CLIPPED_SHARE = 0.1  # of a pool; what is left beside the limit still tells the noise
_MAX_POOLS = 256  # in the range
_POOL_WIDTH = 8.0  # standard errors of a pixel's mean
_NARROW_DN = 1.0  # a pool; over wider ones, what rounding takes from faint noise is no straight line
_POOL_PIXELS = 200  # at least, but for the last one
_GUIDES = 64  # parts of the pixels that tell how noise depends on light before there are pools
_MIN_POOL_PIXELS = 50


@dataclass(frozen=True, eq=False)
class Samples:
    """Pooled pixels of one burst and one site.

    signal, variance: (m,) DN above black and DN^2. freedom: (m,) degrees of freedom. used: (m,) bool, False
    where the fit leaves the pool out (beyond the linear range, or too little left by the converter).
    banding: (m,) DN^4, squared error of the variance beyond that of independent pixels. towards_light: (m,)
    DN that the signal is too low, were all noise read noise (`_towards_light`).
    """

    signal: np.ndarray
    variance: np.ndarray
    freedom: np.ndarray
    used: np.ndarray
    banding: np.ndarray
    towards_light: np.ndarray

    def in_use(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """signal, variance and freedom of the pools that the fit takes."""
        signal, variance, freedom = (v[self.used] for v in (self.signal, self.variance, self.freedom))
        return signal, variance, freedom

    def signal_by(self, k: float, sigma2: float) -> np.ndarray:
        """(m,) DN, `signal` moved by as much of `towards_light` as noise that is k signal + sigma2 asks for.

        Pixels are pooled by their mean over time, m, and noise made some of these too low or high. With read
        noise alone their variance is that of their light. The variance s2 of shot noise, which is skewed
        (third moment k^2 signal), is not independent of m, E(s2 | m) = V + k (m - light): such pixels lie on
        the line already.
        """
        model = np.maximum(k * self.signal + sigma2, 1e-3)
        return self.signal + self.towards_light * np.clip(sigma2 / model, 0, 1)

    @staticmethod
    def joined(parts: Sequence[Samples]) -> Samples:
        """All pools of several bursts or sites."""
        names = [field.name for field in fields(Samples)]
        return Samples(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


def pool_dark(
    dark: TemporalStatistics,
    cfa: str | None,
    white_level: int,
    black: np.ndarray | None = None,
    *,
    left_out: np.ndarray,
) -> tuple[tuple[Samples, ...], np.ndarray]:
    """(one `Samples` of one pool per site, level in DN of each site) of dark frames.

    black: DN of each site, where it is known from shorter dark frames; else the level is the black level.
    left_out: (H, W) bool, pixels of these frames that are `defective`.
    """
    largest = _largest(dark.frames)
    sites = dark.sites(cfa, left_out)
    if min(mean.size for mean, _ in sites) < _MIN_POOL_PIXELS:
        raise FsidError("the dark frames are clipped everywhere; check that the lens was covered")
    found = []
    for mean, variance in sites:
        sound = variance <= largest * max(float(np.median(variance)), RESOLVED_DN2)
        found.append(dark_noise(mean[sound], variance[sound], dark.frames, white_level))
    levels = np.array([site.level for site in found])
    signals = levels - (levels if black is None else black)
    samples = []
    factors = dark.banding_factors(cfa, left_out, largest)
    for site, signal, factor in zip(found, signals, factors, strict=True):
        known = np.isfinite(site.variance_error)
        freedom = 2 * (site.variance / max(site.variance_error, 1e-9)) ** 2 if known else 0.0
        banding = (factor - 1) * site.variance_error**2 if known else 0.0
        values = (signal, site.variance, freedom, known, banding, 0.0)
        samples.append(Samples(*(np.array([v]) for v in values)))
    return tuple(samples), levels


def pool(
    burst: TemporalStatistics,
    cfa: str | None,
    black: np.ndarray,
    white_level: int,
    left_out: np.ndarray | None = None,
) -> tuple[Samples, ...]:
    """Pixels of like mean, one `Samples` per site; black: DN of each site. FsidError if the scene moved.

    left_out: (H, W) bool, pixels that are `defective` in the dark.
    """
    return tuple(
        _pool(mean, variance, burst.frames, float(site_black), white_level)
        for (mean, variance), site_black in zip(burst.sites(cfa, left_out), black, strict=True)
    )


def _pool(mean: np.ndarray, variance: np.ndarray, frames: int, black: float, white: int) -> Samples:
    order = np.argsort(mean)
    signal, variance = mean[order] - black, variance[order]
    if signal.size < _MIN_POOL_PIXELS:
        nothing = np.empty(0)
        return Samples(nothing, nothing, nothing, np.empty(0, bool), nothing, nothing)
    starts = _starts(signal, variance, frames, white - black)
    sound = _sound(signal, variance, starts, frames, LINEAR_SHARE * (white - black))
    count = np.add.reduceat(sound, starts, dtype=np.int64)
    full = count >= _MIN_POOL_PIXELS
    fractions = _fractions(signal + black, sound, starts)[full]
    mean, stored = (np.add.reduceat(v * sound, starts)[full] / count[full] for v in (signal, variance))
    level, unclipped, clipped = before_clipping(mean + black, stored, 0, white)
    tau2, slope = before_rounding(unclipped, fractions)
    resolved = (stored > RESOLVED_DN2) | ((tau2 > _LEAST_TAU2) & (slope < _STEEPEST))
    used = (level - black < LINEAR_SHARE * (white - black)) & resolved & (clipped < _LARGEST_CLIPPED_SHARE)
    restored = np.where(resolved, tau2 + ROUNDING_DN2, stored)
    rarity = np.minimum(1, 2 * stored / np.maximum(1 - stored, stored))  # Gaussian against rare steps of 1 DN
    freedom = count[full] * (frames - 1.0) * rarity * (restored / (slope * np.maximum(stored, 1e-9))) ** 2
    towards_light = _towards_light(signal, variance * sound, starts, frames)[full]
    return Samples(level - black, restored, freedom, used, np.zeros(len(level)), towards_light)


def _fractions(level: np.ndarray, sound: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """(pools, PLACES) shares of the sound pixels by the fraction of their `level` in DN."""
    place = (level % 1 * PLACES).astype(np.intp) % PLACES
    pool_of = np.repeat(np.arange(len(starts)), np.diff(starts, append=level.size))
    counts = np.bincount(pool_of * PLACES + place, sound, len(starts) * PLACES).reshape(-1, PLACES)
    return counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)


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
        width = max(
            _POOL_WIDTH * float(np.interp(signal[start], middles, errors)), min(span / _MAX_POOLS, _NARROW_DN)
        )
        end = max(int(np.searchsorted(signal, signal[start] + width)), start + _POOL_PIXELS)
        if end > signal.size - _MIN_POOL_PIXELS:
            return np.array(starts)
        starts.append(end)


def _towards_light(signal: np.ndarray, variance: np.ndarray, starts: np.ndarray, frames: int) -> np.ndarray:
    """What the mean light of each pool's pixels lies above the mean of their ascending `signal`, DN.

    E(light - signal) = s^2 (p(end) - p(start)) / P,      s^2 = variance / frames,  of Gaussian noise

    p: density of signals at the ends of the pool, P: its share (Tweedie's formula, Efron 2011). The pixels of
    the darkest pool are the ones that noise made darkest: they are lighter than they look.
    """
    count = np.diff(starts, append=signal.size)
    error2 = np.add.reduceat(variance, starts) / count / frames
    edges, reach = signal[starts[1:]], np.sqrt((error2[1:] + error2[:-1]) / 8) + 1e-9
    near = np.searchsorted(signal, edges + reach) - np.searchsorted(signal, edges - reach)
    return error2 * np.diff(near / (2 * reach), prepend=0, append=0) / count


def _sound(
    signal: np.ndarray, variance: np.ndarray, starts: np.ndarray, frames: int, limit: float
) -> np.ndarray:
    """(n,) False for pixels that vary more than Gaussian noise of the usual variance at their signal.

    limit: signal beyond which saturation makes any variance; FsidError where too many below it vary.
    """
    ends = [*starts[1:], signal.size]
    medians = [np.median(variance[a:b]) for a, b in zip(starts, ends, strict=True)]
    middles = [signal[a:b].mean() for a, b in zip(starts, ends, strict=True)]
    sound = variance <= _largest(frames) * np.maximum(np.interp(signal, middles, medians), RESOLVED_DN2)
    linear = sound[: np.searchsorted(signal, limit)]
    if linear.size and linear.mean() < 1 - OUTLIER_SHARE:
        raise FsidError(
            f"{100 * (1 - linear.mean()):.0f} % of the pixels vary more than noise does: the scene or the "
            f"camera moved during the burst; use a tripod and a static scene"
        )
    return sound


def _largest(frames: int) -> float:
    """The largest variance that Gaussian noise shows, in medians."""
    half = (frames - 1) / 2  # quantiles of chi-square with frames - 1 degrees of freedom
    return float(gammaincinv(half, 1 - OUTLIER_PROBABILITY) / gammaincinv(half, 0.5))
