"""Everything a scene is made of: name and seed -> mesh, name and variant -> material maps."""

from fsid.assets.kinds import PART_KINDS, part_kind
from fsid.assets.maps import MaterialMaps
from fsid.assets.mesh import Mesh
from fsid.assets.registry import (
    MATERIAL_VARIANTS,
    bake_material,
    build_mesh,
    material_families,
    material_tile_m,
    mesh_families,
)

__all__ = [
    "MATERIAL_VARIANTS",
    "PART_KINDS",
    "MaterialMaps",
    "Mesh",
    "bake_material",
    "build_mesh",
    "material_families",
    "material_tile_m",
    "mesh_families",
    "part_kind",
]
