"""Nature without pots: stones, crystals, shells, cones, logs, leaves on the ground."""

from __future__ import annotations

import numpy as np

from fsid.assets.forms import loft, scatter_rand, spread, sunflower, turns_to
from fsid.assets.heap import Heap, leant, middle_points
from fsid.assets.meshes.plants import leaf_rand
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import (
    Solid,
    ball,
    ball_directions,
    copies,
    lathe,
    rotation_matrix,
    sheet,
    sweep,
    tubes,
)
from fsid.assets.surfaces import smooth_normals


@mesh_family("stones")
def stones(rng: np.random.Generator) -> Parts:
    """Angular to round stones: balls cut by random planes, single, scattered or stacked."""
    count, size = int(rng.integers(1, 7)), rng.uniform(0.04, 0.15)
    level = 4 if count < 4 else 3
    d = ball_directions(level)
    out, stacked, z = [], rng.random() < 0.25, 0.0
    spots = scatter_rand(rng, count, 1.7 * size)
    for _ in spots:
        planes = rng.normal(size=(int(rng.integers(8, 30)), 3))
        planes /= np.linalg.norm(planes, axis=1, keepdims=True)
        facing = np.clip(d @ planes.T, 1e-3, None)
        radii = np.minimum(1.05, (rng.uniform(0.55, 0.95, len(planes)) / facing).min(1))
        rough = sum(np.sin(d @ rng.normal(0, 9, 3) + rng.uniform(0, 6.3)) for _ in range(8))
        stone = ball(size * rng.uniform(0.5, 1) * (radii + 0.006 * rough), level)
        if stacked:
            stone = stone.stretched(1, 1, rng.uniform(0.3, 0.5)).turned(z_deg=rng.uniform(0, 360)).resting(z)
            z = float(stone.vertices[:, 2].max()) - 0.06 * size
            out.append(stone.at(*rng.normal(0, 0.06 * size, 2)))
        else:
            stone = stone.stretched(1, 1, rng.uniform(0.5, 1)).turned(*rng.uniform(0, 360, 3))
            out.append(stone.resting())
    return {"stone": out if stacked else [s for (s,) in spread([[s] for s in out], spots)]}


@mesh_family("crystals")
def crystals(rng: np.random.Generator) -> Parts:
    """Cluster of six-sided points that grow from a rock in all directions."""
    size, count = rng.uniform(0.04, 0.12), int(rng.integers(6, 26))
    d = ball_directions(3)
    rough = sum(np.sin(d @ rng.normal(0, 3, 3) + rng.uniform(0, 6.3)) for _ in range(6)) / 6
    rock = ball(size * (0.8 + 0.25 * rough), 3).stretched(1, 1, 0.5)
    ways = sunflower(2 * count)[count:] * (1, 1, 1.4) + rng.normal(0, 0.15, (count, 3))
    spears = [
        _point_rand(rng, size * rng.uniform(0.5, 1.7), size * rng.uniform(0.08, 0.24)) for _ in range(4)
    ]
    groups = []
    for k, spear in enumerate(spears):
        turns = turns_to(ways[k::4], rng.uniform(0, 6.3, len(ways[k::4])))
        groups.append(copies(spear, turns, 0.45 * size * ways[k::4] * (1, 1, 0.5)))
    return {"glass_crystals": [g for g in groups if len(g.faces)], "stone": [rock]}


@mesh_family("seashells")
def seashells(rng: np.random.Generator) -> Parts:
    """Spiral shells and ribbed scallops, after the logarithmic spiral."""
    spots = scatter_rand(rng, int(rng.integers(1, 4)), 0.09)
    shells, kinds = [], []
    for _ in spots:
        if rng.random() < 0.6:
            turns, growth = rng.uniform(2.5, 5), rng.uniform(0.16, 0.3)
            a = np.linspace(0, 2 * np.pi * turns, int(22 * turns))
            scale = np.exp(growth * (a - a[-1]))
            size, pitch = rng.uniform(0.015, 0.03), rng.uniform(0.2, 2.6)
            path = size * scale[:, None] * np.c_[np.cos(a), np.sin(a), np.full(len(a), -pitch)]
            ribs = 1 + rng.uniform(0, 0.15) * np.abs(np.sin(a * rng.uniform(3, 9)))
            tube = sweep(path, size * scale * ribs * rng.uniform(0.55, 0.75), 14)
            kinds.append("ceramic_spirals")
            shells.append([tube.turned(*rng.uniform(0, 360, 3)).resting()])
        else:
            fan = _scallop(rng, rng.uniform(0.02, 0.04))
            kinds.append("ceramic_fans")
            shells.append([fan.turned(z_deg=rng.uniform(0, 360)).resting()])
    parts: dict[str, list[Solid]] = {"ceramic_spirals": [], "ceramic_fans": []}
    for kind, (shell,) in zip(kinds, spread(shells, spots), strict=True):
        parts[kind].append(shell)
    return {name: solids for name, solids in parts.items() if solids}


