"""What a burst must be, and what is done about flicker, drift and motion."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from fsid.errors import FsidError
from fsid.sensor import TemporalStatistics, fit_noise
from fsid.sensor.light_change import Blocks, gain_and_offset, line_error2, tells_gain

WHITE, BLACK, K, SIGMA2, SIDE = 4095, 200, 1.5, 9.0, 192
RAMP = np.broadcast_to(np.linspace(0, 2400, SIDE), (SIDE, SIDE))


def exposure(rng: np.random.Generator, light: np.ndarray = RAMP, gain: float = 1.0, drift: float = 0.0):
    mean = BLACK + drift + gain * light
    noise = rng.normal(size=light.shape) * np.sqrt(K * gain * light + SIGMA2 - 1 / 12)
    return np.rint(mean + noise).astype(np.int64)


def burst(frames) -> TemporalStatistics:
    stats = TemporalStatistics(WHITE)
    for number, frame in enumerate(frames):
        stats.add(frame, f"frame {number}")
    return stats


def test_a_steady_burst_is_left_alone(rng):
    stats = burst(exposure(rng) for _ in range(30))
    assert set(stats.gains) == {1.0}
    assert set(stats.offsets_dn) == {0.0}
    assert stats.moved_share == 0


def test_a_sensor_without_filters_is_named_as_in_its_profile(rng):
    stats = burst(exposure(rng) for _ in range(10))
    found, expected = (
        fit_noise([stats], cfa=cfa, white_level=WHITE, black_level=BLACK) for cfa in ("MONO", None)
    )
    assert (found.k_dn, found.sigma2_dn) == (expected.k_dn, expected.sigma2_dn)


def test_flicker_and_drift_do_not_count_as_noise(rng):
    """A lamp that varies by 3 % would add (0.03 * 2400)^2 DN^2 to the brightest pixels, twice their noise."""
    gains, drifts = rng.uniform(0.97, 1.03, 30), rng.uniform(-3, 3, 30)
    stats = burst(exposure(rng, RAMP, g, d) for g, d in zip(gains, drifts, strict=True))
    np.testing.assert_allclose(stats.gains, gains[1:] / gains[0], atol=0.002)
    fit = fit_noise([stats], cfa=None, white_level=WHITE, black_level=BLACK + drifts.mean())
    assert fit.k_dn[0] == pytest.approx(K, rel=0.02)
    assert fit.sigma2_dn[0] == pytest.approx(SIGMA2, rel=0.15)


@pytest.mark.parametrize(
    "gains",
    [[1.04] + [1.0] * 19, [0.96] + [1.0] * 19, [1.04, 0.96] * 10, [0.96, 1.04] * 10, [1.05, 0.97, 0.97]],
    ids=["first brighter", "first dimmer", "alternating", "alternating, dim first", "three frames"],
)
def test_the_first_frame_has_no_more_say_than_the_others(rng, gains):
    """Variance and mean are those of the burst's mean light, whichever frame it is compared with.

    Of three frames, the noise of the first would count for 5 % too much.
    """
    wide = np.broadcast_to(np.linspace(0, 2400, 4 * SIDE), (2 * SIDE, 4 * SIDE))
    fit = fit_noise(
        [burst(exposure(rng, wide, gain) for gain in gains)],
        cfa=None,
        white_level=WHITE,
        black_level=BLACK,
    )
    assert fit.k_dn[0] == pytest.approx(K, rel=0.007 if len(gains) > 3 else 0.012)


def test_a_moving_object_is_left_out(rng):
    def frame(number):
        light = RAMP.copy()
        light[10:30, 20 + number : 40 + number] = 800
        return exposure(rng, light)

    stats = burst(frame(number) for number in range(20))
    assert 0 < stats.moved_share < 0.25
    fit = fit_noise([stats], cfa=None, white_level=WHITE, black_level=BLACK)
    assert fit.k_dn[0] == pytest.approx(K, rel=0.02)


def test_a_moving_camera_is_refused(rng):
    texture = 400 + 300 * gaussian_filter(rng.normal(size=(SIDE, SIDE + 40)), 2)
    with pytest.raises(FsidError, match=r"frame [12].*shifted"):
        burst(exposure(rng, texture[:, n : n + SIDE]) for n in range(10))
    with pytest.raises(FsidError, match=r"frame 1.*static scene"):
        burst(exposure(rng, np.roll(RAMP, 30 * n, axis=1)) for n in range(3))


def test_another_exposure_is_refused(rng):
    with pytest.raises(FsidError, match=r"frame 1.*\+30 %"):
        burst([exposure(rng), exposure(rng, RAMP, 1.3)])


@pytest.mark.parametrize(("shift", "gain"), [(48, 1.0), (0, 1.3)], ids=["moved", "brighter"])
def test_a_burst_goes_on_without_a_frame_that_was_refused(rng, shift, gain):
    """What the frame held must not count as motion, or as noise, of those that come after it."""
    light = np.roll(RAMP, 48, axis=1)  # no edge at the border of the picture
    frames = [exposure(rng, light) for _ in range(6)]
    stats, undisturbed = burst(frames[:3]), burst(frames)
    with pytest.raises(FsidError):
        stats.add(exposure(rng, np.roll(light, shift, axis=1), gain))
    for frame in frames[3:]:
        stats.add(frame)
    assert (stats.frames, stats.moved_share) == (6, 0)
    for found, expected in zip(stats.sites(None), undisturbed.sites(None), strict=True):
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize(
    "frame",
    [
        exposure(np.random.default_rng(0)) / WHITE,
        exposure(np.random.default_rng(0)) - 2 * BLACK,
        exposure(np.random.default_rng(0)) + 70_000,
        np.where(RAMP > 1000, np.nan, 300.0),
        exposure(np.random.default_rng(0))[..., None],
    ],
    ids=["normalised", "below 0", "beyond 16 bits", "NaN", "a channel axis"],
)
def test_what_is_no_dn_is_refused(frame):
    """Stored as 16 bits, it would wrap around or lose its fractions, and give another noise."""
    with pytest.raises(FsidError, match="own frame: holds"):
        TemporalStatistics(WHITE).add(frame, "own frame")


@pytest.mark.parametrize("kind", ["<u2", ">u2", "<f8"])
def test_whole_numbers_of_any_type_are_dn(rng, kind):
    frames = [exposure(rng) for _ in range(3)]
    (expected,), (found,) = (burst(f.astype(k) for f in frames).sites(None) for k in ("<i8", kind))
    np.testing.assert_array_equal(found, expected)


def test_memory_does_not_depend_on_the_number_of_frames(rng):
    import tracemalloc

    frames = [exposure(rng) for _ in range(3)]
    peaks = []
    for count in (3, 30):
        tracemalloc.start()
        burst(frames[n % 3] for n in range(count))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.05 * peaks[0]


def test_row_noise_kurtosis_and_drift_of_dark_frames_are_found(rng):
    rows, sigma, drift = 1.0, 3.0, 0.5
    stats = TemporalStatistics(WHITE, dark=True)
    for _ in range(60):
        noise = sigma * rng.standard_t(8, (SIDE, SIDE)) * np.sqrt(6 / 8)
        frame = BLACK + drift * rng.normal() + rows * rng.normal(size=(SIDE, 1)) + noise
        stats.add(np.rint(frame).astype(np.int64))
    found = stats.read_statistics()
    assert found.row_dn2 == pytest.approx(rows**2, rel=0.15)
    assert found.column_dn2 < 0.05
    assert found.pixel_dn2 == pytest.approx(sigma**2 + rows**2 + 1 / 12, rel=0.03)
    assert found.level_dn2 == pytest.approx(drift**2, rel=0.5)
    kurtosis_of_t8 = 6 / (8 - 4)
    assert found.excess_kurtosis == pytest.approx(kurtosis_of_t8 * (sigma**2 / found.pixel_dn2) ** 2, rel=0.2)


def test_banding_is_told_from_pixels_that_scatter_and_scaled_to_the_mean_site(rng):
    """Sites of two rows differ in noise, and each has banding of a third of its own; then none has any."""
    sigma = np.where(np.arange(SIDE) % 2, 0.6, 2.4)[:, None]
    banded, plain = TemporalStatistics(WHITE, dark=True), TemporalStatistics(WHITE, dark=True)
    for _ in range(40):
        noise, rows = rng.normal(size=(SIDE, SIDE)), rng.normal(size=(SIDE, 1))
        banded.add(np.rint(BLACK + sigma * (noise + rows / 3)).astype(np.int64))
        plain.add(np.rint(BLACK + sigma * noise).astype(np.int64))
    assert plain.read_statistics().sigma_dn == pytest.approx(1.5, rel=0.01)
    assert plain.read_statistics().row_dn2 == pytest.approx(0, abs=0.004)
    assert plain.read_statistics().column_dn2 == pytest.approx(0, abs=0.004)
    found = banded.read_statistics()
    assert found.sigma_dn == pytest.approx(1.5 * np.sqrt(10) / 3, rel=0.02)
    assert found.row_dn2 == pytest.approx((found.sigma_dn / np.sqrt(10)) ** 2, rel=0.15)


def test_the_variance_of_few_levels_is_unbiased():
    stats = TemporalStatistics(WHITE, dark=True)
    for level in (0, 2, 4):
        stats.add(np.full((SIDE, SIDE), BLACK + level))
    assert stats.read_statistics().level_dn2 == pytest.approx(4)


def test_pixels_that_hardly_ever_leave_a_limit_are_left_out_and_zeros_are_counted(rng):
    frames = [exposure(rng) for _ in range(20)]
    for frame in frames[1:]:
        frame[:2, :96] = 0  # 19 of 20 frames: stuck
    for frame in frames[:10]:
        frame[4:6, :96] = 0  # half of them: noise that is cut off
    stats = burst(frames)
    assert stats.clipped_share == pytest.approx(192 / SIDE**2)
    assert stats.zero_share == pytest.approx(192 * (19 + 10) / 20 / SIDE**2)


def test_a_scene_of_which_a_third_moved_is_refused(rng):
    moved = np.full((SIDE, SIDE), 500.0)
    moved[:, :72] += np.where(np.arange(72) // 24 % 2, 300, -300)
    with pytest.raises(FsidError, match=r"frame 1.*in 3[0-9] %"):
        burst([exposure(rng, np.full((SIDE, SIDE), 500.0)), exposure(rng, moved)])


def test_blocks_with_white_pixels_do_not_tell_the_light(rng):
    light = np.broadcast_to(np.linspace(0, 2400, SIDE), (SIDE, SIDE)).copy()
    light[::3, 96::3] = 6000  # a ninth of the pixels of every second block
    gains = [1.0, 1.04, 0.96, 1.04]
    stats = burst(np.minimum(exposure(rng, light, gain), WHITE) for gain in gains)
    np.testing.assert_allclose(stats.gains, gains[1:], atol=0.004)


def test_gain_and_offset_count_from_five_standard_errors_on_and_where_blocks_differ():
    reference, weight = np.linspace(0, 1000, 64), np.full(64, 4.0)
    error = 1 / np.sqrt(weight.sum())
    for errors, found in ((4.5, 0.0), (5.5, 5.5 * error)):
        assert gain_and_offset(np.full(64, errors * error), reference, weight) == (1, pytest.approx(found))
    slope_error = 1 / np.sqrt((weight * (reference - 500) ** 2).sum())
    for errors, found in ((4.5, 1.0), (5.5, 1 + 5.5 * slope_error)):
        change = errors * slope_error * (reference - 500)
        assert gain_and_offset(change, reference, weight)[0] == pytest.approx(found, rel=1e-9)
    for contrast, told in ((9.0, False), (11.0, True)):  # standard errors of a block: their squares are 100
        blocks = np.tile([-1.0, 1.0], 32) * contrast * np.sqrt(1 / weight)
        assert tells_gain(500 + blocks, weight) == told


def test_blocks_that_moved_do_not_tell_the_light_even_where_errors_are_understated():
    reference, weight = np.linspace(0, 1000, 64), np.ones(64)
    change = 0.02 * reference + 4 + np.tile([-3.0, 3.0, 3.0, -3.0], 16)
    gain, offset = gain_and_offset(change, reference, weight)
    change[28:32] += 20
    assert gain_and_offset(change, reference, weight) == (
        pytest.approx(gain, abs=0.001),
        pytest.approx(offset, abs=0.3),
    )


def test_the_error_of_a_block_holds_for_rows_with_a_tenth_of_the_noise_in_common(rng):
    blocks = Blocks.of((SIDE, SIDE))
    means, errors2 = [], []
    for _ in range(40):
        noise = np.sqrt(0.9) * rng.normal(size=(SIDE, SIDE)) + np.sqrt(0.1) * rng.normal(size=(SIDE, 1))
        means.append(blocks.reduce(10 * noise, np.mean))
        errors2.append(blocks.noise(10 * noise)[1])
    assert np.mean(errors2) == pytest.approx(np.mean(np.square(means)), rel=0.15)


def test_the_error_of_a_line_is_that_of_least_squares(rng):
    reference, weight, at = rng.uniform(0, 1000, 20), rng.uniform(1, 3, 20), rng.uniform(0, 2000, 50)
    design, places = (np.stack([x, np.ones_like(x)], axis=1) for x in (reference, at))
    covariance = np.linalg.inv(design.T @ (design * weight[:, None]))
    expected = np.einsum("ni,ij,nj->n", places, covariance, places).mean()
    assert line_error2(reference, weight, at) == pytest.approx(expected)


def test_banding_widens_the_error_alike_along_rows_and_columns_and_independent_pixels_do_not(rng):
    none = np.zeros((SIDE, SIDE), bool)
    frames = [BLACK + 5 * rng.normal(size=(SIDE, SIDE)) for _ in range(12)]
    common = [8 * rng.normal(size=(SIDE, 1)) for _ in frames]
    factors = [
        burst(np.rint(frame).astype(np.int64) for frame in seen).banding_factors(None, none, 10.0)[0]
        for seen in (
            frames,
            [frame + row for frame, row in zip(frames, common, strict=True)],
            [(frame + row).T for frame, row in zip(frames, common, strict=True)],
        )
    ]
    assert 1 <= factors[0] < 1.5
    assert factors[1] > 20
    assert factors[2] == pytest.approx(factors[1])
