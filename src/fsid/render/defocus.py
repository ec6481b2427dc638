"""Depth of field from one sharp image and its depth.

    diameter of the circle of confusion = |1 / focus_m - 1 / depth| * aperture_m * focal length in pixels

The image is cut into layers of like blur; each is blurred and laid over those behind it. A layer covers what
all that is not farther covers, so a surface across several layers has no seams. What a near thing hides is
not known, so it is continued from beside it; and the blur is a Gaussian with the standard deviation of the
disc, a quarter of its diameter. Exact is the mean of many images seen from places on the lens
(`fsid.render.exposure`); docs/results/renderer.md has how far both are apart.
"""

from __future__ import annotations

import numpy as np

from fsid.render.blur import blurred, gaussian_weights

_SIGMA_PX = np.array([0.0, 0.3, 0.5, 0.85, 1.4, 2.4, 4.0, 6.8, 11.5, 20.0])
"""Standard deviations of the layers; what lies between two is shared so that its variance is right."""
_SEEN = 0.1
"""Share of the neighbourhood from which on what is behind counts as known."""
_SHORT_PX = 0.8
_COARSE_PX = 1.6
"""From this standard deviation on half the resolution holds all that is left."""
_COARSE_VARIANCE = 1.0
"""Of halving (1/4) and doubling (3/4) alone, pixels squared."""
_NONE = 1e-6


def defocus(
    radiance: np.ndarray, depth: np.ndarray, aperture_m: float, focus_m: float, focal_px: float
) -> np.ndarray:
    """A sharp image, radiance (H, W, 3) and depth (H, W) in metres, as a lens opening shows it; float32.

    aperture_m: diameter of the opening. focus_m: depth of the sharp plane. focal_px: focal length in pixels.
    """
    blur = (1 / depth - np.float32(1 / focus_m)) * np.float32(aperture_m * focal_px / 4)
    place = np.interp(blur**2, _SIGMA_PX**2, np.arange(len(_SIGMA_PX))).astype(np.float32)
    np.copysign(place, blur, out=place)  # above 0 before the sharp plane
    seen = np.zeros((4, *depth.shape), np.float32)  # what lies behind the next layer: light * known, known
    for layer in range(int(np.floor(place.min())), int(np.ceil(place.max())) + 1):
        sigma_px = float(_SIGMA_PX[abs(layer)])
        window = _window(np.abs(place - layer) < 1, int(np.ceil(3 * sigma_px)) + 4)
        if window is None:
            continue
        ahead = place[window] - np.float32(layer)
        share = np.maximum(1 - np.abs(ahead), 0)
        own = _blurred(share, sigma_px)
        cover = _blurred(np.clip(ahead + 1, 0, 1), sigma_px)  # all that is not farther
        np.minimum(cover, own / _SEEN, out=cover)
        behind = [plane[window] for plane in seen]
        _continue(behind, sigma_px if layer > 0 and sigma_px > _SHORT_PX else 0.0)
        front = cover / np.maximum(own, _NONE)
        for colour, plane in enumerate(behind):
            plane *= 1 - cover
            light = own if colour == 3 else _blurred(radiance[window][..., colour] * share, sigma_px)
            plane += light * front
    seen[:3] /= np.maximum(seen[3], _NONE)
    return np.ascontiguousarray(seen[:3].transpose(1, 2, 0))


def _continue(seen: list[np.ndarray], sigma_px: float) -> None:
    """Take what is not known in `seen`, four planes (H, W), from about `sigma_px` beside it, in place.

    What lies behind the sharp plane reaches under what hides it by its own blur already: there 0 is enough.
    """
    known = seen[3]
    if sigma_px == 0:
        scale = np.clip(1 / np.maximum(known, _NONE), 1, 1 / _SEEN)
        for plane in seen:
            plane *= scale
        return
    there = _blurred(known, sigma_px)
    missing = np.minimum(there / _SEEN, 1) - np.minimum(known, 1)
    share = np.maximum(missing, 0) / np.maximum(there, _NONE)
    for plane in seen[:3]:
        plane += _blurred(plane, sigma_px) * share
    known += there * share


def _window(mask: np.ndarray, margin: int) -> tuple[slice, slice] | None:
    """The rows and columns of `mask` (H, W) that are not empty, with a margin; None where all are."""
    if not mask.any():
        return None
    sides = [np.flatnonzero(mask.any(axis))[[0, -1]] for axis in (1, 0)]
    rows, columns = (slice(max(int(a) - margin, 0), int(b) + margin + 1) for a, b in sides)
    return rows, columns


def _blurred(image: np.ndarray, sigma_px: float) -> np.ndarray:
    """(H, W) through a Gaussian; wide ones at half the resolution."""
    if sigma_px == 0:
        return image
    if sigma_px >= _COARSE_PX and min(image.shape) >= 64:
        left = np.sqrt(sigma_px**2 - _COARSE_VARIANCE)
        return _finer(_blurred(_halved(image), float(left) / 2), image.shape)
    if sigma_px < _SHORT_PX:  # a sampled Gaussian would be too narrow
        return blurred(image, np.array([1 - sigma_px**2, sigma_px**2 / 2]))
    return blurred(image, gaussian_weights(sigma_px))


def _halved(image: np.ndarray) -> np.ndarray:
    height, width = image.shape
    even = np.pad(image, ((0, height % 2), (0, width % 2)), mode="edge")
    rows = even[0::2] + even[1::2]
    return np.asarray((rows[:, 0::2] + rows[:, 1::2]) * np.float32(0.25))


def _finer(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Twice as large, linearly interpolated, cut to `size`."""
    twice = np.repeat(np.repeat(image, 2, 0), 2, 1)
    return blurred(twice, np.array([0.5, 0.25]))[: size[0], : size[1]]
