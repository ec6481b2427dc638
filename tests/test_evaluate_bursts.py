"""Test sets from captured bursts: the truth is better than any frame, and says by how much."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter, shift

from fsid.cli.main import main
from fsid.errors import FsidError
from fsid.evaluate import NOISY, burst_testset, compare, psnr, read_testset, simulated_testset
from fsid.evaluate.alignment import Alignment, _shown, shift_between
from fsid.evaluate.burst_truth import _frames, average
from fsid.evaluate.misalignment import _of_like_noise
from fsid.sensor import NoiseLevel, NoiseTerms, Raw, load_profile, noisy_from_clean, read_raw, write_dng
from fsid.sensor.metadata import ORIENTATION, Metadata, exposure_metadata
from fsid.sensor.tiff import SHORT, Tag
from stated_black import state_black

FRAMES = 12
PROFILE = load_profile("pixel6")


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Raw:
    root = tmp_path_factory.mktemp("clean") / "set"
    simulated_testset(
        root, camera="pixel6", isos=[1600], scenes=1, width=128, height=96, materials=["fabric"]
    )
    return read_raw(root / "fabric-00" / "clean.dng")


def _burst(
    folder: Path,
    clean: Raw,
    change=lambda raw, frame: raw,
    iso: float = 1600,
    terms: NoiseTerms = NoiseTerms(),
) -> list[Path]:
    """FRAMES noisy frames of `clean` at `iso`; change(raw, frame) alters the light of a frame."""
    folder.mkdir(parents=True)
    clean = replace(clean, black_level=PROFILE.black_level, white_level=PROFILE.white_level)
    paths = []
    for frame in range(FRAMES):
        seen = change(clean, frame)
        noisy = noisy_from_clean(np.random.default_rng(frame), seen, iso, PROFILE.level(iso), terms)
        paths.append(folder / f"{frame:03d}.dng")
        write_dng(paths[-1], noisy)
    return paths


def shifted(mosaic: np.ndarray, tiles: float) -> np.ndarray:
    """The mosaic moved down and right by a number of CFA tiles, site by site."""
    out = np.empty_like(mosaic)
    for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
        out[row::2, column::2] = shift(mosaic[row::2, column::2], (tiles, tiles), order=3, mode="grid-wrap")
    return out.clip(0, 1)


def test_the_error_of_the_truth_is_what_it_says(clean: Raw, tmp_path: Path):
    paths = _burst(tmp_path / "b", clean)
    truth, quality, _ = average(paths[1:], paths[0])
    inner = clean.mosaic < 0.9
    error = (truth.mosaic - clean.mosaic)[inner].std()
    assert quality.frames == FRAMES - 1
    assert quality.error == pytest.approx(error, rel=0.1)
    assert psnr(truth.mosaic, clean.mosaic) > psnr(read_raw(paths[0]).mosaic, clean.mosaic) + 9


@pytest.mark.parametrize("tiles", [0.05, 0.12])
def test_a_first_frame_beside_the_others_limits_the_truth(clean: Raw, tmp_path: Path, tiles: float):
    beside = replace(clean, mosaic=shifted(clean.mosaic, tiles))
    paths = _burst(
        tmp_path / "b", clean, lambda raw, f: raw if f else replace(raw, mosaic=beside.mosaic), 400
    )
    truth, quality, _ = average(paths[1:], paths[0])
    assert quality.left_out == 0
    assert quality.psnr == pytest.approx(psnr(truth.mosaic, beside.mosaic), abs=1)
    assert quality.psnr < psnr(truth.mosaic, clean.mosaic) - 3


@pytest.mark.parametrize("moving", ["trembles", "sinks"])
def test_fine_print_before_a_camera_that_moves_limits_the_truth(clean: Raw, tmp_path: Path, moving: str):
    """By less than a sixth of a tile: no frame shows it by itself, and the gradient of one plane of such
    print is not that of the print (the truth was said to be 10 dB better than it is)."""
    rng = np.random.default_rng(3)
    steps = rng.normal(0, 1.0, (FRAMES, 2)) if moving == "trembles" else np.linspace(0, 2, FRAMES)[:, None]
    fine = 10 * 32  # positions in a pixel that strokes of 0.6 px show
    strokes = np.kron(rng.random((fine // 6 + 9, fine // 6 + 9)) < 0.5, np.ones((6, 6)))
    pages = []
    for down, right in np.rint(np.broadcast_to(steps, (FRAMES, 2))).astype(int) + 20:
        seen = strokes[down : down + fine, right : right + fine].reshape(32, 10, 32, 10).mean((1, 3))
        pages.append(np.tile(0.05 + 0.3 * seen, (4, 4)).astype(np.float32))
    paths = _burst(tmp_path / "b", clean, lambda raw, f: replace(raw, mosaic=pages[f]), iso=400)
    truth, quality, _ = average(paths[1:], paths[0])
    assert quality.left_out == 0
    assert quality.psnr == pytest.approx(psnr(truth.mosaic, pages[0]), abs=1)


@pytest.mark.parametrize("row", [0.0, 0.2])
def test_bands_of_a_flickering_lamp_limit_the_truth(clean: Raw, tmp_path: Path, row: float):
    """A rolling shutter makes rows of it, in every frame at another place; noise of rows limits nothing."""
    rng = np.random.default_rng(1)
    bands = [
        1 + (0 if row else 0.03) * np.sin(np.arange(96) / 9 + phase)[:, None]
        for phase in rng.uniform(0, 2 * np.pi, FRAMES)
    ]
    paths = _burst(
        tmp_path / "b",
        clean,
        lambda raw, f: replace(raw, mosaic=(raw.mosaic * bands[f]).astype(np.float32)),
        iso=400,
        terms=NoiseTerms(row=row),
    )
    truth, quality, _ = average(paths[1:], paths[0])
    assert quality.psnr == pytest.approx(psnr(truth.mosaic, clean.mosaic * bands[0]), abs=1)


@pytest.mark.parametrize("black_sigma", [0.0, 0.5, 1.0, 4.0])
def test_noise_that_is_cut_off_at_dn_0_lights_no_truth(clean: Raw, tmp_path: Path, black_sigma: float):
    """The mean of 24 such frames was too bright by 0.4, 0.2 and 0.1 sigma in the dark, and said to be 4 dB
    better than it was."""
    sigma = 8.0
    black, white = int(black_sigma * sigma), 1023
    across = np.linspace(0, 1, 96, dtype=np.float32)
    light = 0.03 * across * (1 + np.sin(np.arange(64, dtype=np.float32) / 5)[:, None])
    noise = NoiseLevel((1 / (white - black),) * 4, ((sigma / (white - black)) ** 2,) * 4)
    dim = replace(clean, mosaic=light, black_level=black, white_level=white, iso=1600)
    folder = tmp_path / "captures" / "a" / "1lux"
    folder.mkdir(parents=True)
    for frame in range(25):
        noisy = noisy_from_clean(np.random.default_rng(frame), dim, 1600, noise)
        write_dng(folder / f"{frame:03d}.dng", noisy)
    testset, (quality,) = burst_testset(tmp_path / "captures", tmp_path / "set")
    truth = read_raw(testset.clean(tmp_path / "set", testset.images[0], "1lux")).mosaic
    dark = light * (white - black) < sigma / 4
    assert abs((truth - light)[dark].mean()) * (white - black) < 0.06 * sigma
    assert quality.psnr == pytest.approx(psnr(truth, light), abs=0.8)


def test_noise_that_is_cut_off_at_white_darkens_no_truth(clean: Raw, tmp_path: Path):
    """The mean of 24 such frames was too dark by 0.013 next to white, and said to be 2.4 dB better than it
    was."""
    across = np.linspace(0.8, 1.06, 128, dtype=np.float32)
    light = across * (1 + 0.02 * np.sin(np.arange(96, dtype=np.float32) / 5)[:, None])
    bright = replace(clean, mosaic=light, black_level=64, white_level=1023, iso=3200)
    paths = []
    for frame in range(25):
        noisy = noisy_from_clean(np.random.default_rng(frame), bright, 3200, PROFILE.level(3200))
        paths.append(tmp_path / f"{frame:03d}.dng")
        write_dng(paths[-1], noisy)
    truth, quality, _ = average(paths[1:], paths[0])
    near = (light > 0.97) & (light < 1)
    assert abs((truth.mosaic - light)[near].mean()) < 0.001
    assert quality.psnr == pytest.approx(psnr(truth.mosaic, light), abs=0.8)


def test_flicker_is_divided_out(clean: Raw, tmp_path: Path):
    flicker = 1 + 0.08 * np.sin(np.arange(FRAMES) * 2.0)
    flicker[0] = 1
    paths = _burst(
        tmp_path / "b", clean, lambda raw, f: replace(raw, mosaic=raw.mosaic * np.float32(flicker[f]))
    )
    truth, quality, _ = average(paths[1:], paths[0])
    assert quality.flicker == pytest.approx(np.abs(flicker[1:] - 1).max(), rel=0.1)
    assert (truth.mosaic - clean.mosaic)[clean.mosaic < 0.8].std() < 1.3 * quality.error


@pytest.mark.parametrize("drift_dn", [0.0, 0.4])
def test_a_drifting_black_level_is_no_flicker(clean: Raw, tmp_path: Path, drift_dn: float):
    """A lamp in a dark room: 0.4 DN are a sixth of the mean light, which scaled the lamp by as much."""
    mosaic = 0.02 * gaussian_filter(clean.mosaic, 4)
    mosaic[40:60, 40:72] = 0.1
    lamp = replace(clean, mosaic=mosaic)
    drifts = np.float32(drift_dn / PROFILE.span) * np.cos(2.5 * np.arange(FRAMES, dtype=np.float32))
    paths = _burst(tmp_path / "b", lamp, lambda raw, f: replace(raw, mosaic=raw.mosaic + drifts[f]), iso=100)
    truth, quality, _ = average(paths[1:], paths[0])
    error = truth.mosaic - lamp.mosaic - drifts[0]
    assert (quality.frames, quality.flicker) == (FRAMES - 1, 0)
    assert quality.psnr == pytest.approx(-10 * np.log10(np.mean(error**2)), abs=0.5)


def test_whole_shifts_are_undone_and_others_left_out(clean: Raw, tmp_path: Path):
    def moved(raw: Raw, frame: int) -> Raw:
        if frame == 3:
            return replace(raw, mosaic=np.roll(raw.mosaic, (4, -6), (0, 1)))
        if frame == 5:
            return replace(raw, mosaic=shifted(raw.mosaic, 0.5))
        return raw

    paths = _burst(tmp_path / "b", clean, moved)
    truth, quality, window = average(paths[1:], paths[0])
    assert quality.left_out == 1
    assert quality.shift_px == pytest.approx(np.hypot(4, 6))
    seen = clean.mosaic[window]
    assert (truth.mosaic - seen)[seen < 0.9].std() < 1.3 * quality.error


def test_frames_are_put_back_and_then_brought_to_the_light_of_the_first(clean: Raw, tmp_path: Path):
    """Less their offset, then over their gain; of a plane that was rolled, what did not come round."""
    write_dng(tmp_path / "a.dng", clean)
    stored = read_raw(tmp_path / "a.dng").mosaic
    aligned = Alignment(tmp_path / "a.dng", (2, -4), 0.8, 0.05, 0.0, 1.0, (0.0, 0.0))
    (found,) = _frames([aligned], np.s_[2:90, 0:120])
    np.testing.assert_allclose(found, (stored[:88, 4:124] - 0.05) / 0.8, atol=1e-6)
    plane = np.arange(80).reshape(8, 10)
    np.testing.assert_array_equal(np.roll(plane, (2, -3), (0, 1))[_shown(np.array((2, -3)))], plane[:-2, 3:])
    assert plane[_shown(np.zeros(2, int))].shape == plane.shape


@pytest.mark.parametrize("power", [1, 2])
def test_frames_of_other_light_are_given_the_noise_of_the_first(power: int):
    """Divided by their gain, shot noise has its variance over that, and read noise over its square."""
    gains = np.array([0.85, 0.95, 1.0, 1.2])
    noise = np.random.default_rng(0).standard_normal((4, 50_000))
    noise /= noise.std(axis=1, keepdims=True)
    times = _of_like_noise(noise / gains[:, None] ** (power / 2), np.log(gains))
    np.testing.assert_allclose(times, gains ** (power / 2), rtol=1e-3)


def test_a_far_move_over_a_smooth_texture_is_seen():
    rng = np.random.default_rng(0)
    for _ in range(6):
        texture = gaussian_filter(rng.standard_normal((400, 400)), 3)
        scene = 0.2 + 0.05 * texture / texture.std()
        tiles = rng.integers(6, 20, 2)
        planes = scene[50:350, 50:350], np.roll(scene, tiles, axis=(0, 1))[50:350, 50:350]
        ours, theirs = (plane + 0.001 * rng.standard_normal(plane.shape) for plane in planes)
        whole, rest = shift_between(theirs, ours)
        np.testing.assert_allclose(whole + rest, -tiles, atol=0.3)


@pytest.mark.parametrize("iso", [1600, 25600])
def test_noise_moves_no_frame_of_a_smooth_scene(clean: Raw, tmp_path: Path, iso: int):
    """A shift along a gradient is hard to see: the estimates are up to 7 tiles off."""
    down, right = np.mgrid[:192, :256] / 256
    smooth = replace(clean, mosaic=(0.05 + 0.2 * right * (0.5 + down)).astype(np.float32))
    paths = _burst(tmp_path / "b", smooth, iso=iso)
    truth, quality, _ = average(paths[1:], paths[0])
    assert (quality.frames, quality.shift_px) == (FRAMES - 1, 0)
    assert (truth.mosaic - smooth.mosaic).std() == pytest.approx(quality.error, rel=0.1)


def test_noise_of_rows_moves_no_frame(clean: Raw, tmp_path: Path):
    """Rows of common noise look like a picture that shifts down, if every pixel counts by itself."""
    dim = replace(clean, mosaic=0.05 * gaussian_filter(np.tile(clean.mosaic, (2, 2)), 2))
    paths = _burst(tmp_path / "b", dim, iso=3200, terms=NoiseTerms(row=0.3))
    _, quality, _ = average(paths[1:], paths[0])
    assert (quality.frames, quality.shift_px) == (FRAMES - 1, 0)


@pytest.mark.parametrize("tiles", [0.3, 3])
def test_a_lamp_in_the_dark_that_moved_is_seen(clean: Raw, tmp_path: Path, tiles: float):
    mosaic = np.full_like(clean.mosaic, 0.005)
    mosaic[40:52, 60:80] = 0.3
    lamp = replace(clean, mosaic=mosaic)
    moved = replace(lamp, mosaic=shifted(mosaic, tiles))
    paths = _burst(
        tmp_path / "b", lamp, lambda raw, f: replace(raw, mosaic=(moved if f == 4 else lamp).mosaic)
    )
    _, quality, _ = average(paths[1:], paths[0])
    assert quality.left_out == (tiles < 1)
    assert quality.shift_px == pytest.approx(2 * tiles * np.sqrt(2) * (tiles >= 1))


def test_a_first_frame_that_the_shutter_shook_leaves_no_bare_edge(clean: Raw, tmp_path: Path):
    def shaken(raw: Raw, frame: int) -> Raw:
        return replace(raw, mosaic=np.roll(raw.mosaic, (4, -6), (0, 1))) if frame else raw

    _burst(tmp_path / "captures" / "fabric" / "1lux", clean, shaken)
    testset, (quality,) = burst_testset(tmp_path / "captures", tmp_path / "set")
    image = testset.images[0]
    truth = read_raw(testset.clean(tmp_path / "set", image, "1lux"))
    noisy = read_raw(testset.noisy(tmp_path / "set", image, "1lux"))
    height, width = clean.mosaic.shape
    assert truth.mosaic.shape == noisy.mosaic.shape == (height - 4, width - 6)
    assert (truth.mosaic - clean.mosaic[:-4, 6:])[clean.mosaic[:-4, 6:] < 0.9].std() < 1.3 * quality.error
    expected = psnr(noisy.mosaic, clean.mosaic[:-4, 6:])
    assert psnr(noisy.mosaic, truth.mosaic) == pytest.approx(expected, abs=0.5)


def test_a_black_level_between_two_integers_leaves_the_noisy_frame_as_it_is(clean: Raw, tmp_path: Path):
    paths = _burst(tmp_path / "captures" / "star" / "1lux", clean)
    for path in paths:
        state_black(path, 129, 2)
    testset, _ = burst_testset(tmp_path / "captures", tmp_path / "set")
    noisy = read_raw(testset.noisy(tmp_path / "set", testset.images[0], "1lux"))
    np.testing.assert_allclose(noisy.mosaic, read_raw(paths[0]).mosaic, atol=1e-6)


@pytest.mark.parametrize("change", ["moved", "brighter"])
def test_further_noisy_frames_are_those_that_the_truth_fits(clean: Raw, tmp_path: Path, change: str):
    def second(raw: Raw, frame: int) -> Raw:
        other = np.roll(raw.mosaic, (4, -6), (0, 1)) if change == "moved" else raw.mosaic * np.float32(1.1)
        return replace(raw, mosaic=other) if frame == 1 else raw

    _burst(tmp_path / "captures" / "fabric" / "1lux", clean, second)
    testset, (quality,) = burst_testset(tmp_path / "captures", tmp_path / "set", frames=3)
    image = testset.images[0]
    truth = read_raw(testset.clean(tmp_path / "set", image, "1lux"))
    first, *others = (
        psnr(read_raw(testset.noisy(tmp_path / "set", image, "1lux", n)).mosaic, truth.mosaic)
        for n in range(3)
    )
    assert others == pytest.approx([first] * 2, abs=0.5)
    assert quality.frames == FRAMES - 3


def test_too_few_still_frames_for_the_noisy_ones_are_named(clean: Raw, tmp_path: Path):
    steps = 1 + 0.04 * np.arange(FRAMES)
    _burst(tmp_path / "a" / "b" / "c", clean, lambda r, f: replace(r, mosaic=r.mosaic * np.float32(steps[f])))
    with pytest.raises(FsidError, match="--frames 3: only 1 of 12"):
        burst_testset(tmp_path / "a", tmp_path / "set", frames=3)


@pytest.mark.parametrize(
    ("name", "iso", "times"),
    [
        ("pixel6", 400, None),
        ("pixel6", 25600, None),
        ("galaxy-s22", 1600, 0.5),
        ("pixel9-pro-tele", 1600, 0.3),
    ],
)
def test_noise_that_is_not_that_of_the_profile_is_said(clean: Raw, tmp_path: Path, capsys, name, iso, times):
    """Any camera's profile was taken for the bursts of any other, without a word."""
    _burst(tmp_path / "captures/star/1lux", clean, iso=iso)
    out = str(tmp_path / "out")
    main(["testset", "from-bursts", str(tmp_path / "captures"), "-o", out, "--camera", name, "--quiet"])
    said = " ".join(capsys.readouterr().err.split())
    assert ("states another noise than 1 of 1 bursts have" in said) == (times is not None)
    if times:
        found = float(said.partition("that of star/1lux has ")[2].split()[0])
        assert found == pytest.approx(times, rel=0.4)


