"""The G-buffer: surface, normals and depth of every sample, nearest drawables first."""

from __future__ import annotations

import moderngl
import numpy as np

from fsid.render.buffers import Buffers
from fsid.render.camera import NEAR_M
from fsid.render.exposure import Shot
from fsid.render.frustum import in_view
from fsid.render.geometry import draw_commands
from fsid.render.programs import load_program, set_uniforms
from fsid.render.stage import Stage
from fsid.render.targets import Targets

_CLIP_DISTANCE0 = 0x3000
_ALL = np.array([0.0, 0.0, 0.0, -1.0])


class SamplePass:
    """One indirect draw of all that is in view."""

    def __init__(self, context: moderngl.Context) -> None:
        self._context = context
        self._visible = load_program(context, "visible.vert", "visible.frag")

    def draw(
        self, targets: Targets, stage: Stage, buffers: Buffers, shot: Shot, *, kept: np.ndarray = _ALL
    ) -> None:
        """Everything that is not glass. kept: (4,) plane, normal and offset; what is behind is cut off."""
        self._draw(targets, stage, buffers, shot, _nearest_first(stage, shot), 0, kept)

    def draw_glass(self, targets: Targets, stage: Stage, buffers: Buffers, shot: Shot) -> None:
        """Glass alone, in front of what `draw` has drawn."""
        seen = _nearest_first(stage, shot)
        self._draw(targets, stage, buffers, shot, seen[stage.glass[seen]], 1, _ALL)

    def _draw(
        self,
        targets: Targets,
        stage: Stage,
        buffers: Buffers,
        shot: Shot,
        which: np.ndarray,
        layer: int,
        kept: np.ndarray,
    ) -> None:
        """layer: 0 of what is opaque, 1 of glass in front of that; shaders/visible.frag drops the other."""
        lens = shot.lens
        set_uniforms(
            self._visible,
            origin=lens.position,
            axes=lens.rotation.T,
            focal=(lens.seen_focal[0], -lens.seen_focal[1]),
            shift=shot.seen_shift,
            near=NEAR_M,
            layer=layer,
            kept=kept,
        )
        self._context.enable_only(moderngl.DEPTH_TEST)
        targets.begin_samples(over=layer == 1)
        self._context.enable_direct(_CLIP_DISTANCE0)
        buffers.draw(buffers.vertex_array(self._visible), draw_commands(stage.geometry.ranges, which))
        self._context.disable_direct(_CLIP_DISTANCE0)


def _nearest_first(stage: Stage, shot: Shot) -> np.ndarray:
    """Numbers of the drawables in view: what is drawn early hides what comes later at no cost."""
    lens, spheres = shot.lens, stage.geometry.spheres
    right, up = ((1 + abs(s)) / f for s, f in zip(shot.seen_shift, lens.seen_focal, strict=True))
    seen = np.flatnonzero(in_view(spheres, lens.position, lens.rotation, (right, up)))
    distance = np.linalg.norm(spheres[seen, :3] - lens.position, axis=1) - spheres[seen, 3]
    return np.asarray(seen[np.argsort(distance, kind="stable")])
