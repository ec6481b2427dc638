"""A folder that is gone on with by the same command holds one experiment: its settings are in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from fsid.config import from_plain, read_yaml, save_settings, to_plain
from fsid.errors import FsidError


def claim(out: Path, config: Any, what: str) -> None:
    """Make `out` the folder of `config`, in `what`.yaml; FsidError where it holds another `what`."""
    file = out / f"{what}.yaml"
    try:
        out.mkdir(parents=True, exist_ok=True)
        if not file.exists():
            save_settings(config, file)
    except OSError as error:
        raise FsidError(f"{out}: cannot be written ({error.strerror})") from None
    there = from_plain(type(config), read_yaml(file), source=str(file))
    if there != config:
        plain, ours = to_plain(there), to_plain(config)
        keys = ", ".join(key for key in ours if plain[key] != ours[key])
        raise FsidError(f"{out}: holds another {what}; these differ: {keys}. Use another folder")
