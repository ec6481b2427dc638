"""The rasteriser beside other renderers on the same scenes: seconds per frame, and the noise that is left.

    python bench/reference.py --width 960 --samples 64                 Mitsuba 3 (fsid[reference])
    python bench/reference.py --direct --objects 12 --width 240        agreement about the lights alone

Times are the best of `--repeat` draws of a scene that is already loaded, in one run, renderers in turn.
Noise is the standard deviation between two renders that differ in their seed alone, relative to the median
radiance: the rasteriser's is 0 by construction (same bits). --direct compares what comes straight from the
lights: one bounce, and no light of the walls in the rasteriser. Blender Cycles: bench/cycles.py.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from fsid.render import Frame, Renderer
from fsid.render.drawable import View, view_of
from fsid.render.reference import ReferenceRenderer, agreement
from fsid.scene import Scene, SceneConfig, sample
from fsid.scene.model import ZERO


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--width", type=int, default=960, help="of the image, 16:9")
    parser.add_argument("--samples", type=int, default=64, help="paths per pixel of Mitsuba")
    parser.add_argument("--seeds", type=int, nargs="+", default=[3], help="scenes")
    parser.add_argument("--objects", type=int, default=40, help="per scene")
    parser.add_argument("--texture-size", type=int, default=512, help="texels per side of a material")
    parser.add_argument("--repeat", type=int, default=2, help="draws of each, the fastest counts")
    parser.add_argument("--direct", action="store_true", help="compare direct light instead, in rooms")
    parser.add_argument("--figure", type=Path, help="picture of both renderers side by side to write")
    options = parser.parse_args()
    path_tracer = ReferenceRenderer(
        samples=options.samples, texture_size=options.texture_size, bounces=1 if options.direct else 7
    )
    print(f"Mitsuba {path_tracer.variant}, {options.samples} samples, {options.width} px wide")
    panels = []
    with Renderer(texture_size=options.texture_size) as raster:
        for seed in options.seeds:
            config = SceneConfig(objects=(options.objects, options.objects))
            scene = sample(config, seed, width=options.width, height=options.width * 9 // 32 * 2)
            make = direct if options.direct else compare
            panels.append(make(raster, path_tracer, plain_lens(scene), options))
    if options.figure:
        Image.fromarray(np.vstack(panels)).save(options.figure)


def plain_lens(scene: Scene) -> Scene:
    """The scene without what Mitsuba's camera does not have."""
    camera = replace(scene.cameras[0], distortion=None, chromatic_aberration=(0.0, 0.0))
    return replace(scene, cameras=(camera,))


def compare(
    raster: Renderer, path_tracer: ReferenceRenderer, scene: Scene, options: argparse.Namespace
) -> np.ndarray:
    """Prints one scene's lines; returns both images side by side, 8 bit."""
    start = time.perf_counter()
    prepared = path_tracer.prepare(scene, scene.cameras[0])
    loading_s = time.perf_counter() - start
    labels = prepared.labels()
    drawn = raster.render(scene)
    raster_s = traced_s = np.inf
    images = []
    for k in range(options.repeat):
        raster_s = min(raster_s, seconds(lambda: raster.render(scene)))
        start = time.perf_counter()
        images.append(prepared.radiance(options.samples, k))
        traced_s = min(traced_s, time.perf_counter() - start)
    traced = replace(labels, radiance=np.mean(images, axis=0).astype(np.float32))
    print(
        f"scene {scene.seed}: rasteriser {raster_s:.2f} s, Mitsuba {traced_s:.1f} s "
        f"(and {loading_s:.0f} s to load) = {traced_s / raster_s:.0f} x"
    )
    if len(images) > 1:
        print(f"  noise of {options.samples} samples: {noise(*images[:2]):.3f} of the median radiance")
    print(f"  {agreement(drawn, traced)}")
    return np.hstack([developed(drawn, drawn), developed(traced, drawn)])


def direct(
    raster: Renderer, path_tracer: ReferenceRenderer, scene: Scene, options: argparse.Namespace
) -> np.ndarray:
    """Prints how both agree about light that comes straight from the lights; returns both images."""
    if scene.sky is not None:
        raise SystemExit(f"seed {scene.seed} is open air, where the sky is a light too: choose a room")
    camera = replace(scene.cameras[0], aperture_m=0.0, exposure_s=0.0)
    camera = replace(camera, softness_px=0.0, sharpening=0.0, colour_contrast=(0.0, 0.0))
    scene = replace(scene, cameras=(camera,))
    drawn, traced = raster.draw(without_walls_light(scene)), path_tracer.render(scene)
    kinds = ", ".join(light.kind for light in scene.lights)
    print(f"scene {scene.seed}, {scene.background.kind}, {kinds}: {agreement(drawn, traced)}")
    return np.hstack([developed(drawn, drawn), developed(traced, drawn)])


def without_walls_light(scene: Scene) -> View:
    """The view of a scene whose walls look as they do and light nothing."""
    view, black = view_of(scene, 0), (ZERO, ZERO, ZERO)
    walls = tuple(replace(wall, colours=black, emission=0.0) for wall in view.room_materials)
    return replace(view, room_materials=walls, ambient=ZERO)


def seconds(work: Callable[[], object]) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def noise(first: np.ndarray, second: np.ndarray) -> float:
    """Median over the image of the standard deviation of one render, relative to the median radiance."""
    deviation = np.abs(first - second).mean(-1) / np.sqrt(2)
    return float(np.median(deviation) * np.sqrt(np.pi / 2) / np.median(first))


def developed(frame: Frame, exposure: Frame) -> np.ndarray:
    """sRGB-like 8 bit, as bright as `exposure` says."""
    light = frame.radiance / np.median(exposure.radiance) * 0.2
    return (np.clip(light, 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)


if __name__ == "__main__":
    main()
