"""The surroundings as a light source: what comes from six sides, for the ambient light and for reflections.

In a room:

    radiance of a wall point = mean albedo * (E_direct / pi + ambient)      E_direct: lights, without shadows

is laid out on a coarse grid per side; a metal reflects it (so metals are never black). The ambient light
is what walls of their mean radiance (one bounce) give a surface low in the middle of the room, as
irradiance E / pi towards each axis; it is normalised so that the mean over the six axes has the luminance
of `Scene.ambient`: a closed white room gives exactly `ambient` from everywhere.

Out of doors the sides are the sky, so far away that places do not matter. On a surface of normal n it is

    E(n) = sum over axes a of  n_a^2 (E(a) + E(-a)) / 2 + n_a (E(a) - E(-a)) / 2,

which is all of E but for products of two axes and what lies beyond the second order of spherical harmonics, a
hundredth of it under the sky (Ramamoorthi and Hanrahan 2001).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fsid.render.shadows import cone_cosines, unit
from fsid.render.sky import angles
from fsid.scene.colour import LUMINANCE
from fsid.scene.model import Light, Vec3

GRID, FINE_GRID = 16, 64
_AMONG_THINGS = 0.25
"""Height, relative to the room's, at which its ambient light is taken: things stand on the floor."""

SKY_HALF_M = 1e5
_PEAK = 10.0
"""Radiance relative to the mean from which on nothing of a sky may be missed."""


@dataclass(frozen=True, eq=False)
class Room:
    """half_m, centre_m: (3,) of the box. ambient: (6, 3) irradiance / pi towards +x -x +y -y +z -z.

    radiance: (6, G, G, 3) of the walls, rows and columns along the axes (a + 2) % 3 and (a + 1) % 3.
    """

    half_m: np.ndarray
    centre_m: np.ndarray
    ambient: np.ndarray
    radiance: np.ndarray


def light_room(
    size_m: Vec3,
    floor_m: float,
    albedo: np.ndarray,
    glow: np.ndarray,
    lights: Sequence[Light],
    ambient: Vec3,
) -> Room:
    """albedo, glow: (6, 3) mean albedo and own radiance of each side. Lights and ambient as in `Scene`."""
    half = np.array(size_m, dtype=float) / 2
    centre = np.array([0.0, 0.0, floor_m + half[2]])
    direct = np.stack([_irradiance(half, centre, side, lights) for side in range(6)])
    radiance = albedo[:, None, None] * (direct / np.pi + np.array(ambient)) + glow[:, None, None]
    level = direct.mean((1, 2)) @ LUMINANCE / np.pi + float(np.array(ambient) @ LUMINANCE)
    shares = _shares(half, np.array([0.0, 0.0, (2 * _AMONG_THINGS - 1) * half[2]])).sum((2, 3))
    relative = shares @ (albedo * level[:, None] + glow)
    mean = float((relative @ LUMINANCE).mean())
    tint = relative / mean if mean > 0 else np.ones((6, 3))
    return Room(half, centre, tint * np.array(ambient) + shares @ glow, radiance)


def light_sky(panorama: np.ndarray) -> Room:
    """panorama: (H, 2 H, 3) as `fsid.render.sky.panorama`."""
    half = np.full(3, SKY_HALF_M)
    directions = np.stack([_grid(half, np.zeros(3), side, FINE_GRID)[0] for side in range(6)]) / SKY_HALF_M
    most = np.float32(_PEAK) * panorama.mean()
    coarse = np.minimum(panorama, most)
    while len(coarse) > 2 * FINE_GRID and len(coarse) % 2 == 0:
        coarse = (coarse[::2] + coarse[1::2]) / 2
        coarse = (coarse[:, ::2] + coarse[:, 1::2]) / 2
    norm = np.linalg.norm(directions, axis=-1)
    unit_direction = directions / norm[..., None]
    radiance = look_up(coarse, unit_direction)
    _add_peaks(radiance, panorama, most, (2 / FINE_GRID) ** 2 / norm**3)
    shares = _shares(np.ones(3), np.zeros(3))
    return Room(half, np.zeros(3), np.einsum("asij,sijc->ac", shares, radiance), radiance)


