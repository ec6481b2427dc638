"""What things come to rest on: a height map of all that has been put down so far.

    an object comes down until its underside meets the map:   z = max over its points of (top - underside)

Bounding boxes would let things hover over bowls, chairs and anything tilted; points spread evenly over the
surface of a mesh meet where the meshes do, to within a cell.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from fsid.assets import build_mesh, ground_height_m
from fsid.assets.surfaces import cross
from fsid.scene.surroundings import Space

CELL_M = 0.02
REACH_M = 2.4
"""The map covers this far around the origin; beyond, things rest on the ground."""

_SPREAD_POINTS = 1500
_VERTICES = 1500
_FOOT = 0.1
"""Part of an object's height, from below, that is its foot."""


@lru_cache(maxsize=256)
def surface_points(family: str, seed: int) -> np.ndarray:
    """(3, P) float32 points of a mesh, evenly by area, with some of its vertices and its extreme ones."""
    mesh = build_mesh(family, seed)
    vertices = mesh.vertices
    a, b, c = (vertices.take(mesh.faces[:, k], axis=0) for k in range(3))
    ab, ac = b - a, c - a
    area = np.cumsum(np.linalg.norm(cross(ab, ac), axis=1))
    step = np.arange(_SPREAD_POINTS)
    face = np.searchsorted(area, (step + 0.5) / _SPREAD_POINTS * area[-1])
    # The R2 sequence (Roberts 2018): pairs that fill the square evenly, folded into a triangle.
    u, v = np.mod(0.5 + step * 0.7548776662466927, 1.0), np.mod(0.5 + step * 0.5698402909980532, 1.0)
    u, v = np.where(u + v > 1, (1 - u, 1 - v), (u, v))
    spread = a[face] + u[:, None] * ab[face] + v[:, None] * ac[face]
    extreme = np.r_[vertices.argmin(0), vertices.argmax(0)]
    stride = max(1, len(vertices) // _VERTICES)
    points = np.concatenate([spread, vertices[::stride], vertices[extreme]])
    return np.ascontiguousarray(points.T, np.float32)


class Relief:
    """The height map of one scene while it is being filled."""

    def __init__(self, space: Space) -> None:
        size = int(2 * REACH_M / CELL_M)
        at = np.abs((np.arange(size) + 0.5) * CELL_M - REACH_M)
        on_ground = (at[:, None] <= space.ground[0]) & (at[None, :] <= space.ground[1])
        self._ground = np.where(on_ground, np.float32(0.0), np.float32(space.floor_m))
        self._tops = self._ground.copy()
        self._floor_m = np.float32(space.floor_m)
        self._open_air_m = space.open_air_m

    def rest_m(self, points: np.ndarray, place: np.ndarray, limit_m: float) -> float:
        """Height of an object of points (3, P), moved by place (2,), that rests on what is below limit_m."""
        cells, inside = self._cells(points, place)
        tops, ground = self._tops[cells], self._ground[cells]
        supports = np.where(tops < limit_m, tops, ground) - points[2, inside]
        outside = self._floor_m - points[2, ~inside]
        return float(max(supports.max(initial=-np.inf), outside.max(initial=-np.inf)))

    def hill_m(self, points: np.ndarray, place: np.ndarray) -> float:
        """How far hills lift an object of points (3, P), moved by place (2,).

        To the lowest ground under its foot, so that on a slope no part of that hangs in the air.
        """
        if self._open_air_m is None:
            return 0.0
        height = points[2] - points[2].min()
        foot = points[:2, height <= _FOOT * height.max()] + place[:, None]
        return float(ground_height_m(self._open_air_m, *foot).min())

    def add(self, points: np.ndarray) -> None:
        """Put down an object whose surface holds these points (3, P) of the world."""
        cells, inside = self._cells(points, np.zeros(2))
        np.maximum.at(self._tops, cells, points[2, inside])

    def _cells(
        self, points: np.ndarray, place: np.ndarray
    ) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
        """Rows and columns of the points on the map, and which points (P,) those are."""
        at = ((points[:2] + (place[:, None] + REACH_M).astype(np.float32)) / CELL_M).astype(np.int32)
        size = len(self._tops)
        inside = (at[0] >= 0) & (at[0] < size) & (at[1] >= 0) & (at[1] < size)
        return (at[0, inside], at[1, inside]), inside
