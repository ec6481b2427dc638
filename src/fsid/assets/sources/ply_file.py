"""A Stanford PLY, as text or binary in either byte order -> `Triangles`.

    element vertex N     with the properties x, y, z
    element face M       with a list vertex_indices or vertex_index, of any number of corners
    other elements and properties are passed over

A row with lists can be found only through those before it; where all lists of an element are as long as those
of its first row, it is an array.
"""

from __future__ import annotations

import struct
import warnings
from dataclasses import dataclass, field, replace

import numpy as np

from fsid.assets.sources.cleaning import Triangles
from fsid.assets.sources.limits import MAX_LINES, MAX_TRIANGLES, NO_VERTEX, RefusedError
from fsid.assets.sources.polygons import triangulated

_MAX_HEADER_BYTES = 100_000
_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "double": "f8", "float32": "f4", "float64": "f8"},
}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_SHORT = "it is shorter than its header states"
_CORNERS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class _Property:
    """kind: numpy's. length_kind: of the number before a list, "" for a single value."""

    name: str
    kind: str
    length_kind: str = ""


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class _Places:
    """Where the values of each property of each row begin, and how many they are, (rows, properties).

    width: of rows that are all alike, of which only the first is here; 0 where all are.
    """

    starts: np.ndarray
    lengths: np.ndarray
    width: int = 0

    @staticmethod
    def of(rows: list[list[tuple[int, int]]], properties: int) -> _Places:
        found = np.array(rows, np.int64).reshape(len(rows), properties, 2)
        return _Places(found[..., 0], found[..., 1])


def read_ply(data: bytes) -> Triangles:
    """The triangles of a PLY as they are in the file, one part. Raises RefusedError."""
    order, elements, body = _header(data)
    rows = _Text(body) if not order else _Binary(body, order)
    vertices, sizes, corners = np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros(0, np.int64)
    for element in elements:
        names = [each.name for each in element.properties]
        places = rows.places(element)
        if element.name == "vertex":
            columns = [rows.numbers(element, places, names.index(axis))[1] for axis in "xyz"]
            vertices = np.stack(columns, axis=-1).astype(np.float64)
        elif element.name == "face":
            place = next((names.index(name) for name in _CORNERS if name in names), None)
            if place is None or not element.properties[place].length_kind:
                raise RefusedError("faces without corners")
            sizes, corners = rows.numbers(element, places, place)
            corners = corners.astype(np.int64)
    if len(corners) > 3 * MAX_TRIANGLES:
        raise RefusedError(f"more than {MAX_TRIANGLES:,} triangles")
    if len(corners) and not 0 <= corners.min() <= corners.max() < len(vertices):
        raise RefusedError(NO_VERTEX)
    kept = sizes >= 3
    triangles, _ = triangulated(vertices, corners[np.repeat(kept, sizes)], sizes[kept])
    return Triangles(vertices, triangles, np.zeros(len(triangles), np.int64), ("geometry",))


def _header(data: bytes) -> tuple[str, list[_Element], bytes]:
    """Byte order ("" for text), elements, and what follows the header."""
    end = data.find(b"end_header", 0, _MAX_HEADER_BYTES)
    if not data.startswith(b"ply") or end < 0:
        raise RefusedError("no PLY, or a header without end")
    order, elements = None, []
    for line in data[:end].decode("latin-1").splitlines()[1:]:
        match line.split():
            case ["format", kind, *_]:
                order = _ORDERS.get(kind.lower())
            case ["element", name, count]:
                if not count.isdecimal() or len(count) > 18 or int(count) > min(len(data), 3 * MAX_TRIANGLES):
                    raise RefusedError(f"{count[:20]} elements in a file of {len(data):,} bytes")
                elements.append(_Element(name, int(count)))
            case ["property", "list", length, kind, name]:
                elements[-1].properties.append(_Property(name, _TYPES[kind], _TYPES[length]))
            case ["property", kind, name]:
                elements[-1].properties.append(_Property(name, _TYPES[kind]))
    if order is None:
        raise RefusedError("a format that is no PLY's")
    start = end + len(b"end_header")
    start += 2 if data[start : start + 2] == b"\r\n" else 1
    return order, elements, data[start:]


