"""Scene -> .glb (glTF 2.0, Khronos): meshes, pictures, lights and cameras in one file for any other engine.

    glTF (x, y, z) = ours (x, z, -y)          one node at the root turns z up into y up

Radiant intensity becomes candela with 683 lm/W, as other exporters count, so relative brightness is kept and
the exposure is the reader's. What emits has its radiance as it is: Blender divides by 683 for lights alone.
What glTF cannot say is left out or approximated: soft shadows (lights are points), area lights (emitting
rectangles), sky and ambient light, motion, lens distortion. The scene itself, exactly, is in
`asset.extras.fsid` as `fsid.scene.scene_to_json` writes it.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Hashable
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from fsid.assets import MaterialMaps, bake_material
from fsid.files import write_atomically
from fsid.render import gltf_textures as textures
from fsid.render.camera import NEAR_M, lens_of
from fsid.render.parts import Part, parts_of
from fsid.render.shadows import FULL_SHARE, half_axes
from fsid.scene import scene_to_json
from fsid.scene.check import check_scene
from fsid.scene.model import Camera, Light, Material, Scene

LUMENS_PER_WATT = 683.0

_ARRAY, _INDEX = 34962, 34963
_FLOAT, _UINT = 5126, 5125
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_JSON_CHUNK, _BINARY_CHUNK = 0x4E4F534A, 0x004E4942


def write_glb(path: Path | str, scene: Scene, *, texture_size: int = 512) -> None:
    """Write a scene as one .glb file. texture_size: texels per side of a material tile, a power of two.

    Raises FsidError for a scene that cannot be built, or where the file cannot be written.
    """
    write_atomically(Path(path), glb_bytes(scene, texture_size=texture_size))


def glb_bytes(scene: Scene, *, texture_size: int = 512) -> bytes:
    """The content of the .glb of a scene; the same scene always gives the same bytes. FsidError."""
    check_scene(scene)
    document = _Document(texture_size)
    for number, group in groupby(parts_of(scene, 0.0), key=lambda part: part.object_id):
        document.add_body(number, list(group))
    for i, light in enumerate(scene.lights):
        document.add_light(i, light)
    for i, camera in enumerate(scene.cameras):
        document.add_camera(i, camera)
    return document.glb(scene)


class _Document:
    """A glTF document while it grows: its JSON tables and its binary chunk."""

    def __init__(self, texture_size: int) -> None:
        self._texture_size = texture_size
        self._binary = bytearray()
        self._shared: dict[Hashable, int] = {}
        self._maps: tuple[tuple[str, int], MaterialMaps] | None = None
        self._extensions: set[str] = set()
        self._lights: list[dict[str, Any]] = []
        self._tables: dict[str, list[dict[str, Any]]] = {
            name: []
            for name in (
                "nodes",
                "meshes",
                "cameras",
                "materials",
                "textures",
                "images",
                "accessors",
                "bufferViews",
            )
        }

    def add_body(self, number: int, parts: list[Part]) -> None:
        """One node and mesh; every part is a primitive with its material."""
        primitives = [self._primitive(part) for part in parts]
        name = "background" if number < 0 else f"object {number}: {parts[0].body}"
        mesh = self._add("meshes", {"name": name, "primitives": primitives})
        node = {"name": name, "mesh": mesh, "extras": {"object_id": number}}
        self._add("nodes", node | _placed(parts[0].rotation, parts[0].position))

    def add_light(self, number: int, light: Light) -> None:
        """KHR_lights_punctual; an area light is a rectangle that emits."""
        forward = np.array(light.direction, dtype=float)
        forward = forward / (np.linalg.norm(forward) or 1.0)
        rotation = _looking(forward if forward.any() else np.array((0.0, 0.0, -1.0)))
        if light.kind == "area":
            self._add_panel(number, light, forward)
            return
        peak = max(light.colour)
        entry: dict[str, Any] = {
            "name": f"light {number}",
            "type": {"sun": "directional"}.get(light.kind, light.kind),
            "color": [value / peak if peak > 0 else 1.0 for value in light.colour],
            "intensity": peak * LUMENS_PER_WATT,
        }
        if light.kind == "spot":
            half = min(np.radians(light.cone_deg / 2), np.pi / 2 - 1e-3)
            entry["spot"] = {"innerConeAngle": FULL_SHARE * half, "outerConeAngle": half}
        self._extensions.add("KHR_lights_punctual")
        self._lights.append(entry)
        node = {
            "name": entry["name"],
            "extensions": {"KHR_lights_punctual": {"light": len(self._lights) - 1}},
        }
        self._add("nodes", node | _placed(rotation, np.array(light.position_m)))

    def add_camera(self, number: int, camera: Camera) -> None:
        """A pinhole camera; it looks along -z of its node."""
        lens = lens_of(camera)
        entry = {
            "name": f"camera {number}",
            "type": "perspective",
            "perspective": {
                "yfov": 2 * float(np.arctan(1 / lens.focal[1])),
                "aspectRatio": camera.width / camera.height,
                "znear": NEAR_M,
            },
        }
        right, up, forward = lens.rotation
        rotation = np.stack([right, up, -forward], axis=-1)
        node = {"name": entry["name"], "camera": self._add("cameras", entry)}
        self._add("nodes", node | _placed(rotation, lens.position))

    def glb(self, scene: Scene) -> bytes:
        """The finished file."""
        nodes = self._tables["nodes"]
        turn = [-float(np.sqrt(0.5)), 0.0, 0.0, float(np.sqrt(0.5))]
        root = {"name": f"scene {scene.seed}", "rotation": turn, "children": list(range(len(nodes)))}
        document: dict[str, Any] = {
            "asset": {
                "version": "2.0",
                "generator": "FSID",
                "extras": {"fsid": json.loads(scene_to_json(scene))},
            },
            "scene": 0,
            "scenes": [{"nodes": [len(nodes)]}],
            **{name: rows for name, rows in self._tables.items() if rows},
            "buffers": [{"byteLength": len(self._binary)}],
            "samplers": [{"magFilter": 9729, "minFilter": 9987, "wrapS": 10497, "wrapT": 10497}],
        }
        document["nodes"] = [*nodes, root]
        if self._lights:
            document["extensions"] = {"KHR_lights_punctual": {"lights": self._lights}}
        if self._extensions:
            document["extensionsUsed"] = sorted(self._extensions)
        text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
        chunks = [_chunk(_JSON_CHUNK, text, b" "), _chunk(_BINARY_CHUNK, bytes(self._binary), b"\0")]
        return struct.pack("<4sII", b"glTF", 2, 12 + sum(map(len, chunks))) + b"".join(chunks)

    def _add(self, table: str, row: dict[str, Any]) -> int:
        self._tables[table].append(row)
        return len(self._tables[table]) - 1

    def _primitive(self, part: Part) -> dict[str, Any]:
        boxed = textures.boxed(part.surface, part.material)
        material = self._material(part)
        attributes = {
            "POSITION": self._accessor(boxed.positions, limits=True),
            "NORMAL": self._accessor(boxed.normals),
            "TEXCOORD_0": self._accessor(boxed.uv),
        }
        if "normalTexture" in self._tables["materials"][material]:
            attributes["TANGENT"] = self._accessor(boxed.tangents)
        indices = self._accessor(boxed.faces.reshape(-1, 1), index=True)
        return {"attributes": attributes, "indices": indices, "material": material}

    def _accessor(self, values: np.ndarray, *, limits: bool = False, index: bool = False) -> int:
        data = np.ascontiguousarray(values, "<u4" if index else "<f4")
        view = self._view(data.tobytes(), _INDEX if index else _ARRAY)
        row: dict[str, Any] = {
            "bufferView": view,
            "componentType": _UINT if index else _FLOAT,
            "count": len(data),
            "type": _TYPES[data.shape[1]],
        }
        if limits:
            row |= {"min": data.min(0).tolist(), "max": data.max(0).tolist()}
        return self._add("accessors", row)

    def _view(self, data: bytes, target: int | None = None) -> int:
        self._binary += b"\0" * (-len(self._binary) % 4)
        row = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(data)}
        self._binary += data
        return self._add("bufferViews", row | ({"target": target} if target else {}))

    def _material(self, part: Part) -> int:
        thickness_m = part.thickness_m if part.material.transmission > 0 else 0.0
        key = ("material", part.material, part.name, thickness_m)
        if key not in self._shared:
            self._shared[key] = self._add("materials", self._look(part.material, part.name, thickness_m))
        return self._shared[key]

    def _look(self, material: Material, name: str, thickness_m: float) -> dict[str, Any]:
        maps = self._maps_of(material)
        family = (material.family, material.variant)
        inside, outside = textures.roughness_factors(material.roughness_scale)
        colour = self._texture(
            ("colour", *family, material.colours), lambda: textures.base_colour(maps, material), textures.jpeg
        )
        surface: dict[str, Any] = {
            "roughnessFactor": outside,
            "metallicFactor": 1.0,
            "baseColorTexture": colour,
        }
        surface["metallicRoughnessTexture"] = self._texture(
            ("roughness", *family, inside), lambda: textures.roughness_metallic(maps, inside), textures.png
        )
        row: dict[str, Any] = {"name": f"{name} ({material.family})", "pbrMetallicRoughness": surface}
        row["doubleSided"] = material.transmission <= 0
        if material.relief_scale > 0 and not textures.is_flat(textures.normals(maps)):
            relief = self._texture(("normal", *family), lambda: textures.normals(maps), textures.png)
            row["normalTexture"] = relief | {"scale": material.relief_scale}
        if material.emission > 0:
            row |= {"emissiveTexture": colour, "emissiveFactor": [1.0, 1.0, 1.0]}
        found = textures.extensions(material, colour, thickness_m)
        if found:
            self._extensions |= found.keys()
            row["extensions"] = found
        return row

    def _maps_of(self, material: Material) -> MaterialMaps:
        """The last one stays: neighbours often share a family."""
        key = (material.family, material.variant)
        if self._maps is None or self._maps[0] != key:
            self._maps = (key, bake_material(*key, self._texture_size))
        return self._maps[1]

    def _texture(
        self, key: Hashable, pixels: Callable[[], np.ndarray], encoded: Callable[[np.ndarray], bytes]
    ) -> dict[str, Any]:
        """A reference to a picture, which is made once; one of a single colour has a single pixel block."""
        if key not in self._shared:
            picture = pixels()
            if textures.is_flat(picture):
                picture = np.broadcast_to(np.rint(picture.mean((0, 1))), (8, 8, 3)).astype(np.uint8)
            kind = "image/png" if encoded is textures.png else "image/jpeg"
            image = {"bufferView": self._view(encoded(picture)), "mimeType": kind}
            source = self._add("images", image)
            self._shared[key] = self._add("textures", {"sampler": 0, "source": source})
        return {"index": self._shared[key]}

    def _add_panel(self, number: int, light: Light, forward: np.ndarray) -> None:
        width, height = half_axes(light)
        corners = np.array([(-1, 1), (1, 1), (1, -1), (-1, -1)]) @ np.stack([width, height])
        peak = max(*light.colour, 1e-9)
        material = {
            "name": f"light {number}",
            "pbrMetallicRoughness": {"baseColorFactor": [0.0, 0.0, 0.0, 1.0], "metallicFactor": 0.0},
            "emissiveFactor": [value / peak for value in light.colour],
            "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": peak}},
        }
        self._extensions.add("KHR_materials_emissive_strength")
        primitive = {
            "attributes": {
                "POSITION": self._accessor(corners, limits=True),
                "NORMAL": self._accessor(np.tile(forward, (4, 1))),
            },
            "indices": self._accessor(np.array([0, 1, 2, 0, 2, 3])[:, None], index=True),
            "material": self._add("materials", material),
        }
        mesh = self._add("meshes", {"name": f"light {number}", "primitives": [primitive]})
        node = {"name": f"light {number}", "mesh": mesh}
        self._add("nodes", node | _placed(np.eye(3), np.array(light.position_m)))


def _chunk(kind: int, data: bytes, filler: bytes) -> bytes:
    padded = data + filler * (-len(data) % 4)
    return struct.pack("<II", len(padded), kind) + padded


def _placed(rotation: np.ndarray, position: np.ndarray) -> dict[str, Any]:
    return {"rotation": _quaternion(rotation), "translation": [float(v) for v in position]}


def _looking(forward: np.ndarray) -> np.ndarray:
    """(3, 3) rotation that takes -z to `forward`."""
    right = np.cross(forward, np.eye(3)[int(np.argmin(np.abs(forward)))])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, forward), -forward], axis=-1)


def _quaternion(rotation: np.ndarray) -> list[float]:
    """(x, y, z, w) of a rotation matrix (Shepperd 1978: by the largest component)."""
    m = rotation
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    squares = np.array([1 + 2 * m[0, 0] - trace, 1 + 2 * m[1, 1] - trace, 1 + 2 * m[2, 2] - trace, 1 + trace])
    i = int(np.argmax(squares))
    if i == 3:
        q = np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], squares[3]])
    else:
        j, k = (i + 1) % 3, (i + 2) % 3
        q = np.zeros(4)
        q[i], q[3] = squares[i], m[k, j] - m[j, k]
        q[j], q[k] = m[j, i] + m[i, j], m[k, i] + m[i, k]
    return [float(v) for v in q / np.linalg.norm(q)]
