"""TIFF 6.0 as bytes: a header, directories of tags, pixels.

    "II" 42 offset | directory: count, (code, type, count, value or offset)..., next | ... | pixels

FSID reads TIFF with tifffile and writes it here, for two reasons: a DNG needs an EXIF directory, or LibRaw
does not see its ISO, and tifffile writes none; and the same image must give the same bytes on every machine,
whatever version of a library is installed there.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

BYTE, ASCII, SHORT, LONG, RATIONAL, SRATIONAL, DOUBLE = 1, 2, 3, 4, 5, 10, 12

_FORMAT = {BYTE: "B", SHORT: "H", LONG: "I", RATIONAL: "I", SRATIONAL: "i", DOUBLE: "d"}
_HEADER_SIZE = 8


@dataclass(frozen=True)
class Tag:
    """One entry. values: numbers (numerator, denominator, ... for rationals), or bytes for BYTE and ASCII."""

    code: int
    kind: int
    values: Sequence[float] | bytes


@dataclass(frozen=True)
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
        Tag(256, LONG, (pixels.shape[1],)),
        Tag(257, LONG, (pixels.shape[0],)),
        Tag(258, SHORT, (8 * pixels.itemsize,) * samples),
        Tag(259, SHORT, (1,)),  # no compression
        Tag(262, SHORT, (photometric,)),
        Tag(277, SHORT, (samples,)),
        Tag(278, LONG, (pixels.shape[0],)),
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
        tags += [Tag(273, LONG, (pixel_offset,)), Tag(279, LONG, (directory.pixels.nbytes,))]
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
    count = len(tag.values) // (2 if tag.kind in (RATIONAL, SRATIONAL) else 1)
    return struct.pack(f"<{len(tag.values)}{_FORMAT[tag.kind]}", *tag.values), count
