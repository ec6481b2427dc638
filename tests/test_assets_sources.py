"""Meshes that users bring: whatever the file, what comes out is the contract of `Mesh`, or one reason."""

from __future__ import annotations

import base64
import json
import re
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from fsid.assets import build_mesh
from fsid.assets.sources import load_source, mesh_sources, survey_meshes
from fsid.assets.sources.cleaning import KEPT_PARTS, KEPT_TRIANGLES, Triangles, clean
from fsid.assets.sources.polygons import triangulated
from fsid.assets.surfaces import face_areas
from fsid.assets.survey import KNOWN
from fsid.errors import FsidError

FURNITURE = Path("/usr/share/sweethome3d/furniture")
CATALOGUE = "PluginFurnitureCatalog.properties"


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path_factory.mktemp("cache")
    monkeypatch.setenv("FSID_CACHE", str(folder))
    KNOWN.clear()
    return folder


def cube_obj(*, unit: float = 1.0, material: str = "oak") -> str:
    cube = trimesh.creation.box((1.0, 2.0, 3.0))
    lines = [f"v {x * unit} {y * unit} {z * unit}" for x, y, z in cube.vertices]
    return "\n".join(
        [*lines, f"usemtl {material}", *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in cube.faces)]
    )


def triangles_of(mesh: trimesh.Trimesh, *names: str) -> Triangles:
    faces = np.asarray(mesh.faces, np.int64)
    parts = np.arange(len(faces)) * len(names) // len(faces)
    return Triangles(np.asarray(mesh.vertices, float), faces, parts, names)


def assert_contract(mesh) -> None:
    """What every source of geometry promises."""
    assert mesh.vertices.dtype == mesh.normals.dtype == np.float32
    assert mesh.faces.dtype == mesh.face_parts.dtype == np.int32
    assert np.isfinite(mesh.vertices).all()
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-4)
    assert mesh.faces.min() >= 0
    assert mesh.faces.max() < len(mesh.vertices)
    assert set(mesh.face_parts) == set(range(len(mesh.part_names)))
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    np.testing.assert_allclose((low + high)[:2], 0.0, atol=2e-5 * max(1, *(high - low)))
    assert abs(low[2]) < 1e-5 * max(1, *(high - low))
    a, b, c = (mesh.vertices[mesh.faces[:, i]].astype(float) for i in range(3))
    assert (np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-11).all()


@pytest.mark.parametrize("suffix", [".glb", ".gltf", ".obj", ".ply", ".stl"])
def test_every_format_gives_the_same_solid(tmp_path: Path, suffix: str):
    solid = trimesh.creation.box((0.3, 0.2, 0.5))
    if suffix in (".glb", ".gltf", ".obj"):  # y up
        solid.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0)))
    if suffix == ".stl":  # millimetres
        solid.apply_scale(1000)
    if suffix == ".gltf":
        for name, content in trimesh.Scene([solid]).export(file_type="gltf").items():
            (tmp_path / name).write_bytes(content)
    else:
        solid.export(tmp_path / f"model{suffix}")
    (name,) = mesh_sources(tmp_path)
    mesh = build_mesh(name, 0)
    assert_contract(mesh)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), (0.3, 0.2, 0.5), atol=1e-5)
    assert len(mesh.faces) == 12
    assert len(mesh.vertices) == 24, "hard edges are kept"


