"""Laws of lights and lobes: sun, area, shining surfaces, sky; energy is conserved by every lobe."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

import fsid.assets.skies
import fsid.render.sky
from fsid.assets import Mesh, survey_skies
from fsid.errors import FsidError
from fsid.render import Renderer
from fsid.render.drawable import BACKGROUND_ID, Drawable, background_drawable, panel_drawable, view_of
from fsid.render.lamps import hoods_apart, lamps_of
from fsid.render.room import light_room, light_sky
from fsid.render.shadows import Source
from fsid.render.sky import _clouds, _lattice, angles, panorama
from fsid.render.sky_sun import part_sun
from fsid.scene import SceneConfig, sample
from fsid.scene.model import ZERO, Background, Camera, Light, Material, Sky, Transform, Vec3
from render_scenes import (
    FROM_ABOVE,
    STILL,
    block,
    draw,
    floor_points,
    grid,
    lambertian,
    plain,
    point_light,
    sphere,
    view,
)

ONE = (1.0, 1.0, 1.0)
SMALL = replace(FROM_ABOVE, width=32, height=32)


def sun(direction: Vec3, irradiance: float = 2.0, tangent: float = 0.0047) -> Light:
    return Light("sun", (0.0, 0.0, 0.0), direction, (irradiance,) * 3, tangent, 360.0)


def panel(position: Vec3, direction: Vec3, size_m: tuple[float, float], radiance: float = 2.0) -> Light:
    return Light("area", position, direction, (radiance,) * 3, 0.0, 360.0, size_m)


def test_the_sun_shines_everywhere_alike(renderer: Renderer) -> None:
    """L = albedo / pi * E * cos(theta), at any distance."""
    frame = draw(renderer, view(lambertian(grid(6.0)), lights=(sun((0.6, 0.0, -0.8)),)))
    np.testing.assert_allclose(frame.radiance, 0.5 / np.pi * 2.0 * 0.8, rtol=2e-3)


def test_the_sun_casts_parallel_shadows(renderer: Renderer) -> None:
    """The shadow of a block of height h ends h tan(zenith angle) behind it."""
    tall = lambertian(block((0.2, 0.6, 0.4)), object_id=1)
    frame = draw(renderer, view(lambertian(grid(6.0)), tall, lights=(sun((0.6, 0.0, -0.8)),)))
    row, x = frame.radiance[48, :, 0], floor_points(FROM_ABOVE)[48, :, 0]
    floor = (x > 0.16) & (frame.object_id[48] == 0)
    edge, pixel = 0.1 + 0.4 * 0.6 / 0.8, x[1] - x[0]
    assert (row[floor & (x < edge - pixel)] < 1e-3).all()
    np.testing.assert_allclose(row[floor & (x > edge + pixel)], 0.5 / np.pi * 2.0 * 0.8, rtol=2e-3)


def irradiance(light: Light, points: np.ndarray) -> np.ndarray:
    """(H, W) what arrives at points (H, W, 3) that look up: the integral over the rectangle."""
    direction = np.array(light.direction) / np.linalg.norm(light.direction)
    width = np.cross(direction, (0.0, 0.0, 1.0))
    width = np.array(ONE) * (1, 0, 0) if np.linalg.norm(width) < 1e-6 else width / np.linalg.norm(width)
    height = np.cross(width, direction)
    t = (np.arange(120) + 0.5) / 120 - 0.5
    u, v = np.meshgrid(t * light.size_m[0], t * light.size_m[1])
    spots = np.array(light.position_m) + u[..., None] * width + v[..., None] * height
    total = np.zeros(points.shape[:2])
    for spot in spots.reshape(-1, 3):
        to = spot - points
        r2 = (to**2).sum(-1)
        cosines = np.maximum(to[..., 2], 0) * np.maximum(-(to @ direction), 0) / r2
        total += cosines / r2
    return total * light.colour[0] * light.size_m[0] * light.size_m[1] / t.size**2


@pytest.mark.parametrize(
    "light",
    [
        panel((0.2, -0.1, 1.0), (0.0, 0.0, -1.0), (0.8, 0.4)),
        panel((0.9, 0.2, 0.3), (-1.0, 0.1, 0.0), (0.5, 1.2)),
    ],
    ids=["above", "standing in the floor"],
)
def test_an_area_light_is_an_integral(renderer: Renderer, light: Light) -> None:
    """Irradiance within 1 % of the integral over the rectangle, also where the horizon cuts it."""
    frame = draw(renderer, view(lambertian(grid(8.0)), lights=(light,), camera=SMALL))
    points = floor_points(SMALL)
    direction = np.array(light.direction) / np.linalg.norm(light.direction)
    expected = 0.5 / np.pi * irradiance(light, points)
    inner = np.abs((points - light.position_m) @ direction) > 0.05
    inner &= expected > 0.02 * expected[inner].max()
    np.testing.assert_allclose(frame.radiance[inner, 0], expected[inner], rtol=0.01)


def test_the_part_of_an_area_light_above_a_face_lights_it(renderer: Renderer) -> None:
    """Its middle is 0.2 m below the top of a block, its upper edge 0.3 m above."""
    light = panel((1.2, 0.2, 0.1), (-1.0, 0.0, 0.0), (1.0, 1.0))
    frame = draw(renderer, view(lambertian(block((0.8, 0.8, 0.3))), lights=(light,), camera=SMALL))
    points = floor_points(SMALL) * (1.7 / 2.0) + (0.0, 0.0, 0.3)
    top = np.abs(points[..., :2]).max(-1) < 0.37
    expected = 0.5 / np.pi * irradiance(light, points)[top]
    np.testing.assert_allclose(frame.radiance[top, 0], expected, rtol=0.02)


def test_an_area_light_casts_a_soft_shadow(renderer: Renderer) -> None:
    """Behind an edge the light grows over the width of its image, from nothing to all."""
    light = panel((-0.4, 0.0, 1.5), (0.0, 0.0, -1.0), (0.2, 0.2))
    shade = lambertian(block((1.0, 3.0, 0.004)), at=Transform((-0.5, 0.0, 0.5), (0, 0, 0), ONE), object_id=1)
    camera = replace(FROM_ABOVE, width=192, height=192)
    shaded = draw(renderer, view(lambertian(grid(8.0)), shade, lights=(light,), camera=camera))
    free = draw(renderer, view(lambertian(grid(8.0)), lights=(light,), camera=camera))
    share = (shaded.radiance / free.radiance)[96, :, 0]
    x = floor_points(camera)[96, :, 0]
    floor = (shaded.object_id[96] == 0) & (x > 0)
    low, high = (np.interp(level, share[floor], x[floor]) for level in (0.1, 0.9))
    assert 0.75 * 0.08 < high - low < 1.35 * 0.08
    assert abs((low + high) / 2 - 0.2) < 0.01
    assert share[floor & (x > 0.32)].min() > 0.99


@pytest.mark.parametrize("layer", ["body", "coat", "metal"])
def test_the_highlight_of_an_area_light_is_that_of_its_pieces(renderer: Renderer, layer: str) -> None:
    """Within a sixth of 64 small lights, also opposite a low viewer, where Fresnel's share changes most."""
    material = plain(ONE if layer == "metal" else (0.0, 0.0, 0.0), roughness=50, family=layer)
    if layer == "coat":
        material = COAT
    sheet = Drawable(grid(8.0), STILL, (material,), 0, specular=0.04 * (layer == "body"), casts=False)
    light = panel((-1.9, 0.0, 0.7), (1.0, 0.0, -0.37), (0.8, 0.8), 1.0)
    ahead = np.array(light.direction) / np.linalg.norm(light.direction)
    up = np.cross((0.0, -1.0, 0.0), ahead)
    t = ((np.arange(8) + 0.5) / 8 - 0.5) * 0.8
    places = np.array(light.position_m) + t[:, None, None] * (0.0, 1.0, 0.0) + t[:, None] * up
    pieces = tuple(
        Light("spot", tuple(place), tuple(-place), (share,) * 3, 0.0, 40.0)
        for place in places.reshape(-1, 3)
        for share in [0.01 * float(-place @ ahead / np.linalg.norm(place))]
    )
    for elevation in np.radians([60.0, 30.0, 15.0]):
        place = (3 * float(np.cos(elevation)), 0.0, 3 * float(np.sin(elevation)))
        camera = Camera(place, (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.5, 4, 4)
        views = (view(sheet, lights=lights, camera=camera) for lights in ((), (light,), pieces))
        dark, shown, summed = (
            draw(renderer, replace(what, room_size_m=FAR)).radiance[2, 2, 1] for what in views
        )
        np.testing.assert_allclose(shown - dark, summed - dark, rtol=1 / 6)


FAR = (1e4, 1e4, 1e4)  # walls from which nothing of a light comes back
BROAD = ((75, 0, 60), (75, 180, 30), (45, 120, 40), (45, 0, 15), (20, 0, 30))
PEAK = ((75, 180, 75), (60, 180, 68), (60, 180, 60), (45, 180, 45))
SHEEN = replace(plain((0.0, 0.0, 0.0)), sheen=1.0)
COAT = replace(plain((0.0, 0.0, 0.0)), clearcoat=1.0, clearcoat_roughness=0.5)


def elevated(elevation_deg: float, azimuth_deg: float, distance_m: float) -> Vec3:
    elevation, azimuth = np.radians((elevation_deg, azimuth_deg))
    flat = distance_m * np.cos(elevation)
    x, y, z = flat * np.cos(azimuth), flat * np.sin(azimuth), distance_m * np.sin(elevation)
    return float(x), float(y), float(z)


@pytest.mark.parametrize(
    ("material", "directions"),
    [
        (plain(ONE), BROAD),
        (SHEEN, BROAD),
        (plain(ONE, roughness=50, family="metal"), PEAK),
        (COAT, PEAK),
    ],
    ids=["body", "sheen", "mirror", "coat"],
)
def test_a_small_panel_lights_as_a_point_of_its_intensity(
    renderer: Renderer, material: Material, directions: tuple[tuple[float, float, float], ...]
) -> None:
    """directions: elevation of the viewer, azimuth and elevation of the light, degrees. The linearly
    transformed cosine of a mirror or a coat is GGX around its highlight alone, where these are compared."""
    sheet = Drawable(grid(8.0), STILL, (material,), 0, specular=0.0, casts=False)
    for viewer, azimuth, elevation in directions:
        camera = Camera(elevated(viewer, 0.0, 3.0), ZERO, (0.0, 1.0, 0.0), 0.5, 4, 4)
        place = elevated(elevation, azimuth, 2.0)
        x, y, z = place
        lights = point_light(place, 1.0, 0.025), panel(place, (-x, -y, -z), (0.05, 0.05), 1 / 0.05**2)
        point, area = (
            draw(renderer, replace(view(sheet, lights=(light,), camera=camera), room_size_m=FAR)).radiance[
                2, 2
            ]
            for light in lights
        )
        np.testing.assert_allclose(area, point, rtol=0.03, err_msg=f"{viewer}, {azimuth}, {elevation}")


@pytest.mark.parametrize("viewer_deg", [80.0, 45.0, 10.0])
def test_a_panel_over_all_of_the_sky_is_a_white_furnace_for_sheen(
    renderer: Renderer, viewer_deg: float
) -> None:
    sheet = Drawable(grid(1.0), STILL, (replace(plain(ONE), sheen=1.0),), 0, specular=0.0, casts=False)
    camera = Camera(elevated(viewer_deg, 0.0, 3.0), ZERO, (0.0, 1.0, 0.0), 0.5, 4, 4)
    light = panel((0.0, 0.0, 0.05), (0.0, 0.0, -1.0), (60.0, 60.0), 1.0)
    frame = draw(renderer, replace(view(sheet, lights=(light,), camera=camera), room_size_m=FAR))
    np.testing.assert_allclose(frame.radiance, 1.0, rtol=0.01)


def test_an_area_light_is_seen_and_mirrored(renderer: Renderer) -> None:
    """Its face has its own radiance; a mirror floor under it shows nearly that, and never more."""
    light = panel((0.0, 0.0, 0.25), (0.0, 0.0, -1.0), (1.0, 1.0), 3.0)
    below = Camera((0.0, 0.0, 0.1), (0.0, 0.0, 1.0), (0.0, 1.0, 0.0), 40.0, 32, 32)
    face = panel_drawable(light, plain())
    frame = draw(renderer, view(lambertian(grid(8.0)), face, lights=(light,), camera=below))
    np.testing.assert_allclose(frame.radiance, 3.0, rtol=1e-3)
    assert (frame.object_id == -1).all()
    mirror = Drawable(grid(8.0), STILL, (plain(ONE, roughness=20, family="metal"),), 0)
    across = Camera((0.0, -0.8, 0.3), (0.0, 0.0, -0.1), (0.0, 0.0, 1.0), 20.0, 32, 32)
    frame = draw(renderer, view(mirror, face, lights=(light,), camera=across))
    assert 2.4 < frame.radiance[16, 16, 0] <= 3.0 * 1.01
    assert frame.radiance.max() <= 3.0 * 1.05


def test_a_shining_surface_lights_its_neighbourhood(renderer: Renderer) -> None:
    """A ball of radiance L and radius R gives E = pi L R^2 cos / d^2."""
    glowing = replace(plain((0.8, 0.8, 0.8)), emission=5.0)
    lamp = Drawable(sphere(0.1), Transform((0.0, 0.0, 1.0), (0, 0, 0), ONE), (glowing,), 1, specular=0.0)
    camera = replace(FROM_ABOVE, position_m=(1.5, 0.0, 1.2), target_m=(1.0, 0.0, 0.0))
    frame = draw(renderer, view(lambertian(grid(8.0)), lamp, camera=camera))
    points = floor_points(camera)
    to = np.array((0.0, 0.0, 1.0)) - points
    d = np.linalg.norm(to, axis=-1)
    expected = 0.5 / np.pi * (np.pi * 4.0 * 0.1**2) * to[..., 2] / d**3
    floor = frame.object_id == 0
    np.testing.assert_allclose(frame.radiance[floor, 0], expected[floor], rtol=0.03)
    above = draw(renderer, view(lamp, camera=FROM_ABOVE))
    np.testing.assert_allclose(above.radiance[48, 48], 4.0, rtol=1e-3)


def test_a_hollow_lamp_gives_as_much_light_as_a_solid_one(renderer: Renderer) -> None:
    """What shines inside a ball of two walls stays there."""
    glowing = replace(plain((0.8, 0.8, 0.8)), emission=5.0)
    wall, inner = sphere(0.1), sphere(0.098)
    lining = replace(inner, normals=-inner.normals, faces=inner.faces[:, ::-1].copy())
    both = joined(wall, lining)
    shell = replace(both, face_parts=np.zeros_like(both.face_parts), part_names=("shell",))
    at = Transform((0.0, 0.0, 1.0), (0, 0, 0), ONE)
    camera = replace(SMALL, position_m=(1.5, 0.0, 1.2), target_m=(1.0, 0.0, 0.0))
    solid, hollow = (
        draw(renderer, view(lambertian(grid(8.0)), Drawable(mesh, at, (glowing,), 1), camera=camera)).radiance
        for mesh in (wall, shell)
    )
    assert solid.min() > 0
    np.testing.assert_allclose(hollow, solid, rtol=0.03)


def test_a_sheet_shines_to_both_sides(renderer: Renderer) -> None:
    """60 degrees off its normal a sheet of radiance L and area A has the intensity L A / 2, its mean."""
    glowing = replace(plain((0.8, 0.8, 0.8)), emission=5.0)
    sheet = Drawable(grid(0.1), Transform((0.0, 0.0, 1.0), (60.0, 0.0, 0.0), ONE), (glowing,), 1)
    camera = Camera((0.0, 0.6, 0.5), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0, 16, 16)
    frame = draw(renderer, view(lambertian(grid(8.0)), sheet, camera=camera))
    np.testing.assert_allclose(frame.radiance[8, 8], 0.5 / np.pi * 4.0 * 0.1**2 / 2, rtol=0.02)


EGG = (sphere(1.0, 24), (0.25, 0.05, 0.1))
"""A mesh and its scale: an ellipsoid of half axes 25, 5 and 10 cm."""


@pytest.mark.parametrize("height_m", [0.6, 2.0])
@pytest.mark.parametrize(
    ("body", "turn"),
    [
        (EGG, (0.0, 0.0, 0.0)),
        (EGG, (90.0, 0.0, 0.0)),
        (EGG, (0.0, 90.0, 0.0)),
        ((block((0.6, 0.6, 0.02)), ONE), (0.0, 0.0, 0.0)),
    ],
    ids=["egg", "egg, broad side", "egg, tip", "slab"],
)
def test_a_shining_body_gives_as_much_as_is_seen_of_it(
    renderer: Renderer, body: tuple[Mesh, Vec3], turn: Vec3, height_m: float
) -> None:
    """Right below it E is the sum over its triangles of L cos cos A / d^2, near and far."""
    glowing = replace(plain((0.8, 0.8, 0.8)), emission=5.0)
    mesh, scale = body
    lamp = Drawable(mesh, Transform((0.0, 0.0, height_m), turn, scale), (glowing,), 1, specular=0.0)
    camera = Camera((0.9, 0.0, 0.2), ZERO, (0.0, 0.0, 1.0), 0.5, 8, 8)
    frame = draw(renderer, view(lambertian(grid(8.0)), lamp, camera=camera))
    rotation, position = lamp.pose(0.0)
    triangles = (mesh.vertices * np.array(scale))[mesh.faces] @ rotation.T + position
    for _ in range(5 if len(triangles) < 100 else 0):
        a, b, c = np.moveaxis(triangles, 1, 0)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        four = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        triangles = np.concatenate([np.stack(corners, axis=1) for corners in four])
    facets = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]) / 2
    middle = triangles.mean(1)
    d2 = (middle**2).sum(-1)
    expected = 4.0 * (middle[:, 2] * np.maximum(-(middle * facets).sum(-1), 0.0) / d2**2).sum()
    np.testing.assert_allclose(frame.radiance[4, 4] * np.pi / 0.5, expected, rtol=0.08)


