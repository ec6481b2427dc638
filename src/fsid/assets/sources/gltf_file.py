"""The geometry of a glTF file, and nothing else of it, as a document that is safe to hand on.

A glTF document may refer to other files, nest nodes without end and declare accessors of any size. Here its
buffers are fetched (from the same folder or below, never above), its numbers compared with the limits, and
pictures, materials, animations and extensions dropped: what is left is meshes, nodes and bytes.
"""

from __future__ import annotations

import base64
import binascii
import json
import re
import struct
from collections.abc import Callable
from typing import Any

import numpy as np

from fsid.assets.sources.limits import (
    MAX_DEPTH,
    MAX_FILE_BYTES,
    MAX_JSON_VALUES,
    MAX_NODES,
    MAX_TRIANGLES,
    RefusedError,
)

Fetch = Callable[[str], bytes]
"""Relative name -> content; raises RefusedError."""

_KEPT = ("asset", "scene", "scenes", "nodes", "meshes", "accessors", "bufferViews")
_JSON, _BIN = 0x4E4F534A, 0x004E4942
_PACKED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression")
_OF_OLD = "glTF 1, which is not supported: save it as glTF 2"
_LIST, _STRIP, _FAN = 4, 5, 6
_INTEGERS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4"}
_URI = re.compile(rb'"uri"\s*:\s*("(?!data:)(?:[^"\\]|\\.){1,1000}")')


def plain_gltf(data: bytes, fetch: Fetch) -> tuple[bytes, dict[str, bytes], list[str]]:
    """A .glb or .gltf as (JSON document, its buffers by name, names of materials).

    Meshes are called 0.part, 1.part ..., after the place of their material in the list: the reader appends to
    names what makes each piece's another one.

    Raises RefusedError; any other exception means that the document is malformed.
    """
    document, binary = _split(data)
    if str(document.get("asset", {}).get("version", 1)).startswith("1"):  # which need not say so
        raise RefusedError(_OF_OLD)
    if not document.get("meshes"):
        raise RefusedError("no triangles")
    for name in document.get("extensionsRequired", ()):
        if name in _PACKED:
            raise RefusedError(f"compressed with {name}, which is not supported")
    buffers = _buffers(document, binary, fetch)
    _keep_triangles(document)
    _check_graph(document)
    _float_positions(document, buffers)
    _list_fans(document, buffers)
    materials = _split_by_material(document)
    if not document.get("scenes"):
        document |= {"scene": 0, "scenes": [{"nodes": sorted(_roots(document.get("nodes", [])))}]}
    plain = {key: document[key] for key in _KEPT if key in document}
    plain["buffers"] = [{"uri": name, "byteLength": len(content)} for name, content in buffers.items()]
    return json.dumps(plain).encode(), buffers, materials


def referred(data: bytes) -> list[str]:
    """What a .gltf refers to, as far as that is seen without reading it: every "uri" that is no data."""
    return [json.loads(name, strict=False) for name in _URI.findall(data)[:MAX_NODES]]


def _split(data: bytes) -> tuple[dict[str, Any], bytes | None]:
    """The JSON document and the binary chunk of a .glb; of a .gltf there is only the first."""
    if data[:4] != b"glTF":
        return _document(data.removeprefix(b"\xef\xbb\xbf")), None
    if data[4:8] == struct.pack("<I", 1):
        raise RefusedError(_OF_OLD)
    chunks: dict[int, bytes] = {}
    at = 12
    while at + 8 <= len(data):
        length, kind = struct.unpack_from("<II", data, at)
        chunks.setdefault(kind, data[at + 8 : at + 8 + length])
        at += 8 + length
    return _document(chunks[_JSON]), chunks.get(_BIN)


def _document(text: bytes) -> dict[str, Any]:
    if text.count(b",") > MAX_JSON_VALUES:
        raise RefusedError(f"more than {MAX_JSON_VALUES:,} values in its JSON")
    return json.loads(text.decode("utf-8"))


