"""The images that passes draw into: G-buffer, occlusion, light that reaches blocks, result."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from ctypes import c_float, c_int, c_uint, c_void_p
from typing import Any

import moderngl
import numpy as np

from fsid.errors import FsidError
from fsid.render.canvas import Canvas, make_marks, use_texels
from fsid.render.context import gl
from fsid.render.frame import Frame
from fsid.render.mip_levels import MipLevels
from fsid.render.programs import ScreenProgram

_ID_LEVELS = 65535
_STRIP = 64  # rows read at once
_COLOUR, _DEPTH = 0x1800, 0x1801


class Targets:
    """G-buffer of grid^2 samples per pixel (20 bytes each), occlusion per 2 x 2 pixels, result per pixel.

    compute: whether the programs that fill them are compute shaders, which store labels always: what a
    fragment shader writes where there is no image is dropped. What `begin_...` returns is to be drawn.
    """

    def __init__(self, context: moderngl.Context, grid: int, mips: MipLevels, *, compute: bool) -> None:
        self._context = context
        self._grid = grid
        self._mips = mips
        self._compute = compute
        self._empty = ScreenProgram(context, "no_samples.frag", compute=True) if compute else None
        self._owned: list[Any] = []
        self._results: list[Canvas] = []
        self._lit: list[Canvas] = []
        self._overview: list[Canvas] = []
        self._lit_rows = 0
        self.block_lights = 0
        self.size = self.seen = (0, 0)
        self._labels = True

    def resize(self, size: tuple[int, int], seen: tuple[int, int], *, labels: bool) -> None:
        """Make the images for `size` pixels and a G-buffer of `seen` pixels, unless they are there. labels:
        whether the result has albedo, normal and id besides radiance and depth."""
        labels = labels or self._compute
        if (self.size, self.seen, self._labels) == (size, seen, labels):
            return
        self._limit = int(self._context.info["GL_MAX_TEXTURE_SIZE"])
        limit = self._limit // self._grid
        for width, height in (size, seen):
            if not (0 < width <= limit and 0 < height <= limit):
                raise FsidError(
                    f"image size {width} x {height}: this driver draws 1 .. {limit} pixels a side"
                )
        self.release()
        self.size, self.seen, self._labels = size, seen, labels
        try:
            self._make()
        except moderngl.Error as error:
            self.release()
            raise FsidError(
                f"image size {size[0]} x {size[1]}: this driver does not hold {self._grid} x {self._grid} "
                "samples for each pixel of it; take fewer pixels or a smaller supersampling"
            ) from error

    def _make(self) -> None:
        context, size, own = self._context, self.size, self._own
        large = (self.seen[0] * self._grid, self.seen[1] * self._grid)
        self.blocks = (-(-self.seen[0] // 2), -(-self.seen[1] // 2))
        self._samples = own(context.texture(large, 4, dtype="u4"))
        self._depth = own(context.depth_texture(large))
        self._depth.compare_func = ""
        self._to_samples = own(context.framebuffer([self._samples], self._depth))
        self._block_depth = own(context.texture(self.blocks, 2, dtype="f4"))
        self._open, self._blurred = (own(context.texture(self.blocks, 4, dtype="f4")) for _ in range(2))
        for texture in (self._samples, self._depth, self._block_depth, self._open, self._blurred):
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._marks = own(make_marks(context, size, compute=self._compute))
        self._results = [self._result()]
        self._to_missing = own(Canvas(context, self._results[0].images[:1], self._marks))
        self._to_marks = own(Canvas(context, [], self._marks))
        self._to_block_depth = own(Canvas(context, [self._block_depth]))
        self._to_open = own(Canvas(context, [self._open]))
        self._to_blurred = own(Canvas(context, [self._blurred]))
        if self._compute:
            self._all_samples = own(Canvas(context, [self._samples]))

    def _own(self, item: Any) -> Any:
        """The item, which `release` frees."""
        self._owned.append(item)
        return item

    def begin_samples(self, *, over: bool) -> None:
        """Draw the G-buffer, from nothing; or only what lies in front of the depth that is there."""
        if self._empty is not None:
            self._empty.draw(self._all_samples)
        self._to_samples.use()
        if self._empty is None:
            clear = gl("glClearBufferuiv", c_uint, c_int, c_void_p)  # glClear is undefined for integers
            clear(_COLOUR, 0, (c_uint * 4)())
        if not over:
            gl("glClearBufferfv", c_uint, c_int, c_void_p)(_DEPTH, 0, (c_float * 1)(1.0))

    def begin_overview(self, width: int) -> Canvas:
        """A grid of places, `width` of them in a row, square unless the image is a slit; unit 0 holds the
        G-buffer."""
        height = min(max(1, round(width * self.seen[1] / self.seen[0])), self._limit)
        if not self._overview:
            texture = self._context.texture((width, height), 4, dtype="u4")
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._overview = [Canvas(self._context, [texture])]
        self._samples.use(0)
        return self._overview[0]

    def read_overview(self) -> tuple[np.ndarray, np.ndarray]:
        """(N, 2) places, 0..1 of the G-buffer, and (N, 4) uint32 samples of it there."""
        width, height = self._overview[0].size
        data = self._overview[0].read((0, 0, width, height), 4, 0, "u4")
        large = np.array(self.seen) * self._grid
        row, column = np.divmod(np.arange(width * height), width)
        texel = (2 * np.column_stack([column, row]) + 1) * large // (2 * np.array([width, height]))
        return (texel + 0.5) / large, np.frombuffer(data, np.uint32).reshape(-1, 4)

    def begin_block_depth(self) -> Canvas:
        """The depth of the blocks; unit 0 holds the G-buffer."""
        self._use(self._samples, 0)
        return self._to_block_depth

    def begin_shadow_blocks(self, lights: int) -> Canvas:
        """The share of each light that reaches the blocks, of as many lights as an image is high; unit 0
        holds the G-buffer, and unit 2 is the result for what is drawn next."""
        width, height = self.blocks
        fours = min(-(-lights // 4), self._limit // height)
        self.block_lights = min(lights, 4 * fours)
        rows = max(fours, 1) * height
        if rows != self._lit_rows:
            self._release_lit()
            texture = self._context.texture((width, rows), 4, dtype="f4")
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            self._lit, self._lit_rows = [Canvas(self._context, [texture])], rows
        self._use(self._lit[0].images[0], 2)
        self._use(self._samples, 0)
        return self._lit[0]

    def _release_lit(self) -> None:
        _release_all(self._lit)
        self._lit, self._lit_rows = [], 0

    def begin_occlusion(self) -> Canvas:
        """The occlusion; units 0, 1 hold the G-buffer and the depth of the blocks."""
        self._use(self._samples, 0)
        self._use(self._block_depth, 1)
        return self._to_open

    def begin_blur(self, *, back: bool) -> Canvas:
        """The occlusion of unit 0 in the second image, or back in the first."""
        self._use(self._blurred if back else self._open, 0)
        return self._to_open if back else self._to_blurred

    def begin_shading(self) -> Canvas:
        """The result; units 0, 1 hold the G-buffer and the occlusion."""
        self._use(self._samples, 0)
        self._use(self._open, 1)
        return self._results[0]

    def begin_missing(self) -> Canvas:
        """The radiance alone, once more, with the marks of `begin_shading`."""
        return self._to_missing

    def use_mirror(self, unit: int) -> None:
        """Bind radiance and depth, with mip levels, for what reflects them."""
        radiance = self._results[0].images[0]
        self._mips.fill(radiance)
        radiance.use(unit)

    def begin_marks(self) -> Canvas:
        """New marks alone; unit 0 holds the G-buffer."""
        self._use(self._samples, 0)
        return self._to_marks

    def begin_glass(self) -> Canvas:
        """What goes over the result; units 11 to 13 hold it."""
        if len(self._results) == 1:
            self._results.append(self._result())
        return self._over(1)

    def end_glass(self) -> Canvas:
        """The result; units 11 to 13 hold what belongs where there are marks."""
        return self._over(0)

    def _over(self, result: int) -> Canvas:
        """One of the two results; units 11 to 13 hold the other, or three times one that has no labels."""
        radiance, *labels = self._results[1 - result].images
        for unit, texture in zip((11, 12, 13), [radiance, *(labels or [radiance] * 2)], strict=True):
            texture.use(unit)
        return self._results[result]

    def _use(self, texture: moderngl.Texture, unit: int) -> None:
        use_texels(texture, unit, compute=self._compute)

    def read_radiance(self) -> tuple[np.ndarray, np.ndarray]:
        """(H, W, 3) radiance and (H, W) depth, inf where nothing was hit; row 0 at the top."""
        width, height = self.size
        radiance, depth = np.empty((height, width, 3), np.float32), np.empty((height, width), np.float32)
        for rows, texels in self._strips(0, "f4", np.float32):
            _fill(radiance[rows], texels, 1.0)
            depth[rows] = texels[..., 3]
        depth[depth <= 0] = np.inf
        return radiance, depth

    def read_frame(self, *, labels: bool) -> Frame:
        """The result, row 0 at the top. labels: False leaves all but radiance and depth without pixels."""
        radiance, depth = self.read_radiance()
        height, width = depth.shape if labels else (0, 0)
        albedo, normal = (np.empty((height, width, 3), np.float32) for _ in range(2))
        object_id = np.empty((height, width), np.int32)
        if labels:
            for rows, texels in self._strips(1, "nu2", np.uint16):
                _fill(albedo[rows], texels, 1 / _ID_LEVELS)
                np.subtract(texels[..., 3], 1, out=object_id[rows], dtype=np.int32)
            for rows, texels in self._strips(2, "nu2", np.uint16):
                _fill(normal[rows], texels, 2 / _ID_LEVELS)
                normal[rows] -= 1
            normal[np.isinf(depth)] = (0, 0, 1)  # its zeros lie between two integers
        return Frame(radiance, albedo, normal, depth, object_id)

    def _strips(self, image: int, dtype: str, kind: type) -> Iterator[tuple[slice, np.ndarray]]:
        """(rows, (h, W, 4) texels) of an image of the result: together they would be the largest thing that a
        frame needs. Beside compute shaders, on a GPU, they are read at once: each part is waited for."""
        width, height = self.size
        read = height if self._compute else _STRIP
        for top in range(0, height, read):
            count = min(read, height - top)
            data = self._results[0].read((0, top, width, count), 4, image, dtype)
            texels: np.ndarray = np.frombuffer(data, kind).reshape(count, width, 4)
            for first in range(0, count, _STRIP):
                strip = texels[first : first + _STRIP]
                yield slice(top + first, top + first + len(strip)), strip

    def release_passing(self) -> None:
        """Free what is needed no longer when the result is drawn, and is made in little time."""
        _release_all(self._results[1:])
        del self._results[1:]
        self._release_lit()

    def release(self) -> None:
        """Free the images."""
        for item in reversed(self._owned):
            item.release()
        _release_all([*self._overview, *self._results])
        self._owned, self._results, self._overview = [], [], []
        self._release_lit()
        self.size = self.seen = (0, 0)

    def _result(self) -> Canvas:
        """Radiance and depth; albedo and id; normal; with the marks."""
        radiance = self._context.texture(self.size, 4, dtype="f4")
        labels = [self._context.texture(self.size, 4, dtype="nu2") for _ in range(2 * self._labels)]
        radiance.repeat_x = radiance.repeat_y = False
        for label in labels:
            label.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return Canvas(self._context, [radiance, *labels], self._marks)


def _release_all(canvases: Sequence[Canvas]) -> None:
    """Free canvases and their images."""
    for canvas in canvases:
        canvas.release()
        for image in canvas.images:
            image.release()


def _fill(image: np.ndarray, texels: np.ndarray, scale: float) -> None:
    """Colours of texels into an image, one by one: numpy takes four times as long for all at once."""
    for k in range(3):
        np.multiply(texels[..., k], np.float32(scale), out=image[..., k])