def test_the_hood_of_a_lamp_shades_its_light(renderer: Renderer) -> None:
    """A square of 0.6 m, 0.3 m below a bulb that is 1 m above the floor, shades a square of 2 m there; what
    is translucent shades nothing of its own bulb."""
    bulb, square = sphere(0.1), grid(0.6)
    mesh = Mesh(
        vertices=np.concatenate([bulb.vertices, square.vertices - np.float32([0, 0, 0.3])]),
        normals=np.concatenate([bulb.normals, square.normals]),
        faces=np.concatenate([square.faces + len(bulb.vertices), bulb.faces]).astype(np.int32),
        face_parts=np.repeat(np.int32([1, 0]), [len(square.faces), len(bulb.faces)]),
        part_names=("bulb", "hood"),
    )
    glowing, at = replace(plain((0.8, 0.8, 0.8)), emission=5.0), Transform((0.0, 0.0, 1.0), (0, 0, 0), ONE)
    camera = replace(FROM_ABOVE, position_m=(1.5, 0.0, 1.2), target_m=(0.9, 0.0, 0.0))
    radiance = {}
    for hood in (plain(), replace(plain(), translucency=0.5)):
        lamp = Drawable(mesh, at, (glowing, hood), 1, specular=0.0)
        frame = draw(renderer, view(lambertian(grid(8.0)), lamp, camera=camera))
        radiance[hood.translucency] = frame.radiance[..., 0]
    share, aside = radiance[0.0] / radiance[0.5], np.abs(floor_points(camera)[..., :2]).max(-1)
    assert (share[aside < 0.7] < 0.01).all()
    np.testing.assert_allclose(share[aside > 1.3], 1.0, atol=0.01)


def joined(*parts: Mesh) -> Mesh:
    """Meshes of one part each as the parts of one mesh."""
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    return Mesh(
        vertices=np.concatenate([part.vertices for part in parts]),
        normals=np.concatenate([part.normals for part in parts]),
        faces=np.concatenate([p.faces + s for p, s in zip(parts, starts, strict=False)]).astype(np.int32),
        face_parts=np.repeat(np.arange(len(parts), dtype=np.int32), [len(part.faces) for part in parts]),
        part_names=tuple(f"part {i}" for i in range(len(parts))),
    )


def moved(mesh: Mesh, offset: Vec3) -> Mesh:
    return replace(mesh, vertices=mesh.vertices + np.float32(offset))


