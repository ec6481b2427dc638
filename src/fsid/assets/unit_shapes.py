"""Unit shapes that solids are pushed out of: the subdivided icosahedron and the rounded box.

Both are the same for every solid of a level or a number of steps, so they are kept.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from fsid.assets.surfaces import face_normals, grid_faces, lengths


@lru_cache(maxsize=8)
def box_template(steps: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit directions (V, 3), signs of the core's corners (V, 3) and faces (F, 3) of a rounded box."""
    bend = np.tan(np.linspace(0, np.pi / 4, steps + 1))
    slope = np.r_[-bend[::-1], bend]
    side = np.r_[-np.ones(steps + 1), np.ones(steps + 1)]
    u, v = (grid.ravel() for grid in np.meshgrid(slope, slope))
    su, sv = (grid.ravel() for grid in np.meshgrid(side, side))
    one = np.ones_like(u)
    grid = grid_faces(len(slope), len(slope))
    directions: list[np.ndarray] = []
    signs: list[np.ndarray] = []
    faces: list[np.ndarray] = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            order = [(axis + 1) % 3, (axis + 2) % 3, axis]
            directions.append(np.stack([u, v, sign * one])[np.argsort(order)].T)
            signs.append(np.stack([su, sv, sign * one])[np.argsort(order)].T)
            faces.append((grid if sign > 0 else grid[:, ::-1]) + len(faces) * len(u))
    out = np.vstack(directions)
    return out / lengths(out), np.vstack(signs), np.vstack(faces)


@lru_cache(maxsize=8)
def icosphere(level: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit directions (10 * 4^level + 2, 3) and faces (20 * 4^level, 3) of a divided icosahedron."""
    g = (1 + 5**0.5) / 2
    points = np.array([p for s in (1, -1) for t in (g, -g) for p in ((0, s, t), (s, t, 0), (t, 0, s))], float)
    gaps = np.linalg.norm(points[:, None] - points[None], axis=-1)
    near = (gaps > 0) & (gaps < 2.1)
    faces = np.array(
        [
            (a, b, c)
            for a in range(12)
            for b in range(a)
            for c in range(b)
            if near[a, b] and near[b, c] and near[a, c]
        ]
    )
    flip = np.einsum("fi,fi->f", face_normals(points, faces), points[faces[:, 0]]) < 0
    faces[flip] = faces[flip][:, ::-1]
    for _ in range(level):
        points, faces = _split(points, faces)
    return points / lengths(points), faces


def _split(points: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each triangle into four, new points on the sphere."""
    points = points / lengths(points)
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    unique, where = np.unique(edges, axis=0, return_inverse=True)
    ab, bc, ca = where.reshape(3, -1) + len(points)
    a, b, c = faces.T
    middle = points[unique].sum(1)
    split = np.concatenate([np.stack(t, 1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
    return np.vstack([points, middle / lengths(middle)]), split
