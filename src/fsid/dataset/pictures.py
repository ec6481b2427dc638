"""Pictures as the source of clean images instead of scenes: photographs, or linear renders of any engine.

A photograph is unprocessed (Brooks et al. 2019). An OpenEXR file holds light, linear and unbounded, and goes
the way of a rendered frame: exposed, seen by the camera, and no curve is inverted.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from fsid.assets.exr import stated_size, stated_values
from fsid.dataset.photos import (
    EXR_SUFFIX,
    PHOTO_SUFFIXES,
    SMALLEST_PX,
    check_photo,
    files_inside,
    instead,
    read_photo,
)
from fsid.errors import FsidError, refuse_any
from fsid.files import check_file
from fsid.plurals import counted

PICTURE_SUFFIXES = (*PHOTO_SUFFIXES, EXR_SUFFIX)
_SRGB_CHROMATICITIES = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
_MOST_PX = 2**27
"""Of a render; about as many as Pillow takes of a photograph."""
_MOST_VALUES = 4 * _MOST_PX
"""Of all layers, which are decoded together: 2 GiB."""
_BEAUTY = "Combined"
"""Blender's name of the layer that holds all light."""


@dataclass(frozen=True, eq=False)
class Picture:
    """pixels: (H, W, 3) float32, H and W even; linear light where `is_linear`, else sRGB-encoded 0..1."""

    path: Path
    pixels: np.ndarray
    is_linear: bool


def find_pictures(folder: str | Path) -> list[Path]:
    """The photographs and .exr files directly inside `folder`, by name; FsidError where there is none."""
    folder = Path(folder)
    if not folder.is_dir():
        raise FsidError(f"{folder}: is not a folder of photographs or .exr renders")
    pictures = files_inside(folder, PICTURE_SUFFIXES)
    if not pictures:
        where = instead(folder, PICTURE_SUFFIXES)
        raise FsidError(f"{folder}: holds no picture ({', '.join(PICTURE_SUFFIXES)}){where}")
    return pictures


def is_render(path: Path) -> bool:
    """Whether a picture is an .exr render, which holds linear light, and no photograph."""
    return path.suffix.lower() == EXR_SUFFIX


def pictures_digest(pictures: Sequence[Path]) -> str:
    """16 hexadecimal digits that tell pictures from others: of their names and sizes in bytes, in order."""
    facts = (b"%s\0%d\0" % (os.fsencode(p.name), p.stat().st_size if p.exists() else -1) for p in pictures)
    return hashlib.sha256(b"".join(facts)).hexdigest()[:16]


def check_pictures(
    pictures: Sequence[Path], threads: int, progress: Callable[[int, int], None] = lambda done, total: None
) -> None:
    """FsidError that names those of `pictures` that have faults."""
    refuse_any(picture_faults(pictures, threads, progress), counted(len(pictures), "picture"))


def picture_faults(
    pictures: Sequence[Path],
    threads: int,
    progress: Callable[[int, int], None],
    smallest_px: int = SMALLEST_PX,
) -> list[str]:
    """Decode every picture once; a line for each that `read_picture` refuses, or that shows nothing.

    smallest_px: how many pixels a side each must have.
    For 1,000 photographs of 12 megapixels one core takes 16 to 40 s if they are JPEG, 4 to 5 min if PNG
    (from single files, on an idle and on a busy machine).
    """
    faults = []
    with ThreadPoolExecutor(threads) as pool:
        for done, fault in enumerate(pool.map(partial(_fault, smallest_px=smallest_px), pictures), 1):
            faults += [fault] if fault else []
            progress(done, len(pictures))
    return faults


def _fault(path: Path, smallest_px: int) -> str:
    """What is wrong with a picture, "" for nothing."""
    try:
        if not is_render(path):
            check_photo(path, smallest_px)
        elif not read_exr(path, smallest_px).any():
            return f"{path}: is black all over"
    except FsidError as error:
        return str(error)
    return ""


