"""fsid generate: clean and noisy RAW pairs from random scenes or photographs."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal

from rich.console import Console
from tyro.conf import Positional

from fsid.cli.progress import progress_bar
from fsid.config import load_settings

Variant = Literal["objects", "materials", "objects-materials", "full"]


def generate(
    out: Positional[Path],
    *,
    count: int,
    seed: int = 0,
    config: Path | None = None,
    set: tuple[str, ...] = (),
    width: int | None = None,
    height: int | None = None,
    variant: Variant | None = None,
    images: Path | None = None,
    workers: int = 1,
    quiet: bool = False,
) -> None:
    """Make clean and noisy RAW pairs. Running the same command again continues it.

    Writes OUT/config.yaml and OUT/shard-00000.tar ... (WebDataset layout); per sample KEY.clean.dng,
    KEY.noisy.dng, KEY.rgb.png (sRGB preview) and KEY.json (scene, camera, ISO, k, sigma2, seeds).

    Args:
        out: Folder of the dataset.
        count: Number of pairs in the finished dataset.
        seed: Seed of the dataset; pair i depends on settings, seed and i alone.
        config: YAML file of settings (see OUT/config.yaml of any dataset for all of them).
        set: Single settings, for example --set iso_range=[800,3200] scene.objects_max=30.
        width: Width of a frame in pixels (default 1920).
        height: Height of a frame in pixels (default 1080).
        variant: What varies between scenes: objects, materials, both, or everything (default full).
        images: Folder of photographs to make the pairs from instead of scenes; frames are random
            windows of at most WIDTH x HEIGHT pixels.
        workers: Number of processes; the result does not depend on it.
        quiet: No progress bar.
    """
    from fsid.dataset import GenerateConfig
    from fsid.dataset import generate as generate_dataset

    given = {"width": width, "height": height, "variant": variant, "images": images and os.fspath(images)}
    overrides = [f"{key}={value}" for key, value in given.items() if value is not None]
    settings = load_settings(GenerateConfig, config, [*set, *overrides])
    with progress_bar("pairs", "pairs", quiet=quiet) as progress:
        made = generate_dataset(out, settings, count=count, seed=seed, workers=workers, progress=progress)
    if not quiet:
        Console(stderr=True).print(f"{out}: {count} pairs, {made} of them new")
