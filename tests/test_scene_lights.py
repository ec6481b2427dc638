"""Laws of light and finish: adaptation, lobes by kind, and files in place of families."""

import dataclasses
import os
from pathlib import Path

import numpy as np
import pytest

from fsid.assets import PART_KINDS, material_families, mesh_sources, survey_skies
from fsid.errors import FsidError
from fsid.scene import BackgroundConfig, LightConfig, MaterialConfig, SceneConfig, sample
from fsid.scene.colour import LUMINANCE
from fsid.scene.lights import _daylight_rand, _temperature_rand
from fsid.scene.lobes import EMISSION, LOBES, lobes_rand
from fsid.scene.materials import PLAIN
from fsid.scene.pools import POOLS
from fsid.scene.sources import mesh_rand, sky_rand

ROOM = BackgroundConfig(kind_shares=(1.0, 0.0, 0.0, 0.0))
OUTSIDE = BackgroundConfig(kind_shares=(0.0, 0.0, 0.0, 1.0))


def scene(seed=0, **groups):
    config = SceneConfig(objects=(1, 1), mesh_families=("toy_blocks",), **groups)
    return sample(config, seed, width=96, height=64)


def mean_colour(s):
    focus = np.array((0.0, 0.0, 0.35))
    total = np.pi * np.array(s.ambient)
    for light in s.lights:
        gap = 1.0 if light.kind == "sun" else float(np.sum((np.array(light.position_m) - focus) ** 2))
        area = np.prod(light.size_m) if light.kind == "area" else 1.0
        total = total + np.array(light.colour) * area / gap
    return total / (total @ (0.2126, 0.7152, 0.0722))


@pytest.mark.parametrize("background", [ROOM, OUTSIDE])
def test_full_adaptation_makes_the_mean_light_white_and_none_leaves_it(background):
    for seed in range(6):
        white = scene(seed, background=background, lights=LightConfig(adaptation=(1.0, 1.0)))
        np.testing.assert_allclose(mean_colour(white), 1, atol=0.12)
    candle = LightConfig(adaptation=(0.0, 0.0), temperature_k=(2000.0, 2000.0), tinted_share=0.0)
    red, _, blue = mean_colour(scene(0, background=ROOM, lights=candle))
    assert red > 3 * blue


def test_mixed_light_stays_mixed():
    """The camera removes the common colour, not the contrast of warm and cool lamps."""
    lights = LightConfig(count=(4, 4), adaptation=(1.0, 1.0), tinted_share=0.0)
    ratios = []
    for seed in range(6):
        colours = np.array([light.colour for light in scene(seed, background=ROOM, lights=lights).lights])
        ratios.append(np.ptp(np.log(colours[:, 0] / colours[:, 2])))
    assert np.median(ratios) > 0.5


def test_the_sun_is_above_and_the_sky_is_there():
    seen = [scene(seed, background=OUTSIDE, lights=LightConfig(night_share=0.2)) for seed in range(24)]
    kinds = [tuple(light.kind for light in s.lights) for s in seen]
    assert ("sun",) in kinds
    assert () in kinds
    assert any("point" in kind or "spot" in kind for kind in kinds)
    for s in seen:
        assert min(s.sky.colour) > 0
        assert s.ambient == s.sky.colour
        for light in s.lights:
            assert light.kind != "sun" or light.direction[2] < 0


def test_every_lobe_belongs_to_a_kind_of_part():
    assert set(LOBES) | set(EMISSION) <= set(PART_KINDS)
    fields = {field.name for field in dataclasses.fields(PLAIN)}
    assert {name for lobes in LOBES.values() for name in lobes} <= fields


@pytest.mark.parametrize("kind", LOBES)
def test_a_part_has_the_lobes_of_its_kind(kind):
    rng = np.random.default_rng(0)
    always = MaterialConfig(lobe_share=1.0, coat_share=1.0, emission_share=0.0)
    for _ in range(20):
        material = lobes_rand(rng, always, PLAIN, f"{kind}_of_the_test")
        for name, (low, high) in LOBES[kind].items():
            assert low <= getattr(material, name) <= high
        others = {"clearcoat", "sheen", "translucency", "transmission", "emission"} - set(LOBES[kind])
        assert not any(getattr(material, name) for name in others)
    never = MaterialConfig(lobe_share=0.0, coat_share=0.0, emission_share=0.0)
    assert lobes_rand(rng, never, PLAIN, kind) == PLAIN


def test_lamps_and_screens_are_lit_in_the_configured_share():
    rng = np.random.default_rng(0)
    half = MaterialConfig(emission_share=0.5)
    for kind, (low, high) in EMISSION.items():
        found = np.array([lobes_rand(rng, half, PLAIN, kind).emission for _ in range(200)])
        assert 0.35 < (found > 0).mean() < 0.65
        assert ((found == 0) | ((found >= low) & (found <= high))).all()


def _radiance_header(width: int, height: int) -> bytes:
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (height, width)


