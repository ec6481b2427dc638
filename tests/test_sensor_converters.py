"""What other programs see in a DNG: the same pixels, levels, filters, colours, and the source's metadata."""

import io
import json
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from fsid.sensor import (
    Raw,
    bayer_crop,
    clean_levels,
    develop_linear,
    linear_to_camera,
    load_profile,
    mosaic,
    read_raw,
    write_dng,
)
from fsid.sensor.dng import read_header
from fsid.sensor.dng_tags import d65_matrix
from fsid.sensor.metadata import exposure_metadata
from fsid.sensor.tiff import (
    ASCII,
    BYTE,
    CFA,
    EXIF_IFD,
    RATIONAL,
    SHORT,
    SRATIONAL,
    Directory,
    Tag,
    image_tags,
    rationals,
    tiff_bytes,
)

PROFILE = load_profile("pixel6")
PATCHES = np.array(
    [[0.2, 0.2, 0.2], [0.4, 0.1, 0.1], [0.1, 0.4, 0.1], [0.1, 0.1, 0.4], [0.3, 0.3, 0.1], [0.1, 0.3, 0.3]]
)
SIDE = 64


def chart() -> Raw:
    """Six patches of known linear sRGB, two rows of three."""
    image = PATCHES.astype(np.float32).reshape(2, 3, 3).repeat(SIDE, 0).repeat(SIDE, 1)
    matrix, gains = PROFILE.xyz_to_camera[1], (2.1, 1.0, 1.7)
    camera = mosaic(linear_to_camera(image, matrix, gains), PROFILE.cfa)
    return Raw(camera, PROFILE.cfa, 64, 1023, gains, matrix, PROFILE.camera, 800.0, PROFILE.level(800))


def patch_means(image: np.ndarray) -> np.ndarray:
    tiles = image.reshape(2, SIDE, 3, SIDE, 3)[:, 20:44, :, 20:44]
    return tiles.mean(axis=(1, 3)).reshape(6, 3)


MATRIX_A = [0.9, -0.3, -0.1, -0.4, 1.2, 0.2, -0.1, 0.2, 0.5]
MATRIX_D65 = [0.8, -0.2, -0.1, -0.5, 1.3, 0.2, -0.1, 0.2, 0.6]
CALIBRATION = np.array([[1.1, 0.0, 0.0], [0.0, 1.0, 0.02], [0.0, 0.0, 0.9]])
BALANCE = [2.0, 1.0, 1.5]


def foreign_dng(illuminants: tuple[int, int] = (17, 21)) -> bytes:
    """A DNG as a camera writes it: two illuminants, crop, lens and exposure, sideways."""
    dn = np.random.default_rng(0).integers(64, 1024, (48, 64)).astype(np.uint16)
    ascii_tags = {
        271: "Maker",
        272: "Model One",
        306: "2026:11:21 05:00:00",
        270: "a cup",
        315: "A. Tester",
        50708: "Maker One",
    }
    tags = (
        *image_tags(dn, CFA, 0),
        *(Tag(code, ASCII, text.encode() + b"\0") for code, text in ascii_tags.items()),
        Tag(274, SHORT, (6,)),
        Tag(33421, SHORT, (2, 2)),
        Tag(33422, BYTE, bytes((0, 1, 1, 2))),
        Tag(50706, BYTE, bytes((1, 4, 0, 0))),
        Tag(50714, SHORT, (64,)),
        Tag(50717, SHORT, (1023,)),
        Tag(50719, SHORT, (4, 2)),
        Tag(50720, SHORT, (56, 44)),
        Tag(50721, SRATIONAL, rationals(MATRIX_A)),
        Tag(50722, SRATIONAL, rationals(MATRIX_D65)),
        Tag(50724, SRATIONAL, rationals(CALIBRATION.ravel())),
        Tag(50727, RATIONAL, rationals(BALANCE)),
        Tag(50728, RATIONAL, rationals([0.5, 1.0, 0.6])),
        Tag(50730, SRATIONAL, rationals([0.35])),
        Tag(50736, RATIONAL, rationals([24.0, 70.0, 2.8, 4.0])),
        Tag(50778, SHORT, illuminants[:1]),
        Tag(50779, SHORT, illuminants[1:]),
    )
    exif = (
        Tag(33434, RATIONAL, (1, 50)),
        Tag(33437, RATIONAL, (28, 10)),
        Tag(34855, SHORT, (1600,)),
        Tag(36867, ASCII, b"2026:11:21 05:00:00\0"),
        Tag(37386, RATIONAL, (350, 10)),
        Tag(42036, ASCII, b"A lens 24-70\0"),
    )
    return tiff_bytes(Directory(tags, dn, ((EXIF_IFD, Directory(exif)),)))


