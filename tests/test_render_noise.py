"""A clean image holds no noise of the renderer's making: other samples, the same picture.

What may differ between two renders of one scene is where the taps of shadows and occlusion lie and where
the samples lie in a pixel. Differences are scaled to mid-grey 0.18 and compared with 5 % of the weakest
read noise of the built-in profiles, each at its lowest published ISO with sigma2 > 0 in all four sites:
2.33e-4, one green of galaxy-s22-plus-tele at ISO 50. (Some entries at low ISO are 0 or nearly so in one
site: fits of noise that could not be told from none.) Smooth: one object, and radiance within 3 % over 5 x
5 pixels, in every image that is compared.

Measured at 480 x 480 pixels, other taps and other phase: 93.2 % and 96.1 % of smooth pixels below the 5 %;
95th percentile 2.4e-5 and 6.5e-6; root mean square of the fine grain 1.6e-5 and 2.8e-6, which is 6.9 % and
1.2 % of that read noise, and 2.6 % and 0.5 % where the radiance is within 1 %. With other taps of shadows
alone 99.7 %; what is left is occlusion, and it is no grain: its taps are points, and how many of them an
occluder covers changes with their places, smoothly from pixel to pixel. Another phase also sees the
curvature of a smooth image, more of it the fewer the pixels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter, uniform_filter

from fsid.assets import MaterialMaps
from fsid.render import Renderer
from fsid.render.drawable import View
from fsid.render.quality import tap_table
from fsid.render.texels import Texels, texels_of
from fsid.scene.model import Material, Transform
from fsid.sensor.profiles import load_profile, profile_names
from render_scenes import FROM_ABOVE, bake_plain, block, grid, lambertian, point_light, sphere, view

READ_NOISE = 2.33e-4
LIMIT = 0.05 * READ_NOISE


def scene() -> View:
    box = Transform((0.5, -0.2, 0.0), (0.0, 0.0, 20.0), (1.0, 1.0, 1.0))
    return view(
        lambertian(grid(6.0)),
        lambertian(sphere(0.3, 200), object_id=1),
        lambertian(block((0.3, 0.2, 0.4)), at=box, object_id=2),
        lights=(
            point_light((0.3, 0.2, 1.8), intensity=4.0, radius_m=0.1),
            point_light((-1.2, 0.5, 1.5), intensity=2.0, radius_m=0.05),
        ),
        ambient=0.1,
        camera=replace(FROM_ABOVE, width=480, height=480),
    )


def check(
    difference: np.ndarray, images: Sequence[np.ndarray], ids: Sequence[np.ndarray], share: float
) -> None:
    """That share of smooth pixels of all images below LIMIT."""
    smooth = smooth_in(images, ids, 0.03)
    assert smooth.mean() > 0.4
    assert np.quantile(np.abs(difference)[smooth] * 0.18 / images[0][smooth], share) < LIMIT


def smooth_in(images: Sequence[np.ndarray], ids: Sequence[np.ndarray], within: float) -> np.ndarray:
    """(H, W) bool: one object, and a radiance that varies by less than `within`, over 5 x 5 pixels."""
    even = [maximum_filter(image, 5) - minimum_filter(image, 5) < within * image for image in images]
    same = [maximum_filter(i, 5) == minimum_filter(i, 5) for i in ids]
    return np.logical_and.reduce(even + same)


def grain(difference: np.ndarray, image: np.ndarray, where: np.ndarray) -> float:
    """Root mean square of what is left of a difference without its mean over 5 x 5 pixels, at mid-grey."""
    fine = (difference - uniform_filter(difference, 5)) * 0.18 / image
    return float(np.sqrt((fine[where] ** 2).mean()))


def test_the_limit_is_that_of_the_weakest_profile() -> None:
    sigmas = []
    for name in profile_names():
        sigma2 = np.array(load_profile(name).sigma2)
        sigmas.append(np.sqrt(sigma2[(sigma2 > 0).all(axis=1)][0].min()))
    assert min(sigmas) == pytest.approx(READ_NOISE, rel=2e-3)


def test_other_taps_give_the_same_picture(renderer: Renderer) -> None:
    before = renderer.draw(scene(), bake=bake_plain)
    taps = tap_table(renderer._quality)
    turn = np.array([[np.cos(1.0), -np.sin(1.0)], [np.sin(1.0), np.cos(1.0)]], np.float32)
    renderer._taps.write(np.ascontiguousarray(taps @ turn.T).tobytes())
    after = renderer.draw(scene(), bake=bake_plain)
    renderer._taps.write(taps.tobytes())
    images = [frame.radiance[..., 0].astype(float) for frame in (before, after)]
    ids, difference = [before.object_id], images[1] - images[0]
    check(difference, images, ids, 0.925)
    assert grain(difference, images[0], smooth_in(images, ids, 0.03)) < 2 * LIMIT
    assert grain(difference, images[0], smooth_in(images, ids, 0.01)) < LIMIT
    assert difference.any()


def test_another_phase_gives_the_same_picture(renderer: Renderer) -> None:
    frames = [renderer.draw(scene(), bake=bake_plain, shift_px=(s, s)) for s in (-0.21, 0.0, 0.21)]
    before, still, after = images = [frame.radiance[..., 0].astype(float) for frame in frames]
    ids, difference = [frame.object_id for frame in frames], (before + after) / 2 - still
    check(difference, [still, before, after], ids, 0.95)
    assert grain(difference, still, smooth_in(images, ids, 0.03)) < LIMIT


def test_filtered_textures_hold_no_steps(renderer: Renderer) -> None:
    """A texel spans 26 pixels; between two of them the filter has to be finer than the texels' 8 bits."""

    def bake_waves(family: str, variant: int, size: int) -> Texels:
        wave = 0.5 + 0.5 * np.cos(2 * np.pi * np.arange(size, dtype=np.float32) / size)
        maps = {name: np.full((size, size), 0.5, np.float32) for name in ("detail", "height")}
        maps |= {name: np.zeros((size, size), np.float32) for name in ("pattern", "metallic")}
        rough = np.ones((size, size), np.float32)
        return texels_of(
            MaterialMaps(mix=np.outer(wave, wave), roughness=rough, relief_m=0.001, tile_m=8.0, **maps)
        )

    material = Material("waves", 0, ((0.4,) * 3, (0.6,) * 3, (0.5,) * 3), 1.0, 0.0, 1.0, 1.0)
    sheet = replace(lambertian(grid(6.0)), materials=(material,))
    lit = view(sheet, ambient=0.5, camera=replace(FROM_ABOVE, width=480, height=480))
    frames = [renderer.draw(lit, bake=bake_waves, shift_px=(s, s)) for s in (-0.21, 0.0, 0.21)]
    before, still, after = images = [frame.radiance[..., 0].astype(float) for frame in frames]
    smooth = smooth_in(images, [frame.object_id for frame in frames], 0.03)
    assert smooth.mean() > 0.4
    assert np.ptp(still) > 0.05 * still.mean()
    assert grain((before + after) / 2 - still, still, smooth) < LIMIT
