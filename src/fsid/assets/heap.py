"""A heap of thin things: each lies on the floor and on those laid before it, and cuts none of them.

    z(x, y) + a + b x + c y >= h(x, y)        h: height of the heap, the highest point in each of its cells

What is laid rests on three points around its middle: of all planes (a, b, c) that lift it out of the heap the
one that lifts its middle least. A sheet that bends sags from there towards what is below it.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.ndimage import minimum_filter

from fsid.assets.solids import Solid
from fsid.assets.surfaces import lengths

BETWEEN = 3
"""Steps between two points of a sheet at which it is compared with the heap."""
SAG = 0.85
"""Share of its height above the heap by which a sheet sags, where it is free."""
STEEPEST = 0.25
"""Slope in metres a metre beyond which nothing leans: it would slide."""

Point = tuple[float, float, float]


class Heap:
    """The heights of a heap within `reach` metres of the origin along x and y; the floor is z = 0."""

    def __init__(self, reach: float, cell: float) -> None:
        self._cell, self._side = cell, 2 * int(reach / cell) + 4
        self._heights = np.zeros(self._side**2)

    def lay(self, points: np.ndarray, thickness: float) -> np.ndarray:
        """(a, b, c) that let the sheet of middle `points` (3, n), a cell apart or less, rest on the heap."""
        x, y, z = points
        cells = self._cells(x, y)
        plane = _resting(x, y, self._heights[cells] + (thickness / 2 - z))
        np.maximum.at(self._heights, cells, z + _at(plane, x, y) + thickness / 2)
        return plane

    def drape(self, grid: np.ndarray, thickness: float) -> np.ndarray:
        """The sheet `grid` (n, m, 3) as it rests on the heap and sags where nothing is close below it."""
        rows, cols = _between(grid.shape[0]), _between(grid.shape[1])
        x, y, z = (rows @ grid.transpose(2, 0, 1) @ cols.T).reshape(3, -1)
        cells = self._cells(x, y)
        free = z - thickness / 2 - self._heights[cells]
        plane = _resting(x, y, -free)
        lift = _at(plane, x, y)
        sag = SAG * _smooth_below((free + lift).reshape(len(rows), -1))
        np.maximum.at(self._heights, cells, z + lift + thickness / 2 - (rows @ sag @ cols.T).ravel())
        x, y, z = grid.transpose(2, 0, 1)
        return np.stack([x, y, z + _at(plane, x, y) - sag], axis=-1)

    def _cells(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        i, j = ((v / self._cell + self._side / 2).astype(int) for v in (x, y))
        return (i * self._side + j).clip(0, self._side**2 - 1)


def middle_points(sheet: Solid, thickness: float, parts: int) -> np.ndarray:
    """(3, n) points between the two sides of a `sheet` that looks up, `parts` to a side of a triangle."""
    up = sheet.faces[sheet.normals[sheet.faces[:, 0], 2] > 0.1]
    corners = (sheet.vertices - sheet.normals * thickness / 2)[up]
    shares = np.array([(i, j, parts - i - j) for i in range(parts + 1) for j in range(parts + 1 - i)]) / parts
    points = (shares @ corners).reshape(-1, 3)
    once = np.unique((points @ (1.0, 7.3, 53.1)).round(7), return_index=True)[1]  # triangles share sides
    return points[once].T


def leant(solids: Solid, planes: np.ndarray) -> Solid:
    """Solids of as many vertices each, as one, each lifted by its plane of `planes` (k, 3)."""
    a, b, c = np.repeat(planes, len(solids.vertices) // len(planes), axis=0).T
    x, y, z = solids.vertices.T
    p, q, r = solids.normals.T
    normals = np.stack([p - b * r, q - c * r, r], axis=1)
    return Solid(np.stack([x, y, z + a + b * x + c * y], axis=1), normals / lengths(normals), solids.faces)


def _at(plane: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return plane[0] + plane[1] * x + plane[2] * y


def _resting(x: np.ndarray, y: np.ndarray, needed: np.ndarray) -> np.ndarray:
    """(a, b, c): of the planes nowhere below `needed` at (x, y) the one lowest at their mean.

    Dual simplex: three points hold the plane around the middle; the highest above it takes the place of one.
    """
    middle = np.array((x.sum(), y.sum())) / len(x)
    places = np.stack([np.ones(len(x)), x - middle[0], y - middle[1]])
    corners: list[Point] = [(1e3, 0.0, -1e6), (-1e3, 1e3, -1e6), (-1e3, -1e3, -1e6)]
    held = [0.5, 0.25, 0.25]  # shares of the corners in the middle
    highest = int(needed.argmax())
    best = np.array((needed[highest], 0.0, 0.0))
    for _ in range(60):
        new = (places.item(1, highest), places.item(2, highest), needed.item(highest))
        parts = _shares(corners, new)
        ratio, out = min((held[i] / parts[i], i) for i in range(3) if parts[i] > 1e-9)
        held = [held[i] - ratio * parts[i] for i in range(3)]
        held[out], corners[out] = ratio, new
        plane = _through(corners)
        above = needed - plane @ places
        highest = int(above.argmax())
        if above[highest] < 1e-7:
            best = plane
            break
    steep = float(np.hypot(best[1], best[2])) / STEEPEST
    if steep > 1:
        best[1:] /= steep
        best[0] += float((needed - best @ places).max())
    best[0] -= best[1:] @ middle
    return best


def _shares(corners: list[Point], point: Point) -> tuple[float, float, float]:
    """Barycentric: shares of three corners in a point, seen from above."""
    (ax, ay, _), (bx, by, _), (cx, cy, _) = corners
    px, py, _ = point
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    second = ((px - ax) * (cy - ay) - (py - ay) * (cx - ax)) / area
    third = ((bx - ax) * (py - ay) - (by - ay) * (px - ax)) / area
    return 1 - second - third, second, third


def _through(corners: list[Point]) -> np.ndarray:
    """(a, b, c) of the plane through three points."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    b = ((bz - az) * (cy - ay) - (cz - az) * (by - ay)) / area
    c = ((bx - ax) * (cz - az) - (cx - ax) * (bz - az)) / area
    return np.array((az - b * ax - c * ay, b, c))


def _smooth_below(free: np.ndarray) -> np.ndarray:
    """Smooth heights at the points of a sheet that, interpolated, are nowhere above `free` between them."""
    low = minimum_filter(free, 4 * BETWEEN + 1)[::BETWEEN, ::BETWEEN]
    return _blur(low.shape[0]) @ low @ _blur(low.shape[1]).T


@cache
def _blur(count: int) -> np.ndarray:
    """(count, count): mean of a point and its neighbours."""
    near = np.abs(np.subtract.outer(np.arange(count), np.arange(count))) < 2
    return near / near.sum(1, keepdims=True)


@cache
def _between(count: int) -> np.ndarray:
    """(BETWEEN (count - 1) + 1, count): linear interpolation between `count` points."""
    at = np.arange(BETWEEN * (count - 1) + 1) / BETWEEN
    return np.maximum(1 - np.abs(at[:, None] - np.arange(count)), 0)
