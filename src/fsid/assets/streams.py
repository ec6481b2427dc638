"""One random stream per (name, number): the same numbers in every process and on every machine."""

from __future__ import annotations

import zlib

import numpy as np


def rng_of(name: str, number: int) -> np.random.Generator:
    """The generator of a mesh (family, seed) or of a material (family, variant)."""
    return np.random.default_rng((zlib.crc32(name.encode()), number))
