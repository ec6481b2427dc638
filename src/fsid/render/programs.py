"""Programs: text in `shaders/`, GLSL 4.30 core, `#include "name.glsl"` resolved by moderngl."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

import moderngl
import numpy as np

_SHADERS = files("fsid.render") / "shaders"
_INCLUDES = tuple(sorted(file.name for file in _SHADERS.iterdir() if file.name.endswith(".glsl")))


def load_program(
    context: moderngl.Context, vertex: str, fragment: str | None, **defines: int
) -> moderngl.Program:
    """A program of two files; without a fragment shader it writes depth only. defines: for the fragments."""
    _register(context)
    source = None if fragment is None else _source(fragment)
    if source is not None:
        lines = "".join(f"#define {name} {value}\n" for name, value in defines.items())
        version, rest = source.split("\n", 1)
        source = f"{version}\n{lines}{rest}"
    return context.program(vertex_shader=_source(vertex), fragment_shader=source)


def set_uniforms(program: moderngl.Program, **values: Any) -> None:
    """Set uniforms; one that the compiler removed is skipped."""
    for name, value in values.items():
        uniform = program.get(name, None)
        if isinstance(uniform, moderngl.Uniform):
            if isinstance(value, np.ndarray):
                uniform.write(value.astype("f4").tobytes())
            elif isinstance(value, tuple) and uniform.array_length > 1:
                uniform.value = value[: uniform.array_length]
            else:
                uniform.value = value


def _register(context: moderngl.Context) -> None:
    for name in _INCLUDES:
        context.includes.setdefault(name, _source(name))


def _source(name: str) -> str:
    return (_SHADERS / name).read_text(encoding="utf-8")
