"""Metals: brushed, scratched, rusted, hammered."""

from __future__ import annotations

import numpy as np

from fsid.assets.material_registry import Layers, material_family
from fsid.assets.patterns import cells, edge, level, noise, scratches


@material_family("brushed_metal", tile_m=0.3, relief_m=0.0002)
def brushed_metal(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Fine parallel brush lines along u, shorter with the variant, and fingerprints of wear."""
    lines = noise(rng, size, 0.3, low=8, stretch=((60, 30, 15, 120)[variant], 1))
    smears = noise(rng, size, 1.8, high=30)
    deep = scratches(rng, size, 150, 0.08, spread_deg=25)
    return Layers(
        mix=0.35 * level(smears),
        pattern=0.3 * deep,
        detail=0.5 + 0.05 * lines + 0.12 * deep,
        roughness=0.32 + 0.05 * lines + 0.08 * level(smears) + 0.15 * deep,
        height=0.5 + 0.16 * lines - 0.3 * deep,
        metallic=1.0,
    )


@material_family("scratched_metal", tile_m=0.4, relief_m=0.0005)
def scratched_metal(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Painted or bare sheet with hair scratches in all directions and chipped spots."""
    hair = scratches(rng, size, (500, 900, 1400, 700)[variant], 0.06)
    wear = noise(rng, size, 1.7, low=2)
    chips = edge(wear + 0.35 * noise(rng, size, 0.6, low=40), (1.4, 1.1, 0.8, 2.0)[variant], 0.08)
    bare = np.maximum(chips, 0.7 * hair)
    painted = variant < 3
    return Layers(
        mix=0.4 * level(wear),
        pattern=bare if painted else 0.4 * hair,
        detail=0.5 + 0.03 * wear + 0.1 * hair * (1 if painted else -1),
        roughness=0.3 + 0.08 * level(wear) + 0.2 * hair + 0.15 * chips,
        height=0.8 - 0.6 * chips - 0.4 * hair,
        metallic=bare if painted else 1.0,
    )


@material_family("rusty_metal", tile_m=0.6, relief_m=0.002, colours="8a8d90 a8572a 6b2f16")
def rusty_metal(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Rust that eats from blotches into metal, with runs along v and flaking grains of a few texels."""
    grains = noise(rng, size, 0.5, low=size / 20)
    blotch = noise(rng, size, 1.5, low=2) + 0.6 * noise(rng, size, 1.2, low=6, stretch=(1, 8))
    rust = edge(blotch + 0.3 * grains, (1.2, 0.6, 0.0, -0.6)[variant], 1.2)
    tone = level(0.5 * grains + noise(rng, size, 1.2, low=6))
    pits = edge(noise(rng, size, 0.4, low=size / 40, high=size / 10), 1.8, 0.6) * rust
    return Layers(
        mix=np.where(rust > 0.5, tone, 0.3 * level(blotch)),
        pattern=rust * (0.35 + 0.6 * tone),
        detail=0.5 + 0.02 * grains + rust * 0.09 * grains - 0.15 * pits,
        roughness=0.35 + 0.5 * rust + 0.04 * grains,
        height=0.4 + rust * (0.3 + 0.09 * grains) - 0.3 * pits,
        metallic=1 - rust,
    )


@material_family("hammered_metal", tile_m=0.25, relief_m=0.0022)
def hammered_metal(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Overlapping round dents of a hammer, tarnished where they meet."""
    shift = 0.05 * np.stack([noise(rng, size, 1.8, low=2, high=20) for _ in range(2)])
    near, second, value = cells(rng, size, (10, 16, 24, 7)[variant], 0.75, shift)
    dent = np.clip(near**2 + 0.25 * value * (second - near), 0, 1)
    skin = noise(rng, size, 0.9, low=size / 50)
    tarnish = noise(rng, size, 1.7) - 3.0 * (second - near) + 0.6
    return Layers(
        mix=np.clip(0.35 * level(noise(rng, size, 1.9)) + 0.2 * dent, 0, 1),
        pattern=np.clip((0.25, 0.45, 0.35, 0.6)[variant] * edge(tarnish, 0.9, 1.6), 0, 1),
        detail=0.5 + 0.012 * skin,
        roughness=(0.2, 0.28, 0.33, 0.4)[variant] + 0.02 * skin + 0.1 * level(tarnish),
        height=np.clip(0.1 + dent + 0.012 * skin, 0, 1),
        metallic=1.0,
    )
