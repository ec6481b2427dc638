"""A RAW image: the mosaic, and what one must know to read it.

    x = (DN - black) / (white - black),      Var(x) = k * E(x) + sigma2   per CFA site

Values below black stay negative and nothing is clipped here: a mean over clipped noise is biased, and
the network would learn the bias. Var(x) is that of stored data: rounding is a part of sigma2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fsid.errors import FsidError
from fsid.sensor.metadata import Metadata

CFA_PATTERNS = ("RGGB", "BGGR", "GRBG", "GBRG")


@dataclass(frozen=True)
class NoiseLevel:
    """`k` and `sigma2` of x in normalised units, one per CFA site.

    Site order is always the packed order R, Gr, Gb, B, whatever the camera's CFA.
    """

    k: tuple[float, float, float, float]
    sigma2: tuple[float, float, float, float]

    def check(self) -> None:
        """FsidError unless these are variances of four sites in units of the white level, none beyond it."""
        if np.shape(self.k) != (4,) or np.shape(self.sigma2) != (4,):
            raise FsidError(f"{self}: needs four values each, for the sites R, Gr, Gb, B")
        if not all(0 <= value <= 1 for value in (*self.k, *self.sigma2)):
            raise FsidError(
                f"{self}: k and sigma2 are variances in units of the white level; 0 to 1 is possible: divide "
                "k in DN by white - black, sigma2 in DN^2 by its square"
            )


@dataclass(frozen=True, eq=False)
class Raw:
    """A Bayer image and its calibration.

    mosaic: (H, W) float32, normalised x, H and W even. cfa: 2x2 pattern read row by row, e.g. "GBRG".
    black_level, white_level: DN, one pair for all sites.
    white_balance: gains (r, g, b) with g = 1 that make a grey surface grey in camera RGB
    (the inverse of DNG `AsShotNeutral`).
    xyz_to_camera: (3, 3) DNG `ColorMatrix1` for D65, rows R, G, B.
    iso: 0 where unknown. noise: None where unknown. metadata: of the file it was read from.
    NumPy's numbers become Python's: the square of a uint16 level would wrap around.
    Two are equal (==) where they are one and the same object; NumPy compares what they hold.
    FsidError for a mosaic of another shape, or of integers: `from_dn` makes x of DN.
    """

    mosaic: np.ndarray
    cfa: str
    black_level: int
    white_level: int
    white_balance: tuple[float, float, float]
    xyz_to_camera: np.ndarray
    camera: str = "unknown"
    iso: float = 0.0
    noise: NoiseLevel | None = None
    metadata: Metadata = Metadata()  # noqa: RUF009  frozen

    def __post_init__(self) -> None:
        check_even(self.mosaic.shape)
        if isinstance(self.mosaic, np.ndarray) and self.mosaic.dtype.kind != "f":
            raise FsidError(f"the mosaic holds {self.mosaic.dtype}; give x = (DN - black) / (white - black)")
        for name in ("black_level", "white_level", "iso"):
            if isinstance(number := getattr(self, name), np.generic):
                object.__setattr__(self, name, number.item())


def check_even(shape: tuple[int, ...]) -> None:
    """FsidError unless `shape` is (H, W) of whole 2x2 tiles."""
    if len(shape) != 2 or shape[0] % 2 or shape[1] % 2 or 0 in shape:
        raise FsidError(f"a Bayer image has an even height and width; got shape {shape}: crop it first")
