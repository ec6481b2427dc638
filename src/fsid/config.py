"""Settings are frozen dataclasses; a file and `--set` lines are overlays on their defaults.

    settings = defaults <- FILE (YAML) <- key=value, key=value ...

`key` may be dotted (`scene.lights.count=2`) and `value` is YAML. A key that does not exist or is given twice,
or a value of the wrong type, is an error that names the key: a typing mistake must not silently train on
defaults.
"""

from __future__ import annotations

import copy
import dataclasses
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

import cattrs
import numpy as np
import yaml
from cattrs import AttributeValidationNote

from fsid.errors import FsidError
from fsid.files import write_atomically
from fsid.yaml_json import parse_yaml, read_yaml

T = TypeVar("T")
Override = str | tuple[str, Any]
"""A text `key=value`, whose value is YAML, or a pair (key, value), whose value is taken as it is."""
_Layer = tuple[str, list[str], Any]
"""One setting: its source, the path of its key and its value."""


def _strict_int(value: Any, _: type) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise ValueError(f"{value!r} is not a whole number")
    return value


def _strict_float(value: Any, _: type) -> float:
    if isinstance(value, bool):
        raise ValueError(f"{value!r} is not a number")
    return float(value)


def _strict_bool(value: Any, _: type) -> bool:
    if not isinstance(value, bool):
        raise ValueError(f"{value!r} is not true or false")
    return value


def _strict_str(value: Any, _: type) -> str:
    if not isinstance(value, str):
        raise ValueError(f"{value!r} is not a text")
    return value


def _strict_tuple(value: Any, kind: Any) -> tuple[Any, ...]:
    """A text is a list of letters for Python; a folder without brackets must not become "/" and "."."""
    kinds = get_args(kind)
    if not isinstance(value, list | tuple):
        advice = ",".join([str(value)] * (1 if kinds[-1] is ... else len(kinds)))
        raise ValueError(f"{value!r} is not a list; write [{advice}]")
    kinds = (kinds[0],) * len(value) if kinds[-1] is ... else kinds
    if len(kinds) != len(value):
        raise ValueError(f"{value!r} is not a list of {len(kinds)}")
    return tuple(_CONVERTER.structure(item, inner) for item, inner in zip(value, kinds, strict=True))


def _strict_choice(value: Any, kind: Any) -> str:
    """YAML reads an unquoted on and off as true and false."""
    word = ("off", "on")[value] if isinstance(value, bool) else value
    if word not in get_args(kind):
        raise ValueError(f"{value!r} is not one of {', '.join(map(str, get_args(kind)))}")
    return word


_CONVERTER = cattrs.Converter(forbid_extra_keys=True)
_CONVERTER.register_structure_hook_func(lambda kind: get_origin(kind) is tuple, _strict_tuple)
_CONVERTER.register_structure_hook_func(lambda kind: get_origin(kind) is Literal, _strict_choice)
for _kind, _hook in ((int, _strict_int), (float, _strict_float), (bool, _strict_bool), (str, _strict_str)):
    _CONVERTER.register_structure_hook(_kind, _hook)


_PLAIN = {bool, int, float, str, type(None)}


def to_plain(settings: Any) -> Any:
    """Dataclasses and tuples as dicts and lists, what NumPy holds and paths as what YAML and JSON hold."""
    if type(settings) in _PLAIN:  # nearly all that a scene holds
        return settings
    if dataclasses.is_dataclass(settings):
        return {field.name: to_plain(getattr(settings, field.name)) for field in dataclasses.fields(settings)}
    if isinstance(settings, Mapping):
        return {key: to_plain(item) for key, item in settings.items()}
    if isinstance(settings, tuple | list):
        return [to_plain(item) for item in settings]
    if isinstance(settings, np.generic | np.ndarray):
        return settings.tolist()
    return str(settings) if isinstance(settings, Path) else settings


def check_fields(settings: Any) -> None:
    """For `__post_init__`: make fields what a file would give, lists tuples and NumPy's numbers Python's.

    FsidError names the first that is of another type than it states.
    """
    made: Any = type(settings)
    for name, kind in _kinds(made).items():
        value = getattr(settings, name)
        if not (isinstance(kind, type) and dataclasses.is_dataclass(kind)):
            value = _structured(name, to_plain(value), kind)
        elif not isinstance(value, kind):
            value = from_plain(kind, to_plain(value), source=name)
        object.__setattr__(settings, name, value)


@cache
def _kinds(made: Any) -> dict[str, Any]:
    known = get_type_hints(made)
    return {field.name: known[field.name] for field in dataclasses.fields(made)}


def _structured(name: str, value: Any, kind: Any) -> Any:
    try:
        return _CONVERTER.structure(value, kind)
    except (ValueError, TypeError) as error:
        raise FsidError(f"{name}: {_reason(error, kind)}") from None


def from_plain(kind: type[T], plain: Any, *, source: str) -> T:
    """Rebuild a dataclass; absent keys take their defaults.

    Raises FsidError, naming `source` and the key, for unknown keys, wrong types and values that the
    dataclass itself refuses.
    """
    if not isinstance(plain, Mapping):
        raise FsidError(f"{source}: expected keys with values, got {plain!r:.60}")
    try:
        return _CONVERTER.structure(plain, kind)
    except cattrs.BaseValidationError as error:
        raise FsidError(f"{source}: {_first_refusal(error) or _first_reason(error)}") from None


