"""Files appear whole or not at all, and a folder is one process's at a time."""

from __future__ import annotations

import contextlib
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from fsid.errors import FsidError


def write_atomically(path: Path, data: bytes) -> None:
    """Replace `path` by `data`, or leave it as it was. FsidError where the disk refuses."""
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        part.write_bytes(data)
        os.replace(part, path)
    except OSError as error:
        raise FsidError(f"{path}: cannot be written ({error.strerror})") from None
    finally:
        with contextlib.suppress(OSError):  # gone already, or never there
            part.unlink()


@contextlib.contextmanager
def held(folder: Path, taken: str) -> Iterator[None]:
    """`folder` exists and is this process's until the end of the block, or until it dies.

    FsidError where it cannot be made, or where another process has it: `taken` says what that does.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise FsidError(f"{folder}: cannot be written ({error.strerror})") from None
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise FsidError(f"{folder}: {taken}; wait for it or stop it") from None
        except OSError:
            pass  # a network file system without locks
        yield
    finally:
        os.close(descriptor)