@mesh_family("pine_cones")
def pine_cones(rng: np.random.Generator) -> Parts:
    """Cones of scales in golden-angle spirals, open or closed."""
    cones = []
    spots = scatter_rand(rng, int(rng.integers(1, 3)), 0.07)
    for _ in spots:
        count, length, wide = int(rng.integers(50, 90)), rng.uniform(0.05, 0.1), rng.uniform(0.017, 0.03)
        k = np.arange(count) / count
        girth = np.sin(np.pi * (0.12 + 0.86 * k) ** 0.75)
        tilt = rng.uniform(15, 60)
        scale = ball(1.0, 1).stretched(0.6, 0.55, 0.16).at(x=0.45)
        turns, places = [], []
        for i in range(count):
            size = wide * (0.35 + 0.65 * girth[i])
            turns.append(rotation_matrix(0, -tilt - 25 * float(k[i]), 137.5 * i) * size * 0.75)
            places.append((0, 0, length * k[i]))
        core = lathe([(0, 0), *np.c_[0.3 * wide * girth, length * k][::6], (0, length)], 12)
        solid = copies(scale, np.array(turns), np.array(places))
        turn = rng.uniform(0, 360, 3) if rng.random() < 0.6 else np.zeros(3)
        lift = -float(solid.turned(*turn).vertices[:, 2].min())
        cones.append([part.turned(*turn).at(z=lift) for part in (solid, core)])
    return {"wood_scales": [part for cone in spread(cones, spots) for part in cone]}


@mesh_family("logs")
def logs(rng: np.random.Generator) -> Parts:
    """Pile of sawn logs: furrowed bark, end faces that bulge a little, knots."""
    radius, length = rng.uniform(0.04, 0.09), rng.uniform(0.15, 0.4)
    barks, ends = [], []
    row = int(rng.integers(1, 4))
    reach, step = 120, radius / 100  # of a net across the logs, wide enough for 1.2 radii
    pile = np.zeros((14, 7 * reach))
    for level in range(row):
        for k in range(row - level):
            size = radius * rng.uniform(0.85, 1.0)
            a = np.linspace(0, 2 * np.pi, 60, endpoint=False)[None]
            s = np.linspace(0, 1, 14)[:, None]
            furrow = sum(
                rng.uniform(0.2, 1) * np.sin(n * a + rng.uniform(0, 6.3) + rng.normal(0, 1) * s)
                for n in (9, 14, 23)
            )
            oval = 1 + 0.05 * np.cos(2 * a + rng.uniform(0, 6.3)) + 0.03 * np.sin(3 * a + 3 * s)
            r = size * oval * (1 + 0.018 * furrow)
            rings = np.stack(np.broadcast_arrays(r * np.cos(a), r * np.sin(a), length * (s - 0.5)), axis=-1)
            bark = loft(rings)
            spin = rng.uniform(0, 360)
            turn = rotation_matrix(y_deg=90) @ rotation_matrix(z_deg=spin)
            low, high = _profiles(rings @ turn.T, step * np.arange(-reach, reach + 1))
            middle = 3 * reach + 103 * (2 * k - (row - level - 1))
            spots = np.arange(middle - 50 * (level > 0), middle + 51)
            lifts = [float((pile[:, m - reach : m + reach + 1] - low).max()) for m in spots]
            m, lift = int(spots[np.argmin(lifts)]), min(lifts)  # where it can roll no lower
            beneath = pile[:, m - reach : m + reach + 1]
            np.maximum(beneath, lift + high, out=beneath)
            place = (0.0, step * (m - 3 * reach), lift)
            barks.append(bark.turned(z_deg=spin).turned(y_deg=90).at(*place))
            for s_end in (0, -1):
                face = rings[s_end] * (0.88, 0.88, 1.0)
                disc = loft(np.stack([face * (1, 1, 0.99), face * (1, 1, 1.02)][:: 1 if s_end else -1]))
                ends.append(disc.turned(z_deg=spin).turned(y_deg=90).at(*place))
    return {"wood_bark": barks, "wood_ends": ends}


@mesh_family("fallen_leaves")
def fallen_leaves(rng: np.random.Generator) -> Parts:
    """Dry leaves of two sorts, curled, in a heap."""
    size = rng.uniform(0.04, 0.1)
    thick = max(0.0008, 0.006 * size)
    sorts, points, order = [], [], []
    for _ in range(2):
        leaf = leaf_rand(rng, int(rng.choice((1, 2, 3, 4, 6))), size)
        roll = rng.uniform(2, 9)

        def curl(p: np.ndarray, roll: float = roll) -> np.ndarray:
            radius, angle = 1 / roll - p[:, 2], roll * p[:, 1]
            return np.c_[p[:, 0], radius * np.sin(angle), 1 / roll - radius * np.cos(angle)]

        curled = leaf.warped(curl)
        count = int(rng.integers(6, 22))
        sides = np.outer(rng.choice((-1.0, 1.0), count), (0, 0, 1))
        turns = turns_to(sides, rng.uniform(0, 6.3, count)) * rng.uniform(0.6, 1.2, (count, 1, 1))
        spots = np.c_[rng.normal(0, 0.9 * size, (count, 2)), np.zeros(count)]
        order.append(rng.random(count))
        sorts.append(copies(curled, turns, spots))
        points.extend(turns @ middle_points(curled, thick, 3) + spots[:, :, None])
    heap = Heap(max(float(np.abs(p[:2]).max()) for p in points), size / 24)
    planes = np.zeros((len(points), 3))
    for k in np.argsort(np.concatenate(order)):
        planes[k] = heap.lay(points[k], 1.6 * thick)
    first = len(order[0])
    return {"leaf": [leant(sorts[0], planes[:first])], "leaf_other": [leant(sorts[1], planes[first:])]}


