"""Geometric self-ensemble: a mosaic is denoised as it is, mirrored and transposed, and the results averaged.

    clean = 1/n  sum over the first n of the eight symmetries s of a square of  s^-1(denoise(s(noisy)))

A network makes other errors on a mirrored image than on the image itself, though it was trained on both
alike, and what differs averages out (Timofte et al. 2016, "Seven ways to improve example-based single image
super resolution"). A mosaic is turned whole: a mirrored RGGB is a GRBG, and its first row still holds Gr; a
transpose leaves R and B in place and swaps the places of Gr and Gb.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fsid.errors import FsidError
from fsid.sensor.raw import NoiseLevel

_COLUMNS, _ROWS, _TRANSPOSED = 1, 2, 4
_SYMMETRIES = (0, 7, 3, 4, 1, 6, 2, 5)
"""Sets of the three above. The first two and the first four are groups: none of these is special in them."""


def check_ensemble(count: int) -> None:
    """FsidError for another number of copies than 1, 2, 4 and 8."""
    if count not in (1, 2, 4, 8) or isinstance(count, float):
        raise FsidError(f"ensemble {count}: must be 1, 2, 4 or 8 copies of the image")


def self_ensemble(
    mosaic: np.ndarray,
    cfa: str,
    level: NoiseLevel,
    count: int,
    denoised: Callable[[np.ndarray, str, NoiseLevel, int], np.ndarray],
) -> np.ndarray:
    """The mean (H, W) of what denoised(mosaic, cfa, level, i) makes of `count` copies of a mosaic (H, W), the
    i-th of them turned back; the first copy is the mosaic itself."""
    total = denoised(mosaic, cfa, level, 0)
    for i, symmetry in enumerate(_SYMMETRIES[1:count], 1):
        turned_cfa = "".join(_turned(np.array([*cfa]).reshape(2, 2), symmetry).ravel())
        turned_level = level.transposed if symmetry & _TRANSPOSED else level
        total += _turned_back(denoised(_turned(mosaic, symmetry), turned_cfa, turned_level, i), symmetry)
    total *= np.float32(1 / count)
    return total


def _turned(image: np.ndarray, symmetry: int) -> np.ndarray:
    image = image[:, ::-1] if symmetry & _COLUMNS else image
    image = image[::-1] if symmetry & _ROWS else image
    return image.T if symmetry & _TRANSPOSED else image


def _turned_back(image: np.ndarray, symmetry: int) -> np.ndarray:
    image = image.T if symmetry & _TRANSPOSED else image
    image = image[::-1] if symmetry & _ROWS else image
    return image[:, ::-1] if symmetry & _COLUMNS else image
