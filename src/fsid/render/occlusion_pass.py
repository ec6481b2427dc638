"""Ambient occlusion: the share of the surroundings that each block of 2 x 2 pixels sees, smoothed over blocks
of like depth."""

from __future__ import annotations

import moderngl

from fsid.render.canvas import use_texels
from fsid.render.exposure import Shot
from fsid.render.programs import ScreenProgram
from fsid.render.quality import Quality
from fsid.render.targets import Targets


class OcclusionPass:
    """taps: the texture of `fsid.render.quality.tap_table`. grid, compute: as in `Targets`."""

    def __init__(
        self, context: moderngl.Context, quality: Quality, grid: int, taps: moderngl.Texture, *, compute: bool
    ) -> None:
        self._taps = taps
        self._compute = compute
        self._block_depth, self._occlusion, self._blur = (
            ScreenProgram(context, file, compute=compute)
            for file in ("block_depth.frag", "occlusion.frag", "blur.frag")
        )
        for program in (self._block_depth, self._occlusion):
            program.set(stride=2 * grid, taps=quality.occlusion_taps)

    def draw(self, targets: Targets, shot: Shot) -> None:
        """The openness of an image whose G-buffer is drawn."""
        self._block_depth.draw(targets.begin_block_depth())
        self._occlusion.set(
            focal=shot.lens.seen_focal,
            axes=shot.lens.rotation.T,
            size=targets.blocks,
            shift=shot.seen_shift,
        )
        use_texels(self._taps, 7, compute=self._compute)
        self._occlusion.draw(targets.begin_occlusion())
        for back in (False, True):
            self._blur.set(direction=(0, 1) if back else (1, 0), size=targets.blocks)
            self._blur.draw(targets.begin_blur(back=back))