def _buffers(document: dict[str, Any], binary: bytes | None, fetch: Fetch) -> dict[str, bytes]:
    out, total = {}, 0
    for i, buffer in enumerate(document.get("buffers", [])):
        uri = buffer.get("uri")
        if uri is None:
            if i or binary is None:
                raise RefusedError("a buffer without data")
            content = binary
        elif uri.startswith("data:"):
            try:
                content = base64.b64decode(uri.partition("base64,")[2])
            except binascii.Error:
                raise RefusedError("a buffer that is not base64") from None
        else:
            content = fetch(uri)
        total += len(content)
        if total > MAX_FILE_BYTES:
            raise RefusedError(f"more than {MAX_FILE_BYTES >> 20} MiB of buffers")
        out[f"buffer{i}"] = content
    return out


def _keep_triangles(document: dict[str, Any]) -> None:
    """Leave of meshes what makes their triangles, and materials; of accessors, what these triangles need."""
    accessors = document["accessors"]
    kept: dict[int, int] = {}
    for mesh in document["meshes"]:
        mesh["primitives"] = [
            {
                "attributes": {"POSITION": kept.setdefault(p["attributes"]["POSITION"], len(kept))},
                **({"indices": kept.setdefault(p["indices"], len(kept))} if "indices" in p else {}),
                **{key: p[key] for key in ("mode", "material") if key in p},
            }
            for p in mesh["primitives"]
            if _triangles(p, accessors)
        ]
    document["accessors"] = [accessors[i] for i in kept]
    for accessor in document["accessors"]:
        if not 0 <= accessor["count"] <= 3 * MAX_TRIANGLES:
            raise RefusedError(f"an accessor of {accessor['count']:,} elements")
        if "bufferView" not in accessor or "sparse" in accessor:
            raise RefusedError("accessors without data of their own are not supported")


def _check_graph(document: dict[str, Any]) -> None:
    """Every node has one parent at most, depth and instanced triangles are limited."""
    nodes = document.get("nodes", [])
    if len(nodes) > MAX_NODES:
        raise RefusedError(f"{len(nodes):,} nodes")
    sizes = [
        sum(_triangles(primitive, document["accessors"]) for primitive in mesh["primitives"])
        for mesh in document["meshes"]
    ]
    level = _roots(nodes)
    total = depth = reached = 0
    while level:
        reached += len(level)
        total += sum(sizes[nodes[i]["mesh"]] for i in level if "mesh" in nodes[i])
        level = {child for i in level for child in nodes[i].get("children", ())}
        depth += 1
        if depth > MAX_DEPTH or total > MAX_TRIANGLES:
            raise RefusedError(
                f"more than {MAX_DEPTH} levels or {MAX_TRIANGLES:,} triangles in the scene graph"
            )
    if reached != len(nodes):
        raise RefusedError("nodes in a circle")


def _roots(nodes: list[dict[str, Any]]) -> set[int]:
    """Nodes without a parent. Raises RefusedError where a node has two."""
    children = [child for node in nodes for child in node.get("children", ())]
    if len(children) != len(set(children)):
        raise RefusedError("a node with two parents")
    return set(range(len(nodes))) - set(children)


def _float_positions(document: dict[str, Any], buffers: dict[str, bytes]) -> None:
    """Positions that are normalised integers (KHR_mesh_quantization) as the floats that they stand for, each
    accessor in a buffer of its own: the reader takes integers as they are."""
    used = {p["attributes"]["POSITION"] for mesh in document["meshes"] for p in mesh["primitives"]}
    found = [document["accessors"][i] for i in sorted(used)]
    found = [accessor for accessor in found if accessor.get("normalized")]
    if sum(accessor["count"] for accessor in found) * 12 > MAX_FILE_BYTES:
        raise RefusedError(f"more than {MAX_FILE_BYTES >> 20} MiB of positions")
    for accessor in found:
        steps = _integers(document, buffers, accessor, 3)
        floats = np.maximum(steps / np.iinfo(steps.dtype).max, -1).astype("<f4")
        accessor |= {"bufferView": _stored(document, buffers, floats), "byteOffset": 0, "componentType": 5126}


