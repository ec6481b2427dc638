"""Sweet Home 3D furniture libraries (.sh3f): a zip of models, their true sizes and licences.

The catalogue is Java properties: `model#7=/chairs/oak.obj`, `width#7=45.5` (centimetres), and for all of
them `license=...`. Models are in any unit and stretched to the catalogue's size after `modelRotation#7`,
a 3 x 3 matrix. Nothing is unpacked to disk, so a member's name can climb nowhere.
"""

from __future__ import annotations

import re
import struct
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fsid.assets.file_names import shown
from fsid.assets.sources.limits import (
    MAX_ARCHIVE_BYTES,
    MAX_CATALOGUE_BYTES,
    MAX_DIRECTORY_BYTES,
    MAX_FILE_BYTES,
    MAX_LICENCE_LETTERS,
    MAX_MODELS,
    NotNowError,
    RefusedError,
)

CATALOGUE = "PluginFurnitureCatalog.properties"
_LINE = re.compile(r"^[ \t]*([\w.]+(?:#\d+)?)[ \t]*[=:](.*)$", re.MULTILINE)
_END_RECORD = struct.Struct("<4s4H2LH")


@dataclass(frozen=True, eq=False)
class Entry:
    """One model. member: its name in the archive. size_m: (3,) width, depth, height, or None where the
    catalogue states none. rotation: (3, 3), y up. present: whether the archive has it."""

    member: str
    licence: str
    size_m: np.ndarray | None
    rotation: np.ndarray
    present: bool


def read_catalogue(path: Path) -> tuple[Entry, ...]:
    """All models of a library in its order. Raises RefusedError."""
    with open_archive(path) as archive:
        try:
            text = _read(archive, CATALOGUE, MAX_CATALOGUE_BYTES).decode("latin-1")
        except KeyError:
            raise RefusedError(f"no {CATALOGUE} in it") from None
        lines = text.replace("\r\n", "\n").replace("\r", "\n")
        values = {key: _unescaped(value.strip(" \t")) for key, value in _LINE.findall(lines)}
        numbers = [key.partition("#")[2] for key in values if key.startswith("model#")]
        if len(numbers) > MAX_MODELS:
            raise RefusedError(f"{len(numbers):,} models; at most {MAX_MODELS:,} are read")
        return tuple(_entry(values, number, archive) for number in numbers)


def read_member(path: Path, member: str) -> bytes:
    """The content of one member. Raises RefusedError."""
    with open_archive(path) as archive:
        try:
            return _read(archive, member, MAX_FILE_BYTES)
        except KeyError:
            raise RefusedError(f"no member '{member}' in the archive") from None


def open_archive(path: Path) -> zipfile.ZipFile:
    """A zip whose directory is of bearable size. Raises RefusedError."""
    if path.exists() and not path.is_file():  # a pipe may stay silent, and a device has no end
        raise RefusedError("not a file")
    try:
        _check_directory(path)
        return zipfile.ZipFile(path)
    except OSError as error:
        raise NotNowError(f"cannot be opened ({error.strerror})") from None
    except (zipfile.BadZipFile, ValueError, NotImplementedError) as error:
        raise RefusedError(f"not a readable zip archive ({error})") from None


def _check_directory(path: Path) -> None:
    """The size of the directory as the record at the file's end states it; `zipfile` would read it all."""
    with path.open("rb") as file:
        size = file.seek(0, 2)
        if size > MAX_ARCHIVE_BYTES:
            raise RefusedError(f"larger than {MAX_ARCHIVE_BYTES >> 20} MiB")
        file.seek(max(0, size - 2**16 - _END_RECORD.size - 20))
        tail = file.read()
    at = tail.rfind(b"PK\5\6", 0, max(0, len(tail) - _END_RECORD.size + 4))
    if at < 0:
        raise RefusedError("not a zip archive")
    directory_bytes = _END_RECORD.unpack_from(tail, at)[5]
    if directory_bytes > MAX_DIRECTORY_BYTES or tail[max(0, at - 20) : at].startswith(b"PK\6\7"):
        raise RefusedError("too many members")


def _read(archive: zipfile.ZipFile, member: str, limit: int) -> bytes:
    info = archive.getinfo(member)
    if info.file_size > limit:
        raise RefusedError(f"unpacks to {info.file_size >> 20} MiB; at most {limit >> 20} MiB are read")
    try:
        with archive.open(info) as file:
            return file.read(limit)
    except (OSError, EOFError, zipfile.BadZipFile, zlib.error, RuntimeError, NotImplementedError) as error:
        raise RefusedError(f"damaged in the archive ({error})") from None


def _entry(values: dict[str, str], number: str, archive: zipfile.ZipFile) -> Entry:
    member = values[f"model#{number}"].lstrip("/")
    sides = _floats(" ".join(values.get(f"{key}#{number}", "") for key in ("width", "depth", "height")), 3)
    rotation = _floats(values.get(f"modelRotation#{number}", ""), 9)
    return Entry(
        member=member,
        licence=shown(values.get(f"license#{number}", values.get("license", ""))[:MAX_LICENCE_LETTERS]),
        size_m=None if sides is None or not (sides > 0).all() else np.clip(sides / 100, 1e-4, 1e3),
        rotation=np.eye(3) if rotation is None else rotation.reshape(3, 3),
        present=member in archive.NameToInfo,
    )


def _floats(text: str, count: int) -> np.ndarray | None:
    try:
        numbers = np.array([float(word) for word in text.split()])
    except ValueError:
        return None
    return numbers if len(numbers) == count and np.isfinite(numbers).all() else None


def _unescaped(value: str) -> str:
    """Java's escapes: \\uXXXX, and a backslash before any other character."""
    return re.sub(r"\\(?:u([0-9a-fA-F]{4})|(.))", lambda m: chr(int(m[1], 16)) if m[1] else m[2], value)
