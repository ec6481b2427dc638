"""The user's own meshes are read before anything is made of them: it takes minutes, and once per library."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.console import Console

from fsid.cli.progress import progress_bar

if TYPE_CHECKING:
    from fsid.scene import SceneConfig


def read_mesh_folders(config: SceneConfig, *, quiet: bool) -> None:
    """Fill the cache with every mesh of `config.mesh_folders`; say how many were skipped, and why the first.

    Raises FsidError for a folder without a usable mesh.
    """
    from fsid.assets.sources import PREFIX, survey_meshes

    console = Console(stderr=True, quiet=quiet)
    for folder in config.mesh_folders:
        with progress_bar(f"reading {folder}", "meshes", quiet=quiet) as progress:
            survey = survey_meshes(folder, config.mesh_folders_cc0_only, progress)
        if survey.skipped:
            name, reason = survey.skipped[0]
            usable, skipped = len(survey.usable), len(survey.skipped)
            console.print(
                f"{folder}: {usable} meshes, {skipped} skipped, first {name.removeprefix(PREFIX)}: {reason}",
                style="yellow",
                soft_wrap=True,
                markup=False,
            )
