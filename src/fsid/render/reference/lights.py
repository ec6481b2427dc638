"""Lights of a scene as Mitsuba's emitters.

A point, spot or sun with an extent is a cloud of CLOUD points: it casts the soft shadow of a sphere but is
itself invisible, as in the rasteriser. The cloud's density f(r) ~ r^2 / sqrt(1 - r^2) within the sphere makes
an even disc of it from every side (the Abel transform of a constant). The soft rim of a spot is projected as
a picture. An area light is a rectangle with an emitting front.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from fsid.errors import FsidError
from fsid.render.shadows import FULL_SHARE, half_axes
from fsid.render.sky import panorama
from fsid.scene.model import Light, Scene

CLOUD = 32
_RIM = 256
"""Pixels of a spot's picture."""


def emitters(mi: Any, light: Light, name: str) -> dict[str, Any]:
    """Name -> Mitsuba plugin of everything that one light is made of. Raises FsidError."""
    if light.kind == "area":
        return {name: _area(mi, light)}
    if light.kind not in ("point", "spot", "sun"):
        raise FsidError(f"scene.lights: kind '{light.kind}' is not known to the reference renderer")
    if light.kind == "spot" and light.cone_deg > 180:
        raise FsidError(
            f"scene.lights: a spot of {light.cone_deg:g} degrees; the reference renderer's reach 180 at most"
        )
    spread = _cloud() * light.radius_m if light.radius_m > 0 else np.zeros((1, 3))
    rgb = np.array(light.colour) / len(spread)
    kinds: dict[str, Callable[..., dict[str, Any]]] = {
        "point": _point,
        "spot": partial(_spot, mi),
        "sun": _sun,
    }
    return {f"{name}_{i}": kinds[light.kind](light, offset, rgb) for i, offset in enumerate(spread)}


def surroundings(mi: Any, scene: Scene) -> dict[str, Any]:
    """What light comes from outside: the sky's panorama, or `Scene.ambient` from everywhere."""
    if scene.sky is not None:
        matrix = np.eye(4)
        matrix[:3, :3] = np.stack([(0, 1, 0), (0, 0, 1), (-1, 0, 0)], axis=-1)  # its y is up, its -z is our x
        picture = mi.Bitmap(panorama(scene.sky).copy())  # Mitsuba takes no array that cannot be written
        return {"sky": {"type": "envmap", "bitmap": picture, "to_world": mi.ScalarTransform4f(matrix)}}
    if any(scene.ambient):
        return {"sky": {"type": "constant", "radiance": _rgb(np.array(scene.ambient))}}
    return {}


def _point(light: Light, offset: np.ndarray, rgb: np.ndarray) -> dict[str, Any]:
    position = (np.array(light.position_m) + offset).tolist()
    return {"type": "point", "position": position, "intensity": _rgb(rgb)}


def _spot(mi: Any, light: Light, offset: np.ndarray, rgb: np.ndarray) -> dict[str, Any]:
    half_deg = min(light.cone_deg / 2, 89.0)
    origin, forward = np.array(light.position_m) + offset, _unit(light.direction)
    right, up = _sides(forward)
    matrix = np.eye(4)
    matrix[:3] = np.stack([right, up, forward, origin], axis=-1)
    return {
        "type": "spot",
        "to_world": mi.ScalarTransform4f(matrix),
        "cutoff_angle": half_deg,
        "beam_width": half_deg * 0.999,
        "intensity": _rgb(rgb),
        "texture": {"type": "bitmap", "bitmap": mi.Bitmap(_rim(half_deg)), "raw": True, "wrap_mode": "clamp"},
    }


def _sun(light: Light, offset: np.ndarray, rgb: np.ndarray) -> dict[str, Any]:
    direction = _unit(_unit(light.direction) + offset)
    return {"type": "directional", "direction": direction.tolist(), "irradiance": _rgb(rgb)}


def _area(mi: Any, light: Light) -> dict[str, Any]:
    width, height = half_axes(light)
    matrix = np.eye(4)
    matrix[:3] = np.stack([width, -height, _unit(light.direction), light.position_m], axis=-1)
    return {
        "type": "rectangle",
        "to_world": mi.ScalarTransform4f(matrix),
        "emitter": {"type": "area", "radiance": _rgb(np.array(light.colour))},
        "bsdf": {"type": "diffuse", "reflectance": 0.0},
    }


def _rim(half_deg: float) -> np.ndarray:
    """(P, P, 3) strength of a spot over its square field: smooth in the cosine from full to nothing."""
    at = ((np.arange(_RIM) + 0.5) / _RIM * 2 - 1) * np.tan(np.radians(half_deg))
    cosine = 1 / np.sqrt(1 + at[None, :] ** 2 + at[:, None] ** 2)
    outer, inner = np.cos(np.radians([half_deg, FULL_SHARE * half_deg]))
    t = np.clip((cosine - outer) / (inner - outer), 0, 1)
    return np.repeat((t * t * (3 - 2 * t))[..., None], 3, axis=2).astype(np.float32)


def _cloud() -> np.ndarray:
    """(CLOUD, 3) points in the unit ball: directions of a spherical spiral, radii by the density above."""
    i = (np.arange(CLOUD) + 0.5) / CLOUD
    z, angle = 1 - 2 * i, np.arange(CLOUD) * np.pi * (3 - np.sqrt(5))
    ring = np.sqrt(1 - z * z)
    directions = np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=-1)
    theta = np.linspace(0, np.pi / 2, 1000)  # r = sin(theta): the density is sin^2(theta) d theta
    share = np.cumsum(np.sin(theta) ** 2)
    mixed = np.arange(CLOUD) * 0.6180339887 % 1.0
    return directions * np.sin(np.interp(mixed, share / share[-1], theta))[:, None]


def _rgb(values: np.ndarray) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(v) for v in values]}


def _unit(vector: Any) -> np.ndarray:
    array = np.array(vector, dtype=float)
    return array / np.linalg.norm(array)


def _sides(forward: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    right = _unit(np.cross(forward, np.eye(3)[int(np.argmin(np.abs(forward)))]))
    return right, np.cross(forward, right)
