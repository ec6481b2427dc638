"""Texture folders as materials: "file:PATH" -> `MaterialMaps` in the picture's own colours.

    colour         -> masks by the triangle of `fsid.assets.triangle`, and its three colours
    displacement   -> height; its range in metres such that its slopes are those of the normal map, without
                      one 2 cm from black to white (in OpenEXR, which has any unit, of its own range)
    normal alone   -> height by integration: H = -i (fx P + fy Q) / (2 pi (fx^2 + fy^2)) of slope spectra

The integration is the least-squares one of Frankot and Chellappa, "A method for enforcing integrability in
shape from shading algorithms", IEEE PAMI 10(4), 1988; on a tileable map its Fourier basis is exact. What is
missing has a default; a set without a colour map, or with an unreadable file, is left out and counted.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.fft import irfft2, rfft2

from fsid.assets.bake_cache import cached, code_key, content_key
from fsid.assets.file_names import NOT_TEXT, PREFIX, shown
from fsid.assets.maps import MaterialMaps
from fsid.assets.survey import Skipped, Survey, surveyed
from fsid.assets.texture_files import (
    EXR_SUFFIX,
    RefusedImageError,
    TextureSet,
    decode_file,
    read_bounded,
    resampled,
    set_at,
    sets_below,
    strangers_below,
    stretched,
)
from fsid.assets.triangle import Triple, enclosing, encode, srgb_to_linear
from fsid.errors import FsidError

TILE_M = 1.0
"""Natural width of a tile: no file says it, and most photographed textures are one or two metres wide."""

_TRIANGLE_PX = 1024
_DEFAULT_RELIEF, _RELIEFS = 0.02, (1e-4, 0.2)
_DEFAULT_ROUGHNESS = 0.7
_CODE = tuple(
    f"fsid.assets.{name}" for name in ("bake_cache", "maps", "texture_files", "textures", "triangle")
)


def texture_sources(path: str | os.PathLike[str]) -> tuple[str, ...]:
    """Names of all usable texture sets below a folder, for `Material.family`. See `survey_textures`."""
    return survey_textures(os.fspath(path)).usable


def survey_textures(
    path: str, progress: Callable[[int, int], None] = lambda done, total: None
) -> Survey[str]:
    """Every texture set of a folder and its subfolders, each read once.

    usable: names for `Material.family`, sorted. skipped: also pictures that are of no set. progress: called
    with the number of sets done and of all. Raises FsidError where `path` is no folder or holds no usable
    set.
    """
    nothing = f"{path}: no usable texture set (ambientCG or Poly Haven file names)"
    return surveyed(("textures", path), lambda: _survey(path, progress), nothing)


def _survey(path: str, progress: Callable[[int, int], None]) -> tuple[list[str], list[Skipped]]:
    if not Path(path).is_dir():
        raise FsidError(f"{path}: there is no such folder of textures")
    usable, skipped = [], []
    sets = sets_below(Path(path))
    for done, found in enumerate(sets):
        progress(done, len(sets))
        name = f"{PREFIX}{found.path}"
        if shown(name) != name:
            skipped.append((shown(name), NOT_TEXT))
            continue
        try:
            _bake(found, 64)
            usable.append(name)
        except RefusedImageError as error:
            skipped.append((name, str(error)))
    progress(len(sets), len(sets))
    skipped += [(shown(f"{PREFIX}{file}"), shown(why)) for file, why in strangers_below(Path(path))]
    return usable, skipped


def texture_files(path: str) -> dict[str, list[Path]]:
    """The files of every usable texture set below a folder, by its name. FsidError as `survey_textures`."""
    usable = set(survey_textures(path).usable)
    found = {f"{PREFIX}{each.path}": list(each.files.values()) for each in sets_below(Path(path))}
    return {name: files for name, files in found.items() if name in usable}


def bake_texture(name: str, size: int) -> MaterialMaps:
    """The maps of "file:PATH": a set's common name, or a folder that holds one set. Raises FsidError."""
    try:
        return _bake(_set_of(name), size)
    except RefusedImageError as error:
        raise FsidError(f"{name.removeprefix(PREFIX)}: {error}") from None


@lru_cache(maxsize=4096)
def _set_of(name: str) -> TextureSet:
    return set_at(Path(name.removeprefix(PREFIX)))


def texture_key(name: str) -> str:
    """Key of what "file:PATH" gives, by the content of its files. Raises FsidError."""
    try:
        return _key(_set_of(name))
    except RefusedImageError as error:
        raise FsidError(f"{name.removeprefix(PREFIX)}: {error}") from None


def _key(found: TextureSet) -> str:
    return _key_as_of(tuple((role, file, *_state(file)) for role, file in sorted(found.files.items())))


def _state(file: Path) -> tuple[int, int]:
    """Size and time of a file; nothing of one that cannot be read, which reading it tells."""
    try:
        state = file.stat()
    except OSError:
        return -1, -1
    return state.st_size, state.st_mtime_ns


