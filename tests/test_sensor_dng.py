"""DNG: what is written opens in LibRaw with the same pixels and comes back as the same Raw."""

import io
import os
import struct
from dataclasses import replace

import numpy as np
import pytest
import rawpy
import tifffile
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fsid.errors import FsidError
from fsid.sensor import (
    CFA_PATTERNS,
    Layout,
    NoiseLevel,
    Raw,
    clean_levels,
    develop,
    dng_pixel_offset,
    load_profile,
    quantise,
    read_raw,
    to_dn,
    write_dng,
)
from fsid.sensor.colour import published_matrices
from fsid.sensor.dng import read_header, read_stored
from fsid.sensor.dng_tags import noise_profile
from fsid.sensor.frames import find_frames
from fsid.sensor.metadata import Metadata
from fsid.sensor.tiff import (
    ASCII,
    BYTE,
    CFA,
    LONG,
    SHORT,
    SRATIONAL,
    Directory,
    Tag,
    image_tags,
    read_directories,
    tiff_bytes,
)

HEIGHT, WIDTH = 34, 50
PREVIEW = np.random.default_rng(0).integers(0, 256, (17, 25, 3)).astype(np.uint8)


def _raw(cfa: str = "GBRG", seed: int = 0) -> Raw:
    rng = np.random.default_rng(seed)
    profile = load_profile("pixel6")
    return Raw(
        mosaic=rng.normal(0.2, 0.3, (HEIGHT, WIDTH)).astype(np.float32),
        cfa=cfa,
        black_level=64,
        white_level=1023,
        white_balance=(2.0 + rng.uniform(-0.1, 0.1), 1.0, 1.7),
        xyz_to_camera=published_matrices()[seed % 4],
        camera=profile.camera,
        iso=2371.375,
        noise=profile.level(2371.375),
    )


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
@pytest.mark.parametrize("preview", [None, PREVIEW], ids=["bare", "preview"])
def test_round_trip(tmp_path, cfa, preview):
    raw = _raw(cfa)
    assert raw.mosaic.min() < -0.05
    assert raw.mosaic.max() > 1.0
    path = tmp_path / "a.dng"
    write_dng(path, raw, preview)
    back = read_raw(path)
    np.testing.assert_array_equal(back.mosaic, quantise(raw).mosaic)
    assert back.mosaic.min() < -0.05
    assert back.mosaic.dtype == np.float32
    assert (back.cfa, back.black_level, back.white_level) == (cfa, 64, 1023)
    assert (back.camera, back.iso, back.noise) == (raw.camera, raw.iso, raw.noise)
    np.testing.assert_allclose(back.white_balance, raw.white_balance, rtol=1e-6)
    np.testing.assert_allclose(back.xyz_to_camera, raw.xyz_to_camera, rtol=1e-9)
    assert [p.name for p in tmp_path.iterdir()] == ["a.dng"]


@pytest.mark.parametrize(("large", "iso"), [(34866, 102400), (34867, 204800), (None, 65535)])
def test_an_iso_that_its_tag_does_not_hold_is_read_where_it_stands(tmp_path, large, iso):
    """Of a camera, which has no private data of FSID; and it stays where it was."""
    said = Tag(34855, SHORT, (65535,)), *((Tag(large, LONG, (iso,)),) if large else ())
    path = tmp_path / "a.dng"
    write_dng(path, replace(_raw("RGGB"), iso=0, metadata=Metadata(exif=said)))
    path.write_bytes(path.read_bytes().replace(b"FSID\0", b"None\0", 1))
    raw = read_raw(path)
    assert raw.iso == iso
    assert {tag.code: tag.values for tag in raw.metadata.exif} == {tag.code: tag.values for tag in said}


@pytest.mark.parametrize(("iso", "is_large"), [(65535.0, False), (102400.0, True), (321772.4, True)])
def test_an_iso_that_its_tag_does_not_hold_is_written_where_others_read_it(tmp_path, iso, is_large):
    """It stood in FSID's private data alone."""
    path = tmp_path / "a.dng"
    write_dng(path, replace(_raw("RGGB"), iso=iso))
    with path.open("rb") as file:
        exif = {code: tag.values for directory in read_directories(file) for code, tag in directory.items()}
    assert exif[34855] == (65535,)
    assert (exif.get(34864), exif.get(34866)) == (((2,), (round(iso),)) if is_large else (None, None))
    assert read_raw(path).iso == iso
    path.write_bytes(path.read_bytes().replace(b"FSID\0", b"None\0", 1))
    assert read_header(path).iso == round(iso)
    write_dng(path, read_raw(path))  # as a source said it, once
    assert read_header(path).iso == round(iso)


