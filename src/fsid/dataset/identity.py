"""What a dataset is made from: settings, seed; pictures; meshes, textures and skies; noise profiles.

    digest = hash of names below their folder and sizes in bytes

A dataset goes on only with what it was begun with. The folders may move: scenes know files by their names
below them (`fsid.scene.sources`).
"""

from __future__ import annotations

import hashlib
import importlib
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
from fsid.config import from_plain, to_plain
from fsid.dataset.config import DATASET_FILE, RENDERED, DatasetConfig, GenerateConfig
from fsid.dataset.pictures import find_pictures, pictures_digest
from fsid.dataset.shards import read_heads
from fsid.dataset.tasks import check_cameras, check_task
from fsid.errors import FsidError, check_kind
from fsid.scene import SceneConfig
from fsid.sensor import CameraProfile, load_bayer_profile
from fsid.sensor.profiles import profiles_digest
from fsid.yaml_json import read_yaml

_SHARD_SIZE = 16  # samples, at least
_DIGESTS = ("pictures_digest", "profiles_digest", "files_digest")
_FOLDERS = ("mesh_folders", "texture_folders", "hdri_folder")


def dataset_config(config: GenerateConfig, seed: int, shard_size: int = 0) -> DatasetConfig:
    """The identity of the dataset of (config, seed); FsidError where what it names does not exist.

    Surveys the folders of meshes, textures and skies, which takes minutes the first time.
    """
    check_settings(config)
    pairs = config.pairs_per_frame
    shard_size = shard_size or -(-_SHARD_SIZE // pairs) * pairs
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
    """FsidError where what `config` names does not exist, or its parts do not agree; reads no large file.

    ModuleNotFoundError where it takes a renderer that is not installed: from a worker it would be a bug.
    """
    check_kind(config, GenerateConfig, "generate_config makes one of a file, a name or settings")
    if config.renderer == "reference" and not config.images:
        importlib.import_module("mitsuba")
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


def is_begun(out: str | Path, dataset: DatasetConfig) -> bool:
    """Whether the config.yaml of `out` is that of `dataset`; FsidError where `out` has samples of another.

    Without samples there is no other, whatever a run that failed before its first shard left there.
    """
    out = Path(out)
    file = out / DATASET_FILE
    if not file.exists():
        return False
    there = _used(from_plain(DatasetConfig, read_yaml(file), source=str(file)))
    here = _in_places_of(there, _as_far_as_known(there, _used(dataset)))
    if there == here or not (any(out.glob("shard-*.tar")) or any(out.glob("*.clean.dng"))):
        return there == here
    if there.generate == here.generate and there.seed == here.seed:
        check_same_origins(out, there)
    keys = ", ".join(_differing(to_plain(there), to_plain(here)))
    raise FsidError(
        f"{out}: already holds another dataset; these differ: {keys}. "
        "Use another folder, or the same settings"
    )


def begun_by(out: str | Path) -> str:
    """The version of FSID that the first pair in `out` states; "" where there is none."""
    shards = sorted(Path(out).glob("shard-*.tar"))
    _, head = next(read_heads(shards[0]), ("", {})) if shards else ("", {})
    return str(head.get("fsid_version", ""))


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


def _as_far_as_known(there: DatasetConfig, here: DatasetConfig) -> DatasetConfig:
    """`here` without the digests that `there` lacks: what FSID wrote before they were recorded."""
    unknown: dict[str, Any] = {key: "" for key in _DIGESTS if not getattr(there, key)}
    return replace(here, **unknown)


def _in_places_of(there: DatasetConfig, here: DatasetConfig) -> DatasetConfig:
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
