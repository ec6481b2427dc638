"""Laws of the sampler: the variants v1-v4, independent streams, and views worth rendering."""

import dataclasses
import time

import numpy as np
import pytest
import trimesh

from fsid.assets import (
    BACKGROUND_PARTS,
    build_mesh,
    ground_height_m,
    material_families,
    mesh_families,
    part_kind,
    registry,
)
from fsid.assets.solids import box, rotation_matrix
from fsid.errors import FsidError
from fsid.scene import (
    VARIANTS,
    BackgroundConfig,
    CameraConfig,
    LensConfig,
    LightConfig,
    MaterialConfig,
    MotionConfig,
    PlacementConfig,
    RigConfig,
    SceneConfig,
    sample,
)
from fsid.scene.choice import power_law_rand
from fsid.scene.materials import PLAIN
from fsid.scene.pools import GROWN, NATURE
from fsid.scene.relief import Relief, surface_points
from fsid.scene.sources import mesh_rand, texture_rand
from fsid.scene.surroundings import space_of

CONFIG = SceneConfig()
EVERYWHERE = SceneConfig(
    objects=(15, 20),
    background=BackgroundConfig(kind_shares=(0.25, 0.25, 0.25, 0.25)),
    lights=LightConfig(kind_shares=(0.4, 0.3, 0.3)),
)
"""All backgrounds and lights, whatever the defaults are."""
FEW = dataclasses.replace(EVERYWHERE, objects=(1, 1), mesh_families=("toy_blocks",))
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
        assert set(s.background.materials) == set(BACKGROUND_PARTS[s.background.kind])
        assert CONFIG.lights.count[0] <= len(s.lights) <= CONFIG.lights.count[1]
        assert (s.cameras[0].width, s.cameras[0].height) == (96, 64)

    def test_no_object_swallows_a_camera_or_a_light(self, variant):
        for seed in SEEDS:
            s = scene(seed, variant, EVERYWHERE)
            points = np.array([s.cameras[0].position_m, *lamp_places(s)])
            low, high = np.moveaxis(boxes(s)[:, :, None], 1, 0)
            inside = np.all((points > low) & (points < high), axis=-1)
            assert not inside.any(), seed

    def test_camera_and_lamps_are_in_the_free_space(self, variant):
        for seed in SEEDS:
            s = scene(seed, variant, EVERYWHERE)
            space = space_of(s.background)
            for place in (s.cameras[0].position_m, *lamp_places(s)):
                assert (place > space.low - 1e-6).all(), seed
                assert (place < space.high + 1e-6).all(), seed


def lamp_places(s):
    return [light.position_m for light in s.lights if light.kind != "sun"]


FULL = dataclasses.replace(
    EVERYWHERE,
    rig=RigConfig(eyes=2),
    motion=MotionConfig(frames=2, exposure_s=(0.01, 0.03), moving_share=0.5),
    lens=LensConfig(distortion_share=0.5, blur_share=0.5, vignetting_share=0.5, fringe_share=0.5),
    materials=MaterialConfig(lobe_share=0.7, coat_share=0.2, emission_share=0.5),
)
"""Every stream draws something."""


def test_a_variant_leaves_the_other_streams_unchanged():
    """All but S, M, T is the same in all four; S is shared by v1, v3, v4 and M by v3, v4."""
    level = dataclasses.replace(FULL, camera=CameraConfig(skyward_share=0.0))
    for seed in SEEDS:
        v1, v2, v3, v4 = (scene(seed, variant, level) for variant in VARIANTS)
        for other in (v2, v3, v4):
            for name in ("background", "lights", "ambient", "sky", "cameras"):
                assert getattr(other, name) == getattr(v1, name), name
        assert v1.objects == v3.objects == v4.objects
        assert v1.motions == v3.motions == v4.motions
        assert v3.materials == v4.materials
        assert v1.transforms != v4.transforms


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


