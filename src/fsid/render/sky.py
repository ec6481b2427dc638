"""The sky by direction: an equirectangular panorama, row 0 = zenith, column 0 = +x, turning towards +y.

    clear sky    colour * mix(zenith, horizon, (1 - sin elevation)^4)      below the horizon: ground glow
    clouds       where fractal value noise exceeds a level set by `cloudiness`: white, greyer the thicker

scaled so that the mean radiance of the upper half (by solid angle) is `Sky.colour`. A picture file is scaled
likewise, and its columns, which go to the right as one stands in it, turn the other way; one of more than
`MOST_HEIGHT` rows is averaged to fewer, because as float32 it would take more memory than all the rest of a
scene.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import lru_cache
from pathlib import Path

import numpy as np

from fsid.assets.file_names import PREFIX
from fsid.assets.skies import XYZE, exr_size, size_flaw, sky_sources
from fsid.errors import FsidError, refuse_any
from fsid.files import read_whole
from fsid.plurals import counted
from fsid.scene.colour import LUMINANCE
from fsid.scene.model import Sky

HEIGHT = 512
MOST_HEIGHT = 2048
_MOST_BYTES = 4 << 30  # of a file; the largest panorama takes a little more than half
_ZENITH = np.array([0.42, 0.8, 1.7])
_HORIZON = np.array([1.2, 1.25, 1.3])
_THIN_CLOUD, _THICK_CLOUD = np.array([1.6, 1.75, 1.95]), np.array([0.75, 0.85, 1.0])
_GROUND = 0.25
_CLOUD_ROWS = 8
"""Rows of clouds drawn at once: as many as stay in the processor's cache."""
_LEAST_LIGHT = 1e-6
"""Mean of the upper half of a picture, relative to its brightest value, that is no darkness."""


def panorama(sky: Sky) -> np.ndarray:
    """(H, 2 H, 3) float32 radiance. Raises FsidError for a source that cannot be read."""
    return _drawn(sky) if sky.source == "procedural" else _scaled(sky, _pictured(sky))


def check_skies(folder: str, progress: Callable[[int, int], None] = lambda done, total: None) -> None:
    """Decode every panorama of a folder once; FsidError that names those which no scene could have.

    One of 2048 x 1024 pixels takes 0.1 s of a core, of 4096 x 2048 up to 0.8 s, of 8192 x 4096 up to 4 s.
    """
    sources, faults = sky_sources(folder), []
    for done, source in enumerate(sources, 1):
        try:
            _decoded(Path(source.removeprefix(PREFIX)))
        except FsidError as error:
            faults.append(str(error))
        progress(done, len(sources))
    refuse_any(faults, counted(len(sources), "panorama"))


@lru_cache(maxsize=2)
def _drawn(sky: Sky) -> np.ndarray:
    """A procedural sky, kept for the next image of the same scene."""
    drawn = _scaled(sky, _procedural(sky))
    drawn.flags.writeable = False
    return drawn


def _pictured(sky: Sky) -> np.ndarray:
    if sky.source.startswith(PREFIX):
        path = Path(sky.source.removeprefix(PREFIX))
        try:
            state = path.stat()
        except OSError as error:
            raise FsidError(f"{path}: cannot be read ({error.strerror})") from None
        return _read(path, state.st_mtime_ns, state.st_size)
    raise FsidError(f"scene.sky.source '{sky.source}': use 'procedural' or 'file:PATH'")


def _scaled(sky: Sky, picture: np.ndarray) -> np.ndarray:
    """`picture` turned, its mean as the sky's."""
    mean = _mean_above(picture)
    if sky.source != "procedural":
        mean = np.full(3, float(mean @ LUMINANCE))
    gain = (np.array(sky.colour) / mean).astype(picture.dtype)
    turned = np.roll(picture, round(sky.azimuth_deg / 360 * picture.shape[1]), axis=1)
    turned *= gain
    return turned.astype(np.float32, copy=False)


