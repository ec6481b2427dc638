"""Profiles: published numbers are kept, their levels are physical, and a wrong file is named."""

import json
import pickle
from contextlib import nullcontext
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from fsid.cli.iso_notes import note_extrapolation
from fsid.errors import FsidError
from fsid.evaluate.testset import levels_of
from fsid.sensor import CameraProfile, NoiseTerms, far_extrapolated, load_profile, profile_names, save_profile
from fsid.sensor.camera_profile import MONO, Measurement, Optics
from fsid.sensor.fit_plot import profile_picture
from fsid.sensor.iso_law import k_curve, k_law, sigma2_curve, sigma2_law
from fsid.sensor.light import light_level
from fsid.sensor.profiles import profiles_digest

PUBLISHED = {
    "pixel6": "pixel6/main",
    "pixel9-pro": "pixel9pro/main",
    "pixel9-pro-tele": "pixel9pro/tele3x",
    "galaxy-s20-fe": "galaxy_s20fe/main",
    "galaxy-s20-ultra": "galaxy_s20u/main",
    "galaxy-s22": "galaxy_s22plus/wide",
    "galaxy-s22-plus-front": "galaxy_s22plus/front",
    "galaxy-s22-plus-tele": "galaxy_s22plus/tele",
    "galaxy-s22-plus-ultrawide": "galaxy_s22plus/ultrawide",
    "galaxy-s22-ultra": "galaxy_s22ultra/wide",
    "galaxy-s22-ultra-tele": "galaxy_s22ultra/tele2",
    "galaxy-s22-ultra-ultrawide": "galaxy_s22ultra/ultrawide",
}

MEAN_LOG_LEVELS = {  # of k and of sigma2, over 200 ISOs from 25 to 25600
    "galaxy-s20-fe": (-6.760120182840616, -12.14513939622364),
    "galaxy-s20-ultra": (-7.933141229601595, -12.796608266609056),
    "galaxy-s22": (-6.739874546038305, -10.846796320966106),
    "galaxy-s22-plus-front": (-6.120580527043658, -10.592148474309727),
    "galaxy-s22-plus-tele": (-5.601325199308228, -9.765594309329995),
    "galaxy-s22-plus-ultrawide": (-6.374787121026171, -10.691074673089595),
    "galaxy-s22-ultra": (-6.886065406499437, -11.602892681157323),
    "galaxy-s22-ultra-tele": (-5.666586633898731, -10.040957143383677),
    "galaxy-s22-ultra-ultrawide": (-6.055295188066277, -10.863927372640813),
    "pixel6": (-7.157337806759144, -12.818826286197375),
    "pixel9-pro": (-7.278634014361216, -12.952308507483936),
    "pixel9-pro-tele": (-6.1817274683150085, -11.093459572210689),
}

GOOD = """
name: mine
camera: My camera
cfa: RGGB
bits: 12
black_level: 256
white_level: 4095
levels:
  - iso: 100
    k: [1.0e-04, 1.1e-04, 1.2e-04, 1.3e-04]
    sigma2: [1.0e-06, 1.0e-06, 1.0e-06, 1.0e-06]
  - iso: 400
    k: [4.0e-04, 4.4e-04, 4.8e-04, 5.2e-04]
    sigma2: [4.0e-06, 4.0e-06, 4.0e-06, 4.0e-06]
"""


def _array(level):
    return np.array([level.k, level.sigma2])


def test_the_published_phones_are_built_in():
    assert set(PUBLISHED) <= set(profile_names())
    for name in PUBLISHED:
        profile = load_profile(name)
        assert (profile.black_level, profile.white_level, profile.bits) == (64, 1023, 10)


@pytest.mark.parametrize("name", profile_names())
def test_a_profile_is_called_as_its_file_is_and_says_where_its_figures_come_from(name):
    profile = load_profile(name)
    assert profile.name == name
    assert profile.source


