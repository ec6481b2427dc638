"""Smooth ground mirrors what stands on it: against a scene that really is there below it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from fsid.render import Renderer
from fsid.render.drawable import BACKGROUND_ID, Drawable, View
from fsid.scene.model import Camera, Distortion, Transform
from render_scenes import STILL, bake_plain, block, grid, lambertian, plain, point_light, view

ONE = (1.0, 1.0, 1.0)
ACROSS = Camera((0.0, -1.6, 0.7), (0.0, 0.2, 0.05), (0.0, 0.0, 1.0), 45.0, 160, 120)
LIGHT = point_light((0.5, -1.2, 1.6), 3.0, 0.02)


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    with Renderer(texture_size=64) as renderer:
        yield renderer


def ground(roughness: int, **lobes: float) -> Drawable:
    material = replace(plain(ONE, roughness=roughness, family="metal"), **lobes)
    return Drawable(grid(5.0), STILL, (material,), BACKGROUND_ID)


def things(*floor: Drawable, camera: Camera = ACROSS) -> View:
    red = lambertian(block((0.3, 0.3, 0.4)), (0.8, 0.1, 0.1), Transform((-0.3, 0.3, 0.0), (0, 0, 20), ONE), 0)
    blue = lambertian(
        block((0.2, 0.2, 0.2)), (0.1, 0.2, 0.8), Transform((0.35, 0.1, 0.3), (0, 0, 50), ONE), 1
    )
    return view(*floor, red, blue, lights=(LIGHT,), ambient=0.2, camera=camera)


def test_a_mirror_shows_what_a_camera_below_it_sees(renderer: Renderer) -> None:
    """Seen from M x along M R, without the floor, the things look as in the floor."""
    frame = renderer.draw(things(ground(10)), bake=bake_plain)
    x, y, z = ACROSS.position_m
    below = replace(
        ACROSS, position_m=(x, y, -z), target_m=(*ACROSS.target_m[:2], -ACROSS.target_m[2]), up=(0, 0, -1)
    )
    direct = renderer.draw(things(camera=below), bake=bake_plain)
    shown = np.flip(direct.radiance, 1)  # a camera turned over sees left and right exchanged
    there = np.flip(direct.object_id, 1) >= 0
    floor = frame.object_id == BACKGROUND_ID
    both = there & floor
    assert both.sum() > 500
    ratio = frame.radiance[both].mean(-1) / shown[both].mean(-1)
    assert np.median(ratio) == pytest.approx(1.0, abs=0.05)
    red = both & (np.flip(direct.object_id, 1) == 0)
    colour = frame.radiance[red].mean(0)
    assert colour[0] > 3 * colour[1]


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