def test_captures_of_another_pattern_than_the_profiles_are_said(clean: Raw, tmp_path: Path):
    _burst(tmp_path / "captures/star/1lux", replace(clean, cfa="RGGB"))
    lines: list[str] = []
    burst_testset(tmp_path / "captures", tmp_path / "out", camera="pixel6", note=lines.append)
    assert f"its CFA and white level are RGGB and 1023, those of profile pixel6 {PROFILE.cfa}" in lines[0]


def test_a_frame_whose_noise_nothing_tells_is_named(clean: Raw, tmp_path: Path, monkeypatch):
    def no_smooth_part(raw: Raw) -> None:
        raise FsidError("no smooth part")

    monkeypatch.setattr("fsid.evaluate.bursts.estimate_noise", no_smooth_part)
    first, *_ = _burst(tmp_path / "captures/star/1lux", clean)
    for path in first.parent.iterdir():
        write_dng(path, replace(read_raw(path), noise=None))
    with pytest.raises(FsidError, match=r"star/1lux/000\.dng: no smooth part; --camera names a profile"):
        burst_testset(tmp_path / "captures", tmp_path / "out")


def test_a_noise_profile_that_states_nothing_is_none(clean: Raw, tmp_path: Path):
    paths = _burst(tmp_path / "captures/star/1lux", clean)
    raws = [read_raw(path) for path in paths]
    for value, iso in ((0.0, 1600), (-1e-6, 0)):
        for path, raw in zip(paths, raws, strict=True):
            noise = NoiseLevel((value,) * 4, (value,) * 4)
            write_dng(path, replace(raw, iso=iso, noise=noise, metadata=Metadata()))
        if value == 0:
            testset, _ = burst_testset(tmp_path / "captures", tmp_path / "zeros")
            found = read_raw(testset.noisy(tmp_path / "zeros", testset.images[0], "1lux")).noise
            assert found is not None
            assert 0.5 < found.k[1] / PROFILE.level(1600).k[1] < 2
    with pytest.raises(
        FsidError, match=r"000\.dng: its NoiseProfile holds a variance below 0; --camera names"
    ):
        burst_testset(tmp_path / "captures", tmp_path / "below")
    with pytest.raises(FsidError, match=r"000\.dng: its ISO is unknown; --camera pixel6 needs"):
        burst_testset(tmp_path / "captures", tmp_path / "no-iso", camera="pixel6")
    assert not (tmp_path / "below").exists()


