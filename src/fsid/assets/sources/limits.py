"""How much of somebody else's file is read: beyond this it is refused, whatever its headers promise.

Mesh files come from the internet. A few hundred bytes can declare 10^12 vertices, a zip of 40 kB can unpack
to gigabytes, and a scene graph can name itself as its child. Every number that a file states is compared
with these limits before anything is allocated for it.
"""

from __future__ import annotations

MAX_FILE_BYTES = 256 * 2**20
"""Of one mesh file, unpacked, and of all that it refers to."""

MAX_ARCHIVE_BYTES = 2 * 2**30
MAX_DIRECTORY_BYTES = 32 * 2**20
"""Of the directory at a zip's end: some 300,000 members."""

MAX_CATALOGUE_BYTES = 16 * 2**20
MAX_MODELS = 10_000
"""Of a library; each that cannot be read leaves a file in the cache."""

MAX_LICENCE_LETTERS = 20_000
MAX_TRIANGLES = 4_000_000
"""As read. What is kept is `cleaning.KEPT_TRIANGLES`."""

MAX_PARTS = 5_000
"""Materials of an OBJ."""

MAX_LINE_BYTES = 16 * 2**20
"""Of an OBJ."""

MAX_LINES = 6_000_000
"""Of an ASCII PLY, some 400 bytes of memory each."""

MAX_EAR_WORK = 10**8
"""Corners looked through to divide the concave faces of a mesh."""

NO_VERTEX = "a face that names a vertex which does not exist"

MAX_NODES = 5_000
MAX_DEPTH = 200
"""Of a glTF scene graph."""

MAX_JSON_VALUES = 4_000_000
"""Of a glTF document, which is told by its commas; up to some 80 bytes of memory each."""


class RefusedError(Exception):
    """Why a mesh is not used: a short clause without the file's name, which the caller knows."""


class NotNowError(RefusedError):
    """A refusal for no fault of the content (no permission, no memory): another time it may be read."""
