"""The paper's sensor model: shot noise grows with the light, read noise does not.

    y = x + sqrt(k x + sigma2) n,     n ~ N(0, 1),     so Var(y) = k x + sigma2   per CFA site

x is the clean normalised signal. This is the heteroscedastic Gaussian limit of a Poisson count plus
Gaussian readout (Foi et al. 2008, eq. 5); the result is neither rounded nor clipped yet.

A profile's sigma2 is that of stored data, as every calibration measures it, and so contains the 1/12 DN^2
that rounding adds. `before_converter` takes that part out; an image that is rounded afterwards then has the
variance of its level, and the level that a file states is the variance of the file.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fsid.errors import FsidError
from fsid.sensor.arrays import check_floating, check_generator
from fsid.sensor.formula import noise_variance, with_noise
from fsid.sensor.gaussian import standard_normal
from fsid.sensor.mosaic import site_offsets
from fsid.sensor.profiles import CameraProfile
from fsid.sensor.quantise import ROUNDING_DN2
from fsid.sensor.raw import NoiseLevel, Raw, check_even, check_level, four

K_JITTER = 0.05  # relative sigma: conversion gain from unit to unit, and vendors' rounding of ISO
_BLOCK_PIXELS = 1 << 17
SIGMA2_JITTER = 0.2  # relative sigma: read noise varies more, with temperature and readout mode


def variance(x: np.ndarray, level: NoiseLevel, cfa: str | None = None) -> np.ndarray:
    """Noise variance `k max(x, 0) + sigma2` of the clean signal x, normalised units, same shape, float32.

    x is packed (4, h, w) in the order R, Gr, Gb, B, or a mosaic (H, W) together with its `cfa`. FsidError
    for anything else, DN among it: `from_dn` makes x of them.
    """
    level.check()
    check_floating(np.asarray(x), "the clean signal")
    x = np.asarray(x, np.float32)
    if cfa is None:
        if x.ndim != 3 or x.shape[0] != 4:
            raise FsidError(f"an image of shape {x.shape} without cfa: give (4, h, w), or (H, W) and its cfa")
        return noise_variance(x, *(np.array(v, np.float32)[:, None, None] for v in (level.k, level.sigma2)))
    check_even(x.shape)
    tiles = x.reshape(-1, 2, x.shape[1])
    return noise_variance(tiles, *_rows(level, cfa, x.shape[1])).reshape(x.shape)


def add_noise(rng: np.random.Generator, raw: Raw, level: NoiseLevel) -> Raw:
    """One exposure of the clean `raw`: its mosaic plus noise of `level`, which the result carries.

    Values may fall below 0 and above 1; `quantise` stores them as the camera would. FsidError for a level
    that is none.
    """
    check_generator(rng)
    check_level(level)
    height, width = raw.mosaic.shape
    rows = _rows(level, raw.cfa, width)
    noisy = np.empty((height // 2, 2, width), np.float32)
    tiles = raw.mosaic.reshape(noisy.shape)
    step = max(1, _BLOCK_PIXELS // (2 * width))  # what a step needs stays in the processor's cache
    for top in range(0, len(tiles), step):
        block = tiles[top : top + step]
        with_noise(block, standard_normal(rng, block.shape), *rows, out=noisy[top : top + step])
    return replace(raw, mosaic=noisy.reshape(height, width), noise=level)


def before_converter(level: NoiseLevel, span: float) -> NoiseLevel:
    """`level` of stored data without the rounding to 1 / span, span = white - black in DN; sigma2 >= 0."""
    level.check()
    rounding = ROUNDING_DN2 / span**2
    return NoiseLevel(k=level.k, sigma2=four(max(value - rounding, 0.0) for value in level.sigma2))


def level_rand(
    rng: np.random.Generator, profile: CameraProfile, iso_range: tuple[float, float]
) -> tuple[float, NoiseLevel]:
    """Draw (ISO, level): ISO log-uniform over `iso_range`, then the profile's level with jitter.

    The jitter is one log-normal factor on k (relative sigma `K_JITTER`) and one on sigma2
    (`SIGMA2_JITTER`), common to all sites: another unit of the same camera at another temperature. sigma2
    stays at or above the rounding noise, which no unit is without. FsidError unless 0 < low <= high.
    """
    low, high = iso_range
    if not 0 < low <= high:
        raise FsidError(f"iso_range ({low}, {high}): give two ISO values, 0 < low <= high")
    iso = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    k_factor, sigma2_factor = np.exp(rng.normal(0.0, (K_JITTER, SIGMA2_JITTER)))
    level, floor = profile.level(iso), ROUNDING_DN2 / profile.span**2
    sigma2 = four(max(value * sigma2_factor, floor) for value in level.sigma2)
    return iso, NoiseLevel(k=four(value * k_factor for value in level.k), sigma2=sigma2)


def _rows(level: NoiseLevel, cfa: str, width: int) -> tuple[np.ndarray, np.ndarray]:
    """k and sigma2 of the two rows of a tile, (2, width) float32 each."""
    rows = np.empty((2, 2, width), np.float32)
    for (r, c), k, sigma2 in zip(site_offsets(cfa), level.k, level.sigma2, strict=True):
        rows[0, r, c::2] = k
        rows[1, r, c::2] = sigma2
    return rows[0], rows[1]
