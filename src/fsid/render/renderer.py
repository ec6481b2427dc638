"""Scene -> Frame in passes with fixed taps, so that an image holds no noise:

    shadows     depth from every light into one atlas, and its moments
    samples     surface, normal and depth of `supersampling`^2 samples per pixel
    occlusion   openness of each block of 2 x 2 pixels to its surroundings
    shading     materials and radiance of each pixel, once per surface in it; the result is read back

The same scene gives the same bits on the same driver whatever was rendered before: buffers that depend on
what is resident (texture slots) are addressed by whole numbers, and everything else is made anew or cleared.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Any, ClassVar, Self

import moderngl
import numpy as np

from fsid.errors import FsidError
from fsid.render.buffers import Buffers
from fsid.render.camera import NEAR_M, lens_of
from fsid.render.context import GlInfo, gl_info, open_context, return_large_blocks
from fsid.render.drawable import BACKGROUND_ID, Drawable, View, view_of
from fsid.render.exposure import Shot, shots_of
from fsid.render.flow import flow_between
from fsid.render.frame import Frame
from fsid.render.frustum import in_view, rectangles, sees
from fsid.render.geometry import Geometry, draw_commands, merge
from fsid.render.lamps import lamps_of
from fsid.render.layers import Layer, LayerStore, fitting_size
from fsid.render.mirror import mirror_shot
from fsid.render.programs import load_program
from fsid.render.quality import QUALITIES, tap_table
from fsid.render.reflectance import lobe_table, reflectance_table
from fsid.render.room import Room, light_room, light_sky
from fsid.render.shadows import NEAR_M as SHADOW_NEAR_M
from fsid.render.shadows import ShadowPlan, Source, plan_shadows
from fsid.render.sky import panorama
from fsid.render.targets import Place, ShadowAtlas, Targets
from fsid.render.texels import Bake, bake_texels
from fsid.scene.model import ZERO, Material, Scene

Mark = Callable[[str], None]
"""Called with the name of each stage when it has been issued; the benchmark measures with it."""


_CLIP_DISTANCE0 = 0x3000
_FAR_M = 1e9
_ABOVE_GROUND_M = 0.0005


@dataclass(frozen=True)
class _Stage:
    """A view as the passes need it: on the device, with its lights and surroundings."""

    view: View
    geometry: Geometry
    plan: ShadowPlan
    room: Room
    sky: np.ndarray | None
    buffers: Buffers


class Renderer:
    """Owns the process's one OpenGL context and what is resident on it. Use it in a `with` block.

    device_index: EGL device; None takes the first GPU, or else the CPU. supersampling: edge of the square
    grid of samples per pixel, 1..4. texture_size: texels per side of a material tile, a power of two; fewer
    where a scene has more materials than texture memory is meant for (`fsid.render.layers.BUDGET_BYTES`).
    quality: "high", or "fast" with fewer taps and coarser shadow maps (docs/render.md has both measured).
    Raises FsidError where OpenGL 4.3 is missing or a second Renderer is opened in one process.
    """

    _active: ClassVar[Renderer | None] = None

    def __init__(
        self,
        *,
        device_index: int | None = None,
        supersampling: int = 2,
        texture_size: int = 1024,
        quality: str = "high",
    ) -> None:
        if Renderer._active is not None:
            raise FsidError(
                "a Renderer is already open in this process: close it first, or use another process"
            )
        if not 1 <= supersampling <= 4:
            raise FsidError(f"supersampling {supersampling}: must be 1 .. 4")
        if not 64 <= texture_size <= 8192 or texture_size & (texture_size - 1):
            raise FsidError(f"texture_size {texture_size}: must be a power of two from 64 to 8192")
        if quality not in QUALITIES:
            raise FsidError(f"quality '{quality}': use {' or '.join(QUALITIES)}")
        self._quality = QUALITIES[quality]
        self._grid = supersampling
        return_large_blocks()
        self._context = open_context(device_index)
        Renderer._active = self
        try:
            self._prepare(texture_size)
        except BaseException:
            self.close()
            raise

    def _prepare(self, texture_size: int) -> None:
        context = self._context
        self._texture_size = texture_size
        self._layers = LayerStore(context, texture_size)
        self._depth = load_program(context, "depth.vert", None)
        self._moments = load_program(context, "screen.vert", "moments.frag")
        self._visible = load_program(context, "visible.vert", "visible.frag")
        self._block_depth = load_program(context, "screen.vert", "block_depth.frag")
        self._occlusion = load_program(context, "screen.vert", "occlusion.frag")
        self._blur = load_program(context, "screen.vert", "blur.frag")
        self._copy = load_program(context, "screen.vert", "copy_result.frag")
        self._shadow_blocks = load_program(
            context, "screen.vert", "shadow_blocks.frag", LENS=0, GRID=self._grid
        )
        self._shades: dict[tuple[int, bool, bool, bool, bool], moderngl.Program] = {}
        self._targets = Targets(context, self._grid)
        self._mirror_targets = Targets(context, self._grid)
        self._atlas = ShadowAtlas(context)
        taps = tap_table(self._quality)
        self._taps = context.texture((taps.shape[1], taps.shape[0]), 2, taps.tobytes(), dtype="f4")
        self._taps.filter = (moderngl.NEAREST, moderngl.NEAREST)
        shares = reflectance_table()
        shares = np.concatenate([np.concatenate([shares, np.zeros_like(shares)], axis=-1), lobe_table()])
        self._reflectance = context.texture(shares.shape[1::-1], 4, shares.tobytes(), dtype="f4")
        self._reflectance.repeat_x = self._reflectance.repeat_y = False
        for program in (self._block_depth, self._occlusion):
            _set(program, stride=2 * self._grid, taps=self._quality.occlusion_taps)

    @property
    def _label_sample(self) -> float:
        """Place in the pixel, along both axes, of the sample that the labels belong to."""
        return (self._grid // 2 + 0.5) / self._grid

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

    def render(self, scene: Scene, camera_index: int = 0, flow_to: int | None = None) -> Frame:
        """The frame of one of the scene's cameras; with the optical flow to another one.

        radiance and albedo are the mean of a pixel's samples. depth, normal and object_id are those of one of
        them, the sample (s // 2, s // 2) of the s x s grid, so the three agree in every pixel.
        Raises FsidError for a scene that cannot be drawn.
        """
        view = view_of(scene, camera_index)
        frame = self.draw(view)
        if flow_to is None:
            return frame
        if not 0 <= flow_to < len(scene.cameras):
            raise FsidError(f"flow_to {flow_to}: the scene has {len(scene.cameras)} cameras")
        here, there = view.camera, scene.cameras[flow_to]
        flow = flow_between(
            frame,
            view.drawables,
            (here, lens_of(here), here.time_s),
            (there, lens_of(there), there.time_s),
            self._label_sample,
        )
        return replace(frame, flow=flow)

    def draw(
        self,
        view: View,
        *,
        bake: Bake = bake_texels,
        shift_px: tuple[float, float] = (0.0, 0.0),
        mark: Mark = lambda stage: None,
    ) -> Frame:
        """The frame of a view; `render` without the scene.

        bake: where the texels of materials come from. shift_px: moves the image by a part of a pixel (right,
        down).
        """
        if Renderer._active is not self:
            raise FsidError("this Renderer is closed")
        camera = view.camera
        shot = Shot(lens_of(camera), camera.time_s, shift_px)
        self._draw(view, shot, bake, mark)
        frame = self._targets.read_frame()
        mark("readback")
        shots = shots_of(camera, view.drawables, frame, shot, self._label_sample, self._quality.shots)
        if not shots:
            return frame
        total = np.zeros_like(frame.radiance)
        for part in shots:
            self._draw(view, part, bake, mark)
            total += self._targets.read_radiance()[..., :3]
        return replace(frame, radiance=total / np.float32(len(shots)))

    def wait(self) -> None:
        """Return when everything issued so far is done; only measuring needs it."""
        self._context.finish()

    def _draw(self, view: View, shot: Shot, bake: Bake, mark: Mark) -> None:
        """One pass over a view; the result stays in the targets."""
        layers = self._load_layers(view, bake)

        def albedo_of(material: Material) -> np.ndarray:
            return _mean_albedo(material, layers[material.family, material.variant])

        geometry = merge(view.drawables, lambda m: layers[m.family, m.variant], shot.time_s)
        sources = [Source(light) for light in view.lights]
        sources += lamps_of(view.drawables, albedo_of, shot.time_s)
        casts = np.array([drawable.casts for drawable in view.drawables])
        movable = np.array([_shades_outdoors(drawable, view) for drawable in view.drawables])
        plan = plan_shadows(
            sources, geometry.spheres[casts & movable], geometry.spheres, self._quality.shadow_px
        )
        sky = None if view.sky is None else panorama(view.sky)
        room = light_sky(sky) if sky is not None else _lit_room(view, sources, albedo_of)
        below = mirror_shot(view, shot, lambda m: layers[m.family, m.variant].roughness * m.roughness_scale)
        mark("scene build")
        self._targets.resize((view.camera.width, view.camera.height), shot.lens.seen_px)
        self._atlas.resize(plan.size)
        buffers = Buffers(self._context, geometry, plan, room, sky)
        try:
            mark("upload")
            stage = _Stage(view, geometry, plan, room, sky, buffers)
            self._draw_shadows(stage, [shot] if below is None else [shot, below], casts)
            mark("shadows")
            if below is not None:
                self._draw_mirror(stage, below)
                mark("mirror")
            targets = self._targets
            glass = np.array([drawable.is_glass for drawable in view.drawables])
            self._draw_samples(targets, stage, shot, np.ones_like(glass), layer=0)
            mark("samples")
            self._draw_occlusion(targets, stage, shot)
            mark("occlusion")
            self._draw_shadow_blocks(targets, stage, shot)
            targets.begin_shading()
            if below is not None:
                self._mirror_targets.use_mirror(11)
            self._shade(targets, stage, shot, planar=below is not None)
            if glass.any():
                self._draw_samples(targets, stage, shot, glass, layer=1)
                targets.begin_glass(_places(geometry.spheres[glass], shot, targets.size))
                self._shade(targets, stage, shot, glass=True)
                targets.end_glass()
                targets.draw(lambda: buffers.draw_screen(self._copy))
            self._context.finish()
            mark("shading")
        finally:
            buffers.release()

    def _load_layers(self, view: View, bake: Bake) -> dict[tuple[str, int], Layer]:
        wanted = {(m.family, m.variant): None for d in view.drawables for m in d.materials}
        size = fitting_size(self._texture_size, len(wanted))
        if size != self._layers.size:
            self._layers.release()
            self._layers = LayerStore(self._context, size)
        return self._layers.load(wanted, bake)

    def _draw_mirror(self, stage: _Stage, below: Shot) -> None:
        """The image that smooth ground shows, with what lies below the ground cut off."""
        targets, size = self._mirror_targets, below.lens.seen_px
        targets.resize(size, size)
        camera = replace(stage.view.camera, width=size[0], vignetting=ZERO, chromatic_aberration=(0.0, 0.0))
        stage = replace(stage, view=replace(stage.view, camera=camera))
        every = np.ones(len(stage.geometry.ranges), bool)
        self._draw_samples(targets, stage, below, every, layer=0, lowest_m=_ABOVE_GROUND_M)
        self._draw_occlusion(targets, stage, below)
        self._draw_shadow_blocks(targets, stage, below)
        targets.begin_shading()
        self._shade(targets, stage, below, shining=False)

    def _draw_shadows(self, stage: _Stage, shots: Sequence[Shot], casts: np.ndarray) -> None:
        geometry, plan, buffers = stage.geometry, stage.plan, stage.buffers
        centres, radii = geometry.spheres[:, :3], geometry.spheres[:, 3]
        deepest = float((np.linalg.norm(centres - shots[0].lens.position, axis=1) + radii).max())
        deepest += 2 * abs(float(shots[0].lens.position[2]))
        self._context.enable_only(moderngl.DEPTH_TEST)
        self._atlas.begin()
        array = buffers.vertex_array(self._depth)
        _set(self._depth, near=SHADOW_NEAR_M)
        for tile in plan.tiles:
            if not any(sees(shot, tile, deepest) for shot in shots):
                continue
            tangent = 1.0 / tile.focal
            seen = casts.copy()
            if tile.range_m == 0:
                seen &= in_view(geometry.spheres, tile.origin, tile.axes, (tangent, tangent))
            if tile.lamp >= 0:
                seen[tile.lamp] = False
            self._atlas.framebuffer.viewport = (*tile.corner, plan.tile_px, plan.tile_px)
            _set(self._depth, origin=tile.origin, axes=tile.axes.T, focal=tile.focal, range_m=tile.range_m)
            buffers.draw(array, draw_commands(geometry.ranges, np.flatnonzero(seen)))
        self._context.enable_only(moderngl.NOTHING)
        self._atlas.begin_moments()
        buffers.draw_screen(self._moments)
        self._atlas.end_moments()

    def _draw_samples(
        self,
        targets: Targets,
        stage: _Stage,
        shot: Shot,
        which: np.ndarray,
        *,
        layer: int,
        lowest_m: float = -_FAR_M,
    ) -> None:
        """The G-buffer of drawables, of what is higher than lowest_m; layer: 0 of what is opaque, 1 of glass
        in front of that."""
        geometry, buffers = stage.geometry, stage.buffers
        lens, shift = shot.lens, shot.seen_shift
        tangents = tuple((1 + abs(s)) / f for s, f in zip(shift, lens.seen_focal, strict=True))
        seen = np.flatnonzero(
            which & in_view(geometry.spheres, lens.position, lens.rotation, (tangents[0], tangents[1]))
        )
        distance = (
            np.linalg.norm(geometry.spheres[seen, :3] - lens.position, axis=1) - geometry.spheres[seen, 3]
        )
        commands = draw_commands(geometry.ranges, seen[np.argsort(distance, kind="stable")])
        focal = (lens.seen_focal[0], -lens.seen_focal[1])
        _set(self._visible, origin=lens.position, axes=lens.rotation.T, focal=focal, shift=shift, near=NEAR_M)
        self._context.enable_only(moderngl.DEPTH_TEST)
        _set(self._visible, layer=layer, lowest=lowest_m)
        targets.begin_samples(over=layer == 1)
        self._context.enable_direct(_CLIP_DISTANCE0)
        buffers.draw(buffers.vertex_array(self._visible), commands)
        self._context.disable_direct(_CLIP_DISTANCE0)

    def _draw_occlusion(self, targets: Targets, stage: _Stage, shot: Shot) -> None:
        buffers = stage.buffers
        self._context.enable_only(moderngl.NOTHING)
        targets.begin_block_depth()
        buffers.draw_screen(self._block_depth)
        blocks, lens = targets.blocks, shot.lens
        _set(
            self._occlusion,
            focal=lens.seen_focal,
            axes=lens.rotation.T,
            size=blocks,
            shift=shot.seen_shift,
        )
        targets.begin_occlusion()
        self._taps.use(7)
        buffers.draw_screen(self._occlusion)
        for back in (False, True):
            _set(self._blur, direction=(0, 1) if back else (1, 0), size=blocks)
            targets.begin_blur(back=back)
            buffers.draw_screen(self._blur)

    def _draw_shadow_blocks(self, targets: Targets, stage: _Stage, shot: Shot) -> None:
        lens, plan, buffers = shot.lens, stage.plan, stage.buffers
        _set(
            self._shadow_blocks,
            blocks=targets.blocks,
            through=_has_lobes(stage.view),
            seen=targets.seen,
            seen_focal=lens.seen_focal,
            seen_shift=shot.seen_shift,
            axes=lens.rotation.T,
            origin=lens.position,
        )
        self._use_shadows(self._shadow_blocks, plan)
        buffers.use()
        targets.begin_shadow_blocks(plan.light_count)
        buffers.draw_screen(self._shadow_blocks)

    def _use_shadows(self, program: moderngl.Program, plan: ShadowPlan) -> None:
        """Bind what lights.glsl needs, but for the table of the lights."""
        _set(
            program,
            tile_px=float(plan.tile_px),
            search_taps=self._quality.search_taps,
            filter_taps=self._quality.filter_taps,
        )
        self._atlas.use(compare_unit=2, moments_unit=3)
        self._taps.use(7)

    def _shade(
        self,
        targets: Targets,
        stage: _Stage,
        shot: Shot,
        *,
        glass: bool = False,
        planar: bool = False,
        shining: bool = True,
    ) -> None:
        view, plan, room, sky, buffers = stage.view, stage.plan, stage.room, stage.sky, stage.buffers
        lens, camera = shot.lens, view.camera
        pixel_rad = 2.0 / (lens.focal[0] * camera.width)
        level = -1.0 if sky is None else max(float(np.log2(pixel_rad * len(sky) / np.pi)), 0.0)
        program = self._shade_program(lens.model, _has_lobes(view), _has_areas(view), glass, planar)
        _set(
            program,
            size=targets.size,
            seen=targets.seen,
            focal=lens.focal,
            seen_focal=lens.seen_focal,
            seen_shift=shot.seen_shift,
            shift=shot.shift_px,
            lens_offset=shot.lens_offset,
            k=lens.k,
            axes=lens.rotation.T,
            origin=lens.position,
            light_count=plan.light_count,
            block_lights=0 if glass else targets.block_lights,
            max_probes=self._quality.probes,
            ambient_sides=room.sides,
            mean_sides=room.radiance.mean((1, 2)),
            room_half=room.half_m,
            room_centre=room.centre_m,
            sky_level=level,
            vignetting=camera.vignetting,
            magnification=1.0,
            shining=float(shining),
        )
        self._layers.use(0, 1)
        self._use_shadows(program, plan)
        self._reflectance.use(14)
        buffers.use()
        red, blue = camera.chromatic_aberration
        for aberration, colours in _colour_passes(red, blue):
            _set(program, magnification=1.0 + aberration)
            targets.draw(lambda: buffers.draw_screen(program), colours)

    def _shade_program(
        self, lens_model: int, lobes: bool, areas: bool, glass: bool, planar: bool
    ) -> moderngl.Program:
        key = (lens_model, lobes, areas, glass, planar)
        if key not in self._shades:
            self._shades[key] = load_program(
                self._context,
                "screen.vert",
                "shade.frag",
                GRID=self._grid,
                LENS=lens_model,
                LOBES=int(lobes),
                AREAS=int(areas),
                GLASS=int(glass),
                PLANAR=int(planar),
            )
        return self._shades[key]


def _has_lobes(view: View) -> bool:
    return any(
        max(m.clearcoat, m.sheen, m.translucency) > 0
        for drawable in view.drawables
        for m in drawable.materials
    )


def _has_areas(view: View) -> bool:
    return any(light.kind == "area" for light in view.lights)


def _places(spheres: np.ndarray, shot: Shot, size: tuple[int, int]) -> list[Place]:
    """Parts of the image that hold the spheres; of a bent image all of it."""
    lens = shot.lens
    if lens.model:
        return [(0, 0, *size)]
    return rectangles(spheres, lens.position, lens.rotation, lens.seen_focal, shot.seen_shift, lens.seen_px)


def _colour_passes(red: float, blue: float) -> list[tuple[float, tuple[bool, bool, bool]]]:
    """(magnification - 1, which of R, G, B) of each pass; labels belong to green."""
    if red == blue == 0.0:
        return [(0.0, (True, True, True))]
    return [(red, (True, False, False)), (0.0, (False, True, False)), (blue, (False, False, True))]


def _shades_outdoors(drawable: Drawable, view: View) -> bool:
    """Whether the sun's shadow map must hold it: the ground out of doors shades nothing that matters."""
    return view.sky is None or drawable.object_id != BACKGROUND_ID


def _lit_room(view: View, sources: Sequence[Source], albedo_of: Callable[[Material], np.ndarray]) -> Room:
    albedo, glow = np.ones((6, 3)), np.zeros((6, 3))
    if view.room_materials:
        albedo = np.stack([albedo_of(material) for material in view.room_materials])
        glow = albedo * np.array([[material.emission] for material in view.room_materials])
    lights = [source.light for source in sources]
    return light_room(view.room_size_m, view.room_floor_m, albedo, glow, lights, view.ambient)


def _mean_albedo(material: Material, layer: Layer) -> np.ndarray:
    return np.clip(layer.shares @ np.array(material.colours), 0.0, 1.0)


def _set(program: moderngl.Program, **values: Any) -> None:
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
