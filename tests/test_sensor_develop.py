"""Developing: grey is grey, white is white, linear images come back, noise does not move the mean."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, ImageOps

from fsid.cli.main import main
from fsid.errors import FsidError
from fsid.sensor import (
    CFA_PATTERNS,
    Raw,
    add_noise,
    colour_rand,
    demosaic,
    develop,
    develop_linear,
    linear_to_camera,
    load_profile,
    mosaic,
    read_raw,
    srgb_encode,
    unprocess,
    upright,
    write_dng,
)
from fsid.sensor.colour import published_matrices
from fsid.sensor.metadata import BASELINE_EXPOSURE, Metadata, exposure_metadata
from fsid.sensor.tiff import DOUBLE, Tag
from fsid.sensor.tone import inverse_tone_curve, photo_to_linear, srgb_decode, tone_curve

cfas = pytest.mark.parametrize("cfa", CFA_PATTERNS)


def _raw(camera, cfa, matrix, gains):
    return Raw(mosaic(camera, cfa), cfa, 64, 1023, gains, matrix)


def _reference_demosaic(image: np.ndarray, cfa: str) -> np.ndarray:
    """Malvar et al. 2004, figure 2, pixel by pixel."""
    cross = np.array(
        [[0, 0, -1, 0, 0], [0, 0, 2, 0, 0], [-1, 2, 4, 2, -1], [0, 0, 2, 0, 0], [0, 0, -1, 0, 0]]
    )
    row = np.array(
        [[0, 0, 0.5, 0, 0], [0, -1, 0, -1, 0], [-1, 4, 5, 4, -1], [0, -1, 0, -1, 0], [0, 0, 0.5, 0, 0]]
    )
    diagonal = np.array(
        [[0, 0, -1.5, 0, 0], [0, 2, 0, 2, 0], [-1.5, 0, 6, 0, -1.5], [0, 2, 0, 2, 0], [0, 0, -1.5, 0, 0]]
    )
    padded = np.pad(image, 2, mode="reflect")
    out = np.empty((*image.shape, 3))
    for i in range(image.shape[0]):
        for j in range(image.shape[1]):
            window = padded[i : i + 5, j : j + 5]
            own = cfa[2 * (i % 2) + j % 2]
            beside = cfa[2 * (i % 2) + 1 - j % 2]
            for channel, colour in enumerate("RGB"):
                if colour == own:
                    weights = None
                elif colour == "G":
                    weights = cross
                elif own == "G":
                    weights = row if beside == colour else row.T
                else:
                    weights = diagonal
                out[i, j, channel] = image[i, j] if weights is None else np.sum(weights * window) / 8
    return out


@cfas
@pytest.mark.parametrize("size", [(10, 14), (136, 10)])  # one strip of rows, and three
def test_demosaic_equals_the_published_filters(cfa, size):
    image = np.random.default_rng(0).uniform(-0.2, 1, size).astype(np.float32)
    np.testing.assert_allclose(demosaic(image, cfa), _reference_demosaic(image, cfa), atol=2e-6)


@pytest.mark.parametrize("shape", [(5, 4), (4, 7), (4, 4, 1)])
def test_a_mosaic_of_broken_tiles_is_not_demosaiced(shape):
    with pytest.raises(FsidError, match="even height and width"):
        demosaic(np.zeros(shape, np.float32), "RGGB")
    assert demosaic(np.zeros((2, 4), np.float32), "RGGB").shape == (2, 4, 3)


@pytest.mark.parametrize("curve", [srgb_encode, srgb_decode, tone_curve, inverse_tone_curve, photo_to_linear])
@pytest.mark.parametrize("number", [0, 0.5, 1])
def test_curves_take_single_numbers(curve, number):
    assert curve(number) == curve(np.array([number], np.float32))[0]


@cfas
def test_demosaic_reproduces_a_colour_gradient_away_from_the_border(cfa):
    y, x = np.mgrid[0:12, 0:16].astype(np.float32)
    image = np.stack([0.1 + 0.02 * x, 0.3 + 0.01 * y, 0.5 - 0.01 * x + 0.02 * y], axis=-1)
    inside = np.s_[2:-2, 2:-2]
    np.testing.assert_allclose(demosaic(mosaic(image, cfa), cfa)[inside], image[inside], atol=1e-5)


@settings(max_examples=30)
@given(st.sampled_from(CFA_PATTERNS), st.floats(0.01, 0.99), st.integers(0, 2**32 - 1))
def test_grey_is_grey(cfa, light, seed):
    matrix, gains = colour_rand(np.random.default_rng(seed), published_matrices())
    camera = linear_to_camera(np.full((8, 8, 3), light), matrix, gains)
    expected = srgb_encode(np.full((8, 8, 3), light, np.float32))
    np.testing.assert_allclose(develop(_raw(camera, cfa, matrix, gains)), expected, atol=1e-4)


@cfas
@pytest.mark.parametrize("gains", [(2.1, 1.0, 1.6), (0.8, 1.0, 1.6), (2.1, 1.0, 0.5)])
def test_saturated_and_over_exposed_light_is_white(cfa, gains):
    camera = np.minimum(np.full((8, 8, 3), 30.0) / np.array(gains), 1).astype(np.float32)
    picture = develop(_raw(camera, cfa, published_matrices()[2], gains))
    np.testing.assert_allclose(picture, 1, atol=1e-5)


@cfas
def test_develop_returns_an_unprocessed_photo(cfa):
    rng = np.random.default_rng(7)
    y, x = np.mgrid[0:64, 0:96] / 96
    smooth = [0.45 + 0.15 * np.sin(5 * x + 3 * y), 0.5 + 0.1 * np.cos(4 * y), 0.45 + 0.1 * np.sin(6 * x)]
    photo = np.stack(smooth, axis=-1).astype(np.float32)
    matrix, gains = colour_rand(rng, published_matrices())
    picture = tone_curve(develop(_raw(unprocess(photo, matrix, gains), cfa, matrix, gains)))
    assert np.sqrt(np.mean((picture - photo) ** 2)) < 1 / 255


def test_noise_does_not_move_the_mean_of_the_developed_light():
    matrix, gains = published_matrices()[0], (2.1, 1.0, 1.6)
    profile = load_profile("pixel6")
    for light in (0.0, 0.002, 0.2):
        clean = _raw(linear_to_camera(np.full((400, 400, 3), light), matrix, gains), "GBRG", matrix, gains)
        noisy = develop_linear(add_noise(np.random.default_rng(1), clean, profile.level(6400)))
        scatter = noisy.std(axis=(0, 1)) / 400 * 3  # demosaicing correlates neighbours
        assert np.all(np.abs(noisy.mean(axis=(0, 1)) - light) < 4.5 * scatter)


def test_develop_repeats_itself_and_leaves_its_input_alone():
    raw = _raw(np.random.default_rng(0).random((16, 16, 3), np.float32), "BGGR", np.eye(3), (2.0, 1.0, 1.5))
    before = raw.mosaic.copy()
    first = develop(raw)
    np.testing.assert_array_equal(raw.mosaic, before)
    np.testing.assert_array_equal(first, develop(raw))
    assert first.dtype == np.float32
    assert first.shape == (16, 16, 3)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_picture_is_turned_upright_as_other_programs_do(orientation):
    stored = np.arange(24, dtype=np.uint8).reshape(4, 6)
    image = Image.fromarray(stored)
    image.getexif()[274] = orientation
    np.testing.assert_array_equal(upright(stored, orientation), np.asarray(ImageOps.exif_transpose(image)))


def test_the_command_develops_a_sideways_file_upright(tmp_path):
    camera = np.random.default_rng(0).random((32, 48, 3), np.float32)
    raw = _raw(camera, "RGGB", np.eye(3), (2.0, 1.0, 1.5))
    write_dng(tmp_path / "a.dng", replace(raw, metadata=exposure_metadata(orientation=6)))
    main(["develop", str(tmp_path / "a.dng"), str(tmp_path / "a.png")])
    picture = np.asarray(Image.open(tmp_path / "a.png"))
    assert picture.shape == (48, 32, 3)
    plain = np.rint(255 * develop(read_raw(tmp_path / "a.dng")))
    assert np.max(np.abs(picture - np.rot90(plain, -1))) <= 1


@pytest.mark.parametrize(("stops", "shown"), [(1.5, 1.5), (0.0, 0.0), (-2.0, 0.0), (np.nan, 0.0), (1e9, 8.0)])
def test_a_picture_is_as_bright_as_its_dng_asks_for(stops, shown):
    """Below white; an exposure below 0 would make white grey."""
    camera = np.full((16, 16, 3), 0.001, np.float32)
    raw = _raw(camera, "RGGB", published_matrices()[0], (2.0, 1.0, 1.5))
    asked = replace(raw, metadata=Metadata(first=(Tag(BASELINE_EXPOSURE, DOUBLE, (stops,)),)))
    brighter = replace(raw, mosaic=raw.mosaic * np.float32(2**shown))
    np.testing.assert_allclose(develop(asked), develop(brighter), atol=1e-5)
    np.testing.assert_array_equal(develop_linear(asked), develop_linear(raw))
    white = replace(asked, mosaic=np.ones_like(raw.mosaic))
    np.testing.assert_allclose(develop(white), 1, atol=1e-5)
