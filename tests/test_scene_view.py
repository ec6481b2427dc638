"""Laws of cameras: rigs, bursts, motion, and lenses that can be inverted."""

import dataclasses
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import find_peaks
from scipy.spatial.transform import Rotation

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
from fsid.scene.distortion import distorted
from fsid.scene.lens import MAX_FISHEYE_DEG, check_distortion, corner_radius, lens_rand
from fsid.scene.model import Background
from fsid.scene.view import burst_rand, camera_rand

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
    """Position and angle vary about as much as the knobs say."""
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


def axes(camera):
    """(3, 3) right, up, forward."""
    return np.stack([np.cross(axis(camera), camera.up), camera.up, axis(camera)])


def test_the_tremor_of_a_hand_is_six_lines_of_one_to_twelve_hertz_of_the_configured_size():
    """About each axis and along it; as many in an octave as in the next, all of one speed."""
    knobs = MotionConfig(frames=1000, interval_s=0.04, shake_deg=(0.2, 0.2), shake_m=(0.002, 0.002))
    hertz, lines, above_6_hz = np.fft.rfftfreq(1000, 0.04), [], []
    for seed in range(4):
        frames = burst_rand(np.random.default_rng(seed), knobs, [CAMERA])
        shift_m = np.array([camera.position_m for camera in frames])
        turn = Rotation.from_matrix([axes(camera).T @ axes(frames[0]) for camera in frames]).as_rotvec()
        for moved, size in ((shift_m, 0.002), (np.degrees(turn), 0.2)):
            assert np.sqrt(moved.var(0).mean()) == pytest.approx(size, rel=0.1)
        speed = np.array([(*camera.velocity_m_s, *camera.spin_deg_s) for camera in frames])
        for each in np.abs(np.fft.rfft(speed * np.hanning(1000)[:, None], axis=0).T):
            assert (each[(hertz > 0.9) & (hertz < 12.1)] ** 2).sum() > 0.99 * (each**2).sum()
            found, _ = find_peaks(each, height=each.max() / 2)
            lines.append(len(found))
            above_6_hz.append((each[hertz > 6] ** 2).sum() / (each**2).sum())
    assert 4.5 < np.mean(lines) <= 6.1
    assert np.mean(above_6_hz) == pytest.approx(1 / np.log2(12), abs=0.1)


def test_the_size_of_tremor_is_log_uniform():
    """Of a knob of three decades half the bursts are in the lower one and a half."""
    knobs = MotionConfig(frames=30, interval_s=0.1, shake_deg=(0.0, 0.0), shake_m=(1e-4, 1e-1))
    bursts = (burst_rand(np.random.default_rng(seed), knobs, [CAMERA]) for seed in range(40))
    sizes = [np.std([camera.position_m for camera in frames], axis=0).mean() for frames in bursts]
    assert np.median(np.log10(sizes)) == pytest.approx(-2.5, abs=0.5)


def turned_deg(before, after):
    """(3,) rotation between two lenses, about a world axis."""
    return np.degrees(Rotation.from_matrix(after.rotation.T @ before.rotation).as_rotvec())


@pytest.mark.parametrize("shake_deg", [0.3, 5.0, 20.0])
def test_velocity_and_spin_are_the_derivatives_of_the_pose(shake_deg):
    """Central differences of a finely sampled burst agree with what each frame states, of a wide rig, too."""
    eyes = [replace(CAMERA, position_m=(x, -2.0, 1.0), target_m=(x, 0.0, 0.3)) for x in (-0.5, 0.5)]
    knobs = MotionConfig(frames=300, interval_s=1e-3, shake_deg=(shake_deg, shake_deg))
    frames = burst_rand(np.random.default_rng(3), knobs, eyes)[300:]
    for before, now, after in zip(frames, frames[1:], frames[2:], strict=False):
        moved = np.subtract(after.position_m, before.position_m) / 2e-3
        np.testing.assert_allclose(moved, now.velocity_m_s, atol=1e-3 * shake_deg)
        turned = turned_deg(lens_of(before), lens_of(after)) / 2e-3
        np.testing.assert_allclose(turned, now.spin_deg_s, atol=0.1 * shake_deg)


