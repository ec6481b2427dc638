"""Smooth colour: skies, gradients, things out of focus, shadows of leaves, skin. What noise hurts most.

Where an image has no edges, a denoiser has only low frequencies and colour to go by; these families have
little else, so that it learns to keep them.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from fsid.assets.material_registry import Layers, material_family, pictured
from fsid.assets.patterns import axes, cells, edge, level, noise, shade, stack, warp
from fsid.assets.pictures import hue_rand, picture_rand


@material_family(
    "sky",
    tile_m=3.0,
    relief_m=0.0005,
    colours=(
        "3f6fb5 9dbfe2 f4f5f7",
        "28406e e8945a f7d9a0",
        "8a97a6 b4bcc6 e9ebee",
        "12204a 3d5c96 c3a5b8",
    ),
)
def sky(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Painted sky: a gradient with cumulus, evening streaks, overcast, thin veils."""
    _, v = axes(size)
    height = 0.5 - 0.5 * np.cos(2 * np.pi * v)
    billow = noise(
        rng, size, (1.6, 1.7, 1.9, 1.5)[variant], stretch=((1, 1.5), (5, 1), (2, 1), (3, 1))[variant]
    )
    haze = noise(rng, size, 2.4)
    body = edge(billow, (0.6, 0.5, -0.3, 0.9)[variant], (1.2, 2.0, 2.5, 2.2)[variant])
    lit = np.roll(billow, size // 40, axis=0) - billow
    return Layers(
        mix=np.clip(height + 0.12 * haze, 0, 1),
        pattern=np.clip((0.9, 0.7, 0.8, 0.5)[variant] * body, 0, 1),
        detail=0.48 + 0.05 * body * np.clip(lit, -1.5, 1.5) + 0.012 * haze,
        roughness=0.9,
    )


@material_family("gradient", tile_m=1.0, relief_m=0.0002)
def gradient(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Nothing but slow transitions: waves, soft clouds, folds of light."""
    u, v = axes(size)
    slow, other = (noise(rng, size, 3.0, high=(3, 6, 10, 20)[variant]) for _ in range(2))
    k = int(rng.integers(1, 3))
    wave = np.sin(2 * np.pi * (k * u + int(rng.integers(-2, 3)) * v + 0.2 * slow))
    fields = (
        (level(slow), 0.5 + 0.5 * wave),
        (0.5 + 0.5 * wave, level(other)),
        (level(slow), level(other)),
        (level(np.sin(3 * slow) * 1.5), level(other)),
    )[variant]
    return Layers(
        mix=fields[0],
        pattern=0.8 * fields[1],
        detail=0.45 + 0.1 * np.tanh(other),
        roughness=(0.6, 0.3, 0.8, 0.2)[variant],
    )


@material_family("bokeh", tile_m=0.6, relief_m=0.0002, colours="picture")
def bokeh(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Lights out of focus: overlapping transparent discs of many hues over a blurred ground."""
    u, v = axes(size)
    ground = hue_rand(rng, 0.6, 0.25) + 0.12 * np.stack(
        [noise(rng, size, 2.4, high=8) for _ in range(3)], axis=-1
    ) * hue_rand(rng, 0.4, 0.8)
    rgb = np.clip(ground, 0.01, 1)
    for _ in range((35, 60, 100, 25)[variant]):
        radius = rng.uniform(0.02, (0.1, 0.07, 0.05, 0.14)[variant])
        dx = (u - rng.random() + 0.5) % 1 - 0.5
        dy = (v - rng.random() + 0.5) % 1 - 0.5
        cols = np.flatnonzero(np.abs(dx[0]) < radius * 1.3)
        rows = np.flatnonzero(np.abs(dy[:, 0]) < radius * 1.3)
        r = np.hypot(dx[:, cols], dy[rows]) / radius
        disc = edge(1 - r, 0, 0.15) * (0.65 + 0.35 * edge(r, 0.85, 0.2))
        light = hue_rand(rng, rng.uniform(0.1, 0.9), rng.uniform(0.3, 1.0)) * rng.uniform(0.2, 0.8)
        window = np.ix_(rows, cols)
        rgb[window] = 1 - (1 - rgb[window]) * (1 - disc[..., None] * light)
    layers = pictured(np.clip(rgb, 0, 1))
    return layers._replace(roughness=(0.5, 0.7, 0.3, 0.6)[variant])


@material_family("blurred_scene", tile_m=0.8, relief_m=0.0002, colours="picture")
def blurred_scene(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """A picture as a lens shows it out of focus; sharp only in one band for variant 3."""
    kind = ("landscape", "blossoms", "still life", "streets")[variant]
    quarter = picture_rand(rng, size // 4, size // 4, kind)
    half = np.concatenate([quarter, quarter[:, ::-1]], axis=1)
    picture = np.concatenate([half, half[::-1]])
    near, far = (
        np.stack([gaussian_filter(picture[..., k], s * size / 512, mode="wrap") for k in range(3)], axis=-1)
        for s in (3, 12)
    )
    _, v = axes(size // 2)
    share = (0.5 + 0.5 * np.cos(4 * np.pi * v))[..., None] if variant == 3 else 0.3
    blurred = near * share + far * (1 - share)
    spectrum = [_doubled(blurred[..., k]) for k in range(3)]
    layers = pictured(np.clip(np.stack(spectrum, axis=-1), 0, 1))
    return layers._replace(roughness=(0.6, 0.4, 0.5, 0.7)[variant])


def _doubled(field: np.ndarray) -> np.ndarray:
    """(S, S) to (2 S, 2 S), bilinear and periodic."""
    out = np.repeat(np.repeat(field, 2, axis=0), 2, axis=1)
    for axis in (0, 1):
        out = (np.roll(out, 1, axis) + 2 * out + np.roll(out, -1, axis)) / 4
    return out


@material_family("dappled_light", tile_m=1.5, relief_m=0.0005)
def dappled_light(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Shadows of leaves and bars on a pale wall: penumbras of several widths."""
    count = (45, 70, 30, 110)[variant]
    outlines = []
    t = np.linspace(0, 2 * np.pi, 14)
    for _ in range(count):
        long, turn = rng.uniform(0.03, 0.13), rng.uniform(0, 2 * np.pi)
        x, y = long * np.cos(t), long * rng.uniform(0.25, 0.5) * np.sin(t)
        c, s = np.cos(turn), np.sin(turn)
        outlines.append(np.c_[c * x - s * y, s * x + c * y] + rng.random(2))
    sharp = shade(stack(size // 2, outlines), np.ones(count))
    light = np.ones_like(sharp)
    for sigma in (2.0, 5.0, 11.0):
        moved = np.roll(sharp, rng.integers(0, size, 2), (0, 1))
        light = light * (1 - 0.45 * gaussian_filter(moved, sigma * size / 512, mode="wrap"))
    light, haze = _doubled(light), noise(rng, size, 2.2)
    return Layers(
        mix=level(haze),
        pattern=0.5 * (1 - light),
        detail=0.12 + 0.4 * light + 0.008 * haze,
        roughness=0.85,
        height=0.5 + 0.05 * noise(rng, size, 1.0, low=20, high=size / 8),
    )


@material_family(
    "skin",
    tile_m=0.12,
    relief_m=0.00018,
    colours=(
        "e0b094 c98a6e a8503f",
        "8f5f43 6e4530 4a2a1e",
        "f0cdb8 dba68e c56a5c",
        "5a3a2a 41281c 2a1610",
    ),
)
def skin(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Skin-like: slow blood mottling, fine creases in a net, pores, freckles. Smooth above all."""
    mottle = noise(rng, size, 2.2, low=1, high=40)
    flush = noise(rng, size, 1.6, low=8, high=60)
    shift = 0.35 * np.stack([noise(rng, size, 1.6, low=4, high=120) for _ in range(2)])
    near, second, _ = cells(rng, size, (90, 70, 110, 60)[variant], 0.95, shift)
    crease = 1 - edge(second - near, 0.1, 0.25)
    freckles = edge(noise(rng, size, 0.9, low=15, high=70), (2.0, 3.2, 1.6, 3.2)[variant], 0.7)
    pores = edge(noise(rng, size, 0.5, low=60, high=110), 2.1, 0.8)
    return Layers(
        mix=level(0.9 * mottle + 0.2 * flush),
        pattern=np.clip(0.15 * level(flush - 0.8, 0.8) + 0.4 * freckles, 0, 1),
        detail=0.5 + 0.02 * mottle - 0.025 * crease - 0.05 * pores,
        roughness=0.5 + 0.05 * flush + 0.08 * crease,
        height=np.clip(0.7 - 0.3 * crease - 0.25 * pores + 0.04 * mottle, 0, 1),
    )


@material_family(
    "water",
    tile_m=1.5,
    relief_m=0.03,
    colours=(
        "2f5d6b 4f8a8f 9fd0cc",
        "14303c 28556a 5f8fa0",
        "5b7f74 86a795 cfdccb",
        "0f2027 1f3d4a 3f6a7a",
    ),
)
def water(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Ripples that steepen at their crests, with a bottom seen through them in a net of light."""
    across = (1, 2, 1, 3)[variant]
    waves = np.zeros((size, size), np.float32)
    for f in (3, 7, 15, 33):
        waves += noise(rng, size, 1.0, low=f, high=2 * f, stretch=(1, across)) / np.float32(f**0.8)
    waves /= np.float32(np.std(waves))
    crest = np.exp(0.6 * waves)
    crest = crest / crest.max()
    bend = noise(rng, size, 1.8, low=3, high=14)
    caustic = np.exp(-np.abs(warp(bend, 0.02 * waves, 0.02 * np.roll(waves, size // 3, 0))) / 0.12)
    return Layers(
        mix=level(noise(rng, size, 2.2)),
        pattern=np.clip(0.55 * caustic * (variant != 3), 0, 1),
        detail=0.45 + 0.04 * np.clip(waves, -3, 3),
        roughness=0.06,
        height=np.clip(crest, 0, 1),
    )
