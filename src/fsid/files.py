"""Files appear whole or not at all, and a folder is one process's at a time."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import re
import threading
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

from fsid.errors import FsidError


def paths_of(paths: str | Path | Iterable[str | Path]) -> list[Path]:
    """A list of paths, or a single one, as a list: a single text would be taken for a list of its letters."""
    return [Path(paths)] if isinstance(paths, str | Path) else [Path(path) for path in paths]


MOST_BYTES = 1 << 26
"""Of settings, cards and records, the largest of which are a few megabytes."""

_PASSED = re.compile(r"/dev/stdin|/(dev|proc/self)/fd/\d+")
"""Open descriptors of this process: the only pipes that are read, since whoever started it passed them."""


def read_whole(path: Path, most_bytes: int = MOST_BYTES) -> bytes:
    """The content of a file of at most so many bytes, or of what the shell passes, as for `<(command)`.

    FsidError where it is larger or cannot be read.
    """
    if not _PASSED.fullmatch(str(path)):
        check_file(path)
    try:
        with path.open("rb") as file:
            is_small = os.fstat(file.fileno()).st_size <= most_bytes
            data = file.read(most_bytes + 1) if is_small else b""
    except OSError as error:
        raise FsidError(f"{path}: cannot be read ({error.strerror})") from None
    if not is_small or len(data) > most_bytes:
        raise FsidError(f"{path}: is more than {most_bytes >> 20} MiB, too large for what it should be")
    return data


def same_files(some: Iterable[Path], others: Iterable[Path]) -> bool:
    """Whether a file of `some` is one of `others`, by another spelling where names ignore case, too."""
    return not _identities(some).isdisjoint(_identities(others))


def _identities(paths: Iterable[Path]) -> set[object]:
    """Where each path leads and, of a file that is there, which file that is."""
    found: set[object] = set()
    for path in paths:
        found.add(path.resolve())
        with contextlib.suppress(OSError):
            there = path.stat()
            found.add((there.st_dev, there.st_ino))
    return found


def check_file(path: Path) -> None:
    """FsidError where `path` is there and no file: a pipe may stay silent, and a device has no end."""
    if path.exists() and not path.is_file():
        raise FsidError(f"{path}: cannot be read (it is no file)")


def stamp(path: Path) -> tuple[int, ...]:
    """What changes with the content of a file, or with the names in a folder; () where there is none."""
    try:
        found = path.stat()
    except FileNotFoundError:
        return ()
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns


class DiskError(FsidError):
    """The disk is full, may not be written to, or this folder may not: nor will the next file there."""


_NOR_THE_NEXT = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES)


def write_atomically(path: Path, data: bytes) -> None:
    """Replace `path` by `data`, or leave it as it was. FsidError where the disk refuses, see `DiskError`."""
    write_together({path: data})


def write_together(files: Mapping[Path, bytes]) -> None:
    """Write files that belong together: all lie on the disk before the first takes its place, in their order.

    FsidError names the one that the disk refuses; then all are as they were. So it does for what is no file:
    renaming would put one in the place of /dev/null or of a pipe.
    """
    parts = {path: path.with_name(f"{path.name}.{threading.get_native_id()}.part") for path in files}
    try:
        for path, data in files.items():
            if path.is_dir():
                raise OSError(errno.EISDIR, os.strerror(errno.EISDIR))
            if path.exists() and not path.is_file():
                raise FsidError(f"{path}: cannot be written (it is no file); give another name")
            with open_new(parts[path]) as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())  # else a power cut may leave an empty file under the name
        for path, part in parts.items():
            os.replace(part, path)
    except OSError as error:
        kind = DiskError if error.errno in _NOR_THE_NEXT else FsidError
        raise kind(f"{path}: cannot be written ({error.strerror})") from None
    finally:
        for part in parts.values():
            with contextlib.suppress(OSError):  # gone already, or never there
                part.unlink()


def open_new(part: Path) -> BinaryIO:
    """A new file to write; whatever has its name is removed first. OSError where the disk refuses.

    That may be what a killed process left or, in a folder of others, a link, through which a file elsewhere
    would be written, or a pipe, on which this process would wait.
    """
    part.unlink(missing_ok=True)
    return part.open("xb")


def check_folder(folder: Path) -> None:
    """DiskError unless `folder` is there or can be made, and be written to: before the work that fills it."""
    there = next(path for path in (folder, *folder.absolute().parents) if os.path.lexists(path))
    if not (there.is_dir() and os.access(there, os.W_OK | os.X_OK)):
        raise DiskError(f"{folder}: cannot be written; {there} is no folder that you may write to")


def check_output(path: Path) -> None:
    """FsidError unless a file can be written to `path`: before the work of which it is made."""
    if not path.parent.is_dir():
        raise FsidError(f"{path}: cannot be written (no such folder); make it first")
    if path.exists() and not path.is_file():
        raise FsidError(f"{path}: cannot be written (it is no file); give another name")
    check_folder(path.parent)


def make_folder(folder: Path) -> None:
    """`folder` is there afterwards, and all above it. FsidError where it cannot be made."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError:
        there = next(path for path in (folder, *folder.absolute().parents) if os.path.lexists(path))
        reason = f"a link to {there.readlink()}, which is not there" if there.is_symlink() else "no folder"
        raise FsidError(f"{folder}: cannot be written; {there} is {reason}") from None
    except OSError as error:
        raise FsidError(f"{folder}: cannot be written ({error.strerror})") from None


@contextlib.contextmanager
def held(folder: Path, taken: str) -> Iterator[bool]:
    """`folder` exists and is this process's until the end of the block, or until it dies.

    Yields whether that is sure: some network file systems know no locks. FsidError where it cannot be made,
    or where another process has it: `taken` says what that does.
    """
    make_folder(folder)
    with contextlib.ExitStack() as stack:
        try:
            descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        except OSError as error:
            raise FsidError(f"{folder}: cannot be written ({error.strerror})") from None
        stack.callback(os.close, descriptor)
        alone = _lock(descriptor, folder, taken)
        if not alone:  # NFS locks only what is open for writing, as no folder is
            with contextlib.suppress(OSError):
                file = stack.enter_context((folder / ".fsid.lock").open("ab"))
                alone = _lock(file.fileno(), folder, taken)
        yield alone


def _lock(descriptor: int, folder: Path, taken: str) -> bool:
    """Lock what is open until it is closed; False where its file system knows no lock for it."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise FsidError(f"{folder}: {taken}; wait for it or stop it") from None
    except OSError:
        return False
    return True
