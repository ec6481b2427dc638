"""Outdoor stuff: grass, leaves, bark, gravel, sand, fur. Layers of overlapping shapes make the edges."""

from __future__ import annotations

import numpy as np

from fsid.assets.material_registry import Layers, material_family
from fsid.assets.patterns import axes, cells, edge, level, noise, shade, stack, turned, warp


def _leaf_outlines(
    rng: np.random.Generator, count: int, length: float, width: float, bend: float
) -> list[np.ndarray]:
    """Pointed ovals of random size and direction, bent sideways; tile units."""
    t = np.linspace(0, 1, 9)
    half = np.sin(np.pi * t) ** 0.8
    out = []
    for _ in range(count):
        long = length * rng.uniform(0.5, 1.3)
        arc = rng.normal(0, bend) * long * (t - t * t)
        side = half * width * rng.uniform(0.6, 1.3) * long
        shape = np.r_[np.c_[t * long, arc + side], np.c_[t * long, arc - side][::-1]]
        out.append(turned(shape, rng.uniform(0, 2 * np.pi)) + rng.random(2))
    return out


@material_family(
    "grass",
    tile_m=0.5,
    relief_m=0.01,
    colours=(
        "4a6b24 6f8f38 b5a85a",
        "56752c 86a048 c2b36a",
        "7a8a3a a5a850 d0bf7a",
        "9a8f4a bfae6a dccb8f",
    ),
)
def grass(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Blades over blades; longer and drier with the variant."""
    count = (4200, 3200, 2400, 1700)[variant]
    index = stack(size, _leaf_outlines(rng, count, (0.08, 0.11, 0.15, 0.2)[variant], 0.035, 0.6))
    depth = shade(index, np.linspace(0.05, 1, count))
    tone = shade(index, rng.random(count))
    fibre = noise(rng, size, 0.2, low=size / 8)
    return Layers(
        mix=tone,
        pattern=edge(tone, (0.97, 0.93, 0.8, 0.6)[variant], 0.02),
        detail=0.13 + 0.4 * depth + 0.04 * fibre,
        roughness=0.6 + 0.1 * tone,
        height=depth,
    )


@material_family(
    "leaves",
    tile_m=0.6,
    relief_m=0.012,
    colours=(
        "4f6f2a 7a9a3f 8f5a2a",
        "5f7f38 8aa850 b59a3f",
        "3f5f2f 648a45 a86a34",
        "a5602a c98a3f 6f3a1f",
    ),
)
def leaves(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Broad leaves over each other, each with a midrib and side veins."""
    count = (420, 700, 260, 1100)[variant]
    long = (0.16, 0.12, 0.22, 0.09)[variant]
    outlines = _leaf_outlines(rng, count, long, (0.25, 0.16, 0.3, 0.38)[variant], 0.2)
    index = stack(size, [half for outline in outlines for half in (outline, _half(outline))])
    depth = shade(index, np.repeat(np.linspace(0.05, 1, count), 2))
    tone = shade(index, np.repeat(rng.random(count), 2))
    across = shade(index, np.tile((0.3, 0.7), count))
    vein = noise(rng, size, 0.8, low=30, stretch=(1, 3))
    spots = edge(noise(rng, size, 1.0, low=20), 2.0, 0.5)
    return Layers(
        mix=np.clip(0.7 * tone + 0.3 * across, 0, 1),
        pattern=np.maximum(0.8 * spots, edge(tone, 0.9, 0.02)),
        detail=0.16 + 0.36 * depth + 0.3 * (across - 0.5) + 0.03 * vein,
        roughness=0.35 + 0.25 * tone,
        height=np.clip(depth + 0.02 * vein, 0, 1),
    )


def _half(outline: np.ndarray) -> np.ndarray:
    """One side of a leaf: its midrib is where the two halves meet."""
    middle = (outline[: len(outline) // 2] + outline[::-1][: len(outline) // 2]) / 2
    return np.r_[outline[: len(outline) // 2], middle[::-1]]


@material_family("dead_leaves", tile_m=0.4, relief_m=0.002)
def dead_leaves(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Occluding shapes with power-law sizes, the classic model of natural image statistics.

    Lee, Mumford and Huang, "Occlusion models for natural images", IJCV 41, 2001: p(r) ~ r^-3 makes the
    image scale invariant. Variant: discs, triangles, rectangles, stars.
    """
    count = 1400
    radius = 0.008 / np.sqrt(rng.random(count) + 0.0015)
    corners = (20, 3, 4, 10)[variant]
    angle = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    star = 1 - 0.5 * (np.arange(corners) % 2) * (variant == 3)
    unit = np.c_[np.cos(angle), np.sin(angle)] * star[:, None]
    outlines = []
    for r in radius:
        turn = rng.uniform(0, 2 * np.pi)
        outlines.append(turned(unit * (r, r * rng.uniform(0.4, 1)), turn) + rng.random(2))
    index = stack(size, outlines)
    hue = rng.random(count)
    grain = noise(rng, size, 0.5, low=size / 16)
    return Layers(
        mix=shade(index, rng.random(count)),
        pattern=shade(index, np.where(hue > 0.6, hue, 0)),
        detail=0.3 + 0.4 * shade(index, rng.random(count)) + 0.02 * grain,
        roughness=0.25 + 0.6 * shade(index, rng.random(count)),
        height=shade(index, np.linspace(0.1, 1, count)),
    )


@material_family(
    "bark",
    tile_m=0.5,
    relief_m=0.015,
    colours=(
        "6b5a48 8f7a62 8a9a6a",
        "7a6a58 a08c74 b5b5a0",
        "5a4636 7d6248 6f7f4a",
        "8f8578 b0a698 c9b890",
    ),
)
def bark(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Ridges along v between warped cracks; flat plates for odd variants."""
    bend = noise(rng, size, 1.8, low=2, high=30, stretch=(1, 3)) * 0.03
    ridge = warp(np.abs(noise(rng, size, 1.0, low=6 + 3 * variant, stretch=(1, 5))), bend, 0)
    fine = noise(rng, size, 0.6, low=size / 24, stretch=(1, 4))
    crack = 1 - edge(ridge, 0.35, 0.5)
    plates = level(noise(rng, size, 1.5, low=4)) if variant % 2 else 0.5
    lichen = edge(noise(rng, size, 1.4, low=3) + 0.3 * fine, 1.5, 0.4)
    return Layers(
        mix=np.clip(level(fine + 0.5 * ridge) * (1 - crack), 0, 1),
        pattern=0.7 * lichen,
        detail=0.55 - 0.35 * crack + 0.07 * fine,
        roughness=0.9,
        height=np.clip(ridge / 2.2, 0, 0.8) * (0.7 + 0.3 * plates) + 0.04 * fine + 0.1,
    )


@material_family(
    "gravel",
    tile_m=0.5,
    relief_m=0.02,
    colours=(
        "9a9088 7a726a c9c0b0",
        "8a7a6c 6b5e54 d8d0c4",
        "6f7478 55595c b5b0a8",
        "b59a7a 8f765a e0d4be",
    ),
)
def gravel(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Pebbles in shadowed gaps, with smaller ones between them."""
    count = (18, 26, 40, 12)[variant]
    shift = 0.12 * np.stack([noise(rng, size, 2.0, low=6, high=8 * count) for _ in range(2)])
    near, second, value = cells(rng, size, count, 0.9, shift)
    dome = np.sqrt(np.clip((second - near) * 1.6, 0, 1))
    small_near, small_second, small = cells(rng, size, count * 3, 0.9)
    gap = 1 - edge(dome, 0.35, 0.2)
    pebble = np.sqrt(np.clip(small_second - small_near, 0, 1))
    grain = noise(rng, size, 0.5, low=size / 16)
    tone = np.where(gap > 0.5, small, value)
    return Layers(
        mix=np.clip(tone + 0.1 * grain, 0, 1),
        pattern=edge((tone * 5) % 1, 0.75, 0.02) * 0.9,
        detail=0.18 + 0.3 * dome * (1 - gap) + 0.22 * pebble * gap + 0.05 * grain,
        roughness=0.6 + 0.3 * tone,
        height=np.where(gap > 0.5, 0.25 * pebble, 0.2 + 0.75 * dome) + 0.02 * grain,
    )


@material_family(
    "sand",
    tile_m=0.4,
    relief_m=0.006,
    colours=(
        "c5ae83 d5c39e 816c4b",
        "be9e71 d3b993 655441",
        "c5b69a d3c8b3 93856a",
        "a58a68 c2a882 5f4f3c",
    ),
)
def sand(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Single grains of one to three texels, some dark or glittering, over wind ripples."""
    _, v = axes(size)
    bend = noise(rng, size, 2.2, low=2, high=20)
    ripples = np.sin(2 * np.pi * ((0, 6, 12, 3)[variant] * v + 0.25 * bend))
    fine = noise(rng, size, 0.0, high=size / 3)
    coarse = noise(rng, size, 0.3, low=size / 20, high=size / 6)
    return Layers(
        mix=level(0.8 * fine + 0.6 * coarse + 0.3 * bend),
        pattern=np.maximum(edge(fine, 2.3, 0.2), edge(coarse, 2.4, 0.2)),
        detail=0.5 + 0.07 * fine + 0.04 * coarse + 0.04 * ripples * (variant > 0),
        roughness=0.9 - 0.5 * edge(fine, 2.8, 0.2),
        height=0.45 + 0.28 * ripples * (variant > 0) + 0.05 * bend + 0.04 * fine + 0.04 * coarse,
    )


@material_family(
    "fur",
    tile_m=0.3,
    relief_m=0.005,
    colours=(
        "8a6a45 b08f62 3a2a1c",
        "bba98a cec5b0 5b3f24",
        "5f5a54 8a857c 2a2624",
        "9e6631 be8b4f d4cbbd",
    ),
)
def fur(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Hair combed along a slowly turning direction, with coat markings."""
    bend = noise(rng, size, 2.2, low=1, high=8) * (0.03, 0.05, 0.08, 0.12)[variant]
    strands = warp(noise(rng, size, 0.1, low=size / 12, stretch=(30, 1)), 0, bend)
    locks = warp(noise(rng, size, 0.8, low=8, stretch=(6, 1)), 0, bend)
    marks = noise(rng, size, 2.5, low=4, high=16)
    return Layers(
        mix=level(0.5 * strands + 0.8 * locks),
        pattern=0.9 * edge(marks + 0.12 * strands, 0.6, 0.2) * (variant > 0),
        detail=0.42 + 0.1 * strands + 0.07 * locks,
        roughness=0.6 + 0.05 * strands,
        height=0.5 + 0.1 * strands + 0.16 * locks,
    )
