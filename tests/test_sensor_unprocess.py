"""Light on the sensor: unprocessing inverts processing, the linear path is linear, grey stays grey."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fsid.errors import FsidError
from fsid.sensor import (
    camera_to_srgb_matrix,
    colour_rand,
    expose,
    exposure_rand,
    linear_to_camera,
    process,
    srgb_decode,
    srgb_encode,
    srgb_to_camera_matrix,
    unprocess,
)
from fsid.sensor.colour import SRGB_TO_XYZ, published_matrices
from fsid.sensor.exposure import BALANCED_RANGE, KEY_RANGE
from fsid.sensor.tone import inverse_tone_curve, photo_to_linear, tone_curve

seeds = st.integers(0, 2**32 - 1)


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_process_inverts_unprocess_where_nothing_clips(seed):
    rng = np.random.default_rng(seed)
    matrix, gains = colour_rand(rng, published_matrices())
    exposure = rng.uniform(0.6, 1.0)
    # In gamut: muted colours map to positive camera RGB below the highlight inflection.
    srgb = np.clip(rng.uniform(0.1, 0.85, (8, 10, 1)) + rng.uniform(-0.05, 0.05, (8, 10, 3)), 0, 1)
    camera = unprocess(srgb, matrix, gains, exposure)
    assert camera.min() > 0
    assert camera.max() < 1
    np.testing.assert_allclose(process(camera, matrix, gains, exposure), srgb, atol=1e-4)


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_white_stays_saturated_and_dark_is_divided_by_the_gains(seed):
    rng = np.random.default_rng(seed)
    matrix, gains = colour_rand(rng, published_matrices())
    np.testing.assert_allclose(unprocess(np.ones((2, 2, 3)), matrix, gains, 0.8), 1, atol=1e-5)
    grey = unprocess(np.full((2, 2, 3), 0.4), matrix, gains, 0.8)
    light = srgb_decode(inverse_tone_curve(np.float32(0.4)))
    np.testing.assert_allclose(grey * gains, 0.8 * light, rtol=1e-4)


def test_highlights_never_get_darker_than_the_light_below_them():
    matrix, gains = published_matrices()[1], (2.2, 1.0, 1.7)
    ramp = np.linspace(0, 1, 256)[None, :, None] * np.ones((1, 1, 3))
    camera = unprocess(ramp, matrix, gains)
    assert np.all(np.diff(camera, axis=1) >= -1e-6)


def test_highlights_are_exposed_as_much_as_the_light_below_them():
    """What is kept of a highlight is never less than its gain: where exposure lifts green, it lifts all."""
    matrix, gains = published_matrices()[1], (2.2, 1.0, 1.7)
    ramp = np.linspace(0, 1, 256, dtype=np.float32)[None, :, None] * np.ones((1, 1, 3), np.float32)
    light = srgb_decode(inverse_tone_curve(ramp[..., 1]))
    camera = unprocess(ramp, matrix, gains, exposure=1.05)
    np.testing.assert_allclose(camera[..., 1], np.minimum(1.05 * light, 1), atol=1e-5)


def test_highlights_are_preserved_as_by_brooks_et_al(rng):
    """Their eq. 2 and 3, of coloured highlights: grey is the mean of the camera's channels, t is 0.9."""
    matrix, gains = published_matrices()[1], np.array([2.2, 1.0, 1.7])
    srgb = tone_curve(srgb_encode(rng.uniform(0.7, 1.0, (20, 20, 1)) + rng.uniform(-0.1, 0.1, (20, 20, 3))))
    linear = photo_to_linear(srgb).astype(float)
    balanced = linear @ srgb_to_camera_matrix(matrix).T
    share = (np.maximum(balanced.mean(axis=-1, keepdims=True) - 0.9, 0) / 0.1) ** 2
    assert np.sum((share > 0.05) & (share < 0.95)) > 20
    expected = balanced * np.maximum(share + (1 - share) * 0.8 / gains, 0.8 / gains)
    np.testing.assert_allclose(unprocess(srgb, matrix, gains, 0.8), expected.clip(0, 1), atol=2e-4)


