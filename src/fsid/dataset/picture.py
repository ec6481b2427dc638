"""Pictures for people: PNG files and contact sheets of scenes."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from fsid.dataset.config import GenerateConfig
from fsid.dataset.sample import make_sample, to_uint8
from fsid.dataset.shards import read_member
from fsid.dataset.worker import rendering
from fsid.errors import FsidError, whole
from fsid.files import check_output, write_atomically
from fsid.sensor import develop

GAP_PX = 4


def save_png(path: str | Path, srgb: np.ndarray) -> None:
    """Write a (H, W, 3) sRGB image, 0..1 float or uint8, as PNG.

    FsidError where it cannot be written, is of another shape, or is none that `to_uint8` takes.
    """
    check_png(path)
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


def contact_sheet(
    config: GenerateConfig,
    seed: int,
    count: int,
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> np.ndarray:
    """The clean images of samples 0 .. count-1, developed, in a grid: (H, W, 3) uint8 sRGB.

    Each is made twice as wide and high and then reduced, as photographs are looked at: pixel by pixel, fine
    texture behind a mosaic is full of false colour, which looks like noise. FsidError for a count below 1,
    and as `make_sample`.
    """
    count = whole(count, "count")
    if count < 1:
        raise FsidError(f"--count {count}: at least one scene is needed")
    config = replace(config, crops=1, crop_width=0, crop_height=0, exposures=1, noise_levels=1)
    config = replace(config, width=2 * config.width, height=2 * config.height)
    tiles = []
    with rendering(config) as renderer:
        for i in range(count):
            progress(i, count)
            tiles.append(to_uint8(_half(develop(make_sample(config, seed, i, renderer).clean))))
        progress(count, count)
    return grid(tiles)


def _half(image: np.ndarray) -> np.ndarray:
    """(2h, 2w, C) to (h, w, C) by averaging."""
    return np.asarray(image.reshape(len(image) // 2, 2, -1, 2, image.shape[2]).mean((1, 3)))


def stored_preview(shard: Path, key: str) -> Image.Image:
    """The preview of a sample, RGB. FsidError where it is no PNG, whatever else Pillow might make of it."""
    name = f"{key}.rgb.png"
    try:
        return Image.open(io.BytesIO(read_member(shard, name)), formats=("PNG",)).convert("RGB")
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise FsidError(
            f"{shard}: {name}: is no readable PNG ({error}); delete it and generate again"
        ) from None


def grid(tiles: Iterable[np.ndarray]) -> np.ndarray:
    """(h, w, 3) tiles side by side, about as many columns as rows, on white, uint8; room for the largest.

    FsidError where there is none, or one that `to_uint8` does not take.
    """
    tiles = list(tiles)
    if not tiles:
        raise FsidError("a grid of pictures needs at least one")
    columns = int(np.ceil(np.sqrt(len(tiles))))
    rows = int(np.ceil(len(tiles) / columns))
    height, width = (max(tile.shape[axis] for tile in tiles) for axis in (0, 1))
    sheet = np.full(
        (rows * (height + GAP_PX) - GAP_PX, columns * (width + GAP_PX) - GAP_PX, 3), 255, np.uint8
    )
    for i, tile in enumerate(tiles):
        top, left = (i // columns) * (height + GAP_PX), (i % columns) * (width + GAP_PX)
        sheet[top : top + len(tile), left : left + tile.shape[1]] = to_uint8(tile)
    return sheet
