"""Display curves and their inverses, on 0..1, of numbers, NumPy arrays and tensors; FsidError for integers.

    sRGB (IEC 61966-2-1):  e(v) = 12.92 v  up to v = 0.0031308,  else  1.055 v^(1/2.4) - 0.055
    tone curve (Brooks et al. 2019, eq. 1):  s(v) = 3 v^2 - 2 v^3,   s^-1(y) = 1/2 - sin(asin(1 - 2 y) / 3)

The smoothstep stands for the contrast curve of an ordinary camera's JPEG engine.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from fsid.sensor.arrays import check_floating, lookup, namespace

_BLOCK = 1 << 16
_ENTRIES = 1 << 16  # i / 65535: every value of an 8-bit or 16-bit photo, exactly


def srgb_encode(linear: Any) -> Any:
    """Linear 0..1 (clipped to that) to sRGB-encoded 0..1, float32."""
    if isinstance(linear, np.ndarray) and linear.size > _BLOCK and len(linear) > 1:
        encoded = np.empty(linear.shape, np.float32)
        rows = max(_BLOCK * len(linear) // linear.size, 1)
        for start in range(0, len(linear), rows):  # of a large image, parts that a cache holds
            encoded[start : start + rows] = _srgb_encoded(linear[start : start + rows])
        return encoded
    return _srgb_encoded(linear)


def _srgb_encoded(linear: Any) -> Any:
    v = _unit(linear)
    root = v.clip(min=0.0031308) ** (1 / 2.4)
    return namespace(v).where(v <= 0.0031308, 12.92 * v, 1.055 * root - 0.055)


def srgb_decode(encoded: Any) -> Any:
    """sRGB-encoded 0..1 (clipped to that) to linear 0..1, float32."""
    v = _unit(encoded)
    return namespace(v).where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def tone_curve(image: Any) -> Any:
    """Smoothstep of an image in 0..1 (clipped to that), float32."""
    v = _unit(image)
    return v * v * (3 - 2 * v)


def inverse_tone_curve(image: Any) -> Any:
    """Inverse of `tone_curve` on 0..1, float32."""
    v = _unit(image)
    xp = namespace(v)
    return 0.5 - xp.sin(xp.arcsin(1 - 2 * v) / 3)


def photo_to_linear(srgb: Any) -> Any:
    """`srgb_decode(inverse_tone_curve(srgb))` by table: exact for 8 and 16 bits, nearest entry between."""
    return lookup(_photo_table(), _unit(srgb))


@cache
def _photo_table() -> np.ndarray:
    table = srgb_decode(inverse_tone_curve(np.arange(_ENTRIES, dtype=np.float32) / np.float32(_ENTRIES - 1)))
    table.setflags(write=False)
    return table


def _unit(image: Any) -> Any:
    if not isinstance(image, np.generic | float | int):
        check_floating(image, "a picture")
    if isinstance(image, np.ndarray | np.generic | float | int):
        return np.clip(image, 0, 1, dtype=np.float32)
    return image.float().clip(0, 1)
