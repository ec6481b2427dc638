"""The figures mean what their names say."""

from __future__ import annotations

import dataclasses
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from skimage import data

from fsid.errors import FsidError
from fsid.evaluate import denoise_classical, psnr, ssim
from fsid.evaluate.classical import _anscombe, _bm3d, _unbiased_inverse
from fsid.sensor import NoiseLevel, add_noise, clean_from_photo, load_profile, variance


def test_psnr_of_a_known_error(rng: np.random.Generator):
    truth = rng.uniform(0.2, 0.8, (64, 64))
    assert psnr(truth + 0.1, truth) == pytest.approx(20.0)
    assert psnr(truth, truth) == float("inf")


def test_values_outside_the_range_count_as_clipped():
    assert psnr(np.full((8, 8), -3.0), np.zeros((8, 8))) == float("inf")
    assert psnr(np.ones((8, 8)), np.full((8, 8), 1.3)) == float("inf")


@pytest.mark.parametrize("metric", [psnr, ssim])
@pytest.mark.parametrize("value", [np.inf, -np.inf, np.nan])
def test_an_image_that_is_not_finite_has_no_figure(metric, value):
    image, truth = np.full((16, 16, 3), 0.5), np.full((16, 16, 3), 0.4)
    image[3, 4] = value
    assert np.isnan(metric(image, truth))
    assert np.isnan(metric(truth, image))


@pytest.mark.parametrize("metric", [psnr, ssim])
def test_what_has_no_range_of_one_or_another_shape_is_refused(metric):
    """Clipped to 0..1, two 8-bit pictures without black are both white, and equal."""
    grey, light = (np.full((16, 16, 3), value, np.uint8) for value in (100, 200))
    with pytest.raises(FsidError, match=r"uint8.*divide"):
        metric(grey, light)
    with pytest.raises(FsidError, match="cannot be compared"):
        metric(grey / 255, light[:1] / 255)
    with pytest.raises(FsidError, match=r"truth: its mean is 200.*divide"):
        metric(grey.astype(np.float32), light.astype(np.float32))


@pytest.mark.parametrize("metric", [psnr, ssim])
def test_an_estimate_may_be_anything_and_a_truth_saturated(metric):
    """A network that diverged has a figure, and so has a frame of which all is above the white level."""
    diverged, saturated = np.full((16, 16, 3), 1e6), np.full((16, 16, 3), 1.3)
    assert np.isfinite(metric(diverged, np.full((16, 16, 3), 0.5)))
    assert metric(diverged, saturated) == metric(saturated, saturated)


def test_ssim_of_less_than_its_window_is_refused():
    with pytest.raises(FsidError, match="11x11"):
        ssim(np.zeros((8, 8, 3)), np.zeros((8, 8, 3)))


def test_ssim_is_one_for_equal_images_and_falls_with_noise(rng: np.random.Generator):
    truth = data.coffee()[:64, :64] / 255.0
    weak, strong = (np.clip(truth + s * rng.standard_normal(truth.shape), 0, 1) for s in (0.02, 0.1))
    assert ssim(truth, truth) == pytest.approx(1.0)
    assert 1.0 > ssim(weak, truth) > ssim(strong, truth) > 0.0


def test_the_transform_makes_the_variance_one(rng: np.random.Generator):
    for counts, sigma in ((5.0, 1.0), (50.0, 2.0), (500.0, 10.0)):
        noisy = rng.poisson(counts, 200_000) + sigma * rng.standard_normal(200_000)
        assert np.var(_anscombe(noisy, np.array(sigma**2))) == pytest.approx(1.0, abs=0.05)


def test_the_inverse_is_unbiased(rng: np.random.Generator):
    for counts, sigma in ((0.0, 3.0), (2.0, 1.0), (20.0, 2.0), (300.0, 5.0)):
        noisy = rng.poisson(counts, 400_000) + sigma * rng.standard_normal(400_000)
        mean = np.mean(_anscombe(noisy, np.array(sigma**2)))
        assert _unbiased_inverse(mean, np.array(sigma**2)) == pytest.approx(counts, abs=0.1, rel=0.01)


def test_the_classical_denoiser_removes_noise_and_keeps_the_mean(rng: np.random.Generator):
    profile = load_profile("pixel6")
    clean = clean_from_photo(rng, data.coffee()[:128, :128].astype(np.float32) / 255, profile)
    noisy = add_noise(rng, clean, profile.level(3200))
    denoised = denoise_classical(noisy)
    assert psnr(denoised.mosaic, clean.mosaic) > psnr(noisy.mosaic, clean.mosaic) + 3
    assert denoised.mosaic.mean() == pytest.approx(clean.mosaic.mean(), rel=0.02)
    assert denoised.cfa == noisy.cfa
    assert denoised.noise is None


def test_the_simulated_noise_has_the_stated_psnr(rng: np.random.Generator):
    profile = load_profile("pixel6")
    level = profile.level(1600)
    clean = clean_from_photo(rng, data.coffee()[:256, :256].astype(np.float32) / 255, profile)
    clean = dataclasses.replace(clean, mosaic=np.clip(clean.mosaic, 0.2, 0.6))
    expected = -10 * np.log10(variance(clean.mosaic, level, clean.cfa).mean())
    assert psnr(add_noise(rng, clean, level).mosaic, clean.mosaic) == pytest.approx(expected, abs=0.1)


def test_bm3d_gets_planes_of_independent_noise_of_the_strength_it_is_told(rng, monkeypatch):
    """The first of them is the mean; and what BM3D leaves as it is comes back as it was."""
    given = {}

    def keep(planes: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        given["planes"], given["sigma"] = planes, sigma
        return planes

    monkeypatch.setitem(sys.modules, "bm3d", SimpleNamespace(bm3d=keep))
    noise = rng.normal(size=(4, 200, 200))
    np.testing.assert_allclose(_bm3d(noise), noise, atol=1e-6)
    covariance = np.cov(given["planes"].reshape(-1, 4).T)
    np.testing.assert_allclose(covariance, np.diag(given["sigma"] ** 2), atol=0.02)
    np.testing.assert_allclose(given["planes"][..., 0], 2 * noise.mean(axis=0), atol=1e-6)


def test_without_a_noise_level_the_classical_denoiser_says_so(rng: np.random.Generator):
    clean = clean_from_photo(rng, data.coffee()[:64, :64].astype(np.float32) / 255, load_profile("pixel6"))
    with pytest.raises(FsidError, match="noise level of this RAW is unknown"):
        denoise_classical(dataclasses.replace(clean, noise=None))
    denoise_classical(clean, NoiseLevel((1e-3,) * 4, (1e-5,) * 4))


def test_ssim_of_one_window_is_the_formula(rng: np.random.Generator):
    """Wang et al. 2004, equation 13, with weighted moments that are not corrected for their number."""
    first, second = rng.uniform(0, 1, (2, 11, 11, 3))
    bell = np.exp(-0.5 * (np.arange(-5, 6) / 1.5) ** 2)
    weight = (np.outer(bell, bell) / bell.sum() ** 2)[..., None]
    a, b, aa, bb, ab = (
        (weight * x).sum((0, 1)) for x in (first, second, first * first, second * second, first * second)
    )
    c1, c2 = 0.01**2, 0.03**2
    alike = (2 * a * b + c1) * (2 * (ab - a * b) + c2)
    expected = alike / ((a * a + b * b + c1) * (aa - a * a + bb - b * b + c2))
    assert ssim(first, second) == pytest.approx(expected.mean(), abs=1e-9)