def test_the_zone_of_each_date_is_kept(tmp_path):
    """OffsetTime, -Original and -Digitized beside the dates they belong to."""
    zones = tuple(Tag(code, ASCII, b"+02:00\0") for code in (36880, 36881, 36882))
    write_dng(tmp_path / "a.dng", replace(_raw("RGGB"), metadata=Metadata(exif=zones)))
    kept = {tag.code: tag.values for tag in read_raw(tmp_path / "a.dng").metadata.exif}
    assert {code: kept.get(code) for code in (36880, 36881, 36882)} == {z.code: z.values for z in zones}


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
@pytest.mark.parametrize("preview", [None, PREVIEW], ids=["bare", "preview"])
def test_libraw_sees_the_same_picture(tmp_path, cfa, preview):
    raw = _raw(cfa)
    path = tmp_path / "a.dng"
    write_dng(path, raw, preview)
    with rawpy.imread(str(path)) as file:
        np.testing.assert_array_equal(file.raw_image_visible, to_dn(raw))
        pattern = "".join(file.color_desc.decode()[i] for i in file.raw_pattern.ravel())
        assert pattern == cfa
        assert file.black_level_per_channel == [64] * 4
        assert file.white_level == 1023
        np.testing.assert_allclose(file.camera_whitebalance[:3], raw.white_balance, rtol=1e-6)
        assert file.other.iso_speed == 2371
        assert file.postprocess(use_camera_wb=True, half_size=True).shape == (HEIGHT // 2, WIDTH // 2, 3)
        if preview is not None:
            np.testing.assert_array_equal(file.extract_thumb().data, preview)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"cfa": "rggb"}, "'rggb' is not a Bayer pattern"),
        ({"black_level": 64.5}, r"\(64\.5, 1023\) are not whole DN"),
        ({"white_balance": (0.0, 1.0, 1.5)}, r"white_balance \(0\.0, 1\.0, 1\.5\)"),
        ({"white_balance": (2.0, 1.0, np.nan)}, "white_balance"),
        ({"white_balance": (2.0, 1.0)}, "white_balance"),
        ({"xyz_to_camera": np.eye(2)}, "xyz_to_camera"),
        ({"xyz_to_camera": np.full((3, 3), np.nan)}, "xyz_to_camera"),
        ({"iso": np.nan}, "iso nan must be finite"),
    ],
)
def test_what_a_dng_does_not_hold_is_named(wrong, named, tmp_path):
    raw = Raw(np.zeros((4, 4), np.float32), "RGGB", 64, 1023, (2.0, 1.0, 1.5), np.eye(3), camera="Mine")
    with pytest.raises(FsidError, match=named):
        write_dng(tmp_path / "a.dng", replace(raw, **wrong))
    assert not list(tmp_path.iterdir())


def test_a_file_in_memory_is_read_like_one_on_the_disk(tmp_path):
    """As what a shard holds."""
    memory, path = io.BytesIO(), tmp_path / "a.dng"
    write_dng(memory, _raw())
    path.write_bytes(memory.getvalue())
    one, two = read_raw(path), read_raw(memory)
    np.testing.assert_array_equal(one.mosaic, two.mosaic)
    np.testing.assert_array_equal(one.xyz_to_camera, two.xyz_to_camera)
    for name in ("cfa", "black_level", "white_level", "white_balance", "camera", "iso", "noise", "metadata"):
        assert getattr(one, name) == getattr(two, name)
    with path.open("rb") as file:
        np.testing.assert_array_equal(read_raw(file).mosaic, one.mosaic)
    with pytest.raises(FsidError, match="the RAW file: "):
        read_raw(io.BytesIO(memory.getvalue()[:-100]))


def test_numbers_of_numpy_are_stored_as_pythons_are(tmp_path):
    raw = _raw()
    level = NoiseLevel(np.array(raw.noise.k), np.array(raw.noise.sigma2))
    write_dng(tmp_path / "python.dng", replace(raw, iso=800))
    write_dng(tmp_path / "numpy.dng", replace(raw, iso=np.int64(800), noise=level))
    assert (tmp_path / "numpy.dng").read_bytes() == (tmp_path / "python.dng").read_bytes()
    write_dng(tmp_path / "single.dng", replace(raw, iso=np.float32(800)))
    assert read_raw(tmp_path / "single.dng").iso == 800


def test_tifffile_reads_the_tags(tmp_path):
    raw = _raw()
    write_dng(tmp_path / "a.dng", raw, PREVIEW)
    with tifffile.TiffFile(tmp_path / "a.dng") as tiff:
        first = tiff.pages.first
        np.testing.assert_array_equal(first.asarray(), PREVIEW)
        np.testing.assert_array_equal(first.pages[0].asarray(), to_dn(raw))
        assert first.tags["UniqueCameraModel"].value == raw.camera
        assert first.tags["Make"].value == "Google"
        assert first.tags["CalibrationIlluminant1"].value == 21
        assert first.tags["Orientation"].value == 1
        assert first.tags["ExifTag"].value["ISOSpeedRatings"] == 2371
        level = first.pages[0].tags["NoiseProfile"].value
    red, green, blue = (0,), (1, 2), (3,)
    for plane, sites in enumerate((red, green, blue)):
        assert level[2 * plane] == np.mean([raw.noise.k[s] for s in sites])
        assert level[2 * plane + 1] == np.mean([raw.noise.sigma2[s] for s in sites])


