"""Shapes that no shop sells: blobs, revolutions, sweeps, stacks of sheets, facets, holes.

They add what furniture lacks: curved silhouettes in all directions, sharp and soft edges side by side,
self-shadowing, thin layers over each other as in the dead-leaves model of natural images.
"""

from __future__ import annotations

import numpy as np

from fsid.assets.forms import loft, plate, spread, turns_to
from fsid.assets.heap import Heap
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import (
    Solid,
    ball,
    ball_directions,
    box,
    copies,
    lathe,
    rotation_matrix,
    sheet,
    sheets,
    tubes,
)
from fsid.assets.surfaces import smooth_normals


@mesh_family("blob")
def blob(rng: np.random.Generator) -> Parts:
    """Sphere displaced by random plane waves of falling amplitude, smooth or ridged, of two stuffs."""
    d = ball_directions(4)
    radii = np.ones(len(d))
    rough, ridged = rng.uniform(0.1, 0.32), rng.random() < 0.35
    for k in (1.5, 3, 6, 12):
        for _ in range(4):
            wave = rng.normal(size=3)
            swell = np.sin(d @ wave * (k / np.linalg.norm(wave)) * 2 + rng.uniform(0, 6.3))
            radii += rough / k * (0.6 - 1.6 * np.abs(swell) if ridged else swell)
    shape = ball(rng.uniform(0.1, 0.3) * np.maximum(radii, 0.25), 4)
    low = radii[shape.faces].mean(1) < np.quantile(radii, rng.uniform(0, 0.6))
    parts = {"body": [Solid(shape.vertices, shape.normals, shape.faces[~low])]}
    return parts | (
        {"hollows": [Solid(shape.vertices, shape.normals, shape.faces[low])]} if low.any() else {}
    )


@mesh_family("revolution")
def revolution(rng: np.random.Generator) -> Parts:
    """Random solid of revolution in two materials with beads, grooves and sharp steps."""
    height, radius = rng.uniform(0.15, 0.6), rng.uniform(0.06, 0.2)
    steps = int(rng.integers(5, 12))
    z = np.linspace(0, height, steps * 6)
    stepped = np.repeat(rng.uniform(0.3, 1, steps), 6)
    smooth = 0.65 + 0.3 * np.sin(2 * np.pi * (rng.uniform(0.5, 3) * z / height + rng.random()))
    share = np.repeat(rng.random(steps) < 0.5, 6)
    r = radius * np.where(share, stepped, smooth)
    cut = 6 * int(rng.integers(1, steps - 1))
    segments = int(rng.choice((5, 6, 8, 40, 40, 40)))
    lower = lathe([(0, 0), *np.c_[r, z][:cut], (0, z[cut - 1])], segments)
    upper = lathe([(0, z[cut - 1]), *np.c_[r, z][cut:], (0, height)], segments)
    if segments < 10:
        lower, upper = _faceted(lower), _faceted(upper)
    return {"lower": [lower], "upper": [upper]}


@mesh_family("sweep")
def sweep_family(rng: np.random.Generator) -> Parts:
    """Random cross section, star to square, swept along a random curve while it twists and tapers."""
    n, m = int(rng.choice((5, 8, 12, 40))), 70
    a = np.linspace(0, 2 * np.pi, n, endpoint=False)
    shape = 1 + sum(rng.normal(0, 0.22 / k) * np.cos(k * a + rng.uniform(0, 6.3)) for k in (2, 3, 4, 5))
    section = np.clip(shape, 0.35, None)[:, None] * np.c_[np.cos(a), np.sin(a) * rng.uniform(0.4, 1)]
    t = np.linspace(0, 1, m)
    height = rng.uniform(0.2, 0.6)
    path = np.stack(
        [
            sum(rng.normal(0, 0.16 / k**1.5) * np.sin(np.pi * k * t + rng.uniform(0, 6.3)) for k in (1, 2, 3))
            * height
            * 1.6
            for _ in range(2)
        ]
        + [height * t],
        axis=1,
    )
    twist = rng.normal(0, 3) * t
    size = rng.uniform(0.03, 0.09) * (
        1 + rng.uniform(-0.7, 0.5) * t + rng.uniform(0, 0.25) * np.cos(2 * np.pi * rng.uniform(1, 5) * t)
    )
    c, s = np.cos(twist)[:, None], np.sin(twist)[:, None]
    x = size[:, None] * (c * section[:, 0] - s * section[:, 1])
    y = size[:, None] * (s * section[:, 0] + c * section[:, 1])
    rings = path[:, None] + np.stack([x, y, np.zeros_like(x)], axis=-1)
    solid = loft(rings)
    return {"body": [_faceted(solid) if n < 10 else solid]}


