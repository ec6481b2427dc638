"""Test sets: truths and their noisy captures, per image and light level, as DNG files.

    DIR/testset.json                      camera, levels and the list of images
    DIR/<image>/clean.dng                 the truth
    DIR/<image>/<level>.clean.dng         in its place where the truth differs from level to level
    DIR/<image>/<level>.noisy.dng         what the camera saw, for example iso3200.noisy.dng
    DIR/<image>/<level>.noisy.01.dng ...  further frames of the same burst

A level is a name such as "iso3200"; the noise level of each capture is in its DNG `NoiseProfile`, ISO and
exposure time in its EXIF tags.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from fsid.config import from_plain, to_plain
from fsid.dataset import check_pictures, find_photos, read_photo
from fsid.dataset.pictures import pictures_digest
from fsid.errors import FsidError, whole
from fsid.files import held, paths_of, write_atomically
from fsid.sensor import (
    CameraProfile,
    Raw,
    clean_from_photo,
    clean_levels,
    light_level,
    load_bayer_profile,
    noisy_from_clean,
    write_dng,
)
from fsid.sensor.light import LONGEST_EXPOSURE_S
from fsid.sensor.metadata import exposure_metadata
from fsid.sensor.profiles import profiles_digest
from fsid.yaml_json import read_json

Progress = Callable[[int, int], None]
T = TypeVar("T")

TESTSET_FILE = "testset.json"
_STEM = 60
"""Letters of a photograph's name in that of its folder: a file system takes 255 bytes."""
_MOST_FRAMES = 10_000
_CHECKED_AT_ONCE = 8
"""Photographs, each of which takes some hundred megabytes."""
ALL_SETS = "all"
"""The name in results of all sets together."""


@dataclass(frozen=True)
class TestImage:
    """One truth. `set` names where it is from; `name` is its folder inside the test set."""

    __test__ = False

    name: str
    set: str


@dataclass(frozen=True)
class TestSet:
    """The content of testset.json. frames: noisy captures per image and level.

    pictures_digest: of names and sizes of the photographs; "" where there are none. profiles_digest: of the
    camera (`fsid.sensor.profiles`). Both are "" in what FSID wrote before they were recorded.
    """

    __test__ = False

    camera: str
    levels: tuple[str, ...]
    images: tuple[TestImage, ...]
    seed: int
    notes: str
    frames: int = 1
    pictures_digest: str = ""
    profiles_digest: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "seed", whole(self.seed, "seed"))
        if self.seed < 0:
            raise FsidError(f"seed {self.seed}: must not be negative")
        if not 1 <= self.frames <= _MOST_FRAMES:
            raise FsidError(f"frames {self.frames}: must be 1 to {_MOST_FRAMES}")
        for key, names in (("levels", self.levels), ("images", [image.name for image in self.images])):
            if not names or len(set(names)) < len(names):
                raise FsidError(f"{key}: there must be at least one, each given once")
        sets = {image.set for image in self.images}
        if len(sets) > 1 and ALL_SETS in sets:
            raise FsidError(f"{ALL_SETS}: means all sets together, so no single one; rename its folder")

    def clean(self, root: str | Path, image: TestImage, level: str = "") -> Path:
        """Path of the truth of `image` (at `level`)."""
        root = Path(root)
        own = root / image.name / f"{level}.clean.dng"
        return own if own.exists() else root / image.name / "clean.dng"

    def noisy(self, root: str | Path, image: TestImage, level: str, frame: int = 0) -> Path:
        """Path of a capture of `image` at `level`."""
        suffix = f".{frame:02d}" if frame else ""
        return Path(root) / image.name / f"{level}.noisy{suffix}.dng"

    def captures(self, root: str | Path) -> Iterator[Path]:
        """Paths of all captures."""
        for image, level, frame in product(self.images, self.levels, range(self.frames)):
            yield self.noisy(root, image, level, frame)


