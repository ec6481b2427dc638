"""The same scene gives the same bits: again, after other scenes, in other slots, in another process."""

from __future__ import annotations

import ctypes
import gc
import hashlib
import os
import pickle
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from ctypes import c_int, c_uint, c_void_p
from dataclasses import replace
from multiprocessing import Pipe, get_context
from multiprocessing.connection import Connection

import numpy as np
import pytest

from fsid.assets import MATERIAL_VARIANTS, MaterialMaps, material_families
from fsid.errors import FsidError
from fsid.render import Frame, GlInfo, Renderer, egl_devices, gpu_device, texels
from fsid.render.context import gl
from fsid.render.drawable import view_of
from fsid.render.layers import MOST_LAYERS, LayerStore, fitting_size
from fsid.render.texels import Texels, bake_texels, level_ranges
from fsid.render.texture_array import TextureArray
from fsid.scene import LensConfig, LightConfig, MotionConfig, Scene, SceneConfig, sample

CONFIG = SceneConfig(objects=(6, 8))


def scene(seed: int) -> Scene:
    return sample(CONFIG, seed, width=96, height=64)


def fingerprint(frame: Frame) -> str:
    arrays = (frame.radiance, frame.albedo, frame.normal, frame.depth, frame.object_id)
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()


@pytest.fixture
def renderer() -> Iterator[Renderer]:
    with Renderer(texture_size=64) as renderer:
        yield renderer


def test_again_and_after_other_scenes(renderer: Renderer) -> None:
    first = fingerprint(renderer.render(scene(1)))
    assert fingerprint(renderer.render(scene(1))) == first
    renderer.render(
        sample(SceneConfig(objects=(4, 4), lights=LightConfig(count=(5, 5))), 2, width=160, height=90)
    )
    assert fingerprint(renderer.render(scene(3))) != first
    assert fingerprint(renderer.render(scene(1))) == first


@pytest.mark.parametrize("held", [1e3, np.nan])
def test_what_the_image_of_shadows_held_leaves_nothing(renderer: Renderer, held: float) -> None:
    """A lookup at the edge of a tile reads what lies beside it: of an earlier scene, or memory as it was."""
    whole = sample(SceneConfig(), 1, width=64, height=48)
    kept = ("objects", "materials", "transforms", "motions")
    drawn = replace(whole, **{name: getattr(whole, name)[:12] for name in kept})
    first = fingerprint(renderer.render(drawn))
    moments = renderer._shadows._atlas._moments
    moments.write(np.full((*moments.size, 2), held, np.float32))
    assert fingerprint(renderer.render(drawn)) == first


@pytest.mark.parametrize(
    "config",
    [
        CONFIG,
        replace(CONFIG, lens=LensConfig(blur_share=1.0, soft_share=1.0)),
        replace(CONFIG, motion=MotionConfig(exposure_s=(0.1, 0.1), moving_share=1.0)),
    ],
)
def test_radiance_alone_is_that_of_the_frame(renderer: Renderer, config: SceneConfig) -> None:
    drawn = sample(config, 4, width=96, height=64)
    assert (renderer.radiance(drawn) == renderer.render(drawn).radiance).all()


def test_radiance_alone_is_that_of_the_frame_through_glass(renderer: Renderer) -> None:
    """Where labels are not wanted there are no images of them, neither of what is drawn nor behind it."""
    drawn = sample(CONFIG, 4, width=96, height=64)
    clear = [tuple(replace(part, transmission=0.7) for part in parts) for parts in drawn.materials]
    glass = replace(drawn, materials=tuple(clear))
    frame = renderer.render(glass)
    assert (frame.radiance != renderer.render(drawn).radiance).any()
    assert (renderer.radiance(glass) == frame.radiance).all()


def test_slots_of_materials_do_not_matter(renderer: Renderer) -> None:
    """With room for a few layers only, materials move between slots and are baked again."""
    first = fingerprint(renderer.render(scene(1)))
    renderer._layers = LayerStore(renderer._context, 64, budget_bytes=12 * 64 * 64 * 11)
    for seed in (2, 3):
        renderer.render(scene(seed))
    assert fingerprint(renderer.render(scene(1))) == first


