"""What a scene must be for any renderer or exporter, as it may have been written by hand."""

from __future__ import annotations

import math
from itertools import chain
from typing import Any

import numpy as np

from fsid.errors import FsidError, check_kind
from fsid.scene.model import Camera, Light, Material, Scene

LIGHT_KINDS = ("point", "spot", "sun", "area")
_SHARES = ("clearcoat", "clearcoat_roughness", "sheen", "translucency", "transmission")


def check_scene(scene: Scene) -> None:
    """FsidError that names the value which makes no sense, by its key in the scene's JSON."""
    check_kind(scene, Scene, "scene_from_json makes one of JSON's text")
    for i, camera in enumerate(scene.cameras):
        _check_camera(f"scene.cameras[{i}]", camera)
    for i, light in enumerate(scene.lights):
        _check_light(f"scene.lights[{i}]", light)
    for i, S in enumerate(scene.objects):
        if S.seed < 0:
            raise FsidError(f"scene.objects[{i}].seed = {S.seed}: must not be negative")
    for i, transform in enumerate(scene.transforms):
        for name in ("position_m", "rotation_deg", "scale"):
            _check_numbers(f"scene.transforms[{i}].{name}", getattr(transform, name), 3)
        if 0 in tuple(transform.scale):
            raise FsidError(f"scene.transforms[{i}].scale = {transform.scale}: must not be zero")
    for i, motion in enumerate(scene.motions):
        for name in ("velocity_m_s", "spin_deg_s"):
            _check_numbers(f"scene.motions[{i}].{name}", getattr(motion, name), 3)
    _check_colour("scene.ambient", scene.ambient)
    if scene.sky is not None:
        _check_colour("scene.sky.colour", scene.sky.colour)
        for name in ("cloudiness", "azimuth_deg"):
            _check_finite(f"scene.sky.{name}", getattr(scene.sky, name))
        if scene.background.kind != "open-air":
            raise FsidError(
                f"scene.sky: a closed '{scene.background.kind}' lets no sky in; "
                "remove it, or use kind 'open-air'"
            )
    for i, parts in enumerate(scene.materials):
        if isinstance(parts, Material):
            raise FsidError(f"scene.materials[{i}]: must hold one material for each part of its object")
    of_objects = (
        (f"scene.materials[{i}][{part}]", material)
        for i, parts in enumerate(scene.materials)
        for part, material in enumerate(parts)
    )
    of_background = ((f"scene.background.materials.{k}", m) for k, m in scene.background.materials.items())
    for where, material in chain(of_objects, of_background):
        _check_material(where, material)


def camera_of(scene: Scene, index: int, argument: str = "camera_index") -> Camera:
    """One of the cameras of a scene; FsidError, naming `argument`, where it has no such."""
    if not 0 <= index < len(scene.cameras):
        raise FsidError(f"{argument} {index}: the scene has {len(scene.cameras)} cameras")
    return scene.cameras[index]


def _check_camera(where: str, camera: Camera) -> None:
    for size in (camera.width, camera.height):
        if not isinstance(size, int | np.integer):
            raise FsidError(f"{where}: width and height must be whole numbers of pixels; got {size!r}")
    if min(camera.width, camera.height) < 1:
        raise FsidError(f"{where}: {camera.width}x{camera.height} pixels; at least 1x1 are needed")
    for name in ("position_m", "target_m", "up", "velocity_m_s", "spin_deg_s", "vignetting"):
        _check_numbers(f"{where}.{name}", getattr(camera, name), 3)
    for name in ("chromatic_aberration", "colour_contrast"):
        _check_numbers(f"{where}.{name}", getattr(camera, name), 2)
    for name in ("time_s", "exposure_s", "aperture_m", "focus_m"):
        _check_finite(f"{where}.{name}", getattr(camera, name))
    if not 0 < camera.fov_deg < 180:
        raise FsidError(f"{where}.fov_deg = {camera.fov_deg:g}: must lie between 0 and 180 degrees")


def _check_light(where: str, light: Light) -> None:
    if light.kind not in LIGHT_KINDS:
        raise FsidError(f"{where}.kind '{light.kind}' is not known; use {', '.join(LIGHT_KINDS)}")
    _check_numbers(f"{where}.position_m", light.position_m, 3)
    _check_numbers(f"{where}.direction", light.direction, 3)
    _check_numbers(f"{where}.size_m", light.size_m, 2)
    if light.kind == "area" and not min(light.size_m) > 0:
        raise FsidError(f"{where}.size_m = {light.size_m}: an area light needs two lengths above 0")
    if light.kind != "point" and not np.linalg.norm(light.direction) > 0:
        raise FsidError(f"{where}.direction = {light.direction}: must not be zero")
    if not 0 <= light.radius_m < math.inf:
        raise FsidError(f"{where}.radius_m = {light.radius_m:g}: must be 0 or more, and finite")
    if light.kind == "spot" and not 0 < light.cone_deg <= 360:
        raise FsidError(f"{where}.cone_deg = {light.cone_deg:g}: must be above 0, at most 360 degrees")
    _check_colour(f"{where}.colour", light.colour)


def _check_finite(where: str, value: float) -> None:
    if not math.isfinite(value):
        raise FsidError(f"{where} = {value:g}: must be finite")


def _check_numbers(where: str, values: Any, count: int) -> None:
    try:
        is_good = len(values) == count and all(map(math.isfinite, values))
    except TypeError:
        is_good = False
    if not is_good:
        raise FsidError(f"{where} = {values}: must be {count} finite numbers")


def _check_colour(where: str, colour: Any) -> None:
    _check_numbers(where, colour, 3)
    if min(colour) < 0:
        raise FsidError(f"{where} = {colour}: there is no light below 0")


def _check_material(where: str, material: Material) -> None:
    if not 0 < material.tile_m < math.inf:
        raise FsidError(f"{where}.tile_m = {material.tile_m:g}: must be above 0, and finite")
    for name in _SHARES:
        if not 0 <= getattr(material, name) <= 1:
            raise FsidError(f"{where}.{name} = {getattr(material, name):g}: must lie between 0 and 1")
    for name in ("roughness_scale", "emission"):
        if not 0 <= getattr(material, name) < math.inf:
            raise FsidError(f"{where}.{name} = {getattr(material, name):g}: must be 0 or more, and finite")
    for name in ("rotation_deg", "relief_scale"):
        _check_finite(f"{where}.{name}", getattr(material, name))
    if len(material.colours) != 3:
        raise FsidError(f"{where}.colours: must be three colours; got {len(material.colours)}")
    for colour in material.colours:
        _check_numbers(f"{where}.colours", colour, 3)
    if min(map(min, material.colours)) < 0:
        raise FsidError(f"{where}.colours = {material.colours}: there is no albedo below 0")
