"""Triangulated surfaces: faces of grids, areas and normals of triangles.

    (b - a) x (c - a)  =  normal of a triangle, twice its area long

so the sum over the triangles about a vertex is its normal weighted by area. vertices (V, 3) in metres,
faces (F, 3) numbers of vertices, counter-clockwise from outside.
"""

from __future__ import annotations

import numpy as np

MIN_AREA_M2 = 1e-10
"""Triangles smaller than this are dropped: 10 um squared, below anything that a pixel can see."""


def smooth_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(V, 3) area-weighted vertex normals of welded triangles."""
    normals = face_normals(vertices, faces)
    total = np.stack(
        [np.bincount(faces.T.ravel(), np.tile(normals[:, k], 3), len(vertices)) for k in range(3)], axis=1
    )
    return total / np.maximum(lengths(total), 1e-30)


def face_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F, 3) normals of triangles, twice their areas long."""
    a, b, c = (vertices.take(faces[:, k], axis=0) for k in range(3))
    return cross(b - a, c - a)


def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """(..., 3) cross products of two (..., 3); `numpy.cross` spends most of its time on moving axes."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape), np.result_type(a, b))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.subtract(a[..., j] * b[..., k], a[..., k] * b[..., j], out=out[..., i])
    return out


def face_areas(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(F,) areas of triangles, square metres."""
    return lengths(face_normals(vertices, faces))[:, 0] / 2


def lengths(vectors: np.ndarray) -> np.ndarray:
    """(..., 1) lengths of (..., 3)."""
    return np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None]


def grid_faces(rows: int, cols: int, *, wrap_rows: bool = False, wrap_cols: bool = False) -> np.ndarray:
    """(F, 3): two triangles per cell of a (rows, cols) vertex grid, facing d_cols x d_rows."""
    i = np.arange(rows if wrap_rows else rows - 1)[:, None]
    j = np.arange(cols if wrap_cols else cols - 1)[None]
    a, b = i * cols + j, i * cols + (j + 1) % cols
    c, d = (i + 1) % rows * cols + (j + 1) % cols, (i + 1) % rows * cols + j
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)


def repeated(faces: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """(k F, 3): the faces of one group of vertices, for each of `groups` (k, ..., 3) laid end to end."""
    size = int(np.prod(groups.shape[1:-1]))
    return (faces + np.arange(len(groups))[:, None, None] * size).reshape(-1, 3)
