"""What a dataset costs beside rendering: python bench/dataset.py --only PART

All ratios are of one run. "cpu" is processor time of all threads of the process, which stays true on a busy
machine. Parts: stages (cost of a pair), workers (two against one), memory (per scene), growth (time over
pixels and triangles), loader (patches per second). Memory is of 128x72, 3 to 5 objects and fast quality, with
--width of default scenes in high quality: --only memory --scenes 1000, --only memory --scenes 8 --width 1920.
"""

from __future__ import annotations

import argparse
import ctypes
import os
import resource
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from fsid.dataset import GenerateConfig, encode, generate
from fsid.dataset.attempt import Attempt
from fsid.dataset.crew import thread_limits
from fsid.dataset.shards import write_shard
from fsid.dataset.tasks import SceneRenderer
from fsid.dataset.worker import rendering
from fsid.render import Renderer
from fsid.scene import Scene
from fsid.scene.config import SceneConfig

SECTIONS = ("stages", "workers", "memory", "growth", "loader")


class Timed:
    """A renderer that adds up the processor time it takes; sampling of the scene is not in it."""

    def __init__(self, renderer: Renderer) -> None:
        self._renderer, self.cpu_s = renderer, 0.0
        self.scenes: list[Scene] = []

    def radiance(self, scene: Scene, camera_index: int = 0) -> np.ndarray:
        start = time.process_time()
        light = self._renderer.radiance(scene, camera_index)
        self.cpu_s += time.process_time() - start
        self.scenes.append(scene)
        return light


@dataclass(frozen=True)
class Pair:
    """Mean processor seconds of a pair. fresh: rendering, with materials that no scene before it had; again:
    the same scene rendered a second time; rest: all that is not rendering."""

    fresh: float
    again: float
    rest: float
    bytes: int

    def __str__(self) -> str:
        share, warm = (100 * self.rest / (self.rest + render) for render in (self.fresh, self.again))
        return (
            f"rendering {self.fresh:.2f} s, {self.again:.2f} s where its materials are there; "
            f"else {self.rest:.2f} s: {share:.1f} %, {warm:.1f} %; {self.bytes / 1e6:.1f} MB"
        )


