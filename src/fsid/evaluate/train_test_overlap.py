"""Test photographs that a rival has seen in its training, under other names, encoded anew, or resized.

    p = 16 x 16 means of a picture, less their mean, in units of their deviation;    a copy: rms(p - q) < 0.2

Copies of 400 photographs (half to twice the size, JPEG of quality 60 to 95) are within 0.1, different ones of
the same collection beyond 0.3. Crops and mirrored copies are not found.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from fsid.dataset.photos import thumbnail
from fsid.errors import FsidError
from fsid.evaluate.testset import as_text
from fsid.plurals import counted

_SIDE = 16
_ALIKE = 0.2
_FLAT = 1 / 255
"""Deviation below which a picture has nothing to know it by."""


def overlap_note(tests: Mapping[str, Sequence[Path]], training: Sequence[Path], threads: int) -> str:
    """In words, which photographs of named test sets the rival is trained on; "" where none is found."""
    seen = dict(copies_in_training([path for photos in tests.values() for path in photos], training, threads))
    said = []
    for name, photos in tests.items():
        if known := [path for path in photos if path in seen]:
            test, theirs = (as_text(path.name) for path in (known[0], seen[known[0]]))
            said.append(
                f"{len(known)} of {counted(len(photos), 'test photograph')} of {as_text(name)} are trained "
                f"on by the real rival, which flatters it ({test} is its {theirs})"
            )
    return "; ".join(said)


def copies_in_training(
    tests: Sequence[Path], training: Sequence[Path], threads: int
) -> list[tuple[Path, Path]]:
    """Which of `tests` show what one of `training` shows, and which; files that are no photographs do not."""
    with ThreadPoolExecutor(threads) as pool:
        theirs = np.array(list(pool.map(_looks, training)), np.float32)
        ours = list(pool.map(_looks, tests))
    found = []
    for test, looks in zip(tests, ours, strict=True):
        distance2 = np.mean((theirs - looks) ** 2, axis=1)
        nearest = int(np.argmin(np.where(np.isnan(distance2), np.inf, distance2)))
        if distance2[nearest] < _ALIKE**2:
            found.append((test, training[nearest]))
    return found


def _looks(path: Path) -> np.ndarray:
    """(n,) what a photograph is known by; NaN for one that is flat or cannot be read."""
    try:
        small = thumbnail(path, _SIDE).astype(np.float64)
    except FsidError:
        return np.full(3 * _SIDE**2, np.nan)
    small -= small.mean(axis=(0, 1))
    deviation = small.std()
    return (small / deviation if deviation > _FLAT else np.full_like(small, np.nan)).ravel()
