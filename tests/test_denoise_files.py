"""Files: any noise, one or many, and nothing of the original is lost but its noise."""

from __future__ import annotations

import errno
import inspect
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pytest
import tifffile
from scipy.ndimage import gaussian_filter

torch = pytest.importorskip("torch")

import fsid  # noqa: E402
from fsid.cli.main import main  # noqa: E402
from fsid.denoise import ModelCard, NetworkConfig, RawDenoiser, denoise_raw, load_model, save_model  # noqa: E402
from fsid.denoise import model as model_module  # noqa: E402
from fsid.denoise.clipped_noise import highest_levels  # noqa: E402
from fsid.denoise.denoise import variance_at_grey  # noqa: E402
from fsid.denoise.export import export  # noqa: E402
from fsid.denoise.files import denoise_file, denoise_folder, noise_of  # noqa: E402
from fsid.denoise.interface import denoise  # noqa: E402
from fsid.denoise.model import model_path  # noqa: E402
from fsid.denoise.preview import PREVIEW_PX, preview_of  # noqa: E402
from fsid.errors import FsidError  # noqa: E402
from fsid.files import open_new  # noqa: E402
from fsid.sensor import (  # noqa: E402
    Layout,
    NoiseLevel,
    Raw,
    develop,
    estimate_noise,
    load_profile,
    noisy_from_clean,
    read_raw,
    save_profile,
    to_dn,
    write_dng,
)
from fsid.sensor.camera_profile import Measurement  # noqa: E402
from fsid.sensor.metadata import exposure_metadata  # noqa: E402
from fsid.sensor.mosaic import pack, unpack  # noqa: E402

PROFILE = load_profile("galaxy-s22")
CARD = ModelCard(NetworkConfig(width=4), patch_px=32, training="nothing")


def blurring_network(path: Path) -> Path:
    """A network that does something: its last convolution pulls each pixel to the mean of its neighbours."""
    torch.manual_seed(0)
    net = RawDenoiser(CARD.network)
    with torch.no_grad():
        net.net.intro.weight.zero_()
        net.net.ending.weight.zero_()
        for site in range(4):
            net.net.intro.weight[site, site, 1, 1] = 1
            net.net.ending.weight[site, site] = 2.0
            net.net.ending.weight[site, site, 1, 1] = -16.0
    save_model(path, net.state_dict(), CARD)
    return path


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return blurring_network(tmp_path_factory.mktemp("network") / "blur.safetensors")


def noisy_raw(iso: float = 3200) -> Raw:
    rng = np.random.default_rng(5)
    ramp = np.broadcast_to(np.linspace(0.02, 0.6, 320, dtype=np.float32), (256, 320))
    clean = Raw(
        ramp,
        PROFILE.cfa,
        PROFILE.black_level,
        PROFILE.white_level,
        (2.0, 1.0, 1.5),
        PROFILE.xyz_to_camera[0],
        camera="Galaxy",
        metadata=exposure_metadata(exposure_s=1 / 30, f_number=1.8, lens="wide"),
    )
    return noisy_from_clean(rng, clean, iso, PROFILE.level(iso))


@pytest.fixture
def noisy_file(tmp_path: Path) -> Path:
    write_dng(tmp_path / "noisy.dng", noisy_raw())
    return tmp_path / "noisy.dng"


def test_a_denoised_file_keeps_what_the_original_said(noisy_file: Path, network: Path) -> None:
    out = noisy_file.with_name("clean.dng")
    main(["denoise", str(noisy_file), str(out), "--model", str(network), "--quiet"])
    noisy, clean = read_raw(noisy_file), read_raw(out)
    assert np.abs(clean.mosaic - noisy.mosaic).mean() > 1e-3
    assert (clean.cfa, clean.camera, clean.iso) == (noisy.cfa, noisy.camera, noisy.iso)
    assert clean.white_balance == pytest.approx(noisy.white_balance, rel=1e-4)
    assert {42036, 33434} <= {tag.code for tag in clean.metadata.exif}  # lens, exposure time
    assert clean.metadata.exif == noisy.metadata.exif
    assert clean.noise is None
    with tifffile.TiffFile(out) as dng:
        preview = dng.pages[0].asarray()
    assert preview.shape == (256, 320, 3)
    assert preview.mean() == pytest.approx(255 * develop(clean).clip(0, 1).mean(), abs=3)


def test_the_noise_is_the_profile_s_or_the_file_s_or_the_image_s(tmp_path: Path) -> None:
    raw = noisy_raw(3200)
    assert noise_of(raw, None, None, tmp_path).level == raw.noise
    assert noise_of(raw, "pixel6", None, tmp_path).level == load_profile("pixel6").level(3200)
    assert noise_of(raw, "pixel6", 800, tmp_path).level == load_profile("pixel6").level(800)
    blind = noise_of(replace(raw, noise=None), None, None, tmp_path)
    assert "estimated" in blind.source
    assert raw.noise is not None
    for x in (0.05, 0.3):
        true, found = (np.array(n.k) * x + np.array(n.sigma2) for n in (raw.noise, blind.level))
        np.testing.assert_allclose(found, true, rtol=0.25)
    tiny = replace(raw, mosaic=raw.mosaic[:16, :16], noise=None)
    with pytest.raises(FsidError, match=r"holds no NoiseProfile.*--profile"):
        noise_of(tiny, None, None, tmp_path)
    with pytest.raises(FsidError, match="--iso"):
        noise_of(raw, None, 800, tmp_path)


