"""M: a random baked family, recoloured. One draw = one `Material`."""

from __future__ import annotations

import numpy as np

from fsid.assets import MATERIAL_VARIANTS, material_families, material_tile_m
from fsid.scene.colour import PALETTES, albedo_rgb, lab_rand, related_rand
from fsid.scene.config import Range, SceneConfig
from fsid.scene.model import Material, Vec3

PLAIN = Material(
    family="paint",
    variant=0,
    colours=((0.4, 0.4, 0.4), (0.4, 0.4, 0.4), (0.4, 0.4, 0.4)),
    tile_m=0.8,
    rotation_deg=0.0,
    roughness_scale=1.0,
    relief_scale=1.0,
)
"""The one plain default material of variant v1 ("objects")."""


def log_uniform_rand(rng: np.random.Generator, limits: Range) -> float:
    """A number whose logarithm is uniform between the two positive limits."""
    return float(np.exp(rng.uniform(*np.log(limits))))


def material_rand(rng: np.random.Generator, config: SceneConfig, scene_hue_deg: float) -> Material:
    """One material; `scene_hue_deg` (CIELAB) is the hue that the harmonised palette keeps to."""
    plain = rng.random() < config.plain_share
    family = "paint" if plain else str(rng.choice(config.material_families or material_families()))
    palette = str(rng.choice(PALETTES, p=config.palette_shares))
    base = lab_rand(rng, palette, scene_hue_deg)
    contrast = _contrasting_rand(rng, base, palette, scene_hue_deg)
    return Material(
        family=family,
        variant=int(rng.integers(MATERIAL_VARIANTS)),
        colours=(
            _albedo(base, config),
            _albedo(related_rand(rng, base), config),
            _albedo(contrast, config),
        ),
        tile_m=material_tile_m(family) * log_uniform_rand(rng, config.tile_scale),
        rotation_deg=float(rng.uniform(0, 360)),
        roughness_scale=float(rng.uniform(*config.roughness_scale)),
        relief_scale=float(rng.uniform(*config.relief_scale)),
    )


def _contrasting_rand(rng: np.random.Generator, base: np.ndarray, palette: str, hue: float) -> np.ndarray:
    """The most different in lightness of three draws: prints and joints should stand out."""
    draws = [lab_rand(rng, palette, hue) for _ in range(3)]
    return max(draws, key=lambda lab: abs(lab[0] - base[0]))


def _albedo(lab: np.ndarray, config: SceneConfig) -> Vec3:
    r, g, b = (float(c) for c in albedo_rgb(lab, *config.albedo))
    return (r, g, b)
