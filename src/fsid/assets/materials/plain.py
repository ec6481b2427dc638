"""Plain surfaces: paint, plaster, plastic. Homogeneous areas exist in reality too."""

from __future__ import annotations

import numpy as np

from fsid.assets.material_registry import Layers, material_family
from fsid.assets.patterns import cells, edge, level, noise


@material_family("paint", tile_m=0.8, relief_m=0.0006)
def paint(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Nearly uniform paint: roller stipple of a few texels, faint clouds. Variant: matt to glossy."""
    stipple = noise(rng, size, 0.5, low=size / 24, high=size / 6)
    clouds = noise(rng, size, 2.0, high=8)
    return Layers(
        mix=0.1 * level(clouds),
        detail=0.5 + 0.006 * clouds,
        roughness=(0.8, 0.6, 0.4, 0.2)[variant] + 0.03 * clouds,
        height=0.5 + 0.12 * stipple + 0.05 * clouds,
    )


@material_family("plastic", tile_m=0.25, relief_m=0.0005)
def plastic(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Moulded plastic with leather-like erosion grain, coarser with the variant, and flow marks."""
    near, second, value = cells(rng, size, (96, 64, 48, 32)[variant], 0.95)
    grain = edge(second - near, 0.2, 0.4)
    flow = noise(rng, size, 1.6, high=20, stretch=(1, 4))
    return Layers(
        mix=0.15 * level(flow),
        detail=0.5 + 0.03 * (grain - 0.5) + 0.01 * flow,
        roughness=0.35 + 0.15 * (1 - grain) + 0.04 * flow,
        height=grain * (0.7 + 0.3 * value),
    )


@material_family("plaster", tile_m=1.2, relief_m=0.004, colours="ddd5c6 cbbfaa a8987f")
def plaster(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Trowelled or sprayed plaster: ridges of overlapping strokes over fine sand."""
    sand = noise(rng, size, 0.3, low=size / 16)
    strokes = np.abs(noise(rng, size, 1.3, low=4 + 6 * variant, stretch=(1, 1 + variant)))
    stains = noise(rng, size, 2.2)
    ridge = np.clip(strokes / 2.5, 0, 1)
    return Layers(
        mix=0.6 * level(stains),
        pattern=0.25 * edge(stains, 1.2, 1.0),
        detail=0.5 + 0.05 * (ridge - 0.4) + 0.035 * sand,
        roughness=0.85 + 0.05 * sand,
        height=0.75 * ridge + 0.04 * sand + 0.1,
    )
