"""Train a denoiser on a dataset of clean mosaics; noise is drawn afresh for every patch.

    minimise  mean (stabilise(net(noisy)) - stabilise(clean))^2            AdamW, warm-up + cosine, EMA

The error is measured in the stabilised domain, where the noise has unit variance: the loss is the share of
the noise that is left, 1 for the untrained network. So dark and bright, quiet and noisy patches count alike;
a plain mean of squares over ISO 400..8000 would hear the brightest and noisiest alone.

**Resume.** Batch `step` depends on (seed, step) and everything else that a step needs is in one checkpoint
file: weights, their moving average, both moments of AdamW, histories of loss and validation. It is replaced
atomically, so a run killed at any moment goes on from its last checkpoint, and on a CPU it ends with the same
bits as an undisturbed one.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from accelerate import Accelerator
from accelerate.state import AcceleratorState, GradientState, PartialState
from rich.text import Text
from torch import Tensor

from fsid.config import read_json, read_yaml, to_plain
from fsid.counted import counted
from fsid.dataset.config import DATASET_FILE
from fsid.dataset.feed import batches
from fsid.dataset.index import StoredMosaic, identity, index_mosaics
from fsid.dataset.loader import Batch, PatchConfig, PatchDataset
from fsid.denoise.board import Board
from fsid.denoise.checkpoint import DIVERGED, TrainState, load_checkpoint, save_checkpoint
from fsid.denoise.denoise import variance_at_grey
from fsid.denoise.initial import initial_network
from fsid.denoise.live import LiveLine
from fsid.denoise.machine_limits import machine_limits
from fsid.denoise.model import MODEL_FILE, Denoiser, ModelCard, save_model
from fsid.denoise.raw_denoiser import RawDenoiser
from fsid.denoise.run_folder import CONFIG_FILE, held_out_as_begun, prepare_run, sizes_as_begun
from fsid.denoise.sessions import Session, read_sessions
from fsid.denoise.stabilise import stabilise
from fsid.denoise.train_config import TrainConfig
from fsid.denoise.validate import held_out, validation
from fsid.errors import FsidError, check_kind
from fsid.files import check_folder, held, write_atomically
from fsid.sensor.profiles import load_bayer_profile, profiles_digest
from fsid.terminal import Terminal

HISTORY_FILE, VALIDATION_FILE = "history.json", "validation.json"
LAST_FILE = "last.safetensors"  # beside the best network, `MODEL_FILE`
SELECTED = "psnr_scenes"  # which validation chooses the best network


@contextmanager
def _all_as_it_was() -> Iterator[None]:
    """PyTorch's threads and random numbers on the CPU, and what all Accelerators of a process share.

    Inside, an Accelerator is the first of its process.
    """
    threads = torch.get_num_threads()
    shared = [state._shared_state for state in (PartialState, AcceleratorState, GradientState)]
    before = [dict(values) for values in shared]
    try:
        for values in shared:
            values.clear()
        with torch.random.fork_rng(devices=()):
            yield
    finally:
        torch.set_num_threads(threads)
        for values, old in zip(shared, before, strict=True):
            values.clear()
            values.update(old)


@_all_as_it_was()
def train(
    data_dir: str | Path,
    run_dir: str | Path,
    config: TrainConfig,
    *,
    resume: bool = False,
    quiet: bool = False,
    command: str = "",
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Train on `data_dir`'s shards; config, checkpoint, history, models go to `run_dir`. Path of the best.

    A run that is in `run_dir` already goes on from its checkpoint; it must have been started with the same
    config, but for what changes no bit (`run_folder`), and dataset, which may have grown or moved. resume:
    insist that there is one. command: for the record of the run. progress(done, steps) is called in place of
    the live line. Under `torchrun` or `accelerate launch` each process draws batches of its own and gradients
    are averaged. Raises FsidError for unusable data or settings, another run in `run_dir`, another process at
    work there, or a training that diverges. PyTorch's number of threads, its random numbers on the CPU and an
    Accelerator of your own are afterwards what they were.
    """
    check_kind(config, TrainConfig, "train_config makes one of a file, a name or settings")
    data_dir, run_dir = Path(data_dir), Path(run_dir)
    config = sizes_as_begun(run_dir, config)
    if config.threads:
        torch.set_num_threads(config.threads)
    gpu = torch.cuda.is_available()
    accelerator = Accelerator(cpu=not gpu, mixed_precision="bf16" if gpu else "no", dynamo_backend="no")
    is_main = accelerator.is_main_process
    kept = held_out(data_dir, config, held_out_as_begun(run_dir))
    scenes = {mosaic.scene for mosaic in kept}
    rank = accelerator.process_index
    patches = PatchDataset(data_dir, _patch_config(config), config.seed, rank, without=scenes)
    config = replace(config, shrink=patches.shrink)
    if resume and is_main and not (run_dir / CONFIG_FILE).is_file():
        raise FsidError(f"{run_dir}: holds no training to resume")
    if is_main:
        check_folder(run_dir)
    initial = initial_network(run_dir, config, resume=resume)
    shown = is_main and not quiet and progress is None
    if shown and config.held_out and not kept:
        _note_nothing_held_out(data_dir)
    with held(run_dir, "another fsid train is at work in it") if is_main else nullcontext():
        with accelerator.main_process_first():
            prepare_run(data_dir, run_dir, config, initial, kept)
        torch.manual_seed(config.seed)
        net, optimizer = _prepare(accelerator, config, initial)
        bare = accelerator.unwrap_model(net)
        state = load_checkpoint(run_dir, bare, optimizer)
        forward = torch.compile(net) if _compiles(config) else net
        feed = batches(patches, range(state.step, config.steps), config.loader_processes, pin=gpu)
        with (
            machine_limits(config),
            closing(feed),  # a notebook keeps the frames of an error, and with them the loader's processes
            LiveLine(config, state.step, accelerator.num_processes, quiet=not shown) as live,
        ):
            card = _card(data_dir, config, patches.mosaics, initial)
            keeper = _Keeper(data_dir, run_dir, config, kept, accelerator, card, command, state, live)
            for batch in feed:
                rate = learning_rate(config, state.step)
                loss, psnr = _step(accelerator, forward, net, optimizer, batch, rate, config)
                state.advance(bare, config.ema_decay)
                live.update(state.step, loss, psnr)
                is_due = state.step % config.log_every == 0 or state.step == config.steps
                row = state.log(loss, psnr, rate, is_due=is_due)
                if is_main:
                    keeper.after_step(row, bare, optimizer)
                if progress is not None:
                    progress(state.step, config.steps)
            if is_main:
                keeper.finish(bare, optimizer)
    accelerator.wait_for_everyone()
    return run_dir / MODEL_FILE


