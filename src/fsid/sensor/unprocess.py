"""From a picture back to the light on the sensor, and forward again.

    photo:     camera = G(M e^-1(s^-1(srgb)))
    radiance:  camera = clip(M radiance / white_balance)

e is the sRGB curve, s the tone curve, M the linear sRGB -> camera matrix, G the division by the white-balance
gains. A photo's white is already clipped, and dividing it would leave grey-pink highlights that no
sensor produces; G therefore fades the division out as a pixel approaches white (Brooks et al. 2019,
eq. 2 and 3). A rendered frame has unbounded highlights and no curve to invert: its path is exactly linear,
and the sensor clips it where its own channels saturate. Images are NumPy arrays or torch tensors.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fsid.errors import FsidError
from fsid.sensor.arrays import check_array, like, namespace
from fsid.sensor.colour import apply_matrix, camera_to_srgb_matrix, srgb_to_camera_matrix
from fsid.sensor.tone import photo_to_linear, srgb_encode, tone_curve

HIGHLIGHT_INFLECTION = 0.9  # t of Brooks et al. 2019, eq. 2: where highlight preservation sets in


def unprocess(
    srgb: Any,
    xyz_to_camera: np.ndarray,
    white_balance: tuple[float, float, float],
    exposure: float = 1.0,
) -> Any:
    """Photo (H, W, 3), sRGB-encoded 0..1, to linear camera RGB (H, W, 3) float32 0..1 before white balance.

    exposure multiplies the light (1 / rgb gain of Brooks et al.); white stays at saturation whatever it is.
    FsidError for what is no such photo.
    """
    check_srgb(srgb)
    linear = photo_to_linear(srgb)
    matrix = srgb_to_camera_matrix(xyz_to_camera)
    gains = exposure / np.asarray(white_balance)
    camera = apply_matrix(gains[:, None] * matrix, linear)
    white = (linear @ like(matrix.mean(axis=0), linear) - HIGHLIGHT_INFLECTION).clip(min=0)
    bright = white > 0
    if bright.any():  # few pixels of most photos
        share = ((white[bright] / (1 - HIGHLIGHT_INFLECTION)) ** 2)[:, None]
        kept = share + (1 - share) * like(gains, share)
        kept = namespace(kept).maximum(kept, like(gains, kept).reshape(1, 3))
        camera[bright] = apply_matrix(matrix, linear[bright]) * kept
    return camera.clip(0, 1)


def process(
    camera: Any,
    xyz_to_camera: np.ndarray,
    white_balance: tuple[float, float, float],
    exposure: float = 1.0,
) -> Any:
    """Inverse of `unprocess` wherever it clipped nothing and no highlight was preserved.

    Linear camera RGB (H, W, 3) to a photo (H, W, 3) float32, sRGB-encoded with tone curve, 0..1.
    """
    balanced = camera * like(np.asarray(white_balance) / exposure, camera)
    linear = apply_matrix(camera_to_srgb_matrix(xyz_to_camera), balanced.clip(max=1))
    return tone_curve(srgb_encode(linear))


def linear_to_camera(
    linear_srgb: Any, xyz_to_camera: np.ndarray, white_balance: tuple[float, float, float] | np.ndarray
) -> Any:
    """Light in linear sRGB (H, W, 3), unbounded, to camera RGB (H, W, 3) float32 clipped to 0..1.

    white_balance: the gains, or a row of them, (W, 3). 1 in grey light saturates green; red and blue, which
    white balance would amplify, saturate later.
    """
    camera = apply_matrix(srgb_to_camera_matrix(xyz_to_camera), linear_srgb)
    camera /= like(white_balance, camera)
    return namespace(camera).clip(camera, 0, 1, out=camera)


def check_srgb(srgb: Any) -> None:
    """FsidError unless `srgb` is (H, W, 3) with finite values in 0..1."""
    check_array(srgb, "a photo")
    if srgb.ndim != 3 or srgb.shape[2] != 3 or 0 in srgb.shape:
        raise FsidError(
            f"a photo must have shape (height, width, 3); got {tuple(srgb.shape)}: convert it to RGB"
        )
    if not (srgb.min() >= 0 and srgb.max() <= 1):
        raise FsidError("a photo must hold finite values in 0..1; divide 8-bit values by 255")


def check_linear(linear: Any) -> None:
    """FsidError unless `linear` is (H, W, 3) with finite floating-point values."""
    check_light(linear)
    if not (linear.min() > -math.inf and linear.max() < math.inf):
        raise FsidError("linear light must hold finite values; it has NaN or infinity")


def check_light(linear: Any) -> None:
    """FsidError unless `linear` is (H, W, 3) with floating-point values."""
    check_array(linear, "linear light")
    if linear.ndim != 3 or linear.shape[2] != 3 or 0 in linear.shape:
        raise FsidError(f"linear light must have shape (height, width, 3), RGB; got {tuple(linear.shape)}")
    if isinstance(linear, np.ndarray) and linear.dtype.kind != "f":
        raise FsidError(
            f"linear light must be floating-point, 1 = saturation; got {linear.dtype}. Photographs are not "
            "linear: clean_from_photo takes them"
        )
