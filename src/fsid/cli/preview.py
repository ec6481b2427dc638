"""fsid preview: a contact sheet of scenes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from fsid.cli.arguments import Settings, overrides
from fsid.cli.generate import Variant
from fsid.cli.libraries import read_libraries
from fsid.cli.progress import progress_bar


def preview(
    output: Annotated[Positional[Path], arg(metavar="OUTPUT")],
    *,
    count: int = 12,
    seed: int = 0,
    config: Path | None = None,
    set: Settings = (),
    width: int | None = None,
    height: int | None = None,
    variant: Variant | None = None,
    quiet: bool = False,
) -> None:
    """Render scenes 0 .. COUNT-1 of a seed into one picture, without noise: what a dataset would hold.

    Each is rendered twice as wide and high and then reduced, as photographs are looked at.

    Args:
        output: PNG file to write.
        count: Number of scenes.
        seed: Seed of the dataset.
        config: YAML file of settings or the name of a built-in one, as for fsid generate.
        set: Single settings, key=value, of what the picture shows.
        width: Width of one scene in pixels (default 480).
        height: Height of one scene in pixels (default 270).
        variant: What varies between scenes (default full); v1 to v4 of the paper.
        quiet: No progress bar; warnings are printed.
    """
    from fsid.config import given_keys
    from fsid.dataset import (
        check_given,
        check_png,
        check_settings,
        contact_sheet,
        dataset_config,
        generate_config,
        save_png,
    )

    check_png(output)
    given = overrides(set, width=width, height=height, variant=variant)
    settings = generate_config(config, [("width", 480), ("height", 270), *given])
    check_given(settings, given_keys(given), "preview")
    check_settings(settings)
    read_libraries(settings.scene, quiet=quiet)
    dataset_config(settings, seed)
    with progress_bar("scenes", "scenes", quiet=quiet) as progress:
        save_png(output, contact_sheet(settings, seed, count, progress=progress))
