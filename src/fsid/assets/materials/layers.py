"""Layers over any material: dust, dirt, stains, wear, scratches, wetness, cracks, splashes, fingerprints.

Where a layer lies follows the relief below it: dust and dirt settle in what is low, wear takes what is high.
A material has three colours and no fourth for a layer: a veil is drawn as their mean (its masks drift to
their averages), soil as less light, splashes as colour_c.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fsid.assets.maps import MaterialMaps
from fsid.assets.material_registry import material_layer
from fsid.assets.patterns import cells, edge, level, noise, scratches

_F = np.float32


def _clip(field: np.ndarray) -> np.ndarray:
    return np.clip(field, 0, 1).astype(np.float32)


def _towards(field: np.ndarray, value: np.ndarray | float, share: np.ndarray) -> np.ndarray:
    return _clip(field + (value - field) * share)


def _low(maps: MaterialMaps) -> np.ndarray:
    """0..1, rank-like depth below the mean height."""
    height = maps.height - maps.height.mean()
    return level(-height / (height.std() + _F(1e-3)))


@material_layer("dust")
def dust(rng: np.random.Generator, variant: int, maps: MaterialMaps) -> MaterialMaps:
    """A pale veil that hides contrast and gloss, thicker in what is low, with specks and wiped strokes."""
    size = len(maps.height)
    cloud = noise(rng, size, 1.7)
    wiped = level(noise(rng, size, 1.4, low=2, high=60, stretch=(5, 1)), 0.7)
    film = level(cloud + 0.8 * (_low(maps) - 0.5), 0.9) * (1 - 0.7 * wiped)
    specks = edge(noise(rng, size, 0.6, low=size / 30, high=size / 5), 2.4, 0.6)
    share = _clip((0.25, 0.45, 0.65, 0.8)[variant] * film + 0.5 * specks)
    pale = min(float(maps.detail.mean()) * 1.25, 0.62)
    return replace(
        maps,
        mix=_towards(maps.mix, float(maps.mix.mean()), share),
        pattern=_towards(maps.pattern, float(maps.pattern.mean()), share),
        detail=_towards(maps.detail, pale, share),
        roughness=_towards(maps.roughness, 0.95, share),
        metallic=_towards(maps.metallic, 0.0, 0.8 * share),
    )


@material_layer("dirt")
def dirt(rng: np.random.Generator, variant: int, maps: MaterialMaps) -> MaterialMaps:
    """Dark grime in cavities and patches, run down along v, with crumbs."""
    size = len(maps.height)
    patch = noise(rng, size, 1.6) + 0.7 * noise(rng, size, 1.2, low=3, stretch=(1, 7))
    crumbs = edge(noise(rng, size, 0.7, low=size / 40, high=size / 6), 2.2, 0.7)
    share = _clip(
        edge(patch + 1.6 * (_low(maps) - 0.5), (1.0, 0.6, 0.2, -0.2)[variant], 1.8) * 0.85 + 0.6 * crumbs
    )
    return replace(
        maps,
        detail=_clip(maps.detail * (1 - (0.5, 0.55, 0.65, 0.75)[variant] * share)),
        roughness=_towards(maps.roughness, 0.9, 0.8 * share),
        metallic=_towards(maps.metallic, 0.0, 0.7 * share),
        height=_clip(maps.height + 0.05 * crumbs),
    )


@material_layer("stains")
def stains(rng: np.random.Generator, variant: int, maps: MaterialMaps) -> MaterialMaps:
    """Dried drops and rings: a dark rim, a paler inside, satellites around."""
    size = len(maps.height)
    count = (3, 5, 8, 12)[variant]
    shift = 0.2 * np.stack([noise(rng, size, 2.0, low=2, high=80) for _ in range(2)])
    dark = np.zeros((size, size), np.float32)
    for number, strength in ((count, 1.0), (count * 3, 0.7)):
        near, _, value = cells(rng, size, number, 0.8, shift)
        radius = 0.12 + 0.3 * value
        rim = np.exp(-(((near - radius) / 0.03) ** 2))
        dark = np.maximum(dark, strength * (value > 0.45) * (0.35 * (near < radius) + 0.65 * rim))
    tint = level(noise(rng, size, 1.8))
    return replace(
        maps,
        mix=_towards(maps.mix, tint, 0.3 * dark),
        detail=_clip(maps.detail * (1 - 0.55 * dark * (0.6 + 0.4 * tint))),
        roughness=_clip(maps.roughness * (1 - 0.25 * dark)),
    )


@material_layer("wear")
def wear(rng: np.random.Generator, variant: int, maps: MaterialMaps) -> MaterialMaps:
    """Rubbed off where it is high: paler, smoother, the pattern faded, frayed borders."""
    size = len(maps.height)
    rubbed = noise(rng, size, 1.8) + 0.35 * noise(rng, size, 0.8, low=20, high=size / 4)
    share = edge(rubbed - 1.2 * (_low(maps) - 0.5), (1.3, 0.9, 0.5, 0.1)[variant], 0.5)
    return replace(
        maps,
        mix=_towards(maps.mix, 1.0, 0.5 * share),
        pattern=_clip(maps.pattern * (1 - 0.75 * share)),
        detail=_towards(maps.detail, min(float(maps.detail.mean()) * 1.2, 0.6), 0.55 * share),
        roughness=_towards(maps.roughness, 0.45, 0.5 * share),
        height=_clip(maps.height - 0.08 * share),
    )


@material_layer("scratches")
def scratched(rng: np.random.Generator, variant: int, maps: MaterialMaps) -> MaterialMaps:
    """Hair lines and a few deep ones, paler than what they cut."""
    size = len(maps.height)
    hair = scratches(rng, size, (150, 400, 900, 1600)[variant], 0.05)
    deep = scratches(rng, size, (6, 12, 25, 40)[variant], 0.2)
    both = np.maximum(0.5 * hair, deep)
    return replace(
        maps,
        detail=_clip(maps.detail * (1 + 0.7 * hair - 0.5 * deep) + 0.06 * hair),
        roughness=_towards(maps.roughness, 0.6, 0.5 * both),
        height=_clip(maps.height - 0.15 * both),
    )


@material_layer("wet")
def wet(rng: np.random.Generator, variant: int, maps: MaterialMaps) -> MaterialMaps:
    """Rain: darker and glossy where porous, puddles that level the relief, drops with round tops."""
    size = len(maps.height)
    water = edge(noise(rng, size, 2.0) + 1.2 * (_low(maps) - 0.5), (1.2, 0.7, 0.1, -0.4)[variant], 0.35)
    near, _, value = cells(rng, size, (40, 60, 30, 80)[variant], 0.9)
    dome = np.sqrt(np.clip(1 - (near / (0.12 + 0.25 * value)) ** 2, 0, 1)) * (value > 0.5) * (1 - water)
    film = _clip(np.maximum(water, dome))
    return replace(
        maps,
        detail=_clip(maps.detail * (1 - 0.4 * film)),
        roughness=_towards(maps.roughness, 0.08, 0.9 * film),
        height=_clip(_towards(maps.height, float(np.quantile(maps.height, 0.6)), 0.9 * water) + 0.12 * dome),
    )


@material_layer("cracks")
def cracks(rng: np.random.Generator, variant: int, maps: MaterialMaps) -> MaterialMaps:
    """Craquelure: a net of branching dark cracks, of two scales, broken here and there."""
    size = len(maps.height)
    shift = 0.25 * np.stack([noise(rng, size, 1.8, low=2, high=100) for _ in range(2)])
    gate = edge(noise(rng, size, 1.8), (0.9, 0.4, -0.1, -0.8)[variant], 0.6)
    dark = np.zeros((size, size), np.float32)
    for count, width, strength in ((8 + 4 * variant, 0.03, 1.0), (30 + 10 * variant, 0.07, 0.6)):
        near, second, _ = cells(rng, size, count, 0.95, shift * count / 12)
        dark = np.maximum(dark, strength * (1 - edge(second - near, width, width)))
    dark *= gate
    return replace(
        maps,
        detail=_clip(maps.detail * (1 - 0.7 * dark)),
        roughness=_towards(maps.roughness, 0.9, dark),
        height=_clip(maps.height - 0.25 * dark),
    )


@material_layer("splashes")
def splashes(rng: np.random.Generator, variant: int, maps: MaterialMaps) -> MaterialMaps:
    """Drops and runs of another paint, from mist to blots."""
    size = len(maps.height)
    cover = np.zeros((size, size), np.float32)
    for count, radius in (((60, 0.2), (24, 0.22), (8, 0.25)), ((24, 0.3), (6, 0.3), (4, 0.3)))[variant % 2]:
        shift = 0.12 * np.stack([noise(rng, size, 2.0, low=count / 3, high=count) for _ in range(2)])
        near, _, value = cells(rng, size, count, 0.9, shift)
        keep = value > (0.75, 0.7, 0.55, 0.5)[variant]
        cover = np.maximum(cover, keep * edge(radius * value - near, 0, 3 * count / size))
    return replace(
        maps,
        pattern=_towards(maps.pattern, 1.0, 0.95 * cover),
        detail=_towards(maps.detail, 0.5, 0.9 * cover),
        roughness=_towards(maps.roughness, (0.3, 0.5, 0.2, 0.7)[variant], cover),
        metallic=_towards(maps.metallic, 0.0, cover),
        height=_clip(maps.height + 0.06 * cover),
    )


@material_layer("fingerprints")
def fingerprints(rng: np.random.Generator, variant: int, maps: MaterialMaps) -> MaterialMaps:
    """Greasy prints with ridges and smears: nearly only gloss."""
    size = len(maps.height)
    near, _, value = cells(rng, size, (4, 6, 8, 5)[variant], 0.7)
    whorl = 0.4 * noise(rng, size, 2.0, low=2, high=20)
    ridges = 0.5 + 0.5 * np.cos(2 * np.pi * (near * 30 + whorl))
    touched = edge(0.32 - near, 0, 0.15) * (value > (0.7, 0.5, 0.3, 0.1)[variant])
    smear = edge(noise(rng, size, 1.6, low=2, stretch=(1, 4)), 0.8, 1.0)
    grease = _clip(touched * (0.3 + 0.7 * ridges) + 0.4 * smear)
    return replace(
        maps,
        detail=_clip(maps.detail * (1 - 0.08 * grease)),
        roughness=_towards(maps.roughness, 0.42, 0.6 * grease),
    )
