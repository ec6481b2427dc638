"""The black level of every pixel of a file, in DN, fractions included.

    level[r, c] = tile[r mod rows, c mod columns] + of_row[r] + of_column[c]

The tile is a DNG's BlackLevel, which repeats, the rest its BlackLevelDeltaV and BlackLevelDeltaH, all from
the first pixel of the active area on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

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
        x -= (self.of_row[: len(x), None] * unit).astype(np.float32)
        x -= (self.of_column[: x.shape[1]] * unit).astype(np.float32)
        return x
