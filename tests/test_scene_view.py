"""Laws of cameras: rigs, bursts, motion, and lenses that can be inverted."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsid.assets import build_background, ground_height_m
from fsid.errors import FsidError
from fsid.render.camera import lens_of
from fsid.scene import (
    BackgroundConfig,
    Camera,
    CameraConfig,
    Distortion,
    LensConfig,
    MotionConfig,
    RigConfig,
    SceneConfig,
    sample,
)
from fsid.scene.lens import MAX_FISHEYE_DEG, check_distortion, corner_radius, lens_rand

CAMERA = Camera((0.0, -2.0, 1.0), (0.0, 0.0, 0.3), (0.0, 0.0, 1.0), 60.0, 96, 64)


def scene(seed=3, **groups):
    config = SceneConfig(objects=(3, 3), mesh_families=("toy_blocks",), **groups)
    return sample(config, seed, width=96, height=64)


def axis(camera):
    forward = np.subtract(camera.target_m, camera.position_m)
    return forward / np.linalg.norm(forward)


def test_a_stereo_pair_stands_a_baseline_apart_and_looks_the_same_way():
    left, right = scene(rig=RigConfig(eyes=2, baseline_m=(0.06, 0.06))).cameras
    step = np.subtract(right.position_m, left.position_m)
    assert np.linalg.norm(step) == pytest.approx(0.06)
    np.testing.assert_allclose(axis(left), axis(right), atol=1e-9)
    assert step @ axis(left) == pytest.approx(0, abs=1e-9)
    assert step @ left.up == pytest.approx(0, abs=1e-9)
    assert step @ np.cross(axis(left), left.up) == pytest.approx(0.06)  # the first eye is the left one
    assert (left.eye, right.eye) == (0, 1)


def test_converging_eyes_look_at_one_point():
    mono = scene().cameras[0]
    cameras = scene(rig=RigConfig(eyes=5, convergence=1.0)).cameras
    assert [camera.eye for camera in cameras] == list(range(5))
    assert len({camera.target_m for camera in cameras}) == 1
    np.testing.assert_allclose(cameras[2].position_m, mono.position_m)
    np.testing.assert_allclose(cameras[2].target_m, mono.target_m)


@pytest.mark.parametrize("kind", range(4))
def test_no_eye_of_a_wide_rig_stands_behind_a_wall_or_in_a_hill(kind):
    shares = tuple(float(kind == i) for i in range(4))
    background = BackgroundConfig(kind_shares=shares, hills_m=(60, 60), ground_m=(150, 150))
    rig, far = RigConfig(eyes=6, baseline_m=(4.0, 4.0)), CameraConfig(distance_m=(20, 40))
    baselines = []
    for seed in range(20):
        drawn = scene(seed, rig=rig, camera=far, background=background)
        eyes = np.array([camera.position_m for camera in drawn.cameras])
        baselines.append(np.linalg.norm(eyes[1] - eyes[0]))
        size_m = drawn.background.size_m
        if drawn.background.kind == "open-air":
            assert (eyes[:, 2] > ground_height_m(size_m, eyes[:, 0], eyes[:, 1])).all()
        else:
            floor_m = -0.75 if drawn.background.kind == "tabletop" else 0.0
            half = np.array(size_m) / 2
            assert (np.abs(eyes - (0, 0, floor_m + half[2])) < half).all()
    assert 0.02 < min(baselines) < 3.9
    assert kind < 3 or max(baselines) == pytest.approx(4.0)


def test_a_burst_starts_with_the_single_picture_and_trembles_by_the_configured_amount():
    """Standard deviations of position and angle over a long burst are those drawn from the knobs."""
    knobs = MotionConfig(frames=400, interval_s=1 / 30, shake_deg=(0.2, 0.2), shake_m=(0.002, 0.002))
    frames = scene(motion=knobs).cameras
    first, single = frames[0], scene().cameras[0]
    np.testing.assert_allclose(first.position_m, single.position_m, atol=1e-12)
    np.testing.assert_allclose(axis(first), axis(single), atol=1e-12)
    assert [camera.frame for camera in frames] == list(range(400))
    assert [camera.time_s for camera in frames] == pytest.approx(np.arange(400) / 30)
    spread = np.std([camera.position_m for camera in frames], axis=0)
    np.testing.assert_allclose(spread, 0.002, rtol=0.35)
    angles = np.degrees(np.arccos(np.clip([axis(c) @ axis(first) for c in frames], -1, 1)))
    assert 0.05 < angles.mean() < 1.0


def test_velocity_and_spin_are_the_derivatives_of_the_pose():
    """Central differences of a finely sampled burst agree with what each frame states."""
    knobs = MotionConfig(frames=9, interval_s=1e-3, exposure_s=(0.01, 0.01), shake_deg=(0.3, 0.3))
    frames = scene(motion=knobs, rig=RigConfig(eyes=2)).cameras[9:]
    for before, now, after in zip(frames, frames[1:], frames[2:], strict=False):
        moved = np.subtract(after.position_m, before.position_m) / 2e-3
        np.testing.assert_allclose(moved, now.velocity_m_s, atol=1e-3)
        turned = (axis(after) - axis(before)) / 2e-3
        np.testing.assert_allclose(turned, np.cross(np.radians(now.spin_deg_s), axis(now)), atol=1e-3)


def test_a_still_camera_takes_no_time():
    camera = scene().cameras[0]
    assert (camera.exposure_s, camera.velocity_m_s, camera.spin_deg_s) == (0.0, (0, 0, 0), (0, 0, 0))
    assert scene().motions == ()


def test_objects_move_as_configured():
    knobs = MotionConfig(frames=2, moving_share=0.5, speed_m_s=(0.1, 0.2), spin_deg_s=(5.0, 6.0))
    config = SceneConfig(objects=(60, 60), mesh_families=("toy_blocks",), motion=knobs)
    s = sample(config, 1, width=96, height=64)
    speeds = np.linalg.norm([motion.velocity_m_s for motion in s.motions], axis=1)
    spins = np.linalg.norm([motion.spin_deg_s for motion in s.motions], axis=1)
    moving = speeds > 0
    assert len(s.motions) == 60
    assert 0.3 < moving.mean() < 0.7
    assert ((speeds[moving] >= 0.1) & (speeds[moving] <= 0.2)).all()
    assert ((spins[moving] >= 5) & (spins[moving] <= 6)).all()
    assert (spins[~moving] == 0).all()


def test_the_lens_changes_nothing_but_the_lens():
    lens = LensConfig(
        distortion_share=1.0, blur_share=1.0, vignetting_share=1.0, fringe_share=1.0, sharp_share=1.0
    )
    plain, seen = scene().cameras[0], scene(lens=lens).cameras[0]
    assert seen.distortion is not None
    assert seen.aperture_m > 0
    assert -1 < sum(seen.vignetting) < 0
    assert any(seen.chromatic_aberration)
    assert 0.4 <= seen.softness_px <= 0.65
    assert 0.4 <= seen.sharpening <= 1.3
    red, blue = seen.colour_contrast
    assert 0.05 <= red <= 0.17
    assert 0.04 <= blue <= 0.16
    fields = (
        *("distortion", "aperture_m", "focus_m", "vignetting"),
        *("chromatic_aberration", "softness_px", "sharpening", "colour_contrast"),
    )
    assert dataclasses.replace(seen, **{name: getattr(plain, name) for name in fields}) == plain


@given(st.integers(0, 2**32), st.floats(5.0, 150.0), st.booleans())
def test_every_drawn_distortion_can_be_inverted(seed, fov_deg, fisheye):
    """Newton's method finds the undistorted point of the corner and of every radius before it."""
    config = LensConfig(distortion_share=1.0, fisheye_share=float(fisheye), distortion=(-0.5, 0.5))
    camera = dataclasses.replace(CAMERA, fov_deg=fov_deg)
    camera = lens_rand(np.random.default_rng(seed), config, camera)
    if camera.distortion is None:
        assert not fisheye
        return
    corner = corner_radius(camera)
    check_distortion(camera.distortion, corner)
    wanted = np.linspace(0, corner, 50)
    if fisheye:
        k = camera.distortion.coefficients
        at = np.linspace(0, np.radians(MAX_FISHEYE_DEG), 20001)
    else:
        k1, k2, _, _, k3 = camera.distortion.coefficients
        k = (k1, k2, k3)
        at = np.linspace(0, 4 * corner, 20001)
    radius = at * (1 + sum(c * at ** (2 * i + 2) for i, c in enumerate(k)))
    end = int(np.argmax(radius > corner))
    assert end > 0
    assert (np.diff(radius[: end + 1]) > 0).all()
    found = np.interp(wanted, radius[: end + 1], at[: end + 1])
    again = found * (1 + sum(c * found ** (2 * i + 2) for i, c in enumerate(k)))
    np.testing.assert_allclose(again, wanted, atol=2e-4 * max(corner, 1))