def test_a_display_lights_what_is_before_it_as_a_rectangle_does(renderer: Renderer) -> None:
    """A slab on a case, 0.4 m x 0.3 m, that stands askew 0.2 m above a floor: E = L times the form factor of
    its front, by summing small pieces of it; where its plane is behind, and below the shelf, no light."""
    slab = block((0.4, 0.3, 0.004))
    case = moved(block((0.42, 0.32, 0.03)), (0.0, 0.0, -0.0302))
    shelf = moved(block((0.02, 0.3, 0.2)), (0.15, 0.0, 0.02))
    glowing = replace(plain((0.8, 0.8, 0.8)), emission=5.0)
    at = Transform((0.0, 0.0, 0.4), (70.0, 25.0, 40.0), ONE)
    screen = Drawable(joined(slab, case), at, (glowing, plain()), 1, specular=0.0)
    floor = lambertian(grid(8.0))
    frame = draw(renderer, view(floor, screen))
    rotation, place = screen.pose(0.0)
    u, v = np.meshgrid((np.arange(40) + 0.5) / 40 - 0.5, (np.arange(30) + 0.5) / 30 - 0.5)
    pieces = np.stack([0.4 * u, 0.3 * v, np.full_like(u, 0.004)], -1).reshape(-1, 3) @ rotation.T + place
    points, ahead = floor_points(FROM_ABOVE), rotation[:, 2]
    to = pieces - points[:, :, None]
    d2 = (to**2).sum(-1)
    share = np.maximum(to[..., 2], 0) * np.maximum(-to @ ahead, 0) / d2**2
    expected = 0.5 / np.pi * 4.0 * share.sum(-1) * (0.4 * 0.3 / len(pieces))
    seen, height = maximum_filter(frame.object_id, 3) == 0, (points - place) @ ahead
    bright = seen & (height > 0.1) & (expected > 0.1 * expected[seen].max())
    assert bright.mean() > 0.2
    np.testing.assert_allclose(frame.radiance[bright, 0], expected[bright], rtol=0.03)
    dark = seen & (height < -0.02)
    assert dark.mean() > 0.2
    assert frame.radiance[dark].max() < 1e-3 * frame.radiance[bright].max()
    with_shelf = Drawable(joined(slab, case, shelf), at, (glowing, plain(), plain()), 1, specular=0.0)
    shaded = draw(renderer, view(floor, with_shelf)).radiance[..., 0]
    assert (shaded[bright] < 0.5 * frame.radiance[bright, 0]).mean() > 0.1


def test_a_mirrored_screen_is_a_mirrored_light() -> None:
    """What is scaled by -1 along x shines to where the mirror image of what it was shines."""
    case = moved(block((0.42, 0.32, 0.03)), (0.0, 0.0, -0.0302))
    materials = (replace(plain(), emission=5.0), plain())
    lights = []
    for mirror in (1.0, -1.0):
        at = Transform((0.0, 0.0, 0.4), (70.0, mirror * 25.0, mirror * 40.0), (mirror, 1.0, 1.0))
        screen = Drawable(joined(block((0.4, 0.3, 0.004)), case), at, materials, 1)
        (source,) = lamps_of(hoods_apart([screen]), lambda material: np.array(material.colours[0]), 0.0)
        lights.append(source.light)
    one, other = lights
    assert one.kind == other.kind == "area"
    np.testing.assert_allclose(other.position_m, np.multiply(one.position_m, (-1, 1, 1)), atol=1e-6)
    np.testing.assert_allclose(other.direction, np.multiply(one.direction, (-1, 1, 1)), atol=1e-6)
    np.testing.assert_allclose((other.size_m, other.colour[:2]), (one.size_m, one.colour[:2]), rtol=1e-6)


def test_what_shines_to_both_sides_is_no_display() -> None:
    """A slab with nothing behind it, and one between two cases."""
    slab, case = block((0.4, 0.3, 0.004)), block((0.42, 0.32, 0.01))
    glowing = replace(plain(), emission=5.0)
    behind, before = moved(case, (0.0, 0.0, -0.011)), moved(case, (0.0, 0.0, 0.005))
    for count, parts in ((0, [slab]), (1, [slab, behind]), (1, [slab, before]), (0, [slab, behind, before])):
        materials = (glowing, plain(), plain())[: len(parts)]
        pieces = hoods_apart([Drawable(joined(*parts), STILL, materials, 1)])
        assert sum(len(piece.displays) for piece in pieces) == count


def test_angles_are_those_of_the_middles_of_texels() -> None:
    elevation, azimuth = angles(3)
    np.testing.assert_allclose(np.degrees(elevation), [60, 0, -60], atol=1e-9)
    np.testing.assert_allclose(np.degrees(azimuth), [30, 90, 150, 210, 270, 330])


