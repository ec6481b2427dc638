"""Train a denoiser on a dataset of clean mosaics; noise is drawn afresh for every patch.

    minimise  mean (stabilise(net(noisy)) - stabilise(clean))^2            AdamW, warm-up + cosine, EMA

The error is measured in the stabilised domain, where the noise has unit variance: the loss is the share of
the noise that is left, 1 for the untrained network. So dark and bright, quiet and noisy patches count alike;
a plain mean of squares over ISO 400..8000 would hear the brightest and noisiest alone.

**Resume.** Batch `step` depends on (seed, step) and everything else that a step needs is in one checkpoint
file: weights, their moving average, both moments of AdamW, the loss history. It is replaced atomically, so a
run killed at any moment goes on from its last checkpoint, and on a CPU it ends with the same bits as an
undisturbed one.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from accelerate import Accelerator
from torch import Tensor
from torch.utils.data import DataLoader

from fsid.config import load_settings, save_settings, to_plain
from fsid.dataset.loader import Batch, PatchConfig, PatchDataset
from fsid.denoise.checkpoint import TrainState, load_checkpoint, save_checkpoint
from fsid.denoise.live import LiveLine
from fsid.denoise.model import MODEL_FILE, ModelCard, save_model
from fsid.denoise.raw_denoiser import RawDenoiser
from fsid.denoise.stabilise import stabilise
from fsid.denoise.train_config import TrainConfig
from fsid.errors import FsidError
from fsid.files import write_atomically

CONFIG_FILE = "config.yaml"
HISTORY_FILE = "history.json"


def train(
    data_dir: Path,
    run_dir: Path,
    config: TrainConfig,
    *,
    resume: bool = False,
    quiet: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Train on `data_dir`'s shards; config, checkpoint, history, model go to `run_dir`. Path of the model.

    A run that is in `run_dir` already goes on from its checkpoint; it must have been started with the same
    config. resume: insist that there is one. progress(done, steps) is called in place of the live line.
    Raises FsidError for unusable data or settings, another run in `run_dir`, or a training that diverges.
    """
    if config.threads:
        torch.set_num_threads(config.threads)
    accelerator = Accelerator(mixed_precision="bf16" if torch.cuda.is_available() else "no")
    patches = PatchDataset(data_dir, _patch_config(config), config.seed, accelerator.process_index)
    _prepare_run(run_dir, config, resume)
    torch.manual_seed(config.seed)
    net, optimizer = _prepare(accelerator, config)
    bare = accelerator.unwrap_model(net)
    state = load_checkpoint(run_dir, bare, optimizer)
    loader = DataLoader(
        patches, batch_size=None, sampler=range(state.step, config.steps), num_workers=config.loader_processes
    )
    is_main = accelerator.is_main_process
    with LiveLine(config, state.step, quiet=quiet or progress is not None or not is_main) as live:
        for batch in loader:
            rate = learning_rate(config, state.step)
            loss, psnr = _step(accelerator, net, optimizer, batch, rate, config)
            state.advance(bare, config.ema_decay)
            state.log(loss, psnr, rate, config.log_every)
            live.update(state.step, loss, psnr)
            if progress is not None:
                progress(state.step, config.steps)
            if is_main and state.step % config.checkpoint_every == 0:
                _save(run_dir, state, bare, optimizer)
    if is_main:
        _save(run_dir, state, bare, optimizer)
        card = _card(config, state, f"{patches.mosaics} images of {data_dir.resolve().name}")
        save_model(run_dir / MODEL_FILE, state.average, card)
    return run_dir / MODEL_FILE


def load_history(run_dir: Path) -> tuple[list[int], list[float], list[float]]:
    """Steps, losses and PSNRs (dB) of a run's training batches, means over `log_every` steps each."""
    path = run_dir / HISTORY_FILE
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))
        return [row["step"] for row in rows], [row["loss"] for row in rows], [row["psnr"] for row in rows]
    except OSError as error:
        raise FsidError(f"{path}: cannot be read ({error.strerror}); give the folder of a training") from None
    except (ValueError, KeyError, TypeError):
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


def _prepare_run(run_dir: Path, config: TrainConfig, resume: bool) -> None:
    file = run_dir / CONFIG_FILE
    if file.is_file():
        old, new = (asdict(c) for c in (load_settings(TrainConfig, file), config))
        if changed := [key for key in new if new[key] != old[key]]:
            raise FsidError(
                f"{file}: this run was started with another {', '.join(changed)}; "
                "continue it with its own settings or give another folder"
            )
    elif resume:
        raise FsidError(f"{run_dir}: holds no training to resume")
    else:
        try:
            run_dir.mkdir(parents=True, exist_ok=True)
            save_settings(config, file)
        except OSError as error:
            raise FsidError(f"{run_dir}: cannot be written ({error.strerror})") from None


def _patch_config(config: TrainConfig) -> PatchConfig:
    return PatchConfig(
        size_px=config.patch_px,
        batch=config.batch,
        profiles=config.profiles,
        iso_min=config.iso_min,
        iso_max=config.iso_max,
    )


def _prepare(accelerator: Accelerator, config: TrainConfig) -> tuple[torch.nn.Module, torch.optim.Optimizer]:
    net = RawDenoiser(config.network)
    optimizer = torch.optim.AdamW(
        net.parameters(), lr=config.learning_rate, betas=config.betas, weight_decay=config.weight_decay
    )
    return accelerator.prepare(net, optimizer)


def _step(
    accelerator: Accelerator,
    net: torch.nn.Module,
    optimizer: torch.optim.Optimizer,
    batch: Batch,
    rate: float,
    config: TrainConfig,
) -> tuple[float, float]:
    noisy, clean, k, sigma2 = (
        tensor.to(accelerator.device, non_blocking=True)
        for tensor in (batch.noisy, batch.clean, batch.k, batch.sigma2)
    )
    for group in optimizer.param_groups:
        group["lr"] = rate
    optimizer.zero_grad()
    estimate = net(noisy, k, sigma2).float()
    loss = noise_left(estimate, clean, k, sigma2)
    accelerator.backward(loss)
    accelerator.clip_grad_norm_(net.parameters(), config.clip_norm)
    optimizer.step()
    value = loss.item()
    if not np.isfinite(value):
        raise FsidError("the loss is not finite: the training diverged; lower learning_rate and start again")
    return value, mean_psnr(estimate.detach(), clean).item()


def _save(run_dir: Path, state: TrainState, net: torch.nn.Module, optimizer: torch.optim.Optimizer) -> None:
    save_checkpoint(run_dir, state, net, optimizer)
    write_atomically(run_dir / HISTORY_FILE, json.dumps(state.history, indent=0).encode())


def _card(config: TrainConfig, state: TrainState, training: str) -> ModelCard:
    details = {"config": to_plain(config), "torch": torch.__version__, "last": state.history[-1:]}
    return ModelCard(config.network, config.patch_px, training, details)
