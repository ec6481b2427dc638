"""Laws of the sampler: the variants v1-v4, independent streams, and views worth rendering."""

import dataclasses

import numpy as np
import pytest

from fsid.assets import build_mesh, material_families, mesh_families
from fsid.assets.solids import rotation_matrix
from fsid.errors import FsidError
from fsid.scene import SURFACES, VARIANTS, SceneConfig, sample
from fsid.scene.materials import PLAIN

CONFIG = SceneConfig()
SEEDS = range(8)


def scene(seed=0, variant="full", config=CONFIG, width=96, height=64):
    return sample(config, seed, width=width, height=height, variant=variant)


def boxes(s):
    """World bounding boxes, (N, 2, 3) metres."""
    out = []
    for o, t in zip(s.objects, s.transforms, strict=True):
        world = (build_mesh(o.family, o.seed).vertices * t.scale) @ rotation_matrix(*t.rotation_deg).T
        out.append((world.min(0) + t.position_m, world.max(0) + t.position_m))
    return np.array(out)


@pytest.mark.parametrize("variant", VARIANTS)
class TestEveryVariant:
    def test_config_and_seed_decide_alone(self, variant):
        assert scene(5, variant) == scene(5, variant)
        assert scene(5, variant) != scene(6, variant)

    def test_everything_fits_together(self, variant):
        s = scene(1, variant)
        assert CONFIG.objects[0] <= len(s.objects) <= CONFIG.objects[1]
        assert len(s.objects) == len(s.materials) == len(s.transforms)
        for o, materials in zip(s.objects, s.materials, strict=True):
            assert len(materials) == len(build_mesh(o.family, o.seed).part_names)
        assert set(s.background.materials) == set(SURFACES)
        assert len(s.lights) == CONFIG.lights == 3
        assert (s.cameras[0].width, s.cameras[0].height) == (96, 64)

    def test_no_object_swallows_the_camera_or_a_light(self, variant):
        for seed in SEEDS:
            s = scene(seed, variant)
            points = np.array([s.cameras[0].position_m, *(light.position_m for light in s.lights)])
            low, high = np.moveaxis(boxes(s)[:, :, None], 1, 0)
            inside = np.all((points > low) & (points < high), axis=-1)
            assert not inside.any(), seed

    def test_camera_and_lights_are_inside_the_room(self, variant):
        for seed in SEEDS:
            s = scene(seed, variant)
            half = np.array(s.background.size_m) / (2, 2, 1)
            for x, y, z in (s.cameras[0].position_m, *(light.position_m for light in s.lights)):
                assert abs(x) < half[0]
                assert abs(y) < half[1]
                assert 0 < z < half[2]


def test_a_variant_leaves_the_other_streams_unchanged():
    """Background, lights and camera are the same in all four; S is shared by v1, v3, v4 and M by v3, v4."""
    for seed in SEEDS:
        v1, v2, v3, v4 = (scene(seed, variant) for variant in VARIANTS)
        for other in (v2, v3, v4):
            assert other.background == v1.background
            assert other.lights == v1.lights
            assert other.ambient == v1.ambient
            assert other.cameras == v1.cameras
        assert v1.objects == v3.objects == v4.objects
        assert v3.materials == v4.materials


def test_v1_varies_objects_only():
    a, b = scene(1, "objects"), scene(2, "objects")
    assert a.objects != b.objects
    assert {m for s in (a, b) for ms in s.materials for m in ms} == {PLAIN}


def test_v2_varies_materials_on_one_fixed_arrangement():
    a, b = scene(1, "materials"), scene(2, "materials")
    assert a.objects == b.objects
    assert a.transforms == b.transforms
    assert a.materials != b.materials


@pytest.mark.parametrize("variant", ["objects", "materials", "objects-materials"])
def test_v1_to_v3_are_upright_on_the_floor_with_one_scale(variant):
    for t in scene(3, variant).transforms:
        assert t.rotation_deg[:2] == (0, 0)
        assert len(set(t.scale)) == 1
        assert t.position_m[2] == 0


def test_v4_rotates_by_the_papers_twenty_angles_per_axis():
    angles = np.array([t.rotation_deg for seed in SEEDS for t in scene(seed).transforms])
    for axis in range(3):
        assert set(angles[:, axis]) == set(np.arange(20) * 18.0)


def test_v4_rests_on_something_or_floats_as_configured():
    """A resting object has its lowest point on the floor or on the top of another; the rest is in the air."""
    floating = total = 0
    for seed in SEEDS:
        extents = boxes(scene(seed))
        levels = np.r_[0.0, extents[:, 1, 2]]
        assert extents[:, 0, 2].min() > -1e-4
        rests = np.abs(extents[:, 0, 2][:, None] - levels).min(1) < 1e-4
        floating += (~rests).sum()
        total += len(rests)
    assert floating / total == pytest.approx(CONFIG.floating_share, abs=0.12)