@pytest.mark.parametrize("exposure_s", [0.02, 0.12, 1.0])
@pytest.mark.parametrize("shake_deg", [0.3, 5.0])
def test_blur_of_a_shaken_camera_is_what_it_moves_by_from_when_the_shutter_opens_until_it_closes(
    shake_deg, exposure_s
):
    """So it never spans more than the tremor does meanwhile; in its middle is the pose of the frame."""
    eyes = [replace(CAMERA, position_m=(x, -2.0, 1.0), target_m=(x, 0.0, 0.3)) for x in (-0.5, 0.5)]
    knobs = MotionConfig(frames=4, interval_s=exposure_s / 2, shake_deg=(shake_deg, shake_deg))
    open_shutter = replace(knobs, frames=2, interval_s=exposure_s, exposure_s=(exposure_s, exposure_s))
    for seed in range(5):
        opens, middle, closes = map(lens_of, burst_rand(np.random.default_rng(seed), knobs, eyes)[5:])
        camera = burst_rand(np.random.default_rng(seed), open_shutter, eyes)[3]
        first, last = (lens_of(camera, camera.time_s + part * exposure_s) for part in (-0.5, 0.5))
        np.testing.assert_allclose(lens_of(camera).rotation, middle.rotation, atol=1e-12)
        np.testing.assert_allclose(lens_of(camera).position, middle.position, atol=1e-12)
        np.testing.assert_allclose(
            last.position - first.position, closes.position - opens.position, atol=1e-9
        )
        np.testing.assert_allclose(turned_deg(first, last), turned_deg(opens, closes), atol=1e-6)


def test_frames_of_a_burst_do_not_overlap_in_time():
    MotionConfig(frames=2, interval_s=0.05, exposure_s=(0.01, 0.05))
    MotionConfig(exposure_s=(0.1, 0.2))
    with pytest.raises(FsidError, match=r"exposure_s = \(0.01, 0.06\): .* every interval_s = 0.05 s"):
        MotionConfig(frames=2, interval_s=0.05, exposure_s=(0.01, 0.06))


def test_a_still_camera_takes_no_time():
    camera = scene().cameras[0]
    assert (camera.exposure_s, camera.velocity_m_s, camera.spin_deg_s) == (0.0, (0, 0, 0), (0, 0, 0))
    assert scene().motions == ()


def test_the_time_of_one_exposure_blurs_a_single_picture():
    knobs = MotionConfig(exposure_s=(0.02, 0.02), moving_share=1.0)
    drawn = scene(motion=knobs)
    (camera,) = drawn.cameras
    assert camera.exposure_s == 0.02
    assert np.linalg.norm(camera.velocity_m_s) > 0
    assert np.linalg.norm(camera.spin_deg_s) > 0
    assert camera.position_m == pytest.approx(scene().cameras[0].position_m)
    assert len(drawn.motions) == len(drawn.objects)
    assert scene(motion=MotionConfig(moving_share=1.0)).motions == ()  # no time passes


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
    along = np.array([np.dot(motion.velocity_m_s, motion.spin_deg_s) for motion in s.motions])
    assert np.abs(along[moving] / (speeds * spins)[moving]).mean() == pytest.approx(0.5, abs=0.2)


def test_the_lens_changes_nothing_but_the_lens():
    lens = LensConfig(
        distortion_share=1.0, blur_share=1.0, vignetting_share=1.0, fringe_share=1.0, sharp_share=1.0
    )
    plain, seen = scene().cameras[0], scene(lens=lens).cameras[0]
    assert seen.distortion is not None
    assert seen.aperture_m > 0
    assert -1 < sum(seen.vignetting) < 0
    assert any(seen.chromatic_aberration)
    assert 0.28 <= seen.softness_px <= 0.65
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
    camera = lens_rand(np.random.default_rng(seed), config, camera, 1.0)
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


CORNER = np.tan(np.radians(30)) * np.hypot(1, 64 / 96)


def lenses(count, camera=CAMERA, **knobs):
    """Lenses of as many seeds with these knobs, all of whose shares are 0 unless given."""
    shares = ("distortion", "fisheye", "blur", "vignetting", "fringe", "soft", "sharp")
    config = LensConfig(**{f"{name}_share": 0.0 for name in shares} | knobs)
    return [lens_rand(np.random.default_rng(seed), config, camera, 1.0) for seed in range(count)]


