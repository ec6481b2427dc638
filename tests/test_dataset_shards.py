"""A shard exists whole or not at all."""

from __future__ import annotations

import errno
import io
import shutil
import subprocess
import tarfile
import weakref
from pathlib import Path

import pytest

from fsid.dataset import read_member, shard_keys, shard_path, write_shard
from fsid.dataset.shards import (
    count_whole,
    each_sample,
    find_shards,
    read_heads,
    read_records,
    read_samples,
)
from fsid.errors import FsidError


def test_what_is_written_is_read(tmp_path: Path):
    path = shard_path(tmp_path, 3)
    write_shard(path, [("a", {"json": b"1", "clean.dng": b"22"}), ("b", {"json": b""})])
    assert path.name == "shard-00003.tar"
    assert shard_keys(path) == ["a", "b"]
    assert read_member(path, "a.clean.dng") == b"22"


@pytest.mark.parametrize("kind", [tarfile.XHDTYPE, tarfile.XGLTYPE, tarfile.GNUTYPE_LONGNAME])
def test_a_header_that_states_more_than_memory_holds_is_refused(tmp_path: Path, kind: bytes):
    member = tarfile.TarInfo("x")
    member.type, member.size = kind, 10**15
    path = shard_path(tmp_path, 0)
    path.write_bytes(member.tobuf(tarfile.GNU_FORMAT) + bytes(1024))
    with pytest.raises(FsidError, match=r"shard-00000\.tar: is not a readable shard \(a header"):
        shard_keys(path)


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


def test_a_sample_is_let_go_before_the_next_is_asked_for(tmp_path: Path):
    """The next one is rendered, which needs the memory."""

    class Files(dict[str, bytes]):
        pass

    def samples(left: list[weakref.ref[Files]]):
        for key in ("a", "b", "c"):
            assert all(files() is None for files in left)
            made = [Files(json=b"{}")]
            left.append(weakref.ref(made[0]))
            yield key, made.pop()

    write_shard(tmp_path / "x.tar", samples([]))
    assert shard_keys(tmp_path / "x.tar") == ["a", "b", "c"]


def test_samples_come_one_after_the_other_as_they_come_together(tmp_path: Path):
    path = tmp_path / "x.tar"
    write_shard(path, [("a", {"json": b"1", "clean.dng": b"22"}), ("b", {"json": b"3"})])
    assert dict(each_sample(path)) == read_samples(path)


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


def _member(name: str, kind: bytes, link: str = "", data: bytes = b"", size: int | None = None) -> bytes:
    """A header as old GNU tar writes it, and what follows it."""
    member = tarfile.TarInfo(name)
    member.type, member.linkname, member.size = kind, link, len(data)
    head = bytearray(member.tobuf(tarfile.GNU_FORMAT))
    if size is not None:  # of a sparse file, holes included
        head[483:495] = b"\x80" + size.to_bytes(11, "big")
        head[148:156] = b" " * 8
        head[148:156] = b"%06o\0 " % sum(head)
    return bytes(head) + data.ljust(-(-len(data) // 512) * 512, b"\0")


@pytest.mark.parametrize(
    ("first", "reads"),
    [
        (_member("b.json", tarfile.SYMTYPE, "b.json"), True),
        (_member("b.json", tarfile.SYMTYPE, "/etc/passwd"), True),
        (_member("b.json", tarfile.LNKTYPE, "b.json"), True),
        (_member("b.json", tarfile.FIFOTYPE), True),
        (_member("b.json", tarfile.GNUTYPE_SPARSE, size=200 << 30), True),
        (_member("p", tarfile.XHDTYPE, data=b"12 path=aaa\n") * 3000, False),
        (_member("p", tarfile.XHDTYPE, data=b"31 size=9999999999999999999999\n"), False),
        (_member("p", tarfile.XHDTYPE, data=b"9999999999999999999999 size=9\n"), False),
        (_member("p", tarfile.XHDTYPE, data=b"22 GNU.sparse.map=0,x\n"), False),
    ],
)
def test_a_strangers_shard_is_read_or_named(tmp_path: Path, first: bytes, reads: bool):
    """What links or states sizes is no file of a sample; numbers that cannot be are one line."""
    whole = io.BytesIO()
    with tarfile.open(fileobj=whole, mode="w") as tar:
        member = tarfile.TarInfo("a.json")
        member.size = 2
        tar.addfile(member, io.BytesIO(b"{}"))
    path = shard_path(tmp_path, 0)
    path.write_bytes(first + whole.getvalue())
    if reads:
        assert read_samples(path) == {"a": {"json": b"{}"}}
        assert shard_keys(path) == ["a"]
        return
    for read in (read_samples, shard_keys):
        with pytest.raises(FsidError, match=r"shard-00000\.tar: is not a readable shard"):
            read(path)


@pytest.mark.parametrize("kind", ["flipped bit", "zeros"])
def test_a_damaged_header_is_no_end(tmp_path: Path, kind: str):
    """`tarfile` reads what stands before it, and the samples behind were gone without a word."""
    path = shard_path(tmp_path, 0)
    write_shard(path, [(f"{i:08d}", {"clean.dng": bytes([i]) * 12000, "json": b"{}"}) for i in range(4)])
    whole = bytearray(path.read_bytes())
    with tarfile.open(path) as tar:
        start = tar.getmember("00000002.clean.dng").offset
    if kind == "zeros":  # as of a copy that was stopped on a file system that had reserved the size
        whole[start:] = bytes(len(whole) - start)
    else:
        whole[start + 3] ^= 1
    path.write_bytes(whole)
    for read in (read_samples, shard_keys, count_whole, lambda path: list(read_records(path))):
        with pytest.raises(FsidError, match=rf"not a readable shard \(at byte {start} .*; delete it"):
            read(path)


def test_a_tar_ends_with_zeros_up_to_a_whole_record(tmp_path: Path):
    """As tarfile, webdataset and GNU tar write it; a tar that was cut behind a file has none."""
    path = shard_path(tmp_path, 0)
    for size in range(0, 10240, 512):
        write_shard(path, [("a", {"bin": bytes(size), "json": b"{}"})])
        assert path.stat().st_size % tarfile.RECORDSIZE == 0
        assert shard_keys(path) == ["a"]
    path.write_bytes(path.read_bytes()[: size + 3 * 512])
    assert count_whole(path) == 1


@pytest.mark.parametrize("size", [0, 9 << 10])
def test_tars_that_were_joined_are_read_whole_or_named(tmp_path: Path, size: int):
    """`cat` leaves the end of the first, where `tarfile` stops; GNU tar -A writes over it, and more zeros."""
    catted, appended, other = (shard_path(tmp_path, number) for number in range(3))
    write_shard(appended, [("a", {"json": bytes(size)})])
    write_shard(other, [("b", {"json": bytes(size)})])
    catted.write_bytes(appended.read_bytes() + other.read_bytes())
    with pytest.raises(FsidError, match=r"shard-00000\.tar: is not a readable shard"):
        shard_keys(catted)
    tar = shutil.which("tar")
    if not tar or subprocess.run([tar, "-Af", appended, other], capture_output=True).returncode:
        pytest.skip("no GNU tar here")
    assert shard_keys(appended) == ["a", "b"]


def test_a_record_that_is_none_is_named_with_what_to_do(tmp_path: Path):
    path = shard_path(tmp_path, 0)
    write_shard(path, [("a", {"json": b'{"key": \0\0'})])
    for read in (read_records, read_heads):
        with pytest.raises(FsidError, match=r"a\.json: is not valid JSON .*; delete the shard and generate"):
            list(read(path))
