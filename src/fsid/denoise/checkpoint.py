"""The state of a training between two steps, in one safetensors file: kill it whenever you like.

    checkpoint = {weight.*, average.*, exp_avg.*, exp_avg_sq.*} + header {step, history, validation}

One file and one rename: weights and optimizer can never be of different steps. Tensors are copied into those
of the live network and optimizer, which keeps their memory layout and so the order of every later sum.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import torch
from torch import Tensor, nn

from fsid.config import from_plain
from fsid.denoise.model import check_weights, read_tensors, write_tensors
from fsid.errors import FsidError

CHECKPOINT_FILE = "checkpoint.safetensors"
DIVERGED = "the training diverged; lower learning_rate and start again"
_MOMENTS = ("exp_avg", "exp_avg_sq")


@dataclass(eq=False)
class TrainState:
    """What changes from step to step beside weights and optimizer.

    step: steps done. average: exponential moving average of the weights. history: one row {step, loss, psnr,
    learning_rate} per `log_every` steps and one at the end, means since the row before. validation: one row
    {step, psnr_scenes, ...} per `validate_every` steps and one at the end. pending: sums for the next row.
    """

    step: int
    average: dict[str, Tensor]
    history: list[dict[str, float]] = field(default_factory=list)
    validation: list[dict[str, float]] = field(default_factory=list)
    pending: list[tuple[float, float]] = field(default_factory=list)

    @classmethod
    def start(cls, net: nn.Module) -> TrainState:
        """Before the first step."""
        return cls(0, {name: tensor.detach().clone() for name, tensor in net.state_dict().items()})

    @torch.no_grad()
    def advance(self, net: nn.Module, decay: float) -> None:
        """Count a step and move the average with min(decay, (1 + t) / (10 + t)): it forgets its start."""
        decay = min(decay, (1 + self.step) / (10 + self.step))
        weights = net.state_dict()
        torch._foreach_lerp_(list(self.average.values()), [weights[n] for n in self.average], 1 - decay)
        self.step += 1

    def log(self, loss: float, psnr: float, rate: float, *, is_due: bool) -> dict[str, float] | None:
        """Take in the figures of the step just done; the row of the history that ends here, if any."""
        self.pending.append((loss, psnr))
        if not is_due:
            return None
        losses, psnrs = zip(*self.pending, strict=True)
        mean_loss, mean_psnr = sum(losses) / len(losses), sum(psnrs) / len(psnrs)
        self.history.append({"step": self.step, "loss": mean_loss, "psnr": mean_psnr, "learning_rate": rate})
        self.pending.clear()
        return self.history[-1]


def save_checkpoint(
    run_dir: Path, state: TrainState, net: nn.Module, optimizer: torch.optim.Optimizer
) -> None:
    """Replace `run_dir`'s checkpoint atomically; FsidError where the weights have become NaN or infinite."""
    tensors = {f"weight.{name}": tensor for name, tensor in net.state_dict().items()}
    tensors |= {f"average.{name}": tensor for name, tensor in state.average.items()}
    if not all(tensor.isfinite().all() for tensor in tensors.values()):
        raise FsidError(f"the weights are not finite after step {state.step}: {DIVERGED}")
    for name, parameter in net.named_parameters():
        for moment in _MOMENTS:
            tensors[f"{moment}.{name}"] = optimizer.state[parameter][moment]
    progress = {
        "step": state.step,
        "history": state.history,
        "validation": state.validation,
        "pending": state.pending,
    }
    write_tensors(run_dir / CHECKPOINT_FILE, tensors, {"progress": json.dumps(progress)})


def load_checkpoint(run_dir: Path, net: nn.Module, optimizer: torch.optim.Optimizer) -> TrainState:
    """Put `run_dir`'s checkpoint into `net` and `optimizer`; where there is none yet, training starts."""
    path = run_dir / CHECKPOINT_FILE
    if not path.exists():
        return TrainState.start(net)
    tensors, header = read_tensors(path, "a checkpoint of `fsid train`")
    state = _progress(header, path)
    weights = _part(tensors, "weight.")
    check_weights(net, weights, path)
    net.load_state_dict(weights)
    state.average = {name: torch.empty_like(live) for name, live in net.state_dict().items()}
    _copy(_part(tensors, "average."), state.average, path)
    for name, parameter in net.named_parameters():
        moments = {moment: torch.empty_like(parameter) for moment in _MOMENTS}
        _copy({moment: tensors.get(f"{moment}.{name}", torch.empty(0)) for moment in _MOMENTS}, moments, path)
        step = torch.tensor(float(state.step), device=parameter.device)  # the fused kernel reads it there
        optimizer.state[parameter] = {"step": step, **moments}
    return state


@dataclass(frozen=True)
class _Progress:
    """What the header must hold; see `TrainState`."""

    step: int
    history: list[dict[str, float]]
    validation: list[dict[str, float]]
    pending: list[tuple[float, float]]


def _progress(header: Mapping[str, str], path: Path) -> TrainState:
    """The state in a checkpoint's header, without its average; rows are not converted: 5 stays 5, not 5.0."""
    try:
        plain = json.loads(header["progress"])
        from_plain(_Progress, dict(plain), source=str(path))
        if not 0 <= plain["step"] < 2**53:
            raise ValueError
    except (KeyError, ValueError, TypeError, RecursionError, FsidError):
        raise FsidError(f"{path}: has no training progress in its header; delete it to start again") from None
    pending = [(loss, psnr) for loss, psnr in plain["pending"]]
    return TrainState(plain["step"], {}, plain["history"], plain["validation"], pending)


def _part(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    return {name.removeprefix(prefix): tensor for name, tensor in tensors.items() if name.startswith(prefix)}


@torch.no_grad()
def _copy(stored: Mapping[str, Tensor], live: Mapping[str, Tensor], path: Path) -> None:
    for name, tensor in live.items():
        if name not in stored or stored[name].shape != tensor.shape:
            raise FsidError(
                f"{path}: {name} is missing or of another shape; delete the checkpoint to start again"
            )
        tensor.copy_(stored[name])
