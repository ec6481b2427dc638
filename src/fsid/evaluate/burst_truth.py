"""The truth of a burst: the robust mean of its frames, with its own error bar.

    truth = mean_f clip((x_f - o_f) / g_f),         clip: within 4 sigma of the first mean
    error^2 = sigma^2 / F + error^2(g, o) / 2 + |x_0 - truth|^2 without noise
                                                    half of the second: the noise of the first frame

g_f is the flicker of the light, o_f the drift of the black level; a frame that moved is shifted back where
the shift is a whole number of CFA tiles (`alignment`), and left out where it is not, since interpolating
would blur the truth. By what is left, less than a sixth of a tile or hidden by noise, the first frame lies
beside the truth, which is blurred by it: the third part of the error (`misalignment`). The light that noise
has where DN 0 or the white level cuts it off is taken out (`clipping_bias`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import uniform_filter

from fsid.evaluate.alignment import LEAST_FRAMES, Alignment, Window, align, read_first, too_few
from fsid.evaluate.clipping_bias import unclipped
from fsid.evaluate.misalignment import Departure, misalignment2
from fsid.sensor import Raw, read_raw
from fsid.sensor.dng import read_stored
from fsid.sensor.mosaic import TILE

OUTLIER_SIGMA = 4.0
SPECK_SIGMA = 10.0
"""Of noise: as much a pixel may count for a first frame that lies beside the truth; more is a cosmic ray."""
_PATCH_TILES = 7


@dataclass(frozen=True)
class TruthQuality:
    """How good the truth of one burst is. frames: used; left_out: moved or flickering ones.

    error: standard error of the truth, normalised, of what changes between frames: what all show (defective
    pixels, fixed pattern) counts as scene; psnr: the best RAW PSNR that could be measured against it, dB.
    outliers: share of samples left out. flicker: largest |g - 1|; shift_px: largest shift undone.
    """

    image: str
    level: str
    frames: int
    left_out: int
    error: float
    psnr: float
    outliers: float
    flicker: float
    shift_px: float


def average(
    paths: Sequence[Path], reference: Path, image: str = "", level: str = ""
) -> tuple[Raw, TruthQuality, Window]:
    """The robust mean of the frames at `paths`, aligned with the frame `reference`; reads every file thrice.

    The window is that of `reference` which all frames show; the mean is of it.
    """
    first = read_first(reference)
    every = [align(path, first) for path in paths]
    aligned = [p for p in every if not p.fault]
    if len(aligned) < LEAST_FRAMES:
        raise too_few(reference, every)
    window = _common_window(aligned, first)
    seen = cut(first, window)
    mean = _trimmed_mean(aligned, window, seen, _of_dn_0(reference)[window])
    shared2 = float(np.mean([p.error2 for p in aligned])) / 2
    error = float(np.sqrt(mean.noise2 + shared2 + mean.misalignment2))
    quality = TruthQuality(
        image=image,
        level=level,
        frames=len(aligned),
        left_out=len(paths) - len(aligned),
        error=error,
        psnr=float(-20 * np.log10(max(error, 1e-9))),
        outliers=mean.outliers,
        flicker=max(abs(p.gain - 1) for p in aligned),
        shift_px=float(max(np.hypot(*p.roll) for p in aligned)),
    )
    return replace(seen, mosaic=mean.truth, noise=None), quality, window


@dataclass(frozen=True, eq=False)
class _Mean:
    """truth: (H, W) float32. outliers: share of samples left out. noise2, misalignment2: mean squares of the
    noise that is left in it, and of how far the first frame lies beside it."""

    truth: np.ndarray
    outliers: float
    noise2: float
    misalignment2: float


def _trimmed_mean(aligned: Sequence[Alignment], window: Window, first: Raw, lowest: np.ndarray) -> _Mean:
    """lowest: (H, W) x of DN 0."""
    mean, variance = _moments(aligned, window)
    used, total, square = (np.zeros(mean.shape) for _ in range(3))
    departures = []
    for x in _frames(aligned, window):
        deviation = x - mean
        kept = _is_like_the_others(deviation, variance, len(aligned))
        used += kept
        total += np.where(kept, deviation, 0)
        square += np.where(kept, deviation**2, 0)
        departures.append(Departure.of(np.where(kept, deviation, 0)))
    change = total / np.maximum(used, 1)
    spread = np.where(used > 1, (square - total * change) / np.maximum(used - 1, 1), variance)
    unlike = float(np.mean(spread**2) / max(np.mean(spread) ** 2, 1e-30))
    reach = SPECK_SIGMA * np.sqrt(_mean_of_site(variance))
    off = Departure.of(change)
    others, gains = [departure.less(off) for departure in departures], [p.gain for p in aligned]
    beside = Departure.of((first.mosaic - mean - change).clip(-reach, reach))
    truth, slope = _uncut(mean + change, spread, lowest, first.white_level - first.black_level)
    return _Mean(
        truth=truth.astype(np.float32),
        outliers=float(1 - used.mean() / len(aligned)),
        noise2=float(np.mean(slope**2 * spread / np.maximum(used, 1))),
        misalignment2=misalignment2(beside, others, gains, unlike),
    )


def _uncut(
    mean: np.ndarray, variance: np.ndarray, lowest: np.ndarray, span: int
) -> tuple[np.ndarray, np.ndarray]:
    """(light without what DN 0 and white cut off of its noise, d light / d mean), (H, W) both; from mean and
    variance over frames. The slope is 0 where light is above white, which PSNR does not know."""
    near_dn2 = span**2 * _mean_of_site(variance)
    up_dn, down_dn = span * (mean - lowest), span * (1 - mean)
    light_dn, slope = unclipped(up_dn, _mean_of_site(up_dn), near_dn2)
    shade_dn, slope_at_white = unclipped(down_dn, _mean_of_site(down_dn), near_dn2)
    light = mean + (light_dn - up_dn - shade_dn + down_dn) / span
    return light, slope * np.where(shade_dn < 0, 0, slope_at_white)


def _of_dn_0(path: Path) -> np.ndarray:
    """(H, W) x of DN 0, that of the pixels' own black levels."""
    stored = read_stored(path)
    return stored.black.normalised(np.zeros_like(stored.dn), stored.black_level, stored.white_level)