def test_a_gpu_keeps_layers_of_other_sizes(renderer: Renderer, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scenes of few and of many materials take turns: none loads again what it had."""
    loaded: list[int] = []

    def load(family: str, variant: int, size: int) -> Texels:
        loaded.append(size)
        return bake_texels(family, variant, size)

    monkeypatch.setattr(renderer, "_on_gpu", True)
    images, loads = [], []
    for size in (64, 128, 64, 128):
        monkeypatch.setattr("fsid.render.renderer.fitting_size", lambda *_, size=size: size)
        images.append(renderer.draw(view_of(scene(1), 0), bake=load).radiance)
        loads.append(len(loaded))
    assert set(loaded) == {64, 128}
    assert loads[1] == loads[3]
    assert (images[0] == images[2]).all()
    assert (images[1] == images[3]).all()


def test_images_are_free_while_a_material_is_drawn_and_come_back(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is drawn anew takes as much memory as they do; what comes from the cache does not."""
    drawn, sizes = texels.draw_material, []

    def draw(family: str, variant: int, size: int) -> MaterialMaps:
        sizes.append(renderer._targets.size)
        return drawn(family, variant, size)

    monkeypatch.setattr(texels, "draw_material", draw)
    renderer.render(scene(2))
    expected = fingerprint(renderer.render(scene(1)))
    renderer.render(scene(2))
    assert renderer._targets.size != (0, 0)
    monkeypatch.setenv("FSID_CACHE", "off")
    renderer._layers = LayerStore(renderer._context, 64)
    sizes.clear()
    assert fingerprint(renderer.render(scene(1))) == expected
    assert set(sizes) == {(0, 0)}


def test_another_process_renders_the_same(renderer: Renderer) -> None:
    code = (
        "from fsid.render import Renderer; from test_render_determinism import *;"
        "r = Renderer(texture_size=64); print(fingerprint(r.render(scene(1))))"
    )
    run = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path[:0] = {sys.path!r}; {code}"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert run.stdout.split()[-1] == fingerprint(renderer.render(scene(1)))


def test_layers_leave_in_order_of_last_use(renderer: Renderer) -> None:
    store = LayerStore(renderer._context, 64, budget_bytes=4 * 64 * 64 * 11)
    baked: list[tuple[str, int]] = []

    def bake(family: str, variant: int, size: int):
        baked.append((family, variant))
        return bake_texels("paint", 0, size)

    for name in ("a", "b", "c", "d", "a", "e"):
        store.load([(name, 0)], bake)
    assert [name for name, _ in baked] == ["a", "b", "c", "d", "e"]
    store.load([("a", 0), ("b", 0)], bake)
    assert [name for name, _ in baked][5:] == ["b"]
    layers = store.load([(str(i), 0) for i in range(9)], bake)
    assert sorted(layer.index for layer in layers.values()) == list(range(9))


def resident(array: TextureArray, level: int, size: int) -> np.ndarray:
    """(layers, size, size, 4) uint8: a mip level of a texture array."""
    data = np.empty((array.capacity, size, size, 4), np.uint8)
    array.use(0)
    gl("glGetTexImage", c_uint, c_int, c_uint, c_uint, c_void_p)(
        0x8C1A, level, 0x1908, 0x1401, data.ctypes.data
    )
    return data


def test_a_stored_layer_is_what_was_baked(renderer: Renderer) -> None:
    """Every mip level of every resident layer survives growth of the arrays."""
    store = LayerStore(renderer._context, 64)
    families = [(family, v) for family in material_families()[:6] for v in range(MATERIAL_VARIANTS)]
    for i in range(1, len(families) + 1):
        layers = store.load(families[:i], bake_texels)
    for level, (size, where) in enumerate(level_ranges(64)):
        for half, array in enumerate(store._arrays):
            found = resident(array, level, size)
            for key, layer in layers.items():
                expected = bake_texels(*key, 64).data[half, where].reshape(size, size, 4)
                np.testing.assert_array_equal(found[layer.index], expected)


def test_too_little_texture_memory_is_said(renderer: Renderer) -> None:
    with pytest.raises(FsidError, match="smaller texture_size"):
        TextureArray(renderer._context, 8192, 2048)
    most = renderer._context.info["GL_MAX_ARRAY_TEXTURE_LAYERS"]
    with pytest.raises(FsidError, match=f"{most + 1} materials are more than the {most} "):
        TextureArray(renderer._context, 64, most + 1)


def live_gl_objects() -> int:
    """How many textures, buffers, framebuffers and vertex arrays the context holds."""
    address = ctypes.CDLL("libEGL.so.1").eglGetProcAddress
    address.restype, address.argtypes = c_void_p, [ctypes.c_char_p]
    asks = [
        ctypes.CFUNCTYPE(ctypes.c_ubyte, c_uint)(address(name))
        for name in (b"glIsTexture", b"glIsBuffer", b"glIsFramebuffer", b"glIsVertexArray")
    ]
    return sum(ask(name) for ask in asks for name in range(1, 4096))


def test_no_gl_object_outlives_its_frame(renderer: Renderer) -> None:
    for seed in (1, 2):
        renderer.render(scene(seed))
    before = live_gl_objects()
    for seed in (1, 2):
        renderer.render(scene(seed))
    assert live_gl_objects() == before


GROWTH = """
import ctypes, gc, sys
sys.path[:0] = {path!r}
from fsid.render import Renderer
from test_render_determinism import CONFIG, sample

def held_bytes():
    gc.collect()
    renderer._context.finish()
    ctypes.CDLL(None).malloc_trim(0)
    return int(open("/proc/self/statm").read().split()[1]) * 4096

drawn = sample(CONFIG, 1, width=240, height=160)
with Renderer(texture_size=64) as renderer:
    for count in (4, 12):
        for _ in range(count):
            frame = renderer.render(drawn)
        renderer._drain()
        print(held_bytes())
    for layers in (1000, 1100):
        renderer._layers._grow(layers)
        print(held_bytes())
        frame = renderer.render(drawn)
"""
"""What is held after warm-up and after twelve frames more; with 44 MB of textures, and with 48."""


def test_memory_does_not_grow() -> None:
    """In a process of its own, to a quarter of a frame's radiance per frame; and textures that were freed are
    gone, though the software driver's threads would hold them longer."""
    if not hasattr(ctypes.CDLL(None), "malloc_trim"):
        pytest.skip("memory that is free cannot be told from memory that is held: no malloc_trim")
    code = GROWTH.format(path=sys.path)
    environment = {**os.environ, "LP_NUM_THREADS": "2"}
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=environment
    )
    before, after, large, larger = map(int, run.stdout.split()[-4:])
    assert after - before < 12 * (240 * 160 * 3 * 4) / 4
    assert larger - large < 20e6


