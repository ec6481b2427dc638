"""Images that were freed, given back by a driver that still holds them.

Mesa's llvmpipe draws into a row of scenes of its own. Each keeps what it has read until it is used again, and
the first idle one is always taken: those at the end of the row, which only a busy moment reaches, hold images
that were freed many frames ago. A busy moment made on purpose empties them all: an image of a single tile, so
that one thread draws it, however many there are. It takes a hundredth of a frame, so it is made only before
much is freed. In Mesa 25 the state of the last shader that read textures holds them, too, until another that
reads one takes its place, so the busy shader reads one. Other drivers have nothing to give back.
"""

from __future__ import annotations

import moderngl

from fsid.render.programs import load_program

_SCENES = 64
"""Scenes in the row, at most (Mesa's MAX_SCENES)."""

_BUSY_PX = 64
"""Mesa's TILE_SIZE."""

_UNIT = 16
"""The texture unit of busy.frag, which no other shader has."""


class Drain:
    """One slow image, and as many small ones waiting behind it as the row has scenes: 25 ms."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._slow = context.simple_framebuffer((_BUSY_PX, _BUSY_PX), 1)
        self._small = [context.simple_framebuffer((1, 1), 1) for _ in range(2)]
        self._nothing = context.texture((1, 1), 1, b"\0")
        program = load_program(context, "screen.vert", "busy.frag")
        self._screen = context.vertex_array(program, [])

    def run(self) -> None:
        """Return when everything issued so far is done, and what has been freed is free."""
        self._context.finish()
        self._nothing.use(_UNIT)
        for target in [self._slow, *self._small * (_SCENES // 2)]:
            target.use()
            self._screen.render(moderngl.TRIANGLES, vertices=3)
        self._context.finish()
