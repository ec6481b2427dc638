"""Laws of the camera: distortion, vignetting, aberration, blur, and flow against their closed formulas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import moderngl
import numpy as np
import pytest
from scipy.ndimage import center_of_mass, map_coordinates
from scipy.spatial.transform import Rotation

from fsid.errors import FsidError
from fsid.render import Renderer
from fsid.render.camera import lens_of
from fsid.render.drawable import Drawable, View
from fsid.render.exposure import Shot, shots_of
from fsid.render.flow import flow_between
from fsid.render.frame import Frame
from fsid.scene import SceneConfig, sample
from fsid.scene.distortion import distorted, fold_radius, rays_of, stretch_of, undistorted
from fsid.scene.model import ZERO, Camera, Distortion, Motion, Transform
from render_scenes import FROM_ABOVE, block, draw, grid, lambertian, plain, point_light, sphere, view

ONE = (1.0, 1.0, 1.0)
BARREL = Distortion("brown-conrady", (-0.25, 0.06, 0.002, -0.001, 0.0))
PINCUSHION = Distortion("brown-conrady", (0.12, 0.01, 0.0, 0.0, 0.0))
FISHEYE = Distortion("fisheye", (0.05, -0.01, 0.002, 0.0))
LENSES = {"barrel": BARREL, "pincushion": PINCUSHION, "fisheye": FISHEYE}
ALL_TERMS = {
    "brown-conrady": Distortion("brown-conrady", (0.11, -0.13, 0.017, -0.019, 0.07)),
    "fisheye": Distortion("fisheye", (0.11, -0.07, 0.05, -0.013)),
}
LABEL_SAMPLE = 0.75
"""Of the 2 x 2 samples of a pixel, that of depth, normal and id lies here."""


def at(x: float, y: float, z: float = 0.0) -> Transform:
    return Transform((x, y, z), (0.0, 0.0, 0.0), ONE)


@pytest.mark.parametrize("name", LENSES)
def test_points_are_where_the_formula_says(renderer: Renderer, name: str) -> None:
    """Small discs in a grid: the centre of each, by its id, within 0.2 pixel of OpenCV's formula."""
    camera = replace(FROM_ABOVE, fov_deg=70.0, width=320, height=240, distortion=LENSES[name])
    places = [(x, y) for x in (-0.9, -0.4, 0.0, 0.5, 1.0) for y in (-0.7, 0.1, 0.6)]
    discs = [lambertian(sphere(0.06, 32), at=at(x, y), object_id=i) for i, (x, y) in enumerate(places)]
    flat = [replace(disc, transform=replace(disc.transform, scale=(1.0, 1.0, 0.001))) for disc in discs]
    frame = draw(renderer, view(*flat, camera=camera))
    focal_px = 160 / np.tan(np.radians(35))
    for i, (x, y) in enumerate(places):
        row, column = center_of_mass(frame.object_id == i)
        seen = distorted(LENSES[name], np.array([x, -y]) / 2.0) * focal_px + (160, 120)
        np.testing.assert_allclose((column + LABEL_SAMPLE, row + LABEL_SAMPLE), seen, atol=0.2)


@pytest.mark.parametrize("name", LENSES)
def test_depth_and_radiance_agree_with_the_bent_rays(renderer: Renderer, name: str) -> None:
    """A slanted plane: depth is that of the labels' ray, light that of the pixel, everywhere.

    Depth of the far plane is as exact as places of vertices in the image, which drivers round to 1/256 pixel
    (llvmpipe stays within 2e-5, an NVIDIA H200 within 6e-5).
    """
    camera = replace(
        FROM_ABOVE, position_m=(0.3, -1.5, 1.2), target_m=(0.1, -0.2, 0.0), distortion=LENSES[name]
    )
    light = point_light((0.3, -0.2, 1.0), intensity=3.0)
    frame = draw(renderer, view(lambertian(grid(60.0)), lights=(light,), camera=camera))
    depth, _ = plane_hits(camera, LABEL_SAMPLE)
    near = (depth > 0) & (depth < 8)
    exact = 2e-5 if renderer.info.is_software else 1e-4
    np.testing.assert_allclose(frame.depth[near], depth[near], rtol=exact)
    _, points = plane_hits(camera, 0.5)
    to = np.array(light.position_m) - points
    expected = 0.5 / np.pi * 3.0 * to[..., 2] / np.linalg.norm(to, axis=-1) ** 3
    np.testing.assert_allclose(frame.radiance[near, 0], expected[near], rtol=0.015)


def plane_hits(camera: Camera, sample_at: float) -> tuple[np.ndarray, np.ndarray]:
    """Depth (H, W) and points (H, W, 3) of z = 0 behind each pixel."""
    lens = lens_of(camera)
    x, y = np.meshgrid(np.arange(camera.width) + sample_at, np.arange(camera.height) + sample_at)
    image = (np.stack([x, y], -1) / (camera.width / 2, camera.height / 2) - 1) / lens.focal
    p = undistorted(camera.distortion, image)
    rays = np.stack([p[..., 0], -p[..., 1], np.ones_like(x)], -1) @ lens.rotation
    depth = -lens.position[2] / rays[..., 2]
    return depth, lens.position + rays * depth[..., None]


