"""fsid experiment: the paper's ablation, and synthetic against real."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

from tyro.conf import Positional

from fsid.cli.arguments import Output, Settings
from fsid.cli.notes import note, note_unread
from fsid.cli.progress import progress_bar
from fsid.terminal import Terminal


def experiment(
    kind: Positional[Literal["ablation", "real-vs-synthetic"]],
    *,
    output: Output,
    scale: Literal["smoke", "cpu", "paper"] = "cpu",
    photos: Path | None = None,
    test: tuple[Path, ...] = (),
    count: int | None = None,
    steps: int | None = None,
    network: str | None = None,
    seeds: tuple[int, ...] = (),
    width: int | None = None,
    height: int | None = None,
    camera: str = "pixel6",
    set: Settings = (),
    workers: int = 1,
    quiet: bool = False,
) -> None:
    """Train the same network on rival data, and measure all on the same test sets.

    ablation: the scene variants objects, materials, objects-materials and full (the paper's Table 1).
    real-vs-synthetic: photographs, scenes, and dead leaves (Table 2). Measured on the ten simulated materials
    at 0.5 to 5 lux, and on photographs (--test) at ISO 800 to 6400. Writes results.json, images.csv and
    report.html. The same command goes on with an experiment that was stopped.

    Args:
        kind: Which experiment.
        output: Folder of the experiment.
        scale: Defaults of count, steps, network and size: smoke takes minutes, cpu hours on two cores, paper
            is 175,000 pairs of 1920x1080 pixels.
        photos: Folder of photographs to train the real rival on (real-vs-synthetic only).
        test: Folders of photographs to measure on; none of them may be trained on.
        count: Pairs per source of data.
        steps: Training steps; 0 takes the number that the network's configuration has.
        network: Training configuration, built-in name or file.
        seeds: One training per source and seed.
        width: Width of a training frame in pixels; photographs are cut to no less than 1024.
        height: Height of a training frame in pixels; photographs likewise.
        camera: Noise profile of all data, trainings (to the highest ISO that is tested) and tests.
        set: Settings of the scenes, key=value, as for fsid generate; what all sources share are options.
        workers: Processes that render.
        quiet: No progress bar; warnings are printed.
    """
    from fsid.errors import FsidError
    from fsid.evaluate.experiment_config import scale_config
    from fsid.evaluate.experiments import experiment as run_experiment

    if kind == "ablation" and photos is not None:
        raise FsidError("--photos: only real-vs-synthetic trains on photographs")
    for folder in (*test, *([photos] if photos else [])):
        if not folder.is_dir():
            raise FsidError(f"{folder}: is not a folder of photographs")
    if photos is not None and any(folder.resolve() == photos.resolve() for folder in test):
        raise FsidError(f"--test {photos}: is what the real rival is trained on; test on other photographs")
    given: dict[str, Any] = {
        "count": count,
        "steps": steps,
        "network": network,
        "width": width,
        "height": height,
    }
    given |= {"seeds": seeds or None, "camera": camera, "settings": set or None}
    given |= {"photos": str(photos.resolve()) if photos else ("" if kind == "real-vs-synthetic" else None)}
    given |= {"tests": tuple(str(folder.resolve()) for folder in test)}
    config = replace(scale_config(kind, scale), **{k: v for k, v in given.items() if v is not None})
    note_unread(test)
    note_unread((photos,), renders=True)
    report = run_experiment(output, config, partial(progress_bar, quiet=quiet), workers=workers, note=note)
    rows = json.loads((output / "results.json").read_text(encoding="utf-8"))
    console = Terminal(stderr=True, quiet=quiet, markup=False)
    console.print(f"{report}: {len(rows)} rows", soft_wrap=True)