@pytest.mark.parametrize("displacement", [-0.08, 0.08])
def test_a_drawn_distortion_moves_the_corner_by_the_configured_share(displacement, monkeypatch):
    """At most three tenths of it by the fourth power of the radius; and decentring by 0.0005 of the corner.
    That it can be rendered is another test's."""
    monkeypatch.setattr("fsid.scene.lens.rays_of", lambda *arguments: None)
    drawn = [lens.distortion for lens in lenses(200, distortion_share=1.0, distortion=(displacement,) * 2)]
    k1, k2, p1, p2, k3 = np.array([distortion.coefficients for distortion in drawn]).T
    np.testing.assert_allclose(k1 * CORNER**2 + k2 * CORNER**4, displacement)
    second = k2 * CORNER**4 / displacement
    assert np.abs(second).max() <= 0.3
    assert second.std() == pytest.approx(0.6 / np.sqrt(12), rel=0.15)
    assert (np.std([p1, p2], axis=1) * CORNER).tolist() == pytest.approx([0.0005] * 2, rel=0.2)
    assert not k3.any()
    corner = np.array([[CORNER, 0.0], [0.0, -CORNER]])
    for distortion in drawn:
        radius = np.linalg.norm(distorted(distortion, corner), axis=1)
        np.testing.assert_allclose(radius / CORNER - 1, displacement, atol=0.008)


def test_a_distortion_that_would_fold_is_weakened_and_not_left_out(monkeypatch):
    monkeypatch.setattr("fsid.scene.lens.rays_of", lambda *arguments: None)
    moved = []
    for lens in lenses(30, distortion_share=1.0, distortion=(-0.5, -0.5)):
        k1, k2, *_ = lens.distortion.coefficients
        moved.append(k1 * CORNER**2 + k2 * CORNER**4)
    assert {-0.15, -0.25} <= set(np.round(moved, 9)) <= {-0.05, -0.15, -0.25, -0.35}


def test_a_drawn_fisheye_is_nearly_equidistant_and_sees_less_than_80_degrees_aside(monkeypatch):
    """Whatever the share of distortion is; a narrower view stays as it is."""
    monkeypatch.setattr("fsid.scene.lens.rays_of", lambda *arguments: None)
    drawn = lenses(200, fisheye_share=1.0)
    assert {lens.fov_deg for lens in drawn} == {60.0}
    bend = np.array([lens.distortion.coefficients for lens in drawn])
    np.testing.assert_allclose(bend.std(0), 0.02 * np.array([1.0, 0.3, 0.1, 0.03]), rtol=0.2)
    wide = dataclasses.replace(CAMERA, fov_deg=130.0)
    for lens in lenses(20, wide, fisheye_share=1.0):
        assert corner_radius(lens) == pytest.approx(0.9 * np.radians(80))


def test_each_knob_of_the_lens_is_its_own():
    """Light lost in the corner is the configured loss, red and blue have a range and a draw each."""
    knobs = {"vignetting": (0.25, 0.25), "contrast_red": (0.1, 0.11), "contrast_blue": (0.2, 0.21)}
    drawn = lenses(100, vignetting_share=1.0, fringe_share=1.0, soft_share=1.0, fringe=(-0.01, 0.01), **knobs)
    losses = -np.array([lens.vignetting for lens in drawn])
    np.testing.assert_allclose(losses.sum(1), 0.25)
    assert losses.min() >= 0
    np.testing.assert_allclose(losses.mean(0) / 0.25, np.array([4, 2, 1]) / 7, atol=0.08)
    red, blue = np.array([lens.chromatic_aberration for lens in drawn]).T
    assert abs(np.corrcoef(red, blue)[0, 1]) < 0.3
    for lens in drawn:
        assert 0.1 <= lens.colour_contrast[0] <= 0.11
        assert 0.2 <= lens.colour_contrast[1] <= 0.21
        assert lens.softness_px > 0
        assert lens.sharpening == 0
    assert {lens.softness_px for lens in lenses(10, sharp_share=1.0)} == {0.0}


