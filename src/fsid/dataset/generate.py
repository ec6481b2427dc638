"""Fill a folder with shards: the missing ones only, by a pool of workers with one renderer each.

Shard s holds samples s*size ... (s+1)*size - 1. A worker makes whole shards; nothing passes between workers,
so their number changes the time and nothing else.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

from fsid.config import from_plain, read_yaml, save_settings, to_plain
from fsid.dataset.config import GenerateConfig
from fsid.dataset.photos import find_photos
from fsid.dataset.sample import encode, make_sample, sample_key
from fsid.dataset.shards import part_path, shard_keys, shard_path, write_shard
from fsid.errors import FsidError
from fsid.render import Renderer
from fsid.sensor import load_profile

SHARD_SIZE = 16


@dataclass(frozen=True)
class DatasetConfig:
    """What `config.yaml` beside the shards says: the identity of the dataset."""

    seed: int
    shard_size: int
    generate: GenerateConfig


@dataclass(frozen=True)
class _Shard:
    path: Path
    indices: range
    dataset: DatasetConfig


def generate(
    out: Path,
    config: GenerateConfig,
    *,
    count: int,
    seed: int = 0,
    workers: int = 1,
    shard_size: int = SHARD_SIZE,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> int:
    """Make the samples 0 .. count-1 that `out` lacks; returns how many were made.

    progress(done, total): samples, called at the start and after every shard.
    Raises FsidError where `out` already holds a dataset of another configuration or seed.
    """
    if count < 1 or workers < 1 or shard_size < 1:
        raise FsidError("--count, --workers and the shard size must be at least 1")
    for camera in config.cameras:
        load_profile(camera)
    if config.images:
        find_photos(Path(config.images))
    dataset = DatasetConfig(seed, shard_size, config)
    _claim(out, dataset)
    todo = list(_missing(out, dataset, count))
    total = sum(len(shard.indices) for shard in todo)
    done = count - total
    progress(done, count)
    for made in _make_shards(todo, workers):
        done += made
        progress(done, count)
    return total


def _make_shards(todo: list[_Shard], workers: int) -> Iterator[int]:
    """Number of samples of each shard as it is finished; half-written ones are removed when stopped."""
    if not todo:
        return
    pool = get_context("spawn").Pool(min(workers, len(todo)), initializer=_share_cores, initargs=(workers,))
    try:
        with pool:
            for made in pool.imap_unordered(_make_shard, todo):
                if isinstance(made, FsidError):
                    raise made
                yield made
    finally:
        pool.join()
        for shard in todo:
            part_path(shard.path).unlink(missing_ok=True)


def _claim(out: Path, dataset: DatasetConfig) -> None:
    file = out / "config.yaml"
    try:
        out.mkdir(parents=True, exist_ok=True)
        if not file.exists():
            save_settings(dataset, file)
            return
    except OSError as error:
        raise FsidError(f"{out}: cannot be written ({error.strerror})") from None
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


def _share_cores(workers: int) -> None:
    """A software rasteriser would start one thread per core in every worker."""
    os.environ.setdefault("LP_NUM_THREADS", str(max(1, (os.cpu_count() or 1) // workers)))


@functools.cache
def _renderer(supersampling: int, texture_size: int) -> Renderer:
    """This process's renderer: one GL context per process, made when the first scene needs it."""
    return Renderer(supersampling=supersampling, texture_size=texture_size)


def _make_shard(shard: _Shard) -> int | FsidError:
    """Bad input travels back as a value: a raised error would lose its type in some pools."""
    config = shard.dataset.generate
    try:
        renderer = None if config.images else _renderer(config.supersampling, config.texture_px)
        write_shard(
            shard.path,
            (
                (sample_key(i), encode(make_sample(config, shard.dataset.seed, i, renderer)))
                for i in shard.indices
            ),
        )
    except FsidError as error:
        return error
    return len(shard.indices)