def test_what_stands_upright_is_turned_about_the_vertical_alone():
    """All draws are made either way, and what floats is turned freely."""
    for floating_share in (0.0, 1.0):
        free, upright = (
            [
                np.array(t.rotation_deg)
                for seed in SEEDS
                for t in scene(seed, config=standing(share, floating_share)).transforms
            ]
            for share in (0.0, 1.0)
        )
        kept = (0.0, 0.0, 1.0) if floating_share == 0 else (1.0, 1.0, 1.0)
        np.testing.assert_array_equal(upright, np.array(free) * kept)
        assert np.any(np.array(free)[:, :2])


def standing(upright_share, floating_share):
    placement = PlacementConfig(upright_share=upright_share, floating_share=floating_share)
    return dataclasses.replace(CONFIG, placement=placement)


def test_v4_floats_as_often_as_configured():
    """What rests is on the ground or on something low; what floats is mostly in the air."""
    spread = [boxes(scene(seed, config=floating(share)))[:, 0, 2] for share in (0.0, 1.0) for seed in SEEDS]
    rest, fly = np.concatenate(spread[: len(SEEDS)]), np.concatenate(spread[len(SEEDS) :])
    assert (rest < 0.62).all()
    assert np.median(rest) < 0.05 < np.median(fly)
    assert min(rest.min(), fly.min()) > -0.08


def floating(share):
    """Without tables: what misses one lies on the floor below."""
    background = BackgroundConfig(kind_shares=(0.6, 0.1, 0.0, 0.3))
    placement = PlacementConfig(floating_share=share, far_share=0.0, size_m=(0.06, 0.4), spread_m=1.5)
    return dataclasses.replace(
        CONFIG, mesh_families=("toy_blocks", "mug"), placement=placement, background=background
    )


def test_things_lie_in_a_bowl_and_not_on_its_rim(monkeypatch):
    """A height map, not a bounding box, decides where a thing comes to rest."""
    monkeypatch.setattr(registry, "_MESHES", dict(registry._MESHES))

    @registry.mesh_family("tray_of_the_test")
    def tray(rng):
        floor = [box(1.0, 1.0, 0.02)]
        rim = [box(1.0, 0.02, 0.4).at(y=y) for y in (-0.49, 0.49)]
        return {"tray": floor + rim + [box(0.02, 1.0, 0.4).at(x=x) for x in (-0.49, 0.49)]}

    @registry.mesh_family("die_of_the_test")
    def die(rng):
        return {"die": [box(0.2, 0.2, 0.2)]}

    relief = Relief(space_of(scene(0).background))
    relief.add(surface_points("tray_of_the_test", 0))
    points = surface_points("die_of_the_test", 0)
    assert relief.rest_m(points, np.zeros(2), 1.0) == pytest.approx(0.02, abs=0.003)
    assert relief.rest_m(points, np.array((0.49, 0.0)), 1.0) == pytest.approx(0.4, abs=0.003)
    assert relief.rest_m(points, np.array((1.0, 0.0)), 1.0) == pytest.approx(0.0, abs=0.003)


def test_sizes_follow_the_power_law():
    """Density ~ r^-p between the limits: the cumulative distribution is that of the integral."""
    rng = np.random.default_rng(0)
    for p in (1.0, 2.0, 3.0):
        sizes = np.array([power_law_rand(rng, (0.1, 1.6), p) for _ in range(4000)])
        middle = np.sqrt(0.1 * 1.6)
        share = 0.5 if p == 1 else (0.1 ** (1 - p) - middle ** (1 - p)) / (0.1 ** (1 - p) - 1.6 ** (1 - p))
        assert (sizes < middle).mean() == pytest.approx(share, abs=0.03)
        assert sizes.min() >= 0.1
        assert sizes.max() <= 1.6


