"""All drawables as one vertex buffer, one index buffer and one surface table; a pass is one indirect draw.

A surface is one part of one drawable. Every vertex names its surface, and the table holds the surface's
place, colours and texture layer, so that neither objects nor materials need a call of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fsid.assets import Mesh
from fsid.render.drawable import CLEAR, Drawable
from fsid.render.layers import Layer
from fsid.scene.model import Material

VERTEX = np.dtype([("normal", "3f4"), ("surface", "u4")])
"""surface: its number in the table; the highest bit is set for glass."""

SURFACE = np.dtype(
    [
        ("place", "(3,4)f4"),  # rows of [rotation | position]
        ("colour_a", "3f4"),
        ("turn_cos", "f4"),
        ("colour_b", "3f4"),
        ("turn_sin", "f4"),
        ("colour_c", "3f4"),
        ("roughness_scale", "f4"),
        ("tiles_per_m", "f4"),
        ("layer", "f4"),
        ("slope_scale", "f4"),
        ("specular", "f4"),
        ("clearcoat", "f4"),
        ("clearcoat_alpha", "f4"),
        ("sheen", "f4"),
        ("translucency", "f4"),
        ("glow", "3f4"),
        ("emission", "f4"),
        ("transmission", "f4"),
        ("object_id", "f4"),
        ("thickness_m", "f4"),
        ("patched", "f4"),
    ]
)
"""Ten texels of `struct Surface` in shaders/surfaces.glsl; object_id is one more than the frame's."""

_SURFACE_TEXELS = 10
_SURFACE_ROWS = 2048


@dataclass(frozen=True, eq=False)
class Geometry:
    """world: (V, 3) float32, points in the world. vertices: VERTEX (V,), normals in the world.

    indices: (3 F,) uint32, drawable after drawable. surfaces: SURFACE (P,). ranges: (N, 2) first index and
    number of indices of each drawable. spheres: (N, 4) world centre and radius of each drawable.
    """

    world: np.ndarray
    vertices: np.ndarray
    indices: np.ndarray
    surfaces: np.ndarray
    ranges: np.ndarray
    spheres: np.ndarray

    def without_vertices(self) -> Geometry:
        """What is still asked for when vertices and indices are on the device."""
        return replace(
            self,
            world=self.world[:0].copy(),
            vertices=self.vertices[:0].copy(),
            indices=self.indices[:0].copy(),
        )


def merge(drawables: Sequence[Drawable], layer_of: Callable[[Material], Layer], time_s: float) -> Geometry:
    """One geometry of all drawables at a time; `layer_of` tells where a material's maps are."""
    vertices, world, indices, surfaces, ranges, spheres = [], [], [], [], [], []
    first_vertex = first_index = first_surface = 0
    for drawable in drawables:
        index, mesh_surface, faces = _by_surface(drawable.mesh)
        positions, normals = _in_world(drawable, index, time_s)
        mesh_vertices = np.empty(len(positions), VERTEX)
        mesh_vertices["normal"] = normals
        clear = np.array([m.transmission >= CLEAR for m in drawable.materials], np.uint32)
        mesh_vertices["surface"] = (mesh_surface + first_surface) | (clear[mesh_surface] << 31)
        vertices.append(mesh_vertices)
        world.append(positions)
        indices.append(faces + np.uint32(first_vertex))
        columns = drawable.mesh.vertices.T
        low, high = (np.array([f(column) for column in columns]) for f in (np.min, np.max))
        thickness_m = _GLASS_SHARE * (high - low).min() * min(drawable.transform.scale)
        surfaces += [
            _surface(drawable, material, layer_of(material), thickness_m, time_s)
            for material in drawable.materials
        ]
        ranges.append((first_index, len(faces)))
        spheres.append(_sphere(drawable, low, high, time_s))
        first_vertex += len(mesh_vertices)
        first_index += len(faces)
        first_surface += len(drawable.materials)
    return Geometry(
        world=np.concatenate(world),
        vertices=np.concatenate(vertices),
        indices=np.concatenate(indices),
        surfaces=np.stack(surfaces),
        ranges=np.array(ranges, np.uint32),
        spheres=np.array(spheres),
    )