@pytest.mark.parametrize("name", PUBLISHED)
def test_sites_are_the_published_ones_in_named_order(name, shared_data):
    path = shared_data / "noise" / "published_models.json"
    camera = json.loads(path.read_text())["cameras"][PUBLISHED[name]]
    # R, Gr, Gb, B in the 2x2 tile, counted row by row.
    order = {"GBRG": [2, 3, 0, 1], "GRBG": [1, 0, 3, 2], "RGGB": [0, 1, 2, 3]}[camera["cfa"]]
    profile = load_profile(name)
    assert profile.cfa == camera["cfa"]
    isos = sorted(camera["iso"], key=float)
    assert profile.iso == tuple(float(iso) for iso in isos)
    for iso, k, sigma2 in zip(isos, profile.k, profile.sigma2, strict=True):
        published = camera["iso"][iso]
        np.testing.assert_allclose(k, np.array(published["k"])[order], rtol=1e-9)
        np.testing.assert_allclose(sigma2, np.array(published["sigma2"])[order], rtol=1e-9)


@pytest.mark.parametrize("name", profile_names())
def test_levels_rise_with_iso_and_have_no_steps(name):
    profile = load_profile(name)
    iso = np.geomspace(25, 25600, 400)
    levels = np.array([_array(profile.level(i)) for i in iso])
    steps = np.diff(np.log(levels), axis=0) / np.diff(np.log(iso))[:, None, None]
    assert np.all(steps >= -1e-9)
    # Slopes in log-log: gain goes as ISO, amplified read noise as ISO squared; tables wiggle around that.
    assert np.all(steps[:, 0] < 2.0)
    assert np.all(steps[:, 1] < 3.5)


@pytest.mark.parametrize("name", profile_names())
def test_read_noise_is_never_below_rounding(name):
    profile = load_profile(name)
    floor = 1 / 12 / profile.span**2
    for iso in (1, 50, 100, 800, 3200, 12800):
        assert np.all(np.array(profile.level(iso).sigma2) >= floor * (1 - 1e-12))


@pytest.mark.parametrize("name", profile_names())
def test_published_gain_is_kept_at_published_iso_where_it_rises(name):
    """Two tables fall: the S20 Ultra's from ISO 50 to 100, by a third, the S22 Ultra tele's at its end."""
    profile = load_profile(name)
    rtol = {"galaxy-s20-ultra": 0.22, "galaxy-s22-ultra-tele": 0.03}.get(name, 1e-9)
    for iso, k in zip(profile.iso, profile.k, strict=True):
        np.testing.assert_allclose(profile.level(iso).k, k, rtol=rtol)


def test_published_read_noise_is_kept_where_it_is_possible():
    profile = load_profile("galaxy-s22")
    for iso, sigma2 in list(zip(profile.iso, profile.sigma2, strict=True))[3:]:
        np.testing.assert_allclose(profile.level(iso).sigma2, sigma2, rtol=1e-9)


@pytest.mark.parametrize("name", MEAN_LOG_LEVELS)
def test_published_tables_give_the_levels_that_they_always_gave(name):
    profile = load_profile(name)
    levels = [_array(profile.level(iso)) for iso in np.geomspace(25, 25600, 200)]
    np.testing.assert_allclose(np.log(levels).mean(axis=(0, 2)), MEAN_LOG_LEVELS[name], rtol=1e-13)


def _calibrated(sigma2_dn2, error_dn2):
    """A profile of ISO 200, 400, ... with these sigma2 in DN^2, and their standard errors where given."""
    known, isos = load_profile("pixel6"), 200 * 2 ** np.arange(len(sigma2_dn2))
    k = np.outer(0.8e-6 * isos, np.ones(4))
    sigma2, error = (np.outer(v, np.ones(4)) / known.span**2 for v in (sigma2_dn2, error_dn2))
    measured = Measurement(0.001 * k, error, 0 * k + 64, (20,) * len(k), (10,) * len(k))
    return replace(known, iso=tuple(isos), k=k, sigma2=sigma2, measured=measured)


def _sigma2_dn2(profile, isos):
    return [profile.level(iso).sigma2[0] * profile.span**2 for iso in isos]


def test_read_noise_that_another_conversion_gain_lowers_is_kept():
    found = _calibrated([1.6, 6.0, 1.2, 4.0], [0.02, 0.06, 0.02, 0.04])
    isos = found.iso
    np.testing.assert_allclose(_sigma2_dn2(found, isos), [1.6, 6.0, 1.2, 4.0])
    assert np.all(np.diff(_sigma2_dn2(found, np.geomspace(400, 800, 9))) < 0)
    np.testing.assert_allclose(_sigma2_dn2(replace(found, measured=None), isos), [1.4, 3.6, 3.6, 5.0])


