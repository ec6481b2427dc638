"""What a shutter and a lens opening gather: the mean of sharp images at fixed times and places on the lens.

    radiance = 1 / N sum_i image(t_i, lens place_i)

The times are evenly spaced and the places lie on a spiral, alike for every pixel: no noise. N follows the
widest blur in the image, so that neighbouring images are at most STEP_PX (of movement) or LENS_STEP_PX (of
defocus) apart, up to a limit. Every place stands for a part of the lens, an opening 1 / sqrt(N) as wide,
whose blur its image is given (`fsid.render.defocus`): few places are enough, and one alone makes a picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np

from fsid.render.camera import NEAR_M, Lens, lens_of
from fsid.render.drawable import UNMOVED, Drawable
from fsid.render.flow import flow_between
from fsid.render.frame import Frame
from fsid.render.quality import spiral
from fsid.scene.model import ZERO, Camera

STEP_PX = 1.5
LENS_STEP_PX = 4.0
_FEWEST = 4
_STRAIGHT_DEG = 30.0
"""What turns by less is measured as if it moved straight on."""
_MOST_PARTS = 32
"""Of the exposure, in which paths are followed."""
_TIME_STEP = (
    0.7320508  # of the exposure; the golden ratio is what the spiral turns by, and would go around once
)


@dataclass(frozen=True)
class Shot:
    """One image. shift_px: of the image. lens_offset: of the rays, place on the lens / focus_m.

    aperture_m: diameter of the part of the lens that it stands for.
    """

    lens: Lens
    time_s: float
    shift_px: tuple[float, float] = (0.0, 0.0)
    lens_offset: tuple[float, float] = (0.0, 0.0)
    aperture_m: float = 0.0

    @property
    def seen_shift(self) -> tuple[float, float]:
        """Shift of the G-buffer that keeps its samples on those of the image, half image sizes."""
        (x, y), focal, size = self.shift_px, self.lens.seen_focal, self.lens.seen_px
        a, b = self.lens_offset
        return (2 * x / size[0] + a * focal[0], 2 * y / size[1] - b * focal[1])


def shots_of(
    camera: Camera,
    drawables: Sequence[Drawable],
    frame: Frame,
    middle: Shot,
    sample: float,
    most: int,
    most_places: int,
) -> list[Shot]:
    """The images to average; none where the camera's image is sharp. frame: that of the shot `middle`.

    most: images. most_places: places on the lens; 1 is its middle.
    """
    moving = is_moving(camera, drawables)
    count = 0
    if camera.aperture_m > 0:
        across = _blur_px(camera, middle.lens, frame) / LENS_STEP_PX
        count = min(round(np.pi / 4 * across * across) + 1, most_places)
    if moving:
        steps = round(_motion_px(camera, drawables, frame, sample, most * STEP_PX) / STEP_PX) + 1
        count = int(np.clip(max(count, steps), _FEWEST, most))
    if count == 0:
        return []
    places = spiral(count) * camera.aperture_m / 2
    part_m = camera.aperture_m / np.sqrt(count)
    order = np.argsort((np.arange(count) * _TIME_STEP) % 1.0, kind="stable")
    shots = []
    for i, (right, up) in enumerate(places[order]):
        since = ((i + 0.5) / count - 0.5) * camera.exposure_s if moving else 0.0
        lens = lens_of(camera, camera.time_s + since)
        offset = (float(right / camera.focus_m), float(up / camera.focus_m))
        position = lens.position + right * lens.rotation[0] + up * lens.rotation[1]
        moved = Lens(lens.rotation, position, lens.focal, lens.seen_px, lens.seen_focal, lens.model, lens.k)
        shots.append(Shot(moved, camera.time_s + since, middle.shift_px, offset, part_m))
    return shots


def is_moving(camera: Camera, drawables: Sequence[Drawable]) -> bool:
    """Whether anything moves while the shutter is open."""
    return camera.exposure_s > 0 and (
        camera.velocity_m_s != ZERO
        or camera.spin_deg_s != ZERO
        or any(drawable.motion != UNMOVED for drawable in drawables)
    )


def _motion_px(
    camera: Camera, drawables: Sequence[Drawable], frame: Frame, sample: float, enough_px: float
) -> float:
    """How far the fastest thing moves in the image during the exposure, be it small: along its path, which
    may lead back to where it began. What is more than `enough_px` need not be exact."""
    moving = [drawable for drawable in drawables if drawable.motion != UNMOVED]
    spins = [camera.spin_deg_s, *(drawable.motion.spin_deg_s for drawable in moving)]
    turn_deg = float(np.linalg.norm(spins, axis=1).max()) * camera.exposure_s
    middle = (camera, lens_of(camera), camera.time_s)
    flows = (
        flow_between(frame, drawables, middle, (camera, lens_of(camera, time_s), time_s), sample)
        for time_s in _times(camera, min(1 + int(turn_deg / _STRAIGHT_DEG), _MOST_PARTS))
    )
    length = np.zeros(frame.depth.shape, np.float32)
    for before, after in pairwise(flows):
        length += np.linalg.norm(after - before, axis=-1)
        if np.isfinite(length).any() and np.nanquantile(length, 0.999) > enough_px:
            break
    lengths = [length]
    for drawable in moving:
        own = length[frame.object_id == drawable.object_id]
        lengths.append(own if np.isfinite(own).any() else _unseen_motion_px(camera, drawable))
    return max((float(np.nanquantile(own, 0.999)) for own in lengths if np.isfinite(own).any()), default=0.0)


def _unseen_motion_px(camera: Camera, drawable: Drawable) -> np.ndarray:
    """How far the corners of a thing's box would move at the speed that they have at each time, NaN where the
    picture does not reach: of a thing that the middle of the exposure does not show."""
    vertices = drawable.mesh.vertices * np.array(drawable.transform.scale)
    corners = np.array(list(product(*zip(vertices.min(0), vertices.max(0), strict=True))))
    reach, pinhole = 1 / np.array(lens_of(camera).seen_focal), replace(camera, distortion=None)
    places = []
    for time_s in _times(camera, _MOST_PARTS):
        lens, (rotation, position) = lens_of(pinhole, time_s), drawable.pose(time_s)
        local = (corners @ rotation.T + position - lens.position) @ lens.rotation.T
        local[local[:, 2] < NEAR_M] = np.nan
        image = local[:, :2] / local[:, 2:]
        inside = (np.fmin.reduce(image) < reach) & (np.fmax.reduce(image) > -reach)
        half_px = np.array(lens.focal) * (camera.width / 2, camera.height / 2)
        places.append(np.where(inside.all(), image * half_px, np.nan))
    return np.asarray(np.linalg.norm(np.diff(places, axis=0), axis=-1) * _MOST_PARTS)


def _times(camera: Camera, parts: int) -> np.ndarray:
    """(parts + 1,) from the start to the end of the exposure, seconds."""
    return np.asarray(camera.time_s + camera.exposure_s * np.linspace(-0.5, 0.5, parts + 1))


def _blur_px(camera: Camera, lens: Lens, frame: Frame) -> float:
    """Diameter of the widest circle of confusion, pixels."""
    nearness = np.abs(1 / camera.focus_m - 1 / frame.depth.astype(float))
    return float(np.quantile(nearness, 0.999) * camera.aperture_m * lens.focal[0] * camera.width / 2)