@settings(max_examples=40, deadline=None)
@given(seeds)
def test_the_path_of_rendered_light_is_exactly_linear(seed):
    rng = np.random.default_rng(seed)
    matrix, gains = colour_rand(rng, published_matrices())
    a, b = rng.uniform(0.2, 0.4, (2, 4, 4, 3))
    total = linear_to_camera(a + 0.5 * b, matrix, gains)
    parts = linear_to_camera(a, matrix, gains) + 0.5 * linear_to_camera(b, matrix, gains)
    np.testing.assert_allclose(total, parts, atol=1e-6)


def test_grey_light_saturates_green_first_then_red_and_blue():
    matrix, gains = published_matrices()[0], (2.0, 1.0, 1.6)
    light = np.array([0.5, 1.0, 1.6, 2.0, 9.0])[None, :, None] * np.ones((1, 1, 3))
    camera = linear_to_camera(light, matrix, gains)[0]
    np.testing.assert_allclose(camera[:, 1], [0.5, 1, 1, 1, 1], atol=1e-6)
    np.testing.assert_allclose(camera[:, 2], [0.5 / 1.6, 1 / 1.6, 1, 1, 1], atol=1e-6)
    np.testing.assert_allclose(camera[:, 0], [0.25, 0.5, 0.8, 1, 1], atol=1e-6)


def test_tone_curve_and_srgb_are_inverted():
    v = np.linspace(0, 1, 4097, dtype=np.float32)
    np.testing.assert_allclose(tone_curve(inverse_tone_curve(v)), v, atol=2e-6)
    np.testing.assert_allclose(srgb_encode(srgb_decode(v)), v, atol=2e-6)
    assert tone_curve(np.float32(0.5)) == pytest.approx(0.5)
    assert srgb_decode(np.float32(0.5)) == pytest.approx(0.21404114, abs=1e-6)  # IEC 61966-2-1
    assert srgb_encode(np.float32(-0.1)) == 0
    assert srgb_encode(np.float32(7.0)) == pytest.approx(1)


