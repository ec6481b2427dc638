"""Pinhole camera: world -> camera -> clip.

    camera space   (x, y, z) = R (x_world - position): right, up, forward (the frame's normals turn z back)
    clip           (f_x x, -f_y y, z - 2 near, z)

y is negated so that row 0 of every image is the top. The far plane is at infinity: window depth is
1 - near / distance, which is linear in 1 / distance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fsid.errors import FsidError
from fsid.scene.model import Camera

NEAR_M = 0.02


@dataclass(frozen=True)
class Lens:
    """rotation: (3, 3), rows right, up, forward. position: (3,) metres. focal: x, y in half sizes."""

    rotation: np.ndarray
    position: np.ndarray
    focal: tuple[float, float]


def lens_of(camera: Camera) -> Lens:
    """Rotation, position and focal lengths of a camera. Raises FsidError for a degenerate one."""
    position = np.array(camera.position_m, dtype=float)
    forward = np.array(camera.target_m, dtype=float) - position
    right = np.cross(forward, np.array(camera.up, dtype=float))
    if not np.linalg.norm(right) > 1e-9 * np.linalg.norm(forward):
        raise FsidError(
            "scene.cameras: target_m must differ from position_m, and up must not point along the view"
        )
    if not 0 < camera.fov_deg < 175:
        raise FsidError(f"scene.cameras: fov_deg = {camera.fov_deg}: must be between 0 and 175")
    forward /= np.linalg.norm(forward)
    right /= np.linalg.norm(right)
    focal_x = 1.0 / np.tan(np.radians(camera.fov_deg) / 2)
    focal = (float(focal_x), float(focal_x * camera.width / camera.height))
    return Lens(np.stack([right, np.cross(right, forward), forward]), position, focal)