def test_noise_profile_of_other_writers_is_exact(tmp_path):
    """Without FSID's private data the tag alone gives the level: bit for bit, greens alike."""
    level = NoiseLevel(k=(1e-3, 2e-3 / 3, 2e-3 / 3, 3e-3), sigma2=(1e-7, 0.0, 0.0, np.pi * 1e-6))
    buffer = io.BytesIO()
    write_dng(buffer, replace(_raw(), noise=level))
    data = buffer.getvalue().replace(b"FSID\0", b"ABCD\0")
    (tmp_path / "a.dng").write_bytes(data)
    back = read_raw(tmp_path / "a.dng")
    assert back.noise == level
    assert noise_profile(back.noise) == noise_profile(level)
    assert back.iso == 2371


def test_a_noise_profile_and_an_iso_that_were_corrected_afterwards_are_read(tmp_path):
    """By a program that knows tags, and leaves FSID's private data as they were."""
    path = tmp_path / "a.dng"
    write_dng(path, _raw())
    with tifffile.TiffFile(path, mode="r+") as file:
        level = (1e-3, 1e-6, 2e-3, 2e-6, 3e-3, 3e-6)
        file.pages[0].tags["NoiseProfile"].overwrite(level)
    back = read_raw(path)
    assert noise_profile(back.noise) == level
    assert back.iso == 2371.375
    path.write_bytes(path.read_bytes().replace((2371).to_bytes(2, "little"), (800).to_bytes(2, "little")))
    assert read_raw(path).iso == 800


def test_a_noise_level_in_single_precision_keeps_its_greens_apart(tmp_path):
    k, sigma2 = (tuple(np.float32(v)) for v in ((1e-3, 2e-3, 3.3e-3, 4e-3), (1e-6, 2e-6, 3e-6, 4e-6)))
    write_dng(tmp_path / "a.dng", replace(_raw(), noise=NoiseLevel(k, sigma2)))
    assert read_raw(tmp_path / "a.dng").noise == NoiseLevel(k, sigma2)


def test_unknown_stays_unknown(tmp_path):
    write_dng(tmp_path / "a.dng", replace(_raw(), noise=None, iso=0.0, camera=""))
    back = read_raw(tmp_path / "a.dng")
    assert (back.noise, back.iso, back.camera) == (None, 0.0, "unknown")


def test_a_clean_image_is_rounded_far_below_its_noise(tmp_path):
    raw = replace(_raw(), mosaic=np.random.default_rng(1).random((HEIGHT, WIDTH), np.float32))
    write_dng(tmp_path / "a.dng", clean_levels(raw))
    back = read_raw(tmp_path / "a.dng")
    assert (back.black_level, back.white_level) == (4096, 65472)
    weakest = min(load_profile("pixel6").level(800).sigma2) ** 0.5
    assert np.max(np.abs(back.mosaic - raw.mosaic)) < 0.01 * weakest


def test_the_same_image_gives_the_same_bytes_and_a_loader_can_map_them(tmp_path):
    raw = _raw()
    for preview in (None, PREVIEW):
        one, two = io.BytesIO(), io.BytesIO()
        write_dng(one, raw, preview)
        write_dng(two, raw, preview)
        assert one.getvalue() == two.getvalue()
        path = tmp_path / "a.dng"
        path.write_bytes(one.getvalue())
        offset = dng_pixel_offset(path)
        assert offset == dng_pixel_offset(io.BytesIO(one.getvalue()))
        assert offset % 2 == 0
        mapped = np.memmap(path, "<u2", "r", offset, (HEIGHT, WIDTH))
        np.testing.assert_array_equal(mapped, to_dn(raw))


def write_with_black(path, dn, *tags):
    """A DNG of GBRG with those (code, type, count, values) and a white level of 1023."""
    camera = [
        (50706, "B", 4, bytes((1, 4, 0, 0))),
        (50708, "s", 0, "Some camera"),
        (33421, "H", 2, (2, 2)),
        (33422, "B", 4, bytes((1, 2, 0, 1))),
        (50717, "I", 1, 1023),
    ]
    extra = [(*tag, True) for tag in (*camera, *tags)]
    tifffile.imwrite(path, dn, photometric="cfa", extratags=extra, metadata=None)