class _Keeper:
    """Writes what a run leaves behind: checkpoints, logs, validation, the best and the last network."""

    def __init__(
        self,
        data_dir: Path,
        run_dir: Path,
        config: TrainConfig,
        kept: Sequence[StoredMosaic],
        accelerator: Accelerator,
        card: ModelCard,
        command: str,
        state: TrainState,
        live: LiveLine,
    ) -> None:
        main = accelerator.is_main_process
        self._run_dir, self._config, self._state, self._live = run_dir, config, state, live
        self._validation = validation(kept if main else (), config, accelerator.device)
        keys = [mosaic.key for mosaic in index_mosaics(data_dir)]
        first = keys.index(kept[0].key) if kept else len(keys)
        self._held_out = {"held_out": len(kept), "held_out_from": first}
        self._card = card
        self._session = Session(
            run_dir,
            command,
            state.step,
            accelerator.num_processes,
            identity(data_dir),
            profiles_digest(config.profiles),
            [mosaic.key for mosaic in kept],
        )
        self._board = Board(run_dir, state.step, wanted=config.tensorboard and main)

    def after_step(
        self, row: dict[str, float] | None, net: torch.nn.Module, optimizer: torch.optim.Optimizer
    ) -> None:
        """What is due after the step just done; row: of the history, where one was finished."""
        config, step = self._config, self._state.step
        if row is not None:
            self._board.write(step, {f"train/{name}": row[name] for name in row if name != "step"})
        if self._validation and (step % config.validate_every == 0 or step == config.steps):
            self._validate()
        if step % config.checkpoint_every == 0:
            self._save(net, optimizer)

    def finish(self, net: torch.nn.Module, optimizer: torch.optim.Optimizer) -> None:
        """The last checkpoint and network; the best one is the last where nothing was validated."""
        self._save(net, optimizer)
        self._model(LAST_FILE)
        if not self._validation or not (self._run_dir / MODEL_FILE).is_file():
            self._model(MODEL_FILE)
        self._board.close()

    def _validate(self) -> None:
        state = self._state
        figures = self._validation.measure(state.average)
        best = max(self._comparable(), default=-np.inf)
        state.validation.append({"step": state.step, **self._held_out, **figures})
        self._board.write(state.step, {f"validation/{name}": value for name, value in figures.items()})
        if figures.get(SELECTED, np.inf) > best:
            self._session.save(state.step)
            self._model(MODEL_FILE)
        if SELECTED in figures:
            self._live.validated(figures[SELECTED])

    def _comparable(self) -> list[float]:
        """PSNR of networks before on the images held out now: older runs held out others of grown data."""
        held_out = self._held_out.items()
        rows = [row for row in self._state.validation if all(row.get(key, n) == n for key, n in held_out)]
        return [row[SELECTED] for row in rows if SELECTED in row]

    def _save(self, net: torch.nn.Module, optimizer: torch.optim.Optimizer) -> None:
        state = self._state
        self._session.save(state.step)  # first: where there is a checkpoint, it says what the run holds out
        save_checkpoint(self._run_dir, state, net, optimizer)
        for file, rows in ((HISTORY_FILE, state.history), (VALIDATION_FILE, state.validation)):
            write_atomically(self._run_dir / file, json.dumps(rows, indent=0).encode())

    def _model(self, name: str) -> None:
        state = self._state
        results = {
            "step": state.step,
            "torch": torch.__version__,
            "last": state.history[-1:],
            "validation": state.validation[-1:],
        }
        card = replace(self._card, details={**self._card.details, **results})
        sessions = {"sessions": read_sessions(self._run_dir)}
        save_model(self._run_dir / name, state.average, card, sessions)


