"""Electronics: screens, keys, grilles, lenses."""

from __future__ import annotations

import numpy as np

from fsid.assets.forms import hollow, plate
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import Solid, ball, box, copies, cylinder, join, lathe, sheet, sweep


@mesh_family("monitor")
def monitor(rng: np.random.Generator) -> Parts:
    """Flat screen on a stand, with a bezel around the display."""
    x = rng.uniform(0.4, 0.75)
    z, rim, lift = x * rng.uniform(0.5, 0.65), rng.uniform(0.006, 0.02), rng.uniform(0.06, 0.16)
    tilt = rng.uniform(-4, 12)
    shell, display = _panel(x, z, rim, rng.uniform(0.02, 0.035))
    stand = [box(0.05, 0.02, lift + z * 0.5 - 0.004, 0.005).at(0, 0.03, 0.004)]
    if rng.random() < 0.5:
        stand.append(box(rng.uniform(0.2, 0.3), rng.uniform(0.15, 0.22), 0.012, 0.005, 3).at(0, 0.02))
    else:
        stand.append(cylinder(rng.uniform(0.09, 0.13), 0.012, 0.004, 48).at(0, 0.02))
    placed = [s.turned(x_deg=-tilt).at(z=lift) for s in shell]
    return {"plastic_shell": placed, "screen": [display.turned(x_deg=-tilt).at(z=lift)], "stand": stand}


@mesh_family("television")
def television(rng: np.random.Generator) -> Parts:
    """Television: a wide flat one on two feet, or an old one with a bulged tube, knobs and antenna."""
    return _flat_television_rand(rng) if rng.random() < 0.6 else _tube_television_rand(rng)


def _flat_television_rand(rng: np.random.Generator) -> Parts:
    x = rng.uniform(0.8, 1.5)
    z, rim, lift = x * rng.uniform(0.55, 0.6), rng.uniform(0.008, 0.025), rng.uniform(0.05, 0.1)
    shell, display = _panel(x, z, rim, rng.uniform(0.025, 0.05))
    feet = []
    for s in (-1, 1):
        legs = np.array([(0, -0.14, 0.008), (0, 0.0, lift + 0.02), (0, 0.14, 0.008)])
        fine = np.linspace(0, 2, 11)
        path = np.c_[0 * fine, np.interp(fine, range(3), legs[:, 1]), np.interp(fine, range(3), legs[:, 2])]
        feet.append(sweep(path, 0.008, 8).at(s * rng.uniform(0.25, 0.42) * x))
    front = [s.at(z=lift) for s in shell]
    return {"plastic_shell": front, "screen": [display.at(z=lift)], "feet": feet}


def _tube_television_rand(rng: np.random.Generator) -> Parts:
    x, y, z = rng.uniform(0.35, 0.6), rng.uniform(0.25, 0.4), rng.uniform(0.3, 0.45)
    wide, tall = x * rng.uniform(0.62, 0.75), z * 0.8
    case = [box(x, y, z, rng.uniform(0.008, 0.04), 4).at(z=0.03)]
    left = -x / 2 + 0.05 * x + wide / 2
    grid = np.linspace(-1, 1, 15)
    u, v = np.meshgrid(grid, grid)
    reach = (np.abs(u) ** 6 + np.abs(v) ** 6 + 1e-9) ** (1 / 6)
    square = np.maximum(np.abs(u), np.abs(v)) / np.maximum(reach, 1e-6)
    bulge = -y / 2 - 0.002 - 0.02 * (1 - (u**2 + v**2) / 2)
    points = np.stack([left + u * square * wide / 2, bulge, 0.03 + z / 2 + v * square * tall / 2], axis=-1)
    tube = sheet(points, 0.004)
    knob = lathe([(0, 0), (0.018, 0), (0.016, 0.014), (0.006, 0.018), (0, 0.018)], 20).turned(x_deg=90)
    right = (left + wide / 2 + x / 2) / 2
    knobs = [knob.at(right, -y / 2, 0.03 + z * h) for h in (0.8, 0.64)]
    grille = [
        box(0.6 * (x / 2 - left - wide / 2), 0.006, 0.004, 0.001, 1).at(right, -y / 2, 0.03 + z * h)
        for h in np.linspace(0.12, 0.45, 9)
    ]
    feet = [cylinder(0.012, 0.035, 0.002, 12).at(a * 0.4 * x, b * 0.35 * y) for a in (-1, 1) for b in (-1, 1)]
    rods = (
        [
            sweep(np.array([(0, 0, z), (s * 0.12, 0.03, z + 0.22), (s * 0.2, 0.04, z + 0.36)]), 0.0022, 8)
            for s in (-1, 1)
        ]
        if rng.random() < 0.6
        else []
    )
    parts = {"case": case, "screen": [tube], "plastic_knobs": knobs, "grille": grille, "feet": feet}
    return parts | ({"metal_antenna": [r.at(z=0.025) for r in rods]} if rods else {})


