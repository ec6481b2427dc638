"""Calibration finds the noise that was put in, and the figures of the EMVA 1288 reference sets."""

from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from fsid.errors import FsidError
from fsid.sensor import (
    NoiseTerms,
    Raw,
    TemporalStatistics,
    add_noise_terms,
    fit_noise,
    load_profile,
    noisy_from_clean,
    profile_names,
    profile_of,
    save_profile,
    to_dn,
    unpack,
)
from fsid.sensor.calibrate import departure

PROFILE = load_profile("pixel6")


def _gradient(side: int = 160) -> Raw:
    ramp = np.linspace(0, 0.9, side, dtype=np.float32)
    mosaic = np.broadcast_to(ramp, (side, side))
    return Raw(mosaic, PROFILE.cfa, 64, 1023, (2.0, 1.0, 1.6), PROFILE.xyz_to_camera[0])


def _burst(clean, iso, frames, rng, flicker_dn=0.0, terms=NoiseTerms()):
    level = PROFILE.level(iso)
    stats = TemporalStatistics(white_level=1023)
    for _ in range(frames):
        dn = to_dn(noisy_from_clean(rng, clean, iso, level, terms)).astype(np.int64)
        stats.add(dn + int(rng.integers(-flicker_dn, flicker_dn + 1)))
    return stats


@pytest.mark.parametrize("iso", [800, 3200, 6400])
@pytest.mark.parametrize("flicker_dn", [0, 3])
def test_the_line_of_a_simulated_burst_is_found_within_its_error(iso, flicker_dn):
    stats = _burst(_gradient(), iso, 50, np.random.default_rng(iso), flicker_dn)
    fit = fit_noise([stats], cfa=PROFILE.cfa, white_level=1023, black_level=64)
    level = PROFILE.level(iso)
    k_dn = np.array(level.k) * PROFILE.span
    sigma2_dn = np.array(level.sigma2) * PROFILE.span**2
    np.testing.assert_allclose(fit.k_dn, k_dn, rtol=0.02)
    assert np.all(np.abs(fit.k_dn - k_dn) < 4.5 * fit.k_dn_error)
    assert np.all(np.abs(fit.sigma2_dn - sigma2_dn) < 4.5 * fit.sigma2_dn_error)


def test_black_levels_of_sites_are_those_of_r_gr_gb_b():
    black = (60, 66, 70, 75)
    above = unpack(np.broadcast_to(np.reshape(black, (4, 1, 1)), (4, 80, 80)), PROFILE.cfa) - 64
    rng, level = np.random.default_rng(2), PROFILE.level(800)
    stats = TemporalStatistics(white_level=1023)
    for _ in range(20):
        frame = to_dn(noisy_from_clean(rng, _gradient(), 800, level)).astype(np.int64) + above
        stats.add(frame.tolist())  # whatever holds whole numbers
    fit = fit_noise([stats], cfa=PROFILE.cfa, white_level=1023, black_level=black)
    np.testing.assert_array_equal(fit.black, black)
    np.testing.assert_allclose(fit.k_dn, np.array(level.k) * PROFILE.span, rtol=0.04)
    assert np.all(np.abs(fit.sigma2_dn / PROFILE.span**2 - level.sigma2) < 4.5 * fit.sigma2_dn_error)


def test_dark_frames_give_black_and_read_noise():
    rng = np.random.default_rng(0)
    dark_scene = Raw(np.zeros((160, 160), np.float32), PROFILE.cfa, 64, 1023, (1, 1, 1), np.eye(3))
    dark = _burst(dark_scene, 3200, 50, rng)
    fit = fit_noise([_burst(_gradient(), 3200, 20, rng)], cfa=PROFILE.cfa, white_level=1023, dark=dark)
    sigma2_dn = np.array(PROFILE.level(3200).sigma2) * PROFILE.span**2
    np.testing.assert_allclose(fit.black, 64, atol=0.05)
    np.testing.assert_allclose(fit.sigma2_dn, sigma2_dn, rtol=0.03)