def test_matrices_keep_grey_and_invert_each_other():
    for matrix in published_matrices():
        to_camera = srgb_to_camera_matrix(matrix)
        np.testing.assert_allclose(to_camera.sum(axis=1), 1, rtol=1e-12)
        np.testing.assert_allclose(camera_to_srgb_matrix(matrix) @ to_camera, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(SRGB_TO_XYZ.sum(axis=1), [0.9505, 1.0, 1.089], atol=1e-3)  # D65 white


def test_colour_rand_blends_inside_the_published_cameras():
    rng = np.random.default_rng(0)
    matrices = published_matrices()
    with pytest.raises(FsidError, match=r"xyz_to_camera has shape \(3, 3\); expected \(m, 3, 3\)"):
        colour_rand(rng, matrices[0])
    draws = [colour_rand(rng, matrices) for _ in range(300)]
    blends = np.array([matrix for matrix, _ in draws])
    assert np.all(blends >= matrices.min(axis=0) - 1e-12)
    assert np.all(blends <= matrices.max(axis=0) + 1e-12)
    assert np.all(blends.std(axis=0)[0] > 0)
    red, green, blue = np.array([gains for _, gains in draws]).T
    assert 1.9 <= red.min() < 1.95 < 2.35 < red.max() <= 2.4
    assert 1.5 <= blue.min() < 1.55 < 1.85 < blue.max() <= 1.9
    assert np.all(green == 1)


def _natural_light(seed: int) -> np.ndarray:
    """Log-normal radiance with smooth structure and a few lamps, of any absolute level."""
    rng = np.random.default_rng(seed)
    small = rng.normal(0, 1.3, (24, 32))
    light = np.exp(np.kron(small, np.ones((8, 8)))) * rng.uniform(0.01, 100)
    light[:4, :6] *= 1000
    return (light[..., None] * rng.uniform(0.6, 1.2, (1, 1, 3))).astype(np.float32)


def _exposed(seed):
    """Share above saturation, and median, of the luminance of a frame."""
    luminance = expose(np.random.default_rng(seed), _natural_light(seed)) @ SRGB_TO_XYZ[1]
    return np.mean(luminance > 1), np.median(luminance)


def test_exposure_clips_highlights_as_photographs_do_and_places_the_middle_where_it_says(monkeypatch):
    monkeypatch.setattr("fsid.sensor.exposure.OVEREXPOSED_SHARE", 0.0)
    clipped, middle = np.transpose([_exposed(seed) for seed in range(60)])
    assert 0.05 < max(clipped) <= 0.2505
    assert 0 < np.median(clipped) < 0.1
    assert max(middle) <= KEY_RANGE[1] + 1e-4
    assert np.median(middle) > 0.02


def test_some_frames_are_overexposed_by_one_to_two_and_a_half_stops(monkeypatch):
    usual = np.array([_exposed(seed)[1] for seed in range(200)])
    monkeypatch.setattr("fsid.sensor.exposure.OVEREXPOSED_SHARE", 0.0)
    times = usual / [_exposed(seed)[1] for seed in range(200)]
    over = times > 1.01
    assert 0.02 < over.mean() < 0.12
    assert np.all((times[over] >= 1.99) & (times[over] <= 6.01))
    np.testing.assert_allclose(times[~over], 1, rtol=1e-4)


@settings(max_examples=20, deadline=None)
@given(seeds, st.floats(1e-3, 1e3))
def test_exposure_cancels_the_absolute_level_of_the_light(seed, factor):
    radiance = _natural_light(1)
    one = exposure_rand(np.random.default_rng(seed), radiance)
    other = exposure_rand(np.random.default_rng(seed), radiance * np.float32(factor))
    np.testing.assert_allclose(other * factor, one, rtol=1e-4)


def test_a_black_frame_stays_black_and_a_mostly_black_one_is_exposed_for_its_light():
    black = np.zeros((8, 8, 3), np.float32)
    assert np.all(expose(np.random.default_rng(0), black) == 0)
    lamp = np.zeros((20, 20, 3), np.float32)
    lamp[:5] = 50
    assert (expose(np.random.default_rng(1), lamp) @ SRGB_TO_XYZ[1]).max() == pytest.approx(1, rel=1e-3)


def test_white_balance_takes_a_part_of_what_tints_a_whole_frame_and_leaves_differences():
    """A frame in red light comes out less red by the share that is drawn, and else as it was."""
    grey = np.random.default_rng(0).lognormal(0, 0.5, (40, 50, 1)).astype(np.float32) * np.ones(3, np.float32)
    red = grey * np.array([4.0, 1.0, 1.0], np.float32)
    for seed in range(20):
        gains = [exposure_rand(np.random.default_rng(seed), light) for light in (grey, red)]
        shares = 1 - np.log([4 * gains[1][0] / gains[1][1], gains[0][0] / gains[0][1]]) @ (1, -1) / np.log(4)
        drawn = np.random.default_rng(seed).uniform(size=3)[2]
        low, high = BALANCED_RANGE
        assert shares == pytest.approx(low + drawn * (high - low), abs=1e-3)
    one_colour = np.zeros((8, 8, 3), np.float32)
    one_colour[..., 0] = 1
    assert np.isfinite(expose(np.random.default_rng(0), one_colour)).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_radiance_that_is_no_number_is_refused(bad):
    with pytest.raises(FsidError, match="radiance"):
        expose(np.random.default_rng(0), np.full((4, 4, 3), bad))


@pytest.mark.parametrize(
    "photo", [np.full((4, 4, 3), 200), np.full((4, 4, 3), np.nan), np.zeros((4, 4)), np.zeros((4, 4, 4))]
)
def test_a_photo_out_of_range_or_shape_is_refused(photo):
    with pytest.raises(FsidError, match="photo"):
        unprocess(photo, np.eye(3), (2.0, 1.0, 1.5))


@pytest.mark.parametrize(
    "convert",
    [
        srgb_encode,
        srgb_decode,
        tone_curve,
        lambda picture: linear_to_camera(picture, np.eye(3), (2.0, 1.0, 1.6)),
        lambda picture: unprocess(picture, np.eye(3), (2.0, 1.0, 1.6)),
        lambda picture: expose(np.random.default_rng(0), picture),
    ],
)
def test_whole_numbers_do_not_pass_for_white(convert):
    """Clipped to 0..1 nearly all of an 8-bit picture is 1."""
    picture = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    for whole in (picture, picture.astype(np.uint16), picture % 2):
        with pytest.raises(FsidError, match=r"floating-point|0\.\.1"):
            convert(whole)


@pytest.mark.parametrize("shape", [(8, 8), (8, 8, 4), (3, 8, 8)])
def test_radiance_of_another_shape_is_refused(shape):
    with pytest.raises(FsidError, match="height, width, 3"):
        exposure_rand(np.random.default_rng(0), np.ones(shape, np.float32))


def test_white_balance_of_a_frame_does_not_depend_on_its_size():
    """Sums over millions of pixels keep their digits."""
    picture = np.random.default_rng(3).uniform(0.05, 1.0, (30, 40, 3)).astype(np.float32)
    small, large = (
        exposure_rand(np.random.default_rng(0), light) for light in (picture, np.tile(picture, (40, 50, 1)))
    )
    np.testing.assert_allclose(large / large[1], small / small[1], rtol=1e-5)


def test_an_average_scene_is_taken_to_be_as_warm_as_photographs_are():
    """A white frame, moved towards (0.98, 1.02, 0.74) by a share of 0.1 to 0.8."""
    rng, white = np.random.default_rng(0), np.ones((8, 8, 3), np.float32)
    gains = np.array([exposure_rand(rng, white) for _ in range(200)])
    for channel, mean in ((0, 0.98), (2, 0.74)):
        shares = np.log(gains[:, channel] / gains[:, 1]) / np.log(mean / 1.02)
        assert 0.1 - 1e-4 < shares.min() < 0.15 < 0.75 < shares.max() < 0.8 + 1e-4


def test_no_channel_is_balanced_by_more_than_a_factor_of_four():
    """A red frame: red by 1 / 4, the others by 4, to the power of a share of 0.1 to 0.8."""
    rng, red = np.random.default_rng(0), np.full((8, 8, 3), (1.0, 1e-6, 1e-6), np.float32)
    gains = np.array([exposure_rand(rng, red) for _ in range(200)])
    shares = np.log(gains[:, 1:] / gains[:, :1]) / np.log(16)
    np.testing.assert_allclose(shares[:, 0], shares[:, 1], rtol=1e-4)
    assert 0.1 - 1e-4 < shares.min() < 0.15 < 0.75 < shares.max() < 0.8 + 1e-4


def test_grey_light_becomes_a_key_from_a_stop_over_to_one_and_a_third_under_a_card(monkeypatch):
    monkeypatch.setattr("fsid.sensor.exposure.OVEREXPOSED_SHARE", 0.0)
    rng, grey = np.random.default_rng(0), np.full((8, 8, 3), 3.0, np.float32)
    keys = np.array([expose(rng, grey)[0, 0] @ SRGB_TO_XYZ[1] for _ in range(300)])
    assert 0.07 - 1e-4 < keys.min() < 0.075
    assert 0.34 < keys.max() < 0.36 + 1e-4
    assert np.log(keys).mean() == pytest.approx(np.log(0.07 * 0.36) / 2, abs=0.1)


def test_what_is_black_has_no_part_in_white_balance():
    lit = np.random.default_rng(3).uniform((0.2, 0.2, 0.06), (0.5, 0.5, 0.15), (20, 20, 3)).astype(np.float32)
    half = np.concatenate([lit, np.zeros_like(lit)])
    whole, dark = (exposure_rand(np.random.default_rng(0), light) for light in (lit, half))
    np.testing.assert_allclose(dark / dark[1], whole / whole[1], rtol=1e-5)


def test_highlights_of_two_fifths_of_a_frame_hold_its_exposure_back(monkeypatch):
    """At most a quarter may be clipped, however dark the middle then is."""
    monkeypatch.setattr("fsid.sensor.exposure.OVEREXPOSED_SHARE", 0.0)
    light = np.ones((10, 10, 3), np.float32)
    light[:4] = 100
    for seed in range(10):
        assert (expose(np.random.default_rng(seed), light) @ SRGB_TO_XYZ[1]).max() == pytest.approx(
            1, rel=1e-3
        )
