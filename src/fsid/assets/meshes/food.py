"""Food: fruit, vegetables, bread, cake."""

from __future__ import annotations

import numpy as np

from fsid.assets.forms import plate, scatter_rand, spread, sunflower, turns_to
from fsid.assets.registry import Parts, mesh_family
from fsid.assets.solids import Solid, ball, ball_directions, copies, cylinder, lathe, sweep
from fsid.assets.surfaces import smooth_normals


@mesh_family("fruit")
def fruit(rng: np.random.Generator) -> Parts:
    """Apples, lemons, pears or tomatoes lying together, with stems."""
    count = int(rng.integers(1, 7))
    size = rng.uniform(0.03, 0.06)
    spots = scatter_rand(rng, count, 2.5 * size)
    fruits = []
    pear = rng.uniform(-0.1, 0.45) * (rng.random() < 0.5)
    stem = sweep(np.array([(0, 0, 0.6), (0.05, 0.02, 1.05), (0.16, 0.05, 1.35)]) * size, 0.0018, 8)
    for _ in spots:
        lean = rng.normal(0, 25, 2)
        body = round_fruit(rng, size * rng.uniform(0.8, 1.1), pear).turned(*lean)
        lift = -float(body.vertices[:, 2].min())
        fruits.append((body.at(z=lift), stem.at(z=0.35 * pear * size).turned(*lean).at(z=lift)))
    bodies, stems = zip(*spread(fruits, spots), strict=True)
    return {"peel": bodies, "wood_stems": stems}


@mesh_family("bananas")
def bananas(rng: np.random.Generator) -> Parts:
    """Bunch of curved, edged fruit that share a stalk."""
    length, thick = rng.uniform(0.13, 0.2), rng.uniform(0.014, 0.02)
    bend = rng.uniform(0.9, 1.6)
    s = np.linspace(0, 1, 22)
    angle = bend * (s - 0.3)
    path = np.c_[np.sin(angle), 0 * s, 1 - np.cos(angle)] * length / bend
    body = np.clip(np.minimum(s * 12, (1 - s) * 9), 0.18, 1) ** 0.6
    one = sweep(path, thick * body, 10)
    many, tips = [], []
    for k in range(int(rng.integers(1, 7))):
        turn = (rng.normal(0, 4), rng.normal(0, 6) - 12, 13 * (k - 2) + rng.normal(0, 3))
        many.append(one.at(x=length * 0.34).turned(*turn).at(z=0.014 * (k % 2)))
        out = (path[-1] - path[-2]) / np.linalg.norm(path[-1] - path[-2])
        tip = sweep(path[-1] + np.linspace(0, 0.45, 3)[:, None] * thick * out, 0.24 * thick, 8)
        tip = tip.at(x=length * 0.34)
        tips.append(tip.turned(*turn).at(z=0.014 * (k % 2)))
    root = many[0].vertices[:10].mean(0)
    stalk = sweep(np.array([(-0.012, 0, 0.004), (0.0, 0, 0.0), (0.03, 0.0, -0.004)]) + root, thick * 0.7, 10)
    return {"peel": many, "tips": tips, "stalk": [stalk]}


@mesh_family("vegetables")
def vegetables(rng: np.random.Generator) -> Parts:
    """Carrots, cucumbers or aubergines side by side, ringed and uneven, with a tuft of green."""
    length, thick = rng.uniform(0.1, 0.22), rng.uniform(0.012, 0.035)
    taper, rough = rng.uniform(0.0, 0.9), rng.uniform(0.0, 0.05)
    s = np.linspace(0, 1, 40)
    bodies, greens, beside = [], [], 0.0
    for _ in range(int(rng.integers(1, 6))):
        shape = np.clip(np.minimum(s * 10, (1 - s) * 6), 0.05, 1) ** 0.5 * (1 - taper * s)
        radius = thick * rng.uniform(0.8, 1.1) * (shape + rough * rng.normal(0, 0.6, 40))
        bow = rng.normal(0, 0.12) * length
        path = np.c_[length * s, bow * np.sin(np.pi * s), thick * (1 - taper * s)]
        turn = rng.normal(0, 9)
        body = sweep(path, np.maximum(radius, 0.0008), 16).turned(z_deg=turn).resting()
        y = beside - float(body.vertices[:, 1].min())
        beside = y + float(body.vertices[:, 1].max()) + 0.001
        bodies.append(body.at(y=y))
        fan = np.linspace(0, 1, 7)[:, None]
        for _ in range(5):
            aim = rng.normal(0, (0.35, 0.35, 0.1), 3) - (1, 0, -0.15)
            stalk = fan * aim * rng.uniform(0.1, 0.35) * length
            stalk[:, 2] = np.abs(stalk[:, 2]) + rng.uniform(0, 0.5) * thick * fan[:, 0] ** 2
            green = sweep(stalk, 0.0016 + 0.0012 * (1 - fan[:, 0]), 6).at(0.004, 0, thick * 0.9)
            greens.append(green.turned(z_deg=turn).at(y=y))
    return {"peel": bodies, "leaf_stalks": greens}


