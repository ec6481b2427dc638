"""A folder or a furniture library -> names of meshes, and a name -> `Mesh`.

    file:PATH           a .glb, .gltf, .obj, .ply or .stl file
    file:PATH!MEMBER    a model of the Sweet Home 3D library PATH (.sh3f)

What cannot be used (broken, hostile, too large, of another licence) is left out and counted with its reason:
one bad file among a thousand never ends a run. Sizes: a library states them; glTF, OBJ and PLY are taken as
metres and STL as millimetres where that gives a size between 1 cm and 20 m, else the unit is guessed.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from urllib.parse import unquote

import numpy as np

from fsid.assets.file_names import NOT_TEXT, PREFIX, shown
from fsid.assets.mesh import Mesh
from fsid.assets.sources.cache import (
    cache_key,
    load_measures,
    load_mesh,
    measures,
    store_mesh,
    store_refusal,
)
from fsid.assets.sources.catalogue import Entry, read_catalogue, read_member
from fsid.assets.sources.cleaning import Triangles, clean
from fsid.assets.sources.gltf_file import referred
from fsid.assets.sources.limits import MAX_FILE_BYTES, MAX_LICENCE_LETTERS, NotNowError, RefusedError
from fsid.assets.sources.reading import MESH_SUFFIXES, read_triangles
from fsid.assets.survey import Skipped, Survey, surveyed
from fsid.errors import FsidError

LIBRARY_SUFFIX = ".sh3f"
_CC0 = re.compile(r"\bcc[ -]?(?:0|zero)\b|public[ -]domain|creativecommons\.org/publicdomain", re.IGNORECASE)
_ATTRIBUTION = re.compile(
    r"\bcc[ -]by\b|\battribution\b[\w -]{0,80} \d\.\d|creativecommons\.org/licenses/", re.IGNORECASE
)
_LICENCE_FILES = re.compile(r"(?:licen[cs]e|copying|cc0)\b.*|.*licen[cs]e\.txt", re.IGNORECASE)
_SIZES_M = (0.01, 20.0)
_GUESSED_M = (0.02, 5.0)
_Z_UP = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])


@dataclass(frozen=True)
class MeshSource:
    """name: for `Object.family`. licence: as the library or the nearest licence file says, "" where nothing
    does. size_m: (x, y, z) of the mesh. triangles: how many it has."""

    name: str
    licence: str
    size_m: tuple[float, float, float]
    triangles: int


def mesh_sources(path: str | os.PathLike[str], *, cc0_only: bool = False) -> tuple[str, ...]:
    """Names of all usable meshes of a folder or library, for `Object.family`. See `survey_meshes`."""
    return tuple(source.name for source in survey_meshes(os.fspath(path), cc0_only).usable)


def survey_meshes(
    path: str, cc0_only: bool = False, progress: Callable[[int, int], None] = lambda done, total: None
) -> Survey[MeshSource]:
    """Every mesh of a folder (with its subfolders), of one library or of one file, each read once.

    cc0_only: leave out what is not stated to be in the public domain (CC0). progress: called with the number
    of meshes done and of all. Raises FsidError where `path` does not exist or holds no usable mesh.
    """
    nothing = f"{path}: no usable mesh ({', '.join((*MESH_SUFFIXES, LIBRARY_SUFFIX))})"
    return surveyed(("meshes", path, str(cc0_only)), lambda: _survey(path, cc0_only, progress), nothing)


def _survey(
    path: str, cc0_only: bool, progress: Callable[[int, int], None]
) -> tuple[list[MeshSource], list[Skipped]]:
    if not Path(path).exists():
        raise FsidError(f"{path}: there is no such folder or file of meshes")
    found, skipped = _candidates(Path(path))
    usable = []
    for done, (name, licence) in enumerate(found):
        progress(done, len(found))
        if shown(name) != name:
            skipped.append((shown(name), NOT_TEXT))
            continue
        if cc0_only and not _is_cc0(licence):
            skipped.append((name, f"licence '{licence or 'unknown'}' is not CC0"))
            continue
        try:
            x, y, z, triangles = _measures(name)
        except RefusedError as error:
            skipped.append((name, str(error)))
            continue
        usable.append(MeshSource(name, licence, (float(x), float(y), float(z)), int(triangles)))
    progress(len(found), len(found))
    return usable, skipped


def load_source(name: str) -> Mesh:
    """The mesh of "file:PATH" or "file:PATH!MEMBER": metres, base on z = 0, footprint centred. FsidError."""
    try:
        return _mesh(name)
    except RefusedError as error:
        raise FsidError(f"{name.removeprefix(PREFIX)}: {error}") from None


def _measures(name: str) -> np.ndarray:
    found = load_measures(_key(*split_source(name)))
    return measures(_mesh(name)) if found is None else found


def _key(path: Path, member: str) -> str:
    is_gltf = path.suffix.lower() == ".gltf" and not member
    try:
        names = referred(_bounded(path)) if is_gltf else []
        return cache_key(path, member, [path.parent / unquote(name) for name in names])
    except (OSError, ValueError) as error:
        raise RefusedError(f"cannot be opened ({error})") from None


def _mesh(name: str) -> Mesh:
    """From the cache, or made and put there. Raises RefusedError."""
    path, member = split_source(name)
    key = _key(path, member)
    mesh = load_mesh(key)
    if mesh is None:
        try:
            mesh = _from_library(path, member) if member else _from_file(path)
        except NotNowError:
            raise
        except RefusedError as error:
            store_refusal(key, str(error))
            raise
        store_mesh(key, mesh)
    return mesh


def split_source(name: str) -> tuple[Path, str]:
    """The file of "file:PATH" or "file:PATH!MEMBER", and the member of the library, "" for none."""
    text = name.removeprefix(PREFIX)
    parts = re.fullmatch(rf"(.*?{re.escape(LIBRARY_SUFFIX)})!(.+)", text, re.IGNORECASE | re.DOTALL)
    return (Path(parts[1]), parts[2]) if parts else (Path(text), "")


def _candidates(path: Path) -> tuple[list[tuple[str, str]], list[Skipped]]:
    """(name, licence) of what may be a mesh, and (name, reason) of libraries that cannot be opened."""
    found: list[tuple[str, str]] = []
    skipped: list[Skipped] = []
    for file in _files(path):
        if file.suffix.lower() != LIBRARY_SUFFIX:
            found.append((f"{PREFIX}{file}", licence_beside(file.parent, path)))
            continue
        try:
            found += [(f"{PREFIX}{file}!{e.member}", e.licence) for e in _catalogue(file)]
        except RefusedError as error:
            skipped.append((shown(f"{PREFIX}{file}"), str(error)))
    return list(dict.fromkeys(found)), skipped


def _files(path: Path) -> Iterator[Path]:
    """Files with a known ending, sorted; symbolic links to folders are not followed."""
    if path.is_file():
        yield path
        return
    for folder, subfolders, names in os.walk(path):
        subfolders.sort()
        for name in sorted(names):
            if name.lower().endswith((*MESH_SUFFIXES, LIBRARY_SUFFIX)):
                yield Path(folder) / name


@lru_cache(maxsize=4096)
def licence_beside(folder: Path, root: Path) -> str:
    """What the nearest licence file from `folder` up to `root` says: "CC0" or its first line, "" for none."""
    for name in sorted(os.listdir(folder)):
        if _LICENCE_FILES.fullmatch(name) and (folder / name).is_file():
            try:
                with (folder / name).open(encoding="utf-8", errors="replace") as file:
                    text = file.read(MAX_LICENCE_LETTERS)
            except OSError:
                return ""
            first = next((line.strip() for line in text.splitlines() if line.strip()), "")
            return "CC0" if _is_cc0(text) else first[:200]
    inside = folder != root and root in folder.parents
    return licence_beside(folder.parent, root) if inside else ""


def _is_cc0(text: str) -> bool:
    """Whether a licence is CC0 alone: the text of CC BY names CC0, too, as the licence of its own text."""
    return bool(_CC0.search(text)) and not _ATTRIBUTION.search(text)


@lru_cache(maxsize=16)
def _catalogue(path: Path) -> tuple[Entry, ...]:
    return read_catalogue(path)


def _from_library(path: Path, member: str) -> Mesh:
    entry = next((e for e in _catalogue(path) if e.member == member), None)
    if entry is None or not entry.present:
        raise RefusedError("not in the archive")
    suffix = _suffix(Path(member))

    def fetch(uri: str) -> bytes:
        return read_member(path, os.path.normpath(os.path.join(os.path.dirname(member), unquote(uri))))

    triangles = read_triangles(read_member(path, member), suffix, fetch)
    turned = triangles.vertices @ (_Z_UP @ entry.rotation @ _Z_UP.T).T
    if entry.size_m is None:
        return clean(_scaled(triangles, turned * _metres(turned, suffix)))
    extent = _extent(turned)
    solid = extent > 1e-5 * extent.max()
    scale = np.where(solid, entry.size_m / np.where(solid, extent, 1.0), 1.0)
    scale[~solid] = np.median(scale[solid])
    return clean(_scaled(triangles, turned * scale))


def _from_file(path: Path) -> Mesh:
    suffix = _suffix(path)
    triangles = read_triangles(_bounded(path), suffix, lambda uri: _neighbour(path, uri))
    return clean(_scaled(triangles, triangles.vertices * _metres(triangles.vertices, suffix)))


def _suffix(path: Path) -> str:
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise RefusedError(f"'{path.suffix}' is not read; use {', '.join(MESH_SUFFIXES)}")
    return path.suffix.lower()


def _neighbour(path: Path, uri: str) -> bytes:
    """A file that `path` refers to: in its folder or below."""
    folder = path.resolve().parent
    target = (folder / unquote(uri)).resolve()
    if not target.is_relative_to(folder):
        raise RefusedError(f"refers to '{uri[:80]}' outside its folder")
    return _bounded(target)


def _bounded(path: Path) -> bytes:
    try:
        if not path.is_file():
            raise RefusedError(f"'{path.name}' is missing or not a file")
        with path.open("rb") as file:
            data = file.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        raise NotNowError(f"cannot be opened ({error.strerror})") from None
    if len(data) > MAX_FILE_BYTES:
        raise RefusedError(f"larger than {MAX_FILE_BYTES >> 20} MiB")
    return data


def _scaled(triangles: Triangles, vertices: np.ndarray) -> Triangles:
    return Triangles(vertices, triangles.faces, triangles.parts, triangles.names)


def _extent(vertices: np.ndarray) -> np.ndarray:
    """(3,) size of what is finite. Raises RefusedError where that is nothing."""
    finite = vertices[np.isfinite(vertices).all(1)]
    extent = np.ptp(finite, axis=0) if len(finite) else np.zeros(3)
    if not 0 < extent.max() < 1e12:
        raise RefusedError("no extent")
    return extent


def _metres(vertices: np.ndarray, suffix: str) -> float:
    """Factor that makes a plausible size in metres: the format's own unit, or cm, mm, or half a metre."""
    largest = float(_extent(vertices).max())
    own = 0.001 if suffix == ".stl" else 1.0
    if _SIZES_M[0] <= largest * own <= _SIZES_M[1]:
        return own
    for unit in (0.01, 0.001, 1.0):
        if _GUESSED_M[0] <= largest * unit <= _GUESSED_M[1]:
            return unit
    return 0.5 / largest
