"""Things that hold things: cabinets, shelves, drawers, crates, parcels."""

from __future__ import annotations

import numpy as np

from fsid.assets.forms import hollow
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import Solid, box, cylinder, lathe, sheet, sweep


@mesh_family("cabinet")
def cabinet(rng: np.random.Generator) -> Parts:
    """Carcass on feet with a grid of doors or drawers, bar handles or knobs, panelled fronts."""
    x, y, z = rng.uniform(0.5, 1.4), rng.uniform(0.32, 0.55), rng.uniform(0.5, 1.6)
    columns, rows = int(rng.integers(1, 4)), int(rng.integers(1, 6))
    feet_z, gap = rng.uniform(0.03, 0.14), 0.004
    wide, high = (x - 0.03) / columns, (z - feet_z - 0.04) / rows
    panelled, knobbed = rng.random() < 0.5, rng.random() < 0.5
    fronts, handles = [], []
    for i in range(columns):
        for j in range(rows):
            cx, low, face = (i - (columns - 1) / 2) * wide, feet_z + 0.02 + j * high, -y / 2 - 0.009
            fronts.append(box(wide - gap, 0.018, high - gap, 0.003).at(cx, face, low))
            if panelled and min(wide, high) > 0.16:
                panel = box(wide - 0.1, 0.012, high - 0.1, 0.006)
                fronts.append(panel.at(cx, face - 0.009, low + 0.05))
            handle = _knob() if knobbed else _bar_handle(0.5 * wide)
            handles.append(handle.at(cx, face - 0.015, low + high * 0.72))
    body = [box(x, y, z - feet_z, 0.005).at(z=feet_z), box(x + 0.03, y + 0.03, 0.025, 0.008).at(z=z - 0.012)]
    dx, dy = x / 2 - 0.06, y / 2 - 0.06
    feet = [
        cylinder(0.022, feet_z + 0.01, 0.003, 16).at(sx * dx, sy * dy) for sx in (-1, 1) for sy in (-1, 1)
    ]
    return {"body": body, "fronts": fronts, "metal_handles": handles, "feet": feet}


@mesh_family("bookshelf")
def bookshelf(rng: np.random.Generator) -> Parts:
    """Open shelf filled with upright and leaning books in three bindings."""
    x, y, z = rng.uniform(0.4, 1.0), rng.uniform(0.22, 0.32), rng.uniform(0.7, 1.8)
    board, rows = rng.uniform(0.016, 0.028), int(rng.integers(2, 6))
    step = (z - board) / rows
    frame = [box(board, y, z, 0.003).at(s * (x - board) / 2) for s in (-1, 1)]
    frame += [
        box(x - 1.8 * board, y - 0.01, board - 0.001, 0.003).at(0, 0.004, j * step + 0.0005)
        for j in range(rows + 1)
    ]
    frame += [box(x - board, 0.008, z - board, 0.001).at(0, y / 2 - 0.0045, board / 2)]
    books: tuple[list[Solid], ...] = ([], [], [])
    for j in range(rows):
        place, end = -x / 2 + board + 0.004, x / 2 - board - 0.05
        while place < end and rng.random() > 0.03:
            thick = rng.uniform(0.012, 0.05)
            tall = min(rng.uniform(0.6, 0.95) * (step - board), 0.34)
            deep, front = rng.uniform(0.6, 0.9) * y, rng.uniform(0.005, 0.03)
            deep = min(deep, y - 0.01 - front)
            book = box(thick, deep, tall, 0.003, 1).at(thick / 2, -y / 2 + deep / 2 + front, 0)
            lean = rng.uniform(3, 12) if rng.random() < 0.08 else 0.0
            aside = tall * np.sin(np.radians(lean))
            if place + thick + aside > end + 0.05:
                lean = aside = 0.0
            leant = book.turned(y_deg=lean).resting(j * step + board + 0.001)
            books[rng.integers(3)].append(leant.at(place))
            place += thick + 0.001 + aside
    parts = {"frame": frame, "books_a": books[0], "books_b": books[1], "books_c": books[2]}
    return {name: solids for name, solids in parts.items() if solids}


