"""Files that mean harm, or none at all: each is one refused file with a reason, fast and in little memory."""

from __future__ import annotations

import base64
import json
import os
import re
import resource
import struct
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from fsid.assets.sources import load_source, mesh_sources, survey_meshes
from fsid.assets.sources.catalogue import CATALOGUE
from fsid.assets.sources.limits import MAX_JSON_VALUES, MAX_LICENCE_LETTERS, MAX_LINES
from fsid.assets.survey import KNOWN

GOOD = trimesh.creation.box((0.2, 0.3, 0.4))
SECONDS = 5.0


@pytest.fixture(autouse=True)
def no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FSID_CACHE", "off")
    KNOWN.clear()


def refused(folder: Path) -> str:
    """The reason why the one bad file beside a good one is skipped; the good one must survive."""
    GOOD.export(folder / "zz_good.ply")
    start, peak = time.perf_counter(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    survey = survey_meshes(str(folder))
    assert time.perf_counter() - start < SECONDS
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak < 600 * 1024, "KiB"
    assert [source.name for source in survey.usable] == [f"file:{folder}/zz_good.ply"]
    assert len(survey.skipped) == 1
    reason = survey.skipped[0][1]
    assert reason
    assert "\n" not in reason
    return reason


def test_a_link_to_itself(tmp_path: Path) -> None:
    (tmp_path / "loop.obj").symlink_to(tmp_path / "loop.obj")
    refused(tmp_path)


def gltf(**changes) -> dict:
    """A glTF document of one triangle."""
    data = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], "<f4").tobytes()
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": len(data)}],
        "buffers": [
            {
                "byteLength": len(data),
                "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode(),
            }
        ],
    }
    return document | changes


def huge(count: int) -> list[dict]:
    return [{"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3"}]


GLTF = {
    "accessor of 10^12": gltf(accessors=huge(10**12)),
    "accessor beyond its view": gltf(accessors=huge(1000)),
    "accessor of negative count": gltf(accessors=huge(-3)),
    "accessor without data": gltf(accessors=[{"componentType": 5126, "count": 9_000_000, "type": "VEC3"}]),
    "node its own child": gltf(nodes=[{"mesh": 0, "children": [0]}]),
    "nodes in a circle": gltf(nodes=[{"mesh": 0}, {"children": [2]}, {"children": [1]}]),
    "billion instances": gltf(
        nodes=[{"children": [i + 1, i + 1]} for i in range(30)] + [{"mesh": 0}], scenes=[{"nodes": [0]}]
    ),
    "a chain of 4000 nodes": gltf(nodes=[*({"children": [i + 1]} for i in range(4000)), {"mesh": 0}]),
    "a million nodes": gltf(nodes=[{"mesh": 0}] * 100_000),
    "buffer above the folder": gltf(buffers=[{"byteLength": 36, "uri": "../secret.bin"}]),
    "buffer above, escaped": gltf(buffers=[{"byteLength": 36, "uri": "%2e%2e/secret.bin"}]),
    "buffer by absolute path": gltf(buffers=[{"byteLength": 36, "uri": "/etc/passwd"}]),
    "buffer from the net": gltf(buffers=[{"byteLength": 36, "uri": "http://example.com/a.bin"}]),
    "buffer that is a device": gltf(buffers=[{"byteLength": 36, "uri": "zero"}]),
    "draco": gltf(extensionsRequired=["KHR_draco_mesh_compression"]),
    "index of no vertex": gltf(
        accessors=[*huge(3), {"bufferView": 0, "componentType": 5125, "count": 9, "type": "SCALAR"}],
        meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    ),
    "fans of one accessor": gltf(
        accessors=huge(11_000_000),
        meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "mode": 6}] * 9}],
        nodes=[{}],
    ),
    "wrong types": gltf(nodes="x", meshes={"a": 1}),
    "nothing": {},
}


@pytest.mark.parametrize("case", GLTF)
def test_a_hostile_gltf_is_refused(tmp_path: Path, case: str):
    folder = tmp_path / "meshes"
    folder.mkdir()
    (tmp_path / "secret.bin").write_bytes(np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], "<f4").tobytes())
    os.symlink("/dev/zero", folder / "zero")
    (folder / "bad.gltf").write_text(json.dumps(GLTF[case]))
    refused(folder)


@pytest.mark.parametrize("asset", [{}, {"asset": {"version": "1.0"}}, {"asset": {"version": "1.1"}}])
def test_a_gltf_of_version_1_is_called_so(tmp_path: Path, asset: dict):
    """Its meshes and all else are dictionaries, and it need not state its version."""
    node = {"meshes": ["a"]}
    (tmp_path / "old.gltf").write_text(json.dumps({**asset, "meshes": {"a": {}}, "nodes": {"n": node}}))
    assert "glTF 1, which is not supported" in refused(tmp_path)