SPELLINGS = {
    "tabs": lambda text: text.replace(b" ", b"\t"),
    "indented": lambda text: text.replace(b"\nf ", b"\n  f ").replace(b"\nv ", b"\n v "),
    "byte order mark": lambda text: b"\xef\xbb\xbf" + text,
    "Windows lines": lambda text: text.replace(b"\n", b"\r\n"),
    "old Macintosh lines": lambda text: text.replace(b"\n", b"\r"),
    "blanks at the ends": lambda text: text.replace(b"\n", b"  \n"),
    "other letters": lambda text: b"# caf\xe9\n" + text,
    "comments behind data": lambda text: re.sub(rb"^([vf] .*)$", rb"\1# so", text, flags=re.MULTILINE),
    "broken lines": lambda text: re.sub(rb"^(f \d+) ", b"\\1 \\\\\n  ", text, flags=re.MULTILINE),
    "counted backwards": lambda text: re.sub(
        rb"^f.*$",
        lambda face: re.sub(rb"\d+", lambda index: b"%d/-1/-1" % (int(index[0]) - 9), face[0]),
        text,
        flags=re.MULTILINE,
    ),
    "normals and colours": lambda text: re.sub(
        rb"^(v .*)$", rb"\1 0.5 0.5 0.5\nvn 0 0 1", text, flags=re.MULTILINE
    ),
}
"""The same OBJ as different programs write it."""


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_an_obj_may_be_spelled_in_any_way(tmp_path: Path, spelling: str):
    plain = cube_obj().encode()
    (tmp_path / "plain.obj").write_bytes(plain)
    (tmp_path / "other.obj").write_bytes(SPELLINGS[spelling](plain))
    other, one = (build_mesh(name, 0) for name in mesh_sources(tmp_path))
    np.testing.assert_array_equal(other.vertices, one.vertices)
    np.testing.assert_array_equal(other.faces, one.faces)
    assert other.part_names == one.part_names


def test_an_obj_counts_backwards_from_the_last_vertex_so_far(tmp_path: Path):
    cube = trimesh.creation.box((1.0, 1.0, 1.0))
    lines = []
    for k in range(3):
        lines += [f"o cube{k}", *(f"v {x + 2 * k} {y} {z}" for x, y, z in cube.vertices)]
        lines += [f"f {a - 8} {b - 8} {c - 8}" for a, b, c in cube.faces]
    (tmp_path / "cubes.obj").write_text("\n".join(lines))
    mesh = load_source(f"file:{tmp_path}/cubes.obj")
    assert len(mesh.faces) == 36
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), (5, 1, 1), rtol=1e-6)


@pytest.mark.parametrize("corners", [4, 5, 6, 7, 20, 101])
def test_triangles_of_a_concave_face_cover_it_once(corners: int):
    """Stars in any plane, from any first corner, among convex faces of as many corners."""
    rng = np.random.default_rng(corners)
    flat, area = [], []
    for convex in (False, True, False, False):
        angle = 2 * np.pi * (np.arange(corners) + 0.9 * rng.random(corners)) / corners
        radius = np.ones(corners) if convex else rng.uniform(0.1, 1.0, corners)
        x, y = radius * np.cos(angle), radius * np.sin(angle)
        flat.append(np.stack([x, y, 0 * x], axis=-1) @ np.linalg.qr(rng.normal(size=(3, 3)))[0])
        area.append((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)
    vertices = np.concatenate(flat)
    triangles, face = triangulated(vertices, np.arange(len(vertices)), np.full(4, corners))
    assert len(triangles) == 4 * (corners - 2)
    covered = np.bincount(face, face_areas(vertices, triangles))
    np.testing.assert_allclose(covered, area, rtol=1e-9)


def test_a_face_with_a_slit_to_its_hole_is_covered_once():
    ring = [(0, 0), (3, 0), (3, 3), (0, 3), (0, 0), (1, 1), (1, 2), (2, 2), (2, 1), (1, 1)]
    vertices = np.array([(x, 0.0, -y) for x, y in ring])
    triangles, _ = triangulated(vertices, np.arange(10), np.array([10]))
    assert face_areas(vertices, triangles).sum() == pytest.approx(8)


def test_normals_are_smooth_where_the_shape_is_and_hard_where_it_is_not():
    mesh = clean(triangles_of(trimesh.creation.cylinder(radius=0.1, height=0.4, sections=48), "part"))
    side = np.abs(mesh.normals[:, 2]) < 0.5
    radial = mesh.vertices[side, :2] / np.linalg.norm(mesh.vertices[side, :2], axis=1, keepdims=True)
    np.testing.assert_allclose(mesh.normals[side, :2], radial, atol=2e-3)
    np.testing.assert_allclose(np.abs(mesh.normals[~side, 2]), 1.0, atol=1e-5)


def test_faces_turned_inside_out_at_random_are_put_right():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.2)
    given = triangles_of(ball, "part")
    faces = given.faces.copy()
    wrong = np.random.default_rng(1).random(len(faces)) < 0.5
    faces[wrong] = faces[wrong][:, ::-1]
    mesh = clean(Triangles(given.vertices, faces, given.parts, given.names))
    outward = mesh.vertices - mesh.vertices.mean(0)
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    assert (mesh.normals * outward).sum(1).min() > 0.99
    assert len(mesh.vertices) == len(ball.vertices)


