"""One image tells its noise, within the error that it states; what shows no noise is refused."""

import numpy as np
import pytest

from fsid.errors import FsidError
from fsid.sensor import Raw, clean_from_photo, estimate_noise, load_profile, noisy_from_clean

PROFILE = load_profile("pixel6")


def photo() -> np.ndarray:
    from skimage import data

    return data.coffee().astype(np.float32) / 255


@pytest.mark.parametrize("iso", [1600, 6400])
def test_the_noise_of_a_photo_is_found(iso, rng):
    clean, level = clean_from_photo(rng, photo(), PROFILE), PROFILE.level(iso)
    found = estimate_noise(noisy_from_clean(rng, clean, iso, level))
    np.testing.assert_allclose(found.level.k, level.k, rtol=0.15)
    assert np.all(np.abs(np.array(found.level.k) - level.k) < 4 * np.array(found.k_error))
    assert np.all(np.abs(np.array(found.level.sigma2) - level.sigma2) < 4 * np.array(found.sigma2_error))


@pytest.mark.parametrize("shape", [(2, 2), (16, 16), (4, 400)])
def test_a_small_image_is_refused(shape, rng):
    raw = Raw(rng.random(shape, np.float32) / 2, "RGGB", 64, 1023, (1, 1, 1), np.eye(3))
    with pytest.raises(FsidError, match="too small"):
        estimate_noise(raw)
