"""RAW files: writes CFA DNG, reads every Bayer file that LibRaw opens.

    DN = round(black + x (white - black)) as uint16, one uncompressed strip, little endian

One strip without compression costs disk and buys that a loader can map the pixels of a sample straight out of
a tar shard. The same image gives the same bytes: no clock, no software version. Tags are in `dng_tags`.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np
import rawpy

from fsid.errors import FsidError
from fsid.files import write_atomically
from fsid.sensor import dng_tags
from fsid.sensor.bad_pixels import bad_pixels, mended
from fsid.sensor.bare import BARE_SUFFIXES
from fsid.sensor.black_levels import BlackLevels
from fsid.sensor.colour import is_of_camera, published_matrices
from fsid.sensor.embedded import embedded_directories
from fsid.sensor.intact import check_intact, check_order
from fsid.sensor.metadata import Metadata, kept_metadata, libraw_metadata, taken
from fsid.sensor.mosaic import CFA_PATTERNS
from fsid.sensor.quantise import to_dn
from fsid.sensor.raw import Raw, check_raw
from fsid.sensor.tiff import (
    CFA,
    EXIF_IFD,
    PHOTOMETRIC,
    RGB,
    SAMPLE_FORMAT,
    STRIP_OFFSETS,
    SUB_IFD,
    Directory,
    Tag,
    Values,
    image_tags,
    read_directories,
    tiff_bytes,
)

_FULL_IMAGE, _REDUCED_IMAGE = 0, 1  # TIFF NewSubfileType
_FLOATING_POINT = 3  # TIFF SampleFormat
_LEAST_GAIN = 1e-3  # of a white balance, whose inverse a DNG's fractions hold
_MOST_RATIO = 99  # of its gains: LibRaw believes no more
_LARGEST = (1e-3, 2e3)  # number of a matrix that a DNG's fractions hold


def write_dng(target: str | Path | BinaryIO, raw: Raw, preview: np.ndarray | None = None) -> None:
    """Write `raw` as DNG to a path (whole or not at all) or to a binary file.

    preview: (h, w, 3) uint8 sRGB, stored as the image that file managers show. Values outside the camera's
    0..white_level are clipped as the camera would. FsidError for what a DNG does not hold: NaN, a filter
    pattern that is not Bayer, levels that are no whole DN, gains of a white balance or numbers of a matrix
    that come back as others, a noise level that is none.
    """
    check_raw(raw)
    data = _dng_bytes(raw, preview)
    if not isinstance(target, str | Path):
        target.write(data)
        return
    write_atomically(Path(target), data)


def dng_pixel_offset(dng: str | Path | BinaryIO) -> int:
    """Byte offset of the mosaic, (H, W) little-endian uint16, in a DNG written by `write_dng`.

    FsidError for a file that is no such DNG.
    """
    if isinstance(dng, str | Path):
        try:
            with Path(dng).open("rb") as file:
                return dng_pixel_offset(file)
        except OSError as error:
            raise FsidError(f"{dng}: cannot be read ({error.strerror})") from None
    dng.seek(0)
    offsets = _mosaic_directory(read_directories(dng)).get(STRIP_OFFSETS)
    if offsets is None:
        raise FsidError(f"{getattr(dng, 'name', 'DNG')}: not a DNG file that FSID wrote")
    return int(offsets.values[0])


@dataclass(frozen=True)
class RawHeader:
    """What a RAW file says of its exposure. iso, exposure_s: 0 where unknown. date: "2026-11-21" or ""."""

    camera: str
    iso: float
    exposure_s: float
    date: str


def read_header(path: str | Path) -> RawHeader:
    """Camera, ISO, exposure time and date of a RAW file, without its pixels. Errors as in `read_raw`."""
    with _opened(Path(path)) as (file, source):
        tags = source.values
        return RawHeader(
            camera=dng_tags.camera_name(tags),
            iso=_iso(file, tags),
            exposure_s=dng_tags.exposure_time_s(tags) or float(file.other.shutter_speed),
            date=dng_tags.date_taken(tags) or taken(file)[:10].replace(":", "-"),
        )


def read_raw(path: str | Path | BinaryIO) -> Raw:
    """Any Bayer RAW file as `Raw`: visible area, even size, levels, CFA of its first pixel, colour, noise.

    path: or a binary file, read from its start, such as io.BytesIO of what a shard holds.

    Black levels that differ between sites (in a DNG in any pattern, between rows and columns too, and by
    fractions of a DN) are subtracted each; `black_level` is their rounded mean. Pixels that a DNG calls bad
    are made of those around them. Unknown colour becomes the mean of the published matrices, unknown white
    balance (1, 1, 1), unknown ISO 0.
    FsidError: missing, truncated, zeros in place of pixels, no RAW, a bare mosaic, not Bayer (X-Trans,
    Foveon, linear DNG, monochrome), floating point, black levels or colours that cannot be.
    """
    given = Path(path) if isinstance(path, str) else path
    if isinstance(given, io.TextIOBase) or not (isinstance(given, Path) or hasattr(given, "seek")):
        raise FsidError(
            f"a {type(path).__name__} is no RAW file: give a path or a binary file, of bytes io.BytesIO(data)"
        )
    with _opened(given) as (file, source):
        return _from_libraw(file, source, _named(given))


@dataclass(frozen=True, eq=False)
class Stored:
    """What a RAW file holds. dn: (H, W) uint16, H and W even. first: (row, column) of its first pixel among
    all that are stored. cfa: of that pixel. black: of each. xyz_to_camera: (3, 3) of D65, None where none is
    stated, or one that cannot be."""

    dn: np.ndarray
    first: tuple[int, int]
    cfa: str
    black: BlackLevels
    white_level: int
    xyz_to_camera: np.ndarray | None

    @property
    def black_level(self) -> int:
        return round(self.black.mean())


def read_stored(path: str | Path) -> Stored:
    """Any Bayer RAW file as it is stored. Errors as in `read_raw`."""
    path = Path(path)
    with _opened(path) as (file, source):
        stored = _stored(file, source.values, path)
        return replace(stored, dn=stored.dn.copy())  # LibRaw's memory goes with the file


def _named(file: Path | BinaryIO) -> Path:
    """What messages call a file."""
    return file if isinstance(file, Path) else Path(str(getattr(file, "name", "the RAW file")))


@contextmanager
def _opened(given: Path | BinaryIO) -> Iterator[tuple[rawpy.RawPy, _Source]]:
    """LibRaw's view of a file and its TIFF tags; whatever LibRaw or the disk refuses becomes one line."""
    path = _named(given)
    try:
        if not isinstance(given, Path):
            given.seek(0)
            source = _read_source(given, path)
            given.seek(0)
        elif given.is_file():
            with given.open("rb") as stream:
                source = _read_source(stream, path)
        else:
            raise FsidError(f"{path}: no such RAW file")
    except OSError as error:
        raise FsidError(f"{path}: cannot be read ({error.strerror})") from None
    try:
        with rawpy.imread(str(given) if isinstance(given, Path) else given) as file:
            yield file, source
    except (rawpy.LibRawError, rawpy.NotSupportedError, NotImplementedError) as error:
        reason = error.args[0].decode() if error.args and isinstance(error.args[0], bytes) else error
        raise FsidError(f"{path}: not a RAW file that LibRaw can read ({reason})") from error
    except UnicodeEncodeError:
        raise FsidError(f"{path}: LibRaw opens no file whose name is not UTF-8; rename it") from None


