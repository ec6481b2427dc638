"""Colour at every pixel: bilinear interpolation corrected by the gradient of the colour that is there.

    G at R  = mean of 4 G neighbours + 1/2 * Laplacian of R / 4        (and likewise for the other cases)

Malvar, He & Cutler, "High-quality linear interpolation for demosaicing of Bayer-patterned color images",
ICASSP 2004, eq. 1-3, with their weights alpha = 1/2, beta = 5/8, gamma = 3/4. Linear, so noise stays Gaussian
and the mean of many demosaiced frames is the demosaiced mean.
"""

from __future__ import annotations

import numpy as np

from fsid.sensor.arrays import check_array
from fsid.sensor.mosaic import site_offsets
from fsid.sensor.raw import check_even

_PAD = 2  # the filters are 5x5; reflection without the edge pixel keeps the CFA phase
_STRIP = 64  # rows at once, an even number: what is in between stays in the cache


def demosaic(mosaic: np.ndarray, cfa: str) -> np.ndarray:
    """Mosaic (H, W) to camera RGB (H, W, 3) float32; FsidError unless both are even. Samples are kept."""
    check_array(mosaic, "a mosaic")
    check_even(mosaic.shape)
    padded = np.pad(mosaic.astype(np.float32, copy=False), _PAD, mode="reflect")
    out = np.empty((*mosaic.shape, 3), np.float32)
    for first in range(0, len(mosaic), _STRIP):
        strip = out[first : first + _STRIP]
        _demosaic(padded[first : first + len(strip) + 2 * _PAD], cfa, strip)
    return out


def _demosaic(padded: np.ndarray, cfa: str, out: np.ndarray) -> None:
    """Into `out` (h, w, 3), from its mosaic with `_PAD` pixels on every side."""
    planes = {(r, c): np.ascontiguousarray(padded[r::2, c::2]) for r in (0, 1) for c in (0, 1)}
    red, gr, gb, blue = site_offsets(cfa)
    for (r, c), own, opposite in ((red, 0, 2), (blue, 2, 0)):
        sums = _Neighbours(planes, r, c)
        site = out[r::2, c::2]
        site[..., own] = sums.centre
        site[..., 1] = (4 * sums.centre + 2 * (sums.across + sums.down) - sums.far_across - sums.far_down) / 8
        far = sums.far_across + sums.far_down
        site[..., opposite] = (6 * sums.centre + 2 * sums.diagonal - 1.5 * far) / 8
    for (r, c), row_channel, column_channel in ((gr, 0, 2), (gb, 2, 0)):
        sums = _Neighbours(planes, r, c)
        site = out[r::2, c::2]
        site[..., 1] = sums.centre
        base = 5 * sums.centre - sums.diagonal
        site[..., row_channel] = (base + 4 * sums.across - sums.far_across + 0.5 * sums.far_down) / 8
        site[..., column_channel] = (base + 4 * sums.down - sums.far_down + 0.5 * sums.far_across) / 8


class _Neighbours:
    """Sums of equidistant neighbours of all pixels at place (row, column) of the tile, each (H/2, W/2)."""

    def __init__(self, planes: dict[tuple[int, int], np.ndarray], row: int, column: int) -> None:
        def at(dy: int, dx: int) -> np.ndarray:
            top, left = _PAD + row + dy, _PAD + column + dx
            plane = planes[top % 2, left % 2]
            height, width = plane.shape[0] - _PAD, plane.shape[1] - _PAD
            return plane[top // 2 : top // 2 + height, left // 2 : left // 2 + width]

        self.centre = at(0, 0)
        self.across = at(0, -1) + at(0, 1)
        self.down = at(-1, 0) + at(1, 0)
        self.far_across = at(0, -2) + at(0, 2)
        self.far_down = at(-2, 0) + at(2, 0)
        self.diagonal = at(-1, -1) + at(-1, 1) + at(1, -1) + at(1, 1)
