"""The contract of the sensor: Var(y) = k x + sigma2 per CFA site, mean x, and the camera's integers."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fsid.errors import FsidError
from fsid.sensor import (
    CFA_PATTERNS,
    NoiseLevel,
    NoiseTerms,
    Raw,
    add_noise,
    add_noise_terms,
    clean_levels,
    from_dn,
    level_rand,
    load_profile,
    noisy_from_clean,
    pack,
    quantise,
    to_dn,
    unpack,
    variance,
)

LEVEL = NoiseLevel(k=(2.3e-3, 2.5e-3, 2.1e-3, 1.9e-3), sigma2=(3e-5, 1e-5, 2e-5, 4e-5))
SIDE = 512


def _flat(x: float, cfa: str = "GBRG", side: int = SIDE) -> Raw:
    return Raw(np.full((side, side), x, np.float32), cfa, 64, 1023, (2.0, 1.0, 1.5), np.eye(3))


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
@pytest.mark.parametrize("x", [0.0, 0.003, 0.1, 0.8])
def test_variance_law_holds_at_every_site(cfa, x):
    noisy = add_noise(np.random.default_rng(3), _flat(x, cfa), LEVEL)
    sites = pack(noisy.mosaic, cfa).reshape(4, -1).astype(np.float64)
    n = sites.shape[1]
    expected = np.array(LEVEL.k) * x + np.array(LEVEL.sigma2)
    # (n - 1) s^2 / sigma^2 is chi-square: s^2 scatters by sqrt(2 / n), the mean by sigma / sqrt(n).
    np.testing.assert_allclose(sites.var(axis=1, ddof=1), expected, rtol=4.5 * np.sqrt(2 / n))
    assert np.all(np.abs(sites.mean(axis=1) - x) < 4.5 * np.sqrt(expected / n))
    assert noisy.noise == LEVEL


@pytest.mark.parametrize(
    "level",
    [
        NoiseLevel((0.001,) * 4, (-1e-5,) * 4),
        NoiseLevel((np.nan,) * 4, (1e-5,) * 4),
        NoiseLevel((np.inf,) * 4, (1e-5,) * 4),
        NoiseLevel((0.001,) * 3, (1e-5,) * 3),
    ],
    ids=["negative", "NaN", "infinite", "three sites"],
)
def test_a_level_that_is_none_is_refused(level):
    """Negative variances made images of NaN, or counted as none."""
    rng, clean = np.random.default_rng(0), _flat(0.2, side=8)
    for use in (
        lambda: add_noise(rng, clean, level),
        lambda: noisy_from_clean(rng, clean, 800, level),
        lambda: add_noise_terms(rng, clean, level, NoiseTerms(row=0.1)),
        lambda: variance(clean.mosaic, level, clean.cfa),
    ):
        with pytest.raises(FsidError, match="NoiseLevel"):
            use()


def test_electrons_are_not_counted_without_shot_noise():
    level = NoiseLevel((0.0,) * 4, (1e-5,) * 4)
    with pytest.raises(FsidError, match="k = 0"):
        add_noise_terms(np.random.default_rng(0), _flat(0.2, side=8), level, NoiseTerms(poisson=True))


@pytest.mark.parametrize("shape", [(8, 8), (4, 8, 8), (7, 8)])
def test_the_variance_is_of_one_shape_with_the_image(shape):
    """A mosaic without its pattern was stretched to four images, one per site."""
    cfa = None if shape == (8, 8) else "RGGB"
    with pytest.raises(FsidError, match="shape"):
        variance(np.zeros(shape, np.float32), LEVEL, cfa)


def test_noise_is_white_and_gaussian():
    noise = (add_noise(np.random.default_rng(5), _flat(0.2), LEVEL).mosaic - 0.2).astype(np.float64)
    noise /= np.sqrt(variance(np.full((SIDE, SIDE), 0.2, np.float32), LEVEL, "GBRG"))
    n = noise.size
    for shifted in (np.roll(noise, 1, axis=0), np.roll(noise, 2, axis=1)):
        assert abs(np.mean(noise * shifted)) < 4.5 / np.sqrt(n)
    assert abs(np.mean(noise**3)) < 4.5 * np.sqrt(15 / n)
    assert abs(np.mean(noise**4) - 3) < 4.5 * np.sqrt(96 / n)


@given(st.sampled_from(CFA_PATTERNS), st.integers(0, 2**32 - 1))
def test_variance_of_packed_and_mosaic_agree_with_the_formula(cfa, seed):
    x = np.random.default_rng(seed).uniform(-0.1, 1, (6, 8)).astype(np.float32)
    packed = pack(x, cfa)
    k, sigma2 = (np.array(v)[:, None, None] for v in (LEVEL.k, LEVEL.sigma2))
    expected = k * np.maximum(packed.astype(np.float64), 0) + sigma2
    np.testing.assert_allclose(variance(packed, LEVEL), expected, rtol=1e-6)
    np.testing.assert_array_equal(unpack(variance(packed, LEVEL), cfa), variance(x, LEVEL, cfa))


def test_noise_leaves_its_input_alone_and_repeats_with_its_seed():
    clean = _flat(0.3, side=16)
    first, second, other = (add_noise(np.random.default_rng(s), clean, LEVEL).mosaic for s in (1, 1, 2))
    np.testing.assert_array_equal(clean.mosaic, np.float32(0.3))
    np.testing.assert_array_equal(first, second)
    assert np.any(first != other)
    assert first.dtype == np.float32


@settings(max_examples=50)
@given(st.integers(0, 1000), st.integers(1001, 65535), st.integers(0, 2**32 - 1))
def test_integers_survive_the_round_trip(black, white, seed):
    dn = np.random.default_rng(seed).integers(0, white + 1, (4, 6)).astype(np.uint16)
    raw = Raw(from_dn(dn, black, white), "RGGB", black, white, (1.0, 1.0, 1.0), np.eye(3))
    np.testing.assert_array_equal(to_dn(raw), dn)
    np.testing.assert_array_equal(quantise(raw).mosaic, raw.mosaic)


def test_quantise_rounds_to_dn_clips_at_white_and_keeps_what_is_below_black():
    raw = _flat(0.0, side=4)
    raw.mosaic[0] = [-1.0, -10.4 / 959, 0.5 + 1e-4, 7.0]
    dn = to_dn(raw)
    np.testing.assert_array_equal(dn[0], [0, 54, 544, 1023])
    np.testing.assert_allclose(quantise(raw).mosaic[0], [-64 / 959, -10 / 959, 480 / 959, 1.0], rtol=1e-6)


@pytest.mark.parametrize(("iso", "x"), [(3200, 0.2), (800, 0.0)])
def test_the_variance_of_stored_data_is_that_of_its_level(iso, x):
    """Rounding is a part of sigma2 and not added to it; at ISO 800 in the dark it would be a tenth more."""
    profile = load_profile("pixel6")
    level = profile.level(iso)
    noisy = noisy_from_clean(np.random.default_rng(0), _flat(x, profile.cfa), iso, level)
    sites = pack(noisy.mosaic, profile.cfa).reshape(4, -1).astype(np.float64)
    expected = np.array(level.k) * x + np.array(level.sigma2)
    np.testing.assert_allclose(sites.var(axis=1), expected, rtol=4.5 * np.sqrt(2 / sites.shape[1]))
    assert noisy.iso == iso
    assert noisy.noise == level


def test_less_noise_than_rounding_makes_is_no_noise_before_it():
    """As another unit's jitter may have it at low ISO; the negative rest would be refused as a variance."""
    level = NoiseLevel(k=(1e-4,) * 4, sigma2=(0.5 / 12 / 959**2,) * 4)
    noisy = noisy_from_clean(np.random.default_rng(0), _flat(0.1), 50, level)
    assert (noisy.mosaic - 0.1).var() == pytest.approx(1e-5 + 1 / 12 / 959**2, rel=0.02)


