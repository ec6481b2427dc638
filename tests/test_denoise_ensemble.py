"""An ensemble treats a mosaic, its mirror images and its transposes alike, and errs less than one of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

import fsid  # noqa: E402
from fsid.cli.main import main  # noqa: E402
from fsid.denoise import denoise_raw, load_model  # noqa: E402
from fsid.denoise.probes import mean_psnr, probes  # noqa: E402
from fsid.errors import FsidError  # noqa: E402
from fsid.evaluate import read_testset  # noqa: E402
from fsid.evaluate.models import evaluate_models  # noqa: E402
from fsid.sensor import CFA_PATTERNS, NoiseLevel, Raw, read_raw, write_dng  # noqa: E402
from test_denoise_tiles import denoiser, raw  # noqa: E402

UNEQUAL = NoiseLevel((4e-3, 1e-3, 6e-3, 2e-3), (1e-5, 4e-5, 2e-5, 8e-5))  # Gr and Gb differ most


def mirrored(image: Raw) -> Raw:
    return replace(image, mosaic=image.mosaic[:, ::-1], cfa=image.cfa[1::-1] + image.cfa[:1:-1])


def transposed(image: Raw) -> Raw:
    assert image.noise is not None
    swapped = "".join(image.cfa[i] for i in (0, 2, 1, 3))
    (r, gr, gb, b), (r2, gr2, gb2, b2) = image.noise.k, image.noise.sigma2
    noise = NoiseLevel((r, gb, gr, b), (r2, gb2, gr2, b2))
    return replace(image, mosaic=image.mosaic.T, cfa=swapped, noise=noise)


@pytest.mark.parametrize("cfa", ["RGGB", "GRBG"])
@pytest.mark.parametrize("ensemble", [1, 2, 4, 8])
def test_what_a_network_does_to_the_image_it_does_to_its_mirror_image(
    rng: np.random.Generator, cfa: str, ensemble: int
) -> None:
    noisy, model = replace(raw(rng, 34, 50, cfa), noise=UNEQUAL), denoiser()
    clean = denoise_raw(noisy, model, ensemble=ensemble).mosaic
    of_mirror = denoise_raw(mirrored(noisy), model, ensemble=ensemble).mosaic[:, ::-1]
    of_transpose = denoise_raw(transposed(noisy), model, ensemble=ensemble).mosaic.T
    assert np.allclose(of_mirror, clean, atol=1e-5) == (ensemble == 8)
    assert np.allclose(of_transpose, clean, atol=1e-5) == (ensemble >= 4)


@pytest.mark.parametrize("cfa", ["RGGB", "GBRG"])
def test_the_identity_network_returns_every_pixel_in_place(rng: np.random.Generator, cfa: str) -> None:
    noisy = raw(rng, 34, 50, cfa)
    clean = denoise_raw(noisy, denoiser(active=False), ensemble=8, tile_px=8)
    np.testing.assert_allclose(clean.mosaic, noisy.mosaic, atol=1e-5)
    assert clean.cfa == cfa


def test_the_shipped_network_errs_less() -> None:
    model = load_model()
    measured = [probe for probe in probes(("coffee.png",)) if probe.noisy.iso == 3200]
    alone, both, all_eight = (mean_psnr(model, measured, ensemble=count) for count in (1, 2, 8))
    assert alone + 0.03 < both
    assert both + 0.01 < all_eight


def test_progress_counts_the_tiles_of_all_copies(rng: np.random.Generator) -> None:
    calls: list[tuple[int, int]] = []
    noisy = raw(rng, 64, 96)
    denoise_raw(noisy, denoiser(), ensemble=2, tile_px=16, progress=lambda *done: calls.append(done))
    shares = [done / tiles for done, tiles in calls]
    assert shares == sorted(shares)
    assert shares[5] == 0.5  # 2 x 3 tiles of the first copy
    assert shares[-1] == 1


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
def test_progress_never_goes_back_where_mirrored_copies_have_other_tiles(
    rng: np.random.Generator, cfa: str
) -> None:
    calls: list[tuple[int, int]] = []
    noisy = replace(raw(rng, 64, 64), cfa=cfa)
    denoise_raw(noisy, denoiser(), ensemble=8, tile_px=32, progress=lambda *done: calls.append(done))
    assert [done for done, _ in calls] == sorted(done for done, _ in calls)
    assert {total for _, total in calls} == {calls[-1][0]}


def test_the_commands_take_it(rng: np.random.Generator, photos: Path, tmp_path: Path) -> None:
    noisy = tmp_path / "noisy.dng"
    write_dng(noisy, raw(rng, 64, 64))
    command = ["denoise", str(noisy), str(tmp_path / "clean.dng"), "--quiet"]
    main([*command, "--ensemble", "4"])
    expected = fsid.denoise(read_raw(noisy), ensemble=4)
    np.testing.assert_allclose(read_raw(tmp_path / "clean.dng").mosaic, expected.mosaic, atol=1e-4)
    with pytest.raises(FsidError, match="ensemble 3: must be 1, 2, 4 or 8"):
        fsid.denoise(read_raw(noisy), ensemble=3)

    testset = tmp_path / "testset"
    options = ["--camera", "pixel6", "--iso", "3200", "--quiet"]
    main(["testset", "photos", str(photos), "-o", str(testset), *options])
    assert len(read_testset(testset).images) == 3
    alone, both = (evaluate_models(testset, ["nafnet-small"], ensemble=count).rows[-1] for count in (1, 2))
    assert (alone.model, both.model) == ("nafnet-small", "nafnet-small (mean of 2)")
    assert both.psnr_raw > alone.psnr_raw
