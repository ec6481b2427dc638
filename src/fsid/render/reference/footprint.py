"""Pixel footprints on surfaces: how far a point moves on its tangent plane per pixel (Igehy 1999).

P = t D,  n . P = const   =>   dP/dx = t (dD/dx - D (n . dD/dx) / (n . D))
"""

from __future__ import annotations

import numpy as np

from fsid.render.reference.dicing import NEAR_M, View

_STEEPEST = 0.04
"""Smallest cosine between ray and normal; flatter views would have footprints without end."""


def footprints(points: np.ndarray, normals: np.ndarray, view: View) -> tuple[np.ndarray, np.ndarray]:
    """((N, 3), (N, 3)) world metres per pixel to the right and per pixel down; `points` world, metres."""
    local, n = view.local(points), normals @ view.rotation.T
    depth = np.maximum(np.abs(local[:, 2]), NEAR_M)
    ray = local / depth[:, None]
    cosine = (n * ray).sum(1)
    least = _STEEPEST * np.linalg.norm(ray, axis=1)
    cosine = np.where(np.abs(cosine) < least, np.where(cosine < 0, -least, least), cosine)
    out = []
    for axis, sign in ((0, 1.0), (1, -1.0)):
        step = np.zeros_like(local)
        step[:, axis] = sign / view.focal_px
        along = depth[:, None] * (step - ray * ((n * step).sum(1) / cosine)[:, None])
        out.append(along @ view.rotation)
    return out[0], out[1]
