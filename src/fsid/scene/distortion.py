"""Distortion of image coordinates, its inverse, and the rays that an image needs.

A scene draws no lens, and a renderer accepts none, for which `rays_of` finds no rays.
"""

from __future__ import annotations

import numpy as np

from fsid.errors import FsidError
from fsid.scene.model import Camera, Distortion

MODELS = {"brown-conrady": 5, "fisheye": 4}
"""Distortion model -> number of its coefficients."""

_WIDEST_TANGENT = 6.0


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


def fold_radius(distortion: Distortion | None) -> float:
    """Pinhole radius up to which the distorted one grows; what lies beyond the polynomial folds back."""
    if distortion is None:
        return float("inf")
    fisheye = distortion.model == "fisheye"
    k = distortion.coefficients if fisheye else (*distortion.coefficients[:2], distortion.coefficients[4])
    slope = [1.0, *((2 * i + 1) * value for i, value in enumerate(k, 1))]  # in radius^2, or angle^2
    folds = [root.real for root in np.roots(slope[::-1]) if abs(root.imag) < 1e-9 and root.real > 0]
    first = float(np.sqrt(min(folds, default=np.inf)))
    if fisheye:
        return float(np.tan(first)) if first < np.pi / 2 else float("inf")
    return first


def undistorted(distortion: Distortion | None, points: np.ndarray) -> np.ndarray:
    """The inverse of `distorted` (Newton's method). FsidError where the lens cannot be inverted there."""
    if distortion is None:
        return points
    check_model(distortion)
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


def check_model(distortion: Distortion) -> None:
    """FsidError unless the model is one of MODELS and has its number of coefficients."""
    if distortion.model not in MODELS:
        raise FsidError(
            f"scene.cameras: distortion model '{distortion.model}' does not exist; "
            f"choose one of: {', '.join(MODELS)}"
        )
    count, given = MODELS[distortion.model], len(distortion.coefficients)
    if given != count:
        raise FsidError(
            f"scene.cameras: distortion {distortion.model} needs {count} coefficients, not {given}"
        )


def focal_of(camera: Camera) -> tuple[float, float]:
    """Focal length in half widths and half heights of the image."""
    focal = 1.0 / np.tan(np.radians(camera.fov_deg) / 2)
    return float(focal), float(focal * camera.width / camera.height)


def rays_of(distortion: Distortion, camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Image coordinates on a grid over the image of `camera` and a pixel beyond, (65, 65, 2), pinhole ones of
    the same points, and the half size (2,) that covers these. FsidError where the lens has no inverse there.
    """
    widest = 1.0 + 2.0 / min(camera.width, camera.height)
    t = np.linspace(-widest, widest, 65)
    image = np.stack(np.meshgrid(t, t), axis=-1) / np.array(focal_of(camera))
    rays = undistorted(distortion, image)
    low, high = rays.reshape(-1, 2).min(0), rays.reshape(-1, 2).max(0)
    half = np.maximum(np.abs(low), np.abs(high)) * 1.001
    if half.max() > _WIDEST_TANGENT:
        raise _not_invertible()
    return image, rays, half


def stretch_of(distortion: Distortion, camera: Camera) -> np.ndarray:
    """(H, W) float32: how much longer the lens shows a short line around each pixel than a pinhole would, the
    geometric mean along and across. FsidError as `rays_of`."""
    image, rays, _ = rays_of(distortion, camera)
    shown, straight = (
        np.linalg.det(np.stack(np.gradient(points, axis=(1, 0)), axis=-1)) for points in (image, rays)
    )
    width, height = camera.width, camera.height
    focal_x, focal_y = focal_of(camera)
    rows = _between_lines(image[:, 0, 1], ((np.arange(height) + 0.5) / height * 2 - 1) / focal_y)
    columns = _between_lines(image[0, :, 0], ((np.arange(width) + 0.5) / width * 2 - 1) / focal_x)
    return (rows @ np.sqrt(shown / straight) @ columns.T).astype(np.float32)


def _between_lines(lines: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(P, N) shares of N ascending lines in what is interpolated at P places between them."""
    at = np.interp(places, lines, np.arange(len(lines)))
    return np.maximum(1 - np.abs(at[:, None] - np.arange(len(lines))), 0.0)
