"""Photographs of users: every number of bits, colour space and order of bytes that a file states."""

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image

from fsid.dataset import read_photo
from fsid.errors import FsidError
from fsid.sensor import srgb_encode

WIDE = np.random.default_rng(0).integers(0, 2**16, (40, 48, 3)).astype(np.uint16)
COLOURS = (WIDE >> 8).astype(np.uint8)
D50 = (0.9642, 1.0, 0.8249)
SRGB_IN_D50 = ((0.4361, 0.2225, 0.0139), (0.3851, 0.7169, 0.0971), (0.1431, 0.0606, 0.7141))


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(levels: np.ndarray, *more: bytes) -> bytes:
    """A PNG of (H, W, C) levels of 8 or 16 bits, with further chunks before the pixels."""
    height, width, channels = levels.shape
    kind = {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    header = struct.pack(">IIBBBBB", width, height, 8 * levels.itemsize, kind, 0, 0, 0)
    rows = b"".join(b"\0" + row.astype(levels.dtype.newbyteorder(">")).tobytes() for row in levels)
    chunks = (chunk(b"IHDR", header), *more, chunk(b"IDAT", zlib.compress(rows)), chunk(b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def profile(name: str, gamma: float, *, grey: bool = False) -> bytes:
    """An ICC profile (version 2) of the primaries of sRGB, or of grey, and a pure power."""

    def xyz(values: tuple[float, ...]) -> bytes:
        return b"XYZ \0\0\0\0" + struct.pack(">3i", *(round(value * 65536) for value in values))

    text = name.encode() + b"\0"
    curve = b"curv\0\0\0\0" + struct.pack(">IH", 1, round(gamma * 256))
    tags = {b"desc": b"desc\0\0\0\0" + struct.pack(">I", len(text)) + text + bytes(78), b"wtpt": xyz(D50)}
    if grey:
        tags[b"kTRC"] = curve
    else:
        for colour, place in zip((b"r", b"g", b"b"), SRGB_IN_D50, strict=True):
            tags |= {colour + b"XYZ": xyz(place), colour + b"TRC": curve}
    start, table, data = 132 + 12 * len(tags), b"", b""
    for tag, content in tags.items():
        table += tag + struct.pack(">II", start + len(data), len(content))
        data += content + bytes(-len(content) % 4)
    space = b"GRAY" if grey else b"RGB "
    header = struct.pack(
        ">I4sI4s4s4s12x4s", start + len(data), b"lcms", 0x02400000, b"mntr", space, b"XYZ ", b"acsp"
    )
    header = header.ljust(68, b"\0") + xyz(D50)[8:]
    return header.ljust(128, b"\0") + struct.pack(">I", len(tags)) + table + data


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize(
    "settings",
    [{}, {"compression": "zlib", "predictor": True}, {"tile": (16, 16)}],
    ids=str,
)
def test_sixteen_bit_colours_of_tiff_keep_their_values(settings: dict, order: str, tmp_path: Path) -> None:
    """At 8 bits their steps would be as large in the shadows as a camera's read noise."""
    tifffile.imwrite(tmp_path / "a.tif", WIDE, photometric="rgb", byteorder=order, **settings)
    np.testing.assert_array_equal(read_photo(tmp_path / "a.tif"), (WIDE / np.float32(65535)))


@pytest.mark.parametrize("channels", [3, 4])
def test_sixteen_bit_colours_of_png_keep_their_values(channels: int, tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(png(np.dstack([WIDE, WIDE[..., :1]])[..., :channels]))
    np.testing.assert_array_equal(read_photo(tmp_path / "a.png"), (WIDE / np.float32(65535)))


def test_sixteen_bit_channels_one_after_the_other_are_not_read_as_eight(tmp_path: Path) -> None:
    """Pillow takes every other byte of such a file for a pixel; of a compressed one the upper bytes."""
    planes = WIDE.transpose(2, 0, 1)
    for name, packing in (("plain", None), ("packed", "zlib")):
        tifffile.imwrite(
            tmp_path / f"{name}.tif", planes, photometric="rgb", planarconfig="separate", compression=packing
        )
    with pytest.raises(FsidError, match=r"plain\.tif: .* channels lie one after the other; save them interl"):
        read_photo(tmp_path / "plain.tif")
    np.testing.assert_array_equal(np.rint(read_photo(tmp_path / "packed.tif") * 255), COLOURS)


@pytest.mark.parametrize("bits", [8, 16])
def test_a_profile_is_known_by_what_it_does_and_not_by_its_name(bits: int, tmp_path: Path) -> None:
    """The profile of this name that Krita and others embed is linear."""
    linear = chunk(b"iCCP", b"a\0\0" + zlib.compress(profile("sRGB-elle-V2-g10.icc", 1.0)))
    levels = COLOURS if bits == 8 else WIDE
    (tmp_path / "a.png").write_bytes(png(levels, linear))
    light = np.rint(levels / (1 if bits == 8 else 257)) / 255
    np.testing.assert_allclose(read_photo(tmp_path / "a.png"), srgb_encode(light), atol=1.5 / 255)


@pytest.mark.parametrize("grey", [True, False])
@pytest.mark.parametrize("bits", [8, 16])
def test_grey_is_brought_to_srgb_by_a_profile_of_greys_or_of_colours(bits: int, grey: bool, tmp_path: Path):
    stated = chunk(b"iCCP", b"a\0\0" + zlib.compress(profile("Gamma 1.8", 1.8, grey=grey)))
    levels = (COLOURS if bits == 8 else WIDE)[..., :1]
    (tmp_path / "a.png").write_bytes(png(levels, stated))
    expected = srgb_encode((levels / (2**bits - 1)) ** 1.8).repeat(3, axis=2)
    np.testing.assert_allclose(read_photo(tmp_path / "a.png"), expected, atol=2 / 255)


def test_the_gamma_of_a_png_is_heeded_where_nothing_says_that_it_is_srgb(tmp_path: Path) -> None:
    linear, usual = (chunk(b"gAMA", struct.pack(">I", gamma)) for gamma in (100000, 45455))
    for chunks, expected in [
        ((linear,), srgb_encode(WIDE / 65535)),
        ((usual,), WIDE / 65535),
        ((linear, chunk(b"sRGB", b"\0")), WIDE / 65535),
        ((chunk(b"gAMA", bytes(4)),), WIDE / 65535),
    ]:
        (tmp_path / "a.png").write_bytes(png(WIDE, *chunks))
        np.testing.assert_allclose(read_photo(tmp_path / "a.png"), expected, atol=1e-4)


def test_adobe_rgb_of_a_camera_that_embeds_no_profile_is_brought_to_srgb(tmp_path: Path) -> None:
    """DCF 2.0: a file whose interoperability index is R03, and whose name begins with an underscore."""
    entries = [
        (0x8769, 4, 1, struct.pack(">I", 26)),
        (0xA005, 4, 1, struct.pack(">I", 44)),
        (1, 2, 4, b"R03\0"),
    ]
    folders = (struct.pack(">HHHI4sI", 1, *entry, 0) for entry in entries)
    exif = b"Exif\0\0MM\0*" + struct.pack(">I", 8) + b"".join(folders)
    Image.new("RGB", (32, 32), (100, 150, 120)).save(tmp_path / "_IMG.jpg", exif=exif, quality=100)
    with Image.open(tmp_path / "_IMG.jpg") as image:
        light = (np.asarray(image)[0, 0] / 255) ** (563 / 256)
    to_xyz = [[0.57667, 0.18556, 0.18823], [0.29734, 0.62736, 0.07529], [0.02703, 0.07069, 0.99134]]
    to_srgb = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
    expected = srgb_encode(np.array(to_srgb) @ to_xyz @ light)
    np.testing.assert_allclose(read_photo(tmp_path / "_IMG.jpg")[0, 0], expected, atol=1e-3)


def test_tiles_of_a_width_that_cannot_be_are_one_line(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "a.tif", COLOURS, photometric="rgb", tile=(16, 16))
    with tifffile.TiffFile(tmp_path / "a.tif", mode="r+b") as file:
        file.pages[0].tags["TileWidth"].overwrite(1 << 30)
    with pytest.raises(FsidError, match=r"a\.tif: cannot be read as a photograph"):
        read_photo(tmp_path / "a.tif")


def test_the_pixels_of_a_phone_are_no_attack(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pillow warns of half as many as it refuses; a warning is an error in these tests."""
    file = io.BytesIO()
    Image.fromarray(COLOURS).save(file, "PNG")
    (tmp_path / "a.png").write_bytes(file.getvalue())
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1500)
    assert read_photo(tmp_path / "a.png").shape == (40, 48, 3)
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 500)
    with pytest.raises(FsidError, match=r"a\.png: has more than 178 million pixels; make it smaller"):
        read_photo(tmp_path / "a.png")
