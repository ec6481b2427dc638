"""Scene -> Frame in passes with fixed taps, so that an image holds no noise:

    samples     surface, normal and depth of `supersampling`^2 samples per pixel
    occlusion   openness of each block of 2 x 2 pixels to its surroundings
    shadows     depth from every light into one atlas, and its moments
    shading     materials and radiance of each pixel, once per surface in it; the result is read back

The same scene gives the same bits on the same driver whatever was rendered before: buffers that depend on
what is resident (texture slots) are addressed by whole numbers, and everything else is made anew or cleared.
"""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import TracebackType
from typing import ClassVar, NoReturn, Self

import moderngl
import numpy as np

from fsid.errors import FsidError, whole
from fsid.render.buffers import Buffers
from fsid.render.camera import lens_of
from fsid.render.colour_contrast import set_colour_contrast
from fsid.render.context import (
    GlInfo,
    check_not_forked,
    gl_info,
    keep_blocks,
    open_context,
    release_context,
    return_free_blocks,
    return_large_blocks,
)
from fsid.render.defocus import defocus
from fsid.render.drain import Drain
from fsid.render.drawable import View, view_of
from fsid.render.exposure import Shot, is_moving, shots_of
from fsid.render.flow import flow_between
from fsid.render.frame import Frame
from fsid.render.fringes import inside, magnified, with_margin
from fsid.render.lamps import hoods_apart
from fsid.render.layers import GPU_BUDGET_BYTES, Layer, LayerStore, fitting_size
from fsid.render.mip_levels import MipLevels
from fsid.render.mirror import MOST, Mirror, clearest_mirror, ground_mirror
from fsid.render.occlusion_pass import OcclusionPass
from fsid.render.overview import OverviewPass
from fsid.render.quality import QUALITIES, tap_table
from fsid.render.sample_pass import SamplePass
from fsid.render.shade_pass import ShadePass
from fsid.render.shadow_pass import ShadowPass
from fsid.render.sharpness import set_sharpness
from fsid.render.stage import Stage, stage_of
from fsid.render.targets import Targets
from fsid.render.texels import Bake, Texels, bake_texels
from fsid.scene.check import camera_of
from fsid.scene.distortion import stretch_of
from fsid.scene.model import ZERO, Camera, Scene

Mark = Callable[[str], None]
"""Called with the name of each stage when it has been issued; the benchmark measures with it."""


