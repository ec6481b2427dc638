"""Texture layers of materials, resident within a memory budget, the least recently used leave first."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass

import moderngl
import numpy as np

from fsid.render.texels import Bake, Texels
from fsid.render.texture_array import TextureArray

BUDGET_BYTES = 224 * 2**20
"""Texture memory: 21 layers of 1024 texels, four times as many of 512."""

GPU_BUDGET_BYTES = 2**30 // 3
"""What may stay resident of each size on a GPU, which several renderers may share: tiles of 1024, 512 and 256
texels take a GiB. Scenes have the same texels there."""

MOST_LAYERS = 480
"""Resident at most, however small they are: those of five crowded scenes. 95 % of what later scenes need is
among them; of four times as many it was 97 % (docs/results.md)."""

_SMALLEST = 64

_STEP_LAYERS = 16


@dataclass(frozen=True, eq=False)
class Layer:
    """index: in the texture arrays. slope_scale and shares as in `Texels`. roughness, metallic: means."""

    index: int
    slope_scale: float
    shares: np.ndarray
    roughness: float
    metallic: float


def fitting_size(size: int, materials: int) -> int:
    """Texels per side at which all materials of a scene fit the budget, at most `size`: a scene of many
    materials has smaller ones, whatever was rendered before it."""
    while size > _SMALLEST and materials * _layer_bytes(size) > BUDGET_BYTES:
        size //= 2
    return size


def _layer_bytes(size: int) -> int:
    """Both arrays, all levels."""
    return size * size * 8 * 4 // 3


class LayerStore:
    """The resident layers. What a layer holds depends on its material alone, never on its slot."""

    def __init__(
        self,
        context: moderngl.Context,
        size: int,
        drain: Callable[[], None] | None = None,
        budget_bytes: int = BUDGET_BYTES,
        *,
        frugal: bool = True,
    ) -> None:
        """drain: called before arrays are freed, so that the driver does not hold them (`Drain.run`).
        budget_bytes: of what stays resident. frugal: wait after each upload, or drivers keep them."""
        self._context = context
        self._drain = drain or context.finish
        self._frugal = frugal
        self._size = size
        self._budget_layers = min(MOST_LAYERS, max(1, budget_bytes // _layer_bytes(size)))
        self._resident: OrderedDict[Hashable, Layer] = OrderedDict()
        self._arrays: list[TextureArray] = []
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
            self._resident[key] = self._write(bake(*key, self._size))
        return {key: self._resident[key] for key in wanted}

    @property
    def size(self) -> int:
        """Texels per side of a layer."""
        return self._size

    def release(self) -> None:
        """Free all layers; the store cannot be used afterwards."""
        self._drain()
        for array in self._arrays:
            array.release()
        self._arrays, self._capacity = [], 0
        self._resident.clear()

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
        """Arrays of `capacity` layers, the resident ones in their places; one array after the other, and each
        old one is free before the next is made, so that growth takes little more than the result."""
        self._drain()
        for i in range(2):
            target = TextureArray(self._context, self._size, capacity, buffered=not self._frugal)
            if self._capacity:
                target.take(self._arrays[i])
                self._context.finish()
                self._arrays[i].release()
                self._arrays[i] = target
            else:
                self._arrays.append(target)
        self._capacity = capacity

    def _write(self, texels: Texels) -> Layer:
        taken = {layer.index for layer in self._resident.values()}
        slot = next(i for i in range(self._capacity) if i not in taken)
        for array, data in zip(self._arrays, texels.data, strict=True):
            array.write(slot, data)
        if self._frugal:
            self._context.finish()
        roughness, metallic = (float(texels.data[i][-1, 3]) / 255 for i in range(2))
        return Layer(slot, texels.slope_scale, texels.shares, roughness, metallic)