def _dng_bytes(raw: Raw, preview: np.ndarray | None) -> bytes:
    _check_storable(raw)
    dn = to_dn(raw)
    mosaic_tags = image_tags(dn, CFA, _FULL_IMAGE) + dng_tags.mosaic_tags(raw)
    exif_tags = dng_tags.exif_tags(raw)
    exif = ((EXIF_IFD, Directory(exif_tags)),) if exif_tags else ()
    if preview is None:
        return tiff_bytes(Directory(mosaic_tags + dng_tags.camera_tags(raw), dn, exif))
    if preview.ndim != 3 or preview.shape[2] != 3 or preview.dtype != np.uint8:
        raise FsidError(f"a DNG preview must be (h, w, 3) uint8; got {preview.shape} {preview.dtype}")
    mosaic = (SUB_IFD, Directory(mosaic_tags, dn))
    first = image_tags(preview, RGB, _REDUCED_IMAGE) + dng_tags.camera_tags(raw)
    return tiff_bytes(Directory(first, preview, (mosaic, *exif)))


def _check_storable(raw: Raw) -> None:
    levels = raw.black_level, raw.white_level
    if not all(isinstance(level, int) for level in levels):
        raise FsidError(
            f"{raw.camera}: black and white level {levels} are not whole DN, as a DNG states them"
        )
    gains, largest = raw.white_balance, np.max(np.abs(raw.xyz_to_camera))
    if not (min(gains) > _LEAST_GAIN and max(gains) <= _MOST_RATIO * min(gains)):
        raise FsidError(
            f"{raw.camera}: white_balance {gains}: a DNG holds gains above {_LEAST_GAIN}, "
            f"the largest at most {_MOST_RATIO} times the least"
        )
    if not _LARGEST[0] <= largest <= _LARGEST[1]:
        raise FsidError(
            f"{raw.camera}: the largest number of xyz_to_camera is {largest:g}; "
            f"a DNG holds {_LARGEST[0]:g} to {_LARGEST[1]:g}"
        )
    if raw.noise is not None and not (
        np.shape(raw.noise.k) == np.shape(raw.noise.sigma2) == (4,)
        and np.isfinite([*raw.noise.k, *raw.noise.sigma2]).all()
    ):
        raise FsidError(f"{raw.camera}: {raw.noise}: a DNG holds four finite numbers of each")
    if not math.isfinite(raw.iso):
        raise FsidError(f"{raw.camera}: iso {raw.iso} must be finite, 0 where unknown")


