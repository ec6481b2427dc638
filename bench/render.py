"""Seconds per frame, where they go, and what quality costs: python bench/render.py [--frames 5]

Sampled scenes of 40 objects with three lights at 960x540 and 1920x1080, 2 x 2 samples per pixel. Every
scene is drawn once before it is timed, so baking and compiling are not counted; the fastest of `--repeat`
draws counts, because other work on the machine only ever adds. "cpu" is processor time of all threads: it
stays true on a busy machine, and its half is what two free cores would take.

--plain draws scenes of the kind that the prototype of this renderer was timed with instead: 40 objects in a
room, three shadowed point and spot lights, 20 materials without clearcoat, sheen and such, an ideal lens.
--fidelity compares both qualities with 4 x 4 samples per pixel (PSNR of the radiance, scaled so that its
97th percentile is white, at 480x270). --triangles draws one scene with meshes divided into ever more
triangles. Memory over many scenes: bench/dataset.py --only memory.

--workers 1 4 16 counts the frames that so many processes make together in --seconds at 1920x1080: every frame
another scene, sampled, built, drawn and read back. Each worker draws --frames scenes before the clock starts,
which compiles; texels of materials come from the cache on disk where they are neither resident nor new.
"""

from __future__ import annotations

import argparse
import itertools
import multiprocessing
import os
import resource
import time
from collections.abc import Sequence
from dataclasses import replace
from threading import Barrier

import numpy as np

from fsid.assets import Mesh
from fsid.render import Renderer
from fsid.render.drawable import View, view_of
from fsid.scene import Scene, SceneConfig, sample
from fsid.scene.camera_config import LensConfig
from fsid.scene.config import BackgroundConfig, LightConfig, MaterialConfig

SIZES = ((960, 540), (1920, 1080))
STAGES = ("scene build", "upload", "samples", "occlusion", "shadows", "mirror", "shading", "readback")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--frames", type=int, default=5, help="number of scenes")
    parser.add_argument("--repeat", type=int, default=3, help="draws per scene, the fastest counts")
    parser.add_argument("--texture-size", type=int, default=512, help="texels per side of a material")
    parser.add_argument("--device", type=int, default=None, help="EGL device")
    parser.add_argument("--quality", default="high", help="high or fast")
    parser.add_argument("--plain", action="store_true", help="plain scenes of three lights, 20 materials")
    parser.add_argument("--fidelity", action="store_true", help="compare the qualities instead")
    parser.add_argument("--triangles", action="store_true", help="cost over triangles instead")
    parser.add_argument("--fragments", action="store_true", help="shade in fragment shaders on a GPU, too")
    parser.add_argument(
        "--workers", type=int, nargs="+", help="frames per second of so many processes instead"
    )
    parser.add_argument("--seconds", type=float, default=20.0, help="how long --workers are timed")
    options = parser.parse_args()
    if options.workers:
        return throughput(options)
    if options.fidelity:
        return fidelity(options)
    with open_renderer(options, options.quality) as renderer:
        print(f"{renderer.info.renderer}, OpenGL {renderer.info.version}, quality {options.quality}")
        (triangles if options.triangles else frames)(renderer, options)
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:,.0f} MiB")
    return None


def open_renderer(options: argparse.Namespace, quality: str, supersampling: int = 2) -> Renderer:
    return Renderer(
        texture_size=options.texture_size,
        device_index=options.device,
        quality=quality,
        supersampling=supersampling,
        compute=False if options.fragments else None,
    )


def scenes_of(count: int, width: int, height: int, *, plain: bool = False) -> list[Scene]:
    return [scene_of(seed, width, height, plain=plain) for seed in range(count)]


def scene_of(seed: int, width: int, height: int, *, plain: bool) -> Scene:
    config = SceneConfig(objects=(40, 40))
    if plain:
        config = replace(
            config,
            materials=MaterialConfig(lobe_share=0.0, cast_share=0.0),
            background=BackgroundConfig(kind_shares=(1.0, 0.0, 0.0, 0.0)),
            lights=LightConfig(count=(3, 3), kind_shares=(0.6, 0.4, 0.0)),
            lens=LensConfig(
                blur_share=0.0,
                vignetting_share=0.0,
                fringe_share=0.0,
                soft_share=0.0,
                sharp_share=0.0,
                contrast_red=(0.0, 0.0),
                contrast_blue=(0.0, 0.0),
            ),
        )
    scene = sample(config, seed, width=width, height=height)
    return of_few_materials(scene, 20) if plain else scene


def of_few_materials(scene: Scene, count: int) -> Scene:
    """`scene` with its objects made of the first `count` of their materials."""
    few = [material for materials in scene.materials for material in materials][:count]
    turn = itertools.cycle(few)
    return replace(scene, materials=tuple(tuple(next(turn) for _ in each) for each in scene.materials))


def throughput(options: argparse.Namespace) -> None:
    """Frames per second of several processes that share the device and the processor."""
    context = multiprocessing.get_context("spawn")
    for count in options.workers:
        os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"), LP_NUM_THREADS="0")
        with context.Manager() as manager, context.Pool(count) as pool:
            ready = manager.Barrier(count)
            turns = [pool.apply_async(frames_in, (options, worker, ready)) for worker in range(count)]
            rates, cpu = np.array([turn.get() for turn in turns]).T
        print(
            f"{count:>3} workers {rates.sum():7.2f} frames/s of {SIZES[-1][0]}x{SIZES[-1][1]}, "
            f"{cpu.mean():.3f} cpu s a frame"
        )


