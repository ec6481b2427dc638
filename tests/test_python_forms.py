"""What means the same is taken: a path as a text, one network or a loaded one, pictures in any sequence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import fsid
from fsid.dataset import check_png, find_pictures, grid, save_png
from fsid.errors import FsidError
from fsid.evaluate import evaluate_models, model_method, photo_testset, psnr, ssim

LIGHT = np.full((8, 8, 3), 0.5, np.float32)


def test_a_path_may_be_a_text(tmp_path: Path):
    save_png(tmp_path / "a.png", LIGHT)
    check_png(str(tmp_path / "a.png"))
    assert find_pictures(str(tmp_path)) == [tmp_path / "a.png"]


def test_pictures_may_come_in_any_sequence():
    assert np.array_equal(grid(np.stack([LIGHT, LIGHT])), grid(LIGHT for _ in range(2)))


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
