"""A knob: a setting with a default and the limits of sane values, checked when its dataclass is made.

    fov_deg: Range = knob((32.0, 70.0), 5.0, 150.0)

A Range is (lowest, highest) of a draw: uniform between them, or log-uniform where the knob's text says so.
"""

from __future__ import annotations

import math
from dataclasses import field, fields
from typing import Any, TypeVar

from fsid.config import check_fields
from fsid.errors import FsidError

Range = tuple[float, float]
T = TypeVar("T")


def knob(default: T, low: float, high: float) -> T:
    """A dataclass field whose number, or both of whose numbers, must lie in low .. high."""
    value: T = field(default=default, metadata={"limits": (low, high)})
    return value


def shares(*default: float) -> Any:
    """A dataclass field of as many shares as given here, each >= 0, of sum 1."""
    return field(default=default, metadata={"shares": len(default)})


def check_knobs(settings: Any) -> None:
    """`check_fields`; then raise FsidError that names the first setting outside its limits."""
    check_fields(settings)
    for item in fields(settings):
        value = getattr(settings, item.name)
        if "limits" in item.metadata:
            _check_limits(item.name, value, *item.metadata["limits"])
        if "shares" in item.metadata:
            _check_shares(item.name, value, item.metadata["shares"])


def _check_shares(key: str, value: tuple[float, ...], count: int) -> None:
    if len(value) != count or not min(value) >= 0 or not math.isclose(sum(value), 1.0, abs_tol=1e-6):
        raise FsidError(f"{key} = {value}: give {count} shares >= 0 that sum to 1")


def _check_limits(key: str, value: Any, low: float, high: float) -> None:
    numbers = value if isinstance(value, tuple) else (value,)
    if isinstance(value, tuple) and not (len(value) == 2 and value[0] <= value[1]):
        raise FsidError(f"{key} = {value}: give two numbers (lowest, highest)")
    if not all(low <= number <= high for number in numbers):
        raise FsidError(f"{key} = {value}: must be between {low} and {high}")
