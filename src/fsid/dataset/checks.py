"""What is wrong with a clean image, if anything, and what it looks like.

A fingerprint is the sign of the horizontal gradient on a grid of 16 x 17 means (difference hash, 256 bits):
it survives noise and exposure, and two images of different content differ in about half of it.
"""

from __future__ import annotations

import numpy as np

from fsid.dataset.config import Checks
from fsid.sensor import Raw, pack

BLACK_X = 1e-3
WHITE_X = 0.999
_ROWS, _COLUMNS = 16, 17


def flaw(clean: Raw, checks: Checks) -> str | None:
    """ "not finite", "out of range", "black" or "blown"; None where the clean mosaic is fine."""
    x = clean.mosaic
    if not np.isfinite(x).all():
        return "not finite"
    if x.min() < 0 or x.max() > 1:
        return "out of range"
    if np.mean(x < BLACK_X) > checks.black_share:
        return "black"
    if np.mean(pack(x, clean.cfa)[1:3] >= WHITE_X) > checks.blown_share:
        return "blown"
    return None


def fingerprint(clean: Raw) -> str:
    """64 hexadecimal digits of what a clean mosaic looks like, from its green."""
    green = pack(clean.mosaic, clean.cfa)[1:3].mean(0, dtype=np.float64)
    for axis, cells in enumerate((_ROWS, _COLUMNS)):
        starts = np.arange(cells) * green.shape[axis] // cells
        sizes = np.maximum(np.diff(starts, append=green.shape[axis]), 1)
        green = np.add.reduceat(green, starts, axis) / np.expand_dims(sizes, 1 - axis)
    return np.packbits(green[:, 1:] > green[:, :-1]).tobytes().hex()


def distance(a: str, b: str) -> int:
    """How many bits of two fingerprints differ."""
    return (int(a, 16) ^ int(b, 16)).bit_count()
