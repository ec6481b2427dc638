"""Flat smooth surfaces mirror what is before them: against a scene that really is seen from behind them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from fsid.assets.solids import rotation_matrix
from fsid.render import Renderer
from fsid.render.drawable import BACKGROUND_ID, Drawable, View
from fsid.render.frame import Frame
from fsid.scene.model import Camera, Distortion, Transform
from render_scenes import STILL, bake_plain, block, grid, lambertian, plain, point_light, sphere, view

ONE = (1.0, 1.0, 1.0)
MIRROR_ID = 7
ACROSS = Camera((0.0, -1.6, 0.7), (0.0, 0.2, 0.05), (0.0, 0.0, 1.0), 45.0, 160, 120)
LIGHT = point_light((0.5, -1.2, 1.6), 3.0, 0.02)


def ground(roughness: int, **lobes: float) -> Drawable:
    material = replace(plain(ONE, roughness=roughness, family="metal"), **lobes)
    return Drawable(grid(5.0), STILL, (material,), BACKGROUND_ID)


def things(*floor: Drawable, camera: Camera = ACROSS) -> View:
    red = lambertian(block((0.3, 0.3, 0.4)), (0.8, 0.1, 0.1), Transform((-0.3, 0.3, 0.0), (0, 0, 20), ONE), 0)
    blue = lambertian(
        block((0.2, 0.2, 0.2)), (0.1, 0.2, 0.8), Transform((0.35, 0.1, 0.3), (0, 0, 50), ONE), 1
    )
    return view(*floor, red, blue, lights=(LIGHT,), ambient=0.2, camera=camera)


def panel(at: Transform, roughness: int = 10, family: str = "metal") -> Drawable:
    """A flat thing of 1.2 m that looks up before it is turned."""
    return Drawable(grid(1.2, 3), at, (plain(ONE, roughness=roughness, family=family),), MIRROR_ID)


WALL = Transform((0.0, 0.8, 0.5), (90.0, 0.0, 0.0), ONE)
LEANING = Transform((0.5, 0.8, 0.4), (70.0, 0.0, -25.0), ONE)


@pytest.mark.parametrize(
    "mirror", [ground(10), panel(WALL), panel(LEANING)], ids=["ground", "wall", "leaning"]
)
def test_a_mirror_shows_what_a_camera_behind_it_sees(renderer: Renderer, mirror: Drawable) -> None:
    """Seen from M x along M R, without the mirror, the things look as in it."""
    camera = replace(ACROSS, width=320, height=240)
    frame = renderer.draw(things(mirror, camera=camera), bake=bake_plain)
    n = rotation_matrix(*mirror.transform.rotation_deg)[:, 2]
    d = float(n @ mirror.transform.position_m)
    position, target, up = (
        tuple(at - 2 * (np.dot(at, n) - offset) * n)
        for at, offset in ((ACROSS.position_m, d), (ACROSS.target_m, d), (ACROSS.up, 0.0))
    )
    behind = replace(camera, position_m=position, target_m=target, up=up)
    direct = renderer.draw(things(camera=behind), bake=bake_plain)
    shown = np.flip(direct.radiance, 1)  # a camera turned over sees left and right exchanged
    inside = binary_erosion(np.flip(direct.object_id, 1) >= 0, iterations=9)  # an image is blurred
    both = inside & (frame.object_id == mirror.object_id)
    assert both.sum() > 500
    ratio = frame.radiance[both].mean(-1) / shown[both].mean(-1)
    assert np.median(ratio) == pytest.approx(1.0, abs=0.05)
    red = both & (np.flip(direct.object_id, 1) == 0)
    colour = frame.radiance[red].mean(0)
    assert colour[0] > 3 * colour[1]


def test_a_wall_mirror_and_the_ground_show_images_at_once(renderer: Renderer) -> None:
    """The red block is seen in each of them, as often as in each alone."""
    frame = renderer.draw(things(ground(10), panel(WALL)), bake=bake_plain)
    for one, other in ((ground(10), panel(WALL, roughness=60)), (panel(WALL), ground(60))):
        alone = renderer.draw(things(other, one), bake=bake_plain)
        red, red_alone = (_red(image)[image.object_id == one.object_id].sum() for image in (frame, alone))
        assert red_alone > 100
        assert red == pytest.approx(red_alone, rel=0.1)


def _red(frame: Frame) -> np.ndarray:
    return np.asarray(frame.radiance[..., 0] > 2 * frame.radiance[..., 1])


@pytest.mark.parametrize(
    ("thing", "images"),
    [
        (panel(WALL), 1),
        (panel(WALL, family="plain"), 0),  # 4 % of a tenth of the picture
        (panel(WALL, roughness=60), 0),
        (panel(Transform((0.0, 9.0, 0.5), (90.0, 0.0, 0.0), ONE)), 0),  # too small
        (panel(Transform((0.0, 0.8, 0.5), (-90.0, 0.0, 0.0), ONE)), 1),  # its back
        (Drawable(sphere(0.5), STILL, (plain(ONE, roughness=10, family="metal"),), MIRROR_ID), 0),
    ],
    ids=["mirror", "weak", "rough", "far", "back", "round"],
)
def test_what_shows_little_costs_no_image(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch, thing: Drawable, images: int
) -> None:
    drawn: list[int] = []
    draw = Renderer._draw_mirror
    monkeypatch.setattr(Renderer, "_draw_mirror", lambda *a: (drawn.append(1), draw(*a))[1])
    assert np.isfinite(renderer.draw(things(thing), bake=bake_plain).radiance).all()
    assert len(drawn) == images


def test_rough_ground_has_no_image_and_costs_none(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[int] = []
    draw = Renderer._draw_mirror
    monkeypatch.setattr(Renderer, "_draw_mirror", lambda *a: (drawn.append(1), draw(*a))[1])
    rough = renderer.draw(things(ground(60)), bake=bake_plain)
    assert not drawn
    renderer.draw(things(ground(60, clearcoat=1.0, clearcoat_roughness=0.1)), bake=bake_plain)
    assert drawn
    assert np.isfinite(rough.radiance).all()


def test_an_image_fades_with_roughness(renderer: Renderer) -> None:
    """The contrast of the floor falls, and at the limit nothing jumps."""
    contrast = []
    for roughness in (15, 30, 45, 49, 51):
        frame = renderer.draw(things(ground(roughness)), bake=bake_plain)
        floor = (frame.object_id == BACKGROUND_ID) & np.isfinite(frame.depth)
        red = frame.radiance[floor][:, 0] / frame.radiance[floor].mean(-1)
        contrast.append(float(red.std()))
        assert np.isfinite(frame.radiance).all()
    assert contrast[0] > contrast[1] > contrast[2]
    assert contrast[3] == pytest.approx(contrast[4], abs=0.01)


def test_a_bent_lens_sees_the_mirror_image_where_it_is(renderer: Renderer) -> None:
    """Undistorting the picture of a bent lens gives that of the pinhole, reflections too."""
    lens = Distortion("brown-conrady", (0.0, 0.0, 0.0, 0.0, 0.0))
    camera = replace(ACROSS, distortion=lens)
    plain_image = renderer.draw(things(ground(10)), bake=bake_plain).radiance
    bent = renderer.draw(things(ground(10), camera=camera), bake=bake_plain).radiance
    relative = np.abs(bent - plain_image).mean(-1) / np.median(plain_image)
    assert np.median(relative) < 0.01
    assert np.quantile(relative, 0.95) < 0.2


def test_a_wall_that_shines_is_seen_in_a_mirror(renderer: Renderer) -> None:
    """As bright as it is: it is no light, which would have a highlight instead."""
    behind = Transform((0.0, 1.0, 0.0), (90.0, 0.0, 0.0), ONE)
    shown = []
    for emission in (0.0, 2.0):
        wall = Drawable(grid(8.0), behind, (replace(plain(), emission=emission),), BACKGROUND_ID)
        frame = renderer.draw(view(ground(10), wall, ambient=0.2, camera=ACROSS), bake=bake_plain)
        shown.append(frame.radiance[[5, 60], 80].mean(-1))  # the wall, and the floor before it
    seen, mirrored = shown[1] - shown[0]
    assert seen == pytest.approx(1.0, rel=0.01)
    assert mirrored == pytest.approx(seen, rel=0.05)
