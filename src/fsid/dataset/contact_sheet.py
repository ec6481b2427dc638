"""Contact sheets: many pictures side by side in one."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from fsid.dataset.config import GenerateConfig
from fsid.dataset.png import to_uint8
from fsid.dataset.sample import make_sample
from fsid.dataset.worker import rendering
from fsid.errors import FsidError, whole
from fsid.sensor import develop

GAP_PX = 4


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
