"""Frames on disk become the profile of the camera that took them."""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fsid.cli.calibrate import _table
from fsid.cli.main import main
from fsid.errors import FsidError
from fsid.sensor import (
    Calibration,
    Layout,
    NoiseTerms,
    Raw,
    calibrate,
    load_profile,
    noisy_from_clean,
    save_profile,
    to_dn,
    write_dng,
)
from fsid.sensor.calibrate import NoiseFit
from fsid.sensor.camera_profile import Optics
from fsid.sensor.fitted_profile import profile_of, site_blacks
from fsid.sensor.frames import Frame, bursts, find_frames
from fsid.sensor.mosaic import site_offsets
from stated_black import state_black

PROFILE = load_profile("galaxy-s22")
SIDE, FRAMES = 192, 20
NO_COLOUR = "no colour matrix is stated: xyz_to_camera has the published ones of other cameras"


def scene(light: float = 0.9, side: int = SIDE) -> Raw:
    ramp = np.linspace(0, light, side, dtype=np.float32) ** 2
    mosaic = np.ascontiguousarray(np.broadcast_to(ramp, (side, side)))
    return Raw(mosaic, PROFILE.cfa, 64, 1023, (2, 1, 1.6), PROFILE.xyz_to_camera[0], camera="Maker Model")


def exposures(rng: np.random.Generator, clean: Raw, iso: float, count: int) -> list[Raw]:
    return [noisy_from_clean(rng, clean, iso, PROFILE.level(iso)) for _ in range(count)]


def write_burst(folder: Path, rng, clean: Raw, iso: float, count: int = FRAMES) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{number:03d}.dng" for number in range(count)]
    for path, raw in zip(paths, exposures(rng, clean, iso, count), strict=True):
        write_dng(path, raw)
    return paths


def write_arrays(folder: Path, images: list[np.ndarray]) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{number:03d}.npy" for number in range(len(images))]
    for path, image in zip(paths, images, strict=True):
        np.save(path, image)
    return paths


def write_dn(path: Path, dn: np.ndarray) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    write_dng(path, replace(scene(), mosaic=((dn - 64) / (1023 - 64)).astype(np.float32), iso=100))
    return path


def within(found, expected, error, sigmas=4.5):
    assert np.all(np.abs(np.array(found) - np.array(expected)) < sigmas * np.array(error) + 1e-12)


