"""fsid doctor: what this machine has."""

from __future__ import annotations

from rich.table import Table
from rich.text import Text

from fsid.terminal import Terminal


def doctor() -> None:
    """Print what was found (OpenGL, GPU, libraries) and render one frame; exit code 2 where that fails."""
    from fsid.evaluate.doctor import examine

    table = Table(show_header=False, box=None)
    try:
        for name, finding in examine():
            table.add_row(Text(name, style="bold"), Text(finding))
    finally:
        Terminal().print(table)
