"""Printed and minted things: coins, notes, cards, books."""

from __future__ import annotations

from itertools import chain

import numpy as np

from fsid.assets.forms import plate, scatter_rand, slab, spread
from fsid.assets.heap import Heap, leant
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import (
    Solid,
    box,
    join,
    lathe,
    rotation_matrix,
    sheet,
)


@mesh_family("coins")
def coins(rng: np.random.Generator) -> Parts:
    """Coins in two metals, stacked and spilled: raised rim, milled edge, a relief on each face."""
    parts: dict[str, list[Solid]] = {"metal_coins": [], "metal_other": []}
    kinds = [_coin_rand(rng) for _ in range(3)]
    spots = scatter_rand(rng, int(rng.integers(3, 9)), 0.036)
    stacks: list[list[Solid]] = []
    names: list[str] = []
    for _ in spots:
        z, stack = 0.0, []
        for _ in range(1 if rng.random() < 0.6 else int(rng.integers(2, 4))):
            k = int(rng.integers(3))
            radius, thick, coin = kinds[k]
            flip = 180.0 * rng.integers(2)
            placed = coin.turned(x_deg=flip).turned(z_deg=rng.uniform(0, 360)).resting(z)
            stack.append(placed.at(*rng.normal(0, 0.05 * radius, 2)))
            names.append("metal_coins" if k else "metal_other")
            z += thick + 2e-5
        stacks.append(stack)
    for name, coin in zip(names, chain(*spread(stacks, spots)), strict=True):
        parts[name].append(coin)
    return {name: solids for name, solids in parts.items() if solids}


@mesh_family("banknotes")
def banknotes(rng: np.random.Generator) -> Parts:
    """Printed notes: fanned, in a loose heap, crumpled, folded or in a banded bundle."""
    x, y = rng.uniform(0.11, 0.16), rng.uniform(0.06, 0.08)
    style, count = int(rng.integers(3)), int(rng.integers(2, 9))
    notes: tuple[list[Solid], ...] = ([], [])
    u, v = np.meshgrid(np.linspace(-1, 1, 18), np.linspace(-1, 1, 9))
    heap, thick = Heap(2.2 * x, 0.004), 0.0002
    for k in range(count):
        wave = sum(
            rng.normal(0, 0.0025) * np.sin(u * rng.normal(0, 3) + v * rng.normal(0, 3)) for _ in range(4)
        )
        fold = rng.uniform(0, 0.25) * np.abs(u) * x / 2 * (style == 1) * (rng.random() < 0.5)
        z = (wave + fold) * (1.0 if style else 0.3)
        note = np.stack([u * x / 2, v * y / 2, z], axis=-1)
        if style == 0:
            turn = rng.uniform(6, 14) * (k - count / 2)
            note = (note + np.array((0, 0.8 * x, 0))) @ rotation_matrix(z_deg=turn).T
        else:
            tilt = rng.normal(0, 3), rng.normal(0, 3), rng.uniform(0, 360) if style == 1 else rng.normal(0, 6)
            note = note @ rotation_matrix(*tilt).T + (*rng.normal(0, 0.3 * x * (style == 1), 2), 0)
        notes[int(rng.integers(2))].append(sheet(heap.drape(note, thick), thick))
    named = dict(zip(("paper_notes", "paper_other"), notes, strict=True))
    if style == 2:
        thick = rng.uniform(0.006, 0.02)
        named["paper_bundle"] = [box(x, y, thick, 0.0012, 1).at(z=-thick - 0.0005)]
        named["band"] = [box(0.03, y + 0.001, thick + 0.001, 0.0016, 2).at(0.1 * x, 0, -thick - 0.001)]
    return {name: solids for name, solids in named.items() if solids}


