"""The black level of every pixel of a file, in DN, fractions included.

    level[r, c] = tile[r mod rows, c mod columns] + of_row[r] + of_column[c]

The tile is a DNG's BlackLevel, which repeats, the rest its BlackLevelDeltaV and BlackLevelDeltaH, all from
the first pixel of the active area on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fsid.sensor.mosaic import pack
from fsid.sensor.quantise import from_dn


@dataclass(frozen=True, eq=False)
class BlackLevels:
    """tile: (rows, columns). of_row: (H,), of_column: (W,), for H rows and W columns, or fewer."""

    tile: np.ndarray
    of_row: np.ndarray
    of_column: np.ndarray

    def mean(self) -> float:
        """Mean over the image, as near as whole tiles are."""
        return float(self.tile.mean() + self.of_row.mean() + self.of_column.mean())

    def normalised(self, dn: np.ndarray, black: int, white: int) -> np.ndarray:
        """(H, W) float32 x of stored integers: each above its own level, in units of white - black."""
        x = from_dn(dn, black, white)
        unit = 1 / (white - black)
        rows, columns = self.tile.shape
        for (r, c), level in np.ndenumerate(self.tile):
            x[r::rows, c::columns] -= np.float32((level - black) * unit)
        of_row, of_column = self._deltas(x.shape)
        x -= (of_row[:, None] * unit).astype(np.float32)
        x -= (of_column * unit).astype(np.float32)
        return x

    def levelled(self, dn: np.ndarray, black: int, white: int) -> np.ndarray:
        """(H, W) uint16: the stored integers, each moved by as many whole DN as its level is off `black`.

        Fractions of a DN stay: rounded once more, integers would fall together. 0 and white stay too.
        """
        above = np.rint(self._above(black, dn.shape))
        moved = np.where((dn > 0) & (dn < white), dn - above, dn)
        return np.clip(moved, 0, white).astype(np.uint16)

    def of_sites(self, black: int, cfa: str) -> np.ndarray:
        """(4,) mean black level that `levelled` leaves R, Gr, Gb, B, fractions included."""
        height, width = len(self.of_row) // 2 * 2, len(self.of_column) // 2 * 2
        above = self._above(black, (height, width))
        return black + pack(above - np.rint(above), cfa).mean(axis=(1, 2), dtype=np.float64)

    def fits(self, shape: tuple[int, ...]) -> bool:
        """Whether an image of another size (H, W) has these levels, too."""
        within = shape[0] <= len(self.of_row) and shape[1] <= len(self.of_column)
        return within or not (self.of_row.any() or self.of_column.any())

    def _deltas(self, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        if self.of_row.any() or self.of_column.any():
            return self.of_row[: shape[0]], self.of_column[: shape[1]]
        return np.zeros(shape[0]), np.zeros(shape[1])

    def _above(self, black: int, shape: tuple[int, ...]) -> np.ndarray:
        rows, columns = (np.arange(side) % n for side, n in zip(shape, self.tile.shape, strict=True))
        above = (self.tile - black).astype(np.float32)[np.ix_(rows, columns)]
        of_row, of_column = self._deltas(shape)
        above += of_row[:, None]
        above += of_column
        return above