@mesh_family("sheet_stack")
def sheet_stack(rng: np.random.Generator) -> Parts:
    """Dead leaves: curled papers of three sorts, square, round or torn, scattered over each other."""
    parts: tuple[list[Solid], ...] = ([], [], [])
    size, n, thick = rng.uniform(0.1, 0.3), 9, 0.0007
    heap = Heap(2.5 * size, size / 18)
    flat = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n))
    for count in rng.integers(2, 9, 3):
        grids = []
        for _ in range(count):
            u, v = flat
            if rng.random() < 0.4:
                u, v = u * np.sqrt(1 - v * v / 2), v * np.sqrt(1 - u * u / 2)
            x, y = size * rng.uniform(0.3, 1), size * rng.uniform(0.3, 1.3)
            curl = rng.normal(0, 0.05, 3) * size
            z = (
                curl[0] * u**2
                + curl[1] * v**2
                + curl[2] * u * v
                + 0.004 * np.sin(rng.normal(0, 3) * u + 3 * v)
            )
            tilt = rotation_matrix(rng.normal(0, 4), rng.normal(0, 4), rng.uniform(0, 360))
            place = (*rng.normal(0, 0.35 * size, 2), 0.0)
            paper = np.stack([u * x / 2, v * y / 2, z], axis=-1) @ tilt.T + np.array(place)
            grids.append(heap.drape(paper, 1.6 * thick))
        parts[int(rng.integers(3))].append(sheets(np.array(grids), thick))
    named = zip(("paper", "paper_second", "paper_third"), parts, strict=True)
    return {name: solids for name, solids in named if solids}


@mesh_family("polyhedron")
def polyhedron(rng: np.random.Generator) -> Parts:
    """Random convex bodies with flat faces: cut gems, boulders of glass, building stones."""
    from scipy.spatial import ConvexHull

    lying, spots = [], []
    for k in range(int(rng.integers(1, 4))):
        count = int(rng.choice((6, 9, 16, 40)))
        points = rng.normal(size=(count, 3))
        points /= np.linalg.norm(points, axis=1, keepdims=True) ** rng.uniform(0.6, 1.0)
        points *= rng.uniform(0.05, 0.16) * rng.uniform(0.5, 1.0, 3)
        hull = ConvexHull(points)
        corners = points[hull.simplices]
        outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        flip = (outward * (corners.mean(1) - points.mean(0))).sum(1) < 0
        corners[flip] = corners[flip][:, ::-1]
        faces = np.arange(3 * len(corners)).reshape(-1, 3)
        solid = Solid(corners.reshape(-1, 3), smooth_normals(corners.reshape(-1, 3), faces), faces)
        lying.append([solid.resting()])
        spots.append((0.14 * k, 0.06 * (k % 2)))
    bodies = [body for (body,) in spread(lying, np.array(spots))]
    return {"glass_gem": bodies[:1], "stone": bodies[1:]} if len(bodies) > 1 else {"glass_gem": bodies}


