"""One definition for arrays and tensors, and the fast ways give what the printed formulas give."""

import numpy as np
import pytest
from scipy import stats

import sensor_transcribed as transcribed
from fsid.sensor import CFA_PATTERNS, NoiseLevel, load_profile, mosaic, pack, unpack, unprocess, variance
from fsid.sensor.colour import srgb_to_camera_matrix
from fsid.sensor.formula import noise_variance, stored, with_noise
from fsid.sensor.gaussian import standard_normal
from fsid.sensor.unprocess import linear_to_camera, process

LEVEL = NoiseLevel(k=(2.3e-3, 2.5e-3, 2.1e-3, 1.9e-3), sigma2=(3e-5, 1e-5, 2e-5, 4e-5))
MATRIX, GAINS = load_profile("pixel6").xyz_to_camera[1], (2.1, 1.0, 1.7)


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
def test_fast_formulas_are_the_printed_ones(cfa, rng):
    x = rng.uniform(-0.1, 1, (16, 20)).astype(np.float32)
    np.testing.assert_array_equal(pack(x, cfa), transcribed.pack(x, cfa).astype(np.float32))
    k, sigma2 = (transcribed.site_map(v, cfa, x.shape) for v in (LEVEL.k, LEVEL.sigma2))
    np.testing.assert_allclose(variance(x, LEVEL, cfa), k * np.maximum(x, 0) + sigma2, rtol=1e-5)


@pytest.mark.parametrize("bits", [8, 16])
def test_unprocessing_of_8_and_16_bit_photos_is_exact(bits, rng):
    photo = (rng.integers(0, 2**bits, (40, 30, 3)) / (2**bits - 1)).astype(np.float32)
    photo[:10] = 1 - photo[:10] * 0.02  # highlights, which are preserved
    photo = np.rint(photo * (2**bits - 1)) / (2**bits - 1)
    expected = transcribed.unprocess(photo, srgb_to_camera_matrix(MATRIX), GAINS)
    np.testing.assert_allclose(unprocess(photo.astype(np.float32), MATRIX, GAINS), expected, atol=2e-4)


def test_fast_normal_numbers_are_normal():
    z = standard_normal(np.random.default_rng(5), (1000, 2000)).astype(np.float64).ravel()
    n = z.size
    for power, moment, spread in ((1, 0, 1), (2, 1, 2), (3, 0, 15), (4, 3, 96)):
        assert abs(np.mean(z**power) - moment) < 4.5 * np.sqrt(spread / n)
    assert stats.kstest(z, "norm").pvalue > 1e-3
    for far in (3.0, 3.29, 3.5, 4.0):
        expected = n * 2 * stats.norm.sf(far)
        assert abs(np.sum(np.abs(z) > far) - expected) < 4.5 * np.sqrt(expected)
    assert 4.5 < np.abs(z).max() < 7
    assert abs(np.mean(z[1:] * z[:-1])) < 4.5 / np.sqrt(n)
    assert standard_normal(np.random.default_rng(0), (3, 5)).shape == (3, 5)


def test_both_numbers_of_a_look_up_are_independent():
    """On 16 x 16 cells of equal probability: as even as independent numbers, half an array apart."""
    z = standard_normal(np.random.default_rng(6), (2, 1 << 20)).astype(np.float64)
    cells = (stats.norm.cdf(z) * 16).astype(int)
    count = np.bincount(cells[0] * 16 + cells[1], minlength=256)
    expected = z.shape[1] / 256
    assert stats.chi2.sf(np.sum((count - expected) ** 2) / expected, 255) > 1e-4
    assert abs(np.mean(z[0] * z[1])) < 4.5 / np.sqrt(z.shape[1])
    assert abs(np.mean(z[0] ** 2 * z[1] ** 2) - 1) < 4.5 * np.sqrt(8 / z.shape[1])


@pytest.mark.parametrize("size", [0, 1, 2, 7])
def test_any_number_of_normal_numbers_can_be_had(size):
    draws = np.array([standard_normal(np.random.default_rng(seed), (size,)) for seed in range(50)])
    assert draws.shape == (50, size)
    assert np.all(np.isfinite(draws))


def test_tensors_give_what_arrays_give(rng):
    torch = pytest.importorskip("torch")
    x = rng.uniform(-0.1, 1.2, (2, 4, 8, 6)).astype(np.float32)
    normal = rng.standard_normal(x.shape, np.float32)
    k, sigma2 = (np.array([v, v], np.float32)[:, :, None, None] for v in (LEVEL.k, LEVEL.sigma2))
    span = np.array([959, 4000], np.float32)[:, None, None, None]

    def both(function, *arrays):
        before = [array.copy() for array in arrays]
        expected = function(*arrays)
        found = function(*(torch.from_numpy(array) for array in before))
        assert isinstance(found, torch.Tensor)
        np.testing.assert_allclose(found.numpy(), expected, rtol=2e-6, atol=2e-6)
        for array, kept in zip(arrays, before, strict=True):
            np.testing.assert_array_equal(array, kept)

    both(noise_variance, x, k, sigma2)
    both(with_noise, x, normal, k, sigma2)
    both(stored, x, 64 + 0 * span, span)
    both(lambda a: pack(a, "GBRG"), x[0, 0])
    both(lambda a: unpack(a, "BGGR"), x[0])
    photo = rng.random((12, 10, 3)).astype(np.float32)
    photo[:3] = 0.999
    both(lambda a: unprocess(a, MATRIX, GAINS, 0.8), photo)
    both(lambda a: process(a, MATRIX, GAINS), photo)
    both(lambda a: linear_to_camera(a, MATRIX, GAINS), 2 * photo)
    both(lambda a: mosaic(a, "GRBG"), photo)
