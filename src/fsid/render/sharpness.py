"""How sharp a picture is: radiance behind the point spread of the lens, and sharpened.

    softened  = G(softness_px) * radiance,      G a Gaussian, the usual model of aberrations, diffraction and
                                                low-pass filter together
    sharpened = softened + sharpening (softened - G(1 px) * softened),      within half of softened

A box over the pixel damps detail of three to eight pixels and lets finer detail through, which aliases:
colours that are sampled side by side then differ where there is no colour. Pictures that have been reduced in
size and sharpened, as published photographs have, are the other way round. docs/rounds.md has what a
denoiser makes of either.
"""

from __future__ import annotations

import numpy as np

from fsid.render.blur import blurred, gaussian_reach, gaussian_weights
from fsid.scene.model import Camera

_STRIP = 32  # rows
_SHARPENED_PX = 1.0
_MOST = 0.5
"""Of its own light a pixel gains or loses so much at most, so that lamps have no black rings."""


def set_sharpness(radiance: np.ndarray, camera: Camera) -> None:
    """Make `radiance` (H, W, 3) as soft and as sharpened as the camera's pictures are: in place, strip by
    strip, since a frame needs the most memory about here."""
    if camera.softness_px == camera.sharpening == 0:
        return
    beyond = gaussian_reach(camera.softness_px) + gaussian_reach(_SHARPENED_PX)
    rows = max(_STRIP, 4 * beyond)
    above = radiance[:0]  # what the next strip sees of the rows before it, as they were
    for first in range(0, len(radiance), rows):
        strip = np.concatenate([above, radiance[first : first + rows + beyond]])
        start, stop = len(above), min(len(above) + rows, len(strip))
        sharp = sharpen(soften(strip, camera.softness_px), camera.sharpening)
        radiance[first : first + rows] = sharp[start:stop]
        above = strip[max(stop - beyond, 0) : stop]


def soften(radiance: np.ndarray, softness_px: float) -> np.ndarray:
    """`radiance` (H, W, ...) through a Gaussian of standard deviation `softness_px` pixels; 0 leaves it."""
    return blurred(radiance, gaussian_weights(softness_px)) if softness_px > 0 else radiance


def sharpen(radiance: np.ndarray, amount: float) -> np.ndarray:
    """`radiance` (H, W, ...), 0 or more, by unsharp masking; amount 0 leaves it."""
    if amount == 0:
        return radiance
    detail = soften(radiance, _SHARPENED_PX)
    np.subtract(radiance, detail, out=detail)
    detail *= np.float32(amount)
    most = np.float32(_MOST) * radiance
    np.minimum(detail, most, out=detail)  # np.clip of arrays takes four times as long
    np.negative(most, out=most)
    np.maximum(detail, most, out=detail)
    detail += radiance
    return detail