@mesh_family("lattice")
def lattice(rng: np.random.Generator) -> Parts:
    """Scaffold of bars between balls on a bent grid: struts cross at every angle and hide each other."""
    n = rng.integers(2, 5, 3)
    cell, thick = rng.uniform(0.05, 0.12), rng.uniform(0.003, 0.009)
    grid = np.stack(np.meshgrid(*(np.arange(k) for k in n), indexing="ij"), -1).astype(float)
    grid = cell * (grid + rng.normal(0, rng.uniform(0, 0.16), grid.shape))
    struts = []
    for axis in range(3):
        first, second = np.split(np.stack([np.delete(grid, -1, axis), np.delete(grid, 0, axis)]), 2)
        struts.append(np.stack([first[0].reshape(-1, 3), second[0].reshape(-1, 3)], axis=1))
    if rng.random() < 0.6:
        struts.append(np.stack([grid[:-1, :-1, :-1].reshape(-1, 3), grid[1:, 1:, 1:].reshape(-1, 3)], axis=1))
    ends = np.concatenate(struts)
    bars = tubes(ends[:, :1] + np.linspace(0, 1, 3)[None, :, None] * (ends[:, 1:] - ends[:, :1]), thick, 6)
    nodes = grid.reshape(-1, 3)
    knob = (
        ball(thick * rng.uniform(1.3, 2.6), 1)
        if rng.random() < 0.6
        else box(3 * thick, 3 * thick, 3 * thick, 0.0006, 1).at(z=-1.5 * thick)
    )
    return {"metal_bars": [bars], "nodes": [copies(knob, np.repeat(np.eye(3)[None], len(nodes), 0), nodes)]}


@mesh_family("terrain")
def terrain(rng: np.random.Generator) -> Parts:
    """Model of a landscape: fractal relief, terraced or smooth, cut out with four walls, with water in it."""
    n, size = 56, rng.uniform(0.2, 0.5)
    f = np.hypot(np.fft.fftfreq(n)[:, None], np.fft.rfftfreq(n)[None])
    f[0, 0] = 1
    spectrum = (
        f ** -rng.uniform(1.6, 2.3) * np.exp(2j * np.pi * rng.random(f.shape)) * rng.rayleigh(size=f.shape)
    )
    spectrum[0, 0] = 0
    z = np.fft.irfft2(spectrum, (n, n))
    z = (z - z.min()) / np.ptp(z)
    if rng.random() < 0.35:
        steps = int(rng.integers(5, 11))
        z = (np.floor(z * steps) + np.clip((z * steps % 1) * 4 - 3, 0, 1)) / steps
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, n), np.linspace(-0.5, 0.5, n))
    tall = size * rng.uniform(0.15, 0.45)
    top = np.stack([u * size, v * size, 0.02 + z * tall], axis=-1)
    parts = {"soil": [sheet(top, 0.001), _skirt(top)]}
    if rng.random() < 0.5:
        level = 0.02 + tall * float(np.quantile(z, rng.uniform(0.15, 0.5)))
        parts["liquid"] = [box(size - 0.004, size - 0.004, level - 0.004, 0.0005, 1).at(z=0.004)]
    return parts


@mesh_family("paper_folds")
def paper_folds(rng: np.random.Generator) -> Parts:
    """Crumpled or pleated paper: flat facets between sharp creases."""
    size, n = rng.uniform(0.12, 0.3), int(rng.integers(7, 15))
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, n), np.linspace(-0.5, 0.5, n))
    if rng.random() < 0.5:
        jitter = rng.normal(0, 0.28 / n, (2, n, n))
        z = rng.normal(0, rng.uniform(0.25, 0.6) / n, (n, n)) + rng.uniform(0, 0.6) * (u**2 + v**2)
        points = np.stack([u + jitter[0], v + jitter[1], z], axis=-1)
    else:
        deep, zig = rng.uniform(0.3, 0.9) / n, rng.uniform(0.15, 0.5) / n
        i, j = np.meshgrid(np.arange(n), np.arange(n))
        points = np.stack([u * 0.8 + 0 * v, v + zig * (-1.0) ** i, deep * (-1.0) ** j + 0 * u], axis=-1)
    return {"paper": [_faceted(sheet(points * size, 0.0009))]}


