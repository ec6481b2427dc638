"""One image tells its noise, within the error that it states; what shows no noise is refused."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from fsid.errors import FsidError
from fsid.sensor import (
    CFA_PATTERNS,
    NoiseLevel,
    Raw,
    clean_from_photo,
    estimate_noise,
    load_profile,
    noisy_from_clean,
)
from fsid.sensor.blind import _HIGH, _Blocks, _pools, contradiction
from fsid.sensor.blind_lines import Lines, Pools, fitted

PROFILE = load_profile("pixel6")


def photo(name: str = "coffee") -> np.ndarray:
    from skimage import data

    return getattr(data, name)().astype(np.float32) / 255


def scene(mosaic: np.ndarray, cfa: str = "RGGB") -> Raw:
    return Raw(mosaic.astype(np.float32), cfa, 64, 1023, (2.0, 1.0, 1.5), np.eye(3))


def ramp(height: int = 256, width: int = 256) -> np.ndarray:
    return np.tile(np.linspace(0.0, 0.8, width), (height, 1))


def lines(k: float, sigma2: float) -> Lines:
    line = np.array([k, sigma2])
    return Lines(line, np.tile(line, (4, 1)), np.zeros((4, 2, 0)))


def line_through(mean: np.ndarray, variance: np.ndarray, freedom: float, floor: float) -> np.ndarray:
    """(k, sigma2) of pools that are alike for all sites."""
    parts, sites = (n.ravel() for n in np.indices((mean.size, 4)))
    pools = Pools(mean[parts], variance[parts], np.full(parts.size, freedom), sites, parts)
    return fitted(pools, lines(1e-3, 1e-5), floor).common


def test_pools_that_texture_lifts_count_less_than_those_below():
    mean = np.linspace(0.02, 0.8, 24)
    variance = 1e-3 * mean + 1e-5
    variance[[5, 11, 12, 20]] *= 1.5
    line = line_through(mean, variance, 500, 1e-8)
    np.testing.assert_allclose(line @ (mean, np.ones(24)), 1e-3 * mean + 1e-5, rtol=0.02)


@pytest.mark.parametrize(("name", "iso"), [("coffee", 1600), ("coffee", 6400), ("astronaut", 3200)])
def test_the_noise_of_a_photo_is_found(name, iso, rng):
    clean, level = clean_from_photo(rng, photo(name), PROFILE), PROFILE.level(iso)
    found = estimate_noise(noisy_from_clean(rng, clean, iso, level))
    np.testing.assert_allclose(found.level.k, level.k, rtol=0.2)
    assert np.all(np.abs(np.array(found.level.k) - level.k) < 4 * np.array(found.k_error))
    assert np.all(np.abs(np.array(found.level.sigma2) - level.sigma2) < 4 * np.array(found.sigma2_error))


@pytest.mark.parametrize("black_share", [0.5, 0.95])
def test_the_noise_of_light_is_found_in_a_large_picture_full_of_black(black_share, rng):
    """A wall at night, 12 MP: its many black blocks spoke for its light too, and k came out as 0 +- 0.03."""
    wall = np.kron(photo("brick"), np.ones((2, 2), np.float32))
    mosaic = 0.4 * np.tile(wall, (3, 4))[:3000, :4000]
    mosaic[: int(3000 * black_share)] = 0
    level = NoiseLevel((2e-3,) * 4, (4e-6,) * 4)
    noisy = noisy_from_clean(rng, scene(mosaic), 800, level)
    found = estimate_noise(noisy)
    np.testing.assert_allclose(found.level.k, level.k, rtol=0.1)
    np.testing.assert_allclose(found.level.sigma2, level.sigma2, rtol=0.05)
    assert contradiction(noisy, level) is None


@pytest.mark.parametrize("light", [0.0, 0.3])
def test_a_picture_of_one_light_tells_its_variance_there(light, rng):
    level = NoiseLevel((2e-3,) * 4, (4e-5,) * 4)
    noisy = noisy_from_clean(rng, scene(np.full((256, 256), light)), 800, level)
    found = estimate_noise(noisy).level
    variance = np.array(found.k) * light + found.sigma2
    np.testing.assert_allclose(variance, np.array(level.k) * light + level.sigma2, rtol=0.1)
    assert contradiction(noisy, level) is None


@pytest.mark.parametrize("black", [0, 8])
def test_noise_that_is_cut_off_at_dn_0_is_found(black, rng):
    """At black half of it is where black is DN 0; as it is stored, it varies by a third."""
    level = NoiseLevel((4e-3,) * 4, (4e-4,) * 4)
    clean = replace(scene(ramp(512, 512) / 4), black_level=black)
    found = estimate_noise(noisy_from_clean(rng, clean, 12800, level))
    np.testing.assert_allclose(found.level.sigma2, level.sigma2, rtol=0.15)
    np.testing.assert_allclose(found.level.k, level.k, rtol=0.15)


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
def test_sites_that_differ_are_told_apart(cfa):
    """Without texture the estimate is unbiased, and its scatter is below the stated error."""
    level, found = NoiseLevel((2e-3, 2.2e-3, 2.4e-3, 2.6e-3), (2e-5, 3e-5, 2e-5, 4e-5)), []
    for seed in range(5):
        noisy = noisy_from_clean(np.random.default_rng(seed), scene(ramp(384, 384), cfa), 800, level)
        estimate = estimate_noise(noisy)
        found.append([estimate.level.k, estimate.level.sigma2])
        for name in ("k", "sigma2"):
            error = np.array(getattr(estimate.level, name)) - getattr(level, name)
            assert np.all(np.abs(error) < 3 * np.array(getattr(estimate, f"{name}_error")))
    k, sigma2 = np.mean(found, axis=0)
    np.testing.assert_allclose(k, level.k, rtol=0.06)
    assert np.corrcoef(k, level.k)[0, 1] > 0.8
    assert sigma2.mean() == pytest.approx(np.mean(level.sigma2), rel=0.3)


def test_the_temporal_noise_of_a_real_sensor_is_found(shared_data):
    """Strips of 25 exposures of EMVA 1288 set 001, whose pattern is faint beside its noise."""
    images = shared_data / "emva1288" / "001" / "images"
    if not images.is_dir():
        pytest.skip(f"{images}: no EMVA 1288 reference set here")
    flats = [np.asarray(Image.open(path), float) for path in sorted(images.glob("b_[0-9]*_001.png"))]
    black = np.asarray(Image.open(min(images.glob("d_0*"))), float).mean()
    strips = np.concatenate([flat[:64] for flat in flats if flat.mean() < 0.7 * 4095])
    found = estimate_noise(replace(scene((strips - black) / (4095 - black)), white_level=4095))
    assert np.mean(found.level.k) * (4095 - black) == pytest.approx(0.28006, rel=0.1)
    assert np.sqrt(np.mean(found.level.sigma2)) * (4095 - black) == pytest.approx(3.0731, rel=0.15)


@pytest.mark.parametrize("shape", [(2, 2), (16, 16), (4, 400)])
def test_a_small_image_is_refused(shape, rng):
    with pytest.raises(FsidError, match="too small"):
        estimate_noise(scene(rng.random(shape) / 2))


@pytest.mark.parametrize(
    ("mosaic", "words"),
    [
        (np.ones((256, 256)), "saturated"),
        (np.full((256, 256), 0.3), "no noise"),
        (ramp(), "no smooth part"),
        (np.full((256, 256), np.nan), "saturated"),
    ],
)
def test_an_image_without_noise_is_refused(mosaic, words):
    with pytest.raises(FsidError, match=words) as caught:
        estimate_noise(scene(mosaic))
    assert "\n" not in str(caught.value)


def test_the_noise_of_rounding_is_counted_once():
    """Pools on a line give that line, though sigma2 is fitted as what it has beyond the floor."""
    mean, floor = np.linspace(0, 0.8, 12), 1e-6
    found = line_through(mean, 2e-5 * mean + 3 * floor, 1e4, floor)
    np.testing.assert_allclose(found, (2e-5, 3 * floor), rtol=1e-9)


def test_pools_scatter_by_the_degrees_of_freedom_that_they_state(rng):
    """Var(variance) = 2 variance^2 / freedom, for the median of the blocks as well."""
    high = np.square(rng.standard_normal((30, 4800, int(_HIGH.sum())))).mean(axis=2)
    zero, site = np.zeros(4800), np.zeros(4800, int)
    pools = [
        _pools(_Blocks(99 * rng.random(4800), zero, of, zero, site, 1.0), lines(0.0, 1.0)) for of in high
    ]
    z2 = [(pool.variance - 1) ** 2 * pool.freedom / 2 for pool in pools]
    assert np.mean(z2) == pytest.approx(1, abs=0.15)


@pytest.mark.parametrize("brightest", [0.002, 0.004, 0.01])
def test_the_noise_of_the_dark_is_found_within_its_error(brightest, rng):
    """Light of 0.1 to 0.5 sigma. Blocks that were sorted by their own noise gave k as 0.05 to 0.5 of itself,
    by up to six stated errors, and shadows that were 10 to 40 % too bright when it was removed."""
    level = NoiseLevel((4.7e-3,) * 4, (6e-5,) * 4)
    squares = np.kron(rng.uniform(0, brightest, (16, 16)), np.ones((64, 64)))
    found = estimate_noise(noisy_from_clean(rng, scene(squares), 6400, level))
    assert np.all(np.abs(np.array(found.level.k) - level.k) < 4 * np.array(found.k_error))
    np.testing.assert_allclose(found.level.sigma2, level.sigma2, rtol=0.07)
    assert 0.7 < np.mean(found.level.k) / level.k[0] < 1.1


def test_k_of_sites_that_differ_is_found_in_the_dark(rng):
    """Red and blue are darker than green and have twice its sigma2: together they show k as 0.4 of itself."""
    level = NoiseLevel((4.7e-3,) * 4, (1.1e-4, 5.5e-5, 5.5e-5, 1e-4))
    squares = np.kron(rng.uniform(0, 0.02, (16, 16)), np.tile([[0.6, 1.0], [1.0, 0.4]], (32, 32)))
    found = estimate_noise(noisy_from_clean(rng, scene(squares), 6400, level)).level
    np.testing.assert_allclose(found.k, level.k, rtol=0.2)
    np.testing.assert_allclose(found.sigma2, level.sigma2, rtol=0.1)


@pytest.mark.parametrize("black_level", [0, 64])
def test_k_that_light_does_not_tell_is_that_of_a_usual_camera(black_level, rng):
    """Under a lens cap: read noise of 2 electrons, with an error as large as k."""
    level = NoiseLevel((0.0,) * 4, (6e-5,) * 4)
    dark = replace(scene(np.zeros((512, 512))), black_level=black_level)
    found = estimate_noise(noisy_from_clean(rng, dark, 6400, level))
    np.testing.assert_allclose(found.level.k, (6e-5 / 4) ** 0.5, rtol=0.3)
    np.testing.assert_allclose(found.k_error, found.level.k, rtol=0.3)


def test_k_that_light_tells_is_not_that_of_a_usual_camera(rng):
    """Read noise of 0.2 and of 20 electrons."""
    for read in (0.2, 20):
        level = NoiseLevel((2e-3,) * 4, ((2e-3 * read) ** 2,) * 4)
        found = estimate_noise(noisy_from_clean(rng, scene(ramp(512, 512)), 800, level))
        np.testing.assert_allclose(found.level.k, level.k, rtol=0.06)


def test_a_site_that_shows_nothing_has_the_errors_of_texture_and_of_other_sites(rng):
    """Its red is saturated: 8 % that texture makes, and the 10 % by which it and the other three differ."""
    noisy = noisy_from_clean(rng, scene(ramp(1024, 1024)), 800, NoiseLevel((2e-3,) * 4, (4e-5,) * 4))
    noisy.mosaic[::2, ::2] = 1
    found = estimate_noise(noisy)
    assert found.k_error[0] / found.level.k[0] == pytest.approx(
        np.hypot(0.08, 0.1 * (1 + 1 / 3) ** 0.5), rel=0.05
    )


@pytest.mark.parametrize(
    ("times", "told"), [(1.0, False), (2.5, False), (0.4, False), (8.0, True), (0.1, True)]
)
def test_a_stated_noise_that_is_another_is_contradicted(times, told, rng):
    clean, level = clean_from_photo(rng, photo(), PROFILE), PROFILE.level(3200)
    noisy = noisy_from_clean(rng, clean, 3200, level)
    stated = NoiseLevel(tuple(k / times for k in level.k), tuple(s / times for s in level.sigma2))
    found = contradiction(noisy, stated)
    assert (found is not None) == told
    if found is not None:
        assert found == pytest.approx(times, rel=0.1)


def test_an_image_without_noise_contradicts_what_states_some():
    flat = scene(np.repeat(np.linspace(0.1, 0.8, 8), 32)[None].repeat(256, 0))
    level = PROFILE.level(3200)
    assert contradiction(flat, level) == 0
    assert contradiction(flat, NoiseLevel((0.0,) * 4, (0.0,) * 4)) is None
    floor = 1 / 12 / (1023 - 64) ** 2
    assert contradiction(flat, NoiseLevel((0.0,) * 4, (2 * floor,) * 4)) is None
