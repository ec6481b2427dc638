"""Pictures as 8-bit sRGB, and as PNG files: written for people, and read back from shards."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from PIL import Image

from fsid.dataset.shards import read_member
from fsid.errors import FsidError
from fsid.files import check_output, write_atomically
from fsid.sensor.arrays import check_array


def to_uint8(srgb: np.ndarray) -> np.ndarray:
    """(..., 3) sRGB-encoded 0..1 as 8-bit values, what is beyond clipped; 8-bit ones as they are.

    FsidError for other integers, whose range nothing tells, and for NaN.
    """
    check_array(srgb, "a picture")
    if srgb.dtype == np.uint8:
        return srgb
    if srgb.dtype.kind != "f":
        raise FsidError(f"a picture of {srgb.dtype} values: give sRGB values in 0..1, or 8-bit ones (uint8)")
    if np.isnan(np.min(srgb, initial=0)):
        raise FsidError("a picture holds NaN; give sRGB values in 0..1")
    levels = np.clip(srgb, 0.0, 1.0)
    levels *= 255.0
    return np.round(levels, out=levels).astype(np.uint8)


def save_png(path: str | Path, srgb: np.ndarray) -> None:
    """Write a (H, W, 3) sRGB image, 0..1 float or uint8, as PNG.

    FsidError where it cannot be written, is of another shape, or is none that `to_uint8` takes.
    """
    check_png(path)
    check_array(srgb, "a picture")
    if srgb.ndim != 3 or srgb.shape[2] != 3 or not srgb.size:
        raise FsidError(f"{path}: a picture must have shape (height, width, 3); got {srgb.shape}")
    buffer = io.BytesIO()
    Image.fromarray(to_uint8(srgb)).save(buffer, "PNG")
    write_atomically(Path(path), buffer.getvalue())


def check_png(path: str | Path) -> None:
    """FsidError unless `path` names a PNG file that can be written."""
    path = Path(path)
    if path.suffix.lower() != ".png":
        raise FsidError(f"{path}: pictures are written as .png")
    check_output(path)


def stored_preview(shard: Path, key: str) -> Image.Image:
    """The preview of a sample, RGB. FsidError where it is no PNG, whatever else Pillow might make of it."""
    name = f"{key}.rgb.png"
    try:
        return Image.open(io.BytesIO(read_member(shard, name)), formats=("PNG",)).convert("RGB")
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise FsidError(
            f"{shard}: {name}: is no readable PNG ({error}); delete it and generate again"
        ) from None
