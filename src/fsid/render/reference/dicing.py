"""Micropolygons: triangles split until no edge is longer than a part of a pixel (Cook et al. 1987, "Reyes").

    dice(vertices, normals, faces, view) -> the same surface, each visible edge at most `view.edge_px` long

With vertices this dense a path tracer needs neither texture coordinates nor textures: everything that the
materials say is evaluated once per vertex, with the footprint of a pixel, and interpolated. So meshes
without coordinates are textured by any rule. An edge is halved or not because of the edge alone, so that
neighbours agree and the surface stays closed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fsid.render.parts import Surface

NEAR_M = 0.02
MAX_VERTICES = 12_000_000
_MAX_LEVELS = 24
_UNSEEN = 12.0
"""How much coarser what faces away or lies outside the image is."""


@dataclass(frozen=True, eq=False)
class View:
    """Where pixels are. rotation: (3, 3) rows right, up, forward. position: (3,) metres. focal_px: focal
    length in pixels. half_px: (2,) half width and height. edge_px: longest edge that stays."""

    rotation: np.ndarray
    position: np.ndarray
    focal_px: float
    half_px: np.ndarray
    edge_px: float

    def local(self, points: np.ndarray) -> np.ndarray:
        """(N, 3) world -> right, up, forward in metres."""
        return (points - self.position) @ self.rotation.T

    def seen(self, points: np.ndarray, normals: np.ndarray, margin_px: np.ndarray | float) -> np.ndarray:
        """(N,) bool: in the image, enlarged by a margin, and facing the camera."""
        local = self.local(points)
        depth = np.maximum(local[:, 2], NEAR_M)
        inside = np.abs(local[:, :2]) * (self.focal_px / depth)[:, None] < self.half_px + np.c_[margin_px]
        facing = ((self.position - points) * normals).sum(1) > -0.1 * np.linalg.norm(local, axis=1)
        return inside.all(1) & (local[:, 2] > 0) & facing


def dice(surface: Surface, view: View) -> Surface:
    """The surface in micropolygons; the vertices that were there stay the first ones."""
    vertices, normals, faces = surface.vertices, surface.normals, surface.faces
    done = []
    for _ in range(_MAX_LEVELS):
        edges, edge_of = _edges(faces, len(vertices))
        split = _too_long(vertices, normals, edges, view)
        if not split.any() or len(vertices) > MAX_VERTICES:
            break
        middle = np.full(len(edges), -1)
        middle[split] = len(vertices) + np.arange(split.sum())
        a, b = edges[split].T
        between = normals[a] + normals[b]
        vertices = np.concatenate([vertices, (vertices[a] + vertices[b]) / 2])
        normals = np.concatenate([normals, between / np.linalg.norm(between, axis=1, keepdims=True)])
        middle = middle[edge_of]
        whole = (middle < 0).all(1)
        done.append(faces[whole])
        faces = _split(faces[~whole], middle[~whole])
    return Surface(vertices, normals, np.concatenate([*done, faces]))


def _edges(faces: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """(E, 2) edges, and (F, 3) which of them goes from each corner to the next."""
    start, end = faces, np.roll(faces, -1, axis=1)
    key = np.minimum(start, end).astype(np.int64) * count + np.maximum(start, end)
    unique, index = np.unique(key, return_inverse=True)
    return np.stack(np.divmod(unique, count), axis=-1), index.reshape(-1, 3)


def _too_long(vertices: np.ndarray, normals: np.ndarray, edges: np.ndarray, view: View) -> np.ndarray:
    used, ends = np.unique(edges, return_inverse=True)
    a, b = ends.reshape(-1, 2).T
    points, facing, local = vertices[used], normals[used], view.local(vertices[used])
    length = np.sqrt(((points[a] - points[b]) ** 2).sum(1))
    distance = np.sqrt((local**2).sum(1))
    nearest = np.maximum(np.maximum(distance[a], distance[b]) - length, NEAR_M)
    bound_px = view.focal_px * length / nearest
    depth = np.maximum(local[:, 2], NEAR_M)
    screen = local[:, :2] * (view.focal_px / depth)[:, None]
    in_front = np.minimum(local[a, 2], local[b, 2]) > NEAR_M
    pixels = np.where(in_front, np.sqrt(((screen[a] - screen[b]) ** 2).sum(1)), bound_px)
    margin_px = np.minimum(bound_px, 1e6) + 2
    seen = view.seen((points[a] + points[b]) / 2, (facing[a] + facing[b]) / 2, margin_px)
    return np.where(seen, pixels > view.edge_px, bound_px > _UNSEEN * view.edge_px)


def _split(faces: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """Each triangle in 2, 3 or 4, by the numbers of its edges' middles, -1 where an edge stays whole."""
    marked = middle >= 0
    count = marked.sum(1)
    out = []
    for number, turn in ((1, marked), (2, ~marked)):
        chosen = count == number
        first = np.argmax(turn[chosen], axis=1)[:, None]
        order = (first + np.arange(3)) % 3
        a, b, c = np.take_along_axis(faces[chosen], order, axis=1).T
        ab, bc, ca = np.take_along_axis(middle[chosen], order, axis=1).T
        if number == 1:  # ab is halved
            out += [_stack(a, ab, c), _stack(ab, b, c)]
        else:  # bc and ca are
            out += [_stack(a, b, bc), _stack(a, bc, ca), _stack(ca, bc, c)]
    a, b, c = faces[count == 3].T
    ab, bc, ca = middle[count == 3].T
    out += [_stack(a, ab, ca), _stack(ab, b, bc), _stack(ca, bc, c), _stack(ab, bc, ca)]
    return np.concatenate(out)


def _stack(*corners: np.ndarray) -> np.ndarray:
    return np.stack(corners, axis=-1)
