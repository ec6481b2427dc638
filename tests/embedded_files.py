"""Smallest CR3 and RAF files: their layout and their EXIF, without pixels."""

from __future__ import annotations

import io
import struct

from fsid.sensor.tiff import ASCII, RATIONAL, SHORT, Directory, Tag, read_directories, tiff_bytes


def exif(*tags: Tag) -> bytes:
    return tiff_bytes(Directory(tags))


def box(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I4s", len(content) + 8, kind) + content


CAMERA = exif(Tag(271, ASCII, b"Canon\0"), Tag(272, ASCII, b"Canon EOS R5\0"), Tag(274, SHORT, (8,)))
EXPOSURE = exif(Tag(33434, RATIONAL, (1, 125)), Tag(34855, SHORT, (3200,)), Tag(42036, ASCII, b"RF50mm\0"))
CANON = bytes.fromhex("85c0b687820f11e08111f4ce462b6a48")
CR3 = (
    box(b"ftyp", b"crx \0\0\0\1crx isom")
    + box(b"moov", box(b"uuid", CANON + box(b"CNCV", b"v") + box(b"CMT1", CAMERA) + box(b"CMT2", EXPOSURE)))
    + box(b"mdat", bytes(64))
)
BOTH = exif(*(tag for part in (CAMERA, EXPOSURE) for tag in read_directories(io.BytesIO(part))[0].values()))
JPEG = b"\xff\xd8\xff\xe1" + struct.pack(">H", len(BOTH) + 8) + b"Exif\0\0" + BOTH
RAF = b"FUJIFILMCCD-RAW 0201".ljust(84, b"\0") + struct.pack(">II", 160, len(JPEG)) + bytes(68) + JPEG