def test_dense_meshes_are_thinned_and_keep_their_shape():
    ball = trimesh.creation.icosphere(subdivisions=6, radius=0.2)
    assert len(ball.faces) > KEPT_TRIANGLES
    mesh = clean(triangles_of(ball, "part"))
    assert KEPT_TRIANGLES / 3 < len(mesh.faces) <= KEPT_TRIANGLES
    radius = np.linalg.norm(mesh.vertices - (0, 0, 0.2), axis=1)
    assert np.abs(radius - 0.2).max() < 0.002


def test_small_parts_are_one():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.2)
    mesh = clean(triangles_of(ball, *(f"m{i}" for i in range(40))))
    assert len(mesh.part_names) == KEPT_PARTS
    assert mesh.part_names[-1] == "other"
    assert_contract(mesh)


def test_degenerate_and_duplicate_triangles_and_wild_points_vanish():
    cube = triangles_of(trimesh.creation.box((0.2, 0.2, 0.2)), "part")
    vertices = np.vstack([cube.vertices, [(np.nan, 0, 0), (np.inf, 1, 1)]])
    extra = [(0, 0, 1), (0, 1, 8), (1, 2, 9), *cube.faces[:3], *cube.faces[:2, ::-1]]
    faces = np.vstack([cube.faces, extra])
    mesh = clean(Triangles(vertices, faces, np.zeros(len(faces), int), ("part",)))
    assert len(mesh.faces) == 12
    assert_contract(mesh)


def test_part_names_are_the_files_materials(tmp_path: Path):
    text = cube_obj().splitlines()
    half = len(text) - 6
    lines = ["mtllib ../../nowhere.mtl", *text[:half], "usemtl Glass_01", *text[half:]]
    (tmp_path / "model.obj").write_text("\n".join(lines))
    mesh = load_source(mesh_sources(tmp_path)[0])
    assert set(mesh.part_names) == {"oak", "Glass_01"}


@pytest.mark.parametrize(
    ("unit", "expected"), [(1.0, 3.0), (100.0, 3.0), (1000.0, 3.0), (1e-4, 0.5), (1e9, 0.5)]
)
def test_a_plausible_size_is_found_for_any_unit(tmp_path: Path, unit: float, expected: float):
    (tmp_path / "model.obj").write_text(cube_obj(unit=unit))
    mesh = load_source(f"file:{tmp_path}/model.obj")
    assert np.ptp(mesh.vertices, axis=0).max() == pytest.approx(expected, rel=1e-4)


def library(path: Path, entries: str, **members: str) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(CATALOGUE, entries)
        for name, content in members.items():
            archive.writestr(name.replace("__", "/") + ".obj", content)
    return path


