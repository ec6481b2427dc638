"""fsid generate: clean and noisy RAW pairs from random scenes or pictures."""

from __future__ import annotations

import os
import shlex
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from fsid import __version__
from fsid.cli.arguments import Settings, overrides
from fsid.cli.iso_notes import note_extrapolation
from fsid.cli.libraries import read_libraries
from fsid.cli.notes import note, note_unread
from fsid.cli.progress import Bar, progress_bar
from fsid.errors import FsidError
from fsid.plurals import counted
from fsid.terminal import Terminal

if TYPE_CHECKING:
    from fsid.dataset import DatasetConfig, GenerateConfig, Workforce

Variant = Literal["objects", "materials", "objects-materials", "full"]
Task = Literal["denoise", "super-resolution", "deblur", "burst"]
RendererName = Literal["raster", "reference"]
Quality = Literal["high", "fast"]
_QUICKLY_READ = 100
"""Shards that are looked at, or readings of shards, of which each has two, up to which they have no bar."""


def generate(
    out: Annotated[Positional[Path], arg(metavar="OUT")],
    *,
    count: int | None = None,
    seed: int | None = None,
    config: Path | None = None,
    set: Settings = (),
    width: int | None = None,
    height: int | None = None,
    variant: Variant | None = None,
    task: Task | None = None,
    renderer: RendererName | None = None,
    quality: Quality | None = None,
    images: Path | None = None,
    workers: int = 1,
    ray: str = "",
    workers_per_gpu: int = 0,
    only: str = "",
    dry_run: bool = False,
    quiet: bool = False,
) -> None:
    """Make clean and noisy RAW pairs. Running the same command again continues it.

    Writes OUT/config.yaml and OUT/shard-00000.tar ... (WebDataset layout); per sample KEY.clean.dng,
    KEY.noisy.dng, KEY.rgb.png (sRGB preview) and KEY.json (scene, camera, ISO, k, sigma2, seeds, settings).

    Args:
        out: Folder of the dataset.
        count: Number of pairs in the finished dataset.
        seed: Seed of the dataset; pair i depends on settings, seed and i alone (default 0).
        config: YAML file of settings, the config.yaml of another dataset (but for its seed), or the name of a
            built-in one (fsid-175k: the paper's dataset).
        set: Single settings, for example --set iso_range=[800,3200] scene.objects=[20,30] crops=4.
        width: Width of a frame in pixels (default 1920).
        height: Height of a frame in pixels (default 1080).
        variant: What varies between scenes: objects, materials, both, or everything (default full); the paper
            calls them v1 to v4.
        task: What the pairs are for (default denoise). super-resolution: KEY.noisy.dng has half the width and
            height (--set scale=4: a quarter), deblur: camera and objects move while the shutter is open;
            KEY.degraded.dng is KEY.noisy.dng without noise. burst: KEY.noisy1.dng ... are further frames,
            KEY.flow1.npy ... the way from each to KEY.noisy.dng in pixels right and down.
        renderer: raster (OpenGL, default) or reference (a path tracer: slow).
        quality: Of the rasteriser: high (default) or fast.
        images: Folder of photographs, or of linear .exr renders of any engine, to take instead
            of scenes; frames are random windows of at most WIDTH x HEIGHT pixels.
        workers: Number of processes (of the whole cluster with --ray), on a CPU of up to 1.2 GB of memory
            each at 1920x1080; the result does not depend on it.
        ray: Address of a Ray cluster to work on: auto, ray://HOST:10001, or local to start one here.
        workers_per_gpu: How many workers share a GPU: worker w renders on GPU w // N, on a cluster on the one
            that Ray assigns. 0: every worker takes the first there is.
        only: Key of one sample (00000012), or the path of its KEY.json: make that one alone, as loose
            files in OUT, which are no part of the dataset.
        dry_run: Measure a few pairs, print the estimated time, size and number of shards, and write nothing.
        quiet: No progress bar; warnings are printed.
    """
    from fsid.config import given_keys
    from fsid.dataset import (
        Workforce,
        begun_by,
        check_count,
        check_given,
        check_settings,
        dataset_config,
        generate_config,
        is_begun,
        make_only,
        pairs_there,
    )

    given = overrides(
        set,
        width=width,
        height=height,
        variant=variant,
        task=task,
        renderer=renderer,
        quality=quality,
        images=images and os.fspath(images),
    )
    console = Terminal(stderr=True, quiet=quiet)
    if only and dry_run:
        raise FsidError("--dry-run: says what a dataset takes, not one sample; leave out --only")
    if only.endswith(".json") and (config or given or (count, seed) != (None, None)):
        raise FsidError(f"--only {only}: the file says all of it; leave out --count, --seed and settings")
    if only:
        of_many = {"count": count, "workers": workers - 1, "ray": ray, "workers-per-gpu": workers_per_gpu}
        for option, value in of_many.items():
            if value not in (None, 0, ""):
                raise FsidError(f"--{option}: is of a dataset, and --only makes one pair; leave it out")
    settings = generate_config(config, given)
    check_given(settings, given_keys(given))
    if only:
        stated = settings if config or given else None
        for path in make_only(out, only, stated, seed, note=note):
            console.print(str(path), soft_wrap=True, markup=False)
        return
    if count is None:
        raise FsidError("--count: say how many pairs the dataset is to have")
    check_count(count)
    seed = seed or 0
    workforce = Workforce(workers, ray, workers_per_gpu)
    check_settings(settings)  # before a library is read
    note_extrapolation(settings.cameras, *settings.iso_range)
    note_unread((settings.images,), renders=True)
    if not settings.images:
        read_libraries(settings.scene, quiet=quiet)
    dataset = dataset_config(settings, seed)
    there = pairs_there(out, dataset.shard_size) if is_begun(out, dataset) else 0
    begun = begun_by(out) if 0 < there < count else ""
    if begun not in ("", __version__):
        note(f"{out} was begun by fsid {begun:.40}, this is {__version__}: its pairs may be of other scenes")
    if dry_run:
        plan = _plan(out, settings, dataset, count, workforce, quiet=quiet)
        Terminal(markup=False).print(plan, soft_wrap=True)
    else:
        if there < count:
            _check_sources(settings, range(there, count), workforce, quiet=quiet)
        made = _make(out, settings, count, seed, workforce, quiet=quiet)
        console.print(f"{out}: {counted(count, 'pair')}, {made} of them new", soft_wrap=True, markup=False)