@pytest.mark.parametrize("terms", [NoiseTerms(), NoiseTerms(row=0.3), NoiseTerms(column=0.3)])
def test_stated_errors_of_sigma2_are_its_scatter_with_banding_too(terms):
    """The pixels of a row that share its noise are fewer samples than there are pixels."""
    level, scene = PROFILE.level(3200), _gradient(128)
    black = Raw(np.zeros((128, 128), np.float32), PROFILE.cfa, 64, 1023, (1, 1, 1), np.eye(3))
    lit = _burst(scene, 3200, 12, np.random.default_rng(0))
    found, stated = [], []
    for seed in range(24):
        rng, dark = np.random.default_rng(seed), TemporalStatistics(white_level=1023)
        for _ in range(12):
            dark.add(to_dn(add_noise_terms(rng, black, level, terms)))
        fit = fit_noise([lit], cfa=PROFILE.cfa, white_level=1023, dark=dark)
        found.append(fit.sigma2_dn)
        stated.append(fit.sigma2_dn_error)
    scatter = np.var(found, axis=0, ddof=1).mean()
    assert 0.8 < np.sqrt(np.mean(np.square(stated)) / scatter) < 1.3


@pytest.mark.parametrize("frames", [6, 12])
def test_dim_bursts_without_dark_frames_are_unbiased(frames):
    """Pixels are pooled by their noisy means, which takes k and gives to sigma2: in shot noise, which is
    skewed, by less than in a normal distribution (`Samples.signal_by`)."""
    scene, level, found = _gradient(128), PROFILE.level(3200), []
    dim = replace(scene, mosaic=scene.mosaic * np.float32(0.1))
    for seed in range(6):
        burst = _burst(dim, 3200, frames, np.random.default_rng(seed), terms=NoiseTerms(poisson=True))
        fit = fit_noise([burst], cfa=PROFILE.cfa, white_level=1023, black_level=64)
        found.append((fit.k_dn.mean() / PROFILE.span, fit.sigma2_dn.mean() / PROFILE.span**2))
    k, sigma2 = np.mean(found, axis=0) / [np.mean(level.k), np.mean(level.sigma2)] - 1
    assert abs(k) < 0.006
    assert abs(sigma2) < 0.035


def test_few_frames_of_dim_shot_noise_lie_on_their_line():
    """As if it were normal, k was 1.5 % too large, with errors twice as large, and pools off the line."""
    clean = _gradient(240)
    dim = replace(clean, mosaic=clean.mosaic * np.float32(0.05))
    black = replace(clean, mosaic=clean.mosaic * 0)
    shot, level, found, crooked = NoiseTerms(poisson=True), PROFILE.level(3200), [], []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        lit, dark = (_burst(scene, 3200, 4, rng, terms=shot) for scene in (dim, black))
        fit = fit_noise([lit], cfa=PROFILE.cfa, white_level=1023, dark=dark)
        crooked.append(departure(fit))
        found.append((fit.k_dn / (np.array(level.k) * PROFILE.span) - 1, fit.k_dn_error / fit.k_dn))
    off, stated = np.moveaxis(found, 1, 0)
    assert np.mean(crooked) < 0.01
    assert abs(off.mean()) < 0.006
    assert 0.6 < np.sqrt(np.mean((off / stated) ** 2)) < 1.4


def test_hot_pixels_of_the_dark_frames_are_left_out_of_the_lit_ones_too():
    """In even light, of pixels that differ by 1 %, they made a pool of their own far from the line."""
    shape, terms = (256, 384), NoiseTerms(poisson=True, prnu=0.01)
    hot = np.random.default_rng(9).random(shape) < 1e-3
    flat = Raw(np.full(shape, 0.3, np.float32), PROFILE.cfa, 64, 1023, (1, 1, 1), np.eye(3))
    found = []
    for light in (0, 0.5, 1):
        scene = replace(flat, mosaic=flat.mosaic * np.float32(light))
        stats = TemporalStatistics(white_level=1023)
        rng = np.random.default_rng(int(10 * light))
        for _ in range(20):
            dn = to_dn(noisy_from_clean(rng, scene, 800, PROFILE.level(800), terms))
            stats.add(np.minimum(dn + np.where(hot, 300, 0), 1023))
        found.append(stats)
    dark, *lit = found
    fit = fit_noise(lit, cfa=PROFILE.cfa, white_level=1023, dark=dark)
    np.testing.assert_allclose(fit.k_dn, np.array(PROFILE.level(800).k) * PROFILE.span, rtol=0.01)
    assert np.all(fit.k_dn_error < 0.005 * fit.k_dn)
    assert departure(fit) == 0


