"""fsid denoise: a noisy RAW file in, a denoised DNG out."""

from __future__ import annotations

from pathlib import Path

from tyro.conf import Positional

from fsid.cli.progress import progress_bar
from fsid.errors import FsidError


def denoise(
    input: Positional[Path],
    output: Positional[Path],
    *,
    model: Path,
    profile: str | None = None,
    iso: float | None = None,
    cfa: str | None = None,
    black_level: int | None = None,
    white_level: int | None = None,
    width: int | None = None,
    height: int | None = None,
    quiet: bool = False,
) -> None:
    """Denoise a Bayer RAW of any size, in tiles. The noise level is the file's NoiseProfile or a profile's.

    Args:
        input: DNG or any other Bayer RAW that LibRaw opens; or a bare mosaic (.npy, 16-bit .png or .tif,
            .raw or .bin of 16-bit little-endian values), given --cfa, --black-level and --white-level.
        output: DNG file to write.
        model: Folder of a training (fsid train), or its model.safetensors.
        profile: Noise profile, a built-in name (fsid profiles) or a file; by default the file's own.
        iso: ISO of the profile's level; by default the file's.
        cfa: Colours of a bare mosaic's first 2x2 pixels, read row by row: RGGB, BGGR, GRBG or GBRG.
        black_level: Black level of a bare mosaic in DN.
        white_level: White level (saturation) of a bare mosaic in DN.
        width: Width of a .raw or .bin mosaic in pixels.
        height: Height of a .raw or .bin mosaic in pixels.
        quiet: No progress bar.
    """
    from fsid.denoise import MosaicLayout, denoise_file, load_model

    layout = None
    if cfa is not None or black_level is not None or white_level is not None:
        if cfa is None or black_level is None or white_level is None:
            raise FsidError("a bare mosaic needs all three: --cfa, --black-level and --white-level")
        layout = MosaicLayout(cfa, black_level, white_level, width, height)
    with progress_bar("denoising", "tiles", quiet=quiet) as progress:
        denoise_file(
            input, output, load_model(model), profile=profile, iso=iso, layout=layout, progress=progress
        )
