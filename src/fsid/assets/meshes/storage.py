"""Things that hold things: cabinet, bookshelf with books, parcel, stack of books, toy blocks."""

from __future__ import annotations

import numpy as np

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
    return {"body": body, "fronts": fronts, "handles": handles, "feet": feet}


@mesh_family("bookshelf")
def bookshelf(rng: np.random.Generator) -> Parts:
    """Open shelf filled with upright and leaning books in three bindings."""
    x, y, z = rng.uniform(0.4, 1.0), rng.uniform(0.22, 0.32), rng.uniform(0.7, 1.8)
    board, rows = rng.uniform(0.016, 0.028), int(rng.integers(2, 6))
    step = (z - board) / rows
    frame = [box(board, y, z, 0.003).at(s * (x - board) / 2) for s in (-1, 1)]
    frame += [box(x - 2 * board, y - 0.01, board, 0.003).at(0, 0.005, j * step) for j in range(rows + 1)]
    frame += [box(x - board, 0.008, z - board, 0.001).at(0, y / 2 - 0.004, board / 2)]
    books: tuple[list[Solid], ...] = ([], [], [])
    for j in range(rows):
        place, end = -x / 2 + board + 0.004, x / 2 - board - 0.05
        while place < end and rng.random() > 0.03:
            thick = rng.uniform(0.012, 0.05)
            tall = min(rng.uniform(0.6, 0.95) * (step - board), 0.34)
            deep = rng.uniform(0.6, 0.9) * y
            book = box(thick, deep, tall, 0.003, 1).at(
                thick / 2, -y / 2 + deep / 2 + rng.uniform(0.005, 0.03), 0
            )
            lean = rng.uniform(3, 12) if rng.random() < 0.08 else 0.0
            books[rng.integers(3)].append(book.turned(y_deg=lean).at(place, 0, j * step + board + 0.001))
            place += thick + 0.001 + tall * np.sin(np.radians(lean))
    parts = {"frame": frame, "books_a": books[0], "books_b": books[1], "books_c": books[2]}
    return {name: solids for name, solids in parts.items() if solids}


@mesh_family("book_stack")
def book_stack(rng: np.random.Generator) -> Parts:
    """A pile of books lying flat, each with covers, spine and a block of pages."""
    covers, pages, z = [], [], 0.0
    for _ in range(int(rng.integers(2, 9))):
        x, y, thick = rng.uniform(0.12, 0.26), rng.uniform(0.17, 0.32), rng.uniform(0.012, 0.055)
        board, turn = rng.uniform(0.0015, 0.004), rng.normal(0, 9)
        dx, dy = rng.normal(0, 0.012, 2)
        for part in (
            box(x, y, board, board / 2, 1),
            box(x, y, board, board / 2, 1).at(z=thick - board),
            box(board, y, thick, board / 2, 1).at(-x / 2),
        ):
            covers.append(part.turned(z_deg=turn).at(dx, dy, z))
        block = box(x - 0.008, y - 0.012, thick - 2 * board, 0.001, 1).at(-0.002, 0, board)
        pages.append(block.turned(z_deg=turn).at(dx, dy, z))
        z += thick + 0.0005
    return {"covers": covers, "pages": pages}


@mesh_family("parcel")
def parcel(rng: np.random.Generator) -> Parts:
    """Cardboard box, closed with tape or open with bent flaps, and a label."""
    x, y, z = rng.uniform(0.15, 0.6), rng.uniform(0.12, 0.45), rng.uniform(0.08, 0.4)
    wall = 0.004
    label = box(0.35 * x, 0.0012, 0.4 * z, 0.0004, 1).at(rng.uniform(-0.2, 0.2) * x, -y / 2 - 0.0005, 0.3 * z)
    if rng.random() < 0.5:
        tape = box(x + 0.001, 0.05, 0.0012, 0.0004, 1).at(z=z - 0.0004)
        side = box(0.0012, 0.05, 0.1, 0.0004, 1).at(x / 2, 0, z - 0.1)
        return {"card": [box(x, y, z, 0.005)], "tape": [tape, side], "label": [label]}
    card = [box(x, y, wall, 0.001)]
    card += [box(x, wall, z, 0.0015).at(0, s * (y - wall) / 2) for s in (-1, 1)]
    card += [box(wall, y, z, 0.0015).at(s * (x - wall) / 2) for s in (-1, 1)]
    for quarter in range(4):
        long, reach = (x, y) if quarter % 2 == 0 else (y, x)
        flap = _bent_flap(rng, long - 0.01, 0.5 * y, wall)
        card.append(flap.at(0, -reach / 2 + wall / 2, z).turned(z_deg=90 * quarter))
    return {"card": card, "label": [label]}


@mesh_family("toy_blocks")
def toy_blocks(rng: np.random.Generator) -> Parts:
    """Cubes, bricks, cylinders and arches of a building set, piled in a tower and scattered."""
    parts: tuple[list[Solid], ...] = ([], [], [])
    size = rng.uniform(0.03, 0.06)
    for tower in range(int(rng.integers(2, 5))):
        base = rng.normal(0, 2.2, 2) * size * (tower > 0)
        z = 0.0
        for _ in range(int(rng.integers(1, 6))):
            tall = size * rng.choice((0.5, 1.0, 1.5))
            if rng.random() < 0.7:
                block = box(size * rng.choice((1, 2)), size, tall, 0.003)
            else:
                block = cylinder(size / 2, tall, 0.003, 24)
            dx, dy = base + rng.normal(0, 0.08, 2) * size
            parts[rng.integers(3)].append(block.turned(z_deg=rng.uniform(0, 360)).at(dx, dy, z))
            z += tall
    named = zip(("blocks_a", "blocks_b", "blocks_c"), parts, strict=True)
    return {name: solids for name, solids in named if solids}


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
    y, z = -np.cumsum(np.cos(angle)) * step, np.cumsum(np.sin(angle)) * step
    along = np.linspace(-length / 2, length / 2, 6)
    grid = np.stack(np.broadcast_arrays(along[None], y[:, None], z[:, None]), axis=-1)
    return sheet(grid, wall * 0.7)