@pytest.mark.parametrize("name", LENSES)
def test_a_pane_of_glass_shows_what_is_behind_it_where_the_lens_bends_it_to(
    renderer: Renderer, name: str
) -> None:
    camera = replace(FROM_ABOVE, fov_deg=70.0, width=160, height=120, distortion=LENSES[name])
    shining = replace(plain((0.5, 0.5, 0.5)), emission=1.0)
    places = [(0.3 * x, 0.3 * y) for x in range(-5, 6) for y in range(-4, 5)]
    squares = [replace(lambertian(grid(0.2), at=at(x, y)), materials=(shining,)) for x, y in places]
    clear = replace(plain(ONE), transmission=1.0)
    pane = replace(lambertian(block((8.0, 8.0, 0.002)), at=at(0, 0, 1.0), object_id=1), materials=(clear,))
    bare = draw(renderer, view(*squares, camera=camera)).radiance
    glazed = draw(renderer, view(*squares, pane, camera=camera))
    assert (glazed.object_id == 1).all()
    assert np.abs(glazed.radiance - bare).mean() < 0.02 * bare.mean()


def test_every_coefficient_is_that_of_opencv() -> None:
    """At (0.6, -0.8), one from the middle, r is 1 and an angle is pi / 4; at half of it r2 is 1/4."""
    k1, k2, p1, p2, k3 = ALL_TERMS["brown-conrady"].coefficients
    for scale in (1.0, 0.5):
        x, y, r2 = 0.6 * scale, -0.8 * scale, scale**2
        radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
        right = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
        wanted = right, y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
        np.testing.assert_allclose(distorted(ALL_TERMS["brown-conrady"], np.array([x, y])), wanted)
        angle = np.arctan(scale)
        bent = angle + sum(k * angle ** (2 * i + 3) for i, k in enumerate(ALL_TERMS["fisheye"].coefficients))
        wanted = bent * np.array([0.6, -0.8])
        np.testing.assert_allclose(distorted(ALL_TERMS["fisheye"], np.array([x, y])), wanted)


@pytest.mark.parametrize("lens", [*LENSES.values(), *ALL_TERMS.values()])
def test_the_lens_can_be_inverted(lens: Distortion) -> None:
    points = np.random.default_rng(0).uniform(-0.8, 0.8, (200, 2))
    np.testing.assert_allclose(undistorted(lens, distorted(lens, points)), points, atol=1e-7)


@pytest.mark.parametrize("lens", ALL_TERMS.values())
@pytest.mark.parametrize(("width", "height"), [(96, 64), (48, 80)])
def test_what_a_lens_looks_up_covers_its_image_and_a_pixel_beyond(
    lens: Distortion, width: int, height: int
) -> None:
    """Its rays are undistorted places of the image; half the size that it needs is the largest of them."""
    camera = replace(FROM_ABOVE, width=width, height=height, fov_deg=70.0, distortion=lens)
    image, rays, half = rays_of(lens, camera)
    focal_px = width / 2 / np.tan(np.radians(35))
    wanted = np.array([width, height]) / 2 / focal_px * (1 + 2 / min(width, height))
    np.testing.assert_allclose(image[[0, -1], [0, -1]], [-wanted, wanted])
    np.testing.assert_allclose(distorted(lens, rays), image, atol=1e-8)
    np.testing.assert_allclose(half, np.abs(rays).max((0, 1)), rtol=2e-3)
    assert (half > np.abs(rays).max((0, 1))).all()


@pytest.mark.parametrize("lens", [BARREL, *ALL_TERMS.values()])
@pytest.mark.parametrize(("width", "height"), [(96, 64), (48, 80)])
def test_a_lens_stretches_by_the_root_of_its_determinant(lens: Distortion, width: int, height: int) -> None:
    """Of its formula, at the middle of every pixel, by small differences."""
    camera = replace(FROM_ABOVE, width=width, height=height, fov_deg=70.0, distortion=lens)
    x, y = np.meshgrid(np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5 - height / 2)
    points = undistorted(lens, np.stack([x, y], -1) / (width / 2) * np.tan(np.radians(35)))
    step = 1e-5
    columns = [
        (distorted(lens, points + shift) - distorted(lens, points - shift)) / (2 * step)
        for shift in (np.array([step, 0.0]), np.array([0.0, step]))
    ]
    expected = np.sqrt(np.linalg.det(np.stack(columns, -1)))
    np.testing.assert_allclose(stretch_of(lens, camera), expected, rtol=0.01)
    assert np.ptp(expected) > 0.05


