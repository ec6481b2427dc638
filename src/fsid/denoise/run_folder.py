"""The folder of a training: whose it is, and what it was begun with."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from fsid.config import load_settings, save_settings, to_plain
from fsid.dataset.index import StoredMosaic, dataset_digest
from fsid.denoise.initial_weights import drop_initial, has_network, keep_initial
from fsid.denoise.model import Denoiser
from fsid.denoise.sessions import SESSIONS_FILE, read_sessions
from fsid.denoise.train_config import TrainConfig
from fsid.errors import FsidError
from fsid.files import make_folder
from fsid.sensor.profiles import profiles_digest
from fsid.yaml_json import read_yaml

CONFIG_FILE = "config.yaml"
_PART = re.compile(r".+\.(yaml|json|csv|png|safetensors)\.\d+\.part")
"""Names that `fsid.files.write_together` gives."""
_WITHOUT_EFFECT = {"checkpoint_every", "loader_processes", "tensorboard"}
"""Settings that change no bit of a network: a run goes on with others."""


def sizes_as_begun(run_dir: Path, config: TrainConfig) -> TrainConfig:
    """`config`, with the sizes of images that the run in `run_dir` was begun with where it names none."""
    file = run_dir / CONFIG_FILE
    if config.shrink or not (file.is_file() and has_network(run_dir)):
        return config
    return replace(config, shrink=_begun_with(file).shrink)


def held_out_as_begun(run_dir: Path) -> list[str] | None:
    """Keys of the images that the run in `run_dir` holds out since it began; None where it says none yet."""
    rows = read_sessions(run_dir) if has_network(run_dir) else []
    stated = next((row["held_out"] for row in rows if isinstance(row.get("held_out"), list)), None)
    return None if stated is None else [str(key) for key in stated]


def _begun_with(file: Path) -> TrainConfig:
    """The settings in the file of a run; before there was `shrink`, images were drawn as they are."""
    there = load_settings(TrainConfig, file)
    return there if "shrink" in read_yaml(file) else replace(there, shrink=(1,))


def remove_parts(run_dir: Path) -> None:
    """Remove what a run that was killed while it wrote has left, a checkpoint of 1.9 GB at worst."""
    for part in run_dir.glob("*.part"):
        if _PART.fullmatch(part.name):
            part.unlink(missing_ok=True)


def prepare_run(
    data_dir: Path, run_dir: Path, config: TrainConfig, initial: Denoiser | None, kept: Sequence[StoredMosaic]
) -> None:
    """Make `run_dir` the folder of a run of `config` on this data; what an earlier run left there that failed
    before its first network is replaced.

    kept: the images of the data that are held out. FsidError where a run has begun there with other settings
    or data, or where the folder holds something else.
    """
    file = run_dir / CONFIG_FILE
    there = _begun_with(file) if file.is_file() else None  # FsidError where the file is of something else
    is_begun = there is not None and has_network(run_dir)
    if there is None and (others := sorted(run_dir.glob("*.safetensors"))):
        raise FsidError(
            f"{run_dir}: holds {others[0].name} of no training that it knows; give another folder"
        )
    if any(run_dir.glob("shard-*.tar")):
        raise FsidError(f"{run_dir}: holds a dataset; give another folder for the run")
    if is_begun:
        check_same_training(run_dir, config)
        _check_same_data(data_dir, run_dir, kept)
    try:
        if not is_begun:
            make_folder(run_dir)
            drop_initial(run_dir)  # first: it may be of other settings
            (run_dir / SESSIONS_FILE).unlink(missing_ok=True)  # of which nothing is in the network to come
        if there != config:
            save_settings(config, file)
        if initial is not None and not is_begun:
            keep_initial(run_dir, initial)
    except OSError as error:
        raise FsidError(f"{run_dir}: cannot be written ({error.strerror})") from None


def check_same_training(run_dir: Path, config: TrainConfig) -> None:
    """FsidError where a training has begun in `run_dir` that has other settings or noise than `config`."""
    file = run_dir / CONFIG_FILE
    if not (file.is_file() and has_network(run_dir)):
        return
    old, new = to_plain(_begun_with(file)), to_plain(config)
    if changed := [key for key in new if new[key] != old[key] and key not in _WITHOUT_EFFECT]:
        raise FsidError(
            f"{file}: this run was started with another {', '.join(changed)}; "
            "continue it with its own settings or give another folder"
        )
    noise = profiles_digest(config.profiles)
    if any(row.get("noise", noise) != noise for row in read_sessions(run_dir)):
        raise FsidError(
            f"{run_dir}: this run was started with another noise than {', '.join(config.profiles)} says now; "
            "put the file back as it was or give another folder"
        )


def _check_same_data(data_dir: Path, run_dir: Path, kept: Sequence[StoredMosaic]) -> None:
    """FsidError where a training has begun in `run_dir` on other data than `data_dir`, or holds out more."""
    data = dataset_digest(data_dir)
    if any(row.get("data", data) != data for row in read_sessions(run_dir)):
        raise FsidError(
            f"{run_dir}: this run was started on other data than {data_dir}; "
            "continue it with its own dataset or give another folder"
        )
    if lost := sorted({*(held_out_as_begun(run_dir) or ())} - {mosaic.key for mosaic in kept}):
        raise FsidError(
            f"{data_dir}: {lost[0]} is there no more, on which the run in {run_dir} is validated; "
            "bring its shard back or give another folder"
        )
