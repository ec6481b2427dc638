"""Symmetric separable blur of large pictures, for the lens: in strips of rows that stay in the cache.

    blurred = rows, then columns, of  w_0 p(x) + sum over i of w_i (p(x - i) + p(x + i)), its border repeated

As `scipy.ndimage.gaussian_filter1d` along both axes, in single precision and a third to a fifth of its time
(`bench/lens.py`): the lens is the last thing in a frame that a driver does not do on all cores.
"""

from __future__ import annotations

import numpy as np

_STRIP = 32  # rows
_TRUNCATE = 3.0  # standard deviations; beyond lie 0.3 % of a Gaussian


def gaussian_reach(sigma_px: float) -> int:
    """How many pixels away a Gaussian of standard deviation `sigma_px` takes light from."""
    return int(_TRUNCATE * sigma_px + 0.5)


def gaussian_weights(sigma_px: float) -> np.ndarray:
    """The weights w_0, w_1 ... of a sampled Gaussian of standard deviation `sigma_px` > 0, for `blurred`."""
    side = np.exp(-0.5 * (np.arange(gaussian_reach(sigma_px) + 1) / sigma_px) ** 2)
    return np.asarray(side / (2 * side.sum() - 1))


def blurred(image: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """`image` (H, W) or (H, W, C), float32, blurred along both axes; weights: of the middle and one side."""
    height, width, step = *image.shape[:2], image[0, 0].size
    reach = len(weights) - 1
    margin = reach * step
    out = np.empty((height, width * step), np.float32)
    for first in range(0, height, _STRIP):
        last = min(first + _STRIP, height)
        source = np.arange(first - reach, last + reach).clip(0, height - 1)
        strip = np.empty((len(source), width * step + 2 * margin), np.float32)
        strip[:, margin : margin + width * step] = image[source].reshape(len(source), -1)
        for pixel in range(reach):
            left, right = pixel * step, strip.shape[1] - (pixel + 1) * step
            strip[:, left : left + step] = strip[:, margin : margin + step]
            strip[:, right : right + step] = strip[:, -margin - step : -margin]
        strip = _weighted([strip[i : i + last - first] for i in range(2 * reach + 1)], weights)
        shifts = range(0, 2 * margin + 1, step)
        out[first:last] = _weighted([strip[:, i : i + width * step] for i in shifts], weights)
    return out.reshape(image.shape)


def _weighted(shifted: list[np.ndarray], weights: np.ndarray) -> np.ndarray:
    """The sum over i of weights[|i|] times what lies i away; shifted: from the farthest on one side on."""
    middle = len(weights) - 1
    total = shifted[middle] * np.float32(weights[0])
    both = np.empty_like(total)
    for away in range(1, middle + 1):
        np.add(shifted[middle - away], shifted[middle + away], out=both)
        both *= np.float32(weights[away])
        total += both
    return total
