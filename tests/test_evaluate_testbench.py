"""The simulated test materials: reproducible, in range, textured, and lit by the exposure model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fsid.cli.main import main
from fsid.evaluate import read_testset, simulated_testset
from fsid.evaluate.testbench import MATERIALS, simulate
from fsid.evaluate.testbench.prints import _screen
from fsid.evaluate.testbench.surface import light_rand, sheet
from fsid.sensor import light_level, load_profile, pack, read_raw
from fsid.sensor.dng import read_header
from fsid.sensor.light import GREY, KEY


@pytest.mark.parametrize("material", MATERIALS)
def test_a_material_is_a_function_of_its_seed_and_has_detail(material: str):
    first, again, other = (simulate(np.random.default_rng(seed), material, 96, 128) for seed in (1, 1, 2))
    assert first.shape == (96, 128, 3)
    assert first.dtype == np.float32
    assert np.array_equal(first, again)
    assert np.abs(first - other).mean() > 0.01
    assert np.isfinite(first).all()
    assert first.min() >= 0
    assert 0.02 < first.mean() < 1
    assert np.abs(np.diff(first.mean(-1), axis=1)).mean() > 0.002


def test_a_matt_sheet_sends_back_its_albedo_in_the_middle():
    """Where the lamp was metered, whatever its place: ambient and direct light add up to 1."""
    for seed in range(5):
        light = light_rand(np.random.default_rng(seed), sheet(128, 128, (0.5, 0.5, 0.5)))
        assert light[32, 32] == pytest.approx(0.5, rel=0.05)


def test_a_halftone_prints_as_much_ink_as_is_asked_for():
    x, y = np.arange(400)[None, :], np.arange(400)[:, None]
    for ink in (0.2, 0.5, 0.8):
        assert np.mean(ink > _screen(x, y, 7.3, 15.0)) == pytest.approx(ink, abs=0.08)


def test_the_command_makes_ten_materials_at_light_levels_in_lux(tmp_path: Path):
    out = tmp_path / "set"
    size = ("--width", "96", "--height", "64", "--scenes", "1", "--frames", "2")
    main(["testset", "simulate", "--camera", "pixel6", "--lux", "0.5", "5", "-o", str(out), *size, "--quiet"])
    testset = read_testset(out)
    assert testset.levels == ("0.5lux", "5lux")
    assert [image.set for image in testset.images] == list(MATERIALS)
    image = testset.images[0]
    frames = [read_raw(testset.noisy(out, image, "0.5lux", n)) for n in range(2)]
    truth = read_raw(testset.clean(out, image, "0.5lux"))
    assert frames[0].mosaic.shape == truth.mosaic.shape == (64, 96)
    assert not np.array_equal(frames[0].mosaic, frames[1].mosaic)
    expected = light_level(load_profile("pixel6"), 0.5, highest_iso=np.inf).iso
    assert frames[0].iso == pytest.approx(expected, rel=0.01)
    bright = read_raw(testset.noisy(out, image, "5lux"))
    assert np.var(frames[0].mosaic - truth.mosaic) > 3 * np.var(bright.mosaic - truth.mosaic)


def test_the_truth_is_exposed_as_the_cameras_meter_would(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A grey card of 18 % comes to KEY of saturation in green, as the electrons of a level in lux assume."""
    monkeypatch.setattr(
        "fsid.evaluate.simulated.simulate",
        lambda rng, material, height, width: np.full((height, width, 3), GREY, np.float32),
    )
    size = {"scenes": 1, "width": 64, "height": 64}
    made = simulated_testset(tmp_path / "set", camera="pixel6", luxes=[5.0], materials=["text"], **size)
    truth = read_raw(made.clean(tmp_path / "set", made.images[0]))
    np.testing.assert_allclose(pack(truth.mosaic, truth.cfa)[1:3], KEY, rtol=1e-3)


def test_a_capture_states_its_iso_and_exposure_time(tmp_path: Path):
    """Only the noise was stated: nobody could tell what the camera was set to at a level in lux."""
    size = {"scenes": 1, "width": 64, "height": 64}
    luxes = [0.02, 500.0]
    made = simulated_testset(tmp_path / "set", camera="pixel6", luxes=luxes, materials=["text"], **size)
    for lux, level in zip(luxes, made.levels, strict=True):
        set_to = light_level(load_profile("pixel6"), lux, highest_iso=np.inf)
        said = read_header(made.noisy(tmp_path / "set", made.images[0], level))
        assert said.iso == pytest.approx(set_to.iso)
        assert said.exposure_s == pytest.approx(set_to.exposure_s, rel=0.01)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--material", "wood"], "wood: no such material"),
        (["--frames", "0"], "--frames 0"),
        (["--width", "33"], "--width 33"),
        (["--width", "102400"], "numbers of 64 to 8192"),
        (["--lux", "-1"], "at least one positive"),
        (["folder"], "takes no folder"),
    ],
)
def test_bad_input_is_one_line(tmp_path: Path, arguments: list[str], words: str, refused):
    assert words in refused("testset", "simulate", *arguments, "-o", tmp_path / "set", "--quiet")
    assert not (tmp_path / "set").exists()
