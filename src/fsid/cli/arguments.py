"""Arguments that several commands share, so that they read and behave alike."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

from fsid.errors import FsidError

if TYPE_CHECKING:
    from fsid.config import Override

Output = Annotated[Path, tyro.conf.arg(name="output", aliases=["-o"])]
OptionalOutput = Annotated[Path | None, tyro.conf.arg(name="output", aliases=["-o"])]
Settings = Annotated[tuple[str, ...], tyro.conf.arg(metavar="KEY=VALUE ...")]
Ensemble = Literal[1, 2, 4, 8]


def overrides(single: Iterable[str], **options: Any) -> list[Override]:
    """Settings of --set, and of the options of their name that were given, which win."""
    return [*single, *((key, value) for key, value in options.items() if value is not None)]


def black_levels(text: str | None) -> tuple[float, ...] | None:
    """--black-level: one number, or four with commas between them; FsidError for anything else."""
    if text is None:
        return None
    try:
        levels = tuple(float(number) for number in text.split(","))
    except ValueError:
        levels = ()
    if len(levels) not in (1, 4):
        raise FsidError(
            f"--black-level {text}: give one number, or those of R, Gr, Gb and B as in 60,66,64,70"
        )
    return levels