def _first_reason(error: cattrs.BaseValidationError) -> str:
    reason, _, path = cattrs.transform_error(error, path="$", format_exception=_reason)[0].rpartition(" @ ")
    key = path.removeprefix("$").removeprefix(".")
    return f"{key}: {reason}" if key else reason


def _reason(error: BaseException, kind: type | None) -> str:
    if isinstance(error, cattrs.ForbiddenExtraKeysError):
        unknown = ", ".join(sorted(map(str, error.extra_fields)))
        known = ", ".join(field.name for field in dataclasses.fields(error.cl))
        return f"no such key: {unknown} (there are: {known})"
    return str(error) if isinstance(error, ValueError) else f"expected {getattr(kind, '__name__', kind)}"


def _first_refusal(error: BaseException, path: str = "") -> str:
    """What the first dataclass that refuses its values says, after the path to it; "" where none does."""
    for inner in getattr(error, "exceptions", ()):
        notes = getattr(inner, "__notes__", ())
        keys = (note.name for note in notes if isinstance(note, AttributeValidationNote))
        place = ".".join(filter(None, (path, *keys)))
        if isinstance(inner, FsidError):
            return f"{place}{_joint(str(inner), getattr(error, 'cl', None))}{inner}" if place else str(inner)
        if found := _first_refusal(inner, place):
            return found
    return ""


def _joint(message: str, made: Any) -> str:
    """What goes between the path to a dataclass and its message, which most often begins with a key of it."""
    names = {field.name for field in dataclasses.fields(made)} if dataclasses.is_dataclass(made) else ()
    return "." if re.split(r"\W", message, maxsplit=1)[0] in names else ": "


def load_settings(
    kind: type[T],
    file: Path | None = None,
    overrides: Sequence[Override] = (),
    read: Callable[[Path], dict[str, Any]] = read_yaml,
) -> T:
    """Settings of dataclass `kind` from an optional YAML file and overrides, of which the last wins.

    read: what reads the file. FsidError names the sources at fault: those without which there would be no
    error, or another one.
    """
    layers: list[_Layer] = []
    if file is not None:
        layers += [(str(file), [key], value) for key, value in read(file).items()]
    for override in overrides:
        key, value = _parse_override(override) if isinstance(override, str) else override
        layers.append(("--set" if isinstance(override, str) else "options", key.split("."), value))
    settings, fault = _overlaid(kind, layers)
    if settings is not None:
        return settings
    sources = list(dict.fromkeys(source for source, _, _ in layers))
    guilty = [s for s in sources if _overlaid(kind, [x for x in layers if x[0] != s])[1] != fault]
    raise FsidError(f"{' and '.join(guilty or sources) or 'defaults'}: {fault}")


def load_named(
    kind: type[T],
    name_or_file: str | Path,
    overrides: Sequence[Override] = (),
    read: Callable[[Path], dict[str, Any]] = read_yaml,
) -> T:
    """`load_settings` of a built-in configuration (`fsid/configs`) by its name, or of a YAML file.

    FsidError as there, and where it is neither, with the names that there are for `kind`.
    """
    builtin = files("fsid.configs").joinpath(f"{name_or_file}.yaml")
    if builtin.is_file():
        with as_file(builtin) as file:
            return load_settings(kind, file, overrides)
    if not Path(name_or_file).exists():
        names = ", ".join(_names_for(kind))
        raise FsidError(f"{name_or_file}: is no file and no built-in configuration ({names})")
    return load_settings(kind, Path(name_or_file), overrides, read)


def _names_for(kind: type[Any]) -> list[str]:
    known = {field.name for field in dataclasses.fields(kind)}
    found = (file for file in files("fsid.configs").iterdir() if file.name.endswith(".yaml"))
    return sorted(
        file.name.removesuffix(".yaml")
        for file in found
        if known.issuperset(parse_yaml(file.read_text("utf-8"), file.name))
    )


def _overlaid(kind: type[T], layers: Sequence[_Layer]) -> tuple[T | None, str]:
    """The settings of all layers, or None and what is wrong with them."""
    plain: dict[str, Any] = {}
    try:
        for _, path, value in layers:
            _assign(plain, path, copy.deepcopy(value))
        return from_plain(kind, plain, source=""), ""
    except FsidError as error:
        return None, str(error).removeprefix(": ")


def given_keys(overrides: Sequence[Override]) -> list[str]:
    """The dotted keys of single settings in `overrides`, also of those that are given as a group."""

    def leaves(key: str, value: Any) -> Iterator[str]:
        if not isinstance(value, Mapping):
            yield key
            return
        for name, inner in value.items():
            yield from leaves(f"{key}.{name}", inner)

    pairs = (_parse_override(item) if isinstance(item, str) else item for item in overrides)
    return [leaf for key, value in pairs for leaf in leaves(key, value)]


def save_settings(settings: Any, file: Path) -> None:
    """Write settings as YAML in the order of their definition, replacing the file atomically."""
    text = yaml.safe_dump(to_plain(settings), sort_keys=False, default_flow_style=None, width=110)
    write_atomically(file, text.encode())


def _parse_override(override: str) -> tuple[str, Any]:
    key, equals, text = override.partition("=")
    if not equals or not key:
        raise FsidError(f"--set {override}: expected key=value, for example --set width=1280")
    return key, parse_yaml(text, f"--set {key}")


def _assign(plain: dict[str, Any], path: list[str], value: Any) -> None:
    for key in path[:-1]:
        inner = plain.setdefault(key, {})
        if not isinstance(inner, dict):
            raise FsidError(f"{'.'.join(path)}: {key} is a single value, not a group of settings")
        plain = inner
    plain[path[-1]] = value