def test_between_isos_of_one_conversion_gain_noise_follows_its_law_beside_another_one():
    """A cubic through both levels out where they meet: 75 % too high at ISO 400, 29 % too low at 6400."""
    isos, floor_dn2 = 200.0 * 4 ** np.arange(6), 0.3
    switched_dn2 = np.where(isos < 1000, 2e-5, 1e-6) * isos**2 + floor_dn2
    found = _calibrated(switched_dn2, 0.005 * switched_dn2)
    k = np.outer(0.8e-6 * isos, np.ones(4))
    found = replace(found, iso=tuple(isos), k=k, measured=replace(found.measured, k_error=0.001 * k))
    between = np.array([400.0, 6400.0, 25600.0, 102400.0])
    expected = np.where(between < 800, 2e-5, 1e-6) * between**2 + floor_dn2
    np.testing.assert_allclose(_sigma2_dn2(found, between), expected, rtol=0.1)
    np.testing.assert_allclose(_sigma2_dn2(found, isos), switched_dn2)


@pytest.mark.parametrize("isos", [(100, 6400), (100, 800, 6400), (100, 150, 3200, 6400)])
def test_points_on_the_law_are_joined_by_the_law(isos):
    """Powers of ISO through two of them made sigma2 up to 2.8 times too large, through three 1.3 times."""
    floor, iso, between = 1 / 12, np.array(isos, float), np.geomspace(100, 6400, 50)

    def true(iso):
        return np.outer(floor + 1.0 + 1e-4 * iso + 1.6e-5 * iso**2, np.ones(4))

    no_error = np.zeros((len(iso), 4))
    found = sigma2_curve(iso, true(iso), floor, no_error)
    linear = len(isos) > 2  # two points leave its coefficient out
    np.testing.assert_allclose([found(i) for i in between], true(between), rtol=1e-4 if linear else 0.02)
    gain = k_curve(iso, np.outer(3e-5 + 7e-7 * iso, np.ones(4)), no_error)
    np.testing.assert_allclose([gain(i)[0] for i in between], 3e-5 + 7e-7 * between, rtol=1e-6)


