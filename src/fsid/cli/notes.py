"""One line to the user that is no error. What warns of their data is said with --quiet, too."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from rich.text import Text

from fsid.terminal import Terminal


def note(line: str) -> None:
    """Print `line` on stderr."""
    Terminal(stderr=True).print(Text(f"note: {line}"), soft_wrap=True)


def note_unread(folders: Iterable[str | Path | None], *, renders: bool = False) -> None:
    """A line for each folder that holds pictures of formats that are not read beside such that are.

    renders: .exr files are. A dataset is no such folder, whatever loose files lie in it.
    """
    from fsid.dataset.photos import PHOTO_SUFFIXES, files_inside, unread
    from fsid.dataset.pictures import PICTURE_SUFFIXES

    suffixes = PICTURE_SUFFIXES if renders else PHOTO_SUFFIXES
    for folder in (Path(folder) for folder in folders if folder):
        is_read = folder.is_dir() and not any(folder.glob("shard-*.tar")) and files_inside(folder, suffixes)
        if is_read and (left_out := unread(folder, suffixes)):
            note(f"{folder}: {left_out}")
