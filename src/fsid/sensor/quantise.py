"""The converter: DN = clip(round(black + x (white - black)), 0, white).

The camera stores integers: noise below black survives only down to DN 0, and nothing exceeds the level
at which the sensor saturates, `white_level`. Noisy images go through these integers exactly once.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fsid.errors import FsidError
from fsid.sensor.raw import Raw

MAX_DN = 65535
ROUNDING_DN2 = 1 / 12  # variance of a uniform error one DN wide: what rounding adds to noise above half a DN

_WHOLE_DN = 0.05  # off an integer, up to which x is that of an integer


def to_dn(raw: Raw) -> np.ndarray:
    """Integers that `raw`'s camera would have stored: (H, W) uint16, 0..white_level. FsidError for NaN."""
    check_levels(raw.black_level, raw.white_level, raw.camera)
    if np.isnan(np.min(raw.mosaic)):
        raise FsidError(f"{raw.camera}: the image holds NaN, which no file can store")
    dn = raw.mosaic * np.float32(raw.white_level - raw.black_level)
    dn += np.float32(raw.black_level)
    np.rint(dn, out=dn)
    np.clip(dn, 0, raw.white_level, out=dn)
    return dn.astype(np.uint16)


def from_dn(dn: np.ndarray, black_level: float, white_level: float) -> np.ndarray:
    """Normalised float32 x of stored integers of any shape and type. FsidError unless black < white.

    black_level: of all pixels; `raw_from_dn` takes those of the sites.
    """
    dn = np.asarray(dn)
    if not black_level < white_level:
        raise FsidError(f"black level {black_level:g} is not below white level {white_level:g}")
    x = dn.astype(np.float32)
    x -= np.float32(black_level)
    x *= np.float32(1 / (white_level - black_level))
    return x


def quantise(raw: Raw) -> Raw:
    """`raw` as read back from the camera's file: rounded to DN, clipped to 0..white_level."""
    return replace(raw, mosaic=from_dn(to_dn(raw), raw.black_level, raw.white_level))


def clean_levels(raw: Raw) -> Raw:
    """The same image with levels scaled by the largest power of two that 16 bits hold (64..1023: by 64).

    A clean image stored with them is rounded to that part of the camera's DN, which is far below its noise.
    FsidError for a black level below 0.
    """
    if raw.black_level < 0:
        raise FsidError(f"{raw.camera}: black level {raw.black_level:g} is below 0")
    scale = 1 << max(int(MAX_DN / float(raw.white_level)).bit_length() - 1, 0)
    return replace(raw, black_level=raw.black_level * scale, white_level=raw.white_level * scale)


def exact_levels(raw: Raw) -> Raw:
    """The same image with levels under which `to_dn` makes no two values one: its own, or `clean_levels`.

    Where a file states a black level between two integers, x lies between the integers of the rounded one.
    """
    dn = raw.mosaic * np.float32(raw.white_level - raw.black_level) + np.float32(raw.black_level)
    dn -= np.rint(dn)
    return raw if float(np.max(np.abs(dn, out=dn))) < _WHOLE_DN else clean_levels(raw)


def check_levels(black_level: float, white_level: float, where: str) -> None:
    """FsidError, naming `where`, unless 0 <= black < white <= 65535."""
    if not 0 <= black_level < white_level <= MAX_DN:
        raise FsidError(
            f"{where}: black level {black_level:g} and white level {white_level:g} must satisfy "
            f"0 <= black < white <= {MAX_DN}"
        )
