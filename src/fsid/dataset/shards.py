"""Shards: WebDataset tar files that appear whole or not at all.

A shard is written under a hidden name of its process, flushed to the disk and renamed, so what exists is
finished and what is missing is the remaining work: there is no other bookkeeping. All tar metadata is
constant (time 0, owner 0), so equal samples give equal shards, and of two writers either may be last.
"""

from __future__ import annotations

import io
import os
import re
import socket
import tarfile
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from itertools import groupby, starmap
from pathlib import Path
from typing import Any

from fsid.errors import FsidError
from fsid.files import check_file, open_new
from fsid.yaml_json import parse_json

_PART = re.compile(r"\.shard-\d+\.tar\..+-\d+\.part|(config\.yaml|README\.md|samples\.png)(\.\d+)?\.part")
"""Names that writers give (`part_path`, `fsid.files.write_together`) and people hardly do."""

_HEAD_BYTES = 16384
_LONG_PART = re.compile(rb', "(scene|settings)": \{')
"""Where in the JSON that FSID writes all else is said, and 200 kB may follow."""

_MOST_END_BYTES = 2 * (tarfile.BLOCKSIZE + tarfile.RECORDSIZE)
"""Two blocks of zeros end a tar and more fill its last record; GNU tar -A leaves up to a record beyond it."""


def shard_path(folder: str | Path, number: int) -> Path:
    """Path of shard `number`."""
    return Path(folder) / f"shard-{number:05d}.tar"


def part_path(path: Path) -> Path:
    """Where this thread writes a shard before it gets its name."""
    return path.with_name(f".{path.name}.{socket.gethostname()}-{threading.get_native_id()}.part")


def remove_parts(folder: Path, unused_s: float) -> None:
    """Remove what killed writers left in a dataset's folder, if nobody wrote to it for `unused_s` seconds.

    A writer that is alive after all fails, harmlessly.
    """
    latest = time.time() - unused_s
    for part in folder.iterdir():
        with suppress(FileNotFoundError):  # its writer was faster
            if _PART.fullmatch(part.name) and (not unused_s or part.stat().st_mtime < latest):
                part.unlink()


def find_shards(folder: str | Path) -> list[Path]:
    """The finished shards of a dataset, in the order of their numbers; FsidError where there is none."""
    folder = Path(folder)
    if not folder.is_dir():
        raise FsidError(f"{folder}: is not a dataset folder (fsid generate makes one)")
    shards = sorted(folder.glob("shard-*.tar"), key=_in_order)
    if not shards:
        raise FsidError(f"{folder}: holds no shard-*.tar (fsid generate makes them)")
    return shards


def _in_order(path: Path) -> list[str | int]:
    """Digits count as numbers: shard-100000 comes after shard-99999."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", path.name)]


def write_shard(path: str | Path, samples: Iterable[tuple[str, Mapping[str, bytes]]]) -> None:
    """Write (key, {extension: bytes}) samples as one tar, atomically. FsidError where the disk refuses."""
    path = Path(path)
    part = part_path(path)
    with _disk_refusals(path):
        try:
            with (
                open_new(part) as file,
                tarfile.open(fileobj=file, mode="w", format=tarfile.USTAR_FORMAT) as tar,
            ):
                for _ in starmap(partial(_add, tar), samples):  # a loop would keep one while the next is made
                    pass
                tar.close()
                file.flush()
                os.fsync(file.fileno())
            os.replace(part, path)
        finally:
            part.unlink(missing_ok=True)


def _add(tar: tarfile.TarFile, key: str, files: Mapping[str, bytes]) -> None:
    for extension, data in files.items():
        member = tarfile.TarInfo(f"{key}.{extension}")
        member.size = len(data)
        member.mode = 0o644
        tar.addfile(member, io.BytesIO(data))


def shard_keys(path: str | Path) -> list[str]:
    """The keys of the samples inside a shard, in order. FsidError where it is not a readable tar."""
    return list(dict.fromkeys(name.partition(".")[0] for name in _members(path)))


def count_whole(path: str | Path) -> int:
    """How many samples of a shard are whole: have their JSON, which is written last."""
    return sum(name.endswith(".json") for name in _members(path))


def read_member(path: str | Path, name: str) -> bytes:
    """One file of a shard, for example `00000000.json`. FsidError where it or the shard cannot be read."""
    with open_shard(Path(path)) as (tar, members):
        found = [member for member in members if member.name == name]
        if not found:
            raise FsidError(f"{path}: has no readable member {name}")
        return _content(tar, found[-1])


def read_samples(path: Path) -> dict[str, dict[str, bytes]]:
    """All samples of a shard by key, and their files by extension. FsidError where it is not readable."""
    samples: dict[str, dict[str, bytes]] = {}
    for name, data in read_files(path):
        key, _, extension = name.partition(".")
        samples.setdefault(key, {})[extension] = data
    return samples


def each_sample(path: Path) -> Iterator[tuple[str, dict[str, bytes]]]:
    """The samples of a shard of `write_shard` one after the other, so that one is in memory. FsidError as
    `read_samples`."""
    for key, files in groupby(read_files(path), lambda file: file[0].partition(".")[0]):
        yield key, {name.partition(".")[2]: data for name, data in files}


def read_record(data: bytes, where: str) -> dict[str, Any]:
    """The content of a sample's JSON. FsidError, naming `where`, unless it is JSON of keys with values."""
    record = parse_json(data, where)
    if not isinstance(record, dict):
        raise FsidError(f"{where}: is not the JSON of a sample; expected keys with values")
    return record


