"""Fabrics: woven, knitted, tartan, carpet, leather. A thread is a bump that carries its own fibres."""

from __future__ import annotations

import numpy as np

from fsid.assets.material_registry import Layers, material_family
from fsid.assets.patterns import axes, cells, edge, level, noise


def _woven(rng: np.random.Generator, size: int, threads: int, kind: str) -> tuple[np.ndarray, ...]:
    """(over, bump, fibres): 1 where the warp thread lies on top; thread height 0..1, the mean of a texel
    where threads are finer; fibre noise."""
    u, v = axes(size)
    wobble = noise(rng, size, 1.5, low=2, high=threads / 2) * np.float32(0.12)
    x, y = u * threads + wobble, v * threads + wobble.T
    count = -(-2 * threads // size)
    within = [((k + 0.5) / count - 0.5) * threads / size for k in range(count)]
    bump = np.mean([_bump(x + dx, y + dy, kind) for dx in within for dy in within], axis=0)
    fibre = noise(rng, size, 0.2, low=size / 12, stretch=(6, 1))
    over = _over(x, y, kind)
    return over, bump.astype(np.float32), np.where(over, fibre.T, fibre)


def _over(x: np.ndarray, y: np.ndarray, kind: str) -> np.ndarray:
    i, j = np.floor(x).astype(np.int32), np.floor(y).astype(np.int32)
    if kind == "plain":
        return (i + j) % 2 == 0
    if kind == "twill":
        return (i + j) % 4 < 2
    if kind == "denim":
        return (i - j) % 3 != 0
    return (i // 2 + j // 2) % 2 == 0


def _bump(x: np.ndarray, y: np.ndarray, kind: str) -> np.ndarray:
    over = _over(x, y, kind)
    across = np.where(over, x, y) % 1 - 0.5
    along = np.where(over, y, x) % 1 - 0.5
    return np.sqrt(np.clip(1 - (2 * across) ** 2, 0.03, 1)) * (0.65 + 0.35 * np.cos(np.pi * along))


@material_family("weave", tile_m=0.15, relief_m=0.0008)
def weave(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Plain linen, twill, denim or basket weave; every thread slightly different."""
    threads = (96, 128, 144, 72)[variant]
    over, bump, fibre = _woven(rng, size, threads, ("plain", "twill", "denim", "basket")[variant])
    u, v = axes(size)
    ends = np.where(
        over, rng.random(threads)[(u * threads).astype(int)], rng.random(threads)[(v * threads).astype(int)]
    )
    worn = noise(rng, size, 1.8)
    contrast = (0.35, 0.7, 1.0, 0.5)[variant]
    return Layers(
        mix=np.clip(contrast * (1 - over) + 0.25 * ends + 0.12 * worn, 0, 1),
        pattern=0.15 * level(worn - 1, 0.5),
        detail=0.26 + 0.28 * bump + 0.04 * fibre + 0.08 * (ends - 0.5),
        roughness=0.85 + 0.05 * fibre,
        height=0.9 * bump + 0.03 * fibre,
    )


@material_family("tartan", tile_m=0.5, relief_m=0.0006)
def tartan(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """A sett of coloured stripes, the same along warp and weft, in a twill."""
    threads = (192, 256, 160, 224)[variant]
    widths = rng.multinomial(threads // 2, rng.dirichlet(np.full(16, 1.2)))
    stripes = np.repeat(rng.random((2, 16)), widths, axis=1)
    sett = np.concatenate([stripes, stripes[:, ::-1]], axis=1)
    over, bump, fibre = _woven(rng, size, threads, "twill")
    u, v = axes(size)
    iu, iv = (u * threads).astype(int), (v * threads).astype(int)
    first = np.where(over, sett[0][iu], sett[0][iv])
    second = np.where(over, sett[1][iu], sett[1][iv])
    return Layers(
        mix=first,
        pattern=edge(second, 0.7, 0.02),
        detail=0.32 + 0.22 * bump + 0.03 * fibre,
        roughness=0.9,
        height=bump,
    )


@material_family("knit", tile_m=0.2, relief_m=0.003)
def knit(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Stockinette: columns of V-shaped stitches of twisted yarn, with stripes or a fair-isle chart."""
    columns, rows = (20, 28, 40, 14)[variant], (24, 36, 52, 16)[variant]
    u, v = axes(size)
    wobble = noise(rng, size, 1.6, low=2, high=40) * np.float32(0.06)
    x, y = u * columns + wobble, v * rows + wobble.T
    side = x % 1 - 0.5
    leg = np.abs(np.abs(side) - 0.25) * 4
    slant = y + 1.1 * np.abs(side)
    bump = np.sqrt(np.clip(1 - leg**2, 0.0, 1)) * (0.7 + 0.3 * np.sin(2 * np.pi * slant))
    twist = np.sin(2 * np.pi * (4 * slant + 3 * leg * np.sign(side)))
    fuzz = noise(rng, size, 0.3, low=size / 8)
    chart = rng.random((rows, columns if variant % 2 else 1)) < 0.37
    stitch = chart[np.floor(slant).astype(int) % rows, np.floor(x).astype(int) % chart.shape[1]]
    return Layers(
        mix=np.clip(0.3 + 0.2 * twist * bump + 0.1 * fuzz, 0, 1),
        pattern=0.9 * stitch,
        detail=0.2 + 0.32 * bump + 0.04 * twist * bump + 0.03 * fuzz,
        roughness=0.92,
        height=0.85 * bump + 0.06 * twist * bump + 0.02 * fuzz,
    )


@material_family("carpet", tile_m=0.4, relief_m=0.006)
def carpet(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Loop or cut pile of several yarn colours, with a woven figure for odd variants."""
    near, _, value = cells(rng, size, (72, 110, 90, 150)[variant], 0.8)
    tuft = np.clip(1 - 1.3 * near, 0, 1)
    fibre = noise(rng, size, 0.0, low=size / 6)
    trodden = noise(rng, size, 1.8, low=2)
    figure = np.abs(noise(rng, size, 3.0, low=3, high=12))
    return Layers(
        mix=np.clip(value * 0.8 + 0.15 * trodden, 0, 1),
        pattern=(0.9 * edge(figure, 0.7, 0.04) if variant % 2 else edge(value, 0.9, 0.05)),
        detail=0.28 + 0.3 * tuft + 0.07 * fibre + 0.03 * trodden,
        roughness=0.95,
        height=0.8 * tuft + 0.05 * fibre + 0.05 * trodden + 0.05,
    )


@material_family(
    "leather",
    tile_m=0.25,
    relief_m=0.0012,
    colours=(
        "6b3f24 8a5632 c29a6a",
        "2a2624 45403c 8a8078",
        "a8703f c48f58 e0bf8f",
        "5a2a24 7a3f36 b5806a",
    ),
)
def leather(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Pebbled hide: warped cells with deep creases between them, pores, darker patina in the creases."""
    count = (40, 60, 90, 28)[variant]
    shift = np.stack([noise(rng, size, 1.8, low=2, high=60), noise(rng, size, 1.8, low=2, high=60)]) * 0.35
    near, second, value = cells(rng, size, count, 0.95, shift)
    crease = 1 - edge(second - near, 0.12, 0.26)
    pores = edge(noise(rng, size, 0.3, low=size / 12), 2.0, 0.5)
    wear = noise(rng, size, 1.9)
    return Layers(
        mix=np.clip(0.5 * crease + 0.35 * level(wear) + 0.15 * value, 0, 1),
        pattern=0.3 * edge(wear, 1.3, 0.8),
        detail=0.52 - 0.13 * crease - 0.1 * pores + 0.02 * wear,
        roughness=0.4 + 0.2 * crease + 0.06 * wear,
        height=0.9 * (1 - crease) * (0.8 + 0.2 * value) - 0.2 * pores + 0.1,
    )
