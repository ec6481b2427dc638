"""Shadow maps: depth as seen from each light, in the square tiles of one atlas.

A spot needs one tile along its direction, a point light six (the sides of a cube). Every tile shows a border
beyond its own field, so that the taps of a soft shadow never leave it. Window depth is 1 - near / z, in which
the plane of the receiver is linear over the tile: each tap compares against that plane (no acne on slopes).
Nothing here depends on what was rendered before: the atlas has the size that this scene's lights need.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fsid.scene.model import Light

BORDER = 0.17
"""Width of a tile's border in tangent units; MAX_FILTER in shaders/lights.glsl stays below it."""

NEAR_M = 0.02
_WIDEST_SPOT_DEG = 120.0
_COLUMNS = 6

LIGHT = np.dtype(
    [
        ("position", "3f4"),
        ("radius_m", "f4"),
        ("direction", "3f4"),
        ("cos_outer", "f4"),
        ("colour", "3f4"),
        ("cos_inner", "f4"),
        ("right", "3f4"),
        ("focal", "f4"),
        ("up", "4f4"),
        ("first_tile", "i4"),
        ("tile_count", "i4"),
        ("padding", "2i4"),
    ]
)
"""std430 layout of `struct Light` in shaders/lights.glsl."""


@dataclass(frozen=True)
class Tile:
    """origin: (3,) metres. axes: (3, 3) rows right, up, forward. focal: in half tiles. corner: texels."""

    origin: np.ndarray
    axes: np.ndarray
    focal: float
    corner: tuple[int, int]


@dataclass(frozen=True)
class ShadowPlan:
    """The tiles of all lights in an atlas of `size` texels, `tile_px` a side each; and the lights' table."""

    tiles: list[Tile]
    size: tuple[int, int]
    tile_px: int
    light_count: int
    table: np.ndarray


def plan_shadows(lights: Sequence[Light]) -> ShadowPlan:
    """Tiles of every light: 1024 texels a side for up to four point lights, 512 for more."""
    fields = [_fields(light) for light in lights]
    count = sum(len(f) for f in fields)
    tile_px = 1024 if count <= 4 * len(_SIDES) else 512
    tiles: list[Tile] = []
    table = np.zeros(max(1, len(lights)), LIGHT)
    for light, field, row in zip(lights, fields, table, strict=False):
        first = len(tiles)
        for axes, half_tan in field:
            y, x = divmod(len(tiles), _COLUMNS)
            corner = (x * tile_px, y * tile_px)
            tiles.append(Tile(np.array(light.position_m), axes, 1.0 / (half_tan + BORDER), corner))
        _fill(row, light, first, tiles[first:])
    size = (max(1, min(count, _COLUMNS)) * tile_px, max(1, -(-count // _COLUMNS)) * tile_px)
    return ShadowPlan(tiles, size, tile_px, len(lights), table)


def _fields(light: Light) -> list[tuple[np.ndarray, float]]:
    """(axes, tangent of the half field) of each tile of a light."""
    if light.kind == "spot" and light.cone_deg <= _WIDEST_SPOT_DEG:
        return [(_axes_along(np.array(light.direction)), float(np.tan(np.radians(light.cone_deg) / 2)))]
    return [(axes, 1.0) for axes in _SIDES]


def _axes_along(forward: np.ndarray) -> np.ndarray:
    """(3, 3) rows right, up, forward."""
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, np.eye(3)[int(np.argmin(np.abs(forward)))])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])


def _fill(row: np.void, light: Light, first_tile: int, tiles: Sequence[Tile]) -> None:
    row["position"], row["radius_m"], row["colour"] = light.position_m, light.radius_m, light.colour
    row["direction"] = np.array(light.direction) / max(float(np.linalg.norm(light.direction)), 1e-12)
    row["cos_outer"], row["cos_inner"] = cone_cosines(light)
    row["right"], row["up"][:3] = tiles[0].axes[:2]
    row["focal"] = tiles[0].focal
    row["first_tile"], row["tile_count"] = first_tile, len(tiles)


def cone_cosines(light: Light) -> tuple[float, float]:
    """Cosines at which a spot is dark and at full strength; below -1 for a point light."""
    if light.kind != "spot":
        return -2.0, -1.5
    half = np.radians(light.cone_deg) / 2
    return float(np.cos(half)), float(np.cos(0.8 * half))


_SIDES = [
    np.roll(np.eye(3), -(axis + 1), axis=0) * np.array([[1.0], [1.0], [sign]])
    for axis in range(3)
    for sign in (1.0, -1.0)
]
"""Axes of the six tiles of a point light, forward +x -x +y -y +z -z; mirrored ones do no harm to depth."""
