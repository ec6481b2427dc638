"""The room as a light source: what its six sides send back, for the ambient light and for reflections.

    radiance of a wall point = mean albedo * (E_direct / pi + ambient)      E_direct: lights, without shadows

is laid out on a coarse grid per side; a metal reflects it (so metals are never black). The ambient light
has the colour of `Scene.ambient` times that of each side (one bounce), normalised so that the mean over the
six sides has the luminance of `Scene.ambient`: a closed white room gives exactly `ambient` from everywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fsid.render.shadows import cone_cosines
from fsid.scene.model import Light, Vec3

GRID = 16
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


@dataclass(frozen=True)
class Room:
    """size_m: x, y, z. sides: (6, 3) diffuse ambient radiance that arrives from +x -x +y -y +z -z.

    radiance: (6, GRID, GRID, 3) of the walls, rows and columns along the axes (a + 2) % 3 and (a + 1) % 3.
    """

    size_m: Vec3
    sides: np.ndarray
    radiance: np.ndarray


def light_room(size_m: Vec3, albedo: np.ndarray, lights: Sequence[Light], ambient: Vec3) -> Room:
    """albedo: (6, 3) mean of each side. Lights and ambient as in `Scene`."""
    direct = np.stack([_irradiance(size_m, side, lights) for side in range(6)])
    radiance = albedo[:, None, None] * (direct / np.pi + np.array(ambient))
    relative = (
        albedo * (direct.mean((1, 2)) @ _LUMINANCE / np.pi + float(np.array(ambient) @ _LUMINANCE))[:, None]
    )
    level = float((relative @ _LUMINANCE).mean())
    tint = relative / level if level > 0 else np.ones((6, 3))
    return Room(size_m, tint * np.array(ambient), radiance)


def _irradiance(size_m: Vec3, side: int, lights: Sequence[Light]) -> np.ndarray:
    """(GRID, GRID, 3) irradiance of the grid points of one side."""
    points, inward = _grid(size_m, side)
    total = np.zeros((GRID, GRID, 3))
    for light in lights:
        to_light = np.array(light.position_m) - points
        distance = np.maximum(np.linalg.norm(to_light, axis=-1), max(light.radius_m, 0.05))
        cosine = np.maximum(to_light @ inward / distance, 0.0)
        cone = _cone(light, -to_light / distance[..., None])
        total += (cosine * cone / distance**2)[..., None] * np.array(light.colour)
    return total


def _cone(light: Light, direction: np.ndarray) -> np.ndarray:
    """Strength of a spot by direction, as `arriving` in shaders/lights.glsl."""
    if light.kind != "spot":
        return np.ones(direction.shape[:-1])
    outer, inner = cone_cosines(light)
    along = direction @ (np.array(light.direction) / np.linalg.norm(light.direction))
    t = np.clip((along - outer) / (inner - outer), 0.0, 1.0)
    return t * t * (3 - 2 * t)


def _grid(size_m: Vec3, side: int) -> tuple[np.ndarray, np.ndarray]:
    """Cell centres of one side (GRID, GRID, 3) in the world, and the normal into the room."""
    axis, sign = side // 2, 1.0 - 2.0 * (side % 2)
    at = (np.arange(GRID) + 0.5) / GRID * 2 - 1
    points = np.zeros((GRID, GRID, 3))
    points[..., axis] = sign
    points[..., (axis + 1) % 3] = at[None, :]
    points[..., (axis + 2) % 3] = at[:, None]
    half = np.array(size_m) / 2
    return points * half + (0, 0, half[2]), -sign * np.eye(3)[axis]
