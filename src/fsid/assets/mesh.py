"""A triangle mesh with named material parts: what every source of geometry is turned into.

World convention of all of FSID: right-handed, z up, metres. An object stands on z = 0 with the centre
of its footprint at the origin, so that a transform places it without knowing what it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with one normal per vertex; hard edges are vertices that appear twice.

    vertices: (V, 3) float32, metres. normals: (V, 3) float32, unit length, outward.
    faces: (F, 3) int32, counter-clockwise seen from outside.
    face_parts: (F,) int32, index into `part_names`.
    """

    vertices: np.ndarray
    normals: np.ndarray
    faces: np.ndarray
    face_parts: np.ndarray
    part_names: tuple[str, ...]
