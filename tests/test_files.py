"""A file appears whole or not at all, and nothing lies beside it afterwards."""

import errno
import fcntl
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest

from fsid.dataset import grid, save_png, shard_keys, to_uint8
from fsid.dataset.photos import read_photo
from fsid.dataset.pictures import read_exr
from fsid.dataset.shards import part_path, write_shard
from fsid.errors import FsidError
from fsid.evaluate.testset import TESTSET_FILE, read_testset
from fsid.files import check_folder, held, make_folder, write_atomically, write_together
from fsid.sensor import load_profile
from fsid.yaml_json import read_json, read_yaml


def test_a_file_is_replaced_whole(tmp_path: Path) -> None:
    write_atomically(tmp_path / "a", b"old")
    write_atomically(tmp_path / "a", b"new")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a": b"new"}


@pytest.mark.parametrize(
    "write",
    [write_atomically, lambda path, data: write_shard(path, [("a", {"b": data})])],
    ids=["file", "shard"],
)
def test_nothing_is_written_through_a_link_that_lies_in_the_way(
    tmp_path: Path, write: Callable[[Path, bytes], None]
) -> None:
    """The names of unfinished files can be guessed: a folder of others may hold links, or pipes, for all."""
    victim, path = tmp_path / "victim", tmp_path / "a.tar"
    victim.write_bytes(b"precious")
    parts = path.with_name(f"a.tar.{os.getpid()}.part"), part_path(path)
    for part in parts:
        part.symlink_to(victim)
    write(path, b"new")
    assert victim.read_bytes() == b"precious"
    assert b"new" in path.read_bytes()
    assert not path.is_symlink()
    for part in parts:
        part.unlink(missing_ok=True)
        os.mkfifo(part)
    write(path, b"newer")
    assert b"newer" in path.read_bytes()


def test_what_is_no_file_is_not_replaced_by_one(tmp_path: Path) -> None:
    """Whoever may write to /dev would have a file for /dev/null."""
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "null").symlink_to("/dev/null")
    for name in ("pipe", "null"):
        with pytest.raises(FsidError, match=f"{name}: cannot be written"):
            write_together({tmp_path / "a": b"new", tmp_path / name: b"new"})
    assert (tmp_path / "pipe").is_fifo()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["null", "pipe"]


