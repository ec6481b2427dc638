"""Depth of field from one image: the circle of confusion, what is hidden, and the exact way beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from fsid.errors import FsidError
from fsid.render import Renderer
from fsid.render.camera import lens_of
from fsid.render.defocus import _blurred, defocus
from fsid.scene.distortion import distorted
from fsid.scene.model import Distortion, Transform
from render_scenes import FROM_ABOVE, bake_plain, grid, lambertian, plain, sphere, view

FOCUS_M, FOCAL_PX = 2.0, 400.0


def at(x: float, y: float, z: float) -> Transform:
    return Transform((x, y, z), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


def aperture_of(diameter_px: float, depth_m: float) -> float:
    """The opening that gives things at `depth_m` this circle of confusion."""
    return diameter_px / (FOCAL_PX * abs(1 / depth_m - 1 / FOCUS_M))


@pytest.mark.parametrize("depth_m", [1.2, 5.0, np.inf])
@pytest.mark.parametrize("diameter_px", [1.0, 3.0, 8.0, 20.0, 120.0, 300.0])
def test_a_point_becomes_as_wide_as_its_disc(depth_m: float, diameter_px: float) -> None:
    """The variance of a disc of diameter D is D^2 / 16 along each axis, and no light is lost."""
    middle = 80 + 2 * int(diameter_px)
    image = np.zeros((2 * middle + 1, 2 * middle + 1, 3), np.float32)
    image[middle, middle] = 1.0
    depth = np.full(image.shape[:2], depth_m, np.float32)
    seen = defocus(image, depth, aperture_of(diameter_px, depth_m), FOCUS_M, FOCAL_PX)[..., 1].astype(float)
    at = np.arange(len(image))
    mean = (seen.sum(0) * at).sum() / seen.sum()
    assert seen.sum() == pytest.approx(1.0, abs=0.01)
    assert (seen.sum(0) * (at - mean) ** 2).sum() == pytest.approx(diameter_px**2 / 16, rel=0.06)


def test_the_sharp_plane_stays_as_it_is() -> None:
    image = np.random.default_rng(0).random((40, 50, 3), np.float32)
    depth = np.full((40, 50), FOCUS_M, np.float32)
    np.testing.assert_allclose(defocus(image, depth, 0.1, FOCUS_M, FOCAL_PX), image, rtol=1e-6)


def test_a_sharp_thing_neither_blurs_nor_bleeds_into_what_is_behind_it() -> None:
    depth = np.full((60, 120), 8.0, np.float32)
    depth[:, :60] = FOCUS_M
    image = np.where(depth[..., None] == FOCUS_M, np.float32(1.0), np.float32(0.1)) * np.ones(3, np.float32)
    seen = defocus(image, depth, aperture_of(12.0, 8.0), FOCUS_M, FOCAL_PX)
    np.testing.assert_allclose(seen, image, atol=1e-3)


def test_a_near_thing_out_of_focus_covers_what_is_sharp_softly() -> None:
    depth = np.full((60, 120), FOCUS_M, np.float32)
    depth[:, :60] = 1.0
    image = np.where(depth[..., None] == 1.0, np.float32(1.0), np.float32(0.0)) * np.ones(3, np.float32)
    row = defocus(image, depth, aperture_of(16.0, 1.0), FOCUS_M, FOCAL_PX)[30, :, 0]
    assert np.diff(row).max() < 1e-4
    assert np.diff(row).min() > -1.05 / (4 * np.sqrt(2 * np.pi))  # nowhere steeper than the middle
    low, high = (np.interp(-level, -row, np.arange(120)) for level in (0.9, 0.1))
    assert high - low == pytest.approx(0.687 * 16, rel=0.2)
    assert (low + high) / 2 == pytest.approx(59.5, abs=1.0)


@pytest.mark.parametrize("sigma_px", [0.5, 0.85, 1.4, 2.4, 6.8, 11.5])
@pytest.mark.parametrize("size", [(160, 162), (129, 163)])
def test_a_blur_at_half_the_resolution_is_a_gaussian(size: tuple[int, int], sigma_px: float) -> None:
    """In its place, also where sides are odd; even light stays even up to the borders."""
    image = np.zeros(size)
    image[45:-45, 45:-45] = np.random.default_rng(0).normal(size=(size[0] - 90, size[1] - 90))
    image = 7 * gaussian_filter(image, 2.0).astype(np.float32)  # of a standard deviation of 1
    seen = _blurred(image, sigma_px)
    assert seen.shape == size
    np.testing.assert_allclose(seen, gaussian_filter(image, sigma_px), atol=0.04)
    np.testing.assert_allclose(_blurred(np.ones(size, np.float32), sigma_px), 1.0, rtol=1e-5)


def test_even_light_stays_even_whatever_stands_before_what() -> None:
    """Neither darker nor lighter along edges, where layers of several depths lie over each other."""
    depth = np.random.default_rng(0).choice([0.8, 1.3, FOCUS_M, 3.0, np.inf], (9, 13)).astype(np.float32)
    depth = np.repeat(np.repeat(depth, 11, 0), 7, 1)
    image = np.full((*depth.shape, 3), 7.5, np.float32)
    np.testing.assert_allclose(defocus(image, depth, 0.1, FOCUS_M, FOCAL_PX), 7.5, rtol=1e-4)


@pytest.mark.parametrize("images", [1, 16])
def test_depth_of_field_blurs_by_the_circle_of_confusion(images: int) -> None:
    """Sharp at the focus; else an edge is as wide as a disc of diameter A f |1/F - 1/z|."""
    camera = replace(FROM_ABOVE, width=192, height=192, focus_m=2.0)
    with Renderer(texture_size=64, lens_images=images) as renderer:
        for height, aperture in ((0.0, 0.06), (0.7, 0.06), (0.7, 0.3)):
            edge = lambertian(grid(4.0), (0.9, 0.9, 0.9), at=at(2.0, 0.0, height))
            opened = replace(camera, aperture_m=aperture)
            row = renderer.draw(view(edge, ambient=1.0, camera=opened), bake=bake_plain).radiance[96, :, 0]
            row = row / row[150]
            low, high = (np.interp(level, row, np.arange(192)) for level in (0.1, 0.9))
            diameter = aperture * (96 / np.tan(np.radians(30))) * abs(1 / 2.0 - 1 / (2.0 - height))
            assert abs((high - low) - 0.687 * diameter) < 0.25 * 0.687 * diameter + 1.0
            assert np.diff(row).min() > -0.01


@pytest.mark.parametrize("images", [1, 24])
def test_a_lens_bends_the_circle_of_confusion_with_the_image(images: int) -> None:
    """In the corner of a fisheye's image it is as small as all is there: its area is the determinant of the
    lens's formula times that of the disc that a pinhole's lens would show."""
    fisheye = Distortion("fisheye", (0.05, -0.01, 0.002, 0.0))
    sharp = replace(FROM_ABOVE, width=192, height=128, fov_deg=90.0, distortion=fisheye, focus_m=8.0)
    opened, place, step = replace(sharp, aperture_m=0.24), np.array([1.7, 1.2]), 1e-4
    shining = replace(plain((0.5, 0.5, 0.5)), emission=1.0)
    spot = replace(lambertian(grid(0.1), at=at(*place, 0.0)), materials=(shining,))
    with Renderer(texture_size=64, lens_images=images) as renderer:
        spots = [
            renderer.draw(view(spot, camera=c), bake=bake_plain).radiance[..., 1] for c in (sharp, opened)
        ]
    y, x = np.mgrid[:128, :192]
    before, after = (np.cov(np.stack([x.ravel(), y.ravel()]), aweights=light.ravel()) for light in spots)
    moved = np.array([[0, 0], [step, 0], [0, step]]) + place / 2
    shown = distorted(fisheye, moved)
    stretch2 = np.linalg.det(shown[1:] - shown[0]) / step**2
    diameter_px = 0.24 * lens_of(sharp).focal[0] * 96 * (1 / 2.0 - 1 / 8.0)
    assert np.sqrt(np.linalg.det(after - before)) == pytest.approx(diameter_px**2 / 16 * stretch2, rel=0.12)


def test_one_image_comes_near_to_many() -> None:
    """A row of balls before a floor, from one image and from 16; the sharp image is far from both."""
    balls = [
        lambertian(sphere(0.2, 48), (0.8, 0.3, 0.2), at=at(x, y, x + 0.6))
        for x in (-0.4, 0.0, 0.4, 0.8)
        for y in (-0.5, 0.0, 0.5)
    ]
    scene = view(lambertian(grid(4.0), (0.2, 0.5, 0.7)), *balls, ambient=1.0)
    sharp = replace(FROM_ABOVE, width=192, height=192)
    opened = replace(sharp, aperture_m=0.15, focus_m=1.4)
    with Renderer(texture_size=64, lens_images=16) as renderer:
        plain = renderer.draw(replace(scene, camera=sharp), bake=bake_plain)
        many = renderer.draw(replace(scene, camera=opened), bake=bake_plain)
    with Renderer(texture_size=64, lens_images=1) as renderer:
        one = renderer.draw(replace(scene, camera=opened), bake=bake_plain)
    focal_px = lens_of(opened).focal[0] * 96
    again = defocus(plain.radiance, plain.depth, 0.15, 1.4, focal_px)
    np.testing.assert_allclose(one.radiance, again, rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(one.depth, plain.depth)
    error = [np.sqrt(((image.radiance - many.radiance) ** 2).mean()) for image in (one, plain)]
    assert error[0] < 0.55 * error[1]


def test_at_least_one_image_is_needed() -> None:
    with pytest.raises(FsidError, match="lens_images 0"):
        Renderer(lens_images=0)


@pytest.mark.parametrize(("depth_m", "least", "most"), [(1.0, 0.0, 0.2), (FOCUS_M, 0.99, 1.01)])
def test_pixels_that_an_edge_divides_are_blurred_as_its_near_side(
    depth_m: float, least: float, most: float
) -> None:
    """Their depth may be that of the far side: they would stay sharp in a soft edge, or lose a sharp one."""
    depth = np.full((60, 120), FOCUS_M if depth_m < FOCUS_M else 8.0, np.float32)
    depth[:, :60] = depth_m
    image = np.zeros((60, 120, 3), np.float32)
    image[:, 60] = 1.0
    seen = defocus(image, depth, aperture_of(12.0, 1.0 if depth_m < FOCUS_M else 8.0), FOCUS_M, FOCAL_PX)
    assert least <= seen[30, 60, 1] <= most
