"""One random stream per (name, number): the same numbers in every process and on every machine."""

from __future__ import annotations

import zlib

import numpy as np


def rng_of(name: str, number: int) -> np.random.Generator:
    """The generator of a mesh (family, seed) or of a material (family, variant)."""
    return np.random.default_rng((zlib.crc32(name.encode()), number))


def branch(rng: np.random.Generator) -> np.random.Generator:
    """A generator of its own for a part: whatever the part draws, `rng` has given one number."""
    return np.random.default_rng(rng.integers(2**63))
