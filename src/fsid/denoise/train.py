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

import os
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from accelerate import Accelerator
from accelerate.state import AcceleratorState, GradientState, PartialState
from rich.text import Text
from torch import Tensor

from fsid.dataset.feed import batches
from fsid.dataset.loader import Batch, PatchConfig, PatchDataset
from fsid.denoise.checkpoint import DIVERGED, load_checkpoint
from fsid.denoise.initial_weights import initial_network
from fsid.denoise.machine_limits import machine_limits
from fsid.denoise.model import MODEL_FILE, Denoiser
from fsid.denoise.progress_line import ProgressLine
from fsid.denoise.raw_denoiser import RawDenoiser
from fsid.denoise.run_folder import (
    CONFIG_FILE,
    held_out_as_begun,
    prepare_run,
    remove_parts,
    sizes_as_begun,
)
from fsid.denoise.run_output import RunOutput, card_of
from fsid.denoise.stabilise import stabilise
from fsid.denoise.train_config import TrainConfig
from fsid.denoise.validate import held_out
from fsid.errors import FsidError, check_kind
from fsid.files import check_folder, held
from fsid.terminal import Terminal

_SHARDED = {
    "DEEPSPEED": "DeepSpeed",
    "FSDP": "FSDP",
    "MEGATRON_LM": "Megatron-LM",
    "PARALLELISM_CONFIG": "ParallelismConfig",
}
"""What `accelerate launch` says to its processes, and the name of it."""


@contextmanager
def _pytorch_restored() -> Iterator[None]:
    """Put back PyTorch's threads and random numbers on the CPU, and what all Accelerators of a process share.

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


@_pytorch_restored()
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
    insist that there is one. quiet: print nothing. command: for the record of the run. progress(done, steps)
    is called in place of what is printed. Under `torchrun` or `accelerate launch` each process draws batches
    of its own and gradients are averaged. Raises FsidError for unusable data or settings, another run in
    `run_dir`, another process at work there, or a training that diverges. Afterwards PyTorch's number of
    threads, its random numbers on the CPU and an Accelerator of your own are what they were.
    """
    check_kind(config, TrainConfig, "train_config makes one of a file, a name or settings")
    data_dir, run_dir = Path(data_dir), Path(run_dir)
    config = sizes_as_begun(run_dir, config)
    if config.threads:
        torch.set_num_threads(config.threads)
    _check_accelerate()
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
    with held(run_dir, "another fsid train is at work in it") if is_main else nullcontext() as alone:
        if alone:
            remove_parts(run_dir)
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
            ProgressLine(config, state.step, accelerator.num_processes, quiet=not shown) as line,
        ):
            card = card_of(data_dir, config, patches.mosaics, initial)
            output = RunOutput(data_dir, run_dir, config, kept, accelerator, card, command, state, line)
            for batch in feed:
                rate = learning_rate(config, state.step)
                loss, psnr = _step(accelerator, forward, net, optimizer, batch, rate, config)
                state.advance(bare, config.ema_decay)
                line.update(state.step, loss, psnr)
                is_due = state.step % config.log_every == 0 or state.step == config.steps
                row = state.log(loss, psnr, rate, is_due=is_due)
                if is_main:
                    output.after_step(row, bare, optimizer)
                if progress is not None:
                    progress(state.step, config.steps)
            if is_main:
                output.finish(bare, optimizer)
    accelerator.wait_for_everyone()
    return run_dir / MODEL_FILE


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
    why = "none is held out for validation, which needs five scenes or pictures when a training begins"
    line = f"note: {data_dir}: {why}; {MODEL_FILE} is the network at the last step"
    Terminal(stderr=True).print(Text(line), soft_wrap=True)


def _check_accelerate() -> None:
    """FsidError where the configuration of accelerate would cut the network into parts."""
    for name, title in _SHARDED.items():
        if os.environ.get(f"ACCELERATE_USE_{name}", "").lower() == "true":
            raise FsidError(
                f"{title}: the configuration of accelerate asks for it, but fsid train keeps the whole "
                f"network in every process; launch with torchrun or accelerate launch --multi_gpu instead"
            )


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
