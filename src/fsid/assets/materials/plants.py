"""More of nature in its own colours: foliage, moss, flowers, straw, snow, soil, coral."""

from __future__ import annotations

import numpy as np

from fsid.assets.material_registry import Layers, material_family, pictured
from fsid.assets.patterns import cells, edge, level, noise, shade, stack, turned, warp


def _leaves(
    rng: np.random.Generator, count: int, length: float, width: float, lobes: int = 0
) -> list[np.ndarray]:
    """Outlines of leaves: pointed ovals, or lobed ones, of any direction; tile units."""
    t = np.linspace(0, 2 * np.pi, 17 if lobes == 0 else 33)[:-1]
    out = []
    for _ in range(count):
        long, turn = length * rng.lognormal(0, 0.3), rng.uniform(0, 2 * np.pi)
        x, y = np.cos(t), width * np.sin(t) * (1 - 0.35 * np.cos(t))
        if lobes:
            star = 0.62 + 0.38 * np.cos(lobes * t)
            x, y = np.cos(t) * star, np.sin(t) * star
        c, s = np.cos(turn), np.sin(turn)
        out.append(np.c_[c * x - s * y, s * x + c * y] * long / 2 + rng.random(2))
    return out


def _canopy(
    rng: np.random.Generator, size: int, outlines: list[np.ndarray], palette: np.ndarray, dark: float
) -> tuple[np.ndarray, np.ndarray]:
    """(picture (S, S, 3), depth 0..1) of leaves over each other, the lower the darker."""
    count = len(outlines)
    index = stack(size, outlines)
    depth = shade(index, np.linspace(0.0, 1.0, count), 0.0)
    pick = rng.integers(len(palette), size=count)
    light = rng.uniform(0.75, 1.25, count)
    tones = palette[pick] * light[:, None] * rng.uniform(0.92, 1.08, (count, 3))
    rgb = np.stack([shade(index, tones[:, k], 0.16) for k in range(3)], axis=-1)
    return rgb * (dark + (1 - dark) * depth)[..., None], depth


