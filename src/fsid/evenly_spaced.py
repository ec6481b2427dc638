"""Some of many, evenly spaced: what is shown or measured where all would be too much."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")


def spaced(items: Sequence[T], limit: int) -> list[T]:
    """`items`, or where there are more than `limit`, so many from the first to the last."""
    at = np.linspace(0, len(items) - 1, min(limit, len(items))).round().astype(int)
    return [items[i] for i in at]
