"""Cords: tubes along curves, twisted, coiled, knotted, wound, linked."""

from __future__ import annotations

import numpy as np

from fsid.assets.forms import spread
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import Solid, ball, box, copies, cylinder, lathe, rotation_matrix, sweep


@mesh_family("knot")
def knot(rng: np.random.Generator) -> Parts:
    """Closed tube along a random smooth curve, like a hose or a thick cord."""
    count, tightest = 220, 0.0
    t = np.linspace(0, 2 * np.pi, count, endpoint=False)[:, None]
    while tightest < 0.02:
        path = np.zeros((count, 3))
        for k in range(1, int(rng.integers(3, 6))):
            path += rng.normal(0, k**-1.2, 3) * np.cos(k * t) + rng.normal(0, k**-1.2, 3) * np.sin(k * t)
        path *= rng.uniform(0.15, 0.3) / np.abs(path).max()
        along = np.roll(path, -1, axis=0) - path
        step = np.linalg.norm(along, axis=1, keepdims=True)
        along /= step
        bend = np.linalg.norm(np.roll(along, -1, axis=0) - along, axis=1)
        tightest = float((step[:, 0] / bend).min())
    thick = min(rng.uniform(0.012, 0.035), 0.7 * tightest)
    radius = thick * (1 + rng.uniform(0, 0.25) * np.cos(int(rng.integers(5, 40)) * t[:, 0]))
    return {"rubber_tube": [sweep(path, radius, 14, closed=True)]}


@mesh_family("rope")
def rope(rng: np.random.Generator) -> Parts:
    """Rope of twisted strands in a flat coil, a hank or a loose curve, with whipped ends."""
    thick, strands = rng.uniform(0.004, 0.011), int(rng.integers(2, 5))
    path = _lying_rand(rng, 2.1 * thick, 260)
    length = np.r_[0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]
    lay = length / (thick * rng.uniform(5, 8)) * 2 * np.pi
    side, up = _around(path)
    twisted = []
    for k in range(strands):
        angle = (lay + 2 * np.pi * k / strands)[:, None]
        twisted.append(path + 0.5 * thick * (np.cos(angle) * side + np.sin(angle) * up))
    parts: dict[str, list[Solid]] = {"yarn": [], "yarn_other": []}
    for k, line in enumerate(twisted):
        name = "yarn_other" if k == 0 and rng.random() < 0.5 else "yarn"
        parts[name].append(sweep(line, 0.56 * thick, 6))
    parts["ends"] = [sweep(path[:3], 1.12 * thick, 10), sweep(path[-3:], 1.12 * thick, 10)]
    return {name: solids for name, solids in parts.items() if solids}


@mesh_family("cable")
def cable(rng: np.random.Generator) -> Parts:
    """Cable with a plug at each end, coiled and tied or lying loose."""
    thick = rng.uniform(0.002, 0.005)
    path = _lying_rand(rng, 2.2 * thick, 240)
    plugs, metal = [], []
    for end, inner, hair in ((path[0], path[3], 0.0), (path[-1], path[-4], 0.0004)):
        heading = np.degrees(np.arctan2(*(end - inner)[1::-1]))
        size = thick * rng.uniform(2.2, 3.5)
        body = box(3.5 * size, 1.8 * size, size, 0.3 * size, 3).at(1.5 * size)
        relief = [
            cylinder((1.3 + 0.4 * (k % 2)) * thick, 0.4 * size, 0.0004, 14)
            .turned(y_deg=90)
            .at(-0.4 * size * (k + 1), 0, size / 2)
            for k in range(3)
        ]
        if rng.random() < 0.5:
            pins = [
                cylinder(0.14 * size, 1.6 * size, 0.0004, 12)
                .turned(y_deg=90)
                .at(3.2 * size, s * 0.45 * size, size / 2)
                for s in (-1, 1)
            ]
        else:
            pins = [box(1.4 * size, 1.2 * size, 0.5 * size, 0.0004, 1).at(3.8 * size, 0, 0.25 * size)]
        low = max(float(end[2]) - size / 2, 0.0) + hair
        plugs += [p.turned(z_deg=heading).at(end[0], end[1], low) for p in (body, *relief)]
        metal += [p.turned(z_deg=heading).at(end[0], end[1], low) for p in pins]
    return {"rubber_cable": [sweep(path, thick, 8)], "plastic_plugs": plugs, "metal_pins": metal}