def test_a_grey_sky_is_a_furnace(renderer: Renderer) -> None:
    """Under a sky of one radiance in all directions a surface shows albedo times it; and the sky is seen."""
    radiance = np.full((32, 64, 3), 0.7, np.float32)
    what = replace(view(lambertian(sphere(0.3), (0.8, 0.4, 0.1))), sky=Sky("procedural", (0.7, 0.7, 0.7)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("fsid.render.stage.panorama", lambda sky: radiance)
        frame = draw(renderer, what)
    np.testing.assert_allclose(frame.radiance[44:52, 44:52].mean((0, 1)), (0.56, 0.28, 0.07), rtol=5e-3)
    np.testing.assert_allclose(frame.radiance[:4, :4], 0.7, rtol=1e-3)
    assert np.isinf(frame.depth[:4, :4]).all()


@pytest.mark.parametrize("cloudiness", [0.0, 0.7])
def test_a_procedural_sky_has_its_mean(cloudiness: float) -> None:
    colour = (0.3, 0.4, 0.7)
    picture = panorama(Sky("procedural", colour, seed=5, cloudiness=cloudiness, azimuth_deg=40.0))
    elevation = np.pi / 2 - (np.arange(len(picture)) + 0.5) / len(picture) * np.pi
    weight = np.cos(elevation) * (elevation > 0)
    mean = (picture * weight[:, None, None]).sum((0, 1)) / (weight.sum() * picture.shape[1])
    np.testing.assert_allclose(mean, colour, rtol=1e-4)
    assert picture.min() >= 0


def test_a_clear_sky_is_deepest_overhead_and_pale_at_the_horizon() -> None:
    """By (1 - sin elevation)^4 between both; what is below the horizon is a quarter as bright as it."""
    rows = panorama(Sky("procedural", ONE))[:, 0]
    elevation, _ = angles(len(rows))
    up, low = elevation > 0, (1 - np.sin(elevation)) ** 4
    for colour in range(3):
        slope, zenith = np.polyfit(low[up], rows[up, colour], 1)
        np.testing.assert_allclose(rows[up, colour], zenith + slope * low[up], rtol=1e-4)
        np.testing.assert_allclose(rows[~up, colour], 0.25 * (zenith + slope), rtol=1e-4)
    assert rows[0, 2] / rows[0, 0] > 2.5 * rows[up][-1, 2] / rows[up][-1, 0]


def test_noise_goes_through_its_lattice_smoothly() -> None:
    """At whole places its numbers, which repeat every 64; between them by 3 u^2 - 2 u^3."""
    values = np.random.default_rng(0).random((64, 64))
    x, y = np.meshgrid(np.arange(-70.0, 70), np.arange(-70.0, 70))
    np.testing.assert_array_equal(_lattice(values, x, y), values[y.astype(int) % 64, x.astype(int) % 64])
    u = 3 * 0.3**2 - 2 * 0.3**3
    np.testing.assert_allclose(
        _lattice(values, np.array(5.3), np.array(7.0)), (1 - u) * values[7, 5] + u * values[7, 6]
    )
    np.testing.assert_allclose(
        _lattice(values, np.array(5.0), np.array(7.3)), (1 - u) * values[7, 5] + u * values[8, 5]
    )


def test_clouds_are_a_flat_layer_that_ends_at_the_horizon() -> None:
    """Around the zenith all directions meet in one place; more cloudiness covers more."""
    elevation, azimuth = angles(256)
    elevation = elevation[:128]
    lattice = np.random.default_rng(4).random((64, 64))
    cover, _ = _clouds(lattice, elevation, azimuth, 0.5)
    assert np.ptp(cover[0]) < 0.05 < np.ptp(cover[40])
    assert cover[elevation < 0.02].max() < 0.13
    assert np.abs(cover - cover[:, ::-1]).mean() > 0.1
    means = [_clouds(lattice, elevation, azimuth, share)[0].mean() for share in (0.1, 0.4, 0.7, 1.0)]
    assert (np.diff(means) > 0.05).all()


def test_a_cloud_is_darker_where_it_is_thicker() -> None:
    """So an overcast sky is no even white: brighter where it is thin, and hardly coloured anywhere."""
    elevation, azimuth = angles(512)
    cover, thickness = _clouds(np.random.default_rng(4).random((64, 64)), elevation[:128], azimuth, 1.0)
    green = panorama(Sky("procedural", ONE, seed=4, cloudiness=1.0))[:128, :, 1]
    assert np.corrcoef(thickness[cover == 1], green[cover == 1])[0, 1] < -0.99
    picture = panorama(Sky("procedural", (1.0, 1.0, 1.0), seed=4, cloudiness=1.0))
    overhead = picture[: len(picture) // 4]
    grey = overhead[overhead[..., 2] < 1.5 * overhead[..., 0]] @ (0.2126, 0.7152, 0.0722)
    assert len(grey) > 0.7 * overhead[..., 0].size
    assert 1.3 < np.quantile(grey, 0.95) / np.quantile(grey, 0.05) < 2.5


LOBES: dict[str, dict[str, float]] = {
    "clearcoat": {"clearcoat": 1.0},
    "sheen": {"sheen": 1.0},
    "translucency": {"translucency": 0.6},
    "all": {"clearcoat": 0.7, "clearcoat_roughness": 0.6, "sheen": 0.6, "translucency": 0.5},
}


@pytest.mark.parametrize("name", LOBES)
def test_lobes_in_a_white_furnace(renderer: Renderer, name: str) -> None:
    """In surroundings of 1 a white body shows 1, whatever layers it has."""
    material = replace(plain(ONE), **LOBES[name])
    frame = draw(renderer, view(Drawable(sphere(0.3), STILL, (material,), 0, specular=0.0), ambient=1.0))
    np.testing.assert_allclose(frame.radiance[40:56, 40:56], 1.0, rtol=0.01)


@pytest.mark.parametrize("name", ["none", "metal", "all"])
def test_lobes_reflect_no_more_than_arrives(renderer: Renderer, name: str) -> None:
    """White, under light of 1 from 112 directions of the whole sphere: between 0.85 and 1.03 comes back."""
    family = "metal" if name == "metal" else "plain"
    material = replace(plain(ONE, roughness=60, family=family), **LOBES.get(name, {}))
    camera = Camera((0.9, 0.0, 0.6), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 10.0, 16, 16)
    sheet = Drawable(grid(0.4), STILL, (material,), 0)
    i = np.arange(112)
    z, phi = 1 - (2 * i + 1) / 112, i * np.pi * (3 - np.sqrt(5))
    directions = np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z], axis=-1)
    total = 0.0
    for some in directions.reshape(7, 16, 3):
        lights = tuple(sun((x, y, z), 4 * np.pi / 112) for x, y, z in some.tolist())
        total += float(draw(renderer, view(sheet, lights=lights, camera=camera)).radiance[8, 8, 1])
    assert 0.85 < total < 1.03


def test_light_passes_through_a_translucent_sheet(renderer: Renderer) -> None:
    """Lit from behind, L = albedo t / pi E; lit from the front, (1 - t) of what an opaque one shows."""
    sheet = replace(plain((0.6, 0.6, 0.6)), translucency=0.4)
    thin = Drawable(grid(1.0), STILL, (sheet,), 0, specular=0.0)
    for height, share in ((-1.0, 0.4), (1.0, 0.6)):
        frame = draw(renderer, view(thin, lights=(sun((0.0, 0.0, -height)),), camera=SMALL))
        np.testing.assert_allclose(frame.radiance[16, 16], 0.6 * share / np.pi * 2.0, rtol=5e-3)


def test_glass_shows_what_is_behind_it(renderer: Renderer) -> None:
    """A clear pane passes (1 - F) / (1 + F) of the floor's light, and the labels are the pane's."""
    glass = replace(plain(ONE, roughness=20), transmission=1.0)
    pane = Drawable(block((0.6, 0.6, 0.01)), Transform((0.0, 0.0, 0.5), (0, 0, 0), ONE), (glass,), 1)
    lights = (sun((0.6, 0.0, -0.8)),)
    frame = draw(renderer, view(lambertian(grid(6.0)), pane, lights=lights))
    dark = draw(renderer, view(lambertian(grid(6.0), ZERO), pane, lights=lights))
    floor = 0.5 / np.pi * 2.0 * 0.8
    np.testing.assert_allclose(frame.radiance[4, 4], floor, rtol=5e-3)
    passed = (frame.radiance - dark.radiance)[44:52, 44:52]
    np.testing.assert_allclose(passed, 0.96 / 1.04 * floor, rtol=0.01)
    assert frame.object_id[48, 48] == 1
    assert frame.object_id[4, 4] == 0
    np.testing.assert_allclose(frame.depth[48, 48], 1.49, atol=1e-3)


@pytest.mark.parametrize("roughness", [20, 50])
@pytest.mark.parametrize(
    "lobes",
    [{"transmission": 1.0}, {"transmission": 0.7}, {"transmission": 1.0, "clearcoat": 1.0, "sheen": 0.5}],
    ids=["clear", "milky", "coated"],
)
def test_glass_in_a_white_furnace(renderer: Renderer, lobes: dict[str, float], roughness: int) -> None:
    """In surroundings of 1 a white pane shows 1 at any angle: what its two faces do not reflect passes."""
    pane = Drawable(grid(3.0), STILL, (replace(plain(ONE, roughness=roughness), **lobes),), 0)
    wall = lambertian(grid(60.0), ONE, at=replace(STILL, position_m=(0.0, 0.0, -2.0)), object_id=1)
    for angle_deg in (0.0, 30.0, 60.0, 70.0, 80.0):
        camera = Camera(elevated(90.0 - angle_deg, 0.0, 2.0), ZERO, (0.0, 1.0, 0.0), 2.0, 8, 8)
        frame = draw(renderer, view(wall, pane, ambient=1.0, camera=camera))
        assert (frame.object_id == 0).all()
        np.testing.assert_allclose(frame.radiance, 1.0, rtol=0.01, err_msg=f"{angle_deg}")


def test_coloured_glass_reflects_behind_its_colour(renderer: Renderer) -> None:
    """White surroundings and a pane that keeps a of the light on one way through: its nearer face reflects F,
    the farther one (1 - F)^2 a^2 F, and (1 - F)^2 a passes; the last two over 1 - a^2 F^2, for the echoes."""
    colour, fresnel = np.array((0.9, 0.5, 0.1)), 0.04
    pane = Drawable(grid(3.0), STILL, (replace(plain((0.9, 0.5, 0.1), roughness=20), transmission=1.0),), 0)
    wall = lambertian(grid(60.0), ONE, at=replace(STILL, position_m=(0.0, 0.0, -2.0)), object_id=1)
    shown = draw(renderer, view(wall, pane, ambient=1.0, camera=SMALL)).radiance[16, 16]
    inside = (1 - fresnel) ** 2 * colour * (colour * fresnel + 1) / (1 - (colour * fresnel) ** 2)
    np.testing.assert_allclose(shown, fresnel + inside, rtol=0.01)


def test_glass_bends_rays_at_a_slant(renderer: Renderer) -> None:
    """Through a thick slanted pane the edge of a stripe is seen elsewhere."""
    glass = replace(plain(ONE, roughness=20), transmission=1.0)
    stripe = lambertian(
        grid(0.3), (0.9, 0.9, 0.9), at=Transform((0.0, 0.0, 0.001), (0, 0, 0), ONE), object_id=2
    )
    floor = lambertian(grid(6.0), (0.05, 0.05, 0.05))
    pane = Drawable(block((1.0, 1.0, 0.3)), Transform((0.0, 0.0, 0.7), (0.0, 35.0, 0.0), ONE), (glass,), 1)
    lights = (sun((0.0, 0.0, -1.0)),)
    plain_view = draw(renderer, view(floor, stripe, lights=lights)).radiance[48, :, 0]
    through = draw(renderer, view(floor, stripe, pane, lights=lights)).radiance[48, :, 0]
    bright = [np.flatnonzero(row > 0.6 * row[30:66].max()) for row in (plain_view, through)]
    assert abs(bright[0].mean() - bright[1].mean()) > 0.5


@pytest.mark.parametrize(("height_m", "scale"), [(0.3, (-1.0, 1.0, 1.0)), (0.1, (1.0, 1.0, 3.0))])
def test_scaled_glass_bends_rays_as_what_it_becomes(
    renderer: Renderer, height_m: float, scale: tuple[float, float, float]
) -> None:
    """Mirrored, or stretched upwards: it looks as the block that is so from the start."""
    camera = Camera((0.6, -1.2, 0.9), (0.0, 0.0, 0.2), (0.0, 0.0, 1.0), 45.0, 64, 48)
    clear = replace(plain(ONE, roughness=20), transmission=1.0)
    stripe = lambertian(
        grid(0.1), (0.9, 0.1, 0.1), at=replace(STILL, position_m=(-0.1, 0.2, 0.001)), object_id=2
    )
    images = []
    for mesh, at in (
        (block((0.5, 0.5, 0.3)), STILL),
        (block((0.5, 0.5, height_m)), replace(STILL, scale=scale)),
    ):
        what = view(
            lambertian(grid(6.0)), stripe, Drawable(mesh, at, (clear,), 1), ambient=1.0, camera=camera
        )
        images.append(draw(renderer, what).radiance)
    np.testing.assert_allclose(images[1], images[0], atol=0.02)


def test_edges_against_the_sky_have_no_outlines_behind_glass(renderer: Renderer) -> None:
    """Blue and red posts before the sky, moved by a slanted pane: no single pixel between one colour and the
    next has a third one."""
    camera = Camera((0.0, -2.0, 0.5), (0.0, 0.0, 0.5), (0.0, 0.0, 1.0), 30.0, 96, 32)
    clear = replace(plain(ONE, roughness=20), transmission=1.0)
    slanted = Transform((0.0, -1.0, -0.5), (0.0, 0.0, 40.0), ONE)
    red, blue = (0.6, 0.05, 0.05), (0.05, 0.05, 0.6)
    posts = [
        lambertian(block((width_m, 0.05, 2.0)), colour, at=replace(STILL, position_m=(x_m, 0.5, -0.5)))
        for x_m, width_m, colour in ((0.0, 0.6, blue), (-0.42, 0.1, red), (0.42, 0.1, red))
    ]
    pane = Drawable(block((2.0, 0.6, 2.0)), slanted, (clear,), 1)
    what = view(*posts, pane, ambient=0.5, camera=camera)
    radiance = draw(renderer, replace(what, sky=Sky("procedural", (0.5, 0.5, 0.5)))).radiance
    redness = radiance[..., 0] / radiance.sum(-1)
    assert np.ptp(redness) > 0.5
    steps = np.diff(redness, axis=1)
    assert (-steps[:, :-1] * steps[:, 1:] < 0.05**2).all()


def test_sampled_scenes_are_finite_and_without_fireflies(renderer: Renderer) -> None:
    """No pixel outshines the brightest of its 24 neighbours fifty times."""
    for seed in (21,):
        frame = renderer.render(sample(SceneConfig(objects=(10, 14)), seed, width=160, height=90))
        for array in (frame.radiance, frame.albedo, frame.normal):
            assert np.isfinite(array).all()
        assert frame.radiance.min() >= 0
        luminance = frame.radiance.mean(-1)
        windows = np.lib.stride_tricks.sliding_window_view(luminance, (5, 5)).reshape(86, 156, 25)
        others = np.delete(windows, 12, axis=-1).max(-1)
        assert (luminance[2:-2, 2:-2] < 50 * others + 0.05 * luminance.mean()).all()


WALLS = ("wall_east", "wall_west", "wall_north", "wall_south")


def simple_scene(**light: object):
    scene = sample(SceneConfig(objects=(1, 1)), 0, width=32, height=32)
    return replace(scene, lights=(replace(point_light((0.0, 0.0, 1.0)), **light),))


@pytest.mark.parametrize(
    ("light", "message"),
    [
        ({"kind": "laser"}, r"lights\[0\].kind 'laser'"),
        ({"kind": "area"}, r"lights\[0\].size_m"),
        ({"kind": "sun", "direction": (0.0, 0.0, 0.0)}, r"lights\[0\].direction"),
        ({"colour": (1.0, -1.0, 1.0)}, r"lights\[0\].colour"),
        ({"radius_m": -0.1}, r"lights\[0\].radius_m"),
        ({"kind": "spot", "cone_deg": 0.0}, r"lights\[0\].cone_deg"),
    ],
)
def test_a_light_that_makes_no_sense_is_named(light: dict, message: str) -> None:
    with pytest.raises(FsidError, match=message):
        view_of(simple_scene(**light), 0)


@pytest.mark.parametrize(
    "value",
    [
        {"clearcoat": 1.5},
        {"sheen": -0.1},
        {"translucency": 2.0},
        {"transmission": 1.1},
        {"emission": -1.0},
        {"colours": ((0.5, -0.5, 0.5),) * 3},
    ],
)
def test_a_material_that_gives_back_more_than_it_gets_is_named(value: dict) -> None:
    """Or takes light from what lies around it: radiance was below 0."""
    scene = simple_scene()
    scene = replace(
        scene, materials=tuple(tuple(replace(m, **value) for m in parts) for parts in scene.materials)
    )
    with pytest.raises(FsidError, match=rf"materials\[0\]\[0\].{next(iter(value))}"):
        view_of(scene, 0)


def test_ambient_light_below_zero_is_named() -> None:
    with pytest.raises(FsidError, match=r"scene.ambient"):
        view_of(replace(simple_scene(), ambient=(-1.0, 0.0, 0.0)), 0)


def test_as_many_lights_as_one_likes_shine(renderer: Renderer) -> None:
    """Forty in one place are one of forty times the strength, shadows too; far too many are refused."""
    ball = lambertian(sphere(0.2, 24), at=Transform((0.0, 0.0, 0.5), (0.0, 0.0, 0.0), ONE), object_id=1)
    things = (lambertian(grid(4.0)), ball)
    one = point_light((0.3, 0.2, 1.5), 4.0, radius_m=0.05)
    fortieth = replace(one, colour=(0.1, 0.1, 0.1))
    alone = draw(renderer, view(*things, lights=(one,), camera=SMALL)).radiance
    many = draw(renderer, view(*things, lights=(fortieth,) * 40, camera=SMALL)).radiance
    np.testing.assert_allclose(many, alone, atol=0.1 * alone.max())
    assert np.abs(many - alone).mean() < 0.005 * alone.mean()
    with pytest.raises(FsidError, match=r"scene.lights: 300 lights"):
        draw(renderer, view(*things, lights=(fortieth,) * 300, camera=SMALL))


def test_a_sky_above_a_closed_room_is_refused() -> None:
    room = Background("room", (3.0, 3.0, 2.5), dict.fromkeys(("floor", "ceiling", *WALLS), plain()))
    scene = replace(simple_scene(), background=room, sky=Sky("procedural", ONE))
    with pytest.raises(FsidError, match=r"scene\.sky: a closed 'room'"):
        view_of(scene, 0)
    assert view_of(replace(scene, sky=None), 0).sky is None


def test_the_sampler_gives_a_sky_to_open_air_alone() -> None:
    config = SceneConfig(objects=(1, 1))
    scenes = [sample(config, seed, width=32, height=32) for seed in range(24)]
    assert {scene.background.kind == "open-air" for scene in scenes} == {False, True}
    assert all((scene.sky is not None) == (scene.background.kind == "open-air") for scene in scenes)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.hdr", b"nothing", "no complete Radiance"),
        ("b.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16 +X 32\n" + bytes(99), "no complete Radiance"),
        ("c.hdr", b"#?RADIANCE\n\n-Y 16 +X 16\n" + bytes(16 * 16 * 4), "equirectangular"),
        ("d.exr", b"\x76\x2f\x31\x01", r"d\.exr: is truncated"),
        (
            "e.hdr",
            b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16 +X 32\n" + bytes(8 * 32 * 4) + b"@@@\x81" * 8 * 32,
            r"e\.hdr: its upper half is black",
        ),
    ],
)
def test_a_broken_sky_is_named(tmp_path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(FsidError, match=message):
        panorama(Sky(f"file:{tmp_path / name}", ONE))


def test_a_sky_of_a_file_is_read_and_scaled(tmp_path) -> None:
    pixels = np.full((16, 32, 4), (128, 64, 32, 129), np.uint8)
    path = tmp_path / "sky.hdr"
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16 +X 32\n" + pixels.tobytes())
    picture = panorama(Sky(f"file:{path}", (1.0, 1.0, 1.0)))
    assert picture.shape == (16, 32, 3)
    np.testing.assert_allclose(picture[3, 3] / picture[3, 3, 0], (1.0, 0.5, 0.25), rtol=1e-5)


def rle(channel: np.ndarray) -> bytes:
    """A row of one channel, run-length coded as Ward's Radiance writes it: 128 + n, value or n, values."""
    out, x = b"", 0
    while x < len(channel):
        stop = x + 1
        while stop < min(len(channel), x + 127) and channel[stop] == channel[x]:
            stop += 1
        if stop > x + 2:
            out += bytes([128 + stop - x, channel[x]])
        else:
            stop = x + min(128, len(channel) - x)  # the longest literal, of repetitions too
            starts = [i for i in range(x + 1, stop - 3) if len(set(channel[i : i + 4])) == 1]
            stop = starts[0] if starts else stop
            out += bytes([stop - x]) + channel[x:stop].tobytes()
        x = stop
    return out


def test_a_run_length_coded_sky_is_decoded(tmp_path) -> None:
    """m 2^(e - 136) of every texel, none where e is 0; scaled to the mean luminance of the upper half."""
    rng = np.random.default_rng(0)
    rgbe = np.repeat(rng.integers(1, 256, (150, 100, 4)), 3, axis=1).astype(np.uint8)
    rgbe[:, 60:] = rng.integers(1, 256, (150, 240, 4))
    rgbe[::2, 100:] = 77  # longer than a run can be
    rgbe[..., 3] = 120 + rgbe[..., 3] % 16
    rgbe[5, 7:20, 3] = 0
    rows = [b"\2\2" + (300).to_bytes(2) + b"".join(rle(row[:, i]) for i in range(4)) for row in rgbe]
    assert len(b"".join(rows)) < 0.8 * rgbe.size
    path = tmp_path / "sky.hdr"
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 150 +X 300\n" + b"".join(rows))
    found = panorama(Sky(f"file:{path}", (0.7, 0.7, 0.7)))
    light = rgbe[:, ::-1, :3] * 2.0 ** (rgbe[:, ::-1, 3:].astype(float) - 136) * (rgbe[:, ::-1, 3:] > 0)
    share = np.cos((np.arange(75) + 0.5) / 150 * np.pi - np.pi / 2)[:, None, None]
    mean = (light[:75] * share).sum((0, 1)) @ (0.2126, 0.7152, 0.0722) / (share.sum() * 300)
    np.testing.assert_allclose(found, 0.7 * light / mean, rtol=2e-3)


@pytest.mark.parametrize("changed", ["time", "size"])
def test_a_sky_that_was_changed_is_read_again(tmp_path, changed: str) -> None:
    path = tmp_path / "sky.hdr"
    found = []
    for first, height in ((64, 16), (255, 16 if changed == "time" else 32)):
        pixels = np.full((height, 2 * height, 4), (64, 64, 64, 129), np.uint8)
        pixels[2, :, 0] = first
        head = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {2 * height}\n"
        path.write_bytes(head.encode() + pixels.tobytes())
        os.utime(path, (1e9, 1e9 + 60 * (changed == "time") * len(found)))
        found.append(panorama(Sky(f"file:{path}", ONE)))
    assert found[0][2, 0, 0] < 1.1 < found[1][2, 0, 0]


def test_a_sky_with_a_sun_gives_light_and_one_that_is_infinite_is_named(tmp_path) -> None:
    light = np.ones((16, 32, 3), np.float32)
    light[4, 3] = 1e4
    write_exr(tmp_path / "sun.exr", light)
    assert panorama(Sky(f"file:{tmp_path / 'sun.exr'}", ONE)).max() > 100
    light[4, 3] = np.inf
    write_exr(tmp_path / "sun.exr", light)
    with pytest.raises(FsidError, match=r"sun\.exr: holds NaN or infinite values"):
        panorama(Sky(f"file:{tmp_path / 'sun.exr'}", ONE))


def test_a_large_sky_is_averaged_and_read_once(tmp_path, monkeypatch) -> None:
    """To whole cells that tile it, and again where the file has changed."""
    monkeypatch.setattr(fsid.render.sky, "MOST_HEIGHT", 32)
    light = np.random.default_rng(0).uniform(0.5, 2, (64, 128, 3)).astype(np.float32)
    path = tmp_path / "sky.exr"
    sky = Sky(f"file:{path}", ONE)
    write_exr(path, light)
    found = panorama(sky)
    expected = light.reshape(32, 2, 64, 2, 3).mean((1, 3))[:, ::-1]
    np.testing.assert_allclose(found / found[3, 3], expected / expected[3, 3], rtol=1e-5)
    with monkeypatch.context() as patch:
        patch.setattr(fsid.render.sky, "_read_exr", None)
        np.testing.assert_array_equal(panorama(replace(sky, azimuth_deg=360.0)), found)
    write_exr(path, np.ones((70, 140, 3), np.float32))
    assert panorama(sky).shape == (23, 46, 3)


def test_the_size_of_an_exr_sky_is_checked_before_it_is_decoded(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(fsid.assets.skies, "_MOST_HEIGHT_PX", 16)
    monkeypatch.setattr(fsid.render.sky, "_equirectangular", None)
    write_exr(tmp_path / "sky.exr", np.ones((17, 34, 3), np.float32))
    with pytest.raises(FsidError, match="34 x 17 pixels are more than 32 x 16"):
        panorama(Sky(f"file:{tmp_path / 'sky.exr'}", ONE))


def test_an_exr_sky_with_channels_that_would_fill_memory_is_left_out(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(fsid.assets.skies, "_MOST_EXR_VALUES", 4 * 32 * 16)
    write_exr(tmp_path / "sky.exr", np.ones((16, 32, 5), np.float32), "RGBAZ")
    with pytest.raises(FsidError, match="2,560 values in all its channels and parts; keep R, G and B alone"):
        survey_skies(str(tmp_path))


def write_exr(path, light: np.ndarray, names: str = "RGB") -> None:
    import OpenEXR

    channels = {c: np.ascontiguousarray(light[..., i]) for i, c in enumerate(names)}
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, channels) as file:
        file.write(str(path))


def test_channels_of_an_exr_sky_may_differ_in_precision_and_dip_below_zero(tmp_path) -> None:
    import OpenEXR

    light = np.random.default_rng(0).uniform(0.5, 2, (16, 32, 3)).astype(np.float16)
    skies = []
    for name, low in (("even", 0.0), ("odd", -0.01)):
        light[2, 3] = low
        channels = {c: np.ascontiguousarray(light[..., i]) for i, c in enumerate("RGB")}
        channels |= {"G": channels["G"].astype(np.float32)} if name == "odd" else {}
        with OpenEXR.File({"type": OpenEXR.scanlineimage}, channels) as file:
            file.write(str(tmp_path / f"{name}.exr"))
        skies.append(panorama(Sky(f"file:{tmp_path / name}.exr", ONE)))
    np.testing.assert_array_equal(*skies)
    assert skies[0].min() == 0


def test_a_sky_in_another_colour_space_is_refused(tmp_path) -> None:
    path = tmp_path / "sky.hdr"
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 16 +X 32\n" + bytes([128]) * (16 * 32 * 4))
    with pytest.raises(FsidError, match="holds CIE XYZ"):
        panorama(Sky(f"file:{path}", ONE))
    with pytest.raises(FsidError, match=r"no panorama.*R, G and B"):
        survey_skies(str(tmp_path))


def test_a_background_without_a_material_is_named() -> None:
    with pytest.raises(FsidError, match="'ceiling' is missing"):
        background_drawable(
            Background(
                "room",
                (3.0, 3.0, 2.5),
                dict.fromkeys(WALLS, plain()),
            )
        )


@pytest.mark.parametrize("cloudiness", [0.0, 0.7])
def test_a_matt_surface_has_the_light_of_all_the_sky_above_it(renderer: Renderer, cloudiness: float) -> None:
    """L = albedo / pi * integral of the sky's radiance times cos(theta), however the surface is tilted."""
    sky = Sky("procedural", (0.3, 0.4, 0.7), seed=5, cloudiness=cloudiness)
    what = replace(view(lambertian(sphere(0.3))), sky=sky)
    frame = draw(renderer, what)
    on = (frame.object_id == 0) & (frame.normal[..., 2] > 0.15)  # without the outline
    normals = frame.normal[on].astype(float)  # from above, camera space is the world's
    picture = panorama(sky)[::4, ::4]
    elevation, azimuth = angles(len(picture))
    up, around = np.meshgrid(elevation, azimuth, indexing="ij")
    towards = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], -1)
    power = picture * (np.cos(up) * (np.pi / len(picture)) ** 2)[..., None]
    cosines = np.maximum(normals[::7] @ towards.reshape(-1, 3).T, 0.0)
    error = frame.radiance[on][::7] / (0.5 / np.pi * cosines @ power.reshape(-1, 3)) - 1
    assert np.abs(error).mean() < 0.03