def test_between_isos_of_each_of_two_conversion_gains_noise_is_that_of_its_law():
    iso, floor = np.array([50.0, 400.0, 1600.0, 12800.0]), 1 / 12

    def true(iso):
        return np.outer(floor + np.where(iso < 800, 1.0 + 4e-5 * iso**2, 0.5 + 1e-6 * iso**2), np.ones(4))

    found = sigma2_curve(iso, true(iso), floor, 0.005 * true(iso))
    within = np.concatenate([np.geomspace(25, 400, 20), np.geomspace(1600, 25600, 20)])
    np.testing.assert_allclose([found(i) for i in within], true(within), rtol=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_levels_between_scattered_points_rise_and_scatter_no_more_than_they(seed):
    """The law times what departs from it would fall at the foot of a rise."""
    rng, iso, floor = np.random.default_rng(seed), 100 * 2.0 ** np.arange(7), 1 / 12
    law = np.outer(floor + 1.0 + 1.6e-5 * iso**2, np.ones(4))
    values = law * (1 + 0.01 * rng.uniform(-1, 1, law.shape))
    found = sigma2_curve(iso, values, floor, 0.01 * values)
    between = np.geomspace(100, 6400, 300)
    levels = np.array([found(i) for i in between])
    assert np.all(np.diff(levels, axis=0) >= -1e-12 * levels[1:])
    np.testing.assert_allclose(levels, np.outer(floor + 1.0 + 1.6e-5 * between**2, np.ones(4)), rtol=0.03)


def test_where_no_law_rises_points_are_joined_over_iso():
    """Published gain that falls and rises again: the line that fits best is level."""
    iso, k = np.array([100.0, 200.0, 400.0]), np.outer([3e-4, 2e-4, 2.5e-4], np.ones(4))
    assert k_law(iso, k[:, 0])[1] == 0
    found = k_curve(iso, k)
    np.testing.assert_allclose([found(i)[0] for i in (100, 150, 200, 400)], [2.5e-4, 2.5e-4, 2.5e-4, 2.75e-4])
    assert 2.5e-4 < found(283)[0] < 2.75e-4


def test_beyond_a_table_with_two_conversion_gains_noise_follows_the_law_of_the_one_there():
    """The law of both was a constant: two stops above, sigma2 was a quarter of what it is."""

    def true_dn2(iso):
        return np.where(iso < 1400, 8e-5, 4e-6) * iso**2 + 2.3

    isos = 200.0 * 2 ** np.arange(6)
    found = _calibrated(true_dn2(isos), 0.005 * true_dn2(isos))
    beyond = np.array([50.0, 100.0, 12800.0, 25600.0])
    np.testing.assert_allclose(_sigma2_dn2(found, beyond), true_dn2(beyond), rtol=0.02)


def test_read_noise_that_falls_within_its_errors_is_pooled_by_them():
    found = _calibrated([0.1, 0.5, 1.0, 0.7, 4.0], [0.001, 0.001, 0.2, 0.1, 0.1])
    pooled = (1.0 + 4 * 0.7) / 5
    np.testing.assert_allclose(_sigma2_dn2(found, found.iso), [0.1, 0.5, pooled, pooled, 4.0])


def test_impossible_read_noise_becomes_the_quadratic_of_its_trustworthy_end():
    profile = load_profile("pixel6")
    assert profile.sigma2.min() < 0  # as published
    np.testing.assert_allclose(profile.level(3199).sigma2, profile.sigma2[-1], rtol=0.1)
    floor = 1 / 12 / profile.span**2
    low, high = (np.array(profile.level(iso).sigma2) - floor for iso in (1600, 6400))
    np.testing.assert_allclose(high / low, 16, rtol=1e-6)


@pytest.mark.parametrize(("name", "bound"), [("pixel6", 0.04), ("galaxy-s22", 0.105)])
def test_the_line_in_iso_describes_the_published_gain(name, bound):
    profile = load_profile(name)
    iso = np.array(profile.iso)
    for k in profile.k.T:
        offset, slope = k_law(iso, k)
        assert np.max(np.abs((offset + slope * iso) / k - 1)) < bound


@pytest.mark.parametrize("name", profile_names())
def test_a_published_iso_that_is_left_out_is_predicted(name):
    """Within 8 %, but for tables that wander: see the files of the S20 Ultra and the two S22 cameras."""
    profile = load_profile(name)
    wandering = {"galaxy-s20-ultra": 0.65, "galaxy-s22-plus-ultrawide": 0.2, "galaxy-s22-ultra-tele": 0.15}
    for left_out in range(1, len(profile.iso)):
        keep = np.arange(len(profile.iso)) != left_out
        rest = replace(
            profile, iso=tuple(np.array(profile.iso)[keep]), k=profile.k[keep], sigma2=profile.sigma2[keep]
        )
        np.testing.assert_allclose(
            rest.level(profile.iso[left_out]).k, profile.k[left_out], rtol=wandering.get(name, 0.08)
        )


def test_laws_recover_the_coefficients_they_were_made_from():
    iso = np.geomspace(50, 6400, 8)
    np.testing.assert_allclose(k_law(iso, 3e-5 + 7e-7 * iso), [3e-5, 7e-7], rtol=1e-6)
    floor = 1e-7
    made = floor + 2e-7 + 3e-10 * iso + 4e-12 * iso**2
    np.testing.assert_allclose(sigma2_law(iso, made, floor, 0.0), [2e-7, 3e-10, 4e-12], rtol=1e-6)


def test_one_iso_is_a_profile_too(tmp_path):
    path = tmp_path / "one.yaml"
    path.write_text(GOOD[: GOOD.index("  - iso: 400")])
    profile = load_profile(path)
    np.testing.assert_allclose(profile.level(100).k, [1.0e-4, 1.1e-4, 1.2e-4, 1.3e-4])
    np.testing.assert_allclose(profile.level(200).k, 2 * profile.k[0], rtol=1e-6)
    assert 2 < profile.level(200).sigma2[0] / profile.level(100).sigma2[0] < 4


def test_own_profile_by_path(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(GOOD)
    profile = load_profile(str(path))
    assert (profile.name, profile.cfa, profile.span) == ("mine", "RGGB", 3839)
    np.testing.assert_allclose(profile.level(400).k, [4.0e-4, 4.4e-4, 4.8e-4, 5.2e-4])
    assert profile.xyz_to_camera.shape == (4, 3, 3)


def test_a_profile_is_shared_and_cannot_be_written_to_until_its_file_changes(tmp_path):
    path = tmp_path / "mine.yaml"
    four, frames = "[1.0, 1.0, 1.0, 1.0]", "frames: 2\n    dark_frames: 2"
    measured = f"    k_error: {four}\n    sigma2_error: {four}\n    black: {four}\n    {frames}\n"
    path.write_text(GOOD[: GOOD.index("  - iso: 400")] + measured)
    profile = load_profile(path)
    assert load_profile(path) is profile
    errors = profile.measured
    arrays = [profile.k, profile.sigma2, profile.xyz_to_camera]
    for array in [*arrays, errors.k_error, errors.sigma2_error, errors.black]:
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    path.write_text(GOOD)
    assert len(load_profile(path).iso) == 2


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("cfa: RGGB", "cfa: RGBG", "cfa"),
        ("cfa: RGGB\n", "", "missing key cfa"),
        ("cfa: RGGB", "cfa: RGGB\ncolour: red", "unknown key colour"),
        ("white_level: 4095", "white_level: 4096", "12 bits"),
        ("black_level: 256", "black_level: 5000", "black_level"),
        ("black_level: 256", "black_level: 256.5", "black_level"),
        ("iso: 400", "iso: 100", "rising"),
        ("iso: 400", "iso: many", r"levels\[1\].iso"),
        ("iso: 400", "iso: true", r"levels\[1\].iso"),
        ("iso: 100", "iso: 0", "rising, positive iso"),
        ("black_level: 256", "black_level: 4095", "black_level must be an integer from 0 to 4094"),
        ("bits: 12", "bits: true", "bits must be an integer"),
        ("1.3e-04]", "]", r"levels\[0\].k "),
        ("1.3e-04]", "1e-04]", "1.0e-05"),
        ("[1.0e-04, 1.1", "[-1.0e-04, 1.1", "positive"),
        ("[4.0e-06", "[.nan", r"levels\[1\].sigma2"),
        ("levels:", "levels: [", "YAML"),
        ("cfa: RGGB", "cfa: RGGB\ndate: 2001-99-99", "YAML"),
        ("cfa: RGGB", "cfa: RGGB\ncfa: BGGR", "cfa is given twice"),
        ("    sigma2: [1.0", "    k_dn: [1.0, 1.0, 1.0, 1.0]\n    sigma2: [1.0", "k_dn"),
        ("    sigma2: [1.0", "    k_dn: [0.384, 0.422, 0.461, 0.51]\n    sigma2: [1.0", "k_dn is not"),
        ("    sigma2: [1.0", "    black: [9, 9, 9, 9]\n    sigma2: [1.0", "missing key dark_frames, frames"),
        ("cfa: RGGB", "cfa: RGGB\nxyz_to_camera: [[1, 2], [3]]", "xyz_to_camera"),
        ("k: [1.0e-04", "k: [1.0e+300", r"levels\[0\]: k \+ sigma2"),
        ("k: [1.0e-04", "k: [.inf", r"levels\[0\].k must"),
        ("k: [1.0e-04", f"k: [1{'0' * 400}", r"levels\[0\].k must"),
        ("sigma2: [1.0e-06", "sigma2: [0.0834", r"levels\[0\].sigma2: 0.0834 is not below 1/12; is it in DN"),
        ("cfa: RGGB", "cfa: RGGB\noptics: {f_number: 2, pixel_pitch_um: 100}", "optics.pixel_pitch_um must"),
        ("cfa: RGGB", "cfa: RGGB\noptics: {f_number: 280, pixel_pitch_um: 1}", "optics.f_number must"),
        *(
            (
                "cfa: RGGB",
                f"cfa: RGGB\noptics: {{f_number: 2, pixel_pitch_um: 1, {key}: {value}}}",
                f"optics.{key} must",
            )
            for key, value in (("quantum_efficiency", 28), ("transmittance", 90), ("transmittance", 0))
        ),
        ("sigma2: [1.0e-06", "sigma2: [-0.5", r"levels\[0\]: k \+ sigma2"),
        *(
            ("cfa: RGGB", f"cfa: RGGB\nxyz_to_camera: {matrices}", "xyz_to_camera")
            for matrices in (
                "[]",
                "[[[0, 0, 0], [0, 0, 0], [0, 0, 0]]]",
                "[[[1, 2, 3], [1, 2, 3], [0, 0, 1]]]",
                "[[[1.0e+308, 0, 0], [0, 1, 0], [0, 0, 1]]]",
                f"[[[1{'0' * 400}, 0, 0], [0, 1, 0], [0, 0, 1]]]",
            )
        ),
    ],
)
def test_a_wrong_profile_names_file_and_key(tmp_path, old, new, words):
    path = tmp_path / "wrong.yaml"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(FsidError, match=words) as caught:
        load_profile(path)
    assert "wrong.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)


