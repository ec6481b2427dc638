"""How light and black level changed between two frames of one scene, from the means of blocks.

    change = (gain - 1) reference + offset + noise

Block means hardly hold noise, and lamp and black level are told apart where blocks differ in light. Gain and
offset count only where they exceed `SIGNIFICANT` standard errors, so that steady light is left alone. A
block's error allows for rows and columns that have a tenth of the noise in common.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fsid.sensor.quantise import ROUNDING_DN2

SIGNIFICANT = 5.0  # standard errors: of 64 blocks in 1,000 frames none deviates so far by chance
MIN_BLOCKS = 4  # to tell gain from offset
MAX_CLIPPED_SHARE = 0.01  # of a block that still tells the light
_BANDING = 0.1  # of the noise that rows or columns may have in common
_GRID = 8
_MIN_SIDE_PX = 8
_MIN_CONTRAST = 100.0  # variance between blocks over their noise; below it the gain is drowned


@dataclass(frozen=True)
class Blocks:
    """At most 8 x 8 equal parts of an image: grid (rows, columns) of blocks of size (height, width) px."""

    grid: tuple[int, int]
    size: tuple[int, int]

    @staticmethod
    def of(shape: tuple[int, ...]) -> Blocks:
        """Those of an image (H, W); even sides, where there is more than one pixel."""
        rows, columns = (max(1, min(_GRID, side // _MIN_SIDE_PX)) for side in shape)
        height, width = shape[0] // rows, shape[1] // columns
        return Blocks((rows, columns), (max(height // 2 * 2, 1), max(width // 2 * 2, 1)))

    def reduce(self, image: np.ndarray, reduction: Callable[..., np.ndarray]) -> np.ndarray:
        """(rows, columns) of `reduction` over each block; what does not fill a block is left out."""
        (rows, columns), (height, width) = self.grid, self.size
        tiles = image[: height * rows, : width * columns].reshape(rows, height, columns, width)
        return reduction(tiles, axis=(1, 3))

    def noise(self, change: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(rows, columns) each, DN^2: variance of a pixel's `change`, and of the mean of a block."""
        pixel = np.maximum(self.reduce(change, np.var), ROUNDING_DN2)
        height, width = self.size
        return pixel, pixel * (1 / (height * width) + _BANDING / min(height, width))


def gain_and_offset(change: np.ndarray, reference: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """Weighted line through the change of block means over their level, twice: what moved counts once.

    change, reference: (n,) DN. weight: (n,) 1 / DN^2. The gain is 1 where it or the contrast is too small.
    """
    slope, level = _line(change, reference, weight)
    z2 = weight * (change - slope * reference - level) ** 2
    still = z2 <= max(SIGNIFICANT**2, 9 * float(np.median(z2)))
    slope, level = _line(change[still], reference[still], weight[still])
    return 1.0 + slope, level


def tells_gain(reference: np.ndarray, weight: np.ndarray) -> bool:
    """Whether blocks differ enough in light to tell another gain from an offset."""
    return _spread(reference, weight)[1] > _MIN_CONTRAST * len(reference)


def line_error2(reference: np.ndarray, weight: np.ndarray, at: np.ndarray) -> float:
    """Mean over `at`, light in DN of any shape, of the squared standard error of the line there, DN^2."""
    middle, spread = _spread(reference, weight)
    return float(1 / weight.sum() + np.mean((at - middle) ** 2) / spread)


def _line(change: np.ndarray, reference: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """(slope, intercept); 0 where they are not significant, or the slope where the contrast is too small."""
    total = weight.sum()
    middle, spread = _spread(reference, weight)
    level = float((weight * change).sum() / total)
    slope = 0.0
    if tells_gain(reference, weight):
        slope = float((weight * (reference - middle) * change).sum() / spread)
    if abs(slope) * np.sqrt(spread) < SIGNIFICANT:
        slope = 0.0
    if slope == 0.0 and abs(level) * np.sqrt(total) < SIGNIFICANT:
        level = 0.0
    return slope, level - slope * middle


def _spread(reference: np.ndarray, weight: np.ndarray) -> tuple[float, float]:
    """Weighted mean of the light of the blocks, and their weighted squares about it."""
    middle = float((weight * reference).sum() / weight.sum())
    return middle, float((weight * (reference - middle) ** 2).sum())
