"""The renderer against closed formulas: light, ambient, shadow position, depth, normals, ids, noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from fsid.assets import Mesh
from fsid.render import Renderer
from fsid.render.camera import lens_of
from fsid.render.drawable import BACKGROUND_ID, Drawable, background_drawable
from fsid.render.shadows import Source, Tile, plan_shadows
from fsid.scene.model import Background, Camera, Light, Sky, Transform
from render_scenes import (
    FROM_ABOVE,
    STILL,
    block,
    draw,
    floor_points,
    grid,
    lambertian,
    pixel_rays,
    plain,
    point_light,
    sphere,
    view,
)

NO_TURN, ONE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
CENTRE = np.hypot(*np.mgrid[-47.5:48, -47.5:48])
"""Distance of each pixel of FROM_ABOVE from the centre of the image, in pixels."""


@pytest.mark.parametrize("height_m", [0.5, 1.0, 1.9])
def test_a_point_light_follows_inverse_square_and_cosine(renderer: Renderer, height_m: float) -> None:
    """L = albedo / pi * I cos(theta) / r^2 within 0.5 %, everywhere on the plane."""
    light = point_light((0.3, -0.2, height_m), intensity=3.0)
    frame = draw(renderer, view(lambertian(grid(6.0)), lights=(light,)))
    to_light = np.array(light.position_m) - floor_points(FROM_ABOVE)
    r2 = (to_light**2).sum(-1)
    expected = 0.5 / np.pi * 3.0 * to_light[..., 2] / np.sqrt(r2) / r2
    np.testing.assert_allclose(frame.radiance[..., 0], expected, rtol=5e-3)


def test_a_spot_shines_inside_its_cone_only(renderer: Renderer) -> None:
    spot = Light("spot", (0.0, 0.0, 1.5), (0.0, 0.0, -1.0), (1.0, 1.0, 1.0), 0.01, 40.0)
    frame = draw(renderer, view(lambertian(grid(6.0)), lights=(spot,)))
    radius = np.linalg.norm(floor_points(FROM_ABOVE)[..., :2], axis=-1)
    angle = np.degrees(np.arctan2(radius, 1.5))
    full = 0.5 / np.pi * np.cos(np.radians(angle)) ** 3 / 1.5**2
    inner, outer = angle < 15.5, angle > 20.6
    np.testing.assert_allclose(frame.radiance[inner, 0], full[inner], rtol=5e-3)
    assert frame.radiance[outer].max() == 0.0


def test_a_closed_white_room_is_a_white_furnace(renderer: Renderer) -> None:
    """Only ambient light, white surroundings: radiance = ambient * albedo where nothing occludes."""
    what = view(lambertian(sphere(0.3), (0.8, 0.4, 0.1)), ambient=0.7)
    frame = draw(renderer, what)
    inside = frame.object_id == 0
    middle = CENTRE < 10
    expected = 0.7 * np.array([[0.8, 0.4, 0.1]])
    np.testing.assert_allclose(frame.radiance[middle] / expected, 1.0, rtol=2e-3)
    assert (frame.radiance[inside] <= expected * 1.002 + 1e-6).all()


@pytest.mark.parametrize("fov_deg", [45.0, 28.0])
def test_a_longer_lens_sees_no_more_shade_at_the_foot_of_a_wall(renderer: Renderer, fov_deg: float) -> None:
    """What occludes is looked for in a part of the image: what that cuts off counts as open."""
    wall = lambertian(block((3.0, 0.2, 1.0)), at=Transform((0.0, 0.1, 0.0), NO_TURN, ONE), object_id=1)
    foot, closed = np.array([0.0, -0.06, 0.0]), []
    for fov in (72.0, fov_deg):
        camera = Camera((0.0, -1.2, 1.2), (0.0, -0.1, 0.0), (0.0, 0.0, 1.0), fov, 384, 384)
        lens = lens_of(camera)
        x, y, z = lens.rotation @ (foot - lens.position)
        row, column = int(192 - 192 * lens.focal[1] * y / z), int(192 + 192 * lens.focal[0] * x / z)
        frame = draw(renderer, view(lambertian(grid(6.0)), wall, ambient=1.0, camera=camera))
        closed.append(1 - frame.radiance[row, column, 0] / 0.5)
    assert closed[0] > 0.5
    assert 0.7 * closed[0] < closed[1] < 1.1 * closed[0]


@pytest.mark.parametrize("roughness", [20, 60, 100])
def test_a_white_metal_is_invisible_in_white_surroundings(renderer: Renderer, roughness: int) -> None:
    """Energy is conserved: under surroundings of 1 a white metal shows 1, smooth or rough."""
    white = plain((1.0, 1.0, 1.0), roughness=roughness, family="metal")
    frame = draw(renderer, view(Drawable(sphere(0.3), STILL, (white,), 0), ambient=1.0))
    np.testing.assert_allclose(frame.radiance[CENTRE < 10], 1.0, rtol=0.01)


def test_the_edge_of_a_shadow_is_where_geometry_says(renderer: Renderer) -> None:
    """A small light over a block: the shadow ends within one pixel of the projected edge."""
    light = point_light((-1.0, 0.0, 1.5))
    tall = lambertian(block((0.2, 0.6, 0.4)), object_id=1)
    frame = draw(renderer, view(lambertian(grid(6.0)), tall, lights=(light,)))
    row = frame.radiance[48, :, 0]
    x = floor_points(FROM_ABOVE)[48, :, 0]
    on_floor = (x > 0.16) & (frame.object_id[48] == 0)
    edge = 0.1 + (0.1 + 1.0) * 0.4 / (1.5 - 0.4)
    pixel = x[1] - x[0]
    r2 = (x + 1) ** 2 + 1.5**2
    lit = 0.5 / np.pi * 1.5 / r2**1.5
    assert (row[on_floor & (x < edge - pixel)] < 0.02 * lit[on_floor & (x < edge - pixel)]).all()
    after = on_floor & (x > edge + pixel)
    np.testing.assert_allclose(row[after], lit[after], rtol=0.02)


def test_a_wide_light_has_the_penumbra_of_its_size(renderer: Renderer) -> None:
    """A disc of radius R appears over 2 R h / (H - h) behind an edge, 10 to 90 % of it over 0.687 of that."""
    camera = replace(FROM_ABOVE, width=192, height=192)
    light = point_light((-0.4, 0.0, 1.5), radius_m=0.1)
    shade = lambertian(block((1.0, 3.0, 0.004)), at=Transform((-0.5, 0.0, 0.5), NO_TURN, ONE), object_id=1)
    frame = draw(renderer, view(lambertian(grid(8.0)), shade, lights=(light,), camera=camera))
    x = floor_points(camera)[96, :, 0]
    share = frame.radiance[96, :, 0] / (0.5 / np.pi * 1.5 / ((x + 0.4) ** 2 + 1.5**2) ** 1.5)
    floor = (frame.object_id[96] == 0) & (x > 0)
    assert (np.diff(share[floor]) > -0.01).all()
    low, high = (np.interp(level, share[floor], x[floor]) for level in (0.1, 0.9))
    ideal = 0.687 * 2 * 0.1 * 0.5 / (1.5 - 0.5)
    assert 0.75 * ideal < high - low < 1.25 * ideal
    assert abs((low + high) / 2 - 0.2) < 0.12 * ideal


def test_no_acne_on_slopes_and_curves(renderer: Renderer) -> None:
    """A lone sphere casts no shadow on its own lit side: radiance is Lambert's law to 2 %."""
    light = point_light((0.8, 0.3, 2.5), radius_m=0.05)
    frame = draw(renderer, view(lambertian(sphere(0.5, 200)), lights=(light,)))
    points, normals = sphere_hits(FROM_ABOVE, 0.5)
    to_light = np.array(light.position_m) - points
    r = np.linalg.norm(to_light, axis=-1)
    cosine = (normals * to_light).sum(-1) / r
    inner = np.isfinite(cosine) & (cosine > 0.2)
    inner &= CENTRE < 19
    expected = 0.5 / np.pi * cosine / r**2
    np.testing.assert_allclose(frame.radiance[inner, 0], expected[inner], rtol=0.02)