@dataclass(frozen=True)
class _Source:
    """Tags of a RAW that is a TIFF or carries one, those of the mosaic's own directory foremost."""

    values: dict[int, Values]
    metadata: Metadata | None


def _mosaic_directory(directories: list[dict[int, Tag]]) -> dict[int, Tag]:
    """The directory that describes the CFA image, {} where none does."""
    return next((d for d in directories if PHOTOMETRIC in d and d[PHOTOMETRIC].values == (CFA,)), {})


def _read_source(file: BinaryIO, path: Path) -> _Source:
    directories = read_directories(file) or embedded_directories(file)
    mosaic = _mosaic_directory(directories)
    values: dict[int, Values] = {}
    for directory in (*directories, mosaic):
        values |= {code: tag.numbers for code, tag in directory.items()}
    described = mosaic or dng_tags.camera_name(values) != "unknown"
    if path.suffix.lower() in BARE_SUFFIXES and not described:  # LibRaw guesses
        raise FsidError(f"{path}: is a bare mosaic: write it as DNG first, see docs/capture-a-test-set.md")
    check_intact(file, mosaic, path)
    if dng_tags.DNG_VERSION in values:
        check_order(file, mosaic, path)
    if SAMPLE_FORMAT in mosaic and mosaic[SAMPLE_FORMAT].values == (_FLOATING_POINT,):
        raise FsidError(
            f"{path}: holds floating-point pixels, which LibRaw scales by a factor that it does not tell; "
            f"FSID needs the integers of a camera"
        )
    return _Source(values, kept_metadata(directories, mosaic) if directories else None)


def _from_libraw(file: rawpy.RawPy, source: _Source, path: Path) -> Raw:
    tags = source.values
    stored = _stored(file, tags, path)
    metadata = source.metadata or libraw_metadata(file)
    mosaic = stored.black.normalised(stored.dn, stored.black_level, stored.white_level)
    return Raw(
        mosaic=mended(mosaic, _bad_pixels(stored, tags)),
        cfa=stored.cfa,
        black_level=stored.black_level,
        white_level=stored.white_level,
        white_balance=_white_balance(file),
        xyz_to_camera=_xyz_to_camera(file, tags, path),
        camera=dng_tags.camera_name(tags),
        iso=_iso(file, tags),
        noise=dng_tags.noise_level(tags),
        metadata=metadata.within(stored.dn.shape[1], stored.dn.shape[0]),
    )


def _bad_pixels(stored: Stored, tags: dict[int, Values]) -> np.ndarray:
    """(H, W) bool: which pixels a DNG calls bad."""
    opcodes = dng_tags.opcodes_of_stored(tags)
    return bad_pixels(opcodes, stored.dn, stored.first, dng_tags.linearization(tags))


def _stored(file: rawpy.RawPy, tags: dict[int, Values], path: Path) -> Stored:
    """The pixels are in LibRaw's memory."""
    dn, colours, first = _visible(file, _pattern(file, path), tags)
    cfa = _cfa(file, colours, path)
    black = _black_levels(file, colours, tags, dn.shape, path)
    dn = dn[: dn.shape[0] - dn.shape[0] % 2, : dn.shape[1] - dn.shape[1] % 2]
    if dn.size == 0:
        raise FsidError(f"{path}: is smaller than one 2x2 tile of its filter pattern")
    level, white = black.mean(), int(file.white_level)
    if not (math.isfinite(level) and 0 <= round(level) < white):
        raise FsidError(f"{path}: black level {level:g} is not below white level {white}")
    matrix = _stated_matrix(file, tags)
    return Stored(dn, first, cfa, black, white, matrix if is_of_camera(matrix) else None)


