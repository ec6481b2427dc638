"""What a dataset will cost, from a short sample that is measured on the spot.

    time = pairs of the busiest worker * seconds of a frame / pairs per frame    seconds: all workers at once

Every worker makes a frame to warm up (programs compiled, first materials baked) and then `FRAMES` frames that
count, while the others do the same, so what they take from each other is in the figure.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

from fsid.dataset.config import GenerateConfig
from fsid.dataset.crew import run
from fsid.dataset.generate import Workforce
from fsid.dataset.identity import dataset_config
from fsid.dataset.sample import encode, make_frame
from fsid.dataset.worker import Worker

FRAMES = 3
_TAR_BLOCK = 512


@dataclass(frozen=True)
class Estimate:
    """workers: that have a shard to make. seconds: of all pairs, by these. bytes: on disk. measured_pairs:
    what it is based on."""

    pairs: int
    shards: int
    workers: int
    seconds: float
    bytes: int
    measured_pairs: int


@dataclass(frozen=True)
class _Trial:
    config: GenerateConfig
    seed: int
    first_frame: int

    def __str__(self) -> str:
        return f"frame {self.first_frame}"

    def do(self, worker: Worker) -> tuple[float, int, int]:
        """Seconds, bytes in a tar and number of the pairs of `FRAMES` frames."""
        self._make(worker, self.first_frame)
        start = time.perf_counter()
        made = [self._make(worker, self.first_frame + 1 + number) for number in range(FRAMES)]
        return time.perf_counter() - start, sum(size for size, _ in made), sum(pairs for _, pairs in made)

    def _make(self, worker: Worker, frame: int) -> tuple[int, int]:
        samples = make_frame(self.config, self.seed, frame, worker.renderer(self.config))
        files = [data for sample in samples for data in encode(sample).values()]
        return sum(_TAR_BLOCK - len(data) // -_TAR_BLOCK * _TAR_BLOCK for data in files), len(samples)


def estimate(
    config: GenerateConfig, *, count: int, seed: int, workforce: Workforce, shards: int = 0
) -> Estimate:
    """Cost of `count` samples made by `workforce`; writes nothing. FsidError as in `generate`.

    shards: in which they are; 0: those of a new dataset.
    """
    dataset = dataset_config(config, seed)
    shards = shards or -(-count // dataset.shard_size)
    workers = min(workforce.workers, shards)
    trials = [_Trial(config, seed, (1 + FRAMES) * worker) for worker in range(workers)]
    results = [result for _, result in run(workforce.crew(workers), trials, tasks_per_worker=workers)]
    pairs = sum(made for _, _, made in results)
    seconds_per_pair = sum(seconds for seconds, _, _ in results) / pairs
    return Estimate(
        pairs=count,
        shards=shards,
        workers=workers,
        seconds=seconds_per_pair * pairs_of_busiest(count, shards, workers, dataset.shard_size),
        bytes=round(count * sum(size for _, size, _ in results) / pairs),
        measured_pairs=pairs,
    )


def pairs_of_busiest(count: int, shards: int, workers: int, shard_size: int) -> int:
    """How many of `count` pairs the worker makes that makes most, at most: shards are made whole."""
    most = -(-shards // workers)
    return min(most * shard_size, count - (shards - most))