def dish(size_m: float, depth_m: float) -> Mesh:
    """A shallow bowl on z = 0 that looks up, a paraboloid."""
    flat = grid(size_m, 120)
    x, y, _ = flat.vertices.T
    steep = 4 * depth_m / size_m**2
    normals = np.stack([-2 * steep * x, -2 * steep * y, np.ones_like(x)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    vertices = np.stack([x, y, steep * (x * x + y * y)], axis=-1)
    return replace(flat, vertices=vertices.astype(np.float32), normals=normals.astype(np.float32))


def test_wide_ground_takes_no_digits_from_the_sun_s_shadows(renderer: Renderer) -> None:
    """A bowl in soft sunlight is as bright as Lambert says, on ground that reaches to the horizon."""
    sun = Light("sun", (0.0, 0.0, 0.0), (0.5, 0.1, -0.5), (2.0, 2.0, 2.0), 0.02, 360.0)
    to_sun = -np.array(sun.direction) / np.linalg.norm(sun.direction)
    ground = replace(lambertian(grid(500.0), at=Transform((0.0, 0.0, -3.0), NO_TURN, ONE)), casts=False)
    bowl = lambertian(dish(1.0, 0.1), object_id=1)
    distant = lambertian(sphere(0.5), at=Transform((-14.0, 3.0, 0.0), NO_TURN, ONE), object_id=2)
    camera = replace(FROM_ABOVE, fov_deg=20.0)
    frame = draw(renderer, view(ground, bowl, distant, lights=(sun,), camera=camera))
    inner = binary_erosion(frame.object_id == 1, iterations=2)
    assert inner.mean() > 0.3
    lambert = 2 * 0.5 / np.pi * frame.normal[inner] @ to_sun  # from above, camera space is the world's
    np.testing.assert_allclose(frame.radiance[inner, 0], lambert, rtol=0.03)


def test_ground_far_behind_all_that_shades_it_has_its_shadow(renderer: Renderer) -> None:
    """The sun's map ends with the last of what casts shadows; what lies beyond is shaded no less."""
    sun = Light("sun", (0.0, 0.0, 0.0), (0.6, 0.0, -0.8), (2.0, 2.0, 2.0), 0.0047, 360.0)
    ball = lambertian(sphere(0.1), at=Transform((-0.9, 0.0, 1.2), NO_TURN, ONE), object_id=1)
    ground = replace(lambertian(grid(300.0)), casts=False)
    frame = draw(renderer, view(ground, ball, lights=(sun,)))
    points, lit = floor_points(FROM_ABOVE), 2 * 0.5 / np.pi * 0.8
    from_centre = np.hypot((points[..., 0]) * 0.8, points[..., 1])  # the shadow is an ellipse, 1 / 0.8 long
    floor = frame.object_id == 0
    assert (frame.radiance[floor & (from_centre < 0.06), 0] < 0.02 * lit).all()
    np.testing.assert_allclose(frame.radiance[floor & (from_centre > 0.16), 0], lit, rtol=2e-3)


def test_a_small_thing_in_the_sun_has_its_shadow_whatever_stands_far_away(renderer: Renderer) -> None:
    """A ball of 2 cm seen close by, above the ground; and with a block 20 m away, out of the picture."""
    sun = Light("sun", (0.0, 0.0, 0.0), (0.6, 0.0, -0.8), (2.0, 2.0, 2.0), 0.0047, 360.0)
    camera = replace(FROM_ABOVE, position_m=(0.0, 0.0, 0.4))
    ground = lambertian(grid(60.0), object_id=BACKGROUND_ID)
    ball = lambertian(sphere(0.01), at=replace(STILL, position_m=(0.0, 0.0, 0.02)))
    far = lambertian(block((1.0, 1.0, 3.0)), at=replace(STILL, position_m=(-14.0, 14.0, 0.0)))
    sky = Sky("procedural", (1e-6,) * 3)
    near = replace(view(ground, ball, lights=(sun,), camera=camera), sky=sky)
    alone = draw(renderer, near).radiance
    assert (alone < 0.05 * alone.max()).any()
    both = draw(renderer, replace(near, drawables=(*near.drawables, far))).radiance
    assert np.abs(both - alone).mean() < 0.02 * alone.max() * (alone < 0.5 * alone.max()).mean()
    assert np.abs(both - alone).max() < 0.4 * alone.max()


@pytest.mark.parametrize(("drop_m", "radius"), [(0.2, 0.02), (0.5, 0.04)])
def test_the_shade_of_a_wall_is_dark_throughout(renderer: Renderer, drop_m: float, radius: float) -> None:
    """A table in a low sun behind a wall at its edge, over ground: some of what lies around a shaded place is
    far in front of it, some far behind, and the mean of both says nothing."""
    sun = Light("sun", (0.0, 0.0, 0.0), (0.9, 0.2, -0.3), (2.0, 2.0, 2.0), radius, 360.0)
    ground = lambertian(grid(8.0), at=replace(STILL, position_m=(0.0, 0.0, -drop_m)))
    at_edge = replace(STILL, position_m=(-0.45, 0.0, -0.01))
    wall = lambertian(block((0.05, 3.0, 0.08)), at=at_edge, object_id=2)
    distant = lambertian(sphere(0.1), at=replace(STILL, position_m=(-3.0, 1.0, 0.5)), object_id=3)
    camera = replace(FROM_ABOVE, position_m=(0.0, 0.0, 1.0), fov_deg=50.0)
    table = lambertian(grid(1.0), object_id=1)
    frame = draw(renderer, view(ground, table, wall, distant, lights=(sun,), camera=camera))
    x = floor_points(camera)[..., 0]
    shaded = binary_erosion((frame.object_id == 1) & (x < -0.425 + 0.9 * 0.07 * 3), iterations=2)
    assert shaded.mean() > 0.1
    assert frame.radiance[shaded].max() == 0.0


def test_the_sun_s_texels_stay_where_they_are_when_the_camera_moves() -> None:
    """The nearer tile of a camera that has moved a little is that of the first, by whole texels aside."""
    sun = Source(Light("sun", (0.0, 0.0, 0.0), (0.3, -0.6, -0.6), (1.0, 1.0, 1.0), 0.0047, 360.0))
    casters = np.array([[0.0, 0.0, 0.0, 1.0], [15.0, 8.0, 1.0, 2.0]])
    points = np.array([[0.0, 0.0, 1.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])

    def nearer(looked_at: np.ndarray) -> Tile:
        whole, tile = plan_shadows([sun], casters, casters, looked_at, 1024).tiles
        assert tile.focal > 4 * whole.focal
        return tile

    first = nearer(points)
    for step in (0.0003, 0.002, 0.05):
        other = nearer(points + step * np.array([1.0, 0.7, 0.2]))
        texels = (other.origin - first.origin) @ first.axes[:2].T * first.focal * first.px / 2
        assert other.focal == first.focal
        np.testing.assert_allclose(texels, np.round(texels), atol=1e-6)


@pytest.fixture
def edge() -> tuple[Camera, list[Drawable], Light]:
    """A block on the ground, seen close by; the sun is behind it and reaches its top, not its front."""
    turned = Transform((0.0, 0.0, 0.0), (0.0, 0.0, 20.0), ONE)
    drawables = [lambertian(grid(6.0)), lambertian(block((0.5, 0.5, 0.4)), at=turned, object_id=1)]
    sun = Light("sun", (0.0, 0.0, 0.0), (0.3, -0.6, -0.6), (2.0, 2.0, 2.0), 0.0047, 360.0)
    camera = Camera((0.3, -1.2, 0.7), (0.0, 0.0, 0.35), (0.0, 0.0, 1.0), 12.0, 160, 120)
    return camera, drawables, sun


def test_no_light_leaks_along_the_edges_of_what_is_in_shadow(renderer: Renderer, edge) -> None:
    camera, drawables, sun = edge
    roof = lambertian(grid(12.0), at=Transform((0.0, 0.0, 0.8), NO_TURN, ONE), object_id=2)
    frame = draw(renderer, view(*drawables, roof, lights=(sun,), camera=camera))
    assert (frame.object_id == 1).mean() > 0.9
    assert frame.radiance.max() == 0.0


def test_shadows_of_one_face_are_not_those_of_the_next(renderer: Renderer, edge) -> None:
    """Where cloth or leaves are about, the sun's share behind a face is found, too; no edge shows it."""
    camera, drawables, sun = edge
    at = Transform((0.0, -3.0, 0.0), NO_TURN, ONE)
    cloth = Drawable(block((0.1, 0.1, 0.1)), at, (replace(plain(), sheen=0.01),), 2)
    alone = draw(renderer, view(*drawables, lights=(sun,), camera=camera)).radiance
    beside = draw(renderer, view(*drawables, cloth, lights=(sun,), camera=camera)).radiance
    np.testing.assert_allclose(beside, alone, rtol=1e-5)


def sphere_hits(camera: Camera, radius_m: float, sample: float = 0.5) -> tuple[np.ndarray, np.ndarray]:
    """Points and normals of a sphere around the world's origin; NaN where the ray misses."""
    rays, rotation = pixel_rays(camera)
    moved = (sample - 0.75) / camera.width * 2 * np.tan(np.radians(camera.fov_deg) / 2)
    rays = rays + moved * (rotation[0] - rotation[1])
    origin = np.array(camera.position_m)
    a, b, c = (rays**2).sum(-1), rays @ origin, origin @ origin - radius_m**2
    root = b * b - a * c
    t = (-b - np.sqrt(np.where(root >= 0, root, np.nan))) / a
    points = origin + rays * t[..., None]
    return points, points / radius_m


def test_depth_of_a_slanted_plane(renderer: Renderer) -> None:
    camera = Camera((0.3, -1.5, 1.2), (0.0, 0.0, 0.0), (0.1, 0.0, 1.0), 50.0, 120, 80)
    frame = draw(renderer, view(lambertian(grid(40.0)), camera=camera))
    rays, _ = pixel_rays(camera)
    expected = -1.2 / rays[..., 2]
    np.testing.assert_allclose(frame.depth, expected, rtol=2e-5)


def test_normal_and_id_of_a_sphere(renderer: Renderer) -> None:
    camera = Camera((0.9, -1.3, 0.8), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 40.0, 96, 96)
    ball = lambertian(sphere(0.4, 300), object_id=7)
    frame = draw(renderer, view(ball, camera=camera))
    _, rotation = pixel_rays(camera)
    points, normals = sphere_hits(camera, 0.4, sample=0.75)
    expected = normals @ (rotation * np.array([[1.0], [1.0], [-1.0]])).T
    inner = (expected[..., 2] > 0.3) & np.isfinite(expected[..., 2])
    assert (frame.object_id[inner] == 7).all()
    cosine = (frame.normal * expected).sum(-1)[inner]
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 0.5
    depth = (points - np.array(camera.position_m)) @ rotation[2]
    np.testing.assert_allclose(frame.depth[inner], depth[inner], atol=2e-4)
    missed = np.isnan(expected[..., 2])
    assert (frame.object_id[missed] == -1).all()
    assert np.isinf(frame.depth[missed]).all()
    assert (frame.normal[np.isinf(frame.depth)] == (0, 0, 1)).all()


def test_normals_face_the_viewer(renderer: Renderer) -> None:
    """One that interpolation or relief turned away is mirrored, n - 2 (n v) v: no surface seen has such."""
    tilted = np.array([0.96, 0.0, 0.28])
    flat = grid(2.0)
    mesh = replace(flat, normals=np.tile(tilted.astype(np.float32), (len(flat.vertices), 1)))
    camera = Camera((-1.5, 0.0, 0.4), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 30.0, 96, 96)
    frame = draw(renderer, view(lambertian(mesh), camera=camera))
    rays, rotation = pixel_rays(camera)
    v = -rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    expected = (tilted - 2 * (v @ tilted)[..., None] * v) @ rotation.T * [1, 1, -1]
    seen = frame.object_id == 0
    assert seen.mean() > 0.3
    assert (v @ tilted)[seen].max() < 0
    np.testing.assert_allclose(frame.normal[seen], expected[seen], atol=0.01)


def test_the_first_row_is_the_top_and_x_goes_right(renderer: Renderer) -> None:
    ball = lambertian(sphere(0.1), at=Transform((0.5, 0.6, 0.1), (0, 0, 0), (1, 1, 1)))
    frame = draw(renderer, view(ball))
    rows, columns = np.nonzero(frame.object_id == 0)
    assert rows.max() < 48
    assert columns.min() > 48


def test_a_transform_scales_then_turns_then_moves(renderer: Renderer) -> None:
    """x_world = Rz Ry Rx (x * scale) + position: the top of a turned box seen from above."""
    at = Transform((0.2, -0.1, 0.3), (90.0, 0.0, 90.0), (0.5, 1.0, 0.25))
    frame = draw(renderer, view(lambertian(block(ONE), at=at)))
    rays, _ = pixel_rays(FROM_ABOVE)
    top = np.abs(frame.depth - (2.0 - 0.8)) < 1e-4
    points = (rays * 1.2)[top][:, :2]
    pixel = 2 * 1.2 * np.tan(np.radians(30)) / 96
    np.testing.assert_allclose(points.min(0), (0.2, -0.35), atol=pixel)
    np.testing.assert_allclose(points.max(0), (0.45, 0.15), atol=pixel)


def test_sub_pixel_phase_leaves_smooth_areas_alone(renderer: Renderer) -> None:
    """Noise-free: samples moved by parts of a pixel change smooth shading by its gradient only.

    What remains, scaled to mid-grey 0.18, stays below 5 % of a read noise of 5e-4 on the lit floor, in the
    umbra's ambient light and on the sphere. (Measured: at most 0.6e-5.)
    """
    light = point_light((0.3, 0.2, 1.8), intensity=4.0, radius_m=0.1)
    ball = lambertian(sphere(0.3, 400), object_id=1)
    what = view(lambertian(grid(6.0)), ball, lights=(light,), ambient=0.1)
    before, still, after = (
        draw(renderer, what, shift_px=(s, s)).radiance[..., 0].astype(float) for s in (-0.21, 0.0, 0.21)
    )
    noise = np.abs((before + after) / 2 - still) * 0.18 / still
    assert noise[CENTRE > 40].max() < 0.05 * 5e-4


def test_a_wide_penumbra_of_thin_things_is_smooth(renderer: Renderer) -> None:
    """No tap pattern: in the shadow of slats under a wide light the phase matters as little as in light.

    Mean over the shadow, scaled to mid-grey. (Measured: 1.3e-5.)
    """
    light = point_light((-0.9, 0.0, 1.9), intensity=4.0, radius_m=0.15)
    places = [Transform((-0.55 + 0.05 * i, 0.0, 0.9), NO_TURN, ONE) for i in range(5)]
    camera = replace(FROM_ABOVE, fov_deg=20.0, width=320, height=320)
    slats = [lambertian(block((0.02, 0.5, 0.01)), at=place, object_id=1) for place in places]
    what = view(lambertian(grid(8.0)), *slats, lights=(light,), camera=camera)
    frames = [draw(renderer, what, shift_px=(s, s)) for s in (-0.21, 0.0, 0.21)]
    before, still, after = (frame.radiance[..., 0].astype(float) for frame in frames)
    unshaded = draw(renderer, replace(what, drawables=what.drawables[:1])).radiance[..., 0]
    shaded = still / unshaded < 0.95
    assert (frames[1].object_id == 0).all()
    assert shaded.mean() > 0.3
    noise = np.abs((before + after) / 2 - still)[shaded] * 0.18 / still[shaded].mean()
    assert noise.mean() < 0.05 * 5e-4


def test_a_room_closes_every_view(renderer: Renderer) -> None:
    names = ("floor", "ceiling", "wall_north", "wall_south", "wall_east", "wall_west")
    room = Background("room", (3.0, 4.0, 2.5), {name: plain() for name in names})
    camera = Camera((0.0, 0.0, 1.2), (1.0, 1.0, 1.5), (0.0, 0.0, 1.0), 120.0, 64, 64)
    frame = draw(
        renderer, view(background_drawable(room), lights=(point_light((0.0, 0.0, 2.0)),), camera=camera)
    )
    assert (frame.object_id == -1).all()
    assert np.isfinite(frame.depth).all()
    assert frame.radiance.min() > 0


@pytest.mark.parametrize("roughness", [20, 50, 100])
def test_a_glossy_white_body_in_a_white_furnace(renderer: Renderer, roughness: int) -> None:
    """Mirror and body of a dielectric share what arrives at any angle: in surroundings of 1 white shows 1,
    or a little less where it is rough and the mirror loses some."""
    sheet = Drawable(grid(8.0), STILL, (plain(ONE, roughness=roughness),), 0)
    for angle in np.radians((0.0, 45.0, 60.0, 75.0, 85.0)):
        at = (0.0, float(-2 * np.sin(angle)), float(2 * np.cos(angle)))
        camera = Camera(at, (0.0, 0.0, 0.0), (0.0, 1.0, 1.0), 4.0, 16, 16)
        shown = draw(renderer, view(sheet, ambient=1.0, camera=camera)).radiance[7:9, 7:9]
        assert 0.97 < shown.min() <= shown.max() < 1.005