def test_copies_look_alike_and_lie_near_the_first_of_their_kind():
    """As many as configured, in heaps of several sizes; without them every object is another one."""
    crowd = dataclasses.replace(CONFIG, objects=(60, 60), placement=PlacementConfig(far_share=0.0))
    assert len(set(scene(0, config=dataclasses.replace(crowd, repeat_share=0.0)).objects)) == 60
    kinds, heaps, ratios = 0, set(), []
    for seed in SEEDS:
        s = scene(seed, config=dataclasses.replace(crowd, repeat_share=0.5))
        groups = {o: [i for i, other in enumerate(s.objects) if other == o] for o in s.objects}
        kinds += len(groups)
        heaps |= {len(group) for group in groups.values()}
        assert all(s.materials[i] == s.materials[group[0]] for group in groups.values() for i in group)
        places = np.array([t.position_m for t in s.transforms])
        near = [np.linalg.norm(places[g[1:]] - places[g[0]], axis=1).mean() for g in groups.values() if g[1:]]
        ratios.append(np.mean(near) / np.linalg.norm(places - places.mean(0), axis=1).mean())
    assert kinds / len(SEEDS) == pytest.approx(30.5, abs=5)
    assert len(heaps) > 4
    assert np.mean(ratios) < 0.8


def test_copies_of_what_is_large_and_far_stand_beside_each_other():
    """In crowds of them too, hardly one has its middle within a quarter of its size from the next one's."""
    outdoors = BackgroundConfig(kind_shares=(0, 0, 0, 1))
    far = PlacementConfig(far_share=0.6, size_m=(0.4, 0.8))
    config = dataclasses.replace(
        CONFIG,
        objects=(80, 80),
        repeat_share=0.8,
        mesh_families=("dice",),
        background=outdoors,
        placement=far,
    )
    gaps = []
    for seed in SEEDS:
        s = scene(seed, config=config)
        extents = boxes(s)
        middles, sizes = extents.mean(1), np.ptp(extents, axis=1).max(1)
        for k, kind in enumerate(s.objects):
            twins = [i for i in range(k) if s.objects[i] == kind]
            if twins and sizes[k] > 2.5:
                gap = np.linalg.norm(middles[twins] - middles[k], axis=1) / (sizes[twins] + sizes[k]) * 2
                gaps.append(gap.min())
    assert len(gaps) > 80
    assert np.mean(np.array(gaps) < 0.25) < 0.3


def test_a_large_copy_is_no_longer_in_x_than_a_small_one():
    """A copy's size and its stretch are drawn apart."""
    config = dataclasses.replace(CONFIG, mesh_families=("dice",), nature_share=0.0, repeat_share=0.9)
    sizes, stretches = [], []
    for seed in SEEDS:
        s = scene(seed, config=config)
        first = {
            o: np.array(t.scale) for o, t in zip(reversed(s.objects), reversed(s.transforms), strict=True)
        }
        for o, t in zip(s.objects, s.transforms, strict=True):
            logs = np.log(np.array(t.scale))
            sizes.append(logs.max() - np.log(first[o].max()))
            stretches.append(logs[0] - logs.mean())
    assert len(sizes) > 300
    assert abs(np.corrcoef(sizes, stretches)[0, 1]) < 0.2


def test_a_new_family_changes_only_the_draws_that_it_wins(monkeypatch):
    """Seeds keep their scenes from release to release, but for what is new in them."""
    before = [scene(seed) for seed in SEEDS]
    monkeypatch.setattr(registry, "_MESHES", {**registry._MESHES, "mug_of_the_test": registry._MESHES["mug"]})
    after = [scene(seed) for seed in SEEDS]
    total = changed = 0
    for old, new in zip(before, after, strict=True):
        for a, b, M, N in zip(old.objects, new.objects, old.materials, new.materials, strict=True):
            assert b == a or b == dataclasses.replace(a, family="mug_of_the_test")
            assert b != a or M == N
            total, changed = total + 1, changed + (a != b)
    assert 0 < changed < 5 * total / len(mesh_families())