def test_an_interrupted_write_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    write_atomically(tmp_path / "a", b"old")
    monkeypatch.setattr("fsid.files.os.replace", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_atomically(tmp_path / "a", b"new")
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a": b"old"}


def test_a_picture_that_cannot_be_written_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    picture = np.zeros((2, 2, 3), np.uint8)
    save_png(tmp_path / "a.png", picture)
    before = (tmp_path / "a.png").read_bytes()
    monkeypatch.setattr("fsid.files.os.replace", full)
    with pytest.raises(FsidError, match=r"a\.png: cannot be written \(No space"):
        save_png(tmp_path / "a.png", picture + 255)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == {"a.png": before}


@pytest.mark.parametrize(
    ("pixels", "words"),
    [
        (np.full((2, 2, 3), 9, np.uint16), "uint16 values: give sRGB values in 0..1"),
        (np.ones((2, 2, 3), bool), "bool values"),
        (np.full((2, 2, 3), np.nan), "NaN"),
        (np.zeros((3, 2, 2)), r"\(height, width, 3\); got \(3, 2, 2\)"),
        (np.zeros((0, 2, 3)), r"got \(0, 2, 3\)"),
    ],
)
def test_what_is_no_picture_is_not_written_as_one(tmp_path: Path, pixels: np.ndarray, words: str) -> None:
    with pytest.raises(FsidError, match=words):
        save_png(tmp_path / "a.png", pixels)
    assert not list(tmp_path.iterdir())


def test_a_grid_takes_what_can_be_written() -> None:
    tile = np.full((2, 2, 3), 0.5)
    np.testing.assert_array_equal(grid([tile]), grid([to_uint8(tile)]))
    with pytest.raises(FsidError, match="at least one"):
        grid([])


@pytest.mark.parametrize("refused", ["folder", "missing/b", "x" * 254])
def test_of_files_that_belong_together_none_is_written_without_the_others(
    tmp_path: Path, refused: str
) -> None:
    (tmp_path / "folder").mkdir()
    write_together({tmp_path / "a": b"old", tmp_path / "b": b"old"})
    for order in (("a", refused), (refused, "a")):
        with pytest.raises(FsidError, match=f"{refused}: cannot be written"):
            write_together({tmp_path / name: b"new" for name in order})
        assert sorted(path.name for path in tmp_path.iterdir()) == ["a", "b", "folder"]
        assert (tmp_path / "a").read_bytes() == b"old"


def test_threads_may_write_to_one_place(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        for _ in pool.map(lambda n: write_atomically(tmp_path / "a", bytes([n]) * 1000), range(100)):
            pass
    assert len(set((tmp_path / "a").read_bytes())) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["a"]


def test_a_place_that_is_no_folder_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(FsidError, match="cannot be written"):
        write_atomically(tmp_path / "file" / "a", b"new")


@pytest.mark.parametrize("make", [make_folder, check_folder])
@pytest.mark.parametrize("inside", ["", "deeper/still"])
def test_a_link_to_nothing_is_no_folder(tmp_path: Path, make: Callable[[Path], None], inside: str) -> None:
    """The system says that it exists, and Python that it does not."""
    (tmp_path / "out").symlink_to(tmp_path / "gone")
    with pytest.raises(FsidError, match=r"cannot be written; .*/out is (a link to .*/gone|no folder)"):
        make(tmp_path / "out" / inside)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


@pytest.fixture
def patience() -> Iterator[None]:
    def too_long(*_: object) -> NoReturn:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, too_long)
    signal.alarm(10)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


def _zeros(path: Path) -> None:
    path.symlink_to("/dev/zero")


def _holes(path: Path) -> None:
    """100 GB that take no place."""
    path.touch()
    os.truncate(path, 100 << 30)


@pytest.mark.usefixtures("patience")
def test_what_the_shell_passes_is_read() -> None:
    """`fsid generate --config <(command)`; a command without end is not."""
    read, write = os.pipe()
    os.write(write, b"width: 64")
    os.close(write)
    assert read_yaml(Path(f"/dev/fd/{read}")) == {"width": 64}
    os.close(read)
    zeros = os.open("/dev/zero", os.O_RDONLY)
    with pytest.raises(FsidError, match="too large"):
        read_yaml(Path(f"/dev/fd/{zeros}"))
    os.close(zeros)


@pytest.mark.parametrize("make", [os.mkfifo, _zeros, _holes, Path.mkdir])
@pytest.mark.parametrize(
    ("name", "read"),
    [
        ("a.yaml", read_yaml),
        ("a.json", read_json),
        ("a.yaml", load_profile),
        (TESTSET_FILE, lambda path: read_testset(path.parent)),
        ("a.png", read_photo),
        ("a.exr", read_exr),
        ("shard-00000.tar", shard_keys),
    ],
)
def test_no_reader_waits_for_what_has_no_end(
    tmp_path: Path, make: Callable[[Path], None], name: str, read: Callable[[Path], object]
) -> None:
    """A pipe that nobody writes to, a device, a file of holes, a folder: as a stranger's archive may hold."""
    make(tmp_path / name)
    with pytest.raises(FsidError, match=name):
        read(tmp_path / name)


def test_a_folder_that_knows_no_locks_is_held_by_a_file_in_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """NFS: only what is open for writing can be locked."""
    lock = fcntl.flock

    def of_nfs(file: Any, operation: int) -> None:
        descriptor = file if isinstance(file, int) else file.fileno()
        if fcntl.fcntl(descriptor, fcntl.F_GETFL) & os.O_ACCMODE == os.O_RDONLY:
            raise OSError(errno.EBADF, os.strerror(errno.EBADF))
        lock(descriptor, operation)

    monkeypatch.setattr(fcntl, "flock", of_nfs)
    with held(tmp_path, "another is at work") as alone:
        assert alone
        with pytest.raises(FsidError, match="another is at work"), held(tmp_path, "another is at work"):
            pass
    with held(tmp_path, "another is at work") as alone:
        assert alone
    monkeypatch.setattr(fcntl, "flock", lambda *_: (_ for _ in ()).throw(OSError(errno.ENOLCK, "no locks")))
    with held(tmp_path, "another is at work") as alone:
        assert not alone
