"""What a training starts from: random weights, or those of a network that was trained before (fine-tuning).

A copy of that network is kept in the run folder, so that a run resumes, and its card says where the network
comes from, after the original has moved or changed.
"""

from __future__ import annotations

from pathlib import Path

from fsid.denoise.checkpoint import CHECKPOINT_FILE
from fsid.denoise.model import Denoiser, load_denoiser, save_model
from fsid.denoise.train_config import TrainConfig
from fsid.errors import FsidError

INITIAL_FILE = "initial.safetensors"


def initial_network(run_dir: Path, config: TrainConfig) -> Denoiser | None:
    """The network that `config` starts from, or that the run in `run_dir` has started from; None: random.

    FsidError where it cannot be read, or where its size is not that of `config.network`.
    """
    if not config.initial_weights:
        return None
    copy = run_dir / INITIAL_FILE
    is_under_way = copy.is_file() and (run_dir / CHECKPOINT_FILE).is_file()
    initial = load_denoiser(copy if is_under_way else config.initial_weights)
    if initial.card.network != config.network:
        raise FsidError(
            f"initial_weights: {config.initial_weights} has another network than this training "
            f"({initial.card.network}, not {config.network}); give the --config that it was trained with"
        )
    return initial


def keep_initial(run_dir: Path, initial: Denoiser | None) -> None:
    """Write the copy for a run that is about to start, or remove that of one that failed before it did."""
    if initial is None:
        (run_dir / INITIAL_FILE).unlink(missing_ok=True)
    else:
        save_model(run_dir / INITIAL_FILE, initial.net.state_dict(), initial.card)