def test_a_scene_of_casts_is_the_same_scene_in_one_paint():
    """Everything but the objects' materials is what it was, and the colours differ from scene to scene."""
    colours = []
    for seed in range(5):
        own, cast = (
            scene(seed, config=dataclasses.replace(CONFIG, materials=MaterialConfig(cast_share=share)))
            for share in (0.0, 1.0)
        )
        assert dataclasses.replace(cast, materials=own.materials) == own
        (paint,) = {material for materials in cast.materials for material in materials}
        (colour,) = set(paint.colours)
        assert len({material for materials in own.materials for material in materials}) > 5
        colours.append(colour)
    assert len(set(colours)) == 5
    assert np.ptp(colours, axis=1).max() > 0.05
    assert 0 < sum(len({m for ms in scene(seed).materials for m in ms}) == 1 for seed in range(40)) < 25


def test_a_knob_of_one_property_leaves_the_others_unchanged():
    base = scene(4)
    knobs = MaterialConfig(plain_share=0.5, relief_scale=(0.0, 0.1))
    repainted = scene(4, config=dataclasses.replace(CONFIG, materials=knobs))
    assert repainted.materials != base.materials
    for name in ("objects", "transforms", "lights", "cameras"):
        assert getattr(repainted, name) == getattr(base, name), name
    assert repainted.background.size_m == base.background.size_m
    zoomed = scene(4, config=dataclasses.replace(CONFIG, camera=CameraConfig(fov_deg=(20.0, 21.0))))
    for name in ("objects", "materials", "lights", "background"):
        assert getattr(zoomed, name) == getattr(base, name), name


def test_k_backgrounds_are_k():
    few = dataclasses.replace(FEW, backgrounds=3)
    seen = [scene(seed, config=few).background for seed in range(16)]
    assert len({str(b) for b in seen}) == 3
    assert len({str(scene(seed, config=FEW).background) for seed in range(16)}) == 16


def test_all_kinds_of_background_and_light_appear_as_configured():
    seen = [scene(seed, config=FEW) for seed in range(24)]
    assert {s.background.kind for s in seen} == set(BACKGROUND_PARTS)
    assert {light.kind for s in seen for light in s.lights} == {"point", "spot", "area", "sun"}
    for s in seen:
        assert (s.sky is not None) == (s.background.kind == "open-air")


def test_the_focus_is_lit_within_the_configured_decade():
    """Irradiance of all lights at the focus (without the sky's) in `irradiance`; ambient its share of it."""
    knobs = CONFIG.lights
    y = 0.2126, 0.7152, 0.0722
    for seed in SEEDS:
        s = scene(seed, config=dataclasses.replace(FEW, background=BackgroundConfig(kind_shares=ROOM)))
        totals = []
        for z in np.linspace(0.2, 0.5, 31):
            gap = [np.sum(np.square(np.array(light.position_m) - (0, 0, z))) for light in s.lights]
            area = [np.prod(light.size_m) if light.kind == "area" else 1.0 for light in s.lights]
            parts = zip(s.lights, gap, area, strict=True)
            totals.append(sum(np.dot(light.colour, y) * a / g for light, g, a in parts))
        assert min(totals) <= knobs.irradiance[1] * 1.01
        assert max(totals) >= knobs.irradiance[0] * 0.99
        share = np.pi * np.dot(s.ambient, y) / np.median(totals)
        assert knobs.ambient_share[0] * 0.5 < share < knobs.ambient_share[1] * 2


ROOM = (1.0, 0.0, 0.0, 0.0)


def test_sampling_takes_little_time():
    """Under 50 ms of processor time on an idle machine; the bound leaves room for a busy one."""
    config = dataclasses.replace(CONFIG, objects=(35, 35))
    scene(0, config=config)
    times = []
    for _ in range(3):
        start = time.process_time()
        scene(0, config=config)
        times.append(time.process_time() - start)
    assert min(times) < 0.15


