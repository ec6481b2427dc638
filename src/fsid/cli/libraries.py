"""The user's own files are read before anything is made of them: it takes minutes, once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from fsid.cli.progress import progress_bar
from fsid.plurals import counted
from fsid.terminal import Terminal

if TYPE_CHECKING:
    from fsid.scene import SceneConfig


def read_libraries(config: SceneConfig, *, quiet: bool) -> None:
    """Fill the cache with every mesh of `config.mesh_folders` and every set of `config.texture_folders`, look
    at the panoramas; say how many were skipped, and why the first.

    Raises FsidError for a folder without a usable one.
    """
    from fsid.assets import survey_meshes, survey_skies, survey_textures

    for folder in config.mesh_folders:
        with progress_bar(f"reading {folder}", "meshes", quiet=quiet) as progress:
            meshes = survey_meshes(folder, config.mesh_folders_cc0_only, progress)
        _tell(f"{folder}: {counted(len(meshes.usable), 'mesh')}", meshes.skipped)
    for folder in config.texture_folders:
        with progress_bar(f"reading {folder}", "texture sets", quiet=quiet) as progress:
            sets = survey_textures(folder, progress)
        _tell(f"{folder}: {counted(len(sets.usable), 'texture set')}", sets.skipped)
    if config.panoramas:
        skies = survey_skies(config.panoramas)
        _tell(f"{config.panoramas}: {counted(len(skies.usable), 'panorama')}", skies.skipped)


def _tell(found: str, skipped: Sequence[tuple[str, str]]) -> None:
    """Nothing where nothing was skipped."""
    from fsid.assets.file_names import PREFIX

    if skipped:
        name, reason = skipped[0]
        Terminal(stderr=True).print(
            f"{found}, {len(skipped)} skipped, first {name.removeprefix(PREFIX)}: {reason}",
            style="yellow",
            soft_wrap=True,
            markup=False,
        )