def test_clean_levels_round_64_times_finer():
    raw = _flat(0.123456, side=4)
    fine = clean_levels(raw)
    assert (fine.black_level, fine.white_level) == (4096, 65472)
    assert np.max(np.abs(quantise(fine).mosaic - raw.mosaic)) <= 0.5001 / (64 * 959)
    with pytest.raises(FsidError, match="black level -1 is below 0"):
        clean_levels(replace(raw, black_level=-1, white_level=1))


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"mosaic": [[0.1, 0.2], [0.3, 0.4]]}, "the mosaic is a list"),
        ({"mosaic": np.zeros((4, 4), np.uint16)}, "the mosaic holds uint16"),
        ({"cfa": "rggb"}, "'rggb' is not a Bayer pattern"),
        ({"black_level": 0, "white_level": 0}, "black level 0 is not below white level 0"),
        ({"black_level": (64, 65, 64, 64)}, "raw_from_dn"),
        ({"black_level": np.full(4, 64)}, "raw_from_dn"),
        ({"white_balance": (0.0, 1.0, 1.5)}, "three finite gains"),
        ({"white_balance": None}, "three finite gains"),
        ({"xyz_to_camera": np.zeros((1, 3, 3))}, r"xyz_to_camera has shape \(1, 3, 3\)"),
    ],
)
def test_what_makes_no_raw_is_named_where_it_is_made(wrong, named):
    with pytest.raises(FsidError, match=named):
        replace(_flat(0.1), **wrong)


