"""Pairs: clean is noise-free and inside the sensor's range, noisy is what the camera would have stored."""

import numpy as np
import pytest

from fsid.errors import FsidError
from fsid.render.frame import Frame
from fsid.sensor import (
    NoiseLevel,
    clean_from_frame,
    clean_from_linear,
    clean_from_photo,
    develop,
    load_profile,
    noisy_from_clean,
    pack,
    profile_names,
    to_dn,
)
from fsid.sensor.tone import photo_to_linear


def _frame(radiance: np.ndarray) -> Frame:
    flat = np.zeros(radiance.shape[:2], np.float32)
    normal = np.broadcast_to(np.array([0, 0, 1], np.float32), radiance.shape)
    return Frame(radiance, np.ones_like(radiance), normal, flat + 1, flat.astype(np.int32))


def _light(height: int = 33, width: int = 49) -> np.ndarray:
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    return 7 * np.exp(np.stack([np.sin(x / 5), np.cos(y / 4), np.sin((x + y) / 6)], axis=-1))


CLEAN = {
    "frame": lambda rng, profile: clean_from_frame(rng, _frame(_light()), profile),
    "photo": lambda rng, profile: clean_from_photo(rng, _light() / 21, profile),
    "linear": lambda rng, profile: clean_from_linear(rng, _light() / 21, profile),
}


@pytest.mark.parametrize("source", CLEAN)
@pytest.mark.parametrize("name", profile_names())
def test_clean_is_the_cameras_and_in_range(source, name):
    profile = load_profile(name)
    clean = CLEAN[source](np.random.default_rng(4), profile)
    assert clean.mosaic.shape == (32, 48)
    assert clean.mosaic.dtype == np.float32
    assert clean.mosaic.min() >= 0
    assert clean.mosaic.max() <= 1
    assert clean.mosaic.std() > 0.02
    assert (clean.cfa, clean.black_level, clean.white_level) == (profile.cfa, 64, 1023)
    assert (clean.camera, clean.noise, clean.iso) == (profile.camera, None, 0.0)


@pytest.mark.parametrize("source", CLEAN)
def test_a_pair_depends_on_its_generator_alone(source):
    profile = load_profile("pixel6")
    one, same, other = (CLEAN[source](np.random.default_rng(s), profile) for s in (1, 1, 2))
    np.testing.assert_array_equal(one.mosaic, same.mosaic)
    assert one.white_balance == same.white_balance
    assert one.white_balance != other.white_balance


def test_noisy_is_stored_in_the_cameras_integers_around_the_clean_signal():
    profile = load_profile("galaxy-s22")
    clean = clean_from_linear(np.random.default_rng(0), np.full((256, 256, 3), 0.3, np.float32), profile)
    level = profile.level(3200)
    noisy = noisy_from_clean(np.random.default_rng(1), clean, 3200, level)
    np.testing.assert_allclose(noisy.mosaic * profile.span + 64, to_dn(noisy), atol=1e-3)
    difference = pack(noisy.mosaic - clean.mosaic, profile.cfa).reshape(4, -1).astype(np.float64)
    x = pack(clean.mosaic, profile.cfa)[:, 0, 0]
    expected = np.array(level.k) * x + np.array(level.sigma2)
    n = difference.shape[1]
    assert np.all(np.abs(difference.mean(axis=1)) < 4.5 * np.sqrt(expected / n))
    np.testing.assert_allclose(difference.var(axis=1), expected, rtol=4.5 * np.sqrt(2 / n))


def test_a_developed_photo_keeps_its_neutral_colours():
    profile = load_profile("pixel6")
    grey = np.full((16, 16, 3), 0.5, np.float32)
    for seed in range(5):
        picture = develop(clean_from_photo(np.random.default_rng(seed), grey, profile))
        assert np.max(np.ptp(picture, axis=2)) < 1e-4


def test_a_photo_of_bytes_is_refused():
    with pytest.raises(FsidError, match="255"):
        clean_from_photo(np.random.default_rng(0), np.full((4, 4, 3), 128, np.uint8), load_profile("pixel6"))


@pytest.mark.parametrize(
    ("light", "words"),
    [
        (np.full((4, 4, 3), 128, np.uint8), "floating-point, 1 = saturation; got uint8"),
        (np.full((4, 4, 3), np.nan, np.float32), "NaN or infinity"),
        (np.full((4, 4, 3), np.inf, np.float32), "NaN or infinity"),
        (np.full((4, 4, 3), -np.inf, np.float32), "NaN or infinity"),
        (np.zeros((3, 4, 4), np.float32), r"shape \(height, width, 3\), RGB; got \(3, 4, 4\)"),
        (np.zeros((4, 4), np.float32), r"got \(4, 4\)"),
    ],
)
def test_what_is_no_light_is_refused(light: np.ndarray, words: str):
    with pytest.raises(FsidError, match=words):
        clean_from_linear(np.random.default_rng(0), light, load_profile("pixel6"))


@pytest.mark.parametrize("exposure", [np.inf, np.array([1.0, np.nan, 1.0], np.float32), -1.0])
def test_what_is_no_exposure_is_refused(exposure: np.ndarray | float):
    """As that of light so weak that its inverse is no number, that makes a RAW of NaN; below 0, black."""
    light = np.full((4, 4, 3), 1e-41, np.float32)
    with pytest.raises(FsidError, match="exposure of linear light must be finite"):
        clean_from_linear(np.random.default_rng(0), light, load_profile("pixel6"), exposure)


def test_a_noisy_image_states_the_noise_it_has_and_rounding_is_a_part_of_it():
    """Of a camera without other noise than its rounding, the noisy image is the clean one, rounded."""
    profile = load_profile("pixel6")
    clean = CLEAN["linear"](np.random.default_rng(0), profile)
    level = NoiseLevel((0.0,) * 4, (1 / 12 / profile.span**2,) * 4)
    noisy = noisy_from_clean(np.random.default_rng(1), clean, 200, level)
    np.testing.assert_array_equal(to_dn(noisy), to_dn(clean))
    assert (noisy.noise, noisy.iso) == (level, 200)


def test_the_exposure_of_linear_light_multiplies_it():
    profile, gains = load_profile("pixel6"), np.array([0.3, 0.5, 0.4], np.float32)
    one = clean_from_linear(np.random.default_rng(0), _light() / 21, profile, gains)
    other = clean_from_linear(np.random.default_rng(0), _light() / 21 * gains, profile)
    np.testing.assert_allclose(one.mosaic, other.mosaic, rtol=1e-5)


def test_photographs_are_darkened_as_by_brooks_et_al():
    """By a factor of mean 0.8 and sigma 0.1, cut off at 0.5 and 1.1: grey at a green pixel, of gain 1."""
    profile, grey = load_profile("pixel6"), np.full((4, 4, 3), 0.5, np.float32)
    light = photo_to_linear(np.float32(0.5))
    greens = [
        pack(clean_from_photo(np.random.default_rng(seed), grey, profile).mosaic, profile.cfa)[1, 0, 0]
        for seed in range(1000)
    ]
    factors = np.array(greens) / light
    assert factors.mean() == pytest.approx(0.8, abs=0.015)
    assert factors.std() == pytest.approx(0.1, abs=0.01)
    assert 0.5 - 1e-5 < factors.min() < factors.max() < 1.1 + 1e-5
