"""Compute shaders make the image of the fragment shaders: lenses, glass, mirrors, hard shadows."""

from __future__ import annotations

from ctypes import c_int, c_uint, c_void_p
from dataclasses import replace

import numpy as np
import pytest

from fsid.render import Frame, Renderer
from fsid.render.context import gl
from fsid.render.mip_levels import MipLevels
from fsid.render.texels import level_ranges
from fsid.render.texture_array import TextureArray
from fsid.scene import Distortion, LightConfig, Scene, SceneConfig, sample

BARREL = Distortion("brown-conrady", (-0.18, 0.03, 0.001, -0.001, 0.0))
FISHEYE = Distortion("fisheye", (-0.03, 0.005, 0.0, 0.0))


def scene(seed: int, lens: Distortion | None = None, **config: object) -> Scene:
    found = sample(SceneConfig(objects=(8, 12), **config), seed, width=130, height=74)
    cameras = tuple(replace(camera, distortion=lens) for camera in found.cameras)
    return replace(found, cameras=cameras)


def drawn(scenes: list[Scene], *, compute: bool, supersampling: int) -> list[Frame]:
    with Renderer(texture_size=64, supersampling=supersampling, compute=compute) as renderer:
        frames = [renderer.render(each) for each in scenes]
        assert renderer._context.error == "GL_NO_ERROR"
        return frames


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


def read_level(level: int, size: tuple[int, int], components: int) -> np.ndarray:
    """A mip level of the texture that unit 0 holds."""
    texels = np.zeros((max(size[1] >> level, 1), max(size[0] >> level, 1), components), np.float32)
    read = gl("glGetTexImage", c_uint, c_int, c_uint, c_uint, c_void_p)
    read(0x0DE1, level, {2: 0x8227, 4: 0x1908}[components], 0x1406, texels.ctypes.data)
    return texels


def levels_of(renderer: Renderer, texels: np.ndarray, *, compute: bool | None) -> list[np.ndarray]:
    """All mip levels of a texture (H, W, components). compute: of `MipLevels`; None: those of the driver."""
    height, width, components = texels.shape
    texture = renderer._context.texture((width, height), components, texels, dtype="f4")
    if compute is None:
        texture.build_mipmaps()
    else:
        MipLevels(renderer._context, compute=compute).fill(texture)
    texture.use(0)
    return [read_level(i, (width, height), components) for i in range(max(width, height).bit_length())]


@pytest.mark.parametrize("components", [2, 4])
def test_mip_levels_of_even_sizes_are_those_of_the_driver(components: int) -> None:
    """To the bit where all sides are even: the mean of four texels."""
    texels = np.random.default_rng(4).random((32, 64, components)).astype(np.float32)
    with Renderer() as renderer:
        if not renderer.info.is_software:
            pytest.skip("a GPU's driver may round in another way")
        of_driver, *found = (levels_of(renderer, texels, compute=each) for each in (None, False, True))
    for levels in found:
        for level, expected in zip(levels, of_driver, strict=True):
            np.testing.assert_array_equal(level, expected)


@pytest.mark.parametrize("compute", [False, True])
@pytest.mark.parametrize("size", [(43, 32), (44, 31), (108, 54), (45, 1), (7, 13)])
def test_every_texel_weighs_the_same_at_every_mip_level(size: tuple[int, int], compute: bool) -> None:
    """The mean of a level is that of the image, wherever the light is: one column and one row at a time."""
    width, height = size
    with Renderer() as renderer:
        for column, row in [(i, i % height) for i in range(width)]:
            texels = np.zeros((height, width, 2), np.float32)
            texels[:, column, 0] = texels[row, :, 1] = 1.0
            for level in levels_of(renderer, texels, compute=compute):
                np.testing.assert_allclose(level.mean((0, 1)), (1 / width, 1 / height), rtol=1e-4)


def test_a_texel_of_a_mip_level_is_the_mean_of_what_it_covers() -> None:
    """Of 7 by 5 texels, 3 by 2: each covers 7/3 by 5/2 of them."""
    texels = np.random.default_rng(4).random((5, 7, 4)).astype(np.float32)
    with Renderer() as renderer:
        found = levels_of(renderer, texels, compute=True)[1]
    fine = np.repeat(np.repeat(texels, 2, axis=0), 3, axis=1)  # of which each covers 5 by 7
    np.testing.assert_allclose(found, fine.reshape(2, 5, 3, 7, 4).mean((1, 3)), rtol=1e-5)


def test_a_layer_by_way_of_a_buffer_is_the_same() -> None:
    """All its mip levels, each from its place in the buffer."""
    levels = level_ranges(64)
    texels = np.random.default_rng(5).integers(0, 256, (levels[-1][1].stop, 4), np.uint8)
    read = gl("glGetTexImage", c_uint, c_int, c_uint, c_uint, c_void_p)
    with Renderer() as renderer:
        for buffered in (False, True):
            array = TextureArray(renderer._context, 64, 3, buffered=buffered)
            array.write(1, texels)
            array.use(0)
            for number, (size, level) in enumerate(levels):
                found = np.zeros((3, size, size, 4), np.uint8)
                read(0x8C1A, number, 0x1908, 0x1401, found.ctypes.data)
                np.testing.assert_array_equal(found[1], texels[level].reshape(size, size, 4))


def test_the_exact_filter_is_the_filter_of_the_driver() -> None:
    """What GPUs have instead of a lookup, on a driver whose lookups are exact; each level by itself."""
    rng = np.random.default_rng(3)
    places = np.zeros((64, 64, 4), np.float32)
    places[..., :2] = rng.random((64, 64, 2))
    with Renderer() as renderer:
        if not renderer.info.is_software:
            pytest.skip("a GPU's own filter is not exact")
        context = renderer._context
        moments = context.texture((96, 46), 2, rng.random((46, 96, 2)).astype(np.float32), dtype="f4")
        moments.build_mipmaps()
        moments.repeat_x = moments.repeat_y = False
        moments.use(3)
        program = context.compute_shader(FILTERS)
        for level in (0.0, 0.3, 1.0, 2.75, 5.5, 9.0):
            places[..., 2] = level
            texels = context.texture((64, 64), 4, places, dtype="f4")
            texels.bind_to_image(0, read=True, write=True)
            program.run(8, 8)
            found = np.frombuffer(texels.read(), np.float32).reshape(64, 64, 4)
            np.testing.assert_allclose(found[..., :2], found[..., 2:], atol=1e-6)
            assert np.ptp(found) > 0


FILTERS = """
#version 430 core
#define EXACT_FILTER 1
#include "moments.glsl"
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0, rgba32f) uniform image2D places;

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    vec4 p = imageLoad(places, at);
    imageStore(places, at, vec4(textureLod(shadow_moments, p.xy, p.z).xy, moments_at(p.xy, p.z)));
}
""".strip()
