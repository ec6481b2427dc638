"""Scene <-> JSON, exact: scene_from_json(scene_to_json(s)) == s.

The dataclasses of `model.py` are the schema: the reader walks their type hints, so a key that is missing,
unknown or of the wrong type is an error that names where it is. Floats are written with all their digits.
"""

from __future__ import annotations

import json
import sys
from dataclasses import fields, is_dataclass
from types import GenericAlias, NoneType, UnionType
from typing import Any, Union, get_args, get_origin, get_type_hints

from fsid.assets import BACKGROUND_PARTS
from fsid.config import to_plain
from fsid.errors import FsidError
from fsid.scene.check import check_scene
from fsid.scene.lens import check_distortion, corner_radius
from fsid.scene.model import Scene
from fsid.yaml_json import parse_json


def scene_to_json(scene: Scene) -> str:
    """The scene as JSON text with sorted keys; the same scene always gives the same text.

    NumPy's numbers and arrays are written as numbers and lists. Raises FsidError as `check_scene`.
    """
    check_scene(scene)
    return json.dumps(to_plain(scene), sort_keys=True, allow_nan=False)


def scene_from_json(text: str) -> Scene:
    """The scene written by `scene_to_json`. Raises FsidError that names the offending key."""
    scene: Scene = _read(Scene, parse_json(text, "scene JSON"), "scene")
    _expect(len(scene.cameras) > 0, "scene.cameras", "at least one")
    for key in ("materials", "transforms"):
        _expect(len(getattr(scene, key)) == len(scene.objects), f"scene.{key}", "as long as scene.objects")
    _expect(
        len(scene.motions) in (0, len(scene.objects)), "scene.motions", "empty or as long as scene.objects"
    )
    kind = scene.background.kind
    _expect(kind in BACKGROUND_PARTS, "scene.background.kind", f"one of {', '.join(BACKGROUND_PARTS)}")
    named = set(scene.background.materials) == set(BACKGROUND_PARTS[kind])
    surfaces = ", ".join(BACKGROUND_PARTS[kind])
    _expect(named, "scene.background.materials", f"one material for each of {surfaces}")
    check_scene(scene)
    for camera in scene.cameras:
        if camera.distortion is not None:
            check_distortion(camera.distortion, corner_radius(camera))
    return scene


def _read(kind: Any, data: Any, where: str) -> Any:
    if is_dataclass(kind):
        return _read_record(kind, data, where)
    origin, arguments = get_origin(kind), get_args(kind)
    if origin in (Union, UnionType):
        return None if data is None else _read(next(a for a in arguments if a is not NoneType), data, where)
    if origin is tuple:
        return _read_tuple(arguments, data, where)
    if origin is dict:
        _expect(isinstance(data, dict), where, "an object")
        return {key: _read(arguments[1], value, f"{where}.{key}") for key, value in data.items()}
    if kind is float:
        number = isinstance(data, int | float) and not isinstance(data, bool)
        _expect(number and abs(data) <= sys.float_info.max, where, "a finite number")
        return float(data)
    is_kind = isinstance(data, kind) and isinstance(data, bool) == (kind is bool)
    _expect(is_kind, where, f"of type {kind.__name__}")
    _expect(kind is not int or data >= 0, where, "at least 0")
    return data


def _read_record(kind: Any, data: Any, where: str) -> Any:
    _expect(isinstance(data, dict), where, "an object")
    names = {field.name for field in fields(kind)}
    for key in sorted(data.keys() - names):
        raise FsidError(f"scene JSON: unknown key {where}.{key}; remove it")
    for key in sorted(names - data.keys()):
        raise FsidError(f"scene JSON: missing key {where}.{key}; add it")
    hints = get_type_hints(kind)
    return kind(**{name: _read(hints[name], data[name], f"{where}.{name}") for name in names})


def _read_tuple(arguments: tuple[GenericAlias, ...], data: Any, where: str) -> tuple[Any, ...]:
    _expect(isinstance(data, list), where, "a list")
    if arguments[-1] is ...:
        return tuple(_read(arguments[0], item, f"{where}[{i}]") for i, item in enumerate(data))
    _expect(len(data) == len(arguments), where, f"a list of {len(arguments)}")
    return tuple(_read(a, d, f"{where}[{i}]") for i, (a, d) in enumerate(zip(arguments, data, strict=True)))


def _expect(condition: bool, where: str, what: str) -> None:
    if not condition:
        raise FsidError(f"scene JSON: {where} must be {what}")
