"""The registry of mesh families: name -> function. (Materials: `fsid.assets.material_registry`.)

A family is one small function that registers itself by decorator; the modules of `assets/meshes` are found
by walking the package, so adding a family touches one file:

    @mesh_family("stool")
    def stool(rng): return {"seat": [...]}

A part name tells with a word of `fsid.assets.PART_KINDS` what it is made of where only one matter makes
sense ("leaf", "glass", "cloth_seat"); the docstring's first line is the family's line in docs/objects.md.

A mesh is a function of (name, seed) alone: the same scene gives the same geometry everywhere.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping, Sequence
from functools import cache, lru_cache

import numpy as np

from fsid.assets.file_names import PREFIX
from fsid.assets.mesh import Mesh
from fsid.assets.solids import Solid, assemble
from fsid.assets.sources import load_source
from fsid.assets.streams import rng_of
from fsid.errors import FsidError, whole

Parts = Mapping[str, Sequence[Solid]]
MeshFamily = Callable[[np.random.Generator], Parts]

_MESHES: dict[str, MeshFamily] = {}


def mesh_family(name: str) -> Callable[[MeshFamily], MeshFamily]:
    """Register `function(rng) -> {part name: solids}` under `name`; metres, any position."""

    def register(function: MeshFamily) -> MeshFamily:
        assert name not in _MESHES, f"mesh family {name} is registered twice"
        _MESHES[name] = function
        return function

    return register


def mesh_families() -> tuple[str, ...]:
    """Names of all mesh families, sorted."""
    _discover()
    return tuple(sorted(_MESHES))


def mesh_family_summary(family: str) -> str:
    """What a mesh family is: the first line of its docstring, without the full stop."""
    _discover()
    return (_MESHES[family].__doc__ or "").strip().splitlines()[0].rstrip(".")


@lru_cache(maxsize=128)
def build_mesh(family: str, seed: int) -> Mesh:
    """The mesh of (family, seed): metres, base on z = 0, footprint centred. Read-only arrays.

    family: a registered name, or a mesh file as `fsid.assets.sources` names them, whose seed plays no part.
    The last 128 meshes stay in memory: a sampler that looks at sizes and a renderer share the work.
    Raises FsidError for a family that does not exist or a file that cannot be read.
    """
    mesh = load_source(family) if family.startswith(PREFIX) else _from_family(family, seed)
    for array in (mesh.vertices, mesh.normals, mesh.faces, mesh.face_parts):
        array.setflags(write=False)
    return mesh


def _from_family(family: str, seed: int) -> Mesh:
    _discover()
    if family not in _MESHES:
        raise FsidError(f"mesh family '{family}' does not exist; choose one of: {', '.join(mesh_families())}")
    if whole(seed, "seed") < 0:
        raise FsidError(f"seed {seed}: must not be negative")
    return assemble(_MESHES[family](rng_of(family, seed)))


@cache
def _discover() -> None:
    """Import every module of the package of families, which fills the registry."""
    package = importlib.import_module("fsid.assets.meshes")
    for module in pkgutil.iter_modules(package.__path__, package.__name__ + "."):
        importlib.import_module(module.name)
