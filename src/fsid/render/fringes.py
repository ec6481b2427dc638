"""Lateral chromatic aberration: a lens that magnifies red and blue by 1 + a relative to green.

    red(x) = image(c + (x - c) / (1 + a)),      c the middle of the image, likewise blue

Both are interpolated in the image that green sees, drawn with a margin from which the edges of a smaller one
come: by Lanczos' kernel along rows, then columns, within a quarter of the values around (no black rings).
Labels are green's. docs/results/renderer.md has what that costs beside shading every colour anew.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fsid.errors import FsidError
from fsid.render.camera import lens_of
from fsid.scene.model import Camera

_REACH = 4
"""Pixels on either side that are interpolated."""
_BEYOND = np.float32(0.25)
"""Share of the least and of the greatest value around by which an interpolated one may lie beyond it."""
_STRIP = 64  # rows interpolated at once: what is in between stays in the cache


def with_margin(camera: Camera) -> tuple[Camera, int]:
    """The camera whose larger image holds what red and blue of `camera` show, and by how many pixels it is
    larger on every side: 0 where that is nothing. Less where its lens cannot be inverted that far out; there
    the border of red and blue is repeated. FsidError as `lens_of` of the camera itself."""
    lens_of(camera)
    smallest = 1 + min(camera.chromatic_aberration)
    if smallest >= 1:
        return camera, 0
    beyond = max(camera.width, camera.height) / 2 * (1 / smallest - 1)
    margin = int(np.ceil(beyond)) + _REACH
    while margin:
        larger = _enlarged(camera, margin)
        try:
            lens_of(larger)
            return larger, margin
        except FsidError:
            margin //= 2
    return camera, 0


def _enlarged(camera: Camera, margin: int) -> Camera:
    width, height = camera.width + 2 * margin, camera.height + 2 * margin
    tangent = np.tan(np.radians(camera.fov_deg) / 2) * width / camera.width
    corner2 = (width**2 + height**2) / (camera.width**2 + camera.height**2)
    a1, a2, a3 = camera.vignetting
    return replace(
        camera,
        width=width,
        height=height,
        fov_deg=float(np.degrees(2 * np.arctan(tangent))),
        vignetting=(a1 * corner2, a2 * corner2**2, a3 * corner2**3),
    )


def inside(camera: Camera, margin: int) -> tuple[slice, slice]:
    """Where the image of `camera` lies in that of the camera `with_margin`."""
    return slice(margin, margin + camera.height), slice(margin, margin + camera.width)


def magnified(radiance: np.ndarray, camera: Camera, margin: int) -> np.ndarray:
    """The (H, W, 3) image of `camera` from `radiance`, that of the camera `with_margin`."""
    if not any(camera.chromatic_aberration):
        return radiance
    inner = radiance[inside(camera, margin)].copy()
    for colour, growth in zip((0, 2), camera.chromatic_aberration, strict=True):
        plane = np.ascontiguousarray(radiance[..., colour])
        rows, columns = (_places(size, growth) + margin for size in (camera.height, camera.width))
        for first in range(0, len(rows), _STRIP):
            strip = slice(first, first + _STRIP)
            inner[strip, :, colour] = _interpolated(_interpolated(plane, rows[strip], 0), columns, 1)
    return inner


def _places(size: int, growth: float) -> np.ndarray:
    """Where along an axis of `size` pixels an image is that is magnified by 1 + growth."""
    middle = (size - 1) / 2
    return (np.arange(size) - middle) / (1 + growth) + middle


def _interpolated(plane: np.ndarray, places: np.ndarray, axis: int) -> np.ndarray:
    """`plane` (H, W), 0 or more, at `places` along an axis."""
    first = np.floor(places).astype(int)
    steps = np.arange(1 - _REACH, _REACH + 1)
    away = (places - first)[:, None] - steps
    weights = np.sinc(away) * np.sinc(away / _REACH)
    weights = (weights / weights.sum(1, keepdims=True)).astype(np.float32)
    total: np.ndarray | float = 0.0
    least, most = np.float32(np.inf), np.float32(-np.inf)
    for step, weight in zip(steps, weights.T, strict=True):
        value = np.take(plane, np.clip(first + step, 0, plane.shape[axis] - 1), axis)
        total = total + value * (weight[:, None] if axis == 0 else weight)
        if -1 <= step <= 2:
            least, most = np.minimum(least, value), np.maximum(most, value)
    return np.asarray(np.clip(total, (1 - _BEYOND) * least, (1 + _BEYOND) * most))
