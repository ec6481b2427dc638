"""Compute shaders make the image of the fragment shaders: lenses, glass, mirrors, hard shadows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fsid.render import Frame, Renderer
from fsid.scene import Distortion, LightConfig, Scene, SceneConfig, sample

BARREL = Distortion("brown-conrady", (-0.18, 0.03, 0.001, -0.001, 0.0))
FISHEYE = Distortion("fisheye", (-0.03, 0.005, 0.0, 0.0))


def scene(seed: int, lens: Distortion | None = None, **config: object) -> Scene:
    found = sample(SceneConfig(objects=(8, 12), **config), seed, width=130, height=74)
    cameras = tuple(replace(camera, distortion=lens) for camera in found.cameras)
    return replace(found, cameras=cameras)


def drawn(scenes: list[Scene], *, compute: bool, supersampling: int) -> list[Frame]:
    with Renderer(texture_size=64, supersampling=supersampling, compute=compute) as renderer:
        return [renderer.render(each) for each in scenes]


def has_glass(which: Scene) -> bool:
    return any(material.transmission > 0 for part in which.materials for material in part)


@pytest.mark.parametrize(("supersampling", "most"), [(2, 4), (1, 1), (3, 1)])
def test_compute_shaders_make_the_same_image(supersampling: int, most: int) -> None:
    points = LightConfig(count=(6, 6), kind_shares=(1.0, 0.0, 0.0))
    scenes = [scene(3), scene(2, FISHEYE), scene(11, BARREL), scene(4, lights=points)][:most]
    assert has_glass(scenes[0])
    pairs = zip(
        drawn(scenes, compute=False, supersampling=supersampling),
        drawn(scenes, compute=True, supersampling=supersampling),
        strict=True,
    )
    for fragments, computed in pairs:
        np.testing.assert_array_equal(computed.object_id, fragments.object_id)
        np.testing.assert_allclose(computed.depth, fragments.depth, rtol=1e-5)
        np.testing.assert_allclose(computed.albedo, fragments.albedo, atol=2e-4)
        np.testing.assert_allclose(computed.normal, fragments.normal, atol=2e-3)
        off = np.abs(computed.radiance - fragments.radiance) > 1e-3 * fragments.radiance + 1e-6
        assert off.mean() < 1e-3


def test_an_image_may_have_any_size() -> None:
    """Groups of pixels that reach beyond the image write nothing there, and leave nothing out."""
    for width, height in ((16, 16), (18, 34), (64, 20)):
        which = sample(SceneConfig(objects=(3, 3)), 5, width=width, height=height)
        fragments, computed = (drawn([which], compute=c, supersampling=2)[0] for c in (False, True))
        assert computed.radiance.shape == (height, width, 3)
        np.testing.assert_allclose(computed.radiance, fragments.radiance, rtol=1e-3, atol=1e-6)
