"""Panoramas of a folder for the sky; what its header shows to be something else is left out and counted.

    width = 2 height, height 16 to 16384, channels R, G, B  Radiance .hdr with rows from the top, or OpenEXR

Folders of downloads hold previews, plain renders and saved error pages; only headers are read here, because
the pixels of a large panorama take seconds. Who reads them (`fsid.render.sky`) believes nothing either.
"""

from __future__ import annotations

import os
import re
from pathlib import Path

from fsid.assets.exr import stated_size, stated_values
from fsid.assets.file_names import NOT_TEXT, PREFIX, shown
from fsid.assets.survey import Skipped, Survey, surveyed
from fsid.errors import FsidError

SKY_SUFFIXES = (".hdr", ".exr")
XYZE = b"FORMAT=32-bit_rle_xyze"
"""In the header of a Radiance picture whose numbers are CIE XYZ."""
_LEAST_HEIGHT_PX, _MOST_HEIGHT_PX = 16, 16384
_MOST_EXR_VALUES = 4 * 2 * _MOST_HEIGHT_PX**2
_HEADER_BYTES = 65536
_RADIANCE = re.compile(rb"#\?.*?\n\n-Y (\d{1,6}) \+X (\d{1,6})\n", re.DOTALL)


def sky_sources(folder: str | os.PathLike[str]) -> tuple[str, ...]:
    """Names of the usable panoramas below a folder, for `Sky.source`. See `survey_skies`."""
    return survey_skies(os.fspath(folder)).usable


def survey_skies(folder: str) -> Survey[str]:
    """Every .hdr and .exr of a folder and its subfolders; links to folders are not followed.

    usable: names for `Sky.source`, sorted. Raises FsidError where there is none.
    """
    nothing = f"{folder}: holds no panorama ({', '.join(SKY_SUFFIXES)})"
    return surveyed(("skies", folder), lambda: _survey(folder), nothing)


def _survey(folder: str) -> tuple[list[str], list[Skipped]]:
    if not Path(folder).is_dir():
        raise FsidError(f"{folder}: there is no such folder of skies")
    usable, skipped = [], []
    files = (Path(place, name) for place, _, names in os.walk(folder) for name in names)
    for path in sorted(path for path in files if path.suffix.lower() in SKY_SUFFIXES):
        reason = _flaw(path)
        if reason:
            skipped.append((shown(f"{PREFIX}{path}"), reason))
        else:
            usable.append(f"{PREFIX}{path}")
    return usable, skipped


def _flaw(path: Path) -> str:
    """Why a file is no panorama, "" where its header says that it is one."""
    if shown(str(path)) != str(path):
        return NOT_TEXT
    if not path.is_file():
        return "is missing or not a file"
    try:
        size = exr_size(path) if path.suffix.lower() == ".exr" else _radiance_size(path)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        return f"cannot be read ({error})"
    if size is None:
        return "is no Radiance or OpenEXR picture with R, G and B and rows from the top"
    return size_flaw(*size)


def size_flaw(width: int, height: int) -> str:
    """Why a picture of so many pixels is no panorama to use, "" where it is one."""
    if width != 2 * height or height < _LEAST_HEIGHT_PX:
        return f"{width} x {height} pixels are no equirectangular picture (twice as wide as high)"
    if height > _MOST_HEIGHT_PX:
        return f"{width} x {height} pixels are more than {2 * _MOST_HEIGHT_PX} x {_MOST_HEIGHT_PX}; reduce it"
    return ""


def _radiance_size(path: Path) -> tuple[int, int] | None:
    """(width, height) of a .hdr."""
    with path.open("rb") as file:
        found = _RADIANCE.match(file.read(_HEADER_BYTES))
    return (int(found[2]), int(found[1])) if found and XYZE not in found[0] else None


def exr_size(path: Path) -> tuple[int, int] | None:
    """(width, height) of the first part of a .exr, as its header states it; None where it has no R, G and B.

    ValueError where all parts and channels, which are decoded together, are more than R, G, B and A of the
    largest panorama. Raises what OpenEXR does (OSError, RuntimeError, ValueError, KeyError, TypeError) for
    what is none.
    """
    import OpenEXR  # only users of such files need it

    with OpenEXR.File(str(path), header_only=True) as file:
        header = file.header()
        if (values := stated_values(file)) > _MOST_EXR_VALUES:
            raise ValueError(f"{values:,} values in all its channels and parts; keep R, G and B alone")
        names = {channel.name for channel in header["channels"]}
        return stated_size(header) if {"R", "G", "B"} <= names else None
