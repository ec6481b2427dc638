"""fsid evaluate: how good denoisers are, per light level."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from rich.table import Column, Table
from tyro.conf import Positional, UseAppendAction, arg

from fsid.cli.arguments import Ensemble, OptionalOutput
from fsid.cli.iso_notes import note_files
from fsid.cli.notes import note
from fsid.cli.progress import progress_bar
from fsid.cli.tables import print_table
from fsid.errors import FsidError
from fsid.files import check_folder


def evaluate(
    testset: Annotated[Positional[Path], arg(metavar="TESTSET")],
    *,
    model: UseAppendAction[tuple[Path, ...]] = (),
    output: OptionalOutput = None,
    ensemble: Ensemble = 1,
    quiet: bool = False,
) -> None:
    """Measure the noisy input, a classical denoiser and models: RAW PSNR, and PSNR and SSIM after develop.

    Prints one table per set. With -o, writes results.json, images.csv (every image) and report.html
    (tables, plot, before and after, error maps).

    Args:
        testset: Folder made by fsid testset.
        model: Folder of a training, a model file, or the name of a shipped network (nafnet-small); may be
            given several times. Without it only the noisy input and the classical denoiser are measured.
        output: Folder of the results.
        ensemble: Each model's results are the mean over so many mirrored and transposed copies of a capture,
            as of fsid denoise; their names in the results say so.
        quiet: No progress bar; warnings are printed.
    """
    from fsid.evaluate.models import evaluate_models, write_comparison
    from fsid.sensor import profile_names

    if ensemble > 1 and not model:
        raise FsidError(f"--ensemble {ensemble}: is for networks; name one with --model")
    if output is not None:
        check_folder(output)
    notes: list[str] = []
    with progress_bar("measuring", "captures", quiet=quiet) as progress:
        comparison = evaluate_models(testset, model, ensemble=ensemble, progress=progress, note=notes.append)
    for line in notes:
        note(line)
    made = comparison.testset
    if made.camera in profile_names():  # that of a file is not there to be asked
        note_files(made.camera, made.captures(testset))
    for name in dict.fromkeys(row.set for row in comparison.rows):
        heads = (Column(head, overflow="fold") for head in ("model", *comparison.testset.levels))
        table = Table(*heads, title=f"{name}: PSNR raw / PSNR / SSIM")
        for method in dict.fromkeys(row.model for row in comparison.rows):
            rows = [row for row in comparison.rows if (row.set, row.model) == (name, method)]
            table.add_row(method, *(f"{r.psnr_raw:.2f} / {r.psnr:.2f} / {r.ssim:.3f}" for r in rows))
        print_table(table)
    if output is not None:
        write_comparison(comparison, testset, output)