@material_family("foliage", tile_m=0.8, relief_m=0.015, colours="picture")
def foliage(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Hedges and lawns in many greens at once, sunlit tops over dark depth; autumn for variant 3."""
    palette = (
        ((0.30, 0.45, 0.14), (0.42, 0.56, 0.20), (0.20, 0.34, 0.13), (0.55, 0.62, 0.25)),
        ((0.18, 0.33, 0.16), (0.26, 0.42, 0.24), (0.36, 0.50, 0.33), (0.45, 0.55, 0.45)),
        ((0.48, 0.60, 0.22), (0.62, 0.68, 0.30), (0.33, 0.47, 0.18), (0.75, 0.72, 0.40)),
        ((0.75, 0.45, 0.12), (0.62, 0.22, 0.10), (0.80, 0.65, 0.20), (0.40, 0.38, 0.14)),
    )[variant]
    shape = ((1500, 0.07, 0.4, 0), (2600, 0.05, 0.22, 0), (1000, 0.1, 0.55, 0), (1100, 0.1, 0.5, 5))[variant]
    rgb, depth = _canopy(rng, size, _leaves(rng, *shape), np.array(palette), 0.35)
    glow = level(noise(rng, size, 1.9))
    vein = noise(rng, size, 0.8, low=size / 30)
    layers = pictured(np.clip(rgb * (0.7 + 0.5 * glow + 0.03 * vein)[..., None], 0, 1))
    return layers._replace(roughness=0.5 + 0.1 * glow, height=depth)


@material_family("flowers", tile_m=0.8, relief_m=0.015, colours="picture")
def flowers(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """A meadow or bed: blossoms of a few hues over green."""
    greens = np.array(((0.22, 0.38, 0.12), (0.34, 0.48, 0.18), (0.16, 0.28, 0.12)))
    rgb, depth = _canopy(rng, size, _leaves(rng, 3000, 0.09, 0.2), greens, 0.35)
    hues = (
        ((0.92, 0.92, 0.88), (0.95, 0.85, 0.3)),
        ((0.85, 0.15, 0.2), (0.95, 0.5, 0.55), (0.7, 0.1, 0.3)),
        ((0.45, 0.3, 0.75), (0.6, 0.5, 0.9), (0.85, 0.8, 0.95)),
        ((0.95, 0.7, 0.15), (0.9, 0.4, 0.1), (0.95, 0.9, 0.4)),
    )[variant]
    count = (160, 110, 260, 130)[variant]
    outlines: list[np.ndarray] = []
    tones, tops = [], []
    angle = np.linspace(0, 2 * np.pi, 40)[:-1]
    for _ in range(count):
        reach, petals, place = rng.uniform(0.012, 0.045), int(rng.integers(4, 9)), rng.random(2)
        hue = np.array(hues[rng.integers(len(hues))]) * rng.uniform(0.8, 1.05)
        for share, tone in ((1.0, hue), (0.68, hue * 0.85), (0.25, np.array((0.85, 0.65, 0.15)))):
            radius = reach * share * (0.75 + 0.25 * np.cos(petals * angle + place[0] * 9))
            outlines.append(np.c_[np.cos(angle), np.sin(angle)] * radius[:, None] + place)
            tones.append(tone)
            tops.append(1.0 - 0.1 * share)
    index = stack(size, outlines)
    cover = shade(index, np.ones(len(outlines)))[..., None]
    bloom = np.stack([shade(index, np.array(tones)[:, k]) for k in range(3)], axis=-1)
    light = (0.75 + 0.4 * level(noise(rng, size, 1.8)) + 0.03 * noise(rng, size, 0.8, low=size / 40))[
        ..., None
    ]
    layers = pictured(np.clip((rgb * (1 - cover) + bloom) * light, 0, 1))
    return layers._replace(
        roughness=0.6, height=np.maximum(0.8 * depth, shade(index, np.array(tops)) * cover[..., 0])
    )


@material_family("moss", tile_m=0.3, relief_m=0.008, colours="3f5a22 7a8f3a 2a2a1a")
def moss(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Cushions of tiny stars, thinner and on stone for higher variants, with litter."""
    near, _, value = cells(rng, size, (60, 90, 70, 120)[variant], 0.95)
    cushion = noise(rng, size, 1.7, low=3, high=40)
    tip = np.clip(1 - 1.2 * near, 0, 1) ** 1.5
    ground = edge(cushion, (-2.5, -1.0, 0.0, 0.6)[variant], 0.5)
    fine = noise(rng, size, 0.8, low=size / 40)
    litter = edge(noise(rng, size, 0.7, low=15, high=60), 2.3, 0.3)
    return Layers(
        mix=np.clip(ground * (0.6 * value + 0.4 * tip) + 0.05 * fine, 0, 1),
        pattern=np.clip(0.95 * (1 - ground) + 0.6 * litter, 0, 1),
        detail=np.clip(0.2 + 0.22 * tip * ground + 0.25 * (1 - ground) + 0.05 * cushion + 0.03 * fine, 0, 1),
        roughness=0.9,
        height=np.clip(0.3 + 0.12 * cushion + 0.3 * tip * ground + 0.02 * fine, 0, 1),
    )


@material_family("straw", tile_m=0.5, relief_m=0.01, colours="cdb26a a5853f 5f4a22")
def straw(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Stalks over each other, combed for variant 1, chopped for 2, pine needles for 3."""
    count, long, width, spread = (
        (1800, 0.3, 0.006, 3.2),
        (2200, 0.5, 0.005, 0.3),
        (4200, 0.08, 0.007, 3.2),
        (3600, 0.12, 0.003, 3.2),
    )[variant]
    outlines = []
    for _ in range(count):
        turn, length = spread * (rng.random() - 0.5), long * rng.uniform(0.5, 1.2)
        half = np.array(((-1, -1), (1, -0.8), (1, 0.8), (-1, 1))) * (
            length / 2,
            width * rng.uniform(0.5, 1.3) / 2,
        )
        outlines.append(turned(half, turn) + rng.random(2))
    index = stack(size, outlines)
    depth, tone = shade(index, np.linspace(0.05, 1, count)), shade(index, rng.random(count))
    fibre = noise(rng, size, 0.7, low=size / 24)
    return Layers(
        mix=tone,
        pattern=0.5 * edge(tone, 0.85, 0.05),
        detail=0.12 + 0.4 * depth + 0.02 * fibre,
        roughness=0.6,
        height=depth,
    )


@material_family(
    "snow",
    tile_m=0.6,
    relief_m=0.009,
    colours=("dfe4eb c7d3e1 f5f5f5", "e3e6ea b9c4d2 8a8074", "e6e9ec d4dde6 a1b7d1", "dfe5ec c2cfdf 5f6f5a"),
)
def snow(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Powder, trodden, wind-carved and thawing snow: soft shades of blue, glints, crumbs."""
    drift = noise(rng, size, 2.0, low=1, high=(20, 60, 14, 40)[variant], stretch=(1, (1, 1, 3, 1)[variant]))
    crumbs = noise(rng, size, 1.0, low=20)
    grain = noise(rng, size, 0.6, low=size / 30)
    bare = edge(drift + 0.3 * crumbs, 1.9, 0.3) * (variant % 2)
    return Layers(
        mix=level(-0.8 * drift - 0.3 * crumbs),
        pattern=np.clip(bare + 0.3 * edge(grain, 2.2, 0.5) * (variant == 0), 0, 1),
        detail=0.49 + 0.015 * grain + 0.02 * crumbs,
        roughness=0.75,
        height=np.clip(0.5 + 0.14 * drift + 0.03 * crumbs + 0.008 * grain, 0, 1),
    )


@material_family(
    "soil",
    tile_m=0.5,
    relief_m=0.012,
    colours=("4a3626 6b5138 1f1610", "6f4a30 946a48 3a2618", "3a3028 54463a 7a6f60", "8a6f4f b09468 5a4630"),
)
def soil(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Clods and crumbs of earth with stones, roots and wet patches; cracked mud for variant 3."""
    clods = noise(rng, size, 1.4, low=4)
    shift = 0.2 * np.stack([noise(rng, size, 1.7, low=6, high=120) for _ in range(2)])
    near, second, value = cells(rng, size, (60, 40, 80, 9)[variant], 0.95, shift)
    crumb = np.sqrt(np.clip(second - near, 0, 1))
    crack = (1 - edge(second - near, 0.05, 0.07)) * (variant == 3)
    wet = edge(noise(rng, size, 1.9), 0.6, 0.6)
    stones = edge(value, 0.93, 0.01) * edge(crumb, 0.4, 0.2) * (variant != 3)
    grain = noise(rng, size, 0.8, low=size / 40)
    return Layers(
        mix=np.clip(level(clods + 0.4 * grain) * 0.8 + 0.2 * value, 0, 1),
        pattern=np.clip(0.8 * crack + 0.7 * stones, 0, 1),
        detail=np.clip(
            0.38 + 0.12 * crumb * (variant != 3) + 0.04 * grain - 0.1 * wet + 0.1 * (variant == 3), 0, 1
        ),
        roughness=0.9 - 0.4 * wet,
        height=np.clip(0.35 + 0.1 * clods + 0.3 * crumb * (1 - crack) + 0.03 * grain - 0.2 * crack, 0, 1),
    )


@material_family("coral", tile_m=0.25, relief_m=0.006)
def coral(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Labyrinths of ridges, like brain coral, zebra skin or fingerprints: one scale, no direction."""
    scale = (24, 36, 54, 16)[variant]
    field = noise(rng, size, 0.0, low=scale * 0.85, high=scale * 1.15)
    bend = noise(rng, size, 1.8, low=2, high=14) * np.float32(0.012)
    field = warp(field, bend, np.roll(bend, size // 3, 1))
    ridge = level(1.6 * field)
    fine = noise(rng, size, 0.8, low=size / 30)
    cloud = noise(rng, size, 1.9)
    return Layers(
        mix=np.clip(0.6 * ridge + 0.3 * level(cloud), 0, 1),
        pattern=0.85 * edge(field, 0.2, (0.3, 0.1, 0.5, 0.08)[variant]) * (variant % 2),
        detail=0.36 + 0.16 * ridge + 0.02 * fine,
        roughness=0.5 + 0.2 * level(cloud),
        height=np.clip(0.1 + 0.75 * ridge + 0.02 * fine, 0, 1),
    )
