"""Material maps: what a surface looks like before it is given colours.

A family is baked once and recoloured at every use, so the maps hold masks instead of colours:

    albedo(u, v) = lerp(lerp(colour_a, colour_b, mix), colour_c, pattern) * (2 * detail)

with the three colours drawn per use. `detail` is 0.5 where it changes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class MaterialMaps:
    """Tileable square maps, all (S, S) float32 in [0, 1], S a power of two, row 0 = top (v = 0).

    mix, pattern, detail: see the module's equation. roughness: perceptual (alpha = roughness^2).
    height: 0 lowest, 1 highest. metallic: 0 dielectric, 1 metal.
    relief_m: physical height range that `height` spans when the tile is `tile_m` wide; both metres.
    colours: what colour_a, colour_b, colour_c are in nature, linear; None where any colours will do. A
    picture is exactly this equation too: with a triangle of three colours around its chromaticities,
    (mix, pattern) say where in the triangle a texel lies and `detail` how bright it is.
    """

    mix: np.ndarray
    pattern: np.ndarray
    detail: np.ndarray
    roughness: np.ndarray
    height: np.ndarray
    metallic: np.ndarray
    relief_m: float
    tile_m: float
    colours: tuple[tuple[float, float, float], ...] | None = None
