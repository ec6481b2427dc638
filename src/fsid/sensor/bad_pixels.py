"""Pixels that a DNG calls bad, in its OpcodeList1: of pixels as they are stored (specification, chapter 7).

    FixBadPixelsConstant: all of one value       FixBadPixelsList: places (row, column) and rectangles

A bad pixel that reaches a denoiser stays as a dot which no converter finds any more. Each becomes the mean of
the good pixels of its site around it, the nearest ones first.
"""

from __future__ import annotations

import struct

import numpy as np
from scipy.ndimage import convolve

from fsid.sensor.mosaic import TILE
from fsid.sensor.opcodes import opcodes

_CONSTANT, _LIST = 4, 5
_MAX_RECTANGLES = 1 << 12  # more than any sensor has; a broken list may hold millions
_REACH = 32  # pixels of a site from the nearest good one: of a cluster, a column or a small rectangle
_AROUND = np.array([[0.5, 1, 0.5], [1, 0, 1], [0.5, 1, 0.5]], np.float32)
"""Of the pixels of a site; those at the corners are farther."""


def bad_pixels(listed: bytes, dn: np.ndarray, first: tuple[int, int], table: np.ndarray | None) -> np.ndarray:
    """(H, W) bool: which of `dn`, a part of the stored pixels, an OpcodeList1 calls bad.

    first: (row, column) of the part's first pixel, since the list counts from the first one stored. table: by
    which LibRaw made what was stored linear, after the list; None where it did not. What is broken in the
    list, or goes on beyond the pixels, says nothing.
    """
    found = np.zeros(dn.shape, bool)
    for number, data in opcodes(listed):
        if number == _CONSTANT and len(data) == 8:
            value = struct.unpack(">I", data[:4])[0]
            if table is not None:
                value = table[min(value, len(table) - 1)]
            found |= dn == value
        elif number == _LIST and len(data) >= 12:
            _, points, rectangles = struct.unpack(">3I", data[:12])
            if len(data) != 12 + 8 * points + 16 * rectangles or rectangles > _MAX_RECTANGLES:
                continue
            places = np.frombuffer(data, ">u4", 2 * points, 12).astype(np.int64).reshape(-1, 2) - first
            rows, columns = places[np.all((places >= 0) & (places < dn.shape), axis=1)].T
            found[rows, columns] = True
            areas = np.frombuffer(data, ">u4", 4 * rectangles, 12 + 8 * points).astype(np.int64)
            for top, left, bottom, right in (areas.reshape(-1, 4) - (*first, *first)).clip(min=0):
                found[top:bottom, left:right] = True
    return found


def mended(mosaic: np.ndarray, bad: np.ndarray) -> np.ndarray:
    """`mosaic` (H, W) float32 with its `bad` pixels made of those around them; as it is far from any good."""
    if not bad.any():
        return mosaic
    mosaic = mosaic.copy()
    for site in TILE:
        plane, good = mosaic[site], ~bad[site]
        for _ in range(_REACH):
            if good.all():
                break
            weight = convolve(good.astype(np.float32), _AROUND, mode="constant")
            total = convolve(np.where(good, plane, 0), _AROUND, mode="constant")
            reached = ~good & (weight > 0)
            plane[reached] = total[reached] / weight[reached]
            good = good | reached
    return mosaic
