"""How sharp a camera's image is: its radiance behind the point spread of the lens, and sharpened.

    softened  = G(softness_px) * radiance,     G a Gaussian, the usual model of aberrations, diffraction and
                                               low-pass filter together
    sharpened = softened + sharpening (softened - G(1.2 px) * softened),     within a factor of softened

Photographs are seldom just as sharp as their pixels. Some are softer: a denoiser trained on nothing but
pixel-sharp renders keeps noise of the highest frequencies, because it takes it for detail. Most published
ones have been sharpened, and keep detail that a box filter over the pixel has damped (docs/results.md).
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from fsid.scene.model import Camera

_TRUNCATE = 3.0  # standard deviations; beyond lie 0.3 % of the light
_SHARPENED_PX = 1.2
_MOST = 1.6
"""Sharpened light stays within this factor of what it was: no dark rings around lamps."""


def focused(radiance: np.ndarray, camera: Camera) -> np.ndarray:
    """`radiance` (H, W, 3) as soft and as sharpened as the camera's images are."""
    return sharpen(soften(radiance, camera.softness_px), camera.sharpening)


def soften(radiance: np.ndarray, softness_px: float) -> np.ndarray:
    """`radiance` (H, W, 3) through a Gaussian of standard deviation `softness_px` pixels; 0 leaves it."""
    for axis in (0, 1) if softness_px > 0 else ():
        radiance = gaussian_filter1d(radiance, softness_px, axis=axis, mode="nearest", truncate=_TRUNCATE)
    return radiance


def sharpen(radiance: np.ndarray, amount: float) -> np.ndarray:
    """`radiance` (H, W, 3) >= 0 by unsharp masking; 0 leaves it."""
    if amount == 0:
        return radiance
    detail = radiance - soften(radiance, _SHARPENED_PX)
    return np.clip(radiance + np.float32(amount) * detail, radiance / _MOST, radiance * _MOST)
