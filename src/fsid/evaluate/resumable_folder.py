"""The folder of a demo or an experiment, which the same command continues: it holds one, and its settings."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fsid.config import from_plain, save_settings, to_plain
from fsid.errors import FsidError
from fsid.files import held
from fsid.yaml_json import read_yaml


@contextmanager
def claimed(out: Path, config: Any, what: str) -> Iterator[None]:
    """`out` is the folder of `config`, which `what`.yaml in it holds, and this process's until the end of the
    block. what: demo or experiment.

    FsidError where it holds another `what`, or where another process is at work in it.
    """
    with held(out, f"another fsid {what} is at work in it"):
        _claim(out, config, what)
        yield


def _claim(out: Path, config: Any, what: str) -> None:
    file = out / f"{what}.yaml"
    if not file.exists():
        save_settings(config, file)
    there = from_plain(type(config), read_yaml(file), source=str(file))
    if there != config:
        plain, ours = to_plain(there), to_plain(config)
        keys = ", ".join(key for key in ours if plain[key] != ours[key])
        raise FsidError(f"{out}: holds another {what}; these differ: {keys}. Use another folder")
