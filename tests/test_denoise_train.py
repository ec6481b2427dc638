"""Training learns, can be killed at any moment, and then ends with the same bits."""

from __future__ import annotations

import errno
import io
import json
import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from importlib.resources import as_file, files
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from accelerate import Accelerator  # noqa: E402
from safetensors.torch import load_file, save_file  # noqa: E402

from fsid.cli.main import main  # noqa: E402
from fsid.config import load_settings, save_settings  # noqa: E402
from fsid.dataset import DatasetConfig, GenerateConfig  # noqa: E402
from fsid.dataset.loader import Batch  # noqa: E402
from fsid.dataset.shards import shard_path, write_shard  # noqa: E402
from fsid.denoise import (  # noqa: E402
    NetworkConfig,
    TrainConfig,
    denoise_raw,
    load_denoiser,
    load_history,
    progress_line,
    train,
)
from fsid.denoise.checkpoint import TrainState, load_checkpoint  # noqa: E402
from fsid.denoise.denoise import most_noise, variance_at_grey  # noqa: E402
from fsid.denoise.raw_denoiser import RawDenoiser  # noqa: E402
from fsid.denoise.run_output import card_of  # noqa: E402
from fsid.denoise.stabilise import stabilise, unstabilise  # noqa: E402
from fsid.denoise.tensorboard_log import TensorBoardLog  # noqa: E402
from fsid.denoise.train import _prepare, _step, learning_rate, mean_psnr, noise_left  # noqa: E402
from fsid.denoise.validate import Validation, _captures, held_out, validation  # noqa: E402
from fsid.errors import FsidError  # noqa: E402
from fsid.files import held  # noqa: E402
from fsid.pace import Pace  # noqa: E402
from fsid.sensor import Raw, add_noise, clean_levels, load_profile, save_profile, write_dng  # noqa: E402

CONFIG = TrainConfig(
    network=NetworkConfig(width=4, encoder_blocks=(1,), middle_blocks=1, decoder_blocks=(1,)),
    steps=8,
    batch=2,
    patch_px=16,
    learning_rate=5e-3,
    warmup_steps=2,
    log_every=3,
    checkpoint_every=2,
    threads=1,
    tensorboard=False,
)

KILLED_TRAINING = """
import os, signal, sys
from pathlib import Path
from fsid.config import load_settings
from fsid.denoise import TrainConfig, train
def progress(done, steps):
    if done == 5:
        os.kill(os.getpid(), signal.SIGKILL)
data, run, config = map(Path, sys.argv[1:])
train(data, run, load_settings(TrainConfig, config), progress=progress)
"""


def patches_of_colour(rng: np.random.Generator, size: int = 96) -> Raw:
    """Smooth blobs: clean images from which denoising can be learnt in seconds."""
    from scipy.ndimage import gaussian_filter

    blobs = gaussian_filter(rng.standard_normal((size, size)), 6)
    x = np.float32(0.3) + np.float32(0.2) * np.tanh(8 * blobs).astype(np.float32)
    return Raw(x, "GBRG", 64, 1023, (2.0, 1.0, 1.5), np.eye(3))


def stored(rng: np.random.Generator, number: int, size: int = 96) -> tuple[str, dict[str, bytes]]:
    buffer = io.BytesIO()
    write_dng(buffer, clean_levels(patches_of_colour(rng, size)))
    return f"{number:08d}", {"clean.dng": buffer.getvalue()}


def stop_at_five(done: int, steps: int) -> None:
    if done == 5:
        raise KeyboardInterrupt


def test_the_loss_is_the_share_of_the_variance_of_the_noise_that_is_left() -> None:
    """A dark patch of a quiet camera, a bright one of a noisy camera; a fifth and all of the noise left."""
    k, sigma2 = torch.tensor([[1e-4] * 4, [1e-2] * 4]), torch.tensor([[1e-6] * 4, [1e-4] * 4])
    levels = k[..., None, None], sigma2[..., None, None]
    clean = torch.tensor([0.05, 0.7]).reshape(2, 1, 1, 1).expand(2, 4, 64, 64)
    noise = torch.randn(clean.shape, generator=torch.Generator().manual_seed(1))
    left = torch.tensor([0.2, 1.0]).reshape(2, 1, 1, 1)
    estimate = unstabilise(stabilise(clean, *levels) + left * noise, *levels)
    assert noise_left(estimate, clean, k, sigma2).item() == pytest.approx((0.2**2 + 1) / 2, rel=0.03)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    rng = np.random.default_rng(1)
    folder = tmp_path_factory.mktemp("data")

    write_shard(shard_path(folder, 0), [stored(rng, number) for number in range(4)])
    return folder


def test_training_denoises(data: Path, tmp_path: Path) -> None:
    network = replace(CONFIG.network, width=8)
    short = {"steps": 150, "batch": 4, "warmup_steps": 10, "learning_rate": 1e-2, "ema_decay": 0.9}
    config = replace(CONFIG, network=network, log_every=10, **short)
    model = load_denoiser(train(data, tmp_path / "run", config, quiet=True))
    rng = np.random.default_rng(2)
    clean, level = patches_of_colour(rng), load_profile("pixel6").level(3200)
    noisy = add_noise(rng, clean, level)
    errors = [np.mean((image.mosaic - clean.mosaic) ** 2) for image in (noisy, denoise_raw(noisy, model))]
    assert 10 * np.log10(errors[0] / errors[1]) > 4
    steps, losses, psnrs = load_history(tmp_path / "run")
    assert steps == list(range(10, 151, 10))
    assert losses[-1] < losses[0]
    assert psnrs[-1] > psnrs[0]


def test_weights_that_are_no_numbers_are_not_kept(data: Path, tmp_path: Path) -> None:
    """The last step before a checkpoint or the end, after which no loss shows that it was ruinous."""
    for steps in (1, 3):
        ruin = replace(CONFIG, steps=steps, learning_rate=1e39, checkpoint_every=1)
        with pytest.raises(FsidError, match="the weights are not finite after step 1: the training diverged"):
            train(data, tmp_path / "run", ruin, quiet=True)
        assert not list((tmp_path / "run").glob("*.safetensors"))


