"""Material maps at points of a surface: the box mapping of the rasteriser, written a second time in NumPy.

    albedo = lerp(lerp(colour_a, colour_b, mix), colour_c, pattern) * 2 detail      (fsid.assets.maps)

A texture lies on the three axial planes of the object, in metres; where the surface turns from one to the
next they are blended. Each look-up covers the footprint of a pixel, an ellipse, by up to four probes along
it, in the mip level of its width. Written apart from the shaders on purpose: what both agree on is right or
wrong twice.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fsid.assets import MaterialMaps
from fsid.assets.triangle import decode
from fsid.scene.model import Material

BLEND = 0.2
MIN_ROUGHNESS = 0.18
MAX_PROBES = 4
PATCHES = 1.5
_LEAST_SHARE = 0.01
_OFFSET = np.array([0.37, 0.61])
_MASK = np.uint64(0xFFFFFFFF)


@dataclass(frozen=True, eq=False)
class Points:
    """Where to evaluate, in the metric space of an object (scaled, not turned).

    position: (N, 3) metres. normal: (N, 3) unit. along_x, along_y: (N, 3) metres on the surface per step of
    the image in x and in y.
    """

    position: np.ndarray
    normal: np.ndarray
    along_x: np.ndarray
    along_y: np.ndarray


@dataclass(frozen=True, eq=False)
class Shading:
    """albedo: (N, 3). roughness, metallic: (N,). normal: (N, 3) unit with relief, metric space."""

    albedo: np.ndarray
    roughness: np.ndarray
    metallic: np.ndarray
    normal: np.ndarray


class Pyramid:
    """Mip levels of the maps: mix, pattern, detail, roughness, metallic, slope u, slope v, slope^2."""

    def __init__(self, maps: MaterialMaps) -> None:
        size = len(maps.height)
        gain = np.float32(maps.relief_m * size / (2 * maps.tile_m))
        du = (np.roll(maps.height, -1, 1) - np.roll(maps.height, 1, 1)) * gain
        dv = (np.roll(maps.height, -1, 0) - np.roll(maps.height, 1, 0)) * gain
        masks = (maps.mix, maps.pattern, maps.detail, maps.roughness, maps.metallic)
        level = np.stack([*masks, du, dv, (du**2 + dv**2) / 2], axis=-1).astype(np.float32)
        self.levels = [level]
        while len(level) > 1:
            level = level.reshape(len(level) // 2, 2, len(level) // 2, 2, -1).mean((1, 3))
            self.levels.append(level)

    def look_up(self, uv: np.ndarray, footprint: np.ndarray) -> np.ndarray:
        """(N, 8) at (N, 2) tile coordinates, v down; footprint: (N,) width in tiles. Trilinear."""
        size = len(self.levels[0])
        level = np.clip(np.log2(np.maximum(footprint * size, 1e-9)), 0, len(self.levels) - 1)
        low = np.minimum(level.astype(int), len(self.levels) - 2)
        part = (level - low).astype(np.float32)[:, None]
        out = np.empty((len(uv), 8), np.float32)
        for number in np.unique(low):
            at = np.flatnonzero(low == number)
            fine, coarse = (_bilinear(self.levels[number + i], uv[at]) for i in (0, 1))
            out[at] = fine + part[at] * (coarse - fine)
        return out


def shade(points: Points, material: Material, pyramid: Pyramid) -> Shading:
    """What the material is at the points."""
    size = np.abs(points.normal)
    weight = np.maximum(size - (size.max(1, keepdims=True) - BLEND), 0.0) ** 2
    weight /= weight.sum(1, keepdims=True)
    values = np.zeros((len(size), 8), np.float32)
    gradient = np.zeros_like(points.position)
    for axis in range(3):
        at = np.flatnonzero(weight[:, axis] > 1e-3)
        share = weight[at, axis][:, None]
        u, v = _turned(*_face_axes(axis, points.normal[at, axis]), material.rotation_deg)
        found = _probe(Points(*(a[at] for a in vars(points).values())), u, v, axis, material, pyramid)
        values[at] += share * found
        slope = found[:, 5:7] * material.relief_scale
        gradient[at] += share * (slope[:, :1] * u + slope[:, 1:] * v)
    mix, pattern, detail, roughness, metallic = values.T[:5]
    albedo = decode(mix, pattern, detail, material.colours)
    n = points.normal
    bumped = n - (gradient - n * (n * gradient).sum(1, keepdims=True))
    spread2 = np.maximum(values[:, 7] - (values[:, 5:7] ** 2).mean(1), 0) * material.relief_scale**2
    alpha2 = np.clip(roughness * material.roughness_scale, MIN_ROUGHNESS, 1.0) ** 4 + 2 * spread2
    return Shading(
        np.clip(albedo, 0.0, 1.0),
        np.minimum(alpha2, 1.0) ** 0.25,
        metallic,
        bumped / np.linalg.norm(bumped, axis=1, keepdims=True),
    )


def _probe(
    points: Points, u: np.ndarray, v: np.ndarray, axis: int, material: Material, pyramid: Pyramid
) -> np.ndarray:
    def tiles(vectors: np.ndarray) -> np.ndarray:
        return np.stack([(u * vectors).sum(1), (v * vectors).sum(1)], axis=-1) / material.tile_m

    uv = tiles(points.position) + _OFFSET * axis
    axes, lengths, _ = np.linalg.svd(np.stack([tiles(points.along_x), tiles(points.along_y)], axis=-1))
    longest, across = lengths[:, 0], np.maximum(lengths[:, 1], 1e-8)
    along = axes[..., 0] * longest[:, None]
    probes = np.clip(np.ceil(longest / across - 0.5), 1, MAX_PROBES)
    total = np.zeros((len(uv), 8), np.float32)
    for share, cut in _patches(uv) if material.patched else [(np.ones(len(uv)), np.zeros_like(uv))]:
        for k in range(MAX_PROBES):
            at = np.flatnonzero((probes > k) & (share > 0))
            step = along[at] * ((k + 0.5) / probes[at] - 0.5)[:, None]
            found = pyramid.look_up(uv[at] + cut[at] + step, longest[at] / probes[at])
            total[at] += (share[at] / probes[at]).astype(np.float32)[:, None] * found
    return total


def _patches(uv: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """The three patches about uv (N, 2): the share of each (N,), and where in the tile it is cut out (N, 2).

    The patches are the corners of a grid of equilateral triangles of edge 1 / (PATCHES sin 60), their shares
    the eighth powers of barycentric coordinates (after Heitz and Neyret 2018).
    """
    x, y = PATCHES * uv.T
    across, up = x - y / np.sqrt(3), y / np.sin(np.pi / 3)
    column, row = np.floor(across).astype(np.int64), np.floor(up).astype(np.int64)
    a, b = across - column, up - row
    upper = a + b > 1
    near = np.where(upper, [a + b - 1, 1 - b, 1 - a], [1 - a - b, b, a]) ** 8
    near = np.where(near / near.sum(0) > _LEAST_SHARE, near, 0.0)
    places = [
        _place(column + np.where(upper, *right), row + np.where(upper, *above))
        for right, above in (((1, 0), (1, 0)), ((1, 0), (0, 1)), ((0, 1), (1, 0)))
    ]
    return list(zip(near / near.sum(0), places, strict=True))


def _place(column: np.ndarray, row: np.ndarray) -> np.ndarray:
    """(N, 2) in 0..1 for every patch: pcg2d of Jarzynski and Olano 2020."""
    x, y = (
        (part.astype(np.uint64) & _MASK) * np.uint64(1664525) + np.uint64(1013904223)
        for part in (column, row)
    )
    for _ in range(2):
        x = (x + (y & _MASK) * np.uint64(1664525)) & _MASK
        y = (y + x * np.uint64(1664525)) & _MASK
        x, y = x ^ (x >> np.uint64(16)), y ^ (y >> np.uint64(16))
    return np.asarray(np.stack([x, y], axis=-1) / 2.0**32)


def _face_axes(axis: int, side: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where u and v grow on the faces of a box, seen upright from outside; v grows downwards."""
    sign = np.where(side < 0, -1.0, 1.0)
    u, v = np.zeros((len(sign), 3)), np.zeros((len(sign), 3))
    u[:, (1, 0, 0)[axis]] = (sign, -sign, np.ones_like(sign))[axis]
    v[:, (2, 2, 1)[axis]] = (-np.ones_like(sign), -np.ones_like(sign), -sign)[axis]
    return u, v


def _turned(u: np.ndarray, v: np.ndarray, rotation_deg: float) -> tuple[np.ndarray, np.ndarray]:
    cos, sin = np.cos(np.radians(rotation_deg)), np.sin(np.radians(rotation_deg))
    return cos * u + sin * v, cos * v - sin * u


def _bilinear(level: np.ndarray, uv: np.ndarray) -> np.ndarray:
    size = len(level)
    at = uv * size - 0.5
    corner = np.floor(at).astype(np.int64)
    fx, fy = (at - corner).astype(np.float32).T[:, :, None]
    x0, y0 = (corner % size).T
    x1, y1 = (x0 + 1) % size, (y0 + 1) % size
    top = level[y0, x0] * (1 - fx) + level[y0, x1] * fx
    return top * (1 - fy) + (level[y1, x0] * (1 - fx) + level[y1, x1] * fx) * fy