def read_records(path: Path) -> Iterator[dict[str, Any]]:
    """The content of the JSON of every sample of a shard. FsidError where it is not readable."""
    for name, data in read_files(path, ".json"):
        yield _stored_record(data, path, name)


def _stored_record(data: bytes, path: Path, name: str) -> dict[str, Any]:
    try:
        return read_record(data, f"{path}: {name}")
    except FsidError as error:
        raise FsidError(f"{error}; delete the shard and generate again") from None


def read_heads(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Name of every sample's JSON and its content up to scene and settings, which are not read; the whole
    content where FSID did not write it. FsidError where it is not readable."""
    with open_shard(path) as (tar, members):
        for member in members:
            if member.name.endswith(".json"):
                head = _content(tar, member, _HEAD_BYTES)
                long = _LONG_PART.search(head) if head.startswith(b'{"key": ') else None
                data = head[: long.start()] + b"}" if long else _content(tar, member)
                yield member.name, _stored_record(data, path, member.name)


@contextmanager
def records_of(path: Path) -> Iterator[None]:
    """FsidError where the block fails for what the records of a shard lack, or hold instead."""
    try:
        yield
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        reason = f"lacks {error}" if isinstance(error, KeyError) else str(error)
        raise FsidError(
            f"{path}: the JSON of a sample is not of fsid generate ({reason}); delete it and generate again"
        ) from None


def read_files(path: Path, suffix: str = "") -> Iterator[tuple[str, bytes]]:
    """Name and content of the files of a shard whose names end so. FsidError where it is not readable."""
    with open_shard(path) as (tar, members):
        for member in members:
            if member.name.endswith(suffix):
                yield member.name, _content(tar, member)


@contextmanager
def open_shard(path: Path) -> Iterator[tuple[tarfile.TarFile, Iterator[tarfile.TarInfo]]]:
    """A tar and its plain files, in order. FsidError where it is not readable, or after the last file where
    that is not the end.

    Links and sparse files, which may name each other or state any size, are none that FSID writes.
    """
    check_file(path)
    try:
        with tarfile.open(path, "r:") as tar:
            yield tar, _plain_files(tar)
    except (OSError, tarfile.TarError, ValueError, OverflowError, RecursionError, MemoryError) as error:
        reason = str(error) or "a header states a size that no memory holds"
        raise FsidError(f"{path}: is not a readable shard ({reason}); delete it and generate again") from None


def _plain_files(tar: tarfile.TarFile) -> Iterator[tarfile.TarInfo]:
    """`tarfile` takes a damaged header for the end, and so it takes zeros in the place of one."""
    yield from (member for member in tar if member.isreg() and not member.issparse())
    assert tar.fileobj is not None
    tar.fileobj.seek(tar.offset)
    rest = tar.fileobj.read(_MOST_END_BYTES + 1)
    if len(rest) > _MOST_END_BYTES or any(rest):
        raise tarfile.ReadError(f"at byte {tar.offset} is neither a file nor the end of a tar")


def _content(tar: tarfile.TarFile, member: tarfile.TarInfo, at_most: int = -1) -> bytes:
    file = tar.extractfile(member)
    assert file is not None
    return file.read(at_most)


def _members(path: str | Path) -> list[str]:
    with open_shard(Path(path)) as (_, members):
        return [member.name for member in members]


@contextmanager
def _disk_refusals(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise FsidError(
            f"{path}: cannot be written ({error.strerror}); nothing half-written is left"
        ) from None