@mesh_family("bread")
def bread(rng: np.random.Generator) -> Parts:
    """Loaf with slashes across its crust, some slices cut off and leaning."""
    x, y, z = rng.uniform(0.1, 0.17), rng.uniform(0.08, 0.12), rng.uniform(0.07, 0.11)
    slashes, depth = int(rng.integers(2, 7)), rng.uniform(0.04, 0.12)
    d = ball_directions(4)
    power = rng.uniform(2.4, 4)
    round_ = (np.abs(d) ** power).sum(1) ** (-1 / power)
    wave = np.abs(np.sin(np.pi * slashes * (round_ * d[:, 0] * 0.5 + 0.5) + rng.uniform(-1, 1) * d[:, 1]))
    cut = depth * np.exp(-((wave / 0.22) ** 2)) * np.clip(d[:, 2], 0, 1)
    radii = round_ * (1 - cut)
    for _ in range(5):
        radii *= 1 + 0.015 * np.sin(d @ rng.normal(0, 5, 3) + rng.uniform(0, 6.3))
    points = ball(radii, 4).vertices * (x, y / 2, z / 2)
    points[:, 2] = np.maximum(points[:, 2], -0.36 * z) + 0.002 * d[:, 2]
    low, faces = float(points[:, 2].min()), ball(1.0, 4).faces
    parts = {"crust": [Solid(points, smooth_normals(points, faces), faces)]}
    slices = []
    outline_angle = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    thick = rng.uniform(0.009, 0.014)
    for k in range(int(rng.integers(0, 4))):
        c, s = np.cos(outline_angle), np.sin(outline_angle)
        reach = (np.abs(c) ** power + np.abs(s) ** power) ** (-1 / power)
        ring = np.c_[reach, reach] * np.c_[c * y, s * z] * 0.46
        slice_ = plate(ring, thick, 0.0015).turned(y_deg=90 - rng.uniform(20, 50)).resting(low)
        slices.append(slice_.at(x=x * 1.12 + 0.035 * k, y=rng.normal(0, 0.006)))
    return parts | ({"slices": slices} if slices else {})


@mesh_family("cake")
def cake(rng: np.random.Generator) -> Parts:
    """Layered round cake with icing, decorations on its rim, often a wedge missing, on a stand."""
    radius, height = rng.uniform(0.08, 0.14), rng.uniform(0.05, 0.1)
    layers = int(rng.integers(2, 5))
    missing = rng.uniform(0.5, 1.4) * (rng.random() < 0.6)
    angle = np.linspace(missing / 2, 2 * np.pi - missing / 2, 60)
    arc = np.c_[np.cos(angle), np.sin(angle)] * radius
    outline = arc if missing == 0 else np.vstack([arc, [(0.004, 0.0)]])
    step = height / layers
    sponge, cream = [], []
    for k in range(layers):
        sponge.append(plate(outline, step * 0.72, 0.0015).at(z=0.004 + k * step))
        cream.append(
            plate(outline * rng.uniform(0.985, 1.015), step * 0.29, 0.0015).at(z=0.004 + (k + 0.715) * step)
        )
    pearls = int(rng.integers(6, 24))
    spots = np.linspace(0.06, 0.94, pearls) * (2 * np.pi - missing) + missing / 2
    size = rng.uniform(0.005, 0.012)
    rim = radius - 1.2 * size
    top = np.full(pearls, height + 0.004 + 0.5 * size)
    places = np.c_[rim * np.cos(spots), rim * np.sin(spots), top]
    pearl = ball(size, 2).stretched(1, 1, rng.uniform(0.7, 1.6))
    decor = copies(pearl, np.repeat(np.eye(3)[None], pearls, 0), places)
    stand = cylinder(radius * 1.15, 0.004, 0.0015, 48)
    return {"sponge": sponge, "cream": cream, "decoration": [decor], "stand": [stand]}


@mesh_family("bramble")
def bramble(rng: np.random.Generator) -> Parts:
    """Berries made of many little balls, in a heap: raspberries, blackberries, grapes."""
    count, size = int(rng.integers(2, 7)), rng.uniform(0.01, 0.016)
    drupes = int(rng.integers(12, 25))
    d = sunflower(drupes) * (1, 1, rng.uniform(1, 1.5))
    grain = size * 1.75 / np.sqrt(drupes)
    berry = copies(ball(grain, 1), turns_to(d), d * (size - 0.4 * grain))
    core = ball(size * 0.72, 1).stretched(1, 1, 1.2)
    spots = scatter_rand(rng, count, 2.3 * size)
    heap = []
    for turn in rng.uniform(0, 360, (count, 3)):
        lift = -float(berry.turned(*turn).vertices[:, 2].min())
        heap.append([part.turned(*turn).at(z=lift) for part in (berry, core, _calyx(size))])
    berries, cores, calyx = zip(*spread(heap, spots), strict=True)
    return {"peel": berries + cores, "leaf_calyx": calyx}


def round_fruit(rng: np.random.Generator, radius: float, pear: float = 0.0) -> Solid:
    """Round to lemon-shaped fruit, dimpled at the poles, slightly uneven; `pear` draws out its top."""
    d = ball_directions(3)
    pole = np.abs(d[:, 2])
    radii = 1 + rng.uniform(-0.25, 0.3) * pole**4 - rng.uniform(0, 0.25) * np.exp(-((1 - pole) / 0.02))
    radii += pear * np.clip(d[:, 2], 0, 1) ** 3
    radii += 0.03 * sum(np.sin(d @ rng.normal(0, 2.5, 3) + rng.uniform(0, 6.3)) for _ in range(4)) / 2
    return ball(radius * radii, 3)


def _calyx(size: float) -> Solid:
    profile = ((0, 0.95), (0.6, 0.85), (0.62, 0.95), (0, 1.25))
    return lathe([(r * size, z * size) for r, z in profile], 10)