def test_hot_pixels_do_not_lift_the_black_level():
    """One in a thousand that shows any value would lift it by half a DN; shading by 12 DN is no defect."""
    rng = np.random.default_rng(0)
    shape = (160, 160)
    scene = Raw(np.zeros(shape, np.float32), PROFILE.cfa, 64, 1023, (1, 1, 1), np.eye(3))
    hot, shading = rng.random(shape) < 1e-3, np.rint(12 * np.linspace(0, 1, shape[1]) ** 4).astype(np.int64)
    dark = TemporalStatistics(white_level=1023)
    for _ in range(20):
        dn = to_dn(noisy_from_clean(rng, scene, 3200, PROFILE.level(3200))) + shading
        dark.add(np.where(hot, 600, dn))
    fit = fit_noise([_burst(_gradient(), 3200, 20, rng)], cfa=PROFILE.cfa, white_level=1023, dark=dark)
    np.testing.assert_allclose(fit.black, 64 + shading.mean(), atol=0.15)


def test_lines_of_arrays_make_a_profile(tmp_path):
    rng = np.random.default_rng(7)
    dark_scene = Raw(np.zeros((96, 96), np.float32), PROFILE.cfa, 64, 1023, (1, 1, 1), np.eye(3))
    fits = {
        iso: fit_noise(
            [_burst(_gradient(96), iso, 20, rng)],
            cfa=PROFILE.cfa,
            white_level=1023,
            dark=_burst(dark_scene, iso, 20, rng),
        )
        for iso in (3200, 800)
    }
    made = profile_of(fits, name="mine", cfa=PROFILE.cfa, white_level=1023, frames={800: 20, 3200: 30})
    save_profile(tmp_path / "mine.yaml", made)
    again = load_profile(tmp_path / "mine.yaml")
    assert (again.iso, again.cfa, again.black_level, again.bits) == ((800, 3200), PROFILE.cfa, 64, 10)
    assert (again.measured.frames, again.measured.dark_frames) == ((20, 30), (0, 0))
    for iso in (800, 3200):
        np.testing.assert_allclose(again.level(iso).k, PROFILE.level(iso).k, rtol=0.05)
        np.testing.assert_allclose(again.level(iso).sigma2, PROFILE.level(iso).sigma2, rtol=0.1)
    mono = fit_noise([_burst(_gradient(96), 800, 20, rng)], cfa=None, white_level=1023, black_level=64)
    assert profile_of({800: mono}, name="m", cfa=None, white_level=1023, black_level=64).cfa == "MONO"
    for wrong, words in (({}, "needs fits by ISO"), ({0: mono}, "needs fits by ISO")):
        with pytest.raises(FsidError, match=words):
            profile_of(wrong, name="m", cfa=None, white_level=1023)
    with pytest.raises(FsidError, match="profile m"):
        profile_of({800: mono}, name="m", cfa=None, white_level=60)


def test_defective_and_clipped_pixels_do_not_count():
    rng = np.random.default_rng(1)
    stats = TemporalStatistics(white_level=1023)
    clean, level = _gradient(), PROFILE.level(3200)
    for frame in range(30):
        dn = to_dn(noisy_from_clean(rng, clean, 3200, level))
        dn[::20, ::7] = 300 + 200 * (frame % 2)  # telegraph noise
        dn[5, :] = 0
        stats.add(dn)
    fit = fit_noise([stats], cfa=PROFILE.cfa, white_level=1023, black_level=64)
    np.testing.assert_allclose(fit.k_dn, np.array(level.k) * PROFILE.span, rtol=0.03)


@pytest.mark.parametrize(("name", "k", "dark_std"), [("001", 0.28006, 3.0731), ("003", 0.09786, 3.0130)])
def test_emva_reference_sets(shared_data, name, k, dark_std):
    folder = shared_data / "emva1288" / name / "images"
    if not folder.is_dir():
        pytest.skip(f"{folder}: no EMVA 1288 reference set here")
    groups = defaultdict(lambda: TemporalStatistics(white_level=4095))
    for path in sorted(folder.glob("[bd]_[0-9]*.png")):
        groups["dark" if path.name[0] == "d" and "_000_" in path.name else path.name[:5]].add(
            np.asarray(Image.open(path))
        )
    flats = [stats for key, stats in groups.items() if key[0] == "b" and stats.frames > 1]
    dark = next(stats for key, stats in sorted(groups.items()) if key[0] == "d" and stats.frames > 1)
    fit = fit_noise(flats, cfa=None, white_level=4095, dark=dark)
    assert fit.k_dn[0] == pytest.approx(k, rel=0.011)  # three of its own standard errors
    assert np.sqrt(fit.sigma2_dn[0]) == pytest.approx(dark_std, rel=0.03)


