"""A RAW image: the mosaic, and what one must know to read it.

    x = (DN - black) / (white - black),      Var(x) = k * E(x) + sigma2   per CFA site

Values below black stay negative and nothing is clipped here: a mean over clipped noise is biased, and
the network would learn the bias. Var(x) is that of stored data: rounding is a part of sigma2.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fsid.errors import FsidError, check_kind
from fsid.sensor.metadata import Metadata

CFA_PATTERNS = ("RGGB", "BGGR", "GRBG", "GBRG")


def four(values: Iterable[float]) -> tuple[float, float, float, float]:
    """A number of each CFA site as plain floats; ValueError where they are not four."""
    r, gr, gb, b = (float(value) for value in values)
    return r, gr, gb, b


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

    @property
    def transposed(self) -> NoiseLevel:
        """That of a transposed mosaic: Gr, which shares its row with R, and Gb have changed places."""
        (r, gr, gb, b), (r2, gr2, gb2, b2) = self.k, self.sigma2
        return NoiseLevel((r, gb, gr, b), (r2, gb2, gr2, b2))


@dataclass(frozen=True, eq=False)
class Raw:
    """A Bayer image and its calibration.

    mosaic: (H, W), normalised x, H and W even; kept as float32.
    cfa: 2x2 pattern read row by row, e.g. "GBRG".
    black_level, white_level: DN, one pair for all sites.
    white_balance: gains (r, g, b) with g = 1 that make a grey surface grey in camera RGB
    (the inverse of DNG `AsShotNeutral`).
    xyz_to_camera: (3, 3) DNG `ColorMatrix1` for D65, rows R, G, B.
    iso: 0 where unknown. noise: None where unknown. metadata: of the file it was read from.
    NumPy's numbers become Python's: the square of a uint16 level would wrap around.
    Two are equal (==) where they are one and the same object; NumPy compares what they hold.
    FsidError for what is none of the above, such as a mosaic of integers: `raw_from_dn` makes a Raw of DN,
    with one black level or those of the sites.
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
        if not isinstance(self.mosaic, np.ndarray):
            raise FsidError(f"the mosaic is a {type(self.mosaic).__name__}: give a NumPy array (H, W)")
        check_even(self.mosaic.shape)
        if self.mosaic.dtype.kind != "f":
            raise FsidError(f"the mosaic holds {self.mosaic.dtype}; give x = (DN - black) / (white - black)")
        object.__setattr__(self, "mosaic", np.asarray(self.mosaic, np.float32))
        if self.cfa not in CFA_PATTERNS:
            raise FsidError(f"cfa: {self.cfa!r} is not a Bayer pattern; use one of {', '.join(CFA_PATTERNS)}")
        for name in ("black_level", "white_level", "iso"):
            if isinstance(number := getattr(self, name), np.generic):
                object.__setattr__(self, name, number.item())
        object.__setattr__(self, "white_balance", _gains(self.white_balance))
        self._check_levels()
        if np.shape(self.xyz_to_camera) != (3, 3):
            raise FsidError(f"xyz_to_camera has shape {np.shape(self.xyz_to_camera)}; expected (3, 3)")

        if not isinstance(self.iso, int | float):
            raise FsidError(f"iso {self.iso!r}: must be a number, 0 where it is unknown")

    def _check_levels(self) -> None:
        levels = self.black_level, self.white_level
        if not all(isinstance(level, int | float) for level in levels):
            raise FsidError(
                f"black and white level {levels}: must be one number each; raw_from_dn takes more"
            )
        if not levels[0] < levels[1]:
            raise FsidError(f"black level {levels[0]:g} is not below white level {levels[1]:g}")


def check_raw(raw: object) -> None:
    """FsidError for a path or an array, of which nobody knows how to read it."""
    check_kind(raw, Raw, "read_raw reads one")


def check_level(level: Any) -> None:
    """FsidError for what is no `NoiseLevel`, or a level that is not physical."""
    check_kind(level, NoiseLevel, "that of a profile is profile.level(iso)")
    level.check()


def noise_to_remove(raw: Raw, level: NoiseLevel | None) -> NoiseLevel:
    """`level`, by default that of `raw`, which a denoiser is about to remove.

    FsidError where it is unknown or not physical, and where the mosaic holds NaN or infinity.
    """
    level = level if level is not None else raw.noise
    if level is None:
        raise FsidError(
            "the noise level of this RAW is unknown: give a profile and an ISO (--profile, --iso)"
        )
    check_level(level)
    if not np.all(np.isfinite(raw.mosaic)):
        raise FsidError("this RAW holds NaN or infinity; read it again from its file")
    return level


def _gains(white_balance: Any) -> tuple[float, float, float]:
    """FsidError unless they are three gains above 0."""
    try:
        r, g, b = map(float, white_balance)
        if min(r, g, b) > 0 and math.isfinite(r + g + b):
            return r, g, b
    except (TypeError, ValueError):
        pass
    raise FsidError(f"white_balance {white_balance}: must be three finite gains above 0, of R, G and B")


def check_even(shape: tuple[int, ...]) -> None:
    """FsidError unless `shape` is (H, W) of whole 2x2 tiles."""
    if len(shape) != 2 or shape[0] % 2 or shape[1] % 2 or 0 in shape:
        raise FsidError(f"a Bayer image has an even height and width; got shape {shape}: crop it first")