def test_hidden_files_and_what_lies_beside_the_raws_are_no_frames(clean: Raw, tmp_path: Path):
    paths = _burst(tmp_path / "captures" / "fabric" / "1lux", clean)
    for name in ("000.jpg", "000.xmp", "._000.dng", "Thumbs.db", "notes.txt"):
        paths[0].with_name(name).write_bytes(b"no RAW")
    for hidden in (".thumbnails/1lux", "fabric/.cache"):
        (tmp_path / "captures" / hidden).mkdir(parents=True)
    testset, _ = burst_testset(tmp_path / "captures", tmp_path / "set")
    assert testset.levels == ("1lux",)


@pytest.mark.parametrize("frames", [5, FRAMES])
def test_a_fly_on_the_chart_is_an_outlier(clean: Raw, tmp_path: Path, frames: int):
    def fly(raw: Raw, frame: int) -> Raw:
        mosaic = raw.mosaic.copy()
        if frame == 4:
            mosaic[20:30, 40:50] = 0.9
        return replace(raw, mosaic=mosaic)

    paths = _burst(tmp_path / "b", clean, fly)[:frames]
    truth, quality, _ = average(paths[1:], paths[0])
    error = np.abs(truth.mosaic - clean.mosaic)[20:30, 40:50].mean()
    assert error < 3 * quality.error
    assert quality.outliers > 0
    inner = clean.mosaic < 0.9
    assert quality.error == pytest.approx((truth.mosaic - clean.mosaic)[inner].std(), rel=0.15)


