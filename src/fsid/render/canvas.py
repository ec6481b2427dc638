"""Images that one program fills together, marks on their pixels, and images that it reads by texel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import moderngl

_MARKS_UNIT = 3  # binding of shaders/screen.glsl


class Canvas:
    """Drawn into through a framebuffer, or as images by a compute shader. marks: of `make_marks`; may be
    shared between canvases. level: a mip level of the images, for compute shaders alone where it is not 0.
    Images and marks stay the caller's; `release` frees the rest."""

    def __init__(
        self,
        context: moderngl.Context,
        images: Sequence[moderngl.Texture],
        marks: Any = None,
        *,
        level: int = 0,
    ) -> None:
        self.images = tuple(images)
        width, height = (images or [marks])[0].size
        self.size = (max(width >> level, 1), max(height >> level, 1))
        self._level = level
        self._marks_image = marks if isinstance(marks, moderngl.Texture) else None
        depth = marks if self._marks_image is None else None
        self._framebuffer: Any = None
        if level == 0 and (images or depth is not None):
            self._framebuffer = context.framebuffer(list(images), depth)

    def use_framebuffer(self, box: tuple[int, int, int, int] | None, *, mark: bool) -> None:
        """Draw into it, or into a box of it: left, top, width, height. mark: whether depth is written."""
        self._framebuffer.scissor = box
        self._framebuffer.depth_mask = mark
        self._framebuffer.use()

    def use_images(self) -> None:
        """Bind the images to the image units 0, 1, ... and the marks to theirs."""
        for unit, image in enumerate(self.images):
            image.bind_to_image(unit, read=True, write=True, level=self._level)
        if self._marks_image is not None:
            self._marks_image.bind_to_image(_MARKS_UNIT, read=True, write=True)

    def read(self, box: tuple[int, int, int, int], components: int, image: int, dtype: str) -> bytes:
        """Texels of a box of one of its images."""
        return bytes(self._framebuffer.read(box, components, attachment=image, dtype=dtype))

    def release(self) -> None:
        """Free the framebuffer."""
        if self._framebuffer is not None:
            self._framebuffer.release()


def use_texels(texture: moderngl.Texture, unit: int, *, compute: bool) -> None:
    """Bind what a program declares with TEXELS or UINT_TEXELS of shaders/screen.glsl."""
    if compute:
        texture.use(unit)
    else:
        texture.bind_to_image(unit, read=True, write=False)


def make_marks(context: moderngl.Context, size: tuple[int, int], *, compute: bool) -> Any:
    """Marks for images of `size`: depth, which tests fragments before they are computed, or an image."""
    return context.texture(size, 1) if compute else context.depth_renderbuffer(size)
