"""Materials -> glTF: baked maps with the palette applied, as pictures that parts share.

    baseColor   sRGB of lerp(lerp(colour_a, colour_b, mix), colour_c, pattern) * 2 detail
    normal      (-du, dv, 1) of the height in metres per metre, v down, green up; `scale` is relief_scale
    roughness   green, metallic: blue

UVs are the box mapping in tiles with the hard seams of a box: each triangle lies on the axial plane that its
normal is closest to (the renderer blends between planes where a surface turns).
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image

from fsid.assets import MaterialMaps
from fsid.assets.triangle import decode
from fsid.render.parts import Surface
from fsid.scene.model import Material


@dataclass(frozen=True, eq=False)
class Boxed:
    """positions, normals: (V, 3). uv: (V, 2) tiles, v down. tangents: (V, 4) as glTF has them, where u grows
    and on which side green is up. faces: (F, 3)."""

    positions: np.ndarray
    normals: np.ndarray
    uv: np.ndarray
    tangents: np.ndarray
    faces: np.ndarray


_QUALITY = 90
"""Of JPEG pictures."""

_ROUGHNESS_STEP = 0.1
"""Of a factor above 1, which glTF does not have: it goes into the picture, rounded so that parts share it."""

_FLAT = 1.5 / 255

SHEEN_ALPHA = 0.5
"""Width of the lobe of fibres in shaders/reflector.glsl, where it makes sin^(1 / alpha) a square."""

SHEEN_ROUGHNESS = SHEEN_ALPHA**0.5
"""The same for KHR_materials_sheen, which squares it."""


def boxed(surface: Surface, material: Material) -> Boxed:
    """The surface with texture coordinates; vertices are doubled where triangles lie on different planes."""
    a, b, c = (surface.vertices[surface.faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    axis = np.abs(normal).argmax(1)
    side = np.take_along_axis(normal, axis[:, None], axis=1)[:, 0] < 0
    key = surface.faces * 6 + (2 * axis + side)[:, None]
    unique, faces = np.unique(key, return_inverse=True)
    vertex, plane = np.divmod(unique, 6)
    positions = surface.vertices[vertex]
    cos, sin = np.cos(np.radians(material.rotation_deg)), np.sin(np.radians(material.rotation_deg))
    u, v = cos * _U[plane] + sin * _V[plane], cos * _V[plane] - sin * _U[plane]
    uv = np.stack([(u * positions).sum(1), (v * positions).sum(1)], axis=-1) / material.tile_m
    n = surface.normals[vertex]
    along = u - n * (n * u).sum(1, keepdims=True)
    along += np.where(np.linalg.norm(along, axis=1, keepdims=True) < 1e-3, np.cross(n, v), 0.0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    hand = np.where((np.cross(n, along) * v).sum(1) > 0, -1.0, 1.0)
    tangents = np.c_[along, hand]
    return Boxed(positions, n, uv + _OFFSET * (plane // 2)[:, None], tangents, faces.reshape(-1, 3))


_OFFSET = np.array([0.37, 0.61])
_U = np.array([(0, 1, 0), (0, -1, 0), (-1, 0, 0), (1, 0, 0), (1, 0, 0), (1, 0, 0)], dtype=float)
_V = np.array([(0, 0, -1)] * 4 + [(0, -1, 0), (0, 1, 0)], dtype=float)
"""Where u and v grow on the planes +x -x +y -y +z -z; v grows downwards."""


def base_colour(maps: MaterialMaps, material: Material) -> np.ndarray:
    """(S, S, 3) uint8, sRGB."""
    colours = np.array(material.colours, np.float32)
    linear = np.clip(decode(maps.mix, maps.pattern, maps.detail, colours), 0, 1)
    return _bytes(np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055))


def normals(maps: MaterialMaps) -> np.ndarray:
    """(S, S, 3) uint8, tangent space, relief_scale 1."""
    gain = maps.relief_m * len(maps.height) / (2 * maps.tile_m)
    du, dv = ((np.roll(maps.height, -1, i) - np.roll(maps.height, 1, i)) * gain for i in (1, 0))
    n = np.stack([-du, dv, np.ones_like(du)], axis=-1)
    return _bytes(n / np.linalg.norm(n, axis=-1, keepdims=True) / 2 + 0.5)


def roughness_metallic(maps: MaterialMaps, factor: float) -> np.ndarray:
    """(S, S, 3) uint8: nothing, roughness * factor, metallic."""
    rough = np.clip(maps.roughness * factor, 0.0, 1.0)
    return _bytes(np.stack([np.ones_like(rough), rough, maps.metallic], axis=-1))


def roughness_factors(scale: float) -> tuple[float, float]:
    """roughness_scale as (factor inside the picture, factor of the material, at most 1)."""
    if scale <= 1:
        return 1.0, scale
    return round(scale / _ROUGHNESS_STEP) * _ROUGHNESS_STEP, 1.0


def is_flat(pixels: np.ndarray) -> bool:
    """Whether one colour says it all."""
    return float(pixels.reshape(-1, 3).std(0).max()) < 255 * _FLAT


def jpeg(pixels: np.ndarray) -> bytes:
    """Without colour subsampling; for colours alone."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=_QUALITY, subsampling=0)
    return buffer.getvalue()


def png(pixels: np.ndarray) -> bytes:
    """Every value as it is: JPEG makes noise of fine relief, and plastic 15 % metal beside rough places."""
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()


def extensions(material: Material, colour: dict[str, Any], thickness_m: float) -> dict[str, Any]:
    """KHR extensions for the lobes beyond metallic-roughness that the material has. colour: its base colour,
    a reference to a texture, which also tints what goes through. thickness_m: of its glass."""
    out: dict[str, Any] = {}
    if material.clearcoat > 0:
        out["KHR_materials_clearcoat"] = {
            "clearcoatFactor": material.clearcoat,
            "clearcoatRoughnessFactor": material.clearcoat_roughness,
        }
    if material.sheen > 0:
        out["KHR_materials_sheen"] = {
            "sheenColorFactor": [material.sheen] * 3,
            "sheenRoughnessFactor": SHEEN_ROUGHNESS,
        }
    if material.transmission > 0:
        out["KHR_materials_transmission"] = {"transmissionFactor": material.transmission}
        out["KHR_materials_ior"] = {"ior": 1.5}
        out["KHR_materials_volume"] = {"thicknessFactor": thickness_m}
    if material.translucency > 0:
        out["KHR_materials_diffuse_transmission"] = {
            "diffuseTransmissionFactor": material.translucency,
            "diffuseTransmissionColorTexture": colour,
        }
    if material.emission > 0:
        out["KHR_materials_emissive_strength"] = {"emissiveStrength": material.emission}
    return out


def _bytes(values: np.ndarray) -> np.ndarray:
    return np.rint(values * 255).astype(np.uint8)