def test_the_command_makes_a_set_that_evaluate_reads(clean: Raw, tmp_path: Path, capsys):
    for level in ("0.5lux", "5lux"):
        _burst(tmp_path / "captures" / "fabric" / level, clean)
    out = tmp_path / "set"
    main(["testset", "from-bursts", str(tmp_path / "captures"), "-o", str(out), "--frames", "2", "--quiet"])
    testset = read_testset(out)
    assert (testset.levels, testset.frames) == (("0.5lux", "5lux"), 2)
    with (out / "truth.csv").open() as stream:
        lines = list(csv.DictReader(stream))
    assert {line["frames"] for line in lines} == {str(FRAMES - 2)}
    assert float(lines[0]["psnr"]) > 40
    noisy = read_raw(testset.noisy(out, testset.images[0], "5lux", 1))
    assert noisy.noise is not None
    assert np.mean(noisy.noise.k) == pytest.approx(np.mean(PROFILE.level(1600).k), rel=0.01)
    main(["evaluate", str(out), "-o", str(tmp_path / "results")])
    assert "fabric" in capsys.readouterr().out
    limits = ", ".join(f"{float(line['psnr']):.1f} dB at {line['level']}" for line in lines)
    assert f"its own PSNR in RAW ({limits}, of" in (tmp_path / "results/report.html").read_text()


