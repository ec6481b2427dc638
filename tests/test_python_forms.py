"""What means the same is taken: a path as a text, one network or a loaded one, pictures in any sequence."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import fsid
from fsid.dataset import check_png, find_pictures, grid, save_png
from fsid.errors import FsidError
from fsid.evaluate import denoise_classical, evaluate_models, model_method, photo_testset, psnr, ssim
from fsid.sensor import NoiseLevel, Raw

LIGHT = np.full((8, 8, 3), 0.5, np.float32)


def test_a_path_may_be_a_text(tmp_path: Path):
    save_png(tmp_path / "a.png", LIGHT)
    check_png(str(tmp_path / "a.png"))
    assert find_pictures(str(tmp_path)) == [tmp_path / "a.png"]


def test_pictures_may_come_in_any_sequence():
    assert np.array_equal(grid(np.stack([LIGHT, LIGHT])), grid(LIGHT for _ in range(2)))


@pytest.mark.parametrize("kind", [np.float16, np.float64, ">f4"])
def test_a_mosaic_of_any_floating_point_is_kept_in_single_precision(kind: str):
    raw = Raw(np.full((4, 4), 0.25, kind), "RGGB", 64, 1023, (2.0, 1.0, 1.5), np.eye(3))
    assert raw.mosaic.dtype == np.float32
    assert raw.mosaic.dtype.isnative
    assert (raw.mosaic == 0.25).all()


def test_the_classical_denoiser_keeps_single_precision():
    raw = Raw(np.full((16, 16), 0.25), "RGGB", 64, 1023, (2.0, 1.0, 1.5), np.eye(3))
    level = NoiseLevel((1e-3,) * 4, (1e-5,) * 4)
    assert denoise_classical(raw, level).mosaic.dtype == np.float32


def test_other_processes_can_be_handed_the_function():
    pytest.importorskip("torch")
    assert pickle.loads(pickle.dumps(fsid.denoise)) is fsid.denoise


def test_a_file_that_cannot_be_denoised_is_named_where_nobody_is_told(tmp_path: Path):
    pytest.importorskip("torch")
    (tmp_path / "bad.dng").write_bytes(b"")
    with pytest.raises(FsidError, match=r"1 of 1 files could not be denoised: .*bad\.dng"):
        fsid.denoise.denoise_folder([tmp_path / "bad.dng"], tmp_path / "out", fsid.load_model())


def test_figures_take_tensors():
    torch = pytest.importorskip("torch")
    image = np.linspace(0, 1, 16 * 16 * 3, dtype=np.float32).reshape(16, 16, 3)
    for figure in (psnr, ssim):
        assert figure(torch.from_numpy(image), torch.from_numpy(image / 2)) == figure(image, image / 2)


def test_a_network_may_be_one_and_loaded(tmp_path: Path):
    pytest.importorskip("torch")
    (tmp_path / "photos").mkdir()
    save_png(tmp_path / "photos" / "a.png", np.full((64, 64, 3), 0.5))
    photo_testset(tmp_path / "photos", tmp_path / "set", camera="pixel6", isos=[3200])
    with pytest.raises(FsidError, match="net: no such file"):
        evaluate_models(tmp_path / "set", "net")
    network = fsid.load_model()
    assert model_method(network, "mine").training == network.card.training
