"""A scene as .glb: read back by another library it is the same scene."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from fsid.assets import MaterialMaps, bake_material, build_mesh
from fsid.cli.main import main
from fsid.dataset import generate_config
from fsid.dataset.attempt import Attempt
from fsid.render.camera import lens_of
from fsid.render.drawable import object_drawables, turn_about
from fsid.render.geometry import merge
from fsid.render.gltf import LUMENS_PER_WATT, glb_bytes
from fsid.render.gltf_textures import base_colour, boxed, normals, roughness_metallic
from fsid.render.layers import Layer
from fsid.render.parts import Surface, parts_of
from fsid.scene import scene_from_json, scene_to_json
from fsid.scene.model import Background, Camera, Light, Material, Object, Scene, Transform

WALLS = ("floor", "ceiling", "wall_north", "wall_south", "wall_east", "wall_west")
BRICK = Material("brick", 1, ((0.6, 0.3, 0.2), (0.5, 0.25, 0.2), (0.7, 0.7, 0.6)), 0.8, 30.0, 1.2, 1.0)
PAINT = Material("paint", 0, ((0.2, 0.4, 0.6),) * 3, 1.0, 0.0, 0.8, 0.0)
Y_UP = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
"""glTF (x, y, z) = ours (x, z, -y)."""


def small_scene(material: Material = BRICK) -> Scene:
    count = len(build_mesh("mug", 1).part_names)
    place = Transform((0.3, -0.2, 0.5), (20.0, -40.0, 70.0), (1.0, 1.5, 0.7))
    lights = (
        Light("point", (0.5, 0.0, 2.0), (0.0, 0.0, -1.0), (4.0, 2.0, 1.0), 0.1, 360.0),
        Light("spot", (0.0, 1.0, 2.0), (0.0, -0.6, -0.8), (3.0, 3.0, 3.0), 0.0, 60.0),
        Light("sun", (0.0, 0.0, 0.0), (0.0, 0.0, -1.0), (2.0, 2.0, 2.0), 0.005, 360.0),
        Light("area", (0.0, 0.0, 2.4), (0.0, 0.0, -1.0), (9.0, 9.0, 9.0), 0.0, 360.0, (0.4, 0.2)),
    )
    camera = Camera((1.0, -1.0, 1.2), (0.3, -0.2, 0.5), (0.1, 0.0, 1.0), 50.0, 320, 180)
    room = Background("room", (4.0, 3.0, 2.5), dict.fromkeys(WALLS, PAINT))
    return Scene(
        7,
        "full",
        (Object("mug", 1),),
        ((material,) * count,),
        (place,),
        room,
        lights,
        (0.1, 0.1, 0.1),
        (camera,),
    )


def document(data: bytes) -> dict:
    length, kind = struct.unpack_from("<II", data, 12)
    assert data[:4] == b"glTF"
    assert struct.unpack_from("<I", data, 8)[0] == len(data)
    assert kind == 0x4E4F534A
    return json.loads(data[20 : 20 + length])


def world_matrix(found: dict, number: int) -> np.ndarray:
    """(4, 4) of a child of the root."""
    root = found["nodes"][found["scenes"][0]["nodes"][0]]
    assert number in root["children"]
    out = np.eye(4)
    for node in (root, found["nodes"][number]):
        x, y, z, w = node["rotation"]
        matrix = trimesh.transformations.quaternion_matrix((w, x, y, z))
        matrix[:3, 3] = node.get("translation", (0, 0, 0))
        out = out @ matrix
    return out


def test_the_geometry_is_read_back_where_it_was():
    scene = small_scene()
    loaded = trimesh.load_scene(io.BytesIO(glb_bytes(scene, texture_size=64)), "glb", process=False)
    ours = [p.surface.vertices @ p.rotation.T + p.position for p in parts_of(scene, 0.0) if p.object_id == 0]
    points = np.concatenate(ours) @ Y_UP.T
    theirs = [
        geometry.vertices @ loaded.graph[node][0][:3, :3].T + loaded.graph[node][0][:3, 3]
        for node in loaded.graph.nodes_geometry
        for geometry in [loaded.geometry[loaded.graph[node][1]]]
        if len(geometry.faces) > 12
    ]
    found = np.concatenate(theirs)
    np.testing.assert_allclose(found.min(0), points.min(0), atol=1e-5)
    np.testing.assert_allclose(found.max(0), points.max(0), atol=1e-5)
    distances = np.abs(np.unique(found.round(5), axis=0)[::50, None] - points[None]).max(-1).min(1)
    assert distances.max() < 2e-5


@pytest.mark.parametrize("scale", [(1.0, 1.5, 0.7), (-1.0, 1.5, 0.7), (-1.0, -1.5, 0.7), (-1.0, -1.5, -0.7)])
def test_faces_go_round_their_normals(scale: tuple[float, float, float]):
    """Those of a mirrored body as well: engines shade what is seen from inside by turned normals, black."""
    scene = small_scene()
    scene = replace(scene, transforms=(replace(scene.transforms[0], scale=scale),))
    surfaces = [part.surface for part in parts_of(scene, 0.0)]
    for surface in surfaces:
        a, b, c = (surface.vertices[surface.faces[:, i]] for i in range(3))
        along = (np.cross(b - a, c - a) * surface.normals[surface.faces].sum(1)).sum(1)
        assert along.sum() > 0.9 * np.abs(along).sum()


def test_the_camera_sees_the_same():
    scene = small_scene()
    found = document(glb_bytes(scene, texture_size=64))
    number = next(i for i, node in enumerate(found["nodes"]) if "camera" in node)
    matrix, lens = world_matrix(found, number), lens_of(scene.cameras[0])
    for axis, ours in zip(
        matrix[:3, :3].T, (lens.rotation[0], lens.rotation[1], -lens.rotation[2]), strict=True
    ):
        np.testing.assert_allclose(axis, Y_UP @ ours, atol=1e-6)
    np.testing.assert_allclose(matrix[:3, 3], Y_UP @ lens.position, atol=1e-6)
    view = found["cameras"][0]["perspective"]
    assert np.tan(view["yfov"] / 2) * view["aspectRatio"] == pytest.approx(np.tan(np.radians(25)))


def test_lights_point_where_they_did():
    found = document(glb_bytes(small_scene(), texture_size=64))
    lights = found["extensions"]["KHR_lights_punctual"]["lights"]
    assert [light["type"] for light in lights] == ["point", "spot", "directional"]
    assert lights[0]["intensity"] == pytest.approx(4.0 * LUMENS_PER_WATT)
    np.testing.assert_allclose(lights[0]["color"], (1.0, 0.5, 0.25))
    assert lights[1]["spot"]["outerConeAngle"] == pytest.approx(np.radians(30))
    spot = next(
        i
        for i, node in enumerate(found["nodes"])
        if node.get("extensions", {}).get("KHR_lights_punctual") == {"light": 1}
    )
    np.testing.assert_allclose(-world_matrix(found, spot)[:3, 2], Y_UP @ (0.0, -0.6, -0.8), atol=1e-6)
    panel = next(m for m in found["materials"] if m["name"] == "light 3")
    assert panel["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] == 9.0


@pytest.mark.parametrize(
    ("change", "extension"),
    [
        ({"clearcoat": 0.5}, "KHR_materials_clearcoat"),
        ({"sheen": 0.5}, "KHR_materials_sheen"),
        ({"transmission": 0.9}, "KHR_materials_transmission"),
        ({"translucency": 0.4}, "KHR_materials_diffuse_transmission"),
        ({"emission": 3.0}, "KHR_materials_emissive_strength"),
    ],
)
def test_every_lobe_is_said(change: dict, extension: str):
    found = document(glb_bytes(small_scene(replace(BRICK, **change)), texture_size=64))
    assert extension in found["extensionsUsed"]
    assert any(extension in material.get("extensions", {}) for material in found["materials"])


def test_glass_is_as_thick_as_ours():
    """Each of three mugs of one glass as `merge` has it for the rasteriser."""
    glass = replace(PAINT, transmission=0.9)
    scene = small_scene(glass)
    scales = ((1.0, 1.5, 0.7), (-0.5, 2.0, 2.0), (3.0, 3.0, 3.0))
    places = tuple(replace(scene.transforms[0], scale=scale) for scale in scales)
    scene = replace(scene, objects=scene.objects * 3, materials=scene.materials * 3, transforms=places)
    found = document(glb_bytes(scene, texture_size=64))
    merged = merge(object_drawables(scene), lambda material: Layer(0, 1.0, np.ones(3), 0.5, 0.0), 0.0)
    for number in range(3):
        ours = merged.surfaces["thickness_m"][merged.surfaces["object_id"] == number + 1]
        mesh = next(m for m in found["meshes"] if m["name"].startswith(f"object {number}:"))
        for primitive in mesh["primitives"]:
            added = found["materials"][primitive["material"]]["extensions"]
            np.testing.assert_allclose(
                added["KHR_materials_volume"]["thicknessFactor"], ours.mean(), rtol=1e-6
            )


def test_sheen_is_as_wide_as_ours():
    """(2 + 1 / alpha) sin^(1 / alpha) / (2 pi), alpha the square of the roughness (Estevez and Kulla 2017),
    is the 2 / pi sin^2 of `shaders/reflector.glsl`."""
    found = document(glb_bytes(small_scene(replace(BRICK, sheen=0.5)), texture_size=64))
    name = "KHR_materials_sheen"
    sheens = [m["extensions"][name] for m in found["materials"] if name in m.get("extensions", {})]
    assert sheens
    sine = np.linspace(0.1, 1.0, 10)
    for sheen in sheens:
        power = 1 / sheen["sheenRoughnessFactor"] ** 2
        np.testing.assert_allclose((2 + power) * sine**power / (2 * np.pi), 2 / np.pi * sine**2, rtol=1e-6)


def test_what_goes_through_has_the_colour_of_the_surface():
    """As in `shaders/reflector.glsl`: without a colour of its own it is white, brighter than any leaf."""
    found = document(glb_bytes(small_scene(replace(BRICK, translucency=0.4)), texture_size=64))
    name = "KHR_materials_diffuse_transmission"
    leaves = [material for material in found["materials"] if name in material.get("extensions", {})]
    assert leaves
    for leaf in leaves:
        through = leaf["extensions"][name]
        assert through["diffuseTransmissionFactor"] == 0.4
        assert through["diffuseTransmissionColorTexture"] == leaf["pbrMetallicRoughness"]["baseColorTexture"]


def test_the_file_holds_the_scene_itself_and_is_the_same_every_time():
    scene = small_scene()
    data = glb_bytes(scene, texture_size=64)
    assert data == glb_bytes(scene, texture_size=64)
    assert scene_from_json(json.dumps(document(data)["asset"]["extras"]["fsid"])) == scene


def test_pictures_are_shared():
    few = document(glb_bytes(small_scene(), texture_size=64))
    assert len(few["images"]) == 5, "brick: colour, normal, finish; paint: colour, finish"


def picture(data: bytes, texture: int) -> np.ndarray:
    """(S, S, 3) uint8 of a texture of the file."""
    found = document(data)
    image = found["images"][found["textures"][texture]["source"]]
    view = found["bufferViews"][image["bufferView"]]
    (length,) = struct.unpack_from("<I", data, 12)
    start = 20 + length + 8 + view["byteOffset"]
    with Image.open(io.BytesIO(data[start : start + view["byteLength"]])) as opened:
        assert image["mimeType"] == Image.MIME[opened.format or ""]
        return np.asarray(opened.convert("RGB"))


def test_relief_and_finish_are_read_back_as_they_were():
    """JPEG keeps neither: no metal would come back as some."""
    data = glb_bytes(small_scene(), texture_size=64)
    maps = bake_material(BRICK.family, BRICK.variant, 64)
    assert maps.metallic.max() == 0
    row = next(m for m in document(data)["materials"] if m["name"].endswith("(brick)"))
    finish = picture(data, row["pbrMetallicRoughness"]["metallicRoughnessTexture"]["index"])
    assert finish[..., 2].max() == 0
    np.testing.assert_array_equal(finish, roughness_metallic(maps, BRICK.roughness_scale))
    np.testing.assert_array_equal(picture(data, row["normalTexture"]["index"]), normals(maps))


def test_texture_coordinates_are_the_box_mapping():
    """A unit square on each plane: u to the right and v down as seen from outside, in tiles."""
    plain = Material("paint", 0, ((0.5,) * 3,) * 3, 0.5, 0.0, 1.0, 1.0)
    for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1), (2, 1), (2, -1)):
        outward = np.zeros(3)
        outward[axis] = sign
        up = np.array((0.0, sign, 0.0)) if axis == 2 else np.array((0.0, 0.0, 1.0))
        right = np.cross(up, outward)
        if axis == 2 and sign < 0:
            right, up = np.array((1.0, 0.0, 0.0)), np.array((0.0, -1.0, 0.0))
        corners = np.array([outward * 0, right, right + up, up])
        surface = Surface(corners, np.tile(outward, (4, 1)), np.array([(0, 1, 2), (0, 2, 3)]))
        made = boxed(surface, plain)
        start = made.uv[np.abs(made.positions).sum(1).argmin()]
        for point, uv in zip(made.positions, made.uv, strict=True):
            np.testing.assert_allclose(uv - start, np.array((point @ right, -point @ up)) / 0.5, atol=1e-9)
        np.testing.assert_allclose(made.tangents[:, :3], np.tile(right, (4, 1)), atol=1e-9)
        green = np.cross(made.normals, made.tangents[:, :3]) * made.tangents[:, 3:]
        np.testing.assert_allclose(green, np.tile(up, (4, 1)), atol=1e-9)


def test_normals_lean_away_from_what_rises():
    size = 64
    ramp = np.tile(0.5 - 0.5 * np.cos(np.arange(size) / size * 2 * np.pi), (size, 1)).astype(np.float32)
    flat = np.full((size, size), 0.5, np.float32)
    maps = MaterialMaps(flat, flat, flat, flat, ramp, flat, relief_m=0.1, tile_m=1.0)
    red = normals(maps)[..., 0].astype(int) - 128
    assert red[:, size // 4].max() < -10, "rising to the right: leans to the left"
    assert red[:, 3 * size // 4].min() > 10
    rotated = MaterialMaps(flat, flat, flat, flat, ramp.T.copy(), flat, relief_m=0.1, tile_m=1.0)
    green = normals(rotated)[..., 1].astype(int) - 128
    assert green[size // 4].min() > 10, "rising downwards: leans up"


def test_colours_are_the_palettes():
    flat = np.zeros((8, 8), np.float32)
    maps = MaterialMaps(flat + 0.5, flat, flat + 0.5, flat, flat, flat, relief_m=0.0, tile_m=1.0)
    material = replace(PAINT, colours=((0.0, 0.2, 0.4), (0.4, 0.2, 0.0), (1.0, 1.0, 1.0)))
    linear = ((base_colour(maps, material)[0, 0] / 255 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(linear, (0.2, 0.2, 0.2), atol=0.004)


def test_turns_are_about_their_axis():
    np.testing.assert_allclose(turn_about((0.0, 0.0, 90.0), 1.0) @ (1, 0, 0), (0, 1, 0), atol=1e-12)
    np.testing.assert_allclose(turn_about((0.0, 0.0, 0.0), 1.0), np.eye(3))


def test_the_command_writes_it_whole(tmp_path: Path, refused: Callable[..., str]):
    """And refuses what it does not know."""
    small = ["--width", "64", "--height", "48", "--texture-size", "64", "--set", "scene.objects=[2,2]"]
    main(["scene", "3", "-o", str(tmp_path / "scene.glb"), *small])
    assert len(trimesh.load_scene(tmp_path / "scene.glb").geometry) > 2
    assert ".json or .glb" in refused("scene", "3", "-o", tmp_path / "scene.fbx")
    assert [file.name for file in tmp_path.iterdir()] == ["scene.glb"]


def test_the_command_writes_the_scene_of_a_sample(tmp_path: Path):
    """Whatever the settings say that the sample was made with: size, variant, and the task's motion."""
    settings = {"width": 96, "height": 64, "variant": "objects", "task": "deblur"}
    (tmp_path / "own.yaml").write_text(json.dumps(settings | {"scene": {"objects": [2, 3]}}))
    scene = Attempt(generate_config(tmp_path / "own.yaml"), 0, 0).drawn_scene()
    main(["scene", str(scene.seed), "-o", str(tmp_path / "a.json"), "--config", str(tmp_path / "own.yaml")])
    assert (tmp_path / "a.json").read_text() == scene_to_json(scene)
    main(
        ["scene", "1", "-o", str(tmp_path / "b.json"), "--set", "width=64", "height=48", "variant=materials"]
    )
    drawn = scene_from_json((tmp_path / "b.json").read_text())
    assert (drawn.variant, drawn.cameras[0].width, drawn.cameras[0].height) == ("materials", 64, 48)