def _visible(
    file: rawpy.RawPy, pattern: np.ndarray, tags: dict[int, Values]
) -> tuple[np.ndarray, np.ndarray, tuple[int, int]]:
    """The image without its masked margins, LibRaw's colours of its first 2x2 pixels, and where it begins.

    LibRaw starts at even pixels, and cuts rows off for some cameras; what a DNG says of pixels counts from
    where its ActiveArea starts.
    """
    height, width = file.raw_image.shape
    area = dng_tags.active_area(tags, (height, width))
    if area is not None:
        top, left, bottom, right = area
        moved = max(abs(file.sizes.top_margin - top), abs(file.sizes.left_margin - left))
        if moved <= 1 and bottom <= height and right <= width:
            colours = np.roll(pattern, (-top, -left), axis=(0, 1))
            return file.raw_image[top:bottom, left:right], colours, (top, left)
    first = file.sizes.top_margin, file.sizes.left_margin
    return file.raw_image_visible, file.raw_colors_visible[:2, :2], first


def _black_levels(
    file: rawpy.RawPy, colours: np.ndarray, tags: dict[int, Values], shape: tuple[int, int], path: Path
) -> BlackLevels:
    """What a DNG's tags say, else what LibRaw says of each colour; shape: of the active area."""
    tile = dng_tags.black_tile(tags, path)
    if tile is None:
        levels = np.asarray(file.black_level_per_channel, np.float64)
        return BlackLevels(levels[colours], np.zeros(shape[0]), np.zeros(shape[1]))
    of_row = dng_tags.black_deltas(tags, dng_tags.BLACK_DELTA_V, shape[0])
    return BlackLevels(tile, of_row, dng_tags.black_deltas(tags, dng_tags.BLACK_DELTA_H, shape[1]))


def _pattern(file: rawpy.RawPy, path: Path) -> np.ndarray:
    """(2, 2) LibRaw's colours of the pixels from the first one on, masked ones included."""
    if file.raw_type != rawpy.RawType.Flat or file.num_colors != 3 or file.raw_pattern is None:
        raise FsidError(f"{path}: has no Bayer mosaic (linear, Foveon or monochrome); FSID needs a Bayer RAW")
    if file.raw_pattern.shape != (2, 2):
        raise FsidError(f"{path}: is an X-Trans RAW; FSID needs a Bayer RAW")
    return file.raw_pattern


def _cfa(file: rawpy.RawPy, colours: np.ndarray, path: Path) -> str:
    names = file.color_desc.decode("ascii")
    cfa = "".join(names[i] for i in colours.ravel())
    if cfa not in CFA_PATTERNS:
        raise FsidError(f"{path}: its filter pattern {cfa} is not Bayer; FSID needs a Bayer RAW")
    return cfa


def _white_balance(file: rawpy.RawPy) -> tuple[float, float, float]:
    for gains in (file.camera_whitebalance, file.daylight_whitebalance):
        if min(gains[:3]) > 0 and math.isfinite(gains[0] / gains[1] + gains[2] / gains[1]):
            return gains[0] / gains[1], 1.0, gains[2] / gains[1]
    return 1.0, 1.0, 1.0


def _iso(file: rawpy.RawPy, tags: dict[int, Values]) -> float:
    return dng_tags.iso_speed(tags) or float(file.other.iso_speed)


def _stated_matrix(file: rawpy.RawPy, tags: dict[int, Values]) -> np.ndarray:
    """(3, 3) XYZ -> camera of D65, of a DNG's tags or else of LibRaw's table; zeros where neither has one."""
    matrix = dng_tags.d65_matrix(tags)
    return np.asarray(file.rgb_xyz_matrix[:3], np.float64) if matrix is None else matrix


def _xyz_to_camera(file: rawpy.RawPy, tags: dict[int, Values], path: Path) -> np.ndarray:
    matrix = _stated_matrix(file, tags)
    if not np.any(matrix):
        return published_matrices().mean(axis=0)
    if not is_of_camera(matrix):
        raise FsidError(f"{path}: its ColorMatrix has no inverse or no light in white; correct this tag")
    return matrix
