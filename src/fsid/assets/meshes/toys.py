"""Toys: blocks, bricks, cars, gears."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np

from fsid.assets.forms import fluted, plate, scatter_rand, slab, spread
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import (
    Solid,
    ball,
    box,
    cone,
    copies,
    cylinder,
    join,
    lathe,
)


@mesh_family("toy_blocks")
def toy_blocks(rng: np.random.Generator) -> Parts:
    """Cubes, bars, cylinders, cones and arches of a building set, in towers and scattered."""
    parts: tuple[list[Solid], ...] = ([], [], [])
    size = rng.uniform(0.03, 0.06)
    spots = scatter_rand(rng, int(rng.integers(2, 6)), 2.6 * size)
    towers: list[list[Solid]] = []
    colours: list[int] = []
    for _ in spots:
        z = 0.0
        tower: list[Solid] = []
        for _ in range(int(rng.integers(1, 6))):
            block, tall = _block_rand(rng, size, arch=not tower)
            dx, dy = rng.normal(0, 0.08, 2) * size
            colours.append(int(rng.integers(3)))
            tower.append(block.turned(z_deg=rng.uniform(0, 360)).at(dx, dy, z))
            z += tall + 0.0002
            if tall == 0.0:
                break
        towers.append(tower)
    for colour, block in zip(colours, chain(*spread(towers, spots)), strict=True):
        parts[colour].append(block)
    named = zip(("wood_blocks", "wood_second", "wood_third"), parts, strict=True)
    return {name: solids for name, solids in named if solids}


@mesh_family("studded_bricks")
def studded_bricks(rng: np.random.Generator) -> Parts:
    """Plastic bricks with studs, stacked crosswise in four colours."""
    unit, tall, thick = 0.008, 0.0096, 0.0032
    stud = lathe([(0.0024, 0), (0.0024, 0.0017), (0.0021, 0.002), (0, 0.002)], 14)
    ground = np.array((14, 10))
    parts: tuple[list[Solid], ...] = ([box(14 * unit, 10 * unit, thick, 0.0003, 1)], [], [], [])
    taken = np.zeros((5, *ground), bool)
    for _ in range(int(rng.integers(1, 5))):
        low = ground // 2 + (rng.integers(-4, 5), rng.integers(-3, 4))
        tower: list[np.ndarray] = []
        colours: list[int] = []
        for _ in range(int(rng.integers(1, 6))):
            size = np.array((rng.choice((1, 2, 2, 3, 4)), rng.choice((1, 2, 2, 4))))[
                :: 1 - 2 * rng.integers(2)
            ]
            if tower:  # on one stud at least
                low = np.clip(low + rng.integers(-1, 2, 2), tower[-1][0] + 1 - size, tower[-1][1] - 1)
            tower.append(np.stack([low, low + size]))
            colours.append(int(rng.integers(4)))
        for level, (low, high) in enumerate(_beside(tower, taken)):
            taken[level, low[0] : high[0], low[1] : high[1]] = True
            size, (x, y) = high - low, (low + high - ground) / 2 * unit
            grid = (np.indices(tuple(size)).reshape(2, -1).T - (size - 1) / 2) * unit
            studs = copies(stud, np.repeat(np.eye(3)[None], len(grid), 0), np.c_[grid, 0 * grid[:, 0]])
            long, wide = (float(side) for side in size * unit - 0.0002)
            brick = box(long, wide, tall, 0.0003, 1)
            placed = join([brick, studs.at(z=tall - 0.0003)]).at(x, y, thick + level * tall)
            parts[colours[level]].append(placed)
    named = zip(("plastic_a", "plastic_b", "plastic_c", "plastic_d"), parts, strict=True)
    return {name: solids for name, solids in named if solids}


def _beside(tower: list[np.ndarray], taken: np.ndarray) -> list[np.ndarray]:
    """Bricks (low, high) of a tower, level by level, moved as little as need be to cells that are not `taken`
    (levels, x, y); none where there is no room."""
    moves = np.indices([2 * n - 1 for n in taken.shape[1:]]).reshape(2, -1).T - np.array(taken.shape[1:]) + 1
    for move in moves[np.argsort((moves**2).sum(1), kind="stable")]:
        moved = [brick + move for brick in tower]
        inside = all((low >= 0).all() and (high <= taken.shape[1:]).all() for low, high in moved)
        if inside and not any(
            taken[level, low[0] : high[0], low[1] : high[1]].any() for level, (low, high) in enumerate(moved)
        ):
            return moved
    return []


@mesh_family("toy_car")
def toy_car(rng: np.random.Generator) -> Parts:
    """Car, van or truck: rounded body, cabin with windows, four to six wheels, lamps, bumpers."""
    x, y, z = rng.uniform(0.08, 0.18), rng.uniform(0.04, 0.06), rng.uniform(0.018, 0.03)
    wheel = rng.uniform(0.32, 0.5) * z + 0.004
    wheel = min(wheel, 0.15 * x)
    truck = rng.random() < 0.35
    nose, tail = rng.uniform(0.05, 0.3), 0.35 if truck else rng.uniform(0.0, 0.25)
    soft = rng.uniform(0.15, 0.45) * z
    body = [box(x, y, z, soft, 4).at(z=wheel)]
    cabin, start = x * (1 - nose - tail), x * (-0.5 + nose)
    lean_front, lean_back = rng.uniform(0.1, 0.5) * cabin, rng.uniform(0, 0.35) * cabin
    roof = rng.uniform(0.7, 1.3) * z

    def shear(p: np.ndarray) -> np.ndarray:
        t = np.clip(p[:, 2] / roof, 0, 1)
        along = p[:, 0] / cabin + 0.5
        px = start + lean_front * t + along * (cabin - (lean_front + lean_back) * t)
        return np.c_[px, p[:, 1] * (1 - 0.16 * t), p[:, 2]]

    house = box(cabin, 0.92 * y, roof, 0.004, 3).warped(shear)
    body.append(house.at(z=wheel + z - 0.0006))
    middle = start + cabin / 2 + (lean_front - lean_back) / 4
    side = box(0.66 * (cabin - lean_front), 0.0025, 0.5 * roof, 0.0008, 1)
    panes = [side.turned(x_deg=-s * 5).at(middle, s * 0.435 * y, wheel + z + 0.25 * roof) for s in (-1, 1)]
    windscreen = box(0.0025, 0.7 * y, 0.62 * np.hypot(roof, lean_front), 0.0008, 1)
    windscreen = windscreen.turned(y_deg=np.degrees(np.arctan2(lean_front, roof)))
    panes.append(windscreen.at(start + 0.2 * lean_front, 0, wheel + z + 0.2 * roof))
    if truck:
        bed = box(tail * x * 0.98, 0.97 * y, rng.uniform(0.4, 1.3) * roof, 0.002, 2)
        body.append(bed.at(0.5 * x * (1 - tail), 0, wheel + z - 0.001))
    axles = (-0.32 * x, 0.36 * x - max(0.2 * x, 2.15 * wheel), 0.36 * x) if truck else (-0.31 * x, 0.31 * x)
    tyres, hubs = _wheels(axles, y, wheel)
    lamps = [ball(0.12 * z + 0.001, 2).at(-x / 2 + 0.001, s * 0.34 * y, wheel + 0.55 * z) for s in (-1, 1)]
    bumpers = [box(0.006, 0.96 * y, 0.2 * z, 0.0015).at(s * x / 2, 0, wheel + 0.1 * z) for s in (-1, 1)]
    return {
        "metal_body": body,
        "glass": panes,
        "rubber_tyres": tyres,
        "hubs": hubs,
        "bulb_lamps": lamps,
        "bumpers": bumpers,
    }


@mesh_family("gears")
def gears(rng: np.random.Generator) -> Parts:
    """Meshing gear wheels on axles: teeth, spokes, hubs, on a plate."""
    pitch = rng.uniform(0.004, 0.008)
    wheels, axles = [], []
    x = y = 0.0
    way = rng.uniform(0, 6.3)
    previous, spin, driver = 0.0, 0.0, 0
    for k in range(int(rng.integers(2, 5))):
        teeth = int(rng.integers(9, 30))
        radius = teeth * pitch / np.pi
        if k:
            way += rng.uniform(-1.1, 1.1)
            x, y = x + (radius + previous) * np.cos(way), y + (radius + previous) * np.sin(way)
            spin = way + np.pi - (np.pi - driver * (way - spin)) / teeth  # a tooth meets a gap
        tall, driver = rng.uniform(0.006, 0.012), teeth
        gear = _gear(rng, teeth, radius, 0.42 * pitch, tall)
        wheels += [p.turned(z_deg=float(np.degrees(spin))).at(x, y, 0.005 + 0.0003 * k) for p in gear]
        axles.append(cylinder(0.16 * radius, tall + 0.012, 0.001, 20).at(x, y, 0.0003))
        previous = radius
    low = np.min([w.vertices.min(0) for w in wheels], axis=0)
    high = np.max([w.vertices.max(0) for w in wheels], axis=0)
    size, centre = high - low, (low + high) / 2
    base = box(float(size[0]) * 1.05, float(size[1]) * 1.05, 0.004, 0.001).at(
        float(centre[0]), float(centre[1])
    )
    return {"metal_gears": wheels, "axles": axles, "base": [base]}


def _block_rand(rng: np.random.Generator, size: float, *, arch: bool) -> tuple[Solid, float]:
    """A block and the height of its flat top; 0 where nothing can stand on it.

    arch: whether it may be one, whose feet would stand beside most blocks.
    """
    kind = rng.random()
    tall = size * float(rng.choice((0.5, 1.0, 1.5)))
    if kind < 0.5:
        return box(size * float(rng.choice((1, 1, 2, 3))), size, tall, 0.003), tall
    if kind < 0.7:
        return cylinder(size / 2, tall, 0.003, 24), tall
    if kind < 0.85 and arch:
        a = np.linspace(0, np.pi, 16)
        inner = np.c_[0.6 * size * np.cos(a), 0.6 * size * np.sin(a)]
        outer = np.c_[
            np.interp(np.cos(a), (-0.75, 0.75), (-1.2, 1.2)) * size,
            1.05 * size * np.minimum(1, 1.6 * np.sin(a)),
        ]
        return slab(inner, outer, size, 0.0015).turned(x_deg=90).at(y=size / 2), 1.05 * size
    if kind < 0.85:
        return box(2 * size, 0.5 * size, tall, 0.003), tall
    return cone(size / 2, 0.05 * size, tall, 0.002, 24), 0.0


def _wheels(axles: Sequence[float], track: float, radius: float) -> tuple[list[Solid], list[Solid]]:
    """Tyres and hubs of a vehicle on z = 0 with its axles at these x."""
    tyre = cylinder(radius, 0.009, 0.0025, 28).warped(fluted(28, 0.05, 0.0)).at(z=-0.0045).turned(x_deg=90)
    dish = [(0, 0), (0.6 * radius, 0), (0.5 * radius, 0.002), (0.2 * radius, 0.001), (0, 0.0025)]
    hub = lathe(dish, 20)
    places = [(x, s) for x in axles for s in (-1, 1)]
    tyres = [tyre.at(x, s * (track / 2 - 0.001), radius) for x, s in places]
    return tyres, [hub.turned(x_deg=-90 * s).at(x, s * (track / 2 + 0.003), radius) for x, s in places]


def _gear(rng: np.random.Generator, teeth: int, radius: float, bite: float, tall: float) -> list[Solid]:
    a = np.arange(6 * teeth) * 2 * np.pi / (6 * teeth)
    shape = np.clip(1.7 * np.cos(teeth * a), -1, 1)
    outer = (radius + 0.9 * bite * shape)[:, None] * np.c_[np.cos(a), np.sin(a)]
    if radius < 0.02 or rng.random() < 0.4:
        return [plate(outer, tall, 0.0003), cylinder(0.3 * radius, tall + 0.003, 0.0008, 24).at(z=-0.0015)]
    inner = 0.78 * radius * np.c_[np.cos(a), np.sin(a)]
    half = len(a) // 2
    ring = [
        slab(
            inner[k : k + half + 1] if k == 0 else np.vstack([inner[half:], inner[:1]]),
            outer[k : k + half + 1] if k == 0 else np.vstack([outer[half:], outer[:1]]),
            tall,
            0.0003,
        )
        for k in (0, half)
    ]
    spokes = int(rng.integers(3, 7))
    arm = box(0.82 * radius, 0.14 * radius, 0.6 * tall, 0.0008, 1).at(0.4 * radius, 0, 0.2 * tall)
    hub = cylinder(0.28 * radius, tall + 0.002, 0.0008, 24).at(z=-0.001)
    return [*ring, hub, *(arm.turned(z_deg=360 * k / spokes).at(z=0.0002 * k) for k in range(spokes))]
