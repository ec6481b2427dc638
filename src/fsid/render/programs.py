"""Shaders: text in `shaders/`, GLSL 4.30 core, `#include "name.glsl"` resolved by moderngl."""

from __future__ import annotations

from importlib.resources import files

import moderngl

_SHADERS = files("fsid.render") / "shaders"
_INCLUDES = ("surfaces.glsl", "encoding.glsl", "lights.glsl", "room.glsl")


def load_program(context: moderngl.Context, vertex: str, fragment: str | None) -> moderngl.Program:
    """A program of two files; without a fragment shader it writes depth only."""
    _register(context)
    return context.program(
        vertex_shader=_source(vertex), fragment_shader=None if fragment is None else _source(fragment)
    )


def load_compute(context: moderngl.Context, name: str) -> moderngl.ComputeShader:
    """A compute shader of one file."""
    return context.compute_shader(_source(name))


def _register(context: moderngl.Context) -> None:
    for name in _INCLUDES:
        context.includes.setdefault(name, _source(name))


def _source(name: str) -> str:
    return (_SHADERS / name).read_text(encoding="utf-8")