def test_a_library_gives_sizes_turns_and_licences(tmp_path: Path):
    path = library(
        tmp_path / "some.sh3f",
        "license=Public domain\n"
        "model#1=/a/cube.obj\nwidth#1=40\ndepth#1=60\nheight#1=50\n"
        "model#2=/cube\\ 2.obj\nwidth#2=40\ndepth#2=60\nheight#2=50\nmodelRotation#2=1 0 0 0 0 1 0 -1 0\n"
        "license#2=Creative Commons Attribution 3.0\n"
        "model#3=/missing.obj\nwidth#3=40\ndepth#3=60\nheight#3=50\n",
        **{"a__cube": cube_obj(), "cube 2": cube_obj()},
    )
    survey = survey_meshes(str(tmp_path))
    assert [s.name for s in survey.usable] == [f"file:{path}!a/cube.obj", f"file:{path}!cube 2.obj"]
    for source in survey.usable:
        np.testing.assert_allclose(source.size_m, (0.4, 0.6, 0.5), atol=1e-5)
        assert_contract(load_source(source.name))
    assert survey.skipped == ((f"file:{path}!missing.obj", "not in the archive"),)
    assert mesh_sources(tmp_path, cc0_only=True) == (f"file:{path}!a/cube.obj",)


@pytest.mark.parametrize("end", ["\r\n", "\r"])
def test_the_lines_of_a_catalogue_end_in_any_way(tmp_path: Path, end: str):
    entries = ["license=CC0 ", "model#1 = /a/cube.obj ", "width#1=40", "depth#1=60", "height#1=50", ""]
    path = library(tmp_path / "some.sh3f", end.join(entries), a__cube=cube_obj())
    (source,) = survey_meshes(str(tmp_path)).usable
    assert (source.name, source.licence) == (f"file:{path}!a/cube.obj", "CC0")
    np.testing.assert_allclose(source.size_m, (0.4, 0.6, 0.5), atol=1e-5)


def test_only_stated_public_domain_counts_as_cc0(tmp_path: Path):
    for folder, licence in (("a", "CC0 1.0 Universal"), ("b", "CC BY 4.0"), ("c", None)):
        (tmp_path / folder / "deep").mkdir(parents=True)
        (tmp_path / folder / "deep" / "cube.obj").write_text(cube_obj())
        if licence:
            (tmp_path / folder / "LICENSE.txt").write_text(licence)
    assert len(mesh_sources(tmp_path)) == 3
    assert mesh_sources(tmp_path, cc0_only=True) == (f"file:{tmp_path}/a/deep/cube.obj",)
    reasons = dict(survey_meshes(str(tmp_path), True).skipped)
    assert reasons[f"file:{tmp_path}/b/deep/cube.obj"] == "licence 'CC BY 4.0' is not CC0"


BY_40 = """Attribution 4.0 International

     Creative Commons Corporation ("Creative Commons") is not a law firm.

Creative Commons is not a party to its public licenses. The text of the Creative Commons public licenses is
dedicated to the public domain under the CC0 Public Domain Dedication.
"""
ZERO = (
    "Creative Commons Legal Code\n\nCC0 1.0 Universal\n\n    CREATIVE COMMONS CORPORATION IS NOT A LAW FIRM"
)


@pytest.mark.parametrize(
    ("text", "free"),
    [
        (ZERO, True),
        ("Kit (2.0)\n\nLicense: (Creative Commons Zero, CC0)\ncreativecommons.org/publicdomain/zero", True),
        ("In the public domain.", True),
        (BY_40, False),
        ("Chairs: CC0. Tables: CC BY 3.0.", False),
        ("https://creativecommons.org/licenses/by-sa/4.0/, formerly CC0", False),
    ],
)
def test_a_licence_that_names_cc0_beside_another_is_not_cc0(tmp_path: Path, text: str, free: bool):
    (tmp_path / "cube.obj").write_text(cube_obj())
    (tmp_path / "LICENSE").write_text(text)
    (source,) = survey_meshes(str(tmp_path)).usable
    assert (source.licence == "CC0") == free
    if not free:
        with pytest.raises(FsidError, match="is not CC0"):
            mesh_sources(tmp_path, cc0_only=True)


