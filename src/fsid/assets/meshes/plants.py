"""Plants: thin leaves and petals on curved stems, most of them in pots."""

from __future__ import annotations

import numpy as np

from fsid.assets.forms import fluted, hollow, loft, scatter_rand, spread, squared, sunflower, turns_to
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import (
    Solid,
    ball,
    copies,
    cylinder,
    join,
    lathe,
    rotation_matrix,
    sheet,
    sweep,
    tubes,
)

LEAVES = 8


@mesh_family("potted_plant")
def potted_plant(rng: np.random.Generator) -> Parts:
    """Pot with soil, curved stems, leaves: blade, oval, heart, lobed, split, fern, round, needle."""
    pot, soil, top, radius = _pot_rand(rng)
    leaf = leaf_rand(rng, int(rng.integers(LEAVES)), rng.uniform(0.08, 0.2))
    count = int(rng.integers(4, 11))
    s = np.linspace(0, 1, 9)
    lean, reach, aim = (
        rng.uniform(0.1, 0.6, count),
        rng.uniform(0.12, 0.42, count),
        rng.uniform(0, 6.3, count),
    )
    out = (0.3 * radius + (lean * reach)[:, None] * s**1.6)[..., None]
    up = (reach[:, None] * s)[..., None]
    heading = np.stack([np.cos(aim), np.sin(aim)], axis=1)[:, None]
    paths = np.concatenate([out * heading, up + top - 0.01], axis=-1)
    stems = tubes(paths, np.linspace(0.005, 0.002, 9), 6)
    turns, places = [], []
    budget = int(6000 / max(len(leaf.faces), 1) / count)
    for path in paths:
        for k in rng.integers(2, 9, size=min(int(rng.integers(4, 9)), max(budget, 1))):
            turn = rotation_matrix(rng.normal(0, 25), rng.uniform(-60, 25), rng.uniform(0, 360))
            turns.append(turn * rng.uniform(0.5, 1.2))
            places.append(path[k])
    free = _free(leaf, np.array(turns), np.array(places), 0.9 * radius, float(pot.vertices[:, 2].max()))
    leaves = copies(leaf, np.array(turns)[free], np.array(places)[free])
    parts = {"pot": [pot], "soil": [soil], "leaf_stems": [stems], "leaf": [leaves]}
    return {name: solids for name, solids in parts.items() if len(solids[0].faces)}


@mesh_family("rosette")
def rosette(rng: np.random.Generator) -> Parts:
    """Succulent or aloe: thick leaves in a golden-angle spiral, in a pot."""
    pot, soil, top, radius = _pot_rand(rng)
    count, length = int(rng.integers(16, 40)), radius * rng.uniform(0.8, 2.2)
    thick, slim, curl = rng.uniform(0.1, 0.25), rng.uniform(0.15, 0.4), rng.uniform(-0.2, 0.8)
    s = np.linspace(0, 1, 10)[:, None]
    a = np.linspace(0, 2 * np.pi, 8, endpoint=False)[None]
    wide = slim * (np.sin(np.pi * np.clip(s, 0.03, 0.985) ** 0.75) ** 0.7 + 0.02)
    y, z = wide * np.cos(a), thick * wide / slim * (np.sin(a) + 0.25 * np.cos(a) ** 2) + curl * s**2 * 0.5
    rings = np.stack(np.broadcast_arrays(s, y, z), axis=-1) * length
    leaf = loft(rings)
    k = np.arange(count)
    turns = [
        rotation_matrix(0, -float(tilt), 137.5 * i + rng.normal(0, 3)) * size
        for i, tilt, size in zip(k, np.linspace(12, 77, count), np.linspace(1, 0.45, count), strict=True)
    ]
    places = np.c_[np.zeros((count, 2)), top + 0.25 * length * k / count]
    return {"pot": [pot], "soil": [soil], "leaf": [copies(leaf, np.array(turns), places)]}


