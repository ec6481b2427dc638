"""Material maps -> texture layers, resident within a memory budget, the least recently used leave first.

    array 0: mix, pattern, detail, roughness
    array 1: slope u, slope v (height gradient, metres per metre), spread, metallic

Normals are stored as slopes because slopes average correctly over a footprint while 8-bit heights would
give steps. `spread` is the standard deviation of the slopes that a mip level has averaged away; the shader
turns it into roughness (Olano and Baker 2010, "LEAN Mapping": lost slope variance is microfacet variance),
so that glossy relief does not sparkle when it is small in the image. Mip levels are averaged here in
float, not by the driver: alike everywhere, and rounded once.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass

import moderngl
import numpy as np

from fsid.assets import MaterialMaps
from fsid.render.programs import load_compute

Bake = Callable[[str, int, int], MaterialMaps]
"""(family, variant, size) -> maps."""

BUDGET_BYTES = 640 * 2**20
"""Texture memory: 60 layers of 1024 texels, four times as many of 512; a scene that needs more gets more."""

_RGBA8 = 0x8058
_STEP_LAYERS = 16


@dataclass(frozen=True)
class Layer:
    """index: in the texture arrays. slope_scale: of the stored slopes. shares: (3,) mean weights of the
    three colours, so that mean albedo = shares @ colours."""

    index: int
    slope_scale: float
    shares: np.ndarray


@dataclass(frozen=True)
class Texels:
    """levels: per mip level (2, s, s, 4) uint8. slope_scale and shares as in `Layer`."""

    levels: list[np.ndarray]
    slope_scale: float
    shares: np.ndarray


def texels_of(maps: MaterialMaps) -> Texels:
    """All mip levels of both arrays of one material."""
    slopes = _slopes(maps)
    slope_scale = float(max(np.quantile(np.abs(slopes[:, ::2, ::2]), 0.999), 1e-4))
    slopes /= np.float32(slope_scale)
    np.clip(slopes, -1.0, 1.0, out=slopes)
    masks = np.stack([maps.mix, maps.pattern, maps.detail, maps.roughness, maps.metallic])
    squares = _mean_square(slopes)
    levels = [_level(masks, slopes, np.float32(0))]
    while masks.shape[1] > 1:
        masks, slopes, squares = _halved(masks), _halved(slopes), _halved(squares)
        levels.append(_level(masks, slopes, np.sqrt(np.maximum(squares - _mean_square(slopes), 0.0))))
    return Texels(levels, slope_scale, _colour_shares(maps))


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


def _mean_square(slopes: np.ndarray) -> np.ndarray:
    return (slopes[0] * slopes[0] + slopes[1] * slopes[1]) * np.float32(0.5)


def _level(masks: np.ndarray, slopes: np.ndarray, spread: np.ndarray | np.float32) -> np.ndarray:
    """One mip level, (2, s, s, 4) uint8, from planes (5, s, s), (2, s, s) and (s, s)."""
    level = np.empty((2, *masks.shape[1:], 4), np.uint8)
    for channel, top in enumerate((255, 255, 254, 255)):
        level[0, ..., channel] = np.rint(masks[channel] * np.float32(top))
    for channel in range(2):
        level[1, ..., channel] = np.rint(slopes[channel] * np.float32(127)) + np.float32(128)
    level[1, ..., 2] = np.rint(spread * np.float32(255))
    level[1, ..., 3] = np.rint(masks[4] * np.float32(255))
    return level


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


class LayerStore:
    """The resident layers. What a layer holds depends on its material alone, never on its slot."""

    def __init__(self, context: moderngl.Context, size: int, budget_bytes: int = BUDGET_BYTES) -> None:
        self._context = context
        self._size = size
        self._levels = size.bit_length()
        self._budget_layers = max(1, budget_bytes * 3 // (size * size * 8 * 4))
        self._upload = load_compute(context, "upload_level.comp")
        self._copy = load_compute(context, "copy_level.comp")
        self._resident: OrderedDict[Hashable, Layer] = OrderedDict()
        self._arrays: list[moderngl.TextureArray] = []
        self._capacity = 0

    def load(self, materials: Iterable[tuple[str, int]], bake: Bake) -> dict[tuple[str, int], Layer]:
        """Layers of all (family, variant), baked where they are not resident."""
        wanted = list(dict.fromkeys(materials))
        for key in wanted:
            if key in self._resident:
                self._resident.move_to_end(key)
        missing = [key for key in wanted if key not in self._resident]
        if missing:
            self._make_room(len(missing), len(wanted))
        for key in missing:
            self._resident[key] = self._write(texels_of(bake(*key, self._size)))
        return {key: self._resident[key] for key in wanted}

    def use(self, masks_unit: int, relief_unit: int) -> None:
        """Bind the two arrays to texture units."""
        for array, unit in zip(self._arrays, (masks_unit, relief_unit), strict=True):
            array.use(unit)

    def _make_room(self, missing: int, wanted: int) -> None:
        needed = len(self._resident) + missing
        limit = max(self._budget_layers, wanted)
        while needed > limit:
            self._resident.popitem(last=False)
            needed -= 1
        if needed > self._capacity:
            self._grow(min(-(-needed // _STEP_LAYERS) * _STEP_LAYERS, limit))

    def _grow(self, capacity: int) -> None:
        """Arrays of `capacity` layers, the resident ones moved to the front; one array after the other, and
        each old one is free before the next is made, so that growth takes little more than the result."""
        for i in range(2):
            target = self._new_array(capacity)
            if self._capacity:
                self._move_layers(self._arrays[i], target)
                self._context.finish()
                self._arrays[i].release()
                self._arrays[i] = target
            else:
                self._arrays.append(target)
        self._capacity = capacity
        layers = enumerate(self._resident.items())
        self._resident = OrderedDict(
            (key, Layer(slot, layer.slope_scale, layer.shares)) for slot, (key, layer) in layers
        )

    def _move_layers(self, source: moderngl.TextureArray, target: moderngl.TextureArray) -> None:
        for slot, layer in enumerate(self._resident.values()):
            for level in range(self._levels):
                source.use(0)
                self._copy["source_layer"] = layer.index
                self._run(self._copy, target, slot, level)

    def _new_array(self, capacity: int) -> moderngl.TextureArray:
        array = self._context.texture_array((self._size, self._size, capacity), 4)
        array.build_mipmaps()
        array.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        return array

    def _write(self, texels: Texels) -> Layer:
        taken = {layer.index for layer in self._resident.values()}
        slot = next(i for i in range(self._capacity) if i not in taken)
        for level, data in enumerate(texels.levels):
            for array, level_texels in zip(self._arrays, data, strict=True):
                buffer = self._context.buffer(level_texels.tobytes())
                buffer.bind_to_storage_buffer(0)
                self._run(self._upload, array, slot, level)
                buffer.release()
        self._context.finish()  # or drivers keep the uploads of a whole scene
        return Layer(slot, texels.slope_scale, texels.shares)

    def _run(
        self, program: moderngl.ComputeShader, target: moderngl.TextureArray, slot: int, level: int
    ) -> None:
        """One level of one layer, in groups of 8 x 8 texels."""
        target.bind_to_image(0, read=False, write=True, level=level, format=_RGBA8)
        if program is self._copy:
            program["level"] = level
        program["layer"] = slot
        program["size"] = self._size >> level
        groups = max(1, (self._size >> level) // 8)
        program.run(groups, groups)
        self._context.memory_barrier()
