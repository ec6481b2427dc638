"""Depth of field from one sharp image and its depth.

    diameter of the circle of confusion = |1 / focus_m - 1 / depth| * aperture_m * focal length in pixels

The image is cut into layers of like blur; each is blurred and laid over those behind it. A layer covers what
all that is not farther covers, so a surface across several layers has no seams. What a near thing hides is
not known, so it is continued from beside it; and the blur is a Gaussian with the standard deviation of the
disc, a quarter of its diameter. Exact is the mean of many images seen from places on the lens
(`fsid.render.exposure`); docs/results/renderer.md has how far both are apart.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.ndimage import minimum_filter

from fsid.render.blur import blurred, gaussian_weights

_SIGMA_PX = np.array([0.0, 0.3, 0.5, 0.85, 1.4, 2.4, 4.0, 6.8, 11.5, 20.0])
"""Standard deviations of the layers; what lies between two is shared so that its variance is right."""
_WIDER = 1.7
"""Where a frame is blurred by more, further layers are so many times wider than the one before."""
_SEEN = 0.1
"""Share of the neighbourhood from which on what is behind counts as known."""
_SHORT_PX = 0.8
"""Near layers of a smaller standard deviation hide too little to continue what lies behind them."""
_COARSE_PX = 1.6
"""From this standard deviation on half the resolution holds all that is left."""
_COARSE_VARIANCE = 1.0
"""Of halving (1/4) and doubling (3/4) alone, pixels squared."""
_NONE = 1e-6
_STRIP = 1 << 15  # values: rows of it stay in the cache with what they are made of


def defocus(
    radiance: np.ndarray,
    depth: np.ndarray,
    aperture_m: float,
    focus_m: float,
    focal_px: float | np.ndarray,
) -> np.ndarray:
    """A sharp image, radiance (H, W, 3) and depth (H, W) in metres, as a lens opening shows it; float32.

    aperture_m: diameter of the opening. focus_m: depth of the sharp plane. focal_px: focal length in
    pixels; (H, W) where a lens that bends the image shows some of it larger.
    """
    depth = minimum_filter(depth, 3)  # pixels that an edge divides belong to its near side
    blur = (1 / depth - np.float32(1 / focus_m)) * np.asarray(aperture_m * focal_px / 4, np.float32)
    sigmas_px = _layers_px(float(np.abs(blur).max()))
    place = np.interp(blur**2, sigmas_px**2, np.arange(len(sigmas_px))).astype(np.float32)
    np.copysign(place, blur, out=place)  # above 0 before the sharp plane
    del blur
    colours = [np.ascontiguousarray(radiance[..., i]) for i in range(3)]
    seen = np.zeros((4, *depth.shape), np.float32)  # what lies behind the next layer: light * known, known
    for layer in range(int(np.floor(place.min())), int(np.ceil(place.max())) + 1):
        sigma_px = float(sigmas_px[abs(layer)])
        window = _window(np.abs(place - layer) < 1, int(np.ceil(3 * sigma_px)) + 4)
        if window is None:
            continue
        share, not_farther = _shares(place[window], layer)
        cover = _blurred(not_farther, sigma_px)
        del not_farther
        behind = [plane[window] for plane in seen]
        _continue(behind, sigma_px if layer > 0 and sigma_px > _SHORT_PX else 0.0)
        own = _blurred(share, sigma_px)
        left, front = _blend_weights(own, cover)
        _lay_over(behind[3], own, left, front)
        for plane, colour in zip(behind, colours, strict=False):
            _lay_over(plane, _blurred(colour[window] * share, sigma_px), left, front)
    seen[:3] /= np.maximum(seen[3], _NONE)
    return np.ascontiguousarray(seen[:3].transpose(1, 2, 0))


def _layers_px(widest_px: float) -> np.ndarray:
    """Standard deviations of the layers of a frame whose widest blur has this one."""
    more = int(np.ceil(np.log(max(widest_px / _SIGMA_PX[-1], 1)) / np.log(_WIDER)))
    return np.concatenate([_SIGMA_PX, _SIGMA_PX[-1] * _WIDER ** np.arange(1, more + 1)])


def _shares(place: np.ndarray, layer: int) -> tuple[np.ndarray, np.ndarray]:
    """How much of each pixel is of a layer, and of all that is not farther, (H, W), 0..1; place: (H, W)."""
    share, not_farther = np.empty(place.shape, np.float32), np.empty(place.shape, np.float32)
    for rows in _strips(place.shape):
        ahead = np.subtract(place[rows], np.float32(layer), out=share[rows])
        np.clip(np.add(ahead, 1, out=not_farther[rows]), 0, 1, out=not_farther[rows])
        np.maximum(np.subtract(1, np.abs(ahead, out=ahead), out=ahead), 0, out=ahead)
    return share, not_farther


def _blend_weights(own: np.ndarray, cover: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How much of what lies behind a blurred layer is left, and by how much its light goes over that.

    own: its share of each pixel (H, W). cover: how much everything not farther hides; it is used up.
    """
    front = np.empty(own.shape, np.float32)
    for rows in _strips(own.shape):
        hidden = np.minimum(cover[rows], own[rows] / _SEEN, out=cover[rows])
        np.divide(hidden, np.maximum(own[rows], _NONE), out=front[rows])
        np.subtract(1, hidden, out=hidden)
    return cover, front


