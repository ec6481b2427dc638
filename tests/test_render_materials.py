"""Every material family on a lit ball, 48 x 48 pixels each, against a golden sheet.

One render shows them all, in their colours of nature or in three that differ, from bakes of 128 texels; each
ball is compared on its own, so that a failure names the families. See golden_images.py for the tolerance.
"""

from __future__ import annotations

import numpy as np
import pytest

from fsid.assets import material_colours, material_families
from fsid.render import Renderer
from fsid.render.drawable import Drawable, View
from fsid.scene.model import Camera, Light, Material, Transform
from golden_images import difference_from, encoded, keep_failure, too_different
from render_scenes import sphere

COLUMNS, TILE_PX, PITCH_M = 12, 48, 0.1
DISTANCE_M = 4.0
COLOURS = ((0.55, 0.3, 0.12), (0.15, 0.3, 0.5), (0.7, 0.65, 0.5))
FAMILIES = material_families()
ROWS = -(-len(FAMILIES) // COLUMNS)


def place(index: int) -> tuple[float, float, float]:
    row, column = divmod(index, COLUMNS)
    return ((column - (COLUMNS - 1) / 2) * PITCH_M, ((ROWS - 1) / 2 - row) * PITCH_M, 0.0)


def sheet() -> View:
    ball = sphere(0.47 * PITCH_M, 40)
    balls = []
    for i, family in enumerate(FAMILIES):
        colours = material_colours(family, 0) or COLOURS
        material = Material(family, 0, colours, PITCH_M, 0.0, 1.0, 1.0)
        balls.append(Drawable(ball, Transform(place(i), (20.0, 0.0, 0.0), (1.0, 1.0, 1.0)), (material,), i))
    camera = Camera(
        (0.0, 0.0, DISTANCE_M),
        (0.0, 0.0, 0.0),
        (0.0, 1.0, 0.0),
        float(np.degrees(2 * np.arctan(COLUMNS * PITCH_M / 2 / DISTANCE_M))),
        COLUMNS * TILE_PX,
        ROWS * TILE_PX,
    )
    light = Light("point", (-3.0, 3.0, 4.0), (0.0, 0.0, -1.0), (60.0, 60.0, 60.0), 0.3, 360.0)
    return View(tuple(balls), (light,), (0.25, 0.25, 0.25), camera, (12.0, 12.0, 6.0), room_floor_m=-1.0)


def test_every_material_family_looks_as_it_did() -> None:
    with Renderer(texture_size=128) as renderer:
        frame = renderer.draw(sheet())
    assert np.isfinite(frame.radiance).all()
    assert set(np.unique(frame.object_id)) == set(range(-1, len(FAMILIES)))
    image = encoded(frame.radiance, 0.9)
    difference = difference_from("materials", image)
    tiles = (
        difference.reshape(ROWS, TILE_PX, COLUMNS, TILE_PX, 3).swapaxes(1, 2).reshape(-1, TILE_PX, TILE_PX, 3)
    )
    wrong = {name: what for name, tile in zip(FAMILIES, tiles, strict=False) if (what := too_different(tile))}
    if wrong:
        pytest.fail(f"{wrong}; {keep_failure('materials', image, difference)}")