@mesh_family("yarn_ball")
def yarn_ball(rng: np.random.Generator) -> Parts:
    """Ball wound from a cord in great circles, with a loose end."""
    radius, thread = rng.uniform(0.04, 0.1), rng.uniform(0.0025, 0.007)
    angle = np.linspace(0, 2 * np.pi, 36, endpoint=False)
    wobble = rng.uniform(0.02, 0.1)
    ring = np.c_[radius * np.cos(angle), radius * np.sin(angle), wobble * radius * np.sin(3 * angle)]
    loop = sweep(ring, thread, 5, closed=True)
    count = min(int(rng.integers(18, 27) * max(0.06 * radius / thread, 1.0)), 48)
    turns = [rotation_matrix(*rng.uniform(0, 360, 3)) * rng.uniform(0.94, 1.06) for _ in range(count)]
    strands = copies(loop, np.array(turns), np.zeros((count, 3)))
    s = np.linspace(0, 1, 40)
    way = rng.normal(0, 1.2) * s + 0.6 * np.sin(rng.uniform(3, 9) * s)
    step = rng.uniform(1, 4) * radius / 40
    floor = float(strands.vertices[:, 2].min()) + thread
    tail = np.c_[0.1 * radius + np.cumsum(np.cos(way)) * step, np.cumsum(np.sin(way)) * step, floor + 0 * s]
    return {"yarn": [strands, sweep(tail, thread, 6)], "yarn_core": [ball(radius * 0.97, 3)]}


@mesh_family("thread_spools")
def thread_spools(rng: np.random.Generator) -> Parts:
    """Spools wound with thread or wire, standing and lying."""
    reels: list[Solid] = []
    threads: list[Solid] = []
    count = int(rng.integers(1, 5))
    for k in range(count):
        radius, tall = rng.uniform(0.012, 0.03), rng.uniform(0.03, 0.06)
        flange = rng.uniform(0.0025, 0.005)
        core = 0.45 * radius
        reel = lathe(
            [
                (0.2 * radius, 0),
                (radius, 0),
                (radius, flange),
                (core, 2 * flange),
                (core, tall - 2 * flange),
                (radius, tall - flange),
                (radius, tall),
                (0.2 * radius, tall),
                (0.2 * radius, 0),
            ],
            32,
        )
        turns = int(rng.integers(14, 26))
        t = np.linspace(0, 1, 13 * turns)
        pitch = (tall - 3 * flange) / turns
        wound = rng.uniform(0.65, 0.95) * (radius - 0.8 * pitch) * (1 + 0.04 * np.sin(np.pi * t))
        coil = np.c_[
            wound * np.cos(2 * np.pi * turns * t),
            wound * np.sin(2 * np.pi * turns * t),
            1.5 * flange + t * (tall - 3 * flange),
        ]
        inside = cylinder(float(wound.min()), tall - 2.6 * flange, 0.001, 24).at(z=1.3 * flange)
        lying = rng.random() < 0.4
        for bits, part in ((reels, reel), (threads, sweep(coil, 0.55 * pitch, 5)), (threads, inside)):
            if lying:
                part = part.turned(x_deg=90, z_deg=20.0 * k).at(z=radius)
            bits.append(part.at(0.07 * k, 0.01 * (k % 2)))
    return {"reels": reels, "yarn": threads}