def _lay_over(behind: np.ndarray, light: np.ndarray, left: np.ndarray, front: np.ndarray) -> None:
    """behind * left + light * front, all (H, W), in place."""
    for rows in _strips(behind.shape):
        part = behind[rows]
        part *= left[rows]
        part += light[rows] * front[rows]


def _strips(shape: tuple[int, ...]) -> Iterator[slice]:
    """Rows of pictures (H, W), few enough that several of them stay in the processor's cache."""
    tall = max(_STRIP // shape[1], 1)
    for first in range(0, shape[0], tall):
        yield slice(first, first + tall)


def _continue(seen: list[np.ndarray], sigma_px: float) -> None:
    """Take what is not known in `seen`, four planes (H, W), from about `sigma_px` beside it, in place.

    What lies behind the sharp plane reaches under what hides it by its own blur already: there 0 is enough.
    """
    known = seen[3]
    if sigma_px == 0:
        for rows in _strips(known.shape):
            scale = np.clip(1 / np.maximum(known[rows], _NONE), 1, 1 / _SEEN)
            for plane in seen:
                plane[rows] *= scale
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
    return blurred(image, gaussian_weights(sigma_px))


def _halved(image: np.ndarray) -> np.ndarray:
    height, width = image.shape
    if height % 2 or width % 2:
        image = np.pad(image, ((0, height % 2), (0, width % 2)), mode="edge")
    rows = image[0::2] + image[1::2]
    half = rows[:, 0::2] + rows[:, 1::2]
    half *= np.float32(0.25)
    return half


def _finer(image: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Twice as large, linearly interpolated, cut to `size`."""
    height, width = image.shape
    tall = np.empty((2 * height, width), np.float32)
    _between(image, tall[0::2], tall[1::2])
    wide = np.empty((2 * height, 2 * width), np.float32)
    for rows in _strips(wide.shape):
        _between(tall[rows].T, wide[rows, 0::2].T, wide[rows, 1::2].T)
    return wide[: size[0], : size[1]]


def _between(image: np.ndarray, before: np.ndarray, after: np.ndarray) -> None:
    """Rows a quarter before and after those of `image`, all (h, w), linearly interpolated; its border is
    repeated."""
    near, far = image * np.float32(0.75), image * np.float32(0.25)
    np.add(near[1:], far[:-1], out=before[1:])
    np.add(near[0], far[0], out=before[0])
    np.add(near[:-1], far[1:], out=after[:-1])
    np.add(near[-1], far[-1], out=after[-1])