def test_the_history_has_the_last_steps_and_is_never_empty(data: Path, tmp_path: Path) -> None:
    for log_every, rows in ((3, [3, 6, 8]), (100, [8])):
        run = tmp_path / f"every{log_every}"
        train(data, run, replace(CONFIG, log_every=log_every), quiet=True)
        assert load_history(run)[0] == rows
        assert load_checkpoint(run, *_prepare(Accelerator(cpu=True), CONFIG, None)).pending == []


@pytest.mark.parametrize(
    "name", ["model.safetensors", "initial.safetensors", "mine.safetensors", "shard-0.tar"]
)
def test_networks_and_data_that_lie_in_the_folder_are_not_replaced(
    data: Path, tmp_path: Path, name: str
) -> None:
    """Without a config.yaml they are of no run that could go on."""
    (tmp_path / name).write_bytes(b"mine")
    (tmp_path / "initial.json").write_bytes(b"mine, too")
    with pytest.raises(
        FsidError, match="holds a dataset" if name.endswith(".tar") else f"holds {name} of no"
    ):
        train(data, tmp_path, CONFIG, quiet=True)
    there = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert there == {name: b"mine", "initial.json": b"mine, too"}


def test_a_killed_training_ends_with_the_same_bits(tmp_path: Path) -> None:
    """Killed at step 5: after a validation at 3 that wrote the best network, and a checkpoint at 4."""
    folder, rng = tmp_path / "data", np.random.default_rng(4)
    folder.mkdir()
    write_shard(shard_path(folder, 0), [stored(rng, number) for number in range(5)])
    config = replace(CONFIG, held_out=1, validate_every=3)
    undisturbed = train(folder, tmp_path / "a", config, quiet=True)
    arguments = [str(folder), str(tmp_path / "b"), str(tmp_path / "a" / "config.yaml")]
    killed = subprocess.run([sys.executable, "-c", KILLED_TRAINING, *arguments], check=False)
    assert killed.returncode == -signal.SIGKILL
    assert not (tmp_path / "b" / "last.safetensors").exists()
    (tmp_path / "b" / "checkpoint.safetensors.1234.part").write_bytes(b"as if it was killed while it wrote")
    resumed = train(folder, tmp_path / "b", config, resume=True, quiet=True)
    assert not list((tmp_path / "b").glob("*.part"))
    assert [row["step"] for row in json.loads((tmp_path / "b" / "validation.json").read_text())] == [3, 6, 8]
    for name in (
        "model.safetensors",
        "last.safetensors",
        "checkpoint.safetensors",
        "history.json",
        "validation.json",
    ):
        assert (tmp_path / "b" / name).read_bytes() == (tmp_path / "a" / name).read_bytes()
    weights = load_file(tmp_path / "a" / "last.safetensors")
    assert not torch.equal(weights["net.intro.weight"], torch.zeros_like(weights["net.intro.weight"]))
    assert train(folder, tmp_path / "b", config, quiet=True).read_bytes() == undisturbed.read_bytes()
    assert resumed == tmp_path / "b" / "model.safetensors"


@pytest.mark.filterwarnings("ignore:for .* copying from a non-meta parameter")
def test_the_state_of_the_optimizer_comes_back_to_the_device_of_the_weights(
    data: Path, tmp_path: Path
) -> None:
    """On a GPU the fused AdamW reads even the count of steps there; "meta" stands for one."""
    train(data, tmp_path, CONFIG, quiet=True)
    net = RawDenoiser(CONFIG.network).to("meta")
    optimizer = torch.optim.AdamW(net.parameters())
    state = load_checkpoint(tmp_path, net, optimizer)
    assert all(tensor.is_meta for tensor in state.average.values())
    for parameter in net.parameters():
        assert set(optimizer.state[parameter]) == {"step", "exp_avg", "exp_avg_sq"}
        assert all(tensor.is_meta for tensor in optimizer.state[parameter].values())