@mesh_family("cactus")
def cactus(rng: np.random.Generator) -> Parts:
    """Ribbed column or ball with arms and rows of spines, in a pot."""
    pot, soil, top, radius = _pot_rand(rng)
    height, ribs = radius * rng.uniform(1.2, 4.5), int(rng.integers(8, 18))
    t = np.linspace(0, 1, 22)
    thick = radius * rng.uniform(0.45, 0.8)
    outer = thick * np.sqrt(np.clip(1 - np.abs(2 * t - 1) ** rng.uniform(2.2, 6), 0.0, 1))
    flutes = fluted(ribs, rng.uniform(0.12, 0.3), 0.0)
    body = lathe(np.c_[outer, t * height], 4 * ribs, 60).warped(flutes)
    bodies = [body.at(z=top - 0.03)]
    for _ in range(int(rng.integers(0, 4))):
        size, side = rng.uniform(0.3, 0.55), rng.uniform(0, 360)
        arm = Solid(body.vertices * size, body.normals, body.faces).turned(
            y_deg=rng.uniform(15, 50), z_deg=side
        )
        bodies.append(
            arm.at(*(rotation_matrix(z_deg=side) @ (0.6 * thick, 0, top + height * rng.uniform(0.2, 0.6))))
        )
    on_rib = 2 * np.pi * np.repeat(np.arange(ribs), 9) / ribs
    level = np.tile(np.linspace(0.12, 0.95, 9), ribs)
    r = np.interp(level, t, outer)
    places = np.c_[r * np.cos(on_rib), r * np.sin(on_rib), level * height + top - 0.03]
    away = np.c_[np.cos(on_rib), np.sin(on_rib), 2.2 * level - 1]
    away += rng.normal(0, 0.35, away.shape)
    spine = lathe([(0.0007, 0), (0.0001, thick * rng.uniform(0.2, 0.5))], 4)
    return {
        "pot": [pot],
        "soil": [soil],
        "leaf_body": bodies,
        "spines": [copies(spine, turns_to(away), places)],
    }


