"""Mip levels of images that passes draw: of s texels a side, d = floor(s / 2), texel i of the next level is

    s = 2 d       the mean of 2i and 2i + 1
    s = 2 d + 1   ((d - i) x[2i] + d x[2i + 1] + (i + 1) x[2i + 2]) / s

the mean of what it covers (Guthe and Heckbert 2005), so that every texel weighs as much as the others at
every level. Drivers blend two texels where s is odd, too: in the middle of an image some then weigh twice as
much as they should at each level, and some nothing.

A compute shader does it, each level from the one before, in storage that nothing was drawn into. A GPU's
driver would take longer than to draw a scene's shadows, and waits for it. llvmpipe's takes a third of the
shader's time, so there the shader makes no more than the small levels from the first odd side on.
"""

from __future__ import annotations

from ctypes import c_int, c_uint, c_void_p
from typing import Any

import moderngl

from fsid.render.canvas import Canvas
from fsid.render.context import gl
from fsid.render.programs import ScreenProgram

_FORMATS = {2: "rg32f", 4: "rgba32f"}
_INTERNAL, _PIXELS = {2: 0x8230, 4: 0x8814}, {2: 0x8227, 4: 0x1908}  # the same for OpenGL; of its channels
_TEXTURE_2D, _MAX_LEVEL, _FLOAT = 0x0DE1, 0x813D, 0x1406


class MipLevels:
    """Owns the programs. compute: as in `ScreenProgram`; False leaves what it can to the driver."""

    def __init__(self, context: moderngl.Context, *, compute: bool) -> None:
        self._context = context
        self._compute = compute
        self._programs = {
            components: ScreenProgram(context, "halved.frag", compute=True, FORMAT=name)
            for components, name in _FORMATS.items()
        }

    def fill(self, texture: Any) -> None:
        """All levels of a float texture from the first one."""
        levels = [
            Canvas(self._context, [texture], level=level)
            for level in range(1, max(texture.size).bit_length())
        ]
        done = 0
        if not self._compute:
            texture.build_mipmaps()
            done = _even_levels(texture.size)
        texture.use(0)
        if self._compute and texture.extra is None:
            _reserve(texture, levels)
        program = self._programs[texture.components]
        for level, canvas in enumerate(levels[done:], done + 1):
            program.set(level=level)
            program.draw(canvas)


def _even_levels(size: tuple[int, int]) -> int:
    """How many times both sides can be halved."""
    sides = size[0] | size[1]
    return (sides & -sides).bit_length() - 1


def _reserve(texture: Any, levels: list[Canvas]) -> None:
    """Storage of the levels of a texture that is bound to unit 0; `extra` says that it is there."""
    kind = texture.components
    store = gl("glTexImage2D", c_uint, *[c_int] * 5, c_uint, c_uint, c_void_p)
    for level, canvas in enumerate(levels, 1):
        store(_TEXTURE_2D, level, _INTERNAL[kind], *canvas.size, 0, _PIXELS[kind], _FLOAT, None)
    gl("glTexParameteri", c_uint, c_uint, c_int)(_TEXTURE_2D, _MAX_LEVEL, len(levels))
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    texture.extra = "has levels"
