"""What FSID knows of one camera, in memory; `profiles` reads and writes it.

    Var(x) = k x + sigma2,      x = (DN - black) / span,      span = white - black

k and sigma2 stand here as they were measured or published; `iso_law` turns them into a physical level at
any ISO. sigma2 is the variance of stored data: the 1/12 DN^2 of rounding is a part of it.
"""

from __future__ import annotations

import operator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from fsid.errors import FsidError
from fsid.sensor.iso_law import IsoCurve, k_curve, sigma2_curve
from fsid.sensor.quantise import ROUNDING_DN2
from fsid.sensor.raw import NoiseLevel, four
from fsid.sensor.terms import PAPER, NoiseTerms

MONO = "MONO"  # stands in `cfa` for a sensor without colour filters; its four sites are alike


@dataclass(frozen=True, eq=False)
class Measurement:
    """How sure the levels are, one row per ISO: standard errors (n, 4), black level (n, 4) in DN, frames."""

    k_error: np.ndarray
    sigma2_error: np.ndarray
    black: np.ndarray
    frames: tuple[int, ...]
    dark_frames: tuple[int, ...]


@dataclass(frozen=True)
class Optics:
    """What decides how many electrons a lux makes; see `light` for the assumed defaults.

    pixel_pitch_um: of the stored pixel, that is after binning. quantum_efficiency: electrons per photon of
    400-700 nm at a green pixel, filter included.
    """

    f_number: float
    pixel_pitch_um: float
    quantum_efficiency: float = 0.28
    transmittance: float = 0.9


@dataclass(frozen=True, eq=False)
class CameraProfile:
    """One camera.

    cfa: Bayer pattern, or "MONO". black_level, white_level: DN; bits: of the stored integer. iso: (n,)
    ascending. k, sigma2: (n, 4) float64, sites R, Gr, Gb, B, normalised units, as measured or published;
    sigma2 may be impossible here, but not in what `level` returns.
    xyz_to_camera: (m, 3, 3) matrices for D65 (DNG `ColorMatrix1`); `colour.colour_rand` blends them.
    date: of the data. measured: None where the source states no errors. terms: beyond the paper's model.
    optics: None where unknown. Two are equal (==) where they are one and the same object.
    Lists become arrays. FsidError for tables of another shape, ISOs that do not rise, and variances in DN.
    """

    name: str
    camera: str
    cfa: str
    black_level: int
    white_level: int
    bits: int
    iso: tuple[float, ...]
    k: np.ndarray
    sigma2: np.ndarray
    xyz_to_camera: np.ndarray
    source: str = ""
    notes: str = ""
    date: str = ""
    measured: Measurement | None = None
    terms: NoiseTerms = PAPER
    optics: Optics | None = None

    def __post_init__(self) -> None:
        for name in ("k", "sigma2", "xyz_to_camera"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), np.float64))
        for name in ("black_level", "white_level", "bits"):
            object.__setattr__(self, name, operator.index(getattr(self, name)))
        object.__setattr__(self, "iso", tuple(np.asarray(self.iso).tolist()))
        where, shape = f"profile {self.name}", (len(self.iso), 4)
        if not self.iso or self.k.shape != shape or self.sigma2.shape != shape:
            raise FsidError(
                f"{where}: k {self.k.shape} and sigma2 {self.sigma2.shape} must be {shape}: ISO, site"
            )
        if self.iso[0] <= 0 or any(b <= a for a, b in pairwise(self.iso)):
            raise FsidError(f"{where}: ISOs must rise and be above 0; got {self.iso}")
        if not (self.k.max() <= 1 and self.sigma2.max() < ROUNDING_DN2):  # in DN^2 it could not be less
            raise FsidError(
                f"{where}: k up to {self.k.max():g}, sigma2 up to {self.sigma2.max():g}: divide k in DN by "
                f"white - black, sigma2 in DN^2 by its square, {self.span**2}"
            )
        if self.xyz_to_camera.shape[1:] != (3, 3):
            raise FsidError(
                f"{where}: xyz_to_camera has shape {self.xyz_to_camera.shape}; expected (m, 3, 3)"
            )

    @property
    def span(self) -> int:
        """DN from black to white."""
        return self.white_level - self.black_level

    def level(self, iso: float) -> NoiseLevel:
        """Noise at any ISO > 0, continuous in ISO; see `iso_law` for what is believed where.

        FsidError: an ISO that is none, or one of so much noise that its variance is beyond the white level.
        """
        if not (np.isfinite(iso) and iso > 0):
            raise FsidError(f"profile {self.name}: ISO {iso} is not a positive number")
        k, sigma2 = (curve(iso) for curve in self.curves)
        if max(k.max(), sigma2.max()) > 1:
            raise FsidError(
                f"profile {self.name}: ISO {iso:g} is too high: k would be {k.max():.2g} and sigma2 "
                f"{sigma2.max():.2g}, where 1 is the white level"
            )
        return NoiseLevel(k=four(k), sigma2=four(sigma2))

    @cached_property
    def curves(self) -> tuple[IsoCurve, IsoCurve]:
        """k and sigma2 over ISO."""
        iso, floor = np.array(self.iso), ROUNDING_DN2 / self.span**2
        if self.measured is None:
            return k_curve(iso, self.k), sigma2_curve(iso, self.sigma2, floor)
        return (
            k_curve(iso, self.k, self.measured.k_error),
            sigma2_curve(iso, self.sigma2, floor, self.measured.sigma2_error),
        )