def test_views_that_look_up_leave_the_fixed_arrangement_in_the_picture():
    """v1-v3 have nothing above it: a fifth of their scenes showed no object."""
    config = dataclasses.replace(
        CONFIG, background=BackgroundConfig(kind_shares=(0, 0, 0, 1)), camera=CameraConfig(skyward_share=1.0)
    )
    heights = []
    for seed in range(40):
        low, full = (scene(seed, variant, config).cameras[0] for variant in ("materials", "full"))
        assert low.position_m == full.position_m
        assert low.target_m[2] <= full.target_m[2]
        forward = np.subtract(low.target_m, low.position_m)
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, low.up)
        to_middle = np.array((0.0, 0.0, 0.35)) - low.position_m
        up = np.cross(right / np.linalg.norm(right), forward)
        half = np.tan(np.radians(low.fov_deg / 2)) * low.height / low.width
        heights.append(to_middle @ up / (to_middle @ forward) / half)
    assert min(heights) > -1.3  # the focus is 0.15 m lower or higher, the arrangement 2.4 m wide
    assert np.median(heights) == pytest.approx(-0.8, abs=0.1)


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
    assert np.mean(shares) > 0.5
    assert min(shares) > 0.1


def test_every_family_is_used():
    rng = np.random.default_rng(0)
    assert {mesh_rand(rng, CONFIG) for _ in range(20 * len(mesh_families()))} == set(mesh_families())
    drawn = {texture_rand(rng, CONFIG) for _ in range(20 * len(material_families()))}
    assert drawn == set(material_families())


def test_out_of_doors_things_have_grown_and_elsewhere_nothing_changes():
    outdoors = dataclasses.replace(CONFIG, background=BackgroundConfig(kind_shares=(0, 0, 0, 1)))
    indoors = dataclasses.replace(CONFIG, background=BackgroundConfig(kind_shares=(1, 0, 0, 0)))
    drawn = [o for seed in SEEDS for o in scene(seed, config=outdoors).objects]
    assert 0.5 < np.mean([o.family in NATURE for o in drawn]) < 0.85
    for seed in SEEDS:
        bare = dataclasses.replace(outdoors, nature_share=0.0)
        inside, without, wild = (scene(seed, config=c) for c in (indoors, bare, outdoors))
        assert [o.seed for o in wild.objects] == [o.seed for o in without.objects]
        assert inside.objects == without.objects
        assert scene(seed, "materials", outdoors).objects == scene(0, "materials", indoors).objects
        for o, materials in zip(wild.objects, wild.materials, strict=True):
            for name, material in zip(build_mesh(o.family, o.seed).part_names, materials, strict=True):
                if o.family in NATURE and part_kind(name) in GROWN:
                    assert material.family.split("+")[0] in GROWN[part_kind(name)]


def test_what_is_far_lies_behind_the_rest_as_the_camera_sees_it():
    far = PlacementConfig(far_share=1.0, floating_share=0.0)
    outdoors = BackgroundConfig(kind_shares=(0, 0, 0, 1))
    config = dataclasses.replace(CONFIG, repeat_share=0.0, placement=far, background=outdoors)
    distances = []
    for seed in SEEDS:
        s = scene(seed, config=config)
        eye, target = np.array(s.cameras[0].position_m), np.array(s.cameras[0].target_m)
        ahead, offsets = target - eye, (boxes(s).mean(1) - eye)[:, :2]
        cosine = (offsets @ ahead[:2]) / np.linalg.norm(offsets, axis=1) / np.linalg.norm(ahead[:2])
        assert np.mean(cosine > np.cos(1.0)) > 0.9
        distances += list(np.linalg.norm(offsets, axis=1))
    assert np.quantile(distances, 0.9) > 8