def test_strength(network: Path) -> None:
    raw, model = noisy_raw(800), load_model(network)
    full = denoise_raw(raw, model).mosaic
    np.testing.assert_allclose(denoise_raw(raw, model, strength=0).mosaic, raw.mosaic, atol=1e-6)
    half = denoise_raw(raw, model, strength=0.5).mosaic
    np.testing.assert_allclose(half, (full + raw.mosaic) / 2, atol=1e-6)
    assert raw.noise is not None
    doubled = denoise_raw(raw, model, strength=2).mosaic
    stronger = type(raw.noise)(tuple(4 * k for k in raw.noise.k), tuple(4 * s for s in raw.noise.sigma2))
    np.testing.assert_array_equal(doubled, denoise_raw(raw, model, stronger).mosaic)
    assert np.abs(doubled - full).mean() > 1e-4
    for wrong in (-0.1, np.nan, np.inf, 1e200):
        with pytest.raises(FsidError, match="strength"):
            denoise_raw(raw, model, strength=wrong)


def shadows(black_level: int, iso: float) -> tuple[Raw, np.ndarray]:
    """A noisy image of four dark patches, and their light."""
    light = np.repeat(np.repeat(np.array([[0.0, 0.003], [0.01, 0.04]], np.float32), 64, axis=0), 64, axis=1)
    clean = Raw(light, PROFILE.cfa, black_level, black_level + 959, (2, 1, 1.6), PROFILE.xyz_to_camera[0])
    return noisy_from_clean(np.random.default_rng(0), clean, iso, PROFILE.level(iso)), light


@pytest.mark.parametrize(("black_level", "ensemble"), [(0, 1), (0, 2), (8, 1), (64, 1)])
def test_shadows_are_as_dark_as_their_light_wherever_noise_is_cut_off(
    black_level: int, ensemble: int
) -> None:
    """Each colour in each patch, where the file is up to 0.4 sigma (4.5 DN) too bright."""
    noisy, light = shadows(black_level, 3200)
    done: list[tuple[int, int]] = []
    denoised = denoise_raw(
        noisy, load_model("nafnet-small"), ensemble=ensemble, progress=lambda *at: done.append(at)
    )
    error = pack(denoised.mosaic - light, PROFILE.cfa).reshape(4, 2, 32, 2, 32)[:, :, 4:28, :, 4:28]
    np.testing.assert_allclose(error.mean((2, 4)) * 959, 0, atol=1.5)
    passes = ensemble + (black_level < 64)
    assert done == [(n + 1, passes) for n in range(passes)]


def test_what_is_dark_for_another_reason_stays_so() -> None:
    """Rows without data at DN 0, and noise that the file states is not there."""
    noisy, _ = shadows(0, 3200)
    noisy.mosaic[:48] = 0
    dark = denoise_raw(noisy, load_model("nafnet-small")).mosaic[8:40]
    assert abs(dark.mean()) * 959 < 1


def test_a_network_of_cameras_that_store_black_as_0_knows_their_shadows(network: Path) -> None:
    model, noisy = load_model(network), shadows(0, 3200)[0]
    assert model.card.lowest == pytest.approx(-64 / 959)
    at_black = replace(model, card=replace(model.card, lowest=0.0))
    calls: list[int] = []
    denoise_raw(noisy, at_black, progress=lambda done, tiles: calls.append(tiles))
    assert calls == [1]
    with pytest.raises(FsidError, match="lowest"):
        replace(model.card, lowest=0.1)


@pytest.mark.parametrize("strength", [0.5, 1, 2])
def test_saturated_light_stays_at_the_white_level(strength: float) -> None:
    """As in the DNG. Far above saturation pixels have no noise."""
    light = np.full((64, 96), 0.3, np.float32)
    light[:, 48:] = 2.5
    clean = Raw(light, PROFILE.cfa, 64, 1023, (2, 1, 1.6), PROFILE.xyz_to_camera[0])
    noisy = noisy_from_clean(np.random.default_rng(0), clean, 3200, PROFILE.level(3200))
    mosaic = denoise_raw(noisy, load_model("nafnet-small"), strength=strength).mosaic
    assert mosaic.max() == 1
    assert mosaic[:, 64:].mean(dtype=float) == pytest.approx(1, abs=1e-3)
    noisy.mosaic[10, 10] = 1.2  # where a file states less than its sensor holds, that is no less true
    assert denoise_raw(noisy, load_model("nafnet-small")).mosaic.max() > 1


def test_light_stays_where_the_sensor_saturates_below_the_white_level() -> None:
    """The network alone makes 0.99 of 0.96, each colour its own. What merely is brightest is no limit."""
    light = np.full((64, 96), 0.3, np.float32)
    light[:, 48:] = 2.5
    clean = Raw(light, PROFILE.cfa, 64, 1023, (2, 1, 1.6), PROFILE.xyz_to_camera[0])
    noisy = noisy_from_clean(np.random.default_rng(0), clean, 1600, PROFILE.level(1600))
    noisy = replace(noisy, mosaic=noisy.mosaic.clip(max=np.float32(round(0.96 * 959) / 959)))
    blown = pack(denoise_raw(noisy, load_model("nafnet-small")).mosaic, PROFILE.cfa)[:, :, 32:]
    np.testing.assert_allclose(blown.mean((1, 2), dtype=float), noisy.mosaic.max(), rtol=1e-3)
    assert highest_levels(noisy) == (noisy.mosaic.max(),) * 4
    assert highest_levels(replace(noisy, mosaic=noisy.mosaic[:, :40])) == (1.0,) * 4
    assert highest_levels(replace(noisy, mosaic=np.full((64, 96), 0.3, np.float32))) == (1.0,) * 4


