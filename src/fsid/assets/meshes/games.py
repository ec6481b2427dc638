"""Games: chessmen, dice, balls."""

from __future__ import annotations

import numpy as np

from fsid.assets.forms import scatter_rand, spread, sunflower
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import (
    Solid,
    ball,
    ball_directions,
    box,
    copies,
    join,
    lathe,
    rotation_matrix,
    sheet,
    sweep,
)


@mesh_family("chessmen")
def chessmen(rng: np.random.Generator) -> Parts:
    """Turned pieces of two colours on a chequered board: pawns, towers, bishops, a crown."""
    cell = rng.uniform(0.03, 0.05)
    side = int(rng.integers(3, 6))
    board = [box((side + 0.5) * cell, (side + 0.5) * cell, 0.012, 0.002)]
    squares: tuple[list[Solid], ...] = ([], [])
    pieces: tuple[list[Solid], ...] = ([], [])
    kinds = [_chessman_rand(rng, cell) for _ in range(3)]
    for i in range(side):
        for j in range(side):
            x, y = (i - (side - 1) / 2) * cell, (j - (side - 1) / 2) * cell
            squares[(i + j) % 2].append(box(cell - 0.0003, cell - 0.0003, 0.002, 0.0002, 1).at(x, y, 0.0112))
            if rng.random() < 0.4 and sum(map(len, pieces)) < 8:
                dx, dy = rng.normal(0, 0.05 * cell, 2)
                piece = kinds[int(rng.integers(3))]
                pieces[int(rng.integers(2))].append(
                    piece.turned(z_deg=rng.uniform(0, 360)).at(x + dx, y + dy, 0.0134)
                )
    named = zip(("wood_light", "wood_dark", "pieces_light", "pieces_dark"), (*squares, *pieces), strict=True)
    return {"wood_board": board} | {name: solids for name, solids in named if solids}


@mesh_family("dice")
def dice(rng: np.random.Generator) -> Parts:
    """Dice with pips, rolled; rounded to nearly sharp."""
    size = rng.uniform(0.012, 0.022)
    pip = ball(0.085 * size, 1).stretched(1, 1, 0.35)
    spots = {
        1: [(0, 0)],
        2: [(-1, -1), (1, 1)],
        3: [(-1, -1), (0, 0), (1, 1)],
        4: [(-1, -1), (-1, 1), (1, -1), (1, 1)],
    }
    spots[5] = spots[4] + spots[1]
    spots[6] = [*spots[4], (-1, 0), (1, 0)]
    turns, places = [], []
    for number, turn in zip(
        (1, 6, 2, 5, 3, 4), ((0, 0), (180, 0), (90, 0), (-90, 0), (0, 90), (0, -90)), strict=True
    ):
        spin = rotation_matrix(*turn)
        for u, v in spots[number]:
            turns.append(spin)
            places.append(spin @ np.array((0.26 * size * u, 0.26 * size * v, 0.5 * size)))
    cube = box(size, size, size, size * rng.uniform(0.08, 0.3), 4).at(z=-size / 2)
    pips = copies(pip, np.array(turns), np.array(places))
    lying = scatter_rand(rng, int(rng.integers(1, 6)), 1.9 * size)
    rolled = []
    for _ in lying:
        a_deg, b_deg, c_deg = 90.0 * rng.integers(0, 4, 3)
        c_deg += rng.uniform(0, 360)
        rolled.append([part.turned(a_deg, b_deg, c_deg).at(z=size / 2) for part in (cube, pips)])
    bodies, dots = zip(*spread(rolled, lying), strict=True)
    return {"plastic_dice": bodies, "pips": dots}