def _card(data_dir: Path, config: TrainConfig, images: int, initial: Denoiser | None) -> ModelCard:
    """The card of the network to come, without results."""
    training = f"{counted(images, 'image')} of {data_dir.resolve().name}"
    details = {"config": to_plain(config), "data": _settings_of(data_dir)}
    cameras = [load_bayer_profile(name) for name in config.profiles]
    lowest = max(-camera.black_level / camera.span for camera in cameras)
    most_noise = max(variance_at_grey(camera.level(config.iso_max)) for camera in cameras)
    if initial is not None:
        training += f" after {initial.card.training}"
        most_noise = max(most_noise, initial.card.most_noise)
        details["initial"] = to_plain(initial.card)
    return ModelCard(config.network, config.patch_px, training, details, lowest, most_noise)


def _settings_of(data_dir: Path) -> dict[str, object]:
    """What the config.yaml of a dataset says; FsidError for what no card can say: dates, bytes, sets."""
    file = data_dir / DATASET_FILE
    plain = read_yaml(file) if file.is_file() else {}
    try:
        json.dumps(plain)
    except (TypeError, ValueError) as error:
        raise FsidError(f"{file}: holds what is neither text nor number ({error}); quote it") from None
    return plain


def load_history(run_dir: str | Path) -> tuple[list[int], list[float], list[float]]:
    """Steps, losses and PSNRs (dB) of a run's training batches: means over `log_every` steps each, the last
    over what is left.

    FsidError where the folder holds no history of a training.
    """
    path = Path(run_dir) / HISTORY_FILE
    if not path.is_file():
        raise FsidError(f"{path}: cannot be read; give the folder of a training")
    try:
        rows = read_json(path)
        return [row["step"] for row in rows], [row["loss"] for row in rows], [row["psnr"] for row in rows]
    except (FsidError, KeyError, TypeError):
        raise FsidError(
            f"{path}: is not the history of a training; resume the run to write it again"
        ) from None


