"""Whether the pixels of a TIFF are all there: LibRaw makes black of what is not, and calls it an image.

A copy that broke off leaves a file short, or zeros in the place of pixels. Zeros tell nothing in uncompressed
pixels. A lossless JPEG begins with the marker SOI, and ends with EOI, after which writers may pad with zeros;
some cut EOI off (Leica M10), so that only zeros without it are a broken copy.

LibRaw also takes for granted where the pixels of a DNG lie: strips one after the other (of lossless JPEGs it
reads the first alone), a lone tile or JPEG no wider than the image, rows and columns in their order; and n
JPEGs of n components that fill the width confuse it. It makes a scrambled or half black image of such.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO

from fsid.errors import FsidError
from fsid.sensor.tiff import (
    BITS,
    COMPRESSION,
    ROWS_PER_STRIP,
    STRIP_OFFSETS,
    STRIP_SIZES,
    TILE_OFFSETS,
    TILE_SIZES,
    TILE_WIDTH,
    WIDTH,
    Tag,
)

LOSSLESS_JPEG = 7  # compression of TIFF
_SOI, _SOF3, _EOI = b"\xff\xd8", b"\xff\xc3", b"\xff\xd9"
_LONGEST_HEADER = 1 << 12
_SECTOR_BYTES = 512  # the least that a broken copy lacks
_LONGEST_PADDING = 1 << 16
_REORDERED = (50974, 50975, 52547)  # DNG: SubTileBlockSize, RowInterleaveFactor, ColumnInterleaveFactor


def check_intact(file: BinaryIO, directory: Mapping[int, Tag], path: Path) -> None:
    """FsidError where strips or tiles of `directory` lie outside the file, or hold zeros, not a JPEG."""
    size = file.seek(0, 2)
    for offsets, sizes in ((STRIP_OFFSETS, STRIP_SIZES), (TILE_OFFSETS, TILE_SIZES)):
        places, lengths = (directory[code].values if code in directory else () for code in (offsets, sizes))
        parts = list(zip(places, lengths, strict=False))
        if not all(0 <= place <= place + length <= size for place, length in parts):
            raise FsidError(f"{path}: truncated, its pixels go on after byte {size}; copy it again")
        if COMPRESSION in directory and directory[COMPRESSION].values == (LOSSLESS_JPEG,):
            for place, length in parts:
                if not _is_jpeg(file, int(place), int(length)):
                    raise FsidError(
                        f"{path}: corrupt, its pixels at byte {place:.0f} are missing or zeros; copy it again"
                    )


def check_order(file: BinaryIO, directory: Mapping[int, Tag], path: Path) -> None:
    """FsidError where the pixels of a DNG's `directory` lie otherwise than LibRaw reads them."""

    def first(code: int) -> float:
        return next(iter(directory[code].values), 0) if code in directory else 0

    strips, tiles = (directory[c].values if c in directory else () for c in (STRIP_OFFSETS, TILE_OFFSETS))
    step = first(ROWS_PER_STRIP) * -(-first(WIDTH) * first(BITS) // 8)
    is_apart = any(place != strips[0] + number * step for number, place in enumerate(strips))
    is_jpeg = first(COMPRESSION) == LOSSLESS_JPEG
    if len(strips) > 1 and (is_apart or is_jpeg):
        kind = "strips, which are compressed or lie apart"
    elif first(TILE_WIDTH) > first(WIDTH) and (is_jpeg or len(tiles) == 1):
        kind = "a tile wider than the image"
    elif any(n != 1 for code in _REORDERED if code in directory for n in directory[code].values):
        kind = "interleaved rows or columns"
    elif is_jpeg and tiles and (n := _components(file, tiles[0], first(WIDTH))) > 1:
        kind = f"JPEGs of {n} components, {n} of which fill its width"
    else:
        return
    raise FsidError(f"{path}: holds its pixels in {kind}; LibRaw misreads that: store them in one strip")


def _components(file: BinaryIO, place: float, image_width: float) -> int:
    """Of the lossless JPEG there, where as many JPEGs of its width fill that of the image; else 0."""
    size = file.seek(0, 2)
    data, at = _read(file, int(place), _LONGEST_HEADER) if 0 <= place < size else b"", len(_SOI)
    while at + 10 <= len(data):
        if data[at : at + 2] == _SOF3:
            width, components = int.from_bytes(data[at + 7 : at + 9], "big"), data[at + 9]
            return components if width * components**2 == image_width else 0
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return 0


def _is_jpeg(file: BinaryIO, place: int, length: int) -> bool:
    """Whether a JPEG begins there, and does not turn to zeros before it ends."""
    return _read(file, place, min(length, 2)) == _SOI and (
        any(_end(file, place, length, _SECTOR_BYTES))
        or _end(file, place, length, _LONGEST_PADDING).rstrip(b"\0").endswith(_EOI)
    )


def _end(file: BinaryIO, place: int, length: int, most: int) -> bytes:
    return _read(file, place + max(length - most, 0), min(length, most))


def _read(file: BinaryIO, place: int, length: int) -> bytes:
    file.seek(place)
    return file.read(length)
