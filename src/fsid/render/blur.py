"""Symmetric separable blur of large pictures, for the lens: in strips of rows that stay in the cache.

    blurred = rows, then columns, of  w_0 p(x) + sum over i of w_i (p(x - i) + p(x + i)), its border repeated

As `scipy.ndimage.gaussian_filter1d` along both axes, in single precision and two to three times as fast
(`bench/lens.py`): the lens is the last thing in a frame that a driver does not do on all cores.
"""

from __future__ import annotations

import numpy as np

_STRIP = 1 << 16  # values: rows of it stay in the cache with what they are made of
_TRUNCATE = 3.0  # standard deviations; beyond lie 0.3 % of a Gaussian
_NARROW_PX = 0.6
"""Below this standard deviation a sampled Gaussian is narrower than it says: of 0.4 it would be 0.28."""


def gaussian_reach(sigma_px: float) -> int:
    """How many pixels away a Gaussian of standard deviation `sigma_px` takes light from."""
    if sigma_px < _NARROW_PX:
        return int(sigma_px > 0)
    return int(_TRUNCATE * sigma_px + 0.5)


def gaussian_weights(sigma_px: float) -> np.ndarray:
    """The weights w_0, w_1 ... of a Gaussian of standard deviation `sigma_px` > 0, for `blurred`: sampled,
    and where it is too narrow for that, those of the same standard deviation that reach one pixel."""
    if sigma_px < _NARROW_PX:
        return np.array([1 - sigma_px**2, sigma_px**2 / 2])
    side = np.exp(-0.5 * (np.arange(gaussian_reach(sigma_px) + 1) / sigma_px) ** 2)
    return np.asarray(side / (2 * side.sum() - 1))


def blurred(image: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """`image` (H, W) or (H, W, C), float32, blurred along both axes; weights: of the middle and one side."""
    height, step = len(image), image[0, 0].size
    rows = image.reshape(height, -1)
    reach = len(weights) - 1
    margin = reach * step
    out = np.empty(rows.shape, np.float32)
    tall = min(max(_STRIP // rows.shape[1], 1), height)
    wide = np.empty((tall, rows.shape[1] + 2 * margin), np.float32)
    for first in range(0, height, tall):
        last = min(first + tall, height)
        source = np.arange(first - reach, last + reach)
        is_inside = source[0] >= 0 and source[-1] < height
        around = rows[source[0] : source[-1] + 1] if is_inside else rows[source.clip(0, height - 1)]
        strip = wide[: last - first]
        down = [around[i : i + last - first] for i in range(2 * reach + 1)]
        strip[:, margin : margin + rows.shape[1]] = _weighted(down, weights)
        for pixel in range(reach):
            left, right = pixel * step, strip.shape[1] - (pixel + 1) * step
            strip[:, left : left + step] = strip[:, margin : margin + step]
            strip[:, right : right + step] = strip[:, -margin - step : -margin]
        across = [strip[:, i : i + rows.shape[1]] for i in range(0, 2 * margin + 1, step)]
        _weighted(across, weights, out=out[first:last])
    return out.reshape(image.shape)


def _weighted(shifted: list[np.ndarray], weights: np.ndarray, out: np.ndarray | None = None) -> np.ndarray:
    """The sum over i of weights[|i|] times what lies i away; shifted: from the farthest on one side on.

    out: where it goes; None: a new array.
    """
    middle = len(weights) - 1
    total = np.multiply(shifted[middle], np.float32(weights[0]), out=out)
    both = np.empty_like(total)
    for away in range(1, middle + 1):
        np.add(shifted[middle - away], shifted[middle + away], out=both)
        both *= np.float32(weights[away])
        total += both
    return total
