"""RAW files that are no TIFF but carry one: their EXIF.

    CR3 (Canon):    ISO base media file;   moov / uuid / CMT1 is a TIFF on the camera, CMT2 on the exposure
    RAF (Fujifilm): at byte 84 the place and size of a JPEG, whose first APP1 segment is an Exif TIFF

LibRaw tells exposure and lens of such files but not, through rawpy, who made the camera. The layouts are
those that the documentation of ExifTool and L. Clevy's notes on CR3 describe; no file was at hand.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from typing import BinaryIO

from fsid.sensor.tiff import Tag, read_directories

_CANON = bytes.fromhex("85c0b687820f11e08111f4ce462b6a48")
_MAX_BYTES = 1 << 20  # of a box or a segment that is worth reading
_MAX_BOXES = 64


def embedded_directories(file: BinaryIO) -> list[dict[int, Tag]]:
    """Directories as `read_directories` returns them, the camera's first; [] where there are none."""
    file.seek(0)
    start = file.read(16)
    if start[4:8] == b"ftyp":
        tiffs = [data for data in _canon(file) if data]
    elif start.startswith(b"FUJIFILMCCD-RAW "):
        tiffs = [data for data in (_fujifilm(file),) if data]
    else:
        return []
    return [directory for data in tiffs for directory in read_directories(io.BytesIO(data))]


def _canon(file: BinaryIO) -> tuple[bytes, bytes]:
    """The contents of CMT1 and CMT2."""
    found = {b"CMT1": b"", b"CMT2": b""}
    for kind, place, length in _boxes(file, 0, file.seek(0, 2)):
        if kind == b"moov":
            for inner, inner_place, inner_length in _boxes(file, place, place + length):
                file.seek(inner_place)
                if inner == b"uuid" and file.read(16) == _CANON:
                    for name, at, size in _boxes(file, inner_place + 16, inner_place + inner_length):
                        if name in found and size <= _MAX_BYTES:
                            file.seek(at)
                            found[name] = file.read(size)
    return found[b"CMT1"], found[b"CMT2"]


def _boxes(file: BinaryIO, place: int, end: int) -> Iterator[tuple[bytes, int, int]]:
    """(kind, place and length of the content) of the boxes between two places of an ISO base media file."""
    for _ in range(_MAX_BOXES):
        if place + 8 > end:
            return
        file.seek(place)
        length, kind = struct.unpack(">I4s", file.read(8))
        if length < 8 or place + length > end:  # 64-bit lengths belong to pixels, which come last
            return
        yield kind, place + 8, length - 8
        place += length


def _fujifilm(file: BinaryIO) -> bytes:
    """The Exif TIFF of the JPEG preview."""
    file.seek(84)
    numbers = file.read(8)
    if len(numbers) < 8:
        return b""
    place, size = struct.unpack(">II", numbers)
    file.seek(place)
    head = file.read(min(size, 12))
    if len(head) < 12 or head[:4] != b"\xff\xd8\xff\xe1" or head[6:12] != b"Exif\0\0":
        return b""
    return file.read(struct.unpack(">H", head[4:6])[0] - 8)