@pytest.mark.parametrize("kind", [np.uint16, np.int16, np.uint32])
def test_levels_of_an_arrays_type_mean_what_they_say(kind: type):
    """As `mosaic.max()` gives them: 959 * 959 does not fit into 16 bits, nor does twice 64 * 1023."""
    raw = _flat(0.123456, side=4)
    typed = replace(raw, black_level=kind(64), white_level=kind(1023))
    level = NoiseLevel(k=(1e-4,) * 4, sigma2=(1e-6,) * 4)
    noisy, expected = (noisy_from_clean(np.random.default_rng(0), r, 50, level) for r in (typed, raw))
    np.testing.assert_array_equal(noisy.mosaic, expected.mosaic)
    assert (clean_levels(typed).black_level, clean_levels(typed).white_level) == (4096, 65472)


def test_equal_levels_are_no_scale():
    with pytest.raises(FsidError, match="black level 64 is not below white level 64"):
        from_dn(np.full((2, 2), 64, np.uint16), 64, 64)


def test_level_rand_is_log_uniform_in_iso_and_scatters_around_the_profile():
    profile = load_profile("pixel6")
    rng = np.random.default_rng(0)
    draws = [level_rand(rng, profile, (400, 6400)) for _ in range(1000)]
    log_iso = np.log2([iso for iso, _ in draws])
    # Uniform over 4 stops: mean at the middle, variance 16 / 12.
    assert abs(log_iso.mean() - np.log2(1600)) < 4.5 * np.sqrt(16 / 12 / 1000)
    assert np.var(log_iso) == pytest.approx(16 / 12, rel=0.15)
    assert log_iso.min() >= np.log2(400)
    assert log_iso.max() <= np.log2(6400)
    k_factor = np.log([level.k[0] / profile.level(iso).k[0] for iso, level in draws])
    sigma2_factor = np.log([level.sigma2[3] / profile.level(iso).sigma2[3] for iso, level in draws])
    assert np.std(k_factor) == pytest.approx(0.05, rel=0.1)
    assert np.std(sigma2_factor) == pytest.approx(0.2, rel=0.1)
    assert abs(np.corrcoef(k_factor, sigma2_factor)[0, 1]) < 0.15


def test_no_unit_of_a_camera_is_without_rounding():
    """At low ISO a fifth less than sigma2 would be less than integers have, and the level no variance."""
    profile, rng = load_profile("pixel6"), np.random.default_rng(0)
    lowest = min(min(level_rand(rng, profile, (50, 100))[1].sigma2) for _ in range(200))
    assert lowest * profile.span**2 == pytest.approx(1 / 12)


@pytest.mark.parametrize("iso_range", [(0, 100), (800, 400), (-5, 5)])
def test_level_rand_refuses_a_range_without_iso(iso_range):
    with pytest.raises(FsidError, match="iso_range"):
        level_rand(np.random.default_rng(0), load_profile("pixel6"), iso_range)


def test_nan_is_refused():
    with pytest.raises(FsidError, match="NaN"):
        to_dn(_flat(float("nan"), side=4))


def test_levels_that_no_camera_has_are_refused():
    raw = Raw(
        np.zeros((2, 2), np.float32), "RGGB", 64, 100_000, (1.0, 1.0, 1.0), np.eye(3), camera="too fine"
    )
    with pytest.raises(FsidError, match="too fine"):
        to_dn(raw)


def test_noise_in_dn_is_told_from_normalised_noise():
    """Lines of `fit_noise` are in DN; injected as they are, they would drown the image."""
    level = NoiseLevel(k=(4.4,) * 4, sigma2=(0.6,) * 4)
    clean = Raw(np.full((16, 16), 0.5, np.float32), "RGGB", 64, 1023, (2.0, 1.0, 1.6), np.eye(3))
    with pytest.raises(FsidError, match="divide k in DN by white - black"):
        noisy_from_clean(np.random.default_rng(0), clean, 800, level)
    with pytest.raises(FsidError, match="clean signal must be floating-point"):
        variance(np.full((16, 16), 500, np.uint16), NoiseLevel((0.01,) * 4, (1e-5,) * 4), "RGGB")
