"""The image that the shadow maps of all lights share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import moderngl

from fsid.render.canvas import Canvas
from fsid.render.mip_levels import MipLevels


class ShadowAtlas:
    """One depth image that holds the tiles of all lights, and its moments at half the size."""

    def __init__(self, context: moderngl.Context, drain: Callable[[], None], mips: MipLevels) -> None:
        """drain: called when an image was freed, so that the driver does not hold it (`Drain.run`)."""
        self._context = context
        self._mips = mips
        self._drain = drain
        self._size = (0, 0)
        self._owned: list[Any] = []
        self._sampler = context.sampler(
            repeat_x=False, repeat_y=False, filter=(moderngl.LINEAR, moderngl.LINEAR), compare_func="<="
        )

    def resize(self, size: tuple[int, int]) -> None:
        """Make the image for `size` texels, unless it is there."""
        if self._size == size:
            return
        for item in self._owned:
            item.release()
        if self._owned:
            self._drain()
        self._depth = self._context.depth_texture(size)
        self._depth.compare_func = ""
        self._depth.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._depth.repeat_x = self._depth.repeat_y = False
        self._moments = self._context.texture((size[0] // 2, size[1] // 2), 2, dtype="f4")
        self.framebuffer = self._context.framebuffer([], self._depth)
        self._to_moments = Canvas(self._context, [self._moments])
        self._owned = [self.framebuffer, self._to_moments, self._depth, self._moments]
        self._size = size

    def begin(self) -> None:
        """Draw depth of all tiles, from nothing."""
        self.framebuffer.use()
        self.framebuffer.viewport = (0, 0, *self._size)
        self.framebuffer.clear(depth=1.0)

    def begin_moments(self) -> Canvas:
        """The moments, of half the size; unit 0 holds the depth that they are made of."""
        self._depth.use(0)
        return self._to_moments

    def end_moments(self) -> None:
        """Make their mip levels."""
        self._mips.fill(self._moments)

    def use(self, compare_unit: int, moments_unit: int) -> None:
        """Bind depth for filtered comparison, and the moments."""
        self._depth.use(compare_unit)
        self._sampler.use(compare_unit)
        self._moments.use(moments_unit)
