"""A path may be a text, in all that a script calls: `train("data", "run", ...)`."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest

from fsid.dataset import find_photos, read_member, read_photo, save_png, shard_keys, shard_path, write_shard
from fsid.errors import FsidError
from fsid.evaluate import NOISY, burst_testset, compare, photo_testset, read_testset, write_results
from fsid.render.gltf import write_glb
from fsid.scene import SceneConfig, sample
from fsid.sensor import Raw, calibrate, write_dng


@pytest.fixture
def data(tmp_path: Path, rng: np.random.Generator) -> str:
    folder = str(tmp_path)
    samples = []
    for number in range(2):
        file = io.BytesIO()
        x = rng.uniform(0, 1, (40, 60)).astype(np.float32)
        write_dng(file, Raw(x, "RGGB", 64, 1023, (2.0, 1.0, 1.5), np.eye(3)))
        samples.append((f"{number:08d}", {"clean.dng": file.getvalue(), "json": b"{}"}))
    shard = str(shard_path(folder, 0))
    write_shard(shard, samples)
    assert shard_keys(shard) == ["00000000", "00000001"]
    assert read_member(shard, "00000000.json") == b"{}"
    return folder


def test_photographs_and_test_sets(photos: Path, tmp_path: Path):
    picture = read_photo(str(find_photos(str(photos))[0]))
    save_png(str(tmp_path / "picture.png"), picture)
    root = str(tmp_path / "set")
    photo_testset([str(photos)], root, camera="pixel6", isos=[3200])
    assert read_testset(root).levels == ("iso3200",)
    write_results(compare(root, [NOISY]).rows, str(tmp_path / "results.json"))
    assert (tmp_path / "results.json").is_file()


def test_a_scene(tmp_path: Path):
    write_glb(str(tmp_path / "scene.glb"), sample(SceneConfig(objects=(1, 1)), 1), texture_size=64)
    assert (tmp_path / "scene.glb").read_bytes()[:4] == b"glTF"


def test_what_is_not_there_is_named(tmp_path: Path):
    with pytest.raises(FsidError, match="captures: is not a folder"):
        burst_testset(str(tmp_path / "captures"), str(tmp_path / "set"))
    with pytest.raises(FsidError, match="frames: no such frame"):
        calibrate(iter([str(tmp_path / "frames")]), name="mine", dark=iter([str(tmp_path / "dark")]))


def test_training(data: str, tmp_path: Path):
    pytest.importorskip("torch")
    from fsid.dataset.loader import PatchConfig, PatchDataset
    from fsid.denoise import (
        NetworkConfig,
        TrainConfig,
        denoise_file,
        denoise_folder,
        find_raws,
        load_history,
        load_model,
        save_model,
        train,
    )
    from fsid.denoise.export import export

    assert PatchDataset(data, PatchConfig(8, 2, ("pixel6",), 400, 800), 0).mosaics == 2
    network = NetworkConfig(width=4, encoder_blocks=(1,), decoder_blocks=(1,))
    config = TrainConfig(network, steps=1, batch=1, patch_px=8, log_every=1, threads=1, tensorboard=False)
    run = str(tmp_path / "run")
    train(data, run, config, quiet=True)
    assert load_history(run)[0] == [1]
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.dng").write_bytes(read_member(shard_path(data, 0), "00000000.clean.dng"))
    found = find_raws(str(tmp_path / "in"))
    model = load_model(run)
    denoise_folder(list(map(str, found)), str(tmp_path / "out"), model, profile="pixel6", iso=800)
    denoise_file(str(found[0]), str(tmp_path / "b.dng"), model, profile="pixel6", iso=800)
    assert (tmp_path / "out" / "a.dng").read_bytes() == (tmp_path / "b.dng").read_bytes()
    model = load_model(run)
    save_model(str(tmp_path / "own.safetensors"), model.net.state_dict(), model.card)
    assert load_model(str(tmp_path / "own.safetensors")).card == model.card
    own = export(run, str(tmp_path / "exported.safetensors"), "float32").file
    assert load_model(str(own)).card == model.card
