"""Contrast of red and blue relative to green: a slope on luminance about the median of the frame."""

from dataclasses import replace

import numpy as np
import pytest

from fsid.errors import FsidError
from fsid.render.camera import lens_of
from fsid.render.colour_contrast import set_colour_contrast
from fsid.scene.colour import LUMINANCE
from fsid.scene.model import Camera

CAMERA = Camera((0, 1, 1), (0, 0, 0), (0, 1, 0), 60.0, 64, 64)


def seen(image, red, blue):
    image = image.copy()
    set_colour_contrast(image, replace(CAMERA, colour_contrast=(red, blue)))
    return image


def test_colours_have_the_stated_slope_on_luminance():
    grey = np.exp(np.random.default_rng(0).normal(0, 1, (64, 64))).astype(np.float32)
    image = np.stack([0.5 * grey, grey, 0.3 * grey], axis=2)
    after = seen(image, 0.1, -0.05)
    assert after.dtype == np.float32
    for colour, slope in enumerate((1.1, 1.0, 0.95)):
        now = np.log(after[..., colour]).ravel()
        assert np.polyfit(np.log(grey).ravel(), now, 1)[0] == pytest.approx(slope, abs=1e-4)


@pytest.mark.parametrize(("red", "blue"), [(0.1, 0.0), (0.0, -0.05)])
def test_one_colour_is_scaled_about_the_median_of_every_fourth_pixel(red, blue):
    """(Y / median Y)^red, of a skewed frame whose median is no mean; Y / median Y is 1e-3 at least."""
    grey = np.exp(np.random.default_rng(3).normal(0, 1, (61, 83))).astype(np.float32)
    grey[1, 1] = 1e-6
    image = np.stack([grey, grey, grey], axis=2)
    after = seen(image, red, blue)
    relative = np.maximum(grey / np.median(grey[::4, ::4]), 1e-3)
    for colour, extra in enumerate((red, 0.0, blue)):
        np.testing.assert_allclose(after[..., colour], grey * relative**extra, rtol=1e-5)


def test_the_middle_keeps_its_colour_and_dark_grey_turns_green():
    rows = [0.2] * 9 + [0.02, 2.0]
    image = np.repeat(np.repeat(np.array(rows, np.float32)[:, None, None], 8, axis=1), 3, axis=2)
    after = seen(image, 0.1, 0.1)
    np.testing.assert_allclose(after[0], image[0], rtol=1e-6)
    np.testing.assert_allclose(after[9][:, [0, 2]] / 0.02, 0.1**0.1, rtol=1e-5)
    np.testing.assert_allclose(after[10][:, [0, 2]] / 2.0, 10**0.1, rtol=1e-5)
    np.testing.assert_array_equal(after[..., 1], image[..., 1])


def test_hues_of_one_brightness_stay_as_they_are():
    image = np.random.default_rng(2).uniform(0.1, 1, (16, 16, 3))
    image = (image / (image @ LUMINANCE)[..., None]).astype(np.float32)
    np.testing.assert_allclose(seen(image, 0.3, -0.2), image, rtol=1e-5)


def test_a_lamp_gains_a_bounded_factor():
    image = np.full((16, 16, 3), 0.1, np.float32)
    image[3, 3] = 1e6
    assert seen(image, 0.1, 0.1)[3, 3, 0] == pytest.approx(1e6 * 100**0.1, rel=1e-4)


def test_no_contrast_changes_nothing():
    image = np.random.default_rng(1).random((20, 20, 3), np.float32)
    np.testing.assert_array_equal(seen(image, 0.0, 0.0), image)


def test_black_stays_black():
    image = np.full((8, 8, 3), 0.3, np.float32)
    image[5] = 0.0
    assert (seen(image, 0.1, -0.1)[5] == 0).all()
    assert (seen(np.zeros((8, 8, 3), np.float32), 0.1, -0.1) == 0).all()


@pytest.mark.parametrize("contrast", [(0.6, 0.0), (0.0, -0.51), (float("nan"), 0.0)])
def test_a_senseless_contrast_is_refused(contrast):
    with pytest.raises(FsidError, match="colour_contrast"):
        lens_of(replace(CAMERA, colour_contrast=contrast))
