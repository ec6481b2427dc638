"""What a burst must be, and what is done about flicker, drift and motion."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from fsid.errors import FsidError
from fsid.sensor import TemporalStatistics, fit_noise

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
