"""What GGX reflects of surroundings of one radiance, by roughness and angle: reflectance = f0 A + B.

    f0 A + B = integral of D G F / (4 nv) over the light's directions,  F = f0 + (1 - f0) (1 - vh)^5

split as Karis does (2013, "Real Shading in Unreal Engine 4"), by importance sampling of the half vector
with a fixed Hammersley set, so that the table is the same everywhere. Masking is that of
shaders/lights.glsl, so that direct and surrounding light agree and the energy that is given back is right.
"""

from __future__ import annotations

from functools import cache

import numpy as np

SIZE = 32
_POINTS = 1024


@cache
def reflectance_table() -> np.ndarray:
    """(SIZE, SIZE, 2) float32 A and B at texel centres; row: roughness, column: cosine to the viewer."""
    centres = (np.arange(SIZE) + 0.5) / SIZE
    i = np.arange(_POINTS)
    u = (i + 0.5) / _POINTS
    phi = 2 * np.pi * _radical_inverse(i)
    table = np.empty((SIZE, SIZE, 2), np.float32)
    nv = centres[:, None]
    v = np.sqrt(1 - nv * nv), nv
    for row, roughness in zip(table, centres, strict=True):
        a2 = max(roughness, 0.05) ** 4
        nh = np.sqrt((1 - u) / (1 + (a2 - 1) * u))
        side = np.sqrt(np.maximum(1 - nh * nh, 0)) * np.cos(phi)
        vh = np.maximum(v[0] * side + v[1] * nh, 0)
        nl = 2 * vh * nh - nv
        lit = nl > 0
        nl = np.maximum(nl, 1e-6)
        masking = nl * np.sqrt(nv * nv * (1 - a2) + a2) + nv * np.sqrt(nl * nl * (1 - a2) + a2)
        weight = np.where(lit, 2 * nl * vh / (masking * nh), 0.0)
        fresnel = (1 - vh) ** 5
        row[:, 0] = ((1 - fresnel) * weight).mean(1)
        row[:, 1] = (fresnel * weight).mean(1)
    return table


def _radical_inverse(i: np.ndarray) -> np.ndarray:
    """Bits of 32-bit integers mirrored behind the binary point."""
    bits = np.unpackbits(i.astype(">u4").view(np.uint8).reshape(-1, 4), axis=1)[:, ::-1]
    return np.asarray(bits @ 0.5 ** np.arange(1, 33))
