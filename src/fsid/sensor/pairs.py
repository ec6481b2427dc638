"""A clean RAW and the noisy one that the camera would have stored.

    frame or photo -> camera RGB in 0..1 -> mosaic = clean,     noisy = Q(clean + sqrt(k clean + s2) n)

Q rounds and clips like the camera, and s2 is sigma2 without what Q adds: Var(noisy) = k clean + sigma2.
Colour, exposure and noise are drawn here, from the generator that the caller gives. The clean image is
neither rounded nor noisy.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from fsid.errors import FsidError, check_kind
from fsid.sensor.arrays import check_generator
from fsid.sensor.colour import colour_rand
from fsid.sensor.exposure import expose
from fsid.sensor.mosaic import mosaic
from fsid.sensor.noise import add_noise, before_converter
from fsid.sensor.profiles import CameraProfile
from fsid.sensor.quantise import clean_levels, quantise
from fsid.sensor.raw import NoiseLevel, Raw, check_level
from fsid.sensor.terms import PAPER, NoiseTerms, add_noise_terms
from fsid.sensor.unprocess import check_linear, check_srgb, linear_to_camera, unprocess

if TYPE_CHECKING:  # RAW files are read and developed on machines without a graphics library
    from fsid.render.frame import Frame

PHOTO_EXPOSURE_MEAN = 0.8  # Brooks et al. 2019: brightness gain is 1 / N(0.8, 0.1)
PHOTO_EXPOSURE_SIGMA = 0.1
PHOTO_EXPOSURE_RANGE = (0.5, 1.1)
_STRIP = 32  # rows at once, an even number: what is in between stays in the cache


def clean_from_frame(rng: np.random.Generator, frame: Frame, profile: CameraProfile) -> Raw:
    """Expose a rendered frame with a random auto-exposure; see `clean_from_linear`."""
    _check_given(rng, profile)
    return clean_from_linear(rng, expose(rng, frame.radiance), profile)


def clean_from_linear(
    rng: np.random.Generator,
    linear_srgb: np.ndarray,
    profile: CameraProfile,
    exposure: np.ndarray | float = 1.0,
) -> Raw:
    """Linear light (H, W, 3) seen through random colour of `profile`: float Raw in 0..1.

    exposure: what takes the light, or each of its three colours, to units of saturation. An odd last row or
    column is dropped. FsidError for another shape, integers, NaN and infinity in either, and for an exposure
    below 0.
    """
    _check_given(rng, profile)
    check_linear(linear_srgb)
    if not (np.isfinite(exposure).all() and np.min(exposure) >= 0):
        raise FsidError(f"the exposure of linear light must be finite and not negative; got {exposure}")
    matrix, gains = colour_rand(rng, profile.xyz_to_camera)
    image = _even(linear_srgb)
    # NumPy takes eight times as long for three numbers per pixel as for a row of them.
    row = np.ones((image.shape[1], 3), np.float32)
    light, white_balance = row * exposure, row * np.asarray(gains, np.float32)
    x = np.empty(image.shape[:2], np.float32)
    for first in range(0, len(image), _STRIP):
        rows = slice(first, first + _STRIP)
        x[rows] = mosaic(linear_to_camera(image[rows] * light, matrix, white_balance), profile.cfa)
    return _raw(x, matrix, gains, profile)


def clean_from_photo(rng: np.random.Generator, srgb: np.ndarray, profile: CameraProfile) -> Raw:
    """Unprocess a photo (H, W, 3), sRGB-encoded 0..1, with random colour and exposure: float Raw in 0..1.

    An odd last row or column is dropped. FsidError for what is no such photo.
    """
    _check_given(rng, profile)
    check_srgb(srgb)
    matrix, gains = colour_rand(rng, profile.xyz_to_camera)
    exposure = float(np.clip(rng.normal(PHOTO_EXPOSURE_MEAN, PHOTO_EXPOSURE_SIGMA), *PHOTO_EXPOSURE_RANGE))
    camera = unprocess(_even(srgb), matrix, gains, exposure)
    return _raw(mosaic(camera, profile.cfa), matrix, gains, profile)


def noisy_from_clean(
    rng: np.random.Generator,
    clean: Raw,
    iso: float,
    level: NoiseLevel,
    terms: NoiseTerms = PAPER,
    *,
    unit: int = 0,
    exposure_s: float = 0.0,
) -> Raw:
    """One stored exposure of `clean` at `level`: noise, then the camera's own rounding and clipping.

    clean: with the camera's levels, to which it is rounded; those of a clean DNG are finer, see
    `clean_levels`. Where the terms leave out rounding, the result has these, and a file hardly rounds it.
    terms, unit, exposure_s: what the camera does beyond the paper's model; see `terms`.
    """
    check_generator(rng)
    check_level(level)
    injected = before_converter(level, clean.white_level - clean.black_level) if terms.quantisation else level
    if terms == PAPER:
        noisy = add_noise(rng, clean, injected)
    else:
        noisy = add_noise_terms(rng, clean, injected, terms, unit=unit, exposure_s=exposure_s)
    return replace(quantise(noisy) if terms.quantisation else clean_levels(noisy), iso=iso, noise=level)


def _check_given(rng: object, profile: object) -> None:
    """FsidError for a seed in place of a generator, and for the name of a profile."""
    check_generator(rng)
    check_kind(profile, CameraProfile, "load_profile reads one by its name")


def _raw(x: np.ndarray, matrix: np.ndarray, gains: tuple[float, float, float], profile: CameraProfile) -> Raw:
    return Raw(
        mosaic=x,
        cfa=profile.cfa,
        black_level=profile.black_level,
        white_level=profile.white_level,
        white_balance=gains,
        xyz_to_camera=matrix,
        camera=profile.camera,
    )


def _even(image: np.ndarray) -> np.ndarray:
    height, width = image.shape[:2]
    return image[: height - height % 2, : width - width % 2]
