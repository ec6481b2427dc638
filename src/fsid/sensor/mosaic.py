"""The colour filter array as index arithmetic: which pixel of the 2x2 tile is which colour.

    packed[s, i, j] = mosaic[2 i + row_s, 2 j + column_s],        s = R, Gr, Gb, B

Gr is the green that shares its row with red, Gb the one that shares its row with blue; the two sit on
different readout columns and differ in gain and noise, so they are never averaged. Every other module
asks here for a site's place in the tile, and none counts pixels itself. `mosaic`, `pack` and `unpack` take
arrays and tensors.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fsid.errors import FsidError
from fsid.sensor.arrays import check_array, namespace
from fsid.sensor.raw import CFA_PATTERNS, Raw, check_even

SITES = ("R", "Gr", "Gb", "B")
SITE_CHANNEL = (0, 1, 1, 2)  # RGB channel of each packed site
TILE = tuple(np.s_[row::2, column::2] for row in (0, 1) for column in (0, 1))
"""The pixels of each place in the tile, row by row, whatever their colour."""


def check_cfa(cfa: str, where: str = "cfa") -> str:
    """Return `cfa` if it is one of the four Bayer patterns; `where` names the file or key in the error."""
    if cfa not in CFA_PATTERNS:
        raise FsidError(f"{where}: {cfa!r} is not a Bayer pattern; use one of {', '.join(CFA_PATTERNS)}")
    return cfa


def site_offsets(cfa: str) -> tuple[tuple[int, int], ...]:
    """(row, column) inside the 2x2 tile of the sites R, Gr, Gb, B."""
    check_cfa(cfa)
    red, blue = divmod(cfa.index("R"), 2), divmod(cfa.index("B"), 2)
    return red, (red[0], 1 - red[1]), (blue[0], 1 - blue[1]), blue


def shift_cfa(cfa: str, rows: int, columns: int) -> str:
    """The pattern seen by an image whose first pixel is pixel (rows, columns) of the pattern `cfa`."""
    check_cfa(cfa)
    return "".join(cfa[2 * ((r + rows) % 2) + (c + columns) % 2] for r in (0, 1) for c in (0, 1))


def mosaic(rgb: Any, cfa: str) -> Any:
    """Keep of each pixel of `rgb` (H, W, 3), H and W even, the one channel its filter passes: (H, W).

    FsidError for another shape or pattern.
    """
    check_array(rgb, "a picture")
    check_even(rgb.shape[:2])
    if rgb.shape[2:] != (3,):
        raise FsidError(f"a picture must have shape (height, width, 3), RGB; got {tuple(rgb.shape)}")
    out = namespace(rgb).empty_like(rgb[..., 0])
    for (r, c), channel in zip(site_offsets(cfa), SITE_CHANNEL, strict=True):
        out[r::2, c::2] = rgb[r::2, c::2, channel]
    return out


def pack(mosaic: Any, cfa: str) -> Any:
    """Mosaic (H, W), H and W even, to its four sites (4, H/2, W/2) in the order R, Gr, Gb, B.

    FsidError for another shape or pattern.
    """
    check_array(mosaic, "a mosaic")
    check_even(mosaic.shape)
    return namespace(mosaic).stack([mosaic[r::2, c::2] for r, c in site_offsets(cfa)])


def unpack(packed: Any, cfa: str) -> Any:
    """Inverse of `pack`: (4, H/2, W/2) to (H, W). FsidError for another shape or pattern."""
    check_array(packed, "packed RAW")
    if packed.ndim != 3 or packed.shape[0] != 4:
        raise FsidError(f"packed RAW has shape {packed.shape}; expected (4, height/2, width/2)")
    out = namespace(packed).empty_like(packed.reshape(2 * packed.shape[1], 2 * packed.shape[2]))
    for site, (r, c) in zip(packed, site_offsets(cfa), strict=True):
        out[r::2, c::2] = site
    return out


def halved(mosaic: np.ndarray) -> np.ndarray:
    """A mosaic half as large, of the same pattern: (4 h, 4 w) of any numbers to (2 h, 2 w) float32.

    Each new pixel takes 3/4 of the nearest and 1/4 of the next old one of its colour along both axes, so that
    the mean of their places is the middle of the 2 x 2 pixels that it covers.
    """
    if mosaic.shape[0] % 4 or mosaic.shape[1] % 4:
        raise FsidError(f"mosaic of {mosaic.shape[1]}x{mosaic.shape[0]} pixels: multiples of 4 can be halved")
    near, far = np.float32(0.75), np.float32(0.25)
    fours = mosaic.reshape(-1, 4, mosaic.shape[1])
    rows = np.stack([near * fours[:, 0] + far * fours[:, 2], far * fours[:, 1] + near * fours[:, 3]], axis=1)
    fours = rows.reshape(len(mosaic) // 2, -1, 4)
    columns = [near * fours[..., 0] + far * fours[..., 2], far * fours[..., 1] + near * fours[..., 3]]
    return np.stack(columns, axis=-1).reshape(len(mosaic) // 2, -1)


def bayer_crop(raw: Raw, top: int, left: int, height: int, width: int) -> Raw:
    """Crop to any pixel offset; the pattern of the result is the one its own first pixel sees.

    Even offsets keep the pattern; an odd one shifts it, which is also how one unifies patterns:
    `bayer_crop(raw, 0, 1, h, w - 2)` of RGGB is GRBG. FsidError unless height and width are even and the crop
    lies inside the image.
    """
    rows, columns = raw.mosaic.shape
    check_even((height, width))
    if top < 0 or left < 0 or top + height > rows or left + width > columns:
        raise FsidError(f"crop {width}x{height} at ({left}, {top}) lies outside the {columns}x{rows} image")
    cut = raw.mosaic[top : top + height, left : left + width].copy()
    return replace(
        raw, mosaic=cut, cfa=shift_cfa(raw.cfa, top, left), metadata=raw.metadata.without_geometry()
    )
