"""Lateral chromatic aberration: a lens that magnifies red and blue by 1 + a relative to green.

    red(x) = image(c + (x - c) / (1 + a)),      c the middle of the image, likewise blue

Both are interpolated in the image that green sees, drawn with a margin from which the edges of a smaller one
come: by Lanczos' kernel along rows, then columns, within a quarter of the values around (no black rings).
Labels are green's. docs/results/renderer.md has what that costs beside shading every colour anew.
"""

from __future__ import annotations

from dataclasses import replace
from functools import reduce
from itertools import pairwise

import numpy as np

from fsid.errors import FsidError
from fsid.render.camera import lens_of
from fsid.scene.model import Camera

_REACH = 4
"""Pixels on either side that are interpolated."""
_BEYOND = np.float32(0.25)
"""Share of the least and of the greatest value around by which an interpolated one may lie beyond it."""
_STRIP = 32  # rows interpolated at once: what is in between stays in the cache


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
        rows, columns = (_taps(_places(size, growth) + margin) for size in (camera.height, camera.width))
        for top in range(0, camera.height, _STRIP):
            strip = slice(top, top + _STRIP)
            high = _interpolated(plane, *(each[..., strip] for each in rows))
            inner[strip, :, colour] = _interpolated(high.T, *columns).T
    return inner


def _places(size: int, growth: float) -> np.ndarray:
    """Where along an axis of `size` pixels an image is that is magnified by 1 + growth."""
    middle = (size - 1) / 2
    return (np.arange(size) - middle) / (1 + growth) + middle


def _taps(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(P,) int numbers of the first lines that `places` are interpolated from, and (2 _REACH, P) weights of
    those and the next."""
    before = np.floor(places).astype(int)
    steps = np.arange(1 - _REACH, _REACH + 1)
    away = (places - before)[:, None] - steps
    weights = np.sinc(away) * np.sinc(away / _REACH)
    weights = (weights / weights.sum(1, keepdims=True)).astype(np.float32)
    return before + steps[0], np.ascontiguousarray(weights.T)


def _interpolated(plane: np.ndarray, first: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """(P, W): lines of `plane` (H, W), 0 or more, by the `_taps` of P places, ascending.

    Neighbours are interpolated from neighbours, but for few places where one is skipped or taken twice: what
    lies between two of those is computed at once, without picking lines one by one.
    """
    source = np.arange(first[0], first[-1] + 2 * _REACH)
    is_inside = source[0] >= 0 and source[-1] < len(plane)
    lines = plane[source[0] : source[-1] + 1] if is_inside else plane[source.clip(0, len(plane) - 1)]
    out = np.empty_like(lines, shape=(len(first), plane.shape[1]))
    breaks = np.flatnonzero(np.diff(first) != 1) + 1
    for start, stop in pairwise((0, *breaks, len(first))):
        at, share = first[start] - first[0], weights[:, start:stop, None]
        values = [lines[at + i : at + i + stop - start] for i in range(2 * _REACH)]
        total = values[0] * share[0]
        for i in range(1, 2 * _REACH):
            total += values[i] * share[i]
        near = values[_REACH - 2 : _REACH + 2]
        least, most = reduce(np.minimum, near), reduce(np.maximum, near)
        np.maximum(total, (1 - _BEYOND) * least, out=total)
        np.minimum(total, (1 + _BEYOND) * most, out=out[start:stop])
    return out