@mesh_family("laptop")
def laptop(rng: np.random.Generator) -> Parts:
    """Open laptop: keyboard with separate keys, touchpad, lid with a display at any angle."""
    x = rng.uniform(0.28, 0.4)
    y, thin, angle = x * rng.uniform(0.62, 0.72), rng.uniform(0.008, 0.018), rng.uniform(75, 140)
    base = [box(x, y, thin, 0.004, 2)]
    keys = _keys(x * 0.9, y * 0.48, int(rng.integers(4, 7)), rng.uniform(0.0012, 0.0025)).at(
        0, 0.16 * y, thin
    )
    pad = box(x * 0.34, y * 0.28, 0.0012, 0.0004, 1).at(0, -0.28 * y, thin - 0.0003)
    shell, display = _panel(x, y, rng.uniform(0.004, 0.012), 0.006)
    lid = [s.turned(x_deg=90 - angle).at(0, y / 2, thin + 0.001) for s in shell]
    hinge = [
        cylinder(0.004, 0.16 * x, 0.0008, 12).turned(y_deg=90).at(s * 0.3 * x - 0.08 * x, y / 2, thin)
        for s in (-1, 1)
    ]
    return {
        "case": base + lid + hinge,
        "plastic_keys": [keys],
        "pad": [pad],
        "screen": [display.turned(x_deg=90 - angle).at(0, y / 2, thin + 0.001)],
    }


@mesh_family("keyboard")
def keyboard(rng: np.random.Generator) -> Parts:
    """Keyboard with dished keys in two colours, perhaps a number block, a cable."""
    x = rng.uniform(0.28, 0.45)
    y, tilt, rows = rng.uniform(0.11, 0.16), rng.uniform(2, 8), int(rng.integers(4, 7))
    board = box(x, y, rng.uniform(0.012, 0.02), 0.004, 3)
    top = float(board.vertices[:, 2].max())
    tall = rng.uniform(0.003, 0.009)
    split = rng.uniform(0.68, 0.8)
    left = _keys(x * split - 0.008, y * 0.9, rows, tall).at(-x / 2 * (1 - split) + 0.002, 0, top)
    right = _keys(x * (1 - split) - 0.012, y * 0.9, rows, tall).at(x / 2 * split - 0.002, 0, top)
    s = np.linspace(0, 1, 26)
    cord = np.c_[
        0.08 * np.sin(rng.uniform(3, 7) * s) * s, y / 2 - 0.004 + 0.224 * s, 0.0022 + 0.006 * (1 - s) ** 4
    ]

    def wedge(p: np.ndarray) -> np.ndarray:
        rise = np.tan(np.radians(tilt)) * (p[:, 1] + y / 2)
        return np.c_[p[:, :2], p[:, 2] + rise * np.minimum(p[:, 2] / top, 1)]

    return {
        "case": [board.warped(wedge)],
        "plastic_keys": [left.warped(wedge)],
        "plastic_block": [right.warped(wedge)],
        "rubber_cable": [sweep(cord, 0.0022, 7)],
    }