@pytest.mark.parametrize(
    ("lens", "narrow", "wide"),
    [
        (Distortion("fisheye", (0.0,) * 4), *np.radians([79.0, 82.0]) / np.sqrt(2)),  # in the corner
        (Distortion("brown-conrady", (0.0,) * 5), 5.8, 6.1),  # at the side
    ],
)
def test_no_lens_looks_more_than_80_degrees_aside(lens: Distortion, narrow: float, wide: float) -> None:
    """To a tangent of 6. narrow, wide: half the width of a square image, focal lengths."""
    camera = replace(FROM_ABOVE, width=2000, height=2000, distortion=lens)
    lens_of(replace(camera, fov_deg=float(2 * np.degrees(np.arctan(narrow)))))
    with pytest.raises(FsidError, match="beyond 160 degrees"):
        lens_of(replace(camera, fov_deg=float(2 * np.degrees(np.arctan(wide)))))


@pytest.mark.parametrize(
    ("lens", "message"),
    [
        (Distortion("brown-conrady", (-0.9, 0.0, 0.0, 0.0, 0.0)), "fold the image"),
        (Distortion("brown-conrady", (0.1,)), "needs 5 coefficients"),
        (Distortion("spherical", (0.1,)), "choose one of: brown-conrady, fisheye"),
    ],
)
def test_a_lens_that_cannot_be_is_named(lens: Distortion, message: str) -> None:
    with pytest.raises(FsidError, match=message):
        lens_of(replace(FROM_ABOVE, fov_deg=90.0, distortion=lens))


def test_vignetting_is_its_polynomial(renderer: Renderer) -> None:
    what = view(lambertian(grid(8.0)), ambient=0.5)
    flat = draw(renderer, what).radiance[..., 0]
    dim = draw(renderer, replace(what, camera=replace(FROM_ABOVE, vignetting=(-0.3, 0.1, -0.2)))).radiance
    x = (np.arange(96) + 0.5) / 48 - 1
    r2 = (x[:, None] ** 2 + x**2) / 2
    np.testing.assert_allclose(dim[..., 0] / flat, 1 - 0.3 * r2 + 0.1 * r2**2 - 0.2 * r2**3, rtol=1e-4)


def test_what_is_behind_glass_loses_its_light_to_vignetting_once(renderer: Renderer) -> None:
    """Through a pane a grey floor is as dark in the corners as beside it."""
    clear = replace(plain(ONE, roughness=20), transmission=1.0)
    pane = Drawable(grid(8.0), Transform((0.0, 0.0, 1.0), (0.0, 0.0, 0.0), ONE), (clear,), 1)
    even = view(lambertian(grid(20.0)), pane, ambient=1.0)
    dim = replace(even, camera=replace(FROM_ABOVE, vignetting=(-0.5, 0.1, -0.2)))
    x = (np.arange(96) + 0.5) / 48 - 1
    r2 = (x**2 + x[:, None] ** 2) / 2
    gain = draw(renderer, dim).radiance / draw(renderer, even).radiance
    np.testing.assert_allclose(gain[..., 1], 1 - 0.5 * r2 + 0.1 * r2**2 - 0.2 * r2**3, atol=2e-3)


def test_aberration_magnifies_red_and_blue(renderer: Renderer) -> None:
    """A bright square: its edges in red and blue lie (1 + a) times as far from the centre as in green."""
    square = lambertian(grid(1.4), (0.9, 0.9, 0.9))
    camera = replace(FROM_ABOVE, width=240, height=240, chromatic_aberration=(0.02, -0.03))
    rows = draw(renderer, view(square, ambient=1.0, camera=camera)).radiance[120]
    widths = rows.sum(0) / rows[120]
    np.testing.assert_allclose(widths[[0, 2]] / widths[1], (1.02, 0.97), atol=0.006)


def moved_view(**camera: object) -> View:
    light = point_light((0.3, 0.2, 1.8), intensity=4.0, radius_m=0.05)
    ball = lambertian(sphere(0.25, 64), at=at(-0.3, 0.1, 0.3), object_id=1)
    ball = replace(ball, motion=Motion(velocity_m_s=(0.8, 0.2, 0.0), spin_deg_s=(0.0, 0.0, 60.0)))
    slab = lambertian(block((0.4, 0.3, 0.3)), at=at(0.4, -0.2), object_id=2)
    what = view(lambertian(grid(8.0)), ball, slab, lights=(light,), ambient=0.1)
    return replace(what, camera=replace(FROM_ABOVE, **camera))


@pytest.mark.parametrize("lens", [None, BARREL])
def test_flow_meets_the_same_point_in_the_other_image(renderer: Renderer, lens: Distortion | None) -> None:
    """Where the point is not hidden there: the other image has the same object at the predicted depth."""
    first = moved_view(width=160, height=160, distortion=lens)
    second = replace(first, camera=replace(first.camera, position_m=(0.15, -0.1, 1.9), time_s=0.2))
    a, b = draw(renderer, first), draw(renderer, second)
    here, there = ((v.camera, lens_of(v.camera), v.camera.time_s) for v in (first, second))
    flow = flow_between(a, first.drawables, here, there, LABEL_SAMPLE)
    back = flow_between(b, first.drawables, there, here, LABEL_SAMPLE)
    rows, columns = np.mgrid[0:160, 0:160]
    y, x = rows + flow[..., 1], columns + flow[..., 0]
    inside = (x > 1) & (x < 158) & (y > 1) & (y < 158)
    meets = np.stack([map_coordinates(back[..., i], [y, x], order=1, mode="nearest") for i in (0, 1)], -1)
    same = map_coordinates(b.object_id.astype(float), [y, x], order=0, mode="nearest") == a.object_id
    error = np.linalg.norm(flow + meets, axis=-1)[inside & same]
    assert (inside & same).mean() > 0.7
    assert np.quantile(error, 0.95) < 0.05
    ball = a.object_id == 1
    assert np.linalg.norm(flow[ball], axis=-1).mean() > 5
    in_two = (*first.drawables, first.drawables[1])  # as a lamp and its hood are
    np.testing.assert_array_equal(flow_between(a, in_two, here, there, LABEL_SAMPLE), flow)


