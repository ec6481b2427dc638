"""Near-duplicates across a dataset: the later of two frames that look alike is drawn again.

    frame f is settled when it looks like no settled frame before it

Frames are settled in their order, so the result depends on settings and seed alone: not on who made what
when, and not on how often the run was interrupted. A frame that still looks like another one after
`REDRAWS` attempts is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fsid.dataset.config import GenerateConfig
from fsid.dataset.sample import ATTEMPTS, encode, make_frame
from fsid.dataset.shards import read_heads, read_samples, records_of, write_shard
from fsid.dataset.worker import Worker

REDRAWS = ATTEMPTS // 2
_TOGETHER = 256
"""Shards that a worker settles before the next are looked at: it takes seconds to start, and nothing is told
of what is done while it works."""


class Looks:
    """Fingerprints of settled frames, 256 bits each; alike are two of which at most `near_bits` differ."""

    def __init__(self, near_bits: int) -> None:
        self._near_bits = near_bits
        self._words = np.empty((4, 1024), np.uint64)  # those of a fingerprint in a column
        self.count = 0

    def has(self, looks: np.ndarray) -> bool:
        """Whether one of `looks` (n, 4) is like one of the known."""
        return any(self._has(row) for row in looks)

    def _has(self, row: np.ndarray) -> bool:
        """Fingerprints that differ by more in the first word alone are not looked at further: nearly all."""
        known = self._words[:, : self.count]
        near = known[:, np.bitwise_count(known[0] ^ row[0]) <= self._near_bits]
        differing = np.bitwise_count(near ^ row[:, None]).sum(0, dtype=int)
        return bool((differing <= self._near_bits).any())

    def add(self, looks: np.ndarray) -> None:
        """Remember `looks` (n, 4)."""
        while self.count + len(looks) > self._words.shape[1]:
            self._words = np.concatenate([self._words, np.empty_like(self._words)], axis=1)
        self._words[:, self.count : self.count + len(looks)] = looks.T
        self.count += len(looks)

    def forget(self, count: int) -> None:
        """Remember only the first `count`."""
        self.count = count


@dataclass(frozen=True, eq=False)
class _Frame:
    """looks: (crops, 4). refused: why earlier attempts at it were."""

    number: int
    refused: tuple[str, ...]
    looks: np.ndarray

    def is_open(self, looks: Looks) -> bool:
        """Whether it has to be drawn again."""
        return len(self.refused) < REDRAWS and looks.has(self.looks)


@dataclass(frozen=True)
class Settle:
    """The task of settling shards, in order. Frames that are not drawn again are copied. looks: of all frames
    before these shards."""

    paths: tuple[Path, ...]
    config: GenerateConfig
    seed: int
    looks: Looks

    def __str__(self) -> str:
        return f"the near-duplicates from {self.paths[0].name} on"

    def do(self, worker: Worker) -> Looks:
        """The looks of all frames up to the last of these shards."""
        for path in self.paths:
            if _has_open(path, self.looks):
                self._redraw(path, worker)
        return self.looks

    def _redraw(self, path: Path, worker: Worker) -> None:
        samples = read_samples(path)
        with records_of(path):
            frames = list(_frames(head for _, head in read_heads(path)))
        for frame in frames:
            last = frame
            while last.is_open(self.looks):
                refused = (*last.refused, "near-duplicate")
                again = make_frame(
                    self.config, self.seed, frame.number, worker.renderer(self.config), refused
                )
                samples |= {sample.key: encode(sample) for sample in again if sample.key in samples}
                last = next(_frames(sample.record for sample in again))
            self.looks.add(last.looks)
        write_shard(path, samples.items())


def settle(
    shards: Sequence[Path],
    config: GenerateConfig,
    seed: int,
    do: Callable[[Settle], Looks],
    read: Callable[[int], None] = lambda shards: None,
) -> None:
    """Settle the frames of all shards. Does nothing for pictures, see `Checks`.

    do(task): has a worker settle a shard with a frame that is to be drawn again, and some shards after it.
    read(shards): called with the number of shards that are done.
    """
    looks, done = Looks(config.checks.duplicate_bits), 0
    if config.images or config.checks.duplicate_bits < 0:
        return
    while done < len(shards):
        some = shards[done : done + 1]
        if _has_open(some[0], looks):
            some = shards[done : done + _TOGETHER]
            looks = do(Settle(tuple(some), config, seed, looks))
        done += len(some)
        read(done)


def _has_open(shard: Path, looks: Looks) -> bool:
    """Whether a frame of the shard has to be drawn again; if none, all are remembered."""
    before = looks.count
    with records_of(shard):
        for frame in _frames(head for _, head in read_heads(shard)):
            if frame.is_open(looks):
                looks.forget(before)
                return True
            looks.add(frame.looks)
    return False


def _frames(records: Iterable[Mapping[str, Any]]) -> Iterator[_Frame]:
    """The frames of consecutive samples."""
    by_number: dict[int, list[Mapping[str, Any]]] = {}
    for record in records:
        by_number.setdefault(record["frame"], []).append(record)
    for number, samples in by_number.items():
        prints = dict.fromkeys(record["fingerprint"] for record in samples)
        looks = np.array([np.frombuffer(bytes.fromhex(each), np.uint64) for each in prints])
        yield _Frame(number, tuple(samples[0]["refused"]), looks)
