"""A few places of a picture, read back from its G-buffer: what is there, before anything is shaded."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from fsid.render.exposure import Shot
from fsid.render.programs import ScreenProgram
from fsid.render.targets import Targets

WIDTH = 64
"""Places along a row of the picture."""


@dataclass(frozen=True, eq=False)
class Overview:
    """count: places asked for. Of those where something was hit, (N,) or (N, 3): surface, its number in the
    table; normal and face_normal, unit, the face's towards the camera; position, metres; all in the world."""

    count: int
    surface: np.ndarray
    normal: np.ndarray
    face_normal: np.ndarray
    position: np.ndarray


class OverviewPass:
    """Draws the places; reads them when asked, so that other passes can be issued in between."""

    def __init__(self, context: moderngl.Context) -> None:
        self._program = ScreenProgram(context, "overview.frag", compute=False)

    def draw(self, targets: Targets) -> None:
        """The places of an image whose G-buffer is drawn."""
        canvas = targets.begin_overview(WIDTH)
        self._program.set(places=canvas.size)
        self._program.draw(canvas)

    def read(self, targets: Targets, shot: Shot) -> Overview:
        """What was drawn; waits for it."""
        at, code = targets.read_overview()
        hit = code[:, 2] > 0
        at, code, lens = at[hit], code[hit], shot.lens
        x, y = ((at * 2 - 1 - shot.seen_shift) / lens.seen_focal).T
        ray = np.column_stack([x, -y, np.ones(len(at))]) @ lens.rotation
        depth = code[:, 3].view(np.float32)[:, None].astype(float)
        return Overview(
            count=len(hit),
            surface=code[:, 2].astype(np.int64) - 1,
            normal=_direction(code[:, 0]),
            face_normal=_direction(code[:, 1]),
            position=ray * depth + lens.position,
        )


def _direction(code: np.ndarray) -> np.ndarray:
    """unpack_direction of shaders/encoding.glsl."""
    p = np.maximum(code.astype("<u4").view("<i2").reshape(-1, 2) / 32767.0, -1.0)
    z = 1 - np.abs(p).sum(1)
    folded = (1 - np.abs(p[:, ::-1])) * np.where(p >= 0, 1.0, -1.0)
    n = np.column_stack([np.where(z[:, None] < 0, folded, p), z])
    return np.asarray(n / np.linalg.norm(n, axis=1, keepdims=True))
