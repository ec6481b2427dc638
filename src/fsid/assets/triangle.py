"""Any picture as masks: three colours around all its chromaticities, and where in between a texel lies.

    rgb = w_a A + w_b B + w_c C,   w >= 0
    detail = (w_a + w_b + w_c) / 2,   pattern = w_c / sum w,   mix = w_b / (w_a + w_b)

inverts the equation of `fsid.assets.maps` exactly where A, B, C are independent and rgb lies in the cone that
they span. The smaller the triangle, the finer the chromaticity after rounding to 8 bits, hence `enclosing`.
"""

from __future__ import annotations

import numpy as np

Triple = tuple[tuple[float, float, float], ...]

PICTURE: Triple = ((1.35, 0.075, 0.075), (0.075, 1.35, 0.075), (0.075, 0.075, 1.35))
"""A triangle around nearly all surface colours, bright enough for white: for what is drawn in full colour."""

_EPSILON = 0.5 / 255
"""By how much a texel may miss the cone, linear: below 8-bit rounding."""

_MIN_SIDE = 0.02


def srgb_to_linear(encoded: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1, 0..1 to 0..1, float32."""
    x = np.asarray(encoded, np.float32)
    return np.where(x <= 0.04045, x / np.float32(12.92), ((x + np.float32(0.055)) / np.float32(1.055)) ** 2.4)


def hex_colours(text: str) -> Triple:
    """ "b07a4a d7b58a 3b2a1e" (sRGB) to linear triples."""
    codes = [[int(word[k : k + 2], 16) / 255 for k in (0, 2, 4)] for word in text.split()]
    return tuple((float(r), float(g), float(b)) for r, g, b in srgb_to_linear(np.array(codes)))


def encode(rgb: np.ndarray, colours: Triple) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(mix, pattern, detail), each (..., ) float32 in [0, 1], of linear rgb (..., 3).

    What lies outside the cone of `colours` is moved to its border; detail saturates at 1.
    """
    weights = rgb @ np.linalg.inv(np.array(colours)).astype(np.float32)
    weights = np.maximum(weights, 0.0)
    a, b, c = np.moveaxis(weights, -1, 0)
    ground, total = a + b, a + b + c
    mix = np.divide(b, ground, out=np.full_like(a, 0.5), where=ground > 1e-6)
    pattern = np.divide(c, total, out=np.full_like(a, 1 / 3), where=total > 1e-6)
    return mix, pattern, np.minimum(total / 2, 1.0)


def decode(
    mix: np.ndarray, pattern: np.ndarray, detail: np.ndarray, colours: Triple | np.ndarray
) -> np.ndarray:
    """The equation of `fsid.assets.maps`: linear albedo (..., 3), as precise as the colours."""
    a, b, c = np.asarray(colours)
    ground = a + mix[..., None] * (b - a)
    return np.asarray((ground + pattern[..., None] * (c - ground)) * (2 * detail[..., None]))


def enclosing(rgb: np.ndarray) -> Triple:
    """The smallest triangle with the sides of the RGB triangle around the chromaticities of rgb (N, 3).

    A chromaticity counts as much as its texel is bright: dark texels have any. The colours are as bright as
    `detail` = 1 needs for the brightest texel; of a picture with white and pure red they exceed 1, while
    the product of the equation does not.
    """
    total = np.maximum(rgb.sum(-1), 1e-6)
    low = np.clip(((rgb + _EPSILON) / total[:, None]).min(0), 0.0, 1.0).astype(np.float64)
    excess = low.sum() - (1 - _MIN_SIDE)
    if excess > 0:
        low = np.maximum(low - excess / 3, 0.0)
    side = 1 - low.sum()
    scale = max(float(total.max()), 3 * _EPSILON) / 2
    vertices = scale * (low + side * np.eye(3))
    return tuple((float(r), float(g), float(b)) for r, g, b in vertices)