def _mean_above(picture: np.ndarray) -> np.ndarray:
    """(3,) mean of the upper half by solid angle."""
    elevation, _ = angles(len(picture))
    weight = np.cos(elevation[elevation > 0])
    above = picture[: len(weight)] * weight[:, None, None]
    return np.asarray(above.sum((0, 1)) / (weight.sum() * picture.shape[1]))


def angles(height: int) -> tuple[np.ndarray, np.ndarray]:
    """Elevation (H,) and azimuth (2 H,) of the texels' centres, radians."""
    elevation = np.pi / 2 - (np.arange(height) + 0.5) / height * np.pi
    return elevation, (np.arange(2 * height) + 0.5) / height * np.pi


def _procedural(sky: Sky) -> np.ndarray:
    elevation, azimuth = angles(HEIGHT)
    height = np.sin(elevation)[:, None, None]
    low = (1 - np.clip(height, 0, 1)) ** 4
    picture = _ZENITH * (1 - low) + _HORIZON * low
    picture = np.where(height < 0, _HORIZON * _GROUND, picture)
    picture = np.repeat(picture, 2 * HEIGHT, axis=1)
    if sky.cloudiness > 0:
        lattice = np.random.default_rng(sky.seed).random((64, 64))
        for top in range(0, HEIGHT // 2, _CLOUD_ROWS):
            rows = slice(top, top + _CLOUD_ROWS)
            cover, thickness = _clouds(lattice, elevation[rows], azimuth, sky.cloudiness)
            cloud = _THIN_CLOUD + thickness[..., None] * (_THICK_CLOUD - _THIN_CLOUD)
            picture[rows] += cover[..., None] * (cloud - picture[rows])
    return picture


def _clouds(
    lattice: np.ndarray, elevation: np.ndarray, azimuth: np.ndarray, cloudiness: float
) -> tuple[np.ndarray, np.ndarray]:
    """(H, W) opacity and thickness, 0..1, of a flat layer of clouds that thins out towards the horizon;
    elevation > 0."""
    reach = 1.0 / np.tan(np.maximum(elevation, 0.06))[:, None]
    x, y = reach * np.cos(azimuth), reach * np.sin(azimuth)
    noise = sum(0.5**octave * _lattice(lattice, x * 2**octave, y * 2**octave) for octave in range(6)) / 1.97
    level = 0.72 - 0.45 * cloudiness
    cover = np.clip((noise - level) / 0.18, 0.0, 1.0)
    opacity = cover * cover * (3 - 2 * cover) * np.clip(elevation / 0.15, 0, 1)[:, None]
    return opacity, np.clip((noise - level) / 0.5, 0.0, 1.0)


def _lattice(values: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Smooth interpolation of a periodic lattice of random numbers, 2^n a side."""
    last, flat = len(values) - 1, values.ravel()
    i, j = np.floor(x), np.floor(y)
    u, v = x - i, y - j
    u, v = u * u * (3 - 2 * u), v * v * (3 - 2 * v)
    i, j = i.astype(np.int32), j.astype(np.int32)
    left, right = i & last, (i + 1) & last
    upper, lower = (j & last) * len(values), ((j + 1) & last) * len(values)
    a, b = flat.take(upper + left), flat.take(upper + right)
    c, d = flat.take(lower + left), flat.take(lower + right)
    return np.asarray((a * (1 - u) + b * u) * (1 - v) + (c * (1 - u) + d * u) * v)


@lru_cache(maxsize=2)
def _read(path: Path, changed_ns: int, size: int) -> np.ndarray:
    """(H, 2 H, 3) float32 >= 0, H <= MOST_HEIGHT. changed_ns, size: of the file, which is read again where
    they differ from those of the pictures that are kept for the next image."""
    picture = _decoded(path)
    picture.flags.writeable = False
    return picture


def _decoded(path: Path) -> np.ndarray:
    return _read_exr(path) if path.suffix.lower() == ".exr" else _read_hdr(path)


def _read_hdr(path: Path) -> np.ndarray:
    rgbe = _radiance_hdr(read_whole(path, _MOST_BYTES), path)
    scale = np.ldexp(np.float32(1), np.arange(256) - 136)
    scale[0] = 0
    scales = scale[rgbe[..., 3]]
    return _equirectangular((rgbe[..., i] * scales for i in range(3)), path)


def _read_exr(path: Path) -> np.ndarray:
    import OpenEXR

    try:
        _check_size(*(exr_size(path) or (0, 0)), path)
        with OpenEXR.File(str(path), separate_channels=True) as file:
            channels = file.channels()
            return _equirectangular((channels.pop(c).pixels for c in "RGB"), path)
    except (OSError, RuntimeError, KeyError, ValueError):
        raise FsidError(f"{path}: is truncated, unreadable or no OpenEXR picture with R, G and B") from None


def _check_size(width: int, height: int, path: Path) -> None:
    flaw = size_flaw(width, height)
    if flaw:
        raise FsidError(f"{path}: {flaw}")


def _equirectangular(channels: Iterable[np.ndarray], path: Path) -> np.ndarray:
    """The panorama of a picture's channels R, G, B, (H, 2 H) each and all alike, reduced; FsidError where it
    gives no light. They come one by one because a large one fills memory."""
    picture = np.stack([_reduced(channel, path) for channel in channels], axis=-1)
    if not _mean_above(picture) @ LUMINANCE > _LEAST_LIGHT * picture.max():
        raise FsidError(f"{path}: its upper half is black and gives no light; turn it over or leave it out")
    return picture[:, ::-1]


def _reduced(channel: np.ndarray, path: Path) -> np.ndarray:
    """(h, 2 h) float32 means of the texels of (H, 2 H); negative values, which the filters of stitching
    leave, count as 0."""
    if not np.isfinite(channel).all():
        raise FsidError(f"{path}: holds NaN or infinite values")
    reduced = channel.clip(min=0).astype(np.float32, copy=False)
    factor = -(-len(channel) // MOST_HEIGHT)
    height = len(channel) // factor
    for axis, cells in enumerate((height, 2 * height) if factor > 1 else ()):
        starts = np.arange(cells) * reduced.shape[axis] // cells
        texels = np.diff(starts, append=reduced.shape[axis]).astype(np.float32)
        reduced = np.add.reduceat(reduced, starts, axis) / (texels if axis else texels[:, None])
    return reduced


def _radiance_hdr(data: bytes, path: Path) -> np.ndarray:
    """(H, 2 H, 4) bytes R, G, B, E of a Radiance file, run-length coded or flat (Ward 1991)."""
    broken = FsidError(f"{path}: is no complete Radiance .hdr picture with rows from the top (-Y .. +X ..)")
    header, _, rest = data.partition(b"\n\n")
    size_line, _, body = rest.partition(b"\n")
    words = size_line.split()
    if not header.startswith(b"#?") or len(words) != 4 or words[0] != b"-Y" or words[2] != b"+X":
        raise broken
    if XYZE in header:
        raise FsidError(f"{path}: holds CIE XYZ; convert it to R, G, B")
    try:
        height, width = int(words[1]), int(words[3])
    except ValueError:
        raise broken from None
    _check_size(width, height, path)
    flat = np.frombuffer(body, np.uint8)
    if len(flat) == 4 * height * width and not (flat[0] == 2 and flat[1] == 2):
        rgbe = flat.reshape(height, width, 4)
    else:
        rgbe = np.empty((height, width, 4), np.uint8)
        at = 0
        for row in rgbe:
            if bytes(body[at : at + 4]) != bytes((2, 2, width >> 8, width & 255)):
                raise broken
            at += 4
            for channel in range(4):
                x = 0
                while x < width:
                    if at + 1 >= len(body):
                        raise broken
                    count = body[at]
                    if count > 128:
                        row[x : x + count - 128, channel] = body[at + 1]
                        x, at = x + count - 128, at + 2
                    else:
                        run = flat[at + 1 : at + 1 + count]
                        if count == 0 or x + len(run) > width or len(run) < count:
                            raise broken
                        row[x : x + count, channel] = run
                        x, at = x + count, at + 1 + count
    return rgbe
