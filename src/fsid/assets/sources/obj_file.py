"""A Wavefront OBJ -> `Triangles`: its vertices, its faces and the names of its materials.

    v X Y Z ...        a vertex; what follows the three numbers (weight, colour) is left
    f A/.../... B ...  a face by its vertices: from 1, or from -1 backwards from the last vertex read so far
    usemtl NAME        the part of the faces that follow; the .mtl file is never opened
    # ...              a comment, but after usemtl, where names hold this sign

Blanks may be tabs and stand before a line, a backslash joins it to the next, and lines end in any way.
"""

from __future__ import annotations

import io
from array import array
from collections.abc import Sequence

import numpy as np

from fsid.assets.sources.cleaning import Triangles
from fsid.assets.sources.limits import MAX_LINE_BYTES, MAX_PARTS, MAX_TRIANGLES, NO_VERTEX, RefusedError
from fsid.assets.sources.polygons import triangulated


def read_obj(data: bytes) -> Triangles:
    """The triangles of an OBJ as they are in the file; one part per material, the last one first.

    Faces without a material are a part, too, which bears the name of the first object. Raises RefusedError;
    ValueError where a number is none.
    """
    points, corners, sizes, owners = array("d"), array("q"), array("q"), array("q")
    parts: dict[bytes | None, int] = {}
    part, first_object = None, b"geometry"
    for line in io.BytesIO(_plain_lines(data)):
        if len(line) > MAX_LINE_BYTES:
            raise RefusedError(f"a line of {len(line):,} bytes")
        word, *values = line.partition(b"#")[0].split() or [b""]
        if word == b"v":
            x, y, z = map(float, values[:3])
            points.extend((x, y, z))
        elif word == b"f":
            indices = _indices(values, len(points) // 3)
            if len(indices) < 3:
                continue
            corners.extend(indices)
            sizes.append(len(indices))
            owners.append(parts.setdefault(part, len(parts)))
            if len(corners) > 3 * MAX_TRIANGLES or len(parts) > MAX_PARTS:
                raise RefusedError(f"more than {MAX_TRIANGLES:,} triangles or {MAX_PARTS:,} materials")
        elif word == b"usemtl":
            part = line.strip()[len(word) :].strip() or None
        elif word == b"o" and values and not parts:
            first_object = line.strip()[len(word) :].strip()
    names = [(first_object if name is None else name).decode("utf-8", "replace") for name in parts]
    vertices, face_corners = np.array(points, np.float64).reshape(-1, 3), np.array(corners, np.int64)
    if len(corners) and not 0 <= face_corners.min() <= face_corners.max() < len(vertices):
        raise RefusedError(NO_VERTEX)
    triangles, owner = triangulated(vertices, face_corners, np.array(sizes, np.int64))
    part_of = len(names) - 1 - np.array(owners, np.int64)
    return Triangles(vertices, triangles, part_of[owner], tuple(names[::-1]))


def _plain_lines(data: bytes) -> bytes:
    """OBJ text with one line feed at every end of a line, without byte order mark and broken lines."""
    text = data.removeprefix(b"\xef\xbb\xbf").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return text.replace(b"\\\n", b" ")


def _indices(values: Sequence[bytes], count: int) -> list[int]:
    """Numbers of vertices from 0, of a face after `count` vertices; < 0 is no vertex."""
    given = [int(value.partition(b"/")[0]) for value in values]
    return [i + count if i < 0 else i - 1 for i in given]