def test_the_report_names_captures_and_shows_them_upright(clean: Raw, tmp_path: Path):
    turned = replace(clean, metadata=Metadata(first=(Tag(ORIENTATION, SHORT, (6,)),)))
    _burst(tmp_path / "captures" / "fabric" / "1lux", turned)
    burst_testset(tmp_path / "captures", tmp_path / "set")
    crops = compare(tmp_path / "set", [NOISY], crop_levels=["1lux"], crop_px=200).crops[0]
    assert (crops.image, crops.level) == ("fabric", "1lux")
    height, width = clean.mosaic.shape
    assert crops.truth.shape == crops.by_method["noisy"].shape == (width, height, 3)


def test_a_burst_that_moves_all_the_time_is_refused(clean: Raw, tmp_path: Path, refused):
    def blurred(raw: Raw, frame: int) -> Raw:
        return replace(raw, mosaic=shifted(raw.mosaic, frame + 0.5 * (frame > 0)))

    _burst(tmp_path / "captures" / "fabric" / "1lux", clean, blurred)
    assert "lie still" in refused(
        "testset", "from-bursts", tmp_path / "captures", "-o", tmp_path / "set", "--quiet"
    )
    assert not (tmp_path / "set").exists()


@pytest.mark.parametrize(
    ("light", "words"),
    [
        ([1.0, *[0.4, 2.0] * 5, 0.4], r"lie still.*; 11 differ from the first in brightness by .*\. Lock"),
        ([1.0, *[0.4] * 11], r"000\.dng: 11 of the 11 other frames .* brightness .* remove this first frame"),
        ([0.0, *[1.0] * 11], r"000\.dng: shows no light"),
        ([50.0] * 12, r"000\.dng: \d+ % .* saturated"),
    ],
    ids=["flicker", "a first frame of its own", "no light", "saturated"],
)
def test_what_spoils_a_burst_is_named(clean: Raw, tmp_path: Path, light: list[float], words: str):
    def lit(raw: Raw, frame: int) -> Raw:
        return replace(raw, mosaic=raw.mosaic * np.float32(light[frame]))

    paths = _burst(tmp_path / "b", clean, lit)
    with pytest.raises(FsidError, match=words) as caught:
        average(paths[1:], paths[0])
    assert "tripod" not in str(caught.value)