def _common_window(aligned: Sequence[Alignment], first: Raw) -> Window:
    """Rows and columns of `first` that every frame has once it is put back."""
    height, width = first.mosaic.shape
    rolls = np.array([(0, 0), *(p.roll for p in aligned)])
    (top, left), (bottom, right) = rolls.max(axis=0), rolls.min(axis=0)
    return slice(top, height + bottom), slice(left, width + right)


def cut(raw: Raw, window: Window) -> Raw:
    """The part of an image that lies in a window of it."""
    mosaic = raw.mosaic[window]
    height, width = mosaic.shape
    return replace(raw, mosaic=mosaic, metadata=raw.metadata.within(width, height))


def _frames(aligned: Sequence[Alignment], window: Window) -> Iterator[np.ndarray]:
    """What the frames, in place, have in the window, without flicker and drift."""
    for p in aligned:
        rolled = np.roll(read_raw(p.path).mosaic, p.roll, axis=(0, 1))[window]
        yield (rolled - np.float32(p.offset)) / np.float32(p.gain)


def _moments(aligned: Sequence[Alignment], window: Window) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance over the frames, pixel by pixel (Welford 1962)."""
    mean = square = np.zeros(())
    for count, x in enumerate(_frames(aligned, window), 1):
        delta = x - mean
        mean = mean + delta / count
        square = square + delta * (x - mean)
    return mean, square / (len(aligned) - 1)


def _is_like_the_others(deviation: np.ndarray, variance: np.ndarray, frames: int) -> np.ndarray:
    """Whether a frame, by its deviation from the mean of all, lies where the others do: within OUTLIER_SIGMA
    of their mean, by their spread, since in a short burst an outlier widens that of all beyond itself."""
    share = frames / (frames - 1)
    others = ((frames - 1) * variance - share * deviation**2) / (frames - 2)
    limit = OUTLIER_SIGMA * np.sqrt(_mean_of_site(others))
    return np.asarray(np.sqrt(share) * np.abs(deviation) <= limit + 1e-9)


def _mean_of_site(values: np.ndarray) -> np.ndarray:
    """Averages over neighbours of the same CFA site: a pixel's own variance is from too few frames."""
    out = np.empty_like(values)
    for site in TILE:
        out[site] = uniform_filter(values[site], _PATCH_TILES, mode="reflect")
    return np.maximum(out, 0)