def test_two_processes_train_one_network(data: Path, tmp_path: Path) -> None:
    """Each draws its own patches, gradients are averaged, and one of them writes."""
    arguments = ["train", str(data), "-o", str(tmp_path / "run"), "--quiet"]
    save_settings(replace(CONFIG, steps=6, checkpoint_every=3), tmp_path / "config.yaml")
    launch = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
    command = [*launch, "-m", "fsid", *arguments, "--config", str(tmp_path / "config.yaml")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    sessions = json.loads((tmp_path / "run" / "sessions.json").read_text())
    assert [(row["processes"], row["first_step"], row["last_step"]) for row in sessions] == [(2, 0, 6)]
    both = load_file(tmp_path / "run" / "model.safetensors")
    alone = load_file(train(data, tmp_path / "alone", replace(CONFIG, steps=6), quiet=True))
    assert any(not torch.equal(both[name], alone[name]) for name in both)


def test_the_best_network_on_held_out_scenes_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A learning rate that ends in ruin: the best network is an early one, and the last one is worse."""

    def ruinous(config: TrainConfig, step: int) -> float:
        return 0.5 if step >= 35 else learning_rate(config, step)

    monkeypatch.setattr(sys.modules["fsid.denoise.train"], "learning_rate", ruinous)
    folder, rng = tmp_path / "data", np.random.default_rng(3)
    folder.mkdir()
    write_shard(shard_path(folder, 0), [stored(rng, number) for number in range(10)])
    config = replace(CONFIG, steps=40, held_out=2, validate_every=5, learning_rate=0.05, clip_norm=1e3)
    model = train(folder, tmp_path / "run", config, quiet=True)
    rows = json.loads((tmp_path / "run" / "validation.json").read_text())
    assert [row["step"] for row in rows] == list(range(5, 41, 5))
    scores = [row["psnr_scenes"] for row in rows]
    assert max(scores) > scores[-1]
    card = json.loads(model.with_suffix(".json").read_text())
    assert card["details"]["validation"] == [rows[int(np.argmax(scores))]]
    assert card["details"]["config"]["seed"] == 0
    assert card["details"]["config"]["shrink"] == [1]
    assert card["sessions"][-1]["first_step"] == 0
    assert card["training"].startswith("8 images")
    noisiest = max(variance_at_grey(load_profile(name).level(config.iso_max)) for name in config.profiles)
    assert card["most_noise"] == pytest.approx(noisiest)
    assert card["lowest"] == pytest.approx(-64 / 959)  # x of DN 0
    last = load_denoiser(tmp_path / "run" / "last.safetensors").net.state_dict()
    watch = validation(held_out(folder, config), config, torch.device("cpu"))
    assert watch.measure(last)["psnr_scenes"] == pytest.approx(scores[-1], abs=1e-9)
    best = load_denoiser(model).net.state_dict()
    assert watch.measure(best)["psnr_scenes"] == pytest.approx(max(scores), abs=1e-9)


@pytest.mark.parametrize("is_older", [False, True])
def test_what_a_run_holds_out_stays_so_when_its_dataset_grows(
    is_older: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of five pictures the last is held out, and its second pair is not trained on.

    A run of an older version holds out what is last now, and does not compare it with what was.
    """
    scores = iter([50.0, 40.0])
    monkeypatch.setattr(Validation, "measure", lambda self, weights: {"psnr_scenes": next(scores)})
    folder, run, rng = tmp_path / "data", tmp_path / "run", np.random.default_rng(3)
    folder.mkdir()
    samples = [stored(rng, number) for number in range(10)]
    write_shard(shard_path(folder, 0), samples[:5])
    save_settings(DatasetConfig(0, 5, GenerateConfig(), pictures=5), folder / "config.yaml")
    config = replace(CONFIG, held_out=1, validate_every=4)

    with pytest.raises(KeyboardInterrupt):
        train(folder, run, config, progress=stop_at_five)
    if is_older:
        sessions = json.loads((run / "sessions.json").read_text())
        (run / "sessions.json").write_text(json.dumps([{**row, "held_out": None} for row in sessions]))
    write_shard(shard_path(folder, 1), samples[5:])
    train(folder, run, config, quiet=True)
    last, best = (load_denoiser(run / name).card for name in ("last.safetensors", "model.safetensors"))
    assert last.training.startswith("8 images")
    row = {"step": 8, "held_out": 1, "held_out_from": 9 if is_older else 4, "psnr_scenes": 40.0}
    assert last.details["validation"] == [row]
    assert best.details["validation"][0]["psnr_scenes"] == (40.0 if is_older else 50.0)


def test_a_run_does_not_go_on_without_what_it_is_validated_on(tmp_path: Path) -> None:
    """The shard at the end is deleted, as a broken one is; the best network would be replaced by the last."""
    folder, run, rng = tmp_path / "data", tmp_path / "run", np.random.default_rng(3)
    folder.mkdir()
    for shard in range(2):
        write_shard(shard_path(folder, shard), [stored(rng, 3 * shard + number) for number in range(3)])
    train(folder, run, replace(CONFIG, steps=1), quiet=True)
    best = (run / "model.safetensors").read_bytes()
    shard_path(folder, 1).unlink()
    with pytest.raises(FsidError, match=r"data: 00000005 is there no more, on which .* its shard back"):
        train(folder, run, replace(CONFIG, steps=1), quiet=True)
    assert (run / "model.safetensors").read_bytes() == best


def test_a_run_keeps_the_sizes_that_it_was_begun_with(data: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    train(data, run, replace(CONFIG, shrink=(2,), steps=2), quiet=True)
    train(data, run, replace(CONFIG, steps=2), quiet=True)
    with pytest.raises(FsidError, match="another shrink"):
        train(data, run, replace(CONFIG, shrink=(1,), steps=2), quiet=True)


def test_an_error_that_is_kept_keeps_no_loader_processes(data: Path, tmp_path: Path) -> None:
    """A notebook keeps the last one, with all that its frames refer to."""

    def stop(step: int, steps: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as kept:
        train(data, tmp_path / "run", replace(CONFIG, steps=50, loader_processes=1), progress=stop)
    assert kept.tb
    assert not multiprocessing.active_children()


@pytest.fixture
def large(tmp_path: Path) -> Path:
    """An image that is trained on at two sizes."""
    folder = tmp_path / "large"
    folder.mkdir()
    write_shard(shard_path(folder, 0), [stored(np.random.default_rng(0), 0, 960)])
    return folder


def test_a_run_says_the_sizes_that_it_chose(large: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    train(large, run, replace(CONFIG, steps=2), quiet=True)
    assert load_settings(TrainConfig, run / "config.yaml").shrink == (1, 2)


def test_a_run_of_before_there_were_sizes_draws_images_as_they_are(large: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    whole = train(large, tmp_path / "whole", replace(CONFIG, shrink=(1,)), quiet=True)

    with pytest.raises(KeyboardInterrupt):
        train(large, run, replace(CONFIG, shrink=(1,)), progress=stop_at_five)
    file = run / "config.yaml"
    file.write_text("".join(line for line in file.read_text().splitlines(True) if "shrink" not in line))
    resumed = train(large, run, CONFIG, quiet=True)
    assert load_file(resumed).keys() == load_file(whole).keys()
    assert all(torch.equal(load_file(resumed)[key], load_file(whole)[key]) for key in load_file(whole))


def test_photographs_are_watched_and_do_not_choose(data: Path, photos: Path, tmp_path: Path) -> None:
    watched = {"validate_every": 4, "validation_photos": str(photos), "tensorboard": True}
    config = replace(CONFIG, steps=4, **watched)
    model = train(data, tmp_path / "run", config, quiet=True)
    (row,) = json.loads((tmp_path / "run" / "validation.json").read_text())
    assert 20 < row["psnr_photos"] < 60
    assert "psnr_scenes" not in row  # four images are too few to hold one out
    assert list((tmp_path / "run" / "tensorboard").iterdir())
    assert model.exists()


def test_progress_replaces_the_progress_line_and_quiet_is_silent(
    data: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    calls: list[tuple[int, int]] = []
    train(data, tmp_path / "a", CONFIG, progress=lambda *done: calls.append(done))
    assert calls == [(step, 8) for step in range(1, 9)]
    train(data, tmp_path / "b", CONFIG, quiet=True)
    assert capfd.readouterr() == ("", "")
    train(data, tmp_path / "c", CONFIG)
    assert "PSNR" in "".join(capfd.readouterr())
    train(data, tmp_path / "c", CONFIG)  # done already: no step has figures to show
    shown = "".join(capfd.readouterr())
    assert "8/8" in shown
    assert "PSNR" not in shown


def test_a_training_says_its_step_in_a_terminal_of_eighty_columns(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    times = iter((0.0, *(100.0,) * 9))
    monkeypatch.setattr(progress_line, "Pace", lambda: Pace(lambda: next(times)))
    with progress_line.ProgressLine(replace(CONFIG, steps=100_000), 0, 1, quiet=False) as line:
        line.validated(48.18)
        line.update(12_345, 0.233, 48.96)
    shown = capsys.readouterr().err
    assert "12345/100000 PSNR 48.96 dB held out 48.18 dB" in shown
    assert "patches/s, 0:11:50 left" in shown


@pytest.mark.parametrize(
    ("images", "pictures", "wanted", "kept"),
    [(40, 0, 8, 8), (12, 0, 8, 2), (40, 8, 8, 1), (50, 10, 8, 2), (40, 4, 8, 0), (4, 0, 8, 0), (40, 0, 0, 0)],
)
def test_held_out_pictures_are_at_most_a_fifth_of_the_data(
    images: int, pictures: int, wanted: int, kept: int, tmp_path: Path
) -> None:
    """Also where each of a few pictures is there many times: eight photographs were all held out."""
    sample = stored(np.random.default_rng(5), 0)[1]
    write_shard(shard_path(tmp_path, 0), [(f"{number:08d}", sample) for number in range(images)])
    save_settings(DatasetConfig(0, images, GenerateConfig(), pictures=pictures), tmp_path / "config.yaml")
    found = held_out(tmp_path, replace(CONFIG, held_out=wanted))
    keys = [f"{number:08d}" for number in range(images - kept, images)]
    assert [mosaic.key for mosaic in found] == keys
    assert held_out(tmp_path, CONFIG, iter(keys)) == found


def test_a_training_that_validates_nothing_says_so(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(4)
    for images, kept, is_noted in ((4, 8, True), (4, 0, False), (5, 8, False)):
        folder = tmp_path / f"{images}-{kept}"
        folder.mkdir()
        write_shard(shard_path(folder, 0), [stored(rng, number) for number in range(images)])
        train(folder, folder / "run", replace(CONFIG, steps=1, held_out=kept))
        assert capfd.readouterr().err.count("none is held out for validation") == is_noted


@pytest.mark.parametrize("ends", [True, False], ids=["done", "interrupted"])
def test_a_training_leaves_pytorch_as_it_was(ends: bool, data: Path, tmp_path: Path) -> None:
    threads, state = torch.get_num_threads(), torch.get_rng_state()
    config = replace(CONFIG, steps=2, threads=threads + 1)
    with nullcontext() if ends else pytest.raises(KeyboardInterrupt):
        train(data, tmp_path / "run", config, quiet=ends, progress=None if ends else interrupted_after(1))
    assert torch.get_num_threads() == threads
    assert torch.equal(torch.get_rng_state(), state)


@pytest.fixture
def accelerate() -> Iterator[ModuleType]:
    """As a process finds it that has made no Accelerator yet."""
    module = pytest.importorskip("accelerate")
    module.state.AcceleratorState._reset_state(reset_partial_state=True)
    module.state.GradientState._reset_state()
    yield module
    module.state.AcceleratorState._reset_state(reset_partial_state=True)
    module.state.GradientState._reset_state()


def test_an_accelerator_of_one_s_own_is_as_it_was(accelerate: ModuleType, data: Path, tmp_path: Path) -> None:
    """Amidst its accumulation of gradients, in which FSID's own steps are not skipped."""
    expected = train(data, tmp_path / "alone", CONFIG, quiet=True).read_bytes()
    own = accelerate.Accelerator(cpu=True, gradient_accumulation_steps=4)
    net = own.prepare(torch.nn.Linear(2, 2))
    with own.accumulate(net):
        assert not own.sync_gradients
    assert train(data, tmp_path / "beside", CONFIG, quiet=True).read_bytes() == expected
    assert own.gradient_accumulation_steps == 4
    assert not own.sync_gradients


@pytest.mark.parametrize("is_before", [True, False])
def test_an_accelerator_of_one_s_own_may_have_another_precision(
    is_before: bool, accelerate: ModuleType, data: Path, tmp_path: Path
) -> None:
    make = partial(accelerate.Accelerator, cpu=True, mixed_precision="bf16")
    before = make() if is_before else None
    train(data, tmp_path / "run", replace(CONFIG, steps=1), quiet=True)
    assert (before or make()).mixed_precision == "bf16"


def test_a_compiler_that_accelerate_is_configured_with_changes_nothing(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`accelerate launch` says so to its processes; the names of a compiled network's weights are others."""
    monkeypatch.setenv("ACCELERATE_DYNAMO_BACKEND", "EAGER")
    load_denoiser(train(data, tmp_path / "run", replace(CONFIG, steps=1), quiet=True))


@pytest.mark.parametrize(
    ("variable", "name"),
    [
        ("DEEPSPEED", "DeepSpeed"),
        ("FSDP", "FSDP"),
        ("MEGATRON_LM", "Megatron-LM"),
        ("PARALLELISM_CONFIG", "ParallelismConfig"),
    ],
)
def test_a_network_in_parts_is_refused(
    variable: str, name: str, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As `accelerate launch` configures its processes: DeepSpeed ended in a traceback."""
    monkeypatch.setenv(f"ACCELERATE_USE_{variable}", "true")
    with pytest.raises(FsidError, match=f"{name}: the configuration of accelerate asks for it"):
        train(data, tmp_path / "run", replace(CONFIG, steps=1), quiet=True)
    assert not (tmp_path / "run").exists()


def test_a_folder_is_one_training_s_at_a_time(data: Path, tmp_path: Path) -> None:
    run, one = tmp_path / "run", replace(CONFIG, steps=1)
    with (
        held(run, "another test is at work in it"),
        pytest.raises(FsidError, match=r"run: another fsid train is at work in it; wait for it or stop it"),
    ):
        train(data, run, one, quiet=True)
    assert not (run / "checkpoint.safetensors").exists()
    train(data, run, one, quiet=True)
    assert (run / "checkpoint.safetensors").exists()


def test_a_folder_that_cannot_be_written_is_one_line_before_the_work(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fsid.files.os.access", lambda *_: False)
    with pytest.raises(FsidError, match="run: cannot be written"):
        train(data, tmp_path / "run", replace(CONFIG, steps=1), quiet=True)
    assert not (tmp_path / "run").exists()


def test_a_run_that_goes_on_keeps_the_figures_up_to_its_checkpoint_in_tensorboard(tmp_path: Path) -> None:
    accumulator = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    for first, steps in ((0, (2,)), (0, (2, 4, 6)), (4, (6,))):  # killed before a checkpoint, and after one
        board = TensorBoardLog(tmp_path, first, wanted=True)
        for step in steps:
            board.write(step, {"train/loss": float(first + step)})
        board.close()
    events = accumulator.EventAccumulator(str(tmp_path / "tensorboard")).Reload()
    assert [(event.step, event.value) for event in events.Scalars("train/loss")] == [(2, 2), (4, 4), (6, 10)]


def test_logs_that_cannot_be_written_are_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the place of a file, and where the disk is full by then."""
    pytest.importorskip("tensorboard")

    def full(*point: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    line = r"tensorboard: cannot be written .*tensorboard=false does without"
    board = TensorBoardLog(tmp_path / "full", 0, wanted=True)
    monkeypatch.setattr("torch.utils.tensorboard.SummaryWriter.add_scalar", full)
    with pytest.raises(FsidError, match=line):
        board.write(1, {"train/loss": 1.0})
    (tmp_path / "tensorboard").touch()
    with pytest.raises(FsidError, match=line):
        TensorBoardLog(tmp_path, 0, wanted=True)


def test_the_corrected_command_goes_into_the_folder_of_the_one_that_failed(
    data: Path, tmp_path: Path
) -> None:
    run, wrong = tmp_path / "run", replace(CONFIG, steps=1, validation_photos=str(tmp_path / "nowhere"))
    with pytest.raises(FsidError, match="nowhere"):
        train(data, run, wrong, quiet=True)
    right = replace(wrong, validation_photos="")
    with held(run, "another test is at work in it"), pytest.raises(FsidError, match="at work"):
        train(data, run, right, quiet=True)
    assert load_settings(TrainConfig, run / "config.yaml") == replace(wrong, shrink=(1,))
    train(data, run, right, quiet=True)
    assert load_settings(TrainConfig, run / "config.yaml") == replace(right, shrink=(1,))
    (run / "checkpoint.safetensors").unlink()
    with pytest.raises(FsidError, match="another validation_photos"):
        train(data, run, wrong, quiet=True)


def test_a_run_says_nothing_of_one_that_failed_before_it_had_a_network(data: Path, tmp_path: Path) -> None:
    """That one's session, on other data, was written before the checkpoint that could not be."""
    run, other, one = tmp_path / "run", tmp_path / "other", replace(CONFIG, steps=1)
    other.mkdir()
    write_shard(shard_path(other, 0), [stored(np.random.default_rng(5), number) for number in range(2)])
    with pytest.raises(FsidError, match="not finite"):
        train(other, run, replace(one, learning_rate=1e39), quiet=True)
    train(data, run, one, quiet=True)
    train(data, run, one, quiet=True)
    assert len(json.loads((run / "sessions.json").read_text())) == 1


def test_settings_made_in_python_go_on(data: Path, tmp_path: Path) -> None:
    """A list of profiles is read back as a tuple, which is no other training."""
    config = replace(CONFIG, steps=np.int64(1), profiles=["pixel6"])
    train(data, tmp_path / "run", config, quiet=True)
    train(data, tmp_path / "run", config, quiet=True)


def test_a_run_goes_on_with_settings_that_change_nothing(data: Path, tmp_path: Path) -> None:
    whole, stopped = tmp_path / "whole", tmp_path / "stopped"
    train(data, whole, CONFIG, quiet=True)
    with pytest.raises(KeyboardInterrupt):
        train(data, stopped, CONFIG, progress=stop_at_five)
    other = replace(CONFIG, checkpoint_every=3, loader_processes=1, tensorboard=True)
    train(data, stopped, other, quiet=True)
    assert load_settings(TrainConfig, stopped / "config.yaml") == replace(other, shrink=(1,))
    expected, weights = (load_file(run / "last.safetensors") for run in (whole, stopped))
    assert all(torch.equal(weights[name], expected[name]) for name in expected)
    with pytest.raises(FsidError, match="another threads;"):
        train(data, stopped, replace(CONFIG, threads=2), quiet=True)


def test_a_run_stays_with_its_noise(data: Path, tmp_path: Path) -> None:
    """A profile that was calibrated again has its name, and other noise."""
    run, mine, profile = tmp_path / "run", tmp_path / "mine.yaml", load_profile("pixel6")
    config = replace(CONFIG, steps=1, profiles=(str(mine),))
    save_profile(mine, profile)
    train(data, run, config, quiet=True)
    save_profile(mine, replace(profile, notes="the same noise"))
    train(data, run, config, quiet=True)
    save_profile(mine, replace(profile, k=1.1 * profile.k))
    with pytest.raises(FsidError, match=r"run: this run was started with another noise than .*mine\.yaml"):
        train(data, run, config, quiet=True)


@pytest.mark.parametrize("said", ["made: 2026-11-29", "key: !!binary aGVsbG8=", "of: !!set {a, b}"])
def test_settings_of_data_that_no_card_can_say_are_named_before_the_training(
    said: str, data: Path, tmp_path: Path
) -> None:
    """They were a traceback when the first network was to be saved."""
    folder = tmp_path / "data"
    shutil.copytree(data, folder)
    save_settings(DatasetConfig(0, 2, GenerateConfig()), folder / "config.yaml")
    with (folder / "config.yaml").open("a") as file:
        file.write(f"{said}\n")
    with pytest.raises(FsidError, match=r"config\.yaml: holds what is neither text nor number"):
        train(folder, tmp_path / "run", replace(CONFIG, steps=1), quiet=True)
    assert not list((tmp_path / "run").glob("*.safetensors"))


@pytest.mark.parametrize("keys", [[{}], [["a"]], [1, "a"]])
def test_a_run_that_holds_out_what_no_key_is_is_refused(
    keys: list[object], data: Path, tmp_path: Path
) -> None:
    run = tmp_path / "run"
    train(data, run, replace(CONFIG, steps=1), quiet=True)
    rows = json.loads((run / "sessions.json").read_text())
    (run / "sessions.json").write_text(json.dumps([row | {"held_out": keys} for row in rows]))
    with pytest.raises(FsidError, match=r"is there no more, on which the run in .* is validated"):
        train(data, run, replace(CONFIG, steps=1), quiet=True)


@pytest.mark.parametrize("has_settings", [True, False])
def test_a_run_stays_with_its_dataset(has_settings: bool, tmp_path: Path) -> None:
    def dataset(name: str, seed: int, shards: int = 1) -> Path:
        folder, rng = tmp_path / name, np.random.default_rng(seed)
        folder.mkdir()
        for shard in range(shards):
            write_shard(shard_path(folder, shard), [stored(rng, 2 * shard + number) for number in range(2)])
        if has_settings:
            save_settings(DatasetConfig(seed, 2, GenerateConfig()), folder / "config.yaml")
        return folder

    run, one, other = tmp_path / "run", replace(CONFIG, steps=1), dataset("other", 2)
    train(dataset("mine", 1), run, one, quiet=True)
    with pytest.raises(FsidError, match=r"run: this run was started on other data than .*other"):
        train(other, run, one, quiet=True)
    train(dataset("mine, moved and grown", 1, shards=2), run, one, quiet=True)
    sessions = run / "sessions.json"
    older = [{key: row[key] for key in row if key != "data"} for row in json.loads(sessions.read_text())]
    sessions.write_text(json.dumps(older))
    train(other, run, one, quiet=True)


def test_fine_tuning_starts_from_a_network_and_says_so(data: Path, tmp_path: Path) -> None:
    """Steps at no rate keep the weights; a run goes on after the network it started from is gone."""
    first = train(data, tmp_path / "first", replace(CONFIG, seed=3), quiet=True)
    before = load_file(first)
    still = replace(CONFIG, initial_weights=str(tmp_path / "first"), learning_rate=1e-30, steps=3)
    after = load_file(train(data, tmp_path / "still", still, quiet=True))
    for name, tensor in before.items():
        torch.testing.assert_close(after[name], tensor, rtol=0, atol=1e-7)
    moved = replace(still, learning_rate=1e-3)
    whole = train(data, tmp_path / "whole", moved, quiet=True).read_bytes()
    with pytest.raises(KeyboardInterrupt):
        train(data, tmp_path / "run", moved, progress=interrupted_after(2))
    first.unlink()
    assert train(data, tmp_path / "run", moved, resume=True, quiet=True).read_bytes() == whole
    card = load_denoiser(tmp_path / "run").card
    assert card.training == f"4 images of {data.name} after 4 images of {data.name}"
    assert card.details["initial"]["details"]["config"]["seed"] == 3


def test_a_network_that_is_trained_on_knows_no_less_noise_than_before(data: Path) -> None:
    """The card of the one that ships does not say how much that is (0)."""
    shipped = load_denoiser("nafnet-small")
    assert shipped.card.most_noise == 0
    card = card_of(data, replace(CONFIG, iso_max=800), 4, shipped)
    assert most_noise(card) >= most_noise(shipped.card)


def test_a_run_keeps_what_it_started_from(tmp_path: Path) -> None:
    """From its first network on; before that another may be chosen, and nothing of the old one stays."""
    data, rng = tmp_path / "data", np.random.default_rng(5)
    data.mkdir()
    write_shard(shard_path(data, 0), [stored(rng, number) for number in range(5)])
    run, source = tmp_path / "run", tmp_path / "source.safetensors"
    networks = [
        train(data, tmp_path / str(seed), replace(CONFIG, seed=seed, steps=2), quiet=True).read_bytes()
        for seed in (3, 9)
    ]
    source.write_bytes(networks[1])
    config = replace(CONFIG, initial_weights=str(source), steps=4, checkpoint_every=4)
    early = replace(config, held_out=1, validate_every=1)  # a network before the first checkpoint

    def seed_of_start(name: str) -> int:
        seed: int = load_denoiser(run / name).card.details["initial"]["details"]["config"]["seed"]
        return seed

    for settings, start in ((config, networks[1]), (early, networks[0])):
        source.write_bytes(start)
        with pytest.raises(KeyboardInterrupt):
            train(data, run, settings, progress=interrupted_after(2))
    assert seed_of_start("model.safetensors") == 3
    source.write_bytes(networks[1])
    train(data, run, early, quiet=True)
    assert seed_of_start("last.safetensors") == 3
    for moved in (config, replace(CONFIG, steps=1)):
        run = tmp_path / f"run of {moved.steps}"
        with pytest.raises(KeyboardInterrupt):
            train(data, run, config, progress=interrupted_after(2))
        source.unlink(missing_ok=True)
        train(data, run, moved, resume=moved is config, quiet=True)
        assert any(run.glob("initial.*")) == (moved is config)
        source.write_bytes(networks[0])


def interrupted_after(steps: int) -> Callable[[int, int], None]:
    def progress(done: int, total: int) -> None:
        if done == steps:
            raise KeyboardInterrupt

    return progress


def test_fine_tuning_refuses_a_network_of_another_size(data: Path, tmp_path: Path) -> None:
    first = train(data, tmp_path / "first", replace(CONFIG, steps=1), quiet=True)
    larger = replace(CONFIG, initial_weights=str(first), network=replace(CONFIG.network, width=8))
    with pytest.raises(FsidError, match=r"initial_weights: .*width=4.*width=8.*--config"):
        train(data, tmp_path / "run", larger, quiet=True)
    with pytest.raises(FsidError, match="nowhere"):
        train(data, tmp_path / "run", replace(CONFIG, initial_weights="nowhere"), quiet=True)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(("decay", "left"), [(0.999, 24 / 17160), (0.15, 0.1 * 0.15**3)])
def test_the_average_of_the_weights_forgets_its_start(decay: float, left: float) -> None:
    """Weights that jump from 0 to 1: four steps miss the product of their decays, 1/10 2/11 3/12 4/13."""
    net = torch.nn.Linear(1, 1)
    with torch.no_grad():
        net.weight.fill_(0.0)
        state = TrainState.start(net)
        net.weight.fill_(1.0)
    for _ in range(4):
        state.advance(net, decay)
    assert state.step == 4
    assert 1 - state.average["weight"].item() == pytest.approx(left, rel=1e-4)


def test_learning_rate_rises_and_falls() -> None:
    config = replace(CONFIG, steps=100, warmup_steps=10, learning_rate=1.0, final_rate=0.01)
    rates = [learning_rate(config, step) for step in range(100)]
    assert rates[9] == max(rates) == 1.0
    assert rates[:10] == sorted(rates[:10])
    assert rates[9:] == sorted(rates[9:], reverse=True)
    assert rates[-1] == pytest.approx(0.01, rel=0.1)
    assert rates[4] == pytest.approx(0.5)
    assert rates[10 + 45] == pytest.approx((1 + 0.01) / 2)


def test_a_row_of_the_history_is_the_mean_of_its_steps() -> None:
    state = TrainState.start(torch.nn.Linear(1, 1))
    assert state.log(1.0, 30.0, 0.1, is_due=False) is None
    assert state.log(3.0, 40.0, 0.1, is_due=True) == {
        "step": 0,
        "loss": 2.0,
        "psnr": 35.0,
        "learning_rate": 0.1,
    }


def test_the_psnr_of_a_batch_is_the_mean_of_its_patches() -> None:
    clean = torch.zeros(2, 4, 8, 8)
    estimate = clean + torch.tensor([0.1, 0.01])[:, None, None, None]
    assert mean_psnr(estimate, clean).item() == pytest.approx((20 + 40) / 2, rel=1e-5)


def test_a_step_forgets_the_gradients_of_the_one_before() -> None:
    net, optimizer = _prepare(Accelerator(cpu=True), CONFIG, None)
    clean, noise = torch.full((1, 4, 16, 16), 0.3), torch.full((1, 4), 1e-3)
    noisy = clean + 0.02 * torch.randn(clean.shape, generator=torch.Generator().manual_seed(0))
    norms = []
    for _ in range(2):
        config, batch = replace(CONFIG, clip_norm=1e6), Batch(noisy, clean, noise, noise)
        _step(Accelerator(cpu=True), net, net, optimizer, batch, 0.0, config)
        norms.append(float(sum(p.grad.square().sum() for p in net.parameters() if p.grad is not None)))
    assert norms[1] == pytest.approx(norms[0], rel=1e-6)
    assert norms[0] > 0


@pytest.mark.parametrize("name", ["nafnet-tiny", "nafnet-small", "nafnet-32", "nafnet-64", "paper"])
def test_shipped_configs_are_valid(name: str) -> None:
    with as_file(files("fsid.configs").joinpath(f"{name}.yaml")) as file:
        assert load_settings(TrainConfig, file).steps > 1


@pytest.mark.parametrize(
    "setting",
    [
        "betas=[2,3]",
        "betas=[0.9,.nan]",
        "weight_decay=.nan",
        "weight_decay=.inf",
        "batch=100000000",
        "learning_rate=.inf",
        "final_rate=.nan",
        "final_rate=-1",
        "iso_max=.inf",
        "threads=100000",
        "loader_processes=100000",
    ],
)
def test_a_setting_that_no_training_survives_is_named(setting: str) -> None:
    with pytest.raises(FsidError, match=setting.partition("=")[0]):
        load_settings(TrainConfig, None, [setting])


@pytest.mark.parametrize("task", ["denoise", "super-resolution", "deblur", "burst", None])
def test_a_denoiser_from_pairs_for_something_else_is_said_to_be_one(
    task: str | None, data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = Path(shutil.copytree(data, tmp_path / "data"))
    (folder / "README.md").touch()
    if task:
        save_settings(DatasetConfig(0, 4, GenerateConfig(task=task)), folder / "config.yaml")
    save_settings(replace(CONFIG, steps=1), tmp_path / "train.yaml")
    command = ["train", str(folder), "-o", str(tmp_path / "run"), "--config", str(tmp_path / "train.yaml")]
    main(command)
    said = capsys.readouterr().err
    assert ("but this trains a denoiser" in said) == (task not in ("denoise", None))
    assert f"pairs for {task}, but" in said or "but this trains" not in said
    main([*command, "--quiet"])
    assert capsys.readouterr().err.count("\n") == ("but this trains a denoiser" in said)


@pytest.mark.parametrize(
    ("cameras", "given", "is_said"),
    [
        (("mine.yaml",), (), True),
        (("mine.yaml",), ("profiles=[pixel6,galaxy-s22]",), False),
        (("galaxy-s22", "pixel6"), (), False),
        (None, (), False),
    ],
)
def test_noise_of_other_cameras_than_those_of_the_dataset_is_said_to_be(
    cameras: tuple[str, ...] | None,
    given: tuple[str, ...],
    is_said: bool,
    data: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A dataset of one's own camera made a denoiser of the noise of two phones, without a word."""
    folder = Path(shutil.copytree(data, tmp_path / "data"))
    if cameras:
        save_settings(DatasetConfig(0, 4, GenerateConfig(cameras=cameras)), folder / "config.yaml")
        (folder / "README.md").touch()
    save_settings(replace(CONFIG, steps=1), tmp_path / "train.yaml")
    command = ["train", str(folder), "-o", str(tmp_path / "run"), "--config", str(tmp_path / "train.yaml")]
    main([*command, "--quiet", *(("--set", *given) if given else ())])
    said = " ".join(capsys.readouterr().err.split())
    line = "was made for mine.yaml; noise is drawn of pixel6, galaxy-s22: --set profiles=[mine.yaml]"
    assert (line in said, bool(said)) == (is_said, is_said)


@pytest.mark.parametrize("lacks", ["config.yaml", "README.md", ""])
def test_a_dataset_that_is_not_finished_is_said_to_be_so(
    lacks: str, data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A folder of several datasets has neither settings nor a card."""
    folder = Path(shutil.copytree(data, tmp_path / "data"))
    save_settings(DatasetConfig(0, 4, GenerateConfig()), folder / "config.yaml")
    (folder / "README.md").touch()
    (folder / lacks).unlink() if lacks else None
    save_settings(replace(CONFIG, steps=1), tmp_path / "train.yaml")
    main(["train", str(folder), "-o", str(tmp_path / "run"), "--config", str(tmp_path / "train.yaml")])
    assert ("has no README.md, which is there when" in capsys.readouterr().err) == (lacks == "README.md")


def test_a_history_is_no_longer_than_a_checkpoint_can_hold() -> None:
    """safetensors takes 100 MB of header, and the training ended there in a traceback, after days."""
    replace(CONFIG, steps=2_000_000, log_every=5, validate_every=1000)
    for every in ({"log_every": 1}, {"validate_every": 1}):
        with pytest.raises(FsidError, match=r"log_every \d, validate_every \d+: 2,\d{3},000 rows"):
            replace(CONFIG, **{"steps": 2_000_000, "log_every": 5, "validate_every": 1000, **every})


def test_bad_input_is_named(data: Path, tmp_path: Path) -> None:
    with pytest.raises(FsidError, match="no training to resume"):
        train(data, tmp_path / "run", CONFIG, resume=True)
    assert not (tmp_path / "run").exists()
    with pytest.raises(FsidError, match="no-such"):
        train(tmp_path / "no-such", tmp_path / "run", CONFIG, quiet=True)
    train(data, tmp_path / "run", replace(CONFIG, steps=2), quiet=True)
    with pytest.raises(FsidError, match="another steps, seed"):
        train(data, tmp_path / "run", replace(CONFIG, seed=1), quiet=True)
    checkpoint = tmp_path / "run" / "checkpoint.safetensors"
    tensors, good = load_file(checkpoint), {"step": 1, "history": [], "validation": [], "pending": []}
    for lie in (
        {"step": "x"},
        {"step": 1.5},
        {"step": -1},
        {"step": 10**30},
        {"history": 3},
        {"history": [3]},
        {"pending": [[1, 2, 3]]},
    ):
        save_file(tensors, checkpoint, {"progress": json.dumps(good | lie)})
        with pytest.raises(FsidError, match=r"checkpoint\.safetensors: has no training progress"):
            train(data, tmp_path / "run", replace(CONFIG, steps=2), quiet=True)
    save_file(tensors, checkpoint, {"progress": "[" * 200_000})
    with pytest.raises(FsidError, match=r"checkpoint\.safetensors: has no training progress"):
        train(data, tmp_path / "run", replace(CONFIG, steps=2), quiet=True)
    checkpoint.write_bytes(b"broken")
    with pytest.raises(FsidError, match=r"checkpoint\.safetensors"):
        train(data, tmp_path / "run", replace(CONFIG, steps=2), quiet=True)
    with pytest.raises(FsidError, match="learning_rate"):
        replace(CONFIG, learning_rate=0.0)


def test_a_gpu_whose_memory_is_too_small_is_one_line(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(net: RawDenoiser, *inputs: torch.Tensor) -> torch.Tensor:
        raise torch.OutOfMemoryError("CUDA out of memory. Tried to allocate 20.00 MiB.")

    monkeypatch.setattr(RawDenoiser, "forward", full)
    with pytest.raises(FsidError, match="batch 2, patch_px 16: the GPU's memory does not hold"):
        train(data, tmp_path / "run", CONFIG, quiet=True)


def test_a_loader_process_that_is_killed_is_one_line(data: Path, tmp_path: Path) -> None:
    """As the kernel does where memory runs out."""

    def kill(done: int, steps: int) -> None:
        if done == 1:
            multiprocessing.active_children()[0].kill()

    config = replace(CONFIG, steps=10_000, loader_processes=1)
    with pytest.raises(FsidError, match=r"loader_processes: DataLoader worker \(pid.*goes on$"):
        train(data, tmp_path / "run", config, progress=kill)


def test_a_machine_without_a_compiler_is_one_line(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As containers with a GPU often are, where the network is compiled unless it is said not to be."""

    def failing(*graph: object) -> Callable[..., object]:
        raise RuntimeError("Failed to find C compiler. Please specify via CC environment variable.")

    monkeypatch.setattr(torch, "compile", partial(torch.compile, backend=failing))
    with pytest.raises(FsidError, match=r"compile: .*Failed to find C compiler.*compile=off") as caught:
        train(data, tmp_path / "run", replace(CONFIG, compile="on"), quiet=True)
    assert "\n" not in str(caught.value)


def test_a_step_follows_the_settings_of_the_optimizer() -> None:
    """Gradients of at most `clip_norm`; AdamW with the betas and the decay that were asked for."""
    config = replace(CONFIG, betas=(0.7, 0.8), weight_decay=0.03, clip_norm=1e-3)
    accelerator = Accelerator(cpu=True)
    net, optimizer = _prepare(accelerator, config, None)
    (group,) = optimizer.param_groups
    assert (group["betas"], group["weight_decay"]) == ((0.7, 0.8), 0.03)
    clean, noise = torch.full((1, 4, 16, 16), 0.3), torch.full((1, 4), 1e-3)
    noisy = clean + 0.02 * torch.randn(clean.shape, generator=torch.Generator().manual_seed(0))
    _step(accelerator, net, net, optimizer, Batch(noisy, clean, noise, noise), 1e-3, config)
    gradients = [p.grad.square().sum() for p in net.parameters() if p.grad is not None]
    assert float(sum(gradients)) ** 0.5 == pytest.approx(1e-3, rel=1e-3)


def test_the_colours_of_a_validation_photograph_are_not_drawn_from_its_noise(
    photos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn, default_rng = [], np.random.default_rng

    def recorded(seed: list[int]) -> np.random.Generator:
        drawn.append(default_rng(seed).random())
        return default_rng(seed)

    monkeypatch.setattr("fsid.denoise.validate.np.random.default_rng", recorded)
    validation([], replace(CONFIG, validation_photos=str(photos)), torch.device("cpu"))
    assert len(set(drawn)) == len(drawn) >= 4


def test_validation_takes_turns_with_the_cameras() -> None:
    config = replace(CONFIG, profiles=("pixel6", "galaxy-s22"))
    isos = np.geomspace(config.iso_min, config.iso_max, 3)
    captures = _captures([patches_of_colour(np.random.default_rng(0))] * 2, config)
    for name, numbers in (("pixel6", (0, 2, 4)), ("galaxy-s22", (1, 3, 5))):
        for number in numbers:
            k = load_profile(name).level(isos[number % 3]).k
            np.testing.assert_allclose(captures[number].k[0], k, rtol=1e-6)
