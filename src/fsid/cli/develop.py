"""fsid develop: look at a RAW file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg


def develop(
    input: Annotated[Positional[Path], arg(metavar="INPUT")],
    output: Annotated[Positional[Path], arg(metavar="OUTPUT")],
) -> None:
    """Develop a RAW file into an upright sRGB PNG: white balance, demosaicing, colour matrix, no tone curve.

    Gain maps and BaselineExposure of a DNG are applied, lens distortion is left.

    Args:
        input: DNG or any other Bayer RAW that LibRaw opens.
        output: PNG file to write, 8 bit, sRGB.
    """
    from fsid.dataset import check_png, save_png
    from fsid.sensor import develop as develop_raw
    from fsid.sensor import read_raw, upright

    check_png(output)
    raw = read_raw(input)
    save_png(output, upright(develop_raw(raw), raw.metadata.orientation))
