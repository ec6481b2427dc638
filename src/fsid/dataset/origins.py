"""What a dataset is made from beside its settings: pictures; meshes, textures and skies; noise profiles.

    digest = hash of names below their folder and sizes in bytes

A dataset goes on only with what it was begun with. The folders may move: scenes know files by their names
below them (`fsid.scene.sources`).
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

from fsid.assets import mesh_sources, sky_sources
from fsid.assets.sources import PREFIX, split_source
from fsid.assets.textures import texture_files
from fsid.dataset.config import DatasetConfig, GenerateConfig
from fsid.dataset.pictures import find_pictures, pictures_digest
from fsid.errors import FsidError
from fsid.scene import SceneConfig
from fsid.sensor.profiles import profiles_digest


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
    if scene.hdri_folder and scene.background.kind_shares[-1]:  # else there is no sky
        for name in sky_sources(scene.hdri_folder):
            yield _fact(scene.hdri_folder, name, Path(name.removeprefix(PREFIX)))


def _fact(folder: str, name: str, *files: Path) -> bytes:
    sizes = sum(file.stat().st_size for file in files if file.exists())
    return b"%s\0%d\0" % (os.fsencode(os.path.relpath(name.removeprefix(PREFIX), folder)), sizes)


def check_same_files(out: Path, dataset: DatasetConfig, digest: str) -> None:
    """FsidError unless the files of the folders of `dataset`, in `out`, are those that it was begun with, if
    known. digest: of those that are there now."""
    if dataset.files_digest in ("", digest):
        return
    scene = dataset.generate.scene
    folders = ", ".join(filter(None, (*scene.mesh_folders, *scene.texture_folders, scene.hdri_folder)))
    raise FsidError(
        f"{out}: was begun with other files than {folders} can give now (names or sizes differ); "
        "put those back, or use another folder"
    )


def check_same_pictures(out: Path, dataset: DatasetConfig) -> None:
    """FsidError unless the pictures of `dataset`, in `out`, are those that it was begun with, if known."""
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


def check_same_profiles(out: Path, dataset: DatasetConfig) -> None:
    """FsidError unless the profiles of `dataset`, in `out`, say the noise that it began with, if known."""
    cameras = dataset.generate.cameras
    if dataset.profiles_digest not in ("", profiles_digest(cameras)):
        raise FsidError(
            f"{out}: was begun with another noise than {', '.join(cameras)} says now; "
            "put the file back as it was, or use another folder"
        )
