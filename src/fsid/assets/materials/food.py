"""Food: bread, grains, citrus, cured meat, cheese, salad. Pores, kernels, fibres and fat."""

from __future__ import annotations

import numpy as np

from fsid.assets.material_registry import Layers, material_family, pictured
from fsid.assets.patterns import cells, edge, level, noise


@material_family(
    "bread",
    tile_m=0.12,
    relief_m=0.0012,
    colours=("e6d2a8 cfae78 a9713a", "d9b98a b98a52 7a4a22", "8f6a45 6b4a2e 3f2a18", "ecdebc d8be8f b28048"),
)
def bread(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Crumb with bubbles of many sizes, crust with flour and seeds for odd variants."""
    pores = np.zeros((size, size), np.float32)
    bend = np.stack([noise(rng, size, 1.9, low=3, high=60) for _ in range(2)])
    for count, weight in ((9, 1.0), (24, 0.8), (60, 0.6)):
        near, _, value = cells(rng, size, count, 0.95, bend * np.float32(0.2 * count**0.5 / 5))
        keep = value > (0.3, 0.85, 0.5, 0.6)[variant]
        pores = np.maximum(pores, weight * keep * edge(0.12 + 0.25 * value - near, 0, 0.1))
    crumb = noise(rng, size, 1.0, low=12)
    bake = noise(rng, size, 1.8)
    near, _, value = cells(rng, size, 26, 0.95)
    seed = edge(0.26 - near, 0, 0.04) * (value > 0.72) * (variant % 2)
    return Layers(
        mix=np.clip(0.6 * level(bake + 0.3 * crumb) + 0.4 * pores, 0, 1),
        pattern=np.clip(0.4 * edge(bake, 1.0, 1.2) + 0.8 * seed, 0, 1),
        detail=np.clip(0.5 + 0.03 * crumb - 0.16 * pores + 0.08 * seed, 0, 1),
        roughness=0.8,
        height=np.clip(0.7 - 0.45 * pores + 0.05 * crumb + 0.2 * seed, 0, 1),
    )


@material_family(
    "grains",
    tile_m=0.12,
    relief_m=0.003,
    colours=("efe8d8 d9cdb2 a89878", "8a3a2a 6b2a22 c9a08a", "c9a04a a87a2a 5f4318", "3f5a2a 6b8a3f c9c48a"),
)
def grains(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Rice, beans, corn or lentils poured out: long or round kernels that touch."""
    count = (46, 22, 26, 34)[variant]
    long = (2.2, 1.5, 1.0, 1.15)[variant]
    stretchable = round(count / long)
    depth = np.zeros((size, size), np.float32)
    tone, split = np.zeros_like(depth), np.zeros_like(depth)
    for layer in range(3):
        shift = 0.5 * np.stack([noise(rng, size, 2.4, low=1, high=6) for _ in range(2)])
        near, second, value = cells(rng, size, stretchable if layer % 2 else count, 0.95, shift)
        dome = np.sqrt(np.clip((second - near) * 1.9, 0, 1)) * (0.55 + 0.22 * layer) * (value > 0.3 * layer)
        above = dome > depth
        depth, tone = np.where(above, dome, depth), np.where(above, value, tone)
        split = np.where(above, np.exp(-((near / 0.12) ** 2)), split)
    skin = noise(rng, size, 0.9, low=size / 50)
    return Layers(
        mix=np.clip(1.3 * tone - 0.15 + 0.05 * skin, 0, 1),
        pattern=np.clip(0.6 * split * (variant in (1, 2)) + 0.5 * edge(tone, 0.93, 0.02), 0, 1),
        detail=np.clip(0.1 + 0.42 * depth + 0.015 * skin, 0, 1),
        roughness=(0.6, 0.3, 0.4, 0.55)[variant],
        height=np.clip(depth, 0, 1),
    )


@material_family(
    "peel",
    tile_m=0.1,
    relief_m=0.0005,
    colours=("e88a1f f2a93f b55f12", "e3c62a f0dd62 b3951c", "a8c23a c8d96a 6f8a22", "c23a2a d96a3a e6b84a"),
)
def peel(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Skin of fruit: dimples of oil glands, blush, lenticels, russet."""
    near, _, value = cells(rng, size, (40, 46, 60, 24)[variant], 0.85)
    dimple = np.exp(-((near / (0.16 + 0.12 * value)) ** 2))
    blush = noise(rng, size, 1.9) + 0.4 * noise(rng, size, 1.2, low=6, stretch=(1, 6)) * (variant == 3)
    russet = edge(noise(rng, size, 1.5, low=3), 1.7, 0.5)
    skin = noise(rng, size, 1.0, low=30)
    return Layers(
        mix=np.clip(0.75 * level(blush) + 0.1 * dimple, 0, 1),
        pattern=np.clip(0.4 * russet + (0.1, 0.1, 0.15, 0.5)[variant] * dimple, 0, 1),
        detail=np.clip(0.5 + 0.015 * skin - 0.05 * dimple * (variant < 3), 0, 1),
        roughness=(0.42, 0.45, 0.5, 0.25)[variant] + 0.2 * russet,
        height=np.clip(0.7 - (0.5, 0.45, 0.35, 0.05)[variant] * dimple + 0.02 * skin, 0, 1),
    )


@material_family(
    "cured_meat",
    tile_m=0.12,
    relief_m=0.0008,
    colours=("a83a36 c25a4f f0ddd0", "8f2a30 b04a48 ecd2c6", "c56e68 d99087 f1e2d8", "6f2226 933a3a e3c4b4"),
)
def cured_meat(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Salami, ham, marbled steak, bresaola: lean fibres with lobes, veins or specks of fat."""
    fibre = noise(rng, size, 0.9, low=10, stretch=(3, 1))
    lobes = noise(rng, size, 1.6, low=3, high=(30, 12, 50, 40)[variant])
    shift = 0.3 * np.stack([noise(rng, size, 1.8, low=4, high=90) for _ in range(2)])
    near, second, value = cells(rng, size, (26, 8, 14, 20)[variant], 0.95, shift)
    if variant == 0:
        fat = edge(0.38 * value - near, 0, 0.06) * (value > 0.35)
    elif variant == 2:
        fat = np.maximum(np.exp(-np.abs(lobes) / 0.1), (1 - edge(second - near, 0.05, 0.06)) * (value > 0.4))
    else:
        fat = np.maximum(edge(lobes, 1.3, 0.3), (1 - edge(second - near, 0.03, 0.05)) * 0.8)
    wet = noise(rng, size, 1.8)
    return Layers(
        mix=level(wet + 0.5 * fibre),
        pattern=np.clip(0.92 * fat + 0.03 * fibre, 0, 1),
        detail=0.47 + 0.025 * fibre + 0.02 * wet,
        roughness=0.25 + 0.08 * level(wet),
        height=np.clip(0.5 + 0.06 * fibre + 0.15 * fat, 0, 1),
    )


@material_family(
    "cheese",
    tile_m=0.15,
    relief_m=0.0015,
    colours=("e5c059 edd286 c79839", "e6dcb8 d3c598 7a8a9a", "d98a2a e6a552 a8621a", "f2ecd8 e3d9b8 c2b27a"),
)
def cheese(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Smooth paste: with holes for 0 and 3, with blue veins for 1, plain for 2."""
    cloud = noise(rng, size, 2.0)
    near, _, value = cells(rng, size, (5, 12, 9, 7)[variant], 0.85)
    hole = edge(0.34 * value - near, 0, 0.03) * (value > 0.4) * (variant in (0, 3))
    curd = noise(rng, size, 1.2, low=6)
    vein = np.exp(-np.abs(noise(rng, size, 1.7, low=3)) / 0.1) * edge(curd, 0.2, 0.8) * (variant == 1)
    return Layers(
        mix=level(cloud + 0.2 * curd),
        pattern=np.clip(0.35 * hole + 0.85 * vein, 0, 1),
        detail=np.clip(0.5 + 0.012 * curd + 0.015 * cloud - 0.14 * hole - 0.1 * vein, 0, 1),
        roughness=0.4 + 0.04 * curd,
        height=np.clip(0.75 - 0.6 * hole + 0.03 * curd - 0.1 * vein, 0, 1),
    )


@material_family("salad", tile_m=0.3, relief_m=0.006, colours="picture")
def salad(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Chopped vegetables: crumpled greens, orange and red slices, white rings, herbs."""
    bend = np.stack([noise(rng, size, 1.6, low=3, high=80) for _ in range(2)]) * np.float32(0.02)
    palette = np.array(
        (
            ((0.35, 0.55, 0.15), (0.55, 0.7, 0.25), (0.85, 0.2, 0.12), (0.9, 0.9, 0.8)),
            ((0.9, 0.5, 0.1), (0.95, 0.65, 0.2), (0.4, 0.55, 0.2), (0.8, 0.75, 0.5)),
            ((0.5, 0.12, 0.3), (0.65, 0.3, 0.45), (0.85, 0.8, 0.82), (0.3, 0.45, 0.15)),
            ((0.85, 0.75, 0.3), (0.7, 0.35, 0.12), (0.3, 0.5, 0.2), (0.75, 0.12, 0.1)),
        )[variant],
        np.float32,
    )
    rgb = np.zeros((size, size, 3), np.float32)
    height = np.zeros((size, size), np.float32)
    for count in (7, 13, 24):
        near, second, value = cells(rng, size, count, 0.95, bend * np.float32(count))
        dome = np.sqrt(np.clip(second - near, 0, 1)) * (0.6 + 0.4 * value)
        rings = 0.5 + 0.5 * np.cos(2 * np.pi * near * (4 + 8 * value))
        tone = palette[np.clip((value * 3.999 * 7) % 4, 0, 3).astype(int)]
        piece = tone * (0.45 + 0.5 * dome + 0.15 * rings)[..., None]
        above = (dome > height)[..., None]
        rgb, height = np.where(above, piece, rgb), np.maximum(dome, height)
    fibre = noise(rng, size, 1.1, low=10)
    layers = pictured(np.clip(rgb * (1 + 0.05 * fibre)[..., None], 0, 1))
    return layers._replace(roughness=0.25 + 0.05 * level(fibre), height=np.clip(height + 0.02 * fibre, 0, 1))