def _check_sources(settings: GenerateConfig, pairs: range, workforce: Workforce, *, quiet: bool) -> None:
    """Before anything is written: the pictures of the frames of `pairs`, decoded on as many cores as there
    are workers, or the panoramas and the GPUs of these."""
    from fsid.dataset import check_pictures, find_pictures
    from fsid.render import check_skies, gpu_device

    skies = settings.scene.panoramas
    if skies and not settings.images and not pairs.start:
        with progress_bar(f"checking {skies}", "panoramas", quiet=quiet) as progress:
            check_skies(skies, progress)
    if settings.images:
        per_frame = settings.pairs_per_frame
        frames = slice(pairs.start // per_frame, -(-pairs.stop // per_frame))
        pictures = find_pictures(Path(settings.images))[frames]
        if pictures:
            with progress_bar(f"checking {settings.images}", "pictures", quiet=quiet) as progress:
                check_pictures(pictures, min(workforce.workers, os.cpu_count() or 1), progress)
    elif workforce.workers_per_gpu and not workforce.ray and settings.renderer == "raster":
        gpu_device((workforce.workers - 1) // workforce.workers_per_gpu)


def _make(
    out: Path, settings: GenerateConfig, count: int, seed: int, workforce: Workforce, *, quiet: bool
) -> int:
    """Generate behind a progress bar; how many pairs are new."""
    from fsid.dataset import generate as generate_dataset

    with progress_bar("looking at shards", "shards", quiet=quiet) as looking:
        progress = looking.then("pairs", "pairs")
        reading = progress.then("checking the whole", "shards")

        return generate_dataset(
            out,
            settings,
            count=count,
            seed=seed,
            workforce=workforce,
            progress=progress,
            lost=progress.failed,
            finishing=_of_many(reading),
            looking=_of_many(looking),
            command=shlex.join(["fsid", *sys.argv[1:]]),
        )


def _of_many(bar: Bar) -> Callable[[int, int], None]:
    """Moves `bar` where there are more than `_QUICKLY_READ`."""
    return lambda done, total: bar(done, total) if total > _QUICKLY_READ else None


def _plan(
    out: Path,
    settings: GenerateConfig,
    dataset: DatasetConfig,
    count: int,
    workforce: Workforce,
    *,
    quiet: bool,
) -> str:
    """What a dry run says: time, size and number of shards of what `out` lacks, from a few pairs."""
    from fsid.dataset import estimate, pairs_to_make

    with progress_bar("looking at shards", "shards", quiet=quiet) as looking:
        left, shards = pairs_to_make(out, dataset, count, _of_many(looking))
    if not left:
        return f"{out}: has {counted(count, 'pair')} already; nothing was written."
    costs = estimate(settings, count=left, seed=dataset.seed, workforce=workforce, shards=shards)
    hours, minutes = divmod(round(costs.seconds / 60), 60)
    folder = next(path for path in (out, *out.absolute().parents) if path.exists())
    there = f"; {count - left} more are there" if left < count else ""
    free = shutil.disk_usage(folder).free
    return (
        f"{out}: {counted(costs.pairs, 'pair')} in {counted(costs.shards, 'shard')}{there}\n"
        f"time   {hours} h {minutes:02d} min with {counted(costs.workers, 'worker')} "
        f"({costs.seconds / costs.pairs:.3g} s per pair)\n"
        f"size   {costs.bytes / 1e9:.3g} GB ({costs.bytes / costs.pairs / 1e6:.3g} MB per pair), "
        f"{free / 1e9:.3g} GB are free\n"
        f"An estimate from {counted(costs.measured_pairs, 'pair')} measured here; nothing was written."
    )