def test_a_matt_surface_has_the_light_of_all_walls_before_it(renderer: Renderer) -> None:
    """L = albedo times the mean of what walls mirror of even light over the half space, by cos(theta)."""
    albedo, half = np.array([0.7, 0.1, 0.5, 0.2, 0.4, 0.8]), np.array([1.5, 2.5, 1.3])
    room = replace(
        view(lambertian(sphere(0.3)), ambient=0.3),
        room_size_m=tuple(2 * half),
        room_floor_m=-half[2] / 2,
        room_materials=tuple(plain((grey,) * 3) for grey in albedo),
    )
    frame = draw(renderer, room)
    on = minimum_filter(frame.object_id == 0, 3)  # without the outline
    normals = np.concatenate([frame.normal[on].astype(float)[::7], np.eye(3), -np.eye(3)])
    i = np.arange(20000) + 0.5
    z, turn = 1 - i / 10000, i * np.pi * (3 - np.sqrt(5))
    rays = np.stack([np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], -1)
    reach = (np.sign(rays) * half - (0.0, 0.0, -half[2] / 2)) / rays
    axis = reach.argmin(-1)
    seen = albedo[2 * axis + (rays[np.arange(len(rays)), axis] < 0)]
    arrives = np.maximum(normals @ rays.T, 0.0) @ seen
    expected = 0.5 * 0.3 * arrives[:-6] / arrives[-6:].mean()
    error = frame.radiance[on][::7, 1] / expected - 1
    assert np.abs(error).mean() < 0.06


