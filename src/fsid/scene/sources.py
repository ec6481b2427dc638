"""Where S, M and the sky come from: the families of FSID, and the folders that the user names.

Files are told apart by their path inside their folder, so a folder may move, and may be named in any way
("skies", "./skies/"), without changing a scene.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np

from fsid.assets import material_families, mesh_families, mesh_sources, sky_sources, texture_sources
from fsid.assets.file_names import PREFIX
from fsid.scene.choice import pick_rand
from fsid.scene.config import SceneConfig

Names = tuple[str, ...]


def mesh_rand(rng: np.random.Generator, config: SceneConfig) -> str:
    """A name for `Object.family`."""
    families = config.mesh_families or mesh_families()
    find = _free_meshes if config.mesh_folders_cc0_only else mesh_sources
    return _rand(rng, families, config.mesh_folders, config.mesh_folder_share, find)


def texture_rand(rng: np.random.Generator, config: SceneConfig) -> str:
    """A name for `Material.family`."""
    families = config.material_families or material_families()
    return _rand(rng, families, config.texture_folders, config.texture_folder_share, texture_sources)


def sky_rand(rng: np.random.Generator, config: SceneConfig) -> str:
    """A name for `Sky.source`."""
    folders = (config.hdri_folder,) if config.hdri_folder else ()
    return _rand(rng, ("procedural",), folders, config.hdri_share, sky_sources)


def _rand(
    rng: np.random.Generator, families: Names, folders: Names, share: float, find: Callable[[str], Names]
) -> str:
    """A family, or a file in `share` of the draws if there are folders; the family is drawn in any case."""
    family, from_file = pick_rand(rng, families), rng.random() < share
    if not folders:
        return family
    names, labels = _catalogue(folders, find)
    chosen = names[labels.index(pick_rand(rng, labels))]
    return chosen if from_file else family


@lru_cache(maxsize=16)
def _catalogue(folders: Names, find: Callable[[str], Names]) -> tuple[Names, Names]:
    """The names of all files, and what they are called within their folder; no two are called alike."""
    names: list[str] = []
    labels: dict[str, None] = {}
    for folder in folders:
        for name in find(folder):
            label = _label(name, folder)
            while label in labels:
                label += "'"
            labels[label] = None
            names.append(name)
    return tuple(names), tuple(labels)


def _label(name: str, folder: str) -> str:
    """The path inside the folder, with the separator in front."""
    path, place = name.removeprefix(PREFIX), str(Path(folder))
    return f"/{path}" if place == "." else path.removeprefix(place)


def _free_meshes(folder: str) -> Names:
    return mesh_sources(folder, cc0_only=True)
