"""fsid inspect: texture, edge and colour statistics of a set of pictures, beside real photographs."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

from rich.table import Table
from tyro.conf import Positional, arg

from fsid.cli.notes import note_unread
from fsid.cli.progress import progress_bar
from fsid.cli.tables import print_table
from fsid.plurals import counted
from fsid.terminal import Terminal


def inspect(
    data: Annotated[Positional[Path], arg(metavar="DATA")],
    *,
    reference: Path | None = None,
    other: Path | None = None,
    out: Path | None = None,
    limit: int = 400,
    quiet: bool = False,
) -> None:
    """Measure edges, texture and colour of a dataset, and how far it lies from real photographs.

    Prints per statistic the means, the distance (mean shift between the two distributions, in standard
    deviations of the reference), and the distance relative to that between two sets of real photographs:
    at most 2 is the aim where --other names the second, better of 50 pictures or more.

    Args:
        data: Folder of a dataset (fsid generate) or of photographs.
        reference: Folder of real photographs, or a dataset, to compare with.
        other: A second real set; its distance to the reference is the yardstick. Without it that is the
            distance of the two halves of the reference, by chance alone: the more pictures, the stricter.
        out: Folder for statistics.json and statistics.png.
        limit: Largest number of pictures to measure of each set, evenly spaced.
        quiet: No progress bar; warnings are printed.
    """
    from fsid.dataset.inspect import inspect as inspect_sets
    from fsid.dataset.inspect import inspection_json
    from fsid.dataset.inspect_plot import inspection_picture
    from fsid.dataset.statistics import TITLES
    from fsid.errors import FsidError
    from fsid.files import check_folder, make_folder, write_together

    if out is not None:
        check_folder(out)
    if other is not None and reference is None:
        raise FsidError("--other needs --reference: it says how far two real sets lie apart")
    note_unread((data, reference, other))
    with progress_bar("pictures", "pictures", quiet=quiet) as progress:
        found = inspect_sets(data, reference, other, limit=limit, progress=progress)
    table = Table(title=f"{data}: {counted(found.pictures, 'picture')}")
    table.add_column("statistic")
    columns = ("mean", "reference", "distance", "relative") if reference else ("mean",)
    for column in columns:
        table.add_column(column, justify="right")
    compared = {c.name: c for c in found.comparisons}
    for name, title in TITLES.items():
        row = [title, f"{found.values[name].mean():.4g}"]
        if name in compared:
            c = compared[name]
            row += [f"{c.reference_mean:.4g}", f"{c.distance:.3f}"]
            row.append("" if math.isnan(c.yardstick) else f"{c.ratio:.1f}x")
        table.add_row(*row)
    print_table(table)
    if found.yardstick:
        Terminal(markup=False).print(f"relative: {found.yardstick}.")
    if out is not None:
        results = {
            out / "statistics.png": inspection_picture(found),
            out / "statistics.json": inspection_json(found),
        }
        make_folder(out)
        write_together(results)
