"""Red and blue of a lens with lateral chromatic aberration: interpolated in the image that green sees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import maximum_filter

from fsid.errors import FsidError
from fsid.render import Frame, Renderer
from fsid.render.camera import lens_of
from fsid.render.drawable import view_of
from fsid.render.fringes import magnified, with_margin
from fsid.scene import SceneConfig, sample
from fsid.scene.model import Camera, Distortion
from render_scenes import FROM_ABOVE

FRINGED = replace(FROM_ABOVE, width=96, height=64, chromatic_aberration=(-0.03, 0.02))


def waves(camera: Camera, red: float = 0.0, blue: float = 0.0, *, period_px: float) -> np.ndarray:
    """(H, W, 3) waves about the middle, red and blue of them magnified."""
    y, x = (np.arange(size) - (size - 1) / 2 for size in (camera.height, camera.width))
    across, down = (2 * np.pi / period_px * direction for direction in (0.8, 0.6))
    planes = [
        2 + np.sin(across * x / (1 + growth)) * np.cos(down * y[:, None] / (1 + growth))
        for growth in (red, 0.0, blue)
    ]
    return np.stack(planes, -1).astype(np.float32)


def test_waves_are_magnified_up_to_the_edges() -> None:
    """Waves of five pixels keep their place and 97 % of their height, at the borders too."""
    larger, margin = with_margin(FRINGED)
    wanted = waves(FRINGED, *FRINGED.chromatic_aberration, period_px=5.0)
    found = magnified(waves(larger, period_px=5.0), FRINGED, margin)
    np.testing.assert_array_equal(found[..., 1], wanted[..., 1])
    np.testing.assert_allclose(found, wanted, atol=0.06)
    assert np.abs(found - wanted)[..., [0, 2]].std() < 0.015


@pytest.mark.parametrize("fringes", [(-0.049, 0.049), (0.049, -0.049), (0.0, -0.03), (0.03, 0.0)])
@pytest.mark.parametrize("size", [(96, 64), (64, 96), (95, 61)])
def test_every_pixel_is_where_its_colour_is_magnified_to(size: tuple[int, int], fringes: tuple) -> None:
    """x = c + (x' - c) / (1 + a) on average, read from slopes along both axes; even light stays even."""
    camera = replace(FROM_ABOVE, width=size[0], height=size[1], chromatic_aberration=fringes)
    larger, margin = with_margin(camera)
    for axis, (wide, more) in enumerate(((camera.height, larger.height), (camera.width, larger.width))):
        away = np.arange(more) - (more - 1) / 2
        slope = (away if axis else away[:, None]) + np.full((larger.height, larger.width), 1000.0)
        found = magnified(np.repeat(slope[..., None], 3, -1).astype(np.float32), camera, margin) - 1000.0
        inner = (np.arange(wide) - (wide - 1) / 2)[4:-4]
        for colour, growth in enumerate((fringes[0], 0.0, fringes[1])):
            line = np.polyfit(inner, found[..., colour].mean(1 - axis)[4:-4], 1)
            np.testing.assert_allclose(line, (1 / (1 + growth), 0.0), atol=1e-3)
    even = np.full((larger.height, larger.width, 3), 7.5, np.float32)
    np.testing.assert_allclose(magnified(even, camera, margin), 7.5, rtol=1e-6)


@pytest.mark.parametrize(("size", "fringes"), [((1920, 1080), (0.01, -0.049)), ((1080, 1920), (-0.049, 0.0))])
def test_a_margin_holds_what_is_interpolated_and_hardly_more(size: tuple[int, int], fringes: tuple) -> None:
    """The outermost pixel is read from 1 / (1 + a) times as far from the middle, and the three beyond it."""
    camera = replace(FROM_ABOVE, width=size[0], height=size[1], chromatic_aberration=fringes)
    outermost = 1919 / 2 * (1 / 0.951 - 1)
    assert outermost + 3 <= with_margin(camera)[1] <= outermost + 6


def test_a_lamp_has_no_black_ring() -> None:
    """Nothing beside it loses more than a quarter per axis, and nothing is much brighter than the lamp, or
    four pixels beside it than what is there."""
    larger, margin = with_margin(FRINGED)
    image = np.ones((larger.height, larger.width, 3), np.float32)
    image[20:40, 30:60] = 1000.0
    found = magnified(image, FRINGED, margin)
    assert found.min() >= 0.75**2
    assert found.max() <= 1000.0 * 1.25**2
    beside = maximum_filter(found > 500.0, (9, 9, 1))
    assert 0.1 < beside.mean() < 0.3
    assert found[~beside].max() <= 1.25**2


def test_a_lens_without_fringes_needs_no_margin() -> None:
    assert with_margin(FROM_ABOVE) == (FROM_ABOVE, 0)
    only_larger = replace(FROM_ABOVE, chromatic_aberration=(0.01, 0.002))
    assert with_margin(only_larger) == (only_larger, 0)


@pytest.mark.parametrize(("fov_deg", "wanted"), [(50.0, 5), (56.0, 2), (58.0, 0)])
def test_a_lens_that_folds_just_outside_keeps_its_image(fov_deg: float, wanted: int) -> None:
    """Where a margin of 5 pixels is too much for it; the image has its size, red and blue their edges."""
    folding = Distortion("brown-conrady", (-0.3, 0.0, 0.0, 0.0, 0.0))
    eye = replace(FRINGED, fov_deg=fov_deg, distortion=folding, chromatic_aberration=(-0.001, 0.0005))
    lens_of(eye)
    larger, margin = with_margin(eye)
    assert margin == wanted
    lens_of(larger)
    image = waves(larger, period_px=30.0)
    found = magnified(image, eye, margin)
    assert found.shape == (64, 96, 3)
    np.testing.assert_allclose(found, waves(eye, period_px=30.0), atol=0.1)


@pytest.mark.parametrize("fringes", [(-1.0, 0.0), (0.0, -1.5), (float("nan"), 0.0), (0.06, 0.0)])
def test_fringes_that_no_lens_has_are_refused(fringes: tuple[float, float]) -> None:
    with pytest.raises(FsidError, match=r"chromatic_aberration must be within \+-0.05"):
        with_margin(replace(FRINGED, chromatic_aberration=fringes))


def test_the_larger_camera_is_the_same_lens() -> None:
    """Pixels of the same size, the same darkening at the same place."""
    camera = replace(FRINGED, vignetting=(-0.3, 0.1, -0.2))
    larger, margin = with_margin(camera)
    assert (larger.width, larger.height) == (96 + 2 * margin, 64 + 2 * margin)
    for axis, (size, more) in enumerate(((96, larger.width), (64, larger.height))):
        assert lens_of(larger).focal[axis] * more == pytest.approx(lens_of(camera).focal[axis] * size)
    r2 = np.array([0.1, 0.5, 1.0])
    more_r2 = r2 * (96**2 + 64**2) / (larger.width**2 + larger.height**2)
    gains = [
        sum(a * q ** (i + 1) for i, a in enumerate(seen.vignetting))
        for seen, q in ((camera, r2), (larger, more_r2))
    ]
    np.testing.assert_allclose(*gains)


def test_a_scene_is_what_lenses_of_other_focal_lengths_see() -> None:
    """Red and blue of one each, behind a point spread of a pixel; green and labels as without fringes."""
    scene = sample(SceneConfig(objects=(12, 12)), 2, width=240, height=136)  # few details finer than a pixel
    eye = scene.cameras[0]
    camera = Camera(eye.position_m, eye.target_m, eye.up, eye.fov_deg, eye.width, eye.height, softness_px=1.0)
    with Renderer(texture_size=64) as renderer:

        def draw(camera: Camera) -> Frame:
            return renderer.draw(view_of(replace(scene, cameras=(camera,)), 0))

        def magnifying(growth: float) -> Camera:
            tangent = np.tan(np.radians(camera.fov_deg) / 2) / (1 + growth)
            return replace(camera, fov_deg=float(np.degrees(2 * np.arctan(tangent))))

        plain = draw(camera)
        fringed = draw(replace(camera, chromatic_aberration=(-0.01, 0.006)))
        alone = [draw(magnifying(growth)).radiance for growth in (-0.01, 0.0, 0.006)]
    white = np.quantile(plain.radiance, 0.97)
    for colour, image in enumerate(alone):
        found, without, wanted = (
            np.clip(radiance[..., colour] / white, 0, 1)
            for radiance in (fringed.radiance, plain.radiance, image)
        )
        assert (found - wanted).std() < (0.02 if colour == 1 else 0.8 * (without - wanted).std())
    same = fringed.object_id == plain.object_id
    assert same.mean() > 0.99
    assert fringed.albedo.shape == fringed.normal.shape == fringed.radiance.shape == plain.radiance.shape
    near = np.isfinite(plain.depth) & same
    np.testing.assert_allclose(np.median(fringed.depth[near] / plain.depth[near]), 1.0, rtol=1e-3)
