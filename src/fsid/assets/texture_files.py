"""Texture sets on disk: which files belong together, and one bounded image of them.

    ambientCG    Bricks001_1K-JPG_Color.jpg   _NormalGL _NormalDX _Roughness _Metalness _Displacement
    Poly Haven   rock_wall_diff_1k.jpg        _nor_gl_ _nor_dx_ _rough_ _metal_ _disp_ _arm_

In both, the colour may also be called BaseColor, Base_Color or Albedo, as painting programs call it, and in
the first kind their other maps Normal_OpenGL (Normal-OGL), Normal_DirectX (Normal-DX), Metallic and Height.
Maps of data (all but the colour and the packed one) may be OpenEXR, as in the archives of Poly Haven. Images
come from the internet: a header may promise any size and data may end anywhere. What a header says is
compared with the limits before a pixel is read, and only formats with a well-tested decoder are read.
"""

from __future__ import annotations

import os
import re
import warnings
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError

from fsid.assets.exr import stated_size, stated_values

MAX_FILE_BYTES = 128 * 2**20
MAX_PIXELS = 8192 * 8192

EXR_SUFFIX = ".exr"
_SUFFIXES = r"(?P<suffix>\.(?:jpe?g|png|exr))"
_AMBIENT_CG = re.compile(
    r"(?P<set>.+?)_(?P<map>color|base_?color|albedo|normal(?:gl|_opengl|-ogl)|normal(?:dx|_directx|-dx)|roughness"
    r"|metalness|metallic|displacement|height|ambientocclusion|opacity|emission)" + _SUFFIXES,
    re.IGNORECASE,
)
_POLY_HAVEN = re.compile(
    r"(?P<set>.+?)_(?P<map>diff|diffuse|col|albedo|base_?color|nor_gl|nor_dx|rough|metal|disp|arm"
    r"|ao|spec|spec_ior|mask|opacity|translucent)(?:_0?\d)?_(?P<size>\d+k)" + _SUFFIXES,
    re.IGNORECASE,
)
_PICTURE = re.compile(r"(?P<stem>.+)\.(?:jpe?g|png|exr|tiff?|tga|webp|bmp)", re.IGNORECASE)
_NEVER_EXR = ("colour", "arm")
_ROLES = {
    **dict.fromkeys(("color", "basecolor", "base_color", "diff", "diffuse", "col", "albedo"), "colour"),
    **dict.fromkeys(("normalgl", "normal_opengl", "normal-ogl", "nor_gl"), "normal_gl"),
    **dict.fromkeys(("normaldx", "normal_directx", "normal-dx", "nor_dx"), "normal_dx"),
    **dict.fromkeys(("roughness", "rough"), "roughness"),
    **dict.fromkeys(("metalness", "metallic", "metal"), "metallic"),
    **dict.fromkeys(("displacement", "height", "disp"), "height"),
    "arm": "arm",
}
"""Of the maps that are read; the others have known names, too."""


class RefusedImageError(Exception):
    """Why an image or a set is not used: a short clause that names the file."""


@dataclass(frozen=True)
class TextureSet:
    """path: folder and common name of the files. files: role ("colour", "normal_gl", "normal_dx",
    "roughness", "metallic", "height", "arm") -> file."""

    path: Path
    files: dict[str, Path]


def sets_below(path: Path, deep: bool = True) -> list[TextureSet]:
    """The sets of a folder, and of its subfolders where `deep`, sorted; links to folders are not followed."""
    found: dict[Path, dict[str, Path]] = defaultdict(dict)
    for folder, names in _folders(path, deep):
        for name in names:
            match = _match(name)
            parts = match.groupdict() if match else {}
            role = _ROLES.get(parts["map"].lower()) if match else None
            if role:
                files = found[folder / (parts["set"] + (f"_{parts['size']}" if parts.get("size") else ""))]
                if parts["suffix"].lower() != EXR_SUFFIX or role not in _NEVER_EXR:
                    files.setdefault(role, folder / name)
    return [TextureSet(key, found[key]) for key in sorted(found)]


def strangers_below(path: Path) -> list[tuple[Path, str]]:
    """Pictures of a folder and its subfolders that are of no set, and why, sorted by folder.

    Not among them: maps by known names that FSID has no use for, and the preview of a set (Bricks001.png).
    """
    out = []
    for folder, names in _folders(path):
        sets = [match["set"] for match in map(_match, names) if match]
        previews = {*sets, *(name.rpartition("_")[0] for name in sets)}
        for name in names:
            picture = _PICTURE.fullmatch(name)
            if not picture or picture["stem"] in previews or _match(name):
                continue
            read = re.search(_SUFFIXES + "$", name, re.IGNORECASE)
            why = "is not named as ambientCG or Poly Haven do" if read else "is no JPEG, PNG or OpenEXR"
            out.append((folder / name, f"{name} {why}"))
    return out


def _folders(path: Path, deep: bool = True) -> Iterator[tuple[Path, list[str]]]:
    """Folders and the names of their files, sorted."""
    for folder, subfolders, names in os.walk(path):
        subfolders[:] = sorted(subfolders) if deep else []
        yield Path(folder), sorted(names)


def _match(name: str) -> re.Match[str] | None:
    return _POLY_HAVEN.fullmatch(name) or _AMBIENT_CG.fullmatch(name)


