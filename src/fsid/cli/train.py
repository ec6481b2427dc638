"""fsid train: a denoiser from shards."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from fsid.cli.arguments import Output, Settings
from fsid.cli.iso_notes import note_extrapolation
from fsid.cli.notes import note, note_unread
from fsid.errors import FsidError
from fsid.terminal import Terminal


def train(
    data: Annotated[Positional[Path], arg(metavar="DATA")],
    *,
    output: Output,
    config: Path = Path("nafnet-tiny"),
    set: Settings = (),
    resume: bool = False,
    quiet: bool = False,
) -> None:
    """Train NAFNet on the clean RAW of a dataset, with fresh noise at every draw, on a GPU or on the CPU.

    Writes the settings (config.yaml), histories of loss and validation, the network that was best on scenes
    held out of the training (model.safetensors) and the last one. Running the same command again continues
    a training that was stopped. Several GPUs: torchrun --nproc-per-node N -m fsid train ...

    Args:
        data: Folder made by fsid generate.
        output: Folder of the run.
        config: YAML file of settings, or the name of a built-in one: nafnet-tiny (CPU, minutes),
            nafnet-small (1 M parameters, phone class; CPU, an hour or two), nafnet-32, nafnet-64 (GPU), paper
            (eight GPUs).
        set: Single settings, for example --set steps=20000 batch=16 learning_rate=1e-3.
        resume: Continue the training in the folder with the settings that it has there.
        quiet: No progress line; warnings are printed.
    """
    from fsid.config import given_keys
    from fsid.dataset.card import CARD
    from fsid.dataset.config import DATASET_FILE
    from fsid.dataset.index import task_of
    from fsid.denoise import train as train_network
    from fsid.denoise import train_config
    from fsid.denoise.run_folder import CONFIG_FILE

    if resume and (config != Path("nafnet-tiny") or set):
        raise FsidError("--resume: takes the settings of the run; leave out --config and --set")
    settings = train_config(output / CONFIG_FILE if resume else config, set)
    is_main = os.environ.get("RANK", "0") == "0"
    if is_main:
        note_extrapolation(settings.profiles, settings.iso_min, settings.iso_max)
        note_unread((settings.validation_photos,))
        if not resume and "profiles" not in given_keys(set):
            _note_cameras(data, settings.profiles)
    task = task_of(data)
    if task != "denoise" and is_main:
        line = f"{data} holds pairs for {task}, but this trains a denoiser: it takes their clean images alone"
        note(f"{line} and draws noise for them")
    if is_main and (data / DATASET_FILE).exists() and not (data / CARD).exists():
        note(f"{data} has no {CARD}, which is there when all pairs are; fsid generate is not done with it")
    command = shlex.join(["fsid", *sys.argv[1:]])
    model = train_network(data, output, settings, resume=resume, quiet=quiet, command=command)
    if not quiet and is_main:
        Terminal(stderr=True).print(f"model: {model}", soft_wrap=True, markup=False)


def _note_cameras(data: Path, profiles: Sequence[str]) -> None:
    """A line where a dataset was made for other cameras than those whose noise is drawn by default."""
    from fsid.dataset.index import cameras_of
    from fsid.denoise import TrainConfig

    cameras = cameras_of(data)
    is_default = tuple(profiles) == TrainConfig().profiles
    if cameras and is_default and {*cameras} != {*profiles}:
        drawn = f"noise is drawn of {', '.join(profiles)}"
        note(f"{data} was made for {', '.join(cameras)}; {drawn}: --set profiles=[{','.join(cameras)}]")
