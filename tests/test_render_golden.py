"""Golden images, 160 x 90: what the laws do not pin down must not change unnoticed.

Every kind of light, lens and lobe, at an exposure fixed per scene; tolerance, files of a failure and new
references: golden_images.py. The material families have a sheet of their own in test_render_materials.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from fsid.assets import MaterialMaps
from fsid.render import Renderer
from fsid.render.drawable import Drawable, View, background_drawable, panel_drawable
from fsid.render.texels import Texels, texels_of
from fsid.scene.model import Background, Camera, Distortion, Light, Material, Motion, Sky, Transform
from golden_images import difference_from, encoded, keep_failure, too_different
from render_scenes import bake_plain, block, grid, plain, point_light, sphere

CAMERA = Camera((0.1, -2.0, 1.3), (0.0, 0.0, 0.35), (0.05, 0.0, 1.0), 52.0, 160, 90)
NAMES = ("floor", "ceiling", "wall_north", "wall_south", "wall_east", "wall_west")
ONE = (1.0, 1.0, 1.0)
WARM, COOL, DARK = (0.7, 0.35, 0.15), (0.2, 0.35, 0.7), (0.06, 0.06, 0.05)


def bake(family: str, variant: int, size: int) -> Texels:
    """Closed formulas: checks (mix), dots (pattern), waves (height), rust (metallic and roughness)."""
    if family in ("plain", "metal"):
        return bake_plain(family, variant, size)
    t = (np.arange(size) + 0.5) / size
    u, v = np.meshgrid(t, t)
    wave = 0.5 + 0.5 * np.sin(2 * np.pi * 4 * u) * np.sin(2 * np.pi * 4 * v)
    check = ((np.floor(8 * u) + np.floor(8 * v)) % 2).astype(float)
    dots = (np.hypot((u * 4) % 1 - 0.5, (v * 4) % 1 - 0.5) < 0.25).astype(float)
    rust = (wave > 0.6).astype(float)
    zero = np.zeros_like(u)
    maps = {
        "checks": (check, dots, 0.5 + 0.1 * wave, zero + 0.5, zero, zero),
        "waves": (wave, zero, zero + 0.5, zero + 0.3, wave, zero),
        "rust": (zero, rust, zero + 0.5, 0.25 + 0.6 * rust, 0.5 - 0.2 * rust, 1 - rust),
    }[family]
    return texels_of(MaterialMaps(*(m.astype(np.float32) for m in maps), relief_m=0.02, tile_m=0.5))


def patterned(family: str, *colours: tuple[float, float, float], turn_deg: float = 0.0) -> Material:
    return Material(family, 0, (colours[0], colours[1], colours[2]), 0.5, turn_deg, 1.0, 1.0)


def thing(mesh: object, material: Material, object_id: int, x: float, y: float, z: float = 0.0) -> Drawable:
    return Drawable(mesh, Transform((x, y, z), (0.0, 0.0, 25.0), (1.0, 1.0, 1.0)), (material,), object_id)  # type: ignore[arg-type]


def room_view(lights: tuple[Light, ...], ambient: float, *things: Drawable) -> View:
    """Things in a room of 4 x 5 x 2.6 m with checked floor and coloured walls."""
    materials = {name: plain((0.6, 0.6, 0.55)) for name in NAMES}
    materials["floor"] = patterned("checks", (0.5, 0.45, 0.4), (0.25, 0.2, 0.15), DARK, turn_deg=30.0)
    materials["wall_north"] = patterned("waves", COOL, (0.5, 0.5, 0.6), DARK)
    room = background_drawable(Background("room", (4.0, 5.0, 2.6), materials))
    return View((room, *things), lights, (ambient,) * 3, CAMERA, (4.0, 5.0, 2.6), room.materials)


def furniture() -> View:
    lights = (
        point_light((1.2, -0.8, 2.0), 3.0, 0.03),
        Light("spot", (-1.2, -0.9, 1.9), (0.5, 0.4, -0.75), (5.0, 3.5, 2.0), 0.08, 50.0),
    )
    return room_view(
        lights,
        0.12,
        thing(block((0.5, 0.4, 0.5)), patterned("waves", WARM, (0.4, 0.2, 0.1), DARK), 0, -0.45, 0.2),
        thing(sphere(0.3, 64), patterned("checks", WARM, COOL, DARK), 1, 0.35, 0.0, 0.3),
        thing(block((0.1, 0.1, 0.9)), plain(COOL, roughness=40), 2, 0.1, 0.6),
    )


def metals() -> View:
    balls = [
        thing(
            sphere(0.2, 64),
            plain((0.95, 0.8, 0.5), roughness=r, family="metal"),
            i,
            -0.75 + 0.5 * i,
            0.0,
            0.2,
        )
        for i, r in enumerate((20, 40, 60, 90))
    ]
    slab = thing(
        block((1.6, 0.1, 0.7)), patterned("rust", (0.8, 0.8, 0.85), DARK, (0.4, 0.15, 0.05)), 9, 0.0, 0.6
    )
    return room_view((point_light((0.6, -1.0, 1.8), 3.0, 0.1),), 0.1, *balls, slab)


def soft_shadows() -> View:
    posts = [
        thing(block((0.06, 0.06, h)), plain(WARM), i, x, -0.1)
        for i, (x, h) in enumerate(((-0.6, 0.9), (0.5, 0.5)))
    ]
    lid = thing(grid(0.5), plain(COOL), 5, 0.0, 0.1, 0.55)
    lights = tuple(point_light((x, 0.6, 2.2), 2.0, r) for x, r in ((-1.2, 0.02), (0.2, 0.2), (1.3, 0.08)))
    return room_view(lights, 0.03, *posts, lid)


def ball(material: Material, number: int, x: float, y: float = 0.0) -> Drawable:
    return thing(sphere(0.22, 64), material, number, x, y, 0.22)


def lobes() -> View:
    """Lacquer, velvet, glass, a lamp, and a sheet of paper with a light behind it."""
    red = plain((0.5, 0.03, 0.02), roughness=60)
    sheet = Drawable(
        grid(0.5),
        Transform((0.1, 0.55, 0.55), (90.0, 0.0, 0.0), ONE),
        (replace(plain((0.7, 0.7, 0.6)), translucency=0.5),),
        9,
    )
    return room_view(
        (point_light((-0.9, -0.9, 1.8), 2.5, 0.06), point_light((0.1, 1.0, 0.6), 0.5, 0.05)),
        0.1,
        ball(replace(red, clearcoat=1.0), 0, -0.75),
        ball(replace(plain((0.05, 0.03, 0.2)), sheen=1.0), 1, -0.25, -0.1),
        ball(replace(plain((0.9, 0.95, 0.9), roughness=20), transmission=1.0), 2, 0.25, -0.1),
        ball(replace(plain(WARM), emission=2.0), 3, 0.8, 0.1),
        sheet,
    )


def area_light() -> View:
    panel = Light("area", (0.3, 0.5, 1.5), (-0.1, -0.4, -1.0), (6.0, 5.5, 5.0), 0.0, 360.0, (0.7, 0.4))
    what = room_view(
        (panel,),
        0.03,
        ball(plain((0.9, 0.7, 0.4), roughness=30, family="metal"), 0, -0.5),
        thing(block((0.3, 0.3, 0.5)), plain(COOL, roughness=40), 1, 0.4, 0.1),
    )
    return replace(what, drawables=(*what.drawables, panel_drawable(panel, plain())))


def open_air() -> View:
    ground = Background("open-air", (60.0, 60.0, 2.0), {"ground": patterned("checks", WARM, DARK, COOL)})
    return View(
        (
            background_drawable(ground),
            ball(plain((0.9, 0.9, 0.9), roughness=20, family="metal"), 0, -0.4),
            thing(block((0.3, 0.3, 0.8)), plain(WARM), 1, 0.4, 0.2),
        ),
        (Light("sun", (0.0, 0.0, 0.0), (-0.6, 0.5, -0.7), (3.0, 2.8, 2.5), 0.0047, 360.0),),
        (0.0, 0.0, 0.0),
        replace(CAMERA, target_m=(0.0, 0.0, 0.6), fov_deg=75.0),
        (60.0, 60.0, 2.0),
        sky=Sky("procedural", (0.3, 0.4, 0.6), seed=3, cloudiness=0.6),
    )


def fisheye() -> View:
    lens = Distortion("fisheye", (0.02, -0.01, 0.0, 0.0))
    camera = replace(
        CAMERA,
        fov_deg=90.0,
        position_m=(0.1, -1.1, 0.8),
        distortion=lens,
        vignetting=(-0.4, 0.0, 0.0),
        chromatic_aberration=(0.006, -0.006),
    )
    return replace(furniture(), camera=camera)


def blurred() -> View:
    """The middle ball is sharp; the right one moves, and so does the camera a little."""
    camera = replace(
        CAMERA, aperture_m=0.04, focus_m=2.2, exposure_s=0.1, velocity_m_s=(0.05, 0.0, 0.0), time_s=0.5
    )
    what = room_view(
        (point_light((-0.9, -0.9, 1.8), 3.0, 0.06),),
        0.1,
        ball(patterned("checks", WARM, COOL, DARK), 0, -0.5, -0.9),
        ball(patterned("checks", WARM, COOL, DARK), 1, -0.1),
        replace(
            ball(plain(COOL, roughness=30), 2, 0.3),
            motion=Motion(velocity_m_s=(1.2, 0.0, 0.0), spin_deg_s=(0.0, 0.0, 90.0)),
        ),
    )
    return replace(what, camera=camera)


SCENES = {
    "furniture": (furniture, 1.6),
    "metals": (metals, 1.6),
    "soft_shadows": (soft_shadows, 2.2),
    "lobes": (lobes, 1.2),
    "area_light": (area_light, 0.8),
    "open_air": (open_air, 0.6),
    "fisheye": (fisheye, 1.6),
    "blurred": (blurred, 1.6),
}
"""name -> (view, exposure)."""


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    with Renderer(texture_size=256) as renderer:
        yield renderer


@pytest.mark.parametrize("name", SCENES)
def test_golden_image(renderer: Renderer, name: str) -> None:
    make, exposure = SCENES[name]
    frame = renderer.draw(make(), bake=bake)
    assert np.isfinite(frame.radiance).all()
    assert frame.radiance.min() >= 0.0
    image = encoded(frame.radiance, exposure)
    difference = difference_from(name, image)
    if what := too_different(difference):
        pytest.fail(f"{name}: {what}; {keep_failure(name, image, difference)}")
