"""Fill a folder with shards: the missing ones only, by a crew of workers with one renderer each.

Shard s holds samples s*size ... (s+1)*size - 1. A worker makes whole shards; nothing passes between workers,
so their number changes the time and nothing else. A shard that exists is complete, so a run that was killed
goes on where it stopped, and one that is running keeps others out of its folder by a lock that dies with it.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from fsid.config import from_plain, read_yaml, save_settings, to_plain
from fsid.dataset.config import GenerateConfig
from fsid.dataset.crew import Crew, LocalCrew, MakeWork, run
from fsid.dataset.photos import find_photos
from fsid.dataset.sample import encode, make_sample, sample_key
from fsid.dataset.shards import remove_parts, shard_keys, shard_path, write_shard
from fsid.errors import FsidError
from fsid.render import Renderer
from fsid.sensor import load_profile

SHARD_SIZE = 16
SAMPLES_PER_WORKER = 320
"""After so many a worker is replaced, so that whatever a driver leaks stays small."""


@dataclass(frozen=True)
class DatasetConfig:
    """What `config.yaml` beside the shards says: the identity of the dataset."""

    seed: int
    shard_size: int
    generate: GenerateConfig


@dataclass(frozen=True)
class Workforce:
    """Who makes a dataset; it changes the time and nothing else.

    workers: processes here, or actors of the Ray cluster at the address `ray`. workers_per_gpu: how many
    share a GPU; 0 lets every worker take the first there is.
    """

    workers: int = 1
    ray: str = ""
    workers_per_gpu: int = 0

    def __post_init__(self) -> None:
        if self.workers < 1 or self.workers_per_gpu < 0:
            raise FsidError("--workers must be at least 1, --workers-per-gpu at least 0")

    def crew(self, make_work: MakeWork) -> Crew:
        """The workers, none of them started."""
        if not self.ray:
            return LocalCrew(self.workers, make_work, self.workers_per_gpu)
        from fsid.dataset.ray_crew import RayCrew

        return RayCrew(self.ray, self.workers, make_work, self.workers_per_gpu)


@dataclass(frozen=True)
class _Shard:
    path: Path
    indices: range
    dataset: DatasetConfig

    def __str__(self) -> str:
        return self.path.name


def generate(
    out: Path,
    config: GenerateConfig,
    *,
    count: int,
    seed: int = 0,
    workers: int = 1,
    shard_size: int = SHARD_SIZE,
    progress: Callable[[int, int], None] = lambda done, total: None,
    workforce: Workforce | None = None,
    lost: Callable[[str], None] = lambda line: None,
) -> int:
    """Make the samples 0 .. count-1 that `out` lacks; returns how many were made.

    workers: short for Workforce(workers). progress(done, total): samples, called at the start and after every
    shard. lost(line): called for every worker that died; its shard is made again by another.
    Raises FsidError where `out` already holds a dataset of another configuration or seed, where another
    process fills it, where the disk refuses, or where a shard kills its worker again and again.
    """
    if count < 1 or shard_size < 1:
        raise FsidError("--count and the shard size must be at least 1")
    workforce = workforce or Workforce(workers)
    for camera in config.cameras:
        load_profile(camera)
    if config.images:
        find_photos(Path(config.images))
    dataset = DatasetConfig(seed, shard_size, config)
    with _locked(out):
        _claim(out, dataset)
        todo = list(_missing(out, dataset, count))
        total = sum(len(shard.indices) for shard in todo)
        done = count - total
        progress(done, count)
        for made in _make_shards(out, todo, workforce, lost):
            done += made
            progress(done, count)
    return total


def _make_shards(
    out: Path, todo: list[_Shard], workforce: Workforce, lost: Callable[[str], None]
) -> Iterator[int]:
    """Number of samples of each shard as it is finished; half-written ones are removed when stopped."""
    if not todo:
        return
    crew = workforce.crew(_ShardMaker)
    tasks_per_worker = max(1, SAMPLES_PER_WORKER // len(todo[0].indices))
    try:
        for _, made in run(crew, todo, tasks_per_worker=tasks_per_worker, lost=lost):
            yield made
    finally:
        remove_parts(out)


@contextmanager
def _locked(out: Path) -> Iterator[None]:
    """`out` exists and is this process's until the end of the block, or until it dies."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        folder = os.open(out, os.O_RDONLY | os.O_DIRECTORY)
    except OSError as error:
        raise FsidError(f"{out}: cannot be written ({error.strerror})") from None
    try:
        try:
            fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise FsidError(f"{out}: another fsid generate is filling it; wait for it or stop it") from None
        except OSError:
            pass  # a network file system without locks
        remove_parts(out)
        yield
    finally:
        os.close(folder)


def _claim(out: Path, dataset: DatasetConfig) -> None:
    file = out / "config.yaml"
    if not file.exists():
        save_settings(dataset, file)
        return
    there = from_plain(DatasetConfig, read_yaml(file), source=str(file))
    if there != dataset:
        keys = ", ".join(_differing(to_plain(there), to_plain(dataset)))
        raise FsidError(
            f"{out}: already holds another dataset; these differ: {keys}. "
            "Use another folder, or the same settings"
        )


def _differing(there: dict, here: dict, path: str = "") -> Iterator[str]:
    for key in there | here:
        a, b = there.get(key), here.get(key)
        if isinstance(a, dict) and isinstance(b, dict):
            yield from _differing(a, b, f"{path}{key}.")
        elif a != b:
            yield f"{path}{key} ({a} there, {b} here)"


def _missing(out: Path, dataset: DatasetConfig, count: int) -> Iterator[_Shard]:
    size = dataset.shard_size
    for number, start in enumerate(range(0, count, size)):
        indices = range(start, min(start + size, count))
        path = shard_path(out, number)
        if not path.exists() or len(shard_keys(path)) < len(indices):
            yield _Shard(path, indices, dataset)


class _ShardMaker:
    """Makes shards in a worker; owns its renderer, which opens when the first scene needs it."""

    def __init__(self, gpu: int | None) -> None:
        self._gpu = gpu
        self._renderer: Renderer | None = None

    def __call__(self, shard: _Shard) -> int:
        config = shard.dataset.generate
        renderer = None if config.images else self._open(config)
        write_shard(
            shard.path,
            (
                (sample_key(i), encode(make_sample(config, shard.dataset.seed, i, renderer)))
                for i in shard.indices
            ),
        )
        return len(shard.indices)

    def _open(self, config: GenerateConfig) -> Renderer:
        if self._renderer is None:
            self._renderer = Renderer(
                device_index=self._gpu,
                supersampling=config.supersampling,
                texture_size=config.texture_px,
            )
        return self._renderer