@pytest.mark.parametrize(
    ("distortion", "message"),
    [
        (Distortion("brown-conrady", (-2.0, 0.0, 0.0, 0.0, 0.0)), "folds"),
        (Distortion("fisheye", (-0.9, 0.0, 0.0, 0.0)), "folds"),
        (Distortion("fisheye", (0.1,)), "4 coefficients"),
        (Distortion("mirror", (0.1,)), "'mirror'"),
    ],
)
def test_a_distortion_without_inverse_is_refused(distortion, message):
    with pytest.raises(FsidError, match=message):
        check_distortion(distortion, 0.7)


def test_views_are_low_level_and_high():
    """Walls and horizon are seen as well as the ground, and no low camera stands among the objects."""
    elevations = []
    for seed in range(60):
        camera = scene(seed, camera=CameraConfig(distance_m=(0.5, 1.2))).cameras[0]
        x, y, z = camera.position_m
        elevations.append(np.degrees(np.arctan2(z - 0.35, np.hypot(x, y))))
        if elevations[-1] < 10:
            assert np.hypot(x, y) > 1.1
    assert min(elevations) < 12
    assert max(elevations) > 50


def test_no_camera_stands_in_a_hill():
    """Far away out of doors the ground rolls, and its triangles are coarse there."""
    background = BackgroundConfig(kind_shares=(0, 0, 0, 1), hills_m=(60, 60), ground_m=(150, 150))
    for seed in range(30):
        drawn = scene(seed, camera=CameraConfig(distance_m=(30, 50)), background=background)
        position = np.array(drawn.cameras[0].position_m)
        ground = build_background("open-air", drawn.background.size_m).vertices
        near = np.argsort(np.linalg.norm(ground[:, :2] - position[:2], axis=1))[:4]
        assert position[2] > ground[near, 2].mean()