def calibrated_profile() -> CameraProfile:
    """No two facts of it are alike, nor are its two ISOs, nor sites."""
    rows = np.arange(1.0, 9.0).reshape(2, 4)
    measured = Measurement(1e-7 * rows, 2e-9 * rows, 500 + rows, (20, 30), (5, 6))
    return CameraProfile(
        name="mine",
        camera="My camera",
        cfa="GRBG",
        black_level=512,
        white_level=65535,
        bits=16,
        iso=(100.0, 400.0),
        k=1e-5 * rows,
        sigma2=1e-7 * rows,
        xyz_to_camera=load_profile("pixel6").xyz_to_camera[:2],
        source="the source",
        notes="the notes",
        date="2024-05-06",
        measured=measured,
        terms=NoiseTerms(row=0.3),
        optics=Optics(0.95, 0.8, 0.5, 0.7),
    )


def test_a_calibrated_profile_is_read_as_it_was_saved(tmp_path):
    made = calibrated_profile()
    save_profile(tmp_path / "mine.yaml", made)
    saved = load_profile(tmp_path / "mine.yaml")
    for of_saved, of_made in ((saved, made), (saved.measured, made.measured)):
        for key in (field.name for field in fields(of_made) if field.name != "measured"):
            found, wanted = getattr(of_saved, key), getattr(of_made, key)
            if isinstance(wanted, np.ndarray):
                np.testing.assert_allclose(found, wanted, rtol=1e-5, err_msg=key)
            else:
                assert found == wanted, key


