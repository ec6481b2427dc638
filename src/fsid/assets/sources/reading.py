"""Bytes of a mesh file -> `Triangles`, with every stated number checked beforehand.

`trimesh` reads glTF and STL: of OBJ it takes only the commonest spelling, of PLY no faces of several sizes.
"""

from __future__ import annotations

import io

import numpy as np

from fsid.assets.sources.cleaning import Triangles
from fsid.assets.sources.gltf_file import Fetch, plain_gltf
from fsid.assets.sources.limits import (
    MAX_FILE_BYTES,
    MAX_PARTS,
    MAX_TRIANGLES,
    NO_VERTEX,
    NotNowError,
    RefusedError,
)
from fsid.assets.sources.obj_file import read_obj
from fsid.assets.sources.ply_file import read_ply

MESH_SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl")

_OWN = {".obj": read_obj, ".ply": read_ply}
_Y_UP = (".glb", ".gltf", ".obj")
"""glTF by its standard, OBJ by custom; PLY and STL come from scanners and printers with z up."""


def read_triangles(data: bytes, suffix: str, fetch: Fetch) -> Triangles:
    """The triangles of a file in its own unit, turned so that z is up; one part per material.

    data: the file. suffix: one of MESH_SUFFIXES. fetch: for the buffers that a .gltf refers to; nothing else
    is ever looked up. Raises RefusedError, whatever is wrong with the file.
    """
    if len(data) > MAX_FILE_BYTES:
        raise RefusedError(f"larger than {MAX_FILE_BYTES >> 20} MiB")
    try:
        own = _OWN.get(suffix)
        triangles = _used(own(data) if own else _joined(_geometries(data, suffix, fetch)))
    except (RefusedError, KeyboardInterrupt):
        raise
    except (ImportError, MemoryError) as error:
        raise NotNowError(f"cannot be read here ({type(error).__name__}: {_one_line(error)})") from None
    except Exception as error:  # what a reader of foreign formats may raise has no end
        raise RefusedError(f"cannot be read ({type(error).__name__}: {_one_line(error)})") from None
    if suffix in _Y_UP:
        x, y, z = triangles.vertices.T
        return Triangles(np.stack([x, -z, y], axis=-1), triangles.faces, triangles.parts, triangles.names)
    return triangles


def _geometries(data: bytes, suffix: str, fetch: Fetch) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """(part name, vertices, faces) of every placed piece of a file."""
    import trimesh  # slow to import, and only users of mesh files need it

    resolver: dict[str, bytes] = {}
    materials: list[str] = []
    if suffix in (".glb", ".gltf"):
        data, resolver, materials = plain_gltf(data, fetch)
        suffix = ".gltf"
    elif data.lower().count(b"endsolid") > MAX_PARTS:
        raise RefusedError(f"more than {MAX_PARTS:,} solids")
    loaded = trimesh.load_scene(io.BytesIO(data), suffix[1:], resolver=resolver, process=False)
    pieces = []
    for node in loaded.graph.nodes_geometry:
        matrix, name = loaded.graph[node]
        geometry = loaded.geometry[name]
        if hasattr(geometry, "faces"):
            with np.errstate(all="ignore"):  # points that are not finite are dropped later
                points = geometry.vertices @ matrix[:3, :3].T + matrix[:3, 3]
            part = materials[int(str(name).partition(".")[0])] if materials else str(name)
            pieces.append((part, points, geometry.faces))
    return pieces


def _joined(pieces: list[tuple[str, np.ndarray, np.ndarray]]) -> Triangles:
    if not pieces:
        raise RefusedError("no triangles")
    names = list(dict.fromkeys(name for name, _, _ in pieces))
    vertices, faces, parts, start = [], [], [], 0
    for name, points, corners in pieces:
        points, corners = np.asarray(points, np.float64), np.asarray(corners, np.int64)
        if len(corners) and not 0 <= corners.min() <= corners.max() < len(points):
            raise RefusedError(NO_VERTEX)
        vertices.append(points.reshape(-1, 3))
        faces.append(corners.reshape(-1, 3) + start)
        parts.append(np.full(len(corners), names.index(name)))
        start += len(points)
    return Triangles(np.concatenate(vertices), np.concatenate(faces), np.concatenate(parts), tuple(names))


def _used(triangles: Triangles) -> Triangles:
    """What faces use: other points have no part in the extent, by which the unit is told."""
    if not len(triangles.faces):
        raise RefusedError("no triangles")
    if len(triangles.faces) > MAX_TRIANGLES:
        raise RefusedError(f"{len(triangles.faces):,} triangles")
    used = np.zeros(len(triangles.vertices), bool)
    used[triangles.faces] = True
    corners = (np.cumsum(used) - 1)[triangles.faces]
    return Triangles(triangles.vertices[used], corners, triangles.parts, triangles.names)


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split())[:120]
