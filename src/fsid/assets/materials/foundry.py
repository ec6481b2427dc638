"""More metal: cast, anodised, checker plate, galvanised, patina, mesh, crumpled foil."""

from __future__ import annotations

import numpy as np

from fsid.assets.material_registry import Layers, material_family
from fsid.assets.patterns import axes, cells, edge, grid, level, noise, scratches


@material_family(
    "cast_metal",
    tile_m=0.3,
    relief_m=0.0012,
    colours=("4a4a4c 6b6a68 2a2624", "8a8478 a8a294 4f4a40", "3a2f2a 5f4a3a a0623a", "5f6468 7f868a c0703f"),
)
def cast_metal(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Sand-cast skin: grains of the mould, pores, a parting line, soft bumps."""
    skin = noise(rng, size, 0.8, low=size / 40)
    bumps = noise(rng, size, 1.7, low=3, high=40)
    pores = edge(noise(rng, size, 0.8, low=30, high=size / 8), (2.4, 2.1, 1.8, 2.8)[variant], 0.5)
    rust = edge(noise(rng, size, 1.5) + 0.3 * skin, (3, 1.8, 1.2, 0.9)[variant], 1.0)
    return Layers(
        mix=level(0.7 * bumps + 0.5 * skin),
        pattern=np.clip(0.6 * pores + 0.5 * rust, 0, 1),
        detail=0.48 + 0.05 * skin - 0.14 * pores,
        roughness=0.5 + 0.08 * skin + 0.25 * rust,
        height=np.clip(0.55 + 0.09 * skin + 0.08 * bumps - 0.3 * pores, 0, 1),
        metallic=np.clip(0.9 - 0.5 * rust - 0.4 * pores, 0, 1),
    )


@material_family(
    "anodised_metal",
    tile_m=0.3,
    relief_m=0.0001,
    colours=(
        "2f5f9f 3f78bd d9dde2",
        "a8323f c04a52 e6dcd9",
        "3f8f5f 58a878 dfe6e0",
        "c9962f dcb04f f2ead6",
    ),
)
def anodised_metal(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Dyed aluminium: silky even bead blast, worn pale edges, a few scratches to the bare metal."""
    blast = noise(rng, size, 0.7, low=size / 40)
    tint = noise(rng, size, 2.1)
    hair = scratches(rng, size, (60, 140, 250, 30)[variant], 0.08)
    worn = edge(noise(rng, size, 1.7, low=2) + 0.2 * blast, (2.6, 2.0, 1.6, 2.2)[variant], 0.3)
    bare = np.maximum(0.9 * worn, 0.8 * hair)
    return Layers(
        mix=level(tint),
        pattern=bare,
        detail=0.5 + 0.01 * blast + 0.02 * tint,
        roughness=0.3 + 0.03 * blast + 0.05 * level(tint) + 0.1 * bare,
        height=np.clip(0.6 + 0.1 * blast - 0.3 * bare, 0, 1),
        metallic=1.0,
    )


@material_family("checker_plate", tile_m=0.4, relief_m=0.003)
def checker_plate(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Floor plate with raised lozenges in turn, worn bright on top, grime between; dots for variant 2."""
    count = (10, 14, 16, 8)[variant]
    a, b, i, j = grid(size, count, count)
    flip = (i + j) % 2 == 0
    p, q = (a + b) / np.sqrt(2), (a - b) / np.sqrt(2)
    along, across = np.where(flip, p, q), np.where(flip, q, p)
    if variant == 2:
        body = np.clip(1 - (np.hypot(a, b) / 0.3) ** 2, 0, 1)
    else:
        body = np.clip(1 - (along / 0.46) ** 2 - (across / 0.13) ** 2, 0, 1)
    raised = np.sqrt(body)
    grime = edge(noise(rng, size, 1.5), 0.2, 1.8) * (1 - edge(raised, 0.4, 0.4))
    hair = scratches(rng, size, 500, 0.05)
    skin = noise(rng, size, 0.7, low=size / 24)
    return Layers(
        mix=np.clip(0.5 * edge(raised, 0.7, 0.3) + 0.2 * level(skin), 0, 1),
        pattern=0.7 * grime,
        detail=0.44 + 0.08 * raised + 0.02 * skin - 0.12 * grime + 0.08 * hair,
        roughness=0.35 - 0.1 * raised + 0.35 * grime,
        height=np.clip(0.85 * raised + 0.03 * skin - 0.04 * hair, 0, 1),
        metallic=1 - 0.8 * grime,
    )


@material_family("galvanised", tile_m=0.4, relief_m=0.0002, colours="a9b0b3 8f989c 6f777b")
def galvanised(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Zinc spangle: flat crystals, each with its own brightness and feathering."""
    shift = 0.1 * np.stack([noise(rng, size, 1.5, low=6, high=80) for _ in range(2)])
    near, second, value = cells(rng, size, (12, 20, 32, 8)[variant], 0.95, shift)
    border = 1 - edge(second - near, 0.03, 0.06)
    feather = np.cos(2 * np.pi * (near * 22 + 9 * value)) * edge(near, 0.1, 0.2)
    fog = noise(rng, size, 1.7)
    white = edge(fog, (2.2, 1.6, 1.3, 1.9)[variant], 0.8)
    return Layers(
        mix=value,
        pattern=np.clip(0.3 * border + 0.12 * level(fog), 0, 1),
        detail=np.clip(0.42 + 0.34 * (value - 0.5) + 0.02 * feather + 0.12 * white, 0, 1),
        roughness=0.3 + 0.25 * value + 0.03 * feather + 0.2 * white,
        height=np.clip(0.5 + 0.2 * (value - 0.5) + 0.05 * feather, 0, 1),
        metallic=1 - 0.7 * white,
    )


@material_family("copper_patina", tile_m=0.6, relief_m=0.0012, colours="a8643f 6f4028 5fa08c")
def copper_patina(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Copper that turns brown and then green, from the joints and in runs."""
    grain = noise(rng, size, 0.9, low=size / 40)
    runs = noise(rng, size, 1.5, low=2) + 0.8 * noise(rng, size, 1.1, low=4, stretch=(1, 9))
    green = edge(runs + 0.3 * grain, (1.4, 0.7, 0.1, -0.5)[variant], 1.3)
    brown = level(noise(rng, size, 1.6) + 0.2 * grain)
    _, v = axes(size)
    seam = edge(np.abs((v * 3) % 1 - 0.5), 0.485, 0.012)
    return Layers(
        mix=np.clip(brown + 0.4 * seam, 0, 1),
        pattern=np.clip(green * (0.85 + 0.06 * grain), 0, 1),
        detail=0.48 + 0.02 * grain + 0.03 * green * grain - 0.15 * seam,
        roughness=0.3 + 0.55 * green + 0.03 * grain,
        height=np.clip(0.4 + 0.2 * green + 0.04 * grain - 0.3 * seam, 0, 1),
        metallic=1 - green,
    )


@material_family("metal_mesh", tile_m=0.15, relief_m=0.002)
def metal_mesh(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Woven wire, perforated sheet, expanded metal, chain mail over darkness."""
    count = (30, 24, 16, 20)[variant]
    u, v = axes(size)
    x, y = u * count + 0 * v, v * count + 0 * u
    i, j = np.floor(x).astype(int), np.floor(y).astype(int)
    a, b = x % 1 - 0.5, y % 1 - 0.5
    if variant == 0:
        over = (i + j) % 2 == 0
        wires = [np.sqrt(np.clip(1 - (w / 0.2) ** 2, 0, 1)) for w in (a, b)]
        top = [wires[0] * np.where(over, 1, 0.6), wires[1] * np.where(over, 0.6, 1)]
        height = np.maximum(*top)
    elif variant == 1:
        shifted = np.where(j % 2 == 0, a, (a + 1.0) % 1 - 0.5)
        height = edge(np.hypot(shifted, b), 0.36, 0.06)
    elif variant == 2:
        p = np.abs(((x + y) % 1) - 0.5), np.abs(((x - y) % 1) - 0.5)
        height = edge(np.maximum(*p), 0.38, 0.1) * (0.7 + 0.3 * np.cos(2 * np.pi * (x - y)))
    else:
        rings = [
            np.exp(-(((np.hypot((a + dx + 0.5) % 1 - 0.5, (b + dy + 0.5) % 1 - 0.5) - 0.36) / 0.09) ** 2))
            for dx, dy in ((0, 0), (0.5, 0.5))
        ]
        height = np.maximum(rings[0], 0.8 * rings[1])
    tarnish = noise(rng, size, 1.7)
    solid = edge(height, 0.25, 0.2)
    return Layers(
        mix=level(tarnish),
        pattern=0.25 * edge(tarnish, 1.0, 1.0) * solid,
        detail=np.clip(0.04 + solid * (0.4 + 0.08 * height + 0.02 * tarnish), 0, 1),
        roughness=0.3 + 0.08 * level(tarnish) + 0.5 * (1 - solid),
        height=np.clip(height, 0, 1),
        metallic=solid,
    )


@material_family(
    "foil",
    tile_m=0.4,
    relief_m=0.02,
    colours=(
        "c9ccd0 a8abb0 e6e7e9",
        "d1a84a b08a35 f0dca0",
        "c0505a 9f3a45 e0a0a5",
        "6f8fc0 5672a5 b5c9e3",
    ),
)
def foil(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Crumpled foil: flat facets between sharp creases of several generations."""
    height = np.zeros((size, size), np.float32)
    tone = np.zeros_like(height)
    bend = 0.35 * np.stack([noise(rng, size, 2.2, low=1, high=14) for _ in range(2)])
    for count, weight in ((3 + variant, 1.0), (9 + 2 * variant, 0.4), (26 + 5 * variant, 0.14)):
        near, second, value = cells(rng, size, count, 0.95, bend * np.float32(count / 12))
        height += weight * (near - 0.4 * second + (0.8 * value - 0.4) * (second - near))
        tone += weight * value
    height = (height - height.min()) / np.ptp(height)
    film = noise(rng, size, 1.8)
    return Layers(
        mix=level((tone - tone.mean()) / tone.std()),
        pattern=0.2 * level(film),
        detail=0.48 + 0.03 * film,
        roughness=0.2 + 0.05 * level(film),
        height=height,
        metallic=1.0,
    )
