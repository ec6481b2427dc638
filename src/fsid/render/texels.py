"""Material maps -> texels of both texture arrays, kept on disk as they go to the graphics memory:

    array 0: mix, pattern, detail, roughness
    array 1: slope u, slope v (height gradient, metres per metre), spread, metallic

Normals are stored as slopes because slopes average correctly over a footprint while 8-bit heights would
give steps. `spread` is the standard deviation of the slopes within a texel, those that a mip level has
averaged away and those between texels; the shader turns it into roughness (Olano and Baker 2010, "LEAN
Mapping": lost slope variance is microfacet variance), so that glossy relief does not sparkle when a texel of
it is a pixel or less. Mip levels are averaged here in float, not by the driver: alike everywhere, and rounded
once.

A scene has a hundred materials and few of them are those of the scene before, so most layers are read from
the disk for every frame: what is kept is ready for use, and deflated only where that saves most of it,
because inflating is what reading costs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fsid.assets import MaterialMaps
from fsid.assets.bake_cache import Arrays, code_key, content_key, rounded, stored
from fsid.assets.material_registry import draw_material, material_key

Bake = Callable[[str, int, int], "Texels"]
"""(family, variant, size) -> texels."""

_WORTH = 0.25
"""Planes that deflate to less than this share are deflated. A layer of 1024 texels (level 0, mean of 37
families, before it had a spread) takes 6.7 MB without any, 2.8 with all, 4.2 with these, inflated in a sixth
of the time of all."""


@dataclass(frozen=True, eq=False)
class Texels:
    """data: (2, T, 4) uint8, both arrays with their mip levels one after the other, the largest first.

    slope_scale: of the stored slopes. shares: (3,) mean weights of the three colours, so that
    mean albedo = shares @ colours.
    """

    data: np.ndarray
    slope_scale: float
    shares: np.ndarray


def level_ranges(size: int) -> list[tuple[int, slice]]:
    """(texels per side, where in T) of all mip levels of a tile of `size` x `size` texels."""
    ranges, start = [], 0
    while size:
        ranges.append((size, slice(start, start + size * size)))
        start += size * size
        size //= 2
    return ranges


def bake_texels(family: str, variant: int, size: int, make_room: Callable[[], None] = lambda: None) -> Texels:
    """The texels of `bake_material(...)`, from the cache where they are. make_room: called before they are
    drawn, which takes up to 170 MiB for 1024 x 1024 of them. Raises FsidError."""

    def drawn() -> Arrays:
        make_room()
        return pack(texels_of(rounded(draw_material(family, variant, size))))

    name, key = material_key(family, variant, size)
    return stored(
        f"{name}-{size}-texels",
        content_key([key.encode(), code_key((__name__,)).encode()]),
        drawn,
        lambda arrays: unpack(arrays, size),
        worth=_WORTH,
    )


def pack(texels: Texels) -> Arrays:
    """One array per channel of one value where it is constant and (T,) otherwise, and the numbers."""
    planes = texels.data.transpose(0, 2, 1).reshape(8, -1)
    arrays = {str(i): p[:1] if (p == p[0]).all() else p for i, p in enumerate(planes)}
    return {**arrays, "numbers": np.array([texels.slope_scale, *texels.shares])}


def unpack(arrays: Arrays, size: int) -> Texels:
    """The inverse of `pack`. Raises ValueError or KeyError where the arrays are not those of `size`."""
    count = level_ranges(size)[-1][1].stop
    data = np.empty((2, count, 4), np.uint8)
    for i in range(8):
        plane = arrays[str(i)]
        if plane.dtype != np.uint8 or plane.shape not in ((1,), (count,)):
            raise ValueError(f"channel {i} of shape {plane.shape}")
        data[i // 4, :, i % 4] = plane
    numbers = arrays["numbers"]
    if numbers.shape != (4,) or not np.isfinite(numbers).all():
        raise ValueError(f"numbers {numbers}")
    return Texels(data, float(numbers[0]), numbers[1:])


def texels_of(maps: MaterialMaps) -> Texels:
    """All mip levels of both arrays of one material."""
    slopes = _slopes(maps)
    slope_scale = float(max(np.quantile(np.abs(slopes[:, ::2, ::2]), 0.999), 1e-4))
    slopes /= np.float32(slope_scale)
    np.clip(slopes, -1.0, 1.0, out=slopes)
    masks = np.stack([maps.mix, maps.pattern, maps.detail, maps.roughness, maps.metallic])
    inside = _within_texels(slopes)
    squares = _mean_square(slopes) + inside
    spread = np.sqrt(inside)
    ranges = level_ranges(len(maps.height))
    data = np.empty((2, ranges[-1][1].stop, 4), np.uint8)
    for size, level in ranges:
        _write_level(data[:, level].reshape(2, size, size, 4), masks, slopes, spread)
        if size > 1:
            masks, slopes, squares = _halved(masks), _halved(slopes), _halved(squares)
            spread = np.sqrt(np.maximum(squares - _mean_square(slopes), 0.0))
    return Texels(data, slope_scale, _colour_shares(maps))


def _slopes(maps: MaterialMaps) -> np.ndarray:
    """(2, s, s) central differences of the height, which repeats, in metres per metre."""
    height, size = maps.height, len(maps.height)
    slopes = np.empty((2, size, size), np.float32)
    for slope, field in ((slopes[0].T, height.T), (slopes[1], height)):
        np.subtract(field[2:], field[:-2], out=slope[1:-1])
        np.subtract(field[1], field[-1], out=slope[0])
        np.subtract(field[0], field[-2], out=slope[-1])
    slopes *= np.float32(maps.relief_m * size / (2 * maps.tile_m))
    return slopes


def _within_texels(slopes: np.ndarray) -> np.ndarray:
    """(s, s) variance within each texel of slopes (2, s, s), which repeat and are linear between texels; the
    mean of both."""
    variance = np.zeros(slopes.shape[1:], np.float32)
    for slope in slopes:
        for axis in (0, 1):
            step = np.roll(slope, -1, axis)
            step -= np.roll(slope, 1, axis)
            step *= step
            variance += step
    variance *= np.float32(1 / 96)  # half of both, half of two texels, a twelfth of the square
    return variance


def _mean_square(slopes: np.ndarray) -> np.ndarray:
    return (slopes[0] * slopes[0] + slopes[1] * slopes[1]) * np.float32(0.5)


def _write_level(
    level: np.ndarray, masks: np.ndarray, slopes: np.ndarray, spread: np.ndarray | np.float32
) -> None:
    """One mip level, (2, s, s, 4) uint8, from planes (5, s, s), (2, s, s) and (s, s)."""
    for channel, top in enumerate((255, 255, 254, 255)):
        level[0, ..., channel] = np.rint(masks[channel] * np.float32(top))
    for channel in range(2):
        level[1, ..., channel] = np.rint(slopes[channel] * np.float32(127)) + np.float32(128)
    level[1, ..., 2] = np.rint(spread * np.float32(255))
    level[1, ..., 3] = np.rint(masks[4] * np.float32(255))


def _colour_shares(maps: MaterialMaps) -> np.ndarray:
    light = 2 * maps.detail
    pattern = light * maps.pattern
    light -= pattern
    ground, pattern_share, mixed = (
        field.mean(dtype=np.float64) for field in (light, pattern, light * maps.mix)
    )
    return np.array([ground - mixed, mixed, pattern_share])


def _halved(planes: np.ndarray) -> np.ndarray:
    """2 x 2 box average of (..., s, s)."""
    rows = planes[..., ::2, :] + planes[..., 1::2, :]
    return (rows[..., ::2] + rows[..., 1::2]) * np.float32(0.25)
