"""A shard exists whole or not at all."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest

from fsid.dataset import read_member, shard_keys, shard_path, write_shard
from fsid.dataset.shards import find_shards
from fsid.errors import FsidError


def test_what_is_written_is_read(tmp_path: Path):
    path = shard_path(tmp_path, 3)
    write_shard(path, [("a", {"json": b"1", "clean.dng": b"22"}), ("b", {"json": b""})])
    assert path.name == "shard-00003.tar"
    assert shard_keys(path) == ["a", "b"]
    assert read_member(path, "a.clean.dng") == b"22"


def test_shards_come_in_the_order_of_their_numbers(tmp_path: Path):
    """Names have five digits, and more from 100,000 on; sets put together have another number before."""
    ordered = ["shard-0-00000.tar", "shard-2-00000.tar", "shard-10-00000.tar", "shard-00011.tar"]
    ordered += ["shard-10001.tar", "shard-99999.tar", "shard-100000.tar", "shard-one.tar"]
    for name in ordered:
        (tmp_path / name).touch()
    found = [shard.name for shard in find_shards(tmp_path)]
    for part in (ordered[:3], ordered[3:]):
        assert [name for name in found if name in part] == part


def test_equal_samples_give_equal_bytes(tmp_path: Path):
    for name in ("x.tar", "y.tar"):
        write_shard(tmp_path / name, [("a", {"json": b"1"})])
    assert (tmp_path / "x.tar").read_bytes() == (tmp_path / "y.tar").read_bytes()


def test_a_failing_sample_leaves_nothing(tmp_path: Path):
    def samples():
        yield "a", {"json": b"1"}
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_shard(tmp_path / "x.tar", samples())
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path: Path):
    def samples():
        yield "a", {"json": b"1"}
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(FsidError, match=r"x\.tar.*No space left"):
        write_shard(tmp_path / "x.tar", samples())
    assert list(tmp_path.iterdir()) == []


def test_a_truncated_shard_is_named(tmp_path: Path):
    path = tmp_path / "x.tar"
    path.write_bytes(b"not a tar")
    with pytest.raises(FsidError, match=r"x\.tar"):
        shard_keys(path)
