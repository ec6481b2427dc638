"""Tables of figures, which a narrow terminal must not cut."""

from __future__ import annotations

from rich.table import Table

from fsid.terminal import Terminal

_LEAST_COLUMNS = 80


def print_table(table: Table, *, quiet: bool = False) -> None:
    """Print a table as wide as the terminal, or as 80 columns: in narrower ones its lines go on below."""
    width = max(_LEAST_COLUMNS, Terminal().width)
    Terminal(width=width, markup=False, quiet=quiet).print(table)