@pytest.mark.parametrize("strength", [8, 20, 100])
def test_the_strongest_smoothing_keeps_the_colours(strength: float) -> None:
    rng = np.random.default_rng(0)
    light = 0.2 + 0.15 * np.tanh(gaussian_filter(rng.standard_normal((64, 96)), 4) * 20)
    packed = light * np.array([0.5, 1.0, 1.0, 0.6])[:, None, None]
    mosaic = unpack(packed.astype(np.float32), PROFILE.cfa)
    clean = Raw(mosaic, PROFILE.cfa, 64, 1023, (2, 1, 1.6), PROFILE.xyz_to_camera[0])
    noisy = noisy_from_clean(rng, clean, 400, PROFILE.level(400))
    smooth = denoise_raw(noisy, load_model("nafnet-small"), strength=strength)
    means, true = (pack(raw.mosaic, raw.cfa).mean((1, 2)) for raw in (smooth, clean))
    np.testing.assert_allclose(means, true, rtol=0.03)


def test_hot_pixels_are_mended_where_that_is_asked_for(
    tmp_path: Path, network: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "in").mkdir()
    raw, spots = noisy_raw(), np.s_[10:250:16, 9:310:20]
    plain = denoise_raw(raw, load_model(network)).mosaic
    raw.mosaic[spots] = 1
    source, out = tmp_path / "in" / "a.dng", tmp_path / "out.dng"
    write_dng(source, raw)
    command = ["denoise", str(source), str(out), "--model", str(network)]
    main(command)
    assert "hot" not in capsys.readouterr().err
    assert np.abs(read_raw(out).mosaic - plain)[spots].min() > 0.05
    main([*command, "--mend-hot-pixels"])
    count = int(capsys.readouterr().err.partition("hot and dead pixels: ")[2].split()[0])
    assert count > 0.9 * raw.mosaic[spots].size
    off = np.abs(read_raw(out).mosaic - plain)[spots]
    assert np.quantile(off, 0.9) < 0.02
    write_dng(tmp_path / "in" / "b.dng", noisy_raw())
    main(
        ["denoise", str(tmp_path / "in"), str(tmp_path / "out"), "--model", str(network), "--mend-hot-pixels"]
    )
    assert f"hot and dead pixels: 0 to {count} mended in a file" in capsys.readouterr().err


def test_a_folder_is_done_file_by_file(tmp_path: Path, network: Path, refused: Callable[..., str]) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    for name in ("a", "b"):
        write_dng(folder / f"{name}.dng", noisy_raw())
    (folder / "notes.txt").write_text("no RAW")
    main(["denoise", str(folder), str(out), "--model", str(network), "--quiet"])
    assert sorted(path.name for path in out.iterdir()) == ["a.dng", "b.dng"]
    assert read_raw(out / "a.dng").mosaic.shape == (256, 320)
    (folder / "aa.dng").write_text("broken")
    (folder / "._a.dng").write_text("what a Mac leaves beside a.dng")
    told = refused("denoise", folder, tmp_path / "again", "--model", network, "--quiet")
    assert "aa.dng" in told
    assert "1 of 3 files" in told
    assert sorted(path.name for path in (tmp_path / "again").iterdir()) == ["a.dng", "b.dng"]
    (folder / "0.nef").write_text("broken, and first: nothing may be written before the folder is refused")
    before = {path: path.read_bytes() for path in folder.iterdir()}
    told = refused("denoise", folder, folder, "--model", network, "--quiet")
    assert "overwritten" in told
    assert "0.nef" not in told
    assert {path: path.read_bytes() for path in folder.iterdir()} == before


