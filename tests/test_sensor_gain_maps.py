"""Gain maps of a DNG: what a phone's lens has darkened is even after developing, and the file keeps them."""

import struct
from dataclasses import replace

import numpy as np
import pytest

from fsid.denoise.preview import preview_of
from fsid.sensor import CFA_PATTERNS, Raw, develop, read_raw, write_dng
from fsid.sensor.colour import published_matrices
from fsid.sensor.gain_maps import GAIN_MAP, shading_gains
from fsid.sensor.metadata import OPCODES_2, Metadata
from fsid.sensor.tiff import Tag

UNDEFINED = 7  # TIFF type
SHAPE = (48, 64)


def gain_map(points, first=(0, 0), pitch=(2, 2), spacing=None, origin=(0.0, 0.0), end=SHAPE, plane=0, cut=0):
    """One opcode; points: (rows, columns) of gains; spacing: over the whole image unless told."""
    points = np.atleast_2d(np.asarray(points, np.float32))
    spacing = spacing or [1 / max(count - 1, 1) for count in points.shape]
    head = struct.pack(">10I4dI", *first, *end, plane, 1, *pitch, *points.shape, *spacing, *origin, 1)
    data = (head + points.astype(">f4").tobytes())[: -cut or None]
    return struct.pack(">4I", GAIN_MAP, 0x01030000, 1, len(data)) + data


def listed(*maps):
    return struct.pack(">I", len(maps)) + b"".join(maps)


def raw_with(maps, mosaic, cfa="RGGB"):
    metadata = Metadata(mosaic=(Tag(OPCODES_2, UNDEFINED, maps),))
    matrix = published_matrices().mean(axis=0)
    return Raw(mosaic, cfa, 64, 1023, (2.0, 1.0, 1.5), matrix, metadata=metadata)


def bilinear(points, spacing, origin, shape):
    """Pixel by pixel, as the specification words it."""
    out = np.empty(shape)
    for r, c in np.ndindex(shape):
        lows, parts = [], []
        for at, side, count, step, zero in zip((r, c), shape, points.shape, spacing, origin, strict=True):
            place = min(max(((at + 0.5) / side - zero) / step, 0), count - 1)
            lows.append(min(int(place), count - 2))
            parts.append(place - lows[-1])
        (i, j), (a, b) = lows, parts
        upper = points[i, j] * (1 - b) + points[i, j + 1] * b
        out[r, c] = upper * (1 - a) + (points[i + 1, j] * (1 - b) + points[i + 1, j + 1] * b) * a
    return out


def test_gains_lie_between_those_of_the_map_and_hold_beyond_its_ends():
    points = np.random.default_rng(0).uniform(1, 4, (4, 5))
    spacing, origin = (0.2, 0.3), (0.15, -0.1)
    found = shading_gains(listed(gain_map(points, pitch=(1, 1), spacing=spacing, origin=origin)), SHAPE)
    np.testing.assert_allclose(found, bilinear(points, spacing, origin, SHAPE), rtol=1e-5)


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
def test_a_shaded_tinted_grey_is_even_after_developing(tmp_path, cfa):
    """Four maps, one per site, as phones write them; through a file."""
    rng = np.random.default_rng(1)
    sites = [(r, c) for r in (0, 1) for c in (0, 1)]
    maps = listed(*(gain_map(rng.uniform(1, 3, (3, 4)), first=site) for site in sites))
    gains = shading_gains(maps, SHAPE)
    even = raw_with(b"", np.full(SHAPE, 0.2, np.float32), cfa)
    shaded = raw_with(maps, even.mosaic / gains, cfa)
    np.testing.assert_allclose(develop(shaded), develop(even), atol=1e-5)
    write_dng(tmp_path / "a.dng", shaded)
    back = read_raw(tmp_path / "a.dng")
    assert back.metadata.opcodes_of_linear == maps
    np.testing.assert_allclose(develop(back), develop(even), atol=5e-3)
    assert np.ptp(develop(replace(shaded, metadata=Metadata()))) > 0.1


def test_a_highlight_stays_white_where_shading_is_made_up_for():
    maps = listed(gain_map([[3.0]], pitch=(1, 1)))
    assert develop(raw_with(maps, np.full(SHAPE, 0.9, np.float32))).min() == pytest.approx(1, abs=1e-5)


def test_the_preview_of_a_large_file_has_its_shading_made_up_for():
    shape = (2200, 2400)
    points = np.array([[3.0, 1.5, 3.0], [2.0, 1.0, 2.0], [3.0, 1.5, 3.0]])
    maps = listed(gain_map(points, pitch=(1, 1), end=shape))
    shaded = raw_with(maps, 0.2 / shading_gains(maps, shape))
    small = preview_of(shaded)
    assert small is not None
    assert max(small.shape) <= 1024
    assert np.ptp(small.reshape(-1, 3).astype(int), axis=0).max() <= 1


BROKEN = {
    "cut short": listed(gain_map([[2.0, 3.0]]))[:-4],
    "too few gains": listed(gain_map([[2.0, 3.0]], cut=4)),
    "no gain": listed(gain_map([[2.0, 0.0]])),
    "not a number": listed(gain_map([[2.0, np.nan]])),
    "of another plane": listed(gain_map([[2.0, 3.0]], plane=1)),
    "no pitch": listed(gain_map([[2.0, 3.0]], pitch=(0, 2))),
    "beyond any phone": listed(gain_map(np.full((1, 1 << 14), 2.0))),
    "another opcode": struct.pack(">5I", 1, 3, 0x01030000, 1, 0),
    "nothing": b"",
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_map_says_nothing(name):
    assert shading_gains(BROKEN[name], SHAPE) is None


def test_maps_of_an_area_or_beyond_the_image_touch_what_lies_inside():
    maps = listed(gain_map([[2.0]], first=(40, 10), pitch=(1, 1), end=(900, 12)))
    gains = shading_gains(maps, SHAPE)
    assert (gains[40:, 10:12] == 2).all()
    assert gains.sum() == gains.size + 8 * 2
