"""Lens shading that a DNG leaves to whoever develops it: GainMap in its OpcodeList2, as phones write it.

    x -> min(x g(u, v), 1),        u, v: 0..1 over the image,        g: bilinear, held beyond the map's ends

Usually four maps, one per site. What is stored is darker at the corners, and of another tint there, until
they are applied, after the black level and before everything else (specification, chapter 7).
"""

from __future__ import annotations

import struct

import numpy as np

from fsid.sensor.opcodes import opcodes

GAIN_MAP = 9  # number of the opcode
_MOST_POINTS = 1 << 10  # of a map along a side; phones write 13 x 17
_HEAD = struct.Struct(">10I4dI")  # area, plane, planes, pitches, points; spacing, origin; planes of the map


def shading_gains(listed: bytes, shape: tuple[int, int]) -> np.ndarray | None:
    """(H, W) float32 by which an OpcodeList2 multiplies the pixels of a mosaic; None where it does not.

    shape: (H, W) of the mosaic, which begins where the list's coordinates do. A map that is broken or holds
    gains that are not above 0 says nothing.
    """
    gains = None
    for number, data in opcodes(listed):
        if number != GAIN_MAP or len(data) < _HEAD.size:
            continue
        top, left, bottom, right, plane, planes, *rest = _HEAD.unpack_from(data)
        row_pitch, column_pitch, rows, columns, *places, depth = rest
        if len(data) != _HEAD.size + 4 * rows * columns * depth or not rows * columns * depth:
            continue
        points = np.frombuffer(data, ">f4", offset=_HEAD.size).reshape(rows, columns, depth)[:, :, 0]
        sound = np.isfinite(points).all() and (points > 0).all() and np.isfinite(places).all()
        sound = sound and max(rows, columns) <= _MOST_POINTS and min(row_pitch, column_pitch) > 0
        if not (sound and plane == 0 and planes > 0):
            continue
        area = slice(top, bottom, row_pitch), slice(left, right, column_pitch)
        gains = np.ones(shape, np.float32) if gains is None else gains
        v = _between(np.arange(shape[0])[area[0]], shape[0], rows, places[0], places[2])
        u = _between(np.arange(shape[1])[area[1]], shape[1], columns, places[1], places[3])
        gains[area] *= v @ points.astype(np.float32) @ u.T
    return gains


def _between(at: np.ndarray, side: int, count: int, spacing: float, origin: float) -> np.ndarray:
    """(N, count) float32: how much of each of a map's points goes into pixels `at` (N,) of `side`."""
    place = ((at + 0.5) / side - origin) / spacing if spacing > 0 else np.zeros(len(at))
    return np.maximum(1 - np.abs(place.clip(0, count - 1)[:, None] - np.arange(count)), 0).astype(np.float32)
