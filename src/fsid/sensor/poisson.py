"""Poisson counts at the speed of Gaussian ones.

    n = round(lam + sqrt(lam - 1/12) z + (z^2 - 1) / 6 - (z^3 - z) / (72 sqrt(lam))),    z ~ N(0, 1)

The Cornish-Fisher expansion of the Poisson quantile (Abramowitz & Stegun, 26.2.49) turns one normal number
into one count; 1/12 is the variance that rounding adds. Mean, variance, skewness and kurtosis are then those
of the Poisson distribution. Below 10 electrons, where the distance of the distributions would show, every
count is drawn exactly.
"""

from __future__ import annotations

import numpy as np

EXACT_BELOW = 10.0


def poisson(rng: np.random.Generator, lam: np.ndarray) -> np.ndarray:
    """Counts (same shape, float32) of mean and variance `lam` >= 0."""
    lam = np.asarray(lam, np.float32)
    few = lam < EXACT_BELOW
    if not few.any():
        return _many(rng, lam)
    if few.all():
        return rng.poisson(lam).astype(np.float32)
    count = np.empty(lam.shape, np.float32)
    count[few] = rng.poisson(lam[few])
    np.logical_not(few, out=few)
    count[few] = _many(rng, lam[few])
    return count


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
