"""A texture is averaged over the footprint of a pixel, however that lies: against eight times finer pixels.

What a pixel shows of a checked floor that runs away from the camera is the mean of 8 x 8 smaller pixels. With
the camera level, the sides of the footprint are its axes; rolled over by 45 degrees they are not, both sides
are long and nearly parallel. Taken for its axes, they would blur the near floor and draw bands across the far
one.

So are highlights on relief whose texels are as large as pixels: without what the normals do inside a pixel,
those of a lamp are isolated bright pixels.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from fsid.assets import MaterialMaps
from fsid.render import Renderer
from fsid.render.drawable import Drawable, View
from fsid.render.texels import Texels, texels_of
from fsid.scene.model import Camera, Material, Vec3
from render_scenes import FROM_ABOVE, STILL, grid, plain, point_light, view

WIDTH, HEIGHT, FINER = 128, 80, 8
CHECKED = Material("checks", 0, ((0.05,) * 3, (0.8,) * 3, (0.1,) * 3), 0.8, 17.0, 1.0, 0.0)
LEVEL, ROLLED = (0.0, 0.0, 1.0), (0.7, 0.0, 0.7)


@pytest.fixture(scope="module")
def renderer() -> Iterator[Renderer]:
    with Renderer(texture_size=256) as renderer:
        yield renderer


def checks(family: str, variant: int, size: int) -> Texels:
    eighth = np.arange(size) * 8 // size
    plane = np.zeros((size, size), np.float32)
    check = plane + ((eighth[:, None] + eighth) % 2)
    maps = MaterialMaps(check, plane, plane + 0.5, plane + 1, plane + 0.5, plane, relief_m=0.001, tile_m=1.0)
    return texels_of(maps)


def floor(up: Vec3, finer: int) -> View:
    """A checked floor, lit evenly, that a camera 0.9 m above it sees up to 25 m."""
    camera = Camera((0.0, -20.0, 0.9), (0.0, 0.0, -1.0), up, 50.0, WIDTH * finer, HEIGHT * finer)
    return view(Drawable(grid(50.0), STILL, (CHECKED,), 0, specular=0.0), ambient=1.0, camera=camera)


@pytest.mark.parametrize(("up", "near", "far"), [(LEVEL, 0.02, 0.035), (ROLLED, 0.032, 0.055)])
def test_a_pixel_shows_the_mean_of_finer_ones(renderer: Renderer, up: Vec3, near: float, far: float) -> None:
    """near, far: root mean square error from 1 to 4 and from 4 to 8 m; the checks are 0.75 apart."""
    frame = renderer.draw(floor(up, 1), bake=checks)
    fine = renderer.draw(floor(up, FINER), bake=checks).radiance[..., 0]
    error = frame.radiance[..., 0] - fine.reshape(HEIGHT, FINER, WIDTH, FINER).mean((1, 3))
    for low, high, limit in ((1, 4, near), (4, 8, far)):
        there = (frame.depth > low) & (frame.depth < high)
        assert there.sum() > 400
        assert np.sqrt((error[there] ** 2).mean()) < limit


def hammered(family: str, variant: int, size: int) -> Texels:
    half = np.full((size, size), 0.5, np.float32)
    height = np.random.default_rng(7).random((size, size), np.float32)
    return texels_of(
        MaterialMaps(0 * half, 0 * half, half, 2 * half, height, 0 * half, relief_m=0.0025, tile_m=1.0)
    )


@pytest.mark.parametrize(("clearcoat", "roughness", "most"), [(1.0, 1.0, 1.3), (0.0, 0.25, 0.8)])
def test_highlights_on_relief_are_averaged_over_the_pixel(
    renderer: Renderer, clearcoat: float, roughness: float, most: float
) -> None:
    """Errors relative to the mean: coated 1.01, and 1.68 if only the normal in the middle counts; bare 0.66
    and 0.94."""
    relief = replace(plain((0.05,) * 3), clearcoat=clearcoat, roughness_scale=roughness, tile_m=6.0)
    square = Drawable(grid(4.0), STILL, (relief,), 0)
    what = view(square, lights=(point_light((0.3, 0.0, 2.0), 1.0, 0.02),))
    width, finer = FROM_ABOVE.width, 4
    camera = replace(FROM_ABOVE, width=finer * width, height=finer * width)
    light = renderer.draw(what, bake=hammered).radiance
    fine = renderer.draw(replace(what, camera=camera), bake=hammered).radiance
    mean = fine.reshape(width, finer, width, finer, 3).mean((1, 3))
    assert light.mean() == pytest.approx(mean.mean(), rel=0.05)
    assert np.sqrt(((light - mean) ** 2).mean()) < most * mean.mean()
