"""A view at one moment as the passes need it: plain arrays, nothing on the device yet."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fsid.render.camera import lens_of
from fsid.render.drawable import BACKGROUND_ID, Drawable, View
from fsid.render.geometry import Geometry, merge
from fsid.render.lamps import lamps_of
from fsid.render.layers import Layer
from fsid.render.room import Room, light_room, light_sky
from fsid.render.shadows import KINDS, ShadowPlan, Source, plan_shadows
from fsid.render.sky import panorama
from fsid.render.sky_sun import part_sun
from fsid.scene.model import Camera, Material


@dataclass(frozen=True, eq=False)
class Stage:
    """geometry: in the world. plan: lights and their shadow maps. room: what surrounds it as a light source.

    sky: (H, W, 3) radiance, None indoors; sunless: its most without the sun, which is a light.
    casts, glass: (N,) bool, which drawables shade others, are glass.
    """

    view: View
    geometry: Geometry
    plan: ShadowPlan
    room: Room
    sky: np.ndarray | None
    sunless: float
    casts: np.ndarray
    glass: np.ndarray

    @property
    def has_lobes(self) -> bool:
        """Whether any surface has clearcoat, sheen or translucency."""
        return any(
            max(m.clearcoat, m.sheen, m.translucency) > 0
            for drawable in self.view.drawables
            for m in drawable.materials
        )

    @property
    def has_areas(self) -> bool:
        """Whether there are area lights, displays that shine included."""
        return bool((self.plan.table["kind"][: self.plan.light_count] == KINDS["area"]).any())


def stage_of(view: View, layers: Mapping[tuple[str, int], Layer], time_s: float, shadow_px: int) -> Stage:
    """The stage at a time. layers: where the maps of each (family, variant) are. shadow_px: of `Quality`."""

    def layer_of(material: Material) -> Layer:
        return layers[material.family, material.variant]

    def albedo_of(material: Material) -> np.ndarray:
        return np.clip(layer_of(material).shares @ np.array(material.colours), 0.0, 1.0)

    geometry = merge(view.drawables, layer_of, time_s)
    sources = [Source(light) for light in view.lights]
    sources += lamps_of(view.drawables, albedo_of, time_s)
    casts = np.array([drawable.casts for drawable in view.drawables])
    movable = np.array([_shades_outdoors(drawable, view) for drawable in view.drawables])
    sky = None if view.sky is None else panorama(view.sky)
    sun, faint = (None, None) if sky is None else part_sun(sky)
    if sun is not None:
        sources.append(Source(sun))
    return Stage(
        view,
        geometry,
        plan_shadows(
            sources, geometry.spheres[casts & movable], geometry.spheres, _looked_at(view.camera), shadow_px
        ),
        light_sky(faint) if faint is not None else _lit_room(view, sources, albedo_of),
        sky,
        0.0 if faint is None else float(faint.max()),
        casts,
        np.array([drawable.is_glass for drawable in view.drawables]),
    )


_LOOKED_AT = 2.0
"""Distance from the camera up to which it looks at things, relative to its target's."""

_WIDEST_LOOK = 1.0  # tangent


def _looked_at(camera: Camera) -> np.ndarray:
    """(5, 3) the camera, and corners of what it sees farther away than its target."""
    lens = lens_of(camera)
    far_m = _LOOKED_AT * float(np.linalg.norm(np.subtract(camera.target_m, camera.position_m)))
    x, y = (min(1 / focal, _WIDEST_LOOK) for focal in lens.seen_focal)
    rays = np.array([(0.0, 0.0, 0.0), (x, y, 1.0), (x, -y, 1.0), (-x, y, 1.0), (-x, -y, 1.0)])
    return np.asarray(lens.position + far_m * rays @ lens.rotation)


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
