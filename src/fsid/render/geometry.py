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
    shapes = {mesh: _shape_of(mesh) for mesh in {drawable.mesh for drawable in drawables}}
    shape_of = [shapes[drawable.mesh] for drawable in drawables]
    whole = Geometry(
        world=np.empty((sum(len(shape.points) for shape in shape_of), 3), np.float32),
        vertices=np.empty(sum(len(shape.points) for shape in shape_of), VERTEX),
        indices=np.empty(sum(len(shape.indices) for shape in shape_of), np.uint32),
        surfaces=np.empty(sum(len(drawable.materials) for drawable in drawables), SURFACE),
        ranges=np.empty((len(drawables), 2), np.uint32),
        spheres=np.empty((len(drawables), 4)),
    )
    vertex = index = number = 0
    for i, (drawable, shape) in enumerate(zip(drawables, shape_of, strict=True)):
        rows, last = slice(vertex, vertex + len(shape.points)), index + len(shape.indices)
        rotation, position = drawable.pose(time_s)
        _to_world(drawable, shape, (rotation, position), whole.world[rows], whole.vertices["normal"][rows])
        clear = np.array([m.transmission >= CLEAR for m in drawable.materials], np.uint32)
        numbers = np.arange(number, number + len(clear), dtype=np.uint32) | clear << 31
        whole.vertices["surface"][rows] = numbers.take(shape.part)
        np.add(shape.indices, np.uint32(vertex), out=whole.indices[index:last])
        thickness_m = drawable.thickness_m(shape.high - shape.low)
        for material in drawable.materials:
            surface = _surface(drawable, material, layer_of(material), thickness_m)
            surface["place"][:, :3], surface["place"][:, 3] = rotation, position
            whole.surfaces[number] = surface
            number += 1
        whole.ranges[i] = index, len(shape.indices)
        whole.spheres[i] = _sphere(drawable, shape, (rotation, position))
        vertex, index = rows.stop, last
    return whole


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


@dataclass(frozen=True, eq=False)
class _Shape:
    """A mesh as it is drawn. points, normals: (V, 3) float32, twice where a vertex is of two parts.

    part: (V,) uint32. indices: (3 F,) uint32. low, high: (3,) corners of its box.
    """

    points: np.ndarray
    normals: np.ndarray
    part: np.ndarray
    indices: np.ndarray
    low: np.ndarray
    high: np.ndarray


def _shape_of(mesh: Mesh) -> _Shape:
    low, high = (np.array([f(column) for column in mesh.vertices.T]) for f in (np.min, np.max))
    part = np.zeros(len(mesh.vertices), np.uint32)
    corners = mesh.faces.T
    for corner in corners:
        part[corner] = mesh.face_parts
    if all((part.take(corner) == mesh.face_parts).all() for corner in corners):
        indices = mesh.faces.astype(np.uint32).ravel()
        return _Shape(mesh.vertices, mesh.normals, part, indices, low, high)
    key = mesh.faces.astype(np.int64) * len(mesh.part_names) + mesh.face_parts[:, None]
    unique, inverse = np.unique(key, return_inverse=True)
    index, part = np.divmod(unique, len(mesh.part_names))
    points, normals = mesh.vertices[index], mesh.normals[index]
    return _Shape(points, normals, part.astype(np.uint32), inverse.astype(np.uint32).ravel(), low, high)


def _to_world(
    drawable: Drawable,
    shape: _Shape,
    pose: tuple[np.ndarray, np.ndarray],
    world: np.ndarray,
    normals: np.ndarray,
) -> None:
    """Into `world` and `normals` (V, 3): points rotation (points * scale) + position, and unit normals."""
    (rotation, position), scale = pose, np.array(drawable.transform.scale)
    np.matmul(shape.points, (rotation * scale).astype(np.float32).T, out=world)
    world += position.astype(np.float32)
    turned = shape.normals @ (rotation / scale).astype(np.float32).T
    length = np.sqrt(np.einsum("ij,ij->i", turned, turned))[:, None]
    np.divide(turned, np.maximum(length, np.float32(1e-20)), out=normals)


def _surface(drawable: Drawable, material: Material, layer: Layer, thickness_m: float) -> np.ndarray:
    """A row of the table, without its place."""
    surface = np.zeros((), SURFACE)
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


_SMOOTHEST = 0.18
"""MIN_ROUGHNESS in shaders/material.glsl: bounds the highlights of lights without size."""


def _sphere(drawable: Drawable, shape: _Shape, pose: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """(4,) world centre and radius."""
    (rotation, position), scale = pose, np.array(drawable.transform.scale)
    middle = rotation @ ((shape.low + shape.high) / 2 * scale) + position
    return np.array([*middle, np.linalg.norm((shape.high - shape.low) * scale) / 2])
