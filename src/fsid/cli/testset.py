"""fsid testset: truths and their noisy captures, to measure denoisers on."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from tyro.conf import Positional

from fsid.cli.arguments import Output
from fsid.cli.progress import progress_bar

DEFAULT_ISOS = (800, 1600, 3200, 6400)


def testset(
    source: Positional[Literal["photos"]],
    folders: Positional[tuple[Path, ...]],
    *,
    output: Output,
    camera: str = "pixel6",
    iso: tuple[int, ...] = (),
    lux: tuple[float, ...] = (),
    seed: int = 0,
    quiet: bool = False,
) -> None:
    """Make a RAW test set: a truth per image, and one noisy capture per light level.

    Args:
        source: "photos": photographs are unprocessed to RAW and given a camera's noise.
        folders: Folders of photographs; the name of a folder becomes the name of its set.
        output: Folder of the test set.
        camera: Noise profile, a built-in name (fsid profiles) or a file.
        iso: ISO of each light level (800 1600 3200 6400 where neither ISO nor lux is given).
        lux: Light levels in lux: auto-exposure of the camera (exposures up to 1/10 s) makes them ISOs.
        seed: Seed of white balance, colour matrix and noise.
        quiet: No progress bar.
    """
    from fsid.errors import FsidError
    from fsid.evaluate import photo_testset

    if not folders:
        raise FsidError("fsid testset photos: name at least one folder of photographs")
    isos = iso if iso or lux else DEFAULT_ISOS
    with progress_bar("photographs", "photographs", quiet=quiet) as progress:
        photo_testset(folders, output, camera=camera, isos=isos, luxes=lux, seed=seed, progress=progress)
