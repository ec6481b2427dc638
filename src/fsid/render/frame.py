"""What a renderer returns: linear light and the geometry behind it, pixel by pixel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Frame:
    """One camera's image of a scene; row 0 is the top. All arrays float32 unless stated.

    radiance: (H, W, 3) linear sRGB primaries, scene-referred, >= 0, unbounded, noise-free.
    albedo: (H, W, 3) linear, 0..1; 0 where nothing was hit. normal: (H, W, 3) unit, camera space (x right, y
    up, z to the viewer); (0, 0, 1) where nothing was hit.
    depth: (H, W) metres along the viewing axis, inf where nothing was hit.
    object_id: (H, W) int32, index into `scene.objects`; -1 is the background, lamp panels and the sky.
    flow: (H, W, 2) pixels right and down from where a surface point is seen here to where the other camera
    that was asked for sees it (also where it is hidden there); NaN where nothing was hit, or it lies behind
    that camera or beyond what its lens has an image of. None where no other camera was named.
    The labels (all but radiance) are those of the middle of the exposure and of the sharp image, and of the
    first surface: of glass and of mirrors their own.
    """

    radiance: np.ndarray
    albedo: np.ndarray
    normal: np.ndarray
    depth: np.ndarray
    object_id: np.ndarray
    flow: np.ndarray | None = None
