"""Each term beyond the paper's model keeps its law, leaves the others alone, and is found by calibration."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2 as chi2_law
from scipy.stats import poisson as distribution

from fsid.errors import FsidError
from fsid.sensor import (
    Layout,
    NoiseLevel,
    NoiseTerms,
    Raw,
    TemporalStatistics,
    add_noise_terms,
    calibrate,
    load_profile,
    noisy_from_clean,
    save_profile,
    to_dn,
    write_dng,
)
from fsid.sensor.metadata import exposure_metadata
from fsid.sensor.mosaic import pack, unpack
from fsid.sensor.poisson import poisson
from fsid.sensor.terms_fit import dark_finding, prnu_of

LEVEL = NoiseLevel(k=(2e-3, 2e-3, 2e-3, 2e-3), sigma2=(4e-5, 4e-5, 4e-5, 4e-5))
SIDE, FRAMES = 128, 40


def flat(x: float, side: int = SIDE) -> Raw:
    return Raw(np.full((side, side), x, np.float32), "RGGB", 64, 1023, (2.0, 1.0, 1.5), np.eye(3))


def stack(terms: NoiseTerms, x: float = 0.0, frames: int = FRAMES, **options) -> np.ndarray:
    """(frames, H, W) float64 noise."""
    rng = np.random.default_rng(0)
    noisy = [add_noise_terms(rng, flat(x), LEVEL, terms, **options).mosaic for _ in range(frames)]
    return np.array(noisy, np.float64) - x


@pytest.mark.parametrize(
    "terms",
    [
        NoiseTerms(),
        NoiseTerms(poisson=True),
        NoiseTerms(row=0.2, column=0.1),
        NoiseTerms(tail=1.0),
        NoiseTerms(fixed=0.5, prnu=0.02),
    ],
)
@pytest.mark.parametrize("x", [0.0, 0.01, 0.5])
def test_the_variance_over_time_stays_the_line(terms, x):
    noise = stack(terms, x)
    expected = LEVEL.k[0] * x + LEVEL.sigma2[0]
    # Rows and columns have few independent numbers: 128 x 40 of each.
    assert noise.var(axis=0, ddof=1).mean() == pytest.approx(expected, rel=0.02)
    assert abs(noise.mean()) < 4.5 * np.sqrt(expected * 0.3 / (SIDE * FRAMES)) + 4.5 * 0.5 * 6.3e-3 / SIDE


def test_banding_is_common_to_rows_and_columns():
    noise = stack(NoiseTerms(row=0.2, column=0.1))
    noise -= noise.mean(axis=(1, 2), keepdims=True)
    left = 0.7 * LEVEL.sigma2[0] / SIDE
    assert noise.mean(axis=2).var() - left == pytest.approx(0.2 * LEVEL.sigma2[0], rel=0.1)
    assert noise.mean(axis=1).var() - left == pytest.approx(0.1 * LEVEL.sigma2[0], rel=0.1)


@pytest.mark.parametrize("row", [0.0, 0.5])
@pytest.mark.parametrize("frames", [2, 10])
def test_the_kurtosis_of_gaussian_noise_scatters_by_its_standard_error(frames, row):
    found = []
    for seed in range(40):
        rng, stats = np.random.default_rng(seed), TemporalStatistics(4095, dark=True)
        for _ in range(frames):
            pixels, rows = rng.standard_normal((64, 64)), rng.standard_normal((64, 1))
            noise = (1 - row) ** 0.5 * pixels + row**0.5 * rows
            stats.add(np.rint(256 + 2 * noise).astype(np.uint16))
        found.append(stats.read_statistics())
    scatter = np.std([each.excess_kurtosis for each in found])
    assert scatter == pytest.approx(np.mean([each.kurtosis_error for each in found]), rel=0.35)


@pytest.mark.parametrize("seed", range(40))
def test_gaussian_dark_frames_show_no_term(seed):
    """In 7 of them the tail of ten frames was beyond 2 %, by chance."""
    rng, stats = np.random.default_rng(seed), TemporalStatistics(4095, dark=True)
    for _ in range(10):
        stats.add(np.rint(256 + 6 * rng.standard_normal((128, 128))).astype(np.uint16))
    finding = dark_finding(stats, 800, 0.02)
    assert finding is not None
    assert finding.terms == NoiseTerms()


def test_fixed_pattern_and_prnu_belong_to_the_unit():
    terms, sigma = NoiseTerms(fixed=0.5, prnu=0.02), np.sqrt(LEVEL.sigma2[0])
    dark, bright = stack(terms).mean(axis=0), stack(terms, 0.5).mean(axis=0)
    assert dark.var() == pytest.approx((0.25 + 1 / FRAMES) * sigma**2, rel=0.05)
    gain = bright - dark
    assert gain.var() == pytest.approx((0.02 * 0.5) ** 2 + (2 * sigma**2 + 1e-3) / FRAMES, rel=0.05)
    other = stack(terms, unit=1).mean(axis=0)
    shared = 1 / FRAMES / (0.25 + 1 / FRAMES)  # the noise that is left in both means, of one seed
    assert np.corrcoef(dark.ravel(), other.ravel())[0, 1] == pytest.approx(shared, abs=0.05)


def test_tail_drift_dark_current_and_defects():
    noise = stack(NoiseTerms(tail=1.0)) / np.sqrt(LEVEL.sigma2[0])
    assert np.mean(noise**4) - 3 == pytest.approx(1.0, rel=0.25)
    levels = stack(NoiseTerms(drift=0.5), frames=200).mean(axis=(1, 2))
    assert levels.std() == pytest.approx(0.5 * np.sqrt(LEVEL.sigma2[0]), rel=0.2)
    charged = stack(NoiseTerms(dark_current_e_s=10.0), exposure_s=2.0)
    assert charged.mean() == pytest.approx(20 * LEVEL.k[0], rel=0.01)
    assert charged.var() == pytest.approx(20 * LEVEL.k[0] ** 2 + LEVEL.sigma2[0], rel=0.02)
    broken = np.abs(stack(NoiseTerms(defective=0.01)).mean(axis=0)) > 0.01
    assert broken.mean() == pytest.approx(0.01, rel=0.2)


def test_a_few_electrons_come_in_integers():
    terms = NoiseTerms(poisson=True)
    still = replace(flat(0.004), noise=None)
    level = NoiseLevel(LEVEL.k, (0.0,) * 4)
    counts = add_noise_terms(np.random.default_rng(0), still, level, terms).mosaic / LEVEL.k[0]
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-5)
    share_of_none = np.mean(counts == 0)
    assert share_of_none == pytest.approx(np.exp(-2.0), abs=4.5 * np.sqrt(0.135 / counts.size))


@pytest.mark.parametrize("lam", [0.0, 0.3, 4.0, 9.9, 10.0, 12.0, 30.0, 500.0])
def test_counts_have_the_moments_of_poisson(lam):
    n = 400_000
    counts = poisson(np.random.default_rng(1), np.full((n,), lam, np.float32)).astype(np.float64)
    assert np.all(counts == np.rint(counts))
    assert counts.min() >= 0
    assert abs(counts.mean() - lam) <= 4.5 * np.sqrt(lam / n)
    assert abs(counts.var() - lam) <= 4.5 * np.sqrt((lam + 2 * lam**2) / n) + 0.001 * lam
    third = np.mean((counts - lam) ** 3)
    assert abs(third - lam) <= 4.5 * np.sqrt(15 * (lam + lam**3) / n) + 0.03 * lam


@pytest.mark.parametrize("lam", [0.02, 0.5, 3.337, 9.99])
def test_few_electrons_are_distributed_as_poisson_says(lam):
    n = 500_000
    counts = poisson(np.random.default_rng(3), np.full(n, lam, np.float32)).astype(int)
    expected = n * distribution.pmf(np.arange(64), lam)
    found = np.bincount(counts, minlength=64)
    usual = expected > 10
    rest = expected[~usual].sum()
    chi2 = np.sum((found - expected)[usual] ** 2 / expected[usual]) + (found[~usual].sum() - rest) ** 2 / rest
    assert chi2_law.sf(chi2, usual.sum()) > 1e-4


def test_a_mixture_of_few_and_many_electrons_keeps_its_places():
    lam = np.array([[0.0, 1000.0], [5.0, 1e5]], np.float32).repeat(500, 0)
    counts = poisson(np.random.default_rng(0), lam)
    np.testing.assert_allclose(counts[:500].mean(axis=0), [0, 1000], rtol=0.01)
    np.testing.assert_allclose(counts[500:].mean(axis=0), [5, 1e5], rtol=0.1)


def test_the_default_is_the_papers_model():
    profile = load_profile("pixel6")
    assert profile.terms == NoiseTerms()
    draws = [
        noisy_from_clean(np.random.default_rng(4), flat(0.1), 800, profile.level(800), *terms).mosaic
        for terms in ((), (profile.terms,))
    ]
    np.testing.assert_array_equal(*draws)
    unrounded = noisy_from_clean(
        np.random.default_rng(4), flat(0.1), 800, LEVEL, NoiseTerms(quantisation=False)
    ).mosaic
    assert np.any(np.abs(unrounded * 959 - np.rint(unrounded * 959)) > 0.1)


@pytest.mark.parametrize(
    "terms", [{"row": 0.8, "column": 0.8}, {"tail": -1.0}, {"defective": 2.0}, {"prnu": np.nan}]
)
def test_terms_that_no_sensor_has_are_refused(terms):
    """Noise of a share above 1 was NaN everywhere, and the profile that holds it could not be read again."""
    with pytest.raises(FsidError, match=next(iter(terms))):
        NoiseTerms(**terms)


def test_switching_one_term_leaves_the_others_noise():
    plain, banded = stack(NoiseTerms(), 0.3, 1), stack(NoiseTerms(row=0.0001), 0.3, 1)
    assert np.max(np.abs(plain - banded)) < 1e-3


@pytest.mark.parametrize("terms", [NoiseTerms(), NoiseTerms(row=0.1)])
def test_noise_goes_by_the_state_of_the_generator_and_not_by_its_seed(terms):
    """Streams of one seed, far apart, had the same noise; a state that was saved and restored had another."""

    def noise(rng: np.random.Generator) -> np.ndarray:
        return add_noise_terms(rng, flat(0.1, 16), LEVEL, terms).mosaic

    def far() -> np.random.Generator:
        return np.random.Generator(np.random.PCG64(3).advance(10**12))

    rng = far()
    state = rng.bit_generator.state
    assert not np.array_equal(noise(np.random.default_rng(3)), noise(far()))
    first = noise(rng)
    rng.bit_generator.state = state
    assert np.array_equal(first, noise(rng))


def test_terms_survive_the_file_and_unknown_ones_are_named(tmp_path):
    profile = replace(load_profile("pixel6"), terms=NoiseTerms(poisson=True, row=0.05))
    save_profile(tmp_path / "p.yaml", profile)
    assert load_profile(tmp_path / "p.yaml").terms == profile.terms
    text = (tmp_path / "p.yaml").read_text()
    for old, new, words in (
        ("row: 0.05", "roww: 0.05", "roww"),
        ("row: 0.05", "row: -1", "row"),
        ("row: 0.05", "row: 1.5", "shares"),
        ("poisson: true", "poisson: 3", "true or false"),
    ):
        (tmp_path / "bad.yaml").write_text(text.replace(old, new))
        with pytest.raises(FsidError, match=rf"bad\.yaml.*{words}"):
            load_profile(tmp_path / "bad.yaml")


def test_calibration_finds_the_terms_again(tmp_path):
    terms = NoiseTerms(row=0.1, column=0.05, tail=1.0, fixed=0.4, prnu=0.01, defective=0.002)
    rng, level = np.random.default_rng(3), NoiseLevel(LEVEL.k, (1e-4,) * 4)
    paths = {}
    for kind, x, count in (("light", 0.5, 60), ("dark", 0.0, 60)):
        (tmp_path / kind).mkdir()
        paths[kind] = tmp_path / kind
        for number in range(count):
            noisy = noisy_from_clean(rng, flat(x, 192), 800, level, terms)
            np.save(tmp_path / kind / f"{number:03d}.npy", to_dn(noisy))
    layout = Layout(iso=800, cfa="RGGB", white_level=1023)
    found = calibrate([paths["light"]], name="p", dark=[paths["dark"]], layout=layout, terms=True)
    measured = found.profile.terms
    for name, rtol in (("row", 0.25), ("column", 0.25), ("fixed", 0.1), ("prnu", 0.15), ("defective", 0.3)):
        assert getattr(measured, name) == pytest.approx(getattr(terms, name), rel=rtol), name
    assert measured.tail == pytest.approx(terms.tail, rel=0.25)
    np.testing.assert_allclose(found.profile.sigma2[0], 1e-4, rtol=0.05)


def test_calibration_finds_dark_current_and_drift_again(tmp_path, rng):
    """Dark frames of two exposure times; the black level wanders by half the read noise."""
    terms, level = NoiseTerms(drift=0.5, dark_current_e_s=10.0), NoiseLevel(LEVEL.k, (1e-4,) * 4)
    ramp = flat(0.0, 96)
    ramp.mosaic[:] = np.linspace(0, 0.8, 96, dtype=np.float32)
    groups = {"light": (ramp, 0.02), "short": (flat(0.0, 96), 0.02), "long": (flat(0.0, 96), 2.0)}
    for name, (clean, exposure_s) in groups.items():
        (tmp_path / name).mkdir()
        stated = replace(clean, metadata=exposure_metadata(exposure_s), camera="Maker Model")
        for number in range(60):
            noisy = noisy_from_clean(rng, stated, 800, level, terms, exposure_s=exposure_s)
            write_dng(tmp_path / name / f"{number:03d}.dng", noisy)
    found = calibrate(
        [tmp_path / "light"], name="p", dark=[tmp_path / "short", tmp_path / "long"], terms=True
    )
    measured = found.profile.terms
    assert measured.dark_current_e_s == pytest.approx(10.0, rel=0.05)
    assert measured.drift == pytest.approx(0.5, rel=0.3)
    assert any("drifted" in note for note in found.notes)
    np.testing.assert_allclose(found.profile.k[0], level.k, rtol=0.03)
    np.testing.assert_allclose(found.profile.sigma2[0], level.sigma2, rtol=0.03)
    assert (measured.row, measured.column, measured.poisson) == (0.0, 0.0, False)


def test_terms_are_those_of_short_dark_frames(tmp_path, rng):
    """Banding is told in parts of the read noise; the shot noise of dark current must not shrink it."""
    terms, level = NoiseTerms(row=0.15, dark_current_e_s=20.0), NoiseLevel(LEVEL.k, (1e-4,) * 4)
    ramp = flat(0.0, 96)
    ramp.mosaic[:] = np.linspace(0, 0.8, 96, dtype=np.float32)
    for name, clean, exposure_s in (
        ("light", ramp, 0.02),
        ("a", flat(0.0, 96), 1.0),
        ("b", flat(0.0, 96), 0.02),
    ):
        (tmp_path / name).mkdir()
        stated = replace(clean, metadata=exposure_metadata(exposure_s), camera="Maker Model")
        for number in range(30):
            noisy = noisy_from_clean(rng, stated, 800, level, terms, exposure_s=exposure_s)
            write_dng(tmp_path / name / f"{number:03d}.dng", noisy)
    found = calibrate([tmp_path / "light"], name="p", dark=[tmp_path / "a", tmp_path / "b"], terms=True)
    assert found.profile.terms.row == pytest.approx(0.15, rel=0.2)


def _dark_and_flat(rng, level, terms, light, frames=30, side=128):
    """Statistics of dark frames and of a grey card, whose sites R, Gr, Gb, B have these signals."""
    sites = np.broadcast_to(np.float32(light)[:, None, None], (4, side // 2, side // 2))
    card = replace(flat(0.0, side), mosaic=unpack(sites, "RGGB"))
    dark, lit = TemporalStatistics(1023, dark=True), TemporalStatistics(1023)
    for _ in range(frames):
        for stats, clean in ((dark, flat(0.0, side)), (lit, card)):
            stats.add(to_dn(noisy_from_clean(rng, clean, 800, level, terms)))
    return dark, lit


def test_sites_of_different_noise_make_no_tail(rng):
    """One kurtosis for four normal distributions of these variances would be 3."""
    level = NoiseLevel(LEVEL.k, (4e-5, 1e-5, 1e-5, 6e-5))
    for tail in (0.0, 0.8):
        dark, _ = _dark_and_flat(rng, level, NoiseTerms(tail=tail), (0.1,) * 4)
        assert dark_finding(dark, 800, 0.01).terms.tail == pytest.approx(tail, abs=0.1)


def _found_again(terms, level, seeds, side):
    """What calibration finds of `terms` in six dark frames, for each seed."""
    found = []
    for seed in range(seeds):
        stats, rng = TemporalStatistics(1023, dark=True), np.random.default_rng([seed, 5])
        for _ in range(6):
            stats.add(to_dn(noisy_from_clean(rng, flat(0.0, side), 800, level, terms)))
        found.append(dark_finding(stats, 800, 0.01).terms)
    return found


@pytest.mark.parametrize("sigma2", [4e-5, 1.2e-6])
def test_calibration_finds_the_terms_that_simulation_had(sigma2):
    """The tail is that of what pixels have by themselves, also where rounding is 8 % of the noise."""
    terms = NoiseTerms(row=0.25, column=0.05, tail=1.0, fixed=0.4)
    found = _found_again(terms, NoiseLevel(LEVEL.k, (sigma2,) * 4), seeds=12, side=160)
    for name in ("row", "column", "tail", "fixed"):
        mean = np.mean([getattr(terms, name) for terms in found])
        assert mean == pytest.approx(getattr(terms, name), rel=0.1), name


def test_drift_of_short_bursts_is_found_on_the_mean():
    """In units of the mean sigma of sites that differ, as it is drawn."""
    level = NoiseLevel(LEVEL.k, (4e-5, 1e-5, 1e-5, 6e-5))
    found = _found_again(NoiseTerms(drift=0.7), level, seeds=100, side=48)
    assert np.mean([terms.drift**2 for terms in found]) == pytest.approx(0.7**2, rel=0.15)


def test_banding_keeps_the_variance_of_every_site_and_is_found_again(rng):
    """Common offsets of one size gave the sites of less noise more than is stated, and the others less."""
    terms = NoiseTerms(row=0.2, column=0.1, quantisation=False)
    level = NoiseLevel(LEVEL.k, (4e-5, 1e-5, 1e-5, 6e-5))
    noisy = [pack(noisy_from_clean(rng, flat(0.0), 800, level, terms).mosaic, "RGGB") for _ in range(FRAMES)]
    measured = np.var(noisy, axis=0, ddof=1).mean(axis=(1, 2))
    np.testing.assert_allclose(measured, level.sigma2, rtol=0.03)
    dark, _ = _dark_and_flat(rng, level, terms, (0.1,) * 4)
    found = dark_finding(dark, 800, 0.01).terms
    # of 30 frames the standard errors are 5 and 7 %
    assert (found.row, found.column) == (pytest.approx(0.2, rel=0.15), pytest.approx(0.1, rel=0.2))


@pytest.mark.parametrize("share", [0.0, 0.002])
def test_dark_shading_is_no_defect_and_hot_pixels_in_it_are(rng, share):
    """From corner to corner 12 DN, ten times the noise; the sites' black levels differ by 20 DN."""
    side, stats = 256, TemporalStatistics(1023, dark=True)
    level = 64 + 12 * np.linspace(0, 1, side) ** 4 + np.linspace(0, 4, side)[:, None]
    level[1::2, ::2] += 20
    level[rng.random(level.shape) < share] += 100
    for _ in range(20):
        stats.add(np.rint(level + 1.2 * rng.normal(size=level.shape)).astype(np.uint16))
    found = dark_finding(stats, 400, 0.1)
    assert found.terms.defective == np.mean(level > 150)
    assert found.terms.fixed == 0


