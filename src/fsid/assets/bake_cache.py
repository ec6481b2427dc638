"""Baked maps on disk: a bake is a function of (source code, library versions, name, variant, size) alone.

    result = unpack(pack(bake()))        whether the packed form was on disk or is made just now

Packing rounds what the renderer stores as 8 bits to 8 bits and height, which slopes are made of, to 16; as
every result has been packed, the cache can never change an image. The key is a hash of all that a bake
depends on, so a stale entry has no name by which it could be found; what is not found any more leaves as
the oldest when the folder grows beyond its limit.

Many processes share the folder: an entry appears by atomic rename, under a name that no other process
writes. An entry that cannot be read is baked again; a folder that cannot be written is done without.

The folder is $FSID_CACHE, or $XDG_CACHE_HOME/fsid, or ~/.cache/fsid; FSID_CACHE=off keeps no files, and
neither does a user without a home.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import secrets
import zipfile
import zlib
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache, lru_cache
from io import BytesIO
from pathlib import Path
from typing import TypeVar

import numpy as np

from fsid.assets.maps import MaterialMaps

LIMIT_BYTES = 4 * 2**30
"""Size of the folder beyond which the entries that were used longest ago are deleted."""

Arrays = dict[str, np.ndarray]
Result = TypeVar("Result")

_ENTRY = re.compile(r".+-[0-9a-f]{32}\.npz(\.[0-9a-f]{16}\.part)?")
"""What is deleted; FSID_CACHE may name a folder that holds other files, too."""

_added: dict[Path, int] = {}
"""Bytes that this process has written to a folder since it looked at the folder's size."""

_BYTES = ("mix", "pattern", "detail", "roughness", "metallic")
_LEVELS = {"detail": 254}
"""Steps between 0 and 1 where they are not 255: neutral detail, 0.5, is one of 254 exactly."""


def cache_folder(kind: str) -> Path | None:
    """Where entries of a kind ("materials") are kept; None where the cache is off or has no place."""
    chosen = os.environ.get("FSID_CACHE", "")
    if chosen.lower() == "off":
        return None
    if chosen:
        return Path(chosen) / kind
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return None if home.startswith("~") else Path(home) / "fsid" / kind


@cache
def code_key(modules: tuple[str, ...]) -> str:
    """A hash of the sources of `modules` and of the versions of the libraries that they draw with."""
    import matplotlib
    import PIL
    import scipy

    versions = [np.__version__, scipy.__version__, PIL.__version__, matplotlib.__version__]
    return content_key([*(_source(module) for module in modules), " ".join(versions).encode()])


def content_key(parts: Iterable[bytes]) -> str:
    """A hash of `parts` in their order, 32 hexadecimal digits."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(hashlib.sha256(part).digest())
    return digest.hexdigest()[:32]


def stored(
    name: str, key: str, make: Callable[[], Arrays], use: Callable[[Arrays], Result], *, worth: float = 1.0
) -> Result:
    """`use(make())`, with what `make` returns from the cache where it has an entry.

    name: readable part of the file name. key: `content_key` of everything that the arrays depend on. use:
    raises ValueError or KeyError for arrays that are not of this kind. worth: arrays are deflated where less
    than this share is left of them.
    """
    folder = cache_folder("materials")
    if folder is None:
        return use(make())
    path = folder / f"{name}-{key}.npz"
    with suppress(OSError, ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error):
        result = use(_read(path))
        with suppress(OSError):
            os.utime(path)
        return result
    arrays = make()
    _write(path, arrays, worth)
    return use(arrays)


def cached(name: str, key: str, size: int, bake: Callable[[], MaterialMaps]) -> MaterialMaps:
    """`bake()` as it comes out of its packed form, from the cache where it has an entry; see `stored`."""
    return stored(f"{name}-{size}", key, lambda: pack(bake()), lambda packed: unpack(packed, size))


def rounded(maps: MaterialMaps) -> MaterialMaps:
    """The maps as they come out of their packed form."""
    return unpack(pack(maps), len(maps.height))


def pack(maps: MaterialMaps) -> Arrays:
    """The maps in integers, each texel as its difference from the one above: small after compression."""
    size = len(maps.height)
    planes = np.empty((7, size, size), np.uint8)
    for plane, name in zip(planes, _BYTES, strict=False):
        plane[:] = np.rint(getattr(maps, name) * np.float32(_LEVELS.get(name, 255)))
    height = np.rint(maps.height * np.float32(65535)).astype(np.uint16)
    height[1:] -= height[:-1].copy()
    planes[:5, 1:] -= planes[:5, :-1].copy()
    planes[5], planes[6] = height >> 8, height & 255
    colours = np.array(maps.colours or np.empty((0, 3)), np.float64)
    return {"planes": planes, "metres": np.array([maps.relief_m, maps.tile_m]), "colours": colours}


def unpack(packed: Arrays, size: int) -> MaterialMaps:
    """The inverse of `pack` up to its rounding. Raises ValueError where the arrays are not `size` wide."""
    planes, metres, colours = packed["planes"], packed["metres"], packed["colours"]
    shapes = (planes.shape, metres.shape, colours.shape[1:])
    if shapes != ((7, size, size), (2,), (3,)) or planes.dtype != np.uint8:
        raise ValueError(f"arrays of shape {shapes}")
    bytes_, height = planes[:5].copy(), (planes[5].astype(np.uint16) << 8) + planes[6]
    for row in range(1, size):  # np.cumsum takes ten times as long
        bytes_[:, row] += bytes_[:, row - 1]
        height[row] += height[row - 1]
    maps = {"height": height.astype(np.float32) / np.float32(65535)}
    for plane, name in zip(bytes_, _BYTES, strict=True):
        maps[name] = plane.astype(np.float32) / np.float32(_LEVELS.get(name, 255))
    relief_m, tile_m = (float(m) for m in metres)
    triple = tuple((float(r), float(g), float(b)) for r, g, b in colours) or None
    return MaterialMaps(**maps, relief_m=relief_m, tile_m=tile_m, colours=triple)


def _read(path: Path) -> Arrays:
    """The arrays of a file; every byte of them is checked by the archive's CRC-32."""
    with zipfile.ZipFile(path) as archive:
        return {name.removesuffix(".npy"): _array(archive.read(name)) for name in archive.namelist()}


