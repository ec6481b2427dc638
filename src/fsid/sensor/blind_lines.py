"""The noise lines of four CFA sites through pools of smooth blocks of one picture, for `blind`.

    V = (k + dk) x + sigma2 + dsigma2,      dk, dsigma2 of a site: 0 within `SITE_SPREAD`

A picture rarely shows every colour in every light, so the lines are fitted together, and a site that says
little is drawn to the mean of all. Where light is too much alike to tell k, it is that of a camera whose read
noise is usual.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import lsq_linear

from fsid.errors import FsidError

SITE_SPREAD = (0.1, 0.3)  # relative, of k and sigma2: twelve published phones
TEXTURE = 0.08  # of a variance: error that texture makes in an ordinary photograph (bench/blind_noise.py)
_REWEIGHTINGS = 12
_READ_E2 = 4.0  # read noise, electrons squared: sigma2 / k^2, 1.6 to 13 over the built-in profiles at ISO 800
_LEAST_K = 1e-15  # keeps what is a share of k above 0


@dataclass(frozen=True, eq=False)
class Pools:
    """Medians of smooth blocks of one site in one part of the range, each (n,): mean, normalised light;
    variance, of its noise; freedom, how many independent coefficients stand behind it; site, 0..3 for R, Gr,
    Gb, B; part, number of the part of the range, from dark to light."""

    mean: np.ndarray
    variance: np.ndarray
    freedom: np.ndarray
    site: np.ndarray
    part: np.ndarray


@dataclass(frozen=True, eq=False)
class Lines:
    """k and sigma2: common (2,), from which those of the sites (4, 2) differ; spread (4, 2, n): what
    each of n independent deviations of one standard error adds to the latter."""

    common: np.ndarray
    sites: np.ndarray
    spread: np.ndarray

    @property
    def errors(self) -> np.ndarray:
        """(4, 2) standard errors of the sites."""
        return np.asarray(np.linalg.norm(self.spread, axis=2))


def fitted(pools: Pools, before: Lines, floor: float) -> Lines:
    """The lines through `pools`, sites being alike within `SITE_SPREAD` of those `before`; floor: variance of
    rounding. Parts of the range above the lines, which texture lifts, count less. FsidError: no pools."""
    if pools.mean.size == 0:
        raise FsidError("the image has no smooth part in which its noise could be seen")
    light = np.stack([pools.mean.clip(min=0), np.ones_like(pools.mean)], axis=1)
    design = np.hstack([light, (np.eye(4)[pools.site][:, :, None] * light[:, None]).reshape(-1, 8)])
    of_site = np.hstack([np.tile(np.eye(2), (4, 1)), np.eye(8)])
    bounds = (np.array([0.0] * 2 + [-np.inf] * 8), np.full(10, np.inf))
    spread = np.tile(np.array(SITE_SPREAD) * np.maximum(before.common, (_LEAST_K, floor)), 4)
    prior = np.hstack([np.zeros((8, 2)), np.diag(1 / spread)])
    model = np.maximum(pools.variance, floor)
    root = np.sqrt(pools.freedom / 2) / model
    for _ in range(_REWEIGHTINGS):
        rows = np.concatenate([design * root[:, None], prior])
        unit = 1 / np.linalg.norm(rows, axis=0)  # of variables whose sizes are far apart
        values = np.concatenate([(pools.variance - floor) * root, np.zeros(8)])
        found = unit * lsq_linear(rows * unit, values, bounds, method="bvls").x
        model = np.maximum(design @ found + floor, floor)
        root = np.sqrt(_weight(pools, model) * pools.freedom / 2) / model
    scatter = max(1.0, float(np.sum((root * (pools.variance - model)) ** 2) / max(len(model) - 2, 1)))
    rows = np.concatenate([design * root[:, None] / np.sqrt(scatter), prior])
    unit = 1 / np.linalg.norm(rows, axis=0)
    spread = (of_site * unit) @ np.linalg.pinv(rows * unit)
    zero = np.array([0.0, floor])
    sites = np.maximum((of_site @ found).reshape(4, 2) + zero, zero)
    return Lines(found[:2] + zero, sites, spread.reshape(4, 2, -1))


def _weight(pools: Pools, model: np.ndarray) -> np.ndarray:
    """(n,) of pools: by how far all pools in the same part of the range together lie above `model`."""
    freedom = np.bincount(pools.part, pools.freedom).clip(min=1e-9)
    above = np.bincount(pools.part, pools.freedom * (pools.variance / model - 1)) / freedom
    z = above / np.sqrt(2 / freedom)
    return (1 / (1 + (z.clip(min=0) / 2) ** 2))[pools.part]


def physical(pools: Pools, site: int, lines: Lines, floor: float) -> tuple[np.ndarray, np.ndarray]:
    """(k, sigma2) of one site and their errors, with what texture may add at either end of the light seen.

    k is weighed against that of a camera whose read noise is `_READ_E2` and that has the same variance in the
    mean light of the site, where the image tells it; the square of that k is the variance of this guess.
    """
    x = pools.mean.clip(min=0)
    own = pools.freedom * (pools.site == site)
    light = float(np.average(x, weights=own if own.any() else np.ones_like(x)))
    k, sigma2 = lines.sites[site]
    dark, bright, variance = (k * at + sigma2 for at in (x.min(), x.max(), light))
    texture = TEXTURE * np.array([np.hypot(dark, bright) / max(x.max() - x.min(), 1e-9), dark])
    k_error, sigma2_error = np.hypot(lines.errors[site], texture)
    usual = (np.sqrt(light**2 + 4 * _READ_E2 * variance) - light) / (2 * _READ_E2)
    told = usual**2 / (usual**2 + k_error**2)
    k, k_error = told * k + (1 - told) * usual, np.sqrt(told) * k_error
    sigma2_error = min(sigma2_error, np.hypot(TEXTURE * variance, k_error * light))
    return np.array([k, max(variance - k * light, floor)]), np.array([k_error, sigma2_error])
