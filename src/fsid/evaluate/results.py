"""Figures of methods, per image and as means over sets, and the files that hold them."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, astuple, dataclass, fields
from pathlib import Path

import numpy as np
from scipy.special import stdtrit

from fsid.errors import FsidError
from fsid.files import read_whole, write_atomically
from fsid.plurals import counted

MOST_DB = 100.0
"""What a PSNR counts as at most: an rms error of 1e-5 of white is less than a step of a 16-bit file. A result
that equals its truth has an infinite one, and so would have every mean over it."""


@dataclass(frozen=True)
class Row:
    """A line of results.json: the mean over the `n` images of a set at one level; dB, dB, 0..1."""

    model: str
    training: str
    camera: str
    level: str
    set: str
    n: int
    psnr_raw: float
    psnr: float
    ssim: float


@dataclass(frozen=True)
class ImageRow:
    """One image at one level under one method: the mean over its noisy frames; dB, dB, 0..1."""

    model: str
    level: str
    set: str
    image: str
    psnr_raw: float
    psnr: float
    ssim: float


def write_results(rows: Sequence[Row], file: str | Path) -> None:
    """Write results.json: a list of rows, figures rounded to 1e-4; null for one that is not finite."""

    def plain(value: object) -> object:
        if not isinstance(value, float):
            return value
        return round(value, 4) if np.isfinite(value) else None

    plain_rows = [{key: plain(value) for key, value in asdict(row).items()} for row in rows]
    write_atomically(Path(file), (json.dumps(plain_rows, indent=1, allow_nan=False) + "\n").encode())


def write_images(images: Sequence[ImageRow], file: Path) -> None:
    """Write images.csv: one line per image, level and method."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(field.name for field in fields(ImageRow))
    for row in images:
        writer.writerow(f"{v:.4f}" if isinstance(v, float) else v for v in astuple(row))
    write_atomically(file, text.getvalue().encode(errors="backslashreplace"))


def read_images(file: Path) -> list[ImageRow]:
    """The rows of an images.csv; FsidError where it holds something else."""
    names = [field.name for field in fields(ImageRow)]
    numbers = {field.name for field in fields(ImageRow) if field.type == "float"}
    try:
        header, *lines = csv.reader(io.StringIO(read_whole(file).decode(), newline=""))
        if header != names:
            raise ValueError
        return [
            ImageRow(*(float(v) if n in numbers else v for n, v in zip(names, line, strict=True)))  # type: ignore[arg-type]
            for line in lines
        ]
    except (ValueError, csv.Error):
        raise FsidError(
            f"{file}: holds no figures of images; delete it, and they are measured again"
        ) from None


def confidence(values: Sequence[float], sets: Sequence[str] = ()) -> float:
    """Half width of the 95 % confidence interval of the mean (Student's t).

    sets: that of each value. Where there are several, these are what is counted, since pictures of one
    material or photographer are alike (clustered variance; of sets of equal size, the interval over their
    means). NaN of fewer than two values, or where one is infinite.
    """
    if len(values) < 2 or not np.isfinite(values).all():
        return float("nan")
    named, cluster = np.unique(sets, return_inverse=True)
    if len(named) < 2:
        cluster = np.arange(len(values))
    departure = np.bincount(cluster, np.asarray(values) - np.mean(values))
    n = len(departure)
    return float(stdtrit(n - 1, 0.975) * np.sqrt(n / (n - 1) * np.sum(departure**2)) / len(values))


def perfect_note(images: Iterable[ImageRow]) -> str:
    """In words, how many results have no error, and what that does to means; "" where none does."""
    perfect = [row for row in images if max(row.psnr_raw, row.psnr) >= MOST_DB]
    if not perfect:
        return ""
    first = f"{perfect[0].model} of {perfect[0].image} at {perfect[0].level}"
    return (
        f"{counted(len(perfect), 'result')} without error ({first} for one): "
        f"a PSNR counts as {MOST_DB:g} dB at most, which still lifts a mean"
    )
