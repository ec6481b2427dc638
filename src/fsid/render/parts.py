"""Scene -> parts: triangles with a place and one material each, for what is not the rasteriser.

Exporters and other renderers take a scene apart alike; textures lie on `surface` as it is here (metric space
of the object), and `rotation`, `position` are rigid, so that nothing is stretched afterwards.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fsid.render.drawable import Drawable, background_drawable, object_drawables
from fsid.scene.model import Material, Scene


@dataclass(frozen=True, eq=False)
class Surface:
    """vertices: (V, 3) metres. normals: (V, 3) unit. faces: (F, 3) int, counterclockwise from outside."""

    vertices: np.ndarray
    normals: np.ndarray
    faces: np.ndarray


@dataclass(frozen=True, eq=False)
class Part:
    """One part of one body: its triangles in metric space (scaled, not turned), and where that is in the
    world: rotation (3, 3) @ vertex + position (3,). body and name: of the mesh and of its part.
    thickness_m: of its glass."""

    surface: Surface
    rotation: np.ndarray
    position: np.ndarray
    material: Material
    object_id: int
    body: str
    name: str
    thickness_m: float


def parts_of(scene: Scene, time_s: float) -> Iterator[Part]:
    """Background and objects, part by part, where they are at a time. Raises FsidError."""
    yield from _parts(background_drawable(scene.background), scene.background.kind, time_s)
    for S, drawable in zip(scene.objects, object_drawables(scene), strict=True):
        yield from _parts(drawable, S.family, time_s)


def _parts(drawable: Drawable, body: str, time_s: float) -> Iterator[Part]:
    mesh, scale = drawable.mesh, np.array(drawable.transform.scale)
    rotation, position = drawable.pose(time_s)
    normals = mesh.normals / scale
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    thickness_m = drawable.thickness_m(np.ptp(mesh.vertices, axis=0))
    onwards = int(np.sign(scale).prod())  # -1: a mirrored triangle goes round the other way
    for number, (material, name) in enumerate(zip(drawable.materials, mesh.part_names, strict=True)):
        used, corners = np.unique(mesh.faces[mesh.face_parts == number], return_inverse=True)
        if len(used):
            surface = Surface(
                mesh.vertices[used] * scale, normals[used], corners.reshape(-1, 3)[:, ::onwards]
            )
            yield Part(surface, rotation, position, material, drawable.object_id, body, name, thickness_m)
