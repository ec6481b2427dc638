"""Surfaces that shine light their neighbourhood: each becomes a light of the same power.

    I = L A / 4      mean radiant intensity of a convex body of surface A and radiance L

placed at its centroid, as large as a sphere of that surface, and shaded by everything but itself.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fsid.render.drawable import BACKGROUND_ID, Drawable
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
            if material.emission <= 0:
                continue
            faces = drawable.mesh.faces[drawable.mesh.face_parts == part]
            if not len(faces):
                continue
            centroid, area = _extent(drawable, faces, time_s)
            intensity = material.emission * albedo_of(material) * area / 4
            r, g, b = (float(c) for c in intensity)
            x, y, z = (float(c) for c in centroid)
            radius = float(np.sqrt(area / (4 * np.pi)))
            light = Light("point", (x, y, z), (0.0, 0.0, -1.0), (r, g, b), radius, 360.0)
            found.append((r + g + b, Source(light, number)))
    found.sort(key=lambda pair: -pair[0])
    return [source for _, source in found[:MAX_LAMPS]]


def _extent(drawable: Drawable, faces: np.ndarray, time_s: float) -> tuple[np.ndarray, float]:
    """Centroid (3,) in the world and surface in m^2 of some faces."""
    rotation, position = drawable.pose(time_s)
    points = drawable.mesh.vertices[faces] * np.array(drawable.transform.scale)
    cross = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    areas = np.linalg.norm(cross, axis=1) / 2
    total = float(areas.sum())
    centre = (points.mean(1) * areas[:, None]).sum(0) / max(total, 1e-12)
    return rotation @ centre + position, total
