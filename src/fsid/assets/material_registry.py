"""The registry of material families: name and variant -> tileable maps.

A family is one small function that registers itself by decorator; the modules of `assets/materials` are
found by walking the package, so adding a family touches one file:

    @material_family("brick", tile_m=1.0, relief_m=0.012)
    def brick(rng, variant, size): return Layers(...)

Everything is a function of (name, variant, size) alone: the same scene gives the same texels in every
process. Bakes are kept on disk by `fsid.assets.bake_cache`; what a family draws with must come from the
modules of SHARED, because their sources are part of its key there.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from fsid.assets.bake_cache import cached, code_key
from fsid.assets.maps import MaterialMaps
from fsid.assets.streams import rng_of
from fsid.errors import FsidError

MATERIAL_VARIANTS = 4
"""Bakes per material family; few, so that a renderer can keep all of them."""

SHARED = tuple(
    f"fsid.assets.{name}" for name in ("bake_cache", "maps", "material_registry", "patterns", "streams")
)
"""What the modules of families may import from FSID, and what is in the key of every bake."""

Field = np.ndarray | float


class Layers(NamedTuple):
    """What a material family returns: the maps of `fsid.assets.maps`, (S, S) arrays or constants."""

    mix: Field = 0.0
    pattern: Field = 0.0
    detail: Field = 0.5
    roughness: Field = 0.5
    height: Field = 0.5
    metallic: Field = 0.0


LayerFamily = Callable[[np.random.Generator, int, int], Layers]


@dataclass(frozen=True)
class _Material:
    bake: LayerFamily
    tile_m: float
    relief_m: float


_MATERIALS: dict[str, _Material] = {}


def material_family(name: str, *, tile_m: float, relief_m: float) -> Callable[[LayerFamily], LayerFamily]:
    """Register `function(rng, variant, size) -> Layers` under `name`.

    tile_m: natural width of one tile. relief_m: height range that `height` 0..1 spans on such a tile.
    """

    def register(function: LayerFamily) -> LayerFamily:
        assert name not in _MATERIALS, f"material family {name} is registered twice"
        _MATERIALS[name] = _Material(function, tile_m, relief_m)
        return function

    return register


def material_families() -> tuple[str, ...]:
    """Names of all material families, sorted."""
    _discover()
    return tuple(sorted(_MATERIALS))


def material_tile_m(family: str) -> float:
    """Natural width in metres of one tile of a material family, known without baking it."""
    return _material(family).tile_m


def bake_material(family: str, variant: int, size: int = 1024) -> MaterialMaps:
    """The tileable maps of (family, variant) at `size` x `size` texels, from the cache where they are.

    variant: 0 .. MATERIAL_VARIANTS - 1. size: a power of two from 64 to 8192. Raises FsidError.
    """
    material = _material(family)
    if variant not in range(MATERIAL_VARIANTS):
        raise FsidError(f"material variant {variant} of '{family}': must be 0 .. {MATERIAL_VARIANTS - 1}")
    if not 64 <= size <= 8192 or size & (size - 1):
        raise FsidError(f"material size {size}: must be a power of two from 64 to 8192")
    key = code_key((material.bake.__module__, *SHARED))
    return cached(f"{family}-{variant}", key, size, lambda: draw_material(family, variant, size))


def draw_material(family: str, variant: int, size: int) -> MaterialMaps:
    """What `bake_material` keeps: the family's function called, before any rounding."""
    material = _material(family)
    layers = material.bake(rng_of(family, variant), variant, size)
    maps: dict[str, Any] = {name: _finished(field, size) for name, field in layers._asdict().items()}
    return MaterialMaps(**maps, relief_m=material.relief_m, tile_m=material.tile_m)


def _finished(field: Field, size: int) -> np.ndarray:
    return np.clip(np.broadcast_to(np.asarray(field, np.float32), (size, size)), 0.0, 1.0)


def _material(family: str) -> _Material:
    _discover()
    if family not in _MATERIALS:
        raise FsidError(
            f"material family '{family}' does not exist; choose one of: {', '.join(material_families())}"
        )
    return _MATERIALS[family]


@cache
def _discover() -> None:
    """Import every module of the package of families, which fills the registry."""
    package = importlib.import_module("fsid.assets.materials")
    for module in pkgutil.iter_modules(package.__path__, package.__name__ + "."):
        importlib.import_module(module.name)
