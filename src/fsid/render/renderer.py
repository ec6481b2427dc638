"""Scene -> Frame in five passes, all with fixed taps, so that an image holds no noise:

    shadows     depth from every light into one atlas
    prepass     depth from the camera, `supersampling`^2 samples per pixel
    surfaces    materials into the G-buffer, where the depth is equal
    occlusion   openness of each pixel to the room
    lighting    radiance of each pixel, averaged over its samples; the result is read back

The same scene gives the same bits on the same driver whatever was rendered before: buffers that depend on
what is resident (texture slots) are addressed by whole numbers, and everything else is made anew or cleared.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Any, ClassVar, Self

import moderngl
import numpy as np

from fsid.assets import bake_material
from fsid.errors import FsidError
from fsid.render.camera import NEAR_M, Lens, lens_of
from fsid.render.context import GlInfo, gl_info, open_context
from fsid.render.drawable import View, view_of
from fsid.render.frame import Frame
from fsid.render.geometry import Geometry, draw_commands, in_view, merge
from fsid.render.layers import Bake, Layer, LayerStore
from fsid.render.programs import load_program
from fsid.render.room import Room, light_room
from fsid.render.shadows import NEAR_M as SHADOW_NEAR_M
from fsid.render.shadows import ShadowPlan, plan_shadows
from fsid.render.targets import ShadowAtlas, Targets
from fsid.scene.model import Material, Scene

Mark = Callable[[str], None]
"""Called with the name of each stage when it has been issued; the benchmark measures with it."""


class Renderer:
    """Owns the process's one OpenGL context and what is resident on it. Use it in a `with` block.

    device_index: EGL device; None takes the first GPU, or else the CPU. supersampling: edge of the square
    grid of samples per pixel, 1..4. texture_size: texels per side of a material tile, a power of two.
    Raises FsidError where OpenGL 4.3 is missing or a second Renderer is opened in one process.
    """

    _active: ClassVar[Renderer | None] = None

    def __init__(
        self, *, device_index: int | None = None, supersampling: int = 2, texture_size: int = 1024
    ) -> None:
        if Renderer._active is not None:
            raise FsidError(
                "a Renderer is already open in this process: close it first, or use another process"
            )
        if not 1 <= supersampling <= 4:
            raise FsidError(f"supersampling {supersampling}: must be 1 .. 4")
        if not 64 <= texture_size <= 8192 or texture_size & (texture_size - 1):
            raise FsidError(f"texture_size {texture_size}: must be a power of two from 64 to 8192")
        self._context = open_context(device_index)
        Renderer._active = self
        try:
            self._prepare(supersampling, texture_size)
        except BaseException:
            self.close()
            raise

    def _prepare(self, supersampling: int, texture_size: int) -> None:
        context = self._context
        self._layers = LayerStore(context, texture_size)
        self._depth = load_program(context, "depth.vert", None)
        self._moments = load_program(context, "screen.vert", "moments.frag")
        self._surface = load_program(context, "surface.vert", "surface.frag")
        self._occlusion = load_program(context, "screen.vert", "occlusion.frag")
        self._blur = load_program(context, "screen.vert", "blur.frag")
        self._lighting = load_program(context, "screen.vert", "lighting.frag")
        self._targets = Targets(context, supersampling)
        self._atlas = ShadowAtlas(context)
        _set(self._occlusion, grid=supersampling, taps=_spiral(32, 1.0))
        _set(self._lighting, grid=supersampling, search_taps=_spiral(12), filter_taps=_spiral(20))

    @property
    def info(self) -> GlInfo:
        """Vendor, device and version of the driver that renders."""
        return gl_info(self._context)

    def close(self) -> None:
        """Give the context and its memory back; the renderer cannot be used afterwards."""
        if Renderer._active is self:
            self._context.release()
            Renderer._active = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def render(self, scene: Scene, camera_index: int = 0) -> Frame:
        """The frame of one of the scene's cameras.

        radiance and albedo are the mean of a pixel's samples. depth, normal and object_id are those of one of
        them, the sample (s // 2, s // 2) of the s x s grid, so the three agree in every pixel.
        Raises FsidError for a scene that cannot be drawn.
        """
        return self.draw(view_of(scene, camera_index))

    def draw(
        self,
        view: View,
        *,
        bake: Bake = bake_material,
        shift_px: tuple[float, float] = (0.0, 0.0),
        mark: Mark = lambda stage: None,
    ) -> Frame:
        """The frame of a view; `render` without the scene.

        bake: where material maps come from. shift_px: moves the image by a part of a pixel (right, down).
        """
        if Renderer._active is not self:
            raise FsidError("this Renderer is closed")
        lens, camera = lens_of(view.camera), view.camera
        layers = self._layers.load([(m.family, m.variant) for d in view.drawables for m in d.materials], bake)
        geometry = merge(view.drawables, lambda m: layers[m.family, m.variant])
        plan = plan_shadows(view.lights)
        room = light_room(view.room_size_m, _room_albedo(view, layers), view.lights, view.ambient)
        mark("scene build")
        self._targets.resize(camera.width, camera.height)
        self._atlas.resize(plan.size)
        shift = (2 * shift_px[0] / camera.width, 2 * shift_px[1] / camera.height)
        buffers = _Buffers(self._context, geometry, plan, room)
        try:
            mark("upload")
            self._draw_shadows(geometry, plan, buffers)
            mark("shadows")
            self._draw_surfaces(geometry, lens, shift, buffers)
            mark("geometry")
            self._light(lens, plan, room, shift_px, buffers)
            self._context.finish()
            mark("shading")
            return self._targets.read_frame()
        finally:
            buffers.release()
            mark("readback")

    def wait(self) -> None:
        """Return when everything issued so far is done; only measuring needs it."""
        self._context.finish()

    def _draw_shadows(self, geometry: Geometry, plan: ShadowPlan, buffers: _Buffers) -> None:
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._atlas.begin()
        array = buffers.vertex_array(self._depth)
        _set(self._depth, near=SHADOW_NEAR_M, shift=(0.0, 0.0))
        for tile in plan.tiles:
            tangent = 1.0 / tile.focal
            seen = np.flatnonzero(in_view(geometry.spheres, tile.origin, tile.axes, (tangent, tangent)))
            if not len(seen):
                continue
            self._atlas.framebuffer.viewport = (*tile.corner, plan.tile_px, plan.tile_px)
            _set(self._depth, origin=tile.origin, axes=tile.axes.T, focal=(tile.focal, tile.focal))
            buffers.draw(array, draw_commands(geometry.ranges, seen))
        self._context.enable_only(moderngl.NOTHING)
        _set(self._moments, near=SHADOW_NEAR_M)
        self._atlas.begin_moments()
        buffers.draw_screen(self._moments)
        self._atlas.end_moments()

    def _draw_surfaces(
        self, geometry: Geometry, lens: Lens, shift: tuple[float, float], buffers: _Buffers
    ) -> None:
        tangents = (1.0 / lens.focal[0] + abs(shift[0]), 1.0 / lens.focal[1] + abs(shift[1]))
        seen = np.flatnonzero(in_view(geometry.spheres, lens.position, lens.rotation, tangents))
        distance = (
            np.linalg.norm(geometry.spheres[seen, :3] - lens.position, axis=1) - geometry.spheres[seen, 3]
        )
        commands = draw_commands(geometry.ranges, seen[np.argsort(distance, kind="stable")])
        for program in (self._depth, self._surface):
            focal = (lens.focal[0], -lens.focal[1])
            _set(program, origin=lens.position, axes=lens.rotation.T, focal=focal, shift=shift, near=NEAR_M)
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._targets.begin_depth()
        buffers.draw(buffers.vertex_array(self._depth), commands)
        self._targets.begin_surfaces()
        self._layers.use(0, 1)
        self._context.depth_func = "=="
        buffers.draw(buffers.vertex_array(self._surface), commands)
        self._context.depth_func = "<"

    def _light(
        self, lens: Lens, plan: ShadowPlan, room: Room, shift_px: tuple[float, float], buffers: _Buffers
    ) -> None:
        self._context.enable_only(moderngl.NOTHING)
        common = {"focal": lens.focal, "axes": lens.rotation.T, "size": self._targets.size}
        _set(self._occlusion, **common)
        self._targets.begin_occlusion()
        buffers.draw_screen(self._occlusion)
        for back in (False, True):
            _set(self._blur, direction=(0, 1) if back else (1, 0), size=self._targets.size)
            self._targets.begin_blur(back=back)
            buffers.draw_screen(self._blur)
        _set(
            self._lighting,
            **common,
            origin=lens.position,
            shift=shift_px,
            light_count=plan.light_count,
            tile_px=float(plan.tile_px),
            ambient_sides=room.sides,
            mean_sides=room.radiance.mean((1, 2)),
            room_half=np.array(room.size_m) / 2,
        )
        self._targets.begin_lighting()
        self._atlas.use(compare_unit=2, moments_unit=3)
        buffers.room.use(4)
        buffers.draw_screen(self._lighting)


class _Buffers:
    """What one view keeps on the device while it is drawn."""

    def __init__(self, context: moderngl.Context, geometry: Geometry, plan: ShadowPlan, room: Room) -> None:
        self._context = context
        self._world = context.buffer(geometry.world.tobytes())
        self._vertices = context.buffer(geometry.vertices.tobytes())
        self._indices = context.buffer(geometry.indices.tobytes())
        self._owned: list[Any] = [self._world, self._vertices, self._indices]
        for binding, table in enumerate((geometry.surfaces, plan.table)):
            buffer = context.buffer(table.tobytes())
            buffer.bind_to_storage_buffer(binding)
            self._owned.append(buffer)
        sides, height, width, _ = room.radiance.shape
        texels = np.concatenate([room.radiance, np.ones((*room.radiance.shape[:3], 1))], axis=-1)
        self.room = context.texture_array(
            (width, height, sides), 4, texels.astype("f4").tobytes(), dtype="f4"
        )
        self.room.build_mipmaps()
        self.room.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self.room.repeat_x = self.room.repeat_y = False
        self._owned.append(self.room)

    def vertex_array(self, program: moderngl.Program) -> moderngl.VertexArray:
        """The geometry as input of a program: positions in the world, and the rest where it is asked for."""
        content: list[tuple[Any, ...]] = [(self._world, "3f", "in_world")]
        if "in_surface" in program:
            content.append((self._vertices, "3f 3f 1u", "in_position", "in_normal", "in_surface"))
        array = self._context.vertex_array(program, content, self._indices)
        self._owned.append(array)
        return array

    def draw(self, array: moderngl.VertexArray, commands: np.ndarray) -> None:
        """One indirect draw of (n, 5) commands."""
        buffer = self._context.buffer(commands.tobytes())
        array.render_indirect(buffer, moderngl.TRIANGLES, count=len(commands))
        self._owned.append(buffer)

    def draw_screen(self, program: moderngl.Program) -> None:
        """Every pixel of the bound target once."""
        array = self._context.vertex_array(program, [])
        array.render(moderngl.TRIANGLES, vertices=3)
        self._owned.append(array)

    def release(self) -> None:
        """Free all of it."""
        for item in self._owned:
            item.release()


def _set(program: moderngl.Program, **values: Any) -> None:
    """Set uniforms; one that the compiler removed is skipped."""
    for name, value in values.items():
        uniform = program.get(name, None)
        if isinstance(uniform, moderngl.Uniform):
            if isinstance(value, np.ndarray):
                uniform.write(value.astype("f4").tobytes())
            else:
                uniform.value = value


def _spiral(count: int, growth: float = 0.5) -> np.ndarray:
    """(count, 2) points of a sunflower spiral on the unit disc (Vogel 1979); radius ~ index^growth."""
    i = np.arange(count)
    radius, angle = ((i + 0.5) / count) ** growth, i * np.pi * (3 - np.sqrt(5))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def _room_albedo(view: View, layers: dict[tuple[str, int], Layer]) -> np.ndarray:
    """(6, 3) mean albedo of the sides of the room."""
    if not view.room_materials:
        return np.ones((6, 3))
    return np.array([_mean_albedo(m, layers[m.family, m.variant]) for m in view.room_materials])


def _mean_albedo(material: Material, layer: Layer) -> Sequence[float]:
    return np.clip(layer.shares @ np.array(material.colours), 0.0, 1.0)
