"""Scene -> drawables: geometry with a place and materials, the only thing that the passes below know.

The background and the shining faces of area lights are drawables like any other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fsid.assets import Mesh, build_background, build_mesh
from fsid.assets.solids import rotation_matrix
from fsid.errors import FsidError
from fsid.render.shadows import half_axes
from fsid.scene.check import camera_of, check_scene
from fsid.scene.model import (
    ZERO,
    Background,
    Camera,
    Light,
    Material,
    Motion,
    Scene,
    Sky,
    Transform,
    Vec3,
)

BACKGROUND_ID = -1
MAX_OBJECTS = 65533
"""The frame's object ids pass through 16 bits."""

DIELECTRIC_SPECULAR = 0.04
"""Reflectance at normal incidence of a surface with refractive index 1.5."""

SURFACES = ("wall_east", "wall_west", "wall_north", "wall_south", "ceiling", "floor")
"""Surfaces of a room in the order +x, -x, +y, -y, +z, -z."""

STILL = Transform(ZERO, ZERO, (1.0, 1.0, 1.0))
UNMOVED = Motion()
CLEAR = 0.5
"""Transmission from which a material is drawn as glass, behind which the rest of the scene is seen."""

_GLASS_SHARE = 0.3
"""Thickness of glass relative to the smallest side of what it is a part of: most are hollow."""


@dataclass(frozen=True, eq=False)
class Display:
    """A rectangle that shines, metres, before its object is turned and moved: centre, half width and half
    height (3,), whose cross product points away from its light."""

    centre: np.ndarray
    half_width: np.ndarray
    half_height: np.ndarray


@dataclass(frozen=True)
class Drawable:
    """materials: one per part of the mesh. specular: reflectance of its dielectric parts, 0..1.

    glow: radiance of the front whatever the material. casts: whether it shades anything. displays: number of
    a part that shines as a rectangle -> that rectangle, as `fsid.render.lamps` finds them.
    """

    mesh: Mesh
    transform: Transform
    materials: tuple[Material, ...]
    object_id: int
    specular: float = DIELECTRIC_SPECULAR
    motion: Motion = UNMOVED
    glow: Vec3 = ZERO
    casts: bool = True
    displays: Mapping[int, Display] = field(default_factory=dict)

    def pose(self, time_s: float) -> tuple[np.ndarray, np.ndarray]:
        """Rotation (3, 3) and position (3,) at a time: x_world = rotation (x * scale) + position."""
        rotation = rotation_matrix(*self.transform.rotation_deg)
        position = np.array(self.transform.position_m) + np.array(self.motion.velocity_m_s) * time_s
        return turn_about(self.motion.spin_deg_s, time_s) @ rotation, position

    def thickness_m(self, extent: np.ndarray) -> float:
        """Of its glass; extent: (3,) sides of the box around its mesh."""
        return float(_GLASS_SHARE * np.abs(extent * self.transform.scale).min())

    @property
    def is_glass(self) -> bool:
        """Whether any part of it is drawn as glass."""
        return any(material.transmission >= CLEAR for material in self.materials)


def turn_about(spin_deg_s: Vec3, time_s: float) -> np.ndarray:
    """(3, 3) rotation by |spin| * time about the axis of `spin` (Rodrigues)."""
    turn = np.radians(np.array(spin_deg_s, dtype=float)) * time_s
    angle = float(np.linalg.norm(turn))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = turn / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * (K @ K)


@dataclass(frozen=True)
class View:
    """One image to make.

    room_size_m, room_floor_m: the box of the surroundings. room_materials: six, in the order of SURFACES;
    none means white surroundings. sky: the surroundings instead of a box.
    """

    drawables: tuple[Drawable, ...]
    lights: tuple[Light, ...]
    ambient: Vec3
    camera: Camera
    room_size_m: Vec3
    room_materials: tuple[Material, ...] = ()
    room_floor_m: float = 0.0
    sky: Sky | None = None


