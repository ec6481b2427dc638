"""One line to the user that is no error. What warns of their data is said with --quiet, too."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from rich.text import Text

from fsid.terminal import Terminal


def note(line: str) -> None:
    """Print `line` on stderr."""
    Terminal(stderr=True).print(Text(f"note: {line}"), soft_wrap=True)


def note_unread(folders: Iterable[str | Path | None]) -> None:
    """A line for each folder of photographs that holds pictures of formats that are not read."""
    from fsid.dataset.photos import unread

    for folder in folders:
        if folder and Path(folder).is_dir() and (left_out := unread(Path(folder))):
            note(f"{folder}: {left_out.removeprefix('; ')}")