def surface_texels(surfaces: np.ndarray) -> np.ndarray:
    """(rows, 10 x blocks, 4) float32: the surface table as a texture."""
    texels = surfaces.view(np.float32).reshape(-1, _SURFACE_TEXELS, 4)
    if len(texels) <= _SURFACE_ROWS:
        return texels
    blocks = -(-len(texels) // _SURFACE_ROWS)
    padded = np.zeros((blocks * _SURFACE_ROWS, _SURFACE_TEXELS, 4), np.float32)
    padded[: len(texels)] = texels
    by_block = padded.reshape(blocks, _SURFACE_ROWS, _SURFACE_TEXELS, 4)
    return by_block.transpose(1, 0, 2, 3).reshape(_SURFACE_ROWS, -1, 4)


def draw_commands(ranges: np.ndarray, visible: np.ndarray) -> np.ndarray:
    """(n, 5) uint32 commands of glMultiDrawElementsIndirect for the drawables numbered `visible`."""
    commands = np.zeros((len(visible), 5), np.uint32)
    commands[:, 0] = ranges[visible, 1]
    commands[:, 1] = 1
    commands[:, 2] = ranges[visible, 0]
    return commands


def _by_surface(mesh: Mesh) -> tuple[np.ndarray | None, np.ndarray, np.ndarray]:
    """(which vertices, their parts, indices): a vertex of two parts is doubled. None: all as they are."""
    part = np.zeros(len(mesh.vertices), np.uint32)
    part[mesh.faces] = mesh.face_parts[:, None]
    if (part[mesh.faces] == mesh.face_parts[:, None]).all():
        return None, part, mesh.faces.astype(np.uint32).ravel()
    key = mesh.faces.astype(np.int64) * len(mesh.part_names) + mesh.face_parts[:, None]
    unique, inverse = np.unique(key, return_inverse=True)
    index, part = np.divmod(unique, len(mesh.part_names))
    return index, part.astype(np.uint32), inverse.astype(np.uint32).ravel()


def _in_world(drawable: Drawable, index: np.ndarray | None, time_s: float) -> tuple[np.ndarray, np.ndarray]:
    """(V, 3) float32 points rotation (points * scale) + position, and their unit normals."""
    points, normals = drawable.mesh.vertices, drawable.mesh.normals
    if index is not None:
        points, normals = points[index], normals[index]
    (rotation, position), scale = drawable.pose(time_s), np.array(drawable.transform.scale)
    world = points @ (rotation * scale).astype(np.float32).T + position.astype(np.float32)
    turned = normals @ (rotation / scale).astype(np.float32).T
    turned /= np.maximum(np.sqrt(np.einsum("ij,ij->i", turned, turned))[:, None], np.float32(1e-20))
    return world, turned


def _surface(
    drawable: Drawable, material: Material, layer: Layer, thickness_m: float, time_s: float
) -> np.ndarray:
    surface = np.zeros((), SURFACE)
    surface["place"][:, :3], surface["place"][:, 3] = drawable.pose(time_s)
    surface["tiles_per_m"] = 1.0 / material.tile_m
    surface["colour_a"], surface["colour_b"], surface["colour_c"] = material.colours
    turn = np.radians(material.rotation_deg)
    surface["turn_cos"], surface["turn_sin"] = np.cos(turn), np.sin(turn)
    surface["roughness_scale"] = material.roughness_scale
    surface["layer"] = layer.index
    surface["slope_scale"] = layer.slope_scale * material.relief_scale
    surface["specular"] = drawable.specular
    surface["clearcoat"] = material.clearcoat
    surface["clearcoat_alpha"] = max(material.clearcoat_roughness, _SMOOTHEST) ** 2
    surface["sheen"] = material.sheen
    surface["translucency"] = material.translucency
    surface["glow"] = drawable.glow
    surface["emission"] = material.emission
    surface["transmission"] = material.transmission
    surface["object_id"] = drawable.object_id + 1
    surface["patched"] = material.patched
    surface["thickness_m"] = thickness_m
    return surface


_GLASS_SHARE = 0.3
"""Thickness of glass relative to the smallest side of what it is a part of: most are hollow."""

_SMOOTHEST = 0.18
"""MIN_ROUGHNESS in shaders/material.glsl: bounds the highlights of lights without size."""


def _sphere(
    drawable: Drawable, low: np.ndarray, high: np.ndarray, time_s: float
) -> tuple[float, float, float, float]:
    scale = np.array(drawable.transform.scale)
    rotation, position = drawable.pose(time_s)
    x, y, z = (float(c) for c in rotation @ ((low + high) / 2 * scale) + position)
    return (x, y, z, float(np.linalg.norm((high - low) * scale) / 2))