def test_noise_beyond_networks_is_said(
    tmp_path: Path, network: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    for name, k in (("a", 0.01), ("b", 0.03), ("c", 0.05)):
        strong = NoiseLevel((k, k, k, k), (1e-5, 1e-5, 1e-5, 1e-5))
        write_dng(folder / f"{name}.dng", replace(noisy_raw(), noise=strong))
    main(["denoise", str(folder), str(tmp_path / "out"), "--model", str(network)])
    assert (
        "b.dng and 1 more: more noise than the network knows (variance at mid-grey above 0.0036)"
        in capsys.readouterr().err
    )
    for name, told in (("a", False), ("c", True)):
        command = ["denoise", str(folder / f"{name}.dng"), str(tmp_path / "one.dng"), "--model", str(network)]
        main(command)
        assert ("c.dng: more noise than the network knows" in capsys.readouterr().err) == told
        main([*command, "--quiet"])
        said = capsys.readouterr().err
        assert ("c.dng: more noise than the network knows" in said) == told
        assert all(line.startswith("note: ") for line in said.splitlines())


def test_a_network_knows_the_noise_that_its_card_says(
    tmp_path: Path, noisy_file: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stated = variance_at_grey(PROFILE.level(3200))
    net, file = RawDenoiser(CARD.network), tmp_path / "a.safetensors"
    for most_noise, told in ((1.01 * stated, False), (0.9 * stated, True)):
        save_model(file, net.state_dict(), replace(CARD, most_noise=most_noise))
        main(["denoise", str(noisy_file), str(tmp_path / "one.dng"), "--model", str(file)])
        assert ("more noise than the network knows" in capsys.readouterr().err) == told


def test_levels_of_more_noise_than_a_model_knows_are_said(
    tmp_path: Path, photos: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, testset = tmp_path / "own.safetensors", tmp_path / "testset"
    card = replace(CARD, most_noise=variance_at_grey(load_profile("pixel6").level(2000)))
    save_model(model, RawDenoiser(card.network).state_dict(), card)
    main(["testset", "photos", str(photos), "-o", str(testset), "--iso", "800", "6400", "--quiet"])
    capsys.readouterr()
    main(["evaluate", str(testset), "--model", str(model), "--model", "nafnet-small"])
    said = capsys.readouterr().err
    assert "note: own: at iso6400 there is more noise than it knows" in said
    assert "nafnet-small: at" not in said


def test_noise_that_the_image_contradicts_is_said(
    tmp_path: Path, network: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    for name, times in (("a", 1), ("b", 2), ("c", 0.1), ("d", 10), ("e", 0.05)):
        level = PROFILE.level(3200)
        stated = NoiseLevel(*(tuple(times * value for value in values) for values in (level.k, level.sigma2)))
        write_dng(folder / f"{name}.dng", replace(noisy_raw(), noise=stated))
    main(["denoise", str(folder), str(tmp_path / "out"), "--model", str(network)])
    said = capsys.readouterr().err
    assert (
        "c.dng and 1 more: shows 10 times the noise variance of the file's NoiseProfile; the result" in said
    )
    assert "d.dng: shows 0.10 times" in said
    for name, told in (("a", ""), ("b", ""), ("c", "may be noisy"), ("d", "d.dng: shows 0.10 times")):
        main(["denoise", str(folder / f"{name}.dng"), str(tmp_path / "one.dng"), "--model", str(network)])
        said = capsys.readouterr().err
        assert ("note:" in said) == bool(told)
        assert told in said
    wrong = ["--model", str(network), "--profile", "galaxy-s22", "--iso", "100"]
    main(["denoise", str(folder / "a.dng"), str(tmp_path / "one.dng"), *wrong])
    assert "times the noise variance of profile galaxy-s22 at ISO 100" in capsys.readouterr().err


def test_a_dark_picture_is_denoised_as_well_with_the_noise_that_it_shows() -> None:
    """Light of less than the noise: a k of 2.5 times itself cost 5 dB, one of 0.1 of itself 8 dB."""
    rng, camera = np.random.default_rng(0), load_profile("pixel6")
    light = 0.006 * np.kron(rng.random((6, 6)), np.tile([[0.6, 1.0], [1.0, 0.4]], (32, 32)))
    clean = Raw(light.astype(np.float32), camera.cfa, 64, 1023, (2, 1, 1.6), PROFILE.xyz_to_camera[0])
    noisy = noisy_from_clean(rng, clean, 6400, camera.level(6400))
    model, levels = load_model("nafnet-small"), (noisy.noise, estimate_noise(noisy).level)
    errors = [np.mean((denoise_raw(noisy, model, level).mosaic - light) ** 2) for level in levels]
    assert abs(10 * np.log10(errors[1] / errors[0])) < 0.5


def test_a_denoised_file_says_so_and_is_not_smoothed_again_without_a_word(
    tmp_path: Path, noisy_file: Path, network: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """NoiseReductionApplied of DNG: at 1 a converter removes no more by itself."""
    once, half, again = (tmp_path / f"{name}.dng" for name in ("once", "half", "again"))
    options = ["--model", str(network), "--profile", "galaxy-s22"]
    for source, out, strength, stated in (
        (noisy_file, half, "0.5", 0.5),
        (half, once, "2", 1.0),
        (once, again, "0.25", 1.0),
    ):
        main(["denoise", str(source), str(out), "--strength", strength, *options])
        assert ("once.dng: denoised before" in capsys.readouterr().err) == (source == once)
        assert read_raw(out).metadata.noise_removed == stated
        with tifffile.TiffFile(out) as dng:
            (mosaic,) = dng.pages[0].pages
            assert mosaic.tags[50935].value == {0.5: (1, 2), 1.0: (1, 1)}[stated]
    assert read_raw(noisy_file).metadata.noise_removed == 0


def test_a_denoised_file_without_stated_noise_says_why_it_shows_none(
    tmp_path: Path, noisy_file: Path, refused: Callable[..., str]
) -> None:
    once = tmp_path / "once.dng"
    main(["denoise", str(noisy_file), str(once), "--quiet"])
    said = refused("denoise", once, tmp_path / "twice.dng")
    assert "once.dng: was denoised before, as NoiseReductionApplied says" in said
    assert "give --profile" in said


def test_a_noise_profile_of_zeros_is_none(
    tmp_path: Path, network: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, zero, below = tmp_path / "in", (0.0,) * 4, (-1e-6,) * 4
    folder.mkdir()
    write_dng(folder / "a.dng", noisy_raw())
    write_dng(folder / "b.dng", replace(noisy_raw(), noise=NoiseLevel(zero, zero)))
    found = noise_of(read_raw(folder / "b.dng"), None, None, folder / "b.dng")
    assert found.is_estimated
    assert 0.5 < found.level.k[1] / PROFILE.level(3200).k[1] < 2
    main(["denoise", str(folder), str(tmp_path / "out"), "--model", str(network)])
    assert f"the noise of 1 of 2 files, the first one {folder / 'b.dng'}, is est" in capsys.readouterr().err
    main(["denoise", str(folder / "b.dng"), str(tmp_path / "b.dng"), "--model", str(network)])
    assert "its NoiseProfile states no noise at all" in capsys.readouterr().err
    with pytest.raises(FsidError, match=r"b\.dng: its NoiseProfile holds a variance below 0; give --profile"):
        noise_of(replace(noisy_raw(), noise=NoiseLevel((1e-3,) * 4, below)), None, None, folder / "b.dng")


def test_a_layout_that_a_profile_contradicts_is_said(
    tmp_path: Path, network: Path, capsys: pytest.CaptureFixture[str], refused: Callable[..., str]
) -> None:
    measured = Measurement(
        k_error=np.full((2, 4), 1e-5),
        sigma2_error=np.full((2, 4), 1e-7),
        black=np.array([[60.0, 66.0, 64.0, 70.0], [64.0, 63.0, 66.0, 68.0]]),  # the second by much noise
        frames=(20, 20),
        dark_frames=(10, 10),
    )
    levels = [PROFILE.level(iso) for iso in (800, 25600)]
    k, sigma2 = (np.array([getattr(level, name) for level in levels]) for name in ("k", "sigma2"))
    mine = replace(PROFILE, name="mine", iso=(800, 25600), k=k, sigma2=sigma2, measured=measured)
    save_profile(tmp_path / "mine.yaml", mine)
    np.save(tmp_path / "a.npy", to_dn(noisy_raw()))
    command = ["denoise", str(tmp_path / "a.npy"), str(tmp_path / "a.dng"), "--model", str(network)]
    command += ["--profile", str(tmp_path / "mine.yaml"), "--iso", "800"]
    own = ["--cfa", PROFILE.cfa, "--white-level", "1023"]
    for black, is_said in (("65", True), ("60,66,64,70", False)):
        main([*command, *own, "--black-level", black])
        said = capsys.readouterr().err
        assert ("without --black-level 60,66,64,70" in said) == is_said
        assert "was measured on frames of" not in said
    for cfa, white, what in (("BGGR", "1023", "--cfa BGGR"), (PROFILE.cfa, "4095", "--white-level 4095")):
        main([*command, "--cfa", cfa, "--white-level", white, "--black-level", "60,66,64,70"])
        assert f"note: {what}: profile {tmp_path / 'mine.yaml'} was measured on" in capsys.readouterr().err
    for black in ("60,66", "60;66", ""):
        assert "--black-level" in refused(*command, *own, "--black-level", black)


def test_an_unreadable_file_is_left_out_of_a_folder(
    tmp_path: Path, network: Path, monkeypatch: pytest.MonkeyPatch, refused: Callable[..., str]
) -> None:
    folder, read = tmp_path / "in", fsid.sensor.dng._read_source
    folder.mkdir()
    for name in ("a", "b"):
        write_dng(folder / f"{name}.dng", noisy_raw())

    def locked(file: BinaryIO, path: Path) -> object:
        if path.name == "a.dng":
            raise PermissionError(13, "Permission denied", str(path))
        return read(file, path)

    monkeypatch.setattr("fsid.sensor.dng._read_source", locked)
    assert "a.dng: cannot be read (Permission denied)" in refused(
        "denoise", folder, tmp_path / "out", "--model", network, "--quiet"
    )
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["b.dng"]


def test_what_is_said_of_files_does_not_depend_on_a_broken_one(
    tmp_path: Path, network: Path, refused: Callable[..., str]
) -> None:
    (folder := tmp_path / "in").mkdir()
    write_dng(folder / "a.dng", replace(noisy_raw(), noise=None))
    write_dng(folder / "b.dng", replace(noisy_raw(), noise=NoiseLevel((0.03,) * 4, (0.001,) * 4)))
    (folder / "c.dng").write_bytes((folder / "a.dng").read_bytes()[:5000])
    said = refused("denoise", folder, tmp_path / "out", "--model", network)
    assert f"the noise of 1 of 2 files, the first one {folder / 'a.dng'}, is estimated" in said
    assert f"{folder / 'b.dng'}: more noise than the network knows" in said


def test_a_folder_may_be_finished_without_doing_it_again(
    tmp_path: Path, network: Path, capsys: pytest.CaptureFixture[str], refused: Callable[..., str]
) -> None:
    (folder := tmp_path / "in").mkdir()
    for name in ("a", "b"):
        write_dng(folder / f"{name}.dng", noisy_raw())
    command = ["denoise", str(folder), str(out := tmp_path / "out"), "--model", str(network)]
    out.mkdir()
    (out / "a.dng").write_bytes(b"made before")
    main([*command, "--skip-existing"])
    assert f"note: 1 of 2 files are in {out} already and left alone" in capsys.readouterr().err
    assert (out / "a.dng").read_bytes() == b"made before"
    whole = (out / "b.dng").read_bytes()
    main([*command, "--quiet"])
    assert (out / "a.dng").read_bytes() != b"made before"
    assert (out / "b.dng").read_bytes() == whole
    main([*command, "--skip-existing", "--quiet"])
    assert "--skip-existing: is for a folder" in refused(
        "denoise", folder / "a.dng", out / "c.dng", "--model", network, "--skip-existing"
    )


def test_a_link_that_leads_nowhere_is_a_file_that_cannot_be_read(
    tmp_path: Path, network: Path, refused: Callable[..., str]
) -> None:
    (folder := tmp_path / "in").mkdir()
    (folder / "folder.dng").mkdir()
    write_dng(folder / "a.dng", noisy_raw())
    (folder / "b.dng").symlink_to(tmp_path / "unplugged" / "b.dng")
    told = refused("denoise", folder, tmp_path / "out", "--model", network, "--profile", "pixel6", "--quiet")
    assert f"{folder / 'b.dng'}: " in told
    assert "1 of 2 files" in told
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["a.dng"]


@pytest.mark.parametrize("code", [errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES])
def test_a_disk_that_takes_no_file_ends_a_folder(
    tmp_path: Path, network: Path, monkeypatch: pytest.MonkeyPatch, refused: Callable[..., str], code: int
) -> None:
    """Else each of the others would be denoised for nothing."""
    read, fits = [], {"a"}

    def reading(path: Path, layout: Layout | None) -> Raw:
        read.append(path.name)
        return noisy_raw()

    def full(part: Path) -> BinaryIO:
        if part.name[0] in fits:
            return open_new(part)
        raise OSError(code, os.strerror(code))

    (folder := tmp_path / "in").mkdir()
    for name in "abcd":
        (folder / f"{name}.dng").touch()
    monkeypatch.setattr("fsid.denoise.files.read_input", reading)
    monkeypatch.setattr("fsid.files.open_new", full)
    command = ("denoise", folder, out := tmp_path / "out", "--model", network, "--quiet")
    told = refused(*command)
    assert read == ["a.dng", "b.dng"]
    assert f"{out / 'b.dng'}: cannot be written ({os.strerror(code)}); " in told
    assert "3 of 4 files are left, --skip-existing goes on from there" in told
    assert [path.name for path in out.iterdir()] == ["a.dng"]
    fits.clear()
    refused(*command[:2], tmp_path / "new", *command[3:])
    assert not (tmp_path / "new").exists()


def test_a_picture_keeps_its_own_iso(noisy_file: Path, network: Path) -> None:
    out = noisy_file.parent / "out.dng"
    own = read_raw(noisy_file).iso
    denoise_file(noisy_file, out, load_model(network), profile="pixel6", iso=2 * own)
    assert read_raw(out).iso == own


def test_an_original_is_not_overwritten(noisy_file: Path, network: Path, refused: Callable[..., str]) -> None:
    before = noisy_file.read_bytes()
    (noisy_file.parent / "sub").mkdir()
    for same in (noisy_file, noisy_file.parent / "sub" / ".." / noisy_file.name):
        assert "original" in refused("denoise", noisy_file, same, "--model", network, "--quiet")
    assert noisy_file.read_bytes() == before


def test_an_original_is_not_overwritten_where_names_ignore_case(
    noisy_file: Path, network: Path, refused: Callable[..., str]
) -> None:
    """As on memory cards and macOS, where L1.DNG becomes L1.dng: here a second name of one file."""
    folder = noisy_file.parent / "card"
    folder.mkdir()
    original = noisy_file.rename(folder / "L1.DNG")
    os.link(original, folder / "L1.dng")
    before = original.read_bytes()
    told = refused("denoise", original, folder / "L1.dng", "--model", network, "--quiet")
    assert "original" in told
    with pytest.raises(FsidError, match="is the folder of the originals"):
        denoise_folder([original], folder, load_model(network))
    assert original.samefile(folder / "L1.dng")
    assert original.read_bytes() == before


def test_a_run_given_by_its_whole_path_is_not_the_file_beside_it(network: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    run.mkdir()
    shutil.copy(network, run / "model.safetensors")
    (tmp_path / "run.safetensors").write_bytes(b"an older export")
    assert model_path(run) == run / "model.safetensors"
    assert model_path("nafnet-small") != model_path(tmp_path / "nafnet-small")


@pytest.mark.parametrize("name", ["a.onnx", "a.safetensors"])
def test_an_unknown_precision_is_refused(network: Path, tmp_path: Path, name: str) -> None:
    with pytest.raises(FsidError, match="precision half: choose float32, float16, int8"):
        export(network, tmp_path / name, "half")  # type: ignore[arg-type]
    assert not (tmp_path / name).exists()


def test_what_is_wrong_with_one_file_names_it(noisy_file: Path, network: Path) -> None:
    raw = replace(noisy_raw(), noise=NoiseLevel((2.0,) * 4, (0.0,) * 4))
    write_dng(noisy_file, raw)
    with pytest.raises(FsidError, match=r"noisy\.dng: "):
        denoise_file(noisy_file, noisy_file.parent / "out.dng", load_model(network), mend_hot_pixels=True)


def test_a_folder_that_is_not_there_is_said_before_the_work(noisy_file: Path, network: Path) -> None:
    def never(done: int, tiles: int) -> None:
        raise AssertionError("denoised a tile that cannot be written")

    with pytest.raises(FsidError, match="no such folder"):
        denoise_file(noisy_file, noisy_file.parent / "none" / "out.dng", load_model(network), progress=never)


@pytest.mark.parametrize("suffix", [".dng", ".onnx", ".safetensors"])
def test_a_place_that_takes_no_file_is_said_before_the_work(
    noisy_file: Path, network: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError("worked for what cannot be written")

    for name in ("fsid.denoise.export.probes", "fsid.denoise.files.read_input"):
        monkeypatch.setattr(name, never)
    source = noisy_file if suffix == ".dng" else network
    write = partial(denoise_file, model=load_model(network)) if suffix == ".dng" else export
    (tmp_path / f"folder{suffix}").mkdir()
    with pytest.raises(FsidError, match="it is no file"):
        write(source, tmp_path / f"folder{suffix}")
    monkeypatch.setattr("fsid.files.os.access", lambda *_: False)
    with pytest.raises(FsidError, match="no folder that you may write to"):
        write(source, tmp_path / f"new{suffix}")


def test_a_folder_of_bare_mosaics(
    tmp_path: Path, network: Path, rng: np.random.Generator, refused: Callable[..., str]
) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    for name in ("a", "b"):
        np.save(folder / f"{name}.npy", rng.integers(64, 1023, (48, 64), dtype=np.uint16))
    command = ["denoise", str(folder), str(tmp_path / "out"), "--model", str(network), "--quiet"]
    command += ["--profile", "pixel6", "--iso", "3200"]
    assert "holds no RAW file" in refused(*command)
    main([*command, "--cfa", "GBRG", "--black-level", "64", "--white-level", "1023"])
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a.dng", "b.dng"]
    assert read_raw(tmp_path / "out" / "a.dng").cfa == "GBRG"


def test_options_of_bare_mosaics_are_for_these_alone(
    tmp_path: Path, noisy_file: Path, network: Path, refused: Callable[..., str]
) -> None:
    def line_of(source: Path, *options: str) -> str:
        return refused("denoise", source, tmp_path / "out.dng", "--model", network, *options)

    levels = ("--cfa", "RGGB", "--black-level", "64", "--white-level", "1023")
    for options in (("--width", "320"), ("--height", "256"), levels):
        line = line_of(noisy_file, *options)
        assert f"{options[0]}: is for bare mosaics" in line
        assert f"not for {noisy_file}" in line
    assert "holds no bare mosaic" in line_of(tmp_path, "--width", "320")
    for name in ("a", "b"):
        np.full((48, 64), 500, "<u2").tofile(tmp_path / f"{name}.raw")
    for source in (tmp_path, tmp_path / "a.raw"):
        assert "a.raw: a headerless mosaic needs --width and --height" in line_of(source, *levels)
        assert "needs all three" in line_of(source, "--width", "64", "--height", "48")
    command = ["denoise", str(tmp_path), str(tmp_path / "out"), "--model", str(network), "--quiet", *levels]
    command += ["--profile", "pixel6", "--iso", "800"]
    main([*command, "--width", "64", "--height", "48"])
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["a.dng", "b.dng"]


def test_what_no_reader_would_open_is_not_written(tmp_path: Path, network: Path) -> None:
    np.save(tmp_path / "tiny.npy", np.full((20, 64), 500, np.uint16))
    layout = Layout(None, "RGGB", 64, 1023)
    with pytest.raises(FsidError, match=r"tiny.npy: is 64x20"):
        denoise_file(
            tmp_path / "tiny.npy",
            tmp_path / "out.dng",
            load_model(network),
            profile="pixel6",
            iso=800,
            layout=layout,
        )
    assert not (tmp_path / "out.dng").exists()


def test_a_preview_is_the_mean_of_what_it_covers() -> None:
    """Columns of every colour, by turns dark and light, at half the size: an even picture between them."""
    stripes = np.broadcast_to(np.array([0.2, 0.2, 0.6, 0.6], np.float32), (8, 500, 4))
    raw = Raw(stripes.reshape(8, 2000), "RGGB", 64, 1023, (2.0, 1.0, 1.5), np.eye(3))
    even = replace(raw, mosaic=np.full_like(raw.mosaic, 0.4))
    preview, expected = preview_of(raw), preview_of(even)
    assert preview is not None
    assert preview.shape == (4, 1000, 3)
    np.testing.assert_array_equal(preview, expected)


def test_a_large_preview_is_small(rng: np.random.Generator) -> None:
    raw = replace(noisy_raw(), mosaic=rng.random((64, 5000), dtype=np.float32))
    preview = preview_of(raw)
    assert preview is not None
    assert max(preview.shape) <= PREVIEW_PX
    assert preview_of(replace(raw, mosaic=raw.mosaic[:2, :2])) is None


def test_what_ships_is_found_by_name_and_by_default(
    tmp_path: Path, network: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(model_module, "WEIGHTS", tmp_path)
    with pytest.raises(FsidError, match="no network ships"):
        load_model()
    done = export(network, tmp_path / f"{model_module.DEFAULT_MODEL}.safetensors")
    assert done.precision == "float16"
    assert abs(done.loss_db) < 0.01
    assert done.file.stat().st_size < 0.7 * network.stat().st_size
    with pytest.raises(FsidError, match="overwritten"):
        export(network, network)
    raw = noisy_raw()
    expected = denoise_raw(raw, load_model(network)).mosaic
    for model in (load_model(), load_model(model_module.DEFAULT_MODEL)):
        assert model.card == CARD
        np.testing.assert_allclose(denoise_raw(raw, model).mosaic, expected, atol=1e-3)


@pytest.mark.parametrize("letters", [248, 300])
def test_a_name_of_any_length_is_a_network_or_none(tmp_path: Path, network: Path, letters: int) -> None:
    """248 letters are a name that a folder may have, but no file with .safetensors behind it."""
    run = tmp_path / ("x" * letters)
    for missing in (run, run.name):
        with pytest.raises(FsidError, match="x: no such file"):
            load_model(missing)
    with pytest.raises(FsidError, match="x' is neither a file nor one of the built-in"):
        load_profile(run.name)
    if letters < 255:
        run.mkdir()
        (run / model_module.MODEL_FILE).write_bytes(network.read_bytes())
        assert load_model(run).card == CARD


def test_the_python_interface(noisy_file: Path, network: Path) -> None:
    raw, model = fsid.read_raw(noisy_file), fsid.load_model(network)
    clean = fsid.denoise(raw, model=model)
    np.testing.assert_array_equal(clean.mosaic, denoise_raw(raw, model).mosaic)
    np.testing.assert_array_equal(fsid.denoise(raw, "galaxy-s22", model=network, iso=raw.iso).cfa, clean.cfa)
    loaded = fsid.denoise(raw, load_profile("galaxy-s22"), model=model, iso=800)
    np.testing.assert_array_equal(loaded.mosaic, fsid.denoise(raw, "galaxy-s22", model=model, iso=800).mosaic)
    fsid.write_dng(noisy_file.with_name("out.dng"), clean)
    stored = read_raw(noisy_file.with_name("out.dng")).mosaic
    np.testing.assert_allclose(stored, clean.mosaic.clip(max=1), atol=1e-4)
    assert fsid.develop(clean).shape == (256, 320, 3)


def test_what_is_no_network_noise_or_backend_is_named(network: Path) -> None:
    """An unknown backend was taken for PyTorch."""
    raw = noisy_raw()
    with pytest.raises(FsidError, match="backend 'tensorrt': is not one of torch, onnx"):
        load_model(network, backend="tensorrt")  # type: ignore[arg-type]
    with pytest.raises(FsidError, match="a function is no network"):
        fsid.denoise(raw, model=lambda raw: raw)
    with pytest.raises(FsidError, match=r"replace\(raw, noise=level\)"):
        fsid.denoise(raw, raw.noise, model=network)
    with pytest.raises(FsidError, match="its ISO is unknown, give iso"):
        fsid.denoise(replace(raw, iso=0.0), load_profile("pixel6"), model=network)
    with pytest.raises(FsidError, match="a CameraProfile is no NoiseLevel"):
        denoise_raw(raw, load_model(network), load_profile("pixel6"))  # type: ignore[arg-type]
    assert len(repr(load_model(network))) < 2000  # what a notebook shows


def test_a_path_is_not_denoised_before_it_is_read() -> None:
    with pytest.raises(FsidError, match="a str is no Raw: read_raw reads one"):
        fsid.denoise("photo.dng")


def test_the_call_of_the_package_describes_itself() -> None:
    assert inspect.signature(fsid.denoise) == inspect.signature(denoise)
    described = inspect.getdoc(fsid.denoise)
    assert described is not None
    assert described.startswith(str(inspect.getdoc(denoise)))


def test_importing_the_package_imports_no_pytorch() -> None:
    script = "import sys, fsid; fsid.read_raw; sys.exit('torch' in sys.modules)"
    subprocess.run([sys.executable, "-c", script], check=True)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ("--profile nokia", "nokia"),
        ("--profile pixel6 --iso -1", "--iso -1: must be a number above 0"),
        ("--profile pixel6 --iso 0", "--iso 0: must be a number above 0"),
        ("--profile pixel6 --iso nan", "--iso nan: must be a number above 0"),
        ("--profile pixel6 --iso inf", "--iso inf: must be a number above 0"),
        ("--profile pixel6 --iso 1e9", "too high: k would be"),
        ("--iso 800", "give --profile too"),
        ("--strength -1", "strength -1"),
        ("--cfa RGGG --black-level 64 --white-level 1023", "--cfa: 'RGGG'"),
        ("--cfa RGGB --black-level 64 --white-level 60", "--black-level and --white-level"),
        ("--profile pixel6 --cfa RGGB --black-level 64 --white-level 1023", "states no ISO, give --iso"),
    ],
)
def test_a_wrong_option_is_said_once_and_leaves_no_folder(
    tmp_path: Path, network: Path, options: str, named: str, refused: Callable[..., str]
) -> None:
    folder, out = tmp_path / "in", tmp_path / "out"
    folder.mkdir()
    for name in ("a", "b"):
        write_dng(folder / f"{name}.dng", noisy_raw())
        np.save(folder / f"{name}.npy", np.full((48, 64), 500, np.uint16))
    assert named in refused("denoise", folder, out, "--model", network, *options.split())
    assert not out.exists()


def test_a_folder_of_which_nothing_can_be_denoised_leaves_none(
    tmp_path: Path, network: Path, refused: Callable[..., str]
) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.dng").write_text("broken")
    refused("denoise", tmp_path / "in", tmp_path / "out", "--model", network, "--quiet")
    assert not (tmp_path / "out").exists()


def test_files_in_subfolders_are_left_out_and_counted(
    tmp_path: Path, network: Path, capsys: pytest.CaptureFixture[str], refused: Callable[..., str]
) -> None:
    folder = tmp_path / "in"
    for place in ("day1", "day2/raw", ".trash"):
        (folder / place).mkdir(parents=True)
        write_dng(folder / place / "a.dng", noisy_raw())
    command = ["denoise", str(folder), str(folder / "out"), "--model", str(network)]
    assert f"{folder / 'day1' / 'a.dng'} lies deeper" in refused(*command)
    write_dng(folder / "a.dng", noisy_raw())
    for options in ([], ["--quiet"]):  # the second time results lie inside, too
        main([*command, *options])
        (line,) = (line for line in capsys.readouterr().err.splitlines() if "left out" in line)
        assert line.startswith(f"note: files in folders inside {folder} are left out (2, the first one")


def test_files_of_the_other_kind_are_left_out_and_counted(
    tmp_path: Path, network: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    for name in ("a", "b"):
        write_dng(folder / f"{name}.dng", noisy_raw())
        np.save(folder / f"bare-{name}.npy", to_dn(noisy_raw()))
    layout = ["--cfa", "RGGB", "--black-level", "64", "--white-level", "1023"]
    for options, first, advice in (
        ([], f"files in {folder} that may be bare mosaics are left out (2, the first one", "with"),
        (layout, f"RAW files in {folder} are left out (2, the first one", "without"),
    ):
        out = tmp_path / f"out-{advice}"
        main(["denoise", str(folder), str(out), "--model", str(network), *options])
        (line,) = (line for line in capsys.readouterr().err.splitlines() if "left out" in line)
        assert line.startswith(f"note: {first}")
        assert line.endswith(f"denoise them {advice} --cfa, --black-level and --white-level")
        assert len(list(out.iterdir())) == 2
        main(["denoise", str(folder), str(out), "--model", str(network), *options, "--quiet"])
        assert line in capsys.readouterr().err.splitlines()


def test_noise_far_beyond_the_profile_is_said_once_per_run(
    tmp_path: Path, network: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    for name, iso in (("a", 3200), ("b", 51200), ("c", 25600)):
        write_dng(folder / f"{name}.dng", replace(noisy_raw(), iso=float(iso)))
    command = ["denoise", "--model", str(network), "--profile", "pixel6"]

    def said(*more: str) -> list[str]:
        main([*command, *more])
        return [line for line in capsys.readouterr().err.splitlines() if "extrapolated" in line]

    (line,) = said(str(folder), str(tmp_path / "out"))
    assert line.endswith("its noise at ISO 3200 to 51200 is extrapolated far")
    assert said(str(folder / "a.dng"), str(tmp_path / "a.dng")) == []
    (line,) = said(str(folder / "a.dng"), str(tmp_path / "a.dng"), "--iso", "20000")
    assert line.endswith("its noise at ISO 20000 is extrapolated far")
    assert len(said(str(folder / "b.dng"), str(tmp_path / "b.dng"), "--quiet")) == 1


def test_a_profile_without_colour_filters_is_refused(tmp_path: Path) -> None:
    mono = replace(load_profile("pixel6"), cfa="MONO")
    save_profile(tmp_path / "mono.yaml", mono)
    with pytest.raises(FsidError, match=r"mono\.yaml: is of a sensor without colour filters"):
        noise_of(noisy_raw(), str(tmp_path / "mono.yaml"), 800, tmp_path)
    with pytest.raises(FsidError, match="profile pixel6: is of a sensor without colour filters"):
        fsid.denoise(noisy_raw(), mono, iso=800)
