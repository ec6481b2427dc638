"""What is made of yarn: lace, embroidery, spools, crochet, plaited ribbons."""

from __future__ import annotations

import numpy as np

from fsid.assets.material_registry import Layers, material_family
from fsid.assets.patterns import axes, edge, grid, level, noise


@material_family("lace", tile_m=0.2, relief_m=0.0008, colours="2a2228 3f343c f2ece2")
def lace(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """A white net over a dark ground with dense flowers, scallops and picots."""
    mesh = (40, 56, 72, 30)[variant]
    x, y, _, j = grid(size, mesh, mesh)
    x = x + 0 * y
    shifted = np.where(j % 2 == 0, x, (x + 1.0) % 1 - 0.5)
    ring = np.abs(np.hypot(shifted, y) - 0.42)
    net = edge(0.09 - ring, 0, 0.06)
    count = (3, 4, 5, 2)[variant]
    a, b, _, _ = grid(size, count, count)
    a, b = a + 0 * b, b + 0 * a
    radius, angle = np.hypot(a, b), np.arctan2(b, a)
    petals = int(rng.integers(5, 9))
    outline = 0.3 + 0.09 * np.cos(petals * angle)
    inside = edge(outline - radius, 0, 0.02)
    rib = 0.5 + 0.5 * np.cos(2 * np.pi * (radius * 14 + 0.6 * np.cos(petals * angle)))
    spokes = 0.5 + 0.5 * np.cos(petals * 4 * angle)
    dense = inside * edge(np.maximum(rib, 0.8 * spokes), 0.3, 0.3)
    border = np.exp(-(((radius - outline) / 0.018) ** 2))
    thread = np.clip(np.maximum(np.maximum(net * (1 - inside), dense), border), 0, 1)
    twist = noise(rng, size, 0.6, low=size / 16, high=size / 5)
    return Layers(
        mix=0.3 * level(noise(rng, size, 1.6)),
        pattern=0.97 * thread,
        detail=0.46 + 0.025 * twist * thread + 0.04 * border,
        roughness=0.85,
        height=np.clip(thread * (0.7 + 0.05 * twist), 0, 1),
    )


@material_family("embroidery", tile_m=0.2, relief_m=0.0012, colours="e8e0cc 8a2a32 2f5d3a")
def embroidery(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Cross-stitch charts or satin-stitch blossoms on linen."""
    threads = (80, 96, 64, 110)[variant]
    x, y, i, j = grid(size, threads, threads)
    weave = np.sqrt(np.clip(1 - np.minimum(2 * np.abs(x), 2 * np.abs(y)) ** 2, 0, 1)) * (
        (i + j) % 2 * 0.2 + 0.8
    )
    if variant % 2 == 0:
        tile = rng.random((threads // 4, threads // 4))
        tile = np.maximum(tile, tile.T)
        chart = np.tile(np.block([[tile, tile[:, ::-1]], [tile[::-1], tile[::-1, ::-1]]]), (2, 2)) > 0.72
        stitch = chart[j % len(chart), i % len(chart)]
        cross = np.maximum(edge(0.2 - np.abs(x - y), 0, 0.12), edge(0.2 - np.abs(x + y), 0, 0.12))
        thread, first = stitch * cross, (i // len(tile) + j // len(tile)) % 2 == 0
    else:
        count = (3, 4, 3, 6)[variant]
        a, b, p, q = grid(size, count, count)
        a, b = a + 0 * b, b + 0 * a
        angle, radius = np.arctan2(b, a), np.hypot(a, b)
        shape = edge(0.26 + 0.14 * np.cos(int(rng.integers(4, 8)) * angle) - radius, 0, 0.015)
        lines = 0.6 + 0.4 * np.cos(2 * np.pi * (angle * 30 + 6 * noise(rng, size, 1.5, high=20) * 0.1))
        thread, first = shape * lines, (p + q) % 2 == 0
    fibre = noise(rng, size, 0.5, low=size / 16)
    return Layers(
        mix=np.clip(0.95 * thread * first, 0, 1),
        pattern=np.clip(0.95 * thread * (1 - first), 0, 1),
        detail=np.clip(0.34 + 0.14 * weave * (thread < 0.1) + 0.16 * thread + 0.02 * fibre, 0, 1),
        roughness=0.85 - 0.4 * thread,
        height=np.clip(0.35 * weave + 0.55 * thread + 0.02 * fibre, 0, 1),
    )


@material_family(
    "thread_spools",
    tile_m=0.3,
    relief_m=0.012,
    colours=(
        "b8323a 2f6fa8 e6b422",
        "3e8d59 be4e8d ede3ce",
        "5a3f8f d97b2f 8fc1c9",
        "d8d2c4 6e8f3a a33b2b",
    ),
)
def thread_spools(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Rows of wound yarn cylinders of many colours: fine helical lines on round bodies."""
    columns, rows = ((8, 4), (12, 6), (6, 3), (16, 6))[variant]
    x, y, i, j = grid(size, columns, rows)
    x, y = x + 0 * y, y + 0 * x
    body = np.sqrt(np.clip(1 - (2.08 * x) ** 2, 0, 1))
    spool = (np.abs(y) < 0.44) * (np.abs(x) < 0.48)
    _, v = axes(size)
    turns = (72, 92, 60, 112)[variant]
    slant = rng.uniform(-0.4, 0.4, (rows, columns))[j % rows, i % columns]
    wound = np.abs(
        np.sin(np.pi * (v * turns * rows / 3 + 3 * slant * x + 0.15 * noise(rng, size, 1.2, low=8)))
    )
    pick = rng.random((2, rows, columns))[:, j % rows, i % columns]
    light = rng.uniform(0.55, 1.1, (rows, columns))[j % rows, i % columns]
    fibre = noise(rng, size, 0.4, low=size / 14, stretch=(3, 1))
    return Layers(
        mix=np.where(spool, pick[0], 0.5),
        pattern=np.where(spool, edge(pick[1], 0.55, 0.3), 0.1),
        detail=np.where(spool, (0.18 + 0.34 * body) * (0.55 + 0.45 * wound) * light + 0.02 * fibre, 0.06),
        roughness=0.75,
        height=np.clip(spool * (0.8 * body + 0.05 * wound), 0, 1),
    )


@material_family("crochet", tile_m=0.25, relief_m=0.004)
def crochet(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Yarn in rosettes and chains with holes between: granny squares, shells."""
    count = (3, 5, 4, 7)[variant]
    x, y, _, _ = grid(size, count, count)
    x, y = x + 0 * y, y + 0 * x
    square = np.maximum(np.abs(x), np.abs(y)) if variant % 2 == 0 else np.hypot(x, y)
    rounds = (7, 6, 9, 5)[variant]
    ring, angle = square * 2 * rounds, np.arctan2(y, x)
    stitches = 2 * np.floor(ring + 1) * 3
    along = (angle / (2 * np.pi) * stitches) % 1 - 0.5
    across = ring % 1 - 0.5
    bump = np.sqrt(np.clip(1 - (1.7 * along) ** 2 - (1.9 * across) ** 2, 0, 1))
    twist = 0.5 + 0.5 * np.sin(2 * np.pi * (4 * along + 5 * across + ring))
    fuzz = noise(rng, size, 0.6, low=size / 18)
    tone = rng.random((rounds + 3, 2))[np.floor(ring).astype(int) % (rounds + 3)]
    return Layers(
        mix=np.where(bump > 0.05, tone[..., 0], 0.2),
        pattern=edge(tone[..., 1], 0.6, 0.02) * (bump > 0.05) * 0.95,
        detail=np.clip(0.1 + bump * (0.3 + 0.1 * twist) + 0.02 * fuzz, 0, 1),
        roughness=0.93,
        height=np.clip(0.85 * bump + 0.08 * twist * bump + 0.015 * fuzz, 0, 1),
    )


@material_family("ribbons", tile_m=0.3, relief_m=0.004)
def ribbons(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Plaited bands over and under each other, each with its own stripe: straps, baskets, webbing."""
    count = (6, 12, 8, 16)[variant]
    x, y, i, j = grid(size, count, count)
    x, y = x + 0 * y, y + 0 * x
    over = (i + j) % 2 == 0 if variant % 2 == 0 else (i + 2 * j) % 4 < 2
    across, along = np.where(over, x, y), np.where(over, y, x)
    band = np.where(over, i + 0 * j, count + j + 0 * i) % (2 * count)
    tones = rng.random((3, 2 * count))[:, band]
    dome = np.clip(1 - (2 * np.abs(across)) ** 6, 0, 1) * (0.6 + 0.4 * np.cos(np.pi * along))
    stripe = edge(np.cos(2 * np.pi * across * (1 + np.floor(4 * tones[2]))), 0.2, 0.2)
    ribs = np.cos(2 * np.pi * along * 14)
    fibre = noise(rng, size, 0.5, low=size / 18)
    return Layers(
        mix=np.clip(tones[0] + 0.02 * fibre, 0, 1),
        pattern=0.9 * stripe * (tones[1] > 0.45),
        detail=0.14 + 0.34 * dome + 0.02 * ribs * dome + 0.015 * fibre,
        roughness=0.55 + 0.3 * (tones[2] > 0.5),
        height=np.clip(0.85 * dome + 0.02 * ribs, 0, 1),
    )