def test_flow_of_what_moves_and_turns_is_that_of_its_motion(renderer: Renderer) -> None:
    """By hand, from depth: 0.2 s of 0.8 and 0.2 m/s and of 60 degrees/s about the ball's upright axis; into
    an image of twice the size and a longer lens. Behind a camera there is none.
    """
    what = moved_view(width=96, height=96, time_s=0.1)
    there = replace(what.camera, width=192, height=192, fov_deg=40.0, time_s=0.3)
    frame = draw(renderer, what)
    cameras = [(camera, lens_of(camera), camera.time_s) for camera in (what.camera, there)]
    flow = flow_between(frame, what.drawables, *cameras, LABEL_SAMPLE)
    rows, columns = np.mgrid[0:96, 0:96] + LABEL_SAMPLE
    tangent, narrow = np.tan(np.radians((30, 20)))
    x = (columns / 48 - 1) * tangent * frame.depth
    y = -(rows / 48 - 1) * tangent * frame.depth
    centre = np.array([[-0.3 + 0.8 * t, 0.1 + 0.2 * t] for t in (0.1, 0.3)])
    turn = np.radians(12)
    right, up = x - centre[0, 0], y - centre[0, 1]
    x1 = np.cos(turn) * right - np.sin(turn) * up + centre[1, 0]
    y1 = np.sin(turn) * right + np.cos(turn) * up + centre[1, 1]
    moved = np.stack([x1 / frame.depth / narrow + 1, -y1 / frame.depth / narrow + 1], -1) * 96
    seen = np.stack([columns, rows], -1)
    still = (seen - 48) * 2 * tangent / narrow + 96
    ball = frame.object_id == 1
    assert 300 < ball.sum() < 3000
    np.testing.assert_allclose(flow[ball], (moved - seen)[ball], atol=0.01)
    np.testing.assert_allclose(flow[~ball], (still - seen)[~ball], atol=0.01)
    up_there = replace(there, target_m=(0.0, 0.0, 5.0))
    behind = flow_between(frame, what.drawables, cameras[0], (up_there, lens_of(up_there), 0.3), LABEL_SAMPLE)
    assert np.isnan(behind).all()


def test_flow_of_a_still_camera_is_zero_and_nan_outside(renderer: Renderer) -> None:
    what = view(lambertian(sphere(0.3)))
    frame = draw(renderer, what)
    here = (what.camera, lens_of(what.camera), 0.0)
    flow = flow_between(frame, what.drawables, here, here, LABEL_SAMPLE)
    assert np.abs(flow[frame.object_id == 0]).max() < 1e-4
    assert np.isnan(flow[frame.object_id == -1]).all()


FOLDS = {
    "barrel": Distortion("brown-conrady", (-0.25, 0.0, 0.0, 0.0, 0.0)),
    "fisheye": Distortion("fisheye", (-0.3, 0.0, 0.0, 0.0)),
}


@pytest.mark.parametrize("name", FOLDS)
def test_a_lens_reaches_to_where_its_image_folds(name: str) -> None:
    radius = fold_radius(FOLDS[name]) * np.array([0.97, 0.98, 0.99, 1.01, 1.02, 1.03])
    seen = distorted(FOLDS[name], np.stack([radius, 0 * radius], -1))[:, 0]
    assert (np.sign(np.diff(seen))[[0, 1, 3, 4]] == [1, 1, -1, -1]).all()
    assert fold_radius(BARREL) == fold_radius(FISHEYE) == fold_radius(None) == np.inf


def test_an_image_folds_where_its_radius_stops_to_grow_first() -> None:
    """d/dr of r + k1 r^3 + k2 r^5 + k3 r^7: (1 - r^2) (1 - r^2 / 2) is 0 at 1 and at the root of 2."""
    twice = Distortion("brown-conrady", (-0.5, 0.1, 0.02, -0.01, 0.0))
    assert fold_radius(twice) == pytest.approx(1.0)
    late = Distortion("brown-conrady", (0.0, 0.0, 0.02, -0.01, -1 / 7 / 1.5**6))
    assert fold_radius(late) == pytest.approx(1.5)
    assert fold_radius(Distortion("fisheye", (-1 / 3 / 1.5**2, 0.0, 0.0, 0.0))) == pytest.approx(np.tan(1.5))
    assert fold_radius(Distortion("fisheye", (-1 / 3 / 1.6**2, 0.0, 0.0, 0.0))) == np.inf