@pytest.mark.parametrize("side", [2, 4])
def test_black_levels_of_each_site_are_subtracted_each(tmp_path, side):
    """A camera whose sites have other blacks in a tile of 2 x 2 or 4 x 4, and 1 DN of light everywhere."""
    blacks = 60 + np.arange(side * side, dtype=np.uint16).reshape(side, side)
    repeat = (50713, "H", 2, (side, side))
    levels = (50714, "I", side * side, tuple(int(b) for b in blacks.ravel()))
    write_with_black(
        tmp_path / "a.dng", np.tile(blacks, (32 // side, 40 // side)) + np.uint16(1), repeat, levels
    )
    back = read_raw(tmp_path / "a.dng")
    assert back.cfa == "GBRG"
    np.testing.assert_allclose(back.mosaic, 1 / (1023 - back.black_level), rtol=1e-4)


@pytest.mark.parametrize(("top", "left"), [(2, 4), (3, 4), (2, 5), (3, 5)])
def test_black_levels_and_crop_count_from_the_active_area(tmp_path, top, left):
    """1 DN of light over black levels of each site, inside masked margins of any parity."""
    blacks = np.array([[60, 64], [68, 76]], np.uint16)
    dn = np.roll(np.tile(blacks + np.uint16(1), (20, 24)), (top, left), axis=(0, 1))
    dn[:top], dn[:, :left] = 0, 0
    area, repeat = (50829, "I", 4, (top, left, top + 33, left + 35)), (50713, "H", 2, (2, 2))
    crop = (50719, "H", 2, (2, 2)), (50720, "H", 2, (28, 26))
    write_with_black(tmp_path / "a.dng", dn, area, repeat, (50714, "I", 4, (60, 64, 68, 76)), *crop)
    back = read_raw(tmp_path / "a.dng")
    assert (back.cfa, back.mosaic.shape) == ("GBRG", (32, 34))
    np.testing.assert_allclose(back.mosaic, 1 / (1023 - 67), rtol=1e-4)
    write_dng(tmp_path / "b.dng", back)
    with tifffile.TiffFile(tmp_path / "b.dng") as file:
        assert tuple(file.pages.first.tags[50719].value) == (2, 2)


def opcodes(*each):
    """(number, parameters as uint32) of each, as an OpcodeList of a DNG holds them."""
    whole = [struct.pack(f">4I{len(p)}I", number, 0x01030000, 1, 4 * len(p), *p) for number, p in each]
    return struct.pack(">I", len(each)) + b"".join(whole)


BAD = ((9, 20), (10, 21), (20, 30), (20, 32))  # of the stored pixels; the last two are neighbours of a site
CALLED_BAD = {
    "one value": (4, (7, 0)),
    "places": (5, (0, 5, 0, *np.ravel(BAD), 900, 900)),
    "rectangles": (5, (0, 2, 3, 20, 30, 20, 32, 9, 20, 10, 21, 10, 21, 11, 22, 0, 0, 3, 5)),
}


@pytest.mark.parametrize("is_linearized", [False, True])
@pytest.mark.parametrize("called", CALLED_BAD)
def test_pixels_that_a_dng_calls_bad_are_made_of_those_around_them(tmp_path, called, is_linearized):
    """A ramp stays one; the list counts from the first pixel stored, and its values are those stored."""
    row, column = np.mgrid[:40, :48]
    dn = (100 + 2 * row + 4 * column).astype(np.uint16)
    area, level = (50829, "I", 4, (3, 5, 37, 45)), (50714, "I", 1, 64)
    tags = [area, level]
    if is_linearized:
        tags.append((50712, "H", 1024, tuple(range(1, 1025))))
    write_with_black(tmp_path / "good.dng", dn, *tags)
    expected = read_raw(tmp_path / "good.dng").mosaic
    dn[tuple(np.transpose(BAD))] = 7
    listed = opcodes((1, (1, 2, 3)), CALLED_BAD[called])
    write_with_black(tmp_path / "bad.dng", dn, *tags, (51008, "B", len(listed), listed))
    found = read_raw(tmp_path / "bad.dng").mosaic
    np.testing.assert_allclose(found, expected, atol=2.7 / (1023 - 64))  # neighbours see more of one side
    lone = tuple(np.transpose(BAD[:2]) - [[3], [5]])
    np.testing.assert_allclose(found[lone], expected[lone], atol=1e-5)
    assert np.sum(found != expected) <= len(BAD)


@pytest.mark.parametrize("broken", [b"", b"\0\0\0\1\0", opcodes((5, (0, 9, 9, 1)), (4, (7,)))[:-2]])
def test_a_broken_list_of_bad_pixels_says_nothing(tmp_path, broken):
    dn = np.full((32, 40), 70, np.uint16)
    write_with_black(tmp_path / "a.dng", dn, (50714, "I", 1, 64), (51008, "B", len(broken), broken))
    np.testing.assert_allclose(read_raw(tmp_path / "a.dng").mosaic, 6 / (1023 - 64), rtol=1e-5)


def test_a_dng_without_an_active_area_is_read_whole_whatever_its_camera(tmp_path):
    """LibRaw cuts the last rows off what a Leica SL2 made."""
    raw = replace(_raw(), mosaic=np.tile(_raw().mosaic, (2, 2)), camera="Leica SL2")
    write_dng(tmp_path / "a.dng", raw)
    np.testing.assert_array_equal(read_raw(tmp_path / "a.dng").mosaic, quantise(raw).mosaic)


def test_black_levels_of_rows_and_columns_are_subtracted(tmp_path):
    """BlackLevelDeltaV and H, from the first pixel of an odd active area on, and 5 DN of light everywhere."""
    rows, columns = np.arange(33) % 7 - 3.5, np.arange(41) % 5 - 1.0
    dn = np.zeros((36, 48), np.uint16)
    dn[3:, 5:46] = 64.5 + 5 + rows[:, None] + columns
    deltas = [
        (code, "2i", len(d), tuple(int(n) for delta in d for n in (2 * delta, 2)))
        for code, d in ((50716, rows), (50715, columns))
    ]
    area, level = (50829, "I", 4, (3, 5, 36, 46)), (50714, "2I", 1, (129, 2))
    write_with_black(tmp_path / "a.dng", dn, area, level, *deltas)
    raw = read_raw(tmp_path / "a.dng")
    np.testing.assert_allclose(raw.mosaic, 5 / (1023 - raw.black_level), atol=1e-6)
    write_dng(tmp_path / "b.dng", clean_levels(raw))
    np.testing.assert_allclose(read_raw(tmp_path / "b.dng").mosaic, raw.mosaic, atol=1e-5)


def test_fractions_of_a_black_level_are_kept(tmp_path):
    """Phones state the mean of their dark pixels as a rational; a quarter of a DN tints shadows."""
    levels = (50714, "2I", 4, (259, 4, 129, 2, 257, 4, 649, 10))
    write_with_black(tmp_path / "a.dng", np.full((32, 40), 70, np.uint16), (50713, "H", 2, (2, 2)), levels)
    back = read_raw(tmp_path / "a.dng")
    dn = back.black_level + back.mosaic[:2, :2] * (1023 - back.black_level)
    expected = 70 + back.black_level - np.array([[64.75, 64.5], [64.25, 64.9]])
    np.testing.assert_allclose(dn, expected, atol=1e-3)


@pytest.mark.parametrize(
    ("repeat", "levels", "level"),
    [
        ((1, 1), (64,) * 4, 64),
        ((2, 2), (64,), 64),
        ((1, 1), (64, 65, 66, 64), None),
        ((2, 2), (64, 65), None),
    ],
)
def test_black_levels_that_fit_no_pattern_are_one_or_refused(tmp_path, repeat, levels, level):
    """As where somebody writes four and forgets BlackLevelRepeatDim, which is 1 x 1 then."""
    tags = [(50714, "H", len(levels), levels if len(levels) > 1 else levels[0])]
    if repeat != (1, 1):
        tags.append((50713, "H", 2, repeat))
    write_with_black(tmp_path / "a.dng", np.full((32, 40), 70, np.uint16), *tags)
    if level is None:
        with pytest.raises(FsidError, match=r"a\.dng: its \d numbers of BlackLevel fit no"):
            read_raw(tmp_path / "a.dng")
    else:
        assert read_raw(tmp_path / "a.dng").black_level == level


@pytest.mark.parametrize("gains", [(0.11, 1.0, 9.0), (99.0, 1.0, 1.0), (1.0, 1.0, 0.0102)])
def test_any_white_balance_that_is_written_comes_back(tmp_path, gains):
    write_dng(tmp_path / "a.dng", replace(_raw(), white_balance=gains))
    np.testing.assert_allclose(read_raw(tmp_path / "a.dng").white_balance, gains, rtol=1e-5)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"white_balance": (500.0, 1.0, 1.0)}, "white_balance"),
        ({"white_balance": (20.0, 1.0, 0.1)}, "white_balance"),
        ({"xyz_to_camera": np.eye(3) * 1e-9}, "xyz_to_camera"),
        ({"xyz_to_camera": np.eye(3) * 1e12}, "xyz_to_camera"),
        ({"noise": NoiseLevel(k=(np.nan,) * 4, sigma2=(0.0,) * 4)}, "four finite numbers"),
        ({"noise": NoiseLevel(k=(0.1,) * 3, sigma2=(0.0,) * 3)}, "four finite numbers"),
    ],
)
def test_what_would_come_back_as_something_else_is_not_written(tmp_path, change, words):
    with pytest.raises(FsidError, match=words):
        write_dng(tmp_path / "a.dng", replace(_raw(), **change))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("rows", [(1,) * 9, (1, -1, 0) * 3, (1, *(0,) * 8), (-1, 0, 0, 0, 1, 0, 0, 0, 1)])
