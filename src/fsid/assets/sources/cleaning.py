"""Triangles from anywhere -> `Mesh`: welded, decimated, oriented, with normals that keep hard edges.

    normal of a corner = sum of (corner angle * face normal) over the faces that are reached from it across
                         edges at its vertex which bend by less than CREASE_DEG

Files disagree about normals (two thirds of a common library have none) and about which side is out, so both
are derived from the shape alone, in time linear in the number of triangles: a mesh made to be slow is not.
Dense meshes are thinned by vertex clustering (Rossignac and Borrel 1993): it needs no manifold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fsid.assets.mesh import Mesh
from fsid.assets.sources.limits import RefusedError
from fsid.assets.surfaces import MIN_AREA_M2, face_areas, face_normals

KEPT_TRIANGLES = 40_000
"""Of one mesh; a scene holds dozens of them."""

KEPT_PARTS = 12
"""The smaller ones become one, "other"."""

CREASE_DEG = 40.0
_GRID = 2**20
"""Points closer than 1 / _GRID of the largest side are one."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """vertices: (V, 3) float64, any unit. faces: (F, 3) int64. parts: (F,) int64, index into `names`."""

    vertices: np.ndarray
    faces: np.ndarray
    parts: np.ndarray
    names: tuple[str, ...]


def clean(triangles: Triangles) -> Mesh:
    """The mesh of triangles that are already in metres with z up: base on z = 0, footprint centred.

    Raises RefusedError where nothing is left.
    """
    vertices, faces, parts = _without_degenerate(*_finite(triangles))
    vertices, faces = _welded(vertices, faces, _GRID)
    kept = _distinct(faces)
    faces, parts = faces[kept], parts[kept]
    if len(faces) > KEPT_TRIANGLES:
        vertices, faces, parts = _thinned(vertices, faces, parts)
    vertices, faces, parts = _without_degenerate(vertices, faces, parts)
    parts, names = _few_parts(vertices, faces, parts, triangles.names)
    faces = _oriented(vertices, faces)
    vertices, normals, faces = _split_at_creases(vertices, faces)
    low, high = vertices.min(0), vertices.max(0)
    placed = vertices - ((low + high) / 2 * (1, 1, 0) + low * (0, 0, 1))
    return Mesh(
        placed.astype(np.float32),
        normals.astype(np.float32),
        faces.astype(np.int32),
        parts.astype(np.int32),
        names,
    )


def _finite(triangles: Triangles) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    good = np.isfinite(triangles.vertices).all(1)[triangles.faces].all(1)
    return triangles.vertices, triangles.faces[good], triangles.parts[good]


def _without_degenerate(
    vertices: np.ndarray, faces: np.ndarray, parts: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles that have an area, and the vertices that they use."""
    good = face_areas(vertices, faces) > MIN_AREA_M2
    if not good.any():
        raise RefusedError("no triangle with an area")
    used, flat = np.unique(faces[good], return_inverse=True)
    return vertices[used], flat.reshape(-1, 3), parts[good]