def test_a_saved_profile_has_figures_in_dn_and_says_how_far_its_law_is_from_them(tmp_path):
    """How far the level is that departs most is to be found again from what the file says of both."""
    iso, floor = np.array([100.0, 200.0, 400.0, 800.0, 1600.0]), 1 / 12
    bent = np.ones((5, 4))
    bent[2] = [1.0, 0.85, 1.05, 1.0]
    k_dn = (0.1 + 2e-3 * iso)[:, None] * bent
    sigma2_dn2 = (floor + 0.3 + 1e-3 * iso + 4e-6 * iso**2)[:, None] * bent
    zero = np.zeros((5, 4))
    made = replace(
        calibrated_profile(),
        iso=tuple(iso),
        k=k_dn / 65023,
        sigma2=sigma2_dn2 / 65023**2,
        measured=Measurement(zero, zero, zero, (2,) * 5, (0,) * 5),
    )
    save_profile(tmp_path / "mine.yaml", made)
    said = yaml.safe_load((tmp_path / "mine.yaml").read_text())
    np.testing.assert_allclose([level["k_dn"] for level in said["levels"]], k_dn, rtol=1e-5)
    np.testing.assert_allclose([level["sigma2_dn"] for level in said["levels"]], sigma2_dn2, rtol=1e-5)
    law = said["law"]
    np.testing.assert_allclose(law["k"][0], np.array([0.1, 2e-3]) / 65023, rtol=1e-4)
    np.testing.assert_allclose(law["sigma2"][0], np.array([floor + 0.3, 1e-3, 4e-6]) / 65023**2, rtol=1e-4)
    for key, values in (("k", made.k), ("sigma2", made.sigma2)):
        drawn = np.stack([np.polynomial.Polynomial(each)(iso) for each in law[key]], axis=1)
        farthest = np.abs((values - drawn) / drawn).max()
        assert 0.03 < farthest < 0.15
        assert law[f"{key}_departure"] == pytest.approx(farthest, rel=0.01)
    save_profile(tmp_path / "published.yaml", replace(made, measured=None))
    assert "law" not in yaml.safe_load((tmp_path / "published.yaml").read_text())


