"""What a training starts from: random weights, or those of a network that was trained before (fine-tuning).

A copy of that network is kept in the run folder, so that a run resumes, and its card says where the network
comes from, after the original has moved or changed.
"""

from __future__ import annotations

from pathlib import Path

from fsid.denoise.model import Denoiser, load_denoiser, save_model
from fsid.denoise.train_config import TrainConfig
from fsid.errors import FsidError

INITIAL_FILE = "initial.safetensors"


def has_network(run_dir: Path) -> bool:
    """Whether a run has begun in `run_dir`: a network or checkpoint of its own lies there."""
    return any(path.name != INITIAL_FILE for path in run_dir.glob("*.safetensors"))


def initial_network(run_dir: Path, config: TrainConfig, *, resume: bool) -> Denoiser | None:
    """The network that `config` starts from, or that the run in `run_dir` has started from; None: random.

    FsidError where it cannot be read, or where its size is not that of `config.network`.
    """
    if not config.initial_weights:
        return None
    copy = run_dir / INITIAL_FILE
    is_under_way = copy.is_file() and (resume or has_network(run_dir))
    initial = load_denoiser(copy if is_under_way else config.initial_weights)
    if initial.card.network != config.network:
        raise FsidError(
            f"initial_weights: {config.initial_weights} has another network than this training "
            f"({initial.card.network}, not {config.network}); give the --config that it was trained with"
        )
    return initial


def keep_initial(run_dir: Path, initial: Denoiser) -> None:
    """Write the copy, for a run that is about to start."""
    save_model(run_dir / INITIAL_FILE, initial.net.state_dict(), initial.card)


def drop_initial(run_dir: Path) -> None:
    """Remove the copy of a run that ended before it had a network."""
    for file in (run_dir / INITIAL_FILE, (run_dir / INITIAL_FILE).with_suffix(".json")):
        file.unlink(missing_ok=True)