def set_at(path: Path) -> TextureSet:
    """The set named by `path`: its common name, else a folder that holds just one. RefusedImageError."""
    for candidate in sets_below(path.parent, deep=False) if path.parent.is_dir() else []:
        if candidate.path == path:
            return candidate
    if path.is_dir():
        found = sets_below(path)
        if len(found) != 1:
            raise RefusedImageError(f"the folder holds {len(found)} texture sets; name one")
        return found[0]
    raise RefusedImageError("no texture set (ambientCG or Poly Haven file names) has this name")


def read_bounded(path: Path) -> bytes:
    """The file's bytes. Raises RefusedImageError where it is missing, no file or too large."""
    try:
        if not path.is_file():
            raise RefusedImageError(f"{path.name} is missing or not a file")
        with path.open("rb") as file:
            data = file.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        raise RefusedImageError(f"{path.name} cannot be opened ({error.strerror})") from None
    if len(data) > MAX_FILE_BYTES:
        raise RefusedImageError(f"{path.name} is larger than {MAX_FILE_BYTES >> 20} MiB")
    return data


def decode_file(path: Path, data: bytes, size: int) -> np.ndarray:
    """(H, W, C) float32 of a file whose content is `data`; see `decode_image`, `decode_exr`."""
    return decode_exr(path) if path.suffix.lower() == EXR_SUFFIX else decode_image(data, path.name, size)


def decode_exr(path: Path) -> np.ndarray:
    """(H, W, C) float32 of R, G and B (C 3) or of the first channel but alpha (C 1), as stored: a
    displacement may be in any unit. Raises RefusedImageError that names the file.
    """
    import OpenEXR  # only users of such files need it

    try:
        with OpenEXR.File(str(path), header_only=True) as file:
            (width, height), values = stated_size(file.header()), stated_values(file)
        _check_size(path.name, width, height)
        if values > 4 * MAX_PIXELS:
            raise RefusedImageError(f"{path.name} has {values:,} values in all its channels and parts")
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = {name: channel.pixels for name, channel in file.channels().items()}
        grey = sorted(channels, key=lambda name: (name.rpartition(".")[2] == "A", name))[:1]
        names = ("R", "G", "B") if {"R", "G", "B"} <= set(channels) else grey
        pixels = np.stack([np.asarray(channels[name], np.float32) for name in names], axis=-1)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, MemoryError) as error:
        raise RefusedImageError(f"{path.name} is no readable OpenEXR picture ({error})") from None
    if pixels.shape[:2] != (height, width) or not np.isfinite(pixels).all():
        raise RefusedImageError(f"{path.name} has subsampled channels or values that are not numbers")
    return pixels


def stretched(pixels: np.ndarray) -> np.ndarray:
    """`pixels` of any unit in 0..1."""
    return (pixels - pixels.min()) / np.float32(max(float(np.ptp(pixels)), 1e-12))


def _check_size(name: str, width: int, height: int) -> None:
    if width * height > MAX_PIXELS:
        raise RefusedImageError(f"{name} has {width} x {height} pixels, more than {MAX_PIXELS >> 20} million")
    if min(width, height) < 8:
        raise RefusedImageError(f"{name} has {width} x {height} pixels, fewer than 8 x 8")


def decode_image(data: bytes, name: str, size: int) -> np.ndarray:
    """(H, W, C) float32 in 0..1 as encoded, C 1 or 3; a JPEG much larger than `size` comes reduced.

    Raises RefusedImageError that names the image.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            image = Image.open(BytesIO(data), formats=("JPEG", "PNG"))
        _check_size(name, *image.size)
        image.draft(image.mode, (2 * size, 2 * size))
        if image.mode.startswith("I"):
            return np.asarray(image, dtype=np.float32)[..., None] / np.float32(65535)
        pixels = np.asarray(image.convert("L" if image.mode in ("1", "L", "LA") else "RGB"))
    except UnidentifiedImageError:
        raise RefusedImageError(f"{name} is no readable JPEG or PNG") from None
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError, MemoryError) as error:
        raise RefusedImageError(f"{name} is no readable JPEG or PNG ({error})") from None
    return np.atleast_3d(pixels).astype(np.float32) / np.float32(255)


def resampled(image: np.ndarray, size: int) -> np.ndarray:
    """(H, W, C) to (size, size, C), periodic, anti-aliased; oblong images are repeated where that fits."""
    height, width = image.shape[:2]
    if max(width, height) % min(width, height) == 0:
        image = np.tile(image, (max(1, width // height), max(1, height // width), 1))
        height, width = image.shape[:2]
    if (height, width) == (size, size):
        return np.clip(image, 0.0, 1.0)
    pad = (min(4 * (height // size + 1), height), min(4 * (width // size + 1), width))
    box = (pad[1], pad[0], pad[1] + width, pad[0] + height)
    out = np.empty((size, size, image.shape[2]), np.float32)
    for channel in range(image.shape[2]):
        plane = np.pad(image[..., channel], ((pad[0],) * 2, (pad[1],) * 2), mode="wrap")
        small = Image.fromarray(plane).resize((size, size), Image.Resampling.BICUBIC, box=box)
        out[..., channel] = np.asarray(small)
    return np.clip(out, 0.0, 1.0)
