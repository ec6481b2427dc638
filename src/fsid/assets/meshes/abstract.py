"""Shapes that no shop sells: blobs, revolutions, knots, stacks of sheets, strands, draped cloth.

They add what furniture lacks: curved silhouettes in all directions, fine parallel edges, self-shadowing.
"""

from __future__ import annotations

import numpy as np

from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import Solid, ball, ball_directions, copies, lathe, rotation_matrix, sheet, sweep


@mesh_family("blob")
def blob(rng: np.random.Generator) -> Parts:
    """Sphere displaced by a sum of random plane waves with falling amplitude."""
    d = ball_directions(5)
    radii = np.ones(len(d))
    rough = rng.uniform(0.1, 0.32)
    for k in (1.5, 3, 6, 12):
        for _ in range(4):
            wave = rng.normal(size=3)
            radii += rough / k * np.sin(d @ wave * (k / np.linalg.norm(wave)) * 2 + rng.uniform(0, 6.3))
    shape = ball(rng.uniform(0.1, 0.3) * np.maximum(radii, 0.25), 5)
    return {"body": [shape]}


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
    lower = lathe([(0, 0), *np.c_[r, z][:cut], (0, z[cut - 1])], 40)
    upper = lathe([(0, z[cut - 1]), *np.c_[r, z][cut:], (0, height)], 40)
    return {"lower": [lower], "upper": [upper]}


@mesh_family("knot")
def knot(rng: np.random.Generator) -> Parts:
    """Closed tube along a random smooth curve, like a hose or a thick cord."""
    t = np.linspace(0, 2 * np.pi, 260, endpoint=False)[:, None]
    path = np.zeros((260, 3))
    for k in range(1, int(rng.integers(3, 6))):
        path += rng.normal(0, 1 / k, 3) * np.cos(k * t) + rng.normal(0, 1 / k, 3) * np.sin(k * t)
    path *= rng.uniform(0.15, 0.3) / np.abs(path).max()
    along = np.roll(path, -1, axis=0) - path
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    bend = np.linalg.norm(np.roll(along, -1, axis=0) - along, axis=1)
    tightest = (np.linalg.norm(np.roll(path, -1, axis=0) - path, axis=1) / bend).min()
    thick = min(rng.uniform(0.012, 0.035), 0.7 * tightest)
    radius = thick * (1 + rng.uniform(0, 0.25) * np.cos(int(rng.integers(5, 40)) * t[:, 0]))
    return {"tube": [sweep(path, radius, 14, closed=True)]}


@mesh_family("yarn_ball")
def yarn_ball(rng: np.random.Generator) -> Parts:
    """A ball wound from a cord in great circles."""
    radius, thread = rng.uniform(0.04, 0.1), rng.uniform(0.003, 0.007)
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    ring = np.c_[radius * np.cos(angle), radius * np.sin(angle), 0.06 * radius * np.sin(3 * angle)]
    loop = sweep(ring, thread, 6, closed=True)
    turns = [rotation_matrix(*rng.uniform(0, 360, 3)) * rng.uniform(0.94, 1.06) for _ in range(32)]
    strands = copies(loop, np.array(turns), np.zeros((32, 3)))
    return {"yarn": [strands], "core": [ball(radius * 0.97, 3)]}


@mesh_family("sheet_stack")
def sheet_stack(rng: np.random.Generator) -> Parts:
    """Curled papers scattered over each other, in three colours."""
    parts: tuple[list[Solid], ...] = ([], [], [])
    count, size = int(rng.integers(6, 22)), rng.uniform(0.1, 0.3)
    for k in range(count):
        x, y = size * rng.uniform(0.4, 1), size * rng.uniform(0.4, 1.3)
        u, v = np.meshgrid(np.linspace(-1, 1, 14), np.linspace(-1, 1, 14))
        curl = rng.normal(0, 0.05, 3) * size
        z = curl[0] * u**2 + curl[1] * v**2 + curl[2] * u * v + 0.004 * np.sin(rng.normal(0, 3) * u + 3 * v)
        paper = sheet(np.stack([u * x / 2, v * y / 2, z - z.min() * 0.3], axis=-1), 0.0007)
        dx, dy = rng.normal(0, 0.35 * size, 2)
        tilt_x, tilt_y = rng.normal(0, 4, 2)
        parts[rng.integers(3)].append(
            paper.turned(tilt_x, tilt_y, rng.uniform(0, 360)).at(dx, dy, 0.0035 * k)
        )
    named = zip(("paper_a", "paper_b", "paper_c"), parts, strict=True)
    return {name: solids for name, solids in named if solids}


@mesh_family("tuft")
def tuft(rng: np.random.Generator) -> Parts:
    """Grass-like strands that bend outwards from one root."""
    reach, count = rng.uniform(0.15, 0.45), int(rng.integers(50, 130))
    t = np.linspace(0, 1, 9)
    half = 0.5 * rng.uniform(0.004, 0.012) * (1 - 0.92 * t)
    bend = rng.uniform(0.3, 1.1)
    spine_x, spine_z = bend * t**2 * reach * 0.7, reach * (t - 0.35 * bend * t**2)
    across = np.linspace(-1, 1, 3)
    grid = np.stack(
        np.broadcast_arrays(
            spine_x[:, None] - 0.3 * half[:, None] * np.abs(across), half[:, None] * across, spine_z[:, None]
        ),
        axis=-1,
    )
    blade = sheet(grid, 0.0008)
    turns = [
        rotation_matrix(0, rng.uniform(-15, 30), rng.uniform(0, 360)) * rng.uniform(0.4, 1.1)
        for _ in range(count)
    ]
    places = np.c_[rng.normal(0, 0.05 * reach, (count, 2)), np.zeros(count)]
    return {"strands": [copies(blade, np.array(turns), places)]}


@mesh_family("draped_cloth")
def draped_cloth(rng: np.random.Generator) -> Parts:
    """A cloth hanging in folds over an invisible round stand; its hem has a border of its own."""
    n = 66
    u, v = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n))
    size, top = rng.uniform(0.2, 0.45), rng.uniform(0.3, 0.6)
    radius, angle = np.hypot(u, v), np.arctan2(v, u)
    over = np.maximum(radius - top, 0)
    folds = int(rng.integers(5, 12))
    wave = np.cos(folds * angle + rng.uniform(0, 6.3) + 0.6 * np.sin(2 * angle + rng.uniform(0, 6.3)))
    spread = np.minimum(radius, top) + 0.25 * over + 0.3 * over * wave
    ripple = 0.006 * np.sin(u * rng.normal(0, 9) + v * rng.normal(0, 9))
    z = -0.9 * over + ripple + 0.05 * over * wave
    points = np.stack([spread * np.cos(angle), spread * np.sin(angle), z], axis=-1) * size
    rows = 5
    return {
        "cloth": [sheet(points[rows:-rows, rows:-rows], 0.004)],
        "hem": [
            sheet(points[: rows + 1], 0.005),
            sheet(points[-rows - 1 :], 0.005),
            sheet(points[rows:-rows, : rows + 1], 0.005),
            sheet(points[rows:-rows, -rows - 1 :], 0.005),
        ],
    }