def _exr(path: Path, width: int, height: int, names: str = "RGB") -> None:
    import OpenEXR

    channels = {name: np.ones((height, width), np.float32) for name in names}
    OpenEXR.File({"type": OpenEXR.scanlineimage}, channels).write(str(path))


def test_skies_come_from_a_folder(tmp_path: Path):
    """And its subfolders; what is no panorama is left out with its reason, and never ends a run."""
    (tmp_path / "dawn.hdr").write_bytes(_radiance_header(64, 32))
    _exr(tmp_path / "noon.EXR", 64, 32)
    (tmp_path / "notes.txt").touch()
    _exr(tmp_path / "render.exr", 64, 36)
    _exr(tmp_path / "depth.exr", 64, 32, names="Z")
    (tmp_path / "page.hdr").write_text("<html>404</html>")
    (tmp_path / "page.exr").write_text("<html>404</html>")
    (tmp_path / "wide.hdr").write_bytes(_radiance_header(64, 33))
    (tmp_path / "huge.hdr").write_bytes(_radiance_header(32770, 16385))
    (tmp_path / "empty.hdr").touch()
    (tmp_path / "city").mkdir()
    (tmp_path / "city" / "night.hdr").write_bytes(_radiance_header(64, 32))
    (tmp_path / "dangling.hdr").symlink_to(tmp_path / "nowhere.hdr")
    Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff.hdr")).write_bytes(_radiance_header(64, 32))
    config = SceneConfig(hdri_folder=str(tmp_path), hdri_share=1.0)
    rng = np.random.default_rng(0)
    found = {sky_rand(rng, config) for _ in range(30)}
    assert found == {f"file:{tmp_path / name}" for name in ("dawn.hdr", "noon.EXR", "city/night.hdr")}
    reasons = dict(survey_skies(str(tmp_path)).skipped)
    assert len(reasons) == 9
    assert "more than 32768 x 16384" in reasons[f"file:{tmp_path / 'huge.hdr'}"]
    assert "64 x 36 pixels" in reasons[f"file:{tmp_path / 'render.exr'}"]
    assert all(f"{name}: {reason}".encode() and "\n" not in reason for name, reason in reasons.items())
    assert sky_rand(rng, SceneConfig()) == "procedural"


@pytest.mark.parametrize("name", ["absent", "empty"])
def test_a_folder_without_skies_names_itself(tmp_path: Path, name):
    (tmp_path / "empty").mkdir()
    config = SceneConfig(hdri_folder=str(tmp_path / name))
    with pytest.raises(FsidError, match=name):
        sky_rand(np.random.default_rng(0), config)


def test_meshes_and_textures_come_from_folders_wherever_these_lie(tmp_path: Path):
    """Objects and materials of the configured share are files, chosen by their names inside the folder."""
    from PIL import Image

    for place in ("here", "there"):
        for name in ("one", "two"):
            folder = tmp_path / place / name
            folder.mkdir(parents=True)
            Image.new("RGB", (64, 64), (120, 90, 60)).save(folder / f"{name}_Color.png")
            (folder / f"{name}.obj").write_text(_TETRAHEDRON)
    drawn = {}
    for place in ("here", "there"):
        folders = (str(tmp_path / place),)
        config = SceneConfig(
            objects=(8, 8),
            mesh_families=("toy_blocks",),
            mesh_folders=folders,
            mesh_folder_share=0.6,
            texture_folders=folders,
            materials=MaterialConfig(layer_share=0.0),
        )
        s = sample(config, 5, width=96, height=64)
        names = [o.family for o in s.objects] + [m.family for ms in s.materials for m in ms]
        drawn[place] = [name.replace(str(tmp_path / place), "") for name in names]
        assert any(name.startswith("file:") for name in names[:8])
        assert "toy_blocks" in names[:8]
        assert any(name.startswith("file:") for name in names[8:])
    assert drawn["here"] == drawn["there"]


