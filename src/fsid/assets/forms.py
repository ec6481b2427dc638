"""Forms made of solids that several families share.

hollow    vessel: a wall of given thickness around a profile
plate     prism over an outline that its centre sees whole
slab      prism over a band between two curves (blades, handles, soles)
loft      skin over closed cross sections, flat ends
squared   circles into superellipses |x|^p + |y|^p = 1
fluted    flutes around z, twisted
scatter_rand, sunflower    places on the floor and directions on the ball
spread    bodies beside each other, none inside another
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fsid.assets.solids import Solid, join, lathe
from fsid.assets.surfaces import smooth_normals

CREASE_COS = np.cos(np.radians(35.0))


def hollow(
    outer: np.ndarray, z: np.ndarray, wall: float, *, bottom: bool = True, segments: int = 48
) -> Solid:
    """Vessel of `wall` thickness from the radii `outer` at heights `z` (rising, from 0), rounded rim.

    bottom: closed below; otherwise open at both ends like a lamp shade.
    """
    inner = np.maximum(outer - wall, 0.002)
    turn = np.linspace(0, np.pi, 6)[1:-1]
    rim = np.c_[(outer[-1] + inner[-1]) / 2 + np.cos(turn) * wall / 2, z[-1] + np.sin(turn) * wall / 2]
    if bottom:
        inside = np.c_[inner, np.maximum(z, wall)][::-1]
        return lathe([(0, 0), *np.c_[outer, z], *rim, *inside, (0, wall)], segments, 50)
    return lathe([*np.c_[outer, z], *rim, *np.c_[inner, z][::-1], (outer[0], z[0])], segments, 50)


def plate(outline: np.ndarray, height: float, bevel: float = 0.001) -> Solid:
    """Prism of `height` on z = 0 over a counter-clockwise `outline` (n, 2), star-shaped about its mean."""
    count = len(outline)
    index = np.arange(count)
    fan = np.stack([np.full(count, count), index, (index + 1) % count], axis=1)
    return _prism(outline, fan, height, bevel)


def slab(left: np.ndarray, right: np.ndarray, height: float, bevel: float = 0.001) -> Solid:
    """Prism of `height` on z = 0 over the band between two curves (n, 2) that run the same way."""
    count = len(left)
    k = np.arange(count - 1)
    far = 2 * count - 1 - k
    strip = np.stack([k, k + 1, far - 1, k, far - 1, far], axis=1).reshape(-1, 3)
    return _prism(np.vstack([right, left[::-1]]), strip, height, bevel)


def _prism(outline: np.ndarray, cap: np.ndarray, height: float, bevel: float) -> Solid:
    """Walls with a chamfer of `bevel` shaded round; `cap` indexes the outline, its mean is the last point."""
    edge = np.roll(outline, -1, axis=0) - outline
    out = np.stack([edge[:, 1], -edge[:, 0]], axis=1)
    out /= np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-30)
    before = np.roll(out, 1, axis=0)
    mean = before + out
    mean /= np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-30)
    inset = outline - mean * bevel
    smooth = (before * out).sum(1, keepdims=True) > CREASE_COS
    start, end = np.where(smooth, mean, out), np.roll(np.where(smooth, mean, before), -1, axis=0)
    levels = ((inset, 0.0), (outline, bevel), (outline, height - bevel), (inset, height))
    vertices, normals = [], []
    for (loop, z), tilt in zip(levels, (-0.8, -0.25, 0.25, 0.8), strict=True):
        for points, side in ((loop, start), (np.roll(loop, -1, axis=0), end)):
            vertices.append(np.c_[points, np.full(len(points), z)])
            normals.append(np.c_[side, np.full(len(points), tilt if bevel > 1e-4 else 0.0)])
    count = len(outline)
    a = np.arange(count)[:, None] + 2 * count * np.arange(3)[:, None, None]
    quads = np.stack([a, a + count, a + 3 * count, a, a + 3 * count, a + 2 * count], axis=-1).reshape(-1, 3)
    wall_normals = np.vstack(normals)
    wall_normals /= np.linalg.norm(wall_normals, axis=1, keepdims=True)
    flat = np.vstack([inset, inset.mean(0)])
    up = np.tile((0.0, 0.0, 1.0), (count + 1, 1))
    return join(
        [
            Solid(np.vstack(vertices), wall_normals, quads),
            Solid(np.c_[flat, np.full(count + 1, height)], up, cap),
            Solid(np.c_[flat, np.zeros(count + 1)], -up, cap[:, ::-1]),
        ]
    )


def loft(rings: np.ndarray) -> Solid:
    """Skin over cross sections `rings` (m, n, 3), counter-clockwise seen from the last, with flat ends."""
    rows, cols = rings.shape[:2]
    i, j = np.arange(rows - 1)[:, None] * cols, np.arange(cols)[None]
    after = (j + 1) % cols
    quads = np.stack([i + j, i + after, i + cols + after, i + j, i + cols + after, i + cols + j], axis=-1)
    faces = quads.reshape(-1, 3)
    points = rings.reshape(-1, 3)
    ends = [_cap(rings[0][::-1]), _cap(rings[-1])]
    return join([Solid(points, smooth_normals(points, faces), faces), *ends])


def _cap(ring: np.ndarray) -> Solid:
    count = len(ring)
    index = np.arange(count)
    faces = np.stack([np.full(count, count), index, (index + 1) % count], axis=1)
    points = np.vstack([ring, ring.mean(0)])
    facing = np.cross(ring - ring.mean(0), np.roll(ring, -1, axis=0) - ring.mean(0)).sum(0)
    return Solid(points, np.tile(facing / max(float(np.linalg.norm(facing)), 1e-30), (count + 1, 1)), faces)


def squared(power: float) -> Callable[[np.ndarray], np.ndarray]:
    """Map for `Solid.warped`: circles about z become superellipses of `power` (2 = circle, 8 = square)."""

    def warp(points: np.ndarray) -> np.ndarray:
        x, y = points[:, 0], points[:, 1]
        radius = np.hypot(x, y) + 1e-12
        reach = (np.abs(x / radius) ** power + np.abs(y / radius) ** power + 1e-12) ** (1 / power)
        return np.c_[x / reach, y / reach, points[:, 2]]

    return warp


def fluted(count: int, depth: float, twist_rad_m: float) -> Callable[[np.ndarray], np.ndarray]:
    """Map for `Solid.warped`: `count` flutes of relative `depth` around z, turning `twist_rad_m` by metre."""

    def warp(points: np.ndarray) -> np.ndarray:
        angle = np.arctan2(points[:, 1], points[:, 0]) + twist_rad_m * points[:, 2]
        reach = 1 + depth * (np.cos(count * angle) - 1) / 2
        return np.c_[points[:, :2] * reach[:, None], points[:, 2]]

    return warp


def scatter_rand(rng: np.random.Generator, count: int, gap: float) -> np.ndarray:
    """(count, 2) places on the floor, roughly `gap` apart, around the origin."""
    k = np.arange(count)
    radius, angle = gap * 0.55 * np.sqrt(k * 1.6), 2.4 * k + rng.uniform(0, 6.3)
    return np.c_[radius * np.cos(angle), radius * np.sin(angle)] + rng.normal(0, 0.06 * gap, (count, 2))


def spread(groups: Sequence[Sequence[Solid]], spots: np.ndarray) -> list[list[Solid]]:
    """Each group of solids at its spot, or farther out from the origin where another is in its way: seen from
    above, circles around the groups do not overlap. spots: (n, 2) metres."""
    placed: list[list[Solid]] = []
    circles: list[tuple[np.ndarray, float]] = []
    for group, spot in zip(groups, spots, strict=True):
        points = np.concatenate([s.vertices[:, :2] for s in group])
        middle = (points.min(0) + points.max(0)) / 2
        radius = 1.005 * float(np.hypot(*(points - middle).T).max())
        far = float(np.hypot(*spot))
        way = spot / far if far > 1e-9 else np.array((1.0, 0.0))
        while True:
            hit = [(c, r + radius) for c, r in circles if np.hypot(*(far * way - c)) < 0.9999 * (r + radius)]
            if not hit:
                break
            far = max(float(way @ c + np.sqrt((way @ c) ** 2 - c @ c + reach**2)) for c, reach in hit)
        circles.append((far * way, radius))
        x, y = far * way - middle
        placed.append([s.at(float(x), float(y)) for s in group])
    return placed


def sunflower(count: int) -> np.ndarray:
    """(count, 3) unit directions spread evenly over the sphere (golden-angle spiral), from -z to +z."""
    z = (np.arange(count) + 0.5) / count * 2 - 1
    angle = np.pi * (3 - 5**0.5) * np.arange(count)
    across = np.sqrt(1 - z * z)
    return np.c_[across * np.cos(angle), across * np.sin(angle), z]


def turns_to(directions: np.ndarray, spin_rad: np.ndarray | float = 0.0) -> np.ndarray:
    """(n, 3, 3) rotations that carry +z to each of `directions` (n, 3), after a spin about z."""
    z = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    x = np.cross(np.where(np.abs(z[:, 1:2]) < 0.9, (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)), z)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(z, x)
    c, s = np.cos(spin_rad), np.sin(spin_rad)
    c, s = np.broadcast_to(c, len(z))[:, None], np.broadcast_to(s, len(z))[:, None]
    return np.stack([x * c + y * s, y * c - x * s, z], axis=2)