def view_of(scene: Scene, camera_index: int) -> View:
    """The background and the objects of a scene from one of its cameras. Raises FsidError."""
    check_scene(scene)
    camera = camera_of(scene, camera_index)
    open_air = scene.background.kind == "open-air"
    background = background_drawable(scene.background)
    panels = [
        panel_drawable(light, background.materials[0]) for light in scene.lights if light.kind == "area"
    ]
    floor = 0.0 if open_air else float(background.mesh.vertices[:, 2].min())
    return View(
        drawables=(background, *object_drawables(scene), *panels),
        lights=scene.lights,
        ambient=scene.ambient,
        camera=replace(camera, width=int(camera.width), height=int(camera.height)),  # OpenGL takes no NumPy's
        room_size_m=scene.background.size_m,
        room_materials=() if open_air else _sides(scene.background),
        room_floor_m=floor,
        sky=(scene.sky or Sky("procedural", scene.ambient)) if open_air else None,
    )


def object_drawables(scene: Scene) -> list[Drawable]:
    """S, M and T as drawables, with their motion. Raises FsidError where these do not belong together."""
    if not len(scene.objects) == len(scene.materials) == len(scene.transforms):
        raise FsidError("scene: objects, materials and transforms must have the same length")
    if scene.motions and len(scene.motions) != len(scene.objects):
        raise FsidError("scene: give no motions, or one for every object")
    if len(scene.objects) > MAX_OBJECTS:
        raise FsidError(f"scene.objects: {len(scene.objects)} objects; at most {MAX_OBJECTS} can be drawn")
    motions = scene.motions or (UNMOVED,) * len(scene.objects)
    out = []
    equation = zip(scene.objects, scene.materials, scene.transforms, motions, strict=True)
    for i, (S, M, T, motion) in enumerate(equation):
        mesh = build_mesh(S.family, S.seed)
        if len(M) != len(mesh.part_names):
            raise FsidError(
                f"scene.materials[{i}]: {len(M)} materials, but '{S.family}' has {len(mesh.part_names)} parts"
            )
        out.append(Drawable(mesh, T, M, i, motion=motion))
    return out


def background_drawable(background: Background) -> Drawable:
    """B as a drawable. FsidError for a kind that does not exist, a part without material, or one too many."""
    mesh = build_background(background.kind, background.size_m)
    for name in mesh.part_names:
        if name not in background.materials:
            raise FsidError(
                f"scene.background.materials: '{name}' is missing; give all of {', '.join(mesh.part_names)}"
            )
    for name in background.materials:
        if name not in mesh.part_names:
            raise FsidError(
                f"scene.background.materials: '{name}' is no part of '{background.kind}'; "
                f"those are {', '.join(mesh.part_names)}"
            )
    materials = tuple(background.materials[name] for name in mesh.part_names)
    return Drawable(mesh, STILL, materials, BACKGROUND_ID)


def panel_drawable(light: Light, like: Material) -> Drawable:
    """The shining rectangle of an area light; `like` is any material, of which only the maps are kept."""
    width, height = half_axes(light)
    corners = np.array([-width - height, width - height, width + height, -width + height])
    normal = np.array(light.direction) / np.linalg.norm(light.direction)
    mesh = Mesh(
        vertices=corners.astype(np.float32),
        normals=np.tile(normal, (4, 1)).astype(np.float32),
        faces=np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        face_parts=np.zeros(2, np.int32),
        part_names=("panel",),
    )
    black = Material(like.family, like.variant, (ZERO, ZERO, ZERO), 1.0, 0.0, 1.0, 0.0)
    place = replace(STILL, position_m=light.position_m)
    return Drawable(mesh, place, (black,), BACKGROUND_ID, specular=0.0, glow=light.colour, casts=False)


def _sides(background: Background) -> tuple[Material, ...]:
    """The material of each side of the box; a sheet that replaces some of them stands for those."""
    sheet = background.materials.get("sweep")
    sides: Sequence[Material | None] = [background.materials.get(name, sheet) for name in SURFACES]
    return tuple(side for side in sides if side is not None)