def test_colours_that_no_camera_has_are_refused(tmp_path, rows):
    """They ended with a traceback where a picture was developed, or with a picture of NaN."""
    matrix = Tag(50721, SRATIONAL, tuple(n for value in rows for n in (value, 1)))
    source = Metadata(first=(matrix, Tag(50778, SHORT, (21,))))
    write_dng(tmp_path / "a.dng", replace(_raw(), xyz_to_camera=np.reshape(rows, (3, 3)), metadata=source))
    with pytest.raises(FsidError, match=r"a\.dng: its ColorMatrix has no inverse"):
        read_raw(tmp_path / "a.dng")
    with pytest.raises(FsidError, match="no camera sees colours"):
        develop(replace(_raw(), xyz_to_camera=np.reshape(rows, (3, 3))))


def test_private_data_nested_without_end_is_none(tmp_path):
    nested = Tag(50740, BYTE, b"FSID\0" + b"[" * 100_000)
    levels = [Tag(50714, SHORT, (64,)), Tag(50717, SHORT, (1023,)), Tag(50706, BYTE, bytes((1, 4, 0, 0)))]
    pattern = [Tag(33421, SHORT, (2, 2)), Tag(33422, BYTE, bytes((0, 1, 1, 2)))]
    pixels = np.full((32, 40), 70, np.uint16)
    tags = (*image_tags(pixels, CFA, 0), *levels, *pattern, nested)
    (tmp_path / "a.dng").write_bytes(tiff_bytes(Directory(tags, pixels)))
    assert read_raw(tmp_path / "a.dng").noise is None


