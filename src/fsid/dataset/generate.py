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
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from fsid.assets.survey import KNOWN
from fsid.config import check_fields, from_plain, save_settings, to_plain
from fsid.dataset.card import CARD, check_card, write_card
from fsid.dataset.config import DATASET_FILE, RENDERED, DatasetConfig, GenerateConfig
from fsid.dataset.crew import Crew, LocalCrew, run
from fsid.dataset.near_duplicates import Looks, Settle, settle
from fsid.dataset.origins import (
    as_far_as_known,
    check_same_origins,
    check_same_pictures,
    files_digest,
    in_places_of,
    source_folders,
)
from fsid.dataset.pictures import find_pictures, pictures_digest
from fsid.dataset.sample import encode, make_frame
from fsid.dataset.shards import count_whole, each_sample, remove_parts, shard_path, write_shard
from fsid.dataset.tasks import SceneRenderer, check_cameras, check_task
from fsid.dataset.worker import Worker
from fsid.errors import FsidError, check_kind, whole
from fsid.files import held, stamp
from fsid.sensor import CameraProfile, load_bayer_profile
from fsid.sensor.profiles import profiles_digest
from fsid.yaml_json import read_yaml

SHARD_SIZE = 16
SAMPLES_PER_WORKER = 320
"""After so many a worker is replaced, so that whatever a driver leaks stays small."""

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
    command: str = "",
) -> int:
    """Make the samples 0 .. count-1 that `out` lacks; returns how many were made.

    workers: short for Workforce(workers); each is a process that imports the calling script, so a script
    calls this under `if __name__ == "__main__":`. shard_size: samples, a multiple of
    `config.pairs_per_frame`; 0 takes the first from SHARD_SIZE on. progress(done, total): samples, called at
    the start and after every shard. lost(line): called for every worker that died; its shard is made again by
    another. finishing(done, total): shards that are read again when all are there, for near-duplicates and
    for the dataset card, README.md. command: for the card.
    Raises FsidError where `out` already holds a dataset of another configuration or seed, where another
    process fills it, where the disk refuses, or where a shard kills its worker again and again.
    """
    count = whole(count, "count")
    if count < 1:
        raise FsidError(f"--count {count}: must be at least 1")
    out, workforce = Path(out), workforce or Workforce(workers)
    dataset = dataset_config(config, seed, shard_size)
    with _locked(out):
        begun, todo = _check_own(out, dataset), list(_missing(out, dataset, count))
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


def pairs_to_make(out: str | Path, dataset: DatasetConfig, count: int) -> tuple[int, int]:
    """How many of the first `count` pairs `out` lacks, in whole frames, and in how many shards they are.

    FsidError where it holds others.
    """
    out = Path(out)
    _check_own(out, dataset)
    missing = list(_missing(out, dataset, count))
    if missing:
        check_card(out)
    return sum(len(shard.indices) for shard in missing), len(missing)


def dataset_config(config: GenerateConfig, seed: int, shard_size: int = 0) -> DatasetConfig:
    """The identity of the dataset of (config, seed); FsidError where what it names does not exist.

    Surveys the folders of meshes, textures and skies, which takes minutes the first time.
    """
    check_settings(config)
    pairs = config.pairs_per_frame
    shard_size = shard_size or -(-SHARD_SIZE // pairs) * pairs
    if shard_size < 1 or shard_size % pairs:
        raise FsidError(f"shard size {shard_size}: is not a multiple of the {pairs} pairs of a frame")
    pictures = find_pictures(Path(config.images)) if config.images else []
    return DatasetConfig(
        seed,
        shard_size,
        config,
        pictures=len(pictures),
        pictures_digest=pictures_digest(pictures) if pictures else "",
        profiles_digest=profiles_digest(config.cameras),
        files_digest=files_digest(config),
    )


def check_settings(config: GenerateConfig) -> None:
    """FsidError where what `config` names does not exist, or its parts do not agree; reads no large file."""
    check_kind(config, GenerateConfig, "generate_config makes one of a file, a name or settings")
    for camera in config.cameras:
        _check_noise(load_bayer_profile(camera), config.iso_range[1])
    check_cameras(config)
    scene = config.scene
    for folder in source_folders(scene):
        if not Path(folder).exists():
            raise FsidError(f"{folder}: there is no such folder")
    if config.crops > config.windows and config.checks.duplicate_bits >= 0 and not config.images:
        raise FsidError(
            f"crops: {config.crops}, but crop_width and crop_height leave {config.windows} different ones, "
            "and near-duplicates are refused"
        )
    check_task(config, find_pictures(Path(config.images)) if config.images else [])


def _check_noise(profile: CameraProfile, highest_iso: float) -> None:
    """FsidError where noise is more than the white level; up there it would end the run that draws it."""
    try:
        profile.level(highest_iso)
    except FsidError as error:
        raise FsidError(f"iso_range: {error}") from None


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


def is_begun(out: str | Path, dataset: DatasetConfig) -> bool:
    """Whether the config.yaml of `out` is that of `dataset`; FsidError where `out` has samples of another.

    Without samples there is no other, whatever a run that failed before its first shard left there.
    """
    out = Path(out)
    file = out / DATASET_FILE
    if not file.exists():
        return False
    there = _used(from_plain(DatasetConfig, read_yaml(file), source=str(file)))
    here = in_places_of(there, as_far_as_known(there, _used(dataset)))
    if there == here or not (any(out.glob("shard-*.tar")) or any(out.glob("*.clean.dng"))):
        return there == here
    if there.generate == here.generate and there.seed == here.seed:
        check_same_origins(out, there)
    keys = ", ".join(_differing(to_plain(there), to_plain(here)))
    raise FsidError(
        f"{out}: already holds another dataset; these differ: {keys}. "
        "Use another folder, or the same settings"
    )


def _used(dataset: DatasetConfig) -> DatasetConfig:
    """`dataset` with defaults for what its samples do not depend on: pictures are not rendered."""
    config, unused = dataset.generate, GenerateConfig()
    if not config.images:
        return dataset
    return replace(dataset, generate=replace(config, **{key: getattr(unused, key) for key in RENDERED}))


def _differing(there: dict, here: dict, path: str = "") -> Iterator[str]:
    for key in there | here:
        a, b = there.get(key), here.get(key)
        if isinstance(a, dict) and isinstance(b, dict):
            yield from _differing(a, b, f"{path}{key}.")
        elif a != b:
            yield f"{path}{key} ({a} there, {b} here)"


def _unbroken(out: Path, size: int) -> Iterator[Path]:
    """The shards from the first one on, up to one that is not full or not there.

    More than a smaller count asks for: where a card is, no larger one would settle them any more.
    """
    for path in (shard_path(out, number) for number in itertools.count()):
        if not path.exists():
            return
        yield path
        if count_whole(path) < size:
            return


def _missing(out: Path, dataset: DatasetConfig, count: int) -> Iterator[_Shard]:
    size = dataset.shard_size
    for number, start in enumerate(range(0, count, size)):
        indices = range(start, min(start + size, count))
        path = shard_path(out, number)
        there = count_whole(path) if path.exists() else 0
        if there < len(indices):
            kept = there - there % dataset.generate.pairs_per_frame
            yield _Shard(path, kept, indices[kept:], dataset)
