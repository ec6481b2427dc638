"""Ambient occlusion: the share of the surroundings that each block of 2 x 2 pixels sees, smoothed over blocks
of like depth."""

from __future__ import annotations

import moderngl

from fsid.render.buffers import Buffers
from fsid.render.exposure import Shot
from fsid.render.programs import load_program, set_uniforms
from fsid.render.quality import Quality
from fsid.render.targets import Targets


class OcclusionPass:
    """taps: the texture of `fsid.render.quality.tap_table`. grid: as in `Targets`."""

    def __init__(
        self, context: moderngl.Context, quality: Quality, grid: int, taps: moderngl.Texture
    ) -> None:
        self._context = context
        self._taps = taps
        self._block_depth = load_program(context, "screen.vert", "block_depth.frag")
        self._occlusion = load_program(context, "screen.vert", "occlusion.frag")
        self._blur = load_program(context, "screen.vert", "blur.frag")
        for program in (self._block_depth, self._occlusion):
            set_uniforms(program, stride=2 * grid, taps=quality.occlusion_taps)

    def draw(self, targets: Targets, buffers: Buffers, shot: Shot) -> None:
        """The openness of an image whose G-buffer is drawn."""
        self._context.enable_only(moderngl.NOTHING)
        targets.begin_block_depth()
        buffers.draw_screen(self._block_depth)
        set_uniforms(
            self._occlusion,
            focal=shot.lens.seen_focal,
            axes=shot.lens.rotation.T,
            size=targets.blocks,
            shift=shot.seen_shift,
        )
        targets.begin_occlusion()
        self._taps.use(7)
        buffers.draw_screen(self._occlusion)
        for back in (False, True):
            set_uniforms(self._blur, direction=(0, 1) if back else (1, 0), size=targets.blocks)
            targets.begin_blur(back=back)
            buffers.draw_screen(self._blur)