@pytest.mark.parametrize("name", profile_names())
def test_a_profile_survives_its_file(tmp_path, name):
    profile = load_profile(name)
    save_profile(tmp_path / "copy.yaml", profile)
    copy = load_profile(tmp_path / "copy.yaml")
    for iso in (100, 1000, 6400):
        np.testing.assert_allclose(copy.level(iso).k, profile.level(iso).k, rtol=1e-5)
        np.testing.assert_allclose(copy.level(iso).sigma2, profile.level(iso).sigma2, rtol=1e-5)
    np.testing.assert_array_equal(copy.xyz_to_camera, profile.xyz_to_camera)
    assert (copy.source, copy.notes, copy.cfa) == (profile.source, profile.notes, profile.cfa)
    assert [p.name for p in tmp_path.iterdir()] == ["copy.yaml"]


def _frames(*images):
    stats = TemporalStatistics(white_level=1023)
    for image in images:
        stats.add(image)
    return stats


@pytest.mark.parametrize(
    ("bursts", "black", "words"),
    [
        ([_frames(np.full((4, 4), 100))], 64, "two frames"),
        ([TemporalStatistics(1023)], 64, "two frames"),
        ([], 64, "at least one burst"),
        ([_frames(np.full((4, 4), 100))], (64, 65), "2 black levels"),
        ([_frames(np.full((40, 40), 100), np.full((40, 40), 101))], 64, "light levels"),
        ([_frames(np.full((40, 40), 1023), np.full((40, 40), 1023))], 64, "light levels"),
        ([_frames(np.full((4, 4), 100), np.full((4, 4), 100))], None, "dark frames or the black"),
    ],
)
def test_a_burst_that_says_nothing_is_refused(bursts, black, words):
    with pytest.raises(FsidError, match=words):
        fit_noise(bursts, cfa="RGGB", white_level=1023, black_level=black)


def test_dark_frames_that_are_clipped_are_refused():
    dark = _frames(np.zeros((40, 40), np.uint16), np.zeros((40, 40), np.uint16))
    with pytest.raises(FsidError, match="dark frames"):
        fit_noise(
            [_burst(_gradient(), 3200, 2, np.random.default_rng(0))], cfa=None, white_level=1023, dark=dark
        )


def test_frames_of_different_size_are_refused():
    with pytest.raises(FsidError, match=r"\(4, 6\)"):
        _frames(np.zeros((4, 4)), np.zeros((4, 6)))


ISOS = tuple(50.0 * 2**stop for stop in range(10))  # 50 .. 25600


@pytest.mark.parametrize(("camera", "isos"), [("pixel6", ISOS), ("galaxy-s22", ISOS[-2:])])
def test_ten_isos_are_unbiased_over_twenty_seeds(camera, isos):
    """From read noise far below one DN (Pixel 6, ISO 50) to noise cut off at DN 0 (Galaxy S22, ISO 25600)."""
    profile, side = load_profile(camera), 64
    ramp = np.broadcast_to(np.linspace(0, 0.95, side, dtype=np.float32) ** 2, (side, side))
    error = np.empty((len(isos), 20, 2))
    for row, iso in enumerate(isos):
        level = profile.level(iso)
        truth = np.array([level.k, level.sigma2]) * [[profile.span], [profile.span**2]]
        for seed in range(20):
            rng = np.random.default_rng([seed, row])
            bursts = []
            for mosaic, frames in ((ramp, 50), (0 * ramp, 20)):
                stacked = np.tile(mosaic, (frames, 1))
                clean = Raw(stacked, profile.cfa, 64, 1023, (2, 1, 1.6), np.eye(3))
                noisy = to_dn(noisy_from_clean(rng, clean, iso, level))
                bursts.append(_frames(*noisy.reshape(frames, side, side)))
            fit = fit_noise(bursts[:1], cfa=profile.cfa, white_level=1023, dark=bursts[1])
            error[row, seed] = np.mean(np.array([fit.k_dn, fit.sigma2_dn]) / truth - 1, axis=1)
    bias, scatter = error.mean(axis=1), error.std(axis=1) / np.sqrt(20)
    assert np.all(np.abs(bias) < [0.01, 0.02] + 3.5 * scatter)
    assert np.all(np.abs(bias) < [0.02, 0.05])
