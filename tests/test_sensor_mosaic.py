"""Mosaic arithmetic: every pixel keeps its colour, whatever the pattern, crop or flip."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsid.errors import FsidError
from fsid.sensor import CFA_PATTERNS, Raw, bayer_crop, mosaic, pack, unpack
from fsid.sensor.mosaic import halved, shift_cfa, site_offsets

cfas = st.sampled_from(CFA_PATTERNS)
sides = st.integers(1, 9).map(lambda n: 2 * n)


def _colours(height: int, width: int) -> np.ndarray:
    """An image whose value says which channel it is: 0, 1, 2."""
    return np.broadcast_to(np.arange(3, dtype=np.float32), (height, width, 3))


def _raw(image: np.ndarray, cfa: str) -> Raw:
    return Raw(image, cfa, 64, 1023, (2.0, 1.0, 1.5), np.eye(3))


@given(cfas, sides, sides)
def test_mosaic_has_the_colour_that_the_pattern_names(cfa, height, width):
    tile = ["RGB".index(colour) for colour in cfa]
    expected = np.tile(np.reshape(tile, (2, 2)), (height // 2, width // 2))
    np.testing.assert_array_equal(mosaic(_colours(height, width), cfa), expected)


@given(cfas, sides, sides, st.integers(0, 2**32 - 1))
def test_pack_and_unpack_are_inverse(cfa, height, width, seed):
    image = np.random.default_rng(seed).normal(size=(height, width)).astype(np.float32)
    packed = pack(image, cfa)
    assert packed.shape == (4, height // 2, width // 2)
    np.testing.assert_array_equal(unpack(packed, cfa), image)


@given(cfas)
def test_packed_order_is_red_green_green_blue_and_gr_shares_the_red_row(cfa):
    np.testing.assert_array_equal(pack(mosaic(_colours(2, 2), cfa), cfa)[:, 0, 0], [0, 1, 1, 2])
    red, gr, gb, blue = site_offsets(cfa)
    assert gr[0] == red[0]
    assert gb[0] == blue[0]
    assert len({red, gr, gb, blue}) == 4


def test_a_crop_of_whole_rows_is_no_window_on_the_original():
    whole = _raw(np.zeros((4, 4), np.float32), "RGGB")
    assert not np.shares_memory(bayer_crop(whole, 0, 0, 2, 4).mosaic, whole.mosaic)


@given(cfas, st.integers(0, 5), st.integers(0, 5))
def test_crop_at_any_offset_keeps_every_pixels_colour(cfa, top, left):
    whole = _raw(mosaic(_colours(12, 12), cfa), cfa)
    cut = bayer_crop(whole, top, left, 6, 4)
    np.testing.assert_array_equal(cut.mosaic, mosaic(_colours(6, 4), cut.cfa))
    assert cut.cfa == shift_cfa(cfa, top, left)
    assert (cut.cfa == cfa) == (top % 2 == 0 and left % 2 == 0)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: pack(np.zeros((3, 4)), "RGGB"), "even height"),
        (lambda: mosaic(np.zeros((4, 5, 3)), "RGGB"), "even height"),
        (lambda: pack(np.zeros((4, 4)), "RGBG"), "RGBG"),
        (lambda: unpack(np.zeros((3, 2, 2)), "RGGB"), r"\(3, 2, 2\)"),
        (lambda: bayer_crop(_raw(np.zeros((4, 4)), "RGGB"), 2, 0, 4, 4), "outside"),
        (lambda: bayer_crop(_raw(np.zeros((4, 4)), "RGGB"), -2, 0, 2, 2), "outside"),
        (lambda: bayer_crop(_raw(np.zeros((4, 4)), "RGGB"), 0, 0, 3, 2), "even height"),
    ],
)
def test_bad_shapes_and_patterns_are_named(call, words):
    with pytest.raises(FsidError, match=words):
        call()


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (np.full((8, 8), 500, np.uint16), "uint16"),
        (np.zeros((7, 8), np.float32), r"\(7, 8\)"),
        (np.zeros((4, 8, 8), np.float32), r"\(4, 8, 8\)"),
    ],
    ids=["DN", "odd", "packed"],
)
def test_a_raw_holds_whole_tiles_of_normalised_values(image, words):
    """DN for x were developed, and stored, as a white picture."""
    with pytest.raises(FsidError, match=words):
        _raw(image, "RGGB")


def test_a_raw_is_equal_to_itself_alone():
    raw = _raw(np.zeros((4, 4), np.float32), "RGGB")
    assert raw in [raw]
    assert len({raw, replace(raw, mosaic=raw.mosaic.copy())}) == 2
    assert raw not in [replace(raw, mosaic=raw.mosaic.copy())]


def test_a_halved_mosaic_keeps_its_colours_apart() -> None:
    colours = np.tile(np.array([[3, 5], [7, 11]], np.uint16), (6, 8))
    half = halved(colours)
    assert half.dtype == np.float32
    np.testing.assert_array_equal(half, colours[:6, :8])


@pytest.mark.parametrize("axis", [0, 1])
def test_a_halved_mosaic_puts_everything_in_the_middle_of_what_it_covers(axis: int) -> None:
    ramp = np.indices((12, 20))[axis].astype(np.uint16)
    expected = 2 * np.indices((6, 10))[axis] + 0.5
    np.testing.assert_array_equal(halved(ramp), expected)


def test_a_halved_mosaic_keeps_the_light() -> None:
    """Every old pixel has a share in the new ones, of which there are a quarter as many."""
    weights = np.zeros((16, 16))
    for i in range(16):
        for j in range(16):
            one = np.zeros((16, 16), np.float32)
            one[i, j] = 1
            weights[i, j] = halved(one).sum()
    assert weights.min() > 0.05
    np.testing.assert_allclose(weights.mean(), 0.25)


@pytest.mark.parametrize("shape", [(6, 8), (8, 10)])
def test_only_whole_pairs_of_tiles_are_halved(shape: tuple[int, int]) -> None:
    with pytest.raises(FsidError, match="multiples of 4"):
        halved(np.zeros(shape))


@pytest.mark.parametrize("shape", [(8, 8), (8, 8, 1), (8, 8, 4), (4, 8, 8)])
def test_a_picture_of_other_channels_is_refused(shape):
    """Of four the first three would be taken; (4, H, W) is as good a picture of 4 x H pixels."""
    with pytest.raises(FsidError, match="height, width, 3"):
        mosaic(np.ones(shape, np.float32), "RGGB")
