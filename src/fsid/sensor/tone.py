"""Display curves and their inverses, on 0..1.

    sRGB (IEC 61966-2-1):  e(v) = 12.92 v  up to v = 0.0031308,  else  1.055 v^(1/2.4) - 0.055
    tone curve (Brooks et al. 2019, eq. 1):  s(v) = 3 v^2 - 2 v^3,   s^-1(y) = 1/2 - sin(asin(1 - 2 y) / 3)

The smoothstep stands for the contrast curve of an ordinary camera's JPEG engine.
"""

from __future__ import annotations

import numpy as np


def srgb_encode(linear: np.ndarray) -> np.ndarray:
    """Linear 0..1 (clipped to that) to sRGB-encoded 0..1, float32."""
    v = np.clip(linear, 0, 1, dtype=np.float32)
    root = np.maximum(v, np.float32(0.0031308)) ** np.float32(1 / 2.4)
    return np.where(v <= 0.0031308, np.float32(12.92) * v, np.float32(1.055) * root - np.float32(0.055))


def srgb_decode(encoded: np.ndarray) -> np.ndarray:
    """sRGB-encoded 0..1 (clipped to that) to linear 0..1, float32."""
    v = np.clip(encoded, 0, 1, dtype=np.float32)
    power = ((v + np.float32(0.055)) / np.float32(1.055)) ** np.float32(2.4)
    return np.where(v <= 0.04045, v / np.float32(12.92), power)


def tone_curve(image: np.ndarray) -> np.ndarray:
    """Smoothstep of an image in 0..1 (clipped to that), float32."""
    v = np.clip(image, 0, 1, dtype=np.float32)
    return v * v * (3 - 2 * v)


def inverse_tone_curve(image: np.ndarray) -> np.ndarray:
    """Inverse of `tone_curve` on 0..1, float32."""
    v = np.clip(image, 0, 1, dtype=np.float32)
    return np.float32(0.5) - np.sin(np.arcsin(1 - 2 * v) / 3)
