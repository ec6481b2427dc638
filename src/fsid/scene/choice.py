"""Draws that stay when the list of names grows.

    choice = argmax over names of hash(name, key)         key: 64 random bits of this draw

Rendezvous hashing (Thaler and Ravishankar 1998): every name's score is its own, so a new name changes only
the draws that it wins, 1 in N, and scenes keep their seeds from one release to the next.
"""

from __future__ import annotations

from functools import lru_cache
from hashlib import blake2b

import numpy as np


def pick_rand(rng: np.random.Generator, names: tuple[str, ...]) -> str:
    """One of `names`, all equally likely, whatever their order. Draws exactly one number."""
    key = rng.integers(2**64, dtype=np.uint64)
    return names[int(_mixed(_hashes(names) ^ key).argmax())]


def share_rand(rng: np.random.Generator, shares: tuple[float, ...]) -> int:
    """An index of `shares`, drawn as often as they say; they sum to 1, or nearly, as written by hand."""
    return int(rng.choice(len(shares), p=np.array(shares) / sum(shares)))


def log_uniform_rand(rng: np.random.Generator, limits: tuple[float, float]) -> float:
    """A number whose logarithm is uniform between the two positive limits."""
    return float(np.exp(rng.uniform(*np.log(limits))))


def power_law_rand(rng: np.random.Generator, limits: tuple[float, float], exponent: float) -> float:
    """A number of density ~ x^-exponent between the two positive limits."""
    if abs(exponent - 1.0) < 1e-9:
        return log_uniform_rand(rng, limits)
    low, high = (limit ** (1.0 - exponent) for limit in limits)
    return float((low + rng.random() * (high - low)) ** (1.0 / (1.0 - exponent)))


@lru_cache(maxsize=64)
def _hashes(names: tuple[str, ...]) -> np.ndarray:
    digests = (blake2b(name.encode(), digest_size=8).digest() for name in names)
    return np.frombuffer(b"".join(digests), "<u8")


def _mixed(bits: np.ndarray) -> np.ndarray:
    """The finaliser of SplitMix64 (Steele, Lea and Flood 2014): every input bit moves every output bit."""
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))
