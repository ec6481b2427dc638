"""Red and blue of more, or less, contrast than green, as film and the rendering of most pictures have them.

    R' = R (R / median R)^red,      B' = B (B / median B)^blue

An exponent of 0 leaves a colour as it is; above 0 dark parts turn greener and light ones more magenta
("crossover" of colour film). docs/rounds.md has by how much photographs do, and what a denoiser makes of it.
"""

from __future__ import annotations

import numpy as np

from fsid.scene.model import Camera

_STRIDE = 4
_DARKEST = np.float32(1e-4)
"""Relative to the median: darker parts take the factor of this, so that black stays finite."""


def set_colour_contrast(radiance: np.ndarray, camera: Camera) -> None:
    """Give red and blue of `radiance` (H, W, 3), linear RGB >= 0, the camera's contrast: in place.

    The median is taken over every fourth pixel both ways. A colour whose median is 0 is left alone.
    """
    for colour, extra in zip((0, 2), camera.colour_contrast, strict=True):
        light = radiance[..., colour]
        middle = np.median(light[::_STRIDE, ::_STRIDE])
        if extra and middle > 0:
            light *= np.maximum(light / middle, _DARKEST) ** np.float32(extra)