@mesh_family("petal_burst")
def petal_burst(rng: np.random.Generator) -> Parts:
    """Thin curved plates that radiate from a middle, like an artichoke, a paper star or a turbine."""
    count, rows = int(rng.integers(7, 18)), int(rng.integers(1, 5))
    size, twist = rng.uniform(0.08, 0.2), rng.normal(0, 0.8)
    s, across = np.linspace(0.05, 1, 10)[:, None], np.linspace(-1, 1, 5)[None]
    half = rng.uniform(0.1, 0.35) * np.sin(np.pi * s ** rng.uniform(0.5, 1.2)) + 0.01
    roll = twist * s
    x, y, z = np.broadcast_arrays(
        s, half * across * np.cos(roll), half * across * np.sin(roll) + rng.uniform(-0.4, 0.7) * s**2
    )
    blade = sheet(np.stack([x, y, z], axis=-1) * size, 0.0015)
    groups: tuple[list[np.ndarray], ...] = ([], [])
    for row in range(rows):
        for k in range(count):
            lift = -75 * row / max(rows, 2) - rng.uniform(0, 6)
            groups[row % 2].append(
                rotation_matrix(rng.normal(0, 3), lift, 360 * (k + 0.5 * row) / count) * (1 - 0.12 * row)
            )
    parts = {"core": [ball(0.16 * size, 3)]}
    for name, turns in zip(("petal", "petal_other"), groups, strict=True):
        if turns:
            parts[name] = [copies(blade, np.array(turns), np.zeros((len(turns), 3)))]
    return parts


@mesh_family("cluster")
def cluster(rng: np.random.Generator) -> Parts:
    """Heap of one random form at many sizes: cubes, beads, rods, discs stuck on a core at all angles."""
    core, count = rng.uniform(0.04, 0.1), int(rng.integers(24, 70))
    d = rng.normal(size=(count, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    size = rng.uniform(0.25, 0.6) * core
    kind = int(rng.integers(4))
    a = 2 * np.pi * np.arange(6) / 6
    form = (
        box(size, size, size, 0.06 * size, 1).at(z=-0.4 * size),
        ball(0.5 * size, 2),
        box(0.3 * size, 0.3 * size, 2.4 * size, 0.03 * size, 1),
        plate(0.8 * size * np.c_[np.cos(a), np.sin(a)], 0.25 * size, 0.02 * size),
    )[kind]
    count = min(count, 9000 // len(form.faces))
    d = d[:count]
    turns = turns_to(d, rng.uniform(0, 6.3, count)) * rng.uniform(0.4, 1.3, (count, 1, 1))
    cut = count // 2
    places = d * core
    return {
        "first": [copies(form, turns[:cut], places[:cut])],
        "second": [copies(form, turns[cut:], places[cut:])],
        "core": [ball(core, 3)],
    }


def _faceted(solid: Solid) -> Solid:
    """Every triangle on its own, flat-shaded."""
    points = solid.vertices[solid.faces]
    cross = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    keep = np.linalg.norm(cross, axis=1) > 1e-12
    points, cross = points[keep], cross[keep]
    normals = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    faces = np.arange(3 * len(points)).reshape(-1, 3)
    return Solid(points.reshape(-1, 3), np.repeat(normals, 3, axis=0), faces)


def _skirt(top: np.ndarray) -> Solid:
    """Block below a height field (n, m, 3): four sides and the bottom at z = 0, up into its sheet."""
    border = np.concatenate([top[0, :-1], top[:-1, -1], top[-1, :0:-1], top[:0:-1, 0]])
    inset = border * (0.999, 0.999, 1) - np.array((0, 0, 0.0003))
    ring = np.stack([inset * (1, 1, 0), inset])
    solid = loft(ring)
    keep = np.abs(solid.normals[solid.faces[:, 0]][:, 2]) < 0.5
    low = np.abs(solid.vertices[solid.faces].mean(1)[:, 2]) < 1e-9
    return _faceted(Solid(solid.vertices, solid.normals, solid.faces[keep | low]))
