"""Paper, cardboard, plastics, hides and other things at hand."""

from __future__ import annotations

import numpy as np

from fsid.assets.material_registry import Layers, material_family
from fsid.assets.patterns import axes, cells, edge, level, noise, scratches


@material_family(
    "paper",
    tile_m=0.3,
    relief_m=0.004,
    colours=("f2eee4 e6dfcf c9bfa8", "d8c6a0 c2ab7d 8a7350", "f2f0eb e7e4dc 788dad", "b5c4a8 9fb090 e8e4d4"),
)
def paper(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Sheets: smooth, kraft, crumpled, hand-made with fibres and petals."""
    fibre = noise(rng, size, 0.7, low=size / 40)
    wave = noise(rng, size, 2.3)
    strands = scratches(rng, size, (60, 300, 40, 700)[variant], 0.02)
    crumple = np.zeros((size, size), np.float32)
    for count, weight in ((5, 1.0), (13, 0.5), (31, 0.2)):
        near, second, value = cells(rng, size, count, 0.95)
        crumple += weight * (near - 0.5 * second + (value - 0.5) * (second - near))
    crumple = (crumple - crumple.mean()) / crumple.std() * (0.1, 0.2, 1.0, 0.2)[variant]
    specks = edge(noise(rng, size, 0.8, low=20, high=90), (9, 2.6, 9, 2.2)[variant], 0.4)
    return Layers(
        mix=np.clip(0.5 * level(wave) + 0.3 * strands, 0, 1),
        pattern=np.clip(0.7 * specks + 0.25 * strands * (variant == 3), 0, 1),
        detail=0.5 + 0.01 * fibre + 0.01 * wave + 0.012 * crumple,
        roughness=0.8,
        height=np.clip(0.5 + 0.13 * crumple + 0.05 * wave + 0.006 * fibre, 0, 1),
    )


@material_family("cardboard", tile_m=0.4, relief_m=0.0012, colours="c19a6b a67f52 6b4a2c")
def cardboard(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Boxes: flutes shining through, dents, tape; open corrugation for 2, edges for 3."""
    u, v = axes(size)
    flutes = (60, 60, 40, 24)[variant]
    wave = 0.5 + 0.5 * np.cos(2 * np.pi * flutes * (u + 0 * v))
    fibre = noise(rng, size, 0.9, low=size / 50, stretch=(1, 2))
    dents = noise(rng, size, 1.8, low=2, high=40)
    specks = edge(noise(rng, size, 0.7, low=40, high=160), 2.2, 0.6)
    tape = edge(0.07 - np.abs(v - 0.5 + 0 * u), 0, 0.003) * (variant == 1)
    if variant == 3:
        ply = np.abs((v * 16) % 1 - 0.5)
        line = np.exp(-(((v * 16 % 1 - 0.5 - 0.3 * np.cos(2 * np.pi * flutes * u)) / 0.09) ** 2))
        solid = np.maximum(edge(ply, 0.42, 0.05), line)
        relief, shade = 0.1 + 0.8 * solid, 0.1 + 0.4 * solid
    else:
        relief = 0.5 + (0.06, 0.06, 0.4, 0)[variant] * (wave - 0.5) + 0.08 * dents
        shade = 0.48 + (0.02, 0.02, 0.12, 0)[variant] * (wave - 0.5)
    return Layers(
        mix=np.clip(0.4 * level(dents) + 0.1 * level(fibre) + 0.15 * wave * (variant < 2), 0, 1),
        pattern=np.clip(0.35 * specks, 0, 1) * (1 - tape),
        detail=np.clip(shade + 0.018 * fibre + 0.03 * tape, 0, 1),
        roughness=0.85 - 0.55 * tape,
        height=np.clip(relief + 0.012 * fibre + 0.05 * tape, 0, 1),
    )


@material_family("glossy_plastic", tile_m=0.3, relief_m=0.0006)
def glossy_plastic(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Polished mouldings: orange peel, swirls of colour, seams and hair scratches; two colours for 3."""
    wave = noise(rng, size, 1.6, low=4, high=30)
    swirl = noise(rng, size, 2.2, low=1, high=12)
    hair = scratches(rng, size, (30, 200, 80, 120)[variant], 0.05)
    marbled = level(np.sin(4 * swirl + wave * 0.3) * 1.5, (1.0, 1.0, 0.6, 0.15)[variant])
    _, v = axes(size)
    seam = np.exp(-((((v * 2) % 1 - 0.5) / 0.006) ** 2)) * (variant % 2)
    return Layers(
        mix=np.clip((0.15, 0.3, 0.9, 0.5)[variant] * marbled, 0, 1),
        pattern=0.9 * marbled * (variant == 3),
        detail=0.5 + 0.008 * swirl + 0.03 * hair - 0.05 * seam,
        roughness=0.1 + 0.15 * hair + 0.03 * level(swirl),
        height=np.clip(0.5 + 0.1 * wave - 0.05 * hair + 0.3 * seam, 0, 1),
    )


@material_family("translucent_plastic", tile_m=0.2, relief_m=0.0012)
def translucent_plastic(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Milky or tinted: light spreads inside, so edges are soft; bubbles, ribs, bubble wrap."""
    glow = noise(rng, size, 2.4, high=(8, 14, 6, 20)[variant])
    near, _, value = cells(rng, size, (14, 30, 10, 22)[variant], 0.9 if variant < 3 else 0.0)
    bubble = np.clip(1 - (near / (0.1 + 0.15 * value if variant < 3 else 0.44)) ** 2, 0, 1)
    dome = np.sqrt(bubble) * (1.0 if variant == 3 else (value > 0.6))
    u, v = axes(size)
    rib = (0.5 + 0.5 * np.cos(2 * np.pi * 24 * u + 0 * v)) * (variant == 2)
    haze = noise(rng, size, 1.7, high=60)
    return Layers(
        mix=level(glow + 0.2 * haze),
        pattern=np.clip(0.25 * dome + 0.2 * edge(glow, 0.8, 2.0), 0, 1),
        detail=np.clip(0.44 + 0.03 * glow + 0.08 * dome**3 + 0.05 * rib, 0, 1),
        roughness=0.22 + 0.08 * level(haze),
        height=np.clip(0.2 + 0.55 * dome + 0.4 * rib + 0.03 * haze, 0, 1),
    )


@material_family("foam", tile_m=0.2, relief_m=0.0015)
def foam(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Sponge with open pores, beads of polystyrene, upholstery foam, soap froth."""
    depth = np.zeros((size, size), np.float32)
    tone = np.zeros_like(depth)
    for count in ((20, 50, 120), (40, 40, 40), (70, 140, 200), (12, 30, 80))[variant]:
        near, second, value = cells(rng, size, count, 0.9)
        hole = edge(0.16 + 0.3 * value - near, 0, 0.12) * (value > 0.45)
        bead = np.sqrt(np.clip((second - near) * 1.5, 0, 1))
        depth = np.maximum(depth, bead if variant % 2 else hole)
        tone = np.maximum(tone, value * (bead if variant % 2 else hole))
    soft = noise(rng, size, 1.6)
    sign = 1.0 if variant % 2 else -1.0
    return Layers(
        mix=np.clip(0.4 * level(soft) + 0.4 * tone, 0, 1),
        pattern=0.2 * depth * (variant == 0),
        detail=np.clip(0.45 + sign * (0.1 if variant % 2 else 0.22) * (depth - 0.4) + 0.015 * soft, 0, 1),
        roughness=(0.9, 0.5, 0.9, 0.2)[variant],
        height=np.clip(0.5 + sign * 0.45 * (depth - 0.5) + 0.03 * soft, 0, 1),
    )


@material_family("suede", tile_m=0.4, relief_m=0.0008, colours="a87a4f 8a5f38 c9a67a")
def suede(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Napped hide: brushed strokes in two shades, scuffs, perforations for odd variants."""
    strokes = noise(rng, size, 1.4, low=3, high=90, stretch=(2, 1))
    nap = noise(rng, size, 0.9, low=size / 60)
    scuff = edge(noise(rng, size, 1.6, low=2), (1.6, 1.2, 2.2, 1.8)[variant], 0.8)
    u, v = axes(size)
    x, y = (u * 40) % 1 - 0.5, (v * 40 + 0.5 * (np.floor(u * 40) % 2)) % 1 - 0.5
    hole = (1 - edge(np.hypot(x, y), 0.17, 0.08)) * (variant % 2)
    return Layers(
        mix=level(strokes + 0.25 * nap, 0.7),
        pattern=0.5 * scuff,
        detail=np.clip(0.5 + 0.02 * nap + 0.03 * strokes - 0.38 * hole, 0, 1),
        roughness=0.95,
        height=np.clip(0.6 + 0.05 * strokes + 0.04 * nap - 0.5 * hole, 0, 1),
    )


@material_family(
    "reptile",
    tile_m=0.3,
    relief_m=0.002,
    colours=("8a7a4a 5f5230 2a2418", "6f3a2a 94583f 2f1812", "5a6b3f 7f9158 262e1c", "c9bfa8 8f8570 3a342a"),
)
def reptile(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Snake and crocodile: scales that grow and shrink, with saddles and diamonds."""
    u, v = axes(size)
    bend = np.stack([noise(rng, size, 2.2, low=1, high=6) for _ in range(2)]) * np.float32(0.5)
    count = (40, 16, 56, 24)[variant]
    near, second, value = cells(rng, size, count, (0.12, 0.55, 0.1, 0.5)[variant], bend)
    scale = edge(second - near, 0.12, 0.16)
    dome = np.sqrt(np.clip(second - near, 0, 1))
    k = (3, 2, 4, 3)[variant]
    saddle = np.cos(2 * np.pi * k * u + bend[0]) * np.cos(2 * np.pi * k * v + bend[1])
    marks = edge(saddle + 0.25 * (value - 0.5), 0.25, 0.12)
    rim = np.exp(-(((saddle - 0.25) / 0.06) ** 2))
    return Layers(
        mix=np.clip(0.6 * marks + 0.35 * value, 0, 1),
        pattern=np.clip(0.75 * rim + 0.6 * (1 - scale), 0, 1),
        detail=np.clip(0.36 + 0.16 * dome + 0.05 * (value - 0.5), 0, 1),
        roughness=0.3 + 0.3 * (1 - scale),
        height=np.clip(0.1 + 0.8 * dome, 0, 1),
    )
