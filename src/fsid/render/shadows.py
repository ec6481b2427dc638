"""Shadow maps: depth as seen from each light, in the square tiles of one atlas.

A spot needs one tile along its direction, a point or area light six (the sides of a cube). The sun has one
of all that casts shadows, tens of metres out of doors, and a nearer one, twice as large, of what the camera
looks at. Every tile shows a border beyond its own field, so that the taps of a soft shadow never leave it.
What is stored is the window depth, 1 - near / z, or z / range of the sun: the plane of the receiver is linear
in both over the tile, and each tap compares against that plane (no acne on slopes).
Nothing here depends on what was rendered before: the atlas has the size that this scene's lights need.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fsid.errors import FsidError
from fsid.scene.check import LIGHT_KINDS
from fsid.scene.model import Light

BORDER = 0.17
"""Width of a tile's border in tangent units; a large area light has a wider one."""

FULL_SHARE = 0.8
"""Of a spot's half angle: within, it has its full strength."""

NEAR_M = 0.02
COLUMNS = 6
_LARGEST_PX = 16384
"""Side of the atlas: OpenGL 4.3 promises no more."""

_COARSEST_PX = 64
KINDS = dict(zip(LIGHT_KINDS, (0, 0, 1, 2), strict=True))
_WIDEST_SPOT_DEG = 120.0
_WIDEST_BORDER = 0.7
_SHAPED = -3.0
"""In place of the cosine of a cone: a lamp that has a shape, as in shaders/lights.glsl."""

_NEAR_CELLS = 2
"""Side of the sun's nearer tile, in other tiles."""

_NEAR_STEPS = 4
"""Sizes of the nearer tile per doubling: few cameras of a burst or a rig have another one than the first."""

_NEAR_BORDER = 0.2
"""Of the nearer tile, relative to its field."""

LIGHT = np.dtype(
    [
        ("position", "3f4"),
        ("radius_m", "f4"),
        ("direction", "3f4"),
        ("cos_outer", "f4"),
        ("colour", "3f4"),
        ("cos_inner", "f4"),
        ("right", "3f4"),
        ("focal", "f4"),
        ("up", "3f4"),
        ("border", "f4"),
        ("kind", "f4"),
        ("first_tile", "f4"),
        ("tile_count", "f4"),
        ("range_m", "f4"),
        ("half_width", "4f4"),
        ("half_height", "4f4"),
    ]
)
"""Eight texels of `struct Light` in shaders/lights.glsl; for half_width, half_height of the sun see
`_fill_nearer`, of a lamp `_fill_shape`."""


@dataclass(frozen=True, eq=False)
class Source:
    """A light, and the number of the drawable (-1: none) that is the lamp itself and casts no shadow.

    axes: half width and half height (3,) of an area light that does not lie as `half_axes` has it.
    shape: (3, 3) Q of a point light whose intensity in direction u is sqrt(u Q u) times its colour.
    """

    light: Light
    lamp: int = -1
    axes: tuple[np.ndarray, np.ndarray] | None = None
    shape: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class Tile:
    """origin: (3,) metres. axes: (3, 3) rows right, up, forward. focal: in half tiles. corner, px: in the
    atlas, texels; px a side.

    range_m: depth of a parallel tile (the sun's), 0 for a perspective one. middle: what moments take off 1 -
    window depth. lamp: as in `Source`.
    """

    origin: np.ndarray
    axes: np.ndarray
    focal: float
    corner: tuple[int, int]
    px: int
    range_m: float
    middle: float
    lamp: int


@dataclass(frozen=True, eq=False)
class ShadowPlan:
    """The tiles of all lights in an atlas of `size` texels, `tile_px` a side each but for the sun's nearer
    one; and the lights' table.

    No side of the atlas is a power of two: Mesa compiles every program once for textures with such sides and
    once for those without, per texture and side, and keeps them all (0.25 MiB each).
    """

    tiles: list[Tile]
    size: tuple[int, int]
    tile_px: int
    light_count: int
    table: np.ndarray


@dataclass(frozen=True, eq=False)
class _Field:
    """What one tile shows: as `Tile`. half, border: half of its field, and its border; tangent units or
    metres. cells: its side, in tiles."""

    origin: np.ndarray
    axes: np.ndarray
    half: float
    border: float
    range_m: float = 0.0
    middle: float = 0.0
    cells: int = 1