@pytest.mark.parametrize("fisheye_share", [0.0, 1.0])
@pytest.mark.parametrize(
    ("width", "height", "fov_deg"), [(64, 48, 60.0), (320, 192, 149.0), (96, 170, 145.0)]
)
def test_every_lens_that_is_drawn_can_be_rendered(width, height, fov_deg, fisheye_share):
    """Small images reach farther beyond their corner, wide ones look farther aside, than a radius says."""
    camera = dataclasses.replace(CAMERA, width=width, height=height, fov_deg=fov_deg)
    config = LensConfig(distortion_share=1.0, distortion=(-0.5, 0.5), fisheye_share=fisheye_share)
    for seed in range(60):
        lens_of(lens_rand(np.random.default_rng(seed), config, camera))


def test_the_focus_is_a_share_of_the_distance():
    config = LensConfig(blur_share=1.0, focus=(2.0, 2.0))
    camera = lens_rand(np.random.default_rng(0), config, CAMERA)
    assert camera.focus_m == pytest.approx(2 * np.hypot(2.0, 0.7))


def test_a_camera_rolls_about_its_axis_by_the_configured_angle():
    """Up stays a unit vector across the line of sight, aslant of the vertical plane by the roll."""
    rolls = []
    for seed in range(60):
        camera = scene(seed, camera=CameraConfig(roll_deg=20.0)).cameras[0]
        right = np.cross(axis(camera), (0.0, 0.0, 1.0))
        rolls.append(np.degrees(np.arcsin(camera.up @ right / np.linalg.norm(right))))
        assert np.linalg.norm(camera.up) == pytest.approx(1)
        assert camera.up @ axis(camera) == pytest.approx(0, abs=1e-9)
    assert np.sqrt(np.mean(np.square(rolls))) == pytest.approx(20, rel=0.25)