@mesh_family("loudspeaker")
def loudspeaker(rng: np.random.Generator) -> Parts:
    """Box with two to four cones, their rubber rings, and screws."""
    x, y = rng.uniform(0.14, 0.28), rng.uniform(0.16, 0.28)
    count = int(rng.integers(1, 4))
    radii = x * np.sort(rng.uniform(0.18, 0.42, count))[::-1]
    gap = rng.uniform(0.01, 0.03)
    z = float(2.5 * radii.sum() + gap * (count + 1))
    case = [box(x, y, z, rng.uniform(0.002, 0.02), 3)]
    cones: list[Solid] = []
    rings: list[Solid] = []
    screws: list[Solid] = []
    centre, s = gap, np.linspace(0, 1, 10)
    for r in radii:
        centre += 1.25 * r
        bowl = np.c_[r * (0.3 + 0.55 * s), 0.3 * r * s**0.7]
        dome = np.c_[0.3 * r * np.sin(s * np.pi / 2), 0.16 * r * np.cos(s * np.pi / 2)]
        roll = np.c_[0.92 * r + 0.08 * r * np.cos(np.pi * s), 0.3 * r + 0.06 * r * np.sin(np.pi * s)]
        rim = [(0.84 * r, 0.3 * r), (0.84 * r, -0.003)]
        cone = lathe([(0, -0.006), (0.87 * r, -0.006), *bowl[::-1], *dome[:-1][::-1], (0, 0.16 * r)], 36, 50)
        ring = lathe([(1.05 * r, -0.002), (1.05 * r, 0.3 * r), *roll, *rim], 36, 50)
        bolt = cylinder(0.003, 0.006, 0.0008, 8).at(1.13 * r, 0, -0.002)
        for bits, part in ((cones, cone), (rings, ring)):
            bits.append(part.turned(x_deg=90).at(0, -y / 2, centre))
        screws += [bolt.turned(z_deg=60 * k).turned(x_deg=90).at(0, -y / 2, centre) for k in range(6)]
        centre += 1.25 * r + gap
    return {"case": case, "paper_cones": cones, "rubber_rings": rings, "metal_screws": screws}


@mesh_family("camera")
def camera(rng: np.random.Generator) -> Parts:
    """Photo camera: body with a leather band, prism, dials, shutter button, stepped lens with glass."""
    x, y, z = rng.uniform(0.11, 0.15), rng.uniform(0.035, 0.06), rng.uniform(0.07, 0.095)
    body = [box(x, y, z, rng.uniform(0.004, 0.014), 4)]
    band = [box(x + 0.0012, y + 0.0012, z * 0.5, rng.uniform(0.004, 0.014), 4).at(z=z * 0.18)]
    prism = box(0.045, y * 0.8, 0.022, rng.uniform(0.003, 0.012), 3).at(0, 0, z - 0.004)
    metal = [prism]
    for place, radius in zip((-0.38, 0.24, 0.42), rng.uniform(0.006, 0.009, 3), strict=True):
        teeth = 20
        a = np.linspace(0, 2 * np.pi, 4 * teeth, endpoint=False)
        r = radius * (1 + 0.04 * np.sign(np.sin(teeth * a)))
        metal.append(
            plate(np.c_[r * np.cos(a), r * np.sin(a)], rng.uniform(0.005, 0.01), 0.0004).at(
                place * x, 0, z - 0.002
            )
        )
    lens, length, radius = [], 0.0, rng.uniform(0.024, 0.034)
    for _ in range(int(rng.integers(2, 6))):
        step = rng.uniform(0.006, 0.02)
        lens.append(
            hollow(np.full(3, radius), np.linspace(0, step, 3), 0.003, bottom=False, segments=40).at(z=length)
        )
        lens.append(cylinder(radius - 0.0015, 0.6 * step, 0.0005, 40).at(z=length + 0.1 * step))
        length += step
        radius *= rng.uniform(0.9, 1.06)
    eye = ball(radius - 0.0035, 3).stretched(1, 1, 0.25).at(z=length - 0.005)
    turn = {"x_deg": 90.0}
    front = (0.0, -y / 2 + 0.002, z * 0.48)
    return {
        "metal_body": body + metal,
        "leather_band": band,
        "lens": [s.turned(**turn).at(*front) for s in lens],
        "glass": [eye.turned(**turn).at(*front)],
    }


