"""Lamps: a bulb, something around it, something that holds it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fsid.assets.forms import hollow
from fsid.assets.meshes.tables import turned_post
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import Solid, ball, box, cone, cylinder, lathe, sweep


@mesh_family("lamp")
def lamp(rng: np.random.Generator) -> Parts:
    """Table or floor lamp: foot, plain or turned stem, conical, drum or pleated shade."""
    floor = rng.random() < 0.4
    height = rng.uniform(1.2, 1.6) if floor else rng.uniform(0.3, 0.6)
    foot, stem = rng.uniform(0.09, 0.15), rng.uniform(0.006, 0.014)
    low, top, tall = rng.uniform(0.12, 0.22), rng.uniform(0.07, 0.14), rng.uniform(0.14, 0.26)
    t = np.linspace(0, 1, 8)
    waist = rng.uniform(-0.12, 0.12)
    outer, depth = low + (top - low) * t - waist * low * np.sin(np.pi * t), 0.0
    shade = hollow(outer, t * tall, 0.002, bottom=False)
    if rng.random() < 0.5:
        outer = low + (top - low) * t
        shade, depth = _pleated_rand(rng, low, top, tall)
    base = [cone(foot, foot * rng.uniform(0.5, 0.95), rng.uniform(0.012, 0.05), 0.005, 40)]
    post = height - tall * 0.4
    if floor or rng.random() < 0.5:
        pole = cylinder(stem, post - 0.004, 0.002, 16).at(z=0.004)
    else:
        pole = turned_post(rng, rng.uniform(0.02, 0.06), post - 0.004, 28).at(z=0.004)
    held = height - 0.12 * tall
    rod = cylinder(0.003, held - post + 0.01, 0.001, 12).at(z=post - 0.005)
    inside, a = (np.interp(0.88, t, outer) - 0.002) * (1 - depth), np.linspace(0, 2 * np.pi, 49)[:-1]
    hoop = sweep(np.c_[inside * np.cos(a), inside * np.sin(a), np.full(48, held)], 0.0015, 6, closed=True)
    spokes = [box(2 * inside, 0.004, 0.003, 0.001).turned(z_deg=60 * k) for k in range(3)]
    metal = [pole, rod, hoop, *(s.at(z=held - 0.003 + 0.0015 * k) for k, s in enumerate(spokes))]
    bulb = ball(0.03, 3).at(z=height - tall * 0.45)
    return {"foot": base, "stem": metal, "shade": [shade.at(z=height - tall)], "bulb": [bulb]}


@mesh_family("desk_lamp")
def desk_lamp(rng: np.random.Generator) -> Parts:
    """Work lamp with two sprung arms, joints, and a reflector that hangs over the desk."""
    foot, lower, upper = rng.uniform(0.07, 0.11), rng.uniform(0.22, 0.38), rng.uniform(0.2, 0.36)
    lean, bow, tube = rng.uniform(-5, 35), rng.uniform(50, 110), rng.uniform(0.004, 0.007)
    base = [cylinder(foot, rng.uniform(0.015, 0.03), 0.005, 40)]
    hip = np.array((0.0, 0.0, 0.05))
    elbow = hip + lower * _direction(-lean)
    wrist = elbow + upper * _direction(bow - lean)
    arms, joints = [cylinder(0.009, 0.046, 0.002, 16).at(z=0.004)], []
    for a, b in ((hip, elbow), (elbow, wrist)):
        along = np.linspace(a, b, 4)
        for y in (-0.012, 0.012) if rng.random() < 0.7 else (0.0,):
            arms.append(sweep(along, tube, 10).at(y=y))
        joints.append(cylinder(0.014, 0.04, 0.003, 20).at(z=-0.02).turned(x_deg=90).at(*a))
        joints.append(_spring(a + 0.15 * (b - a), a + 0.5 * (b - a)))
    joints.append(cylinder(0.012, 0.04, 0.003, 20).at(z=-0.02).turned(x_deg=90).at(*wrist))
    wide, deep = rng.uniform(0.05, 0.085), rng.uniform(0.08, 0.14)
    s = np.linspace(0, 1, 14)
    bell = hollow(0.022 + (wide - 0.022) * s ** rng.uniform(0.6, 2.5), s * deep, 0.0015, segments=40)
    tilt = rng.uniform(130, 200)
    bulb = ball(0.022, 3).stretched(1, 1, 1.25).at(z=0.6 * deep)
    parts: dict[str, list[Solid]] = {"foot": base, "metal_arms": arms, "joints": joints}
    parts["metal_shade"] = [bell.turned(y_deg=tilt).at(*wrist)]
    parts["bulb"] = [bulb.turned(y_deg=tilt).at(*wrist)]
    return parts


@mesh_family("pendant_lamp")
def pendant_lamp(rng: np.random.Generator) -> Parts:
    """Hanging lamp: ceiling rose, cord, and a globe, a bell, a ribbed paper lantern or stacked rings."""
    cord, size = rng.uniform(0.15, 0.7), rng.uniform(0.09, 0.24)
    shades = _shades_rand(rng, size)
    t = np.linspace(0, 1, 30)
    top = max(float(s.vertices[:, 2].max()) for s in shades)
    sag = rng.normal(0, 0.03) * np.sin(np.pi * t)
    flex = sweep(np.c_[sag, 0 * t, top * 0.55 + t * (cord + top * 0.45)], 0.0028, 8)
    socket = cone(0.016, 0.022, 0.05, 0.003, 24).at(z=0.5 * top)
    rose = cone(0.05, 0.02, 0.03, 0.004, 32).at(z=top + cord)
    mouth = np.concatenate([s.vertices for s in shades])
    wide = 1.98 * float(np.hypot(*mouth[mouth[:, 2] > top - 0.003, :2].T).max())
    spokes = [box(wide, 0.003, 0.002, 0.0005, 1).turned(z_deg=60 * k).at(z=top - 0.004) for k in range(3)]
    return {
        "shade": shades,
        "cord": [flex],
        "socket": [socket, rose, *(s.at(z=0.0004 * k) for k, s in enumerate(spokes))],
        "bulb": [ball(0.028, 3).at(z=0.5 * top - 0.022)],
    }


_RING = ((1.0, 0.0), (0.875, 0.5), (0.75, 1.0))
"""Share of the radius and of the height of a ring of stacked rings, from below."""


def _shades_rand(rng: np.random.Generator, size: float) -> list[Solid]:
    """A globe, a bell, a ribbed paper lantern or stacked rings, open below."""
    kind = int(rng.integers(4))
    t = np.linspace(0, 1, 30)
    if kind == 0:
        angle = np.pi * (0.08 + 0.84 * t)
        squash = rng.uniform(0.7, 1.3)
        outer, z = size * np.sin(angle), size * squash * (1 - np.cos(angle))
        return [hollow(outer, z - z[0], 0.002, bottom=False, segments=44)]
    if kind == 1:
        rise = rng.uniform(0.4, 1.2) * size * 2
        outer = size * (1 - 0.85 * t ** rng.uniform(0.7, 3))
        return [hollow(outer, rise * t, 0.002, bottom=False, segments=44)]
    if kind == 2:
        ribs = int(rng.integers(7, 14))
        angle = np.pi * (0.1 + 0.8 * np.linspace(0, 1, 4 * ribs + 1))
        bulge = 1 - rng.uniform(0.02, 0.07) * np.abs(np.sin(np.arange(4 * ribs + 1) * np.pi / 4))
        z = -size * 0.9 * np.cos(angle)
        return [hollow(size * np.sin(angle) * bulge, z - z[0], 0.0012, bottom=False, segments=36)]
    rings = int(rng.integers(3, 8))
    tall = 2 * size / rings
    widths = size * (0.5 + 0.5 * np.sin(np.pi * (np.arange(rings) + rng.uniform(0.3, 1)) / rings))
    steps = np.array([(w * s, 0.0, (k + 0.8 * h) * tall) for k, w in enumerate(widths) for s, h in _RING])
    wire = sweep(steps * (0.995, 1, 1), 0.0012, 6)
    return [
        hollow(
            w * np.linspace(1, 0.75, 4),
            tall * 0.8 * np.linspace(0, 1, 4),
            0.002,
            bottom=False,
            segments=36,
        ).at(z=k * tall)
        for k, w in enumerate(widths)
    ] + [wire.turned(z_deg=120 * k) for k in range(3)]


@mesh_family("candle")
def candle(rng: np.random.Generator) -> Parts:
    """Candles, dripped and burnt down to different heights, on a holder, with wick and flame."""
    count, radius = int(rng.integers(1, 6)), rng.uniform(0.01, 0.03)
    spots = np.zeros((1, 2)) if count == 1 else _ring(count, 2.2 * radius + 0.45 * radius * count)
    wax, holder, wicks, flames = [], [], [], []
    reach = float(np.hypot(*spots.T).max()) + 2.2 * radius
    holder.append(cone(reach, reach * rng.uniform(0.85, 1), 0.012, 0.003, 48))
    for x, y in spots:
        tall, lift = rng.uniform(0.04, 0.22), 0.012 + rng.uniform(0, 0.05)
        holder.append(cone(radius * 1.25, radius * 1.2, lift - 0.004, 0.002, 24).at(x, y, 0.004))
        body = lathe(
            [
                (0, 0),
                (radius, 0),
                *((radius, tall * k / 12) for k in range(1, 13)),
                (0.7 * radius, tall + 0.001),
                (0.0, tall - 0.3 * radius),
            ],
            28,
            50,
        )
        drips = rng.uniform(0, 6.3, 5), rng.uniform(0.2, 0.95, 5) * tall
        wax.append(body.warped(_dripped(*drips)).at(x, y, lift - 0.001))
        wick = np.c_[
            0.15 * radius * np.linspace(0, 1, 5) ** 2, np.zeros(5), np.linspace(-0.4 * radius, 0.012, 5)
        ]
        wicks.append(sweep(wick, 0.0009, 6).at(x, y, lift + tall))
        s = np.linspace(0.02, 1, 12)
        flame = lathe([(0, 0), *np.c_[0.006 * np.sin(np.pi * s**0.6), 0.03 * s][:-1], (0, 0.03)], 14, 60)
        flames.append(flame.at(x + 0.1 * radius, y, lift + tall + 0.006))
    return {"wax": wax, "holder": holder, "yarn_wick": wicks, "bulb_flame": flames}


def _dripped(angles: np.ndarray, ends: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    def warp(points: np.ndarray) -> np.ndarray:
        angle, z = np.arctan2(points[:, 1], points[:, 0]), points[:, 2]
        swell = np.ones(len(points))
        for a, end in zip(angles, ends, strict=True):
            near = np.exp((np.cos(angle - a) - 1) * 18)
            swell += 0.14 * near / (1 + np.exp((end - z) / 0.006))
        return np.c_[points[:, :2] * swell[:, None], z]

    return warp


def _ring(count: int, radius: float) -> np.ndarray:
    angle = 2 * np.pi * np.arange(count) / count
    return radius * np.c_[np.cos(angle), np.sin(angle)]


def _direction(from_up_deg: float) -> np.ndarray:
    angle = np.radians(from_up_deg)
    return np.array((np.sin(angle), 0.0, np.cos(angle)))


def _spring(start: np.ndarray, end: np.ndarray) -> Solid:
    t = np.linspace(0, 1, 90)[:, None]
    side = np.array((-(end - start)[2], 0.0, (end - start)[0])) / np.linalg.norm(end - start)
    coil = np.cos(2 * np.pi * 9 * t) * side + np.sin(2 * np.pi * 9 * t) * np.array((0.0, 1.0, 0.0))
    return sweep(start + t * (end - start) + 0.006 * coil, 0.0011, 5)


def _pleated_rand(rng: np.random.Generator, low: float, top: float, tall: float) -> tuple[Solid, float]:
    """A conical shade and the depth of its pleats, a share of its radius."""
    count, depth = int(rng.integers(24, 60)), rng.uniform(0.015, 0.04)
    t = np.linspace(0, 1, 4)
    shade = hollow(low + (top - low) * t, t * tall, 0.002, bottom=False, segments=4 * count)

    def warp(points: np.ndarray) -> np.ndarray:
        pleat = 1 + depth * np.cos(count * np.arctan2(points[:, 1], points[:, 0]))
        return np.c_[points[:, :2] * pleat[:, None], points[:, 2]]

    return shade.warped(warp), depth