def read_testset(root: str | Path) -> TestSet:
    """The description of the test set in `root`; FsidError where it is missing or broken."""
    root = Path(root)
    file = root / TESTSET_FILE
    if not file.exists():
        raise FsidError(f"{file}: is missing; fsid testset makes one")
    testset = from_plain(TestSet, read_json(file), source=str(file))
    names = [*testset.levels, *(image.name for image in testset.images)]
    for name in names:
        if name in ("", "..") or name != Path(name).name:
            raise FsidError(f"{file}: {name!r} is not a plain file name")
    for image, level, frame in product(testset.images, testset.levels, range(testset.frames)):
        for capture in (testset.clean(root, image, level), testset.noisy(root, image, level, frame)):
            if not capture.is_file():
                raise FsidError(f"{capture}: is missing; {file.name} names it")
    return testset


def photo_testset(
    folders: str | Path | Iterable[str | Path],
    out: str | Path,
    *,
    camera: str | Path,
    isos: Iterable[float],
    luxes: Iterable[float] = (),
    seed: int = 0,
    progress: Progress = lambda done, total: None,
) -> TestSet:
    """Push photographs through a named camera: unprocess, mosaic, and one capture per ISO and light level.

    luxes: light levels; the camera's auto-exposure (`sensor.light`) makes them ISOs, beyond its highest too,
    where a phone brightens digitally.

    The set of an image is the name of its folder. Photograph i draws from SeedSequence(seed, spawn_key=(i,)).
    FsidError for a camera, levels or folders that cannot be used, an `out` that is not empty, and for all
    photographs that cannot be read or show nothing, before the first of them takes its time.
    """
    profile = load_bayer_profile(camera)
    levels = levels_of(profile, isos, luxes)
    sources = paths_of(folders)
    names = [folder.resolve().name for folder in sources]
    if twice := [name for name in names if names.count(name) > 1]:
        raise FsidError(f"{twice[0]}: two folders have this name, and it is that of a set; rename one")
    photos = [
        (name, path) for name, folder in zip(names, sources, strict=True) for path in find_photos(folder)
    ]
    paths = [path for _, path in photos]
    testset = TestSet(
        camera=profile.name,
        levels=tuple(levels),
        images=tuple(
            TestImage(f"{i:04d}-{as_text(path.stem)[:_STEM]}", as_text(name))
            for i, (name, path) in enumerate(photos)
        ),
        seed=seed,
        notes="photographs unprocessed to RAW (Brooks et al. 2019), noise from the camera's profile",
        pictures_digest=pictures_digest(paths),
        profiles_digest=profiles_digest([camera]),
    )

    def truth(rng: np.random.Generator, i: int) -> Raw:
        return clean_from_photo(rng, read_photo(paths[i]), profile)

    def check() -> None:
        check_pictures(paths, min(os.cpu_count() or 1, _CHECKED_AT_ONCE))

    capture(testset, Path(out), profile, levels, truth, progress, check)
    return testset


def as_text(name: str) -> str:
    """A file's name in Unicode: what is no text in it is replaced."""
    return os.fsencode(name).decode(errors="replace")


class Setting(NamedTuple):
    """What the camera is set to at a level; the exposure time matters for dark current only.

    Where an ISO is given, it is the longest: auto-exposure takes that before it raises the ISO.
    """

    iso: float
    exposure_s: float


def listed(values: Iterable[T], name: str) -> tuple[T, ...]:
    """FsidError, naming them, for one value, or a text: for Python a list of letters."""
    if isinstance(values, str) or not isinstance(values, Iterable):
        raise FsidError(f"{name}: {values!r} is not a list; give [{values!r}]")
    return tuple(values)