CODE = """
import sys
sys.path[:0] = {path!r}
from fsid.render import Renderer
from render_scenes import bake_plain, block, lambertian, point_light, view

def code_kib():
    rows = open("/proc/self/smaps").read().splitlines()
    total, counts = 0, False
    for row in rows:
        if "-" in row.split()[0]:
            counts = len(row.split()) == 5 and "x" in row.split()[1]
        total += int(row.split()[1]) if counts and row.startswith("Rss:") else 0
    return total

with Renderer(texture_size=64) as renderer:
    for lights, things in ((3, 2), (7, 2), (1, 1), (2, 3), (4, 7), (8, 15)):
        lamps = tuple(point_light((i / 10, 0.0, 1.0)) for i in range(lights))
        boxes = [lambertian(block((0.1, 0.1, 0.1)))] * things
        renderer.draw(view(*boxes, lights=lamps), bake=bake_plain)
        print(code_kib())
    print(renderer.info.is_software)
"""
"""KiB of memory that is code and comes from no file: what the driver has compiled."""


def test_no_number_of_lights_or_things_is_compiled_for() -> None:
    """llvmpipe compiles again where a side of a texture becomes a power of two; in a process of its own."""
    code = CODE.format(path=sys.path)
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    *sizes, is_software = run.stdout.split()
    if is_software == "False":
        pytest.skip("what a GPU's driver compiles is not seen")
    assert int(sizes[0]) > 0
    assert len(set(sizes)) == 1


def test_small_layers_are_bounded_by_number(renderer: Renderer) -> None:
    store = LayerStore(renderer._context, 64)
    texels = bake_texels("paint", 0, 64)
    for i in range(MOST_LAYERS + 40):
        store.load([(str(i), 0)], lambda *_: texels)
    assert [array.capacity for array in store._arrays] == [MOST_LAYERS] * 2