@mesh_family("chain")
def chain(rng: np.random.Generator) -> Parts:
    """Chain of oval or long links, lying in a curve, perhaps with a ring at its end."""
    wire = rng.uniform(0.002, 0.006)
    links, long = int(rng.integers(14, 34)), rng.uniform(1.35, 2.2)
    inner = 1.5 * wire
    a = np.linspace(0, 2 * np.pi, 18, endpoint=False)
    oval = np.c_[
        (inner + wire) * (np.cos(a) + (long - 1) * np.tanh(3 * np.cos(a))), (inner + wire) * np.sin(a), 0 * a
    ]
    link = sweep(oval, wire, 7, closed=True)
    pitch = 2 * (float(oval[:, 0].max()) - wire)
    way = np.cumsum(rng.normal(0, 0.16, links)) + rng.uniform(0.1, 0.3) * np.arange(links)
    end, wide = float(oval[:, 0].max()), 2.2  # the ring is as many times a link
    places, ring_at = _hung(way, pitch, (1 + wide) * end)
    while _meet(places, 2 * (end + wire)) or _near(ring_at, places[1:], (1 + wide) * end):
        way *= 0.85  # it came back to itself
        places, ring_at = _hung(way, pitch, (1 + wide) * end)
    # One link leans this way, the next that way; the first stands, and a ring that lies goes through it.
    roll = 35 + 55 * np.clip(1 - np.arange(links) / 5, 0, 1) + 90 * (np.arange(links) % 2)
    turns = [rotation_matrix(r + rng.normal(0, 6), 0, np.degrees(w)) for r, w in zip(roll, way, strict=True)]
    chained = copies(link, np.array(turns), places)
    thick = 1.3 * wire
    drop = np.arcsin((chained.vertices[:, 2].min() + thick) / (2 * wide * end))
    ring = sweep(wide * (oval - (end, 0, 0)), thick, 8, closed=True).at(x=wire + thick - end)
    ring = ring.turned(y_deg=float(np.degrees(drop))).turned(z_deg=float(np.degrees(way[0]))).at(*places[0])
    return {"metal": [chained], "metal_ring": [ring]}


