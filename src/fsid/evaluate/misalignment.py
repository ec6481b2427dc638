"""How far the first frame of a burst lies beside its truth, by what frames show together.

    x_f - truth = change_f + noise_f,      C_fg = mean over pixels of (x_f - truth) (x_g - truth)
                                           C = S + v 1,    S_00 = mean change_0^2

The noise of two frames is independent, so the eigenvalues of C by noise alone end at v (1 + sqrt(F / N))^2
(Marchenko & Pastur 1967). A hand that trembles or a tripod that sinks moves the edges of one picture, however
fine they are, so that a few eigenvectors, with eigenvalues far above that end, hold all of it. (The gradient
of the truth shows too little of it: text is finer than the pixels of a site.) A first frame that differs from
the others in its own way is an eigenvector by itself.

The means of rows and columns are measured apart: without them, shifts of single pixels show more clearly. The
noise that a row has in common is independent from frame to frame; the flicker of a lamp in a rolling shutter
is not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fsid.evaluate.alignment import unbanded
from fsid.sensor.mosaic import TILE

_PIXELS = 200_000
"""At most, of each frame: the end of the noise is then within 4 % of v for 50 frames."""
_BEYOND = 2.0
"""Times the square root above: pixels of other noise than the rest, and frames of other light, widen it."""

_SITES = 2.0
"""In which a row is, or a column, and its noise is the same."""


@dataclass(frozen=True, eq=False)
class Departure:
    """A frame less the truth: (n,) pixels without what their rows and columns have in common, and that of
    rows and of columns without the mean of all. Their mean squares add up to that of the frame."""

    pixels: np.ndarray
    rows: np.ndarray
    columns: np.ndarray

    @staticmethod
    def of(frame: np.ndarray) -> Departure:
        """Of a frame less the truth (H, W)."""
        sites = [frame[site] for site in TILE]
        pixels = np.concatenate([unbanded(site).ravel() for site in sites])
        rows, columns = (
            np.concatenate([site.mean(axis=axis) - site.mean() for site in sites]) for axis in (1, 0)
        )
        return Departure(pixels[:: -(-pixels.size // _PIXELS)].astype(np.float32), rows, columns)

    def less(self, other: Departure) -> Departure:
        """That of a truth which departs from this one's by `other`."""
        return Departure(self.pixels - other.pixels, self.rows - other.rows, self.columns - other.columns)


def misalignment2(
    first: Departure, others: Sequence[Departure], gains: Sequence[float], spread: float
) -> float:
    """Mean square by which the first frame lies beside the mean of the F >= 3 others, without noise.

    gains: what the others were divided by. spread: mean square of the noise variance of the pixels, over the
    square of its mean: 1 where all have the same.
    """
    light = np.log(gains)
    return (
        _misalignment2(first.pixels, [other.pixels for other in others], light, spread)
        + _misalignment2(first.rows, [other.rows for other in others], light, _SITES)
        + _misalignment2(first.columns, [other.columns for other in others], light, _SITES)
    )


def _misalignment2(
    first: np.ndarray, others: Sequence[np.ndarray], light: np.ndarray, spread: float
) -> float:
    count = len(others)
    share = (count + 1) / count  # of noise, and of what first and mean differ by: the mean has some, too
    frames = np.stack([first / np.float32(np.sqrt(share)), *others])
    frames[1:] *= _of_like_noise(frames[1:], light)[:, None]
    values, vectors = np.linalg.eigh((frames @ frames.T).astype(np.float64) / first.size)
    noise2 = values[1 + count // 4]  # the least is 0: the others' deviations from their mean add up to it
    end = noise2 * (1 + _BEYOND * np.sqrt(count * spread / first.size)) ** 2
    seen = values > end
    return share * float((values[seen] - noise2) @ vectors[0, seen] ** 2)


def _of_like_noise(frames: np.ndarray, light: np.ndarray) -> np.ndarray:
    """(F,) what frames divided by their gain have to be multiplied by to have the noise of the first one.

    light: log of the gain, whose inverse the variance of shot noise falls with, that of read noise with its
    square.
    """
    other = light - light.mean()
    falls = float(other @ np.log(np.maximum(np.mean(frames**2, axis=1), 1e-30)))
    power = min(max(-falls / max(float(other @ other), 1e-30), 1.0), 2.0)
    return np.asarray(np.exp(power / 2 * light), np.float32)