def test_a_distortion_is_sane_while_its_radius_grows_by_a_tenth_until_two_percent_beyond_the_corner():
    """r (1 + k r^2) is at 1.02 x 0.7, with a slope of 0.1, where r = 1.02 and k = -0.3 / r^2."""
    edge = -0.3 / 1.02**2
    check_distortion(Distortion("brown-conrady", (edge + 1e-3, 0.0, 0.0, 0.0, 0.0)), 0.7)
    for refused in ((edge - 1e-3, 0.0, 0.0, 0.0, 0.0), (edge + 1e-3, 0.0, 0.01, 0.0, 0.0)):
        with pytest.raises(FsidError, match="folds"):
            check_distortion(Distortion("brown-conrady", refused), 0.7)
    equidistant = Distortion("fisheye", (0.0,) * 4)
    check_distortion(equidistant, np.radians(80) / 1.03)
    with pytest.raises(FsidError, match="folds"):
        check_distortion(equidistant, np.radians(80) / 1.01)
    assert corner_radius(CAMERA) == pytest.approx(CORNER)


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


def test_views_come_from_all_around_and_look_at_the_focus_and_beside_it():
    """By 0.12 of the distance along each axis; up is up, and no wall is near."""
    wide = Background("room", (40.0, 40.0, 20.0), {})
    config = CameraConfig(skyward_share=0.0, roll_deg=0.0, distance_m=(0.5, 5.0))
    aside, octants = [], []
    for seed in range(400):
        camera, focus, _ = camera_rand(np.random.default_rng(seed), config, wide, 96, 64)
        away = np.subtract(camera.position_m, focus)
        aside.append(np.subtract(camera.target_m, focus) / np.linalg.norm(away))
        octants.append(int(np.arctan2(away[1], away[0]) // (np.pi / 4)))
        assert 0.2 <= focus[2] <= 0.5
        assert tuple(focus[:2]) == (0, 0)
        assert camera.up[2] > 0
    np.testing.assert_allclose(np.std(aside, axis=0), 0.12, rtol=0.12)
    np.testing.assert_allclose(np.mean(aside, axis=0), 0.0, atol=0.025)
    assert np.unique(octants, return_counts=True)[1].tolist() == pytest.approx([50] * 8, abs=25)


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
        lens_of(lens_rand(np.random.default_rng(seed), config, camera, 1.0))


def test_the_focus_is_a_share_of_the_distance():
    config = LensConfig(blur_share=1.0, focus=(2.0, 2.0))
    assert lens_rand(np.random.default_rng(0), config, CAMERA, 1.5).focus_m == pytest.approx(3.0)


def test_views_up_at_the_sky_are_focused_on_what_is_in_front():
    """The point that they look at is up in the air, many times as far as the things below it."""
    for skyward in (0.0, 1.0):
        knobs = {"lens": LensConfig(blur_share=1.0), "background": BackgroundConfig(kind_shares=(0, 0, 0, 1))}
        for seed in range(12):
            config = CameraConfig(skyward_share=skyward, fov_deg=(110.0, 120.0))
            camera = scene(seed, camera=config, **knobs).cameras[0]
            to_middle = np.linalg.norm(np.subtract(camera.position_m, (0, 0, 0.35)))
            assert 0.4 < camera.focus_m / to_middle < 2.1  # 0.7 to 1.4 times, and the focus lies beside it


def test_eyes_above_high_hills_keep_their_baseline():
    background = BackgroundConfig(kind_shares=(0, 0, 0, 1), hills_m=(200, 200), ground_m=(300, 300))
    highest = 0.0
    for seed in range(40):
        far = CameraConfig(distance_m=(60, 100))
        eyes = scene(seed, camera=far, background=background, rig=RigConfig(eyes=2)).cameras
        highest = max(highest, eyes[0].position_m[2])
        assert np.linalg.norm(np.subtract(eyes[0].position_m, eyes[1].position_m)) > 0.02
    assert highest > 55


def test_the_smallest_images_have_lenses_that_can_be_rendered():
    camera = dataclasses.replace(CAMERA, width=160, height=16, fov_deg=150.0)
    config = LensConfig(fisheye_share=1.0)
    drawn = [lens_rand(np.random.default_rng(seed), config, camera, 1.0) for seed in range(20)]
    for each in drawn:
        lens_of(each)
    narrow = dataclasses.replace(camera, fov_deg=90.0)
    assert lens_rand(np.random.default_rng(0), config, narrow, 1.0).distortion is not None


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
