"""Seconds per frame of the renderer and where they go: python bench/render.py [--frames 5]

Sampled scenes of 40 objects with three lights at 960x540 and 1920x1080, 2 x 2 samples per pixel. Every
scene is drawn once before it is timed, so baking and compiling are not counted; the fastest of `--repeat`
draws counts, because other work on the machine only ever adds. "cpu" is processor time of all threads: it
stays true on a busy machine, and its half is what two free cores would take.
"""

from __future__ import annotations

import argparse
import resource
import time

from fsid.render import Renderer
from fsid.render.drawable import view_of
from fsid.scene import Scene, SceneConfig, sample

SIZES = ((960, 540), (1920, 1080))
STAGES = ("scene build", "upload", "shadows", "samples", "occlusion", "shading", "readback")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--frames", type=int, default=5, help="number of scenes")
    parser.add_argument("--repeat", type=int, default=3, help="draws per scene, the fastest counts")
    parser.add_argument("--texture-size", type=int, default=512, help="texels per side of a material")
    parser.add_argument("--device", type=int, default=None, help="EGL device")
    options = parser.parse_args()
    config = SceneConfig(objects=(40, 40))
    totals = []
    with Renderer(texture_size=options.texture_size, device_index=options.device) as renderer:
        print(f"{renderer.info.renderer}, OpenGL {renderer.info.version}")
        print(f"{'size':>10} {'total s':>8} {'cpu s':>8}  " + "  ".join(f"{stage:>11}" for stage in STAGES))
        for width, height in SIZES:
            scenes = [sample(config, seed, width=width, height=height) for seed in range(options.frames)]
            rows = [fastest(renderer, scene, options.repeat) for scene in scenes]
            mean = {key: sum(row[key] for row in rows) / len(rows) for key in rows[0]}
            totals.append(mean)
            split = "  ".join(f"{mean[stage]:11.3f}" for stage in STAGES)
            print(f"{width:>5}x{height:<4} {mean['total']:8.3f} {mean['cpu']:8.3f}  {split}")
        faces = sum(face_count(scene) for scene in scenes) / len(scenes)
    small, large = (t["total"] for t in totals)
    print(
        f"1920x1080 costs {large / small:.2f} x 960x540 for 4 x the pixels; {faces:,.0f} triangles per scene"
    )
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:,.0f} MiB")


def fastest(renderer: Renderer, scene: Scene, repeat: int) -> dict[str, float]:
    """Seconds by stage of the fastest draw, its total and its processor time."""
    draw(renderer, scene)
    return min((draw(renderer, scene) for _ in range(repeat)), key=lambda row: row["total"])


def draw(renderer: Renderer, scene: Scene) -> dict[str, float]:
    """Seconds by stage; every stage waits for the device."""
    row: dict[str, float] = {}
    cpu = time.process_time()
    start = last = time.perf_counter()

    def mark(stage: str) -> None:
        nonlocal last
        renderer.wait()
        now = time.perf_counter()
        row[stage] = now - last
        last = now

    renderer.draw(view_of(scene, 0), mark=mark)
    return row | {"total": time.perf_counter() - start, "cpu": time.process_time() - cpu}


def face_count(scene: Scene) -> int:
    """Triangles of a scene."""
    return sum(len(drawable.mesh.faces) for drawable in view_of(scene, 0).drawables)


if __name__ == "__main__":
    main()
