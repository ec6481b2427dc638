"""Poisson counts, some times faster than numpy's.

    lam < 10:  n = A + B,   A ~ Poisson(q) by alias table,   B ~ Poisson(lam - q),   q = floor(32 lam) / 32
    else:      n = round(lam + sqrt(lam - 1/12) z + (z^2 - 1) / 6 - (z^3 - z) / (72 sqrt(lam))),   z ~ N(0, 1)

Few electrons: exact. One table row per 1/32 electron, of 64 counts (Walker 1977), gives A from one random
number; the remainder is less than 1/32, so most of B is 0, and the rest comes from thinning a Poisson process
over the array. Many: the Cornish-Fisher expansion of the Poisson quantile (Abramowitz & Stegun, 26.2.49)
turns one normal number into one count; 1/12 is the variance that rounding adds. Mean, variance, skewness and
kurtosis are those of the Poisson distribution.
"""

from __future__ import annotations

from functools import cache

import numpy as np

EXACT_BELOW = 10.0
_PER_ELECTRON = 32
_COUNTS = 64  # of a row: Poisson(10) exceeds 63 once in 10^26 times
_COUNT_BITS = 6
_FRACTION = (1 << 26) - 1  # the low bits of a random number: its place within its count
_BLOCK = 1 << 16


def poisson(rng: np.random.Generator, lam: np.ndarray) -> np.ndarray:
    """Counts (same shape, float32) of mean and variance `lam` >= 0."""
    lam = np.asarray(lam, np.float32)
    count = np.empty(lam.shape, np.float32)
    flat, out = lam.reshape(-1), count.reshape(-1)
    for start in range(0, flat.size, _BLOCK):  # what a step needs stays in the processor's cache
        part = slice(start, start + _BLOCK)
        out[part] = _counts(rng, flat[part])
    return count


def _counts(rng: np.random.Generator, lam: np.ndarray) -> np.ndarray:
    few = lam < EXACT_BELOW
    if few.all():
        return _few(rng, lam)
    if not few.any():
        return _many(rng, lam)
    count = np.empty(lam.shape, np.float32)
    count[few] = _few(rng, lam[few])
    np.logical_not(few, out=few)
    count[few] = _many(rng, lam[few])
    return count


def _few(rng: np.random.Generator, lam: np.ndarray) -> np.ndarray:
    row = (lam * np.float32(_PER_ELECTRON)).astype(np.int32)
    rest = lam - row * np.float32(1 / _PER_ELECTRON)
    number = rng.integers(0, 1 << 32, lam.shape, np.uint32)
    count = number >> (32 - _COUNT_BITS)
    row *= _COUNTS
    row += count.view(np.int32)
    entry = _alias_table().take(row, mode="clip")
    number &= _FRACTION
    count = np.where(number < entry >> _COUNT_BITS, count, entry & (_COUNTS - 1)).astype(np.float32)
    places = rng.integers(0, lam.size, rng.poisson(lam.size / _PER_ELECTRON))
    places = places[rng.random(places.size, np.float32) < rest[places] * _PER_ELECTRON]
    np.add.at(count, places, 1)
    return count


@cache
def _alias_table() -> np.ndarray:
    """(rows * 64,) uint32, a column per count: 26 bits its share of itself, 6 bits whose the rest is."""
    from scipy.stats import poisson as distribution  # slow to import, and most profiles count no electrons

    rows = np.arange(int(EXACT_BELOW * _PER_ELECTRON) + 1) / _PER_ELECTRON
    share = distribution.pmf(np.arange(_COUNTS), rows[:, None]) * _COUNTS
    kept, other = np.ones_like(share), np.tile(np.arange(_COUNTS, dtype=np.uint32), (len(rows), 1))
    for row in range(len(rows)):
        _pair(share[row], kept[row], other[row])
    table = (np.rint(kept * _FRACTION).astype(np.uint32) << _COUNT_BITS | other).ravel()
    table.setflags(write=False)
    return table


def _pair(share: np.ndarray, kept: np.ndarray, other: np.ndarray) -> None:
    """Fill columns that have less than their share from those that have more (Vose 1991)."""
    small, large = [list(np.flatnonzero(test)) for test in (share < 1, share >= 1)]
    while small and large:
        column, donor = small.pop(), large[-1]
        kept[column], other[column] = share[column], donor
        share[donor] -= 1 - share[column]
        if share[donor] < 1:
            small.append(large.pop())


def _many(rng: np.random.Generator, lam: np.ndarray) -> np.ndarray:
    z = rng.standard_normal(lam.shape, np.float32)
    root = np.sqrt(lam - np.float32(1 / 12))
    excess = z * z
    excess -= 1  # z^2 - 1
    count = z / root
    count *= np.float32(-1 / 72)
    count += np.float32(1 / 6)
    count *= excess
    root *= z
    count += root
    count += lam
    np.rint(count, out=count)
    return np.maximum(count, 0, out=count)
