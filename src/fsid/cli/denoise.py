"""fsid denoise: noisy RAW files in, denoised DNGs out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from rich.text import Text
from tyro.conf import Positional, arg

from fsid.cli.arguments import Ensemble, black_levels
from fsid.cli.denoise_notes import (
    note_guessed,
    note_hot_pixels,
    note_left_out,
    note_noises,
    note_other_frames,
)
from fsid.cli.iso_notes import note_extrapolation, note_files
from fsid.cli.notes import note
from fsid.cli.progress import progress_bar
from fsid.errors import FsidError
from fsid.terminal import Terminal, error_line

if TYPE_CHECKING:
    from fsid.denoise import Noise
    from fsid.sensor import Layout


def denoise(
    input: Annotated[Positional[Path], arg(metavar="INPUT")],
    output: Annotated[Positional[Path], arg(metavar="OUTPUT")],
    *,
    model: Path | None = None,
    profile: str | None = None,
    iso: float | None = None,
    strength: float = 1.0,
    ensemble: Ensemble = 1,
    mend_hot_pixels: bool = False,
    backend: Literal["torch", "onnx"] | None = None,
    cfa: str | None = None,
    black_level: str | None = None,
    white_level: int | None = None,
    width: int | None = None,
    height: int | None = None,
    skip_existing: bool = False,
    quiet: bool = False,
) -> None:
    """Denoise a Bayer RAW of any size, or a folder of them. The noise level is the file's NoiseProfile, that
    of a profile, or else estimated from the image.

    Args:
        input: DNG or any other Bayer RAW that LibRaw opens; or a bare mosaic (.npy, 16-bit .png or .tif, .raw
            or .bin of 16-bit little-endian values), given --cfa, --black-level and --white-level; or a folder
            of either (folders inside it, and files of the other kind, are left out).
        output: DNG file to write (replaced if it is there), another than the input; a folder where the input
            is one.
        model: Folder of a training (fsid train), its model.safetensors, a file of fsid export (.onnx or
            .safetensors), or the name of a shipped network; by default the shipped one.
        profile: Noise profile, a built-in name (fsid profiles) or a file; by default the file's own noise.
        iso: ISO of the profile's level; by default the file's, which the output keeps.
        strength: 0 to 1: share of the noise's amplitude to remove (1 all of it, less leaves grain). Above 1:
            take the noise for that many times as strong, which smooths more, as far as the network keeps the
            colours (at most 100).
        ensemble: Average over so many mirrored and transposed copies of the image: less error (0.1 dB with 8,
            two thirds of that with 2) for as many times the time.
        mend_hot_pixels: Make single pixels that are far brighter or darker than all around them, as of long
            exposures, of their neighbours first. Of images as sharp as their pixels it takes dots of light.
        backend: What runs the network: torch (on a GPU where there is one) or onnx (onnxruntime, on the CPU);
            by default onnx for an .onnx file, else torch.
        cfa: Colours of a bare mosaic's first 2x2 pixels, read row by row: RGGB, BGGR, GRBG or GBRG.
        black_level: Black level of a bare mosaic in DN; where they differ those of R, Gr, Gb and B, as in
            60,66,64,70.
        white_level: White level (saturation) of a bare mosaic in DN.
        width: Width of a .raw or .bin mosaic in pixels.
        height: Height of a .raw or .bin mosaic in pixels.
        skip_existing: Leave alone what an earlier, interrupted run over a folder has made.
        quiet: No progress bar, no line on the noise level; warnings are printed.
    """
    from fsid.denoise import check_options, denoise_file, denoise_folder, find_raws, load_model
    from fsid.denoise.denoise import most_noise
    from fsid.denoise.files import target_in
    from fsid.sensor import Layout

    given = Layout(None, cfa, black_levels(black_level), white_level, width, height)
    layout = given if given != Layout() else None
    sources = find_raws(input, bare=layout is not None) if input.is_dir() else None
    if skip_existing and sources is None:
        raise FsidError("--skip-existing: is for a folder of files; leave it out")
    if layout is not None:
        _check_layout(layout, sources or [input])
        note_other_frames(layout, profile)
    network = load_model(model, backend)
    check_options(profile, iso, strength, layout)
    console = Terminal(stderr=True)
    if profile is not None and iso is not None:
        note_extrapolation([profile], iso, iso)
    elif profile is not None:
        note_files(profile, sources or [input])
    if sources is not None:
        note_left_out(input, output, bare=layout is not None)
        made = [path for path in sources if target_in(output, path).is_file()] if skip_existing else []
        if made and not quiet:
            note(f"{len(made)} of {len(sources)} files are in {output} already and left alone")
        noises: dict[Path, Noise] = {}
        try:
            with progress_bar("denoising", "files", quiet=quiet) as progress:
                denoise_folder(
                    sources,
                    output,
                    network,
                    profile=profile,
                    iso=iso,
                    strength=strength,
                    ensemble=ensemble,
                    mend_hot_pixels=mend_hot_pixels,
                    layout=layout,
                    skip_existing=skip_existing,
                    progress=progress,
                    denoised=noises.__setitem__,
                    failed=lambda error: console.print(error_line(error), soft_wrap=True),
                )
        finally:  # what is to be said of those that are done does not depend on the others
            note_guessed(noises)
            note_noises(noises, most_noise(network.card))
            if mend_hot_pixels and not quiet:
                note_hot_pixels(noises)
        return
    with progress_bar("denoising", "tiles", quiet=quiet) as progress:
        noise = denoise_file(
            input,
            output,
            network,
            profile=profile,
            iso=iso,
            strength=strength,
            ensemble=ensemble,
            mend_hot_pixels=mend_hot_pixels,
            layout=layout,
            progress=progress,
        )
    if not quiet:
        k, sigma2 = (sum(values) / 4 for values in (noise.level.k, noise.level.sigma2))
        line = f"noise: {noise.source}, k = {k:.3g}, sigma2 = {sigma2:.3g}"
        console.print(Text(line), soft_wrap=True)
    note_noises({input: noise}, most_noise(network.card))
    if mend_hot_pixels and not quiet:
        note_hot_pixels({input: noise})


def _check_layout(layout: Layout, paths: Sequence[Path]) -> None:
    """FsidError where `paths` need no layout, or more of it, or where it is none."""
    from fsid.sensor.bare import BARE_SUFFIXES, HEADERLESS_SUFFIXES
    from fsid.sensor.mosaic import check_cfa
    from fsid.sensor.quantise import check_levels

    given = next(key for key, value in asdict(layout).items() if value is not None).replace("_", "-")
    for path in paths:
        kind = path.suffix.lower()
        if kind not in BARE_SUFFIXES:
            kinds = ", ".join(BARE_SUFFIXES)
            raise FsidError(f"--{given}: is for bare mosaics ({kinds}), not for {path}; leave it out")
        if kind in HEADERLESS_SUFFIXES and None in (layout.width, layout.height):
            raise FsidError(f"{path}: a headerless mosaic needs --width and --height")
    if layout.cfa is None or layout.black_level is None or layout.white_level is None:
        raise FsidError("a bare mosaic needs all three: --cfa, --black-level and --white-level")
    check_cfa(layout.cfa, "--cfa")
    for level in np.atleast_1d(layout.black_level):
        check_levels(level, layout.white_level, "--black-level and --white-level")