def _welded(vertices: np.ndarray, faces: np.ndarray, cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices in the same cell of a grid of `cells` along the largest side become their mean."""
    low = vertices.min(0)
    side = (vertices.max(0) - low).max()
    cell = np.floor((vertices - low) * (cells / side) + 0.5).astype(np.int64)
    _, owner, count = np.unique(
        (cell[:, 0] << 42) | (cell[:, 1] << 21) | cell[:, 2], return_inverse=True, return_counts=True
    )
    means = [np.bincount(owner, vertices[:, i]) / count for i in range(3)]
    return np.stack(means, axis=-1), owner.reshape(-1)[faces]


def _thinned(
    vertices: np.ndarray, faces: np.ndarray, parts: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """At most KEPT_TRIANGLES, on the finest grid found; what a grid leaves grows with its square."""
    cells = 2048
    while True:
        thin_vertices, thin = _welded(vertices, faces, cells)
        kept = _distinct(thin)
        if len(kept) <= KEPT_TRIANGLES:
            return thin_vertices, thin[kept], parts[kept]
        cells = int(cells * min(0.95, 0.98 * np.sqrt(KEPT_TRIANGLES / len(kept))))


def _distinct(faces: np.ndarray) -> np.ndarray:
    """Indices of the first of each set of triangles that have the same corners, without collapsed ones."""
    corners = np.sort(faces, axis=1)
    good = np.flatnonzero((corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]))
    a, b, c = corners[good].T
    order = np.lexsort((c, b, a))
    same = np.all([np.diff(side[order]) == 0 for side in (a, b, c)], axis=0)
    return np.sort(good[order[np.r_[True, ~same]]]) if len(good) else good


def _few_parts(
    vertices: np.ndarray, faces: np.ndarray, parts: np.ndarray, names: tuple[str, ...]
) -> tuple[np.ndarray, tuple[str, ...]]:
    """The KEPT_PARTS - 1 largest parts in the file's order, the rest as one."""
    area = np.bincount(parts, face_areas(vertices, faces), minlength=len(names))
    present = np.flatnonzero(area > 0)
    if len(present) > KEPT_PARTS:
        largest = np.sort(present[np.argsort(-area[present], kind="stable")[: KEPT_PARTS - 1]])
    else:
        largest = present
    renumber = np.full(len(names), len(largest))
    renumber[largest] = np.arange(len(largest))
    kept = tuple(names[i] for i in largest)
    return renumber[parts], kept if len(largest) == len(present) else (*kept, "other")


def _edge_pairs(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Half edges (3 * face + corner, from that corner to the next) that are the only two at their edge."""
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    edge = np.minimum(start, end) * (faces.max() + 1) + np.maximum(start, end)
    order = np.argsort(edge, kind="stable")
    _, first, count = np.unique(edge[order], return_index=True, return_counts=True)
    pair = first[count == 2]
    return order[pair], order[pair + 1]


def _oriented(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Faces turned so that neighbours agree and each connected piece encloses a positive volume.

    Every face is two nodes of a graph, as given and turned over; neighbours link the nodes that agree.
    A flat piece keeps the side that most of its area had.
    """
    half_a, half_b = _edge_pairs(faces)
    a, b = half_a // 3, half_b // 3
    agree = (faces.reshape(-1)[half_a] != faces.reshape(-1)[half_b]).astype(np.int64)
    count = len(faces)
    rows = np.r_[a, a + count]
    columns = np.r_[b + (1 - agree) * count, b + agree * count]
    _, label = connected_components(coo_array((np.ones(len(rows)), (rows, columns)), (2 * count, 2 * count)))
    given, turned = label[:count], label[count:]
    piece = np.minimum(given, turned)
    side = np.where(given == piece, 1.0, -1.0)
    cross = face_normals(vertices, faces)
    area = np.linalg.norm(cross, axis=1) / 2
    centre = vertices[faces].mean(1)
    weight = np.maximum(np.bincount(piece, area), 1e-30)
    middle = np.stack([np.bincount(piece, area * centre[:, i]) / weight for i in range(3)], axis=-1)
    volume = np.bincount(piece, side * ((centre - middle[piece]) * cross).sum(1) / 6)
    flat = np.abs(volume) < 1e-3 * weight**1.5
    volume = np.where(flat, np.bincount(piece, side * area), volume)
    turn = side * np.where(volume < 0, -1.0, 1.0)[piece] < 0
    out = faces.copy()
    out[turn] = out[turn][:, ::-1]
    return out


def _split_at_creases(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, normals and faces with one vertex per smooth fan of corners."""
    cross = face_normals(vertices, faces)
    normal = cross / np.linalg.norm(cross, axis=1, keepdims=True)
    half_a, half_b = _edge_pairs(faces)
    smooth = (normal[half_a // 3] * normal[half_b // 3]).sum(1) > np.cos(np.radians(CREASE_DEG))
    smooth &= faces.reshape(-1)[half_a] != faces.reshape(-1)[half_b]
    half_a, half_b = half_a[smooth], half_b[smooth]
    next_a, next_b = (h // 3 * 3 + (h + 1) % 3 for h in (half_a, half_b))
    rows, columns = np.r_[half_a, next_a], np.r_[next_b, half_b]
    size = faces.size
    _, fan = connected_components(coo_array((np.ones(len(rows)), (rows, columns)), (size, size)))
    weighted = np.repeat(normal, 3, axis=0) * _corner_angles(vertices, faces)[:, None]
    fans = int(fan.max()) + 1
    sums = np.stack([np.bincount(fan, weighted[:, i], fans) for i in range(3)], axis=-1)
    any_corner = np.zeros(fans, np.int64)
    any_corner[fan] = np.arange(size)
    length = np.linalg.norm(sums, axis=1, keepdims=True)
    normals = np.where(length > 1e-9, sums / np.maximum(length, 1e-9), normal[any_corner // 3])
    return vertices[faces.reshape(-1)[any_corner]], normals, fan.reshape(-1, 3)


def _corner_angles(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(3 F,) interior angles, radians."""
    corners = vertices[faces]
    forward = np.roll(corners, -1, axis=1) - corners
    forward /= np.linalg.norm(forward, axis=2, keepdims=True)
    cosine = -(forward * np.roll(forward, 1, axis=1)).sum(2)
    return np.arccos(np.clip(cosine, -1.0, 1.0)).reshape(-1)