def test_the_digest_is_that_of_noise_levels_and_colour_alone(tmp_path):
    """What a dataset or a test set was begun with: other noise under the same name is told apart."""
    made = calibrated_profile()

    def digest(**changes) -> str:
        save_profile(tmp_path / "mine.yaml", replace(made, **changes))
        return profiles_digest([tmp_path / "mine.yaml", "pixel6"])

    first = digest()
    assert len(first) == 16
    assert profiles_digest(["galaxy-s22", Path("pixel6")]) == ""
    assert digest(name="other", camera="other", source="", notes="", date="", optics=None) == first
    others = [
        *({"cfa": "RGGB"}, {"black_level": 513}, {"white_level": 65534}, {"iso": (100.0, 500.0)}),
        *({key: 1.01 * getattr(made, key)} for key in ("k", "sigma2", "xyz_to_camera")),
        {"measured": replace(made.measured, k_error=np.ones((2, 4)))},
        {"measured": replace(made.measured, sigma2_error=np.ones((2, 4)))},
        *({"terms": NoiseTerms(row=0.4)}, {"measured": None}),
    ]
    assert len({first, *(digest(**changes) for changes in others)}) == 1 + len(others)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("cfa: RGGB", f"cfa: {MONO}"),
        ("black_level: 256", "black_level: 0"),
        ("bits: 12", "bits: 16"),
        ("bits: 12\nblack_level: 256\nwhite_level: 4095", "bits: 16\nblack_level: 256\nwhite_level: 65535"),
        ("bits: 12\nblack_level: 256\nwhite_level: 4095", "bits: 1\nblack_level: 0\nwhite_level: 1"),
        ("cfa: RGGB", "cfa: RGGB\noptics: {f_number: 0.5, pixel_pitch_um: 50}"),
        ("cfa: RGGB", "cfa: RGGB\noptics: {f_number: 64, pixel_pitch_um: 0.3}"),
    ],
)
def test_a_profile_of_an_unusual_camera_is_read(tmp_path, old, new):
    path = tmp_path / "mine.yaml"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new, 1))
    assert len(load_profile(path).iso) == 2


@pytest.mark.parametrize(("value", "is_refused"), [("0.0", False), ("-1.0e-06", True)])
def test_read_noise_that_is_negative_everywhere_is_refused(tmp_path, value, is_refused):
    path = tmp_path / "mine.yaml"
    path.write_text(
        GOOD.replace("sigma2: [1.0e-06", f"sigma2: [{value}").replace("sigma2: [4.0e-06", f"sigma2: [{value}")
    )
    with pytest.raises(FsidError, match=r"mine\.yaml: levels: .*sigma2") if is_refused else nullcontext():
        load_profile(path)


@pytest.mark.parametrize(("black", "white"), [(64, 1023), (64, 4095), (512, 16383)])
def test_levels_are_the_same_after_saving_where_read_noise_is_that_of_rounding(tmp_path, black, white):
    """Rounded to six digits, 1/12 DN^2 may come out below itself, which no camera can have."""
    span = white - black
    sigma2 = np.outer([1 / 12, 1 / 12, 1.2, 12.0], np.ones(4)) / span**2
    made = replace(
        load_profile("pixel6"),
        black_level=black,
        white_level=white,
        bits=white.bit_length(),
        iso=(100.0, 400.0, 800.0, 3200.0),
        k=np.outer([0.11, 0.35, 0.65, 2.3], np.ones(4)) / span,
        sigma2=sigma2,
    )
    save_profile(tmp_path / "made.yaml", made)
    saved = load_profile(tmp_path / "made.yaml")
    for iso in (50, 100, 200, 800, 1600, 6400):
        np.testing.assert_allclose(_array(saved.level(iso)), _array(made.level(iso)), rtol=1e-5)


def test_a_profile_of_numpy_numbers_is_saved(tmp_path):
    known = load_profile("pixel6")
    own = replace(known, iso=np.array(known.iso), black_level=np.int64(64), bits=np.uint8(10))
    save_profile(tmp_path / "own.yaml", own)
    save_profile(tmp_path / "known.yaml", known)
    assert (tmp_path / "own.yaml").read_text() == (tmp_path / "known.yaml").read_text()


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(FsidError, match="pixel6"):
        load_profile("pixel7")


