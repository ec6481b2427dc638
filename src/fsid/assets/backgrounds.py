"""B as geometry: (kind, size) -> mesh, one part per surface that has a material of its own.

    room      closed box 0 <= z <= height, seen from inside
    backdrop  the same box; one sheet is floor, curve and north wall, as in a photographer's studio
    tabletop  the box lowered by TABLE_HEIGHT_M, with a table whose top is at z = 0
    open-air  ground without walls: flat where objects stand, rolling beyond

Everything follows from the size alone: no seed, so that the sampler knows where it may put things.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fsid.assets.mesh import Mesh
from fsid.assets.solids import Solid, box, join
from fsid.assets.surfaces import smooth_normals
from fsid.errors import FsidError

TABLE_HEIGHT_M = 0.75
_BOX = ("wall_east", "wall_west", "wall_north", "wall_south", "ceiling", "floor")

BACKGROUND_PARTS: dict[str, tuple[str, ...]] = {
    "room": _BOX,
    "backdrop": ("wall_east", "wall_west", "wall_south", "ceiling", "sweep"),
    "tabletop": (*_BOX, "table"),
    "open-air": ("ground",),
}
"""Kind -> names of its parts, the keys of `Background.materials`. Walls: +x, -x, +y, -y."""

_SWEEP_STEPS = 16
_GROUND_CELLS = 64
_FLAT_SHARE = 0.06
"""Ground: part of its half width around the origin that is exactly flat, at least 6 m."""


def build_background(kind: str, size_m: Sequence[float]) -> Mesh:
    """The mesh of `scene.Background(kind, size_m)`; world coordinates, normals towards the objects.

    size_m: width along x, along y, height of the room; out of doors the last is the height of the hills.
    Raises FsidError for a kind that does not exist or a size that holds nothing.
    """
    if kind not in BACKGROUND_PARTS:
        raise FsidError(f"background '{kind}' does not exist; choose one of: {', '.join(BACKGROUND_PARTS)}")
    x, y, z = (float(v) for v in size_m)
    if not (x > 0 and y > 0 and z >= 0 and np.isfinite([x, y, z]).all()):
        raise FsidError(f"background size_m = {tuple(size_m)}: give three positive lengths in metres")
    if kind == "open-air":
        solids = {"ground": _ground(x, y, z)}
    else:
        low = -TABLE_HEIGHT_M if kind == "tabletop" else 0.0
        solids = {name: _side(i, x, y, low, low + z) for i, name in enumerate(_BOX)}
    if kind == "backdrop":
        solids["sweep"] = _sweep(x, y, z)
    if kind == "tabletop":
        solids["table"] = _table(*table_size_m(size_m))
    return _mesh({name: solids[name] for name in BACKGROUND_PARTS[kind]})


def table_size_m(size_m: Sequence[float]) -> tuple[float, float]:
    """Width along x and y of the table in the middle of a tabletop background."""
    return (min(0.8 * size_m[0], 2.6), min(0.8 * size_m[1], 2.6))


def sweep_radius_m(size_m: Sequence[float]) -> float:
    """Radius of the curve in which the floor of a backdrop turns into its north wall."""
    return 0.2 * min(size_m[1], size_m[2])


def ground_height_m(size_m: Sequence[float], x_m: np.ndarray, y_m: np.ndarray) -> np.ndarray:
    """Height of the ground of an open-air background at places along x and y, of any shape: metres."""
    width, depth, relief_m = size_m
    half = min(width, depth) / 2
    flat = max(6.0, _FLAT_SHARE * half)
    beyond = np.clip((np.hypot(x_m, y_m) - flat) / max(half - flat, 1e-9), 0, 1)
    u, v = 2 * x_m / width, 2 * y_m / depth
    hills = 0.5 + 0.25 * (np.sin(7.0 * u + 2.1 * np.sin(3.0 * v)) + np.sin(5.0 * v - 1.7 * np.sin(4.0 * u)))
    return np.asarray(relief_m * hills * beyond**2 * (3 - 2 * beyond))


def _side(side: int, x: float, y: float, low: float, high: float) -> Solid:
    """One quad of the box, facing inward; sides in the order +x, -x, +y, -y, +z, -z."""
    axis, sign = side // 2, 1 - 2 * (side % 2)
    corners = np.zeros((4, 3))
    corners[:, axis] = sign
    corners[:, (axis + 1) % 3] = (-1, 1, 1, -1)
    corners[:, (axis + 2) % 3] = np.array((-1, -1, 1, 1)) * sign
    inward = np.zeros((4, 3))
    inward[:, axis] = -sign
    half = np.array((x / 2, y / 2, (high - low) / 2))
    return Solid(corners * half + (0, 0, (high + low) / 2), inward, np.array([(0, 2, 1), (0, 3, 2)]))


def _sweep(x: float, y: float, z: float) -> Solid:
    """Floor, quarter circle and north wall in one sheet."""
    radius = sweep_radius_m((x, y, z))
    angle = np.linspace(0, np.pi / 2, _SWEEP_STEPS + 1)
    path = np.vstack(
        [
            (-y / 2, 0.0),
            np.c_[y / 2 - radius + radius * np.sin(angle), radius - radius * np.cos(angle)],
            (y / 2, z),
        ]
    )
    normals = np.vstack([(0, 1), np.c_[-np.sin(angle), np.cos(angle)], (-1, 0)])
    rows = len(path)
    vertices = np.stack([np.insert(path, 0, side * x / 2, axis=1) for side in (-1, 1)], axis=1)
    upright = np.repeat(np.insert(normals, 0, 0.0, axis=1), 2, axis=0)
    return Solid(vertices.reshape(-1, 3), upright, _quads(rows, 2))


def _table(x: float, y: float) -> Solid:
    """A plate with four legs, its top at z = 0."""
    thickness, leg = 0.04, 0.07
    top = box(x, y, thickness, 0.006).at(z=-thickness)
    foot = box(leg, leg, TABLE_HEIGHT_M - thickness, 0.004).at(z=-TABLE_HEIGHT_M)
    inset = (x / 2 - leg, y / 2 - leg)
    return join([top, *(foot.at(i * inset[0], j * inset[1]) for i in (-1, 1) for j in (-1, 1))])


def _ground(x: float, y: float, relief_m: float) -> Solid:
    """A grid that is fine and flat around the origin, coarse and rolling towards the horizon."""
    at = np.linspace(-1, 1, _GROUND_CELLS + 1)
    at = np.sign(at) * at**2
    grid_y, grid_x = np.meshgrid(at * y / 2, at * x / 2, indexing="ij")
    height = ground_height_m((x, y, relief_m), grid_x, grid_y)
    vertices = np.stack([grid_x, grid_y, height], axis=-1).reshape(-1, 3)
    faces = _quads(_GROUND_CELLS + 1, _GROUND_CELLS + 1)
    return Solid(vertices, smooth_normals(vertices, faces), faces)


def _quads(rows: int, cols: int) -> np.ndarray:
    """Two triangles per cell of a (rows, cols) vertex grid, facing d_cols x d_rows."""
    a = (np.arange(rows - 1)[:, None] * cols + np.arange(cols - 1)).ravel()
    return np.stack([a, a + 1, a + cols + 1, a, a + cols + 1, a + cols], axis=-1).reshape(-1, 3)


def _mesh(solids: dict[str, Solid]) -> Mesh:
    whole = join(list(solids.values()))
    return Mesh(
        vertices=whole.vertices.astype(np.float32),
        normals=whole.normals.astype(np.float32),
        faces=whole.faces.astype(np.int32),
        face_parts=np.repeat(np.arange(len(solids), dtype=np.int32), [len(s.faces) for s in solids.values()]),
        part_names=tuple(solids),
    )
