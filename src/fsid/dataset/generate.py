"""Fill a folder with shards: the missing ones only, by a crew of workers with one renderer each.

Shard s holds samples s*size ... (s+1)*size - 1. A worker makes whole shards; nothing passes between workers,
so their number changes the time and nothing else. A shard that exists is complete, so a run that was killed
goes on where it stopped, and one that is running keeps others out of its folder by a lock that dies with it.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from fsid.assets.survey import KNOWN
from fsid.config import check_fields, save_settings
from fsid.dataset.card import CARD, check_card, write_card
from fsid.dataset.config import DATASET_FILE, DatasetConfig, GenerateConfig
from fsid.dataset.crew import Crew, LocalCrew, run
from fsid.dataset.identity import check_same_pictures, dataset_config, is_begun
from fsid.dataset.near_duplicates import Looks, Settle, settle
from fsid.dataset.sample import encode, make_frame
from fsid.dataset.shards import count_whole, each_sample, remove_parts, shard_path, write_shard
from fsid.dataset.tasks import SceneRenderer
from fsid.dataset.worker import Worker
from fsid.errors import FsidError, whole
from fsid.files import held, stamp
from fsid.plurals import counted

SAMPLES_PER_WORKER = 320
"""After so many a worker is replaced, so that whatever a driver leaks stays small."""

_MOST_PAIRS = 100_000_000
"""Keys have eight digits."""

DEAD_AFTER_S = 86400
"""Where there are no locks, a file that was not written to for so long is of a process that died."""


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
        check_fields(self)
        if self.workers < 1 or self.workers_per_gpu < 0:
            raise FsidError("--workers must be at least 1, --workers-per-gpu at least 0")

    def crew(self, tasks: int) -> Crew:
        """As many workers as `tasks` can use, which share the cores; none of them started."""
        size, make_worker = min(self.workers, tasks), partial(Worker, surveys=dict(KNOWN))
        if not self.ray:
            return LocalCrew(size, make_worker, self.workers_per_gpu)
        from fsid.dataset.ray_crew import RayCrew

        return RayCrew(self.ray, size, make_worker, self.workers_per_gpu)


@dataclass(frozen=True)
class _Shard:
    """kept: so many samples, of whole frames, are there already. indices: of the others."""

    path: Path
    kept: int
    indices: range
    dataset: DatasetConfig

    def __str__(self) -> str:
        return self.path.name

    def do(self, worker: Worker) -> int:
        """Write the shard; number of its new samples. FsidError where pictures came or went meanwhile."""
        if images := self.dataset.generate.images:
            check_same_pictures(self.path.parent, self.dataset, stamp(Path(images)))
        kept = itertools.islice(each_sample(self.path), self.kept) if self.kept else ()
        write_shard(self.path, itertools.chain(kept, self._samples(worker)))
        return len(self.indices)

    def _samples(self, worker: Worker) -> Iterator[tuple[str, dict[str, bytes]]]:
        config = self.dataset.generate
        first, last = (index // config.pairs_per_frame for index in (self.indices[0], self.indices[-1]))
        for frame in range(first, last + 1):
            yield from self._samples_of(frame, worker.renderer(config))

    def _samples_of(
        self, frame: int, renderer: SceneRenderer | None
    ) -> Iterator[tuple[str, dict[str, bytes]]]:
        """Nothing of a frame is left when the next one is rendered, which needs the memory."""
        config = self.dataset.generate
        for sample in make_frame(config, self.dataset.seed, frame, renderer):
            if sample.record["index"] in self.indices:
                yield sample.key, encode(sample)


def generate(
    out: str | Path,
    config: GenerateConfig,
    *,
    count: int,
    seed: int = 0,
    workers: int = 1,
    shard_size: int = 0,
    progress: Callable[[int, int], None] = lambda done, total: None,
    workforce: Workforce | None = None,
    lost: Callable[[str], None] = lambda line: None,
    finishing: Callable[[int, int], None] = lambda done, total: None,
    looking: Callable[[int, int], None] = lambda done, total: None,
    command: str = "",
) -> int:
    """Make the samples 0 .. count-1 that `out` lacks; returns how many were made.

    workers: short for Workforce(workers); each is a process that imports the calling script, so a script
    calls this under `if __name__ == "__main__":`. shard_size: samples, a multiple of
    `config.pairs_per_frame`; 0 takes the first one from 16 on. progress(done, total): samples, called at
    the start and after every shard. lost(line): called for every worker that died; its shard is made again by
    another. finishing(done, total): shards that are read again when all are there, for near-duplicates and
    for the dataset card, README.md. looking(done, total): shards of which it is seen, at the start, whether
    they are whole. command: for the card.
    Raises FsidError where `out` already holds a dataset of another configuration or seed, or shards of a
    larger count that would stay incomplete, where another process fills it, where the disk refuses, or where
    a shard kills its worker again and again.
    """
    count = check_count(count)
    out, workforce = Path(out), workforce or Workforce(workers)
    dataset = dataset_config(config, seed, shard_size)
    with _locked(out):
        begun, todo = _check_own(out, dataset), list(_missing(out, dataset, count, looking))
        _check_unbroken(out, dataset.shard_size, count)
        if todo or not begun:
            check_card(out)
        if not begun:
            save_settings(dataset, out / DATASET_FILE)
        total = sum(len(shard.indices) for shard in todo)
        done = count - total
        progress(done, count)
        tasks_per_worker = max(1, SAMPLES_PER_WORKER // dataset.shard_size)
        if todo:
            _withdraw_card(out)
            for _, made in run(workforce.crew(len(todo)), todo, tasks_per_worker=tasks_per_worker, lost=lost):
                done += made
                progress(done, count)

        def redraw(task: Settle) -> Looks:
            ((_, looks),) = run(workforce.crew(1), [task], tasks_per_worker=1, lost=lost)
            return looks

        if todo or not (out / CARD).exists():
            shards = list(_unbroken(out, dataset.shard_size))
            both = 2 * len(shards)
            settle(shards, dataset.generate, dataset.seed, redraw, lambda n: finishing(n, both))
            write_card(out, dataset, shards, command, lambda n: finishing(len(shards) + n, both))
    return total


def check_count(count: int) -> int:
    """`count` as a whole number; FsidError unless a dataset may have so many pairs."""
    count = whole(count, "count")
    if count < 1:
        raise FsidError(f"--count {count}: must be at least 1")
    if count > _MOST_PAIRS:
        raise FsidError(f"--count {count}: at most {_MOST_PAIRS:,}; make several datasets, of a seed each")
    return count


def pairs_to_make(
    out: str | Path,
    dataset: DatasetConfig,
    count: int,
    looking: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[int, int]:
    """How many of the first `count` pairs `out` lacks, in whole frames, and in how many shards they are.

    looking: as of `generate`. FsidError where it holds others, and for a count as there.
    """
    out, count = Path(out), check_count(count)
    _check_own(out, dataset)
    missing = list(_missing(out, dataset, count, looking))
    _check_unbroken(out, dataset.shard_size, count)
    if missing:
        check_card(out)
    return sum(len(shard.indices) for shard in missing), len(missing)


def pairs_there(out: str | Path, shard_size: int) -> int:
    """How many pairs `out` has, whole shards and those of the last one."""
    shards = sorted(Path(out).glob("shard-*.tar"))
    return (len(shards) - 1) * shard_size + count_whole(shards[-1]) if shards else 0


@contextmanager
def _locked(out: Path) -> Iterator[None]:
    """`out` is this process's, and free of what an interrupted one left, if that is sure to be dead."""
    with held(out, "another fsid generate is filling it") as alone:
        unused_s = 0 if alone else DEAD_AFTER_S
        remove_parts(out, unused_s)
        try:
            yield
        finally:
            remove_parts(out, unused_s)


