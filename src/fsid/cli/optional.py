"""How the help shows options that need not be given: as --iso FLOAT, with a default where that says anything.

Tyro writes --iso {None}|FLOAT, takes the word None, and ends with "(default: None)", whatever the text before
it says of what happens then; with "(default: False)" at a switch.
"""

from __future__ import annotations

import types
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from inspect import signature
from typing import Annotated, Any, Union, get_args, get_type_hints

from tyro.conf import arg
from tyro.constructors import (
    ConstructorRegistry,
    PrimitiveConstructorSpec,
    PrimitiveTypeInfo,
    UnsupportedTypeAnnotationError,
)

AS_GIVEN = ConstructorRegistry()
"""Reads an option of type `X | None` as one of type X."""


@AS_GIVEN.primitive_rule
def _given(
    option: PrimitiveTypeInfo,
) -> PrimitiveConstructorSpec[Any] | UnsupportedTypeAnnotationError | None:
    kinds = get_args(option.type)
    if option.type_origin not in (types.UnionType, Union) or types.NoneType not in kinds:
        return None
    given: Any = Union[tuple(kind for kind in kinds if kind is not types.NoneType)]  # noqa: UP007
    spec = AS_GIVEN.get_primitive_spec(PrimitiveTypeInfo.make(given, option.markers))
    if isinstance(spec, UnsupportedTypeAnnotationError):
        return spec
    return replace(
        spec,
        is_instance=lambda value: value is None or spec.is_instance(value),
        str_from_instance=lambda value: [] if value is None else spec.str_from_instance(value),
    )


@cache
def without_empty_defaults(command: Callable[..., None]) -> None:
    """Leave "(default: None)" and such out of the help of `command`."""
    hints = get_type_hints(command, include_extras=True)
    for name, parameter in signature(command).parameters.items():
        default = parameter.default
        if default is None or default is False or default in ("", ()):
            hints[name] = Annotated[hints[name], arg(help_behavior_hint="")]
    command.__annotations__ = hints
