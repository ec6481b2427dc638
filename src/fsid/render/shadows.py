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
        ("first_tile", "i4"),
        ("tile_count", "i4"),
        ("padding", "2i4"),
    ]
)
"""std430 layout of `struct Light` in shaders/lights.glsl."""

TILE = np.dtype([("axes", "(3,4)f4"), ("place", "4f4")])
"""std430 layout of `struct Tile`: rows right, up, forward, the last with the focal length."""


@dataclass(frozen=True)
class Tile:
    """origin: (3,) metres. axes: (3, 3) rows right, up, forward. focal: in half tiles. corner: (x, y) texels."""

    origin: np.ndarray
    axes: np.ndarray
    focal: float
    corner: tuple[int, int]


@dataclass(frozen=True)
class ShadowPlan:
    """The tiles of all lights in an atlas of `size` texels, `tile_px` a side each; and the two GPU tables."""

    tiles: list[Tile]
    size: tuple[int, int]
    tile_px: int
    light_table: np.ndarray
    tile_table: np.ndarray


def plan_shadows(lights: Sequence[Light]) -> ShadowPlan:
    """Tiles of every light: 1024 texels a side for up to four point lights, 512 for more."""
    fields = [_fields(light) for light in lights]
    count = sum(len(f) for f in fields)
    tile_px = 1024 if count <= 4 * 6 else 512
    tiles: list[Tile] = []
    light_table = np.zeros(len(lights), LIGHT)
    for light, field, row in zip(lights, fields, light_table, strict=True):
        _fill(row, light, len(tiles), len(field))
        for axes, half_tan in field:
            y, x = divmod(len(tiles), _COLUMNS)
            focal = 1.0 / (half_tan + BORDER)
            tiles.append(Tile(np.array(light.position_m), axes, focal, (x * tile_px, y * tile_px)))
    size = (max(1, min(count, _COLUMNS)) * tile_px, max(1, -(-count // _COLUMNS)) * tile_px)
    return ShadowPlan(tiles, size, tile_px, light_table, _tile_table(tiles, size, tile_px))


def _fields(light: Light) -> list[tuple[np.ndarray, float]]:
    """(axes, tangent of the half field) of each tile of a light."""
    if light.kind == "spot" and light.cone_deg <= _WIDEST_SPOT_DEG:
        return [(_axes_along(np.array(light.direction)), float(np.tan(np.radians(light.cone_deg) / 2)))]
    directions = [sign * np.eye(3)[axis] for axis in range(3) for sign in (1.0, -1.0)]
    return [(_axes_along(direction), 1.0) for direction in directions]


def _axes_along(forward: np.ndarray) -> np.ndarray:
    """(3, 3) rows right, up, forward, all along world axes where `forward` is one."""
    forward = forward / np.linalg.norm(forward)
    helper = np.eye(3)[int(np.argmin(np.abs(forward)))]
    right = np.cross(forward, helper)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), forward])


def _fill(row: np.void, light: Light, first_tile: int, tile_count: int) -> None:
    row["position"], row["radius_m"], row["colour"] = light.position_m, light.radius_m, light.colour
    row["direction"] = np.array(light.direction) / max(float(np.linalg.norm(light.direction)), 1e-12)
    half = np.radians(light.cone_deg) / 2
    is_spot = light.kind == "spot"
    row["cos_outer"] = np.cos(half) if is_spot else -2.0
    row["cos_inner"] = np.cos(0.8 * half) if is_spot else -1.5
    row["first_tile"], row["tile_count"] = first_tile, tile_count


def _tile_table(tiles: Sequence[Tile], size: tuple[int, int], tile_px: int) -> np.ndarray:
    table = np.zeros(max(1, len(tiles)), TILE)
    for row, tile in zip(table, tiles, strict=False):
        row["axes"][:, :3] = tile.axes
        row["axes"][2, 3] = tile.focal
        row["place"] = (*np.divide(tile.corner, size), *np.divide(tile_px, size))
    return table
