"""Denoise a RAW of any size and any Bayer pattern, in tiles, exactly as if it were done in one piece.

    tile(image)[inside] = whole(image)[inside]        for every tile, within float rounding

Everything in NAFNet is a convolution of bounded reach except channel attention, which averages over the whole
input: tiles with averages of their own would show seams. So the averages are taken first, once, over evenly
spaced patches of training size (over the whole image where it is small), and held constant for all tiles.
That also keeps them what the network was trained on: means over a patch, not over megapixels. What is left is
a convolutional network; tiles that overlap by its receptive radius and start on multiples of its stride
repeat the untiled result.

Noise that the camera cut off is drawn anew after a first pass (`clipped_noise`).

The network knows one geometry, an RGGB tile seen from R. Other patterns are brought to it by mirroring one
row or column outwards (index -1 is index 1, which has the same colour), and the extra pixels are cut off
again.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from fsid.denoise.clipped_noise import drawn_anew, highest_levels, lowest_levels
from fsid.denoise.ensemble import check_ensemble, self_ensemble
from fsid.denoise.model import ModelCard
from fsid.errors import FsidError, whole
from fsid.sensor.light import GREY
from fsid.sensor.mosaic import pack, site_offsets, unpack
from fsid.sensor.raw import NoiseLevel, Raw, check_raw, four, noise_to_remove

MAX_STRENGTH = 100.0
MAX_TOLD = 0.0036
"""Largest variance at mid-grey (that of k = 0.02) that a strength above 1 tells a network. Beyond what it was
trained on a network loses the colours; up to here the one that ships keeps them to 3 %."""
TILE_PX = 512  # packed pixels: some 500 MB of activations for the small networks
_POOLING_PATCHES = 16
_WHOLE_UP_TO = 2  # image sides, in training patches, up to which it is pooled as a whole

Progress = Callable[[int, int], None]


class Network(Protocol):
    """What runs the tiles: PyTorch (`Denoiser`, which says what each of these is) or onnxruntime
    (`OnnxDenoiser`)."""

    @property
    def card(self) -> ModelCard: ...

    @property
    def multiple(self) -> int: ...

    @property
    def receptive_radius(self) -> int: ...

    def averages(self, patch: np.ndarray, level: NoiseLevel) -> np.ndarray: ...

    def run(self, tile: np.ndarray, level: NoiseLevel, averages: np.ndarray) -> np.ndarray: ...


def denoise_raw(
    raw: Raw,
    model: Network,
    level: NoiseLevel | None = None,
    *,
    strength: float = 1.0,
    ensemble: int = 1,
    tile_px: int = TILE_PX,
    progress: Progress | None = None,
) -> Raw:
    """The clean estimate of `raw`. Its `noise` is None (what is left no longer follows the law), its metadata
    are those of `raw` and state that it is denoised. Nothing is brighter than saturation or the brightest
    pixel of `raw`, nor than where its site saturates below the white level (`highest_levels`): saturated
    light has no noise, which no training shows, and networks brighten it, each colour by its own.

    level: noise of `raw`; None takes `raw.noise`. strength: 0..1 is the share of the noise's amplitude that
    is removed, so that grain is left below 1; above 1 the noise is taken to be that many times as strong, up
    to a variance of `MAX_TOLD`, which smooths more. ensemble: 1, 2, 4 or 8 mirrored and transposed copies
    whose results are averaged, for as many times the time. tile_px: side of a tile in packed pixels, overlap
    excluded; memory grows with it, the result does not depend on it. progress(done, total) is called after
    each tile, both in tiles of the first copy.
    Raises FsidError where `raw` is no `Raw`, the noise level unknown or not physical, the strength below 0 or
    above `MAX_STRENGTH`, the ensemble another number, the mosaic holds NaN or infinity, or the network makes
    such.
    """
    check_raw(raw)
    check_network(model)
    check_ensemble(ensemble)
    stated = level = noise_to_remove(raw, level)
    check_strength(level, strength)
    if whole(tile_px, "tile_px") < 1:
        raise FsidError(f"tile_px {tile_px}: must be at least 1")
    if strength > 1:
        level = _stronger(level, strength**2)

    known = model.card.lowest
    lowest = lowest_levels(raw, known)
    first = int(any(limit is not None for limit in lowest))
    each = 0

    def denoised(mosaic: np.ndarray, cfa: str, level: NoiseLevel, copy: int) -> np.ndarray:
        def told(done: int, tiles: int) -> None:
            nonlocal each
            each = each or tiles
            if progress is not None:  # a mirrored copy may have other tiles, being of another pattern
                progress((first + copy) * each + done * each // tiles, (first + ensemble) * each)

        return _denoise_mosaic(mosaic, cfa, model, level, tile_px, told)

    mosaic = raw.mosaic
    if first:
        mosaic = drawn_anew(raw, denoised(mosaic, raw.cfa, level, -1), stated, lowest, known)
    mosaic = self_ensemble(mosaic, raw.cfa, level, ensemble, denoised)
    for (r, c), limit in zip(site_offsets(raw.cfa), highest_levels(raw), strict=True):
        np.minimum(mosaic[r::2, c::2], limit, out=mosaic[r::2, c::2])
    if strength < 1:
        mosaic *= np.float32(strength)
        mosaic += np.float32(1 - strength) * raw.mosaic
    return replace(raw, mosaic=mosaic, noise=None, metadata=raw.metadata.with_noise_removed(min(strength, 1)))


def most_noise(card: ModelCard) -> float:
    """Variance at mid-grey up to which a network knows noise; `MAX_TOLD` where its card does not say."""
    return card.most_noise or MAX_TOLD


def variance_at_grey(level: NoiseLevel) -> float:
    """Of the site that has most."""
    return max(GREY * k + sigma2 for k, sigma2 in zip(level.k, level.sigma2, strict=True))


def _stronger(level: NoiseLevel, times: float) -> NoiseLevel:
    """Of so many times the variance, or as many as `MAX_TOLD` allows."""
    times = min(times, max(MAX_TOLD / max(variance_at_grey(level), 1e-12), 1.0))
    return NoiseLevel(four(times * value for value in level.k), four(times * value for value in level.sigma2))


def check_network(model: object) -> None:
    """FsidError for the name of a network, or a function."""
    if not hasattr(model, "averages"):
        raise FsidError(f"model: a {type(model).__name__} is no network: give what load_model returns")


def check_strength(level: NoiseLevel | None, strength: float) -> None:
    """FsidError where a noise level that is known is not physical, or the strength is none."""
    if level is not None:
        level.check()
    if not 0 <= strength <= MAX_STRENGTH:
        raise FsidError(
            f"strength {strength}: must be 0 (nothing is removed) to {MAX_STRENGTH:g}; 1 removes the noise"
        )


def _denoise_mosaic(
    mosaic: np.ndarray, cfa: str, model: Network, level: NoiseLevel, tile_px: int, progress: Progress
) -> np.ndarray:
    """mosaic (H, W) of any pattern, H and W even -> (H, W)."""
    row, column = site_offsets(cfa)[0]
    height, width = mosaic.shape
    stride = model.multiple
    bottom, right = -(height + row) % (2 * stride), -(width + column) % (2 * stride)
    aligned = np.pad(mosaic, ((row, bottom), (column, right)), mode="reflect")
    packed = pack(aligned.astype(np.float32, copy=False), "RGGB")
    del aligned
    clean = _denoise_packed(packed, model, level, tile_px, progress)
    del packed
    return np.ascontiguousarray(unpack(clean, "RGGB")[row : row + height, column : column + width])


def _denoise_packed(
    packed: np.ndarray, model: Network, level: NoiseLevel, tile_px: int, progress: Progress
) -> np.ndarray:
    """packed (4, H, W), H and W multiples of the network's stride -> (4, H, W)."""
    stride, radius = model.multiple, model.receptive_radius
    tile, overlap = (-(-length // stride) * stride for length in (tile_px, radius))
    rows, columns = (_tiles(length, tile, overlap) for length in packed.shape[1:])
    out = np.empty_like(packed)
    patches = _pooling_patches(packed, model.card.patch_px)
    averages = np.mean([model.averages(patch, level) for patch in patches], axis=0)
    for done, (row, column) in enumerate((r, c) for r in rows for c in columns):
        clean = model.run(np.ascontiguousarray(packed[:, row.seen, column.seen]), level, averages)
        if not np.all(np.isfinite(clean)):
            raise FsidError("the network makes NaN or infinity of this image: its weights are broken")
        out[:, row.kept, column.kept] = clean[:, row.inside, column.inside]
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