def test_what_lies_in_the_hills_lies_on_them():
    """As deep in the ground as on the plain, where hills are nearer and higher than by default."""
    background = BackgroundConfig(kind_shares=(0, 0, 0, 1), ground_m=(60.0, 60.0), hills_m=(20.0, 20.0))
    placement = PlacementConfig(far_share=1.0, floating_share=0.0, far_factor=30.0, upright_share=1.0)
    config = dataclasses.replace(CONFIG, objects=(30, 30), background=background, placement=placement)
    raised = 0
    for seed in SEEDS:
        s = scene(seed, config=config)
        for o, t in zip(s.objects, s.transforms, strict=True):
            points = surface_points(o.family, o.seed) * np.array(t.scale)[:, None]
            points = rotation_matrix(*t.rotation_deg) @ points + np.array(t.position_m)[:, None]
            height = points[2] - points[2].min()
            foot = points[:, height <= 0.1 * height.max()]
            ground_m = ground_height_m(s.background.size_m, foot[0], foot[1])
            raised += ground_m.min() > 0.5
            diagonal_m = np.linalg.norm(np.ptp(points, axis=1))
            if ground_m.min() > 0:
                assert -0.03 * diagonal_m < points[2].min() - ground_m.min() < 0.001
    assert raised > 20


def test_nothing_lies_beyond_the_end_of_the_ground():
    background = BackgroundConfig(kind_shares=(0, 0, 0, 1), ground_m=(20.0, 20.0))
    placement = PlacementConfig(far_share=1.0, far_factor=30.0)
    config = dataclasses.replace(CONFIG, objects=(20, 20), background=background, placement=placement)
    for seed in SEEDS:
        assert np.abs(boxes(scene(seed, config=config)).mean(1)[:, :2]).max() < 8.5


def test_views_towards_the_sky_have_the_horizon_where_it_is_asked_for():
    """Half heights below the middle; from low down; and indoors nothing changes."""
    ground = BackgroundConfig(kind_shares=(0.0, 0.0, 0.0, 1.0))
    wanted = CameraConfig(skyward_share=1.0, skyward=(1.5, 1.5), roll_deg=0.0)
    for seed in SEEDS:
        camera = scene(seed, config=dataclasses.replace(FEW, background=ground, camera=wanted)).cameras[0]
        ahead = np.subtract(camera.target_m, camera.position_m)
        half = np.tan(np.radians(camera.fov_deg / 2)) * camera.height / camera.width
        assert ahead[2] / np.hypot(*ahead[:2]) == pytest.approx(1.5 * half)
        assert camera.position_m[2] < 0.5 + 3.0 * np.sin(np.radians(0.2 * 55))
    room = dataclasses.replace(FEW, background=BackgroundConfig(kind_shares=(1.0, 0.0, 0.0, 0.0)))
    always, never = (
        dataclasses.replace(room, camera=CameraConfig(skyward_share=share)) for share in (1.0, 0.0)
    )
    assert scene(3, config=always) == scene(3, config=never)


def test_without_sun_the_sky_is_overcast():
    outdoors = dataclasses.replace(
        FEW,
        background=BackgroundConfig(kind_shares=(0.0, 0.0, 0.0, 1.0)),
        lights=LightConfig(night_share=0.0),
    )
    cloudiness = {True: [], False: []}
    for seed in range(24):
        s = scene(seed, config=outdoors)
        cloudiness[bool(s.lights)].append(s.sky.cloudiness)
    assert min(cloudiness[False]) >= 0.6 > np.median(cloudiness[True])


