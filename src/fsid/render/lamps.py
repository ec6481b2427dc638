"""Surfaces that shine light their neighbourhood: each becomes a light of the same power.

    I = L A / 4      mean radiant intensity of a convex body of surface A and radiance L

placed at its centroid, as large as a sphere of that surface, and shaded by everything but itself and what
it touches.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from trimesh.triangles import closest_point

from fsid.assets import Mesh
from fsid.render.drawable import BACKGROUND_ID, CLEAR, Drawable
from fsid.render.shadows import Source
from fsid.scene.model import Light, Material

MAX_LAMPS = 12
"""The strongest ones; each costs as much as a point light."""


def lamps_of(
    drawables: Sequence[Drawable], albedo_of: Callable[[Material], np.ndarray], time_s: float
) -> list[Source]:
    """A light per shining part of an object, strongest first. albedo_of: mean albedo (3,) of a material."""
    found: list[tuple[float, Source]] = []
    for number, drawable in enumerate(drawables):
        if drawable.object_id == BACKGROUND_ID:
            continue
        for part, material in enumerate(drawable.materials):
            if material.emission <= 0 or part not in drawable.mesh.face_parts:
                continue
            centroid, area = _extent(drawable, part)
            rotation, position = drawable.pose(time_s)
            intensity = material.emission * albedo_of(material) * area / 4
            r, g, b = (float(c) for c in intensity)
            x, y, z = (float(c) for c in rotation @ centroid + position)
            radius = float(np.sqrt(area / (4 * np.pi)))
            light = Light("point", (x, y, z), (0.0, 0.0, -1.0), (r, g, b), radius, 360.0)
            found.append((r + g + b, Source(light, number)))
    found.sort(key=lambda pair: -pair[0])
    return [source for _, source in found[:MAX_LAMPS]]


def hoods_apart(drawables: Sequence[Drawable]) -> tuple[Drawable, ...]:
    """The same, with the hoods of lamps as drawables of their own: what shades their light."""
    return tuple(piece for drawable in drawables for piece in _hood_apart(drawable))


def _hood_apart(drawable: Drawable) -> list[Drawable]:
    """The parts of a lamp that its light passes through or that touch what shines, and the others."""
    parts = np.unique(drawable.mesh.face_parts)
    lamps = [_extent(drawable, part) for part in parts if drawable.materials[part].emission > 0]
    if not lamps or drawable.object_id == BACKGROUND_ID:
        return [drawable]
    hood = np.zeros(len(drawable.materials), bool)
    hood[parts] = [_is_hood(drawable, part, lamps) for part in parts]
    return [_pieces(drawable, ~hood), _pieces(drawable, hood)] if hood.any() else [drawable]


def _is_hood(drawable: Drawable, part: int, lamps: Sequence[tuple[np.ndarray, float]]) -> bool:
    """Whether a part keeps off the spheres of all lamps, as of `_extent`, and lets no light through."""
    material = drawable.materials[part]
    if material.emission > 0 or material.translucency > 0 or material.transmission >= CLEAR:
        return False
    triangles = _triangles(drawable, part)
    return all(
        np.linalg.norm(closest_point(triangles, np.tile(centre, (len(triangles), 1))) - centre, axis=1).min()
        > np.sqrt(area / (4 * np.pi))
        for centre, area in lamps
    )


def _pieces(drawable: Drawable, wanted: np.ndarray) -> Drawable:
    """The parts of a drawable that are `wanted` (P,)."""
    mesh, numbers = drawable.mesh, np.flatnonzero(wanted)
    faces = wanted[mesh.face_parts]
    used, corners = np.unique(mesh.faces[faces], return_inverse=True)
    pieces = Mesh(
        vertices=mesh.vertices[used],
        normals=mesh.normals[used],
        faces=corners.reshape(-1, 3).astype(np.int32),
        face_parts=np.searchsorted(numbers, mesh.face_parts[faces]).astype(np.int32),
        part_names=tuple(mesh.part_names[number] for number in numbers),
    )
    return replace(drawable, mesh=pieces, materials=tuple(drawable.materials[number] for number in numbers))


def _extent(drawable: Drawable, part: int) -> tuple[np.ndarray, float]:
    """Centroid (3,) of a part, metres before the drawable is turned and moved, and its surface in m^2."""
    points = _triangles(drawable, part)
    cross = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    areas = np.linalg.norm(cross, axis=1) / 2
    total = float(areas.sum())
    return (points.mean(1) * areas[:, None]).sum(0) / max(total, 1e-12), total


def _triangles(drawable: Drawable, part: int) -> np.ndarray:
    """(F, 3, 3) metres, as `_extent`."""
    mesh = drawable.mesh
    return np.asarray(mesh.vertices[mesh.faces[mesh.face_parts == part]] * np.array(drawable.transform.scale))
