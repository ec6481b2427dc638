"""Scene -> parts: triangles with a place and one material each, for what is not the rasteriser.

Exporters and other renderers take a scene apart alike; textures lie on `surface` as it is here (metric space
of the object), and `rotation`, `position` are rigid, so that nothing is stretched afterwards.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fsid.assets import Mesh, build_background, build_mesh
from fsid.assets.solids import rotation_matrix
from fsid.errors import FsidError
from fsid.scene.model import Material, Motion, Scene


@dataclass(frozen=True, eq=False)
class Surface:
    """vertices: (V, 3) metres. normals: (V, 3) unit. faces: (F, 3) int."""

    vertices: np.ndarray
    normals: np.ndarray
    faces: np.ndarray


@dataclass(frozen=True, eq=False)
class Part:
    """One part of one body: its triangles in metric space (scaled, not turned), and where that is in the
    world: rotation (3, 3) @ vertex + position (3,). body and name: of the mesh and of its part."""

    surface: Surface
    rotation: np.ndarray
    position: np.ndarray
    material: Material
    object_id: int
    body: str
    name: str


def parts_of(scene: Scene, time_s: float) -> Iterator[Part]:
    """Background and objects, part by part, where they are at a time. Raises FsidError."""
    background = scene.background
    mesh = build_background(background.kind, background.size_m)
    missing = [name for name in mesh.part_names if name not in background.materials]
    if missing:
        raise FsidError(f"scene.background.materials: '{missing[0]}' is missing")
    materials = tuple(background.materials[name] for name in mesh.part_names)
    yield from _parts(mesh, np.ones(3), np.eye(3), np.zeros(3), materials, -1, background.kind)
    motions = scene.motions or (Motion(),) * len(scene.objects)
    for i, (S, M, T, motion) in enumerate(
        zip(scene.objects, scene.materials, scene.transforms, motions, strict=True)
    ):
        mesh = build_mesh(S.family, S.seed)
        if len(M) != len(mesh.part_names):
            raise FsidError(
                f"scene.materials[{i}]: {len(M)} materials, but '{S.family}' has {len(mesh.part_names)} parts"
            )
        rotation = turn(np.array(motion.spin_deg_s) * time_s) @ rotation_matrix(*T.rotation_deg)
        place = np.array(T.position_m) + np.array(motion.velocity_m_s) * time_s
        yield from _parts(mesh, np.array(T.scale), rotation, place, M, i, S.family)


def _parts(
    mesh: Mesh,
    scale: np.ndarray,
    rotation: np.ndarray,
    position: np.ndarray,
    materials: tuple[Material, ...],
    object_id: int,
    body: str,
) -> Iterator[Part]:
    normals = mesh.normals / scale
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    for number, material in enumerate(materials):
        used, corners = np.unique(mesh.faces[mesh.face_parts == number], return_inverse=True)
        if len(used):
            surface = Surface(mesh.vertices[used] * scale, normals[used], corners.reshape(-1, 3))
            yield Part(surface, rotation, position, material, object_id, body, mesh.part_names[number])


def turn(degrees: np.ndarray) -> np.ndarray:
    """(3, 3) rotation by |degrees| about the axis of `degrees` (Rodrigues)."""
    angle = np.radians(np.linalg.norm(degrees))
    if angle == 0:
        return np.eye(3)
    x, y, z = degrees / np.linalg.norm(degrees)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
