"""From a picture back to the light on the sensor, and forward again.

    photo:     camera = G(M e^-1(s^-1(srgb)))
    radiance:  camera = clip(M radiance / white_balance)

e is the sRGB curve, s the tone curve, M the linear sRGB -> camera matrix, G the division by the white-balance
gains. A photo's white is already clipped, and dividing it would leave grey-pink highlights that no
sensor produces; G therefore fades the division out as a pixel approaches white (Brooks et al. 2019,
eq. 2 and 3). A rendered frame has unbounded highlights and no curve to invert: its path is exactly linear,
and the sensor clips it where its own channels saturate.
"""

from __future__ import annotations

import numpy as np

from fsid.errors import FsidError
from fsid.sensor.colour import apply_matrix, camera_to_srgb_matrix, srgb_to_camera_matrix
from fsid.sensor.tone import inverse_tone_curve, srgb_decode, srgb_encode, tone_curve

HIGHLIGHT_INFLECTION = 0.9  # t of Brooks et al. 2019, eq. 2: where highlight preservation sets in


def unprocess(
    srgb: np.ndarray,
    xyz_to_camera: np.ndarray,
    white_balance: tuple[float, float, float],
    exposure: float = 1.0,
) -> np.ndarray:
    """Photo (H, W, 3), sRGB-encoded 0..1, to linear camera RGB (H, W, 3) float32 0..1 before white balance.

    exposure multiplies the light (1 / rgb gain of Brooks et al.); white stays at saturation whatever it is.
    """
    check_srgb(srgb)
    linear = srgb_decode(inverse_tone_curve(srgb))
    camera = apply_matrix(srgb_to_camera_matrix(xyz_to_camera), linear)
    gains = np.float32(exposure) / np.asarray(white_balance, np.float32)
    grey = camera.mean(axis=-1, keepdims=True)
    white = np.maximum(grey - HIGHLIGHT_INFLECTION, 0) / np.float32(1 - HIGHLIGHT_INFLECTION)
    white *= white
    camera *= np.maximum(white + (1 - white) * gains, gains)
    return np.clip(camera, 0, 1, out=camera)


def process(
    camera: np.ndarray,
    xyz_to_camera: np.ndarray,
    white_balance: tuple[float, float, float],
    exposure: float = 1.0,
) -> np.ndarray:
    """Inverse of `unprocess` wherever it clipped nothing and no highlight was preserved.

    Linear camera RGB (H, W, 3) to a photo (H, W, 3) float32, sRGB-encoded with tone curve, 0..1.
    """
    balanced = camera * (np.asarray(white_balance, np.float32) / np.float32(exposure))
    linear = apply_matrix(camera_to_srgb_matrix(xyz_to_camera), np.minimum(balanced, 1))
    return tone_curve(srgb_encode(linear))


def linear_to_camera(
    linear_srgb: np.ndarray, xyz_to_camera: np.ndarray, white_balance: tuple[float, float, float]
) -> np.ndarray:
    """Light in linear sRGB (H, W, 3), unbounded, to camera RGB (H, W, 3) float32 clipped to 0..1.

    1 in grey light saturates green; red and blue, which white balance would amplify, saturate later.
    """
    camera = apply_matrix(srgb_to_camera_matrix(xyz_to_camera), linear_srgb)
    camera /= np.asarray(white_balance, np.float32)
    return np.clip(camera, 0, 1, out=camera)


def check_srgb(srgb: np.ndarray) -> None:
    """FsidError unless `srgb` is (H, W, 3) with finite values in 0..1."""
    if srgb.ndim != 3 or srgb.shape[2] != 3:
        raise FsidError(f"a photo must have shape (height, width, 3); got {srgb.shape}: convert it to RGB")
    if not (np.min(srgb) >= 0 and np.max(srgb) <= 1):
        raise FsidError("a photo must hold finite values in 0..1; divide 8-bit values by 255")