class Renderer:
    """Owns the process's one OpenGL context and what is resident on it. Use it in a `with` block or close
    it; one that nothing refers to any more, as in a notebook, closes by itself.

    device_index: EGL device; None takes the first GPU, or else the CPU. supersampling: edge of the square
    grid of samples per pixel, 1..4. texture_size: texels per side of a material tile, a power of two; fewer
    where a scene has more materials than texture memory is meant for (`fsid.render.layers.BUDGET_BYTES`).
    quality: "high", or "fast" with fewer taps and coarser shadow maps (docs/render.md has both measured).
    lens_images: at most so many images, seen from places on the lens, make one with depth of field; each is
    blurred by its depth for the part of the lens that it stands for. compute: shade in compute shaders
    instead of fragment shaders; None does so on a GPU. Both make the same image to rounding.
    Raises FsidError where OpenGL 4.3 is missing or a second Renderer is opened in one process. The thread
    that opens it is the one that renders: OpenGL knows a context in one thread only. Other processes open
    their own; one that was forked from a process that had a Renderer cannot (a spawned one can): FsidError.
    """

    _is_open: ClassVar[bool] = False

    def __init__(
        self,
        *,
        device_index: int | None = None,
        supersampling: int = 2,
        texture_size: int = 1024,
        quality: str = "high",
        lens_images: int = 1,
        compute: bool | None = None,
    ) -> None:
        check_not_forked()
        if Renderer._is_open:
            raise FsidError(
                "a Renderer is already open in this process: close it first, or use another process"
            )
        if not 1 <= whole(supersampling, "supersampling") <= 4:
            raise FsidError(f"supersampling {supersampling}: must be 1 .. 4")
        if not 64 <= whole(texture_size, "texture_size") <= 8192 or texture_size & (texture_size - 1):
            raise FsidError(f"texture_size {texture_size}: must be a power of two from 64 to 8192")
        if quality not in QUALITIES:
            raise FsidError(f"quality '{quality}': use {' or '.join(QUALITIES)}")
        if whole(lens_images, "lens_images") < 1:
            raise FsidError(f"lens_images {lens_images}: must be at least 1")
        self._quality = QUALITIES[quality]
        self._lens_images = lens_images
        self._grid = supersampling
        self._context = open_context(device_index)
        self._thread = threading.get_ident()
        Renderer._is_open = True
        self._given_back = weakref.finalize(self, _give_back, self._context)
        self._given_back.atexit = False
        try:
            self._on_gpu = not self.info.is_software
            (keep_blocks if self._on_gpu else return_large_blocks)()
            self._prepare(texture_size, self._on_gpu if compute is None else compute)
        except BaseException:
            self.close()
            raise

    def _prepare(self, texture_size: int, compute: bool) -> None:
        context, quality, grid = self._context, self._quality, self._grid
        self._compute = compute
        self._texture_size = texture_size
        self._drain = context.finish if self._on_gpu else Drain(context).run
        self._layers = self._new_layers(texture_size)
        self._idle_layers: dict[int, LayerStore] = {}  # by size
        mips = MipLevels(context, compute=compute)
        self._targets = Targets(context, grid, mips, compute=compute)
        self._mirror_targets = [Targets(context, grid, mips, compute=compute) for _ in range(MOST)]
        table = tap_table(quality)
        self._taps = context.texture((table.shape[1], table.shape[0]), 2, table.tobytes(), dtype="f4")
        self._taps.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._shadows = ShadowPass(context, quality, grid, self._taps, self._drain, mips, compute=compute)
        self._samples = SamplePass(context)
        self._overview = OverviewPass(context)
        self._occlusion = OcclusionPass(context, quality, grid, self._taps, compute=compute)
        self._shade = ShadePass(context, quality, grid, self._shadows, compute=compute)
        self._idle = context.simple_framebuffer((1, 1))

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
        self._given_back()

    def __reduce__(self) -> NoReturn:
        raise TypeError("a Renderer cannot be copied or sent to another process: open one there")

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
        here, there = view.camera, camera_of(scene, flow_to, "flow_to")
        flow = flow_between(
            frame,
            view.drawables,
            (here, lens_of(here), here.time_s),
            (there, lens_of(there), there.time_s),
            self._label_sample,
        )
        return replace(frame, flow=flow)

    def radiance(self, scene: Scene, camera_index: int = 0) -> np.ndarray:
        """(H, W, 3), the `radiance` of `render` alone, the same bits: labels stay on the device, which takes
        less time and memory. Raises FsidError for a scene that cannot be drawn."""
        return self.draw(view_of(scene, camera_index), labels=False).radiance

    def draw(
        self,
        view: View,
        *,
        bake: Bake | None = None,
        shift_px: tuple[float, float] = (0.0, 0.0),
        labels: bool = True,
        mark: Mark = lambda stage: None,
    ) -> Frame:
        """The frame of a view; `render` without the scene.

        bake: where the texels of materials come from; None takes `bake_texels`. shift_px: moves the image by
        a part of a pixel (right, down). labels: False may leave albedo, normal and object_id without pixels.
        """
        if not self._given_back.alive:
            raise FsidError("this Renderer is closed")
        check_not_forked()
        if threading.get_ident() != self._thread:
            raise FsidError("a Renderer works in the thread that opened it; open and use it in one thread")
        asked = view.camera
        camera, margin = with_margin(asked)
        view = replace(view, camera=camera, drawables=hoods_apart(view.drawables))
        shot = Shot(lens_of(camera), camera.time_s, shift_px)
        bake = bake or self._bake
        labels = labels or is_moving(camera, view.drawables)
        self._draw(view, shot, bake, mark, labels=labels)
        frame = self._targets.read_frame(labels=labels)
        mark("readback")
        most, places = self._quality.shots, self._lens_images
        shots = shots_of(camera, view.drawables, frame, shot, self._label_sample, most, places)
        radiance = frame.radiance
        focal_px = _focal_px(camera) if camera.aperture_m > 0 else 0.0
        if len(shots) == 1:
            radiance = _through_lens(shots[0], camera, focal_px, radiance, frame.depth)
        elif shots:
            radiance = np.zeros_like(radiance)
            for part in shots:
                self._draw(view, part, bake, mark, labels=labels)
                radiance += _through_lens(part, camera, focal_px, *self._targets.read_radiance())
            radiance /= np.float32(len(shots))
        radiance = magnified(radiance, asked, margin)
        set_sharpness(radiance, asked)
        set_colour_contrast(radiance, asked)
        labels_of = (frame.albedo, frame.normal, frame.depth, frame.object_id)
        return Frame(radiance, *(label[inside(asked, margin)] for label in labels_of))

    def wait(self) -> None:
        """Return when everything issued so far is done; only measuring needs it."""
        self._context.finish()

    def _draw(self, view: View, shot: Shot, bake: Bake, mark: Mark, *, labels: bool) -> None:
        """All passes over a view; the result stays in the targets."""
        layers = self._load_layers(view, bake)
        stage = stage_of(view, layers, shot.time_s, self._quality.shadow_px)
        mark("scene build")
        self._targets.resize((view.camera.width, view.camera.height), shot.lens.seen_px, labels=labels)
        self._shadows.resize(stage.plan)
        buffers = Buffers(self._context, stage, compute=self._compute)
        stage = replace(stage, geometry=stage.geometry.without_vertices())
        try:
            mark("upload")
            # Shadows come third: a CPU makes their triangles ready while it draws the first two.
            self._samples.draw(self._targets, stage, buffers, shot)
            mark("samples")
            self._overview.draw(self._targets)
            self._occlusion.draw(self._targets, shot)
            mark("occlusion")
            mirrors = self._mirrors(view, shot, layers)
            self._shadows.draw(stage, buffers, [shot, *(mirror.shot for mirror in mirrors)])
            mark("shadows")
            images = list(zip(mirrors, self._mirror_targets, strict=False))
            for mirror, targets in images:
                self._draw_mirror(targets, stage, buffers, mirror)
            mark("mirror")
            self._draw_light(stage, buffers, shot, [(mirror.plane, targets) for mirror, targets in images])
            mark("shading")
        finally:
            self._idle.use()  # moderngl binds the last one again later: it must not be one that is freed
            buffers.release()
            for targets in self._mirror_targets:
                targets.release()
            self._targets.release_passing()
            if not self._on_gpu:
                return_free_blocks()

    def _load_layers(self, view: View, bake: Bake) -> dict[tuple[str, int], Layer]:
        wanted = {(m.family, m.variant): None for d in view.drawables for m in d.materials}
        size = fitting_size(self._texture_size, len(wanted))
        if size != self._layers.size:
            self._layers = self._layers_of(size)
        return self._layers.load(wanted, bake)

    def _bake(self, family: str, variant: int, size: int) -> Texels:
        return bake_texels(family, variant, size, self._free_images)

    def _free_images(self) -> None:
        """Give back those of the frame before while a material is drawn: both would be a worker's peak."""
        if not self._on_gpu and self._targets.size != (0, 0):
            self._targets.release()
            self._drain()

    def _layers_of(self, size: int) -> LayerStore:
        """Those of another size instead. On a GPU those of now stay: scenes of few materials and of many take
        turns, and each would have to load all of its own."""
        if not self._on_gpu:
            self._layers.release()
            return self._new_layers(size)
        self._idle_layers[self._layers.size] = self._layers
        return self._idle_layers.pop(size, None) or self._new_layers(size)

    def _new_layers(self, size: int) -> LayerStore:
        if self._on_gpu:
            return LayerStore(self._context, size, self._drain, GPU_BUDGET_BYTES, frugal=False)
        return LayerStore(self._context, size, self._drain)

    def _mirrors(self, view: View, shot: Shot, layers: dict[tuple[str, int], Layer]) -> list[Mirror]:
        """The flat smooth surfaces that show images, from the G-buffer."""
        overview = self._overview.read(self._targets, shot)
        found = [ground_mirror(view, shot, layers), clearest_mirror(view, overview, shot, layers)]
        return [mirror for mirror in found if mirror is not None]

    def _draw_mirror(self, targets: Targets, stage: Stage, buffers: Buffers, mirror: Mirror) -> None:
        """The image that a mirror shows, with what lies behind it cut off."""
        shot, size = mirror.shot, mirror.shot.lens.seen_px
        targets.resize(size, size, labels=False)
        camera = replace(stage.view.camera, width=size[0], vignetting=ZERO)
        stage = replace(stage, view=replace(stage.view, camera=camera))
        self._samples.draw(targets, stage, buffers, shot, kept=mirror.kept)
        self._occlusion.draw(targets, shot)
        self._shadows.draw_blocks(targets, stage, buffers, shot)
        self._shade.draw(targets, stage, buffers, shot, self._layers, shining=False)

    def _draw_light(
        self, stage: Stage, buffers: Buffers, shot: Shot, mirrors: Sequence[tuple[np.ndarray, Targets]]
    ) -> None:
        """The result, from samples, occlusion and shadows."""
        targets = self._targets
        self._shadows.draw_blocks(targets, stage, buffers, shot)
        self._shade.draw(targets, stage, buffers, shot, self._layers, mirrors=mirrors)
        if stage.glass.any():
            self._samples.draw_glass(targets, stage, buffers, shot)
            self._shade.draw_glass(targets, stage, buffers, shot, self._layers)
        if not self._on_gpu:
            self._context.finish()


def _give_back(context: moderngl.Context) -> None:
    release_context(context)
    Renderer._is_open = False


def _focal_px(camera: Camera) -> float | np.ndarray:
    """Focal length in pixels; (H, W) where the lens bends the image."""
    focal_px = float(lens_of(camera).focal[0]) * camera.width / 2
    return focal_px if camera.distortion is None else focal_px * stretch_of(camera.distortion, camera)


def _through_lens(
    shot: Shot, camera: Camera, focal_px: float | np.ndarray, radiance: np.ndarray, depth: np.ndarray
) -> np.ndarray:
    """An image as the part of the lens that `shot` stands for shows it. focal_px: of the camera."""
    if shot.aperture_m == 0:
        return radiance
    return defocus(radiance, depth, shot.aperture_m, camera.focus_m, focal_px)
