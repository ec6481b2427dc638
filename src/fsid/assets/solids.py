"""Solid builders: the few shapes that every procedural object is put together from.

    box       rounded box: Minkowski sum of a box and a sphere, p = core + r n, so normals are exact
    lathe     surface of revolution of a profile (r, z), split into hard edges where it turns sharply
    sweep     circular tube along a path in a rotation-minimising frame
    tubes     many of them at once
    sheet     a grid of points given a thickness, so that both sides carry their own normals
    ball      icosphere pushed along its directions

Real edges are never perfectly sharp: the bevel of a box catches the highlight that tells the eye (and a
denoiser) where an edge is. A `Solid` is placed by chaining `.turned().stretched().at()`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from fsid.assets.mesh import Mesh
from fsid.assets.surfaces import MIN_AREA_M2, cross, face_areas, grid_faces, lengths, repeated, smooth_normals
from fsid.assets.tube_frames import frames_along, tangents_of, with_caps
from fsid.assets.unit_shapes import box_template, icosphere


def rotation_matrix(x_deg: float = 0.0, y_deg: float = 0.0, z_deg: float = 0.0) -> np.ndarray:
    """(3, 3) rotation Rz Ry Rx, the order of `fsid.scene.Transform`."""
    (cx, cy, cz), (sx, sy, sz) = (fn(np.radians((x_deg, y_deg, z_deg))) for fn in (np.cos, np.sin))
    rx = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    ry = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    rz = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return rz @ ry @ rx


@dataclass(frozen=True, eq=False)
class Solid:
    """vertices (V, 3) metres, normals (V, 3) unit outward, faces (F, 3) counter-clockwise from outside."""

    vertices: np.ndarray
    normals: np.ndarray
    faces: np.ndarray

    def at(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Solid:
        """Moved by (x, y, z) metres."""
        return Solid(self.vertices + np.array((x, y, z)), self.normals, self.faces)

    def turned(self, x_deg: float = 0.0, y_deg: float = 0.0, z_deg: float = 0.0) -> Solid:
        """Rotated about the origin by Rz Ry Rx."""
        turn = rotation_matrix(x_deg, y_deg, z_deg).T
        return Solid(self.vertices @ turn, self.normals @ turn, self.faces)

    def resting(self, z: float = 0.0) -> Solid:
        """Moved up or down until its lowest vertex is at height `z`."""
        return self.at(z=z - float(self.vertices[:, 2].min()))

    def stretched(self, x: float, y: float, z: float) -> Solid:
        """Scaled per axis by positive factors; normals by the inverse transpose."""
        normals = self.normals / (x, y, z)
        return Solid(self.vertices * (x, y, z), normals / lengths(normals), self.faces)

    def warped(self, warp: Callable[[np.ndarray], np.ndarray]) -> Solid:
        """Bent by a smooth map (V, 3) -> (V, 3) that keeps orientation; normals by the cofactors of its
        Jacobian (forward differences), so smooth stays smooth and hard edges stay hard."""
        moved = warp(self.vertices)
        a, b, c = ((warp(self.vertices + step) - moved) / 1e-6 for step in 1e-6 * np.eye(3))
        x, y, z = self.normals.T[:, :, None]
        normals = x * cross(b, c) + y * cross(c, a) + z * cross(a, b)
        return Solid(moved, normals / np.maximum(lengths(normals), 1e-30), self.faces)


def join(solids: Sequence[Solid]) -> Solid:
    """All solids as one, in order."""
    starts = np.cumsum([0] + [len(s.vertices) for s in solids[:-1]])
    return Solid(
        np.concatenate([s.vertices for s in solids]),
        np.concatenate([s.normals for s in solids]),
        np.concatenate([s.faces + start for s, start in zip(solids, starts, strict=True)]),
    )


def assemble(parts: Mapping[str, Sequence[Solid]]) -> Mesh:
    """The named parts as one mesh: base on z = 0, footprint centred, degenerate triangles dropped."""
    solids = [solid for group in parts.values() for solid in group]
    whole = join(solids)
    owner = [index for index, group in enumerate(parts.values()) for _ in group]
    face_parts = np.repeat(owner, [len(s.faces) for s in solids])
    low, high = whole.vertices.min(0), whole.vertices.max(0)
    vertices = (whole.vertices - ((low + high) * (0.5, 0.5, 0) + low * (0, 0, 1))).astype(np.float32)
    keep = face_areas(vertices.astype(np.float64), whole.faces) > MIN_AREA_M2
    return Mesh(
        vertices=vertices,
        normals=whole.normals.astype(np.float32),
        faces=whole.faces[keep].astype(np.int32),
        face_parts=face_parts[keep].astype(np.int32),
        part_names=tuple(parts),
    )


def box(size_x: float, size_y: float, size_z: float, bevel: float = 0.004, steps: int = 2) -> Solid:
    """Box with rounded edges, footprint centred, base on z = 0. `bevel` is limited to 49 % of a side."""
    directions, signs, faces = box_template(steps)
    half = np.array((size_x, size_y, size_z)) / 2
    radius = min(bevel, 0.98 * half.min())
    vertices = signs * (half - radius) + directions * radius
    return Solid(vertices + np.array((0, 0, half[2])), directions, faces)


def lathe(profile: Sequence[Sequence[float]], segments: int, crease_deg: float = 35.0) -> Solid:
    """Revolve a profile of (radius, z) points, ordered so that the outside is on its right going up."""
    points = np.asarray(profile, dtype=float)
    points = points[np.r_[True, np.hypot(*np.diff(points, axis=0).T) > 1e-7]]
    heading = np.diff(points, axis=0)
    heading /= lengths(heading)
    bend = np.degrees(np.arccos(np.clip((heading[1:] * heading[:-1]).sum(1), -1, 1)))
    cuts = [0, *(np.flatnonzero(bend > crease_deg) + 1), len(points) - 1]
    return join([_revolved(points[a : b + 1], heading[a:b], segments) for a, b in pairwise(cuts)])


def cylinder(radius: float, height: float, bevel: float = 0.003, segments: int = 32) -> Solid:
    """Upright cylinder with rounded rims, base on z = 0."""
    return cone(radius, radius, height, bevel, segments)


def cone(bottom: float, top: float, height: float, bevel: float = 0.003, segments: int = 32) -> Solid:
    """Upright truncated cone with rounded rims, base on z = 0."""
    b = min(bevel, 0.9 * min(bottom, top, height / 2))
    turn = np.linspace(0, np.pi / 2, 4)
    lower = np.c_[bottom - b + b * np.sin(turn), b - b * np.cos(turn)]
    upper = np.c_[top - b + b * np.cos(turn), height - b + b * np.sin(turn)]
    return lathe([(0, 0), *lower, *upper, (0, height)], segments)


def sweep(path: np.ndarray, radius: float | np.ndarray, segments: int, *, closed: bool = False) -> Solid:
    """Tube of `radius` (scalar or one per point, metres) along `path` (n, 3); open ends get round caps."""
    return tubes(np.asarray(path, dtype=float)[None], radius, segments, closed=closed)


def tubes(paths: np.ndarray, radius: float | np.ndarray, segments: int, *, closed: bool = False) -> Solid:
    """`sweep` along many `paths` (k, n, 3) at once; `radius` broadcasts to (k, n).

    Thin ones, of up to six segments, end in a point instead of a round cap.
    """
    radii = np.broadcast_to(np.asarray(radius, dtype=float), paths.shape[:2])
    if not closed:
        paths, radii = with_caps(paths, radii, 3 if segments > 6 else 1)
    normals, binormals = frames_along(tangents_of(paths, closed), closed)
    angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)[:, None]
    ring = normals[:, :, None] * np.cos(angle) + binormals[:, :, None] * np.sin(angle)
    points = paths[:, :, None] + ring * radii[:, :, None, None]
    faces = repeated(grid_faces(paths.shape[1], segments, wrap_rows=closed, wrap_cols=True), points)
    vertices = points.reshape(-1, 3)
    return Solid(vertices, smooth_normals(vertices, faces), faces)


def sheet(points: np.ndarray, thickness: float) -> Solid:
    """Thick sheet over a grid `points` (n, m, 3): two sides and a rim; the top faces d_cols x d_rows."""
    return sheets(points[None], thickness)


def sheets(points: np.ndarray, thickness: float) -> Solid:
    """`sheet` over many grids `points` (k, n, m, 3) at once."""
    count, rows, cols = points.shape[:3]
    faces = repeated(grid_faces(rows, cols), points)
    middle = points.reshape(-1, 3)
    normals = smooth_normals(middle, faces)
    lift = normals * thickness / 2
    index = np.arange(rows * cols).reshape(rows, cols)
    loop = np.r_[index[0, :-1], index[:-1, -1], index[-1, :0:-1], index[:0:-1, 0]]
    loops = np.arange(count)[:, None] * rows * cols + loop
    top, bottom = middle + lift, middle - lift
    rim = _rim(bottom[loops], top[loops], normals[loops])
    return join([Solid(top, normals, faces), Solid(bottom, -normals, faces[:, ::-1]), rim])


def ball(radii: np.ndarray | float, level: int = 4) -> Solid:
    """Icosphere of 10 * 4^level + 2 directions (`ball_directions`), each pushed to its radius in metres."""
    directions, faces = icosphere(level)
    vertices = directions * np.broadcast_to(np.asarray(radii, dtype=float), len(directions))[:, None]
    return Solid(vertices, smooth_normals(vertices, faces), faces)


def ball_directions(level: int) -> np.ndarray:
    """(V, 3) unit directions of the vertices of `ball`."""
    return icosphere(level)[0]


def copies(solid: Solid, turns: np.ndarray, places: np.ndarray) -> Solid:
    """One copy per row: rotated and uniformly scaled by `turns` (N, 3, 3), moved to `places` (N, 3)."""
    vertices = np.einsum("nij,vj->nvi", turns, solid.vertices) + places[:, None]
    normals = np.einsum("nij,vj->nvi", turns, solid.normals)
    faces = solid.faces + np.arange(len(turns))[:, None, None] * len(solid.vertices)
    return Solid(vertices.reshape(-1, 3), (normals / lengths(normals)).reshape(-1, 3), faces.reshape(-1, 3))


def _revolved(points: np.ndarray, heading: np.ndarray, segments: int) -> Solid:
    tangent = np.vstack([heading[:1], heading[1:] + heading[:-1], heading[-1:]])
    tangent /= lengths(tangent)
    angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle), np.ones(segments)], axis=1)
    vertices = points[:, None, [0, 0, 1]] * circle
    normals = np.stack([tangent[:, 1], tangent[:, 1], -tangent[:, 0]], axis=1)[:, None] * circle
    faces = grid_faces(len(points), segments, wrap_cols=True)
    return Solid(vertices.reshape(-1, 3), normals.reshape(-1, 3), faces)


def _rim(bottom: np.ndarray, top: np.ndarray, normals: np.ndarray) -> Solid:
    """The strips that close sheets, flat per edge; `bottom` and `top` (k, n, 3) run once around each."""
    bottom_after, top_after = np.roll(bottom, -1, axis=1), np.roll(top, -1, axis=1)
    outward = cross(bottom_after - bottom, normals + np.roll(normals, -1, axis=1))
    outward /= np.maximum(lengths(outward), 1e-30)
    corners = np.stack([bottom, bottom_after, top_after, top], axis=2).reshape(-1, 3)
    quads = np.arange(0, len(corners), 4)[:, None, None] + np.array([(0, 1, 2), (0, 2, 3)])
    return Solid(corners, np.repeat(outward.reshape(-1, 3), 4, axis=0), quads.reshape(-1, 3))
