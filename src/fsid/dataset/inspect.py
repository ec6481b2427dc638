"""Pictures in, statistics out: a dataset of this package, or any folder of photographs, seen alike.

    photo -> clean mosaic of PHOTO_CAMERA, as in training
    clean mosaic -> R, (Gr + Gb) / 2, B at half resolution -> white balance, CCM -> sRGB curve

Nothing is interpolated. Photographs take the way through a camera, too, because it leaves traces: colours are
sampled beside each other and then mixed by a matrix, which turns fine detail into colour. Compared with
photographs as they are, any RAW has too much colour in its texture. See `statistics` for what is measured.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from fsid.dataset.index import StoredMosaic, some_mosaics
from fsid.dataset.photos import find_photos, read_photo
from fsid.dataset.shards import read_member, read_record
from fsid.dataset.statistics import Comparison, compare, measure, pool
from fsid.errors import FsidError
from fsid.evenly_spaced import spaced
from fsid.sensor import camera_to_srgb_matrix, clean_from_photo, load_profile, pack, srgb_encode
from fsid.sensor.colour import is_of_camera

MAX_PICTURES = 400
"""Of a larger set, this many pictures are measured, evenly spaced."""
LEAST_PICTURES = 50
"""Sets of fewer differ by chance about as much as sets of other pictures do."""
PHOTO_CAMERA = "pixel6"

Progress = Callable[[int, int], None]
Measured = dict[str, np.ndarray]
"""Statistics by name, of a picture or pooled."""
Reader = tuple[Sequence, Callable[..., np.ndarray]]
"""What is to be read, and the function that reads one of it."""


@dataclass(frozen=True, eq=False)
class Inspection:
    """The statistics of a set, of its reference, and their distances. `reference` is None without one.

    yardstick: in words, what distances are relative to.
    """

    data: str
    pictures: int
    values: dict[str, np.ndarray]
    reference: dict[str, np.ndarray] | None = None
    reference_name: str = ""
    comparisons: tuple[Comparison, ...] = ()
    yardstick: str = ""


def inspect(
    data: Path,
    reference: Path | None = None,
    other: Path | None = None,
    *,
    limit: int = MAX_PICTURES,
    progress: Progress = lambda done, total: None,
) -> Inspection:
    """Measure `data`, and compare it with `reference`, both a dataset or a folder of photographs.

    other: a second real set, whose distance to the reference is the yardstick; without it the two halves of
    the reference (every second picture) take its place, where it has `LEAST_PICTURES` or more. These differ
    by chance alone, the less the more pictures there are. Raises FsidError, also for a reference of one.
    """
    if limit < 1:
        raise FsidError(f"--limit {limit}: measure at least one picture")
    readers = [_reader(folder, limit) for folder in (data, reference, other) if folder is not None]
    if reference is not None and len(readers[1][0]) < 2:
        raise FsidError(f"{reference}: one picture has no spread to measure distances in; take more of them")
    measured = _measured(readers, progress)
    values = pool(measured[0])
    if reference is None:
        return Inspection(str(data), len(measured[0]), values)
    rival = None if other is None else (str(other), measured[2])
    comparisons, yardstick = _compared(values, (str(reference), measured[1]), rival)
    real = pool(measured[1])
    return Inspection(
        str(data), len(measured[0]), values, real, str(reference), tuple(comparisons), yardstick
    )


def _measured(readers: Sequence[Reader], progress: Progress) -> list[list[Measured]]:
    """The statistics of each picture of each set."""
    total = sum(len(items) for items, _ in readers)
    measured: list[list[Measured]] = []
    done = 0
    for items, read in readers:
        measured.append([])
        for item in items:
            measured[-1].append(measure(read(item)))
            done += 1
            progress(done, total)
    return measured


def _compared(
    values: Measured, reference: tuple[str, list[Measured]], other: tuple[str, list[Measured]] | None
) -> tuple[list[Comparison], str]:
    """Distances of pooled `values` from a reference, and in words what they are relative to.

    reference, other: name and pictures of a set.
    """
    name, pictures = reference
    real, count = pool(pictures), len(pictures)
    if other is not None:
        other_name, others = other
        yardstick = f"1x is how far {other_name} ({len(others)} pictures) lies from the {count} of {name}"
        if min(count, len(others)) < LEAST_PICTURES:
            yardstick += f"; sets of fewer than {LEAST_PICTURES} differ by chance, so relative is too small"
        return compare(values, real, pool(others)), yardstick
    found = compare(values, real)
    if count < LEAST_PICTURES:
        return found, (
            f"none: halves of {count} pictures differ by chance too much, {LEAST_PICTURES} are the least; "
            "--other takes a second real set"
        )
    halves = compare(pool(pictures[::2]), pool(pictures[1::2]))
    return [replace(each, yardstick=half.distance) for each, half in zip(found, halves, strict=True)], (
        f"1x is how far the halves of the {count} pictures of {name} lie apart by chance, the less "
        "the more they are; the aim of 2x is for --other, a second real set"
    )


def inspection_json(inspection: Inspection) -> bytes:
    """Means, distances and yardsticks as a JSON file."""
    content = {
        "data": inspection.data,
        "pictures": inspection.pictures,
        "mean": {name: float(values.mean()) for name, values in inspection.values.items()},
        "reference": inspection.reference_name,
        "yardstick": inspection.yardstick,
        "statistics": [_finite(asdict(c)) for c in inspection.comparisons],
    }
    return (json.dumps(content, indent=1) + "\n").encode()


def _finite(record: dict) -> dict:
    return {key: None if value != value else value for key, value in record.items()}


def _reader(folder: Path, limit: int) -> Reader:
    if not folder.is_dir():
        raise FsidError(f"{folder}: is neither a dataset nor a folder of photographs")
    if any(folder.glob("shard-*.tar")):
        return some_mosaics(folder, limit), _stored_picture
    return spaced(find_photos(folder), limit), _photo_picture


def _stored_picture(stored: StoredMosaic) -> np.ndarray:
    balance, matrix = _colour(stored)
    mosaic = (stored.levels().astype(np.float32) - stored.black_level) / (
        stored.white_level - stored.black_level
    )
    return _picture(mosaic, stored.cfa, balance, matrix)


def _colour(stored: StoredMosaic) -> tuple[np.ndarray, np.ndarray]:
    """White-balance gains (3,) and xyz_to_camera (3, 3) of a sample; FsidError where its JSON lacks them."""
    name = f"{stored.key}.json"
    where = f"{stored.shard}: {name}"
    record = read_record(read_member(stored.shard, name), where)
    try:
        balance, matrix = (np.asarray(record[key], np.float64) for key in ("white_balance", "xyz_to_camera"))
    except (KeyError, TypeError, ValueError, OverflowError):
        raise FsidError(f"{where}: states no white_balance and xyz_to_camera") from None
    if balance.shape != (3,) or not ((balance > 1e-3) & (balance < 1e3)).all():
        raise FsidError(f"{where}: white_balance must be three gains between 0.001 and 1000")
    if matrix.shape != (3, 3) or not is_of_camera(matrix):
        raise FsidError(f"{where}: xyz_to_camera must be a 3x3 matrix with an inverse")
    return balance, matrix


def _photo_picture(path: Path) -> np.ndarray:
    """Colour and exposure are drawn anew for each photograph, by its name: the same in every run."""
    rng = np.random.default_rng(list(os.fsencode(path.name)))
    raw = clean_from_photo(rng, read_photo(path), load_profile(PHOTO_CAMERA))
    return _picture(raw.mosaic, raw.cfa, raw.white_balance, raw.xyz_to_camera)


def _picture(mosaic: np.ndarray, cfa: str, white_balance: ArrayLike, xyz_to_camera: ArrayLike) -> np.ndarray:
    """(H / 2, W / 2, 3) sRGB-encoded of a mosaic (H, W) in 0..1."""
    red, green_r, green_b, blue = pack(mosaic, cfa)
    gains = np.asarray(white_balance, np.float32) / np.min(white_balance)
    balanced = np.minimum(np.stack([red, (green_r + green_b) / 2, blue], axis=-1) * gains, 1)
    return srgb_encode(balanced @ camera_to_srgb_matrix(np.asarray(xyz_to_camera)).T)