@pytest.fixture(scope="module")
def dng_bursts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Bursts of a ramp at three ISOs and their dark frames, as DNG."""
    folder, rng = tmp_path_factory.mktemp("bursts"), np.random.default_rng(1)
    for iso in (400, 1600, 6400):
        write_burst(folder / f"light{iso}", rng, scene(), iso)
        write_burst(folder / f"dark{iso}", rng, scene(0.0), iso, 5)
    return folder


def test_bursts_at_several_isos_give_a_profile_for_any_iso(dng_bursts, tmp_path):
    isos = (400, 1600, 6400)
    found = calibrate(
        [dng_bursts / f"light{iso}" for iso in isos],
        name="mine",
        dark=[dng_bursts / f"dark{iso}" for iso in isos],
    )
    save_profile(tmp_path / "mine.yaml", found.profile)
    profile = load_profile(tmp_path / "mine.yaml")
    assert profile.iso == isos
    assert (profile.camera, profile.cfa, profile.black_level) == ("Maker Model", PROFILE.cfa, 64)
    np.testing.assert_allclose(profile.xyz_to_camera, PROFILE.xyz_to_camera[:1], atol=1e-6)
    measured = profile.measured
    assert measured is not None
    assert (measured.frames, measured.dark_frames) == ((20,) * 3, (5,) * 3)
    np.testing.assert_allclose(measured.black, 64, atol=0.5)
    for row, iso in enumerate(isos):
        truth = PROFILE.level(iso)
        within(profile.k[row], truth.k, measured.k_error[row])
        within(profile.sigma2[row], truth.sigma2, measured.sigma2_error[row])
        fit = found.fits[row]
        np.testing.assert_allclose(measured.k_error[row] * 959, fit.k_dn_error, rtol=1e-4)
        np.testing.assert_allclose(measured.sigma2_error[row] * 959**2, fit.sigma2_dn_error, rtol=1e-4)
    assert NO_COLOUR not in found.notes
    for iso in (800, 3200, 12800):
        np.testing.assert_allclose(profile.level(iso).k, PROFILE.level(iso).k, rtol=0.12)
    assert "k_departure" in (tmp_path / "mine.yaml").read_text()


def test_what_a_replaced_profile_had_and_the_new_one_lacks_is_said(dng_bursts, tmp_path, capsys):
    """Optics and terms that were written by hand were gone without a word, as was another ISO."""
    optics, terms = Optics(1.8, 1.2), NoiseTerms(poisson=True)
    save_profile(tmp_path / "mine.yaml", replace(PROFILE, optics=optics, terms=terms))
    command = ["calibrate", str(dng_bursts / "light400"), "--dark", str(dng_bursts / "dark400"), "--quiet"]
    main([*command, "-o", str(tmp_path / "mine.yaml")])
    said = " ".join(capsys.readouterr().err.split())
    assert "mine.yaml: was replaced; the one before had what this one lacks: optics, terms.poisson" in said
    assert "ISO 50, 100," in said
    main([*command, "-o", str(tmp_path / "mine.yaml")])
    assert "replaced" not in capsys.readouterr().err


def test_arrays_of_several_exposures_and_isos_are_sorted_into_bursts(tmp_path, rng):
    paths = []
    for iso in (800, 3200):
        images = [to_dn(r) for light in (0.3, 0.7) for r in exposures(rng, scene(light), iso, 10)]
        paths += write_arrays(tmp_path / f"iso{iso}", images)
    found = calibrate(paths, name="mine", layout=Layout(cfa=PROFILE.cfa, black_level=64, white_level=1023))
    assert found.profile.iso == (800, 3200)
    for row, iso in enumerate(found.profile.iso):
        within(found.fits[row].k_dn / 959, PROFILE.level(iso).k, found.fits[row].k_dn_error / 959)
    tied = calibrate(
        paths, name="mine", layout=Layout(cfa=PROFILE.cfa, black_level=64, white_level=1023), tie_greens=True
    )
    assert tied.fits[0].k_dn[1] == tied.fits[0].k_dn[2]
    assert found.fits[0].k_dn[1] != found.fits[0].k_dn[2]


def test_the_fit_is_unbiased_over_seeds():
    """Twenty bursts: the mean departure in units of the stated error is that of twenty normal numbers."""
    from fsid.sensor import TemporalStatistics, fit_noise

    truth, z = PROFILE.level(1600), []
    clean = scene(side=128)
    for seed in range(20):
        rng = np.random.default_rng(seed)
        light, dark = TemporalStatistics(1023), TemporalStatistics(1023)
        for raw in exposures(rng, clean, 1600, 12):
            light.add(to_dn(raw))
        for raw in exposures(rng, replace(clean, mosaic=0 * clean.mosaic), 1600, 12):
            dark.add(to_dn(raw))
        fit = fit_noise([light], cfa=PROFILE.cfa, white_level=1023, dark=dark)
        z.append(
            [
                (fit.k_dn - np.array(truth.k) * 959) / fit.k_dn_error,
                (fit.sigma2_dn - np.array(truth.sigma2) * 959**2) / fit.sigma2_dn_error,
            ]
        )
    means = np.mean(z, axis=(0, 2))
    assert np.all(np.abs(means) < 3.5 / np.sqrt(20 * 4))
    assert np.all(np.std(z, axis=(0, 2)) < 1.4)


@pytest.mark.parametrize(("name", "k", "dark_std"), [("001", 0.28006, 3.0731), ("003", 0.09786, 3.0130)])
def test_the_command_meets_the_emva_reference(shared_data, tmp_path, name, k, dark_std):
    folder = shared_data / "emva1288" / name / "images"
    if not folder.is_dir():
        pytest.skip(f"{folder}: no EMVA 1288 reference set here")
    flats = sorted(folder.glob("b_[0-9]*.png"))
    main(
        [
            "calibrate",
            *map(str, flats),
            "--dark",
            *map(str, sorted(folder.glob("d_0[0-9][0-9]_*.png"))[:2]),
            *("-o", str(tmp_path / "p.yaml"), "--plot", str(tmp_path / "p.png"), "--quiet"),
        ]
    )
    profile = load_profile(tmp_path / "p.yaml")
    assert profile.cfa == "MONO"
    assert profile.k[0, 0] * profile.span == pytest.approx(k, rel=0.01)
    assert np.sqrt(profile.sigma2[0, 0]) * profile.span == pytest.approx(dark_std, rel=0.03)
    assert (tmp_path / "p.png").stat().st_size > 10_000


def test_a_refused_output_leaves_nothing(dng_bursts, tmp_path, refused):
    """Both files are checked before the work; neither is written without the other."""
    folder = tmp_path / "out"
    folder.mkdir()
    for profile, plot, named in (
        ("missing/p.yaml", "fit.png", "p.yaml"),
        ("p.yaml", "missing/fit.png", "fit.png"),
        ("p.yaml", f"{'x' * 250}.png", "File name too long"),
        ("p.yaml", "fit.exe", "fit.exe"),
        (".", "fit.png", "out"),
    ):
        command = ["calibrate", dng_bursts / "light1600", "-o", folder / profile, "--plot", folder / plot]
        assert named in refused(*command, "--quiet")
        assert list(folder.iterdir()) == []


def test_no_frame_is_written_over(tmp_path, rng, refused):
    """A shell puts the first frame after an -o that was left without a name."""
    frames = tmp_path / "frames"
    files = write_burst(frames, rng, scene(0.5), 1600, 3)
    (frames / "fit.png").write_bytes(b"a picture")
    link = tmp_path / "p.yaml"
    link.symlink_to(files[0])
    before = {file: file.read_bytes() for file in frames.iterdir()}
    plot, profile = frames / "fit.png", tmp_path / "q.yaml"
    for named, arguments in (
        (files[0], ["-o", files[0]]),
        (link, ["-o", link]),
        (plot, ["-o", profile, "--plot", plot]),
    ):
        assert refused("calibrate", frames, *arguments).startswith(f"fsid: {named}: ")
    assert {file: file.read_bytes() for file in frames.iterdir()} == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["frames", "p.yaml"]


def test_a_frame_of_another_size_is_named(tmp_path, rng):
    paths = write_burst(tmp_path / "frames", rng, scene(0.5, 64), 1600, 3)
    larger = write_burst(tmp_path / "larger", rng, scene(0.5, 80), 1600, 3)
    words = r"larger/000\.dng: is 80x80, the first frame 64x64; .* one mode"
    _fails(words, [*paths, larger[0]])
    dark = write_burst(tmp_path / "dark", rng, scene(0.0, 64), 1600, 3)
    binned = write_burst(tmp_path / "binned", rng, scene(0.0, 32), 1600, 3)  # has less noise
    _fails(r"binned/000\.dng: is 32x32, the first frame 64x64", paths, dark=binned)
    _fails(words, [*paths, *larger], dark=dark)


def test_what_is_wrong_with_frames_is_said_with_quiet_too(tmp_path, rng, capsys):
    write_burst(tmp_path / "frames", rng, scene(0.5), 1600, 3)
    main(["calibrate", str(tmp_path / "frames"), "-o", str(tmp_path / "p.yaml"), "--quiet"])
    out, err = capsys.readouterr()
    assert out == ""
    assert "note: ISO 1600: k is uncertain by" in err
    assert all(line.startswith("note: ") for line in err.splitlines())


def test_the_name_of_a_camera_is_printed_as_it_is(tmp_path, rng, capsys):
    write_burst(tmp_path / "frames", rng, scene(0.5), 1600, 3)
    name, source = "mine [b] [/home/me]", "bench [red], [/lab/2]"
    profile = str(tmp_path / "p.yaml")
    main(["calibrate", str(tmp_path / "frames"), "-o", profile, "--camera", name])
    assert name in capsys.readouterr().out
    save_profile(profile, replace(load_profile(profile), source=source))
    main(["profiles", profile])
    out = capsys.readouterr().out
    assert name in out
    assert source in out


def test_every_option_of_the_command_is_what_calibration_is_asked_for(tmp_path, monkeypatch):
    asked = []

    def calibrated(frames, **options):
        asked.append((frames, options))
        raise FsidError("no more of this is needed")

    monkeypatch.setattr("fsid.sensor.calibrate", calibrated)
    lit, dark = write_dn(tmp_path / "a.npy", np.zeros((4, 4))), write_dn(tmp_path / "b.npy", np.ones((4, 4)))
    command = f"calibrate {lit} -o {tmp_path}/mine.yaml --quiet"
    given = f"--dark {dark} --iso 200 --cfa GRBG --black-level 60,66,64,70 --white-level 1023 --width 8"
    for more in ("", f"{given} --height 6 --camera Mine --tie-greens", "--terms"):
        with pytest.raises(SystemExit):
            main([*command.split(), *more.split()])
    for _, options in asked:
        del options["progress"]
    usual = {
        "name": "mine",
        "dark": (),
        "layout": Layout(),
        "camera": None,
        "tie_greens": False,
        "terms": False,
    }
    layout = Layout(200.0, "GRBG", (60, 66, 64, 70), 1023, 8, 6)
    chosen = {"dark": (dark,), "layout": layout, "camera": "Mine", "tie_greens": True}
    assert asked == [((lit,), usual), ((lit,), usual | chosen), ((lit,), usual | {"terms": True})]


@pytest.mark.parametrize(("sites", "labels"), [(4, ["R", "Gr", "Gb", "B"]), (1, ["mono"])])
def test_the_table_of_a_calibration_has_each_figure_in_its_place(sites, labels):
    rows = np.arange(10.0).reshape(2, 5)[..., None] + np.arange(1, sites + 1) / 100 + 1
    profile = replace(
        PROFILE, iso=(200.0, 400.0), k=PROFILE.k[:2], sigma2=PROFILE.sigma2[:2], camera="[Mine]"
    )
    fits = tuple(NoiseFit(*row, samples=()) for row in rows)
    table = _table(Calibration(profile, fits, ()))
    assert str(table.title) == "[Mine]"
    cells = list(zip(*(column.cells for column in table.columns), strict=True))
    # k, sigma2 and their errors come first in a fit, the black level last
    assert cells == [
        (f"{iso}", label, f"{r[4, i]:.2f}", *(f"{r[at, i]:.4g}" for at in (0, 2, 1, 3)))
        for iso, r in zip((200, 400), rows, strict=True)
        for i, label in enumerate(labels)
    ]


def test_read_noise_that_reaches_zero_is_said_and_still_found(tmp_path, rng):
    paths = {
        kind: write_burst(tmp_path / kind, rng, scene(light), 12800, 10)
        for kind, light in (("light", 0.9), ("dark", 0.0))
    }
    found = calibrate(paths["light"], name="mine", dark=paths["dark"], terms=True)
    assert found.profile.terms == NoiseTerms()
    assert any("reaches DN 0" in note for note in found.notes)
    np.testing.assert_allclose(found.profile.sigma2[0], PROFILE.level(12800).sigma2, rtol=0.04)
    np.testing.assert_allclose(found.profile.measured.black, 64, atol=2)


@pytest.mark.parametrize("blacks", [((129, 2), (129, 2)), ((322, 5), (323, 5))])
def test_a_black_level_between_two_integers_rounds_nothing_twice(tmp_path, rng, blacks):
    """Noise of 0.1 DN x signal + 0.8 DN^2 above 64.5 DN; a file may state 64.4 and the next one 64.6."""
    bursts: list[list[Path]] = [[], []]
    for paths, light_dn in zip(bursts, (600 * scene().mosaic, 0 * scene().mosaic), strict=True):
        for number in range(FRAMES):
            noise = np.sqrt(0.1 * light_dn + 0.8 - 1 / 12) * rng.standard_normal(light_dn.shape)
            path = tmp_path / f"{light_dn.max():.0f}" / f"{number}.dng"
            paths.append(write_dn(path, np.rint(64.5 + light_dn + noise)))
            state_black(path, *blacks[number % 2])
    fit = calibrate(bursts[0], name="x", dark=bursts[1]).fits[0]
    np.testing.assert_allclose(fit.black, 64.5, atol=0.02)
    np.testing.assert_allclose(fit.sigma2_dn, 0.8, rtol=0.03)
    within(fit.sigma2_dn, 0.8, fit.sigma2_dn_error)
    stated = calibrate(bursts[0], name="x").fits[0]
    np.testing.assert_allclose(stated.black, blacks[0][0] / blacks[0][1])
    within(stated.sigma2_dn, 0.8, stated.sigma2_dn_error)


def _fails(match, *arguments, **options):
    with pytest.raises(FsidError, match=match) as caught:
        calibrate(*arguments, name="mine", **options)
    assert "\n" not in str(caught.value)


LAYOUT = Layout(iso=800, cfa=PROFILE.cfa, black_level=64, white_level=1023)


def test_a_frame_or_two_are_too_few(tmp_path, rng):
    light = write_burst(tmp_path / "light", rng, scene(), 400, 1)
    _fails("only 1 frame and 0 dark frames of ISO 400; a calibration needs at least 3 in all", light)
    dark = write_burst(tmp_path / "dark", rng, scene(0.0), 400, 1)
    _fails("only 1 frame and 1 dark frame of ISO 400", light, dark=dark)


def test_the_lowest_of_bare_dark_frames_is_the_black_level(tmp_path, rng):
    """Bare mosaics state no exposure, and the long dark frames may come first by name."""
    lit = write_arrays(tmp_path / "lit", [to_dn(raw) for raw in exposures(rng, scene(), 800, 10)])
    short = [to_dn(raw) for raw in exposures(rng, scene(0.0), 800, 10)]
    write_arrays(tmp_path / "dark" / "1s", [image + 30 for image in short])
    write_arrays(tmp_path / "dark" / "20ms", short)
    layout = replace(LAYOUT, black_level=None, iso=800)
    found = calibrate(lit, name="mine", dark=[tmp_path / "dark"], layout=layout)
    np.testing.assert_allclose(found.fits[0].black, 64, atol=0.5)


def test_bare_dark_frames_that_drift_are_one_burst(tmp_path, rng):
    """4 DN are 6 % of a level of 64 DN, but less than the noise: the black level is the mean of all."""
    lit = write_arrays(tmp_path / "lit", [to_dn(raw) for raw in exposures(rng, scene(), 3200, 10)])
    dark = [to_dn(raw) + 4 * (number % 2) for number, raw in enumerate(exposures(rng, scene(0.0), 3200, 10))]
    paths = write_arrays(tmp_path / "dark", dark)
    fit = calibrate(lit, name="x", dark=paths, layout=replace(LAYOUT, iso=3200, black_level=None)).fits[0]
    np.testing.assert_allclose(fit.black, 66, atol=0.5)
    np.testing.assert_allclose(fit.sigma2_dn / 959**2, PROFILE.level(3200).sigma2, rtol=0.05)


def test_frames_of_a_burst_are_like_its_first_one(tmp_path, rng):
    """Within 3 % of its light, however slowly that changes; dark ones within three times their noise, by
    pixels of one site."""
    levels = (100.0, 102.0, 104.0, 106.0, 109.5)
    frames = [Frame(Path(f"{level}"), 100.0, 0.0, level, 0.03 * level) for level in levels]
    assert [[frame.level for frame in burst] for burst in bursts(frames)] == [[100, 102], [104, 106], [109.5]]
    sites = np.kron(np.ones((64, 64), np.int64), np.array([[200, 240], [260, 220]]))
    images = [np.rint(sites + 12 * rng.standard_normal(sites.shape)).astype(np.uint16) for _ in range(2)]
    paths = write_arrays(tmp_path, images)
    found = find_frames(paths[:1], paths[1:], LAYOUT)
    assert found.frames[0].same_dn == pytest.approx(0.03 * images[0].mean())
    assert found.dark[0].same_dn == pytest.approx(3 * 12, rel=0.05)


def test_a_frame_counts_once_and_hidden_files_and_what_lies_beside_frames_not_at_all(tmp_path, rng):
    folder = tmp_path / "iso100" / "iso800" / "deeper"
    frames = write_arrays(folder, [to_dn(raw) for raw in exposures(rng, scene(), 800, 5)])
    beside = (
        "000.JPG",
        "000.heic",
        "000.xmp",
        "Thumbs.db",
        "desktop.ini",
        "notes.txt",
        "levels.csv",
        "a.json",
    )
    for name in (".DS_Store", *beside, "mine.yaml", "README.md"):
        (folder / name).write_bytes(b"no frame")
    found = find_frames([tmp_path, *frames], [], replace(LAYOUT, iso=None))
    assert [frame.path for frame in found.frames] == frames
    assert {frame.iso for frame in found.frames} == {800}


def test_a_black_level_that_dark_frames_miss_is_noted(tmp_path, rng):
    lit = write_arrays(tmp_path / "lit", [to_dn(raw) for raw in exposures(rng, scene(), 800, 6)])
    dark = write_arrays(tmp_path / "dark", [to_dn(raw) for raw in exposures(rng, scene(0.0), 800, 6)])
    for stated, is_noted in ((LAYOUT.black_level, False), (LAYOUT.black_level + 6, True)):
        found = calibrate(lit, name="x", dark=dark, layout=replace(LAYOUT, black_level=stated))
        assert any(f"--black-level is {stated}" in note for note in found.notes) == is_noted


def test_a_black_level_of_files_that_dark_frames_miss_is_kept(tmp_path, rng):
    """Of RAW files, which nobody stated: from a DN on, or from their noise on."""
    for iso, off_dn, is_noted in ((800, 20, True), (12800, 20, False)):
        clean, covered = (replace(scene(light), black_level=64 + off_dn) for light in (0.8, 0.0))
        paths = []
        for name, what in (("lit", clean), ("dark", covered)):
            folder = tmp_path / f"{name}{iso}"
            folder.mkdir()
            for number, raw in enumerate(exposures(rng, what, iso, 4)):
                dn = to_dn(raw).astype(np.float32)
                told = replace(raw, mosaic=(dn - 64) / 959, black_level=64)
                write_dng(folder / f"{number}.dng", told)
            paths.append(folder)
        found = calibrate(paths[0], name="x", dark=paths[1])
        assert any("the files' black level is 64" in note for note in found.notes) == is_noted
        np.testing.assert_allclose(found.fits[0].black, 64 + off_dn, atol=2)


def test_what_happened_in_a_burst_is_said_with_its_size(tmp_path, rng):
    def notes(name: str, images: list[np.ndarray]) -> str:
        found = calibrate(write_arrays(tmp_path / name, images), name="x", layout=LAYOUT)
        k_error = np.max(found.fits[0].k_dn_error / found.fits[0].k_dn)
        assert (f"k is uncertain by {100 * k_error:.1f} %" in "".join(found.notes)) == (k_error > 0.02)
        return " ".join(found.notes)

    lamp = replace(scene(), mosaic=0.1 + 0.5 * scene().mosaic)
    dimmed = replace(lamp, mosaic=np.float32(0.98) * lamp.mosaic)
    flicker = [to_dn(exposures(rng, what, 800, 1)[0]) for what in (lamp, dimmed) * 3]
    drift_dn = re.search(r"level of 1 burst drifted by up to ([\d.]+) DN", notes("flicker", flicker))
    assert float(drift_dn[1]) == pytest.approx(0.02 * 959 * lamp.mosaic.mean(), rel=0.1)
    fly = [to_dn(raw) for raw in exposures(rng, scene(), 800, 6)]
    fly[3][40:52, 60:80] = fly[3][40:52, :20]
    assert f"1 burst, the first one that of {tmp_path}/fly/000.npy: something moved" in notes("fly", fly)
    assert "k is uncertain" in notes("few", [to_dn(raw) for raw in exposures(rng, scene(side=64), 800, 4)])


def test_a_line_that_means_little_is_said(tmp_path, rng):
    """Of a black level that is too low, of compressed DN, of a read noise that no dark frame shows."""

    def notes(folder: str, images: list[np.ndarray], black: int = 64, dark: int = 0) -> str:
        paths = write_arrays(tmp_path / folder, images)
        layout = replace(LAYOUT, iso=800, black_level=black)
        return " ".join(calibrate(paths, name="x", dark=paths_dark[:dark], layout=layout).notes)

    covered = [to_dn(raw) for raw in exposures(rng, scene(0.0), 800, 6)]
    paths_dark = write_arrays(tmp_path / "dark", covered)
    lit = [to_dn(raw) for raw in exposures(rng, scene(), 800, 20)]
    bent = [np.interp(dn, [0, 200, 400, 1023], [0, 200, 300, 400]).astype(np.uint16) for dn in lit]
    assert notes("lit", lit, dark=6) == NO_COLOUR
    assert notes("lit", lit) == NO_COLOUR
    assert "black level is at least 1" in notes("lit", lit, black=44)
    assert "no straight line in light (off by " in notes("bent", bent, dark=6)
    bright = replace(scene(), mosaic=0.3 + 0.3 * scene().mosaic)
    images = [to_dn(raw) for raw in exposures(rng, bright, 800, 6)]
    assert "sigma2 is uncertain by " in notes("bright", images)
    assert "sigma2 is uncertain by " not in notes("bright", images, dark=6)


def test_sites_of_noisy_dark_frames_are_not_told_apart_by_chance(tmp_path, rng):
    """12 bits that a program stored as 16: what is 0.5 DN between the sites is a hundredth of their noise."""
    lit = write_arrays(tmp_path / "lit", [to_dn(raw) * 60 for raw in exposures(rng, scene(), 1600, 6)])
    dark = write_arrays(tmp_path / "dark", [to_dn(raw) * 60 for raw in exposures(rng, scene(0.0), 1600, 6)])
    layout = replace(LAYOUT, black_level=None, white_level=61380)
    found = calibrate(lit, name="x", dark=dark, layout=layout)
    assert np.ptp(found.fits[0].black) > 0.5
    assert not any("sites differ" in note for note in found.notes)


def test_the_black_level_is_that_of_the_isos_that_show_it_best():
    """At ISO 102400 of 16 bits it is uncertain by 5 DN, at ISO 100 by a thirtieth."""

    def fit(sigma2_dn2, black):
        dn, error = np.full(4, sigma2_dn2), np.ones(4)
        return NoiseFit(error, dn, 0.01 * error, 0.01 * dn, np.array(black), ())

    fits = {100.0: fit(66.0, [1024.0] * 4), 102400.0: fit(2e6, [1034.0, 1021.0, 1027.0, 1013.0])}
    black = np.array([each.black for each in fits.values()])
    found = site_blacks(black, np.array([each.sigma2_dn for each in fits.values()]))
    np.testing.assert_allclose(found, 1024, atol=0.01)
    fits[102400.0] = fit(2e6, [1033.0] * 4)
    assert profile_of(fits, name="x", cfa="RGGB", white_level=65535).black_level == 1024


def test_sites_of_other_black_levels_are_measured_stated_and_kept(tmp_path, rng):
    """k and sigma2 are those of the camera with and without dark frames; the profile has the true levels."""
    above = np.zeros((SIDE, SIDE), np.uint16)
    levels, truth = np.array([60, 66, 64, 70]), PROFILE.level(800)
    for (row, column), level in zip(site_offsets(PROFILE.cfa), levels, strict=True):
        above[row::2, column::2] = level - 60
    clean, covered = (replace(scene(light), black_level=60) for light in (0.8, 0.0))
    lit = write_arrays(tmp_path / "lit", [to_dn(raw) + above for raw in exposures(rng, clean, 800, 20)])
    dark = write_arrays(tmp_path / "dark", [to_dn(raw) + above for raw in exposures(rng, covered, 800, 20)])
    for black_level, frames in ((None, dark), (tuple(levels), dark), (tuple(levels), [])):
        found = calibrate(lit, name="x", dark=frames, layout=replace(LAYOUT, black_level=black_level))
        fit = found.fits[0]
        np.testing.assert_allclose(fit.black, levels, atol=0.1)
        within(fit.k_dn, np.array(truth.k) * 963, fit.k_dn_error)
        within(fit.sigma2_dn, np.array(truth.sigma2) * 963**2, fit.sigma2_dn_error)
        assert found.profile.black_level == 65
        np.testing.assert_allclose(found.profile.measured.black[0], levels, atol=0.1)
        assert any("--black-level 60,66,64,70" in note for note in found.notes)


def simulated(folder: Path, rng, light_dn, *, black: float, read_dn: float, k_dn: float, step: int = 1):
    """Twelve frames of white noise that are multiples of `step`."""
    sigma = np.sqrt(read_dn**2 + k_dn * light_dn)
    noises = rng.standard_normal((12, *light_dn.shape))
    return write_arrays(
        folder, [step * np.rint(black + light_dn + sigma * z).astype(np.uint16) for z in noises]
    )


@pytest.mark.parametrize(("black", "noted"), [(63.5, True), (64.0, False)])
def test_a_black_level_between_two_integers_is_noted(tmp_path, rng, black, noted):
    noise = {"black": black, "read_dn": 2.0, "k_dn": 0.5}
    lit, dark = (simulated(tmp_path / str(x), rng, x * scene().mosaic, **noise) for x in (500, 0))
    notes = calibrate(lit, name="x", dark=dark, layout=replace(LAYOUT, black_level=None)).notes
    assert any(note.endswith("--black-level 63.5") for note in notes) == noted


@pytest.mark.parametrize(("read_dn", "noted"), [(0.2, True), (2.0, False)])
def test_integers_with_gaps_wider_than_the_noise_are_noted(tmp_path, rng, read_dn, noted):
    """12 bits as the upper ones of 16, as PNG files have them."""
    noise = {"black": 256, "read_dn": read_dn, "k_dn": 0.5, "step": 16}
    lit, dark = (simulated(tmp_path / str(x), rng, x * scene().mosaic, **noise) for x in (900, 0))
    layout = Layout(iso=800, cfa=PROFILE.cfa, white_level=65520)
    notes = calibrate(lit, name="x", dark=dark, layout=layout).notes
    assert any("multiples of 16" in note for note in notes) == noted


def test_what_levels_contradict_is_refused(tmp_path, rng):
    lit = write_arrays(tmp_path / "lit", [to_dn(raw) for raw in exposures(rng, scene(), 800, 6)])
    dark = write_arrays(tmp_path / "dark", [to_dn(raw) for raw in exposures(rng, scene(0.0), 800, 6)])
    _fails("contradict --black-level 164", lit, dark=dark, layout=replace(LAYOUT, black_level=164))
    _fails("below the black level, 164", lit, layout=replace(LAYOUT, black_level=164))
    _fails("beyond the white level 400", lit, layout=replace(LAYOUT, white_level=400))
    _fails("--iso -100", lit, layout=replace(LAYOUT, iso=-100))
    light = np.linspace(0, 30, SIDE)
    odd = [np.rint(90 + light + (6 - light / 6) * rng.normal(size=(SIDE, SIDE))) for _ in range(8)]
    odd_files = write_arrays(tmp_path / "odd", [image.astype(np.uint16) for image in odd])
    _fails("does not grow with light", odd_files, layout=LAYOUT)


def test_raw_files_without_an_iso_are_noted_as_iso_100(tmp_path, rng):
    for number, raw in enumerate(exposures(rng, scene(), 800, 6)):
        write_dng(tmp_path / f"{number}.dng", replace(raw, iso=0.0))
    found = calibrate([tmp_path], name="mine")
    assert found.profile.iso == (100,)
    assert any("no ISO known" in note for note in found.notes)
    save_profile(tmp_path / "mine.yaml", found.profile)
    assert "noted as ISO 100" in load_profile(tmp_path / "mine.yaml").notes


def test_dark_frames_without_an_iso_are_of_that_of_the_others(tmp_path, rng):
    """A path that names a chart, ISO 12233, names no ISO."""
    noise = {"black": 64, "read_dn": 2.0, "k_dn": 0.5}
    lit = simulated(tmp_path / "iso400" / "iso12233", rng, 500 * scene().mosaic, **noise)
    dark = simulated(tmp_path / "covered", rng, 0 * scene().mosaic, **noise)
    found = calibrate(lit, name="x", dark=dark, layout=replace(LAYOUT, iso=None, black_level=None))
    assert found.profile.iso == (400,)
    assert any("12 frames" in note and "ISO 400, that of the others" in note for note in found.notes)


def test_mosaics_without_a_pattern_are_noted_as_those_of_no_filters(tmp_path, rng):
    paths = write_arrays(tmp_path, [to_dn(raw) for raw in exposures(rng, scene(), 800, 6)])
    for cfa, is_noted in ((None, True), ("MONO", False), ("RGGB", False)):
        found = calibrate(paths, name="x", layout=replace(LAYOUT, cfa=cfa))
        assert ("--cfa states its pattern" in found.profile.notes) == is_noted


def test_an_iso_that_is_given_replaces_no_other_unsaid(dng_bursts, tmp_path, rng):
    one = [dng_bursts / "light1600"]
    for given, is_noted in ((1600, False), (800, True)):
        found = calibrate(one, name="x", layout=Layout(iso=given))
        assert found.profile.iso == (given,)
        assert any(f"--iso {given}" in note for note in found.notes) == is_noted
        assert ("in place of ISO 1600" in found.profile.notes) == is_noted
    _fails("--iso 800: .*ISO 1600, .*ISO 400", [*one, dng_bursts / "light400"], layout=Layout(iso=800))
    _fails("--iso 800: .*ISO 1600, .*ISO 400", one, dark=[dng_bursts / "dark400"], layout=Layout(iso=800))
    images = [to_dn(raw) for raw in exposures(rng, scene(), 800, 6)]
    paths = [*write_arrays(tmp_path / "iso100", images[:3]), *write_arrays(tmp_path / "iso800", images[3:])]
    _fails("--iso 800: .*iso100.*ISO 100, .*iso800.*ISO 800", paths, layout=LAYOUT)
    assert calibrate(paths[3:], name="x", layout=LAYOUT).notes == (NO_COLOUR,)
    _fails("--iso nan", paths, layout=replace(LAYOUT, iso=float("nan")))
    _fails("--iso inf", paths, layout=replace(LAYOUT, iso=float("inf")))


def test_bad_bursts_are_named(tmp_path, dng_bursts, rng):
    light = dng_bursts / "light1600"
    ramp = [to_dn(raw) for raw in exposures(rng, scene(), 800, 6)]
    good = write_arrays(tmp_path / "good", ramp)
    other = tmp_path / "other.dng"
    write_dng(other, replace(exposures(rng, scene(), 1600, 1)[0], camera="Another Camera"))
    lone = tmp_path / "lone.dng"
    write_dng(lone, exposures(rng, scene(), 200, 1)[0])
    black70 = tmp_path / "black70.dng"
    write_dng(black70, replace(exposures(rng, scene(), 1600, 1)[0], black_level=70))
    _fails("other.dng.*Another Camera", [light, other])
    _fails("black70.dng.*one camera in one mode", [light, black70])
    _fails("lone.dng.*only 1 frame", [light, lone])
    _fails("only 2 frames", good[:2], layout=LAYOUT)
    _fails("000.npy.*one kind", [light, *good])
    for name in ("000.tmp", "notes.txt"):  # the second is skipped in a folder alone
        (tmp_path / name).write_bytes(b"no frame")
        for paths in ([tmp_path / name, *good], [*good, tmp_path / name], [light, tmp_path / name, *good]):
            _fails(f"{name}: is neither a RAW file nor a bare mosaic", paths)
    _fails("no such frame", [tmp_path / "none"])
    _fails("at least one burst", [])
    _fails("no dark frames and no black level", good, layout=replace(LAYOUT, black_level=None))
    _fails("states its CFA", [light], layout=LAYOUT)
    _fails("levels and size itself", [light], layout=Layout(width=192))
    _fails("frame and as a dark frame", [light], dark=[light / "000.dng"])
    _fails("not dark", [light], dark=[shutil.copytree(light, tmp_path / "lit")])
    moved = write_arrays(tmp_path / "moved", [np.roll(image, 12 * n, 1) for n, image in enumerate(ramp)])
    _fails("001.npy.*(moved|static scene)", moved, layout=LAYOUT)
    _fails("saturated", write_arrays(tmp_path / "white", [np.full((64, 64), 1023)] * 4), layout=LAYOUT)
    sites = np.kron(np.ones((32, 32), np.int64), np.array([[100, 300], [300, 200]]))
    _fails(
        "looks like a Bayer", write_arrays(tmp_path / "bayer", [sites] * 4), layout=replace(LAYOUT, cfa=None)
    )
    small = write_arrays(tmp_path / "small", [ramp[0][:64]])
    _fails("another size", [*good, *small], layout=LAYOUT)
    truncated = tmp_path / "short.dng"
    truncated.write_bytes((light / "000.dng").read_bytes()[:9000])
    _fails("short.dng.*truncated", [light, truncated])