def test_a_glb_of_version_1_is_called_so(tmp_path: Path):
    """It has a length and a format of its text where version 2 has chunks."""
    text = b'{"meshes": {}}  '
    (tmp_path / "old.glb").write_bytes(struct.pack("<4sIIII", b"glTF", 1, 36, len(text), 0) + text)
    assert "glTF 1, which is not supported" in refused(tmp_path)


@pytest.mark.parametrize("changes", [{"meshes": []}, {"meshes": [], "accessors": []}, {"scene": 0}])
def test_a_gltf_of_cameras_alone_has_no_triangles(tmp_path: Path, changes: dict):
    document = {"asset": {"version": "2.0"}, "nodes": [{"camera": 0}], "scenes": [{"nodes": [0]}]}
    (tmp_path / "cameras.gltf").write_text(json.dumps(document | changes))
    assert refused(tmp_path) == "no triangles"


def test_the_gltf_of_these_tests_is_good_without_its_change(tmp_path: Path):
    (tmp_path / "good.gltf").write_text(json.dumps(gltf()))
    assert len(mesh_sources(tmp_path)) == 1


def test_a_link_out_of_the_folder_is_not_followed(tmp_path: Path):
    folder = tmp_path / "meshes"
    folder.mkdir()
    (tmp_path / "secret.bin").write_bytes(b"\0" * 36)
    os.symlink(tmp_path / "secret.bin", folder / "inside.bin")
    document = gltf(buffers=[{"byteLength": 36, "uri": "inside.bin"}])
    (folder / "bad.gltf").write_text(json.dumps(document))
    assert "outside its folder" in refused(folder)


def glb(chunk_bytes: int) -> bytes:
    text = json.dumps(gltf()).encode()
    return struct.pack("<4sIIII", b"glTF", 2, 2**31, chunk_bytes, 0x4E4F534A) + text[:-9]


BYTES = {
    "empty.obj": b"",
    "noise.obj": bytes(np.random.default_rng(0).integers(0, 256, 20_000, np.uint8)),
    "points.obj": b"v 0 0 0\nv 1 0 0\n",
    "outside.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 900000000\n",
    "flat.obj": b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n",
    "zero.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n",
    "too_far_back.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -4\n",
    "short.obj": b"v 0 0\nv 1 0 0 0\nv 0 1 0\nf 1 2 3\n",
    "comb.obj": b"".join(b"v %d %d 0\n" % (i, i % 2 * 9) for i in range(60_000))
    + b"v 0 -9 0\nf "
    + b" ".join(b"%d" % (i + 1) for i in range(60_001)),
    "crossed.obj": b"v nan 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3 4 2 3 1\nf 2 2 2 2\n",
    "nan.obj": b"v nan 0 0\nv 1 nan 0\nv inf 1 0\nf 1 2 3\n",
    "giant.obj": b"v 0 0 0\nv 1e300 0 0\nv 0 1e300 0\nf 1 2 3\n",
    "materials.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    + b"".join(b"usemtl m%d\nf 1 2 3\n" % i for i in range(50_000)),
    "noise.glb": b"glTF" + bytes(range(256)) * 10,
    "long_chunk.glb": glb(2**32 - 1),
    "cut.glb": GOOD.export(file_type="glb")[:300],
    "deep.gltf": b"[" * 100_000,
    "noise.stl": bytes(range(256)) * 10,
    "count.stl": b"\0" * 80 + struct.pack("<I", 2**32 - 1) + b"\0" * 500,
    "cut.ply": GOOD.export(file_type="ply")[:-20],
    "count.ply": b"ply\nformat binary_little_endian 1.0\nelement vertex 999999999999\n"
    b"property float x\nproperty float y\nproperty float z\nend_header\n" + b"\0" * 64,
    "count_ascii.ply": b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    b"property float z\nelement face 99999999999999999999\nproperty list uchar int vertex_indices\n"
    b"end_header\n",
    "list.ply": b"ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\n"
    b"element face 1\nproperty list uint int vertex_indices\nend_header\n" + b"\xff" * 64,
    "script.ply": b"__import__('os').system('touch pwned')\n",
    "not_a_zip.sh3f": b"PK\5\6" + b"\0" * 200,
    "noise.sh3f": bytes(range(256)) * 50,
}


@pytest.mark.parametrize("name", BYTES)
def test_hostile_bytes_are_refused(tmp_path: Path, name: str):
    (tmp_path / name).write_bytes(BYTES[name])
    refused(tmp_path)


