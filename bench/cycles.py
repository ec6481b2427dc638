"""The rasteriser beside Blender Cycles on the same scenes: python bench/cycles.py --python PYTHON

PYTHON is an interpreter that has `bpy` (in an environment of its own: pip install bpy). Cycles draws the
exported .glb on the CPU with 32 paths per pixel and its denoiser, the best of --repeat draws of a scene that
is loaded already; the rasteriser likewise. The scenes are the plain ones of bench/render.py, 40 objects in a
room under three point and spot lights, or with --default those that `fsid generate` draws.

A .glb cannot say all of a scene (docs/other-engines.md): this compares times, not images. --figure writes
both side by side to look at.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image

from fsid.render import Renderer
from fsid.render.gltf import write_glb
from fsid.scene import Scene
from render import scenes_of

_CYCLES = """
import json, sys, time, bpy
glb, png, width, height, samples, repeat = sys.argv[-6:]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=glb)
scene = bpy.context.scene
scene.camera = next(o for o in bpy.data.objects if o.type == "CAMERA")
scene.render.engine = "CYCLES"
scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.device = int(samples), True, "CPU"
scene.cycles.use_adaptive_sampling = False
scene.render.resolution_x, scene.render.resolution_y = int(width), int(height)
scene.render.resolution_percentage = 100
scene.render.use_persistent_data = True
scene.render.image_settings.file_format = "PNG"
scene.render.filepath = png
seconds = []
for _ in range(int(repeat)):
    start = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    seconds.append(time.perf_counter() - start)
print(json.dumps({"version": bpy.app.version_string, "seconds": seconds}))
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--python", type=Path, required=True, help="interpreter that has bpy")
    parser.add_argument("--width", type=int, default=960, help="of the image, 16:9")
    parser.add_argument("--samples", type=int, default=32, help="paths per pixel of Cycles")
    parser.add_argument("--frames", type=int, default=2, help="number of scenes")
    parser.add_argument("--default", action="store_true", help="scenes as fsid generate draws them")
    parser.add_argument("--texture-size", type=int, default=512, help="texels per side of a material")
    parser.add_argument("--repeat", type=int, default=2, help="draws of each, the fastest counts")
    parser.add_argument("--figure", type=Path, help="picture of both side by side to write")
    options = parser.parse_args()
    height = options.width * 9 // 32 * 2
    panels = []
    with Renderer(texture_size=options.texture_size) as raster:
        for scene in scenes_of(options.frames, options.width, height, plain=not options.default):
            light, ours_s = rasterised(raster, scene, options.repeat)
            picture, cycles_s, version = traced(scene, options)
            print(
                f"scene {scene.seed}, {options.width}x{height}: rasteriser {ours_s:.2f} s, Cycles of Blender "
                f"{version} {cycles_s:.1f} s = {cycles_s / ours_s:.0f} x",
                flush=True,
            )
            panels.append(np.hstack([developed(light), picture]))
    if options.figure:
        Image.fromarray(np.vstack(panels)).save(options.figure)


def rasterised(raster: Renderer, scene: Scene, repeat: int) -> tuple[np.ndarray, float]:
    """The scene's light (H, W, 3) and the seconds of the fastest draw after the first."""
    light = raster.render(scene).radiance
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        raster.render(scene)
        times.append(time.perf_counter() - start)
    return light, min(times)


def traced(scene: Scene, options: argparse.Namespace) -> tuple[np.ndarray, float, str]:
    """Cycles' picture (H, W, 3) of the exported scene, 8 bit, seconds of its fastest draw, its version."""
    camera = scene.cameras[0]
    with tempfile.TemporaryDirectory() as folder:
        glb, png = Path(folder) / "scene.glb", Path(folder) / "scene.png"
        write_glb(glb, scene, texture_size=options.texture_size)
        numbers = (camera.width, camera.height, options.samples, options.repeat)
        command = [str(options.python), "-c", _CYCLES, str(glb), str(png), *map(str, numbers)]
        out = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        picture = np.asarray(Image.open(png).convert("RGB"))
    result = json.loads(next(line for line in out.splitlines() if line.startswith("{")))
    return picture, min(result["seconds"]), result["version"]


def developed(light: np.ndarray) -> np.ndarray:
    """sRGB-like 8 bit with the median at 0.2."""
    return (np.clip(light / np.median(light) * 0.2, 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)


if __name__ == "__main__":
    main()
