"""Mip levels of images that passes draw.

A GPU's driver takes longer to make them than to draw a scene's shadows, and waits for it: there a compute
shader does it, each level from the one before.
"""

from __future__ import annotations

from typing import Any

import moderngl

from fsid.render.canvas import Canvas
from fsid.render.programs import ScreenProgram

_FORMATS = {2: "rg32f", 4: "rgba32f"}


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
        if not self._programs or texture.extra is None:
            texture.build_mipmaps()  # makes room for them, too
            texture.extra = "has levels"
        if not self._programs:
            return
        program = self._programs[texture.components]
        texture.use(0)
        for level in range(1, max(texture.size).bit_length()):
            program.set(level=level)
            program.draw(Canvas(self._context, [texture], level=level))
