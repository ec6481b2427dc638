"""Shading: materials and radiance of each pixel, once per surface in it; glass over it in a second round.

Most pixels find their shadows between those of the blocks. Lights whose shadow must be found in the pixel
itself are drawn after the rest, where the rest has left a mark, and glass only where there is some: on a CPU
every pixel pays for all that a shader can do.

What a scene does not have costs nothing on a CPU: a program is compiled for each combination of lens, layers,
area lights, glass and mirrors that occurs. Compilers of GPUs take seconds for each, so there one does it all.
"""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from fsid.render.buffers import Buffers
from fsid.render.canvas import Canvas
from fsid.render.exposure import Shot
from fsid.render.layers import LayerStore
from fsid.render.mirror import MOST
from fsid.render.programs import ScreenProgram
from fsid.render.quality import Quality
from fsid.render.reflectance import lobe_table, reflectance_table
from fsid.render.shadow_pass import ShadowPass
from fsid.render.stage import Stage
from fsid.render.targets import Targets


class ShadePass:
    """Owns the programs and the table of what GGX reflects. grid, compute: as in `Targets`."""

    def __init__(
        self, context: moderngl.Context, quality: Quality, grid: int, shadows: ShadowPass, *, compute: bool
    ) -> None:
        self._context = context
        self._compute = compute
        self._quality = quality
        self._grid = grid
        self._shadows = shadows
        self._programs: dict[tuple[object, ...], ScreenProgram] = {}
        self._copy = ScreenProgram(context, "copy_result.frag", compute=compute, marks=2)
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
        """Everything but glass. mirrors: planes, and the images that they show. shining: whether objects
        and panels that shine are seen to; walls always are."""
        for i in range(MOST):
            self._reflectance.use(11 + i)  # any image will do where there is no mirror, but none will not
        for i, (_, image) in enumerate(mirrors):
            image.use_mirror(11 + i)
        planar = MOST if self._compute else len(mirrors)
        planes = np.zeros((planar, 4))  # no surface lies in a plane without normal
        for own_plane, (plane, _) in zip(planes, mirrors, strict=False):
            own_plane[:] = plane
        for own, canvas in enumerate((targets.begin_shading(), targets.begin_missing())):
            program = self._shading(
                shot.lens.model, stage, marks=1 + own, adds=own == 1, GLASS=0, PLANAR=planar, OWN=own
            )
            program.set(block_lights=targets.block_lights, shining=float(shining), mirror_planes=planes)
            self._shade(program, canvas, targets, stage, buffers, shot, layers)

    def draw_glass(
        self, targets: Targets, stage: Stage, buffers: Buffers, shot: Shot, layers: LayerStore
    ) -> None:
        """Glass over the result so far."""
        lens = shot.lens.model
        marks = self._program("glass_marks.frag", marks=1, LENS=lens)
        _set_view(marks, targets, shot)
        marks.draw(targets.begin_marks())
        program = self._shading(lens, stage, marks=2, GLASS=1, PLANAR=0, OWN=2)
        program.set(block_lights=0, shining=1.0)
        self._shade(program, targets.begin_glass(), targets, stage, buffers, shot, layers)
        self._copy.draw(targets.end_glass())

    def _shade(
        self,
        program: ScreenProgram,
        canvas: Canvas,
        targets: Targets,
        stage: Stage,
        buffers: Buffers,
        shot: Shot,
        layers: LayerStore,
    ) -> None:
        _set_view(program, targets, shot)
        _set_surroundings(program, stage, shot)
        camera = stage.view.camera
        program.set(
            light_count=stage.plan.light_count,
            max_probes=self._quality.probes,
            vignetting=camera.vignetting,
        )
        layers.use(8, 9)
        self._shadows.use(program, stage.plan)
        self._reflectance.use(14)
        buffers.use()
        program.draw(canvas)

    def _shading(
        self, lens_model: int, stage: Stage, *, marks: int, adds: bool = False, **defines: int
    ) -> ScreenProgram:
        if self._compute:
            found = {"LOBES": 1, "AREAS": 1}
        else:
            found = {"LOBES": int(stage.has_lobes), "AREAS": int(stage.has_areas)}
        return self._program("shade.frag", marks=marks, adds=adds, LENS=lens_model, **defines, **found)

    def _program(self, source: str, *, marks: int, adds: bool = False, **defines: int) -> ScreenProgram:
        key = (source, marks, adds, *defines.items())
        if key not in self._programs:
            self._programs[key] = ScreenProgram(
                self._context,
                source,
                compute=self._compute,
                marks=marks,
                adds=adds,
                GRID=self._grid,
                **defines,
            )
        return self._programs[key]


def _set_view(program: ScreenProgram, targets: Targets, shot: Shot) -> None:
    lens = shot.lens
    program.set(
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


def _set_surroundings(program: ScreenProgram, stage: Stage, shot: Shot) -> None:
    room, sky, pixel_rad = stage.room, stage.sky, 2.0 / (shot.lens.focal[0] * stage.view.camera.width)
    program.set(
        ambient_even=(room.ambient[0::2] + room.ambient[1::2]) / 2,
        ambient_odd=(room.ambient[0::2] - room.ambient[1::2]) / 2,
        mean_sides=room.radiance.mean((1, 2)),
        room_half=room.half_m,
        room_centre=room.centre_m,
        sunless=stage.sunless,
        sky_level=-1.0 if sky is None else max(float(np.log2(pixel_rad * len(sky) / np.pi)), 0.0),
    )
