"""Cleaned meshes on disk, so that a library is read once per machine and not once per process.

A mesh is (key).npz, a refusal (key).txt with its reason. The key covers the file's place, size and time,
those of the files that it refers to, and the version of the cleaning. Deleting the folder costs time and
nothing else; a folder that cannot be written only makes the next process slower. Its size has no limit, as
every process asks for the measures of a whole library: a limit below would have them all read anew each time.

The folder is $FSID_CACHE/meshes, or $XDG_CACHE_HOME/fsid/meshes, or ~/.cache/fsid/meshes; FSID_CACHE=off
keeps no files.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import os
import secrets
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fsid.assets.bake_cache import cache_folder
from fsid.assets.mesh import Mesh
from fsid.assets.sources.limits import RefusedError

_VERSION = 5
"""One more whenever the same file gives another mesh."""


def cache_key(path: Path, member: str, referred: Sequence[Path]) -> str:
    """Name of what is made from a file, and from those that it refers to, as they are now. OSError where
    there is none; the others may be missing."""
    text = "|".join(
        (f"{_VERSION}|{os.path.realpath(path)}|{_state(path)}|{member}", *map(_state_if_any, referred))
    )
    return hashlib.blake2b(text.encode(), digest_size=20).hexdigest()


def _state(path: Path) -> str:
    state = path.stat()
    return f"{state.st_size}|{state.st_mtime_ns}"


def _state_if_any(path: Path) -> str:
    try:
        return _state(path)
    except (OSError, ValueError):
        return "missing"


def load_mesh(key: str) -> Mesh | None:
    """The mesh stored under a key, None where there is none. Raises the RefusedError stored instead."""
    stored = _load(key, ("vertices", "normals", "faces", "face_parts", "part_names"))
    if stored is None:
        return None
    *arrays, names = stored
    vertices, normals, faces, face_parts = arrays
    if not _is_mesh(vertices, normals, faces, face_parts, names.size if names.ndim == 1 else 0):
        return None
    return Mesh(vertices, normals, faces, face_parts, tuple(str(name) for name in names))


def _is_mesh(
    vertices: np.ndarray, normals: np.ndarray, faces: np.ndarray, face_parts: np.ndarray, parts: int
) -> bool:
    """Whether arrays fit each other: others may write to a folder that they share, and what draws a mesh
    believes its indices."""
    return (
        (vertices.ndim, faces.ndim, face_parts.ndim) == (2, 2, 1)
        and vertices.shape == normals.shape == (len(vertices), 3)
        and faces.shape == (len(face_parts), 3)
        and vertices.dtype == normals.dtype == np.float32
        and faces.dtype == face_parts.dtype == np.int32
        and len(faces) > 0
        and bool(np.isfinite(vertices).all() and np.isfinite(normals).all())
        and bool(faces.min() >= 0 and faces.max() < len(vertices))
        and bool(face_parts.min() >= 0 and face_parts.max() < parts)
    )


def load_measures(key: str) -> np.ndarray | None:
    """(4,) `measures` of the mesh stored under a key, which are read without it; else as `load_mesh`."""
    stored = _load(key, ("measures",))
    is_whole = stored is not None and stored[0].shape == (4,) and stored[0].dtype == np.float64
    return stored[0] if stored is not None and is_whole else None


def measures(mesh: Mesh) -> np.ndarray:
    """(4,) float64: size along x, y and z in metres, and the number of triangles."""
    return np.r_[np.ptp(mesh.vertices, axis=0), len(mesh.faces)].astype(np.float64)


def _load(key: str, names: tuple[str, ...]) -> list[np.ndarray] | None:
    folder = cache_folder("meshes")
    if folder is None:
        return None
    try:
        with np.load(folder / f"{key}.npz", allow_pickle=False) as stored:
            return [stored[name] for name in names]
    except (OSError, ValueError, KeyError, EOFError, RuntimeError, zipfile.BadZipFile, zlib.error):
        pass
    try:
        reason = (folder / f"{key}.txt").read_text(encoding="utf-8")
    except (OSError, ValueError):
        return None
    raise RefusedError(reason)


def store_mesh(key: str, mesh: Mesh) -> None:
    """Keep a mesh."""
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        vertices=mesh.vertices,
        normals=mesh.normals,
        faces=mesh.faces,
        face_parts=mesh.face_parts,
        part_names=np.array(mesh.part_names),
        measures=measures(mesh),
    )
    _replace(f"{key}.npz", buffer.getvalue())


def store_refusal(key: str, reason: str) -> None:
    """Keep why there is no mesh."""
    _replace(f"{key}.txt", reason.encode())


def _replace(name: str, data: bytes) -> None:
    """A whole file under its name at once, or nothing at all; every process writes one of its own."""
    folder = cache_folder("meshes")
    if folder is None:
        return
    part = folder / f"{name}.{secrets.token_hex(8)}.part"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with part.open("xb") as file:  # through no link that others laid in a folder they share
            file.write(data)
        os.replace(part, folder / name)
    except OSError:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
