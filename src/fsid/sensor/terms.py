"""What real sensors add to the paper's two parameters; each term can be switched on by itself.

    poisson            k Poisson(x / k) instead of sqrt(k x) n: shot noise at a few electrons
    row, column        shares of sigma2 that all pixels of a row or column have in common: banding, of every
                       site in proportion to its own sigma
    tail               excess kurtosis of the pixels' read noise: Student's t, 4 + 6 / tail degrees of freedom
    fixed, prnu        patterns of one unit of the camera: offset in read-noise sigmas, gain relative to 1
    drift              black level from frame to frame, in read-noise sigmas
    dark_current_e_s   electrons per second and pixel: light that is not there, with its own shot noise
    defective          share of pixels that show any value but theirs
    quantisation       False leaves the noisy image unrounded, with the fine levels of a clean one

row, column and tail say how sigma2 is made up, so Var(x) = k x + sigma2 over time holds with them too. fixed,
prnu and defective do not vary over time. `NoiseTerms()` is the paper's model. Each term draws from its own
stream: switching one leaves the others' noise as it was.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from fsid.config import check_fields
from fsid.errors import FsidError
from fsid.sensor.arrays import check_generator
from fsid.sensor.mosaic import site_offsets
from fsid.sensor.poisson import poisson
from fsid.sensor.raw import NoiseLevel, Raw, check_level


@dataclass(frozen=True)
class NoiseTerms:
    """See the module docstring for meaning and units; 0 and False switch a term off.

    FsidError: a term of another type, a negative one, or shares (row + column, defective) of 1 and more.
    """

    poisson: bool = False
    row: float = 0.0
    column: float = 0.0
    tail: float = 0.0
    fixed: float = 0.0
    prnu: float = 0.0
    drift: float = 0.0
    dark_current_e_s: float = 0.0
    defective: float = 0.0
    quantisation: bool = True

    def __post_init__(self) -> None:
        check_fields(self)
        for field in fields(self):
            if not 0 <= getattr(self, field.name) < math.inf:
                raise FsidError(f"{field.name}: {getattr(self, field.name)} is not a number >= 0")
        if self.row + self.column >= 1 or self.defective >= 1:
            raise FsidError("row + column and defective are shares and must stay below 1")


PAPER = NoiseTerms()


def add_noise_terms(
    rng: np.random.Generator,
    raw: Raw,
    level: NoiseLevel,
    terms: NoiseTerms,
    *,
    unit: int = 0,
    exposure_s: float = 0.0,
) -> Raw:
    """One exposure of the clean `raw` at `level` with `terms`, neither rounded nor clipped.

    unit: which specimen of the camera, 0, 1, 2 ...; its fixed patterns. exposure_s: for the dark current.
    FsidError for one below 0, for a level that is none, and counts of electrons with k = 0, which says that
    they are infinitely many.
    """
    check_generator(rng)
    check_level(level)
    if not 0 <= exposure_s < math.inf:
        raise FsidError(f"exposure_s {exposure_s}: must be finite and not negative")
    if unit < 0:
        raise FsidError(f"unit {unit}: must not be negative")
    if terms.poisson and min(level.k) == 0:
        raise FsidError(f"poisson: {level} has a site without shot noise, k = 0; switch the term off")
    # not rng.spawn, which knows nothing of how far the generator is
    shot, pixels, rows, columns, level_drift = map(np.random.default_rng, rng.integers(2**63, size=5))
    shape = raw.mosaic.shape
    k, sigma2 = _site_map(level.k, raw.cfa, shape), _site_map(level.sigma2, raw.cfa, shape)
    light = np.maximum(raw.mosaic, 0)
    if terms.prnu:
        light *= 1 + np.float32(terms.prnu) * _pattern(unit, 0, shape)
    light += k * np.float32(terms.dark_current_e_s * exposure_s)
    np.maximum(light, 0, out=light)  # a strong pattern leaves some pixels without gain, none with less
    if terms.poisson:
        noisy = poisson(shot, light / k).astype(np.float32) * k
    else:
        noisy = light + np.sqrt(k * light) * shot.standard_normal(shape, np.float32)
    noisy += np.minimum(raw.mosaic, 0)
    sigma = np.sqrt(sigma2)
    noisy += sigma * np.float32(np.sqrt(1 - terms.row - terms.column)) * _read(pixels, shape, terms.tail)
    noisy += sigma * np.float32(np.sqrt(terms.row)) * rows.standard_normal((shape[0], 1), np.float32)
    noisy += sigma * np.float32(np.sqrt(terms.column)) * columns.standard_normal((1, shape[1]), np.float32)
    noisy += np.float32(terms.drift * float(sigma.mean()) * level_drift.standard_normal())
    if terms.fixed:
        noisy += np.float32(terms.fixed) * sigma * _pattern(unit, 1, shape)
    if terms.defective:
        broken = np.random.default_rng([unit, 2])
        mask = broken.random(shape, np.float32) < terms.defective
        noisy[mask] = broken.random(int(mask.sum()), np.float32)
    return replace(raw, mosaic=noisy, noise=level)


def parse_terms(data: Any, where: str) -> NoiseTerms:
    """`terms:` of a profile; FsidError names the key that is unknown or out of range."""
    known = {field.name: field.default for field in fields(NoiseTerms)}
    if not isinstance(data, dict):
        raise FsidError(f"{where} must be `term: value` lines; terms are {', '.join(known)}")
    for key, value in data.items():
        if key not in known:
            raise FsidError(f"{where}: unknown term {key}; terms are {', '.join(known)}")
        switch = isinstance(known[key], bool)
        if isinstance(value, bool) != switch or not isinstance(value, int | float) or not 0 <= value < 1e6:
            raise FsidError(f"{where}.{key} must be {'true or false' if switch else 'a number >= 0'}")
    try:
        return NoiseTerms(**data)
    except FsidError as error:
        raise FsidError(f"{where}: {error}") from None


def _read(rng: np.random.Generator, shape: tuple[int, ...], tail: float) -> np.ndarray:
    """Unit-variance read noise of the pixels with the excess kurtosis `tail`."""
    if tail == 0:
        return rng.standard_normal(shape, np.float32)
    freedom = 4 + 6 / tail
    return (rng.standard_t(freedom, shape) * np.sqrt((freedom - 2) / freedom)).astype(np.float32)


def _pattern(unit: int, stream: int, shape: tuple[int, ...]) -> np.ndarray:
    return np.random.default_rng([unit, stream]).standard_normal(shape, np.float32)


def _site_map(values: tuple[float, ...], cfa: str, shape: tuple[int, ...]) -> np.ndarray:
    out = np.empty(shape, np.float32)
    for (r, c), value in zip(site_offsets(cfa), values, strict=True):
        out[r::2, c::2] = value
    return out