def test_samples_per_pixel_agree_on_average(renderer: Renderer) -> None:
    """More samples change edges, not the light: the mean of the image stays within 1.5 %."""
    means = [renderer.render(scene(4)).radiance.mean()]
    renderer.close()
    with Renderer(texture_size=64, supersampling=4) as fine:
        means.append(fine.render(scene(4)).radiance.mean())
    assert abs(means[0] / means[1] - 1) < 0.015


def test_a_second_renderer_is_refused(renderer: Renderer) -> None:
    with pytest.raises(FsidError, match="already open"):
        Renderer()


def test_another_thread_is_told_why_it_cannot_render(renderer: Renderer) -> None:
    with ThreadPoolExecutor(1) as threads, pytest.raises(FsidError, match="thread that opened it"):
        threads.submit(renderer.render, sample(SceneConfig(), 7, width=32, height=32)).result()


def _refusals(renderer: Renderer, found: Connection) -> None:
    """What a forked process is told."""
    for use in (lambda: renderer.radiance(scene(1)), Renderer, egl_devices):
        try:
            use()
        except FsidError as error:
            found.send(str(error))


def test_a_forked_process_is_refused_where_the_driver_would_wait_for_ever(renderer: Renderer) -> None:
    here, there = Pipe()
    forked = get_context("fork").Process(target=_refusals, args=(renderer, there))
    forked.start()
    forked.join(60)
    forked.kill()
    said = [here.recv() for _ in range(3) if here.poll()]
    assert len(said) == 3
    assert all("spawn" in line for line in said)


def test_a_renderer_is_not_sent_to_another_process(renderer: Renderer) -> None:
    with pytest.raises(TypeError, match="open one there"):
        pickle.dumps(renderer)


def test_a_renderer_that_nobody_refers_to_makes_room_for_another() -> None:
    """As after a cell of a notebook, of which nothing is left that could be closed."""
    gc.disable()
    try:
        frames = [Renderer(texture_size=64).radiance(scene(1)) for _ in range(2)]
    finally:
        gc.enable()
    assert np.array_equal(*frames)


def test_a_closed_renderer_says_so(renderer: Renderer) -> None:
    renderer.close()
    with pytest.raises(FsidError, match="closed"):
        renderer.render(scene(1))


def test_missing_drivers_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(**settings: object) -> None:
        raise Exception("libEGL.so.1 not loaded")

    monkeypatch.setattr("moderngl.create_context", fail)
    with pytest.raises(
        FsidError, match=r"libegl1 libgl1 libgl1-mesa-dri.*NVIDIA_DRIVER_CAPABILITIES"
    ) as error:
        Renderer()
    assert "\n" not in str(error.value)
    assert not Renderer._is_open


def test_an_unknown_device_is_an_error() -> None:
    with pytest.raises(FsidError, match="device 77"):
        Renderer(device_index=77)


def test_the_driver_is_named(renderer: Renderer) -> None:
    info = renderer.info
    assert info.renderer
    assert info.vendor
    assert info.version[0] == "4"


@pytest.mark.parametrize(("materials", "size"), [(1, 1024), (21, 1024), (22, 512), (84, 512), (85, 256)])
def test_many_materials_have_smaller_tiles(materials: int, size: int) -> None:
    """224 MiB hold 21 layers of 1024 texels, 84 of 512."""
    assert fitting_size(1024, materials) == size


def test_the_size_of_tiles_follows_the_scene_alone(
    renderer: Renderer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A scene looks the same after one whose tiles were of another size."""
    import fsid.render.renderer as module

    before = renderer.render(scene(1))
    with monkeypatch.context() as patch:
        patch.setattr(module, "fitting_size", lambda size, count: 2 * size)
        larger = renderer.render(scene(1))
    after = renderer.render(scene(1))
    assert (larger.radiance != before.radiance).any()
    np.testing.assert_array_equal(after.radiance, before.radiance)


def test_gpus_are_counted_without_software_drivers(monkeypatch: pytest.MonkeyPatch) -> None:
    """EGL may list the CPU's driver before, between and after the GPUs."""
    kinds = (True, False, True, False)
    found = {i: GlInfo("", "", "", is_software=software) for i, software in enumerate(kinds)}
    monkeypatch.setattr("fsid.render.context.egl_devices", lambda: found)
    assert [gpu_device(number) for number in (0, 1)] == [1, 3]
    with pytest.raises(FsidError, match="GPU 2 is needed, and OpenGL finds 2"):
        gpu_device(2)
