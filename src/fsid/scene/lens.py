"""Lenses: distortion that can be inverted over the whole image, blur, dark corners, fringes.

    Brown-Conrady   r_d = r (1 + k1 r^2 + k2 r^4 + k3 r^6),  plus a small decentring (p1, p2)
    fisheye         theta_d = theta (1 + k1 theta^2 + ...),  theta the angle from the axis

A renderer and a user who undistorts both need the inverse, so a distortion counts as sane only where the
radius grows strictly up to beyond the corner of the image: coefficients that fold it over are refused.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fsid.errors import FsidError
from fsid.scene.camera_config import LensConfig
from fsid.scene.choice import log_uniform_rand
from fsid.scene.distortion import check_model, rays_of
from fsid.scene.model import Camera, Distortion

MAX_FISHEYE_DEG = 80.0
"""Angle from the axis in the corner of the image: beyond 90 degrees a plane has no image point."""

_STEPS = 2000
_MIN_SLOPE = 0.1
_DECENTRING = 0.0005


def lens_rand(rng: np.random.Generator, config: LensConfig, camera: Camera, depth_m: float) -> Camera:
    """The camera with a lens of its own; every number is drawn, whatever the shares leave out.

    depth_m: how far away is what it is focused on, give or take.
    """
    distorted, fisheye, blurred, vignetted, fringed, soft = rng.random(6) < (
        config.distortion_share,
        config.fisheye_share,
        config.blur_share,
        config.vignetting_share,
        config.fringe_share,
        config.soft_share,
    )
    displacement, second = rng.uniform(*config.distortion), rng.uniform(-0.3, 0.3)
    decentring = rng.normal(0, _DECENTRING, 2)
    bend = rng.normal(0, 0.02, 4)
    aperture_m, focus = log_uniform_rand(rng, config.aperture_m), rng.uniform(*config.focus)
    loss, power = rng.uniform(*config.vignetting), rng.dirichlet((2.0, 1.0, 0.5))
    fringe = rng.uniform(*config.fringe, 2)
    softness_px = float(rng.uniform(*config.softness_px))
    sharpened, sharpening = rng.random() < config.sharp_share, float(rng.uniform(*config.sharpening))
    contrast = float(rng.uniform(*config.contrast_red)), float(rng.uniform(*config.contrast_blue))
    camera = replace(camera, colour_contrast=contrast)
    if fisheye:
        camera = _fisheye(camera, bend)
    elif distorted:
        camera = replace(camera, distortion=_brown_conrady(camera, displacement, second, decentring))
    if blurred:
        camera = replace(camera, aperture_m=aperture_m, focus_m=depth_m * float(focus))
    if vignetted:
        a1, a2, a3 = (float(-loss * p) for p in power)
        camera = replace(camera, vignetting=(a1, a2, a3))
    if fringed:
        camera = replace(camera, chromatic_aberration=(float(fringe[0]), float(fringe[1])))
    if soft:
        camera = replace(camera, softness_px=softness_px)
    return replace(camera, sharpening=sharpening) if sharpened else camera


def corner_radius(camera: Camera) -> float:
    """Radius of the corner of the image in normalised image coordinates, as distorted."""
    half = np.tan(np.radians(camera.fov_deg) / 2)
    return float(half * np.hypot(1.0, camera.height / camera.width))


def check_distortion(distortion: Distortion, corner: float) -> None:
    """Raise FsidError unless the distortion has an inverse up to the radius `corner`, see `corner_radius`."""
    check_model(distortion)
    if not _is_invertible(distortion, corner):
        raise FsidError(
            f"distortion {distortion.coefficients} of {distortion.model} folds the image over before its "
            f"corner: take smaller coefficients or a smaller fov_deg"
        )


def _is_invertible(distortion: Distortion, corner: float) -> bool:
    """Whether the distorted radius grows strictly until it has passed the corner by 2 %."""
    if distortion.model == "fisheye":
        at = np.linspace(0, np.radians(MAX_FISHEYE_DEG), _STEPS)
        radius = at * (1 + _even(at, distortion.coefficients))
    else:
        k1, k2, p1, p2, k3 = distortion.coefficients
        at = np.linspace(0, 4 * corner, _STEPS)
        radius = at * (1 + _even(at, (k1, k2, k3))) - 3 * np.hypot(p1, p2) * at**2
    slope = np.diff(radius) / np.diff(at)
    passed = np.flatnonzero(radius > 1.02 * corner)
    return bool(len(passed)) and bool((slope[: passed[0]] > _MIN_SLOPE).all())


def _even(at: np.ndarray, coefficients: tuple[float, ...]) -> np.ndarray:
    """k1 at^2 + k2 at^4 + ..."""
    return sum((k * at ** (2 * i + 2) for i, k in enumerate(coefficients)), np.zeros_like(at))


def _has_rays(distortion: Distortion, camera: Camera) -> bool:
    """Whether the camera can be rendered with it: beyond the corner by a pixel, and not too wide."""
    try:
        rays_of(distortion, camera)
    except FsidError:
        return False
    return True


def _brown_conrady(
    camera: Camera, displacement: float, second: float, decentring: np.ndarray
) -> Distortion | None:
    """The lens that moves the corner by `displacement` x its radius, weakened until it is invertible; None
    for an image so wide that none is."""
    corner = corner_radius(camera)
    for strength in (1.0, 0.7, 0.5, 0.3, 0.1):
        k1 = strength * displacement * (1 - second) / corner**2
        k2 = strength * displacement * second / corner**4
        p1, p2 = (float(strength * p / corner) for p in decentring)
        distortion = Distortion("brown-conrady", (float(k1), float(k2), p1, p2, 0.0))
        if _is_invertible(distortion, corner) and _has_rays(distortion, camera):
            return distortion
    return None


def _fisheye(camera: Camera, bend: np.ndarray) -> Camera:
    """The camera with a fisheye lens; its field of view shrinks where the corner would look too far aside.

    An image of few pixels, whose border looks much farther aside than its corner, has none.
    """
    corner = corner_radius(camera)
    widest = 0.9 * np.radians(MAX_FISHEYE_DEG)
    if corner > widest:
        half = np.tan(np.radians(camera.fov_deg) / 2) * widest / corner
        camera = replace(camera, fov_deg=float(2 * np.degrees(np.arctan(half))))
        corner = float(widest)
    for strength in (1.0, 0.5, 0.0):
        k1, k2, k3, k4 = (float(strength * k) for k in bend * (1.0, 0.3, 0.1, 0.03))
        distortion = Distortion("fisheye", (k1, k2, k3, k4))
        if _is_invertible(distortion, corner) and _has_rays(distortion, camera):
            return replace(camera, distortion=distortion)
    return camera
