"""Optical flow, exactly: a pixel's surface point is moved as its object moves and seen by the other camera.

    x1 = R1 R0^T (x0 - p0) + p1          R, p: rotation and position of the object at both times
    flow = image1(x1) - image0(x0)

The point of a pixel is that of its labels, so depth, object id and flow agree in every pixel.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fsid.render.camera import Lens
from fsid.render.drawable import UNMOVED, Drawable
from fsid.render.frame import Frame
from fsid.scene.distortion import distorted, fold_radius, undistorted
from fsid.scene.model import Camera


def flow_between(
    frame: Frame,
    drawables: Sequence[Drawable],
    here: tuple[Camera, Lens, float],
    there: tuple[Camera, Lens, float],
    sample: float,
) -> np.ndarray:
    """(H, W, 2) float32 pixels right and down; NaN where nothing was hit, or where it lies behind the other
    camera or beyond what its lens has an image of.

    here, there: camera, lens and time of both images. sample: place of the labels' sample in a pixel, 0..1.
    """
    camera, lens, time_s = here
    other, other_lens, other_time_s = there
    x, y = np.meshgrid(np.arange(camera.width) + sample, np.arange(camera.height) + sample)
    seen = np.stack([x, y], axis=-1)
    half = np.array([camera.width, camera.height]) / 2
    rays = undistorted(camera.distortion, (seen / half - 1) / lens.focal)
    hit = np.isfinite(frame.depth)
    depth = np.where(hit, frame.depth, 1.0).astype(float)
    local = np.stack([rays[..., 0] * depth, -rays[..., 1] * depth, depth], axis=-1)
    points = local @ lens.rotation + lens.position
    objects = {drawable.object_id: drawable for drawable in drawables}  # of one object alike
    for number, drawable in objects.items():
        if drawable.motion != UNMOVED and time_s != other_time_s:
            own = frame.object_id == number
            points[own] = _moved(drawable, points[own], time_s, other_time_s)
    local = (points - other_lens.position) @ other_lens.rotation.T
    hit &= local[..., 2] > 1e-6
    ahead = np.where(hit, local[..., 2], 1.0)
    image = np.stack([local[..., 0] / ahead, -local[..., 1] / ahead], axis=-1)
    hit &= np.linalg.norm(image, axis=-1) < fold_radius(other.distortion)
    half = np.array([other.width, other.height]) / 2
    moved = (distorted(other.distortion, image) * other_lens.focal + 1) * half
    return np.where(hit[..., None], moved - seen, np.nan).astype(np.float32)


def _moved(drawable: Drawable, points: np.ndarray, time_s: float, other_time_s: float) -> np.ndarray:
    rotation, position = drawable.pose(time_s)
    rotation1, position1 = drawable.pose(other_time_s)
    return np.asarray((points - position) @ (rotation1 @ rotation.T).T + position1)
