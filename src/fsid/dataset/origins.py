"""What a dataset is made from beside its settings: pictures; meshes, textures and skies; noise profiles.

    digest = hash of names below their folder and sizes in bytes

A dataset goes on only with what it was begun with. The folders may move: scenes know files by their names
below them (`fsid.scene.sources`).
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from fsid.assets import mesh_sources, sky_sources
from fsid.assets.file_names import PREFIX
from fsid.assets.sources import split_source
from fsid.assets.textures import texture_files
from fsid.dataset.config import DatasetConfig, GenerateConfig
from fsid.dataset.pictures import find_pictures, pictures_digest
from fsid.errors import FsidError
from fsid.scene import SceneConfig
from fsid.sensor.profiles import profiles_digest

_DIGESTS = ("pictures_digest", "profiles_digest", "files_digest")
_FOLDERS = ("mesh_folders", "texture_folders", "hdri_folder")


def files_digest(config: GenerateConfig) -> str:
    """16 hexadecimal digits that tell the usable files of the folders of `config.scene` from others; "" where
    scenes take none. FsidError where a folder has none that is usable."""
    facts = () if config.images else tuple(_files(config.scene))
    return hashlib.sha256(b"".join(facts)).hexdigest()[:16] if facts else ""


def _files(scene: SceneConfig) -> Iterator[bytes]:
    for folder in scene.mesh_folders:
        for name in mesh_sources(folder, cc0_only=scene.mesh_folders_cc0_only):
            yield _fact(folder, name, split_source(name)[0])
    for folder in scene.texture_folders:
        for name, files in texture_files(folder).items():
            yield _fact(folder, name, *files)
    if scene.panoramas:
        for name in sky_sources(scene.panoramas):
            yield _fact(scene.panoramas, name, Path(name.removeprefix(PREFIX)))


def _fact(folder: str, name: str, *files: Path) -> bytes:
    sizes = sum(file.stat().st_size for file in files if file.exists())
    return b"%s\0%d\0" % (os.fsencode(os.path.relpath(name.removeprefix(PREFIX), folder)), sizes)


def source_folders(scene: SceneConfig) -> tuple[str, ...]:
    """The folders of meshes, textures and skies."""
    return tuple(filter(None, (*scene.mesh_folders, *scene.texture_folders, scene.hdri_folder)))


def as_far_as_known(there: DatasetConfig, here: DatasetConfig) -> DatasetConfig:
    """`here` without the digests that `there` lacks: what FSID wrote before they were recorded."""
    unknown: dict[str, Any] = {key: "" for key in _DIGESTS if not getattr(there, key)}
    return replace(here, **unknown)


def in_places_of(there: DatasetConfig, here: DatasetConfig) -> DatasetConfig:
    """`here` with the folders of `there` where they hold the same: folders may move."""
    config = here.generate
    if there.pictures_digest and there.pictures_digest == here.pictures_digest:
        config = replace(config, images=there.generate.images)
    if there.files_digest and there.files_digest == here.files_digest:
        folders = {key: getattr(there.generate.scene, key) for key in _FOLDERS}
        config = replace(config, scene=replace(config.scene, **folders))
    return replace(here, generate=config)


def check_same_origins(out: Path, dataset: DatasetConfig) -> None:
    """FsidError unless the pictures, files and profiles of `dataset`, in `out`, are those that it was begun
    with, if known."""
    _check_pictures(out, dataset)
    _check_profiles(out, dataset)
    if dataset.files_digest not in ("", files_digest(dataset.generate)):
        raise FsidError(
            f"{out}: was begun with other files than {', '.join(source_folders(dataset.generate.scene))} can "
            "give now (names or sizes differ); put those back, or use another folder"
        )


@lru_cache(maxsize=1)  # each shard asks, and the sizes of 10,000 files take longer than a small frame
def check_same_pictures(out: Path, dataset: DatasetConfig, stamped: tuple[int, ...]) -> None:
    """FsidError unless the pictures of `dataset` are those that it was begun with. stamped: their folder's
    `stamp`; while it stays, they count as the same."""
    _check_pictures(out, dataset)


def _check_pictures(out: Path, dataset: DatasetConfig) -> None:
    if not dataset.generate.images:
        return
    pictures = find_pictures(Path(dataset.generate.images))
    digest = dataset.pictures_digest and pictures_digest(pictures)
    if (len(pictures), digest) != (dataset.pictures, dataset.pictures_digest):
        raise FsidError(
            f"{dataset.generate.images}: holds other pictures than those that {out} was begun with (names or "
            f"sizes differ; {dataset.pictures} then, {len(pictures)} now); "
            "put those back, or use another folder"
        )


def _check_profiles(out: Path, dataset: DatasetConfig) -> None:
    cameras = dataset.generate.cameras
    if dataset.profiles_digest not in ("", profiles_digest(cameras)):
        raise FsidError(
            f"{out}: was begun with another noise than {', '.join(cameras)} says now; "
            "put the file back as it was, or use another folder"
        )
