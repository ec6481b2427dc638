"""Scene -> Frame with Mitsuba 3: an independent path tracer to compare the rasteriser with, or to use.

    radiance    mean of `samples` paths per pixel, box filter        holds Monte-Carlo noise ~ samples^-1/2
    labels      one ray through the middle of each pixel             free of noise

Light bounces for real, so `Scene.ambient`, with which the rasteriser stands in for the walls' light, is used
out of doors only. Lens distortion is not Mitsuba's; a camera that has it is refused instead of being rendered
without. Fringes, sharpness and colour contrast come after the image, as the rasteriser's do.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np

from fsid.assets import bake_material
from fsid.errors import FsidError
from fsid.render.camera import Lens, lens_of
from fsid.render.colour_contrast import set_colour_contrast
from fsid.render.drawable import turn_about
from fsid.render.frame import Frame
from fsid.render.fringes import inside, magnified, with_margin
from fsid.render.parts import parts_of
from fsid.render.reference.bodies import Body, body_of, bsdf_of, pyramids
from fsid.render.reference.dicing import View
from fsid.render.reference.lights import emitters, surroundings
from fsid.render.reference.variant import load_mitsuba
from fsid.render.sharpness import set_sharpness
from fsid.scene.check import camera_of, check_scene
from fsid.scene.model import Camera, Scene
from fsid.scene.vectors import vec3

_PASS = 16
"""Samples per pass: the compiled variant keeps all paths of a pass in memory."""

_SHUTTER_STEPS = 8
_OFF_PX = 0.02
"""Label rays miss the middle of the pixel by this much: there, rays of a symmetric scene meet edges exactly
and slip through."""

_LABELS = "position:position,normal:sh_normal,face:prim_index,shape:shape_index"


class ReferenceRenderer:
    """Renders as `fsid.render.Renderer` does, by path tracing. Needs `fsid[reference]`.

    samples: paths per pixel. bounces: 1 is direct light only. texture_size: texels per side of a material
    tile, a power of two. edge_px: longest edge of a micropolygon in pixels.
    Raises FsidError for settings out of range, ModuleNotFoundError where Mitsuba is not installed.
    """

    def __init__(
        self, *, samples: int = 64, bounces: int = 7, texture_size: int = 1024, edge_px: float = 0.7
    ) -> None:
        for key, value, low, high in (
            ("samples", samples, 1, 65536),
            ("bounces", bounces, 1, 1000),
            ("texture_size", texture_size, 64, 8192),
            ("edge_px", edge_px, 0.1, 16.0),
        ):
            if not low <= value <= high:
                raise FsidError(f"{key} {value}: must be {low} .. {high}")
        self._mi = load_mitsuba()
        self._samples, self._bounces = samples, bounces
        self._texture_size, self._edge_px = texture_size, edge_px

    @property
    def variant(self) -> str:
        """Mitsuba's variant: "llvm_ad_rgb", or "scalar_rgb" where LLVM does not work."""
        return str(self._mi.variant())

    def render(self, scene: Scene, camera_index: int = 0, *, seed: int = 0) -> Frame:
        """The frame of one of the scene's cameras; `seed`, any whole number, changes the noise only.
        Raises FsidError."""
        check_scene(scene)
        asked = camera_of(scene, camera_index)
        if asked.distortion is not None:
            raise FsidError(
                "the reference renderer has no lens distortion; draw scenes without: "
                "--set scene.lens.distortion_share=0 scene.lens.fisheye_share=0"
            )
        camera, margin = with_margin(asked)
        still = not (camera.exposure_s and (scene.motions or _moves(camera)))
        steps = 1 if still else _SHUTTER_STEPS
        prepared = self.prepare(scene, camera)
        labels = prepared.labels()
        total = np.zeros_like(labels.radiance)
        for k in range(steps):
            if steps > 1:
                offset = camera.exposure_s * ((k + 0.5) / steps - 0.5)
                prepared = self.prepare(scene, _later(camera, offset))
            total += prepared.radiance(-(-self._samples // steps), seed * steps + k)
        radiance = (total / steps * _vignette(camera)[..., None]).astype(np.float32)
        radiance = magnified(radiance, asked, margin)
        set_sharpness(radiance, asked)
        set_colour_contrast(radiance, asked)
        labels_of = (labels.albedo, labels.normal, labels.depth, labels.object_id)
        return Frame(radiance, *(label[inside(asked, margin)] for label in labels_of))

    def radiance(self, scene: Scene, camera_index: int = 0) -> np.ndarray:
        """(H, W, 3), the `radiance` of `render` alone."""
        return self.render(scene, camera_index).radiance

    def prepare(self, scene: Scene, camera: Camera) -> Prepared:
        """The scene in Mitsuba's memory, diced for a camera; apart from `render` for measuring its time."""
        mi, lens = self._mi, lens_of(camera)
        focal_px = lens.focal[0] * camera.width / 2
        half_px = np.array((camera.width, camera.height)) / 2
        view = View(lens.rotation, lens.position, focal_px, half_px, self._edge_px)
        contents: dict[str, Any] = {"type": "scene"}
        bodies: dict[str, Body] = {}
        pyramid = pyramids(bake_material, self._texture_size)
        bsdf = cache(partial(bsdf_of, mi))
        parts = sorted(parts_of(scene, camera.time_s), key=lambda p: (p.material.family, p.material.variant))
        for i, part in enumerate(parts):
            name = f"part{i}"
            bodies[name] = body_of(mi, name, part, view, pyramid, bsdf)
            contents[name] = bodies[name].mesh
        for i, light in enumerate(scene.lights):
            contents |= emitters(mi, light, f"light{i}")
        if scene.background.kind == "open-air":
            contents |= surroundings(mi, scene)
        contents["camera"] = _sensor(mi, camera, lens)
        return Prepared(mi, mi.load_dict(contents), camera, lens, bodies, self._bounces)


class Prepared:
    """A scene in Mitsuba's memory, seen by one camera."""

    def __init__(
        self, mi: Any, scene: Any, camera: Camera, lens: Lens, bodies: dict[str, Body], bounces: int
    ) -> None:
        self._mi, self._scene, self._camera, self._lens = mi, scene, camera, lens
        self._depth = bounces + 1
        self._bodies = [bodies.get(shape.id()) for shape in scene.shapes()]

    def radiance(self, samples: int, seed: int) -> np.ndarray:
        """(H, W, 3) float64: mean of `samples` paths per pixel."""
        integrator = self._mi.load_dict({"type": "path", "max_depth": self._depth, "rr_depth": 64})
        total, done = np.zeros((self._camera.height, self._camera.width, 3)), 0
        while done < samples:
            count = min(_PASS, samples - done)
            seed_32 = (seed * 100_003 + done) % 2**32  # Mitsuba takes no other
            image = self._mi.render(self._scene, integrator=integrator, spp=count, seed=seed_32)
            total += np.array(image, np.float64)[..., :3] * count
            done += count
        return total / samples

    def labels(self) -> Frame:
        """A frame without light: albedo, depth, normal and ids at the middles of the pixels."""
        mi = self._mi
        sensor = mi.load_dict(_sensor(mi, self._camera, self._lens, regular=True))
        integrator = mi.load_dict({"type": "aov", "aovs": _LABELS, "light": {"type": "direct"}})
        image = np.array(mi.render(self._scene, sensor=sensor, integrator=integrator, spp=1), np.float64)
        position, normal, face, shape = np.split(image[..., -8:], (3, 6, 7), axis=-1)
        number = np.rint(shape[..., 0]).astype(int)  # from 1; 0 where nothing was hit
        albedo, object_id = np.zeros_like(position), np.full(number.shape, -1, np.int32)
        for i, body in enumerate(self._bodies, start=1):
            at = number == i
            if body is not None and at.any():
                albedo[at] = body.albedo_at(position[at], np.rint(face[at][:, 0]).astype(int))
                object_id[at] = body.object_id
        hit = (number > 0)[..., None]
        local = (position - self._lens.position) @ self._lens.rotation.T
        towards = normal @ self._lens.rotation.T
        towards = np.where((towards * local).sum(-1, keepdims=True) > 0, -towards, towards) * (1, 1, -1)
        towards /= np.maximum(np.linalg.norm(towards, axis=-1, keepdims=True), 1e-9)
        return Frame(
            radiance=np.zeros(position.shape, np.float32),
            albedo=np.where(hit, albedo, 0).astype(np.float32),
            normal=np.where(hit, towards, (0, 0, 1)).astype(np.float32),
            depth=np.where(hit[..., 0], local[..., 2], np.inf).astype(np.float32),
            object_id=object_id,
        )


def _sensor(mi: Any, camera: Camera, lens: Lens, *, regular: bool = False) -> dict[str, Any]:
    """regular: one ray through the middle of each pixel."""
    matrix = np.eye(4)
    right, up, forward = lens.rotation
    matrix[:3] = np.stack([-right, up, forward, lens.position], axis=-1)
    sampler = {"type": "stratified", "jitter": False} if regular else {"type": "independent"}
    sensor = {
        "type": "perspective",
        "to_world": mi.ScalarTransform4f(matrix),
        "fov": camera.fov_deg,
        "fov_axis": "x",
        "near_clip": 0.02,
        "far_clip": 1e4,
        "film": {
            "type": "hdrfilm",
            "width": camera.width,
            "height": camera.height,
            "pixel_format": "rgb",
            "component_format": "float32",
            "rfilter": {"type": "box"},
        },
        "sampler": sampler | {"sample_count": 1},
    }
    if regular:
        sensor |= {
            "principal_point_offset_x": _OFF_PX / camera.width,
            "principal_point_offset_y": 0.7 * _OFF_PX / camera.height,
        }
    elif camera.aperture_m > 0:
        sensor |= {
            "type": "thinlens",
            "aperture_radius": camera.aperture_m / 2,
            "focus_distance": camera.focus_m,
        }
    return sensor


def _vignette(camera: Camera) -> np.ndarray:
    """(H, W) gain >= 0 by distance from the centre, 1 in the corner."""
    y, x = np.mgrid[: camera.height, : camera.width] + 0.5
    centre = np.array((camera.width, camera.height)) / 2
    r2 = ((x - centre[0]) ** 2 + (y - centre[1]) ** 2) / (centre**2).sum()
    a1, a2, a3 = camera.vignetting
    return np.maximum(1 + r2 * (a1 + r2 * (a2 + r2 * a3)), 0.0)


def _moves(camera: Camera) -> bool:
    return any(camera.velocity_m_s) or any(camera.spin_deg_s)


def _later(camera: Camera, offset_s: float) -> Camera:
    """The camera `offset_s` seconds later."""
    rotation = turn_about(camera.spin_deg_s, offset_s)
    position = np.array(camera.position_m) + np.array(camera.velocity_m_s) * offset_s
    forward = rotation @ (np.array(camera.target_m) - camera.position_m)
    return replace(
        camera,
        position_m=vec3(position),
        target_m=vec3(position + forward),
        up=vec3(rotation @ np.array(camera.up)),
        time_s=camera.time_s + offset_s,
    )