def test_a_profile_that_is_no_text_is_named(tmp_path):
    path = tmp_path / "image.yaml"
    path.write_bytes(bytes(range(256)))
    with pytest.raises(FsidError, match=r"image\.yaml"):
        load_profile(path)


def test_a_profile_travels_to_workers():
    profile = load_profile("galaxy-s22")
    level = profile.level(1234)
    assert pickle.loads(pickle.dumps(profile)).level(1234) == level


@pytest.mark.parametrize("iso", [0, -100, float("nan")])
def test_iso_must_be_positive(iso):
    with pytest.raises(FsidError, match="ISO"):
        load_profile("pixel6").level(iso)


def test_an_iso_of_more_noise_than_white_is_named():
    """Of noise alone nobody knows which ISO it is of, and of an ISO not at how little light."""
    pixel = load_profile("pixel6")
    with pytest.raises(FsidError, match=r"^profile pixel6: ISO 1e\+06 is too high: k would be 0.74"):
        pixel.level(1e6)
    with pytest.raises(FsidError, match=r"^0\.01lux: profile pixel6: ISO 772144 is too high"):
        levels_of(pixel, (), (0.5, 0.01))
    assert light_level(pixel, 0.01, highest_iso=np.inf).iso == pytest.approx(772144, abs=1)
    assert profile_picture(replace(pixel, iso=(1e6,), k=[[1.0] * 4], sigma2=[[0.08] * 4]), ".png")


def test_a_range_far_beyond_the_measured_isos_is_noted_and_two_stops_are_not(tmp_path, capsys):
    path = tmp_path / "mine.yaml"
    path.write_text(GOOD)
    assert [profile.name for profile in far_extrapolated([path, "pixel6"], 400, 8000)] == ["mine"]
    assert not list(far_extrapolated([path], 25, 1600))
    assert not list(far_extrapolated(profile_names(), 100, 12800))
    note_extrapolation([str(path)], 20, 400)
    said = " ".join(capsys.readouterr().err.split())
    assert said == (
        "note: profile mine was measured at ISO 100 to 400; its noise at ISO 20 to 400 is extrapolated far"
    )


@pytest.mark.parametrize(("standard_errors", "is_pooled"), [(2.5, True), (3.5, False)])
def test_a_fall_is_real_beyond_three_standard_errors_of_the_difference(standard_errors, is_pooled):
    iso, error = np.array([100.0, 200.0]), np.full((2, 4), 1e-5)
    k = np.full((2, 4), 1e-3)
    k[1] -= standard_errors * np.sqrt(2) * 1e-5
    found = np.array([k_curve(iso, k, error)(value) for value in iso])
    np.testing.assert_allclose(found, np.broadcast_to(k.mean(0), (2, 4)) if is_pooled else k, rtol=1e-9)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"k": [0.001] * 4}, "must be"),
        ({"iso": (200, 100)}, "must rise"),
        ({"k": np.full((2, 4), 2.0)}, "divide k in DN by white - black"),
        ({"sigma2": np.full((2, 4), 0.5)}, "divide k in DN by white - black"),
        ({"xyz_to_camera": np.eye(3)}, r"expected \(m, 3, 3\)"),
    ],
)
def test_a_profile_made_by_hand_says_what_is_wrong_with_it(wrong, named):
    by_hand = {"k": [[0.001] * 4, [0.002] * 4], "sigma2": [[1e-6] * 4, [2e-6] * 4], "iso": (100, 200)}
    by_hand |= {"name": "mine", "camera": "Mine", "cfa": "RGGB", "black_level": np.int64(256)}
    by_hand |= {"white_level": np.int64(4095), "bits": 12, "xyz_to_camera": [np.eye(3)]}
    assert CameraProfile(**by_hand).level(100).k == pytest.approx((0.001,) * 4)
    with pytest.raises(FsidError, match=f"profile mine: .*{named}"):
        CameraProfile(**{**by_hand, **wrong})


def test_no_profile_is_written_that_could_not_be_read(tmp_path):
    lower = replace(load_profile("pixel6"), cfa="gbrg")
    with pytest.raises(FsidError, match="profile pixel6: cfa: 'gbrg' is not a Bayer pattern"):
        save_profile(tmp_path / "mine.yaml", lower)
    assert not list(tmp_path.iterdir())
