"""The patches of a dataset at one size of its images, and which of them comes at which place.

    cells of a mosaic of H x W pixels = (H / shrink) // pitch by (W / shrink) // pitch

The cells start elsewhere in every epoch, and those of all mosaics come in a random order (`permutation`). A
cell is one tile larger than a patch, for the shift of a mirrored window.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from statistics import median

import numpy as np

from fsid.dataset.index import StoredMosaic
from fsid.dataset.permutation import mixed, shuffled
from fsid.errors import FsidError

_LEAST_PX = 480
"""Longer side of images made smaller: frames of this size train best (docs/rounds/size-of-frames.md)."""


@dataclass(frozen=True)
class Cell:
    """Where a patch is cut: `side` pixels each way from corner (row, column) of `mosaic` made `shrink` times
    smaller."""

    mosaic: StoredMosaic
    corner: tuple[int, int]
    side: int
    shrink: int

    @property
    def window(self) -> tuple[slice, slice]:
        """Rows and columns of the stored mosaic: whole tiles around the cell."""
        rows, columns = (
            slice(self.shrink * (start - start % 2), self.shrink * (start + self.side + start % 2))
            for start in self.corner
        )
        return rows, columns

    @property
    def corner_inside(self) -> tuple[int, int]:
        """The corner in what lies in the window, made smaller."""
        return self.corner[0] % 2, self.corner[1] % 2


@dataclass(frozen=True, eq=False)
class Grid:
    """The cells of all `mosaics`. size_px: side of a patch in packed pixels. FsidError where one is too small
    for a patch as it is, or all are when made smaller; of these, those that are too small have no cells."""

    mosaics: tuple[StoredMosaic, ...]
    size_px: int
    shrink: int = 1

    def __post_init__(self) -> None:
        fits = self._cells.all(1)
        if fits.all() or (self.shrink > 1 and fits.any()):
            return
        mosaic = self.mosaics[int(np.argmin(fits))]
        needed = self.pitch * self.shrink
        smaller, lower = "", "it"
        if self.shrink > 1:
            smaller, lower = f" to be made {self.shrink} times smaller", "it or shrink"
        raise FsidError(
            f"{mosaic.shard}: {mosaic.key} is {mosaic.width}x{mosaic.height}{smaller}, too small for patches "
            f"of {self.size_px} packed pixels (needs {needed}x{needed}); lower {lower}"
        )

    @property
    def pitch(self) -> int:
        """Pixels from one cell to the next."""
        return 2 * self.size_px + 2

    @property
    def patches(self) -> int:
        """How many an epoch has."""
        return int(self._ends[-1])

    def cell(self, position: int, seed: int) -> Cell:
        """That at a position of the whole training, epoch after epoch."""
        epoch, place = divmod(position, self.patches)
        number = shuffled(place, self.patches, seed, epoch)
        at = int(np.searchsorted(self._ends, number, side="right"))
        mosaic = self.mosaics[at]
        number -= int(self._ends[at - 1]) if at else 0
        chance = mixed(seed, epoch, at)
        corner = []
        for index, size in zip(divmod(number, int(self._cells[at, 1])), self._size(mosaic), strict=True):
            chance, start = divmod(chance, size % self.pitch + 1)
            corner.append(start + index * self.pitch)
        return Cell(mosaic, (corner[0], corner[1]), self.pitch, self.shrink)

    def _size(self, mosaic: StoredMosaic) -> tuple[int, int]:
        """(H, W) made smaller, whole tiles."""
        return mosaic.height // self.shrink // 2 * 2, mosaic.width // self.shrink // 2 * 2

    @cached_property
    def _cells(self) -> np.ndarray:
        """(M, 2) rows and columns of cells."""
        return np.array([self._size(mosaic) for mosaic in self.mosaics]) // self.pitch

    @cached_property
    def _ends(self) -> np.ndarray:
        return np.cumsum(self._cells.prod(1))


def check_shrink(shrink: tuple[int, ...]) -> None:
    """FsidError unless these are different powers of 2."""
    powers = [factor for factor in shrink if factor > 0 and factor & (factor - 1) == 0]
    if len(set(powers)) < len(shrink):
        raise FsidError(f"shrink {list(shrink)}: give different powers of 2, such as [1,2,4]")


def shrink_for(mosaics: Sequence[StoredMosaic], size_px: int) -> tuple[int, ...]:
    """The sizes to draw images at where none are named: 1, 2, 4 ... times smaller, while the longer side of
    most keeps 480 pixels, and all of it as long as patches of `size_px` packed pixels fit."""
    longer = median(max(mosaic.height, mosaic.width) for mosaic in mosaics)
    shorter = median(min(mosaic.height, mosaic.width) for mosaic in mosaics)
    factors = [1]
    while longer >= 2 * factors[-1] * _LEAST_PX and shorter >= 2 * factors[-1] * (2 * size_px + 2):
        factors.append(2 * factors[-1])
    return tuple(factors)