@mesh_family("cards")
def cards(rng: np.random.Generator) -> Parts:
    """Playing cards or photographs: a fanned hand, a spread on the table, a house of cards."""
    x, y = rng.uniform(0.055, 0.1), rng.uniform(0.085, 0.13)
    card = plate(_rounded(x, y, rng.uniform(0.001, 0.006)), 0.0004, 0.00005)
    faces: list[Solid] = []
    backs: list[Solid] = []
    style = int(rng.integers(3))
    if style == 2:
        lean = rng.uniform(14, 24)
        foot, rise = 2 * y * np.sin(np.radians(lean)) + 0.002, y * np.cos(np.radians(lean)) + 0.0012
        floors = int(rng.integers(1, 4))
        for level in range(floors):
            for k in range(floors - level):
                middle = (k - (floors - level - 1) / 2) * foot
                for side in (-1, 1):
                    leaf = card.turned(x_deg=90).at(z=y / 2).turned(x_deg=side * lean)
                    leaf = leaf.at(0, middle + side * foot / 2, level * (rise + 0.001))
                    (faces if side > 0 else backs).append(leaf.turned(z_deg=rng.normal(0, 1.5)))
                if k and level + 1 < floors:
                    roof = card.at(
                        0, middle - foot / 2, (level + 1) * (rise + 0.001) - 0.0007 + 0.0005 * (k % 2)
                    )
                    faces.append(roof)
    else:
        count, heap = int(rng.integers(4, 20)), Heap(7 * y, 0.006)
        flat = _net(x, y, 0.006)
        for k in range(count):
            place, turn = np.array((0.0, 0.9 * y)), 80 * (k / count - 0.5)
            if style == 0:
                place = rotation_matrix(z_deg=turn)[:2, :2] @ place
            else:
                turn, place = rng.uniform(0, 360), rng.normal(0, 1.1 * y, 2)
            plane = heap.lay(rotation_matrix(z_deg=turn) @ flat + np.r_[place, 0.0002][:, None], 0.0004)
            leaf = leant(card.turned(z_deg=turn).at(*place), plane[None])
            (faces if rng.random() < 0.7 else backs).append(leaf)
    return {name: solids for name, solids in (("paper_faces", faces), ("paper_backs", backs)) if solids}


@mesh_family("open_book")
def open_book(rng: np.random.Generator) -> Parts:
    """Book lying open: two curved blocks of pages, some leaves in the air, cover, ribbon."""
    x, y, thick = rng.uniform(0.1, 0.2), rng.uniform(0.15, 0.28), rng.uniform(0.006, 0.03)
    share = rng.uniform(0.25, 0.75)
    s, v = np.linspace(0, 1, 16)[:, None], np.linspace(-1, 1, 6)[None] * y / 2
    blocks, leaves = [], []
    for side, deep in ((-1, thick * share), (1, thick * (1 - share))):
        top = (
            deep * (1 - np.exp(-9 * s)) * (1 - 0.25 * s)
            + 0.0022
            + 0.35 * deep * np.exp(-(((s - 0.2) / 0.12) ** 2))
        )
        grid = np.stack(np.broadcast_arrays(side * (0.0008 + s * x), v, top), axis=-1)
        blocks.append(_on_floor(grid if side > 0 else grid[:, ::-1], 0.0018))
        for _ in range(int(rng.integers(0, 4))):
            lift, curl = rng.uniform(0.15, 1.1), rng.normal(0, 0.5)
            angle = np.minimum(lift * (1 - np.exp(-7 * s)) + curl * s**2, 2.2)
            px, pz = np.cumsum(np.cos(angle), axis=0) / 16 * x, np.cumsum(np.sin(angle), axis=0) / 16 * x
            leaf = np.stack(
                np.broadcast_arrays(side * (0.002 + 0.98 * px), 0.985 * v, pz + 0.8 * deep + 0.004), axis=-1
            )
            leaves.append(sheet(leaf, 0.00025))
    cover = [box(x + 0.006, y + 0.008, 0.0016, 0.0006, 1).at(side * (x / 2 + 0.0045)) for side in (-1, 1)]
    cover.append(box(0.006, y + 0.008, 0.0013, 0.0004, 1).at(z=0.0001))
    path = np.c_[0.002 + 0.02 * s**2, -0.3 * y - 0.35 * y * s, 0.9 * thick * (1 - s) + 0.003]
    half = np.array([(0.003, 0.0, 0.0)])
    ribbon = sheet(np.stack([path - half, path + half], axis=1)[:, ::-1], 0.0005)
    parts = {"cover": cover, "paper_pages": blocks, "cloth_ribbon": [ribbon]}
    return parts | ({"paper_leaves": leaves} if leaves else {})