@pytest.mark.parametrize(
    ("levels", "level"),
    [
        ((50714, "H", 2, (64, 64)), 64),
        ((50714, "H", 2, (64, 1)), None),
        ((50714, "2I", 1, (64, 1)), 64),
        ((50714, "2I", 1, (64, 0)), None),
        ((50714, "2I", 1, (0, 0)), None),
    ],
)
def test_whole_numbers_are_no_fraction_and_a_fraction_over_0_no_number(tmp_path, levels, level):
    """Two equal levels, one of them too many, were 64 / 64 = 1, and 0 / 0 was a level of 0."""
    write_with_black(tmp_path / "a.dng", np.full((32, 40), 70, np.uint16), levels)
    if level is None:
        with pytest.raises(FsidError, match=r"a\.dng: its .*BlackLevel .*; correct"):
            read_raw(tmp_path / "a.dng")
    else:
        assert read_raw(tmp_path / "a.dng").black_level == level


def test_stored_integers_are_moved_by_whole_dn_and_never_fall_together(tmp_path):
    """Blacks of 60, 64.5, 68 and 75.5 DN about their mean, 67; what is at 0 or white stays there."""
    levels = (50714, "2I", 4, (60, 1, 129, 2, 68, 1, 151, 2))
    dn = np.concatenate([np.arange(40 * 30).reshape(30, 40), np.full((2, 40), 1023)]).clip(0, 1023)
    write_with_black(tmp_path / "a.dng", dn.astype(np.uint16), (50713, "H", 2, (2, 2)), levels)
    stored = read_stored(tmp_path / "a.dng")
    np.testing.assert_array_equal(stored.dn, dn)
    assert (stored.cfa, stored.black_level, stored.white_level) == ("GBRG", 67, 1023)
    moved = stored.black.levelled(stored.dn, 67, 1023).astype(int)
    expected = dn - np.tile([[-7, -2], [1, 8]], (16, 20))
    inside = (dn > 0) & (dn < 1023)
    np.testing.assert_array_equal(moved, np.where(inside, expected.clip(0, 1023), dn))


def test_rows_that_differ_in_black_level_are_made_alike(tmp_path):
    rows = (50716, "2i", 32, tuple(n for row in range(32) for n in (row % 3 - 1, 1)))
    write_with_black(tmp_path / "a.dng", np.full((32, 40), 70, np.uint16), (50714, "H", 1, 64), rows)
    frames = find_frames([tmp_path / "a.dng"], [], Layout())
    levelled = frames.read(frames.frames[0], Layout())
    np.testing.assert_array_equal(levelled, 70 - (np.arange(32) % 3 - 1)[:, None] + np.zeros(40))


def test_a_crop_ends_with_the_image(tmp_path):
    """Of an odd number of columns the last one is dropped, and a crop of all of them has one less."""
    crop = (50719, "H", 2, (0, 0)), (50720, "H", 2, (41, 32))
    write_with_black(tmp_path / "a.dng", np.full((32, 41), 70, np.uint16), (50714, "H", 1, 64), *crop)
    write_dng(tmp_path / "b.dng", read_raw(tmp_path / "a.dng"))
    with tifffile.TiffFile(tmp_path / "b.dng") as file:
        assert file.pages.first.shape == (32, 40)
        assert tuple(file.pages.first.tags[50720].value) == (40, 1, 32, 1)


def _write_other(path, kind):
    linear_raw, cfa = 34892, 32803
    shape, photometric = {
        "linear": ((32, 32, 3), linear_raw),
        "monochrome": ((32, 32), linear_raw),
        "x-trans": ((36, 36), cfa),
    }[kind]
    pixels = np.zeros(shape, np.uint16)
    pattern = bytes("RGB".index(c) for c in "GBGGRGRGRBGBGBGGRGGRGGBGBGBRGRGRGGBG")
    tags = (
        *image_tags(pixels, photometric, 0),
        Tag(50706, BYTE, bytes((1, 4, 0, 0))),
        Tag(50708, ASCII, b"Some camera\0"),
        Tag(33421, SHORT, (6, 6)),
        Tag(33422, BYTE, pattern),
    )
    path.write_bytes(tiff_bytes(Directory(tags[: None if kind == "x-trans" else -2], pixels)))


