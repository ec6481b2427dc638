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
    """A line for each folder that holds pictures of formats that are not read beside such that are."""
    from fsid.dataset.photos import PHOTO_SUFFIXES, files_inside, unread

    for folder in (Path(folder) for folder in folders if folder):
        if folder.is_dir() and files_inside(folder, PHOTO_SUFFIXES) and (left_out := unread(folder)):
            note(f"{folder}: {left_out}")