def _list_fans(document: dict[str, Any], buffers: dict[str, bytes]) -> None:
    """Fans of triangles as lists, each in a buffer of its own: the reader knows lists and strips."""
    fans = [p for mesh in document["meshes"] for p in mesh["primitives"] if p.get("mode") == _FAN]
    accessors = document["accessors"]
    if sum(_triangles(fan, accessors) for fan in fans) * 12 > MAX_FILE_BYTES:
        raise RefusedError(f"more than {MAX_FILE_BYTES >> 20} MiB of indices")
    for fan in fans:
        if "indices" in fan:
            corners = _integers(document, buffers, accessors[fan["indices"]], 1)[:, 0]
        else:
            corners = np.arange(accessors[fan["attributes"]["POSITION"]]["count"])
        rim = corners[1:]
        listed = np.stack([rim[:-1], rim[1:], np.full_like(rim[1:], corners[0])], axis=-1).astype("<u4")
        fan |= {"mode": _LIST, "indices": len(accessors)}
        accessors.append(
            {
                "bufferView": _stored(document, buffers, listed),
                "componentType": 5125,
                "count": listed.size,
                "type": "SCALAR",
            }
        )


def _integers(
    document: dict[str, Any], buffers: dict[str, bytes], accessor: dict[str, Any], width: int
) -> np.ndarray:
    """(count, width) integers of an accessor, as they are stored."""
    view = document["bufferViews"][accessor["bufferView"]]
    kind = np.dtype(_INTEGERS[accessor["componentType"]])
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    strides = (view.get("byteStride", width * kind.itemsize), kind.itemsize)
    return np.ndarray((accessor["count"], width), kind, buffers[f"buffer{view['buffer']}"], start, strides)


def _stored(document: dict[str, Any], buffers: dict[str, bytes], values: np.ndarray) -> int:
    """Number of a new view, of a new buffer that holds `values`."""
    document["bufferViews"].append({"buffer": len(buffers), "byteLength": values.nbytes})
    buffers[f"buffer{len(buffers)}"] = values.tobytes()
    return len(document["bufferViews"]) - 1


def _triangles(primitive: dict[str, Any], accessors: list[dict[str, Any]]) -> int:
    """How many a primitive has."""
    corners = accessors[primitive.get("indices", primitive["attributes"]["POSITION"])]["count"]
    mode = primitive.get("mode", _LIST)
    return corners // 3 if mode == _LIST else max(corners - 2, 0) if mode in (_STRIP, _FAN) else 0


def _split_by_material(document: dict[str, Any]) -> list[str]:
    """A mesh of each material instead of every mesh; a node of several gets children. The materials."""
    names: list[str] = []
    materials, nodes = document.get("materials", []), document.get("nodes", [])
    meshes: list[dict[str, Any]] = []
    split = []
    for mesh in document["meshes"]:
        groups: dict[int | None, list[dict[str, Any]]] = {}
        for primitive in mesh["primitives"]:
            groups.setdefault(primitive.pop("material", None), []).append(primitive)
        split.append(range(len(meshes), len(meshes) + len(groups)))
        for i, primitives in groups.items():
            name = mesh.get("name", "part") if i is None else materials[i].get("name", f"material{i}")
            meshes.append({"name": f"{len(names)}.part", "primitives": primitives})
            names.append(str(name))
    for node in [node for node in nodes if "mesh" in node]:
        shown = split[node.pop("mesh")]
        if len(shown) == 1:
            node["mesh"] = shown[0]
        else:
            node["children"] = [*node.get("children", ()), *range(len(nodes), len(nodes) + len(shown))]
            nodes += [{"mesh": mesh} for mesh in reversed(shown)]  # the reader takes the last child first
    document["meshes"] = meshes
    return names
