"""Test sets: a truth and its noisy captures, per image and light level, as DNG files.

    DIR/testset.json                      camera, levels and the list of images
    DIR/<image>/clean.dng                 the truth
    DIR/<image>/<level>.noisy.dng         what the camera saw, for example iso3200.noisy.dng

A level is a name such as "iso3200"; the noise level of each capture is in its DNG `NoiseProfile`.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fsid.config import from_plain, to_plain
from fsid.dataset import find_photos, read_photo
from fsid.errors import FsidError
from fsid.sensor import (
    clean_from_photo,
    clean_levels,
    light_level,
    load_profile,
    noisy_from_clean,
    write_dng,
)


@dataclass(frozen=True)
class TestImage:
    """One truth. `set` names where it is from; `name` is its folder inside the test set."""

    __test__ = False

    name: str
    set: str


@dataclass(frozen=True)
class TestSet:
    """The content of testset.json. iso: per level, in the order of `levels`."""

    __test__ = False

    camera: str
    levels: tuple[str, ...]
    images: tuple[TestImage, ...]
    seed: int
    notes: str

    def clean(self, root: Path, image: TestImage) -> Path:
        """Path of the truth of `image`."""
        return root / image.name / "clean.dng"

    def noisy(self, root: Path, image: TestImage, level: str) -> Path:
        """Path of the capture of `image` at `level`."""
        return root / image.name / f"{level}.noisy.dng"


def read_testset(root: Path) -> TestSet:
    """The description of the test set in `root`; FsidError where it is missing or broken."""
    file = root / "testset.json"
    try:
        plain = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise FsidError(f"{file}: cannot be read ({error.strerror}); fsid testset makes one") from None
    except ValueError as error:
        raise FsidError(f"{file}: is not valid JSON ({error})") from None
    testset = from_plain(TestSet, plain, source=str(file))
    names = [*testset.levels, *(image.name for image in testset.images)]
    for name in names:
        if not name or name != Path(name).name:
            raise FsidError(f"{file}: {name!r} is not a plain file name")
    return testset


def photo_testset(
    folders: Sequence[Path],
    out: Path,
    *,
    camera: str,
    isos: Sequence[int],
    luxes: Sequence[float] = (),
    seed: int = 0,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> TestSet:
    """Push photographs through a named camera: unprocess, mosaic, and one capture per ISO and light level.

    luxes: light levels; the camera's auto-exposure (`sensor.light`) makes them ISOs, beyond its highest too,
    where a phone brightens digitally.

    The set of an image is the name of its folder. Photograph i draws from SeedSequence(seed, spawn_key=(i,)).
    """
    profile = load_profile(camera)
    if not (isos or luxes) or min((*isos, *luxes)) <= 0:
        raise FsidError("--iso: at least one positive ISO (or --lux) is needed")
    levels = {f"iso{iso}": float(iso) for iso in isos}
    levels |= {f"{lux:g}lux": light_level(profile, lux, highest_iso=np.inf).iso for lux in luxes}
    photos = [(folder.name, path) for folder in folders for path in find_photos(folder)]
    images = tuple(TestImage(f"{i:04d}-{path.stem}", name) for i, (name, path) in enumerate(photos))
    testset = TestSet(
        camera=profile.name,
        levels=tuple(levels),
        images=images,
        seed=seed,
        notes="photographs unprocessed to RAW (Brooks et al. 2019), noise from the camera's profile",
    )
    with _staged(out) as root:
        for i, (image, (_, path)) in enumerate(zip(images, photos, strict=True)):
            rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(i,)))
            clean = clean_from_photo(rng, read_photo(path), profile)
            (root / image.name).mkdir()
            write_dng(testset.clean(root, image), clean_levels(clean))
            for level, iso in levels.items():
                noisy = noisy_from_clean(rng, clean, iso, profile.level(iso), profile.terms)
                write_dng(testset.noisy(root, image, level), noisy)
            progress(i + 1, len(photos))
        (root / "testset.json").write_text(json.dumps(to_plain(testset), indent=1) + "\n", encoding="utf-8")
    return testset


@contextmanager
def _staged(out: Path) -> Iterator[Path]:
    """A folder beside `out` that becomes `out` when all is written, and vanishes where something fails."""
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise FsidError(f"{out}: exists already and is not empty; use another folder")
    part = out.with_name(f".{out.name}.part")
    try:
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        yield part
        part.replace(out)
    except OSError as error:
        raise FsidError(f"{out}: cannot be written ({error.strerror})") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)