@mesh_family("sports_ball")
def sports_ball(rng: np.random.Generator) -> Parts:
    """Ball: panelled football, seamed tennis ball, beach ball in segments, golf ball with dimples."""
    radius, kind = rng.uniform(0.02, 0.12), int(rng.integers(4))
    if kind == 0:
        return _football(rng, radius)
    if kind == 1:
        t = np.linspace(0, 2 * np.pi, 90, endpoint=False)
        bend = rng.uniform(0.3, 0.46)
        curve = np.c_[
            (1 - bend) * np.cos(t) + bend * np.cos(3 * t),
            (1 - bend) * np.sin(t) - bend * np.sin(3 * t),
            2 * np.sqrt(bend * (1 - bend)) * np.sin(2 * t),
        ]
        seam = sweep(1.003 * radius * curve, 0.035 * radius, 7, closed=True)
        return {"cloth_felt": [ball(radius, 4)], "yarn_seam": [seam]}
    if kind == 2:
        segments = 2 * int(rng.integers(3, 6))
        groups: tuple[list[Solid], ...] = ([], [])
        s = np.linspace(-1.4, 1.4, 14)[:, None]
        for k in range(segments):
            a = (np.linspace(0.01, 0.99, 7)[None] + k) * 2 * np.pi / segments
            grid = np.stack(np.broadcast_arrays(np.cos(s) * np.cos(a), np.cos(s) * np.sin(a), np.sin(s)), -1)
            groups[k % 2].append(sheet(radius * grid, 0.02 * radius))
        caps = [
            lathe(
                [
                    (0, 0.93 * radius),
                    (0.24 * radius, 0.95 * radius),
                    (0.2 * radius, 1.0 * radius),
                    (0, 1.02 * radius),
                ],
                24,
            ).turned(x_deg=flip)
            for flip in (0, 180)
        ]
        return {"plastic_a": groups[0], "plastic_b": groups[1], "valve": [*caps, ball(0.96 * radius, 3)]}
    d = sunflower(int(rng.integers(60, 150)))
    v = ball_directions(4)
    near = np.max(v @ d.T, axis=1)
    wide = 1.6 / np.sqrt(len(d))
    dimple = np.clip(1 - np.arccos(np.clip(near, -1, 1)) / wide, 0, 1)
    sign = rng.choice((-1.0, 1.0))
    return {"rubber": [ball(radius * (1 + sign * rng.uniform(0.03, 0.1) * dimple**1.5), 4)]}


def _chessman_rand(rng: np.random.Generator, cell: float) -> Solid:
    radius, tall = 0.38 * cell, cell * rng.uniform(0.9, 1.9)
    s = np.linspace(0, 1, 18)
    waist = rng.uniform(0.25, 0.42)
    neck = radius * (waist + (0.85 - waist) * np.exp(-6 * s) + 0.12 * np.exp(-(((s - 0.85) / 0.05) ** 2)))
    body = lathe(
        [(0, 0), (radius, 0), (radius, 0.08 * tall), *np.c_[neck, tall * (0.1 + 0.62 * s)], (0, 0.72 * tall)],
        20,
    )
    kind = int(rng.integers(3))
    if kind == 0:
        return join([body, ball(0.58 * radius, 2).at(z=0.72 * tall + 0.45 * radius)])
    if kind == 1:
        cup = lathe(
            [
                (0, 0),
                (0.5 * radius, 0),
                (0.66 * radius, 0.6 * radius),
                (0.46 * radius, 0.6 * radius),
                (0.42 * radius, 0.3 * radius),
                (0, 0.3 * radius),
            ],
            20,
        )
        tooth = box(0.2 * radius, 0.24 * radius, 0.26 * radius, 0.0006, 1).at(0.56 * radius, 0, 0.52 * radius)
        teeth = [tooth.turned(z_deg=60 * k) for k in range(6)]
        return join([body, *(p.at(z=0.7 * tall) for p in (cup, *teeth))])
    drop = np.linspace(0, np.pi, 12)
    tip = lathe(
        np.c_[
            0.55 * radius * np.sin(drop) * (1 - 0.3 * drop / np.pi), 0.8 * radius * (1 - np.cos(drop))
        ].tolist(),
        24,
    )
    return join([body, tip.at(z=0.7 * tall), ball(0.16 * radius, 2).at(z=0.7 * tall + 1.66 * radius)])


def _football(rng: np.random.Generator, radius: float) -> Parts:
    """Goldberg-like ball: plump panels around spread directions, in two colours."""
    v = ball_directions(4)
    seeds = ball_directions(0) if rng.random() < 0.6 else sunflower(int(rng.integers(8, 20)))
    order = np.sort(v @ seeds.T, axis=1)
    gap = np.arccos(np.clip(order[:, -2], -1, 1)) - np.arccos(np.clip(order[:, -1], -1, 1))
    radii = radius * (1 - 0.035 * np.exp(-gap / 0.05))
    whole = ball(radii, 4)
    centre = whole.vertices[whole.faces].mean(1)
    near = np.max(centre @ seeds.T / np.linalg.norm(centre, axis=1, keepdims=True), axis=1)
    patch = near > np.quantile(near, rng.uniform(0.5, 0.75))
    return {
        "leather_panels": [Solid(whole.vertices, whole.normals, whole.faces[~patch])],
        "leather_patches": [Solid(whole.vertices, whole.normals, whole.faces[patch])],
    }