def learning_rate(config: TrainConfig, step: int) -> float:
    """Linear warm-up over `warmup_steps`, then half a cosine down to `final_rate` x `learning_rate`."""
    if step < config.warmup_steps:
        return config.learning_rate * (step + 1) / config.warmup_steps
    progress = (step - config.warmup_steps) / max(1, config.steps - config.warmup_steps)
    cosine = 0.5 * (1 + np.cos(np.pi * min(progress, 1.0)))
    return float(config.learning_rate * (config.final_rate + (1 - config.final_rate) * cosine))


def noise_left(estimate: Tensor, clean: Tensor, k: Tensor, sigma2: Tensor) -> Tensor:
    """Mean squared error of (B, 4, h, w) in units of the noise variance; k, sigma2 (B, 4)."""
    k, sigma2 = k[:, :, None, None], sigma2[:, :, None, None]
    return (stabilise(estimate, k, sigma2) - stabilise(clean, k, sigma2)).square().mean()


def mean_psnr(estimate: Tensor, clean: Tensor) -> Tensor:
    """Mean over the patches of (B, 4, h, w) of their PSNR in dB, data range 1, linear RAW."""
    return -10 * torch.log10((estimate - clean).square().mean((1, 2, 3)) + 1e-12).mean()


def _note_nothing_held_out(data_dir: Path) -> None:
    why = "none is held out for validation, which takes five scenes or pictures when a training begins"
    line = f"note: {data_dir}: {why}; {MODEL_FILE} is the network at the last step"
    Terminal(stderr=True).print(Text(line), soft_wrap=True)


def _patch_config(config: TrainConfig) -> PatchConfig:
    return PatchConfig(
        size_px=config.patch_px,
        batch=config.batch,
        profiles=config.profiles,
        iso_min=config.iso_min,
        iso_max=config.iso_max,
        shrink=config.shrink,
    )


def _compiles(config: TrainConfig) -> bool:
    return config.compile == "on" or (config.compile == "auto" and torch.cuda.is_available())


def _prepare(
    accelerator: Accelerator, config: TrainConfig, initial: Denoiser | None
) -> tuple[torch.nn.Module, torch.optim.Optimizer]:
    net = RawDenoiser(config.network)
    if initial is not None:
        net.load_state_dict(initial.net.state_dict())
    optimizer = torch.optim.AdamW(
        net.parameters(),
        lr=config.learning_rate,
        betas=config.betas,
        weight_decay=config.weight_decay,
        fused=True,
    )
    return accelerator.prepare(net, optimizer)


def _step(
    accelerator: Accelerator,
    forward: Callable[..., Tensor],
    net: torch.nn.Module,
    optimizer: torch.optim.Optimizer,
    batch: Batch,
    rate: float,
    config: TrainConfig,
) -> tuple[float, float]:
    noisy, clean, k, sigma2 = batch.to(accelerator.device, non_blocking=True).tensors
    for group in optimizer.param_groups:
        group["lr"] = rate
    optimizer.zero_grad()
    estimate = forward(noisy, k, sigma2).float()
    loss = noise_left(estimate, clean, k, sigma2)
    accelerator.backward(loss)
    accelerator.clip_grad_norm_(net.parameters(), config.clip_norm)
    optimizer.step()
    value = loss.item()
    if not np.isfinite(value):
        raise FsidError(f"the loss is not finite: {DIVERGED}")
    return value, mean_psnr(estimate.detach(), clean).item()