def test_surface_colours_keep_their_limits_and_stay_moderate():
    """Albedo within its limits; HSV-like saturation of real photographs: mean around a third."""
    drawn = dataclasses.replace(
        CONFIG,
        background=BackgroundConfig(kind_shares=(1, 0, 0, 0)),
        materials=MaterialConfig(natural_share=0.0, lobe_share=0.0),
    )
    scenes = [scene(seed, config=drawn) for seed in SEEDS]
    colours = np.array([c for s in scenes for ms in s.materials for m in ms for c in m.colours])
    assert colours.min() >= CONFIG.materials.albedo[0]
    assert colours.max() <= CONFIG.materials.albedo[1]
    encoded = colours ** (1 / 2.2)
    saturation = 1 - encoded.min(1) / encoded.max(1)
    assert 0.1 < saturation.mean() < 0.4


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
    ("group", "key", "value"),
    [
        (SceneConfig, "objects", (5, 3)),
        (SceneConfig, "objects", (1, 10**6)),
        (SceneConfig, "mesh_families", ("sofa",)),
        (SceneConfig, "material_families", ("velvet",)),
        (PlacementConfig, "size_m", (0.0, 1.0)),
        (PlacementConfig, "floating_share", 1.5),
        (PlacementConfig, "floating_share", float("nan")),
        (MaterialConfig, "palette_shares", (1.0, 1.0, 0.0, 0.0)),
        (MaterialConfig, "palette_shares", (1.0, 0.0, 0.0)),
        (MaterialConfig, "tile_scale", (1.0, float("inf"))),
        (BackgroundConfig, "width_m", (0.5, 3.0)),
        (CameraConfig, "fov_deg", (10.0, 180.0)),
        (CameraConfig, "elevation_deg", (-10.0, 30.0)),
        (LightConfig, "irradiance", (0.0, 1.0)),
        (LightConfig, "count", (0, 3)),
        (LensConfig, "distortion", (-2.0, 0.0)),
        (MotionConfig, "frames", 0),
        (RigConfig, "eyes", 0),
    ],
)
def test_a_bad_setting_names_its_key(group, key, value):
    with pytest.raises(FsidError, match=key):
        group(**{key: value})


def test_shares_that_are_accepted_can_be_drawn_from():
    """Thirds of seven digits sum to 1 - 1e-7."""
    thirds = (0.3333333, 0.3333333, 0.3333333)
    config = SceneConfig(
        objects=(1, 1),
        mesh_families=("toy_blocks",),
        materials=MaterialConfig(palette_shares=(*thirds, 0.0), cast_share=0.0),
        background=BackgroundConfig(kind_shares=(*thirds, 0.0)),
        lights=LightConfig(kind_shares=thirds),
    )
    assert {scene(seed, config=config).background.kind for seed in range(20)} == {
        "room",
        "backdrop",
        "tabletop",
    }


def test_a_list_does_where_two_values_or_names_are_asked_for():
    given = SceneConfig(objects=[2, 3], mesh_families=["mug", "vase"], lights=LightConfig(count=[1, 1]))
    meant = SceneConfig(objects=(2, 3), mesh_families=("mug", "vase"), lights=LightConfig(count=(1, 1)))
    assert given == meant
    assert scene(config=given) == scene(config=meant)


@pytest.mark.parametrize("given", [{"objects": 5}, {"mesh_families": "mug"}, {"mesh_folders": "meshes"}])
def test_one_value_is_no_list(given):
    """A text is a list of letters for Python, and one number would fail where it is drawn from."""
    with pytest.raises(FsidError, match=f"{next(iter(given))}: .* is not a list"):
        SceneConfig(**given)


def test_a_narrow_choice_of_families_is_obeyed():
    config = SceneConfig(
        mesh_families=("vase", "stool"),
        material_families=("brick",),
        materials=MaterialConfig(plain_share=0.0, layer_share=0.0),
    )
    s = scene(2, config=config)
    assert {o.family for o in s.objects} == {"vase", "stool"}
    assert {m.family for ms in s.materials for m in ms} == {"brick"}


def test_meshes_of_unknown_licence_can_be_left_out(tmp_path):
    """A folder without a licence file holds nothing that is stated to be in the public domain."""
    trimesh.creation.box().export(tmp_path / "box.ply")
    config = SceneConfig(mesh_folders=(str(tmp_path),), mesh_folder_share=1.0)
    assert all(o.family.startswith("file:") for o in sample(config, 1, width=64, height=64).objects)
    with pytest.raises(FsidError):
        sample(dataclasses.replace(config, mesh_folders_cc0_only=True), 1, width=64, height=64)