def plan_shadows(
    sources: Sequence[Source],
    casters: np.ndarray,
    scene: np.ndarray,
    looked_at: np.ndarray,
    finest_px: int,
) -> ShadowPlan:
    """Tiles of every light: finest_px texels a side for up to four point lights, half of it for more, less
    where the atlas would be too large. FsidError for more lights than it can hold.

    casters, scene: (N, 4) spheres of what can cast a shadow, and of everything. looked_at: (N, 3) points
    around what the sun's nearer tile shows.
    """
    fields = [_fields(source.light, casters, scene, looked_at) for source in sources]
    suns = sum(source.light.kind == "sun" for source in sources)
    others = sum(len(f) for f in fields if f[0].range_m == 0)
    sun_cell, cell = 0, suns * COLUMNS * _NEAR_CELLS  # each sun has rows of its own, before all others
    columns = min(others, COLUMNS) if not suns else COLUMNS if others else 1 + _NEAR_CELLS
    rows = -(-(cell + others) // COLUMNS)
    tile_px = finest_px if suns + others <= 4 * len(_SIDES) else finest_px // 2
    while _side_px(rows, tile_px) > _LARGEST_PX:
        tile_px //= 2
    if tile_px < _COARSEST_PX:
        raise FsidError(
            f"scene.lights: {len(sources)} lights and shining things are too many; leave some out"
        )
    tiles: list[Tile] = []
    table = np.zeros(max(1, len(sources)), LIGHT)
    for source, field, row in zip(sources, fields, table, strict=False):
        if source.light.kind == "sun":
            first, sun_cell = sun_cell, sun_cell + COLUMNS * _NEAR_CELLS
        else:
            first, cell = cell, cell + len(field)
        own = [_tile(f, first + i, tile_px, source.lamp) for i, f in enumerate(field)]
        _fill(row, source, field, first, own)
        tiles += own
    size = (_side_px(columns, tile_px), _side_px(rows, tile_px))
    return ShadowPlan(tiles, size, tile_px, len(sources), table)


def _tile(field: _Field, cell: int, tile_px: int, lamp: int) -> Tile:
    y, x = divmod(cell, COLUMNS)
    px = tile_px * field.cells
    focal, corner = 1.0 / (field.half + field.border), (x * tile_px, y * tile_px)
    return Tile(field.origin, field.axes, focal, corner, px, field.range_m, field.middle, lamp)


def _side_px(tiles: int, tile_px: int) -> int:
    """Half a tile more than a power of two: all mip levels that shadows read stay aligned with the tiles."""
    return max(1, tiles) * tile_px + (tile_px // 2 if tiles.bit_count() <= 1 else 0)


def half_axes(light: Light) -> tuple[np.ndarray, np.ndarray]:
    """Half width and half height of an area light as vectors in the world; their cross product points away
    from its light."""
    direction = unit(np.array(light.direction))
    width = np.cross(direction, (0.0, 0.0, 1.0))
    width = np.array([1.0, 0.0, 0.0]) if np.linalg.norm(width) < 1e-6 else unit(width)
    height = np.cross(width, direction)
    return width * light.size_m[0] / 2, height * light.size_m[1] / 2


def unit(vector: np.ndarray) -> np.ndarray:
    """`vector` with length one; the null vector stays."""
    return vector / max(float(np.linalg.norm(vector)), 1e-12)


def _fields(light: Light, casters: np.ndarray, scene: np.ndarray, looked_at: np.ndarray) -> list[_Field]:
    if light.kind == "sun":
        whole = _sun_field(light, casters, scene)
        return [whole, *_nearer_field(whole, looked_at)]
    origin, border = np.array(light.position_m, dtype=float), BORDER
    if light.kind == "spot" and light.cone_deg <= _WIDEST_SPOT_DEG:
        half = float(np.tan(np.radians(light.cone_deg) / 2))
        return [_Field(origin, _axes_along(np.array(light.direction)), half, border)]
    if light.kind == "area":
        border = float(np.clip(np.hypot(*light.size_m) / 2, BORDER, _WIDEST_BORDER))
    return [_Field(origin, axes, 1.0, border) for axes in _SIDES]


def _sun_field(light: Light, casters: np.ndarray, scene: np.ndarray) -> _Field:
    """A square along the sun's rays around all that casts shadows, and as deep.

    What lies beyond is in no need of depth of its own, and a range of that of wide ground would leave the
    moments of the casters no digits.
    """
    axes = _axes_along(np.array(light.direction))
    inside = casters if len(casters) else scene
    local = inside[:, :3] @ axes.T
    low, high = (local - inside[:, 3:]).min(0), (local + inside[:, 3:]).max(0)
    origin = np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2] - 0.01]) @ axes
    half, range_m = float((high - low)[:2].max() / 2), float(high[2] - low[2] + 0.02)
    return _Field(origin, axes, half, 0.02 * half + light.radius_m * range_m, range_m, 0.5)


