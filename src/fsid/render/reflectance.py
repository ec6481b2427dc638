"""What GGX reflects of surroundings of one radiance, by roughness and angle: f0 A + B; of a clear coat, C.

    f0 A + B = integral of D G F / (4 nv) over the light's directions,  F = f0 + (1 - f0) (1 - vh)^5
    C        = the same with Fresnel's equations for index 1.5, of which Schlick's F misses up to 23 %

split as Karis does (2013, "Real Shading in Unreal Engine 4"), by importance sampling of the half vector
with a fixed Hammersley set, so that the table is the same everywhere. Masking is that of
shaders/lights.glsl, so that direct and surrounding light agree and the energy that is given back is right.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np

SIZE = 32
COAT_INDEX = 1.5
_POINTS = 1024


def lobe_table() -> np.ndarray:
    """(32, 32, 4) float32: a, b, c, d of tools/fit_lobes.py, laid out as `reflectance_table`."""
    with (files("fsid.render") / "lobes.npy").open("rb") as file:
        return np.asarray(np.load(file, allow_pickle=False), np.float32)


@cache
def reflectance_table() -> np.ndarray:
    """(SIZE, SIZE, 3) float32 A, B and C at texel centres; row: roughness, column: cosine to the viewer."""
    centres = (np.arange(SIZE) + 0.5) / SIZE
    table = np.empty((SIZE, SIZE, 3), np.float32)
    for row, roughness in zip(table, centres, strict=True):
        vh, weight = _half_vectors(roughness, centres[:, None])
        fresnel = (1 - vh) ** 5
        row[:, 0] = ((1 - fresnel) * weight).mean(1)
        row[:, 1] = (fresnel * weight).mean(1)
        row[:, 2] = (clear_fresnel(vh) * weight).mean(1)
    return table


def clear_fresnel(cosine: np.ndarray) -> np.ndarray:
    """Share of unpolarised light that a clear dielectric of index COAT_INDEX reflects at `cosine`."""
    g = np.sqrt(COAT_INDEX**2 - 1 + cosine**2)
    across, tilt = (g - cosine) / (g + cosine), (cosine * (g + cosine) - 1) / (cosine * (g - cosine) + 1)
    return np.asarray(0.5 * across**2 * (1 + tilt**2))


def _half_vectors(roughness: float, nv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """For nv (..., 1) the cosines of N half vectors of GGX to the viewer, and what each reflects."""
    i = np.arange(_POINTS)
    u = (i + 0.5) / _POINTS
    phi = 2 * np.pi * _radical_inverse(i)
    a2 = max(roughness, 0.05) ** 4
    nh = np.sqrt((1 - u) / (1 + (a2 - 1) * u))
    sine = np.sqrt(np.maximum(1 - nh * nh, 0))
    vh = np.maximum(np.sqrt(1 - nv * nv) * (sine * np.cos(phi)) + nv * nh, 0)
    nl = 2 * vh * nh - nv
    lit = nl > 0
    nl = np.maximum(nl, 1e-6)
    masking = nl * np.sqrt(nv * nv * (1 - a2) + a2) + nv * np.sqrt(nl * nl * (1 - a2) + a2)
    return vh, np.where(lit, 2 * nl * vh / (masking * nh), 0.0)


def _radical_inverse(i: np.ndarray) -> np.ndarray:
    """Bits of 32-bit integers mirrored behind the binary point."""
    bits = np.unpackbits(i.astype(">u4").view(np.uint8).reshape(-1, 4), axis=1)[:, ::-1]
    return np.asarray(bits @ 0.5 ** np.arange(1, 33))
