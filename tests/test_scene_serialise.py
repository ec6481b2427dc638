"""scene_from_json(scene_to_json(s)) == s exactly, and nothing else is accepted."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fsid.errors import FsidError
from fsid.render.drawable import view_of
from fsid.render.gltf import glb_bytes
from fsid.scene import VARIANTS, Scene, SceneConfig, sample, scene_from_json, scene_to_json
from fsid.scene.model import Sky

FEW = SceneConfig(objects=(2, 4))


@settings(max_examples=25)
@given(st.integers(0, 2**63), st.sampled_from(VARIANTS))
def test_round_trip_is_exact(seed, variant):
    scene = sample(FEW, seed, width=64, height=48, variant=variant)
    text = scene_to_json(scene)
    assert scene_from_json(text) == scene
    assert scene_to_json(scene_from_json(text)) == text


@pytest.fixture
def data():
    return json.loads(scene_to_json(sample(FEW, 7, width=64, height=48)))


@pytest.mark.parametrize(
    "text", ["{", "[" * 100_000, '{"seed": ' + "9" * 5000 + "}"], ids=["cut", "deep", "long"]
)
def test_what_no_parser_takes_is_one_line(text):
    with pytest.raises(FsidError, match=r"^scene JSON: is not valid JSON"):
        scene_from_json(text)


def test_an_unknown_key_is_named(data):
    data["lights"][0]["colou"] = 1
    with pytest.raises(FsidError, match=r"unknown key scene\.lights\[0\]\.colou"):
        scene_from_json(json.dumps(data))


def test_a_missing_key_is_named(data):
    del data["cameras"][0]["fov_deg"]
    with pytest.raises(FsidError, match=r"missing key scene\.cameras\[0\]\.fov_deg"):
        scene_from_json(json.dumps(data))


@pytest.mark.parametrize(
    "value", ["12", None, [1.0, 2.0], [1.0, 2.0, "x"], [1.0, 2.0, float("nan")], [0, 0, 10**400], True]
)
def test_a_value_of_the_wrong_kind_is_named(data, value):
    data["transforms"][0]["position_m"] = value
    with pytest.raises(FsidError, match=r"scene\.transforms\[0\]\.position_m"):
        scene_from_json(json.dumps(data))


@pytest.mark.parametrize("value", [1.5, "1", True, -1])
def test_a_whole_number_stays_one(data, value):
    data["seed"] = value
    with pytest.raises(FsidError, match=r"scene\.seed"):
        scene_from_json(json.dumps(data))


def test_a_scene_has_a_camera(data):
    data["cameras"] = []
    with pytest.raises(FsidError, match=r"scene\.cameras"):
        scene_from_json(json.dumps(data))


@pytest.mark.parametrize("text", ["", "{", "[]", "3", "[" * 200_000])
def test_other_text_is_refused_in_one_line(text):
    with pytest.raises(FsidError, match="scene") as caught:
        scene_from_json(text)
    assert "\n" not in str(caught.value)


def test_lists_that_do_not_belong_together_are_refused(data):
    del data["transforms"][-1]
    with pytest.raises(FsidError, match=r"scene\.transforms must be as long as"):
        scene_from_json(json.dumps(data))


def test_a_background_has_all_its_surfaces(data):
    data["background"]["kind"] = "tabletop"
    with pytest.raises(FsidError, match=r"background\.materials must be one material for each of .*table"):
        scene_from_json(json.dumps(data))


def test_a_scene_of_numpy_numbers_is_the_same():
    sizes = [{"width": 64, "height": 48}, {"width": np.int64(64), "height": np.uint16(48)}]
    plain, numpy = (
        scene_to_json(sample(SceneConfig(), kind(7), **s))
        for kind, s in zip((int, np.int64), sizes, strict=True)
    )
    assert numpy == plain


@pytest.mark.parametrize(
    ("place", "value", "words"),
    [
        (("cameras", 0, "height"), 0, r"scene\.cameras\[0\]: \d+x0 pixels"),
        (("cameras", 0, "fov_deg"), 180.0, r"scene\.cameras\[0\]\.fov_deg"),
        (("transforms", 0, "scale"), [1.0, 0.0, 1.0], r"scene\.transforms\[0\]\.scale"),
        (("materials", 0, 0, "tile_m"), 0.0, r"scene\.materials\[0\]\[0\]\.tile_m"),
        (("lights", 0, "kind"), "laser", r"scene\.lights\[0\]\.kind 'laser'"),
    ],
)
def test_a_value_that_nothing_can_be_made_of_is_named(data, place, value, words):
    *way, last = place
    inner = data
    for key in way:
        inner = inner[key]
    inner[last] = value
    with pytest.raises(FsidError, match=words):
        scene_from_json(json.dumps(data))


def test_no_file_is_made_of_such_a_scene():
    scene = sample(SceneConfig(objects=(1, 1)), 0, width=32, height=32)
    flat = replace(scene, transforms=(replace(scene.transforms[0], scale=(1.0, 0.0, 1.0)),))
    with pytest.raises(FsidError, match=r"transforms\[0\]\.scale"):
        glb_bytes(flat)


def _with(scene: Scene, key: str, value: object) -> Scene:
    """The scene with one value of its first light, transform or material, or of its own, set by hand."""
    group, _, name = key.partition(".")
    if not name:
        return replace(scene, **{group: value})
    if group == "materials":
        (first, *parts), *others = scene.materials
        return replace(scene, materials=((replace(first, **{name: value}), *parts), *others))
    first, *others = getattr(scene, group)
    return replace(scene, **{group: (replace(first, **{name: value}), *others)})


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("lights.position_m", (np.nan, 0.0, 2.0)),
        ("lights.position_m", (0.0, 2.0)),
        ("lights.colour", (np.inf, 1.0, 1.0)),
        ("lights.colour", 5.0),
        ("transforms.position_m", (0.0, np.nan, 0.0)),
        ("transforms.scale", 1.0),
        ("materials.emission", np.inf),
        ("materials.colours", ((0.5, 0.5, 0.5),) * 2),
        ("materials.colours", ((0.5, np.nan, 0.5),) * 3),
        ("cameras.target_m", (np.inf, 0.0, 0.0)),
        ("cameras.width", 64.0),
        ("cameras.time_s", np.nan),
        ("cameras.exposure_s", np.inf),
        ("cameras.aperture_m", np.inf),
        ("cameras.colour_contrast", (0.1,)),
        ("objects.seed", -1),
        ("ambient", (np.nan,) * 3),
        ("sky", Sky("procedural", (1.0, 1.0, 1.0), cloudiness=np.nan)),
        ("sky", Sky("procedural", (1.0, 1.0, 1.0), azimuth_deg=np.inf)),
    ],
)
def test_what_a_hand_sets_wrong_is_named(key, value):
    """Infinite and missing numbers would draw a picture, of NaN or without the object."""
    scene = _with(sample(FEW, 7, width=64, height=48), key, value)
    with pytest.raises(FsidError, match=rf"scene\.{key.replace('.', r'.*')}"):
        view_of(scene, 0)
    with pytest.raises(FsidError, match=rf"scene\.{key.replace('.', r'.*')}"):
        scene_to_json(scene)


def test_a_material_of_no_part_of_the_background_is_named():
    scene = sample(FEW, 7, width=64, height=48)
    surfaces = scene.background.materials
    more = replace(scene.background, materials={**surfaces, "wall": next(iter(surfaces.values()))})
    with pytest.raises(FsidError, match="'wall' is no part of"):
        view_of(replace(scene, background=more), 0)


def test_arrays_and_numbers_of_numpy_are_those_of_python():
    scene = sample(FEW, 7, width=64, height=48)
    place = np.asarray(scene.lights[0].position_m, np.float32)
    ours = _with(_with(scene, "lights.position_m", place), "cameras.width", np.int64(64))
    plain = _with(scene, "lights.position_m", tuple(place.tolist()))
    assert scene_from_json(scene_to_json(ours)) == plain
    assert isinstance(view_of(ours, 0).camera.width, int)  # moderngl takes no other


def test_what_is_no_scene_is_named():
    with pytest.raises(FsidError, match="a str is no Scene"):
        view_of("scene.json", 0)