def test_the_cache_changes_nothing_and_follows_the_file(tmp_path: Path, own_cache: Path):
    file = tmp_path / "model.obj"
    file.write_text(cube_obj(material="glass"))
    fresh = load_source(f"file:{file}")
    assert len(list(own_cache.rglob("*.npz"))) == 1
    again = load_source(f"file:{file}")
    assert again.part_names == fresh.part_names == ("glass",)
    for name in ("vertices", "normals", "faces", "face_parts"):
        np.testing.assert_array_equal(getattr(again, name), getattr(fresh, name))
    for stored in own_cache.rglob("*.npz"):
        stored.write_bytes(stored.read_bytes()[:100])
    np.testing.assert_array_equal(load_source(f"file:{file}").vertices, fresh.vertices)
    file.write_text(cube_obj(unit=0.1))
    assert np.ptp(load_source(f"file:{file}").vertices, axis=0).max() == pytest.approx(0.3)


@pytest.mark.parametrize(("kind", "code"), [("<i2", 5122), ("u1", 5121)])
def test_positions_of_normalised_integers_are_fractions(tmp_path: Path, kind: str, code: int):
    cube = trimesh.creation.box((2.0, 2.0, 2.0))
    steps = np.zeros((8, 4), kind)
    steps[:, :3] = cube.vertices.clip(min=np.sign(np.iinfo(kind).min)) * np.iinfo(kind).max
    data = steps.tobytes() + cube.faces.astype("<u2").tobytes()
    document = {
        "asset": {"version": "2.0"},
        "extensionsRequired": ["KHR_mesh_quantization"],
        "scene": 0,
        "scenes": [{"nodes": [0, 1]}],
        "nodes": [{"mesh": 0, "scale": [0.5, 1.0, 1.5]}, {"mesh": 0, "translation": [0.0, 3.0, 0.0]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": code, "normalized": True, "count": 8, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": steps.nbytes, "byteStride": 4 * steps.itemsize},
            {"buffer": 0, "byteOffset": steps.nbytes, "byteLength": 72},
        ],
        "buffers": [{"byteLength": len(data), "uri": "data.bin"}],
    }
    (tmp_path / "data.bin").write_bytes(data)
    (tmp_path / "cubes.gltf").write_text(json.dumps(document))
    low = 0 if kind == "u1" else -1
    mesh = load_source(f"file:{tmp_path}/cubes.gltf")
    expected = (1 - low, 1.5 * (1 - low), 4 - low)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), expected, rtol=1e-4)


def cube_gltf(*primitives: dict, **changes) -> str:
    """A glTF of a cube whose six sides are accessors 1 to 6, of indices; 0 is its positions."""
    cube = trimesh.creation.box((1.0, 2.0, 3.0))
    order = np.argsort(cube.face_normals @ (1, 2, 3), kind="stable")
    data = cube.vertices.astype("<f4").tobytes() + cube.faces[order].astype("<u2").tobytes()
    side = {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"name": "Cup", "primitives": primitives}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3"},
            *({**side, "byteOffset": 12 * i} for i in range(6)),
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": 72},
        ],
        "buffers": [{"byteLength": 168, "uri": f"data:;base64,{base64.b64encode(data).decode()}"}],
    }
    return json.dumps(document | changes)


def sides(**changes) -> list[dict]:
    return [{"attributes": {"POSITION": 0}, "indices": i + 1, **changes} for i in range(6)]


def test_materials_of_one_gltf_mesh_name_its_parts(tmp_path: Path):
    """As Blender writes an object of several materials; a second object shows the same mesh."""
    primitives = [side | {"material": i % 3} for i, side in enumerate(sides())]
    del primitives[5]["material"]
    text = cube_gltf(
        *primitives,
        materials=[{"name": "Glass"}, {"name": "Steel brushed"}, {}],
        scenes=[{"nodes": [0, 1]}],
        nodes=[{"mesh": 0}, {"mesh": 0, "translation": [4, 0, 0], "children": [2]}, {}],
    )
    (tmp_path / "cup.gltf").write_text(text)
    mesh = load_source(f"file:{tmp_path}/cup.gltf")
    assert len(mesh.faces) == 24
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx((5, 3, 2))
    assert mesh.part_names == ("Glass", "Steel brushed", "material2", "Cup")
    assert np.bincount(mesh.face_parts).tolist() == [8, 8, 4, 4]


