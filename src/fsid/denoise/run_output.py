"""What a training leaves in its folder: checkpoints, logs, validation, the best and the last network."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from accelerate import Accelerator

from fsid.config import to_plain
from fsid.dataset.config import DATASET_FILE
from fsid.dataset.index import StoredMosaic, dataset_digest, index_mosaics
from fsid.denoise.checkpoint import TrainState, save_checkpoint
from fsid.denoise.denoise import most_noise, variance_at_grey
from fsid.denoise.model import MODEL_FILE, Denoiser, ModelCard, save_model
from fsid.denoise.progress_line import ProgressLine
from fsid.denoise.sessions import Session, read_sessions
from fsid.denoise.tensorboard_log import TensorBoardLog
from fsid.denoise.train_config import TrainConfig
from fsid.denoise.validate import validation
from fsid.errors import FsidError
from fsid.files import write_atomically
from fsid.plurals import counted
from fsid.sensor.profiles import load_bayer_profile, profiles_digest
from fsid.yaml_json import read_json, read_yaml

HISTORY_FILE, VALIDATION_FILE = "history.json", "validation.json"
LAST_FILE = "last.safetensors"  # beside the best network, `MODEL_FILE`
SELECTED = "psnr_scenes"  # which validation chooses the best network


class RunOutput:
    """Writes the files of a run while it goes on. card: of its network, without results."""

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
        line: ProgressLine,
    ) -> None:
        main = accelerator.is_main_process
        self._run_dir, self._config, self._state, self._line = run_dir, config, state, line
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
            dataset_digest(data_dir),
            profiles_digest(config.profiles),
            [mosaic.key for mosaic in kept],
        )
        self._tensorboard = TensorBoardLog(run_dir, state.step, wanted=config.tensorboard and main)

    def after_step(
        self, row: dict[str, float] | None, net: torch.nn.Module, optimizer: torch.optim.Optimizer
    ) -> None:
        """What is due after the step just done; row: of the history, where one was finished."""
        config, step = self._config, self._state.step
        if row is not None:
            self._tensorboard.write(step, {f"train/{name}": row[name] for name in row if name != "step"})
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
        self._tensorboard.close()

    def _validate(self) -> None:
        state = self._state
        figures = self._validation.measure(state.average)
        best = max(self._comparable(), default=-np.inf)
        state.validation.append({"step": state.step, **self._held_out, **figures})
        self._tensorboard.write(state.step, {f"validation/{name}": value for name, value in figures.items()})
        if figures.get(SELECTED, np.inf) > best:
            self._session.save(state.step)
            self._model(MODEL_FILE)
        if SELECTED in figures:
            self._line.validated(figures[SELECTED])

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


def card_of(data_dir: Path, config: TrainConfig, images: int, initial: Denoiser | None) -> ModelCard:
    """The card of the network to come, without results."""
    training = f"{counted(images, 'image')} of {data_dir.resolve().name}"
    details = {"config": to_plain(config), "data": _settings_of(data_dir)}
    cameras = [load_bayer_profile(name) for name in config.profiles]
    lowest = max(-camera.black_level / camera.span for camera in cameras)
    strongest = max(variance_at_grey(camera.level(config.iso_max)) for camera in cameras)
    if initial is not None:
        training += f" after {initial.card.training}"
        strongest = max(strongest, most_noise(initial.card))
        details["initial"] = to_plain(initial.card)
    return ModelCard(config.network, config.patch_px, training, details, lowest, strongest)


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