@pytest.mark.parametrize(("rows", "turn"), [(512, 0), (512, 7), (512, 200), (333, 1), (1500, 750)])
def test_the_sun_in_a_picture_of_the_sky_gives_all_its_light(rows: int, turn: int) -> None:
    """One texel of irradiance 3 wherever it lies: E max(cos, 0) / pi towards each axis, besides the grey."""
    picture, row = np.full((rows, 2 * rows, 3), 0.2, np.float32), rows // 4
    elevation, azimuth = angles(rows)
    picture[row, turn] += 3.0 / (np.cos(elevation[row]) * (np.pi / rows) ** 2)
    up, around = elevation[row], azimuth[turn]
    to_sun = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
    expected = 0.2 + 3.0 * np.maximum(np.array([1, -1]) * to_sun[:, None], 0.0).ravel() / np.pi
    np.testing.assert_allclose(light_sky(picture).ambient[:, 1], expected, atol=0.025)


def test_the_sun_in_a_picture_of_the_sky_is_a_sun(renderer: Renderer) -> None:
    """A grey sky with an even disc of irradiance 3 in it lights and shades as the grey sky and a `Light`, and
    is mirrored once."""
    elevation, azimuth = angles(512)
    up, around = np.meshgrid(elevation, azimuth, indexing="ij")
    towards = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], -1)
    to_sun = np.array((0.48, 0.6, 0.64))
    disc = (towards @ to_sun > np.cos(0.02)) * np.cos(up) * (np.pi / 512) ** 2
    grey = np.full((512, 1024, 3), 0.2, np.float32)
    with_sun = grey + np.where(disc > 0, 3.0 / disc.sum(), 0.0)[..., None].astype(np.float32)
    light = Light("sun", ZERO, tuple(-to_sun), (3.0,) * 3, 0.02, 0.0)
    ball = lambertian(sphere(0.2), at=replace(STILL, position_m=(-0.1, 0.3, 0.2)), object_id=1)
    metal = plain(ONE, roughness=20, family="metal")
    mirror = Drawable(grid(0.8), Transform((0.0, -0.5, 0.3), (-48.0, 0.0, -8.4), ONE), (metal,), 2)
    camera = Camera((-0.7, 1.4, 1.8), (0.0, 0.0, 0.2), (0.0, 0.0, 1.0), 50.0, 96, 96)
    what = replace(view(lambertian(grid(8.0)), ball, mirror, camera=camera), sky=Sky("procedural", ONE))
    images = []
    for picture, lights in ((grey, (light,)), (with_sun, ())):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("fsid.render.stage.panorama", lambda sky, kept=picture: kept)
            images.append(draw(renderer, replace(what, lights=lights)))
    mirrored = images[0].object_id == 2
    expected, found = (image.radiance[..., 1] for image in images)
    bright = expected[~mirrored].max()
    assert bright > 4 * expected[~mirrored].min()
    assert (np.abs(found - expected)[~mirrored] < 0.01 * bright).mean() > 0.995  # all but outlines of shadows
    assert expected[mirrored].max() > 20 * bright
    np.testing.assert_allclose(found[mirrored].sum(), expected[mirrored].sum(), rtol=0.03)


TO_SUN = np.array((0.48, 0.6, 0.64))


def sky_of(*places: tuple[np.ndarray, float, Vec3]) -> tuple[np.ndarray, list[np.ndarray]]:
    """A grey sky with even discs: towards, radius and irradiance; and where each is (H, 2 H)."""
    elevation, azimuth = angles(512)
    up, around = np.meshgrid(elevation, azimuth, indexing="ij")
    towards = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], -1)
    picture, discs = np.full((512, 1024, 3), 0.2), []
    for place, radius, irradiance in places:
        discs.append(towards @ place > np.cos(radius))
        size = (discs[-1] * np.cos(up)).sum() * (np.pi / 512) ** 2
        picture[discs[-1]] += np.array(irradiance) / size
    return picture.astype(np.float32), discs


def test_what_is_brighter_than_ten_times_the_mean_around_the_brightest_place_is_the_sun() -> None:
    """Its excess is the light's, in its direction and of its size; all else stays in the sky: what is 10
    degrees beside it, what is below the horizon, and what is left of it."""
    beside = np.array((0.48, 0.4, 0.64)) / np.linalg.norm((0.48, 0.4, 0.64))
    below = np.array((0.6, 0.0, -0.8))
    picture, discs = sky_of(
        (TO_SUN, 0.03, (3.0, 2.0, 0.0)), (beside, 0.02, (0.3,) * 3), (below, 0.03, (9.0,) * 3)
    )
    before = picture.copy()
    light, rest = part_sun(picture)
    np.testing.assert_array_equal(picture, before)
    assert light is not None
    most = 10 * picture.mean()
    size = np.pi * 0.03**2
    np.testing.assert_allclose(light.colour, (3 + (0.2 - most) * size, 2 + (0.2 - most) * size, 0), atol=0.02)
    np.testing.assert_allclose(light.direction, -TO_SUN, atol=1e-3)
    assert np.linalg.norm(light.direction) == pytest.approx(1)
    assert light.radius_m == pytest.approx(0.03, rel=0.03)
    sun_disc, *others = discs
    np.testing.assert_allclose(rest[sun_disc], np.minimum(picture[sun_disc], most), rtol=1e-5)
    np.testing.assert_array_equal(rest[~sun_disc], picture[~sun_disc])
    assert all((picture[disc] > most).any() for disc in others)


@pytest.mark.parametrize(
    ("radius", "irradiance", "is_sun"), [(0.02, 0.1, True), (0.006, 0.02, False), (0.5, 0.7, False)]
)
def test_neither_a_star_nor_a_bright_cloud_is_a_sun(radius: float, irradiance: float, is_sun: bool) -> None:
    """A light is worth a shadow from a twentieth of pi times the mean on, 0.03 here, and if it is 10 times
    as bright as the mean."""
    picture, _ = sky_of((TO_SUN, radius, (irradiance,) * 3))
    light, rest = part_sun(picture)
    assert (light is not None) == is_sun
    assert is_sun or rest is picture


def test_walls_shine_as_they_are_lit() -> None:
    """Albedo times (E / pi + ambient), and their own light, at the middles of 16 x 16 cells of each side: no
    nearer to a bulb than its surface, of a spot all within 0.8 of its half angle, of the sun nothing."""
    size, floor_m, ambient = np.array([3.0, 4.0, 2.5]), -0.75, np.array([0.1, 0.2, 0.3])
    albedo = np.linspace(0.1, 0.8, 18).reshape(6, 3)
    glow = np.linspace(0.5, 0.0, 18).reshape(6, 3)
    bulb = Light("point", (1.3, -0.7, 0.9), (0.0, 0.0, -1.0), (2.0, 3.0, 4.0), 0.3, 360.0)
    spot = Light("spot", (0.1, 0.3, 0.4), (0.6, 0.0, -0.8), (4.0, 2.0, 3.0), 0.05, 80.0)
    lamp = panel((-0.5, 0.6, 1.2), (0.0, -0.6, -0.8), (0.4, 0.3), 5.0)
    room = light_room(
        tuple(size), floor_m, albedo, glow, (bulb, lamp, spot, sun((0.0, 0.0, -1.0))), tuple(ambient)
    )
    t = (np.arange(16) + 0.5) / 16 - 0.5
    ahead = np.array(lamp.direction)
    for side in range(6):
        axis, sign = side // 2, 1 - 2 * (side % 2)
        points = np.zeros((16, 16, 3))
        points[..., axis] = sign / 2
        points[..., (axis + 1) % 3] = t
        points[..., (axis + 2) % 3] = t[:, None]
        points = points * size + (0, 0, floor_m + size[2] / 2)
        total = np.zeros((16, 16, 3))
        for light in (bulb, lamp, spot):
            to = np.array(light.position_m) - points
            distance = np.maximum(np.linalg.norm(to, axis=-1), light.radius_m)
            share = np.maximum(-sign * to[..., axis] / distance, 0)
            if light is lamp:
                share *= 0.12 * np.maximum(-to @ ahead / distance, 0) / (distance**2 + 0.12 / np.pi)
            else:
                share /= distance**2
            if light is spot:
                outer, inner = np.cos(np.radians((40, 32)))
                edge = np.clip((-to @ light.direction / distance - outer) / (inner - outer), 0, 1)
                share *= 3 * edge**2 - 2 * edge**3
            total += share[..., None] * light.colour
        np.testing.assert_allclose(room.radiance[side], albedo[side] * (total / np.pi + ambient) + glow[side])


