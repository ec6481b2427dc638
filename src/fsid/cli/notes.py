"""One line to the user that is no error. What warns of their data is said with --quiet, too."""

from __future__ import annotations

from rich.text import Text

from fsid.terminal import Terminal


def note(line: str) -> None:
    """Print `line` on stderr."""
    Terminal(stderr=True).print(Text(f"note: {line}"), soft_wrap=True)
