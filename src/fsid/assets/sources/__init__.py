"""Meshes that the user brings: folders of files and Sweet Home 3D libraries, as if they were families."""

from fsid.assets.sources.library import (
    MeshSource,
    licence_beside,
    load_source,
    mesh_sources,
    split_source,
    survey_meshes,
)

__all__ = ["MeshSource", "licence_beside", "load_source", "mesh_sources", "split_source", "survey_meshes"]
