"""Matter without order does not repeat on large surfaces, and keeps its look otherwise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fsid.assets import bake_material
from fsid.render import Renderer
from fsid.render.drawable import Drawable
from fsid.render.texels import Texels, texels_of
from fsid.scene import BackgroundConfig, SceneConfig, sample
from fsid.scene.model import Camera, Material
from fsid.scene.pools import POOLS, WITHOUT_ORDER
from render_scenes import STILL, grid, view

TILES, TILE_PX, WIDTH, HEIGHT = 8, 48, 8 * 48, 6 * 48
ABOVE = Camera((0.0, 0.0, 10.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 2 * 21.80140948635181, WIDTH, HEIGHT)
"""8 m wide at a distance of 10 m: eight tiles of a metre."""
MARBLE = Material("marble", 0, ((0.1,) * 3, (0.7,) * 3, (0.4,) * 3), 1.0, 0.0, 1.0, 0.0)


def bake(family: str, variant: int, size: int) -> Texels:
    return texels_of(bake_material(family, variant, size))


@pytest.fixture(scope="module")
def albedo() -> dict[bool, np.ndarray]:
    """(H, W) of a marble floor from above, as it is and patched."""
    with Renderer(texture_size=256) as renderer:
        return {
            patched: renderer.draw(
                view(
                    Drawable(grid(20.0), STILL, (replace(MARBLE, patched=patched),), 0),
                    ambient=1.0,
                    camera=ABOVE,
                ),
                bake=bake,
            ).albedo[..., 0]
            for patched in (False, True)
        }


def likeness(image: np.ndarray, step: int) -> float:
    """Correlation of an image with itself, `step` pixels to the right."""
    return float(np.corrcoef(image[:, :-step].ravel(), image[:, step:].ravel())[0, 1])


def test_a_patched_texture_does_not_repeat(albedo: dict[bool, np.ndarray]) -> None:
    assert likeness(albedo[False], TILE_PX) > 0.98
    for tiles in range(1, TILES - 1):
        assert abs(likeness(albedo[True], tiles * TILE_PX)) < 0.4


def test_it_keeps_brightness_contrast_and_fineness(albedo: dict[bool, np.ndarray]) -> None:
    plain, patched = albedo[False], albedo[True]
    assert patched.mean() == pytest.approx(plain.mean(), rel=0.1)
    assert patched.std() == pytest.approx(plain.std(), rel=0.2)
    slopes = [np.abs(np.diff(image, axis=1)).mean() for image in (plain, patched)]
    assert slopes[1] == pytest.approx(slopes[0], rel=0.25)


def test_no_seam_is_sharper_than_the_texture(albedo: dict[bool, np.ndarray]) -> None:
    plain, patched = (np.abs(np.diff(albedo[key], axis=1)) for key in (False, True))
    assert np.quantile(patched, 0.999) < 1.3 * np.quantile(plain, 0.999)


def test_grounds_of_scenes_are_patched_where_they_have_no_order() -> None:
    assert {"grass", "gravel", "snow"} <= WITHOUT_ORDER & set(POOLS["ground"])
    assert not WITHOUT_ORDER & {"brick", "tiles", "parquet", "wallpaper", "cobblestones", "shingles"}
    config = SceneConfig(objects=(1, 1), background=BackgroundConfig(kind_shares=(0.5, 0, 0, 0.5)))
    for seed in range(12):
        for material in sample(config, seed).background.materials.values():
            assert material.patched == (material.family in WITHOUT_ORDER)
