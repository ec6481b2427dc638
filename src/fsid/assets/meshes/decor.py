"""What stands on furniture: vessels, lamps, plants, frames, screens, fruit, stones."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import (
    Solid,
    ball,
    ball_directions,
    box,
    cone,
    copies,
    cylinder,
    lathe,
    rotation_matrix,
    sheet,
    sweep,
)


@mesh_family("vase")
def vase(rng: np.random.Generator) -> Parts:
    """Hollow solid of revolution through random radii, often with fluted rings."""
    height, radius = rng.uniform(0.12, 0.5), rng.uniform(0.05, 0.14)
    knots = np.r_[
        rng.uniform(0.4, 0.9), rng.uniform(0.5, 1, 2), rng.uniform(0.25, 0.8), rng.uniform(0.35, 0.9)
    ]
    t = np.linspace(0, 1, 44)
    outer = radius * PchipInterpolator(np.linspace(0, 1, 5), knots)(t)
    if rng.random() < 0.4:
        outer *= 1 + rng.uniform(0.01, 0.04) * np.cos(2 * np.pi * int(rng.integers(6, 20)) * t)
    return {"body": [hollow(outer, t * height, rng.uniform(0.003, 0.007))]}


@mesh_family("bottle")
def bottle(rng: np.random.Generator) -> Parts:
    """Body, shoulder, neck, cap and a label wrapped around."""
    height, radius = rng.uniform(0.15, 0.34), rng.uniform(0.025, 0.05)
    neck, shoulder = radius * rng.uniform(0.25, 0.5), rng.uniform(0.5, 0.72)
    z = np.array((0, 0.02, shoulder, shoulder + 0.13, 0.9, 1.0)) * height
    r = np.array((0.88, 1.0, 1.0, neck / radius * 1.3, neck / radius, neck / radius)) * radius
    t = np.linspace(0, height, 60)
    body = hollow(PchipInterpolator(z, r)(t), t, 0.002)
    low, high = 0.12 * height, (shoulder - 0.06) * height
    label = lathe([(radius, low), (radius + 0.0008, low), (radius + 0.0008, high), (radius, high)], 48)
    cap = cylinder(neck * 1.15, 0.1 * height, 0.002, 32).at(z=0.93 * height)
    return {"body": [body], "label": [label], "cap": [cap]}


@mesh_family("bowl")
def bowl(rng: np.random.Generator) -> Parts:
    """Bowl or plate on a foot ring, sometimes full of fruit."""
    radius = rng.uniform(0.08, 0.18)
    depth = radius * rng.uniform(0.2, 0.8)
    t = np.linspace(0, 1, 30)
    outer = radius * (0.35 + 0.65 * t ** rng.uniform(0.35, 0.9))
    parts = {"bowl": [hollow(outer, depth * t, rng.uniform(0.003, 0.006))]}
    if rng.random() < 0.5:
        spots = rng.uniform(-0.45, 0.45, (int(rng.integers(3, 8)), 2)) * radius
        fruits = [_fruit(rng, radius * rng.uniform(0.22, 0.34)) for _ in spots]
        parts["fruit"] = [
            f.at(dx, dy, depth * rng.uniform(0.6, 1.1)) for f, (dx, dy) in zip(fruits, spots, strict=True)
        ]
    return parts


@mesh_family("mug")
def mug(rng: np.random.Generator) -> Parts:
    """Cup with a handle."""
    height, radius = rng.uniform(0.07, 0.12), rng.uniform(0.032, 0.05)
    t = np.linspace(0, 1, 24)
    outer = radius * (1 - rng.uniform(0, 0.3) * (1 - t) ** 2)
    turn = np.linspace(-1.9, 1.9, 24)
    reach, grip = rng.uniform(0.5, 0.8) * radius, rng.uniform(0.28, 0.38) * height
    path = np.c_[
        radius * 0.93 + reach * (np.cos(turn) + 0.33), np.zeros(24), height / 2 + grip * np.sin(turn)
    ]
    return {"cup": [hollow(outer, t * height, 0.004)], "handle": [sweep(path, rng.uniform(0.004, 0.007), 12)]}


@mesh_family("fruit")
def fruit(rng: np.random.Generator) -> Parts:
    """A few apples, lemons or stones lying together."""
    count = int(rng.integers(1, 7))
    size = rng.uniform(0.03, 0.06)
    spots = _spread_rand(rng, count, 2.1 * size)
    bodies = [_fruit(rng, size * rng.uniform(0.7, 1.15)) for _ in range(count)]
    stems = [
        sweep(np.array([(0, 0, 0.6), (0.08, 0.03, 1.2), (0.2, 0.05, 1.5)]) * size, 0.0018, 8) for _ in bodies
    ]
    return {
        "skin": [b.at(dx, dy, size) for b, (dx, dy) in zip(bodies, spots, strict=True)],
        "stems": [b.at(dx, dy, size) for b, (dx, dy) in zip(stems, spots, strict=True)],
    }


@mesh_family("stones")
def stones(rng: np.random.Generator) -> Parts:
    """Angular to round stones: balls cut by random planes."""
    count, size = int(rng.integers(1, 4)), rng.uniform(0.04, 0.15)
    d = ball_directions(4)
    out = []
    for dx, dy in _spread_rand(rng, count, 1.7 * size):
        planes = rng.normal(size=(int(rng.integers(8, 30)), 3))
        planes /= np.linalg.norm(planes, axis=1, keepdims=True)
        facing = np.clip(d @ planes.T, 1e-3, None)
        radii = np.minimum(1.05, (rng.uniform(0.55, 0.95, len(planes)) / facing).min(1))
        rough = sum(np.sin(d @ rng.normal(0, 9, 3) + rng.uniform(0, 6.3)) for _ in range(8))
        stone = ball(size * rng.uniform(0.5, 1) * (radii + 0.006 * rough), 4)
        out.append(
            stone.stretched(1, 1, rng.uniform(0.5, 1)).turned(*rng.uniform(0, 360, 3)).at(dx, dy, size * 0.6)
        )
    return {"stone": out}


@mesh_family("lamp")
def lamp(rng: np.random.Generator) -> Parts:
    """Table or floor lamp: foot, stem, conical or pleated shade."""
    floor = rng.random() < 0.4
    height = rng.uniform(1.2, 1.6) if floor else rng.uniform(0.3, 0.6)
    foot, stem = rng.uniform(0.09, 0.15), rng.uniform(0.006, 0.014)
    low, top, tall = rng.uniform(0.12, 0.22), rng.uniform(0.07, 0.14), rng.uniform(0.14, 0.26)
    t = np.linspace(0, 1, 6)
    shade = hollow(low + (top - low) * t, t * tall, 0.002, bottom=False)
    if rng.random() < 0.5:
        angle = np.arctan2(shade.vertices[:, 1], shade.vertices[:, 0])
        pleat = 1 + 0.02 * np.cos(angle * 36)
        shade = Solid(shade.vertices * np.c_[pleat, pleat, np.ones(len(pleat))], shade.normals, shade.faces)
    base = [cone(foot, foot * rng.uniform(0.5, 0.95), rng.uniform(0.012, 0.05), 0.005, 40)]
    bulb = ball(0.03, 3).at(z=height - tall * 0.5)
    return {
        "foot": base,
        "stem": [cylinder(stem, height - tall * 0.4, 0.002, 16)],
        "shade": [shade.at(z=height - tall)],
        "bulb": [bulb],
    }


@mesh_family("potted_plant")
def potted_plant(rng: np.random.Generator) -> Parts:
    """Pot with soil, curved stems, and leaves that are blades, ovals, hearts or needles."""
    radius, tall = rng.uniform(0.06, 0.14), rng.uniform(0.09, 0.2)
    t = np.linspace(0, 1, 12)
    pot = hollow(radius * (0.7 + 0.3 * t), t * tall, 0.005)
    soil = cylinder(radius * 0.93, 0.02, 0.004, 32).at(z=tall * 0.85)
    kind = int(rng.integers(4))
    leaf = _leaf(rng, kind, rng.uniform(0.08, 0.2))
    stems, turns, places = [], [], []
    for _ in range(int(rng.integers(4, 10))):
        aim, reach = rng.uniform(0, 360), rng.uniform(0.12, 0.42)
        s = np.linspace(0, 1, 10)[:, None]
        lean = rng.uniform(0.1, 0.6)
        path = np.c_[lean * reach * s**1.6, 0 * s, reach * s] @ rotation_matrix(z_deg=aim).T + (
            0,
            0,
            tall * 0.9,
        )
        stems.append(sweep(path, np.linspace(0.005, 0.002, 10), 7))
        for k in rng.integers(2, 10, size=int(rng.integers(4, 9))):
            turn = rotation_matrix(rng.normal(0, 25), rng.uniform(-60, 25), rng.uniform(0, 360))
            turns.append(turn * rng.uniform(0.5, 1.2))
            places.append(path[k])
    leaves = copies(leaf, np.array(turns), np.array(places))
    return {"pot": [pot], "soil": [soil], "stems": stems, "leaves": [leaves]}


@mesh_family("picture_frame")
def picture_frame(rng: np.random.Generator) -> Parts:
    """Framed picture with a mount, standing upright with a slight lean."""
    x, z, wide, deep = (
        rng.uniform(0.15, 0.6),
        rng.uniform(0.15, 0.6),
        rng.uniform(0.01, 0.05),
        rng.uniform(0.012, 0.03),
    )
    round_ = rng.uniform(0.002, 0.3 * wide)
    frame = [box(x, deep, wide, round_, 3).at(z=s) for s in (0, z - wide)]
    frame += [box(wide, deep, z - 2 * wide, round_, 3).at(s * (x - wide) / 2, 0, wide) for s in (-1, 1)]
    mount = box(x - wide, 0.004, z - wide, 0.001, 1).at(z=wide / 2)
    border = rng.uniform(0.1, 0.3) * min(x, z)
    picture = box(x - wide - border, 0.003, z - wide - border, 0.0005, 1).at(0, -0.002, (wide + border) / 2)
    lean = rng.uniform(0, 12)
    parts = {"frame": frame, "mount": [mount], "picture": [picture]}
    return {name: [s.turned(x_deg=-lean) for s in solids] for name, solids in parts.items()}


@mesh_family("monitor")
def monitor(rng: np.random.Generator) -> Parts:
    """Flat screen on a stand, with a bezel around the display."""
    x = rng.uniform(0.4, 0.75)
    z, rim, lift = x * rng.uniform(0.5, 0.65), rng.uniform(0.006, 0.02), rng.uniform(0.06, 0.16)
    tilt = rng.uniform(-4, 12)
    shell = [box(x, 0.03, z, 0.006, 3)]
    shell += [box(x, 0.008, rim, 0.002).at(0, -0.017, low) for low in (0, z - rim)]
    shell += [box(rim, 0.008, z, 0.002).at(s * (x - rim) / 2, -0.017) for s in (-1, 1)]
    display = box(x - 2 * rim, 0.003, z - 2 * rim, 0.0005, 1).at(0, -0.0158, rim)
    stand = [box(0.05, 0.02, lift + z * 0.5, 0.005).at(0, 0.03), box(0.26, 0.2, 0.012, 0.005, 3).at(0, 0.02)]
    return {
        "shell": [s.turned(x_deg=-tilt).at(z=lift) for s in shell],
        "display": [display.turned(x_deg=-tilt).at(z=lift)],
        "stand": stand,
    }


def hollow(
    outer: np.ndarray, z: np.ndarray, wall: float, *, bottom: bool = True, segments: int = 48
) -> Solid:
    """Vessel of `wall` thickness from the radii `outer` at heights `z` (rising, from 0), rounded rim.

    bottom: closed below; otherwise open at both ends like a lamp shade.
    """
    inner = np.maximum(outer - wall, 0.002)
    turn = np.linspace(0, np.pi, 6)[1:-1]
    rim = np.c_[(outer[-1] + inner[-1]) / 2 + np.cos(turn) * wall / 2, z[-1] + np.sin(turn) * wall / 2]
    if bottom:
        inside = np.c_[inner, np.maximum(z, wall)][::-1]
        return lathe([(0, 0), *np.c_[outer, z], *rim, *inside, (0, wall)], segments, 50)
    return lathe([*np.c_[outer, z], *rim, *np.c_[inner, z][::-1], (outer[0], z[0])], segments, 50)


def _fruit(rng: np.random.Generator, radius: float) -> Solid:
    """Round to lemon-shaped, dimpled at the poles, slightly uneven."""
    d = ball_directions(3)
    pole = np.abs(d[:, 2])
    radii = 1 + rng.uniform(-0.25, 0.35) * pole**4 - rng.uniform(0, 0.25) * np.exp(-((1 - pole) / 0.02))
    radii += 0.03 * sum(np.sin(d @ rng.normal(0, 2.5, 3) + rng.uniform(0, 6.3)) for _ in range(4)) / 2
    return ball(radius * radii, 3).turned(*rng.normal(0, 25, 2))


def _spread_rand(rng: np.random.Generator, count: int, gap: float) -> np.ndarray:
    """(count, 2) places on the floor, roughly `gap` apart."""
    k = np.arange(count)
    radius, angle = gap * 0.55 * np.sqrt(k * 1.6), 2.4 * k + rng.uniform(0, 6.3)
    return np.c_[radius * np.cos(angle), radius * np.sin(angle)] + rng.normal(0, 0.06 * gap, (count, 2))


def _leaf(rng: np.random.Generator, kind: int, length: float) -> Solid:
    """A leaf along +x from the origin: 0 blade, 1 oval, 2 heart, 3 lobed; folded at its midrib, drooping."""
    t = np.linspace(0, 1, 11)
    half = (
        0.08 * np.sin(np.pi * t**0.7),
        0.26 * np.sin(np.pi * t**0.8) ** 0.8,
        0.42 * np.sqrt(np.clip(t, 0, 1)) * (1 - t) ** 0.7 * 1.5,
        0.3 * np.sin(np.pi * t**0.8) * (0.65 + 0.35 * np.abs(np.cos(np.pi * t * int(rng.integers(3, 6))))),
    )[kind] + 0.006
    across = np.linspace(-1, 1, 5)[None]
    fold, droop = rng.uniform(0.1, 0.6), rng.uniform(0.1, 0.7)
    y = half[:, None] * across
    z = fold * np.abs(y) - droop * (t**2)[:, None] * 0.6 + 0.015 * np.sin(9 * t)[:, None] * across**2
    grid = np.stack(np.broadcast_arrays(t[:, None], y, z), axis=-1) * length
    return sheet(grid, 0.0012)
