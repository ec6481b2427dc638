"""What the user's own folders hold that can be used, and what is skipped and why.

Surveying a large folder takes minutes, so a process does it once, and tells its workers what it found.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from fsid.errors import FsidError

T = TypeVar("T")
Skipped = tuple[str, str]
"""Name and reason."""


@dataclass(frozen=True)
class Survey(Generic[T]):
    """usable: in a fixed order. skipped: (name, reason) of all others."""

    usable: tuple[T, ...]
    skipped: tuple[Skipped, ...]


KNOWN: dict[tuple[str, ...], Survey[Any]] = {}
"""The surveys of this process, by what tells them apart."""


def surveyed(
    key: tuple[str, ...], look: Callable[[], tuple[Sequence[T], Sequence[Skipped]]], nothing: str
) -> Survey[T]:
    """What `look()` finds to use and skips, the first time that `key` is asked for.

    key: the kind, the place as it was given (names come from it; seen from another working folder it is
    another one), and what else matters.
    FsidError, `nothing` and why the first was skipped, where there is none to use.
    """
    key = (*key, os.path.abspath(key[1]))
    if key not in KNOWN:
        usable, skipped = look()
        if not usable:
            why = f"; the first of {len(skipped)} skipped: {skipped[0][1]}" if skipped else ""
            raise FsidError(nothing + why)
        KNOWN[key] = Survey(tuple(usable), tuple(skipped))
    return KNOWN[key]