@mesh_family("drawer_unit")
def drawer_unit(rng: np.random.Generator) -> Parts:
    """Chest of drawers, some pulled out and full of folded cloth or odds and ends."""
    x, y = rng.uniform(0.35, 0.9), rng.uniform(0.35, 0.5)
    rows, tall, wall = int(rng.integers(2, 6)), rng.uniform(0.11, 0.22), rng.uniform(0.012, 0.02)
    z, foot = rows * tall + wall, rng.uniform(0.02, 0.12)
    body = [box(wall, y, z, 0.002).at(s * (x - wall) / 2, 0, foot) for s in (-1, 1)]
    body += [box(x - 1.9 * wall, 0.008, z - 0.002, 0.001).at(0, y / 2 - 0.006, foot + 0.001)]
    body += [
        box(x - 1.9 * wall, y - 0.008, wall - 0.001, 0.002).at(0, 0, foot + 0.0005 + j * (z - wall))
        for j in (0, 1)
    ]
    body.append(box(x + 0.02, y + 0.02, 0.02, 0.005).at(z=foot + z - 0.004))
    drawers: list[Solid] = []
    handles: list[Solid] = []
    things: list[Solid] = []
    knobbed = rng.random() < 0.5
    wide = x - 2 * wall - 0.006
    for j in range(rows):
        pull = rng.uniform(0.2, 0.7) * y if rng.random() < 0.4 else 0.0
        low, front = foot + wall + j * tall, -y / 2 - pull
        drawers += _drawer(wide, y - 0.05, tall - wall, front, low)
        for h in (-0.25, 0.25) if wide > 0.5 else (0.0,):
            handle = _knob() if knobbed else _bar_handle(0.3 * wide)
            handles.append(handle.at(h * wide, front - 0.008, low + 0.55 * tall))
        if pull > 0:
            thick = rng.uniform(0.3, 0.7) * (tall - wall)
            for k in range(int(rng.integers(1, 4))):
                thing = box(rng.uniform(0.2, 0.3) * wide, 0.7 * pull, thick, 0.3 * thick, 3)
                turned = thing.turned(z_deg=rng.normal(0, 8))
                things.append(turned.at((k - 1) * 0.3 * wide, front + 0.02 + 0.42 * pull, low + 0.012))
    feet = [
        cylinder(0.02, foot + 0.004, 0.003, 16).at(a * (x / 2 - 0.05), b * (y / 2 - 0.05))
        for a in (-1, 1)
        for b in (-1, 1)
    ]
    parts = {"wood_body": body, "wood_drawers": drawers, "metal_handles": handles, "feet": feet}
    return parts | ({"cloth_contents": things} if things else {})


@mesh_family("crate")
def crate(rng: np.random.Generator) -> Parts:
    """Slatted wooden box, nailed, open above, sometimes full of bottles or balls."""
    x, y, slats = rng.uniform(0.25, 0.5), rng.uniform(0.2, 0.36), int(rng.integers(2, 5))
    slat, gap, thick = rng.uniform(0.05, 0.09), rng.uniform(0.008, 0.03), rng.uniform(0.007, 0.012)
    z = slats * (slat + gap)
    wood, nails = [], []
    post = [
        box(0.025, 0.025, z, 0.002).at(a * (x / 2 - 0.022), b * (y / 2 - 0.022), 0.001)
        for a in (-1, 1)
        for b in (-1, 1)
    ]
    for k in range(slats):
        low = k * (slat + gap) + 0.012
        wobble = rng.normal(0, 0.4, 4)
        wood += [
            box(x, thick, slat, 0.0015).turned(y_deg=wobble[i]).at(0, s * (y / 2 - 0.004), low)
            for i, s in enumerate((-1, 1))
        ]
        wood += [box(thick, y - 2.2 * thick, slat, 0.0015).at(s * (x / 2 - 0.005), 0, low) for s in (-1, 1)]
        nail = cylinder(0.003, 0.003, 0.001, 8).turned(x_deg=90)
        nails += [
            nail.at(a * (x / 2 - 0.02), -y / 2 + 0.004 - thick / 2, low + h * slat)
            for a in (-1, 1)
            for h in (0.3, 0.7)
        ]
    boards = int(rng.integers(3, 6))
    step = (y - 0.02) / boards
    wood += [
        box(x - 0.016, step * 0.86, 0.008, 0.001).at(0, (k - (boards - 1) / 2) * step, 0.002)
        for k in range(boards)
    ]
    parts = {"wood_slats": wood, "wood_posts": post, "metal_nails": nails}
    if rng.random() < 0.5:
        parts["glass"] = _bottles_rand(rng, x, y, z)
    return {name: solids for name, solids in parts.items() if solids}


