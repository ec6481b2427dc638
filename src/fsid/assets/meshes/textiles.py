"""Cloth: hanging, lying, folded, rolled, fringed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import Solid, ball, cylinder, sheet, sweep, tubes


@mesh_family("draped_cloth")
def draped_cloth(rng: np.random.Generator) -> Parts:
    """Cloth in folds over an invisible round or square stand; its hem has a border of its own."""
    n = 52
    u, v = np.meshgrid(np.linspace(-1, 1, n), np.linspace(-1, 1, n))
    size, top = rng.uniform(0.2, 0.45), rng.uniform(0.3, 0.6)
    power = rng.choice((2.0, 2.0, 4.0, 8.0))
    angle, radius = np.arctan2(v, u), np.hypot(u, v)
    stand = top * (np.abs(np.cos(angle)) ** power + np.abs(np.sin(angle)) ** power) ** (-1 / power)
    over = np.maximum(radius - stand, 0)
    folds = int(rng.integers(5, 12))
    wave = np.cos(folds * angle + rng.uniform(0, 6.3) + 0.6 * np.sin(2 * angle + rng.uniform(0, 6.3)))
    spread = np.minimum(radius, stand) + 0.25 * over + 0.3 * over * wave
    ripple = 0.006 * np.sin(u * rng.normal(0, 9) + v * rng.normal(0, 9))
    z = -0.9 * over + ripple + 0.05 * over * wave
    points = np.stack([spread * np.cos(angle), spread * np.sin(angle), z], axis=-1) * size
    rows = 4
    hem = [
        points[: rows + 1],
        points[-rows - 1 :],
        points[rows:-rows, : rows + 1],
        points[rows:-rows, -rows - 1 :],
    ]
    return {
        "cloth": [sheet(points[rows:-rows, rows:-rows], 0.004)],
        "cloth_hem": [sheet(part, 0.005) for part in hem],
    }


@mesh_family("curtain")
def curtain(rng: np.random.Generator) -> Parts:
    """Curtain in pleats on rings and a rod, gathered by a tie or falling free."""
    x, z = rng.uniform(0.4, 1.2), rng.uniform(0.6, 1.6)
    pleats, deep = int(rng.integers(5, 14)), rng.uniform(0.02, 0.06)
    u, t = np.linspace(-1, 1, 8 * pleats + 1)[None], np.linspace(0, 1, 26)[:, None]
    jitter = 0.35 * np.sin(u * rng.uniform(2, 6) + rng.uniform(0, 6)) + 0.3 * t * np.sin(3 * t + 4 * u)
    gather = 1 - rng.uniform(0.3, 0.7) * (rng.random() < 0.5) * np.exp(-(((t - 0.6) / 0.16) ** 2))
    y = deep * gather * (0.45 + 0.55 * t**0.5) * np.cos(np.pi * pleats * u + jitter)
    points = np.stack(np.broadcast_arrays(x / 2 * u * gather, y, z * (1 - t) + 0 * u), axis=-1)
    rod_z = z + 0.022
    rod = [cylinder(0.011, x + 0.16, 0.002, 16).at(z=-x / 2 - 0.08).turned(y_deg=90).at(z=rod_z)]
    rod += [ball(0.022, 2).at(s * (x / 2 + 0.09), 0, rod_z) for s in (-1, 1)]
    before, after = points[0, :-1], points[0, 1:]
    crossing = np.flatnonzero(before[:, 1] * after[:, 1] < 0)[::2]  # where the top edge passes below the rod
    share = (before[:, 1] / (before[:, 1] - after[:, 1]))[crossing]
    held = before[crossing, 0] + share * (after - before)[crossing, 0]
    a = np.linspace(0, 2 * np.pi, 18, endpoint=False)
    rings = np.array([np.c_[0 * a + px, 0.02 * np.cos(a), 0.02 * np.sin(a) + rod_z - 0.006] for px in held])
    return {
        "cloth": [sheet(points[:, ::-1], 0.0025)],
        "metal_rod": rod,
        "metal_rings": [tubes(rings, 0.0022, 6, closed=True)],
    }


@mesh_family("rug")
def rug(rng: np.random.Generator) -> Parts:
    """Rug with a border and a fringe of threads, lying in ripples, with a curled corner or an edge folded."""
    x, y = rng.uniform(0.35, 0.9), rng.uniform(0.5, 1.4)
    waves = [(rng.normal(0, 5, 2), rng.uniform(0, 6.3), rng.uniform(0, 0.006)) for _ in range(5)]
    curl, thick = rng.uniform(0, 0.9) * (rng.random() < 0.6), rng.uniform(0.004, 0.009)

    def lay(u: np.ndarray, v: np.ndarray) -> np.ndarray:
        z = sum(a * (1 + np.sin(k[0] * u + k[1] * v + phase)) for k, phase, a in waves)
        far = np.clip((u / x + v / y - 0.55) / 0.45, 0, 1)
        return np.stack(
            [u - 0.25 * curl * far**2 * x, v - 0.2 * curl * far**2 * y, z + 0.3 * curl * far**2 * x], -1
        )

    def piece(u0: float, u1: float, v0: float, v1: float, nu: int, nv: int, deep: float) -> Solid:
        return sheet(lay(*np.meshgrid(np.linspace(u0, u1, nu), np.linspace(v0, v1, nv))), deep)

    edge = rng.uniform(0.06, 0.16) * x
    a, b = x / 2, y / 2
    field = piece(-a + edge, a - edge, -b + edge, b - edge, 20, 28, thick)
    border = [
        piece(s * (a - edge / 2) - edge / 2, s * (a - edge / 2) + edge / 2, -b, b, 4, 34, thick * 1.15)
        for s in (-1, 1)
    ]
    border += [
        piece(
            -a + edge,
            a - edge,
            s * (b - edge / 2) - edge / 2,
            s * (b - edge / 2) + edge / 2,
            20,
            4,
            thick * 1.15,
        )
        for s in (-1, 1)
    ]
    return {
        "cloth_field": [field],
        "cloth_border": border,
        "yarn_fringe": _fringe_rand(rng, x, y, thick, lay),
    }


def _fringe_rand(
    rng: np.random.Generator,
    x: float,
    y: float,
    thick: float,
    lay: Callable[[np.ndarray, np.ndarray], np.ndarray],
) -> list[Solid]:
    """Threads at the two short ends of a rug, x by y wide, that `lay` places where it lies."""
    a, b = x / 2, y / 2
    count, reach = int(x / 0.007), rng.uniform(0.02, 0.06)
    s = np.linspace(0, 1, 5)
    threads = []
    for side in (-1, 1):
        root = np.linspace(-0.99, 0.99, count) * a
        sway = rng.normal(0, 0.25, (count, 1)) + 0.4 * np.sin(9 * root / x + 2 * side)[:, None]
        u = root[:, None] + sway * reach * s**1.5
        v = side * (b - 0.002 + reach * s * rng.uniform(0.8, 1.05, (count, 1))) + 0 * u
        path = lay(np.clip(u, -a, a), np.clip(v, -b, b)) + np.stack(
            [0 * u, v - np.clip(v, -b, b), -0.3 * thick * s + 0 * u], -1
        )
        path[:, :, 0] += u - np.clip(u, -a, a)
        path[:, :, 2] = np.maximum(path[:, :, 2], 0.001)
        threads.append(tubes(path, np.array((1, 1, 0.9, 0.8, 0.6)) * rng.uniform(0.0012, 0.002), 4))
    return threads


@mesh_family("towels")
def towels(rng: np.random.Generator) -> Parts:
    """Folded towels in a pile, or rolled: soft layers with visible folds.

    A roll ends its pile: nothing would lie on it, and the next towel begins a pile beside it.
    """
    x, y = rng.uniform(0.18, 0.35), rng.uniform(0.14, 0.28)
    piles: list[list[tuple[int, Solid]]] = [[]]
    z = 0.0
    for k in range(int(rng.integers(1, 6))):
        thick = rng.uniform(0.007, 0.018)
        if rng.random() < 0.3:
            turns = rng.uniform(2.5, 4)
            a = np.linspace(0.6, turns * 2 * np.pi, 90)
            r = 0.009 + thick * 1.12 * a / (2 * np.pi)
            roll = _ribbon(np.c_[r * np.cos(a), r * np.sin(a)], x, thick).turned(z_deg=rng.normal(0, 5))
            piles[-1].append((k % 2, roll.resting(z)))
            piles.append([])
            z = 0.0
            continue
        layers = int(rng.integers(2, 6))
        pitch = 1.12 * thick
        t = np.linspace(0, 1, 14)
        bend = np.linspace(-np.pi / 2, np.pi / 2, 8)[1:-1]
        line = []
        for m in range(layers):
            way = 1 if m % 2 == 0 else -1
            wobble = 0.0008 * np.sin(9 * t + rng.uniform(0, 6))
            line.append(np.c_[way * (t - 0.5) * y, m * pitch + wobble])
            if m + 1 < layers:
                line.append(
                    np.c_[way * (y / 2 + pitch / 2 * np.cos(bend)), (m + 0.5 + 0.5 * np.sin(bend)) * pitch]
                )
        folded = _ribbon(np.vstack(line), x * rng.uniform(0.9, 1.05), thick).turned(z_deg=rng.normal(0, 4))
        folded = folded.resting(z).at(*rng.normal(0, 0.006, 2))
        piles[-1].append((k % 2, folded))
        z = float(folded.vertices[:, 2].max())
    parts: tuple[list[Solid], ...] = ([], [])
    edge = 0.0
    for pile in piles:
        y_in_pile = np.concatenate([towel.vertices[:, 1] for _, towel in pile] or [np.zeros(1)])
        for colour, towel in pile:
            parts[colour].append(towel.at(y=edge - float(y_in_pile.min())))
        edge += float(np.ptp(y_in_pile)) + 0.004
    named = zip(("cloth", "cloth_other"), parts, strict=True)
    return {name: solids for name, solids in named if solids}


@mesh_family("flag")
def flag(rng: np.random.Generator) -> Parts:
    """Flag or pennants in the wind: stripes that wave together, on a pole with a knob."""
    x, z, stripes = rng.uniform(0.4, 1.1), rng.uniform(0.3, 0.7), int(rng.integers(2, 6))
    pole = rng.uniform(0.8, 1.4)
    t = np.linspace(0, 1, 44)[None]
    phase, number, depth = rng.uniform(0, 6.3), rng.uniform(1.2, 3), rng.uniform(0.04, 0.13)
    cut = rng.uniform(0, 1.0) * (rng.random() < 0.4)
    groups: tuple[list[Solid], ...] = ([], [], [])
    for k in range(stripes):
        v = np.linspace(k, k + 1, 6)[:, None] / stripes
        wave = depth * t**0.7 * np.sin(2 * np.pi * number * t - phase + 1.2 * v)
        high = (v - 0.5) * (1 - cut * t)
        points = np.stack(
            np.broadcast_arrays(x * t * (0.96 - 0.6 * depth) + 0.012, x * wave, z * (high + 0.5)), axis=-1
        )
        groups[k % 3].append(sheet(points, 0.0018).at(z=pole - z - 0.03))
    post = [
        cylinder(0.009, pole, 0.003, 14),
        ball(0.02, 2).at(z=pole + 0.012),
        cylinder(0.06, 0.02, 0.006, 32).at(z=-0.004),
    ]
    named = zip(("cloth_a", "cloth_b", "cloth_c"), groups, strict=True)
    return {name: solids for name, solids in named if solids} | {"pole": post}


@mesh_family("stuffed_toy")
def stuffed_toy(rng: np.random.Generator) -> Parts:
    """Sewn animal: plump body, head, ears, limbs, snout, button eyes, perhaps a scarf."""
    body, head = rng.uniform(0.08, 0.13), rng.uniform(0.06, 0.1)
    ears, limb = rng.uniform(0.25, 1.3), rng.uniform(0.35, 0.5)
    soft = [ball(body, 3).stretched(1, 0.85, rng.uniform(1.0, 1.3)).at(z=1.1 * body)]
    top = 2.15 * body
    soft.append(ball(head, 3).stretched(1.05, 0.95, 0.95).at(0, -0.1 * body, top + 0.7 * head))
    inner = []
    for s in (-1, 1):
        ear = ball(0.4 * head, 3).stretched(1, 0.45, 0.6 + ears).turned(y_deg=s * rng.uniform(12, 35))
        place = (s * 0.72 * head, -0.08 * body, top + (1.45 + 0.25 * ears) * head)
        soft.append(ear.at(*place))
        inner.append(
            ball(0.27 * head, 2)
            .stretched(1, 0.4, 0.6 + ears)
            .turned(y_deg=s * 22)
            .at(place[0], place[1] - 0.09 * head, place[2])
        )
        arm = ball(limb * body, 3).stretched(0.75, 0.75, 1.5).turned(x_deg=rng.uniform(20, 70), y_deg=s * -35)
        soft.append(arm.at(s * 0.95 * body, -0.25 * body, 1.5 * body))
        leg = ball(limb * body, 3).stretched(0.9, 1.6, 0.9).turned(z_deg=s * -rng.uniform(5, 30))
        soft.append(leg.at(s * 0.6 * body, -0.75 * body, 0.42 * body))
        inner.append(
            ball(0.7 * limb * body, 2)
            .stretched(1, 0.3, 1)
            .at(s * 0.75 * body, -0.75 * body - 1.5 * limb * body, 0.42 * body)
        )
    inner.append(
        ball(0.42 * head, 3).stretched(1.1, 0.8, 0.8).at(0, -0.1 * body - 0.8 * head, top + 0.5 * head)
    )
    eyes = [
        ball(0.1 * head, 2).at(s * 0.36 * head, -0.1 * body - 0.84 * head, top + 0.92 * head) for s in (-1, 1)
    ]
    eyes.append(
        ball(0.13 * head, 2).stretched(1.3, 0.8, 0.9).at(0, -0.1 * body - 1.12 * head, top + 0.62 * head)
    )
    parts = {"yarn_fur": soft, "cloth_inner": inner, "plastic_eyes": eyes}
    return parts | ({"cloth_scarf": [_scarf(body, top)]} if rng.random() < 0.6 else {})


def _scarf(body: float, top: float) -> Solid:
    """Around the neck of a body of that radius, at height `top`."""
    a = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    wide = 0.62 * body
    path = np.c_[
        wide * np.cos(a),
        wide * 0.9 * np.sin(a) - 0.05 * body,
        top + 0.04 * body + 0.03 * body * np.sin(3 * a),
    ]
    return sweep(path, 0.17 * body, 10, closed=True)


def _ribbon(line: np.ndarray, width: float, thick: float) -> Solid:
    """A band of `thick` cloth along `line` (n, 2) of (y, z), `width` wide along x."""
    across = np.linspace(-0.5, 0.5, 7)[None] * width
    points = np.stack(np.broadcast_arrays(across, line[:, :1], line[:, 1:]), axis=-1)
    return sheet(points, thick)
