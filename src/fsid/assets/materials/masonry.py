"""More stone: cobbles, ashlar, sandstone, slate, travertine, asphalt, shingles."""

from __future__ import annotations

import numpy as np

from fsid.assets.material_registry import Layers, material_family
from fsid.assets.patterns import axes, cells, edge, level, noise, warp


@material_family(
    "cobblestones",
    tile_m=1.2,
    relief_m=0.03,
    colours=("8a857c 6b665f 4a4238", "9a8f80 74695c 5a5f3f", "a59a88 8a7a66 6b5f4a", "5f6468 7d8286 3f3a34"),
)
def cobblestones(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Rounded setts in rows, or wild paving, with sand and moss in the joints."""
    count = (9, 14, 7, 20)[variant]
    shift = 0.1 * np.stack([noise(rng, size, 2.0, low=3, high=4 * count) for _ in range(2)])
    near, second, value = cells(rng, size, count, (0.25, 0.35, 0.85, 0.2)[variant], shift)
    face = edge(second - near, 0.12, 0.12)
    dome = np.sqrt(np.clip((second - near) * 1.4, 0, 1))
    grit = noise(rng, size, 1.0, low=20)
    green = edge(noise(rng, size, 1.7), 0.5, 0.8) * (1 - face)
    return Layers(
        mix=np.clip(face * (0.7 * value + 0.1 * grit) + 0.3 * (1 - face), 0, 1),
        pattern=np.clip((1 - face) * 0.85, 0, 1),
        detail=np.clip(0.3 + 0.22 * dome + 0.035 * grit + 0.12 * green, 0, 1),
        roughness=0.75 - 0.2 * face * value,
        height=np.clip(0.9 * dome + 0.03 * grit, 0, 1),
    )


@material_family(
    "ashlar",
    tile_m=1.5,
    relief_m=0.02,
    colours=("b9a88a 9a8a6e d0c4a8", "8f8a82 6f6a64 b5b0a6", "a8785a 8a5f45 c9bca5", "cfc6b4 b5aa94 8a8272"),
)
def ashlar(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Hewn blocks of unequal width in courses."""
    rows = (6, 8, 10, 7)[variant]
    u, v = axes(size)
    ragged = noise(rng, size, 1.4, low=6, high=160)
    y = v * rows + 0.025 * ragged
    row = np.floor(y).astype(int) % rows
    block = np.zeros((size, size), np.int32)
    border = np.zeros((size, size), np.float32)
    for r in range(rows):
        widths = rng.dirichlet(np.full(int(rng.integers(3, 6)), 5.0))
        ends = (np.cumsum(widths) + rng.random()) % 1.0
        x = (u + 0.006 * ragged.T) % 1.0
        gap = np.min([np.abs((x - e + 0.5) % 1 - 0.5) for e in ends], axis=0)
        order = np.sort(ends)
        index = np.searchsorted(order, x) % len(order)
        here = row == r
        block = np.where(here, r * 8 + index, block)
        border = np.where(here, gap * rows, border)
    border = np.minimum(border, 0.5 - np.abs(y % 1 - 0.5))
    tone = rng.random(rows * 8)[block]
    face = edge(border, 0.06, 0.06)
    hewn = warp(noise(rng, size, 1.2, low=8), 0.1 * tone, 0.07 * tone)
    bed = noise(rng, size, 1.3, low=10, stretch=(8, 1))
    return Layers(
        mix=np.clip(0.7 * tone + 0.12 * hewn + 0.08 * bed, 0, 1),
        pattern=np.clip(0.8 * (1 - face), 0, 1),
        detail=np.clip(0.48 + 0.03 * hewn + 0.02 * bed - 0.08 * (1 - face), 0, 1),
        roughness=0.85,
        height=np.clip(face * (0.55 + 0.15 * tone + 0.07 * hewn) + 0.05, 0, 1),
    )


@material_family(
    "sandstone",
    tile_m=0.8,
    relief_m=0.006,
    colours=("d1a878 b5834f e6cda8", "a85f42 c9805a e3b08a", "c9bfa5 a89a7a e6e0cc", "8f7a6a 6f5a4a b5a08c"),
)
def sandstone(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Beds of sand that bend and fault, weathered into ledges."""
    _, v = axes(size)
    bend = noise(rng, size, 2.1, low=1, high=12, stretch=(2, 1))
    fold = v * (6, 4, 10, 8)[variant] + (0.3, 0.7, 0.2, 0.5)[variant] * bend
    steps = rng.random(64)
    at = (fold * 64 / (6, 4, 10, 8)[variant]) % 64
    low = np.floor(at).astype(int)
    share = edge(at - low, 0.8, 0.4)
    bed = steps[low % 64] * (1 - share) + steps[(low + 1) % 64] * share
    grain = noise(rng, size, 0.8, low=size / 50)
    weather = noise(rng, size, 1.6)
    return Layers(
        mix=np.clip(0.8 * bed + 0.12 * weather + 0.05 * grain, 0, 1),
        pattern=np.clip(0.5 * edge(bed, 0.8, 0.1) + 0.15 * level(weather - 0.8), 0, 1),
        detail=0.49 + 0.03 * grain + 0.015 * weather,
        roughness=0.9,
        height=np.clip(0.35 + 0.35 * bed + 0.05 * weather + 0.03 * grain, 0, 1),
    )


@material_family(
    "slate",
    tile_m=0.7,
    relief_m=0.006,
    colours=("4a5258 5f686e 2f3539", "5a4f58 75686f 3a3238", "3f4a45 566560 7a6a4f", "2a2d30 3d4145 8a8f93"),
)
def slate(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Split sheets: flat terraces with broken steps, mineral stains."""
    field = noise(rng, size, 1.9, low=1, high=120)
    steps = (5, 8, 12, 4)[variant]
    terrace = np.floor(field * steps / 2)
    riser = edge((field * steps / 2) % 1, 0.94, 0.12)
    ragged = noise(rng, size, 1.2, low=8)
    grain = noise(rng, size, 0.9, low=size / 50, stretch=(3, 1))
    stain = edge(noise(rng, size, 1.6, low=2), 1.2, 0.8)
    tone = (terrace * 0.37) % 1
    return Layers(
        mix=np.clip(0.5 * tone + 0.15 * ragged + 0.3 * riser, 0, 1),
        pattern=np.clip(0.5 * stain, 0, 1),
        detail=np.clip(0.48 + 0.03 * grain + 0.03 * ragged + 0.08 * riser, 0, 1),
        roughness=0.55 + 0.05 * ragged,
        height=np.clip(0.5 + (terrace + riser) / steps * 0.4 + 0.02 * ragged + 0.008 * grain, 0, 1),
    )


@material_family("travertine", tile_m=0.8, relief_m=0.002, colours="d9c9a8 bfa880 8a7450")
def travertine(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Banded limestone with rows of holes, filled or open; onyx for variant 3."""
    bend = noise(rng, size, 2.0, low=1, high=14)
    bands = warp(noise(rng, size, 1.2, low=4, stretch=(10, 1)), 0.0, 0.03 * bend)
    holes = edge(
        noise(rng, size, 0.9, low=14, stretch=(3, 1)) + 0.7 * bands, (2.2, 1.8, 2.5, 9)[variant], 0.3
    )
    crystal = noise(rng, size, 1.2, low=12)
    vein = np.exp(-np.abs(noise(rng, size, 1.8, low=2)) / 0.03) * (variant >= 2)
    return Layers(
        mix=level(bands + 0.2 * crystal, 0.8 if variant == 3 else 1.0),
        pattern=np.clip(0.7 * holes + 0.6 * vein, 0, 1),
        detail=np.clip(0.5 + 0.012 * crystal + 0.02 * bands - 0.15 * holes, 0, 1),
        roughness=0.2 + 0.5 * holes + 0.03 * crystal,
        height=np.clip(0.8 - 0.6 * holes + 0.01 * crystal, 0, 1),
    )


@material_family("asphalt", tile_m=0.8, relief_m=0.004, colours="3a3b3d 5a5a58 8a8880")
def asphalt(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Chippings in bitumen, worn, patched, cracked, with painted lines for odd variants."""
    near, second, value = cells(rng, size, (90, 120, 70, 100)[variant], 0.95)
    chip = edge(second - near, 0.2, 0.2) * (value > 0.35)
    u, v = axes(size)
    wear = noise(rng, size, 1.7)
    line = edge(0.08 - np.abs(v - 0.5 + 0 * u), 0, 0.004) * (variant % 2)
    paint = line * edge(wear + 0.6 * chip + 0.3 * noise(rng, size, 0.8, low=30), -0.3, 0.4)
    crack = np.exp(-np.abs(noise(rng, size, 1.6, low=2)) / 0.015) * edge(wear, 0.3, 0.4) * (variant >= 2)
    patch = edge(noise(rng, size, 2.2, low=1, high=6), 0.9, 0.01) * (variant == 2)
    return Layers(
        mix=np.clip((0.3 + 0.6 * value) * chip * (1 - 0.7 * patch) + 0.08 * wear, 0, 1),
        pattern=np.clip(0.95 * paint + 0.25 * (value > 0.9) * chip, 0, 1),
        detail=np.clip(0.42 + 0.1 * chip + 0.03 * wear - 0.25 * crack - 0.08 * patch + 0.3 * paint, 0, 1),
        roughness=0.85 - 0.2 * paint,
        height=np.clip(0.25 + 0.45 * chip + 0.05 * wear - 0.25 * crack, 0, 1),
    )


@material_family("shingles", tile_m=0.9, relief_m=0.015)
def shingles(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Roof tiles or fish scales in overlapping rows: square, round, pointed, wooden."""
    rows, columns = (10, 12, 14, 8)[variant], (12, 10, 14, 20)[variant]
    t = (np.arange(size, dtype=np.float32) + 0.5) / size
    u, y = t[None], t[:, None] * rows
    found = np.full((size, size), -1, np.int32)
    along, side = np.zeros((size, size), np.float32), np.zeros((size, size), np.float32)
    for above in (0, 1):  # a tile hangs over the row below it, so the row above is asked first
        row = np.floor(y).astype(int) - 1 + above
        x = u * columns + 0.5 * (row % 2)
        column = np.floor(x).astype(int) % columns
        dx = x % 1 - 0.5
        tip = (0 * dx, 0.45 - 0.9 * dx**2 / 0.5, 0.5 - 0.9 * np.abs(dx), 0 * dx)[variant]
        depth = y - row - 1
        inside = (depth < tip + 0 * y) if above == 0 else np.ones((size, size), bool)
        new = inside & (found < 0)
        found = np.where(new, (row % rows) * columns + column, found)
        along = np.where(new, depth + 1 - tip, along)
        side = np.where(new, np.abs(dx) + 0 * y, side)
    tone = rng.random(rows * columns)[found]
    along = np.clip(along, 0, 1.6)
    gap = edge(side, 0.485, 0.02)
    grain = noise(rng, size, 1.0, low=12, stretch=(1, 6 if variant == 3 else 1))
    weather = noise(rng, size, 1.7)
    lip = edge(along, 0.93, 0.06)
    return Layers(
        mix=np.clip(0.75 * tone + 0.1 * grain + 0.1 * weather, 0, 1),
        pattern=np.clip(0.35 * edge(weather, 1.2, 0.6) + 0.4 * gap, 0, 1),
        detail=np.clip(0.3 + 0.16 * along + 0.03 * grain - 0.15 * gap - 0.1 * lip, 0, 1),
        roughness=0.75,
        height=np.clip(0.1 + 0.6 * along - 0.2 * gap + 0.02 * grain, 0, 1),
    )
