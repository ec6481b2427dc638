"""Tools: a handle and a working end, lying on the table."""

from __future__ import annotations

import numpy as np

from fsid.assets.forms import loft, plate, scatter_rand, slab, spread
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import Solid, box, cylinder, join, lathe, sweep, tubes


@mesh_family("hammer")
def hammer(rng: np.random.Generator) -> Parts:
    """Hammer or mallet: shaped handle, a head with a face and a peen or a claw."""
    length, thick = rng.uniform(0.22, 0.38), rng.uniform(0.011, 0.016)
    grip = _grip_rand(rng, length, thick)
    wide = rng.uniform(0.09, 0.13)
    kind = int(rng.integers(3))
    if kind == 2:
        head = [cylinder(rng.uniform(0.025, 0.04), wide, 0.004, 32).at(z=-wide / 2).turned(x_deg=90)]
    else:
        size = rng.uniform(0.011, 0.016)
        s = np.linspace(0, 1, 12)
        face = lathe(
            [(0, 0), (size, 0), (size, 0.008), (0.75 * size, 0.014), (0.75 * size, 0.5 * wide)], 24, 50
        )
        head = [
            face.turned(x_deg=-90).at(y=-0.55 * wide),
            box(2.1 * size, 0.03, 2.1 * size, 0.004).at(z=-1.05 * size),
        ]
        if kind == 0:
            across = size * np.linspace(1, 0.9, 12)
            high = size * (1 - 0.86 * s)
            head.append(_wedge_loft(across, high, 0.014 + s * 0.45 * wide, 0 * s))
        else:
            for side in (-1, 1):
                fan = side * (0.35 * size + 0.5 * size * s)
                prong = _wedge_loft(
                    0.5 * size * (1 - 0.3 * s),
                    0.7 * size * (1 - 0.75 * s),
                    0.012 + s * 0.5 * wide,
                    -1.4 * size * s**2,
                )
                head.append(prong.turned(y_deg=90).at(z=float(fan.mean())))
    parts = {"wood_handle": [grip], "metal_head": [h.at(x=length - 0.012) for h in head]}
    above = -float(join(head).vertices[:, 2].min()) - thick
    lean = np.degrees(np.arcsin(max(above, 0.0) / length))
    return {name: [s.turned(y_deg=-lean) for s in solids] for name, solids in parts.items()}


@mesh_family("wrench")
def wrench(rng: np.random.Generator) -> Parts:
    """Open-ended and ring spanners of falling size, side by side."""
    solids = []
    y = 0.0
    length, deep = rng.uniform(0.12, 0.24), rng.uniform(0.004, 0.008)
    for _ in range(int(rng.integers(1, 5))):
        jaw, bar = length * rng.uniform(0.09, 0.12), length * rng.uniform(0.04, 0.055)
        shaft = _band(np.linspace(0.6 * jaw, length - 0.6 * jaw, 6), np.full(6, bar / 2), deep * 0.7)
        ring = lathe(
            [
                (0.55 * jaw, 0),
                (0.95 * jaw, 0),
                (1.0 * jaw, 0.1 * deep),
                (1.0 * jaw, 0.9 * deep),
                (0.95 * jaw, deep),
                (0.6 * jaw, deep),
                (0.55 * jaw, 0.9 * deep),
                (0.55 * jaw, 0),
            ],
            24,
        )
        angle = np.linspace(0.7, 2 * np.pi - 0.7, 26)
        outer = np.c_[np.cos(angle), np.sin(angle)] * 1.05 * jaw
        inner = np.c_[
            0.62 * jaw * np.cos(angle) + 0.3 * jaw,
            0.5 * jaw * np.sign(np.sin(angle)) * np.minimum(1, np.abs(np.sin(angle)) * 1.6),
        ]
        fork = slab(inner, outer, deep, 0.0006).turned(z_deg=rng.uniform(-20, 20))
        one = [shaft.at(z=0.15 * deep), ring, fork.at(x=length)]
        turn = rng.normal(0, 1)
        solids += [part.turned(z_deg=turn).at(y=y) for part in one]
        y += 2.7 * jaw
        length *= rng.uniform(0.75, 0.92)
    return {"metal": solids}


