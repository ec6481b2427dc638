"""How far two renderers agree about one scene, pixel by pixel, away from edges.

An edge is where the object, the depth or the surface's direction changes within a pixel: there two renderers
that sample at other points inside a pixel differ, and both are right. So they do in depth on a surface that
runs away: what half a pixel changes it by is allowed. Textures have edges everywhere: albedo and radiance are
compared as means over 3 x 3 pixels, of which none is an edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter, uniform_filter

from fsid.render.frame import Frame

DEPTH_STEP = 0.02
"""Relative deviation of 1 / depth from a plane, on which it is linear, that is an edge."""

NORMAL_STEP_DEG = 25.0
TOLERANCES = {"depth": 0.01, "normal_deg": 15.0, "albedo": 0.03}
"""A pixel is off beyond: relative depth, and what half a pixel changes it by; angle between the normals;
absolute difference of a channel."""


@dataclass(frozen=True)
class Agreement:
    """inside: share of pixels that are no edges; the others are shares of those. ids_off, depth_off,
    normal_off, albedo_off: beyond TOLERANCES. ratio: (5,) percentiles 5, 25, 50, 75, 95 of the luminance of
    the first frame over that of the second, where both are lit. NaN where there is nothing to compare, as in
    a picture of the sky."""

    inside: float
    ids_off: float
    depth_off: float
    normal_off: float
    albedo_off: float
    ratio: tuple[float, ...]


def agreement(a: Frame, b: Frame) -> Agreement:
    """Two frames of one scene and camera."""
    inside = ~(_edges(a) | _edges(b))
    hit = inside & np.isfinite(a.depth) & np.isfinite(b.depth)
    cosine = (a.normal[hit] * b.normal[hit]).sum(-1)
    nearness = 1 / b.depth.astype(np.float64)
    step = sum(np.abs(gradient) for gradient in np.gradient(nearness))
    apart = (np.abs(1 / a.depth - nearness) - 0.5 * step)[hit] / nearness[hit]
    albedo = np.abs(_mean(a.albedo) - _mean(b.albedo))[hit].max(-1)
    first, second = (_mean(frame.radiance)[hit].mean(-1) for frame in (a, b))
    lit = np.minimum(first, second) > 0.05 * _percentile(second, 50)
    return Agreement(
        inside=float(inside.mean()),
        ids_off=_share(a.object_id[inside] != b.object_id[inside]),
        depth_off=_share(apart > TOLERANCES["depth"]),
        normal_off=_share(cosine < np.cos(np.radians(TOLERANCES["normal_deg"]))),
        albedo_off=_share(albedo > TOLERANCES["albedo"]),
        ratio=tuple(_percentile(first[lit] / second[lit], percent) for percent in (5, 25, 50, 75, 95)),
    )


def _share(found: np.ndarray) -> float:
    return float(found.mean()) if found.size else float("nan")


def _percentile(values: np.ndarray, percent: float) -> float:
    return float(np.percentile(values, percent)) if values.size else float("nan")


def _edges(frame: Frame) -> np.ndarray:
    """(H, W) bool: pixels with an edge in their 3 x 3 neighbourhood."""
    inverse = np.pad(1 / frame.depth.astype(np.float64), 1, mode="reflect", reflect_type="odd")
    bends = [np.abs(np.diff(inverse, 2, axis=0)[:, 1:-1]), np.abs(np.diff(inverse, 2, axis=1)[1:-1])]
    bend = np.maximum(*bends) > DEPTH_STEP * np.maximum(inverse[1:-1, 1:-1], 1e-9)
    out = (_spread(frame.object_id) > 0) | (maximum_filter(bend, 3) > 0)
    return out | (_max_turn(frame.normal) > NORMAL_STEP_DEG)


def _mean(values: np.ndarray) -> np.ndarray:
    return np.asarray(uniform_filter(values.astype(np.float64), (3, 3, 0)))


def _spread(values: np.ndarray) -> np.ndarray:
    return np.asarray(maximum_filter(values, 3) - minimum_filter(values, 3))


def _max_turn(normal: np.ndarray) -> np.ndarray:
    """(H, W) largest angle in degrees between a pixel's normal and those of its eight neighbours."""
    padded = np.pad(normal, ((1, 1), (1, 1), (0, 0)), mode="edge")
    height, width = normal.shape[:2]
    least = np.ones((height, width))
    for y in range(3):
        for x in range(3):
            least = np.minimum(least, (padded[y : y + height, x : x + width] * normal).sum(-1))
    return np.degrees(np.arccos(np.clip(least, -1, 1)))
