"""Camera: world -> camera -> clip, and the lens that bends the image.

    camera space   (x, y, z) = R (x_world - position): right, up, forward (the frame's normals turn z back)
    clip           (f_x x, -f_y y, z - 2 near, z)
    lens           image coordinates = distortion(x / z, -y / z), y down, as `scene.model.Distortion` says

y is negated so that row 0 of every image is the top. The far plane is at infinity: window depth is
1 - near / distance, which is linear in 1 / distance. A bent image looks its samples up in a pinhole image of
the same place, wide and fine enough for every pixel, and meets the surfaces found there with its own rays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fsid.errors import FsidError
from fsid.render.drawable import turn_about
from fsid.scene.distortion import focal_of, rays_of
from fsid.scene.model import Camera, Distortion

NEAR_M = 0.02
_SHADER_MODELS = {"brown-conrady": 1, "fisheye": 2}
"""Distortion model -> its number in shaders/lens.glsl."""

_MOST_PIXELS = 3.0
_MAX_SOFTNESS_PX = 50.0
_MAX_SHARPENING = 5.0
_MAX_COLOUR_CONTRAST = 0.5
_MAX_FRINGE = 0.05


@dataclass(frozen=True, eq=False)
class Lens:
    """rotation: (3, 3), rows right, up, forward. position: (3,) metres. focal: x, y in half sizes.

    seen_px, seen_focal: of the pinhole image in which a bent one looks things up; without distortion the
    image's own. model, k: number of the distortion model (0 none) and its coefficients.
    """

    rotation: np.ndarray
    position: np.ndarray
    focal: tuple[float, float]
    seen_px: tuple[int, int]
    seen_focal: tuple[float, float]
    model: int
    k: tuple[float, ...]


def lens_of(camera: Camera, time_s: float | None = None) -> Lens:
    """The lens of a camera at a time; None: the middle of its exposure. FsidError for a degenerate one."""
    position = np.array(camera.position_m, dtype=float)
    forward = np.array(camera.target_m, dtype=float) - position
    right = np.cross(forward, np.array(camera.up, dtype=float))
    if not np.linalg.norm(right) > 1e-9 * np.linalg.norm(forward):
        raise FsidError(
            "scene.cameras: target_m must differ from position_m, and up must not point along the view"
        )
    if not 0 < camera.fov_deg < 175:
        raise FsidError(f"scene.cameras: fov_deg = {camera.fov_deg}: must be between 0 and 175")
    if not (camera.exposure_s >= 0 and camera.aperture_m >= 0 and camera.focus_m > 0):
        raise FsidError("scene.cameras: exposure_s and aperture_m must be 0 or more, focus_m more than 0")
    if not 0 <= camera.softness_px <= _MAX_SOFTNESS_PX:
        raise FsidError(f"scene.cameras: softness_px {camera.softness_px}: must be 0 .. {_MAX_SOFTNESS_PX:g}")
    if not 0 <= camera.sharpening <= _MAX_SHARPENING:
        raise FsidError(f"scene.cameras: sharpening {camera.sharpening}: must be 0 .. {_MAX_SHARPENING:g}")
    if not all(abs(extra) <= _MAX_COLOUR_CONTRAST for extra in camera.colour_contrast):
        raise FsidError(
            f"scene.cameras: colour_contrast {camera.colour_contrast}: "
            f"must be -{_MAX_COLOUR_CONTRAST:g} .. {_MAX_COLOUR_CONTRAST:g}"
        )
    if not all(abs(growth) < _MAX_FRINGE for growth in camera.chromatic_aberration):
        raise FsidError(f"scene.cameras: chromatic_aberration must be within +-{_MAX_FRINGE:g}")
    forward /= np.linalg.norm(forward)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(right, forward), forward])
    since = 0.0 if time_s is None else time_s - camera.time_s
    rotation = rotation @ turn_about(camera.spin_deg_s, since).T
    position = position + np.array(camera.velocity_m_s) * since
    focal = focal_of(camera)
    if camera.distortion is None:
        return Lens(rotation, position, focal, (camera.width, camera.height), focal, 0, (0.0,) * 5)
    return _bent(camera, camera.distortion, rotation, position, focal)


def _bent(
    camera: Camera,
    distortion: Distortion,
    rotation: np.ndarray,
    position: np.ndarray,
    focal: tuple[float, float],
) -> Lens:
    """The pinhole image covers all rays of the bent one, at its finest resolution."""
    image, rays, half = rays_of(distortion, camera)
    finest = np.abs(np.diff(image[32, :, 0])).max() / np.abs(np.diff(rays, axis=1)[..., 0]).min()
    size = np.array([camera.width, camera.height])
    pixels = half * np.array(focal) * size * min(finest, 1.5)
    pixels = np.minimum(np.ceil(pixels / 2) * 2, np.ceil(size * _MOST_PIXELS / 2) * 2)
    seen_px = (int(pixels[0]), int(pixels[1]))
    seen_focal = (float(1 / half[0]), float(1 / half[1]))
    given = distortion.coefficients
    k = (*given, *(0.0,) * (5 - len(given)))
    return Lens(rotation, position, focal, seen_px, seen_focal, _SHADER_MODELS[distortion.model], k)