@pytest.fixture
def foreign(tmp_path):
    (tmp_path / "foreign.dng").write_bytes(foreign_dng())
    return tmp_path / "foreign.dng"


def written(path, raw: Raw):
    write_dng(path, raw)
    return path


def test_a_rewritten_file_rewrites_to_the_same_bytes(foreign, tmp_path):
    once = written(tmp_path / "once.dng", read_raw(foreign))
    twice = written(tmp_path / "twice.dng", read_raw(once))
    assert once.read_bytes() == twice.read_bytes()
    np.testing.assert_array_equal(read_raw(once).mosaic, read_raw(foreign).mosaic)


def test_the_header_of_a_foreign_file_is_read(foreign):
    header = read_header(foreign)
    assert (header.camera, header.iso, header.exposure_s) == ("Maker One", 1600.0, 0.02)
    assert header.date == "2026-11-21"
    expected = np.diag(BALANCE) @ CALIBRATION @ np.reshape(MATRIX_D65, (3, 3))
    np.testing.assert_allclose(read_raw(foreign).xyz_to_camera, expected, rtol=1e-9)


@pytest.mark.parametrize("illuminants", [(17, 23), (17, 20), (17, 22), (3, 10), (14, 255), (20, 21)])
def test_the_matrix_of_the_light_nearest_to_d65_is_read(tmp_path, illuminants):
    """Standard light A and D50, D55 or D75, a lamp and clouds, a lamp and an unknown light, D55 and D65; and
    what this unit differs by from its model in the second one."""
    second, first = CALIBRATION @ np.reshape(MATRIX_D65, (3, 3)), np.reshape(MATRIX_A, (3, 3))
    for pair, matrix in ((illuminants, second), (illuminants[::-1], first)):
        (tmp_path / "a.dng").write_bytes(foreign_dng(pair))
        back = read_raw(written(tmp_path / "b.dng", read_raw(tmp_path / "a.dng")))
        np.testing.assert_allclose(back.xyz_to_camera, np.diag(BALANCE) @ matrix, rtol=1e-9)


def test_a_calibration_of_another_profile_does_not_count():
    tags = {50721: MATRIX_A, 50723: tuple(CALIBRATION.ravel()), 50931: b"one\0", 50932: b"another\0"}
    np.testing.assert_array_equal(d65_matrix(tags), np.reshape(MATRIX_A, (3, 3)))
    matched = d65_matrix(tags | {50932: b"one\0"})
    np.testing.assert_allclose(matched, CALIBRATION @ np.reshape(MATRIX_A, (3, 3)))


def test_what_was_replaced_is_not_contradicted_by_what_was_kept(foreign, tmp_path):
    raw = read_raw(foreign)
    other = replace(raw, camera="Another Camera", xyz_to_camera=PROFILE.xyz_to_camera[2], iso=400.0)
    back = read_raw(written(tmp_path / "other.dng", other))
    assert (back.camera, back.iso) == ("Another Camera", 400.0)
    np.testing.assert_allclose(back.xyz_to_camera, other.xyz_to_camera, rtol=1e-9)
    assert {50722, 50727}.isdisjoint({tag.code for tag in back.metadata.first})
    cut = read_raw(written(tmp_path / "cut.dng", bayer_crop(raw, 2, 2, 32, 32)))
    assert {50719, 50720}.isdisjoint({tag.code for tag in cut.metadata.mosaic})


