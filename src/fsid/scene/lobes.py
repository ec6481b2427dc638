"""What a part's kind adds to its material: glass lets light through, cloth has a fuzz, a screen shines.

The kinds are the vocabulary of `fsid.assets.part_kind`; what is not named keeps the plain surface model.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fsid.assets import part_kind
from fsid.scene.choice import log_uniform_rand
from fsid.scene.config import MaterialConfig
from fsid.scene.knobs import Range
from fsid.scene.model import Material, Vec3

LOBES: dict[str, dict[str, Range]] = {
    "glass": {"transmission": (0.7, 1.0)},
    "liquid": {"transmission": (0.5, 1.0)},
    "screen": {"clearcoat": (0.5, 1.0)},
    "shade": {"translucency": (0.3, 0.7)},
    "leaf": {"translucency": (0.15, 0.5), "clearcoat": (0.0, 0.5)},
    "petal": {"translucency": (0.3, 0.6)},
    "paper": {"translucency": (0.05, 0.25)},
    "cloth": {"sheen": (0.2, 1.0)},
    "yarn": {"sheen": (0.3, 1.0)},
    "leather": {"clearcoat": (0.05, 0.4)},
    "wood": {"clearcoat": (0.1, 0.9)},
    "ceramic": {"clearcoat": (0.6, 1.0)},
    "plastic": {"clearcoat": (0.0, 0.8)},
    "wax": {"translucency": (0.15, 0.5)},
    "peel": {"clearcoat": (0.2, 0.6), "translucency": (0.03, 0.12)},
}
"""Kind -> lobe of `Material` -> range of its weight, uniform."""

EMISSION: dict[str, Range] = {"screen": (0.3, 3.0), "shade": (0.3, 3.0), "bulb": (2.0, 20.0)}
"""Kind -> range of `Material.emission`, log-uniform; lamps give an irradiance of 1 to 10 by default."""

_CLEAR = ("glass", "liquid")


def lobes_rand(
    rng: np.random.Generator, config: MaterialConfig, material: Material, part_name: str
) -> Material:
    """`material` with the lobes that a part of this name has, as often as `config` says."""
    has_lobe, has_coat, is_lit = rng.random(3) < (config.lobe_share, config.coat_share, config.emission_share)
    weights = rng.random(2)
    coat, coat_roughness = rng.uniform(0.3, 1.0), log_uniform_rand(rng, (0.03, 0.3))
    level = rng.random()
    kind = part_kind(part_name)
    if kind in EMISSION and is_lit:
        low, high = EMISSION[kind]
        material = replace(material, emission=float(low * (high / low) ** level))
    if kind in LOBES and has_lobe:
        found = zip(LOBES[kind].items(), weights, strict=False)
        lobes: dict[str, Any] = {name: float(low + (high - low) * w) for (name, (low, high)), w in found}
        material = replace(material, clearcoat_roughness=coat_roughness, **lobes)
        return _cleared(material) if kind in _CLEAR else material
    if kind not in LOBES and has_coat:
        material = replace(material, clearcoat=float(coat), clearcoat_roughness=coat_roughness)
    return material


def _cleared(material: Material) -> Material:
    """Glass: smooth, and of a light tint, because its albedo is what it lets through."""

    def light(colour: Vec3) -> Vec3:
        r, g, b = (0.75 + 0.25 * channel for channel in colour)
        return (r, g, b)

    a, b, c = (light(colour) for colour in material.colours)
    return replace(material, colours=(a, b, c), roughness_scale=0.2, relief_scale=0.1)
