"""Photographs as the source of clean images, for the real rival and for test sets."""

from __future__ import annotations

import os
import struct
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
from PIL import ExifTags, Image

from fsid.dataset.photo_values import srgb_values
from fsid.errors import FsidError
from fsid.files import check_file
from fsid.sensor import upright
from fsid.sensor.frames import RAW_SUFFIXES

SMALLEST_PX = 32
_BLACK = 0.02  # sRGB-encoded; a photograph that is darker everywhere shows nothing
PHOTO_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".webp", ".bmp")
_FORMATS = ("PNG", "JPEG", "TIFF", "WEBP", "BMP")
"""Whatever a file is called: others Pillow may hand to programs of their own, PostScript to Ghostscript."""
EXR_SUFFIX = ".exr"
"""Of renders, which some take for pictures, too."""
_OTHER_SUFFIXES = (".heic", ".heif", ".avif", ".gif", ".jxl", ".jp2", EXR_SUFFIX, *RAW_SUFFIXES)
"""Of pictures that are no photographs here."""
_SUBFILE, _SUB_PAGES = 254, 330
_REDUCED = (1, 3, 5, 7)
"""Tags of TIFF 6.0, and what the first may say."""


def find_photos(folder: str | Path) -> list[Path]:
    """The photographs directly inside `folder`, sorted by name; FsidError where there is none."""
    folder = Path(folder)
    if not folder.is_dir():
        raise FsidError(f"{folder}: is not a folder of photographs")
    photos = files_inside(folder, PHOTO_SUFFIXES)
    if not photos:
        where = instead(folder, PHOTO_SUFFIXES)
        raise FsidError(f"{folder}: holds no photograph ({', '.join(PHOTO_SUFFIXES)}){where}")
    return photos


def files_inside(folder: Path, suffixes: tuple[str, ...]) -> list[Path]:
    """The files directly inside `folder` that end so, sorted; hidden ones ("._a.jpg" of macOS) left out."""
    files = (path for path in folder.iterdir() if not path.name.startswith("."))
    return sorted(path for path in files if path.suffix.lower() in suffixes)


def unread(folder: Path, suffixes: tuple[str, ...]) -> str:
    """In words, how many pictures directly inside `folder` do not end so, and are not read; "" for none."""
    others = tuple(suffix for suffix in _OTHER_SUFFIXES if suffix not in suffixes)
    counts = Counter(path.suffix.lower() for path in files_inside(folder, others))
    if not counts:
        return ""
    formats = ", ".join(f"{count} {suffix}" for suffix, count in sorted(counts.items()))
    return f"left out are {formats}, which are not read here: save them as .png or .jpg"


def instead(folder: Path, suffixes: tuple[str, ...]) -> str:
    """What an error adds where `folder` holds no such files: where some lie, or what else is there; "" for
    neither."""
    left_out = unread(folder, suffixes)
    return _deeper(folder, suffixes) or (f"; {left_out}" if left_out else "")


def _deeper(folder: Path, suffixes: tuple[str, ...]) -> str:
    """In words, where a folder inside `folder` holds such files; "" where none does."""
    for below, subfolders, names in os.walk(folder):
        subfolders[:] = sorted(name for name in subfolders if not name.startswith("."))
        for name in sorted(names):
            if not name.startswith(".") and name.lower().endswith(suffixes):
                return f"; {os.path.join(below, name)} lies deeper, give its folder"
    return ""


def read_photo(path: str | Path) -> np.ndarray:
    """(H, W, 3) float32 sRGB-encoded 0..1, upright, cropped to even size; FsidError where unreadable.

    Colours of another space that the file states (an ICC profile, the gamma of a PNG, Adobe RGB in EXIF) are
    brought to sRGB and clipped there.
    """
    pixels = _read(path)
    height, width = (size // 2 * 2 for size in pixels.shape[:2])
    return pixels[:height, :width]


def check_photo(path: str | Path, smallest_px: int) -> None:
    """FsidError where `read_photo` has one, and for a photograph that shows nothing or is smaller.

    A JPEG takes a quarter of the time of `read_photo`, others little less.
    """
    pixels = _read(path, shrink=8, smallest_px=smallest_px)
    for colour, shows_nothing in (("black", pixels.max() < _BLACK), ("white", pixels.min() > 1 - _BLACK)):
        if shows_nothing:
            raise FsidError(f"{path}: is {colour} all over")


def thumbnail(path: str | Path, side: int) -> np.ndarray:
    """(side, side, 3) means of a photograph's parts, sRGB-encoded 0..1; FsidError as `read_photo`."""
    pixels = _read(path, shrink=8, least_px=8 * side)
    parts = [Image.fromarray(channel).resize((side, side), Image.Resampling.BOX) for channel in pixels.T]
    return np.stack([np.asarray(part) for part in parts]).T


def _read(path: str | Path, shrink: int = 1, least_px: int = 1, smallest_px: int = SMALLEST_PX) -> np.ndarray:
    """As `read_photo`; a JPEG `shrink` times smaller, or of `least_px`, which its decoder does quickly."""
    check_file(Path(path))
    try:
        with _without_warnings(), _opened(path) as image:
            _pass_thumbnails(image)
            width, height = image.size
            if min(width, height) < smallest_px:
                needed = f"at least {smallest_px}x{smallest_px} are needed"
                raise FsidError(f"{path}: is {width}x{height} pixels, {needed}")
            if shrink > 1:
                image.draft(image.mode, (max(width // shrink, least_px), max(height // shrink, least_px)))
            values = srgb_values(image, partial(_opened, path, image.tell()))
            # not Pillow's exif_transpose: it writes all of EXIF anew, and a faulty tag makes that fail
            return upright(values, image.getexif().get(ExifTags.Base.Orientation, 1))
    except Image.DecompressionBombError:
        raise FsidError(f"{path}: has more than 178 million pixels; make it smaller") from None
    except (OSError, SyntaxError, ValueError, OverflowError, struct.error) as error:
        raise FsidError(f"{path}: cannot be read as a photograph ({error})") from None


@contextmanager
def _without_warnings() -> Iterator[None]:
    """Pillow's own, of what it copes with: faulty EXIF, transparency, 108 million pixels of a phone."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module=r"PIL\.")
        yield


def _opened(path: str | Path, page: int = 0) -> Image.Image:
    image = Image.open(path, formats=_FORMATS)
    image.seek(page)
    return image


def _pass_thumbnails(image: Image.Image) -> None:
    """Go on to a TIFF's first page that is no smaller copy of another."""
    tags = getattr(image, "tag_v2", {})
    has_more = getattr(image, "is_animated", False) or _SUB_PAGES in tags
    while has_more and tags.get(_SUBFILE) in _REDUCED:
        try:
            image.seek(image.tell() + 1)
        except EOFError:
            raise ValueError("its pages are thumbnails alone; save the picture as the first page") from None
        tags = getattr(image, "tag_v2", {})