def test_shape_keys_and_what_else_is_left_of_a_gltf_may_be_sparse_or_huge(tmp_path: Path):
    shape_key = {"componentType": 5126, "count": 8, "type": "VEC3", "sparse": {"count": 1}}
    never_read = {"bufferView": 0, "componentType": 5126, "count": 10**12, "type": "VEC2"}
    document = json.loads(cube_gltf(*sides(targets=[{"POSITION": 7}])))
    document["accessors"] += [shape_key, never_read]
    document["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = 8
    (tmp_path / "cube.gltf").write_text(json.dumps(document))
    mesh = load_source(f"file:{tmp_path}/cube.gltf")
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), (1, 3, 2), rtol=1e-6)
    assert len(mesh.faces) == 12


@pytest.mark.parametrize("scenes", [{}, {"scenes": [{"nodes": [0, 1]}]}])
def test_a_gltf_without_scenes_shows_all_its_nodes(tmp_path: Path, scenes: dict):
    nodes = [{"children": [2]}, {"mesh": 0, "translation": [4, 0, 0]}, {"mesh": 0}]
    document = json.loads(cube_gltf(*sides(), nodes=nodes))
    del document["scene"], document["scenes"]
    (tmp_path / "cubes.gltf").write_text(json.dumps(document | scenes))
    mesh = load_source(f"file:{tmp_path}/cubes.gltf")
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), (5, 3, 2), rtol=1e-6)


@pytest.mark.parametrize("indexed", [True, False])
def test_a_gltf_fan_is_triangles(tmp_path: Path, indexed: bool):
    """A hexagon about its first corner, whose other sides are no triangles."""
    angle = np.radians(60 * np.arange(6))
    points = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1).astype("<f4")
    order = np.array([2, 3, 4, 5, 0, 1], "u1")
    data = (points if indexed else points[order]).tobytes() + order.tobytes()
    fan = {"attributes": {"POSITION": 0}, "mode": 6, **({"indices": 1} if indexed else {})}
    text = cube_gltf(
        fan,
        {"attributes": {"POSITION": 0}, "mode": 1},
        accessors=[
            {"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR"},
        ],
        bufferViews=[{"buffer": 0, "byteLength": 72}, {"buffer": 0, "byteOffset": 72, "byteLength": 6}],
        buffers=[{"byteLength": 78, "uri": f"data:;base64,{base64.b64encode(data).decode()}"}],
    )
    (tmp_path / "fan.gltf").write_text(text)
    mesh = load_source(f"file:{tmp_path}/fan.gltf")
    assert len(mesh.faces) == 4
    assert face_areas(mesh.vertices.astype(float), mesh.faces).sum() == pytest.approx(1.5 * 3**0.5)


@pytest.mark.parametrize("suffix", ["ply", "glb"])
def test_points_without_a_face_have_no_part_in_the_size(tmp_path: Path, suffix: str):
    cube = trimesh.creation.box((1.0, 2.0, 3.0))
    points = np.vstack([cube.vertices, (1e6, 0, 0)])
    trimesh.Trimesh(points, cube.faces, process=False).export(tmp_path / f"cube.{suffix}")
    (source,) = survey_meshes(str(tmp_path)).usable
    np.testing.assert_allclose(sorted(source.size_m), (1, 2, 3), rtol=1e-5)


@pytest.mark.parametrize(("field", "value"), [(10, 77), (8, 1), (None, 0xFF)])
def test_a_damaged_mesh_in_the_cache_is_made_again(tmp_path: Path, own_cache: Path, field, value: int):
    file = tmp_path / "model.obj"
    file.write_text(cube_obj())
    fresh = load_source(f"file:{file}")
    (stored,) = own_cache.rglob("*.npz")
    data = bytearray(stored.read_bytes())
    if field is None:
        start = 30 + len("vertices.npy") + 20  # past the header of the first member
        data[start : start + 20] = bytes([value] * 20)
    else:
        data[data.index(b"PK\1\2") + field] = value  # method and flags in the directory
    stored.write_bytes(data)
    np.testing.assert_array_equal(load_source(f"file:{file}").vertices, fresh.vertices)


