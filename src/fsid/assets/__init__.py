"""Everything a scene is made of: name and seed -> mesh, name and variant -> material maps."""

from fsid.assets.backgrounds import (
    BACKGROUND_PARTS,
    build_background,
    ground_height_m,
    sweep_radius_m,
    table_size_m,
)
from fsid.assets.kinds import PART_KINDS, part_kind
from fsid.assets.maps import MaterialMaps
from fsid.assets.material_registry import (
    MATERIAL_VARIANTS,
    bake_material,
    material_colours,
    material_families,
    material_layers,
    material_tile_m,
)
from fsid.assets.mesh import Mesh
from fsid.assets.registry import (
    build_mesh,
    mesh_families,
)
from fsid.assets.skies import sky_sources, survey_skies
from fsid.assets.sources import mesh_sources, survey_meshes
from fsid.assets.textures import survey_textures, texture_sources

__all__ = [
    "BACKGROUND_PARTS",
    "MATERIAL_VARIANTS",
    "PART_KINDS",
    "MaterialMaps",
    "Mesh",
    "bake_material",
    "build_background",
    "build_mesh",
    "ground_height_m",
    "material_colours",
    "material_families",
    "material_layers",
    "material_tile_m",
    "mesh_families",
    "mesh_sources",
    "part_kind",
    "sky_sources",
    "survey_meshes",
    "survey_skies",
    "survey_textures",
    "sweep_radius_m",
    "table_size_m",
    "texture_sources",
]
