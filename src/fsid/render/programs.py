"""Programs: text in `shaders/`, GLSL 4.30 core, `#include "name.glsl"` resolved by moderngl."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

import moderngl
import numpy as np

from fsid.render.canvas import Canvas
from fsid.render.context import gl_info

_SHADERS = files("fsid.render") / "shaders"
_INCLUDES = tuple(sorted(file.name for file in _SHADERS.iterdir() if file.name.endswith(".glsl")))
_GROUP_PX = 8  # local_size of shaders/screen.glsl


def load_program(context: moderngl.Context, vertex: str, fragment: str | None) -> moderngl.Program:
    """A program of two files; without a fragment shader it writes depth only."""
    _register(context)
    return context.program(
        vertex_shader=_source(vertex), fragment_shader=None if fragment is None else _source(fragment)
    )


class ScreenProgram:
    """Finds each pixel of a `Canvas` once: a fragment shader over one triangle, or the same file as a compute
    shader, which GPUs for datacenters run on more of their cores (docs/results/renderer.md).

    source: a file that includes shaders/screen.glsl, which explains its defines. marks: 0; 1 marks pixels of
    the canvas; 2 draws marked ones alone. adds: to what is there instead of replacing it. defines: its own.
    """

    def __init__(
        self,
        context: moderngl.Context,
        source: str,
        *,
        compute: bool,
        marks: int = 0,
        adds: bool = False,
        **defines: int | str,
    ) -> None:
        _register(context)
        self._context, self._compute, self._marks, self._adds = context, compute, marks, adds
        exact = int(not gl_info(context).is_software)
        defines |= {"COMPUTE": int(compute), "MARKS": marks, "ADDS": int(adds), "EXACT_FILTER": exact}
        lines = "".join(f"#define {name} {value}\n" for name, value in defines.items())
        version, rest = _source(source).split("\n", 1)
        text = f"{version}\n{lines}{rest}"
        self._program: Any
        if compute:
            self._program = context.compute_shader(text)
        else:
            self._program = context.program(vertex_shader=_source("screen.vert"), fragment_shader=text)
            self._screen = context.vertex_array(self._program, [])

    def set(self, **values: Any) -> None:
        """Set uniforms; one that the compiler removed is skipped."""
        set_uniforms(self._program, **values)

    def draw(self, canvas: Canvas, box: tuple[int, int, int, int] | None = None) -> None:
        """Find all pixels, or those of a box: left, top, width, height."""
        left, top, width, height = box or (0, 0, *canvas.size)
        if self._compute:
            canvas.use_images()
            self.set(first_pixel=(left, top), last_pixel=(left + width - 1, top + height - 1))
            self._program.run(-(-width // _GROUP_PX), -(-height // _GROUP_PX))
            self._context.memory_barrier()
            return
        self._set_tests()
        canvas.use_framebuffer(box, mark=self._marks == 1)
        self._screen.render(moderngl.TRIANGLES, vertices=3)
        self._context.depth_func = "<"
        self._context.enable_only(moderngl.NOTHING)

    def _set_tests(self) -> None:
        """Marks are depth: drawn without a test, and drawn where they are nearer than the triangle."""
        context = self._context
        context.enable_only(moderngl.DEPTH_TEST if self._marks else moderngl.NOTHING)
        context.depth_func = "1" if self._marks == 1 else ">" if self._marks else "<"
        if self._adds:
            context.enable(moderngl.BLEND)
            context.blend_func = moderngl.ONE, moderngl.ONE


def set_uniforms(program: moderngl.Program | moderngl.ComputeShader, **values: Any) -> None:
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