def frames_in(options: argparse.Namespace, worker: int, ready: Barrier) -> tuple[float, float]:
    """Frames per second of one worker, and processor seconds of a frame."""
    seeds = itertools.count(worker * 100_000)
    with open_renderer(options, options.quality) as renderer:

        def draw_next() -> None:
            renderer.radiance(scene_of(next(seeds), *SIZES[-1], plain=options.plain))

        for _ in range(options.frames):
            draw_next()
        ready.wait()
        start, cpu, done = time.perf_counter(), time.process_time(), 0
        while time.perf_counter() - start < options.seconds:
            draw_next()
            done += 1
        return done / (time.perf_counter() - start), (time.process_time() - cpu) / done


def frames(renderer: Renderer, options: argparse.Namespace) -> None:
    """Stages and totals at both sizes."""
    print(f"{'size':>10} {'total s':>8} {'cpu s':>8}  " + "  ".join(f"{stage:>11}" for stage in STAGES))
    totals = []
    for width, height in SIZES:
        views = [view_of(scene, 0) for scene in scenes_of(options.frames, width, height, plain=options.plain)]
        rows = [fastest(renderer, view, options.repeat) for view in views]
        mean = {key: sum(row[key] for row in rows) / len(rows) for key in rows[0]}
        totals.append(mean)
        split = "  ".join(f"{mean[stage]:11.3f}" for stage in STAGES)
        print(f"{width:>5}x{height:<4} {mean['total']:8.3f} {mean['cpu']:8.3f}  {split}")
    faces = sum(face_count(view) for view in views) / len(views)
    small, large = (t["cpu"] for t in totals)
    print(f"1920x1080 costs {large / small:.2f} x 960x540 for 4 x the pixels; {faces:,.0f} triangles a scene")


def triangles(renderer: Renderer, options: argparse.Namespace) -> None:
    """Processor time over the number of triangles of one scene."""
    view = view_of(scenes_of(1, *SIZES[0])[0], 0)
    for _ in range(3):
        row = fastest(renderer, view, options.repeat)
        print(f"{face_count(view):>12,} triangles {row['cpu']:8.3f} cpu s")
        view = replace(view, drawables=tuple(replace(d, mesh=divided(d.mesh)) for d in view.drawables))


def divided(mesh: Mesh) -> Mesh:
    """Every triangle as four."""
    a, b, c = (mesh.vertices[mesh.faces[:, i]] for i in range(3))
    na, nb, nc = (mesh.normals[mesh.faces[:, i]] for i in range(3))
    points = np.concatenate([a, b, c, (a + b) / 2, (b + c) / 2, (c + a) / 2])
    normals = np.concatenate([na, nb, nc, na + nb, nb + nc, nc + na])
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    count = len(mesh.faces)
    A, B, C, AB, BC, CA = (np.arange(count) + i * count for i in range(6))
    faces = np.concatenate([np.stack(t, -1) for t in ((A, AB, CA), (AB, B, BC), (CA, BC, C), (AB, BC, CA))])
    parts = np.tile(mesh.face_parts, 4)
    return Mesh(
        points.astype(np.float32), normals.astype(np.float32), faces.astype(np.int32), parts, mesh.part_names
    )


def fidelity(options: argparse.Namespace) -> None:
    """PSNR and processor time of both qualities against 4 x 4 samples per pixel."""
    views = [view_of(scene, 0) for scene in scenes_of(options.frames, 480, 270)]
    with open_renderer(options, "high", supersampling=4) as renderer:
        references = [renderer.draw(view).radiance for view in views]
    for quality in ("high", "fast"):
        with open_renderer(options, quality) as renderer:
            rows = [fastest(renderer, view, options.repeat) for view in views]
            images = [renderer.draw(view).radiance for view in views]
        psnr = np.mean([_psnr(a, b) for a, b in zip(images, references, strict=True)])
        cpu = np.mean([row["cpu"] for row in rows])
        print(f"{quality:>5}: {psnr:.1f} dB against 4 x 4 samples, {cpu:.3f} cpu s at 480x270")


def _psnr(image: np.ndarray, reference: np.ndarray) -> float:
    white = np.quantile(reference, 0.97)
    error = np.clip(image / white, 0, 1).astype(float) - np.clip(reference / white, 0, 1)
    return float(-10 * np.log10((error**2).mean()))


def fastest(renderer: Renderer, view: View, repeat: int) -> dict[str, float]:
    """Seconds by stage of the fastest draw, its total and its processor time."""
    draw(renderer, view)
    rows: Sequence[dict[str, float]] = [draw(renderer, view) for _ in range(repeat)]
    return min(rows, key=lambda row: row["cpu"])


def draw(renderer: Renderer, view: View) -> dict[str, float]:
    """Seconds by stage; every stage waits for the device."""
    row = dict.fromkeys(STAGES, 0.0)
    cpu = time.process_time()
    start = last = time.perf_counter()

    def mark(stage: str) -> None:
        nonlocal last
        renderer.wait()
        now = time.perf_counter()
        row[stage] += now - last
        last = now

    renderer.draw(view, mark=mark)
    return row | {"total": time.perf_counter() - start, "cpu": time.process_time() - cpu}


def face_count(view: View) -> int:
    """Triangles of a view."""
    return sum(len(drawable.mesh.faces) for drawable in view.drawables)


if __name__ == "__main__":
    main()
