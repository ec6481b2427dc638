"""Mip levels of images that passes draw.

A GPU's driver takes longer to make them than to draw a scene's shadows, and waits for it: there a compute
shader does it, each level from the one before, in storage that nothing was drawn into.
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
    """Owns the programs; compute: as in `ScreenProgram`."""

    def __init__(self, context: moderngl.Context, *, compute: bool) -> None:
        self._context = context
        self._programs = {
            components: ScreenProgram(context, "halved.frag", compute=True, FORMAT=name)
            for components, name in _FORMATS.items()
            if compute
        }

    def fill(self, texture: Any) -> None:
        """All levels of a float texture from the first one."""
        if not self._programs:
            texture.build_mipmaps()
            return
        levels = [
            Canvas(self._context, [texture], level=level)
            for level in range(1, max(texture.size).bit_length())
        ]
        texture.use(0)
        if texture.extra is None:
            _reserve(texture, levels)
        program = self._programs[texture.components]
        for level, canvas in enumerate(levels, 1):
            program.set(level=level)
            program.draw(canvas)


def _reserve(texture: Any, levels: list[Canvas]) -> None:
    """Storage of the levels of a texture that is bound to unit 0; `extra` says that it is there."""
    kind = texture.components
    store = gl("glTexImage2D", c_uint, *[c_int] * 5, c_uint, c_uint, c_void_p)
    for level, canvas in enumerate(levels, 1):
        store(_TEXTURE_2D, level, _INTERNAL[kind], *canvas.size, 0, _PIXELS[kind], _FLOAT, None)
    gl("glTexParameteri", c_uint, c_uint, c_int)(_TEXTURE_2D, _MAX_LEVEL, len(levels))
    texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
    texture.extra = "has levels"
