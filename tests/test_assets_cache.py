"""Laws of the bake cache: it never changes a result, never believes a bad file, never grows without end."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fsid.assets import bake_cache, bake_material, material_registry
from fsid.assets.bake_cache import cached, content_key, pack, unpack
from fsid.assets.material_registry import SHARED, draw_material, material_families

ASSETS = Path(material_registry.__file__).parent
MAPS = ("mix", "pattern", "detail", "roughness", "height", "metallic")


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("FSID_CACHE", str(tmp_path))
    return tmp_path / "materials"


def same(first, second) -> bool:
    numbers = (first.relief_m, first.tile_m, first.colours) == (
        second.relief_m,
        second.tile_m,
        second.colours,
    )
    return numbers and all(np.array_equal(getattr(first, name), getattr(second, name)) for name in MAPS)


def counted(monkeypatch) -> list[str]:
    """Names of the families that are really drawn from now on."""
    calls: list[str] = []

    def draw(family, variant, size):
        calls.append(family)
        return draw_material(family, variant, size)

    monkeypatch.setattr(material_registry, "draw_material", draw)
    return calls


def test_with_without_and_from_the_cache_are_identical(folder, monkeypatch):
    calls = counted(monkeypatch)
    fresh = bake_material("brick", 1, 64)
    stored = bake_material("brick", 1, 64)
    assert len(calls) == 1
    monkeypatch.setenv("FSID_CACHE", "off")
    assert same(fresh, stored)
    assert same(fresh, bake_material("brick", 1, 64))
    assert len(calls) == 2


def test_packing_rounds_within_what_the_renderer_stores():
    maps = draw_material("rusty_metal", 1, 64)
    once = unpack(pack(maps), 64)
    assert np.abs(once.height - maps.height).max() <= 0.5001 / 65535
    for name in ("mix", "pattern", "roughness", "metallic"):
        assert np.abs(getattr(once, name) - getattr(maps, name)).max() <= 0.5001 / 255, name
    assert np.abs(once.detail - maps.detail).max() <= 0.5001 / 254
    assert same(unpack(pack(once), 64), once)


def test_neutral_detail_stays_neutral():
    maps = unpack(pack(draw_material("printed_text", 0, 64)), 64)
    flat = type(maps)(**{**vars(maps), "detail": np.full((64, 64), 0.5, np.float32)})
    assert (unpack(pack(flat), 64).detail == 0.5).all()


@pytest.mark.parametrize("damage", ["truncated", "garbage", "empty", "flipped", "pickle", "wrong size"])
def test_a_damaged_entry_is_baked_again(folder, damage, monkeypatch):
    expected = bake_material("brick", 0, 64)
    (path,) = folder.iterdir()
    data = bytearray(path.read_bytes())
    if damage == "truncated":
        path.write_bytes(data[: len(data) // 2])
    elif damage == "garbage":
        path.write_bytes(os.urandom(1000))
    elif damage == "empty":
        path.write_bytes(b"")
    elif damage == "flipped":
        data[len(data) // 2] ^= 0xFF
        path.write_bytes(data)
    elif damage == "pickle":
        np.savez(path, planes=np.array([{}], dtype=object), metres=np.zeros(2), colours=np.zeros((0, 3)))
    else:
        np.savez(path, **pack(draw_material("brick", 0, 128)))
    calls = counted(monkeypatch)
    assert same(bake_material("brick", 0, 64), expected)
    assert same(bake_material("brick", 0, 64), expected)
    assert calls == ["brick"]


def test_the_key_covers_every_source_that_a_family_imports():
    """A family module that drew with a module outside SHARED could leave stale entries behind."""
    names = [f"{module.stem}.py" for module in ASSETS.glob("materials/*.py")]
    assert len(names) > 5
    shared_files = [ASSETS / f"{module.rsplit('.', 1)[1]}.py" for module in SHARED]
    for path in [*ASSETS.glob("materials/*.py"), *shared_files]:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("fsid."):
                known = {*SHARED, "fsid.errors", "fsid.assets.file_names", "fsid.assets.textures"}
                assert node.module in known, f"{path.name} imports {node.module}"


def test_another_source_is_another_key(folder, monkeypatch):
    calls = counted(monkeypatch)
    bake_material("brick", 0, 64)
    monkeypatch.setattr(material_registry, "code_key", lambda modules: content_key([b"edited"]))
    bake_material("brick", 0, 64)
    assert len(calls) == len(list(folder.iterdir())) == 2


def test_content_key_does_not_run_parts_together():
    assert content_key([b"ab", b"c"]) != content_key([b"a", b"bc"])
    assert content_key([b"a"]) == content_key(iter([b"a"]))


def test_the_folder_keeps_below_its_limit_and_loses_the_oldest(folder, monkeypatch):
    maps = draw_material("brick", 0, 64)
    for number in range(3):
        cached("x", content_key([bytes([number])]), 64, lambda: maps)
        path = folder / f"x-64-{content_key([bytes([number])])}.npz"
        os.utime(path, (1e9 + number, 1e9 + number))
    foreign = {"foreign.txt", "foreign.npz", "x-64-12.npz", "y.part"}
    for name in foreign:
        (folder / name).write_text("stays")
        os.utime(folder / name, (1, 1))
    one = path.stat().st_size
    monkeypatch.setattr(bake_cache, "LIMIT_BYTES", int(2.5 * one))
    first = folder / f"x-64-{content_key([bytes([0])])}.npz"
    cached("x", content_key([bytes([0])]), 64, lambda: maps)  # read: now the youngest
    cached("x", content_key([bytes([9])]), 64, lambda: maps)
    kept = {p.name for p in folder.iterdir()}
    assert first.name in kept
    assert foreign <= kept
    assert sum(p.stat().st_size for p in folder.glob("*.npz") if p.name not in foreign) <= 2.5 * one


def test_a_folder_that_cannot_be_written_is_done_without(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv("FSID_CACHE", str(tmp_path / "file"))
    assert bake_material("paint", 0, 64).mix.shape == (64, 64)


def test_entries_may_be_read_by_whom_the_umask_lets(folder):
    bake_material("paint", 0, 64)
    (folder / "probe").touch()
    (entry,) = folder.rglob("paint*.npz")
    assert entry.stat().st_mode == (folder / "probe").stat().st_mode
    assert not list(folder.rglob("*.part"))


def test_the_folder_follows_the_environment(monkeypatch):
    monkeypatch.setenv("FSID_CACHE", "/somewhere")
    assert bake_cache.cache_folder("materials") == Path("/somewhere/materials")
    monkeypatch.delenv("FSID_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", "/xdg")
    assert bake_cache.cache_folder("materials") == Path("/xdg/fsid/materials")
    monkeypatch.setenv("FSID_CACHE", "off")
    assert bake_cache.cache_folder("materials") is None


def test_a_user_without_a_home_has_no_cache(monkeypatch: pytest.MonkeyPatch):
    """As in a container whose user has no entry in passwd: no folder named ~ in the working directory."""

    def no_entry(uid: int) -> None:
        raise KeyError(uid)

    for name in ("FSID_CACHE", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("pwd.getpwuid", no_entry)
    assert bake_cache.cache_folder("materials") is None


def test_processes_that_bake_at_once_agree(folder):
    script = (
        "from zlib import crc32; from fsid.assets import bake_material\n"
        "for v in (0, 1, 2, 3): print(crc32(bake_material('weave', v, 64).height.tobytes()))"
    )
    started = [
        subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) for _ in range(3)
    ]
    outputs = {process.communicate()[0] for process in started}
    assert len(outputs) == 1
    assert len(outputs.pop().split()) == 4
    assert {p.suffix for p in folder.iterdir()} == {".npz"}
    assert len(list(folder.iterdir())) == 4


def test_every_family_is_known_by_its_module():
    for family in material_families():
        assert material_registry._MATERIALS[family].draw.__module__.startswith("fsid.assets.materials.")
