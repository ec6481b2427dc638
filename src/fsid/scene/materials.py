"""M: a random baked family, recoloured, with the finish that its part asks for. One draw = one `Material`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache

import numpy as np

from fsid.assets import (
    MATERIAL_VARIANTS,
    material_colours,
    material_families,
    material_layers,
    material_tile_m,
    part_kind,
)
from fsid.assets.file_names import PREFIX
from fsid.scene.choice import log_uniform_rand, pick_rand, share_rand
from fsid.scene.colour import PALETTES, Mood, albedo_rgb, calmed, lab_rand, mood_rand, related_rand
from fsid.scene.config import SceneConfig
from fsid.scene.knobs import Range
from fsid.scene.lobes import lobes_rand
from fsid.scene.model import Material, Vec3
from fsid.scene.pools import OFTEN_PLAIN, POOLS, WITHOUT_ORDER
from fsid.scene.sources import Names, texture_rand
from fsid.scene.vectors import vec3

PLAIN_FAMILY = "paint"

PLAIN = Material(
    family=PLAIN_FAMILY,
    variant=0,
    colours=((0.4, 0.4, 0.4), (0.4, 0.4, 0.4), (0.4, 0.4, 0.4)),
    tile_m=0.8,
    rotation_deg=0.0,
    roughness_scale=1.0,
    relief_scale=1.0,
)
"""The one plain default material of variant v1 ("objects")."""

_CAST_PALETTES = (0.35, 0.3, 0.3, 0.05)
"""Shares of `PALETTES` that the colour of casts comes from."""


def cast_rand(rng: np.random.Generator, config: SceneConfig) -> Material | None:
    """The paint of all objects of a scene, of one colour; None where they have materials of their own."""
    knobs = config.materials
    cast, mood = rng.random() < knobs.cast_share, mood_rand(rng, knobs.calm_share, knobs.variation)
    lab = lab_rand(rng, PALETTES[share_rand(rng, _CAST_PALETTES)], mood)
    colour = vec3(albedo_rgb(lab[None], *knobs.albedo)[0])
    return replace(PLAIN, colours=(colour,) * 3) if cast else None


def material_rand(
    rng: np.random.Generator,
    config: SceneConfig,
    mood: Mood,
    part_name: str,
    pools: Mapping[str, Names],
) -> Material:
    """The material of an object's part; its name may say what it is made of (`fsid.assets.part_kind`).

    pools: kind -> families that such a part has in its own colours; for other kinds anything goes.
    """
    plain, family = rng.random() < config.materials.plain_share, texture_rand(rng, config)
    pool = pools.get(part_kind(part_name) or "", ())
    pool = tuple(name for name in pool if name in (config.material_families or pool))
    if pool and not family.startswith(PREFIX):
        plain, family = False, pick_rand(rng, pool)
    material = _finished_rand(
        rng,
        config,
        mood,
        PLAIN_FAMILY if plain else family,
        config.materials.tile_scale,
        in_nature=bool(pool),
    )
    return lobes_rand(rng, config.materials, material, part_name)


def surface_rand(rng: np.random.Generator, config: SceneConfig, mood: Mood, surface: str) -> Material:
    """The material of a background's part, by its pool."""
    share = config.background.plain_share if surface in OFTEN_PLAIN else config.materials.plain_share
    plain, family = rng.random() < share, texture_rand(rng, config)
    known = config.material_families or material_families()
    pool = tuple(name for name in POOLS[surface] if name in known) or known
    common = pick_rand(rng, pool)
    if rng.random() < config.background.pool_share and not family.startswith(PREFIX):
        family = common
    family = PLAIN_FAMILY if plain else family
    material = _finished_rand(rng, config, mood, family, config.background.tile_scale)
    material = replace(material, patched=family in WITHOUT_ORDER)
    aligned, quarter = rng.random() < config.background.aligned_share, int(rng.integers(4))
    return replace(material, rotation_deg=90.0 * quarter) if aligned else material


def _finished_rand(
    rng: np.random.Generator,
    config: SceneConfig,
    mood: Mood,
    family: str,
    tile_scale: Range,
    *,
    in_nature: bool = False,
) -> Material:
    """`family` in random colours, size and relief. in_nature: always in its own colours, where it has any."""
    knobs = config.materials
    variant = int(rng.integers(MATERIAL_VARIANTS))
    layered, layer = rng.random() < knobs.layer_share, pick_rand(rng, material_layers())
    natural, colours = rng.random() < knobs.natural_share, _colours_rand(rng, config, mood)
    from_file = family.startswith(PREFIX)
    known = _colours_of(family, variant) if natural or in_nature or from_file else None
    own = np.array(known or colours)
    a, b, c = own if from_file else calmed(own, mood.variation)
    return Material(
        family=f"{family}+{layer}" if layered and family != PLAIN_FAMILY else family,
        variant=variant,
        colours=(vec3(a), vec3(b), vec3(c)),
        tile_m=material_tile_m(family) * log_uniform_rand(rng, tile_scale),
        rotation_deg=float(rng.uniform(0, 360)),
        roughness_scale=float(rng.uniform(*knobs.roughness_scale)),
        relief_scale=float(rng.uniform(*knobs.relief_scale)),
    )


def _colours_rand(rng: np.random.Generator, config: SceneConfig, mood: Mood) -> tuple[Vec3, Vec3, Vec3]:
    """A colour, one of the same stuff, and one that stands out."""
    knobs = config.materials
    palette = PALETTES[share_rand(rng, knobs.palette_shares)]
    contrast = float(rng.uniform(*knobs.contrast))
    base = lab_rand(rng, palette, mood)
    related = base + contrast * (related_rand(rng, base) - base)
    chroma = 0.7 * rng.random() ** 3  # texture is light and dark far more than colour (docs/rounds.md)
    apart = (_contrasting_rand(rng, base, palette, mood) - base) * (1.0, chroma, chroma)
    other = base + contrast * apart
    a, b, c = albedo_rgb(np.stack([base, related, other]), *knobs.albedo)
    return vec3(a), vec3(b), vec3(c)


@lru_cache(maxsize=4096)
def _colours_of(family: str, variant: int) -> tuple[Vec3, Vec3, Vec3] | None:
    """The family's own colours, those of a picture for a texture set; None where it has none."""
    own = material_colours(family, variant)
    return None if own is None else (vec3(own[0]), vec3(own[1]), vec3(own[2]))


def _contrasting_rand(rng: np.random.Generator, base: np.ndarray, palette: str, mood: Mood) -> np.ndarray:
    """The more different in lightness of two draws: prints and joints should stand out."""
    draws = [lab_rand(rng, palette, mood) for _ in range(2)]
    return max(draws, key=lambda lab: abs(lab[0] - base[0]))
