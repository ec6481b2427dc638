"""Shading: materials and radiance of each pixel, once per surface in it; glass over it in a second round.

Most pixels find their shadows between those of the blocks. Lights whose shadow must be found in the pixel
itself are drawn after the rest, where the rest has left a mark, and glass only where there is some: on a CPU
every pixel pays for all that a shader can do.

What a scene does not have costs nothing: a program is compiled for each combination of lens, layers, area
lights, glass and mirrors that occurs.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from fsid.render.buffers import Buffers
from fsid.render.exposure import Shot
from fsid.render.layers import LayerStore
from fsid.render.programs import load_program, set_uniforms
from fsid.render.quality import Quality
from fsid.render.reflectance import lobe_table, reflectance_table
from fsid.render.shadow_pass import ShadowPass
from fsid.render.stage import Stage
from fsid.render.targets import Targets


class ShadePass:
    """Owns the programs and the table of what GGX reflects. grid: as in `Targets`."""

    def __init__(self, context: moderngl.Context, quality: Quality, grid: int, shadows: ShadowPass) -> None:
        self._context = context
        self._quality = quality
        self._grid = grid
        self._shadows = shadows
        self._programs: dict[tuple[object, ...], moderngl.Program] = {}
        self._copy = load_program(context, "screen.vert", "copy_result.frag")
        shares = reflectance_table()
        table = np.concatenate([np.pad(shares, ((0, 0), (0, 0), (0, 1))), lobe_table()])
        self._reflectance = context.texture(table.shape[1::-1], 4, table.tobytes(), dtype="f4")
        self._reflectance.repeat_x = self._reflectance.repeat_y = False

    def draw(
        self,
        targets: Targets,
        stage: Stage,
        buffers: Buffers,
        shot: Shot,
        layers: LayerStore,
        *,
        mirrors: Sequence[tuple[np.ndarray, Targets]] = (),
        shining: bool = True,
    ) -> None:
        """Everything but glass. mirrors: planes, and the images that they show. shining: whether what emits
        light is seen to."""
        targets.begin_shading()
        for i, (_, image) in enumerate(mirrors):
            image.use_mirror(11 + i)
        context, planar = self._context, len(mirrors)
        planes = np.array([plane for plane, _ in mirrors])

        def draw_part(own: int) -> None:
            program = self._shading(shot.lens.model, stage, GLASS=0, PLANAR=planar, OWN=own)
            set_uniforms(
                program, block_lights=targets.block_lights, shining=float(shining), mirror_planes=planes
            )
            self._shade(program, targets, stage, buffers, shot, layers)

        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = "1"  # always: what is drawn is a mark
        draw_part(0)
        targets.begin_missing()
        context.enable(moderngl.BLEND)
        context.blend_func = moderngl.ONE, moderngl.ONE
        context.depth_func = ">"
        draw_part(1)
        context.depth_func = "<"
        context.enable_only(moderngl.NOTHING)

    def draw_glass(
        self, targets: Targets, stage: Stage, buffers: Buffers, shot: Shot, layers: LayerStore
    ) -> None:
        """Glass over the result so far."""
        context, lens = self._context, shot.lens.model
        marks = self._program("glass_marks.frag", LENS=lens)
        _set_view(marks, targets, shot)
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = "1"
        targets.begin_marks()
        buffers.draw_screen(marks)
        context.depth_func = ">"
        targets.begin_glass()
        program = self._shading(lens, stage, GLASS=1, PLANAR=0, OWN=2)
        set_uniforms(program, block_lights=0, shining=1.0)
        self._shade(program, targets, stage, buffers, shot, layers)
        targets.end_glass()
        buffers.draw_screen(self._copy)
        context.depth_func = "<"
        context.enable_only(moderngl.NOTHING)

    def _shade(
        self,
        program: moderngl.Program,
        targets: Targets,
        stage: Stage,
        buffers: Buffers,
        shot: Shot,
        layers: LayerStore,
    ) -> None:
        _set_view(program, targets, shot)
        _set_surroundings(program, stage, shot)
        camera = stage.view.camera
        set_uniforms(
            program,
            light_count=stage.plan.light_count,
            max_probes=self._quality.probes,
            vignetting=camera.vignetting,
        )
        layers.use(0, 1)
        self._shadows.use(program, stage.plan)
        self._reflectance.use(14)
        buffers.use()
        buffers.draw_screen(program)

    def _shading(self, lens_model: int, stage: Stage, **defines: int) -> moderngl.Program:
        lobes, areas = int(stage.has_lobes), int(stage.has_areas)
        return self._program("shade.frag", LENS=lens_model, LOBES=lobes, AREAS=areas, **defines)

    def _program(self, fragment: str, **defines: int) -> moderngl.Program:
        key = (fragment, *defines.items())
        if key not in self._programs:
            self._programs[key] = load_program(
                self._context, "screen.vert", fragment, GRID=self._grid, **defines
            )
        return self._programs[key]


def _set_view(program: moderngl.Program, targets: Targets, shot: Shot) -> None:
    lens = shot.lens
    set_uniforms(
        program,
        size=targets.size,
        seen=targets.seen,
        focal=lens.focal,
        seen_focal=lens.seen_focal,
        seen_shift=shot.seen_shift,
        shift=shot.shift_px,
        lens_offset=shot.lens_offset,
        k=lens.k,
        axes=lens.rotation.T,
        origin=lens.position,
    )


def _set_surroundings(program: moderngl.Program, stage: Stage, shot: Shot) -> None:
    room, sky, pixel_rad = stage.room, stage.sky, 2.0 / (shot.lens.focal[0] * stage.view.camera.width)
    set_uniforms(
        program,
        ambient_sides=room.sides,
        mean_sides=room.radiance.mean((1, 2)),
        room_half=room.half_m,
        room_centre=room.centre_m,
        sky_level=-1.0 if sky is None else max(float(np.log2(pixel_rad * len(sky) / np.pi)), 0.0),
    )