@mesh_family("book_stack")
def book_stack(rng: np.random.Generator) -> Parts:
    """Books lying on each other: covers, a rounded or flat spine and a block of pages."""
    covers, pages, z = [], [], 0.0
    for _ in range(int(rng.integers(2, 9))):
        x, y, thick = rng.uniform(0.12, 0.26), rng.uniform(0.17, 0.32), rng.uniform(0.012, 0.055)
        board, turn = rng.uniform(0.0015, 0.004), rng.normal(0, 9)
        dx, dy = rng.normal(0, 0.012, 2)
        spine = box(board, y - 0.0006, thick - 0.0008, board / 2, 1).at(-x / 2, 0, 0.0004)
        if rng.random() < 0.5:
            a = np.linspace(-np.pi / 2, np.pi / 2, 10)
            bulge = rng.uniform(0.1, 0.4)
            arc = np.c_[-bulge * np.cos(a), 0.5 + 0.5 * np.sin(a)] * (thick - 0.0008)
            spine = slab(arc, arc * (0.7, 0.9) + (0.001, 0.05 * thick), y - 0.0006, 0.0002)
            spine = spine.at(z=-y / 2).turned(x_deg=90).at(-x / 2, 0, 0.0004)
        parts = (box(x, y, board, board / 2, 1), box(x, y, board, board / 2, 1).at(z=thick - board), spine)
        covers += [part.turned(z_deg=turn).at(dx, dy, z) for part in parts]
        block = box(x - 0.008, y - 0.012, thick - 2 * board + 0.0004, 0.001, 1).at(-0.002, 0, board - 0.0002)
        pages.append(block.turned(z_deg=turn).at(dx, dy, z))
        z += thick + 0.0005
    return {"covers": covers, "paper_pages": pages}


def _coin_rand(rng: np.random.Generator) -> tuple[float, float, Solid]:
    radius, thick = rng.uniform(0.008, 0.015), rng.uniform(0.0014, 0.0024)
    rim = radius * rng.uniform(0.06, 0.14)
    step = 0.00025
    profile = [
        (0, step),
        (radius - rim, step),
        (radius - 0.8 * rim, 0),
        (radius, 0),
        (radius, thick),
        (radius - 0.8 * rim, thick),
        (radius - rim, thick - step),
        (0, thick - step),
    ]
    disc = lathe(profile, 36)
    number = int(rng.integers(3, 9))
    a = np.linspace(0, 2 * np.pi, 2 * number, endpoint=False)
    star = (
        0.55
        * radius
        * np.where(np.arange(2 * number) % 2, rng.uniform(0.35, 0.8), 1)[:, None]
        * np.c_[np.cos(a), np.sin(a)]
    )
    relief = plate(star, thick - 2 * step + 0.0004, 0.00008).at(z=step - 0.0002)
    return radius, thick, join([disc, relief])


def _rounded(x: float, y: float, radius: float) -> np.ndarray:
    """Outline (n, 2) of a rectangle with round corners, counter-clockwise."""
    a = np.linspace(0, np.pi / 2, 5)
    corner = radius * np.c_[np.cos(a), np.sin(a)]
    out = []
    for k, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        turn = rotation_matrix(z_deg=90 * k)[:2, :2]
        out.append(corner @ turn.T + (sx * (x / 2 - radius), sy * (y / 2 - radius)))
    return np.vstack(out)


def _net(x: float, y: float, step: float) -> np.ndarray:
    """(3, n) points of a flat rectangle, not farther apart than `step`."""
    along = [np.linspace(-side / 2, side / 2, int(side / step) + 2) for side in (x, y)]
    u, v = (a.ravel() for a in np.meshgrid(*along))
    return np.stack([u, v, 0 * u])


def _on_floor(grid: np.ndarray, floor: float) -> Solid:
    """Solid between a height field `grid` (n, m, 3) and the plane z = floor: the top, and five flat sides."""
    low = grid * (1, 1, 0) + (0, 0, floor)
    top = sheet(grid, 0.0004)
    walls = []
    for edge, under in (
        (grid[0], low[0]),
        (grid[-1], low[-1]),
        (grid[:, 0], low[:, 0]),
        (grid[:, -1], low[:, -1]),
    ):
        walls.append(sheet(np.stack([edge, under], axis=1), 0.0003))
    return join([top, *walls, sheet(low, 0.0003)])
