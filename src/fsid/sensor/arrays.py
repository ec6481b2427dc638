"""One definition for NumPy arrays and torch tensors: the formulas use what both have.

    v = x.clip(min=0);  v *= k;  v += sigma2            operators and methods of the same name
    namespace(x).where(...), like(values, x)            functions, and constants where x lives

Nothing here imports torch: a tensor brings it along. What is an array here may be on any device.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from fsid.errors import FsidError, check_kind


def check_generator(rng: object) -> None:
    """FsidError for a seed in place of a generator."""
    check_kind(rng, np.random.Generator, "numpy.random.default_rng(seed) makes one")


def check_array(x: Any, what: str) -> None:
    """FsidError, naming `what`, for a list, a picture of another library or a path."""
    if not (hasattr(x, "ndim") and hasattr(x, "dtype")):
        raise FsidError(f"{what}: a {type(x).__name__} is no array; numpy.asarray makes one of numbers")


def check_floating(x: Any, what: str) -> None:
    """FsidError, naming `what`, for an array or tensor of whole numbers: nothing tells what is white."""
    check_array(x, what)
    if x.dtype.kind != "f" if isinstance(x, np.ndarray) else not x.is_floating_point():
        raise FsidError(
            f"{what} must be floating-point, with 1 for white; got {x.dtype}: divide by the white"
        )


def namespace(x: Any) -> Any:
    """The module whose functions take `x`: numpy or torch."""
    return np if isinstance(x, np.ndarray | np.generic) else sys.modules["torch"]


def like(values: Any, x: Any) -> Any:
    """`values` as an array of the type of `x`, on its device."""
    if isinstance(x, np.ndarray | np.generic):
        return np.asarray(values, x.dtype)
    return namespace(x).as_tensor(np.array(values), dtype=x.dtype, device=x.device)


def lit(x: Any) -> Any:
    """max(x, 0); `x` itself where it is a NumPy array without negative values, which is quicker to see."""
    if isinstance(x, np.ndarray) and x.min(initial=0) >= 0:
        return x
    return x.clip(min=0)


def lookup(table: np.ndarray, x: Any) -> Any:
    """The entry of `table`, float32 of length n, that is nearest to x (n - 1), for x in 0..1."""
    place = x * (len(table) - 1)
    place += 0.5
    if isinstance(x, np.ndarray | np.generic):
        return table.take(place.astype(np.uint16), mode="clip")
    return like(table, x)[place.long()]