def test_hot_pixels_make_no_tail(rng):
    """Their current has shot noise, many times that of a pixel in the dark; `defective` has them already."""
    hot = np.where(rng.random((160, 160)) < 0.002, rng.exponential(300, (160, 160)), 0)
    stats = TemporalStatistics(4095, dark=True)
    for _ in range(20):
        stats.add(np.rint(256 + 3 * rng.normal(size=hot.shape) + rng.poisson(hot)).astype(np.int64))
    found = dark_finding(stats, 400, 0.1)
    assert found is not None
    assert found.terms.tail < 0.1
    assert found.terms.defective == pytest.approx((hot > 0).mean(), rel=0.2)


@pytest.mark.parametrize("sigma_dn", [0.8, 1.0])
def test_means_of_few_integers_show_no_fixed_pattern(rng, sigma_dn):
    """Their steps are multiples of 0.1 DN; the median of those of 0.36 DN is 0.3 or 0.4."""
    stats = TemporalStatistics(1023, dark=True)
    for _ in range(10):
        stats.add(np.rint(64.3 + sigma_dn * rng.normal(size=(256, 256))).astype(np.uint16))
    assert dark_finding(stats, 400, 0.1).terms.fixed == 0


@pytest.mark.parametrize("light", [(0.2, 0.4, 0.4, 0.3), (0.4, 0.15, 0.15, 0.25)])
@pytest.mark.parametrize("side", [128, 144])
def test_the_gain_pattern_of_a_grey_card_is_found_though_its_sites_differ(rng, light, side):
    """Set against the mean signal, the median of all steps made it a sixth too weak."""
    level = NoiseLevel((3e-4,) * 4, (2e-6,) * 4)
    for prnu in (0.008, 0.0):
        _, lit = _dark_and_flat(rng, level, NoiseTerms(prnu=prnu), light, side=side)
        assert prnu_of(lit, 64.0, 0.0) == pytest.approx(prnu, rel=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_a_camera_without_them_gets_no_terms(seed, tmp_path):
    rng = np.random.default_rng(seed)
    for kind, x in (("light", 0.5), ("dark", 0.0)):
        (tmp_path / kind).mkdir()
        for number in range(20):
            noisy = noisy_from_clean(rng, flat(x, 96), 800, LEVEL)
            np.save(tmp_path / kind / f"{number:03d}.npy", to_dn(noisy))
    layout = Layout(iso=800, cfa="RGGB", white_level=1023)
    found = calibrate([tmp_path / "light"], name="p", dark=[tmp_path / "dark"], layout=layout, terms=True)
    assert replace(found.profile.terms, prnu=0.0) == NoiseTerms()
    assert found.profile.terms.prnu < 0.003


def test_values_below_black_stay_below_it():
    noise = stack(NoiseTerms(), x=-0.05, frames=1)
    assert noise.mean() == pytest.approx(0, abs=5e-4)


@pytest.mark.parametrize("poisson", [False, True])
def test_a_pixel_without_gain_has_read_noise_alone(poisson):
    """A third of them, where a gain pattern of more than 1 (as one is, in percent) is asked for."""
    noisy = stack(NoiseTerms(prnu=2.3, poisson=poisson), x=0.5, frames=8) + 0.5
    dead = noisy.mean(axis=0) < 0.02
    assert np.isfinite(noisy).all()
    assert dead.mean() == pytest.approx(1 / 3, abs=0.02)
    assert noisy.var(axis=0, ddof=1)[dead].mean() == pytest.approx(LEVEL.sigma2[0], rel=0.1)


def test_each_unit_has_defects_of_its_own_and_keeps_them():
    level, terms = NoiseLevel(k=(1e-12,) * 4, sigma2=(1e-12,) * 4), NoiseTerms(defective=0.1)
    exposures = [
        add_noise_terms(np.random.default_rng(seed), flat(0.5), level, terms, unit=unit).mosaic
        for seed, unit in ((0, 0), (1, 0), (0, 1))
    ]
    first, again, other = (np.abs(mosaic - 0.5) > 1e-3 for mosaic in exposures)
    np.testing.assert_array_equal(first, again)
    assert np.mean(first & other) == pytest.approx(0.01, abs=0.003)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"exposure_s": -1.0}, "exposure_s -1.0"),
        ({"exposure_s": np.nan}, "exposure_s nan"),
        ({"unit": -1}, "unit -1"),
    ],
)
def test_a_time_and_a_unit_are_not_negative(options, named):
    """Dark current of a time below 0 took away the light that there was."""
    with pytest.raises(FsidError, match=named):
        stack(NoiseTerms(dark_current_e_s=30.0), x=0.05, frames=1, **options)
