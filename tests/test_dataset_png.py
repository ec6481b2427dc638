"""Previews hold the pixels that they were made of."""

import io

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from PIL import Image

from fsid.dataset.png import png_bytes


@given(
    arrays(
        np.uint8,
        array_shapes(min_dims=2, max_dims=2, max_side=9).map(lambda side: (*side, 3)),
        elements=st.integers(0, 255),
    )
)
def test_a_preview_is_read_back_as_it_was(pixels: np.ndarray) -> None:
    image = Image.open(io.BytesIO(png_bytes(pixels)))
    assert (image.format, image.mode) == ("PNG", "RGB")
    assert (np.asarray(image) == pixels).all()