@pytest.mark.parametrize(
    ("odd", "words"),
    [
        ({"camera": "Other Phone"}, "camera Other Phone differs from"),
        ({"mosaic": np.full((64, 96), 0.2, np.float32)}, "size 96x64 differs from 128x96"),
        ({"cfa": "RGGB"}, "filter pattern RGGB differs from GBRG"),
        ({"white_level": 4095}, "white level 4095 differs from 1023"),
        ({"black_level": 80}, "black level 80 differs from 64"),
        ({"iso": 800.0}, "ISO 800 differs from 1600"),
        ({"metadata": exposure_metadata(exposure_s=0.01)}, "exposure time in s 0.01 differs from 0.02"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_a_frame_of_another_camera_or_setting_is_named(clean: Raw, tmp_path: Path, odd, words, refused):
    known = replace(clean, metadata=exposure_metadata(exposure_s=0.02))
    paths = _burst(tmp_path / "captures" / "star" / "1lux", known)
    write_dng(paths[5], replace(read_raw(paths[5]), **odd))
    told = refused("testset", "from-bursts", tmp_path / "captures", "-o", tmp_path / "set", "--quiet")
    assert f"005.dng: {words}" in told


def test_black_levels_and_times_that_phones_measure_anew_are_those_of_one_burst(clean: Raw, tmp_path: Path):
    known = replace(clean, metadata=exposure_metadata(exposure_s=0.02))
    paths = _burst(tmp_path / "b", known)
    other = replace(read_raw(paths[5]), black_level=66, metadata=exposure_metadata(exposure_s=0.0202))
    write_dng(paths[5], other)
    assert average(paths[1:], paths[0])[1].frames == FRAMES - 1


def test_what_a_file_states_is_checked_before_a_burst_is_averaged(clean: Raw, tmp_path: Path, monkeypatch):
    """Averaging takes minutes, and what is finished is lost with the rest."""
    monkeypatch.setattr("fsid.evaluate.bursts.average", lambda *of: pytest.fail("was averaged"))
    for scene in ("a", "b"):
        paths = _burst(tmp_path / "captures" / scene / "1lux", clean)
    write_dng(paths[0], replace(read_raw(paths[0]), noise=NoiseLevel((-1.0,) * 4, (1e-4,) * 4)))
    with pytest.raises(FsidError, match=f"{paths[0]}.*below 0"):
        burst_testset(tmp_path / "captures", tmp_path / "set")
    write_dng(paths[0], replace(read_raw(paths[0]), noise=None))
    write_dng(paths[3], replace(read_raw(paths[3]), iso=800.0))
    with pytest.raises(FsidError, match=f"{paths[3]}: ISO 800"):
        burst_testset(tmp_path / "captures", tmp_path / "set")


def test_bursts_of_two_cameras_are_no_test_set(clean: Raw, tmp_path: Path, refused):
    """The set states one camera, and results name it: the second one's would be taken for its."""
    captures = tmp_path / "captures"
    _burst(captures / "a" / "1lux", clean)
    _burst(captures / "b" / "1lux", replace(clean, camera="Other Phone"))
    told = refused("testset", "from-bursts", captures, "-o", tmp_path / "set", "--quiet")
    assert "000.dng: is from camera 'Other Phone'" in told


def test_a_scene_that_no_test_set_can_have_is_refused_before_the_work(clean: Raw, tmp_path: Path):
    for scene in ("all", "star"):
        _burst(tmp_path / "captures" / scene / "1lux", clean)
    done: list[int] = []
    with pytest.raises(FsidError, match="all: means all sets together"):
        burst_testset(tmp_path / "captures", tmp_path / "set", progress=lambda n, total: done.append(n))
    assert not done


@pytest.mark.parametrize("missing", ["frames", "level", "all"])
def test_what_is_missing_is_named(clean: Raw, tmp_path: Path, missing: str, refused):
    captures = tmp_path / "captures"
    captures.mkdir()
    if missing != "all":
        _burst(captures / "a" / "1lux", clean)
        other = _burst(captures / "b" / ("2lux" if missing == "level" else "1lux"), clean)
        for path in other[2:] if missing == "frames" else []:
            path.unlink()
    words = {"frames": "holds 2 frames", "level": "has no burst", "all": "holds no bursts"}[missing]
    assert words in refused("testset", "from-bursts", captures, "-o", tmp_path / "set", "--quiet")
