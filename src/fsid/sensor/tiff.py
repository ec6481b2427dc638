"""TIFF 6.0 directories: the container of DNG and of most cameras' RAW files.

    "II" 42 offset | directory: count, (code, type, count, value or offset)..., next | ... | pixels

Written here and not with tifffile, because a DNG needs an EXIF directory, or LibRaw does not see its ISO, and
because the same image must give the same bytes whatever version of a library is installed. Read here,
because a broken file must cost neither time nor memory: a tag that reaches outside the file is not there.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import BinaryIO

import numpy as np

BYTE, ASCII, SHORT, LONG, RATIONAL, SRATIONAL, DOUBLE = 1, 2, 3, 4, 5, 10, 12
SUB_IFD, EXIF_IFD = 330, 34665
COMPRESSION, PHOTOMETRIC, SAMPLE_FORMAT = 259, 262, 339
STRIP_OFFSETS, STRIP_SIZES, TILE_OFFSETS, TILE_SIZES = 273, 279, 324, 325
WIDTH, BITS, ROWS_PER_STRIP, TILE_WIDTH = 256, 258, 278, 322
RGB, CFA = 2, 32803  # photometric interpretations

Values = tuple[float, ...] | bytes  # numbers (numerator, denominator, ... of rationals), or bytes and text

_BYTES = (BYTE, ASCII, 7)
_FORMAT = {
    SHORT: "H",
    LONG: "I",
    RATIONAL: "II",
    8: "h",
    9: "i",
    SRATIONAL: "ii",
    11: "f",
    DOUBLE: "d",
    13: "I",
}
_HEADER_SIZE = 8
_MAX_TAG_BYTES = 1 << 20  # a tag of a healthy file that FSID reads is far smaller
_MAX_DIRECTORY_BYTES = 1 << 23
_MAX_ENTRIES = 1 << 10
_DENOMINATOR = 1_000_000
_MAX_CHILDREN = 16


@dataclass(frozen=True)
class Tag:
    """One entry of a directory."""

    code: int
    kind: int
    values: Values

    @property
    def numbers(self) -> Values:
        """`values` with fractions divided out: none where one is over 0. Bytes and text as they are."""
        if self.kind in (RATIONAL, SRATIONAL) and not isinstance(self.values, bytes):
            return tuple(quotients(self.values))
        return self.values


@dataclass(frozen=True, eq=False)
class Directory:
    """Tags, the image they describe as one uncompressed strip, and directories that tags point to."""

    tags: tuple[Tag, ...]
    pixels: np.ndarray | None = None
    children: tuple[tuple[int, Directory], ...] = ()


def image_tags(pixels: np.ndarray, photometric: int, subfile_type: int) -> tuple[Tag, ...]:
    """Tags that any reader needs for pixels (H, W) or (H, W, samples), uint8 or uint16."""
    samples = 1 if pixels.ndim == 2 else pixels.shape[2]
    return (
        Tag(254, LONG, (subfile_type,)),
        Tag(WIDTH, LONG, (pixels.shape[1],)),
        Tag(257, LONG, (pixels.shape[0],)),
        Tag(BITS, SHORT, (8 * pixels.itemsize,) * samples),
        Tag(COMPRESSION, SHORT, (1,)),  # none
        Tag(PHOTOMETRIC, SHORT, (photometric,)),
        Tag(277, SHORT, (samples,)),
        Tag(ROWS_PER_STRIP, LONG, (pixels.shape[0],)),
        Tag(284, SHORT, (1,)),  # samples of a pixel side by side
    )


def tiff_bytes(root: Directory) -> bytes:
    """The file that holds `root`, its children and their pixels, little endian."""
    directories = list(_walk(root))
    place = _HEADER_SIZE
    at: dict[int, int] = {}
    for directory in directories:
        at[id(directory)] = place
        place += len(_encode(directory, 0, 0, at))
    body, strips = [], []
    for directory in directories:
        body.append(_encode(directory, at[id(directory)], place, at))
        if directory.pixels is not None:
            strip = directory.pixels.astype(directory.pixels.dtype.newbyteorder("<"), copy=False).tobytes()
            strips.append(strip + bytes(len(strip) % 2))
            place += len(strips[-1])
    return b"".join([b"II", struct.pack("<HI", 42, _HEADER_SIZE), *body, *strips])


def _walk(directory: Directory) -> Iterator[Directory]:
    yield directory
    for _, child in directory.children:
        yield from _walk(child)


def _encode(directory: Directory, offset: int, pixel_offset: int, at: dict[int, int]) -> bytes:
    tags = [*directory.tags, *(Tag(code, LONG, (at.get(id(d), 0),)) for code, d in directory.children)]
    if directory.pixels is not None:
        tags += [
            Tag(STRIP_OFFSETS, LONG, (pixel_offset,)),
            Tag(STRIP_SIZES, LONG, (directory.pixels.nbytes,)),
        ]
    tail_offset = offset + 2 + 12 * len(tags) + 4
    entries, tail = b"", b""
    for tag in sorted(tags, key=lambda t: t.code):
        data, count = _values(tag)
        if len(data) > 4:
            field = struct.pack("<I", tail_offset + len(tail))
            tail += data + bytes(len(data) % 2)
        else:
            field = data.ljust(4, b"\0")
        entries += struct.pack("<HHI", tag.code, tag.kind, count) + field
    return struct.pack("<H", len(tags)) + entries + bytes(4) + tail


def _values(tag: Tag) -> tuple[bytes, int]:
    if isinstance(tag.values, bytes):
        return tag.values, len(tag.values)
    letters = _FORMAT[tag.kind]
    count = len(tag.values) // len(letters)
    return struct.pack("<" + letters * count, *tag.values), count


def rationals(values: Iterable[float]) -> tuple[int, ...]:
    """Numerators and denominators in turn; numbers return within 5e-7 of themselves."""
    fractions = [Fraction(float(value)).limit_denominator(_DENOMINATOR) for value in values]
    return tuple(n for f in fractions for n in (f.numerator, f.denominator))


def quotients(values: Sequence[float]) -> list[float]:
    """The numbers of numerators and denominators in turn; [] where one is over 0 or has no denominator."""
    numerators, denominators = values[::2], values[1::2]
    if len(numerators) != len(denominators) or not all(denominators):
        return []
    return [n / d for n, d in zip(numerators, denominators, strict=True)]


# TIFF, and what Panasonic and Olympus write in the place of its 42.
_BYTE_ORDERS = {b"II*\0": "<", b"MM\0*": ">", b"IIU\0": "<", b"IIRO": "<", b"IIRS": "<", b"MMOR": ">"}


def read_directories(file: BinaryIO) -> list[dict[int, Tag]]:
    """The first directory of a TIFF, its EXIF directory and its sub-directories, as far as they are whole.

    [] where `file` is no TIFF. Tags by code; broken entries are left out.
    """
    header = file.read(_HEADER_SIZE)
    order = _BYTE_ORDERS.get(header[:4])
    if order is None or len(header) < _HEADER_SIZE:
        return []
    size = file.seek(0, 2)
    first = _read_directory(file, order, struct.unpack(order + "I", header[4:])[0], size)
    children = [offset for code in (EXIF_IFD, SUB_IFD) if code in first for offset in first[code].values]
    return [first, *(_read_directory(file, order, o, size) for o in children[:_MAX_CHILDREN])]


def _read_directory(file: BinaryIO, order: str, offset: float, size: int) -> dict[int, Tag]:
    if not 0 <= offset <= size - 2:  # nor NaN
        return {}
    file.seek(int(offset))
    (count,) = struct.unpack(order + "H", file.read(2))
    entries = file.read(12 * min(count, _MAX_ENTRIES))
    tags: dict[int, Tag] = {}
    left = _MAX_DIRECTORY_BYTES
    for start in range(0, len(entries) - 11, 12):
        code, kind, values = struct.unpack_from(order + "HHI", entries, start)
        letters = "B" if kind in _BYTES else _FORMAT.get(kind, "")
        length = values * struct.calcsize(order + letters)
        if not 0 < length <= min(_MAX_TAG_BYTES, left):
            continue
        data = entries[start + 8 : start + 8 + length]
        if length > 4:
            (place,) = struct.unpack_from(order + "I", entries, start + 8)
            if place + length > size:
                continue
            file.seek(place)
            data = file.read(length)
            left -= length
        tags[code] = Tag(
            code, kind, data if kind in _BYTES else struct.unpack(order + letters * values, data)
        )
    return tags