def stages(config: GenerateConfig, pairs: int) -> Pair:
    """What a pair costs, after one that compiles the programs."""
    with Renderer(supersampling=config.supersampling, texture_size=config.texture_px) as renderer:
        make(config, 0, renderer)
        timed, start = Timed(renderer), time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            shard = Path(folder) / "shard.tar"
            write_shard(shard, (encoded for i in range(1, pairs + 1) for encoded in make(config, i, timed)))
            size = shard.stat().st_size
        total = time.process_time() - start
        again = Timed(renderer)
        for scene in timed.scenes:
            renderer.radiance(scene)
            again.radiance(scene)
    return Pair(timed.cpu_s / pairs, again.cpu_s / pairs, (total - timed.cpu_s) / pairs, size // pairs)


def make(
    config: GenerateConfig, frame: int, renderer: SceneRenderer | None
) -> list[tuple[str, dict[str, bytes]]]:
    """The encoded samples of a frame, whatever the checks say."""
    free = replace(config, checks=replace(config.checks, black_share=1.0, blown_share=1.0))
    samples = Attempt(free, 0, frame).samples(renderer)
    assert isinstance(samples, list), samples
    return [(sample.key, encode(sample)) for sample in samples]


def workers(config: GenerateConfig, pairs: int) -> None:
    """Two workers of one thread against one, and against one of two threads; their start is left out."""
    teams = {"1 of 1 thread": (1, 1), "1 of 2 threads": (1, 2), "2 of 1 thread": (2, 1)}
    rates = dict.fromkeys(teams, 0.0)
    for _ in range(2):
        for name, (count, threads) in teams.items():
            os.environ.update(thread_limits(threads))
            rates[name] = max(rates[name], pairs_per_second(config, pairs, count))
    best = rates.pop("2 of 1 thread")
    print(f"workers: 2 of 1 thread make {best:.2f} pairs/s")
    for name, rate in rates.items():
        print(f"  {name} makes {rate:.2f}: 2 make {best / rate:.2f} times as many")


def pairs_per_second(config: GenerateConfig, pairs: int, count: int) -> float:
    """Of the second half of 4 x `pairs` shards of one pair."""
    times: list[tuple[float, int]] = []

    def progress(done: int, total: int) -> None:
        times.append((time.perf_counter(), done))

    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "data"
        generate(out, config, count=4 * pairs, workers=count, shard_size=1, progress=progress)
    (start, before), (end, after) = times[2 * pairs], times[4 * pairs]
    return (after - before) / (end - start)


class Mallinfo2(ctypes.Structure):
    """glibc's statistics of malloc; hblkhd: bytes in blocks that are mapped one by one."""

    _fields_ = (("first", ctypes.c_size_t * 4), ("hblkhd", ctypes.c_size_t), ("last", ctypes.c_size_t * 5))


def memory(config: GenerateConfig, scenes: int) -> None:
    """Resident memory of a worker of one thread over scenes, with a line through the second half; and without
    blocks above a MiB: images, whose size is that of the scene's lights, and up to 80 MiB of materials."""
    mallinfo2 = ctypes.CDLL(None).mallinfo2
    mallinfo2.restype = Mallinfo2
    os.environ.update(thread_limits(1))
    held, every = np.zeros((scenes, 2)), max(1, scenes // 20)
    with rendering(config) as renderer:
        for i in range(scenes):
            make(config, i, renderer)
            resident = int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()
            held[i] = np.array([resident, resident - mallinfo2().hblkhd]) / 2**20
            if (i + 1) % every == 0:
                peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
                mean, small = held[i + 1 - every : i + 1].mean(0)
                line = f"  to scene {i + 1}: {mean:.0f} MiB, {small:.0f} in small blocks, peak {peak:.0f}"
                print(line, flush=True)
    half = held[scenes // 2 :]
    if len(half) < 3:
        return  # no line is certain
    for name, column in zip(("memory", "in small blocks"), half.T, strict=True):
        (slope, _), covariance = np.polyfit(np.arange(len(half)), column, 1, cov=True)
        print(
            f"{name}: {slope:+.3f} +- {covariance[0, 0] ** 0.5:.3f} MiB per scene over the last {len(half)}"
        )


def growth(config: GenerateConfig) -> None:
    """Rendering time over pixels, and over triangles at one size."""
    with Renderer(supersampling=config.supersampling, texture_size=config.texture_px) as renderer:
        for width, height in ((480, 270), (960, 540), (1920, 1080)):
            sized = replace(config, width=width, height=height, texture_size=config.texture_px)
            print(f"{width}x{height}: {render_seconds(sized, renderer):.2f} s per frame")
        for objects in (10, 40, 160):
            scene = replace(config.scene, objects=(objects, objects))
            sized = replace(config, width=960, height=540, texture_size=config.texture_px, scene=scene)
            print(f"{objects} objects at 960x540: {render_seconds(sized, renderer):.2f} s per frame")


def render_seconds(config: GenerateConfig, renderer: Renderer, scenes: int = 2) -> float:
    """Mean over scenes of the faster of two renders each, after one that loads what it needs."""
    total = 0.0
    for i in range(scenes):
        scene = Attempt(config, 0, i).drawn_scene()
        renderer.render(scene)
        total += min(seconds(partial(renderer.render, scene)) for _ in range(2))
    return total / scenes


def seconds(work: Callable[[], object]) -> float:
    """Wall time of one call."""
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def loader(processes: int = 2) -> None:
    """Packed 128x128 patches/s from a warm cache, and those that a training step of two networks eats."""
    from fsid.dataset.feed import batches
    from fsid.dataset.loader import PatchConfig, PatchDataset

    with tempfile.TemporaryDirectory() as folder:
        write_noise(Path(folder))
        config = PatchConfig(128, 16, ("pixel6", "galaxy-s22"), 400, 8000)
        patches = PatchDataset(Path(folder), config, seed=0)
        rates: dict[int, float] = {}
        for count in (0, processes, 0, processes):
            times = [time.perf_counter() for _ in batches(patches, range(300), count)]
            rate = 240 * config.batch / (times[-1] - times[-241])
            rates[count] = max(rates.get(count, 0.0), rate)
    print(f"loader: this process {rates[0]:.0f} patches/s, {processes} others {rates[processes]:.0f}")
    for name in ("nafnet-tiny", "nafnet-small"):
        eaten = eaten_by(name)
        print(
            f"a training step of {name} eats {eaten:.1f} patches/s of as many pixels: the loader makes "
            f"{rates[processes] / eaten:.0f} times as many"
        )


def eaten_by(name: str) -> float:
    """Packed 128x128 patches/s that forward and backward of a network of this name take on this machine."""
    import torch

    from fsid.denoise import train_config
    from fsid.denoise.raw_denoiser import RawDenoiser

    config = train_config(name)
    net, shape = RawDenoiser(config.network), (config.batch, 4, config.patch_px, config.patch_px)
    noisy, level = torch.rand(shape), torch.full((config.batch, 4), 1e-3)

    def step() -> None:
        net(noisy, level, level).square().mean().backward()

    step()
    return config.batch / min(seconds(step) for _ in range(5)) * (config.patch_px / 128) ** 2


def write_noise(folder: Path) -> None:
    """A dataset of 16 random full HD mosaics."""
    import io

    from fsid.sensor import Raw, write_dng

    rng = np.random.default_rng(0)
    for number in range(4):
        samples = []
        for i in range(4):
            file = io.BytesIO()
            x = rng.random((1080, 1920), np.float32)
            write_dng(file, Raw(x, "GRBG", 4096, 65472, (2.0, 1.0, 1.5), np.eye(3)))
            samples.append((f"{4 * number + i:08d}", {"clean.dng": file.getvalue()}))
        write_shard(folder / f"shard-{number:05d}.tar", samples)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--pairs", type=int, default=3, help="pairs per measurement")
    parser.add_argument("--scenes", type=int, default=300, help="scenes of memory")
    parser.add_argument("--width", type=int, help="of a frame, pixels; 16:9. 1920, of memory 128")
    parser.add_argument("--only", choices=SECTIONS, help="one part")
    options = parser.parse_args()
    width = options.width or 1920
    config = GenerateConfig(width=width, height=width * 9 // 32 * 2)
    small = GenerateConfig(width=320, height=180, scene=SceneConfig(objects=(10, 20)))
    tiny = GenerateConfig(width=128, height=72, quality="fast", scene=SceneConfig(objects=(3, 5)))
    sections: dict[str, Callable[[], object]] = {
        "stages": lambda: print(f"pair of {config.width}x{config.height}: {stages(config, options.pairs)}"),
        "workers": lambda: workers(small, 2 * options.pairs),
        "memory": lambda: memory(config if options.width else tiny, options.scenes),
        "growth": lambda: growth(config),
        "loader": loader,
    }
    for name in [options.only] if options.only else SECTIONS:
        sections[name]()


if __name__ == "__main__":
    main()
