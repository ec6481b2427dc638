"""A lens's point spread, a Gaussian that neither makes nor loses light; and unsharp masking."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d

from fsid.errors import FsidError
from fsid.render.blur import blurred, gaussian_weights
from fsid.render.camera import lens_of
from fsid.render.sharpness import set_sharpness, sharpen, soften
from fsid.scene.model import Camera

CAMERA = Camera((0, 1, 1), (0, 0, 0), (0, 1, 0), 60.0, 64, 64)


@pytest.mark.parametrize("softness_px", [0.1, 0.28, 0.4, 0.5, 0.55, 0.6, 0.65, 0.8, 1.5, 4.0])
def test_a_point_spreads_as_stated(softness_px):
    point = np.zeros((65, 65, 3), np.float32)
    point[32, 32] = (1.0, 2.0, 3.0)
    spread = soften(point, softness_px)
    assert spread.dtype == np.float32
    np.testing.assert_allclose(spread.sum(axis=(0, 1)), (1.0, 2.0, 3.0), rtol=1e-5)
    away = np.arange(65) - 32
    for axis in (0, 1):
        variance = (spread[..., 1].sum(axis=axis) / 2 * away**2).sum()
        assert np.sqrt(variance) == pytest.approx(softness_px, rel=0.02)


@pytest.mark.parametrize("sigma_px", [0.6, 1.0, 20.0])
@pytest.mark.parametrize("size", [(1, 1), (1, 50), (50, 1), (33, 5, 3), (70, 40, 3), (700, 100)])
def test_a_blur_is_that_of_scipy_whatever_the_size_of_the_picture(size, sigma_px):
    image = np.random.default_rng(2).random(size, np.float32)
    expected = image.astype(float)
    for axis in (0, 1):
        expected = gaussian_filter1d(expected, sigma_px, axis=axis, mode="nearest", truncate=3.0)
    np.testing.assert_allclose(blurred(image, gaussian_weights(sigma_px)), expected, atol=2e-6)


def test_even_light_stays_even_up_to_the_border():
    even = np.full((40, 30, 3), 7.5, np.float32)
    np.testing.assert_allclose(soften(even, 2.0), even, rtol=1e-6)


def test_no_softness_changes_nothing():
    image = np.random.default_rng(0).random((20, 20, 3), np.float32)
    assert soften(image, 0.0) is image


@pytest.mark.parametrize("softness_px", [-0.1, 51.0, float("nan")])
def test_a_senseless_softness_is_refused(softness_px):
    with pytest.raises(FsidError, match="softness_px"):
        lens_of(replace(CAMERA, softness_px=softness_px))


def test_sharpening_adds_the_stated_share_of_fine_detail():
    """A sine of frequency f keeps exp(-2 (pi f sigma)^2) behind a Gaussian; the rest is what is added."""
    frequency, amount = 0.2, 0.7
    wave = 1 + 0.1 * np.sin(2 * np.pi * frequency * np.arange(200, dtype=np.float32))
    image = np.tile(wave[:, None, None], (1, 8, 3)).astype(np.float32)
    gain = (sharpen(image, amount)[50:150] - 1).std() / (image[50:150] - 1).std()
    assert gain == pytest.approx(1 + amount * (1 - np.exp(-2 * (np.pi * frequency) ** 2)), rel=0.01)


def test_sharpening_leaves_no_black_ring_around_a_lamp():
    image = np.full((32, 32, 3), 0.5, np.float32)
    image[16, 16] = 500.0
    sharp = sharpen(image, 2.0)
    assert sharp.dtype == np.float32
    assert 0.25 <= sharp.min() < 0.5
    assert 500.0 < sharp.max() <= 750.0


def test_a_camera_softens_and_sharpens_its_own_pictures():
    image = np.random.default_rng(1).random((300, 20, 3), np.float32)  # three strips of rows
    same = image.copy()
    set_sharpness(same, CAMERA)
    np.testing.assert_array_equal(same, image)
    for softness_px, sharpening in ((0.8, 0.5), (0.1, 0.5), (0.0, 0.5), (0.8, 0.0), (20.0, 0.5)):
        both = image.copy()
        set_sharpness(both, replace(CAMERA, softness_px=softness_px, sharpening=sharpening))
        np.testing.assert_array_equal(both, sharpen(soften(image, softness_px), sharpening))


@pytest.mark.parametrize("sharpening", [-0.1, 5.1, float("nan")])
def test_a_senseless_sharpening_is_refused(sharpening):
    with pytest.raises(FsidError, match="sharpening"):
        lens_of(replace(CAMERA, sharpening=sharpening))