def _shares(half: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """(6, 6, FINE_GRID, FINE_GRID): of the irradiance towards each axis, what comes from each cell of each
    side of a box that is as bright everywhere. eye: (3,) metres beside its middle."""
    weight = np.empty((6, 6, FINE_GRID, FINE_GRID))
    for side in range(6):
        points, inward = _grid(half, -eye, side, FINE_GRID)
        cell = half.prod() / half[side // 2]
        weight[:, side] = np.maximum(_AXES @ points[..., None], 0.0)[..., 0].transpose(2, 0, 1)
        weight[:, side] *= -cell * (points @ inward) / (points**2).sum(-1) ** 2
    return np.asarray(weight / weight.sum((1, 2, 3), keepdims=True))


def _add_peaks(radiance: np.ndarray, panorama: np.ndarray, most: float, solid_angle: np.ndarray) -> None:
    """Add what of a panorama is brighter than `most`, by its power, to the cells (6, G, G, 3) that it is in:
    a look-up misses most suns, or takes them several times. solid_angle: (6, G, G) of the cells."""
    texel, colour = np.divmod(np.flatnonzero(panorama > most), 3)
    row, column = np.divmod(texel, panorama.shape[1])
    elevation, azimuth = angles(len(panorama))
    up, around = elevation[row], azimuth[column]
    power = (panorama[row, column, colour] - most) * np.cos(up) * (np.pi / len(panorama)) ** 2
    direction = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
    axis, each = np.abs(direction).argmax(0), np.arange(len(texel))
    along = direction[axis, each]
    at = [direction[(axis + i) % 3, each] / np.abs(along) for i in (2, 1)]
    cells = [((0.5 + 0.5 * x) * FINE_GRID).astype(int).clip(0, FINE_GRID - 1) for x in at]
    place = (2 * axis + (along < 0), *cells)
    np.add.at(radiance, (*place, colour), power / solid_angle[place])


def look_up(panorama: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """(..., 3) radiance of the nearest texel in each unit direction (..., 3)."""
    height, width = panorama.shape[:2]
    row = np.arccos(np.clip(direction[..., 2], -1, 1)) / np.pi * height
    column = np.arctan2(direction[..., 1], direction[..., 0]) / (2 * np.pi) * width
    return np.asarray(panorama[np.clip(row.astype(int), 0, height - 1), np.floor(column).astype(int) % width])


def _irradiance(half: np.ndarray, centre: np.ndarray, side: int, lights: Sequence[Light]) -> np.ndarray:
    """(GRID, GRID, 3) irradiance of the grid points of one side. The sun comes through no wall."""
    points, inward = _grid(half, centre, side, GRID)
    total = np.zeros((GRID, GRID, 3))
    for light in lights:
        if light.kind == "sun":
            continue
        to_light = np.array(light.position_m) - points
        distance = np.maximum(np.linalg.norm(to_light, axis=-1), max(light.radius_m, 0.05))
        cosine = np.maximum(to_light @ inward / distance, 0.0)
        shape = _shape(light, -to_light / distance[..., None])
        area = light.size_m[0] * light.size_m[1]
        reach2 = distance**2 + (area / np.pi if light.kind == "area" else 0.0)
        total += (cosine * shape / reach2)[..., None] * np.array(light.colour)
    return total


def _shape(light: Light, direction: np.ndarray) -> np.ndarray:
    """Strength of a light by direction: a spot as in shaders/lights.glsl, an area by its cosine."""
    if light.kind == "point":
        return np.ones(direction.shape[:-1])
    along = direction @ unit(np.array(light.direction))
    if light.kind == "area":
        return np.maximum(along, 0.0) * light.size_m[0] * light.size_m[1]
    outer, inner = cone_cosines(light)
    t = np.clip((along - outer) / (inner - outer), 0.0, 1.0)
    return t * t * (3 - 2 * t)


def _grid(half: np.ndarray, centre: np.ndarray, side: int, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Cell centres of one side (cells, cells, 3) in the world, and the normal into the room."""
    axis, sign = side // 2, 1.0 - 2.0 * (side % 2)
    at = (np.arange(cells) + 0.5) / cells * 2 - 1
    points = np.zeros((cells, cells, 3))
    points[..., axis] = sign
    points[..., (axis + 1) % 3] = at[None, :]
    points[..., (axis + 2) % 3] = at[:, None]
    return points * half + centre, -sign * np.eye(3)[axis]


_AXES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]], dtype=float)
