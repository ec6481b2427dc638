"""Scene -> drawables: geometry with a place and materials, the only thing that the passes below know.

The room is one more drawable: a box seen from inside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fsid.assets import Mesh, build_mesh
from fsid.errors import FsidError
from fsid.scene.model import Background, Camera, Light, Material, Scene, Transform, Vec3

BACKGROUND_ID = -1
MAX_OBJECTS = 65534
"""The G-buffer keeps 16 bits of the object id."""

DIELECTRIC_SPECULAR = 0.04
"""Reflectance at normal incidence of a surface with refractive index 1.5."""

SURFACES = ("wall_east", "wall_west", "wall_north", "wall_south", "ceiling", "floor")
"""Surfaces of a room in the order +x, -x, +y, -y, +z, -z."""


@dataclass(frozen=True)
class Drawable:
    """materials: one per part of the mesh. specular: reflectance of its dielectric parts, 0..1."""

    mesh: Mesh
    transform: Transform
    materials: tuple[Material, ...]
    object_id: int
    specular: float = DIELECTRIC_SPECULAR


@dataclass(frozen=True)
class View:
    """One image to make. room_materials: six, in the order of SURFACES; none means white surroundings."""

    drawables: tuple[Drawable, ...]
    lights: tuple[Light, ...]
    ambient: Vec3
    camera: Camera
    room_size_m: Vec3
    room_materials: tuple[Material, ...] = ()


def view_of(scene: Scene, camera_index: int) -> View:
    """The room and the objects of a scene from one of its cameras. Raises FsidError."""
    if not 0 <= camera_index < len(scene.cameras):
        raise FsidError(f"camera_index {camera_index}: the scene has {len(scene.cameras)} cameras")
    room = room_drawable(scene.background)
    return View(
        drawables=(room, *_objects(scene)),
        lights=scene.lights,
        ambient=scene.ambient,
        camera=scene.cameras[camera_index],
        room_size_m=scene.background.size_m,
        room_materials=room.materials,
    )


def _objects(scene: Scene) -> list[Drawable]:
    if not len(scene.objects) == len(scene.materials) == len(scene.transforms):
        raise FsidError("scene: objects, materials and transforms must have the same length")
    if len(scene.objects) > MAX_OBJECTS:
        raise FsidError(f"scene.objects: {len(scene.objects)} objects; at most {MAX_OBJECTS} can be drawn")
    out = []
    for i, (S, M, T) in enumerate(zip(scene.objects, scene.materials, scene.transforms, strict=True)):
        mesh = build_mesh(S.family, S.seed)
        if len(M) != len(mesh.part_names):
            raise FsidError(
                f"scene.materials[{i}]: {len(M)} materials, but '{S.family}' has {len(mesh.part_names)} parts"
            )
        out.append(Drawable(mesh, T, M, i))
    return out


def room_drawable(background: Background) -> Drawable:
    """The inside of the box 0 <= z <= height centred on the origin. Raises FsidError for another kind."""
    if background.kind != "room":
        raise FsidError(f"scene.background.kind '{background.kind}' is not known; use 'room'")
    for name in SURFACES:
        if name not in background.materials:
            raise FsidError(
                f"scene.background.materials: '{name}' is missing; give all of {', '.join(SURFACES)}"
            )
    still = Transform((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    materials = tuple(background.materials[name] for name in SURFACES)
    return Drawable(room_mesh(background.size_m), still, materials, BACKGROUND_ID)


def room_mesh(size_m: tuple[float, float, float]) -> Mesh:
    """Six quads facing inward, one part each in the order of SURFACES."""
    vertices, normals, faces = [], [], []
    half = np.array(size_m) / 2
    for side in range(6):
        axis, sign = side // 2, 1 - 2 * (side % 2)
        u, v = np.zeros(3), np.zeros(3)
        u[(axis + 1) % 3], v[(axis + 2) % 3] = 1, sign
        outward = np.zeros(3)
        outward[axis] = sign
        vertices += [(outward + a * u + b * v) * half + (0, 0, half[2]) for a, b in _CORNERS]
        normals += [-outward] * 4
        faces += [[4 * side, 4 * side + 2, 4 * side + 1], [4 * side, 4 * side + 3, 4 * side + 2]]
    return Mesh(
        vertices=np.array(vertices, np.float32),
        normals=np.array(normals, np.float32),
        faces=np.array(faces, np.int32),
        face_parts=np.repeat(np.arange(6, dtype=np.int32), 2),
        part_names=SURFACES,
    )


_CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))
