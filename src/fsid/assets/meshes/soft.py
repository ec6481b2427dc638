"""Upholstery: couch, bed, cushion, and the pillow they share."""

from __future__ import annotations

import numpy as np

from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import Solid, ball, ball_directions, box, cone, sheet, sweep
from fsid.assets.surfaces import smooth_normals


@mesh_family("couch")
def couch(rng: np.random.Generator) -> Parts:
    """Upholstered couch or armchair: base, arms, back, one to three seat and back cushions, feet."""
    seats = int(rng.integers(1, 4))
    wide, depth, arm = rng.uniform(0.5, 0.7), rng.uniform(0.75, 0.95), rng.uniform(0.08, 0.2)
    base, seat, back = rng.uniform(0.2, 0.3), rng.uniform(0.12, 0.18), rng.uniform(0.35, 0.5)
    x = seats * wide + 2 * arm
    soft = rng.uniform(0.02, 0.06)
    body = [box(x - 0.012, depth - 0.012, base, 0.03, 3).at(z=0.101)]
    body += [
        box(arm, depth, base + rng.uniform(0.15, 0.3), soft, 4).at(s * (x - arm) / 2, 0.001, 0.1)
        for s in (-1, 1)
    ]
    body += [box(x - 0.006, 0.16, base + back, soft, 4).at(0, depth / 2 - 0.075, 0.104)]
    cushions = []
    for k in range(seats):
        cx = (k - (seats - 1) / 2) * wide
        cushions.append(pillow(wide - 0.01, depth - 0.2, seat, 3.5).at(cx, -0.09, 0.1 + base + seat * 0.42))
        lean = pillow(wide - 0.02, back, 0.18, 3.0).turned(x_deg=90 - rng.uniform(6, 16))
        cushions.append(lean.at(cx, depth / 2 - 0.24, 0.1 + base + seat * 0.8 + back / 2))
    feet = [
        cone(0.018, 0.026, 0.11, 0.003, 16).at(sx * (x / 2 - 0.08), sy * (depth / 2 - 0.08))
        for sx in (-1, 1)
        for sy in (-1, 1)
    ]
    return {"cloth_body": body, "cloth_cushions": cushions, "feet": feet}


@mesh_family("bed")
def bed(rng: np.random.Generator) -> Parts:
    """Frame with headboard, mattress, blanket with folds, pillows."""
    x, y = rng.uniform(0.9, 1.8), rng.uniform(1.9, 2.1)
    frame_z, mattress = rng.uniform(0.2, 0.35), rng.uniform(0.16, 0.26)
    frame = [box(x, y, frame_z, 0.012), box(x, 0.05, rng.uniform(0.7, 1.1), 0.015, 3).at(0, y / 2)]
    count = 1 if x < 1.2 else 2
    pillows = []
    for k in range(count):
        soft = pillow(0.55 * min(1, x / count / 0.6), 0.4, 0.16, 2.6).turned(z_deg=rng.uniform(-12, 12))
        pillows.append(soft.at((k - (count - 1) / 2) * x / count, y / 2 - 0.3, frame_z + mattress + 0.06))
    cover = box(x - 0.04, y - 0.06, mattress, 0.05, 4).at(z=frame_z)
    blanket = _blanket(rng, x + 0.03, y * rng.uniform(0.5, 0.7), mattress).at(0, -y * 0.14, frame_z + 0.012)
    return {"frame": frame, "cloth_mattress": [cover], "cloth_pillows": pillows, "cloth_blanket": [blanket]}


@mesh_family("cushion")
def cushion(rng: np.random.Generator) -> Parts:
    """Square to oblong throw cushion with piping along its seam."""
    x, y, z = rng.uniform(0.3, 0.6), rng.uniform(0.3, 0.5), rng.uniform(0.1, 0.2)
    pinch = rng.uniform(2.6, 6)
    angle = np.linspace(0, 2 * np.pi, 96, endpoint=False)
    c, s = np.cos(angle), np.sin(angle)
    edge = np.c_[c, s] / (np.abs(c) ** pinch + np.abs(s) ** pinch)[:, None] ** (1 / pinch)
    seam = sweep(np.c_[edge * (x / 2, y / 2), np.zeros(96)], rng.uniform(0.003, 0.007), 8, closed=True)
    return {"cloth_cover": [pillow(x, y, z, pinch, rng, 4)], "cloth_piping": [seam]}


def pillow(
    x: float, y: float, z: float, pinch: float, rng: np.random.Generator | None = None, level: int = 3
) -> Solid:
    """Superellipse outline of exponent `pinch` with a puffed, round section; wrinkled when `rng` is given,
    but for its seam."""
    d = ball_directions(level)
    flat = np.hypot(d[:, 0], d[:, 1]) + 1e-9
    outline = flat / (np.abs(d[:, 0]) ** pinch + np.abs(d[:, 1]) ** pinch + 1e-12) ** (1 / pinch)
    stretch = 1 + (outline - 1) * flat**2
    radii = np.ones(len(d))
    if rng is not None:
        for _ in range(6):
            wave = rng.normal(0, 5, 3)
            radii += 0.012 * np.sin(d @ wave + rng.uniform(0, 6.3)) * (1 - flat**6)
    solid = ball(radii, level)
    shaped = Solid(solid.vertices * np.c_[stretch, stretch, np.ones(len(d))], solid.normals, solid.faces)
    return _renormalised(shaped.stretched(x / 2, y / 2, z / 2))


def _renormalised(solid: Solid) -> Solid:
    return Solid(solid.vertices, smooth_normals(solid.vertices, solid.faces), solid.faces)


def _blanket(rng: np.random.Generator, x: float, y: float, drop: float) -> Solid:
    rows, cols = 28, 48
    across = np.linspace(-1, 1, cols) * (x / 2 + drop * 0.8)
    over = np.maximum(np.abs(across) - x / 2, 0)
    u = np.sign(across) * np.minimum(np.abs(across), x / 2 + 0.004)
    v = np.linspace(-y / 2, y / 2, rows)
    height = np.zeros((rows, cols))
    for _ in range(9):
        k = rng.normal(0, 9, 2)
        height += rng.uniform(0.001, 0.005) * np.sin(
            k[0] * across[None] + k[1] * v[:, None] + rng.uniform(0, 6.3)
        )
    fold = 0.5 + 0.5 * np.sin(v * rng.uniform(25, 45))[:, None]
    side = np.sign(across)[None] * (np.minimum(over, 0.06) * fold * 0.35 + np.abs(height))
    points = np.stack(
        [u + side, np.broadcast_to(v[:, None], (rows, cols)), drop + 0.012 + height - over], axis=-1
    )
    return sheet(points, 0.012)