def test_a_gltf_is_read_again_when_its_buffer_comes_or_changes(tmp_path: Path):
    trimesh.creation.box((1.0, 2.0, 3.0)).export(tmp_path / "model.gltf")
    name, buffer = f"file:{tmp_path}/model.gltf", sorted(tmp_path.glob("*.bin"))[0]
    renamed = tmp_path / "größe #1.bin"
    text = (tmp_path / "model.gltf").read_text()
    (tmp_path / "model.gltf").write_text(text.replace(buffer.name, "gr%C3%B6%C3%9Fe%20%231.bin"))
    data = buffer.read_bytes()
    buffer.unlink()
    with pytest.raises(FsidError, match=r"'größe #1\.bin' is missing"):
        load_source(name)
    renamed.write_bytes(data[:20])
    with pytest.raises(FsidError, match="cannot be read"):
        load_source(name)
    renamed.write_bytes(data)
    np.testing.assert_allclose(np.ptp(load_source(name).vertices, axis=0), (1, 3, 2))


def test_a_refusal_that_may_pass_is_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "cube.obj").write_text(cube_obj())

    opened = Path.open

    def denied(path: Path, *arguments, **options):
        if path.suffix == ".obj":
            raise PermissionError(13, "Permission denied")
        return opened(path, *arguments, **options)

    with monkeypatch.context() as context:
        context.setattr(Path, "open", denied)
        with pytest.raises(FsidError, match="Permission denied"):
            load_source(f"file:{tmp_path}/cube.obj")
    assert len(load_source(f"file:{tmp_path}/cube.obj").faces) == 12


def test_a_licence_that_cannot_be_read_says_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "cube.obj").write_text(cube_obj())
    (tmp_path / "LICENSE").write_text(ZERO)
    opened = Path.open

    def denied(path: Path, *arguments, **options):
        if path.name == "LICENSE":
            raise PermissionError(13, "Permission denied", str(path))
        return opened(path, *arguments, **options)

    monkeypatch.setattr(Path, "open", denied)
    (source,) = survey_meshes(str(tmp_path)).usable
    assert source.licence == ""


def test_the_seed_plays_no_part(tmp_path: Path):
    (tmp_path / "cube.obj").write_text(cube_obj())
    (name,) = mesh_sources(tmp_path)
    np.testing.assert_array_equal(build_mesh(name, 1).vertices, build_mesh(name, 2).vertices)


@pytest.mark.parametrize("path", ["nowhere", "empty"])
def test_nothing_usable_is_one_clear_line(tmp_path: Path, path: str):
    (tmp_path / "empty").mkdir()
    with pytest.raises(FsidError, match=path):
        mesh_sources(tmp_path / path)


@pytest.mark.skipif(not FURNITURE.is_dir(), reason="needs the Debian package sweethome3d-furniture")
def test_real_furniture_has_its_catalogue_size():
    survey = survey_meshes(str(FURNITURE / "Reallusion.sh3f"))
    assert len(survey.usable) == 25
    assert not survey.skipped
    female = survey.usable[0]
    np.testing.assert_allclose(female.size_m, (0.466, 0.455, 1.655), rtol=1e-3)
    assert "Attribution" in female.licence
    for source in survey.usable[:5]:
        assert_contract(load_source(source.name))


@pytest.mark.parametrize(("bend_deg", "corners"), [(38.0, 4), (42.0, 6)])
def test_an_edge_is_hard_where_it_bends_by_more_than_forty_degrees(bend_deg: float, corners: int):
    c, s = np.cos(np.radians(bend_deg)), np.sin(np.radians(bend_deg))
    vertices = np.array([(0, 0, 0), (0, 1, 0), (-1, 0.5, 0), (c, 0.5, s)])
    faces = np.array([(0, 1, 2), (1, 0, 3)])
    assert len(clean(Triangles(vertices, faces, np.zeros(2, int), ("part",))).vertices) == corners