@mesh_family("screwdriver")
def screwdriver(rng: np.random.Generator) -> Parts:
    """Screwdrivers with fluted handles, flat or cross tips."""
    tools, drawn = [], []
    for _ in range(int(rng.integers(1, 5))):
        radius, length = rng.uniform(0.009, 0.018), rng.uniform(0.07, 0.11)
        s = np.linspace(0, 1, 18)
        bulge = (
            radius
            * (0.8 + 0.2 * np.cos(2 * np.pi * s))
            * np.minimum(1, 6 * np.minimum(s + 0.06, 1.04 - s)) ** 0.5
        )
        body = lathe([(0, 0), *np.c_[bulge, s * length], (0, length)], 48)
        teeth, depth = int(rng.integers(5, 12)), rng.uniform(0.05, 0.16)

        def flute(p: np.ndarray, teeth: int = teeth, depth: float = depth) -> np.ndarray:
            groove = 1 - depth * (0.5 + 0.5 * np.cos(teeth * np.arctan2(p[:, 1], p[:, 0]))) ** 2
            return np.c_[p[:, :2] * groove[:, None], p[:, 2]]

        reach, thin = rng.uniform(0.06, 0.2), rng.uniform(0.002, 0.004)
        rod = cylinder(thin, reach, 0.0005, 14).at(z=length - 0.004)
        if rng.random() < 0.5:
            tip = [box(2.6 * thin, 0.8 * thin, 0.012, 0.0003, 1)]
        else:
            tip = [box(1.9 * thin, 0.6 * thin, 0.008, 0.0002, 1).turned(z_deg=90 * k) for k in range(2)]
        parts = [body.warped(flute), rod, *(t.at(z=length + reach - 0.007) for t in tip)]
        drawn.append((radius, rng.normal(0, 6)))
        tools.append([p.turned(y_deg=90).at(z=radius) for p in parts])
    radii, turns = np.array(drawn).T
    turns = np.sort(turns)  # they fan out, so that none lies across the next
    steepest = np.radians(np.maximum(np.abs(turns[1:]), np.abs(turns[:-1])))
    y = np.r_[0, np.cumsum(1.6 * (radii[1:] + radii[:-1]) / np.cos(steepest))]
    handles, blades = [], []
    for k, parts in enumerate(tools):
        laid = [p.turned(z_deg=float(turns[k])).at(y=float(y[k])) for p in parts]
        handles.append(laid[0])
        blades += laid[1:]
    return {"plastic_handles": handles, "metal_blades": blades}


@mesh_family("saw")
def saw(rng: np.random.Generator) -> Parts:
    """Hand saw: a tapering blade with a row of teeth, a handle with a hole to hold."""
    length, tall, teeth = rng.uniform(0.25, 0.5), rng.uniform(0.07, 0.12), int(rng.integers(30, 70))
    x = np.linspace(0, length, 2 * teeth + 1)
    back = tall * (1 - rng.uniform(0.3, 0.6) * x / length)
    bite = length / teeth * rng.uniform(0.4, 0.8) * (np.arange(2 * teeth + 1) % 2)
    blade = slab(np.c_[x, back], np.c_[x, bite], 0.0014, 0.0002)
    a = np.linspace(0, 2 * np.pi, 44, endpoint=False)
    wave = 1 + 0.08 * np.sin(2 * a + rng.uniform(0, 6)) + 0.05 * np.sin(3 * a + rng.uniform(0, 6))
    loop = np.c_[0.045 * np.cos(a), 0.62 * tall * np.sin(a)] * wave[:, None]
    path = np.c_[loop[:, 0] - 0.03, loop[:, 1] + 0.5 * tall, np.full(44, 0.0007)]
    handle = sweep(path, rng.uniform(0.009, 0.012) * (1 + 0.15 * np.cos(2 * a)), 14, closed=True)
    screws = [cylinder(0.004, 0.0235, 0.001, 14).at(0.012, h * tall, -0.011) for h in (0.3, 0.68)]
    return {"metal_blade": [blade], "wood_handle": [handle], "metal_screws": screws}


@mesh_family("brush")
def brush(rng: np.random.Generator) -> Parts:
    """Paint brush, scrubbing brush or broom head: handle, ferrule, hundreds of bristles."""
    wide, deep, tall = rng.uniform(0.03, 0.12), rng.uniform(0.012, 0.03), rng.uniform(0.03, 0.07)
    length = rng.uniform(0.1, 0.2)
    count = int(rng.integers(250, 420))
    foot = rng.uniform(-1, 1, (count, 2)) * (0.46 * wide, 0.44 * deep)
    flare = rng.uniform(1.0, 1.3)
    s = np.linspace(0, 1, 4)[None, :, None]
    tip = np.c_[foot * flare + rng.normal(0, 0.0015, (count, 2)), rng.uniform(0.85, 1, count) * tall]
    base = np.c_[foot, np.zeros(count)]
    bend = rng.normal(0, 0.003, (count, 1, 3)) * (1, 1, 0) * s * s
    bristles = tubes(base[:, None] * (1 - s) + tip[:, None] * s + bend, 0.0006, 4)
    band = box(wide, deep, 0.03, 0.003, 2).at(z=-0.022)
    x = np.linspace(0, length, 16)
    half = np.interp(
        x / length, (0, 0.15, 0.45, 0.8, 0.95, 1), np.array((0.46, 0.4, 0.17, 0.24, 0.2, 0.1)) * wide
    )
    grip = (
        _band(x, np.maximum(half, 0.006), 0.6 * deep, 0.004)
        .at(z=-0.3 * deep)
        .turned(y_deg=90, z_deg=90)
        .at(z=-0.018)
    )
    parts = {"wood_handle": [grip], "metal_ferrule": [band], "yarn_bristles": [bristles]}
    if rng.random() < 0.6:
        return {name: [p.turned(x_deg=90).at(z=deep) for p in solids] for name, solids in parts.items()}
    return {name: [p.turned(x_deg=180) for p in solids] for name, solids in parts.items()}