def test_an_exposure_can_be_stated(tmp_path):
    raw = replace(chart(), metadata=exposure_metadata(0.1, 1.85, 6.81, "Main camera", orientation=8))
    header = read_header(written(tmp_path / "a.dng", raw))
    assert header.exposure_s == pytest.approx(0.1)
    assert {tag.code for tag in read_raw(tmp_path / "a.dng").metadata.exif} >= {33434, 33437, 37386, 42036}


def needs(program: str, package: str) -> None:
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not installed (Debian: apt-get install {package})")


def exiftool(path, *options) -> dict:
    run = subprocess.run(["exiftool", "-json", "-n", *options, path], capture_output=True, check=True)
    return json.loads(run.stdout)[0]


def test_exiftool_finds_nothing_wrong_and_the_same_metadata(foreign, tmp_path):
    needs("exiftool", "libimage-exiftool-perl")
    raw = read_raw(foreign)
    denoised = clean_levels(replace(raw, mosaic=raw.mosaic * 0.9))
    out = written(tmp_path / "denoised.dng", denoised)
    preview = np.zeros((16, 24, 3), np.uint8)
    write_dng(tmp_path / "preview.dng", denoised, preview)
    before = exiftool(foreign)
    for path in (out, tmp_path / "preview.dng"):
        assert str(exiftool(path, "-validate")["Validate"]).startswith("0 0")  # errors, warnings
        after = exiftool(path)
        for name in (
            *("Make", "Model", "UniqueCameraModel", "Orientation", "ModifyDate", "Artist", "ISO"),
            *("ColorMatrix1", "ColorMatrix2", "CalibrationIlluminant1", "CalibrationIlluminant2"),
            *("AsShotNeutral", "BaselineExposure", "DNGLensInfo", "DefaultCropOrigin", "DefaultCropSize"),
            *("ExposureTime", "FNumber", "DateTimeOriginal", "FocalLength", "LensModel", "CFAPattern2"),
        ):
            assert name in before, name
            assert after[name] == before[name], name
        assert (after["BlackLevel"], after["WhiteLevel"]) == (64 * 64, 1023 * 64)


def test_exiftool_reads_what_fsid_wrote(tmp_path):
    needs("exiftool", "libimage-exiftool-perl")
    raw = chart()
    found = exiftool(written(tmp_path / "a.dng", raw))
    assert (found["BlackLevel"], found["WhiteLevel"], found["ISO"]) == (64, 1023, 800)
    assert found["CFAPattern2"] == "1 2 0 1"
    neutral = [float(v) for v in str(found["AsShotNeutral"]).split()]
    np.testing.assert_allclose(neutral, [1 / gain for gain in raw.white_balance], rtol=1e-6)
    noise = [float(v) for v in found["NoiseProfile"].split()]
    assert raw.noise is not None
    np.testing.assert_allclose(noise[:2], [raw.noise.k[0], raw.noise.sigma2[0]], rtol=1e-9)


def test_darktable_develops_the_same_colours(tmp_path):
    """Its colour science adapts white to D50 and back, ours scales the matrix rows: 3 % apart at most."""
    needs("darktable-cli", "darktable")
    raw = chart()
    written(tmp_path / "a.dng", raw)
    subprocess.run(
        [
            *("darktable-cli", "a.dng", "a.pfm", "--icc-type", "LIN_REC709"),
            *("--apply-custom-presets", "false", "--core", "--library", ":memory:", "-t", "1"),
            *("--configdir", "dt", "--conf", "plugins/darkroom/workflow=none", "--disable-opencl"),
        ],
        cwd=tmp_path,
        capture_output=True,
        check=True,
        timeout=120,
    )
    file = io.BytesIO((tmp_path / "a.pfm").read_bytes())
    assert file.readline() == b"PF\n"
    width, height = map(int, file.readline().split())
    order = "<f4" if float(file.readline()) < 0 else ">f4"
    picture = np.frombuffer(file.read(), order).reshape(height, width, 3)[::-1]
    assert picture.shape == (*raw.mosaic.shape, 3)
    np.testing.assert_allclose(patch_means(picture), patch_means(develop_linear(raw)), atol=0.006)
    np.testing.assert_allclose(patch_means(picture), PATCHES, atol=0.01)
