"""A lens's point spread: a Gaussian of the stated width that neither makes nor loses light."""

from dataclasses import replace

import numpy as np
import pytest

from fsid.errors import FsidError
from fsid.render.camera import lens_of
from fsid.render.softness import soften
from fsid.scene.model import Camera

CAMERA = Camera((0, 1, 1), (0, 0, 0), (0, 1, 0), 60.0, 64, 64)


@pytest.mark.parametrize("softness_px", [0.7, 1.5, 4.0])
def test_a_point_spreads_as_stated(softness_px):
    point = np.zeros((65, 65, 3), np.float32)
    point[32, 32] = (1.0, 2.0, 3.0)
    spread = soften(point, softness_px)
    assert spread.dtype == np.float32
    np.testing.assert_allclose(spread.sum(axis=(0, 1)), (1.0, 2.0, 3.0), rtol=1e-5)
    away = np.arange(65) - 32
    for axis in (0, 1):
        variance = (spread[..., 1].sum(axis=axis) / 2 * away**2).sum()
        assert np.sqrt(variance) == pytest.approx(softness_px, rel=0.04)


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