class _Rows:
    """The numbers after the header; the rows of one element after the other."""

    def __init__(self) -> None:
        self._at = 0

    def places(self, element: _Element) -> _Places:
        """Of the next element, which follows those that were asked for."""
        return self._alike(element) or self._row_by_row(element)

    def numbers(self, element: _Element, found: _Places, place: int) -> tuple[np.ndarray, np.ndarray]:
        """How many the property at `place` has in every row, (count,), and these, one row after the other."""
        kind, starts, sizes = element.properties[place].kind, found.starts[:, place], found.lengths[:, place]
        if found.width:
            table = self._table(starts[0], found.width, (element.count, int(sizes[0])), kind)
            return np.full(element.count, sizes[0]), table.ravel()
        within = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
        return sizes, self._values(np.repeat(starts, sizes) + self._step(kind) * within, kind)

    def _alike(self, element: _Element) -> _Places | None:
        """Of rows that are all like the first; None where they are not."""
        if not element.count:
            return None
        row, end = self._row(element, self._at)
        found, width = _Places.of([row], len(row)), end - self._at
        if element.count * width > self._length() - self._at:
            return None
        for (start, length), each in zip(row, element.properties, strict=True):
            if each.length_kind:
                at = start - self._step(each.length_kind)
                if (self._table(at, width, (element.count, 1), each.length_kind) != length).any():
                    return None
        self._at += element.count * width
        return replace(found, width=width)

    def _row_by_row(self, element: _Element) -> _Places:
        rows = []
        for _ in range(element.count):
            row, self._at = self._row(element, self._at)
            rows.append(row)
        return _Places.of(rows, len(element.properties))

    def _row(self, element: _Element, at: int) -> tuple[list[tuple[int, int]], int]:
        """(start, length) of each property of the row that begins at `at`, and where it ends."""
        places = []
        for each in element.properties:
            length = 1
            if each.length_kind:
                if at + self._step(each.length_kind) > self._length():
                    raise RefusedError(_SHORT)
                length = self._one(at, each.length_kind)
                at += self._step(each.length_kind)
            places.append((at, length))
            at += length * self._step(each.kind)
            if length < 0 or at > self._length():
                raise RefusedError(_SHORT)
        return places, at

    def _one(self, at: int, kind: str) -> int:
        """A single number."""
        raise NotImplementedError

    def _step(self, kind: str) -> int:
        """How many places a number takes."""
        raise NotImplementedError

    def _length(self) -> int:
        """How many places there are."""
        raise NotImplementedError

    def _values(self, at: np.ndarray, kind: str) -> np.ndarray:
        """The numbers at these places."""
        raise NotImplementedError

    def _table(self, at: int, width: int, shape: tuple[int, int], kind: str) -> np.ndarray:
        """Numbers that follow each other, in rows that begin at `at` and then every `width` places."""
        raise NotImplementedError


class _Text(_Rows):
    """Places are numbers in the order of the file."""

    def __init__(self, body: bytes) -> None:
        super().__init__()
        lines = len(body) - len(body.translate(None, b"\n\r\v\f\x1c\x1d\x1e"))
        if lines > MAX_LINES or not body.isascii():
            raise RefusedError(f"more than {MAX_LINES:,} lines, or letters among its numbers")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # where a number is none, the numbers end
            self._numbers = np.fromstring(body.decode("ascii"), np.float64, sep=" ")

    def _step(self, kind: str) -> int:
        return 1

    def _length(self) -> int:
        return len(self._numbers)

    def _one(self, at: int, kind: str) -> int:
        return int(self._numbers[at])

    def _values(self, at: np.ndarray, kind: str) -> np.ndarray:
        return self._numbers[at]

    def _table(self, at: int, width: int, shape: tuple[int, int], kind: str) -> np.ndarray:
        return np.ndarray(shape, np.float64, self._numbers.data, 8 * at, (8 * width, 8))


class _Binary(_Rows):
    """Places are bytes."""

    def __init__(self, body: bytes, order: str) -> None:
        super().__init__()
        self._body, self._bytes, self._order = body, np.frombuffer(body, np.uint8), order

    def _step(self, kind: str) -> int:
        return int(kind[1])

    def _length(self) -> int:
        return len(self._bytes)

    def _one(self, at: int, kind: str) -> int:
        return int(struct.unpack_from(self._order + np.dtype(kind).char, self._body, at)[0])

    def _values(self, at: np.ndarray, kind: str) -> np.ndarray:
        size = self._step(kind)
        return self._bytes[at[:, None] + np.arange(size)].view(self._order + kind)[:, 0]

    def _table(self, at: int, width: int, shape: tuple[int, int], kind: str) -> np.ndarray:
        return np.ndarray(shape, self._order + kind, self._body, at, (width, self._step(kind)))