def test_a_folder_named_like_a_mesh_and_a_pipe_do_no_harm(tmp_path: Path):
    (tmp_path / "folder.obj").mkdir()
    os.mkfifo(tmp_path / "pipe.obj")
    assert "not a file" in refused(tmp_path)


def library(path: Path, catalogue: str, members: dict[str, bytes]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(CATALOGUE, catalogue)
        for name, content in members.items():
            archive.writestr(name, content)


def test_a_pipe_or_a_device_named_like_a_library_is_left_out(tmp_path: Path):
    """A pipe would be waited for, and a device read without end; this test would hang."""
    trimesh.creation.box().export(tmp_path / "good.ply")
    os.mkfifo(tmp_path / "pipe.sh3f")
    (tmp_path / "zero.sh3f").symlink_to("/dev/zero")
    found = survey_meshes(str(tmp_path))
    assert [source.name for source in found.usable] == [f"file:{tmp_path / 'good.ply'}"]
    assert [reason for _, reason in found.skipped] == ["not a file", "not a file"]


def test_a_decompression_bomb_is_not_unpacked(tmp_path: Path):
    library(tmp_path / "bomb.sh3f", "model#1=bomb.obj\n", {"bomb.obj": b"\n" * (300 * 2**20)})
    assert "unpacks to 300 MiB" in refused(tmp_path)


def test_a_catalogue_bomb_is_not_unpacked(tmp_path: Path):
    with zipfile.ZipFile(tmp_path / "bomb.sh3f", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(CATALOGUE, b"\n" * (20 * 2**20))
    assert "unpacks to" in refused(tmp_path)


def test_a_library_of_more_models_than_any_has_is_not_looked_through(tmp_path: Path):
    """100 kB that name 20,000 models which are not there left as many files in the cache."""
    library(tmp_path / "x.sh3f", "".join(f"model#{i}=a{i}\n" for i in range(10_001)), {})
    assert "10,001 models" in refused(tmp_path)


def test_a_long_licence_takes_no_time(tmp_path: Path):
    """A zip of 1 kB took a minute to tell whether its licence is CC0, and one of 2 kB four times as long."""
    catalogue = f"model#1=a.obj\nlicense=CC0 {'attribution ' * 40_000}\n"
    library(tmp_path / "x.sh3f", catalogue, {"a.obj": GOOD.export(file_type="obj").encode()})
    (source,) = survey_meshes(str(tmp_path), cc0_only=True).usable
    assert len(source.licence) == MAX_LICENCE_LETTERS


_PLY = (
    b"element vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
    b"property list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
)
SWELLING = {
    "empty lines": ("a.ply", b"ply\nformat ascii 1.0\n" + _PLY + b"\n" * MAX_LINES, "lines"),
    "empty lines of another kind": (
        "a.ply",
        b"ply\r\nformat ASCII 1.0\r\n" + _PLY + b"\f" * MAX_LINES,
        "lines",
    ),
    "solids": ("a.stl", b"solid\nfacet\nendsolid\n" * 5_001, "solids"),
    "values": ("a.gltf", b'{"x":[' + b"{}," * MAX_JSON_VALUES + b"{},0]}", "values"),
}


@pytest.mark.parametrize("case", SWELLING)
def test_text_that_swells_as_it_is_read_is_refused(tmp_path: Path, case: str):
    """A line became an array and an empty pair of braces a dict: zips of 16 and 245 kB took 3 and 6 GB."""
    name, content, reason = SWELLING[case]
    library(tmp_path / "x.sh3f", f"model#1={name}\n", {name: content})
    assert re.search(f"more than [0-9,]+ {reason}", refused(tmp_path))


def test_a_catalogue_of_blanks_takes_no_time(tmp_path: Path):
    library(tmp_path / "x.sh3f", f"license=a{' ' * 10**6}b\nmodel#1=missing.obj\n", {})
    assert "not in the archive" in refused(tmp_path)


@pytest.mark.parametrize("name", ["../../climbed.obj", "/abs/climbed.obj", "a/../../climbed.obj"])
def test_members_that_climb_write_nothing(tmp_path: Path, name: str):
    """They are read under their name inside the archive, or not at all; nothing is unpacked to disk."""
    folder = tmp_path / "a" / "b"
    folder.mkdir(parents=True)
    content = GOOD.export(file_type="obj").encode()
    library(folder / "x.sh3f", f"model#1={name}\nwidth#1=-1\ndepth#1=nan\nheight#1=1e999\n", {name: content})
    before = sorted(p for p in tmp_path.rglob("*"))
    GOOD.export(folder / "zz_good.ply")
    survey = survey_meshes(str(folder))
    assert f"file:{folder}/zz_good.ply" in [s.name for s in survey.usable]
    assert sorted(p for p in tmp_path.rglob("*") if p.name != "zz_good.ply") == before


def test_a_gltf_in_a_library_reads_nothing_outside_it(tmp_path: Path):
    (tmp_path / "secret.bin").write_bytes(b"\0" * 36)
    document = gltf(buffers=[{"byteLength": 36, "uri": "../secret.bin"}])
    library(tmp_path / "x.sh3f", "model#1=m/bad.gltf\n", {"m/bad.gltf": json.dumps(document).encode()})
    assert "no member" in refused(tmp_path)


def test_a_library_without_a_catalogue_or_with_a_damaged_member(tmp_path: Path):
    library(tmp_path / "x.sh3f", "model#1=a.obj\n", {"a.obj": GOOD.export(file_type="obj").encode() * 50})
    data = bytearray((tmp_path / "x.sh3f").read_bytes())
    at = data.find(b"a.obj")
    data[at + 20 : at + 60] = b"\xff" * 40
    (tmp_path / "x.sh3f").write_bytes(data)
    assert "damaged" in refused(tmp_path)


def test_names_and_licences_that_are_no_text_can_be_printed(tmp_path: Path):
    """A name that no JSON, hash or terminal takes is left out; a licence is shown with escapes."""
    content = GOOD.export(file_type="obj").encode()
    Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff.obj")).write_bytes(content)
    catalogue = "model#1=\\ud800.obj\nmodel#2=a.obj\nlicense#2=\\udfff\n"
    library(tmp_path / "x.sh3f", catalogue, {"a.obj": content})
    survey = survey_meshes(str(tmp_path))
    ((name, licence),) = [(source.name, source.licence) for source in survey.usable]
    assert name == f"file:{tmp_path}/x.sh3f!a.obj"
    assert licence == "\\udfff"
    assert len(survey.skipped) == 2
    assert all(f"{name}: {reason}".encode() for name, reason in survey.skipped)


def test_a_zip_that_states_a_huge_directory_is_not_opened(tmp_path: Path):
    library(tmp_path / "x.sh3f", "model#1=a.obj\n", {})
    data = bytearray((tmp_path / "x.sh3f").read_bytes())
    data[-10:-6] = struct.pack("<I", 2**31)
    (tmp_path / "x.sh3f").write_bytes(data)
    assert "too many members" in refused(tmp_path)


@pytest.mark.parametrize(
    "changes",
    [
        {"faces": np.full((12, 3), 10**6, np.int32)},
        {"faces": np.zeros((12, 3))},
        {"vertices": np.zeros(3, np.float32)},
        {"face_parts": np.full(12, -1, np.int32)},
        {"part_names": np.array([print], object)},
        {"measures": np.zeros(2)},
    ],
    ids=lambda changes: next(iter(changes)),
)
def test_what_others_put_into_a_cache_that_they_share_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changes: dict[str, np.ndarray]
) -> None:
    monkeypatch.setenv("FSID_CACHE", str(tmp_path / "cache"))
    GOOD.export(tmp_path / "a.ply")
    name = f"file:{tmp_path}/a.ply"
    mesh, survey = load_source(name), survey_meshes(str(tmp_path))
    (entry,) = (tmp_path / "cache" / "meshes").glob("*.npz")
    with np.load(entry) as stored:
        arrays = dict(stored)
    np.savez(entry, **arrays | changes)
    KNOWN.clear()
    assert survey_meshes(str(tmp_path)) == survey
    np.testing.assert_array_equal(load_source(name).faces, mesh.faces)


def test_random_damage_is_always_one_line(tmp_path: Path):
    """Every format with bytes changed, cut and repeated: a mesh that keeps the contract, or a reason."""
    rng = np.random.default_rng(7)
    originals = {suffix: _bytes_of(suffix) for suffix in ("glb", "obj", "ply", "stl")}
    for i in range(120):
        suffix = list(originals)[i % 4]
        data = bytearray(originals[suffix])
        for _ in range(int(rng.integers(1, 8))):
            at = int(rng.integers(len(data)))
            data[at : at + int(rng.integers(1, 5))] = rng.bytes(int(rng.integers(0, 5)))
        (tmp_path / f"{i:03}.{suffix}").write_bytes(data)
    GOOD.export(tmp_path / "zz_good.ply")
    survey = survey_meshes(str(tmp_path))
    assert len(survey.usable) + len(survey.skipped) == 121
    assert survey.skipped


def _bytes_of(suffix: str) -> bytes:
    data = GOOD.export(file_type=suffix)
    return data.encode() if isinstance(data, str) else data