def levels_of(profile: CameraProfile, isos: Iterable[float], luxes: Iterable[float]) -> dict[str, Setting]:
    """The camera's setting at every level by name; FsidError where there is none, or one that cannot be."""
    isos, luxes = listed(isos, "isos"), listed(luxes, "luxes")
    if not (isos or luxes) or not all(0 < level < np.inf for level in (*isos, *luxes)):
        raise FsidError("--iso: at least one positive ISO (or --lux) is needed, and no infinite one")
    levels = {
        f"iso{int(iso) if iso == int(iso) else iso}": Setting(float(iso), LONGEST_EXPOSURE_S) for iso in isos
    }
    for lux in luxes:
        light = light_level(profile, lux, highest_iso=np.inf)
        levels[f"{lux:g}lux"] = Setting(light.iso, light.exposure_s)
    for name, setting in levels.items():
        try:
            profile.level(setting.iso)
        except FsidError as error:
            raise FsidError(f"{name}: {error}") from None
    return levels


def capture(
    testset: TestSet,
    out: Path,
    profile: CameraProfile,
    levels: dict[str, Setting],
    truth: Callable[[np.random.Generator, int], Raw],
    progress: Progress,
    check: Callable[[], None] = lambda: None,
) -> None:
    """Write a test set: truth(rng, i) of image i, and `testset.frames` captures of it at every level.

    Image i draws from SeedSequence(testset.seed, spawn_key=(i,)). check: comes first, once `out` is free.
    """
    with staged(out) as root:
        check()
        for i, image in enumerate(testset.images):
            rng = np.random.default_rng(np.random.SeedSequence(testset.seed, spawn_key=(i,)))
            clean = truth(rng, i)
            (root / image.name).mkdir()
            write_dng(root / image.name / "clean.dng", clean_levels(clean))
            for level, (iso, exposure_s) in levels.items():
                noise = profile.level(iso)
                for frame in range(testset.frames):
                    noisy = noisy_from_clean(rng, clean, iso, noise, profile.terms, exposure_s=exposure_s)
                    said = replace(noisy, metadata=exposure_metadata(exposure_s))
                    write_dng(testset.noisy(root, image, level, frame), said)
            progress(i + 1, len(testset.images))
        write_testset(root, testset)


def write_testset(root: Path, testset: TestSet) -> None:
    """Write testset.json."""
    write_atomically(root / TESTSET_FILE, (json.dumps(to_plain(testset), indent=1) + "\n").encode())


@contextmanager
def staged(out: Path) -> Iterator[Path]:
    """A hidden folder inside `out`; what is written there becomes the content of `out` at the end.

    Nothing is left where something fails. FsidError where `out` is not empty, or another process fills it.
    """
    if not out.name:
        raise FsidError(f"{out}: name a new folder")
    root, is_new = out.resolve(), not out.exists()
    with held(root, "another fsid testset is filling it") as alone:
        part = root / ".testset.part"
        left = _left_by_a_killed_run(part) if alone else [part]
        if any(path not in left for path in root.iterdir()):
            raise FsidError(f"{out}: exists already and is not empty; use another folder")
        for path in left if alone else ():
            shutil.rmtree(path, ignore_errors=True)
        _make(part)
        try:
            yield part
            for path in sorted(part.iterdir(), key=lambda path: path.name == TESTSET_FILE):
                path.rename(root / path.name)
        except OSError as error:
            raise FsidError(f"{out}: cannot be written ({error.strerror})") from None
        finally:
            shutil.rmtree(part, ignore_errors=True)
            if is_new:
                with suppress(OSError):  # it holds the test set
                    root.rmdir()


def _left_by_a_killed_run(part: Path) -> list[Path]:
    """`part`, and beside it the images that were moved out while testset.json, the last, was still in it."""
    try:
        plain = read_json(part / TESTSET_FILE)
        names = {image.name for image in from_plain(TestSet, plain, source=str(part)).images}
    except FsidError:
        names = set()
    return [path for path in part.parent.iterdir() if path == part or path.name in names]


def _make(folder: Path) -> None:
    try:
        folder.mkdir()
    except OSError as error:
        raise FsidError(f"{folder}: cannot be made ({error.strerror})") from None
