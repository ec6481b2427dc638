"""Shadows in two passes: depth from every light into the tiles of one atlas, with its first two moments; and
the share of each light that reaches one sample per block of 2 x 2 pixels, which shading interpolates."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import moderngl
import numpy as np

from fsid.render.buffers import Buffers
from fsid.render.canvas import use_texels
from fsid.render.exposure import Shot
from fsid.render.frustum import in_view, sees
from fsid.render.geometry import draw_commands
from fsid.render.mip_levels import MipLevels
from fsid.render.programs import ScreenProgram, load_program, set_uniforms
from fsid.render.quality import Quality
from fsid.render.shadow_atlas import ShadowAtlas
from fsid.render.shadows import NEAR_M, ShadowPlan, Tile
from fsid.render.stage import Stage
from fsid.render.targets import Targets


class ShadowPass:
    """Owns the atlas. taps: the texture of `fsid.render.quality.tap_table`. grid, compute: as in `Targets`.
    drain, mips: as in `ShadowAtlas`."""

    def __init__(
        self,
        context: moderngl.Context,
        quality: Quality,
        grid: int,
        taps: moderngl.Texture,
        drain: Callable[[], None],
        mips: MipLevels,
        *,
        compute: bool,
    ) -> None:
        self._context = context
        self._quality = quality
        self._taps = taps
        self._compute = compute
        self._atlas = ShadowAtlas(context, drain, mips)
        self._depth = load_program(context, "depth.vert", None)
        self._moments = ScreenProgram(context, "moments.frag", compute=compute)
        self._no_moments = ScreenProgram(context, "no_moments.frag", compute=compute)
        self._blocks = ScreenProgram(context, "shadow_blocks.frag", compute=compute, LENS=0, GRID=grid)

    def resize(self, plan: ShadowPlan) -> None:
        """Make the atlas as large as the plan says."""
        self._atlas.resize(plan.size)

    def draw(self, stage: Stage, buffers: Buffers, shots: Sequence[Shot]) -> None:
        """The tiles that any of the shots can see, and their moments."""
        geometry = stage.geometry
        deepest_m = [_deepest_m(geometry.spheres, shot) for shot in shots]
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._atlas.begin()
        array = buffers.vertex_array(self._depth)
        set_uniforms(self._depth, near=NEAR_M)
        seen = [
            tile
            for tile in stage.plan.tiles
            if any(sees(shot, tile, far) for shot, far in zip(shots, deepest_m, strict=True))
        ]
        for tile in seen:
            self._atlas.framebuffer.viewport = (*tile.corner, tile.px, tile.px)
            set_uniforms(
                self._depth,
                origin=tile.origin,
                axes=tile.axes.T,
                focal=tile.focal,
                range_m=tile.range_m,
            )
            buffers.draw(array, draw_commands(geometry.ranges, _casters(stage, tile)))
        self._context.enable_only(moderngl.NOTHING)
        canvas = self._atlas.begin_moments()
        self._no_moments.draw(canvas)  # a lookup at a tile's edge reads its neighbour, at next to no weight
        for tile in seen:
            self._moments.set(middle=tile.middle)
            box = (tile.corner[0] // 2, tile.corner[1] // 2, tile.px // 2, tile.px // 2)
            self._moments.draw(canvas, box)
        self._atlas.end_moments()

    def draw_blocks(self, targets: Targets, stage: Stage, buffers: Buffers, shot: Shot) -> None:
        """What reaches the blocks of an image whose G-buffer is drawn."""
        lens = shot.lens
        self._blocks.set(
            blocks=targets.blocks,
            through=stage.has_lobes,
            light_count=stage.plan.light_count,
            seen=targets.seen,
            seen_focal=lens.seen_focal,
            seen_shift=shot.seen_shift,
            axes=lens.rotation.T,
            origin=lens.position,
        )
        self.use(self._blocks, stage.plan)
        buffers.use()
        self._blocks.draw(targets.begin_shadow_blocks(stage.plan.light_count))

    def use(self, program: ScreenProgram, plan: ShadowPlan) -> None:
        """Bind what shaders/shadows.glsl needs, but for the table of the lights."""
        program.set(
            tile_px=float(plan.tile_px),
            search_taps=self._quality.search_taps,
            filter_taps=self._quality.filter_taps,
        )
        self._atlas.use(compare_unit=15, moments_unit=3)
        use_texels(self._taps, 7, compute=self._compute)


def _deepest_m(spheres: np.ndarray, shot: Shot) -> float:
    """No surface is farther from the lens than this."""
    return float((np.linalg.norm(spheres[:, :3] - shot.lens.position, axis=1) + spheres[:, 3]).max())


def _casters(stage: Stage, tile: Tile) -> np.ndarray:
    """Numbers of the drawables that can shade something in the tile."""
    seen = stage.casts.copy()
    spheres, half = stage.geometry.spheres, 1.0 / tile.focal
    if tile.range_m == 0:
        seen &= in_view(spheres, tile.origin, tile.axes, (half, half))
    else:
        aside = np.abs((spheres[:, :3] - tile.origin) @ tile.axes[:2].T)
        seen &= (aside < half + spheres[:, 3:]).all(1)
    if tile.lamp >= 0:
        seen[tile.lamp] = False
    return np.flatnonzero(seen)
