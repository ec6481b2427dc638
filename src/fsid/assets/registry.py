"""Two registries: name -> function for furniture meshes and for material families.

A family is one small function that registers itself by decorator; the modules of `assets/meshes` and
`assets/materials` are found by walking the two packages, so adding a family touches one file:

    @mesh_family("stool")                      @material_family("brick", tile_m=1.0, relief_m=0.012)
    def stool(rng): return {"seat": [...]}     def brick(rng, variant, size): return Layers(...)

A part name tells with a word of `fsid.assets.PART_KINDS` what it is made of where only one matter makes
sense ("leaf", "glass", "cloth_seat"); the docstring's first line is the family's line in docs/objects.md.

Everything is a function of (name, seed) or (name, variant) alone: the same scene gives the same geometry
and the same texels in every process and on every machine.
"""

from __future__ import annotations

import importlib
import pkgutil
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np

from fsid.assets.maps import MaterialMaps
from fsid.assets.mesh import Mesh
from fsid.assets.solids import Solid, assemble
from fsid.errors import FsidError

MATERIAL_VARIANTS = 4
"""Bakes per material family; few, so that a renderer can keep all of them."""

Field = np.ndarray | float


class Layers(NamedTuple):
    """What a material family returns: the maps of `fsid.assets.maps`, (S, S) arrays or constants."""

    mix: Field = 0.0
    pattern: Field = 0.0
    detail: Field = 0.5
    roughness: Field = 0.5
    height: Field = 0.5
    metallic: Field = 0.0


Parts = Mapping[str, Sequence[Solid]]
MeshFamily = Callable[[np.random.Generator], Parts]
LayerFamily = Callable[[np.random.Generator, int, int], Layers]


@dataclass(frozen=True)
class _Material:
    bake: LayerFamily
    tile_m: float
    relief_m: float


_MESHES: dict[str, MeshFamily] = {}
_MATERIALS: dict[str, _Material] = {}


def mesh_family(name: str) -> Callable[[MeshFamily], MeshFamily]:
    """Register `function(rng) -> {part name: solids}` under `name`; metres, any position."""

    def register(function: MeshFamily) -> MeshFamily:
        assert name not in _MESHES, f"mesh family {name} is registered twice"
        _MESHES[name] = function
        return function

    return register


def material_family(name: str, *, tile_m: float, relief_m: float) -> Callable[[LayerFamily], LayerFamily]:
    """Register `function(rng, variant, size) -> Layers` under `name`.

    tile_m: natural width of one tile. relief_m: height range that `height` 0..1 spans on such a tile.
    """

    def register(function: LayerFamily) -> LayerFamily:
        assert name not in _MATERIALS, f"material family {name} is registered twice"
        _MATERIALS[name] = _Material(function, tile_m, relief_m)
        return function

    return register


def mesh_families() -> tuple[str, ...]:
    """Names of all mesh families, sorted."""
    _discover()
    return tuple(sorted(_MESHES))


def material_families() -> tuple[str, ...]:
    """Names of all material families, sorted."""
    _discover()
    return tuple(sorted(_MATERIALS))


def material_tile_m(family: str) -> float:
    """Natural width in metres of one tile of a material family, known without baking it."""
    return _material(family).tile_m


@lru_cache(maxsize=128)
def build_mesh(family: str, seed: int) -> Mesh:
    """The mesh of (family, seed): metres, base on z = 0, footprint centred. Read-only arrays.

    The last 128 meshes stay in memory: a sampler that looks at sizes and a renderer share the work.
    Raises FsidError for a family that does not exist.
    """
    _discover()
    if family not in _MESHES:
        raise FsidError(f"mesh family '{family}' does not exist; choose one of: {', '.join(mesh_families())}")
    mesh = assemble(_MESHES[family](_rng(family, seed)))
    for array in (mesh.vertices, mesh.normals, mesh.faces, mesh.face_parts):
        array.setflags(write=False)
    return mesh


def bake_material(family: str, variant: int, size: int = 1024) -> MaterialMaps:
    """The tileable maps of (family, variant) at `size` x `size` texels.

    variant: 0 .. MATERIAL_VARIANTS - 1. size: a power of two from 64 to 8192. Raises FsidError.
    """
    material = _material(family)
    if variant not in range(MATERIAL_VARIANTS):
        raise FsidError(f"material variant {variant} of '{family}': must be 0 .. {MATERIAL_VARIANTS - 1}")
    if not 64 <= size <= 8192 or size & (size - 1):
        raise FsidError(f"material size {size}: must be a power of two from 64 to 8192")
    layers = material.bake(_rng(family, variant), variant, size)
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


def _rng(name: str, number: int) -> np.random.Generator:
    return np.random.default_rng((zlib.crc32(name.encode()), number))


@cache
def _discover() -> None:
    """Import every module of the two family packages, which fills the registries."""
    for package_name in ("fsid.assets.meshes", "fsid.assets.materials"):
        package = importlib.import_module(package_name)
        for module in pkgutil.iter_modules(package.__path__, package_name + "."):
            importlib.import_module(module.name)
