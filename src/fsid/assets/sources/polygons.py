"""Faces of many corners -> triangles: a fan from the first corner, ears where that would leave the face.

    fan    fits a face where each of its triangles turns as the face does: ((b - a) x (c - a)) . normal >= 0
    ear    three corners in a row that turn as the face does and have no other corner between them

A simple polygon of more than three corners has two ears (G. H. Meisters, "Polygons have ears", American
Mathematical Monthly 82, 1975), and cutting one off leaves a simple polygon. All faces of one size are cut
together; a cut costs time in proportion to the corners that are left.
"""

from __future__ import annotations

import numpy as np

from fsid.assets.sources.limits import MAX_EAR_WORK, RefusedError

_STEP = 3_000
"""Corners that are looked through in the time that a step takes besides."""


def triangulated(
    vertices: np.ndarray, corners: np.ndarray, sizes: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (T, 3) int64 and the face (T,) of each, of F faces whose corners follow each other.

    vertices: (V, 3). corners: (C,) int64, index into `vertices`. sizes: (F,) int64, corners of each face, at
    least 3. A face that crosses itself gets some triangles. Raises RefusedError where cutting ears would take
    more than about half a minute.
    """
    starts = np.cumsum(sizes) - sizes
    triangles, owners, work = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)], 0
    for size in np.unique(sizes):
        owner = np.flatnonzero(sizes == size)
        faces = corners[starts[owner, None] + np.arange(size)]
        second = np.arange(1, size - 1)
        cuts = np.tile(np.stack([0 * second, second, second + 1], axis=-1), (len(faces), 1, 1))
        bent, flat = _without_fan(vertices, faces)
        if len(bent):
            work += size * max(len(bent) * size, _STEP)
            if work > MAX_EAR_WORK:
                raise RefusedError(f"{len(bent):,} concave faces of {size:,} corners")
            cuts[bent] = _cut(flat)
        triangles.append(np.take_along_axis(faces, cuts.reshape(len(faces), -1), axis=1).reshape(-1, 3))
        owners.append(np.repeat(owner, size - 2))
    return np.concatenate(triangles), np.concatenate(owners)


def _without_fan(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which of faces (F, N) no fan fits, (B,), and these in a plane, counter-clockwise, (B, N, 2)."""
    if faces.shape[1] == 3:
        return np.zeros(0, np.int64), np.zeros((0, 3, 2))
    with np.errstate(all="ignore"):  # points that are not finite are dropped later
        points = vertices[faces]
        edges = points[:, 1:] - points[:, :1]
        cross = np.cross(edges[:, :-1], edges[:, 1:])
        normal = cross.sum(1)
        turn = (cross * normal[:, None]).sum(2)
        bent = np.flatnonzero(turn.min(1) < -1e-9 * (normal * normal).sum(1))
        return bent, _flat(points[bent], normal[bent])


def _flat(points: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """(F, N, 2) faces seen along the axis that is nearest to their normal (F, 3), counter-clockwise."""
    axis = np.abs(normal).argmax(1)[:, None]
    u, v = (np.take_along_axis(points, (axis + i)[..., None] % 3, axis=2)[..., 0] for i in (1, 2))
    return np.stack([u * np.sign(np.take_along_axis(normal, axis, axis=1)), v], axis=-1)


def _cut(points: np.ndarray) -> np.ndarray:
    """(F, N - 2, 3) corners of the triangles of polygons (F, N, 2)."""
    count, size, _ = points.shape
    row = np.arange(count)
    ring = np.tile(np.arange(size), (count, 1))
    ears = np.stack([_is_ear(points, ring, np.full(count, at)) for at in range(size)], axis=1)
    triangles = []
    while ring.shape[1] > 3:
        at = ears.argmax(1)  # the first corner where there is no ear
        triangles.append(_around(ring, at))
        left = np.arange(ring.shape[1]) != at[:, None]
        ring, ears = (of[left].reshape(count, -1) for of in (ring, ears))
        for changed in (at - 1, at % ring.shape[1]):
            ears[row, changed] = _is_ear(points, ring, changed)
    return np.stack([*triangles, ring], axis=1)


def _around(ring: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(F, 3) corners before, at and after a place (F,) of each ring (F, M)."""
    return np.take_along_axis(ring, (at[:, None] + (-1, 0, 1)) % ring.shape[1], axis=1)


def _is_ear(points: np.ndarray, ring: np.ndarray, at: np.ndarray) -> np.ndarray:
    """(F,) whether the triangle at a place of each ring turns left and no other corner is in or on it."""
    row = np.arange(len(points))[:, None]
    corner = points[row, _around(ring, at)]
    others = points[row, ring]
    inside = np.ones(ring.shape, bool)
    for i in range(3):
        a, b = corner[:, i, None], corner[:, (i + 1) % 3, None]
        along, across = b - a, others - a
        inside &= along[..., 0] * across[..., 1] >= along[..., 1] * across[..., 0]
        inside &= (across != 0).any(2)
    before, after = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 1]
    return (before[:, 0] * after[:, 1] > before[:, 1] * after[:, 0]) & ~inside.any(1)