@pytest.mark.parametrize(
    ("kind", "words"),
    [("linear", "no Bayer mosaic"), ("monochrome", "no Bayer mosaic"), ("x-trans", "X-Trans")],
)
def test_a_raw_that_is_not_bayer_is_named(tmp_path, kind, words):
    _write_other(tmp_path / "other.dng", kind)
    with pytest.raises(FsidError, match=words) as caught:
        read_raw(tmp_path / "other.dng")
    assert "other.dng" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_floating_point_pixels_are_refused(tmp_path):
    """LibRaw scales the largest value, or white if that is more, to 16383, and tells neither."""
    write_with_black(tmp_path / "a.dng", np.full((32, 40), 70, np.float32), (50714, "H", 1, 64))
    with pytest.raises(FsidError, match=r"a\.dng: holds floating-point pixels"):
        read_raw(tmp_path / "a.dng")


@pytest.mark.parametrize("data", [b"", b"II*\0", b"hello, this is text\n" * 100, bytes(5000)])
def test_what_is_not_raw_is_named(tmp_path, data):
    (tmp_path / "note.dng").write_bytes(data)
    with pytest.raises(FsidError, match=r"note\.dng"):
        read_raw(tmp_path / "note.dng")


def test_a_missing_file_and_a_folder_are_named(tmp_path):
    for path in (tmp_path / "missing.dng", tmp_path):
        with pytest.raises(FsidError, match=str(path)):
            read_raw(path)


def test_a_name_that_is_no_text_is_named(tmp_path):
    path = tmp_path / os.fsdecode(b"b\xff.dng")
    write_dng(path, _raw())
    with pytest.raises(FsidError, match="name is not UTF-8"):
        read_raw(path)


