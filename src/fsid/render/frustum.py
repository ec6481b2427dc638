"""What can be seen at all, so that nothing else is drawn: all answers err on the side of seeing.

in_view       spheres in a pyramid
sees          whether a lens can look into a tile of a shadow map
"""

from __future__ import annotations

import numpy as np

from fsid.render.exposure import Shot
from fsid.render.shadows import Tile


def in_view(
    spheres: np.ndarray, origin: np.ndarray, axes: np.ndarray, tan_xy: tuple[float, float]
) -> np.ndarray:
    """(N,) bool: spheres that touch the pyramid from `origin` along axes[2] (rows right, up, forward)."""
    local = (spheres[:, :3] - origin) @ axes.T
    radius = spheres[:, 3]
    inside = local[:, 2] > -radius
    for axis in (0, 1):
        beyond = np.abs(local[:, axis]) - tan_xy[axis] * local[:, 2]
        inside &= beyond < radius * np.hypot(1.0, tan_xy[axis])
    return inside


def sees(shot: Shot, tile: Tile, deepest_m: float) -> bool:
    """Whether anything that is seen can lie in the tile; no other tile is ever looked up.

    deepest_m: no surface is farther from the lens than this. Two pyramids are apart where a side of one has
    the other wholly behind it.
    """
    lens = shot.lens
    corners = np.array([(x, y) for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    tangents = (corners - shot.seen_shift) / lens.seen_focal * (1, -1)
    rays = np.column_stack([tangents, np.ones(4)]) @ lens.rotation
    eye = np.vstack([lens.position, lens.position + deepest_m * rays])
    return tile.range_m > 0 or not _apart(tile, eye, rays)


def _apart(tile: Tile, eye: np.ndarray, rays: np.ndarray) -> bool:
    """eye: (5, 3) apex and far corners of what is seen; rays: (4, 3) its edges."""
    half = 1.0 / tile.focal
    corners = np.array([(x, y, 1.0) for x in (-half, half) for y in (-half, half)]) @ tile.axes
    return _behind(eye, tile.origin, corners) or _behind(
        np.vstack([tile.origin, tile.origin + corners * 1e4]), eye[0], rays
    )


def _behind(points: np.ndarray, apex: np.ndarray, edges: np.ndarray) -> bool:
    """Whether all points lie behind one side of a pyramid, whose edges are those of corners 00 01 10 11."""
    sides = np.cross(edges[[0, 1, 3, 2]], edges[[1, 3, 2, 0]])
    inward = sides * np.where(sides @ edges.sum(0) > 0, 1.0, -1.0)[:, None]
    return bool(((points - apex) @ inward.T < 0).all(axis=0).any())
