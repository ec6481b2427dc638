"""What one stage keeps on the device while it is drawn: vertices, tables, surroundings."""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np

from fsid.render.canvas import use_texels
from fsid.render.geometry import surface_texels
from fsid.render.stage import Stage

UNITS = {"room": 4, "surfaces": 5, "lights": 6, "sky": 10}
"""Texture units of the tables, as the shaders' `binding`s."""
_TEXELS = ("surfaces", "lights")  # read texel by texel


class Buffers:
    """Made for one stage and released after it. compute: as in `Targets`."""

    def __init__(self, context: moderngl.Context, stage: Stage, *, compute: bool) -> None:
        self._context = context
        self._compute = compute
        geometry, plan = stage.geometry, stage.plan
        self._world, self._vertices, self._indices = (
            context.buffer(array.view(np.uint8))
            for array in (geometry.world, geometry.vertices, geometry.indices)
        )
        self._owned: list[Any] = [self._world, self._vertices, self._indices]
        self._tables: dict[str, Any] = {
            "surfaces": self._table(surface_texels(geometry.surfaces)),
            "lights": self._table(plan.table.view(np.float32).reshape(len(plan.table), -1, 4)),
            "room": self._room(stage.room.radiance),
        }
        if stage.sky is not None:
            self._tables["sky"] = self._panorama(stage.sky)
        self._owned += self._tables.values()

    def use(self) -> None:
        """Bind all tables to their units."""
        for name, table in self._tables.items():
            if name in _TEXELS:
                use_texels(table, UNITS[name], compute=self._compute)
            else:
                table.use(UNITS[name])

    def vertex_array(self, program: moderngl.Program) -> moderngl.VertexArray:
        """The geometry as input of a program: positions in the world, and the rest where it is asked for."""
        content: list[tuple[Any, ...]] = [(self._world, "3f", "in_world")]
        if "in_normal" in program:
            content.append((self._vertices, "3f 1u", "in_normal", "in_surface"))
        else:
            content.append((self._vertices, "12x 1u", "in_surface"))
        array = self._context.vertex_array(program, content, self._indices)
        self._owned.append(array)
        return array

    def draw(self, array: moderngl.VertexArray, commands: np.ndarray) -> None:
        """One indirect draw of (n, 5) commands."""
        if not len(commands):
            return
        buffer = self._context.buffer(commands.tobytes())
        array.render_indirect(buffer, moderngl.TRIANGLES, count=len(commands))
        self._owned.append(buffer)

    def release(self) -> None:
        """Free all of it."""
        for item in self._owned:
            item.release()

    def _table(self, texels: np.ndarray) -> moderngl.Texture:
        """Rows are added to an odd number, from three on: no power of two, for the reason of `ShadowPlan`."""
        rows = len(texels)
        texels = np.pad(texels, ((0, max(3, rows | 1) - rows), (0, 0), (0, 0)))
        height, width, _ = texels.shape
        texture = self._context.texture((width, height), 4, texels.tobytes(), dtype="f4")
        texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        return texture

    def _room(self, radiance: np.ndarray) -> moderngl.TextureArray:
        sides, height, width, _ = radiance.shape
        texels = np.concatenate([radiance, np.ones((*radiance.shape[:3], 1))], axis=-1).astype("f4")
        array = self._context.texture_array((width, height, sides), 4, texels.tobytes(), dtype="f4")
        array.build_mipmaps()
        array.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        array.repeat_x = array.repeat_y = False
        return array

    def _panorama(self, panorama: np.ndarray) -> moderngl.Texture:
        height, width, _ = panorama.shape
        texture = self._context.texture((width, height), 3, panorama.tobytes(), dtype="f4")
        texture.build_mipmaps()
        texture.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        texture.repeat_y = False
        return texture