def _nearer_field(whole: _Field, looked_at: np.ndarray) -> list[_Field]:
    """A square around the points, as deep as the whole one, on a grid of its own texels: to the next camera
    of a burst or a rig they lie at the same places. None where it would be the larger one.

    Depth is counted from the middle of the points: moments of finer texels need more digits.
    """
    local = looked_at @ whole.axes.T
    low, high = local.min(0), local.max(0)
    size = max(float((high - low)[:2].max() / 2), 1e-3)
    half = 2.0 ** (np.ceil(_NEAR_STEPS * np.log2(size)) / _NEAR_STEPS)
    border = _NEAR_BORDER * half
    if half + border > whole.half + whole.border:
        return []
    step = (half + border) / _COARSEST_PX
    x, y, z = np.round((low + high) / 2 / step) * step
    start = float(whole.origin @ whole.axes[2])
    middle = float(np.clip(1 - (z - start) / whole.range_m, 0.0, 1.0))
    origin = np.array([x, y, start]) @ whole.axes
    return [_Field(origin, whole.axes, half, border, whole.range_m, middle, _NEAR_CELLS)]


def _axes_along(forward: np.ndarray) -> np.ndarray:
    """(3, 3) rows right, up, forward."""
    forward = unit(forward)
    right = unit(np.cross(forward, np.eye(3)[int(np.argmin(np.abs(forward)))]))
    return np.stack([right, np.cross(right, forward), forward])


def _fill(
    row: np.void, source: Source, fields: Sequence[_Field], first_tile: int, tiles: Sequence[Tile]
) -> None:
    light = source.light
    row["position"] = tiles[0].origin
    row["radius_m"], row["colour"] = light.radius_m, light.colour
    row["direction"] = unit(np.array(light.direction))
    row["cos_outer"], row["cos_inner"] = cone_cosines(light)
    row["right"], row["up"] = tiles[0].axes[:2]
    row["focal"], row["border"], row["range_m"] = tiles[0].focal, fields[0].border, tiles[0].range_m
    row["kind"], row["first_tile"], row["tile_count"] = KINDS[light.kind], first_tile, len(tiles)
    if light.kind == "area":
        row["half_width"][:3], row["half_height"][:3] = source.axes or half_axes(light)
        row["radius_m"] = 0.5 * float(np.hypot(*light.size_m))
    if len(fields) == 2:
        _fill_nearer(row, *fields)
    if source.shape is not None:
        _fill_shape(row, source.shape)


def _fill_shape(row: np.void, Q: np.ndarray) -> None:
    """The six numbers of the symmetric Q and the root of its determinant, marked by a cosine that no cone
    has."""
    row["cos_outer"], row["cos_inner"] = _SHAPED, np.sqrt(max(float(np.linalg.det(Q)), 0.0))
    row["half_width"][:3] = np.diag(Q)
    row["half_height"][:3] = Q[1, 2], Q[2, 0], Q[0, 1]


def _fill_nearer(row: np.void, whole: _Field, nearer: _Field) -> None:
    """The sun's nearer tile: where in the whole one its middle is, half of its side; half of its field, and
    what moments take off 1 - window depth."""
    x, y, _ = whole.axes @ (nearer.origin - whole.origin)
    row["half_width"][:3] = x, y, nearer.half + nearer.border
    row["half_height"][:2] = nearer.half, nearer.middle


def cone_cosines(light: Light) -> tuple[float, float]:
    """Cosines at which a spot is dark and at full strength; below -1 for every other light."""
    if light.kind != "spot":
        return -2.0, -1.5
    half = np.radians(light.cone_deg) / 2
    return float(np.cos(half)), float(np.cos(FULL_SHARE * half))


_SIDES = [
    np.roll(np.eye(3), -(axis + 1), axis=0) * np.array([[1.0], [1.0], [sign]])
    for axis in range(3)
    for sign in (1.0, -1.0)
]
"""Axes of the six tiles of a point light, forward +x -x +y -y +z -z; mirrored ones do no harm to depth."""
