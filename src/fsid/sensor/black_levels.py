"""The black level of every pixel of a file, in DN, fractions included.

    level[r, c] = tile[r mod rows, c mod columns] + of_row[r] + of_column[c]

The tile is a DNG's BlackLevel, which repeats, the rest its BlackLevelDeltaV and BlackLevelDeltaH, all from
the first pixel of the active area on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fsid.errors import FsidError
from fsid.sensor.mosaic import pack, site_offsets
from fsid.sensor.quantise import from_dn


@dataclass(frozen=True, eq=False)
class BlackLevels:
    """tile: (rows, columns). of_row: (H,), of_column: (W,), for H rows and W columns, or fewer."""

    tile: np.ndarray
    of_row: np.ndarray
    of_column: np.ndarray

    @staticmethod
    def stated(levels: float | Sequence[float], cfa: str | None, where: str) -> BlackLevels:
        """One level of all pixels, or those of R, Gr, Gb, B; FsidError, naming `where`, for other counts."""
        each = np.atleast_1d(np.asarray(levels, np.float64))
        if each.shape not in ((1,), (4,)) or (len(each) == 4 and cfa is None):
            sites = "one, or one each of R, Gr, Gb and B" if cfa else "one"
            raise FsidError(f"{where}: {len(each)} black levels; {sites} is possible")
        if not np.isfinite(each).all():
            raise FsidError(f"{where}: must be numbers")
        tile = np.full((2, 2), each[0])
        for place, level in zip(site_offsets(cfa) if cfa else (), np.broadcast_to(each, 4), strict=False):
            tile[place] = level
        return BlackLevels(tile, np.zeros(2), np.zeros(2))

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
        above = self._above_whole_tiles(black)
        return black + pack(above - np.rint(above), cfa).mean(axis=(1, 2), dtype=np.float64)

    def moved(self, black: int, cfa: str) -> np.ndarray:
        """(4,) mean DN that `levelled` takes off R, Gr, Gb, B."""
        return pack(np.rint(self._above_whole_tiles(black)), cfa).mean(axis=(1, 2), dtype=np.float64)

    def _deltas(self, shape: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        if self.of_row.any() or self.of_column.any():
            return self.of_row[: shape[0]], self.of_column[: shape[1]]
        return np.zeros(shape[0]), np.zeros(shape[1])

    def _above_whole_tiles(self, black: int) -> np.ndarray:
        return self._above(black, (len(self.of_row) // 2 * 2, len(self.of_column) // 2 * 2))

    def _above(self, black: int, shape: tuple[int, ...]) -> np.ndarray:
        rows, columns = (np.arange(side) % n for side, n in zip(shape, self.tile.shape, strict=True))
        above = (self.tile - black).astype(np.float32)[np.ix_(rows, columns)]
        of_row, of_column = self._deltas(shape)
        above += of_row[:, None]
        above += of_column
        return above
