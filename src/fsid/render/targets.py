"""The images that passes draw into: G-buffer, occlusion, result, shadow atlas."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np

from fsid.errors import FsidError
from fsid.render.frame import Frame


class Targets:
    """G-buffer of grid^2 samples per pixel (24 bytes and depth each), occlusion and result per pixel."""

    def __init__(self, context: moderngl.Context, grid: int) -> None:
        self._context = context
        self._grid = grid
        self._owned: list[Any] = []
        self.size = (0, 0)

    def resize(self, width: int, height: int) -> None:
        """Make the images for width x height pixels, unless they are there."""
        if self.size == (width, height):
            return
        limit = int(self._context.info["GL_MAX_TEXTURE_SIZE"]) // self._grid
        if not (0 < width <= limit and 0 < height <= limit):
            raise FsidError(f"image size {width} x {height}: this driver draws 1 .. {limit} pixels a side")
        self.release()
        context, large, size = self._context, (width * self._grid, height * self._grid), (width, height)
        self._a = context.texture(large, 4, dtype="u4")
        self._b = context.texture(large, 2, dtype="u4")
        self._depth = context.depth_texture(large)
        self._depth.compare_func = ""
        self._open, self._blurred = (context.texture(size, 2, dtype="f4") for _ in range(2))
        self._result = [context.texture(size, 4, dtype="f4") for _ in range(3)]
        images = [self._a, self._b, self._depth, self._open, self._blurred, *self._result]
        for texture in images:
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._to_depth = context.framebuffer([], self._depth)
        self._to_surfaces = context.framebuffer([self._a, self._b], self._depth)
        self._to_open = context.framebuffer([self._open])
        self._to_blurred = context.framebuffer([self._blurred])
        self._to_result = context.framebuffer(self._result)
        framebuffers = [self._to_depth, self._to_surfaces, self._to_open, self._to_blurred, self._to_result]
        self._owned = [*framebuffers, *images]
        self.size = size

    def begin_depth(self) -> None:
        """Draw depth of all samples, from nothing."""
        self._to_depth.use()
        self._to_depth.clear(depth=1.0)

    def begin_surfaces(self) -> None:
        """Draw the G-buffer over the depth that is there."""
        self._to_surfaces.use()

    def begin_occlusion(self) -> None:
        """Draw the occlusion; units 0, 1, 2 hold the G-buffer."""
        self._a.use(0)
        self._b.use(1)
        self._depth.use(2)
        self._to_open.use()

    def begin_blur(self, *, back: bool) -> None:
        """Draw the occlusion of unit 0 into the second image, or back into the first."""
        (self._blurred if back else self._open).use(0)
        (self._to_open if back else self._to_blurred).use()

    def begin_lighting(self) -> None:
        """Draw the result; units 0, 1, 5, 6 hold the G-buffer and the occlusion."""
        self._a.use(0)
        self._b.use(1)
        self._depth.use(5)
        self._open.use(6)
        self._to_result.use()

    def read_frame(self) -> Frame:
        """The result, row 0 at the top."""
        width, height = self.size
        radiance, albedo, normal = (
            np.frombuffer(t.read(), np.float32).reshape(height, width, 4) for t in self._result
        )
        depth = radiance[..., 3]
        return Frame(
            radiance=np.ascontiguousarray(radiance[..., :3]),
            albedo=np.ascontiguousarray(albedo[..., :3]),
            normal=np.ascontiguousarray(normal[..., :3]),
            depth=np.where(depth > 0, depth, np.float32(np.inf)),
            object_id=albedo[..., 3].astype(np.int32) - 1,
        )

    def release(self) -> None:
        """Free the images."""
        for item in self._owned:
            item.release()
        self._owned = []


class ShadowAtlas:
    """One depth image that holds the tiles of all lights, and its moments at half the size."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
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
        self._depth = self._context.depth_texture(size)
        self._depth.compare_func = ""
        self._depth.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._depth.repeat_x = self._depth.repeat_y = False
        self._moments = self._context.texture((size[0] // 2, size[1] // 2), 2, dtype="f4")
        self._moments.build_mipmaps()
        self._moments.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self.framebuffer = self._context.framebuffer([], self._depth)
        self._to_moments = self._context.framebuffer([self._moments])
        self._owned = [self.framebuffer, self._to_moments, self._depth, self._moments]
        self._size = size

    def begin(self) -> None:
        """Draw depth of all tiles, from nothing."""
        self.framebuffer.use()
        self.framebuffer.viewport = (0, 0, *self._size)
        self.framebuffer.clear(depth=1.0)

    def begin_moments(self) -> None:
        """Draw the moments; unit 0 holds the depth."""
        self._depth.use(0)
        self._to_moments.use()

    def end_moments(self) -> None:
        """Average them into mip levels."""
        self._moments.build_mipmaps()

    def use(self, compare_unit: int, moments_unit: int) -> None:
        """Bind depth for filtered comparison, and the moments."""
        self._depth.use(compare_unit)
        self._sampler.use(compare_unit)
        self._moments.use(moments_unit)