def _withdraw_card(out: Path) -> None:
    """A card is there only while all samples are."""
    try:
        (out / CARD).unlink(missing_ok=True)
    except OSError as error:
        raise FsidError(f"{out}: cannot be written ({error.strerror})") from None


def _check_own(out: Path, dataset: DatasetConfig) -> bool:
    """`is_begun`; FsidError where the pictures lie in `out`, too: the contact sheet would be one of them."""
    images = dataset.generate.images
    if images and os.path.realpath(images) == os.path.realpath(out):
        raise FsidError(f"{out}: is the folder of the pictures; give another one for the dataset")
    return is_begun(out, dataset)


def _unbroken(out: Path, size: int, first: int = 0) -> Iterator[Path]:
    """The shards from number `first` on, up to one that is not full or not there.

    Also those beyond the count that is asked for: once there is a card, a later run would not settle them.
    """
    for path in (shard_path(out, number) for number in itertools.count(first)):
        if not path.exists():
            return
        yield path
        if count_whole(path) < size:
            return


def _check_unbroken(out: Path, size: int, count: int) -> None:
    """FsidError where shards of a larger count would lie beyond a gap when this one is made: they would not
    be settled, nor counted by the card, but whatever reads the dataset would take them."""
    first = count // size
    settled = {*(shard_path(out, number) for number in range(first)), *_unbroken(out, size, first)}
    beyond = [path.name for path in out.glob("shard-*.tar") if path not in settled]
    if beyond:
        raise FsidError(
            f"{out}: {counted(len(beyond), 'shard')} from {min(beyond)} on would lie beyond a gap, of a "
            "larger --count that was not finished; take that one again, or delete these shards"
        )


def _missing(
    out: Path, dataset: DatasetConfig, count: int, looking: Callable[[int, int], None]
) -> Iterator[_Shard]:
    size, looks = dataset.shard_size, False
    starts = range(0, count, size)
    for number, start in enumerate(starts):
        indices = range(start, min(start + size, count))
        path = shard_path(out, number)
        there = count_whole(path) if path.exists() else 0
        looks = looks or there > 0  # where there is none yet, it takes no time
        if looks:
            looking(number + 1, len(starts))
        if there < len(indices):
            kept = there - there % dataset.generate.pairs_per_frame
            yield _Shard(path, kept, indices[kept:], dataset)