@mesh_family("feathers")
def feathers(rng: np.random.Generator) -> Parts:
    """Feathers: a bent quill with hundreds of barbs, parted here and there."""
    quills, vanes = [], []
    for x, y in scatter_rand(rng, int(rng.integers(1, 3)), 0.06):
        length, wide, bend = rng.uniform(0.1, 0.22), rng.uniform(0.012, 0.03), rng.normal(0, 0.35)
        t = np.linspace(0, 1, 20)
        spine = length * np.c_[t, bend * t**2, 0.12 * np.sin(np.pi * t)]
        count = 80
        s = np.linspace(0.18, 1, count)
        base = np.stack([np.interp(s, t, spine[:, k]) for k in range(3)], axis=1)
        reach = wide * np.sin(np.pi * np.clip((s - 0.12) / 0.9, 0, 1) ** 0.7) ** 0.6 + 0.002
        part = 0.25 * np.cumsum(rng.normal(0, 0.12, count) * (rng.random(count) < 0.12))
        u = np.linspace(0, 1, 5)[None, :, None]
        for side in (-1, 1):
            aim = np.stack([0.75 + part, side * (0.85 - 0.3 * s), 0.15 + 0 * s], axis=1)
            curve = aim[:, None] * u + np.array((0.35, 0.0, -0.25)) * u**2
            barbs = tubes(
                base[:, None] + reach[:, None, None] * curve, np.array((1, 1, 0.9, 0.7, 0.4)) * 0.0007, 4
            )
            vanes.append(barbs.at(x, y))
        quills.append(sweep(spine, 0.0016 * (1.2 - t), 7).at(x, y))
    spin = rng.uniform(0, 360)
    return {
        "yarn_barbs": [v.turned(z_deg=spin) for v in vanes],
        "plastic_quill": [q.turned(z_deg=spin) for q in quills],
    }


def _profiles(rings: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(R, len(y)) each: lowest and highest z of closed outlines (R, n, 3) about the x axis at `y`; beside an
    outline it is inf and -inf."""
    low, high = np.full((len(rings), len(y)), np.inf), np.full((len(rings), len(y)), -np.inf)
    for ring, below, above in zip(rings, low, high, strict=True):
        across = ring[np.argsort(ring[:, 1])]
        for out, half, none in (
            (below, across[across[:, 2] < 0], np.inf),
            (above, across[across[:, 2] > 0], -np.inf),
        ):
            out[:] = np.interp(y, half[:, 1], half[:, 2], left=none, right=none)
    return low, high


def _point_rand(rng: np.random.Generator, length: float, radius: float) -> Solid:
    """Six-sided prism with a pyramid on top, flat faces."""
    shoulder = length * rng.uniform(0.6, 0.85)
    a = 2 * np.pi * np.arange(6) / 6
    uneven = rng.uniform(0.8, 1.2, 6)
    ring = radius * uneven[:, None] * np.c_[np.cos(a), np.sin(a)]
    low, high = np.c_[ring, np.zeros(6)], np.c_[ring * rng.uniform(0.85, 1), np.full(6, shoulder)]
    tip = np.array((*rng.normal(0, 0.15 * radius, 2), length))
    triangles = []
    for k in range(6):
        n = (k + 1) % 6
        triangles += [(low[k], low[n], high[n]), (low[k], high[n], high[k]), (high[k], high[n], tip)]
        triangles.append((low[n], low[k], np.zeros(3)))
    points = np.array(triangles).reshape(-1, 3)
    faces = np.arange(len(points)).reshape(-1, 3)
    return Solid(points, smooth_normals(points, faces), faces)


def _scallop(rng: np.random.Generator, size: float) -> Solid:
    ribs, a, r = (
        int(rng.integers(7, 11)),
        np.linspace(-1.15, 1.15, 64)[None],
        np.linspace(0.03, 1, 12)[:, None],
    )
    dome = 0.5 * np.sin(np.pi * (0.15 + 0.6 * r)) * np.cos(a) ** 0.5
    groove = 0.045 * r * np.cos(2 * np.pi * ribs * a / 2.3)
    ring = 0.012 * np.sin(14 * r**1.5)
    edge = 1 + 0.03 * np.cos(2 * np.pi * ribs * a / 2.3)
    grid = np.stack(
        np.broadcast_arrays(r * edge * np.cos(a), r * edge * np.sin(a), dome + groove + ring), axis=-1
    )
    return sheet(size * grid, 0.02 * size)
