"""Cameras whose files are not at hand (NEF, CR3, RAF, X3F): a stand-in says what LibRaw would say of them."""

from contextlib import contextmanager
from datetime import datetime
from types import SimpleNamespace

import numpy as np
import pytest
import rawpy

from embedded_files import CR3, RAF
from fsid.errors import FsidError
from fsid.sensor import develop, read_raw, write_dng
from fsid.sensor.colour import published_matrices
from fsid.sensor.dng import read_header

BAYER = np.array([[0, 1], [3, 2]], np.uint8)
X_TRANS = np.array([[1, 0, 1, 1, 2, 1], [2, 1, 2, 0, 1, 0], [1, 2, 1, 1, 0, 1]] * 2, np.uint8)


def libraw(pattern: np.ndarray | None = BAYER, **said) -> SimpleNamespace:
    """A file that says nothing but its pixels, filters and levels, unless `said`."""
    dn = np.random.default_rng(0).integers(512, 16384, (47, 65)).astype(np.uint16)
    rows, columns = np.indices(dn.shape)
    tile = BAYER if pattern is None else pattern
    silent = {
        "raw_type": rawpy.RawType.Flat,
        "num_colors": 3,
        "color_desc": b"RGBG",
        "raw_pattern": pattern,
        "raw_colors_visible": tile[rows % len(tile), columns % len(tile)],
        "raw_image": dn,
        "raw_image_visible": dn,
        "black_level_per_channel": [512] * 4,
        "white_level": 16383,
        "camera_whitebalance": [0.0] * 4,
        "daylight_whitebalance": [0.0] * 4,
        "rgb_xyz_matrix": np.zeros((4, 3), np.float32),
        "sizes": SimpleNamespace(flip=0, top_margin=0, left_margin=0),
        "other": rawpy._rawpy.Other(0.0, 0.0, 0.0, 0.0, None, 0, ""),
        "lens": rawpy._rawpy.Lens("", "", 0.0, 0.0),
    }
    return SimpleNamespace(**{**silent, **said})


@pytest.fixture
def opened(monkeypatch, tmp_path):
    """A function that puts `file` in the place of what LibRaw reads and returns a path of that kind."""

    def put(file: SimpleNamespace, name: str = "picture.cr3"):
        monkeypatch.setattr(rawpy, "imread", lambda path: contextmanager(lambda: (yield file))())
        (tmp_path / name).write_bytes(b"\0\0\0\x18ftypcrx " + bytes(100))
        return tmp_path / name

    return put


def test_a_file_that_says_nothing_can_be_read_written_and_developed(opened, tmp_path, monkeypatch):
    path = opened(libraw())
    raw = read_raw(path)
    assert raw.mosaic.shape == (46, 64)
    assert (raw.cfa, raw.black_level, raw.white_level) == ("RGGB", 512, 16383)
    assert (raw.camera, raw.iso, raw.noise) == ("unknown", 0.0, None)
    assert (raw.white_balance, raw.metadata.orientation) == ((1.0, 1.0, 1.0), 1)
    np.testing.assert_array_equal(raw.xyz_to_camera, published_matrices().mean(axis=0))
    header = read_header(path)
    assert (header.camera, header.iso, header.exposure_s, header.date) == ("unknown", 0.0, 0.0, "")
    assert np.all(np.isfinite(develop(raw)))
    monkeypatch.undo()
    write_dng(tmp_path / "a.dng", raw)
    np.testing.assert_array_equal(read_raw(tmp_path / "a.dng").mosaic, raw.mosaic)


def test_what_libraw_says_of_an_exposure_reaches_the_rewritten_file(opened, tmp_path, monkeypatch):
    other = rawpy._rawpy.Other(1600.0, 0.02, 2.8, 35.0, datetime(2026, 11, 21, 5, 0, 7), 12, "A. Tester")
    lens = rawpy._rawpy.Lens("A lens 24-70", "Maker", 24.0, 70.0)
    matrix = np.array([[0.8, -0.2, -0.1], [-0.5, 1.3, 0.2], [-0.1, 0.2, 0.6], [0, 0, 0]])
    path = opened(
        libraw(
            other=other,
            lens=lens,
            sizes=SimpleNamespace(flip=6, top_margin=0, left_margin=0),
            camera_whitebalance=[2048.0, 1024.0, 1536.0, 1024.0],
            rgb_xyz_matrix=matrix,
        )
    )
    assert read_header(path).exposure_s == 0.02
    raw = read_raw(path)
    monkeypatch.undo()
    write_dng(tmp_path / "a.dng", raw)
    back, header = read_raw(tmp_path / "a.dng"), read_header(tmp_path / "a.dng")
    assert (header.iso, header.exposure_s, header.date) == (1600.0, 0.02, "2026-11-21")
    assert back.white_balance == pytest.approx((2.0, 1.0, 1.5))
    assert back.metadata.orientation == 6
    np.testing.assert_allclose(back.xyz_to_camera, matrix[:3], rtol=1e-6)
    tags = {tag.code: tag.values for tag in back.metadata.exif}
    assert tags[42036] == b"A lens 24-70\0"
    assert (tags[33437], tags[37386]) == ((14, 5), (35, 1))


@pytest.mark.parametrize(("name", "data"), [("a.cr3", CR3), ("a.raf", RAF)])
def test_the_exif_inside_other_formats_is_kept(opened, name, data):
    path = opened(libraw(), name)
    path.write_bytes(data)
    raw, header = read_raw(path), read_header(path)
    assert raw.camera == "Canon EOS R5"
    assert (header.iso, header.exposure_s, raw.metadata.orientation) == (3200.0, 1 / 125, 8)
    assert {tag.code: tag.values for tag in raw.metadata.exif}[42036] == b"RF50mm\0"
    for length in range(0, len(data), 7):  # cut short it says less, or is refused
        path.write_bytes(data[:length])
        assert read_raw(path).camera in ("unknown", "Canon", "Canon EOS R5")


@pytest.mark.parametrize(
    ("file", "words"),
    [
        (libraw(X_TRANS), "X-Trans"),
        (libraw(raw_type=rawpy.RawType.Stack, raw_pattern=None), "Foveon"),
        (libraw(None), "no Bayer mosaic"),
        (libraw(num_colors=1), "monochrome"),
        (libraw(color_desc=b"GMCY"), "GMYC is not Bayer"),
        (libraw(color_desc=b"RGBE"), "RGEB is not Bayer"),
        (libraw(white_level=512), "black level 512"),
        (libraw(raw_image_visible=np.zeros((1, 9), np.uint16)), "smaller than one"),
    ],
)
def test_what_is_not_bayer_is_said_in_one_line(opened, file, words):
    with pytest.raises(FsidError, match=rf"picture\.raf.*{words}") as caught:
        read_raw(opened(file, "picture.raf"))
    assert "\n" not in str(caught.value)
