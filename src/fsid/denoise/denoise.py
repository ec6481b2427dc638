"""Denoise a RAW of any size and any Bayer pattern, in tiles, exactly as if it were done in one piece.

    tile(image)[inside] = whole(image)[inside]        for every tile, within float rounding

Everything in NAFNet is a convolution of bounded reach except channel attention, which averages over the whole
input: tiles with averages of their own would show seams. So the averages are taken first, once, over evenly
spaced patches of training size (over the whole image where it is small), and held constant for all tiles.
That also keeps them what the network was trained on: means over a patch, not over megapixels. What is left is
a convolutional network; tiles that overlap by its receptive radius and start on multiples of its stride
repeat the untiled result.

The network knows one geometry, an RGGB tile seen from R. Other patterns are brought to it by mirroring one
row or column outwards (index -1 is index 1, which has the same colour), and the extra pixels are cut off
again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch

from fsid.denoise.model import Denoiser
from fsid.denoise.nafnet import frozen_pooling
from fsid.errors import FsidError
from fsid.sensor.mosaic import pack, site_offsets, unpack
from fsid.sensor.raw import NoiseLevel, Raw

TILE_PX = 256  # packed pixels: some 100 MB of activations for the small networks
_POOLING_PATCHES = 16
_WHOLE_UP_TO = 2  # image sides, in training patches, up to which it is pooled as a whole

Progress = Callable[[int, int], None]


def denoise_raw(
    raw: Raw,
    model: Denoiser,
    level: NoiseLevel | None = None,
    *,
    tile_px: int = TILE_PX,
    progress: Progress | None = None,
) -> Raw:
    """The clean estimate of `raw`, all metadata kept, `noise` None (what is left no longer follows the law).

    level: noise of `raw`; None takes `raw.noise`. tile_px: side of a tile in packed pixels, overlap excluded;
    memory grows with it, the result does not depend on it. progress(done, tiles) is called after each tile.
    Raises FsidError where the noise level is unknown or not physical, or the mosaic holds NaN or infinity.
    """
    level = level if level is not None else raw.noise
    _check(raw, level, tile_px)
    assert level is not None
    row, column = site_offsets(raw.cfa)[0]
    height, width = raw.mosaic.shape
    stride = model.net.net.multiple
    bottom, right = -(height + row) % (2 * stride), -(width + column) % (2 * stride)
    aligned = np.pad(raw.mosaic, ((row, bottom), (column, right)), mode="reflect")
    packed = pack(aligned.astype(np.float32, copy=False), "RGGB")
    del aligned
    clean = _denoise_packed(packed, model, level, tile_px, progress)
    mosaic = unpack(clean, "RGGB")[row : row + height, column : column + width]
    return replace(raw, mosaic=np.ascontiguousarray(mosaic), noise=None)


def _check(raw: Raw, level: NoiseLevel | None, tile_px: int) -> None:
    if level is None:
        raise FsidError(
            "the noise level of this RAW is unknown: give a profile and an ISO (--profile, --iso)"
        )
    if not np.all(np.isfinite((level.k, level.sigma2))) or min(*level.k, *level.sigma2) < 0:
        raise FsidError(f"noise level {level}: k and sigma2 must be finite and not negative")
    if not np.all(np.isfinite(raw.mosaic)):
        raise FsidError("this RAW holds NaN or infinity; read it again from its file")
    if tile_px < 1:
        raise FsidError(f"tile_px {tile_px}: must be at least 1")


@torch.no_grad()
def _denoise_packed(
    packed: np.ndarray, model: Denoiser, level: NoiseLevel, tile_px: int, progress: Progress | None
) -> np.ndarray:
    """packed (4, H, W), H and W multiples of the network's stride -> (4, H, W)."""

    def run(patch: np.ndarray) -> np.ndarray:
        k, sigma2 = (
            torch.tensor([v], dtype=torch.float32, device=model.device) for v in (level.k, level.sigma2)
        )
        return model.net(torch.from_numpy(patch)[None].to(model.device), k, sigma2)[0].cpu().numpy()

    stride, radius = model.net.net.multiple, model.net.net.receptive_radius
    tile, overlap = (-(-length // stride) * stride for length in (tile_px, radius))
    rows, columns = (_tiles(length, tile, overlap) for length in packed.shape[1:])
    out = np.empty_like(packed)
    with frozen_pooling(
        model.net, lambda: [run(patch) for patch in _pooling_patches(packed, model.card.patch_px)]
    ):
        for done, (row, column) in enumerate((r, c) for r in rows for c in columns):
            patch = run(np.ascontiguousarray(packed[:, row.seen, column.seen]))
            out[:, row.kept, column.kept] = patch[:, row.inside, column.inside]
            if progress is not None:
                progress(done + 1, len(rows) * len(columns))
    return out


@dataclass(frozen=True)
class _Span:
    """One tile along one axis: what the network sees, what is kept, and where that is in what is seen."""

    seen: slice
    kept: slice
    inside: slice


def _tiles(length: int, tile: int, overlap: int) -> list[_Span]:
    spans = []
    for start in range(0, length, tile):
        stop = min(start + tile, length)
        first, last = max(start - overlap, 0), min(stop + overlap, length)
        spans.append(_Span(slice(first, last), slice(start, stop), slice(start - first, stop - first)))
    return spans


def _pooling_patches(packed: np.ndarray, patch_px: int) -> Iterator[np.ndarray]:
    """The image itself where small, else an even grid of about `_POOLING_PATCHES` patches of it."""
    height, width = packed.shape[1:]
    if max(height, width) <= _WHOLE_UP_TO * patch_px:
        yield packed
        return
    side = _POOLING_PATCHES**0.5
    ratio = (height / width) ** 0.5
    for top in _starts(height, patch_px, max(1, round(side * ratio))):
        for left in _starts(width, patch_px, max(1, round(side / ratio))):
            yield np.ascontiguousarray(packed[:, top : top + patch_px, left : left + patch_px])


def _starts(length: int, patch_px: int, count: int) -> list[int]:
    free = max(length - patch_px, 0)
    return sorted({round(free * (i + 0.5) / count) for i in range(count)})