@mesh_family("telephone")
def telephone(rng: np.random.Generator) -> Parts:
    """Desk telephone: wedge, dial or push buttons, receiver on its fork, coiled cord."""
    x, y, z = rng.uniform(0.16, 0.22), rng.uniform(0.16, 0.22), rng.uniform(0.05, 0.1)
    slope = rng.uniform(0.2, 0.45)
    body = box(x, y, z, 0.012, 4).warped(
        lambda p: np.c_[p[:, 0], p[:, 1], p[:, 2] * (1 - slope * (0.5 - p[:, 1] / y))]
    )
    lean = np.degrees(np.arctan(z * slope / y))
    height = z * (1 - slope * 0.62)
    keys = []
    if rng.random() < 0.5:
        for i in range(3):
            for j in range(4):
                keys.append(box(0.016, 0.012, 0.009, 0.002).at(0.024 * (i - 1), 0.019 * (j - 1.5), -0.002))
    else:
        a = np.linspace(0.5, 5.4, 10)
        holes = [
            lathe([(0.0055, 0.004), (0.0055, 0.0085), (0.0075, 0.0085), (0.0075, 0.004)][::-1], 14).at(
                0.033 * np.cos(t), 0.033 * np.sin(t)
            )
            for t in a
        ]
        keys = [lathe([(0, 0), (0.045, 0), (0.045, 0.004), (0.02, 0.006), (0, 0.006)], 40), *holes]
    dial = [k.turned(x_deg=lean).at(0, -0.12 * y, height) for k in keys]
    s = np.linspace(-1, 1, 24)
    grip = sweep(np.c_[0.1 * s, 0 * s, 0.022 - 0.02 * s**4], 0.012 + 0.006 * s**6, 12)
    cups = [
        lathe([(0, 0), (0.026, 0), (0.024, 0.016), (0.01, 0.026), (0, 0.026)], 24).at(0.1 * k, 0, -0.018)
        for k in (-1, 1)
    ]
    lift = z + 0.016
    handset = [p.at(0, 0.28 * y, lift) for p in (grip, *cups)]
    t = np.linspace(0, 1, 220)
    bend = np.c_[-0.1 - 0.09 * np.sin(np.pi * t), 0.28 * y - 0.1 * t, lift * (1 - t) ** 1.5 + 0.009]
    coil = np.c_[0 * t, 0.006 * np.cos(150 * t), 0.006 * np.sin(150 * t)]
    return {
        "plastic_body": [body],
        "keys": dial,
        "plastic_handset": handset,
        "rubber_cord": [sweep(bend + coil, 0.0018, 5)],
    }


def _panel(x: float, z: float, rim: float, deep: float) -> tuple[list[Solid], Solid]:
    """Back shell with a raised bezel, and the display within it, standing on z = 0 and facing -y."""
    shell = [box(x, deep, z, 0.005, 3)]
    front = -deep / 2 - 0.001
    shell += [box(x - 0.0008, 0.007, rim, 0.0015).at(0, front, low) for low in (0.0004, z - rim - 0.0004)]
    side = box(rim, 0.0066, z - 1.6 * rim, 0.0015).at(z=0.8 * rim)
    shell += [side.at(s * (x - rim - 0.0012) / 2, front) for s in (-1, 1)]
    return shell, box(x - 2 * rim + 0.001, 0.004, z - 2 * rim + 0.001, 0.0005, 1).at(
        0, front + 0.0005, rim - 0.0005
    )


def _keys(wide: float, deep: float, rows: int, tall: float) -> Solid:
    """Rows of keys of different widths, centred on the origin."""
    step = deep / rows
    columns = max(int(wide / step / 1.02), 2)
    cell = wide / columns
    keys = []
    for j in range(rows):
        space = j == 0 and columns > 6
        first, last = (2, columns - 4) if space else (0, 0)
        key = box(0.86 * cell, 0.86 * step, tall, 0.12 * step, 1).at(z=-0.0004)
        y = (j - (rows - 1) / 2) * step
        places = [((i - (columns - 1) / 2) * cell, y, 0.0) for i in range(columns) if not first <= i < last]
        keys.append(copies(key, np.repeat(np.eye(3)[None], len(places), 0), np.array(places)))
        if space:
            middle = ((first + last - 1) / 2 - (columns - 1) / 2) * cell
            keys.append(
                box((last - first - 0.14) * cell, 0.86 * step, tall, 0.12 * step, 1).at(middle, y, -0.0004)
            )
    return join(keys)
