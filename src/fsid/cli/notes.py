"""One line to the user that is no error."""

from __future__ import annotations

from rich.text import Text

from fsid.terminal import Terminal


def note(line: str, *, quiet: bool = False) -> None:
    """Print `line` on stderr; quiet: do not."""
    Terminal(stderr=True, quiet=quiet).print(Text(f"note: {line}"), soft_wrap=True)
