"""Vessels: solids of revolution with walls, feet, spouts and handles, empty or filled."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator

from fsid.assets.forms import fluted, hollow, scatter_rand, spread, squared
from fsid.assets.meshes.food import round_fruit
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import Solid, ball, cone, cylinder, join, lathe, sweep


@mesh_family("vase")
def vase(rng: np.random.Generator) -> Parts:
    """Vase through random radii: round, square, fluted along or across, twisted, sometimes with two ears."""
    height, radius = rng.uniform(0.12, 0.5), rng.uniform(0.05, 0.14)
    knots = np.r_[
        rng.uniform(0.4, 0.9), rng.uniform(0.5, 1, 2), rng.uniform(0.25, 0.8), rng.uniform(0.35, 0.9)
    ]
    t = np.linspace(0, 1, 38)
    outer = radius * PchipInterpolator(np.linspace(0, 1, 5), knots)(t)
    if rng.random() < 0.4:
        outer *= 1 + rng.uniform(0.01, 0.04) * np.cos(2 * np.pi * int(rng.integers(4, 11)) * t)
    wall, style = rng.uniform(0.003, 0.007), rng.random()
    body, sides = hollow(outer, t * height, wall), [np.c_[s * outer, 0 * t, t * height] for s in (1, -1)]
    if style < 0.6:
        warp = (
            squared(rng.uniform(2.4, 6))
            if style < 0.25
            else fluted(int(rng.integers(4, 13)), rng.uniform(0.02, 0.09), rng.normal(0, 9))
        )
        body, sides = body.warped(warp), [warp(side) for side in sides]
    parts = {"body": [body]}
    if rng.random() < 0.25:
        s = np.linspace(0, np.pi, 20)
        low, high = height * rng.uniform(0.3, 0.5), height * rng.uniform(0.7, 0.9)
        out, thick = radius * rng.uniform(0.3, 0.7) * np.sin(s), rng.uniform(0.004, 0.009)
        ears = [_ear(np.abs(side[:, 0]) - 0.7 * wall, t * height, low, high, out, thick) for side in sides]
        parts["handles"] = [ears[0], ears[1].turned(z_deg=180)]
    return parts


def _ear(within: np.ndarray, z: np.ndarray, low: float, high: float, out: np.ndarray, thick: float) -> Solid:
    """Handle from `low` to `high`, `out` (n,) off the wall, that ends in it: at radii `within` at `z`."""
    start, end = np.interp((low, high), z, within)
    share = (1 - np.cos(np.linspace(0, np.pi, len(out)))) / 2
    path = np.c_[start + (end - start) * share + out, 0 * out, low + (high - low) * share]
    return _ending_in_wall(sweep(path, thick, 10), within, z)


def _ending_in_wall(handle: Solid, within: np.ndarray, z: np.ndarray) -> Solid:
    """`handle`, at x > 0, with flat ends where they would come through: at radii `within` at `z`."""
    x, y, height = handle.vertices.T
    flat = np.c_[np.maximum(x, np.interp(height, z, within)), y, height]
    return Solid(flat, handle.normals, handle.faces)


@mesh_family("bottle")
def bottle(rng: np.random.Generator) -> Parts:
    """Bottle, round to square: shoulder, neck, cap or cork, a label around it."""
    height, radius = rng.uniform(0.12, 0.34), rng.uniform(0.025, 0.05)
    neck, shoulder = radius * rng.uniform(0.25, 0.5), rng.uniform(0.45, 0.72)
    top = rng.uniform(0.87, 0.93)
    z = np.array((0, 0.02, shoulder, shoulder + rng.uniform(0.06, 0.15), top, 1.0)) * height
    r = np.array((0.88, 1.0, 1.0, neck / radius * 1.3, neck / radius, neck / radius)) * radius
    t = np.r_[np.linspace(0, 0.03, 5), np.linspace(0.1, shoulder - 0.02, 4), np.linspace(shoulder, 1, 24)]
    t *= height
    glass = [hollow(PchipInterpolator(z, r)(t), t, 0.002, segments=40)]
    low, high = rng.uniform(0.05, 0.2) * height, (shoulder - rng.uniform(0.03, 0.15)) * height
    wrap = [(radius, low), (radius + 0.0008, low), (radius + 0.0008, high), (radius, high)]
    label = [lathe(wrap, 40)]
    if rng.random() < 0.3:
        square = squared(rng.uniform(2.5, 7))
        glass, label = [s.warped(square) for s in glass], [s.warped(square) for s in label]
    if rng.random() < 0.5:
        closure = {"cap": [cylinder(neck * 1.15, 0.1 * height, 0.002, 32).at(z=0.93 * height)]}
    else:
        closure = {"wood_cork": [cone(neck * 0.8, neck * 0.95, 0.12 * height, 0.001, 24).at(z=0.94 * height)]}
    return {"glass": glass, "paper_label": label, **closure}


@mesh_family("glass")
def glass(rng: np.random.Generator) -> Parts:
    """Drinking glass: tumbler, plain or fluted, or stem glass, often with a drink in it."""
    height, radius, wall = rng.uniform(0.07, 0.16), rng.uniform(0.025, 0.045), rng.uniform(0.0015, 0.004)
    stemmed = rng.random() < 0.5
    stem = rng.uniform(0.04, 0.1) if stemmed else 0.0
    t = np.linspace(0, 1, 22)
    if stemmed:
        outer = radius * np.maximum(0.12, np.sin(np.pi * t ** rng.uniform(0.5, 0.8) * rng.uniform(0.55, 0.8)))
    else:
        outer = radius * (1 - rng.uniform(-0.1, 0.3) * (1 - t) ** rng.uniform(0.6, 2))
    cup = hollow(outer, t * height, wall).at(z=stem)
    if not stemmed and rng.random() < 0.4:
        cup = cup.warped(fluted(int(rng.integers(6, 16)), rng.uniform(0.01, 0.04), 0.0))
    parts: dict[str, list[Solid]] = {"glass": [cup]}
    if stemmed:
        s = np.linspace(0, 1, 12)
        post = 0.0035 + 0.7 * radius * np.exp(-9 * s) + 0.12 * radius * s**4
        foot = lathe(
            [(0, 0), (radius * 0.85, 0), (radius * 0.85, 0.0015), *np.c_[post, 0.003 + s * stem]], 40
        )
        parts["glass"].append(foot)
    if rng.random() < 0.6:
        fill = int(22 * rng.uniform(0.3, 0.9))
        inside = np.maximum(outer - wall - 0.0006, 0.001)
        level = t[fill] * height
        drink = np.c_[inside, np.maximum(t * height, wall + 0.0006)][: fill + 1]
        drink = drink[np.r_[True, np.diff(drink[:, 1]) > 1e-6]]
        parts["liquid"] = [lathe([(0, drink[0, 1]), *drink, (0, level)], 40, 50).at(z=stem)]
    return parts


@mesh_family("bowl")
def bowl(rng: np.random.Generator) -> Parts:
    """Bowl on a foot ring, plain or lobed, sometimes full of fruit."""
    radius = rng.uniform(0.08, 0.18)
    depth = radius * rng.uniform(0.35, 0.9)
    t = np.linspace(0, 1, 24)
    curve = rng.uniform(0.35, 0.9)
    outer = radius * (0.35 + 0.65 * t**curve)
    wall = rng.uniform(0.003, 0.006)
    shell = hollow(outer, depth * t, wall)
    if rng.random() < 0.3:
        shell = shell.warped(fluted(int(rng.integers(5, 14)), rng.uniform(0.02, 0.06), 0.0))
    foot = hollow(np.linspace(0.32, 0.36, 4) * radius, np.linspace(0, 0.012, 4), 0.003, bottom=False)
    parts = {"ceramic_bowl": [shell.at(z=0.01), foot]}
    if rng.random() < 0.5:
        count = int(rng.integers(3, 8))
        size = radius * rng.uniform(0.22, 0.32)
        spots = scatter_rand(rng, count, 1.7 * size)
        spots *= min(1.0, 0.5 * radius / np.hypot(*spots.T).max())
        fruits = [round_fruit(rng, size * rng.uniform(0.8, 1.1)) for _ in spots]
        spread_out = [fruit for (fruit,) in spread([[fruit] for fruit in fruits], spots)]
        spots = np.array([(f.vertices[:, :2].min(0) + f.vertices[:, :2].max(0)) / 2 for f in spread_out])
        x = np.linspace(0, 1, 9)
        beside = np.clip((np.hypot(*spots.T)[:, None] + 1.2 * size * x) / radius - 0.35, 0, 0.65) / 0.65
        touch = depth * beside ** (1 / curve) + 1.2 * size * np.sqrt(1 - x * x)
        lift = 0.012 + wall + touch.max(1)
        fits = np.hypot(*spots.T) < radius - 0.9 * size
        parts["peel"] = [f.at(z=z) for f, z, fit in zip(spread_out, lift, fits, strict=True) if fit]
    return parts


@mesh_family("plate")
def plate_stack(rng: np.random.Generator) -> Parts:
    """One to five plates in a stack, coupe or with a rim and a well."""
    radius, rim = rng.uniform(0.07, 0.15), rng.uniform(0.0, 0.45)
    rise, wall = rng.uniform(0.012, 0.035), rng.uniform(0.003, 0.005)
    t = np.linspace(0, 1, 16)
    flat, well = 0.5, 1 - rim * 0.6
    z = rise * np.where(t < (well - flat) / (1 - flat), 0.75, 1.0) * np.clip(t * 1.2, 0, 1) ** 1.3
    z = np.maximum.accumulate(z + 1e-4 * np.arange(16))
    outer = radius * (flat + (1 - flat) * t)
    one = hollow(outer, z - z[0], wall, segments=44)
    foot = lathe([(0.44 * radius, -0.004), (0.47 * radius, -0.004), (0.47 * radius, 0.001)], 44, 50)
    inner = lathe([(0.44 * radius, 0.001), (0.44 * radius, -0.004)], 44, 50)
    if rng.random() < 0.25:
        wavy = fluted(int(rng.integers(8, 20)), rng.uniform(0.01, 0.03), 0.0)
        one, foot, inner = one.warped(wavy), foot.warped(wavy), inner.warped(wavy)
    single = join([one, foot, inner])
    count = 1 if rng.random() < 0.5 else int(rng.integers(2, 6))
    stack = [
        single.turned(z_deg=rng.uniform(0, 360)).at(rng.normal(0, 0.002) * (k > 0), 0, k * (wall + 0.0055))
        for k in range(count)
    ]
    return {"ceramic": stack}


@mesh_family("mug")
def mug(rng: np.random.Generator) -> Parts:
    """Cup with a handle, straight, bulged or waisted, sometimes on a saucer or filled."""
    height, radius, wall = rng.uniform(0.06, 0.12), rng.uniform(0.03, 0.05), rng.uniform(0.003, 0.005)
    t = np.linspace(0, 1, 24)
    outer = radius * (1 - rng.uniform(0, 0.45) * (1 - t) ** rng.uniform(1.5, 4))
    outer *= 1 + rng.normal(0, 0.07) * np.sin(np.pi * t)
    turn = np.linspace(-1.9, 1.9, 24)
    reach, grip = rng.uniform(0.4, 0.8) * radius, rng.uniform(0.22, 0.38) * height
    middle = rng.uniform(0.45, 0.58) * height
    beside = np.interp(middle + grip * np.sin(turn), t * height, outer) - 0.6 * wall
    x = np.maximum(beside, beside + reach * (np.cos(turn) + 0.33))
    x[1:-1] = beside[1:-1] + reach * (np.cos(turn[1:-1]) + 0.33)
    handle = sweep(
        np.c_[x, np.zeros(24), middle + grip * np.sin(turn)], rng.uniform(0.003, 0.006), 12
    ).stretched(1, rng.uniform(1, 1.8), 1)
    handle = _ending_in_wall(handle, outer - 0.7 * wall, t * height)
    parts = {"ceramic_cup": [hollow(outer, t * height, wall)], "ceramic_handle": [handle]}
    if rng.random() < 0.4:
        level = rng.uniform(0.6, 0.9) * height
        inside = float(np.interp(level, t * height, outer)) - wall + 0.0003
        parts["liquid"] = [cone(inside * 0.98, inside, 0.003, 0.0003, 40).at(z=level)]
    if rng.random() < 0.35:
        s = np.linspace(0, 1, 10)
        saucer = hollow(radius * (0.7 + rng.uniform(0.7, 1.1) * s), 0.02 * s**1.4, 0.003)
        parts = {name: [p.at(z=0.0032) for p in solids] for name, solids in parts.items()}
        parts["ceramic_saucer"] = [saucer]
    return parts


@mesh_family("teapot")
def teapot(rng: np.random.Generator) -> Parts:
    """Pot with a spout, a handle at its side or above, and a lid with a knob."""
    radius = rng.uniform(0.06, 0.1)
    height = radius * rng.uniform(1.0, 2.2)
    t = np.linspace(0, 1, 26)
    belly = radius * (0.5 + 0.5 * np.sin(np.pi * (0.12 + 0.78 * t)) ** rng.uniform(0.5, 1.5))
    mouth = belly[-1]
    body = lathe([(0, 0), *np.c_[belly, t * height], (mouth - 0.006, height), (0, height)], 44)
    s = np.linspace(0, 1, 14)
    bend, far = rng.uniform(0.1, 0.5), radius * rng.uniform(0.7, 1.1)
    up = height * (0.3 + rng.uniform(0.55, 0.75) * (s ** (1 + 2 * bend)))
    spout = sweep(np.c_[radius * 0.75 + far * s, 0 * s, up], radius * (0.24 - 0.15 * s), 14)
    tall = None if rng.random() < 0.6 else height * rng.uniform(0.5, 0.9)
    thick = radius * rng.uniform(0.07, 0.11)
    dome = np.linspace(0, np.pi / 2, 8)
    top = rng.uniform(0.15, 0.35) * radius
    lid = lathe(
        [(0, 0), *np.c_[(mouth - 0.003) * np.cos(dome), 0.002 + top * np.sin(dome)][:-1], (0, 0.002 + top)],
        36,
    )
    knob = ball(radius * rng.uniform(0.12, 0.18), 2).stretched(1, 1, rng.uniform(0.7, 1.3))
    lids = [lid.at(z=height + 0.0005), knob.at(z=height + top + 0.1 * radius)]
    if tall is None:
        a = np.linspace(-1.75, 1.75, 22)
        path = np.c_[
            -0.8 * radius - 0.55 * radius * (np.cos(a) + 0.2), 0 * a, height * (0.55 + 0.33 * np.sin(a))
        ]
    else:
        foot, shoulder = float(np.interp(0.75, t, belly)), 0.75 * height
        path = _arch(foot, tall, thick + 0.02 * radius, join(lids).vertices - (0, 0, shoulder))
        path += (0, 0, shoulder)
    return {"ceramic_body": [body, spout], "handle": [sweep(path, thick, 12)], "lid": lids}


def _arch(foot: float, tall: float, away: float, points: np.ndarray) -> np.ndarray:
    """(n, 3) path of a handle in the plane of x and z, from `foot` to -`foot`: a superellipse, `tall` or as
    tall as it takes to stay `away` from `points` (n, 3) about the z axis."""
    beside = np.hypot(points[:, 0], points[:, 1]) / (foot - away)
    tall = max(tall, away + float((points[:, 2] / np.cbrt(1 - beside**3)).max()))
    c, s = np.cos(np.linspace(0, np.pi, 34)), np.sin(np.linspace(0, np.pi, 34))
    return np.c_[foot * np.sign(c) * np.abs(c) ** (2 / 3), 0 * c, tall * np.abs(s) ** (2 / 3)]


@mesh_family("jar")
def jar(rng: np.random.Generator) -> Parts:
    """Preserving jar or tin: ribbed lid, label, contents seen through the glass."""
    radius, height = rng.uniform(0.03, 0.06), rng.uniform(0.06, 0.18)
    t = np.array((0.0, 0.03, 0.06, 0.2, 0.5, 0.76, 0.82, 0.87, 0.9, 0.95, 1.0))
    r = np.array((0.9, 0.97, 1.0, 1, 1, 1, 0.97, 0.88, 0.84, 0.84, 0.84)) * radius
    fine = np.unique(np.r_[t, np.linspace(0.74, 0.92, 8)])
    outer = PchipInterpolator(t, r)(fine)
    parts = {"glass": [hollow(outer, fine * height, 0.0022, segments=44)]}
    level = rng.uniform(0.4, 0.75) * height
    inside = radius * 0.97 - 0.003
    parts["contents"] = [cylinder(inside, level, 0.003, 36).at(z=0.003)]
    lid = cylinder(0.87 * radius, 0.13 * height, 0.0015, 72).warped(fluted(36, rng.choice((0.0, 0.015)), 0.0))
    parts["metal_lid"] = [lid.at(z=0.91 * height)]
    if rng.random() < 0.7:
        low, high = rng.uniform(0.1, 0.3) * height, rng.uniform(0.5, 0.72) * height
        edge = radius + 0.0009
        parts["paper_label"] = [
            lathe(
                [(radius - 0.001, low), (edge, low), (edge, high), (radius - 0.001, high)],
                44,
            )
        ]
    return parts
