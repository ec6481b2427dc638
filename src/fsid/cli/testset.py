"""fsid testset: truths and their noisy captures, to measure denoisers on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from rich.table import Column, Table
from tyro.conf import Positional, arg

from fsid.cli.arguments import Output
from fsid.cli.iso_notes import note_files
from fsid.cli.notes import note, note_unread
from fsid.cli.progress import progress_bar
from fsid.cli.tables import print_table
from fsid.errors import FsidError

if TYPE_CHECKING:
    from fsid.evaluate.burst_truth import TruthQuality

DEFAULT_ISOS = (800, 1600, 3200, 6400)


def testset(
    source: Positional[Literal["photos", "simulate", "from-bursts"]],
    folders: Annotated[Positional[tuple[Path, ...]], arg(metavar="[FOLDER...]")] = (),
    *,
    output: Output,
    camera: str = "",
    iso: tuple[int, ...] = (),
    lux: tuple[float, ...] = (),
    frames: int | None = None,
    scenes: int | None = None,
    width: int | None = None,
    height: int | None = None,
    material: tuple[str, ...] = (),
    seed: int | None = None,
    quiet: bool = False,
) -> None:
    """Make a RAW test set: a truth per image, and noisy captures per light level.

    Args:
        source: "photos": photographs are unprocessed to RAW and given a camera's noise. "simulate": the ten
            test materials of the paper are drawn and lit. "from-bursts": truth and captures from your own
            bursts, FOLDER/<scene>/<level>/*.dng.
        folders: Folders of photographs (the name of a folder becomes the name of its set), or the one folder
            of bursts; none for "simulate".
        output: Folder of the test set.
        camera: Noise profile, a built-in name (fsid profiles) or a file (default pixel6; for from-bursts the
            noise in the files, or an estimate).
        iso: ISO of each light level (photos: 800 1600 3200 6400 where neither ISO nor lux is given).
        lux: Light levels in lux: auto-exposure of the camera (exposures up to 1/10 s) makes them ISOs
            (simulate: 0.5 1 2 5 where neither is given).
        frames: Noisy frames per image and level (simulate, from-bursts; default 1).
        scenes: Pictures per material (simulate; default 3).
        width: Width of a picture in pixels (simulate; default 1024).
        height: Height of a picture in pixels (simulate; default 768).
        material: Materials to draw (simulate; default all ten).
        seed: Seed of drawing, white balance, colour matrix and noise (photos, simulate; default 0).
        quiet: No progress bar; warnings are printed.
    """
    from fsid.evaluate import burst_testset, photo_testset, simulated_testset

    _check_folders(source, folders)
    numbers = {"frames": frames, "scenes": scenes, "width": width, "height": height, "seed": seed}
    given = {name: number for name, number in numbers.items() if number is not None}
    _check_options(source, {"iso": iso, "lux": lux, "material": material}, given)
    if source != "from-bursts":
        camera = camera or "pixel6"
    if source == "simulate":
        with progress_bar("materials", "pictures", quiet=quiet) as progress:
            made = simulated_testset(
                output,
                camera=camera,
                luxes=lux,
                isos=iso,
                materials=material,
                progress=progress,
                **given,
            )
    elif source == "from-bursts":
        lines: list[str] = []
        with progress_bar("bursts", "bursts", quiet=quiet) as progress:
            made, found = burst_testset(
                folders[0], output, camera=camera, progress=progress, note=lines.append, **given
            )
        print_table(_table(found))
        for line in lines:
            note(line)
    else:
        isos = iso if iso or lux else DEFAULT_ISOS
        with progress_bar("photographs", "photographs", quiet=quiet) as progress:
            made = photo_testset(
                folders, output, camera=camera, isos=isos, luxes=lux, progress=progress, **given
            )
        note_unread(folders)  # not before: what is wrong is one line
    if camera:
        note_files(camera, made.captures(output))


def _check_folders(source: str, folders: tuple[Path, ...]) -> None:
    if source == "simulate" and folders:
        raise FsidError(f"fsid testset simulate: takes no folder, but {folders[0]} was given")
    if source != "simulate" and not folders:
        raise FsidError(f"fsid testset {source}: name at least one folder")
    if source == "from-bursts" and len(folders) > 1:
        raise FsidError("fsid testset from-bursts: give one folder, <scene>/<level>/frames inside")


def _check_options(source: str, lists: Mapping[str, Sequence[object]], numbers: Mapping[str, int]) -> None:
    """Refuse what would do nothing: a set that looks right would lack it."""
    drawn = {"material", "scenes", "width", "height"}
    useless = {"photos": {*drawn, "frames"}, "from-bursts": {*drawn, "iso", "lux", "seed"}}.get(source, set())
    for option in (*(name for name, values in lists.items() if values), *numbers):
        if option in useless:
            raise FsidError(f"--{option}: fsid testset {source} has no use for it; leave it out")


def _table(found: Sequence[TruthQuality]) -> Table:
    """How good the truths are, a row per burst."""
    table = Table(
        Column("burst", overflow="fold"),
        "frames",
        "left out",
        "outliers",
        "flicker",
        "shift px",
        "truth PSNR dB",
    )
    for q in found:
        table.add_row(
            f"{q.image}/{q.level}",
            str(q.frames),
            str(q.left_out),
            f"{q.outliers:.3%}",
            f"{q.flicker:.2%}",
            f"{q.shift_px:.0f}",
            f"{q.psnr:.1f}",
        )
    return table