def test_the_largest_parts_are_kept_in_the_order_of_the_file():
    sides = np.array([5, 1, 14, 2, 13, 3, 12, 4, 11, 6, 10, 7, 9, 8], float)
    right = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)])
    vertices = np.concatenate([right * side + (0, 0, i) for i, side in enumerate(sides)])
    names = tuple(f"{side:.0f}" for side in sides)
    mesh = clean(Triangles(vertices, np.arange(42).reshape(14, 3), np.arange(14), names))
    assert mesh.part_names == (*(name for name in names if int(name) > 3), "other")


PRISM = np.array([(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2)], float)
"""An L, of area 4: its prism of height 1 has a surface of 18."""


def ply(order: str, faces: list[tuple[int, ...]], points: np.ndarray, extra: bool = False) -> bytes:
    """As text or binary. extra: colours beside both, and an element before and after them."""
    properties = ["property float x", "property double y", "property float z"]
    text = f"ply\nformat {order} 1.0\ncomment by hand\n"
    before = "element camera 1\nproperty list uchar float view\nproperty short n\n" if extra else ""
    colour = "property uchar red\n" if extra else ""
    of_faces = "property list ushort int vertex_indices\n"
    text += f"{before}element vertex {len(points)}\n{colour}" + "".join(f"{p}\n" for p in properties)
    text += f"element face {len(faces)}\n{colour}{of_faces}"
    text += "element edge 1\nproperty int vertex1\nend_header\n"
    rows: list[list[tuple[str, float]]] = []
    if extra:
        rows.append([("B", 2), ("f", 0.5), ("f", 0.25), ("h", -7)])
    red = [("B", 200)] if extra else []
    rows += [[*red, ("f", x), ("d", y), ("f", z)] for x, y, z in points]
    rows += [[*red, ("H", len(face)), *(("i", c) for c in face)] for face in faces]
    rows.append([("i", 0)])
    if order == "ascii":
        return (text + "".join(" ".join(f"{v:g}" for _, v in row) + "\n" for row in rows)).encode()
    mark = "<" if "little" in order else ">"
    return text.encode() + b"".join(struct.pack(mark + kind, value) for row in rows for kind, value in row)


@pytest.mark.parametrize("extra", [False, True])
@pytest.mark.parametrize("order", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_a_ply_may_have_faces_of_any_number_of_corners(tmp_path: Path, order: str, extra: bool):
    """As Blender writes what is not triangulated: sides of four corners, ends of six that are concave."""
    points = np.concatenate([np.pad(PRISM, ((0, 0), (0, 1)), constant_values=z) for z in (0, 1)])
    sides = [(i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6) for i in range(6)]
    (tmp_path / "l.ply").write_bytes(
        ply(order, [*sides, (5, 4, 3, 2, 1, 0), tuple(range(6, 12))], points, extra)
    )
    mesh = load_source(f"file:{tmp_path}/l.ply")
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx((3, 2, 1))
    corners = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    assert areas.sum() == pytest.approx(18)
    (tmp_path / "quads.ply").write_bytes(ply(order, sides, points, extra))  # all of one size
    assert len(load_source(f"file:{tmp_path}/quads.ply").faces) == 12


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian"])
def test_a_ply_that_ends_early_is_refused(tmp_path: Path, order: str):
    points = np.pad(PRISM, ((0, 0), (0, 1)))
    whole = ply(order, [(0, 1, 2), (0, 1, 2, 3)], points)
    for cut in (3, 20, 40):
        (tmp_path / "cut.ply").write_bytes(whole[:-cut])
        with pytest.raises(FsidError, match="shorter than its header"):
            load_source(f"file:{tmp_path}/cut.ply")
