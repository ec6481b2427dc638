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
from fsid.scene.model import Camera, Distortion

NEAR_M = 0.02
MODELS = {"brown-conrady": (1, 5), "fisheye": (2, 4)}
"""Distortion model -> its number in shaders/lens.glsl and how many coefficients it has."""

_WIDEST_TANGENT = 6.0
_MOST_PIXELS = 3.0
_MAX_SOFTNESS_PX = 50.0
_MAX_SHARPENING = 5.0
_MAX_COLOUR_CONTRAST = 0.5
_MAX_FRINGE = 0.05


@dataclass(frozen=True)
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
    focal_x = 1.0 / np.tan(np.radians(camera.fov_deg) / 2)
    focal = (float(focal_x), float(focal_x * camera.width / camera.height))
    if camera.distortion is None:
        return Lens(rotation, position, focal, (camera.width, camera.height), focal, 0, (0.0,) * 5)
    return _bent(camera, camera.distortion, rotation, position, focal)


def distorted(distortion: Distortion | None, points: np.ndarray) -> np.ndarray:
    """(..., 2) distorted image coordinates of pinhole ones (x right, y down); OpenCV's formulas."""
    if distortion is None:
        return points
    x, y = points[..., 0], points[..., 1]
    r2 = x * x + y * y
    if distortion.model == "fisheye":
        r = np.sqrt(r2)
        theta = np.arctan(r)
        t2 = theta * theta
        k = distortion.coefficients
        bent = theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))))
        return points * np.where(r > 1e-12, bent / np.maximum(r, 1e-12), 1.0)[..., None]
    k1, k2, p1, p2, k3 = distortion.coefficients
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return np.stack(
        [
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        ],
        axis=-1,
    )


def undistorted(distortion: Distortion | None, points: np.ndarray) -> np.ndarray:
    """The inverse of `distorted` (Newton's method). FsidError where the lens cannot be inverted there."""
    if distortion is None:
        return points
    _check_model(distortion)
    if distortion.model == "fisheye":
        return _undistorted_fisheye(distortion, points)
    p, step = points.astype(float), 1e-6
    right, down = np.array([step, 0.0]), np.array([0.0, step])
    for _ in range(30):
        f = distorted(distortion, p)
        dx = (distorted(distortion, p + right) - distorted(distortion, p - right)) / (2 * step)
        dy = (distorted(distortion, p + down) - distorted(distortion, p - down)) / (2 * step)
        determinant = dx[..., 0] * dy[..., 1] - dx[..., 1] * dy[..., 0]
        if not (determinant > 0.02).all():
            raise _not_invertible()
        e = points - f
        p = p + np.stack(
            [
                (e[..., 0] * dy[..., 1] - e[..., 1] * dy[..., 0]) / determinant,
                (dx[..., 0] * e[..., 1] - dx[..., 1] * e[..., 0]) / determinant,
            ],
            axis=-1,
        )
    if not np.abs(distorted(distortion, p) - points).max() < 1e-8:
        raise _not_invertible()
    return p


def _undistorted_fisheye(distortion: Distortion, points: np.ndarray) -> np.ndarray:
    wanted = np.linalg.norm(points, axis=-1)
    k1, k2, k3, k4 = distortion.coefficients
    theta = np.minimum(wanted, 1.4)
    for _ in range(30):
        t2 = theta * theta
        value = theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
        growth = 1 + t2 * (3 * k1 + t2 * (5 * k2 + t2 * (7 * k3 + t2 * 9 * k4)))
        if not (growth > 0.02).all():
            raise _not_invertible()
        theta = theta - (value - wanted) / growth
    if not (np.abs(value - wanted).max() < 1e-8 and theta.max() < np.arctan(_WIDEST_TANGENT)):
        raise _not_invertible()
    return points * np.where(wanted > 1e-12, np.tan(theta) / np.maximum(wanted, 1e-12), 1.0)[..., None]


def _not_invertible() -> FsidError:
    return FsidError(
        "scene.cameras: distortion: these coefficients fold the image or reach beyond 160 degrees; "
        "use smaller ones or a smaller fov_deg"
    )


def _check_model(distortion: Distortion) -> None:
    if distortion.model not in MODELS:
        raise FsidError(
            f"scene.cameras: distortion.model '{distortion.model}': use 'brown-conrady' or 'fisheye'"
        )
    count = MODELS[distortion.model][1]
    if len(distortion.coefficients) != count:
        raise FsidError(f"scene.cameras: distortion '{distortion.model}' needs {count} coefficients")


def _bent(
    camera: Camera,
    distortion: Distortion,
    rotation: np.ndarray,
    position: np.ndarray,
    focal: tuple[float, float],
) -> Lens:
    """The pinhole image covers all rays of the bent one, at its finest resolution."""
    widest = 1.0 + 2.0 / min(camera.width, camera.height)
    t = np.linspace(-widest, widest, 65)
    image = np.stack(np.meshgrid(t, t), axis=-1) / np.array(focal)
    rays = undistorted(distortion, image)
    low, high = rays.reshape(-1, 2).min(0), rays.reshape(-1, 2).max(0)
    half = np.maximum(np.abs(low), np.abs(high)) * 1.001
    if half.max() > _WIDEST_TANGENT:
        raise _not_invertible()
    finest = np.abs(np.diff(image[32, :, 0])).max() / np.abs(np.diff(rays, axis=1)[..., 0]).min()
    size = np.array([camera.width, camera.height])
    pixels = half * np.array(focal) * size * min(finest, 1.5)
    pixels = np.minimum(np.ceil(pixels / 2) * 2, np.ceil(size * _MOST_PIXELS / 2) * 2)
    seen_px = (int(pixels[0]), int(pixels[1]))
    seen_focal = (float(1 / half[0]), float(1 / half[1]))
    given = distortion.coefficients
    k = (*given, *(0.0,) * (5 - len(given)))
    return Lens(rotation, position, focal, seen_px, seen_focal, MODELS[distortion.model][0], k)
