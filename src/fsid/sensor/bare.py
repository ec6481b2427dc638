"""A mosaic without metadata, in a file or in memory: the caller says what the camera would have written.

    .raw .bin   uint16 little endian, row by row, no header (`width` and `height` needed)
    .npy        integers (H, W), or packed (H/2, W/2, 4) in the order R, Gr, Gb, B
    .png .tif   16-bit (or 8-bit), one channel

The values are DN; `x = (DN - black_level) / (white_level - black_level)` as everywhere.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tifffile
from PIL import Image

from fsid.errors import FsidError
from fsid.sensor.black_levels import BlackLevels
from fsid.sensor.colour import published_matrices
from fsid.sensor.defects import GAUSS_MAD
from fsid.sensor.mosaic import check_cfa, unpack
from fsid.sensor.quantise import MAX_DN, check_levels
from fsid.sensor.raw import Raw

MAX_PIXELS = 1 << 29
_PLACES_DIFFER, _SIGNIFICANT = 0.05, 8.0  # of the level, and in errors: colours differ by far more
_LEAST_PIXELS = 256
BEYOND_WHITE, BEYOND_WHITE_SHARE = 1.1, 0.001  # of the range; of the values: the white level is wrong
logging.getLogger("tifffile").setLevel(
    logging.CRITICAL
)  # what is wrong with a file is said in one line, here
HEADERLESS_SUFFIXES = (".raw", ".bin")
BARE_SUFFIXES = (*HEADERLESS_SUFFIXES, ".npy", ".png", ".tif", ".tiff")


@dataclass(frozen=True)
class Layout:
    """What a bare mosaic does not say; None where it must be found. cfa "MONO" for no colour filters.

    black_level: DN, fractions included; of all pixels, or of the sites R, Gr, Gb, B.
    """

    iso: float | None = None
    cfa: str | None = None
    black_level: float | Sequence[float] | None = None
    white_level: int | None = None
    width: int | None = None
    height: int | None = None

    def read(self, path: Path) -> Raw:
        """The Bayer mosaic at `path`; FsidError as `read_mosaic`, and where filters or levels are missing."""
        if self.cfa is None or self.black_level is None or self.white_level is None:
            raise FsidError(f"{path}: a bare mosaic needs its filter pattern, black level and white level")
        return read_mosaic(
            path,
            cfa=self.cfa,
            black_level=self.black_level,
            white_level=self.white_level,
            width=self.width,
            height=self.height,
            iso=self.iso or 0.0,
        )


def read_mosaic(
    path: str | Path,
    *,
    cfa: str,
    black_level: float | Sequence[float],
    white_level: int,
    width: int | None = None,
    height: int | None = None,
    white_balance: tuple[float, float, float] = (1.0, 1.0, 1.0),
    xyz_to_camera: np.ndarray | None = None,
    camera: str = "unknown",
    iso: float = 0.0,
) -> Raw:
    """The mosaic file at `path` as `Raw`; an odd last row or column is dropped.

    width, height: pixels, needed for .raw and .bin, checked for the others where given. The rest is that of
    `raw_from_dn`. FsidError: missing or unreadable file, wrong size, and as there.
    """
    check_cfa(cfa, f"{path}: cfa")
    return raw_from_dn(
        read_dn(path, cfa=cfa, width=width, height=height),
        cfa=cfa,
        black_level=black_level,
        white_level=white_level,
        white_balance=white_balance,
        xyz_to_camera=xyz_to_camera,
        camera=camera,
        iso=iso,
        source=str(path),
    )


def raw_from_dn(
    dn: np.ndarray,
    *,
    cfa: str,
    black_level: float | Sequence[float],
    white_level: int,
    white_balance: tuple[float, float, float] = (1.0, 1.0, 1.0),
    xyz_to_camera: np.ndarray | None = None,
    camera: str = "unknown",
    iso: float = 0.0,
    source: str = "the mosaic",
) -> Raw:
    """A mosaic in memory, `dn` (H, W) integers as the camera stored them, as `Raw`.

    An odd last row or column is dropped. cfa: of the first 2x2 pixels, row by row. black_level: DN, of all
    pixels or of the sites R, Gr, Gb, B, fractions included; the Raw states their rounded mean. white_level:
    DN. white_balance: gains of R, G, B. xyz_to_camera: (3, 3) DNG `ColorMatrix1` for D65, the mean of the
    published matrices where None. source: for messages. FsidError: another shape, not integers, values above
    16 bits, far beyond the white level, or such as no Bayer mosaic has.
    """
    check_cfa(cfa, f"{source}: cfa")
    black = BlackLevels.stated(black_level, cfa, source)
    for stated in (black.tile.min(), black.tile.max()):
        check_levels(stated, white_level, source)
    if white_level != int(white_level):
        raise FsidError(f"{source}: white level {white_level} is no whole DN")
    dn = _even(np.asarray(dn), source)
    check_bayer(dn, source)
    level, white_level = round(black.mean()), int(white_level)
    check_white(dn, level, white_level, source)
    return Raw(
        mosaic=black.normalised(dn, level, white_level),
        cfa=cfa,
        black_level=level,
        white_level=white_level,
        white_balance=white_balance,
        xyz_to_camera=published_matrices().mean(axis=0) if xyz_to_camera is None else xyz_to_camera,
        camera=camera,
        iso=iso,
    )


def read_dn(
    path: str | Path, *, cfa: str | None = None, width: int | None = None, height: int | None = None
) -> np.ndarray:
    """The integers (H, W) of the mosaic file at `path`; an odd last row or column is dropped.

    cfa: needed for packed .npy only. FsidError: missing or unreadable file, wrong size, not integers, values
    above 16 bits.
    """
    path = Path(path)
    try:
        if not path.is_file():
            raise FsidError(f"{path}: no such mosaic file")
        dn = _read(path, cfa, width, height)
    except OSError as error:
        raise FsidError(f"{path}: cannot be read ({error.strerror})") from None
    even = _even(dn, str(path))
    if (height or dn.shape[0], width or dn.shape[1]) != dn.shape:
        raise FsidError(f"{path}: is {dn.shape[1]}x{dn.shape[0]}, not {width}x{height}; correct the size")
    return even


def _even(dn: np.ndarray, source: str) -> np.ndarray:
    """Without an odd last row or column; FsidError, naming `source`, unless it is a mosaic of DN."""
    if dn.ndim != 2 or min(dn.shape) < 2:
        raise FsidError(f"{source}: holds an array of shape {dn.shape}, not a mosaic (height, width)")
    if dn.dtype.kind not in "ui" or dn.min() < 0 or dn.max() > MAX_DN:
        raise FsidError(
            f"{source}: holds {dn.dtype} values; a mosaic holds DN as integers from 0 to {MAX_DN}"
        )
    return dn[: dn.shape[0] // 2 * 2, : dn.shape[1] // 2 * 2]


def check_bayer(dn: np.ndarray, path: str | Path) -> None:
    """FsidError where pixels of one Bayer site differ by their place in 4x4 or 6x6 pixels.

    Those of quad-Bayer, RGBW (4x4) and X-Trans (6x6) sensors do, since they have filters of other
    colours. Noise of whole rows and columns counts as error, or not at all where it is taken out.
    """
    for period, kinds in ((4, "quad-Bayer or RGBW"), (6, "X-Trans")):
        places = [dn[r::period, c::period] for r in range(period) for c in range(period)]
        if min(place.size for place in places) < _LEAST_PIXELS or min(dn.shape) < 2 * period:
            continue
        means = np.array([place.mean(dtype=np.float64) for place in places]).reshape(period, period)
        errors = np.array([place.std(dtype=np.float64) / np.sqrt(place.size) for place in places])
        with_lines = float(np.hypot(errors.max(), _line_error(dn, period)))
        for r, c in np.ndindex(2, 2):
            site = means[r::2, c::2]
            unlined = site - site.mean(axis=0) - site.mean(axis=1, keepdims=True)
            for differs, error in ((site, with_lines), (unlined, errors.max())):
                if np.ptp(differs) > max(_PLACES_DIFFER * site.mean(), _SIGNIFICANT * error):
                    raise FsidError(
                        f"{path}: looks like no Bayer mosaic but like {kinds} (a colour differs by its place "
                        f"in {period}x{period} pixels); make a Bayer mosaic of it first"
                    )


def _line_error(dn: np.ndarray, period: int) -> float:
    """Standard error that noise of whole rows and columns makes of the means over every `period`-th of them.

    From the steps between lines of the same filters; the median of their sizes knows no edge of the scene.
    """
    error2 = 0.0
    for axis in (0, 1):
        lines = dn.mean(axis=axis, dtype=np.float64)
        steps = lines[period:] - lines[:-period]
        spread = float(np.median(np.abs(steps - np.median(steps)))) / GAUSS_MAD
        error2 += spread**2 / 2 * period / len(lines)
    return float(np.sqrt(error2))


def check_white(dn: np.ndarray, black_level: int, white_level: int, path: str | Path) -> None:
    """FsidError where values lie far beyond the white level.

    A sensor saturates near one value, each of its pixels a little above or below it; hot pixels are few.
    """
    beyond = float(np.mean(dn > black_level + BEYOND_WHITE * (white_level - black_level)))
    if beyond > BEYOND_WHITE_SHARE:
        raise FsidError(
            f"{path}: {100 * beyond:.2g} % of its values lie far beyond the white level {white_level}, "
            f"up to {int(dn.max())}; state where the sensor saturates"
        )


def _read(path: Path, cfa: str | None, width: int | None, height: int | None) -> np.ndarray:
    kind = path.suffix.lower()
    if kind in HEADERLESS_SUFFIXES:
        return _read_headerless(path, width, height)
    if kind not in BARE_SUFFIXES:
        raise FsidError(f"{path}: unknown kind of mosaic file; use .raw, .bin, .npy, .png or .tif")
    try:
        if kind == ".npy":
            array = np.load(path, allow_pickle=False)
            packed = array.ndim == 3 and array.shape[2] == 4
            return unpack(np.moveaxis(array, 2, 0), cfa) if packed and cfa else array
        return _read_png(path) if kind == ".png" else _read_tiff(path)
    except Exception as error:  # a decoder of a broken file raises anything, zlib.error among it
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        if kind == ".npy" and isinstance(error, ValueError):
            is_object = "pickle" in reason  # NumPy's own line advises to unpickle it
            reason = "it is no array of numbers" if is_object else "it is shorter than its header states"
        raise FsidError(f"{path}: cannot read this {kind} file: {reason}") from error


def _read_png(path: Path) -> np.ndarray:
    with Image.open(path, formats=("PNG",)) as image:
        _check_size((image.height, image.width))
        if image.mode == "P":
            raise ValueError("it holds numbers of colours (a palette), not values; write it as greys")
        return np.asarray(image)


def _read_tiff(path: Path) -> np.ndarray:
    with tifffile.TiffFile(path) as file:
        whole = (page for page in file.pages if not getattr(page, "is_reduced", False))
        page = next(whole, file.pages.first)
        _check_size(page.shape)
        if sum(other.shape == page.shape for other in file.pages) > 1:
            raise ValueError("it holds several mosaics; write each to a file of its own")
        return page.asarray()


def _check_size(shape: tuple[int, ...]) -> None:
    """A broken header may promise more pixels than any sensor has; memory is taken before they are read."""
    if not 0 < np.prod(shape, dtype=float) <= MAX_PIXELS:
        raise ValueError(f"its header states {'x'.join(map(str, shape))} pixels")


def _read_headerless(path: Path, width: int | None, height: int | None) -> np.ndarray:
    width, height = width or 0, height or 0
    if min(width, height) < 1:
        raise FsidError(f"{path}: a headerless mosaic needs its width and height")
    expected, found = 2 * width * height, path.stat().st_size
    if found != expected:
        bits = 8 * found / (width * height)
        advice = (
            f"they are packed, {bits:g} bits a pixel: unpack them to 16 first" if bits in (10, 12, 14) else ""
        )
        raise FsidError(
            f"{path}: {width}x{height} uint16 pixels are {expected} bytes, the file has {found}; "
            f"{advice or 'correct width and height'}"
        )
    return np.fromfile(path, dtype="<u2").reshape(height, width)
