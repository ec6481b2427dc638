"""Things to wear and carry: shoes, hats, bags, spectacles, umbrellas, cases."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from fsid.assets.forms import loft, plate, slab
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import Solid, box, cylinder, join, lathe, rotation_matrix, sheet, sweep, tubes


@mesh_family("shoe")
def shoe(rng: np.random.Generator) -> Parts:
    """Pair of shoes, from slipper to boot: sole with a heel, shaped upper, opening, laces through eyelets."""
    length = rng.uniform(0.2, 0.3)
    heel, ankle, point = rng.uniform(0.004, 0.06), rng.uniform(0.05, 0.14), rng.uniform(0.0, 0.5)
    s = np.linspace(0, 1, 22)
    half = length * np.interp(
        s, (0, 0.08, 0.3, 0.68, 0.9, 1), (0.05, 0.11, 0.105, 0.16, 0.11 - 0.05 * point, 0.02)
    )
    bow = 0.02 * length * np.sin(np.pi * s)
    lift = heel * np.clip((0.62 - s) / 0.35, 0, 1) ** 1.5 + 0.012 * np.clip((s - 0.75) / 0.25, 0, 1) ** 2
    high = np.interp(s, (0, 0.1, 0.32, 0.5, 0.75, 1), (ankle, ankle, ankle * 0.95, 0.062, 0.045, 0.02))
    rings = _upper(0.002 + 0.985 * s * length, bow, half, lift + 0.012, high)
    upper = loft(rings)
    edge = 1.06 * half + 0.0025
    sole = _sole(s * length, bow, edge, lift, 0.012)
    parts: dict[str, list[Solid]] = {"leather_upper": [upper], "rubber_sole": [sole]}
    if heel > 0.015:
        block = slab(
            np.c_[s[:6] * length, bow[:6] + edge[:6]], np.c_[s[:6] * length, bow[:6] - edge[:6]], heel + 0.004
        )
        parts["rubber_sole"].append(block)
    mouth = np.linspace(0, 2 * np.pi, 36, endpoint=False)
    oval = np.c_[0.16 * length + 0.14 * length * np.cos(mouth), 0.045 * length * np.sin(mouth)]
    collar = np.c_[oval, np.full(36, heel + 0.011 + 0.97 * ankle)]
    inside = plate(oval, 0.004, 0.0005).at(z=heel + 0.01 + ankle)
    parts["cloth_collar"] = [sweep(collar, 0.0065, 10, closed=True), inside]
    if rng.random() < 0.7:
        rows = int(rng.integers(3, 7))
        t = 0.4 + 0.27 * np.arange(rows) / rows
        parts["yarn_laces"] = _laces(length, t, np.interp(t, s, high + lift), np.interp(t, s, half))
    gap, turn = 0.46 * length, -abs(rng.normal(0, 10))
    pair = {name: list(solids) for name, solids in parts.items()}
    for name, solids in parts.items():
        pair[name] += [_mirrored(p).turned(z_deg=turn).at(y=-gap) for p in solids]
    return pair


def _laces(length: float, t: np.ndarray, high: np.ndarray, half: np.ndarray) -> list[Solid]:
    """Rows of laces at shares `t` of the length, `high` above the floor on an upper `half` as wide; a bow."""
    laces = []
    across = np.linspace(-1, 1, 7)
    for k, (at, z, wide) in enumerate(zip(t, high + 0.0125, 0.3 * half, strict=True)):
        slant = 0.04 * length * (across if k % 2 else -across) / 2
        laces.append(np.c_[at * length + slant, wide * across, z - 0.25 * wide * across**2])
    solids = [tubes(np.array(laces), 0.0018, 6)]
    u = np.linspace(0, 1, 40)[:, None]
    for side in (-1, 1):
        loop = np.c_[
            0.014 * np.sin(2 * np.pi * u), side * 0.028 * np.sin(np.pi * u), -0.012 * u * np.sin(np.pi * u)
        ]
        solids.append(sweep(loop + laces[0][3] + (0, 0, 0.002), 0.0017, 6))
    return solids


@mesh_family("hat")
def hat(rng: np.random.Generator) -> Parts:
    """Brimmed hat: crown with a dent, wavy brim, band."""
    radius = rng.uniform(0.08, 0.1)
    tall, brim = rng.uniform(0.07, 0.14), rng.uniform(1.3, 2.2)
    rng.random()  # of no use any more, but without it every seed has another hat
    s = np.linspace(0, 1, 14)
    crown = np.c_[radius * (1 - 0.25 * s**3), s * tall]
    roof = np.c_[0.75 * radius * np.linspace(1, 0, 8), np.full(8, tall)]
    thick = 0.0035
    out = [
        *np.c_[radius * brim * np.linspace(1, 0, 8)[:-1] + radius * np.linspace(0, 1, 8)[:-1], np.zeros(7)]
    ]
    upper = [(brim * radius, -thick), (brim * radius, 0.0), *out[1:], *crown, *roof[1:]]
    inner = [  # as many rings as outside, so that `shape` bends both alike and neither comes through
        *np.c_[0.73 * radius * np.linspace(0, 1, 8), np.full(8, tall - thick)],
        *np.c_[np.linspace(0.73 * radius, radius - thick, 14), np.linspace(tall - thick, -thick, 14)][1:],
        *np.c_[np.linspace(radius - thick, brim * radius, 8)[1:-1], np.full(6, -thick)],
    ]
    curl, dent, waves = rng.uniform(-0.2, 0.3), 0.75 * rng.uniform(0, 0.4), int(rng.integers(2, 4))

    def shape(p: np.ndarray) -> np.ndarray:
        r, a = np.hypot(p[:, 0], p[:, 1]), np.arctan2(p[:, 1], p[:, 0])
        far = np.clip(r - radius, 0, None)
        rise = curl * far * (0.4 + 0.6 * np.cos(waves * a)) * far / (0.3 * radius)
        sink = dent * tall * np.exp(-((p[:, 1] / (0.3 * radius)) ** 2)) * np.clip(p[:, 2] / tall, 0, 1) ** 3
        return np.c_[p[:, 0] * 1.08, p[:, 1] * 0.94, p[:, 2] + rise - sink]

    felt = lathe([*inner, *upper], 56, 50).warped(shape)
    band = lathe(
        [(radius - 0.001, 0.004), (radius + 0.002, 0.004), (radius + 0.0015, 0.026), (radius - 0.002, 0.026)],
        56,
    )
    return {"cloth_felt": [felt], "cloth_band": [band.warped(shape)]}


@mesh_family("bag")
def bag(rng: np.random.Generator) -> Parts:
    """Handbag or tote: soft body with a mouth, two straps, buckles, a pocket."""
    x, y, z = rng.uniform(0.22, 0.4), rng.uniform(0.07, 0.15), rng.uniform(0.18, 0.34)
    s = np.linspace(0, 1, 18)[:, None]
    a = np.linspace(0, 2 * np.pi, 40, endpoint=False)[None]
    power = rng.uniform(2.5, 6)
    reach = (np.abs(np.cos(a)) ** power + np.abs(np.sin(a)) ** power) ** (-1 / power)
    narrow = rng.uniform(0.5, 1.0)
    sag = 1 + rng.uniform(0, 0.14) * np.sin(np.pi * s) + 0.02 * np.sin(5 * a + 6 * s + rng.uniform(0, 6)) * s
    bx = x / 2 * reach * np.cos(a) * sag * (1 - (1 - narrow) * 0.4 * s)
    by = y / 2 * reach * np.sin(a) * sag * (1 - (1 - 0.35 * narrow) * s)
    outer = np.stack(np.broadcast_arrays(bx, by, z * s), axis=-1)
    inner = (outer * (0.965, 0.93, 1))[:1:-1]
    lip = 0.5 * (outer[-1:] + inner[:1]) + np.array((0, 0, 0.004))
    body = loft(np.concatenate([outer, lip, inner]))
    t = np.linspace(0, np.pi, 26)
    tall, wide = rng.uniform(0.1, 0.28), rng.uniform(0.15, 0.28) * x
    straps, buckles = [], []
    for side in (-1, 1):
        path = np.c_[
            wide * np.cos(t), np.full(26, side * (float(by[-1].max()) + 0.003)), 0.86 * z + tall * np.sin(t)
        ]
        ends = path[[0, -1]] - (0, 0, 0.12 * z)
        path = np.vstack([ends[:1], path, ends[1:]])
        straps.append(sweep(path, 0.005, 10).at(0, 0))
        buckles += [
            box(0.02, 0.005, 0.026, 0.002).at(k * wide, path[0, 1] + side * 0.004, 0.78 * z) for k in (-1, 1)
        ]
    pocket = box(0.45 * x, 0.012, 0.36 * z, 0.006, 3).at(0, -float(by[6].max()) + 0.001, 0.2 * z)
    return {
        "leather_body": [body],
        "leather_straps": straps,
        "metal_buckles": buckles,
        "leather_pocket": [pocket],
    }


@mesh_family("spectacles")
def spectacles(rng: np.random.Generator) -> Parts:
    """Spectacles: two rims of any shape with lenses, bridge, folded or open temples."""
    wide, tall, power = rng.uniform(0.021, 0.029), rng.uniform(0.014, 0.026), rng.uniform(1.8, 4.5)
    wire, droop = rng.uniform(0.0008, 0.0026), rng.uniform(-0.25, 0.25)
    a = np.linspace(0, 2 * np.pi, 44, endpoint=False)
    reach = (np.abs(np.cos(a)) ** power + np.abs(np.sin(a)) ** power) ** (-1 / power)
    outline = np.c_[wide * reach * np.cos(a) * (1 + droop * np.sin(a)), tall * reach * np.sin(a)]
    gap = wide * 1.0 + rng.uniform(0.007, 0.011)
    rims, lenses, metal = [], [], []
    for side in (-1, 1):
        at = {"x": side * gap, "z": 0.03}
        rims.append(
            sweep(np.c_[outline[:, 0] * side, 0 * a, outline[:, 1]][::side], wire, 8, closed=True).at(**at)
        )
        lens = outline * (side, 1)
        lenses.append(plate(lens[::side], 0.0016, 0.0003).turned(x_deg=90).at(y=0.0008, **at))
    t = np.linspace(-1, 1, 12)
    inner = gap - wide * 0.93
    metal.append(sweep(np.c_[inner * t, -0.002 * (1 - t**2), 0.035 + 0.004 * (1 - t**2)], wire * 1.1, 8))
    length = rng.uniform(0.11, 0.14)
    temples = []
    for side in (-1, 1):
        s = np.linspace(0, 1, 16)
        bend = np.clip(s - 0.72, 0, 1) ** 1.5 * 0.14
        path = np.c_[0 * s + 0.006 * side * np.sin(np.pi * s), s * length, -bend]
        folded = 88.0 * side if rng.random() < 0.3 else rng.normal(0, 3)
        temple = sweep(path, wire * (1 + 0.8 * s**2), 8).turned(z_deg=folded)
        temples.append(temple.at(side * (gap + wide + 0.003), 0.003 + 0.004 * (side > 0), 0.036))
        deep = 0.012 if side > 0 else 0.004  # the temple on this side starts farther back
        temples.append(
            box(0.006, deep, 2.4 * wire, 0.0005, 1).at(side * (gap + wide + 0.001), 0.0, 0.036 - wire)
        )
    return {"plastic_rims": rims, "glass": lenses, "metal_bridge": metal, "plastic_temples": temples}


@mesh_family("umbrella")
def umbrella(rng: np.random.Generator) -> Parts:
    """Open umbrella or parasol: panels that sag between their ribs, shaft, hooked handle.

    It lies on the tips of two ribs and its handle, as open ones lie.
    """
    radius, ribs = rng.uniform(0.35, 0.6), int(rng.integers(6, 11))
    rise, sag = rng.uniform(0.18, 0.4) * radius, rng.uniform(0.03, 0.09)
    s = np.linspace(0.02, 1, 11)[:, None]
    a = np.linspace(0, 2 * np.pi, 8 * ribs + 1)[None]
    way, between = a + np.pi / ribs, np.abs(np.sin(ribs * a / 2))
    hem = max(0.09, 1.3 * (1 - np.cos(np.pi / ribs)))
    r = radius * s * (1 - hem * between**1.5 * s)
    z = rise * (1 - s**2) - sag * radius * between * s**1.5 * (1.1 - s)
    points = np.stack(np.broadcast_arrays(r * np.cos(way), r * np.sin(way), z), axis=-1)
    colour = np.arange(ribs) % 2
    panels: tuple[list[Solid], ...] = ([], [])
    for k in range(ribs):
        panels[colour[k]].append(sheet(points[:, 8 * k : 8 * k + 9], 0.0012))
    spoke = np.linspace(0.03, 1.0, 8)
    line = np.stack([radius * spoke, 0 * spoke, rise * (1 - spoke**2) - 0.003], axis=1)
    spokes = tubes(
        np.array([line @ rotation_matrix(z_deg=360 * (k + 0.5) / ribs).T for k in range(ribs)]), 0.0018, 6
    )
    length = radius * rng.uniform(1.2, 1.6)
    shaft = cylinder(0.005, length + rise + 0.03, 0.002, 12).at(z=-length)
    t = np.linspace(0, np.pi * 1.15, 16)
    hook = np.c_[0.035 * (1 - np.cos(t)), 0 * t, -length - 0.035 * np.sin(t)]
    grip = sweep(np.vstack([(0, 0, -length + 0.09), (0, 0, -length + 0.03), hook]), 0.0085, 10)
    grip = grip.turned(z_deg=rng.uniform(-90, 90))
    parts = {
        "cloth_panels": panels[0],
        "cloth_other": panels[1],
        "metal_ribs": [spokes, shaft],
        "wood_handle": [grip],
    }
    canopy = join([*panels[0], *panels[1], spokes])

    def above_deg(lean: float) -> float:
        rim, end = (float(part.turned(y_deg=lean).vertices[:, 2].min()) for part in (canopy, grip))
        return rim - end

    lean = brentq(above_deg, 0, 90)
    return {name: [p.turned(y_deg=lean) for p in solids] for name, solids in parts.items()}


@mesh_family("suitcase")
def suitcase(rng: np.random.Generator) -> Parts:
    """Travel case with ribs, straps, handle, castors and locks."""
    x, y, z = rng.uniform(0.35, 0.6), rng.uniform(0.16, 0.26), rng.uniform(0.3, 0.55)
    soft = rng.uniform(0.01, 0.05)
    shell = [box(x, y, z, soft, 4).at(z=0.04)]
    bars = int(rng.integers(0, 8))
    ribs = (
        [
            box(0.02, y + 0.008, z - 2 * soft, 0.004).at(px, 0, 0.04 + soft)
            for px in np.linspace(-0.36, 0.36, bars) * x
        ]
        if bars
        else []
    )
    straps = []
    if rng.random() < 0.5:
        straps = [box(0.035, y + 0.014, z + 0.006, soft, 3).at(s * 0.27 * x, 0, 0.037) for s in (-1, 1)]
    seam = box(x + 0.004, 0.012, z + 0.004, soft, 4).at(0, 0.12 * y, 0.038)
    t = np.linspace(0, np.pi, 18)
    grip = sweep(np.c_[0.07 * np.cos(t), 0 * t, z + 0.036 + 0.05 * np.sin(t) ** 0.5], 0.008, 10)
    metal = [box(0.03, 0.006, 0.045, 0.002).at(s * 0.16 * x, -y / 2 - 0.003, z - 0.02) for s in (-1, 1)]
    wheels = []
    for sx in (-1, 1):
        for sy in (-1, 1):
            wheel = cylinder(0.018, 0.014, 0.003, 18).at(z=-0.007).turned(x_deg=90)
            wheels.append(wheel.at(sx * 0.4 * x, sy * 0.32 * y, 0.018))
            metal.append(box(0.014, 0.026, 0.034, 0.002).at(sx * 0.4 * x, sy * 0.32 * y, 0.02))
    parts = {
        "shell": shell + ribs,
        "metal_fittings": [*metal, seam],
        "handle": [grip],
        "rubber_wheels": wheels,
    }
    return parts | ({"leather_straps": straps} if straps else {})


@mesh_family("basket")
def basket(rng: np.random.Generator) -> Parts:
    """Woven basket: uprights, strands in front of one and behind the next, a plaited rim, a handle."""
    radius, tall = rng.uniform(0.09, 0.18), rng.uniform(0.08, 0.2)
    stakes, rows = 2 * int(rng.integers(8, 13)), int(rng.integers(7, 11))
    flare, strand = rng.uniform(0.9, 1.35), 0.42 * tall / rows
    a = np.linspace(0, 2 * np.pi, 5 * stakes, endpoint=False)
    paths = []
    for k in range(rows):
        level = (k + 0.5) / rows
        side = 0.055 * np.cos(stakes / 2 * a + np.pi * k)
        r = radius * (1 + (flare - 1) * level + side)
        paths.append(np.c_[r * np.cos(a), r * np.sin(a), np.full(len(a), level * tall)])
    weave = tubes(np.array(paths), strand * 1.05, 5, closed=True)
    b = 2 * np.pi * np.arange(stakes) / stakes
    s = np.linspace(0, 1, 6)[None]
    r = radius * (1 + (flare - 1) * s)
    posts = np.stack(np.broadcast_arrays(r * np.cos(b)[:, None], r * np.sin(b)[:, None], s * tall), axis=-1)
    uprights = tubes(posts, 0.0032, 5)
    around = np.linspace(0, 2 * np.pi, 110, endpoint=False)
    rims = []
    for phase in (0, np.pi):
        twist = 18 * around + phase
        r = radius * flare + 0.006 * np.cos(twist)
        rim = np.c_[r * np.cos(around), r * np.sin(around), tall + 0.006 * np.sin(twist)]
        rims.append(sweep(rim, 0.0052, 6, closed=True))
    floor = cylinder(radius, 0.006, 0.002, 36)
    parts = {"wood_weave": [weave], "wood_stakes": [uprights, floor], "wood_rim": rims}
    if rng.random() < 0.6:
        t = np.linspace(0, np.pi, 24)
        bow = np.c_[radius * flare * np.cos(t), 0 * t, tall + radius * rng.uniform(0.8, 1.6) * np.sin(t)]
        parts["handle"] = [sweep(bow, 0.0065, 9)]
    return parts


def _upper(x: np.ndarray, bow: np.ndarray, half: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Cross sections along x of a body flat below and round above."""
    a = np.linspace(0, 2 * np.pi, 28, endpoint=False)
    c, s = np.cos(a), np.sin(a)
    y = bow[:, None] + half[:, None] * np.sign(c) * np.abs(c) ** 0.5
    z = low[:, None] + np.where(s > 0, high[:, None] * np.abs(s) ** 0.6, -0.004 * np.abs(s) ** 0.3)
    narrow = 1 - 0.2 * np.clip(s, 0, 1) ** 2 * np.clip(high / 0.09, 0, 1)[:, None]
    y = bow[:, None] + (y - bow[:, None]) * narrow
    return np.stack(np.broadcast_arrays(x[:, None], y, z), axis=-1)


def _sole(x: np.ndarray, bow: np.ndarray, edge: np.ndarray, lift: np.ndarray, thick: float) -> Solid:
    flat = slab(np.c_[x, bow + edge], np.c_[x, bow - edge], thick, 0.002)

    def arch(p: np.ndarray) -> np.ndarray:
        return np.c_[p[:, :2], p[:, 2] + np.interp(p[:, 0], x, lift)]

    return flat.warped(arch)


def _mirrored(solid: Solid) -> Solid:
    """Reflected in y = 0: the other shoe of a pair."""
    flip = np.array((1.0, -1.0, 1.0))
    return Solid(solid.vertices * flip, solid.normals * flip, solid.faces[:, ::-1])