@pytest.mark.parametrize("name", FOLDS)
def test_flow_ends_where_the_lens_of_the_other_camera_does(renderer: Renderer, name: str) -> None:
    """Along a row of the floor the other camera, turned to the right, sees one point right of the other."""
    what = view(lambertian(grid(8.0)))
    turned = replace(what.camera, target_m=(1.5, 0.0, 0.0), fov_deg=40.0, distortion=FOLDS[name])
    frame = draw(renderer, what)
    here, there = ((camera, lens_of(camera), 0.0) for camera in (what.camera, turned))
    flow = flow_between(frame, what.drawables, here, there, LABEL_SAMPLE)[48, :, 0]
    seen = np.arange(96) + flow
    assert 0 < np.isnan(flow).sum() < 70
    assert (np.diff(seen[np.isfinite(flow)]) > 0).all()


def test_render_gives_flow_to_another_camera(renderer: Renderer) -> None:
    scene = sample(SceneConfig(objects=(2, 2)), 0, width=48, height=32)
    scene = replace(scene, cameras=(scene.cameras[0],) * 2)
    frame = renderer.render(scene, 0, flow_to=1)
    assert frame.flow is not None
    assert np.abs(frame.flow[np.isfinite(frame.depth)]).max() < 1e-3
    with pytest.raises(FsidError, match="flow_to 7"):
        renderer.render(scene, 0, flow_to=7)


def test_a_slit_is_a_column_of_the_image(renderer: Renderer) -> None:
    """Also one so narrow that a grid of 64 places in a row has more rows than a driver's texture."""
    what = view(lambertian(sphere(0.3)), lights=(point_light((0.3, 0.2, 1.8)),))
    wide, narrow = (replace(FROM_ABOVE, width=width, height=600, fov_deg=60.0) for width in (32, 2))
    tangent = np.tan(np.radians(wide.fov_deg) / 2) * 2 / 32
    narrow = replace(narrow, fov_deg=float(np.degrees(2 * np.arctan(tangent))))
    whole, slit = (draw(renderer, replace(what, camera=camera)) for camera in (wide, narrow))
    np.testing.assert_allclose(slit.depth, whole.depth[:, 15:17], rtol=1e-4)
    np.testing.assert_allclose(slit.radiance, whole.radiance[:, 15:17], rtol=0.05)