def test_a_folder_may_be_named_in_any_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A trailing or leading "./" is no other folder: the same seed draws the same files."""
    folder = tmp_path / "meshes"
    folder.mkdir()
    for name in "abcdefgh":
        (folder / f"{name}.obj").write_text(_TETRAHEDRON)
    monkeypatch.chdir(tmp_path)

    def drawn(place: str) -> list[str]:
        rng = np.random.default_rng(1)
        config = SceneConfig(mesh_folders=(place,), mesh_folder_share=1.0)
        return [Path(mesh_rand(rng, config).removeprefix("file:")).name for _ in range(12)]

    first = drawn(str(folder))
    assert len(set(first)) > 3
    assert all(drawn(place) == first for place in ("meshes", "meshes/", "./meshes", f"{folder}/"))
    monkeypatch.chdir(folder)
    assert drawn(".") == first


def test_a_relative_folder_is_that_of_the_working_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    for place, name in (("one", "a"), ("two", "b")):
        folder = tmp_path / place / "meshes"
        folder.mkdir(parents=True)
        (folder / f"{name}.obj").write_text(_TETRAHEDRON)
        monkeypatch.chdir(tmp_path / place)
        assert mesh_sources("meshes") == (f"file:meshes/{name}.obj",)


def test_files_of_one_name_in_two_folders_are_all_drawn(tmp_path: Path):
    for place in ("one", "two"):
        (tmp_path / place).mkdir()
        (tmp_path / place / "same.obj").write_text(_TETRAHEDRON)
    config = SceneConfig(mesh_folders=(str(tmp_path / "one"), str(tmp_path / "two")), mesh_folder_share=1.0)
    rng = np.random.default_rng(2)
    found = {mesh_rand(rng, config).removeprefix(f"file:{tmp_path}") for _ in range(20)}
    assert found == {"/one/same.obj", "/two/same.obj"}


_TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


def test_every_pool_names_families_that_exist():
    for surface, pool in POOLS.items():
        assert len(pool) >= 5, surface
        assert set(pool) <= set(material_families()), surface


def test_no_area_light_turns_its_back_to_the_camera_in_view():
    lights = LightConfig(kind_shares=(0.0, 0.0, 1.0), count=(2, 2))
    areas = 0
    for seed in range(30):
        s = scene(seed, background=ROOM, lights=lights)
        eye = np.array(s.cameras[0].position_m)
        to_focus = np.array((0.0, 0.0, 0.35)) - eye
        for light in s.lights:
            if light.kind == "area":
                areas += 1
                to_light = np.array(light.position_m) - eye
                behind = to_light @ light.direction > 0
                cosine = to_light @ to_focus / np.linalg.norm(to_light) / np.linalg.norm(to_focus)
                assert not behind or cosine < np.cos(np.radians(45)), seed
    assert areas > 30


def test_every_area_light_hangs_in_its_room_and_shines_at_the_focus():
    """Large ones had no place in small rooms, and lay below the floor, turned away."""
    lights = LightConfig(kind_shares=(0.0, 0.0, 1.0), count=(2, 2), area_m=(1.0, 3.0), distance_m=(2.0, 5.0))
    small = BackgroundConfig(kind_shares=(1, 0, 0, 0), width_m=(2.0, 2.0), height_m=(6.0, 6.0))
    areas = 0
    for seed in range(60):
        s = scene(seed, background=small, lights=lights)
        half = np.array(s.background.size_m[:2]) / 2
        for light in s.lights:
            if light.kind == "area":
                areas += 1
                assert np.all(np.abs(light.position_m[:2]) < half)
                assert 0 < light.position_m[2] < s.background.size_m[2]
                to_focus = np.subtract((0.0, 0.0, 0.35), light.position_m)
                assert to_focus @ light.direction > 0
    assert areas > 30


def test_the_sun_is_redder_the_lower_it_stands():
    suns = [
        _daylight_rand(np.random.default_rng(i), LightConfig(sun_share=1.0), 5.0, "procedural")[0]
        for i in range(40)
    ]
    heights = [-light.direction[2] for (light,) in suns]
    redness = np.array([light.colour[0] / light.colour[2] for (light,) in suns])[np.argsort(heights)]
    assert np.all(np.diff(redness) <= 1e-9)
    assert redness[0] > 2 * redness[-1]


def test_a_picture_of_the_sky_gets_no_second_sun(tmp_path: Path):
    """Its own shines as a light; all of the light that is drawn comes from it and the sky around it."""
    (tmp_path / "noon.hdr").write_bytes(_radiance_header(64, 32))
    lights = LightConfig(sun_share=1.0, night_share=0.0, irradiance=(2.0, 2.0), adaptation=(0.0, 0.0))
    for seed in range(3):
        s = scene(seed, background=OUTSIDE, lights=lights, hdri_folder=str(tmp_path), hdri_share=1.0)
        assert s.lights == ()
        assert np.array(s.sky.colour) @ LUMINANCE == pytest.approx(2.0 / np.pi)


def test_the_sky_at_night_gives_three_tenths_of_what_surroundings_do():
    night = LightConfig(
        night_share=1.0, irradiance=(2.0, 2.0), ambient_share=(1.5, 1.5), adaptation=(0.0, 0.0)
    )
    for seed in range(3):
        s = scene(seed, background=OUTSIDE, lights=night)
        assert {light.kind for light in s.lights} <= {"point", "spot", "area"}
        assert np.array(s.sky.colour) @ LUMINANCE == pytest.approx(0.3 * 1.5 * 2.0 / np.pi)


def test_a_lamp_is_no_larger_than_three_tenths_of_its_distance():
    wide = LightConfig(radius_m=(1.0, 1.0), kind_shares=(0.5, 0.5, 0.0), count=(4, 4), distance_m=(1.0, 1.0))
    lights = scene(0, background=OUTSIDE, lights=dataclasses.replace(wide, night_share=1.0)).lights
    assert [light.radius_m for light in lights] == pytest.approx([0.3] * 4)


def test_temperatures_are_uniform_in_mired():
    rng = np.random.default_rng(0)
    mired = np.array([1e6 / _temperature_rand(rng, (2000.0, 10000.0)) for _ in range(4000)])
    assert np.histogram(mired, 4, (100, 500))[0] == pytest.approx([1000] * 4, abs=120)