def read_picture(path: Path) -> Picture:
    """A photograph or a render, upright, cropped to even size; FsidError where it is unreadable."""
    if is_render(path):
        return Picture(path, read_exr(path), is_linear=True)
    return Picture(path, read_photo(path), is_linear=False)


def read_exr(path: Path, smallest_px: int = SMALLEST_PX) -> np.ndarray:
    """(H, W, 3) float32 linear sRGB light >= 0, even size, of the channels R, G, B (or Y).

    Of several layers: the one without a name, else Blender's `Combined`, else the only one with colours.
    Negative values, which renderers' filters leave, become 0. FsidError: unreadable, too large, no such
    channels, other primaries than those of sRGB, NaN or infinity.
    """
    import OpenEXR

    check_file(path)
    try:
        with OpenEXR.File(str(path), header_only=True) as file:  # before anything is decoded
            sizes, values = [stated_size(part.header) for part in file.parts], stated_values(file)
        for width, height in sizes:
            if width * height > _MOST_PX:
                raise FsidError(f"{path}: is {width}x{height} pixels, more than {_MOST_PX >> 20} million")
        if values > _MOST_VALUES:
            raise FsidError(
                f"{path}: has {values:,} values in all its layers; write the one of the light alone"
            )
        with OpenEXR.File(str(path), separate_channels=True) as file:
            parts = [{name: c.pixels for name, c in part.channels.items()} for part in file.parts]
            chromaticities = file.header().get("chromaticities", _SRGB_CHROMATICITIES)
    except (RuntimeError, ValueError, OSError, KeyError):
        raise FsidError(f"{path}: cannot be read as OpenEXR, it is truncated or something else") from None
    colours = _light_of(path, parts)
    if not np.allclose(chromaticities, _SRGB_CHROMATICITIES, atol=2e-3):
        raise FsidError(f"{path}: its primaries are not those of sRGB (Rec. 709); convert it to linear sRGB")
    if len({colour.shape for colour in colours}) > 1:
        raise FsidError(f"{path}: its channels differ in size (subsampled chroma); write plain R, G, B")
    pixels = np.stack(colours, axis=-1).astype(np.float32)
    height, width = (size // 2 * 2 for size in pixels.shape[:2])
    if min(height, width) < smallest_px:
        needed = f"at least {smallest_px}x{smallest_px} are needed"
        raise FsidError(f"{path}: is {pixels.shape[1]}x{pixels.shape[0]} pixels, {needed}")
    if not np.isfinite(pixels).all():
        raise FsidError(f"{path}: holds NaN or infinite values; render it again")
    return pixels[:height, :width].clip(min=0)


def _light_of(path: Path, parts: list[dict[str, np.ndarray]]) -> list[np.ndarray]:
    """Red, green and blue of the layer that holds the light; three times the same where it is grey."""
    layers: dict[str, list[np.ndarray]] = {}
    for channels in parts:
        for name in channels:
            layer, _, last = name.rpartition(".")
            prefix = name[: -len(last)]
            is_grey = last == "Y" and not {prefix + "X", prefix + "RY"} & channels.keys()  # vector, chroma
            names = [name] * 3 if is_grey else [prefix + colour for colour in "RGB"]
            if (last == "R" or is_grey) and all(n in channels for n in names):
                layers.setdefault(layer, [channels[n] for n in names])
    beauty = [layer for layer in layers if layer.rpartition(".")[2] == _BEAUTY]
    for layer in ("", *beauty, *(layers if len(layers) == 1 else ())):
        if layer in layers:
            return layers[layer]
    if layers:
        raise FsidError(f"{path}: has the layers {', '.join(sorted(layers))}; write one of them alone")
    found = sorted(name for channels in parts for name in channels)
    raise FsidError(f"{path}: has the channels {', '.join(found)}; R, G and B (or Y) are needed")