def test_ambient_light_of_a_room_is_as_stated_on_average_and_what_its_walls_give_besides() -> None:
    """Alike from all sides where these are, by what is on each where not, and more from a near floor."""
    size, ambient = (3.0, 4.0, 2.5), (0.1, 0.2, 0.3)
    none, grey, luminance = np.zeros((6, 3)), np.full((6, 3), 0.4), np.array((0.2126, 0.7152, 0.0722))
    np.testing.assert_allclose(light_room(size, 0.0, grey, none, (), ambient).ambient, [ambient] * 6)
    np.testing.assert_allclose(light_room(size, 0.0, none, grey, (), ambient).ambient, np.add(ambient, grey))
    uneven = np.linspace(0.1, 0.8, 6)[:, None] * np.ones(3)
    found = light_room(size, 0.0, uneven, none, (), ambient).ambient
    assert (found @ luminance).mean() == pytest.approx(np.dot(ambient, luminance))
    for even in (0, 2, 4):
        assert found[even, 0] < found[even + 1, 0]  # towards the darker side and the lighter one
    shining = {side: np.arange(6)[:, None] == [[side] * 3] for side in (4, 5)}  # ceiling, floor
    sideways = {
        side: light_room(size, 0.0, none, 1.0 * glow, (), (0.0,) * 3).ambient[:4].mean()
        for side, glow in shining.items()
    }
    assert sideways[5] > 1.5 * sideways[4] > 0


