"""More wood: plywood, burl, chipboard, peeling paint, end grain, wicker, cork, bamboo."""

from __future__ import annotations

import numpy as np

from fsid.assets.material_registry import Layers, material_family
from fsid.assets.patterns import axes, cells, edge, grid, joint, level, noise, shade, stack, turned, warp


@material_family("plywood", tile_m=0.8, relief_m=0.0006, colours="d9b98a c79c63 8a6238")
def plywood(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Rotary-cut veneer: wide cathedral figure, small knots with plugs, flecks; edge plies for variant 3."""
    u, v = axes(size)
    field = noise(rng, size, 2.1, low=1, high=24, stretch=(3.5, 1))
    knots = edge(noise(rng, size, 2.0, low=4, high=9), (2.3, 2.0, 2.6, 9)[variant], 0.5)
    rings = (field * (2.2, 3.4, 1.6, 2.5)[variant] + 1.5 * knots) % 1
    late = rings**4 * edge(1 - rings, 0.05, 0.1)
    flecks = level(noise(rng, size, 0.5, low=size / 14, stretch=(16, 1)) - 1.3, 0.5)
    plies = np.abs((v * 8) % 2 - 1) + 0 * u
    ply = edge(plies, 0.5, 0.06) if variant == 3 else np.float32(0)
    grain = noise(rng, size, 0.7, low=size / 24, stretch=(8, 1))
    return Layers(
        mix=np.clip(0.55 * late + 0.25 * level(field) + 0.6 * knots + 0.5 * ply, 0, 1),
        pattern=np.clip(0.5 * flecks + 0.75 * edge(knots, 0.7, 0.3) + 0.25 * ply, 0, 1),
        detail=0.5 + 0.025 * grain - 0.04 * late,
        roughness=0.5 + 0.05 * grain,
        height=np.clip(0.6 - 0.15 * late + 0.05 * grain - 0.25 * flecks, 0, 1),
    )


@material_family(
    "burl",
    tile_m=0.4,
    relief_m=0.0003,
    colours=(
        "8a5a2f c08a4a 3a2212",
        "6b3a22 a5653a 2a150c",
        "b98a55 dcb880 5a3a1e",
        "54382a 84604a 22140e",
    ),
)
def burl(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Root wood: eyes around which the grain swirls, polished."""
    bend = [noise(rng, size, 1.7, low=2, high=60) for _ in range(2)]
    amount = np.float32((0.02, 0.035, 0.05, 0.03)[variant])
    near, _, value = cells(rng, size, (14, 20, 9, 28)[variant], 0.95)
    eye = np.exp(-((near / 0.16) ** 2)) * (value > 0.35)
    swirl = warp(noise(rng, size, 1.7, low=2, high=200), bend[0] * amount, bend[1] * amount)
    figure = (swirl * 1.6 + 2.2 * eye) % 1
    line = figure**3 * edge(1 - figure, 0.05, 0.1)
    pores = level(noise(rng, size, 0.6, low=size / 24) - 1.6, 0.5)
    return Layers(
        mix=np.clip(level(swirl) * 0.7 + 0.4 * line, 0, 1),
        pattern=np.clip(0.8 * edge(eye, 0.6, 0.5) + 0.35 * line + 0.3 * pores, 0, 1),
        detail=0.5 + 0.03 * swirl,
        roughness=0.16 + 0.08 * pores,
        height=np.clip(0.7 - 0.1 * line - 0.2 * pores, 0, 1),
    )


@material_family("chipboard", tile_m=0.5, relief_m=0.001, colours="d2ae74 b98d50 7a5a30")
def chipboard(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Strands pressed in all directions (OSB), finer with the variant down to particle board."""
    count = (900, 1600, 3000, 6000)[variant]
    long = (0.09, 0.07, 0.045, 0.02)[variant]
    outlines = []
    for length, width, turn, x, y in zip(
        long * rng.uniform(0.5, 1.5, count),
        rng.uniform(0.12, 0.4, count),
        rng.uniform(0, np.pi, count),
        rng.random(count),
        rng.random(count),
        strict=True,
    ):
        corners = np.array(((-1, -0.7), (0.9, -1), (1, 0.8), (-0.8, 1))) * (length, length * width) / 2
        outlines.append(turned(corners, turn) + np.array((x, y)))
    index = stack(size, outlines)
    tone = shade(index, rng.random(count), 0.5)
    knotted = shade(index, (rng.random(count) > 0.93).astype(float))
    depth = shade(index, rng.random(count), 0.5)
    grain = noise(rng, size, 0.8, low=size / 40)
    return Layers(
        mix=np.clip(tone + 0.08 * grain, 0, 1),
        pattern=0.6 * knotted + 0.12 * level(grain - 1, 0.5),
        detail=0.44 + 0.12 * depth + 0.025 * grain,
        roughness=0.6 + 0.1 * depth,
        height=np.clip(0.2 + 0.6 * depth + 0.03 * grain, 0, 1),
    )


@material_family(
    "peeling_paint",
    tile_m=0.8,
    relief_m=0.0025,
    colours=(
        "d8d4c6 b9b3a2 6b4a30",
        "4f7f86 3f656b 8a6a48",
        "a8503f 8a3f32 5a4634",
        "e3d6a8 c9b884 7a5f42",
    ),
)
def peeling_paint(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Old paint that has cracked along the grain and flaked off the boards below."""
    grain = noise(rng, size, 1.1, low=6, stretch=(12, 1))
    shift = 0.3 * np.stack([noise(rng, size, 1.7, low=3, high=80) for _ in range(2)])
    near, second, value = cells(rng, size, (14, 22, 32, 18)[variant], 0.95, shift)
    lost = edge(noise(rng, size, 1.5, low=2) + 1.2 * (value - 0.5), (1.4, 0.9, 0.4, 0.0)[variant], 0.04)
    crack = (1 - edge(second - near, 0.05, 0.05)) * edge(noise(rng, size, 1.8), 0.3, 1.5)
    bare = np.maximum(lost, crack)
    rim = np.clip(edge(noise(rng, size, 0.6, low=40), 0, 2), 0, 1)
    chalk = noise(rng, size, 1.7)
    return Layers(
        mix=np.clip(0.5 * level(chalk), 0, 1),
        pattern=0.95 * bare,
        detail=0.5 + 0.02 * chalk + bare * 0.08 * grain,
        roughness=0.5 + 0.35 * bare,
        height=np.clip((1 - bare) * (0.7 + 0.1 * value + 0.03 * rim) + bare * (0.3 + 0.08 * grain), 0, 1),
    )


@material_family("end_grain", tile_m=0.4, relief_m=0.0008, colours="b5834e 8a5c33 3f2614")
def end_grain(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Butcher's block: sawn ends with arcs of rings, rays and checks."""
    count = (4, 6, 8, 3)[variant]
    x, y, i, j = grid(size, count, count)
    centre = rng.uniform(-1.2, 1.2, (2, count, count))[:, j, i]
    pitch = rng.uniform(9, 20, (count, count))[j, i]
    tone = rng.random((count, count))[j, i]
    dx, dy = x - centre[0], y - centre[1]
    wobble = noise(rng, size, 1.8, low=2) * 0.03
    radius = np.hypot(dx, dy) + wobble
    ring = (radius * pitch) % 1
    late = ring**4 * edge(1 - ring, 0.04, 0.08)
    angle = np.arctan2(dy, dx)
    rays = level(noise(rng, size, 0.8, low=size / 20) - 1, 0.5) * (0.5 + 0.5 * np.cos(160 * angle))
    check = edge(np.cos(angle * 3 + 6 * tone), 0.9985, 0.002) * edge(noise(rng, size, 1.6), 0.6, 0.3)
    to_side = np.maximum(np.abs(x), np.abs(y))
    gap = joint(to_side, 0.488, 0.012, count / size)
    return Layers(
        mix=np.clip(0.6 * late + 0.5 * tone, 0, 1),
        pattern=np.clip(0.8 * gap + 0.7 * check + 0.2 * rays, 0, 1),
        detail=0.5 + 0.1 * (tone - 0.5) - 0.05 * late,
        roughness=0.5,
        height=np.clip((0.8 - 0.15 * late) * (1 - gap) - 0.4 * check, 0, 1),
    )


@material_family("wicker", tile_m=0.3, relief_m=0.008, colours="c79a5f a5773f 4a3018")
def wicker(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Canes woven around stakes, with shadowed gaps; caning with holes for variant 3."""
    stakes, canes = (14, 20, 10, 16)[variant], (40, 60, 28, 18)[variant]
    u, v = axes(size)
    wobble = noise(rng, size, 1.6, low=2, high=30) * np.float32(0.035)
    y = v * canes + wobble
    j = np.floor(y).astype(int) % canes
    wave = np.cos(np.pi * (u * stakes + 0.5 + j % 2))  # highest and lowest at stakes
    across = y % 1 - 0.5
    cane = np.sqrt(np.clip(1 - (2.05 * across) ** 2, 0, 1))
    height = cane * (0.55 + 0.35 * wave)
    x = (u * stakes + wobble.T) % 1 - 0.5
    stake = np.sqrt(np.clip(1 - (4.2 * x) ** 2, 0, 1)) * 0.6
    if variant == 3:
        height = np.where(np.abs(across) < 0.33, height, 0)
    top = np.maximum(height, stake)
    tone = rng.random(canes)[j]
    fibre = noise(rng, size, 0.6, low=size / 20, stretch=(14, 1))
    return Layers(
        mix=np.clip(tone + 0.1 * fibre, 0, 1),
        pattern=np.clip(0.9 * (1 - edge(top, 0.12, 0.2)) + 0.1 * level(fibre - 1, 0.5), 0, 1),
        detail=np.clip(0.14 + 0.42 * top + 0.025 * fibre, 0, 1),
        roughness=0.45 + 0.1 * tone,
        height=np.clip(top + 0.01 * fibre, 0, 1),
    )


@material_family("cork", tile_m=0.3, relief_m=0.0012, colours="c69a68 a87848 5a3a20")
def cork(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Pressed granules of bark with dark lenticels and pits."""
    shift = 0.25 * np.stack([noise(rng, size, 1.7, low=8, high=200) for _ in range(2)])
    near, second, value = cells(rng, size, (30, 48, 70, 20)[variant], 0.95, shift)
    bond = 1 - edge(second - near, 0.08, 0.1)
    grain = noise(rng, size, 0.9, low=size / 50)
    pits = edge(grain + 0.5 * noise(rng, size, 1.2, low=8), 2.0, 0.5)
    return Layers(
        mix=np.clip(value + 0.12 * grain, 0, 1),
        pattern=np.clip(0.75 * pits + 0.3 * bond + 0.5 * (value > 0.92), 0, 1),
        detail=0.5 + 0.035 * grain - 0.06 * bond,
        roughness=0.85,
        height=np.clip(0.75 - 0.3 * bond - 0.4 * pits + 0.03 * grain, 0, 1),
    )


@material_family("bamboo", tile_m=0.6, relief_m=0.01, colours="d3b873 b39247 5f4a22")
def bamboo(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Canes or slats side by side with nodes, blinds tied by cords for odd variants."""
    canes = (12, 40, 20, 64)[variant]
    u, v = axes(size)
    x = u * canes
    i = np.floor(x).astype(int)
    body = np.sqrt(np.clip(1 - (2.06 * (x % 1 - 0.5)) ** 2, 0, 1)) + 0 * v
    node_at = (v * (2 + i % 2) + rng.random(canes)[i]) % 1 - 0.5
    node = np.exp(-((node_at / 0.012) ** 2))
    tone = rng.random(canes)[i] + 0 * v
    fibre = noise(rng, size, 0.7, low=size / 24, stretch=(1, 20))
    cord = (np.abs((v * 6) % 1 - 0.5) < 0.035) * (variant % 2)
    twist = 0.5 + 0.5 * np.cos(2 * np.pi * (u * 160 + v * 80))
    return Layers(
        mix=np.clip(0.7 * tone + 0.08 * fibre + 0.3 * node, 0, 1),
        pattern=np.clip(0.8 * (1 - edge(body, 0.2, 0.3)) + 0.5 * node + 0.5 * cord * twist, 0, 1),
        detail=np.clip(0.18 + 0.34 * body + 0.02 * fibre, 0, 1),
        roughness=0.35 + 0.3 * cord,
        height=np.clip(0.8 * body + 0.12 * node + 0.1 * cord, 0, 1),
    )