def test_an_image_that_the_driver_does_not_hold_is_named(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """llvmpipe allows 7680 x 4320 pixels a side, and has no framebuffer of 2 x 2 samples of them."""

    def framebuffer(*images: object) -> None:
        raise moderngl.Error("the framebuffer is not complete (INCOMPLETE_ATTACHMENT)")

    what = view(lambertian(sphere(0.3)), lights=(point_light((0.3, 0.2, 1.8)),))
    before = draw(renderer, what).radiance
    what = replace(what, camera=replace(FROM_ABOVE, width=48, height=20))
    targets = renderer._targets
    small = SimpleNamespace(
        info=targets._context.info,
        texture=targets._context.texture,
        depth_texture=targets._context.depth_texture,
        framebuffer=framebuffer,
    )
    with monkeypatch.context() as patch:
        patch.setattr(targets, "_context", small)
        with pytest.raises(FsidError, match=r"48 x 20: .* smaller supersampling"):
            draw(renderer, what)
    assert draw(renderer, what).radiance.shape == (20, 48, 3)
    what = replace(what, camera=FROM_ABOVE)
    np.testing.assert_array_equal(draw(renderer, what).radiance, before)


def test_a_still_scene_is_not_blurred(renderer: Renderer) -> None:
    what = view(lambertian(sphere(0.3)), lights=(point_light((0.3, 0.2, 1.8)),))
    sharp = draw(renderer, what).radiance
    open_shutter = draw(renderer, replace(what, camera=replace(FROM_ABOVE, exposure_s=0.5))).radiance
    assert (sharp == open_shutter).all()


def test_motion_blur_is_a_box_along_the_path(renderer: Renderer) -> None:
    """A bright disc that moves d pixels during the exposure: a ramp of that length at both ends, no ghosts.

    The steps of the ramp are what is left of the single images: below 3 % of the disc's radiance.
    """
    disc = lambertian(sphere(0.3, 96), (0.9, 0.9, 0.9))
    disc = replace(disc, motion=Motion(velocity_m_s=(1.0, 0.0, 0.0)))
    camera = replace(FROM_ABOVE, width=192, height=192, exposure_s=0.3)
    frame = draw(renderer, view(disc, ambient=1.0, camera=camera))
    row = frame.radiance[96, :, 0] / frame.radiance[96, :, 0].max()
    path_px = 0.3 * 96 / np.tan(np.radians(30)) / 2
    low, high = (np.interp(level, row[:96], np.arange(96)) for level in (0.05, 0.95))
    assert 0.85 * 0.9 * path_px < high - low < 1.2 * 0.9 * path_px
    ramp = row[int(low) : int(high)]
    assert np.diff(ramp).min() > -0.005
    assert np.abs(np.diff(ramp, 2)).max() < 0.03
    assert (frame.object_id == draw(renderer, view(disc)).object_id.repeat(2, 0).repeat(2, 1)).mean() > 0.97


def test_a_small_thing_that_moves_leaves_no_ghosts(renderer: Renderer) -> None:
    """A ball of 4 pixels, a thousandth of the picture's, is a line along the 41 pixels of its path."""
    ball = lambertian(sphere(0.022, 24), (0.9, 0.9, 0.9), at(0.0, 0.0, 0.3), object_id=1)
    ball = replace(ball, motion=Motion(velocity_m_s=(3.0, 0.0, 0.0)))
    what = view(lambertian(grid(8.0), (0.1, 0.1, 0.1)), ball, ambient=1.0)
    camera = replace(FROM_ABOVE, width=192, height=108, exposure_s=0.14)
    sharp = draw(renderer, replace(what, camera=replace(camera, exposure_s=0.0)))
    assert 5 < (sharp.object_id == 1).sum() < 0.001 * sharp.object_id.size
    row = draw(renderer, replace(what, camera=camera)).radiance[53, 80:112, 0]
    assert row.min() > 0.11
    assert row.max() < 1.4 * row.min()


@pytest.mark.parametrize("turns", ["the thing", "the camera"])
def test_what_turns_once_leaves_a_disc(renderer: Renderer, turns: str) -> None:
    """A bar that ends where it began has been everywhere between: alike all around."""
    bar = lambertian(block((0.6, 0.08, 0.02)), (0.9, 0.9, 0.9), object_id=1)
    spin = (0.0, 0.0, 720.0)
    camera = replace(FROM_ABOVE, width=64, height=64, exposure_s=0.5)
    if turns == "the thing":
        bar = replace(bar, motion=Motion(spin_deg_s=spin))
    else:
        camera = replace(camera, spin_deg_s=spin)
    image = draw(renderer, view(bar, ambient=1.0, camera=camera)).radiance[..., 0]
    angle, radius_px = np.linspace(0, 2 * np.pi, 60), 0.22 * 16 / np.tan(np.radians(30))
    around = map_coordinates(image, 31.5 + radius_px * np.stack([np.sin(angle), np.cos(angle)]), order=1)
    assert around.max() < 1.3 * around.min()


def test_what_comes_into_the_picture_late_leaves_no_ghosts(renderer: Renderer) -> None:
    """A ball that the middle of the exposure does not show is a line from where it was at the start."""
    ball = lambertian(sphere(0.06, 24), (0.9, 0.9, 0.9), at(1.4, 0.0, 0.3), object_id=1)
    ball = replace(ball, motion=Motion(velocity_m_s=(-10.0, 0.0, 0.0)))
    camera = replace(FROM_ABOVE, width=96, height=32, exposure_s=0.2)
    what = view(lambertian(grid(8.0), (0.1, 0.1, 0.1)), ball, ambient=1.0, camera=camera)
    frame = draw(renderer, what)
    assert (frame.object_id == 0).all()
    row = frame.radiance[15, 72:90, 0]
    assert row.min() > 0.11
    assert row.max() < 1.4 * row.min()


@pytest.mark.parametrize(
    ("key", "good", "bad"),
    [
        ("fov_deg", (0.1, 174.9), (-10.0, 0.0, 175.0, float("nan"))),
        ("exposure_s", (0.0, 10.0), (-1.0,)),
        ("aperture_m", (0.0, 10.0), (-1.0,)),
        ("focus_m", (0.01, 1e6), (-1.0, 0.0)),
        ("softness_px", (0.0, 50.0), (-0.1, 50.1)),
        ("sharpening", (0.0, 5.0), (-0.1, 5.1)),
        ("colour_contrast", ((-0.5, 0.5),), ((0.51, 0.0), (0.0, -0.51))),
        ("chromatic_aberration", ((-0.049, 0.049),), ((0.05, 0.0), (0.0, -0.05))),
        ("target_m", ((0.0, 0.1, 0.0),), (FROM_ABOVE.position_m, (0.0, 1.0, 2.0))),
    ],
)
def test_a_camera_that_makes_no_sense_is_named(key: str, good: Sequence, bad: Sequence) -> None:
    for value in good:
        lens_of(replace(FROM_ABOVE, **{key: value}))
    for value in bad:
        with pytest.raises(FsidError, match=rf"scene\.cameras: .*{key}"):
            lens_of(replace(FROM_ABOVE, **{key: value}))


def test_things_are_seen_from_two_centimetres_on(renderer: Renderer) -> None:
    close = lambertian(grid(0.2), at=at(0.0, 0.0, FROM_ABOVE.position_m[2] - 0.025))
    frame = draw(renderer, view(lambertian(grid(8.0), object_id=1), close, ambient=1.0))
    assert (frame.object_id == 0).all()
    np.testing.assert_allclose(frame.depth, 0.025, rtol=1e-4)


def test_albedo_is_flat_where_the_material_is(renderer: Renderer) -> None:
    """Labels do not depend on the lens: a plain floor has one albedo everywhere."""
    for lens in (None, *LENSES.values()):
        camera = replace(FROM_ABOVE, distortion=lens)
        frame = draw(renderer, view(lambertian(grid(40.0), (0.2, 0.5, 0.7)), camera=camera))
        np.testing.assert_allclose(frame.albedo, np.broadcast_to((0.2, 0.5, 0.7), (96, 96, 3)), atol=1e-3)
        np.testing.assert_allclose(frame.normal[..., 2], 1.0, atol=1e-3)


def test_places_far_from_the_middle_of_the_lens_come_at_all_times() -> None:
    """Neither outwards, as the spiral runs, nor around the lens or from one of its sides to the other."""
    camera = replace(FROM_ABOVE, exposure_s=0.1, velocity_m_s=(1.0, 0.0, 0.0), aperture_m=2.0, focus_m=1.5)
    shape = camera.height, camera.width
    middle = Shot(lens_of(camera), 0.0)
    frame = SimpleNamespace(depth=np.full(shape, 2.0, np.float32), object_id=np.full(shape, -1))
    shots = shots_of(camera, (), frame, middle, LABEL_SAMPLE, 64, 64)
    assert len(shots) > 16
    times = [shot.time_s for shot in shots]
    places = np.array([shot.lens_offset for shot in shots])
    for along in (np.hypot(*places.T), *places.T, places.sum(1), places @ (1, -1)):
        assert abs(np.corrcoef(times, along)[0, 1]) < 0.3


def test_a_camera_is_where_its_velocity_and_spin_have_taken_it() -> None:
    """About its own place and an axis of the world, seen from the middle of its exposure."""
    camera = replace(FROM_ABOVE, position_m=(0.3, -1.5, 1.2), up=(0.0, 0.0, 1.0), time_s=0.4)
    camera = replace(camera, velocity_m_s=(0.5, -0.2, 0.1), spin_deg_s=(0.0, 0.0, 150.0))
    middle, later = lens_of(camera), lens_of(camera, 0.6)
    np.testing.assert_allclose(middle.position, camera.position_m)
    np.testing.assert_allclose(lens_of(camera, 0.4).rotation, middle.rotation)
    np.testing.assert_allclose(later.position, (0.4, -1.54, 1.22))
    quarter = Rotation.from_euler("z", 30, degrees=True)  # x towards y
    np.testing.assert_allclose(later.rotation, quarter.apply(middle.rotation), atol=1e-12)
    ahead = np.array((-0.3, 1.5, -1.2)) / np.linalg.norm((0.3, 1.5, 1.2))
    np.testing.assert_allclose(middle.rotation[2], ahead)
    np.testing.assert_allclose(np.cross(middle.rotation[0], middle.rotation[1]), -ahead)
    assert middle.rotation[0, 2] == pytest.approx(0)
    assert middle.rotation[1, 2] > 0


@pytest.mark.parametrize("lens", [BARREL, PINCUSHION, FISHEYE])
@pytest.mark.parametrize(("width", "height"), [(96, 64), (48, 80)])
def test_what_a_lens_looks_up_is_as_fine_as_its_image(lens: Distortion, width: int, height: int) -> None:
    """Where it stretches most to the right, by the derivative of its formula."""
    camera = replace(FROM_ABOVE, width=width, height=height, fov_deg=70.0, distortion=lens)
    seen, focal_px = lens_of(camera), width / 2 / np.tan(np.radians(35))
    x, y = np.meshgrid(np.arange(width + 2) - (width + 1) / 2, np.arange(height + 2) - (height + 1) / 2)
    points, step = undistorted(lens, np.stack([x, y], -1) / focal_px), np.array([1e-5, 0.0])
    stretch = (distorted(lens, points + step) - distorted(lens, points - step))[..., 0].max() / 2e-5
    assert 0.9 < stretch < 1.4
    for px, focal in zip(seen.seen_px, seen.seen_focal, strict=True):
        assert px % 2 == 0
        assert 0.98 < px / 2 * focal / focal_px / stretch < 1.04


def still_frame(camera: Camera, depth_m: float) -> Frame:
    """What `shots_of` looks at of a frame: all at one depth, of no object."""
    shape = camera.height, camera.width
    return SimpleNamespace(depth=np.full(shape, depth_m, np.float32), object_id=np.full(shape, -1))


def test_the_images_of_an_exposure_are_evenly_spaced_in_time_and_on_the_lens() -> None:
    """Each at its time of the moving camera, for an equal part of the opening; what is in focus stays."""
    camera = replace(FROM_ABOVE, width=96, height=64, time_s=2.0, exposure_s=0.3, aperture_m=0.4, focus_m=1.5)
    camera = replace(camera, velocity_m_s=(1.0, 0.0, 0.0))
    middle = Shot(lens_of(camera), 2.0, (0.25, -0.125))
    shots = shots_of(camera, (), still_frame(camera, 2.0), middle, LABEL_SAMPLE, 64, 64)
    count = len(shots)
    focal_px = 48 / np.tan(np.radians(30))
    assert count == round(0.3 * focal_px / 2.0 / 1.5) + 1  # neighbours are 1.5 pixels apart
    np.testing.assert_allclose(np.diff([shot.time_s for shot in shots]), 0.3 / count)
    assert np.mean([shot.time_s for shot in shots]) == pytest.approx(2.0)
    focal = np.array(middle.lens.focal)
    places = []
    for shot in shots:
        at_rest = np.add(camera.position_m, (shot.time_s - 2.0, 0, 0))
        places.append((shot.lens.position - at_rest)[:2])
        assert shot.lens.position[2] == pytest.approx(2.0)
        assert shot.aperture_m == pytest.approx(0.4 / np.sqrt(count))
        for x, y in ((0.0, 0.0), (0.3, -0.2)):  # in the plane of the focus, beside the camera's place
            point = np.add(at_rest, (x, y, -1.5))
            right, up, ahead = shot.lens.rotation @ (point - shot.lens.position)
            seen = np.array([right, -up]) / ahead * focal + shot.seen_shift
            np.testing.assert_allclose(seen, np.array([x, -y]) / 1.5 * focal + (0.5 / 96, -0.25 / 64))
    distance = np.linalg.norm(places, axis=1)
    assert distance.max() <= 0.2 * 1.1
    assert np.mean(distance**2) == pytest.approx(0.2**2 / 2, rel=0.05)  # of an even disc
    np.testing.assert_allclose(np.mean(places, axis=0), 0, atol=1e-9)


def images_of(camera: Camera, *drawables: Drawable, frame: Frame | None = None, most: int = 400) -> int:
    """How many images `shots_of` averages; of a floor 2 m before the camera where no frame is given."""
    frame = frame or still_frame(camera, 2.0)
    return len(shots_of(camera, drawables, frame, Shot(lens_of(camera), 0.0), LABEL_SAMPLE, most, most))


def test_there_are_as_many_images_as_the_widest_blur_has_steps() -> None:
    """1.5 pixels along a path; circles of 4 pixels in that of confusion; four at least, and as many as are
    allowed."""
    still = replace(FROM_ABOVE, exposure_s=0.5, height=48, time_s=3.0)
    focal_px = 48 / np.tan(np.radians(30))
    assert images_of(still) == 0
    for speed, steps in ((1e-6, 4), (0.5, 8), (3.0, 43)):
        moving = replace(still, velocity_m_s=(0.0, speed, 0.0))
        assert images_of(moving) == steps == max(round(speed * 0.5 * focal_px / 2 / 1.5) + 1, 4)
        assert images_of(replace(moving, exposure_s=0.0)) == 0
    assert images_of(moving, most=16) == 16
    for turn_deg in (20.0, 90.0, 360.0):  # about the middle of the picture: the path of its corners
        turning = replace(still, spin_deg_s=(0.0, 0.0, turn_deg / 0.5))
        path_px = np.radians(turn_deg) * np.hypot(47, 23)
        assert images_of(turning) == pytest.approx(path_px / 1.5 + 1, rel=0.03)
    opened = replace(still, aperture_m=0.5, focus_m=1.0)
    across_px = 0.5 * focal_px * (1 / 1.0 - 1 / 2.0)
    assert images_of(opened) == round(np.pi / 4 * (across_px / 4) ** 2) + 1 == 22
    assert images_of(opened, most=9) == 9


def test_the_path_of_one_small_thing_counts_be_it_seen_or_not() -> None:
    """Where the middle of the exposure does not show it, that of its box while it is in the picture, which
    with a lens may reach farther than without; its scale and turn belong to it."""
    camera = replace(FROM_ABOVE, exposure_s=0.5, width=48, height=32)
    turned = Transform(ZERO, (0.0, 0.0, 90.0), (3.0, 1.0, 1.0))
    half = block((0.1, 0.1, 0.1))
    half = replace(half, vertices=half.vertices + np.float32([0.05, 0.0, 0.0]))
    slab = lambertian(half, at=turned)  # 0.3 m long from its place on, along y
    slab = replace(slab, object_id=1, motion=Motion(velocity_m_s=(2.0, 0.0, 0.0)))
    frame = still_frame(camera, 2.0)
    frame.object_id[16, 24] = 1
    focal_px = 24 / np.tan(np.radians(30))
    assert images_of(camera, slab, frame=frame) == round(1.0 * focal_px / 2 / 1.5) + 1

    def hidden(x_m: float, y_m: float, z_m: float) -> Drawable:
        return replace(slab, transform=replace(slab.transform, position_m=(x_m, y_m, z_m)))

    assert images_of(camera, hidden(0.0, 0.0, -1.0)) == round(1.0 * focal_px / 2.9 / 1.5) + 1
    for lens, seen_m, unseen_m in ((None, -1.4, -1.5), (BARREL, -1.72, -1.8)):
        bent = replace(camera, distortion=lens)
        assert images_of(bent, hidden(0.0, seen_m, -1.0)) > 8
        assert images_of(bent, hidden(0.0, unseen_m, -1.0)) == 4
    for place in ((5.0, 0.0, -1.0), (0.0, 0.0, 3.0)):
        assert images_of(camera, hidden(*place)) == 4