@lru_cache(maxsize=4096)
def _key_as_of(files: tuple[tuple[str, Path, int, int], ...]) -> str:
    """Every scene asks for the keys of its sets: files are read again only where they have changed."""
    return _key_of({role: read_bounded(file) for role, file, _, _ in files})


def _key_of(data: dict[str, bytes]) -> str:
    return content_key([code_key(_CODE).encode(), " ".join(data).encode(), *data.values()])


def _bake(found: TextureSet, size: int) -> MaterialMaps:
    key = _key(found)

    def maps() -> MaterialMaps:
        data = {role: read_bounded(file) for role, file in sorted(found.files.items())}
        if _key_of(data) != key:
            raise RefusedImageError("changed while it was read")
        return _maps(found, data, size)

    return cached("file", key, size, maps)


def _maps(found: TextureSet, data: dict[str, bytes], size: int) -> MaterialMaps:
    if "colour" not in data:
        raise RefusedImageError("no colour map (JPEG or PNG)")

    def image(role: str) -> np.ndarray:
        """(S, S, 3) as encoded."""
        file = found.files[role]
        pixels = decode_file(file, data[role], size)
        if role == "height" and file.suffix.lower() == EXR_SUFFIX:
            pixels = stretched(pixels)
        return np.broadcast_to(resampled(pixels, size), (size, size, 3))

    colours, rgb = _colour(found.files["colour"], data["colour"], size)
    mix, pattern, detail = encode(rgb, colours)
    arm = image("arm") if "arm" in data else None
    flat = np.zeros((size, size), np.float32)
    roughness = image("roughness")[..., 0] if "roughness" in data else None
    metallic = image("metallic")[..., 0] if "metallic" in data else None
    if arm is not None:
        roughness = arm[..., 1] if roughness is None else roughness
        metallic = arm[..., 2] if metallic is None else metallic
    slopes = None
    for role, up in (("normal_gl", 1.0), ("normal_dx", -1.0)):
        if role in data and slopes is None:
            slopes = slopes_of(image(role), up)
    height, relief = _height(image("height")[..., 0] if "height" in data else None, slopes, size)
    return MaterialMaps(
        mix=mix,
        pattern=pattern,
        detail=detail,
        roughness=flat + _DEFAULT_ROUGHNESS if roughness is None else np.ascontiguousarray(roughness),
        height=height,
        metallic=flat if metallic is None else np.ascontiguousarray(metallic),
        relief_m=relief * TILE_M,
        tile_m=TILE_M,
        colours=colours,
    )


def _colour(path: Path, data: bytes, size: int) -> tuple[Triple, np.ndarray]:
    """The picture's triangle, the same at every size, and the picture itself, linear (S, S, 3)."""
    pixels = decode_file(path, data, max(size, _TRIANGLE_PX))
    linear = np.broadcast_to(srgb_to_linear(pixels), (*pixels.shape[:2], 3))
    reference = resampled(linear, _TRIANGLE_PX)
    return enclosing(reference.reshape(-1, 3)), resampled(linear, size)


def slopes_of(encoded: np.ndarray, up: float) -> np.ndarray:
    """(2, S, S) dh/du and dh/dv, v downwards, of a normal map; up: 1 for OpenGL's green, -1 for DirectX's."""
    normal = 2 * encoded - 1
    depth = np.maximum(normal[..., 2], 0.1)
    return np.stack([-normal[..., 0] / depth, up * normal[..., 1] / depth])


def integrated(slopes: np.ndarray) -> np.ndarray:
    """(S, S) periodic height in tile widths, mean 0, whose slopes are nearest to `slopes` (2, S, S)."""
    size = slopes.shape[-1]
    fx = np.fft.rfftfreq(size, 1 / size).astype(np.float32)[None]
    fy = np.fft.fftfreq(size, 1 / size).astype(np.float32)[:, None]
    f2 = fx * fx + fy * fy
    f2[0, 0] = 1.0
    spectrum = -1j * (fx * rfft2(slopes[0]) + fy * rfft2(slopes[1])) / (2 * np.pi * f2)
    spectrum[0, 0] = 0.0
    return irfft2(spectrum, s=(size, size)).astype(np.float32)


def _height(map_: np.ndarray | None, slopes: np.ndarray | None, size: int) -> tuple[np.ndarray, float]:
    """(height 0..1, its range in tile widths)."""
    shape = np.zeros((size, size), np.float32) if slopes is None else integrated(slopes)
    field = shape if map_ is None else map_
    span = float(np.ptp(field))
    if span < 1e-6:
        return np.full((size, size), 0.5, np.float32), _RELIEFS[0]
    height = (field - field.min()) / np.float32(span)
    if map_ is None:
        relief = span
    elif slopes is None:
        relief = _DEFAULT_RELIEF * span
    else:
        relief = _steepness(shape) / max(_steepness(height), 1e-9)
    return height, float(np.clip(relief, *_RELIEFS))


def _steepness(field: np.ndarray) -> float:
    """RMS difference of texels two apart: what is finer than that counts little."""
    return float(np.sqrt(np.mean([np.square(field - np.roll(field, 2, axis)) for axis in (0, 1)])))
