"""Wood: planks, burl and turned grain, parquet."""

from __future__ import annotations

import numpy as np

from fsid.assets.material_registry import Layers, material_family
from fsid.assets.patterns import axes, edge, joint, level, noise, warp


def _fibres(rng: np.random.Generator, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Grain along u: slow colour bands and pores one texel wide."""
    bands = noise(rng, size, 1.0, low=3, stretch=(14, 1))
    pores = noise(rng, size, 0.3, low=size / 12, stretch=(30, 1))
    return bands, pores


@material_family(
    "wood_planks",
    tile_m=1.0,
    relief_m=0.003,
    colours=(
        "9a6b42 b98a5c 3a2818",
        "6f4a30 8f6544 22160c",
        "b59468 cfb288 5a4630",
        "8a8278 a59c90 4a443c",
    ),
)
def wood_planks(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Floor boards along u with staggered ends; each board cut from its own place of the grain."""
    rows = (6, 8, 10, 16)[variant]
    u, v = axes(size)
    row = np.floor(v * rows).astype(int)
    offset = rng.random(rows)[row]
    along = (u + offset) % 1.0 * 2
    board = row * 2 + np.floor(along).astype(int)
    shade, shift = rng.random(rows * 2), rng.random((rows * 2, 2)).astype(np.float32)
    bands, pores = _fibres(rng, size)
    bands = warp(bands, shift[board, 0], shift[board, 1])
    to_side = np.abs((v * rows) % 1 - 0.5)
    to_end = np.abs(along % 1 - 0.5) * rows / 2
    sides = joint(to_side, 0.485, 0.03, rows / size)
    gap = np.maximum(sides, joint(to_end, rows / 4 - 0.015, 0.03, rows / size, rows / 4))
    return Layers(
        mix=level(bands + 1.6 * (shade[board] - 0.5)),
        pattern=0.85 * gap + 0.15 * (1 - gap) * level(pores - 1.2, 0.4),
        detail=0.5 + 0.05 * pores + 0.15 * (shade[board] - 0.5) - 0.3 * gap,
        roughness=0.4 + 0.06 * pores + 0.3 * gap,
        height=(1 - gap) * (0.9 + 0.03 * pores),
    )


@material_family(
    "wood_grain",
    tile_m=0.5,
    relief_m=0.0008,
    colours=(
        "a8743f c9955a 4a2e18",
        "7a4f2f a06f45 2f1c0e",
        "c9a06a e0be8a 6b4a28",
        "8f6038 b5854f 3a2412",
    ),
)
def wood_grain(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """One cut of wood: growth rings warped by noise; straight for variant 0, burl for 3."""
    _, v = axes(size)
    twist = (0.4, 0.7, 1.2, 1.9)[variant]
    bend = noise(rng, size, 1.8, high=60, stretch=(4 - variant, 1))
    ring = (v * (16, 22, 14, 8)[variant] + bend * twist) % 1.0
    late = (ring * edge(1 - ring, 0.04, 0.08)) ** 3
    bands, pores = _fibres(rng, size)
    eyes = edge(noise(rng, size, 2.2), 1.9, 0.5) * (variant > 1)
    return Layers(
        mix=np.clip(0.65 * late + 0.35 * level(bands), 0, 1),
        pattern=np.clip(0.8 * eyes + 0.25 * level(pores - 1.4, 0.4), 0, 1),
        detail=0.5 + 0.055 * pores - 0.06 * (late - 0.3),
        roughness=0.35 + 0.1 * level(pores),
        height=0.6 - 0.3 * late + 0.07 * pores,
    )


@material_family(
    "parquet",
    tile_m=1.2,
    relief_m=0.002,
    colours=(
        "a8743f c9955a 3a2616",
        "7a4a2a 96623a 24140a",
        "c9a878 dfc49a 5a4226",
        "8f5a34 ae7a4c 2a180c",
    ),
)
def parquet(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Basket-weave parquet: squares of parallel strips that alternate in direction."""
    squares, strips = (8, 6, 4, 6)[variant], (4, 5, 7, 3)[variant]
    u, v = axes(size)
    x, y = u * squares, v * squares
    ix, iy = np.floor(x).astype(int), np.floor(y).astype(int)
    flip = (ix + iy) % 2 == 1
    across = np.where(flip, x % 1, y % 1) * strips
    strip = (iy * squares + ix) * strips + np.floor(across).astype(int)
    shade = rng.random(squares * squares * strips)[strip]
    bands, pores = _fibres(rng, size)
    bands, pores = np.where(flip, bands.T, bands), np.where(flip, pores.T, pores)
    to_end = np.maximum(np.abs(x % 1 - 0.5), np.abs(y % 1 - 0.5))
    sides = joint(np.abs(across % 1 - 0.5), 0.48, 0.05, squares * strips / size)
    gap = np.maximum(sides, joint(to_end, 0.495, 0.012, squares / size))
    return Layers(
        mix=level(0.7 * bands + 2.4 * (shade - 0.5)),
        pattern=0.8 * gap,
        detail=0.5 + 0.04 * pores + 0.12 * (shade - 0.5) - 0.25 * gap,
        roughness=0.3 + 0.05 * pores + 0.3 * gap,
        height=(1 - gap) * (0.85 + 0.1 * shade + 0.02 * pores),
    )