def test_a_truncated_file_is_named(tmp_path):
    buffer = io.BytesIO()
    write_dng(buffer, _raw())
    data = buffer.getvalue()
    for kept in (len(data) - 1, len(data) // 2, 900, 500, 100, 9):
        (tmp_path / "short.dng").write_bytes(data[:kept])
        with pytest.raises(FsidError, match=r"short\.dng"):
            read_raw(tmp_path / "short.dng")


PLAIN, JPEG = (259, SHORT, (1,)), (259, SHORT, (7,))
TILES_64 = (322, LONG, (64,)), (323, LONG, (32,))


def write_parts(path, parts, *layout, size, tiles=False, gap=0):
    """A DNG of `size` (height, width) whose strips or tiles hold those bytes, `gap` bytes apart."""
    offsets, sizes = (324, 325) if tiles else (273, 279)
    tags = [
        (256, LONG, size[1:]),
        (257, LONG, size[:1]),
        (258, SHORT, (16,)),
        (262, SHORT, (CFA,)),
        (277, SHORT, (1,)),
        (sizes, LONG, tuple(map(len, parts))),
        (33421, SHORT, (2, 2)),
        (33422, BYTE, bytes((0, 1, 1, 2))),
        (50706, BYTE, bytes((1, 4, 0, 0))),
        (50708, ASCII, b"Some camera\0"),
        *layout,
    ]
    places = np.cumsum([0, *(len(part) + gap for part in parts)])[:-1]
    for start in (0, len(tiff_bytes(Directory(tuple(Tag(*t) for t in (*tags, (offsets, LONG, places))))))):
        found = (offsets, LONG, tuple(int(place) + start for place in places))
        data = tiff_bytes(Directory(tuple(Tag(*t) for t in (*tags, found))))
    path.write_bytes(data + bytes(gap).join(parts))


def write_tiles(path, *tiles):
    """A DNG 32 high whose tiles, 64 wide, hold those bytes."""
    write_parts(path, tiles, JPEG, *TILES_64, size=(32, 64 * len(tiles)), tiles=True)


def grey_jpeg(components: int) -> bytes:
    """A lossless JPEG of 32 x 64 values of 16 bits, all 32768."""
    frame = b"".join(bytes((component, 17, 0)) for component in range(components))
    scan = b"".join(bytes((component, 0)) for component in range(components))
    parts = (
        b"\xff\xd8",
        b"\xff\xc4\x00\x14\x00" + bytes((1, *15 * (0,), 0)),  # one code, 0: no difference to the last pixel
        b"\xff\xc3\x00" + bytes((8 + len(frame), 16, 0, 32, 0, 64 // components, components)) + frame,
        b"\xff\xda\x00" + bytes((6 + len(scan), components)) + scan + bytes((1, 0, 0)),
        bytes(32 * 64 // 8),
        b"\xff\xd9",
    )
    return b"".join(parts)


GREY_JPEG = grey_jpeg(1)


@pytest.mark.parametrize("last", [GREY_JPEG, GREY_JPEG + b"\0", GREY_JPEG + bytes(5000), GREY_JPEG[:-1]])
def test_a_compressed_file_is_read_whatever_follows_its_end(tmp_path, last):
    write_tiles(tmp_path / "a.dng", GREY_JPEG, last)
    raw = read_raw(tmp_path / "a.dng")
    assert raw.mosaic.shape == (32, 128)
    np.testing.assert_allclose(raw.mosaic, 32768 / 65535)


def test_three_tiles_of_two_components_are_read(tmp_path):
    """Of two, which fill the width, LibRaw would read each row twice as long as it is."""
    write_tiles(tmp_path / "a.dng", *[grey_jpeg(2)] * 3)
    np.testing.assert_allclose(read_raw(tmp_path / "a.dng").mosaic, np.full((32, 192), 32768 / 65535))


@pytest.mark.parametrize("kept", [0, 1, 60])
def test_zeros_for_compressed_pixels_are_a_broken_copy(tmp_path, kept):
    write_tiles(tmp_path / "a.dng", GREY_JPEG, GREY_JPEG[:kept] + bytes(5000 - kept))
    with pytest.raises(FsidError, match=r"a\.dng: corrupt.*copy it again"):
        read_raw(tmp_path / "a.dng")


DN = np.arange(32 * 40, dtype="<u2").reshape(32, 40)
STRIPS, TILE = [DN[:16].tobytes(), DN[16:].tobytes()], [np.pad(DN, ((0, 0), (0, 24))).tobytes()]
ROWS_16, ROWS_32 = (278, LONG, (16,)), (278, LONG, (32,))


@pytest.mark.parametrize(
    ("kind", "parts", "layout", "laid"),
    [
        (None, STRIPS, [PLAIN, ROWS_16], {}),
        ("strips", STRIPS, [PLAIN, ROWS_16], {"gap": 2}),
        ("strips", [GREY_JPEG] * 2, [JPEG, ROWS_32], {"size": (64, 64)}),
        ("a tile wider", TILE, [PLAIN, *TILES_64], {"tiles": True}),
        ("a tile wider", [GREY_JPEG] * 2, [JPEG, *TILES_64], {"size": (64, 60), "tiles": True}),
        ("JPEGs of 2", [grey_jpeg(2)] * 2, [JPEG, *TILES_64], {"size": (32, 128), "tiles": True}),
        ("interleaved", STRIPS, [PLAIN, ROWS_16, (50975, SHORT, (2,))], {}),
        ("interleaved", STRIPS, [PLAIN, ROWS_16, (52547, SHORT, (2,))], {}),
    ],
)
def test_pixels_that_libraw_would_look_for_elsewhere_are_refused(tmp_path, kind, parts, layout, laid):
    """It reads strips from the first one on, of JPEG strips the first, and no more than the width."""
    path = tmp_path / "a.dng"
    write_parts(path, parts, *layout, **{"size": DN.shape, **laid})
    if kind is None:
        np.testing.assert_array_equal(read_stored(path).dn, DN)
    else:
        with pytest.raises(FsidError, match=rf"a\.dng: holds its pixels in {kind}"):
            read_raw(path)


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.integers(0, 819), st.integers(0, 255)), min_size=1, max_size=4))
def test_mutated_headers_end_with_an_image_or_one_line(tmp_path, changes):
    buffer = io.BytesIO()
    write_dng(buffer, _raw())
    data = bytearray(buffer.getvalue())
    for place, value in changes:
        data[place] = value
    (tmp_path / "fuzz.dng").write_bytes(data)
    try:
        raw = read_raw(tmp_path / "fuzz.dng")
    except FsidError as error:
        lines = str(error).splitlines()
    else:
        lines = ["fuzz.dng"]
        assert np.all(np.isfinite(raw.mosaic))
    assert len(lines) == 1
    assert "fuzz.dng" in lines[0]


def test_a_folder_that_is_not_there_leaves_nothing_behind(tmp_path):
    with pytest.raises(FsidError, match="nowhere"):
        write_dng(tmp_path / "nowhere" / "a.dng", _raw())
    assert list(tmp_path.iterdir()) == []


def test_a_preview_of_the_wrong_type_is_refused():
    with pytest.raises(FsidError, match="preview"):
        write_dng(io.BytesIO(), _raw(), np.zeros((4, 4, 3), np.float32))


def test_pixel_offset_of_no_dng_is_an_error(tmp_path):
    (tmp_path / "note.dng").write_bytes(b"text")
    with pytest.raises(FsidError, match=r"note\.dng"):
        dng_pixel_offset(tmp_path / "note.dng")
    with pytest.raises(FsidError, match=r"none\.dng: cannot be read"):
        dng_pixel_offset(tmp_path / "none.dng")


def test_pixel_offset_of_a_file_that_was_read_before():
    file = io.BytesIO()
    write_dng(file, Raw(np.zeros((32, 32), np.float32), "RGGB", 64, 1023, (2.0, 1.0, 1.5), np.eye(3)))
    offset = dng_pixel_offset(file)
    read_raw(file)
    assert dng_pixel_offset(file) == offset
