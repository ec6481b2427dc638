"""More cloth, from satin to sequins: threads, piles and seams."""

from __future__ import annotations

import numpy as np

from fsid.assets.material_registry import Layers, material_family
from fsid.assets.patterns import axes, cells, edge, level, noise, scratches, warp


@material_family(
    "satin",
    tile_m=0.4,
    relief_m=0.004,
    colours=(
        "8f2f3a c4616a f0c0b8",
        "2a3f6f 5f7fb5 c9d4e6",
        "c2ae8a ded1b4 efe9d8",
        "3a3a3f 66666e a8a8b0",
    ),
)
def satin(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Long floats that shine, in soft folds; damask figures in matt for odd variants."""
    floats = noise(rng, size, 0.4, low=size / 16, stretch=(10, 1))
    folds = noise(rng, size, 2.2, low=1, high=(4, 8, 6, 12)[variant], stretch=(1, (1, 2, 3, 1)[variant]))
    crease = noise(rng, size, 1.7, low=2, high=60)
    figure = edge(np.abs(noise(rng, size, 2.6, low=4, high=14)), 0.6, 0.05) * (variant % 2)
    return Layers(
        mix=level(folds + 0.4 * crease),
        pattern=0.35 * figure + 0.12 * level(floats - 1, 0.6),
        detail=0.5 + 0.025 * floats * (1 - figure) + 0.04 * folds,
        roughness=0.3 + 0.3 * figure + 0.03 * floats,
        height=np.clip(0.5 + 0.16 * folds + 0.03 * crease + 0.004 * floats, 0, 1),
    )


@material_family(
    "denim",
    tile_m=0.3,
    relief_m=0.0012,
    colours=(
        "2b3f66 53709c b3b9c2",
        "1b2334 33415a c9a25a",
        "6f8fb5 a9bfd6 e9e4d8",
        "22252b 3f434a a8763a",
    ),
)
def denim(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Twill with slubs, faded in streaks and patches, with seams of two rows of stitches."""
    threads = 160
    u, v = axes(size)
    wobble = noise(rng, size, 1.4, low=3, high=60) * np.float32(0.15)
    diagonal = (u * threads + v * threads / 2 + wobble) % 1
    rib = np.sin(np.pi * diagonal) ** 2
    slub = noise(rng, size, 0.5, low=size / 20, stretch=(1, 12))
    fade = noise(rng, size, 1.6) + 0.5 * noise(rng, size, 1.2, low=4, stretch=(1, 6))
    seams = (1, 2, 0, 1)[variant]
    at = np.abs((v * max(seams, 1) + 0.3) % 1 - 0.5) / max(seams, 1)
    row = np.exp(-(((at - 0.012) / 0.0022) ** 2)) * (np.abs((u * 60) % 1 - 0.5) < 0.32) * (seams > 0)
    fold = edge(0.02 - at, 0, 0.004) * (seams > 0)
    return Layers(
        mix=np.clip(0.35 * rib + 0.5 * level(fade + 0.5 * slub) + 0.15 * fold, 0, 1),
        pattern=np.clip(row, 0, 1) * 0.95,
        detail=0.4 + 0.14 * rib + 0.03 * slub - 0.12 * np.exp(-(((at - 0.02) / 0.004) ** 2)) * (seams > 0),
        roughness=0.9,
        height=np.clip(0.3 + 0.15 * rib + 0.03 * slub + 0.35 * fold + 0.2 * row, 0, 1),
    )


@material_family(
    "corduroy",
    tile_m=0.2,
    relief_m=0.0018,
    colours=(
        "6b4a2b 96703f 3a2a1a",
        "3a4a35 5f7355 1f2a1c",
        "7a2f35 a5525a 401a1e",
        "38485f 5f7591 1c2533",
    ),
)
def corduroy(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Velvet ribs, bent a little, rubbed flat here and there. Variant: wales per tile."""
    wales = (28, 44, 64, 18)[variant]
    u, _ = axes(size)
    bend = noise(rng, size, 2.0, low=1, high=10) * np.float32(0.25)
    x = (u * wales + bend) % 1 - 0.5
    rib = np.sqrt(np.clip(1 - (2.1 * x) ** 2, 0, 1))
    pile = noise(rng, size, 0.3, low=size / 14, stretch=(1, 2))
    rubbed = level(noise(rng, size, 1.8, low=2))
    return Layers(
        mix=np.clip(0.5 * rubbed + 0.3 * rib + 0.08 * pile, 0, 1),
        pattern=0.3 * (1 - rib),
        detail=0.22 + 0.28 * rib + 0.04 * pile * rib,
        roughness=0.92,
        height=np.clip(0.85 * rib * (0.8 + 0.2 * rubbed) + 0.04 * pile, 0, 1),
    )


@material_family("felt", tile_m=0.25, relief_m=0.0012)
def felt(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Matted fibres in all directions, melange of two wools, lint on top."""
    hairs = scratches(rng, size, (900, 1400, 700, 1800)[variant], 0.03)
    other = scratches(rng, size, (700, 900, 500, 1200)[variant], 0.04)
    mat = noise(rng, size, 0.8, low=20)
    cloud = noise(rng, size, 1.8)
    return Layers(
        mix=np.clip((0.2, 0.5, 0.35, 0.6)[variant] * hairs + 0.3 * level(cloud), 0, 1),
        pattern=(0.1, 0.5, 0.25, 0.7)[variant] * other * (1 - 0.5 * hairs),
        detail=0.45 + 0.05 * mat + 0.12 * hairs + 0.03 * cloud,
        roughness=0.97,
        height=np.clip(0.45 + 0.09 * mat + 0.15 * hairs + 0.12 * other, 0, 1),
    )


@material_family("terry", tile_m=0.25, relief_m=0.003)
def terry(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Towel loops that lean in all directions, with woven borders and ribs."""
    near, _, value = cells(rng, size, (90, 120, 70, 100)[variant], 0.95)
    lean = noise(rng, size, 1.4, low=4, high=60)
    loop = np.clip(1 - 1.25 * near, 0, 1) * (0.8 + 0.2 * np.cos(9 * value + 8 * near))
    _, v = axes(size)
    bands = (0, 3, 6, 2)[variant]
    border = edge(np.abs((v * max(bands, 1)) % 1 - 0.5), 0.4, 0.01) * (bands > 0)
    rib = 0.5 + 0.5 * np.cos(2 * np.pi * 120 * v)
    fibre = noise(rng, size, 0.5, low=size / 16)
    return Layers(
        mix=np.clip(0.25 * value + 0.3 * level(lean) + 0.4 * border, 0, 1),
        pattern=0.85 * border * (variant != 2),
        detail=0.3 + (1 - border) * 0.24 * loop + 0.2 * border * rib + 0.02 * fibre,
        roughness=0.95,
        height=np.clip((1 - border) * (0.8 * loop + 0.03 * fibre + 0.03 * lean) + border * 0.25 * rib, 0, 1),
    )


@material_family("quilt", tile_m=0.6, relief_m=0.02)
def quilt(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Padded diamonds, squares or patchwork between seams with stitches."""
    count = (5, 6, 8, 4)[variant]
    u, v = axes(size)
    p, q = (u + v, u - v) if variant % 2 == 0 else (u + 0 * v, v + 0 * u)
    x, y = (p * count) % 1 - 0.5, (q * count) % 1 - 0.5
    i, j = np.floor(p * count).astype(int) % count, np.floor(q * count).astype(int) % count
    puff = np.maximum(np.cos(np.pi * x) * np.cos(np.pi * y), 0.0) ** 0.6
    wrinkle = noise(rng, size, 1.3, low=6, high=120) * (1 - puff)
    seam = edge(np.maximum(np.abs(x), np.abs(y)), 0.49, 0.012)
    stitch = edge(np.minimum(np.abs(np.abs(x) - 0.47), np.abs(np.abs(y) - 0.47)), 0.012, 0.01)
    dashed = (1 - stitch) * (((p - q + u) * 120 % 1) < 0.6)
    cloth = noise(rng, size, 0.4, low=size / 20, high=size / 5)
    patch = rng.random((3, count, count))[:, i, j]
    dots = edge(np.cos(2 * np.pi * 40 * u) * np.cos(2 * np.pi * 40 * v), 0.4, 0.3)
    figure = (patch[1] > 0.6) * (dots if variant == 3 else np.float32(variant > 0))
    return Layers(
        mix=np.clip((patch[0] if variant else 0.2) + 0.06 * wrinkle, 0, 1),
        pattern=np.clip(0.8 * figure + 0.5 * dashed, 0, 0.95),
        detail=0.4 + 0.1 * puff + 0.02 * cloth - 0.2 * seam,
        roughness=0.8,
        height=np.clip(0.85 * puff + 0.05 * wrinkle + 0.004 * cloth, 0, 1),
    )


@material_family("velour", tile_m=0.5, relief_m=0.003, colours="5a1f3f 8f3f66 c98fae")
def velour(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Pile brushed in patches: its shade turns where it was stroked; crushed for odd variants."""
    strokes = noise(rng, size, 1.5, low=2, high=(40, 90, 25, 140)[variant], stretch=(1, 2))
    bend = noise(rng, size, 2.0, low=2, high=12) * np.float32(0.015)
    nap = warp(noise(rng, size, 0.4, low=size / 18, stretch=(1, 2.5)), bend, bend.T)
    shine = level(strokes, 0.6 if variant % 2 else 1.0)
    return Layers(
        mix=np.clip(shine + 0.04 * nap, 0, 1),
        pattern=0.3 * edge(strokes, 1.2, 1.0),
        detail=0.36 + 0.14 * shine + 0.022 * nap,
        roughness=0.85,
        height=np.clip(0.5 + 0.14 * strokes + 0.02 * nap, 0, 1),
    )


@material_family("sequins", tile_m=0.15, relief_m=0.0015)
def sequins(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Overlapping shiny discs or fish scales, each tilted and toned by itself."""
    count = (24, 36, 50, 18)[variant]
    u, v = axes(size)
    height = np.zeros((size, size), np.float32)
    tone = np.zeros_like(height)
    flat = np.zeros_like(height)
    rim = np.zeros_like(height)
    tones, tilt = rng.random((count, count)), rng.normal(size=(2, count, count)) * 0.25
    for parity in (0, 1):
        for drop in (0.0, 0.5):
            x = u * count + 0.5 * parity + 0 * v
            y = (v * count + 0.5 * parity + drop) + 0 * u
            i, j = np.floor(x).astype(int) % count, np.floor(y).astype(int) % count
            dx, dy = x % 1 - 0.5, y % 1 - 0.5
            inside = np.hypot(dx, dy) < 0.55
            lean = tilt[:, j, i]
            plane = 0.5 + 0.35 * dy + lean[0] * dx + lean[1] * dy + 0.03 * parity
            above = inside & (plane > height)
            height = np.where(above, plane, height)
            tone = np.where(above, tones[j, i], tone)
            flat = np.where(above, 1.0, flat)
            rim = np.where(above, edge(np.hypot(dx, dy), 0.5, 0.06), rim)
    return Layers(
        mix=tone,
        pattern=0.9 * edge(tone, 0.8, 0.02) * (variant % 2),
        detail=0.42 + 0.12 * tone - 0.2 * rim,
        roughness=0.2 + 0.15 * tone,
        height=np.clip(height, 0, 1).astype(np.float32),
        metallic=(1.0, 0.6, 1.0, 0.0)[variant] * flat,
    )
