"""All drawables as one vertex buffer, one index buffer and one surface table; a pass is one indirect draw.

A surface is one part of one drawable. Every vertex names its surface, and the table holds the surface's
place, colours and texture layer, so that neither objects nor materials need a call of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fsid.assets import Mesh
from fsid.assets.solids import rotation_matrix
from fsid.render.drawable import Drawable
from fsid.render.layers import Layer
from fsid.scene.model import Material, Transform

VERTEX = np.dtype([("position", "3f4"), ("normal", "3f4"), ("surface", "u4")])

SURFACE = np.dtype(
    [
        ("place", "(3,4)f4"),  # rows of [rotation | position]
        ("scale", "3f4"),
        ("tiles_per_m", "f4"),
        ("colour_a", "3f4"),
        ("turn_cos", "f4"),
        ("colour_b", "3f4"),
        ("turn_sin", "f4"),
        ("colour_c", "3f4"),
        ("roughness_scale", "f4"),
        ("layer", "f4"),
        ("slope_scale", "f4"),
        ("specular", "f4"),
        ("object_id", "i4"),
    ]
)
"""std430 layout of `struct Surface` in shaders/surfaces.glsl; object_id is one more than the frame's."""


@dataclass(frozen=True)
class Geometry:
    """vertices: VERTEX (V,), in the object. world: (V, 3) float32, the same points in the world.

    indices: (3 F,) uint32, drawable after drawable. surfaces: SURFACE (P,). ranges: (N, 2) first index and
    number of indices of each drawable. spheres: (N, 4) world centre and radius of each drawable.
    """

    vertices: np.ndarray
    world: np.ndarray
    indices: np.ndarray
    surfaces: np.ndarray
    ranges: np.ndarray
    spheres: np.ndarray


def merge(drawables: Sequence[Drawable], layer_of: Callable[[Material], Layer]) -> Geometry:
    """One geometry of all drawables; `layer_of` tells where a material's maps are."""
    vertices, world, indices, surfaces, ranges, spheres = [], [], [], [], [], []
    first_vertex = first_index = first_surface = 0
    for drawable in drawables:
        mesh_vertices, mesh_indices = _with_surfaces(drawable.mesh, first_surface)
        vertices.append(mesh_vertices)
        world.append(_in_world(mesh_vertices["position"], drawable.transform))
        indices.append(mesh_indices + np.uint32(first_vertex))
        surfaces += [_surface(drawable, material, layer_of(material)) for material in drawable.materials]
        ranges.append((first_index, len(mesh_indices)))
        spheres.append(_sphere(drawable.mesh, drawable.transform))
        first_vertex += len(mesh_vertices)
        first_index += len(mesh_indices)
        first_surface += len(drawable.materials)
    return Geometry(
        vertices=np.concatenate(vertices),
        world=np.concatenate(world),
        indices=np.concatenate(indices),
        surfaces=np.stack(surfaces),
        ranges=np.array(ranges, np.uint32),
        spheres=np.array(spheres),
    )


def draw_commands(ranges: np.ndarray, visible: np.ndarray) -> np.ndarray:
    """(n, 5) uint32 commands of glMultiDrawElementsIndirect for the drawables numbered `visible`."""
    commands = np.zeros((len(visible), 5), np.uint32)
    commands[:, 0] = ranges[visible, 1]
    commands[:, 1] = 1
    commands[:, 2] = ranges[visible, 0]
    return commands


def in_view(
    spheres: np.ndarray, origin: np.ndarray, axes: np.ndarray, tan_xy: tuple[float, float]
) -> np.ndarray:
    """(N,) bool: spheres that touch the pyramid from `origin` along axes[2] (rows right, up, forward)."""
    local = (spheres[:, :3] - origin) @ axes.T
    radius = spheres[:, 3]
    inside = local[:, 2] > -radius
    for axis in (0, 1):
        beyond = np.abs(local[:, axis]) - tan_xy[axis] * local[:, 2]
        inside &= beyond < radius * np.hypot(1.0, tan_xy[axis])
    return inside


def _with_surfaces(mesh: Mesh, first_surface: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices that know their surface; a vertex used by two parts is doubled."""
    part = np.zeros(len(mesh.vertices), np.int64)
    part[mesh.faces] = mesh.face_parts[:, None]
    index, faces = np.arange(len(part)), mesh.faces
    if (part[faces] != mesh.face_parts[:, None]).any():
        key = mesh.faces.astype(np.int64) * len(mesh.part_names) + mesh.face_parts[:, None]
        unique, inverse = np.unique(key, return_inverse=True)
        index, part = np.divmod(unique, len(mesh.part_names))
        faces = inverse.reshape(-1, 3)
    vertices = np.empty(len(index), VERTEX)
    vertices["position"] = mesh.vertices[index]
    vertices["normal"] = mesh.normals[index]
    vertices["surface"] = part + first_surface
    return vertices, faces.astype(np.uint32).ravel()


def _in_world(points: np.ndarray, transform: Transform) -> np.ndarray:
    """(V, 3) float32: rotation (points * scale) + position."""
    matrix = (rotation_matrix(*transform.rotation_deg) * transform.scale).astype(np.float32)
    return points @ matrix.T + np.array(transform.position_m, np.float32)


def _surface(drawable: Drawable, material: Material, layer: Layer) -> np.ndarray:
    surface = np.zeros((), SURFACE)
    surface["place"][:, :3] = rotation_matrix(*drawable.transform.rotation_deg)
    surface["place"][:, 3] = drawable.transform.position_m
    surface["scale"] = drawable.transform.scale
    surface["tiles_per_m"] = 1.0 / material.tile_m
    surface["colour_a"], surface["colour_b"], surface["colour_c"] = material.colours
    turn = np.radians(material.rotation_deg)
    surface["turn_cos"], surface["turn_sin"] = np.cos(turn), np.sin(turn)
    surface["roughness_scale"] = material.roughness_scale
    surface["layer"] = layer.index
    surface["slope_scale"] = layer.slope_scale * material.relief_scale
    surface["specular"] = drawable.specular
    surface["object_id"] = drawable.object_id + 1
    return surface


def _sphere(mesh: Mesh, transform: Transform) -> tuple[float, float, float, float]:
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    scale = np.array(transform.scale)
    centre = rotation_matrix(*transform.rotation_deg) @ ((low + high) / 2 * scale) + transform.position_m
    x, y, z = (float(c) for c in centre)
    return (x, y, z, float(np.linalg.norm((high - low) * scale) / 2))