@mesh_family("springs")
def springs(rng: np.random.Generator) -> Parts:
    """Helical springs: cylindrical, conical or barrel-shaped, standing, lying or bent."""
    solids, spots = [], []
    for k in range(int(rng.integers(1, 5))):
        radius, tall, turns = rng.uniform(0.01, 0.03), rng.uniform(0.04, 0.12), int(rng.integers(4, 12))
        wire = min(rng.uniform(0.001, 0.0035), 0.3 * tall / turns)
        t = np.linspace(0, 1, 22 * turns)
        shape = 1 + rng.uniform(-0.6, 0.4) * np.sin(np.pi * t) + rng.uniform(-0.5, 0) * t
        angle = 2 * np.pi * turns * t
        eased = np.clip((t - 0.05) / 0.9, 0, 1)
        path = np.c_[radius * shape * np.cos(angle), radius * shape * np.sin(angle), tall * eased + wire]
        bow = rng.normal(0, 0.4) * path[:, 2] ** 2 / tall
        spring = sweep(path + np.c_[bow, 0 * bow, 0 * bow], wire, 8)
        if rng.random() < 0.5:
            spring = spring.turned(x_deg=90).turned(z_deg=rng.uniform(0, 360))
        solids.append([spring.resting()])
        spots.append((0.07 * (k % 2), 0.08 * (k // 2)))
    return {"metal": [spring for (spring,) in spread(solids, np.array(spots))]}


@mesh_family("beads")
def beads(rng: np.random.Generator) -> Parts:
    """String of beads in two kinds: round, barrel, faceted or disc, in a loop or spilled line."""
    size = rng.uniform(0.004, 0.011)
    path = _lying_rand(rng, 2.4 * size, 300)
    walked = np.r_[0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]
    kinds = [_bead_rand(rng, size) for _ in range(2)]
    groups: tuple[list[tuple[np.ndarray, np.ndarray]], ...] = ([], [])
    at, rhythm, k = size, int(rng.integers(2, 6)), 0
    while at < walked[-1] - size and k < 38:
        which = int(k % rhythm == 0)
        here, ahead = (
            np.array([np.interp(at + d, walked, path[:, i]) for i in range(3)]) for d in (0, 0.3 * size)
        )
        heading = np.degrees(np.arctan2(*(ahead - here)[1::-1]))
        groups[which].append((rotation_matrix(rng.uniform(0, 360), 0, heading), here))
        at += kinds[which][1] * 1.02
        k += 1
    strung = path[: max(int(np.searchsorted(walked, at)), 8)]
    parts = {"yarn": [sweep(strung, 0.0006, 4)]}
    for name, (bead, _), group in zip(("beads", "glass_beads"), kinds, groups, strict=True):
        parts[name] = [copies(bead, np.array([g[0] for g in group]), np.array([g[1] for g in group]))]
    return parts


def _hung(way: np.ndarray, pitch: float, far: float) -> tuple[np.ndarray, np.ndarray]:
    """Middles (n, 3) of links that head for `way` (rad), end to end, and of a ring `far` behind the first."""
    heading = np.c_[np.cos(way), np.sin(way), 0 * way]
    places = np.cumsum(pitch / 2 * (heading + np.roll(heading, 1, axis=0)), axis=0)
    return places, places[0] - far * heading[0]


def _meet(places: np.ndarray, reach: float) -> bool:
    """Whether two places four or more after each other are closer than `reach`."""
    return any(_near(place, places[k + 4 :], reach) for k, place in enumerate(places[:-4]))


def _near(place: np.ndarray, others: np.ndarray, reach: float) -> bool:
    return bool((np.linalg.norm(others - place, axis=1) < reach).any())


def _bead_rand(rng: np.random.Generator, size: float) -> tuple[Solid, float]:
    """A bead along x, and how much of the string it takes."""
    kind = int(rng.integers(4))
    s = np.linspace(0.08, np.pi - 0.08, 9)
    long = (1.0, 1.4, 1.0, 0.45)[kind]
    profile = np.c_[size * np.sin(s) ** (1.0, 0.5, 0.9, 0.5)[kind], -size * long * np.cos(s)]
    sides = (14, 12, 6, 14)[kind]
    low, high = (0.0, float(profile[0, 1])), (0.0, float(profile[-1, 1]))
    solid = lathe([low, *profile[:: 1 if kind != 2 else 2], high], sides, 20 if kind == 2 else 50)
    return solid.turned(y_deg=90), 2 * size * long


def _lying_rand(rng: np.random.Generator, gap: float, count: int) -> np.ndarray:
    """(count, 3) path on the floor: a flat spiral, a stack of loops or a meander, crossing over itself."""
    t = np.linspace(0, 1, count)
    kind = int(rng.integers(3))
    if kind == 0:
        angle = 2 * np.pi * rng.uniform(2.5, 6) * t
        r = gap * 1.06 * (1.2 + angle / (2 * np.pi))
        return _lifted(np.c_[r * np.cos(angle), r * np.sin(angle)], gap)
    if kind == 1:
        angle = 2 * np.pi * rng.uniform(3, 7) * t
        r = gap * rng.uniform(8, 14) * (1 + 0.12 * np.sin(2.3 * angle) + 0.06 * t)
        return _lifted(np.c_[r * np.cos(angle), rng.uniform(0.4, 1) * r * np.sin(angle)], gap)
    way = np.zeros(count)
    for k in range(1, 6):
        way += rng.normal(0, 2.4 / k) * np.sin(np.pi * k * t + rng.uniform(0, 6.3))
    step = gap * rng.uniform(30, 60) / count
    return _lifted(np.c_[np.cumsum(np.cos(way)) * step, np.cumsum(np.sin(way)) * step], gap)


def _lifted(plan: np.ndarray, gap: float) -> np.ndarray:
    """(n, 3) path above `plan` (n, 2) of a cord of thickness `gap`: on the floor, or on itself."""
    walked = np.r_[0, np.cumsum(np.linalg.norm(np.diff(plan, axis=0), axis=1))]
    along = walked[:, None] - walked
    across = np.linalg.norm(plan[:, None] - plan, axis=-1)
    on = np.where(along > 2.5 * gap, gap**2 - across**2, -1.0)
    rise = np.where(on > 0, np.sqrt(np.maximum(on, 0)), -np.inf)
    z = np.full(len(plan), gap / 2)
    for _ in range(12):
        held = np.maximum(z, (z + rise).max(1))
        ramp = (held - 0.5 * np.abs(along)).max(1)
        if np.allclose(ramp, z, atol=1e-3 * gap):
            break
        z = ramp
    return np.c_[plan, z]


def _around(path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit vectors (n, 3) across a path that lies nearly flat: to its side and upwards."""
    along = np.gradient(path, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    side = np.cross((0.0, 0.0, 1.0), along)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    return side, np.cross(along, side)
