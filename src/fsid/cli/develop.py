"""fsid develop: look at a RAW file."""

from __future__ import annotations

from pathlib import Path

from tyro.conf import Positional


def develop(input: Positional[Path], output: Positional[Path]) -> None:
    """Develop a RAW file into an sRGB PNG: white balance, demosaic (Malvar et al. 2004), colour matrix.

    Args:
        input: DNG or any other Bayer RAW that LibRaw opens.
        output: PNG file to write, 8 bit, sRGB.
    """
    from fsid.dataset import check_png, save_png
    from fsid.sensor import develop as develop_raw
    from fsid.sensor import read_raw

    check_png(output)
    save_png(output, develop_raw(read_raw(input)))
