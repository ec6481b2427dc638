"""Hot and dead pixels are found in noise of any strength; points of light, detail and noise are not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from skimage import data

from fsid.errors import FsidError
from fsid.sensor import (
    Raw,
    clean_from_photo,
    hot_pixels,
    load_profile,
    mosaic,
    noisy_from_clean,
    without_hot_pixels,
)
from fsid.sensor.raw import CFA_PATTERNS

PROFILE = load_profile("pixel6")
SIZE = 240
GAINS = (2.1, 1.0, 1.6)
BESIDE_THE_BORDER = (0, SIZE - 1)


def smooth_scene() -> np.ndarray:
    """(SIZE, SIZE, 3) of camera RGB: a grey gradient, in which no pixel stands out."""
    ramp = np.linspace(0.05, 0.3, SIZE, dtype=np.float32)
    return (ramp[:, None] + ramp[None])[..., None] / np.array(GAINS, np.float32)


def exposed(rgb: np.ndarray, cfa: str, iso: float, seed: int = 0) -> Raw:
    clean = Raw(
        mosaic(rgb, cfa), cfa, PROFILE.black_level, PROFILE.white_level, GAINS, PROFILE.xyz_to_camera[0]
    )
    return noisy_from_clean(np.random.default_rng(seed), clean, iso, PROFILE.level(iso))


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
@pytest.mark.parametrize(("iso", "step"), [(50, 0.08), (800, 0.25), (6400, 0.6)])
def test_hot_and_dead_pixels_are_found_and_nothing_else(cfa: str, iso: float, step: float) -> None:
    raw = exposed(smooth_scene(), cfa, iso)
    rows, columns = np.mgrid[0:SIZE:13, 0:SIZE:17].reshape(2, -1)
    rows, columns = np.append(rows, BESIDE_THE_BORDER), np.append(columns, BESIDE_THE_BORDER)
    bad = np.zeros(raw.mosaic.shape, bool)
    bad[rows, columns] = True
    clean = raw.mosaic.copy()
    raw.mosaic[bad] += step
    dead = bad & (np.arange(SIZE) % 2 == 1) & (iso == 50)
    raw.mosaic[dead] = 0

    found = hot_pixels(raw)
    assert found[bad].mean() > 0.9
    assert not found[~bad].any()
    mended, count = without_hot_pixels(raw)
    assert count == found.sum()
    np.testing.assert_array_equal(mended.mosaic[~bad], clean[~bad])
    assert np.abs(mended.mosaic - clean)[found].max() < 0.3 * step


@pytest.mark.parametrize("colour", [(1.0, 1.0, 1.0), (1.0, 0.3, 0.1), (0.1, 0.3, 1.0)])
def test_points_of_light_behind_a_lens_stay(colour: tuple[float, float, float]) -> None:
    """Stars of a sharp lens (point spread of 0.7 pixels), anywhere between pixels, white, red and blue."""
    rng = np.random.default_rng(1)
    rows, columns = np.mgrid[:SIZE, :SIZE]
    sky = np.zeros((SIZE, SIZE))
    for row in range(10, SIZE - 10, 20):
        for column in range(10, SIZE - 10, 20):
            r, c = row + rng.uniform(), column + rng.uniform()
            sky += rng.uniform(0.1, 1) * np.exp(-((rows - r) ** 2 + (columns - c) ** 2) / (2 * 0.7**2))
    light = np.float32(0.02) + sky[..., None].astype(np.float32) * np.array(colour, np.float32)
    raw = exposed((light / np.array(GAINS, np.float32)).clip(max=1), "RGGB", 100)
    assert not hot_pixels(raw).any()


def test_noise_is_none() -> None:
    flat = np.full((2000, 2000, 3), 0.2, np.float32)
    assert not hot_pixels(exposed(flat, "GBRG", 3200)).any()


@pytest.mark.parametrize(("photo", "most"), [(data.chelsea, 2e-5), (data.coffee, 1.5e-4)])
def test_a_photograph_keeps_its_detail(photo: Callable[[], np.ndarray], most: float) -> None:
    """Sharper than a sensor sees: what a lens would have spread is in single pixels here."""
    srgb = photo()[:300].astype(np.float32) / 255
    clean = clean_from_photo(np.random.default_rng(0), srgb, PROFILE)
    raw = noisy_from_clean(np.random.default_rng(1), clean, 100, PROFILE.level(100))
    assert hot_pixels(raw).mean() <= most


def test_the_noise_must_be_known() -> None:
    raw = exposed(smooth_scene(), "RGGB", 100)
    with pytest.raises(FsidError, match="noise level of this RAW is unknown"):
        hot_pixels(replace(raw, noise=None))


def test_the_smallest_image_has_none() -> None:
    raw = exposed(smooth_scene()[:2, :2], "RGGB", 100)
    assert not hot_pixels(raw).any()