def test_a_knob_of_one_property_leaves_the_others_unchanged():
    base = scene(4)
    repainted = scene(4, config=dataclasses.replace(CONFIG, plain_share=0.5, relief_scale=(0.0, 0.1)))
    assert repainted.materials != base.materials
    assert repainted.objects == base.objects
    assert repainted.transforms == base.transforms
    assert repainted.lights == base.lights
    assert repainted.cameras == base.cameras
    assert repainted.background.size_m == base.background.size_m
    zoomed = scene(4, config=dataclasses.replace(CONFIG, fov_deg=(20.0, 21.0)))
    assert zoomed.objects == base.objects
    assert zoomed.materials == base.materials
    assert zoomed.lights == base.lights
    assert zoomed.background == base.background


def test_the_focus_is_lit_within_the_configured_decade():
    """E = sum I / r^2 in `irradiance`; the ambient adds its share of it, E = pi L."""
    for seed in SEEDS:
        s = scene(seed)
        camera = s.cameras[0]
        y = 0.2126, 0.7152, 0.0722
        heights = np.linspace(0.2, 0.5, 31)
        totals = []
        for z in heights:
            gap = [np.sum(np.square(np.array(light.position_m) - (0, 0, z))) for light in s.lights]
            totals.append(sum(np.dot(light.colour, y) / g for light, g in zip(s.lights, gap, strict=True)))
        assert min(totals) <= CONFIG.irradiance[1] * 1.01
        assert max(totals) >= CONFIG.irradiance[0] * 0.99
        share = np.pi * np.dot(s.ambient, y) / np.median(totals)
        assert CONFIG.ambient_share[0] * 0.5 < share < CONFIG.ambient_share[1] * 2
        distance = np.linalg.norm(np.array(camera.position_m) - camera.target_m)
        assert 0.3 < distance < 3.2


def test_objects_fill_the_view():
    """Share of camera rays that meet the bounding box of an object: a view of bare walls is useless."""
    shares = []
    for seed in SEEDS:
        s = scene(seed)
        camera = s.cameras[0]
        origin = np.array(camera.position_m)
        forward = np.array(camera.target_m) - origin
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, camera.up)
        right /= np.linalg.norm(right)
        half = np.tan(np.radians(camera.fov_deg / 2))
        x, y = np.meshgrid(np.linspace(-half, half, 24), np.linspace(-half, half, 16) * 2 / 3)
        rays = forward + x[..., None] * right + y[..., None] * np.cross(right, forward)
        with np.errstate(divide="ignore"):
            t = (boxes(s)[:, :, None, None] - origin) / rays
        near, far = np.minimum(*np.moveaxis(t, 1, 0)).max(-1), np.maximum(*np.moveaxis(t, 1, 0)).min(-1)
        shares.append(((near < far) & (far > 0)).any(0).mean())
    assert np.mean(shares) > 0.6
    assert min(shares) > 0.25


def test_every_family_is_used():
    config = dataclasses.replace(CONFIG, objects=(60, 60))
    seen = [scene(seed, config=config) for seed in range(6)]
    assert {o.family for s in seen for o in s.objects} == set(mesh_families())
    assert {m.family for s in seen for ms in s.materials for m in ms} == set(material_families())


def test_surface_colours_keep_their_limits_and_stay_moderate():
    """Albedo within its limits; HSV-like saturation of real photographs: mean around a third."""
    colours = np.array([c for s in map(scene, SEEDS) for ms in s.materials for m in ms for c in m.colours])
    assert colours.min() >= CONFIG.albedo[0]
    assert colours.max() <= CONFIG.albedo[1]
    encoded = colours ** (1 / 2.2)
    saturation = 1 - encoded.min(1) / encoded.max(1)
    assert 0.15 < saturation.mean() < 0.4


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"seed": -1}, "seed -1"),
        ({"width": 95}, "width 95"),
        ({"height": 8}, "height 8"),
        ({"variant": "v5"}, "'v5'"),
    ],
)
def test_bad_arguments_name_themselves(arguments, message):
    with pytest.raises(FsidError, match=message):
        scene(**arguments)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("objects", (5, 3)),
        ("objects", (1, 10**6)),
        ("object_size_m", (0.0, 1.0)),
        ("floating_share", 1.5),
        ("floating_share", float("nan")),
        ("mesh_families", ("sofa",)),
        ("material_families", ("velvet",)),
        ("palette_shares", (1.0, 1.0, 0.0, 0.0)),
        ("room_width_m", (0.5, 3.0)),
        ("fov_deg", (10.0, 180.0)),
        ("camera_elevation_deg", (-10.0, 30.0)),
        ("irradiance", (0.0, 1.0)),
        ("lights", 0),
        ("tile_scale", (1.0, float("inf"))),
    ],
)
def test_a_bad_setting_names_its_key(key, value):
    with pytest.raises(FsidError, match=key):
        SceneConfig(**{key: value})


def test_a_narrow_choice_of_families_is_obeyed():
    config = SceneConfig(mesh_families=("vase", "stool"), material_families=("brick",), plain_share=0.0)
    s = scene(2, config=config)
    assert {o.family for o in s.objects} == {"vase", "stool"}
    assert {m.family for ms in s.materials for m in ms} == {"brick"}