@mesh_family("bolts")
def bolts(rng: np.random.Generator) -> Parts:
    """Hexagon bolts with their threads, nuts and washers, spilled."""
    count, radius = int(rng.integers(3, 9)), rng.uniform(0.003, 0.006)
    bolt, nut, washer = _bolt(rng, radius), _nut(radius), _washer(radius)
    parts: dict[str, list[Solid]] = {"metal_bolts": [], "metal_nuts": [], "metal_washers": []}
    spots = scatter_rand(rng, count, 9 * radius)
    spilled, names = [], []
    for k in range(count):
        name, solid = list(zip(parts, (bolt, nut, washer), strict=True))[k % 3]
        lying = (
            90 - np.degrees(np.arcsin(0.06)) if solid is bolt else rng.choice((0.0, 90.0)) * (solid is nut)
        )
        placed = solid.turned(z_deg=rng.choice((0, 60))).turned(x_deg=lying).turned(z_deg=rng.uniform(0, 360))
        spilled.append([placed.resting()])
        names.append(name)
    for name, (solid,) in zip(names, spread(spilled, spots), strict=True):
        parts[name].append(solid)
    return parts


@mesh_family("scissors")
def scissors(rng: np.random.Generator) -> Parts:
    """Scissors, opened: two crossing blades, a rivet, two finger loops."""
    length, open_deg = rng.uniform(0.07, 0.14), rng.uniform(2, 25)
    width, loop = length * rng.uniform(0.1, 0.16), length * rng.uniform(0.16, 0.24)
    blades, grips = [], []
    x = np.linspace(-0.45 * length - 0.5 * loop, length, 18)
    for side in (-1, 1):
        edge = np.interp(x / length, (-0.45, 0, 0.15, 1), (0.25, 0.5, 0.55, 0.04)) * width
        aside = -side * np.interp(x, (x[0], -0.3 * length), (0.1 * loop + 0.005, 0))
        spine, inner = np.c_[x, side * edge + aside], np.c_[x, -side * 0.45 * edge + aside]
        left, right = (spine, inner) if side > 0 else (inner, spine)
        blade = slab(left, right, 0.0022, 0.0004).at(z=0.0023 * (side > 0))
        a, wire = np.linspace(0, 2 * np.pi, 36, endpoint=False), rng.uniform(0.003, 0.005)
        oval = np.c_[
            -0.45 * length - 0.95 * loop + loop * 1.25 * np.cos(a),
            -side * (0.75 * loop + 0.005) + 0.75 * loop * np.sin(a),
        ]
        ring = sweep(np.c_[oval, np.full(36, 0.0035)], wire, 10, closed=True)
        blades.append(blade.turned(z_deg=side * open_deg / 2))
        grips.append(ring.turned(z_deg=side * open_deg / 2))
    rivet = cylinder(0.3 * width, 0.0064, 0.001, 20).at(z=-0.0008)
    return {"metal_blades": blades, "plastic_grips": [g.at(z=0.0018) for g in grips], "metal_rivet": [rivet]}