def _array(member: bytes) -> np.ndarray:
    """The array of an .npy file, where it lies. Raises ValueError for one that would have to be unpickled."""
    start = 10 + int.from_bytes(member[8:10], "little")
    shape, dtype = _shape(member[:start])
    return np.frombuffer(member, dtype, offset=start).reshape(shape)


@lru_cache(maxsize=256)
def _shape(header: bytes) -> tuple[tuple[int, ...], np.dtype]:
    """Shape and type in the head of an .npy file; there are few different ones, and parsing takes as long as
    reading a small array."""
    file = BytesIO(header)
    np.lib.format.read_magic(file)
    shape, _, dtype = np.lib.format.read_array_header_1_0(file)
    return shape, dtype


def _write(path: Path, arrays: Arrays, worth: float) -> None:
    part = path.with_name(f"{path.name}.{secrets.token_hex(8)}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with part.open("xb") as file, zipfile.ZipFile(file, "w", compresslevel=1) as archive:
            for name, array in arrays.items():
                member = BytesIO()
                np.lib.format.write_array(member, np.ascontiguousarray(array), (1, 0), allow_pickle=False)
                kind = zipfile.ZIP_DEFLATED if _deflates(array, worth) else zipfile.ZIP_STORED
                archive.writestr(f"{name}.npy", member.getbuffer(), kind)
        size_bytes = os.path.getsize(part)
        os.replace(part, path)
        _count(path.parent, size_bytes)
    except OSError:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def _deflates(array: np.ndarray, worth: float) -> bool:
    """Whether the first 32nd of an array deflates to less than `worth` of itself."""
    sample = array.reshape(-1)[: -(-array.size // 32)].tobytes()
    return len(zlib.compress(sample, 1)) < worth * len(sample)


def _count(folder: Path, added_bytes: int) -> None:
    """Keep the folder below its limit, looking only after every 64th part of it that this process adds."""
    _added[folder] = _added.get(folder, LIMIT_BYTES) + added_bytes
    if _added[folder] > LIMIT_BYTES // 64:
        _keep_below(folder, LIMIT_BYTES)
        _added[folder] = 0


def _keep_below(folder: Path, limit_bytes: int) -> None:
    """Delete the entries used longest ago, and what killed processes left, until the rest fits."""
    entries = [entry for entry in os.scandir(folder) if _ENTRY.fullmatch(entry.name)]
    stats = []
    for entry in entries:
        try:
            stats.append((entry.stat(), entry.path))
        except FileNotFoundError:
            continue  # another process was faster
    used = sum(stat.st_size for stat, _ in stats)
    for stat, path in sorted(stats, key=lambda item: item[0].st_mtime):
        if used <= limit_bytes:
            break
        Path(path).unlink(missing_ok=True)
        used -= stat.st_size


def _source(module: str) -> bytes:
    spec = importlib.util.find_spec(module)
    assert spec is not None, module
    assert spec.origin is not None, module
    return Path(spec.origin).read_bytes()