def _bottles_rand(rng: np.random.Generator, x: float, y: float, z: float) -> list[Solid]:
    """Up to eight bottles of one kind in the places of a crate, x by y wide and z high."""
    size = rng.uniform(0.03, 0.045)
    t = np.linspace(0, 1, 14)
    shape = size * np.where(t < 0.6, 1.0, 1 - 0.68 * np.clip((t - 0.6) / 0.2, 0, 1))
    bottle = hollow(shape, t * z * rng.uniform(0.9, 1.5), 0.003, segments=20)
    nx, ny = int((x - 0.06) / (2.1 * size)), int((y - 0.06) / (2.1 * size))
    places = [
        ((i - (nx - 1) / 2) * 2.1 * size, (j - (ny - 1) / 2) * 2.1 * size)
        for i in range(nx)
        for j in range(ny)
    ]
    keep = rng.permutation(len(places))[: min(8, len(places))]
    return [bottle.at(places[k][0], places[k][1], 0.011) for k in keep]


@mesh_family("parcel")
def parcel(rng: np.random.Generator) -> Parts:
    """Cardboard box, closed with tape or open with bent flaps, and a label."""
    x, y, z = rng.uniform(0.15, 0.6), rng.uniform(0.12, 0.45), rng.uniform(0.08, 0.4)
    wall = 0.004
    label = box(0.35 * x, 0.0012, 0.4 * z, 0.0004, 1).at(rng.uniform(-0.2, 0.2) * x, -y / 2 - 0.0005, 0.3 * z)
    if rng.random() < 0.5:
        tape = box(x + 0.001, 0.05, 0.0012, 0.0004, 1).at(z=z - 0.0004)
        side = box(0.0012, 0.05, 0.1, 0.0004, 1).at(x / 2, 0, z - 0.1)
        return {"card": [box(x, y, z, 0.005)], "tape": [tape, side], "paper_label": [label]}
    card = [box(x - wall, y - wall, wall, 0.001).at(z=0.0008)]
    card += [box(x, wall, z, 0.0015).at(0, s * (y - wall) / 2) for s in (-1, 1)]
    card += [
        box(wall, y - wall, z - 0.0008, 0.0015).at(s * (x - wall - 0.001) / 2, 0, 0.0004) for s in (-1, 1)
    ]
    for quarter in range(4):
        long, reach = (x, y) if quarter % 2 == 0 else (y, x)
        flap = _bent_flap(rng, long - 0.01, 0.5 * y, wall)
        card.append(flap.at(0, -reach / 2 + wall / 2, z).turned(z_deg=90 * quarter))
    return {"card": card, "paper_label": [label]}


def _drawer(x: float, y: float, z: float, front: float, low: float) -> list[Solid]:
    """Tray with a front board whose face is at y = `front` and whose bottom is at `low`."""
    board = box(x, 0.016, z - 0.004, 0.003).at(0, front + 0.008, low + 0.002)
    sides = [
        box(0.009, y - 0.01, 0.8 * z, 0.001).at(s * (x / 2 - 0.012), front + y / 2 + 0.01, low + 0.006)
        for s in (-1, 1)
    ]
    back = box(x - 0.03, 0.008, 0.78 * z, 0.001).at(0, front + y - 0.002, low + 0.0065)
    return [
        board,
        *sides,
        back,
        box(x - 0.026, y - 0.02, 0.006, 0.001).at(0, front + y / 2 + 0.004, low + 0.004),
    ]


def _knob() -> Solid:
    return lathe([(0, 0), (0.007, 0), (0.006, 0.01), (0.013, 0.02), (0.01, 0.027), (0, 0.029)], 16).turned(
        x_deg=90
    )


def _bar_handle(length: float) -> Solid:
    half = min(length, 0.2) / 2
    path = np.array([(-half, 0, 0), (-half, -0.02, 0), (-half + 0.008, -0.027, 0)])
    return sweep(np.vstack([path, (path * (-1, 1, 1))[::-1]]), 0.004, 8)


def _bent_flap(rng: np.random.Generator, length: float, reach: float, wall: float) -> Solid:
    open_deg = rng.uniform(10, 130)
    t = np.linspace(0, 1, 8)
    angle = np.radians(90 - open_deg * np.minimum(1, 4 * t) + rng.normal(0, 8) * t)
    step = reach / 7
    y, z = -np.cumsum(np.r_[0, np.cos(angle[1:])]) * step, np.cumsum(np.r_[0, np.sin(angle[1:])]) * step
    along = np.linspace(-length / 2, length / 2, 6)
    grid = np.stack(np.broadcast_arrays(along[None], y[:, None], z[:, None]), axis=-1)
    return sheet(grid, wall * 0.7)