@mesh_family("pencils")
def pencils(rng: np.random.Generator) -> Parts:
    """Hexagonal and round pencils: sharpened cone of wood, lead, painted shaft; loose or fanned."""
    count, radius = int(rng.integers(2, 10)), rng.uniform(0.0035, 0.006)
    parts: dict[str, list[Solid]] = {"shaft": [], "shaft_other": [], "wood_cone": [], "lead": [], "end": []}
    sides = 6 if rng.random() < 0.7 else 16
    a = 2 * np.pi * np.arange(sides) / sides
    fan = rng.uniform(0, 8)
    drawn = [(rng.uniform(0.07, 0.18), rng.normal(0, 3), rng.normal(0, 0.006)) for _ in range(count)]
    turns = np.sort([fan * (k - count / 2) + turn for k, (_, turn, _) in enumerate(drawn)])
    steepest = np.radians(np.maximum(np.abs(turns[1:]), np.abs(turns[:-1])))
    y = np.r_[0, np.cumsum(2.2 * radius / np.cos(steepest))]
    for k, (length, _, slid) in enumerate(drawn):
        shaft = plate(radius * np.c_[np.cos(a), np.sin(a)], length, 0.0002)
        tip = lathe([(0, 0), (0.97 * radius, 0), (0.27 * radius, 3.2 * radius), (0, 3.2 * radius)], 16).at(
            z=length
        )
        lead = lathe([(0, 0), (0.26 * radius, 0), (0.08 * radius, 0.9 * radius), (0, radius)], 10)
        end = cylinder(1.02 * radius, 0.012, 0.001, 16).at(z=-0.011)
        for name, part in (
            ("shaft" if k % 2 else "shaft_other", shaft),
            ("wood_cone", tip),
            ("lead", lead.at(z=length + 3.2 * radius)),
            ("end", end),
        ):
            lying = part.turned(z_deg=30).turned(y_deg=90).at(0.018 + slid)
            parts[name].append(lying.turned(z_deg=float(turns[k])).at(0, float(y[k]), radius))
    return parts


def _grip_rand(rng: np.random.Generator, length: float, thick: float) -> Solid:
    s = np.linspace(0, 1, 20)
    wave = 1 + 0.18 * np.cos(2 * np.pi * (s * rng.uniform(0.8, 1.6) + rng.uniform(-0.2, 0.2)))
    return sweep(np.c_[s * length, 0 * s, 0 * s], thick * wave * np.linspace(1.05, 0.8, 20), 14).stretched(
        1, 0.75, 1
    )


def _wedge_loft(across: np.ndarray, high: np.ndarray, along: np.ndarray, lift: np.ndarray) -> Solid:
    """Box-like bar along +y of half widths `across` and half heights `high`."""
    a = np.linspace(0, 2 * np.pi, 16, endpoint=False) + np.pi / 16
    c, s = np.cos(a), np.sin(a)
    reach = (np.abs(c) ** 5 + np.abs(s) ** 5) ** -0.2
    x, z = across[:, None] * reach * c, high[:, None] * reach * s + lift[:, None]
    rings = np.stack(np.broadcast_arrays(-x, along[:, None], z), axis=-1)
    return loft(rings)


def _band(x: np.ndarray, half: np.ndarray, height: float, bevel: float = 0.0008) -> Solid:
    return slab(np.c_[x, half], np.c_[x, -half], height, bevel)


def _bolt(rng: np.random.Generator, radius: float) -> Solid:
    length, pitch = radius * rng.uniform(5, 10), radius * 0.42
    a = 2 * np.pi * np.arange(6) / 6
    head = plate(1.8 * radius * np.c_[np.cos(a), np.sin(a)], 1.3 * radius, 0.15 * radius)
    turns = int(length / pitch)
    t = np.linspace(0, 2 * np.pi * turns, 14 * turns)
    helix = np.c_[radius * np.cos(t), radius * np.sin(t), 1.3 * radius + pitch * t / (2 * np.pi)]
    return join(
        [head, cylinder(radius, length, 0.1 * radius, 16).at(z=1.3 * radius), sweep(helix, 0.18 * radius, 4)]
    )


def _nut(radius: float) -> Solid:
    a = 2 * np.pi * np.arange(48) / 48
    flat = np.cos(np.pi / 6) / np.cos((a % (np.pi / 3)) - np.pi / 6)
    outer = 1.8 * radius * flat
    hole, tall = 1.02 * radius, 1.5 * radius
    ring = lathe([(hole, 0), (2.0, 0), (2.0, tall), (hole, tall), (hole, 0)], 48)
    points = ring.vertices.copy()
    wide = np.hypot(points[:, 0], points[:, 1]) > 1.0
    k = np.rint(np.arctan2(points[wide, 1], points[wide, 0]) / (2 * np.pi / 48)).astype(int) % 48
    points[wide, :2] *= (outer[k] / 2.0)[:, None]
    facing = (
        np.round((np.arctan2(points[:, 1], points[:, 0]) - np.pi / 6) / (np.pi / 3)) * np.pi / 3 + np.pi / 6
    )
    normals = ring.normals.copy()
    side = wide & (np.abs(normals[:, 2]) < 0.5)
    normals[side] = np.c_[np.cos(facing[side]), np.sin(facing[side]), np.zeros(side.sum())]
    return Solid(points, normals, ring.faces)


def _washer(radius: float) -> Solid:
    return lathe(
        [
            (1.1 * radius, 0),
            (2.3 * radius, 0),
            (2.3 * radius, 0.3 * radius),
            (1.1 * radius, 0.3 * radius),
            (1.1 * radius, 0),
        ],
        32,
    )