@mesh_family("flower")
def flower(rng: np.random.Generator) -> Parts:
    """Cut flowers, single or a bunch, sometimes in a vase: daisies, tulips, roses, lilies."""
    head, heart = _blossom_rand(rng)
    count = min(int(rng.integers(1, 8)), 9000 // (len(head.faces) + len(heart.faces)))
    size, tall = rng.uniform(0.025, 0.06), rng.uniform(0.2, 0.45)
    s = np.linspace(0, 1, 12)
    petals: list[Solid] = []
    hearts: list[Solid] = []
    stems, turns, places = [], [], []
    leaf = leaf_rand(rng, int(rng.integers(3)), 0.3 * tall)
    for k in range(count):
        aim, lean, high = rng.uniform(0, 360), rng.uniform(2, 24) * (k > 0), tall * rng.uniform(0.75, 1)
        bend = np.radians(lean) * s**1.5
        path = np.c_[0.7 * high * np.sin(bend), 0 * s, high * s] @ rotation_matrix(z_deg=aim).T
        stems.append(sweep(path, 0.002 + 0.001 * (s > 0.97), 8))
        scale = size * rng.uniform(0.8, 1.2)
        for bits, part in ((petals, head), (hearts, heart)):
            grown = Solid(part.vertices * scale, part.normals, part.faces)
            bits.append(grown.turned(y_deg=1.3 * lean + rng.normal(0, 8)).turned(z_deg=aim).at(*path[-1]))
        for at in rng.integers(3, 9, 2):
            turns.append(rotation_matrix(rng.normal(0, 10), rng.uniform(-65, -20), rng.uniform(0, 360)))
            places.append(path[at])
    free = np.ones(len(turns), bool)
    vase: list[Solid] = []
    if rng.random() < 0.5:
        z = np.linspace(0, 1, 16)
        outer = (0.03 + 0.012 * count**0.5) * (
            1 + rng.normal(0, 0.35) * (z - 0.5) ** 2 - 0.25 * np.sin(np.pi * z)
        )
        free = _free(leaf, np.array(turns), np.array(places), 0.85 * float(outer[-1]), 0.45 * tall)
        vase = [hollow(outer, 0.45 * tall * z, 0.003, segments=40).at(z=-0.008)]
    foliage = [copies(leaf, np.array(turns)[free], np.array(places)[free])] if free.any() else []
    parts = {"petal": petals, "blossom": hearts, "leaf_stems": stems, "leaf": foliage, "glass_vase": vase}
    return {name: solids for name, solids in parts.items() if solids}


@mesh_family("branch")
def branch(rng: np.random.Generator) -> Parts:
    """Bare or budding twig that forks again and again."""
    length, fork, crook = rng.uniform(0.2, 0.4), rng.uniform(20, 50), rng.uniform(0.01, 0.04)
    level: list[tuple[np.ndarray, np.ndarray, float]] = [(np.zeros(3), np.array((0.0, 0.0, 1.0)), 1.0)]
    s = np.linspace(0, 1, 7)[:, None]
    paths, radii, tips = [], [], []
    for depth in range(int(rng.integers(4, 6))):
        grown = []
        for start, way, size in level:
            kink = rng.normal(0, crook, (7, 3)) * s
            path = start + length * size * (way * s + kink * (s > 0.1))
            paths.append(path)
            radii.append(0.016 * length / 0.3 * size**1.4 * np.linspace(1, 0.62, 7))
            for _ in range(2 if depth else 3):
                turn = way + np.tan(np.radians(fork)) * rng.normal(0, 0.75, 3)
                turn[2] += 0.15
                at = path[-1] if rng.random() < 0.6 else path[int(rng.integers(3, 6))]
                grown.append((at, turn / np.linalg.norm(turn), size * rng.uniform(0.55, 0.8)))
            tips.append(path[-1])
        level = grown
    wood = tubes(np.array(paths), np.array(radii), 7)
    parts = {"wood_bark": [wood]}
    if rng.random() < 0.6:
        ends = np.array(tips[-40:])
        bud = ball(rng.uniform(0.004, 0.012), 1).stretched(1, 1, rng.uniform(0.9, 2))
        parts["petal_buds"] = [copies(bud, turns_to(rng.normal(0, 1, ends.shape)), ends)]
    return parts


@mesh_family("bush")
def bush(rng: np.random.Generator) -> Parts:
    """Crown of one or two hundred leaves about a stem that forks: shrub, small tree, bouquet of foliage."""
    count, length = int(rng.integers(110, 230)), rng.uniform(0.05, 0.14)
    t = np.linspace(0, 1, 5)
    half = (
        rng.uniform(0.5, 1.2)
        * (_oval(t), 0.3 * np.sin(np.pi * t), 0.55 * np.sqrt(t) * (1 - t) ** 0.7)[int(rng.integers(3))]
    )
    leaf = _grid_leaf(half + 0.03, rng.uniform(0.1, 0.5), rng.uniform(0.1, 0.6), 3, length)
    ways = rng.normal((0, 0, rng.uniform(0, 0.8)), 1, (count, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    lumps = rng.normal(0, 1, (6, 3)) @ ways.T
    depth = (0.75 + 0.15 * np.tanh(lumps.max(axis=0) - 1)) * rng.uniform(0.2, 1, count) ** (1 / 3)
    crown = rng.uniform(0.16, 0.34, 3)
    high = crown[2] * rng.uniform(0.9, 1.8)
    spots = ways * depth[:, None] * crown + (0, 0, high)
    aim = ways + rng.normal(0, 0.6, (count, 3)) - (0, 0, rng.uniform(0, 0.8))
    turns = turns_to(aim, rng.uniform(0, 2 * np.pi, count)) * rng.uniform(0.6, 1.25, count)[:, None, None]
    s = np.linspace(0, 1, 6)[None, :, None]
    ends = spots[: int(rng.integers(12, 30)), None]
    middle = ends * (0.25, 0.25, 0.6) + rng.normal(0, 0.01, (len(ends), 1, 3))
    stems = tubes(2 * s * (1 - s) * middle + s**2 * ends, np.linspace(0.008, 0.002, 6), 6)
    leaf = leaf.turned(y_deg=-90)
    free = _free(leaf, turns, spots, 0.0, 0.0)
    return {"wood_bark": [stems], "leaf": [copies(leaf, turns[free], spots[free])]}


@mesh_family("mushrooms")
def mushrooms(rng: np.random.Generator) -> Parts:
    """Group of caps on stalks, with gills below and sometimes warts above."""
    count, size = int(rng.integers(1, 5)), rng.uniform(0.025, 0.06)
    open_, point = rng.uniform(0.35, 1.0), rng.uniform(0.7, 2.0)
    group = []
    s = np.linspace(0, 1, 14)
    fin = sheet(
        np.stack(np.meshgrid(np.linspace(0.15, 0.93, 4), (-0.16, 0.0)), -1)[..., [0, 0, 1]] * (1, 0, 1), 0.02
    )
    spokes = np.array([rotation_matrix(z_deg=k * 15) for k in range(24)])
    spots = scatter_rand(rng, count, 1.5 * size)
    for _ in spots:
        r, tall, lean = size * rng.uniform(0.5, 1.1), size * rng.uniform(1.1, 2.6), rng.normal(0, 7, 2)
        dome = np.c_[np.cos(s * np.pi / 2) ** point, open_ * np.sin(s * np.pi / 2)]
        cap = lathe([(0, -0.02), (0.96, -0.04), (1.0, -0.01), *dome[1:-1], (0, open_)], 30, 50)
        thick = 0.2 + 0.12 * np.abs(1 - 2 * s)
        stem = lathe([(0, 0), *np.c_[thick * r, s * tall], (0, tall)], 18)
        head = Solid(cap.vertices * r, cap.normals, cap.faces).at(z=tall)
        fan = copies(Solid(fin.vertices * r, fin.normals, fin.faces), spokes, np.zeros((24, 3))).at(
            z=tall - 0.02 * r
        )
        d = sunflower(40)[23:38]
        on_cap = np.c_[d[:, :2], d[:, 2] * open_] * r * 0.99
        dots = copies(ball(0.05 * r, 1).stretched(1, 1, 0.5), turns_to(d), on_cap).at(z=tall)
        lift = -float(stem.turned(*lean).vertices[:, 2].min())
        group.append([part.turned(*lean).at(z=lift) for part in (head, stem, fan, dots)])
    parts = zip(*spread(group, spots), strict=True)
    named = dict(zip(("peel_cap", "stalk", "gills", "warts"), parts, strict=True))
    return named if rng.random() < 0.5 else {name: named[name] for name in ("peel_cap", "stalk", "gills")}


def leaf_rand(rng: np.random.Generator, kind: int, length: float) -> Solid:
    """A leaf along +x from the origin, folded at its midrib, drooping.

    kind: 0 blade, 1 oval, 2 heart, 3 lobed, 4 split, 5 fern (leaflets), 6 round on a stalk, 7 needles.
    """
    fold, droop = rng.uniform(0.1, 0.6), rng.uniform(0.1, 0.7)
    if kind == 5:
        return _compound(_grid_leaf(_oval(np.linspace(0, 1, 5)), fold, droop, 3), length, 7)
    if kind == 7:
        needle = lathe([(0.008, 0), (0.0015, 0.34)], 4)
        k = np.arange(26)
        way = np.c_[np.full(26, 0.55), np.cos(2.4 * k), np.sin(2.4 * k)]
        needles = copies(needle, turns_to(way), np.c_[k / 26, 0 * k, 0 * k])
        twig = sweep(np.array([(0, 0, 0), (0.5, 0, 0.0), (1, 0, 0)]), 0.012, 5)
        both = join([needles, twig])
        return Solid(both.vertices * length, both.normals, both.faces)
    t = np.linspace(0, 1, 13 if kind in (3, 4) else 10)
    half = (
        0.08 * np.sin(np.pi * t**0.7),
        _oval(t),
        0.63 * np.sqrt(t) * (1 - t) ** 0.7,
        0.3 * np.sin(np.pi * t**0.8) * (0.65 + 0.35 * np.abs(np.cos(np.pi * t * int(rng.integers(3, 6))))),
        0.42 * np.sin(np.pi * t**0.7) * (0.35 + 0.65 * (np.arange(len(t)) % 2)),
        t,
        0.45 * np.sqrt(np.clip(1 - (2 * np.clip((t - 0.35) / 0.65, 0, 1) - 1) ** 2, 0, 1)),
    )[kind]
    return _grid_leaf(half + 0.006, fold, droop, 5, length)


def _free(leaf: Solid, turns: np.ndarray, places: np.ndarray, wall: float, rim: float) -> np.ndarray:
    """(n,) bool: which copies of `leaf` stay above the floor, and out of a wall of that radius and height."""
    points = np.einsum("nij,vj->nvi", turns, leaf.vertices) + places[:, None]
    beside, high = np.hypot(points[..., 0], points[..., 1])[:, leaf.faces], points[:, leaf.faces, 2]
    through = (beside.min(2) < wall) & (beside.max(2) > wall) & (high.min(2) < rim)
    return (points[..., 2].min(1) > 0) & ~through.any(1)


def _oval(t: np.ndarray) -> np.ndarray:
    return 0.26 * np.sin(np.pi * t**0.8) ** 0.8


def _grid_leaf(half: np.ndarray, fold: float, droop: float, columns: int, length: float = 1.0) -> Solid:
    t = np.linspace(0, 1, len(half))[:, None]
    across = np.linspace(-1, 1, columns)[None]
    y = (half + 0.004)[:, None] * across
    z = fold * np.abs(y) - droop * t**2 * 0.6 + 0.015 * np.sin(9 * t) * across**2
    return sheet(np.stack(np.broadcast_arrays(t, y, z), axis=-1) * length, max(0.0008, 0.006 * length))


def _compound(leaflet: Solid, length: float, pairs: int) -> Solid:
    """Leaflets along both sides of a bent rib."""
    s = np.linspace(0.1, 1, pairs)
    rib = np.c_[s, 0 * s, 0.25 * s - 0.35 * s**2]
    size = 0.4 * np.sin(np.pi * (0.15 + 0.8 * s)) + 0.05
    turns = [rotation_matrix(x_deg=side * 12, z_deg=side * 62) * k for side in (1, -1) for k in size]
    fans = copies(leaflet, np.array(turns), np.vstack([rib, rib]))
    both = join([fans, sweep(np.vstack([(0, 0, 0), rib]), 0.008, 5)])
    return Solid(both.vertices * length, both.normals, both.faces)


def _blossom_rand(rng: np.random.Generator) -> tuple[Solid, Solid]:
    """Petals and heart of a flower of radius about 1 that looks up."""
    kind = int(rng.integers(4))
    rows = ((1, 13), (1, 6), (5, 6), (1, 6))[kind]
    cup, wide = ((0.15, 0.2), (1.25, 0.55), (0.9, 0.55), (0.45, 0.3))[kind]
    t, across = np.linspace(0, 1, 7)[:, None], np.linspace(-1, 1, 5)[None]
    half = wide * (np.sin(np.pi * (0.08 + 0.86 * t) ** (0.6 + 0.5 * (kind != 1))) + 0.05)
    bend = cup * 1.25 * t
    reach = np.sin(bend + 0.001) / (cup * 1.25) if kind != 3 else t
    z = (1 - np.cos(bend)) / (cup * 1.25) * 1.2 - (0.45 * t**3 if kind == 3 else 0) + 0.35 * half * across**2
    petal = sheet(np.stack(np.broadcast_arrays(0.12 + reach, half * across, z), axis=-1), 0.025)
    turns, count = [], int(rng.integers(rows[1] - 1, rows[1] + 3))
    for ring in range(rows[0]):
        for k in range(count):
            spin = 360 * k / count + 360 / count / 2 * (ring % 2) + rng.normal(0, 3)
            turn = rotation_matrix(rng.normal(0, 4), -13 * ring * (kind == 2) + rng.normal(0, 4), spin)
            turns.append(turn * (1 - 0.13 * ring))
    petals = copies(petal, np.array(turns), np.zeros((len(turns), 3)))
    d = sunflower(50)[22:]
    heart = ball(0.09 if kind == 0 else 0.05, 1)
    dome = copies(heart, np.repeat(np.eye(3)[None], len(d), 0), 0.28 * d * (1, 1, 0.6))
    if kind in (1, 3):
        around = np.arange(6)
        high = np.full(6, 0.5 + 0.2 * (kind == 1))
        tops = np.c_[0.14 * np.cos(around), 0.14 * np.sin(around), high]
        paths = np.linspace(np.zeros((6, 3)), tops, 5, axis=1)
        return petals, tubes(paths, np.array((0.02, 0.02, 0.02, 0.045, 0.045)), 6)
    return petals, dome


def _pot_rand(rng: np.random.Generator) -> tuple[Solid, Solid, float, float]:
    """Pot, soil, height of the soil's surface and radius of the pot's mouth, metres."""
    radius, tall = rng.uniform(0.06, 0.14), rng.uniform(0.09, 0.2)
    t = np.linspace(0, 1, 12)
    lip = rng.uniform(0, 0.09) * (t > 0.8)
    outer = radius * (1 - rng.uniform(0, 0.4) * (1 - t) ** rng.uniform(0.7, 2.5) + lip)
    pot = hollow(outer, t * tall, 0.005, segments=40)
    soil = cylinder(0.94 * float(outer[9]) - 0.004, 0.02, 0.004, 40)
    if rng.random() < 0.3:
        square = squared(rng.uniform(2.5, 7))
        pot, soil = pot.warped(square), soil.warped(square)
    return pot, soil.at(z=tall * 0.72), tall * 0.72 + 0.02, radius