@pytest.mark.parametrize("lamp", [0.0, 5.0, 50.0])
def test_a_sky_gives_each_axis_the_light_of_its_half(lamp: float) -> None:
    """E / pi by summing texels: of a slope around the horizon, of stripes finer than the grid, of a disc
    brighter than what is looked up, and of a thousand lamps of one texel, as of a town at night."""
    picture, _ = sky_of((TO_SUN, 0.2, (0.3, 0.2, 0.1)))
    elevation, azimuth = angles(len(picture))
    picture *= (1 + 0.5 * np.cos(azimuth - 1))[:, None].astype(np.float32)
    picture[::2] *= 1.5
    picture[1::2] *= 0.5
    picture[:, ::2] *= 0.7
    picture[:, 1::2] *= 1.3
    up, around = np.meshgrid(elevation, azimuth, indexing="ij")
    picture[np.random.default_rng(0).random(up.shape) < 0.003 * np.cos(up)] += np.float32(lamp)
    assert picture.max() > 15 * picture.mean()
    towards = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], -1)
    solid = np.cos(up) * (np.pi / len(picture)) ** 2
    found = light_sky(picture).ambient
    for side in range(6):
        cosine = np.maximum((1 - 2 * (side % 2)) * towards[..., side // 2], 0)
        wanted = (picture * (cosine * solid)[..., None]).sum((0, 1)) / np.pi
        np.testing.assert_allclose(found[side], wanted, rtol=0.02)


def parallel_share(a: float, b: float, h: float) -> float:
    """Of the light on a surface, what a rectangle 2 a by 2 b gives that faces it in a distance h."""
    a, b = a / h, b / h
    p, q = np.sqrt(1 + a * a), np.sqrt(1 + b * b)
    return float(2 / np.pi * (a / p * np.arctan(b / p) + b / q * np.arctan(a / q)))


def test_each_side_of_a_room_gives_ambient_light_by_its_form_factor() -> None:
    """Low in the middle, at a quarter of the height; towards each axis the six shares are all."""
    x, y, z = size = (3.0, 4.0, 2.5)
    none = np.zeros((6, 3))
    glow = np.eye(6)[:, :, None] * np.ones(3)
    shares = np.stack([light_room(size, 0.0, none, each, (), ZERO).ambient[:, 1] for each in glow], axis=1)
    np.testing.assert_allclose(shares.sum(1), 1)
    assert shares[4, 4] == pytest.approx(parallel_share(x / 2, y / 2, 0.75 * z), rel=2e-3)
    assert shares[5, 5] == pytest.approx(parallel_share(x / 2, y / 2, 0.25 * z), rel=2e-3)
    for side, away, aside in ((0, x / 2, y / 2), (2, y / 2, x / 2)):
        parts = [parallel_share(aside, share * z, away) / 2 for share in (0.25, 0.75)]
        assert shares[side, side] == pytest.approx(sum(parts), rel=2e-3)
        assert shares[side + 1, side + 1] == pytest.approx(sum(parts), rel=2e-3)
    assert shares[0, 1] == shares[4, 5] == 0


def test_ambient_light_comes_from_walls_of_their_mean_radiance() -> None:
    """As these are lit and shine, it has the luminance of `ambient` on average; what they shine is added."""
    size, ambient = (3.0, 4.0, 2.5), (0.2, 0.2, 0.2)
    albedo = np.linspace(0.1, 0.8, 6)[:, None] * np.ones(3)
    glow = np.array([0.0, 0.5, 0.0, 0.0, 0.3, 0.0])[:, None] * np.ones(3)
    lamp = point_light((0.4, -0.7, 1.5), intensity=6.0)
    room = light_room(size, 0.0, albedo, glow, (lamp,), ambient)
    dark = np.zeros((6, 3))
    shares = np.stack(
        [
            light_room(size, 0.0, dark, each, (), ZERO).ambient[:, 1]
            for each in np.eye(6)[:, :, None] * np.ones(3)
        ],
        axis=1,
    )
    from_walls = shares @ room.radiance.mean((1, 2))
    wanted = 0.2 * from_walls / from_walls.mean() + shares @ glow
    np.testing.assert_allclose(room.ambient, wanted, rtol=1e-5)


def test_the_twelve_strongest_lamps_shine_strongest_first() -> None:
    """Of radiance L and surface A the intensity L A / 4, at the middle, as large as it is, all around alike;
    what shines of the background is none of them."""
    strength = [3.0, 14.0, 1.0, 9.0, 4.0, 12.0, 7.0, 2.0, 11.0, 5.0, 8.0, 10.0, 6.0, 13.0]
    ball = moved(sphere(0.1, 24), (0.0, 0.0, 0.5))
    lamps = [
        Drawable(
            ball,
            Transform((float(i), 0.0, 1.0), (90.0, 0.0, 0.0), (2.0, 2.0, 2.0)),
            (replace(plain((0.8, 0.4, 0.2)), emission=emission),),
            i if emission < 14 else BACKGROUND_ID,
        )
        for i, emission in enumerate(strength)
    ]
    found = lamps_of(hoods_apart(lamps), lambda material: np.array(material.colours[0]), 0.0)
    wanted = sorted((emission for emission in strength if emission < 14), reverse=True)[:12]
    area = 4 * np.pi * 0.2**2
    for source, emission in zip(found, wanted, strict=True):
        light, i = source.light, strength.index(emission)
        rotation, position = lamps[i].pose(0.0)
        assert source.lamp == i
        assert light.kind == "point"
        np.testing.assert_allclose(light.position_m, rotation @ (0, 0, 1.0) + position, atol=1e-3)
        np.testing.assert_allclose(light.colour, np.array((0.8, 0.4, 0.2)) * emission * area / 4, rtol=0.02)
        assert light.radius_m == pytest.approx(0.2, rel=0.01)
        np.testing.assert_allclose(source.shape, np.eye(3), atol=0.03)


def lamps_in(*drawables: Drawable) -> list[Source]:
    return lamps_of(hoods_apart(drawables), lambda material: np.array(material.colours[0]), 0.0)


GLOWING = replace(plain((0.8, 0.4, 0.2)), emission=5.0)
ASKEW = Transform((0.3, -0.2, 1.0), (20.0, 50.0, 30.0), ONE)


def in_one_part(*meshes: Mesh) -> Mesh:
    mesh = joined(*meshes)
    return replace(mesh, face_parts=np.zeros_like(mesh.face_parts), part_names=("part 0",))


def test_a_shining_ellipsoid_gives_its_shadow_s_area_in_every_direction() -> None:
    """I(u) = L pi sqrt((b c u_x)^2 + (c a u_y)^2 + (a b u_z)^2) of half axes a, b, c, along its own axes."""
    a, b, c = half_axes = np.array((0.25, 0.05, 0.1))
    own = Drawable(sphere(1.0, 2), replace(ASKEW, rotation_deg=(-35.0, 25.0, 60.0)), (GLOWING,), 1).pose(0.0)[
        0
    ]
    ball = sphere(1.0, 24)
    mesh = replace(ball, vertices=(ball.vertices * half_axes @ own.T + (0.0, 0.1, 0.0)).astype(np.float32))
    lamp = Drawable(mesh, replace(ASKEW, scale=(2.0, 2.0, 2.0)), (GLOWING,), 1)
    (source,) = lamps_in(lamp)
    rotation, position = lamp.pose(0.0)
    np.testing.assert_allclose(source.light.position_m, position + 0.2 * rotation[:, 1], atol=1e-4)
    for u in np.random.default_rng(0).normal(size=(50, 3)):
        u /= np.linalg.norm(u)
        expected = 4 * np.pi * np.linalg.norm((b * c, c * a, a * b) * (own.T @ rotation.T @ u))
        found = np.sqrt(u @ source.shape @ u) * np.array(source.light.colour)
        np.testing.assert_allclose(found, expected * np.array((4.0, 2.0, 1.0)), rtol=0.03)


@pytest.mark.parametrize(
    ("meshes", "area", "height_m"),
    [
        ([sphere(0.1, 48)], 4 * np.pi * 0.01, 0.0),
        ([sphere(0.1, 48), sphere(0.095, 48)], 4 * np.pi * 0.01, 0.0),  # hollow: what is inside is not seen
        ([sphere(0.1, 48), moved(sphere(0.1, 12), (0.0, 0.0, 0.6))], 8 * np.pi * 0.01, 0.3),  # two bulbs
        ([block((0.2, 0.2, 0.1))], 0.16, 0.05),
        ("a dome", 3 * np.pi * 0.01, 0.05),  # its opening shines
    ],
    ids=["ball", "hollow", "two", "block", "dome"],
)
def test_a_lamp_is_as_large_as_what_is_seen_of_it(meshes: list[Mesh], area: float, height_m: float) -> None:
    """Its mean intensity is L A / 4, and its light a sphere of that surface in its middle."""
    mesh = in_one_part(*(meshes if isinstance(meshes, list) else [sphere(0.1, 48)]))
    if meshes == "a dome":
        mesh = replace(mesh, faces=mesh.faces[(mesh.vertices[mesh.faces][..., 2] > -2e-3).all(1)])
        mesh = replace(mesh, face_parts=np.zeros(len(mesh.faces), np.int32))
    (source,) = lamps_in(Drawable(mesh, replace(ASKEW, scale=(2.0, 2.0, 2.0)), (GLOWING, GLOWING), 1))
    rotation, position = Drawable(mesh, ASKEW, (GLOWING,), 1).pose(0.0)
    light = source.light
    np.testing.assert_allclose(light.colour, np.array((4.0, 2.0, 1.0)) * 4 * area / 4, rtol=0.04)
    assert light.radius_m == pytest.approx(np.sqrt(4 * area / (4 * np.pi)), rel=0.02)
    np.testing.assert_allclose(light.position_m, position + 2 * height_m * rotation[:, 2], atol=0.01)
    u = np.random.default_rng(0).normal(size=(20_000, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    assert np.sqrt(np.einsum("ni,ij,nj->n", u, source.shape, u)).mean() == pytest.approx(1, abs=3e-3)


def disc(radius_m: float) -> Mesh:
    """A disc in z = 0 that looks up, of 64 corners."""
    angle = np.arange(64) * np.pi / 32
    rim = np.stack([radius_m * np.cos(angle), radius_m * np.sin(angle), 0 * angle], -1)
    vertices = np.concatenate([np.zeros((1, 3)), rim]).astype(np.float32)
    i = np.arange(64)
    faces = np.stack([0 * i, 1 + i, 1 + (i + 1) % 64], -1).astype(np.int32)
    normals = np.tile(np.float32([0, 0, 1]), (65, 1))
    return Mesh(vertices, normals, faces, np.zeros(64, np.int32), ("disc",))


@pytest.mark.parametrize(
    ("face", "case", "size_m", "centre_m", "ahead"),
    [
        (
            block((0.4, 0.3, 0.004)),
            moved(block((0.4, 0.3, 0.03)), (0, 0, -0.04)),
            (0.4, 0.3),
            (0, 0, 0.004),
            2,
        ),
        (
            block((0.3, 0.4, 0.004)),
            moved(block((0.3, 0.4, 0.03)), (0, 0, -0.04)),
            (0.3, 0.4),
            (0, 0, 0.004),
            2,
        ),
        (
            block((0.4, 0.004, 0.3)),
            moved(block((0.4, 0.03, 0.3)), (0, -0.04, 0)),
            (0.4, 0.3),
            (0, 0.002, 0.15),
            1,
        ),
        (
            block((0.004, 0.4, 0.3)),
            moved(block((0.03, 0.4, 0.3)), (-0.04, 0, 0)),
            (0.4, 0.3),
            (0.002, 0, 0.15),
            0,
        ),
        (
            in_one_part(moved(grid(0.3, 5), (-0.15, 0, 0)), moved(grid(0.3), (0.15, 0, 0))),
            *(moved(block((0.6, 0.3, 0.03)), (0, 0, -0.05)), (0.6, 0.3), (0, 0, 0), 2),
        ),
        (disc(0.2), moved(block((0.5, 0.5, 0.03)), (0, 0, -0.05)), (0.2 * np.sqrt(np.pi),) * 2, (0, 0, 0), 2),
    ],
    ids=["lying", "lying across", "to the north", "to the east", "of many triangles and few", "round"],
)
def test_a_display_is_an_area_light_of_its_front(
    face: Mesh, case: Mesh, size_m: tuple[float, float], centre_m: Vec3, ahead: int
) -> None:
    """Of its radiance and area, away from its case, as wide and high as it is along its object's axes."""
    screen = Drawable(joined(case, face), replace(ASKEW, scale=(2.0, 2.0, 2.0)), (plain(), GLOWING), 1)
    (source,) = lamps_in(screen)
    light, (rotation, position) = source.light, screen.pose(0.0)
    assert light.kind == "area"
    np.testing.assert_allclose(light.colour, (4.0, 2.0, 1.0))
    np.testing.assert_allclose(light.size_m, 2 * np.array(size_m), rtol=2e-3)
    np.testing.assert_allclose(light.position_m, position + rotation @ (2 * np.array(centre_m)), atol=1e-5)
    np.testing.assert_allclose(light.direction, rotation[:, ahead], atol=1e-5)
    assert source.axes is not None
    half_width, half_height = (rotation.T @ axis for axis in source.axes)
    assert np.abs(half_width).argmax() == (1 if ahead == 0 else 0)
    assert np.abs(half_height).argmax() == (1 if ahead == 2 else 2)
    np.testing.assert_allclose(np.linalg.norm((half_width, half_height), axis=1), size_m, rtol=2e-3)
    np.testing.assert_allclose(
        -np.cross(half_width, half_height), np.eye(3)[ahead] * np.prod(size_m), atol=1e-3
    )


@pytest.mark.parametrize(
    ("thick_m", "case_m", "left", "material", "is_display"),
    [
        (0.03, 0.08, 1.0, {}, True),
        (0.06, 0.08, 1.0, {}, False),  # 3/4 of its surface looks up and down
        (0.03, 0.13, 1.0, {}, False),  # 0.3 times the edge of a square as large are 0.10 m
        (0.03, 0.08, 0.6, {}, True),
        (0.03, 0.08, 0.4, {}, False),
        (0.03, 0.08, 1.0, {"translucency": 0.5}, False),
        (0.03, 0.08, 1.0, {"transmission": 1.0}, False),
        (0.03, 0.08, 1.0, {"emission": 0.1}, False),
    ],
)
def test_a_flat_thing_close_before_most_of_an_opaque_back_is_a_display(
    thick_m: float, case_m: float, left: float, material: dict[str, float], is_display: bool
) -> None:
    """case_m: from its front to the back; left: how much of its width that covers."""
    back = moved(block((0.4 * left, 0.3, 0.01)), (0.2 * left - 0.2, 0.0, thick_m - case_m - 0.01))
    parts = joined(block((0.4, 0.3, thick_m)), back)
    pieces = hoods_apart([Drawable(parts, STILL, (GLOWING, replace(plain(), **material)), 1)])
    assert any(0 in piece.displays for piece in pieces) == is_display


def test_what_keeps_off_a_lamp_is_its_hood_and_everything_else_stays_with_it() -> None:
    """A bulb on a stem that touches it, a display on its case, and a hood and a base apart from both; parts
    keep their triangles, materials and names, and displays their part."""
    stem, hood = moved(block((0.02, 0.02, 0.5)), (0, 0, -0.5)), moved(block((0.5, 0.5, 0.01)), (0, 0, 0.15))
    glass = moved(block((0.5, 0.5, 0.01)), (0, 0, 0.6))
    case, face = moved(block((0.4, 0.3, 0.03)), (2.0, 0, -0.04)), moved(block((0.4, 0.3, 0.004)), (2.0, 0, 0))
    base = moved(block((0.3, 0.3, 0.02)), (0, 0, -0.6))
    mesh = joined(hood, sphere(0.1, 24), stem, glass, face, base, case)
    bright = replace(plain((0.1, 0.1, 0.1)), emission=9.0)
    clear = replace(plain((0.3, 0.3, 0.3)), transmission=1.0)
    materials = (plain(), GLOWING, plain((0.2, 0.2, 0.2)), clear, bright, plain((0.6, 0.6, 0.6)), plain())
    whole = Drawable(mesh, ASKEW, materials, 1)
    lamp, apart = hoods_apart([whole])
    assert lamp.mesh.part_names == ("part 1", "part 2", "part 3", "part 4")
    assert apart.mesh.part_names == ("part 0", "part 5", "part 6")
    assert list(lamp.displays) == [3]
    assert not apart.displays
    for piece in (lamp, apart):
        assert (piece.object_id, piece.transform) == (1, ASKEW)
        for number, name in enumerate(piece.mesh.part_names):
            part = int(name.removeprefix("part "))
            assert piece.materials[number] == materials[part]
            found, wanted = (
                of.vertices[of.faces[of.face_parts == n]] for of, n in ((piece.mesh, number), (mesh, part))
            )
            np.testing.assert_array_equal(found, wanted)
    kinds = [source.light.kind for source in lamps_in(whole)]
    assert sorted(kinds) == ["area", "point"]
    background = replace(whole, object_id=BACKGROUND_ID)
    assert hoods_apart([background]) == (background,)


def test_displays_and_bulbs_are_ranked_by_what_they_give_ahead() -> None:
    """Radiance times area of a display, and that times a quarter of its surface of a ball."""
    case, white = moved(block((0.1, 0.1, 0.03)), (0, 0, -0.04)), plain(ONE)
    screen = Drawable(
        joined(block((0.1, 0.1, 0.002)), case), STILL, (replace(white, emission=1.0), plain()), 1
    )
    for emission, kinds in ((0.9, ["point", "area"]), (0.1, ["area", "point"])):
        ball = Drawable(sphere(0.1, 24), ASKEW, (replace(white, emission=emission),), 2)  # times 0.0314 m2
        assert [source.light.kind for source in lamps_in(screen, ball)] == kinds


def test_a_sky_turns_from_x_towards_y(tmp_path) -> None:
    """Column 0 of a picture ends at +x: turned by 90 degrees it ends at +y."""
    light = np.ones((16, 32, 3), np.float32)
    light[:, 0] = 9
    write_exr(tmp_path / "sky.exr", light)
    picture = panorama(Sky(f"file:{tmp_path / 'sky.exr'}", ONE, azimuth_deg=90.0))
    assert set(picture[..., 0].argmax(axis=1)) == {7}


def test_a_picture_of_the_sky_is_not_seen_mirrored(renderer: Renderer, tmp_path) -> None:
    """What is to the right in it is to the right for who stands in it."""
    light = np.full((32, 64, 3), 0.1, np.float32)
    light[:, :8, 0] = light[:, 8:16, 1] = 1.0
    write_exr(tmp_path / "sky.exr", light)
    sky = Sky(f"file:{tmp_path / 'sky.exr'}", ONE)
    angle = -2 * np.pi * 8 / 64  # where red meets green
    ahead = Camera(ZERO, (float(np.cos(angle)), float(np.sin(angle)), 0.0), (0.0, 0.0, 1.0), 40.0, 32, 32)
    sheet = lambertian(grid(0.1), at=replace(STILL, position_m=(0.0, 0.0, -9.0)))
    left, right = np.hsplit(draw(renderer, replace(view(sheet, camera=ahead), sky=sky)).radiance, 2)
    assert (left[:, :-1, 0] > 2 * left[:, :-1, 1]).all()
    assert (right[:, 1:, 1] > 2 * right[:, 1:, 0]).all()
