"""From a table of noise levels at a few ISOs to the level at any ISO.

    k(ISO) = a + b ISO,      sigma2(ISO) = floor + c0 + c1 ISO + c2 ISO^2,      all coefficients >= 0

Analog gain multiplies the electrons, so k rises with ISO and the amplified part of the read noise with
its square; c1 lets the transition curve. Real sensors depart from the law (a dual conversion gain steps
between two such lines), so the table is believed where it exists and the law carries it beyond its ends:

- between table points: monotone cubic through log(value) over log(ISO) (Fritsch & Carlson 1980);
- outside: the law, scaled to join the last point;
- a published value that falls while ISO rises is a fit's error: it is averaged with its neighbours until none
  falls;
- where a table states standard errors, as a calibrated one does, neighbours that fall within three errors of
  their difference are pooled, weighted by their errors (Ayer et al. 1955). A fall beyond them is the
  camera's: another conversion gain, with less read noise. It is kept, and so is all that does not fall. Each
  gain has a cubic of its own, since a common one would level out at both sides of the fall, and a law of its
  own beyond the end of the table, since a common one finds read noise that does not grow with ISO.

sigma2 below the rounding noise of the converter, 1/12 DN^2, is impossible for an image made of integers; a
published table holds such values, even negative ones, when its intercepts were fitted without that bound.
The size of the impossible values is then the size of the error of all intercepts of that camera, and the
points carry no more than a trend: the law, fitted with that error in its weights, replaces the whole table.
Results are continuous in ISO, never below the floor, and monotone but for such falls.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.polynomial.polynomial import polyval
from scipy.interpolate import PchipInterpolator, PPoly
from scipy.optimize import nnls

RELATIVE_ERROR = 0.1  # of a published value against the law, where no absolute error dominates
DIGITS = 1e-5  # relative; a value this near the floor is the floor, written to the six digits of a file
SIGNIFICANT = 3.0  # standard errors of a difference, beyond which a fall is real
_REWEIGHTINGS = 10


@dataclass(frozen=True, eq=False)
class IsoCurve:
    """Values of the four sites R, Gr, Gb, B at any ISO.

    first, last: ends of the table. inside: log(ISO) -> log(values) between them, None where the law alone
    holds. below, above: (powers, 4) polynomial coefficients of the law at both ends, in ascending order.
    """

    first: float
    last: float
    inside: PPoly | None
    below: np.ndarray
    above: np.ndarray

    def __call__(self, iso: float) -> np.ndarray:
        """(4,) values at `iso` > 0."""
        law = self.below if iso < self.first else self.above
        if self.inside is None:
            return polyval(iso, law)
        nearest = min(max(iso, self.first), self.last)
        return np.exp(self.inside(np.log(nearest))) * polyval(iso, law) / polyval(nearest, law)


def k_curve(iso: np.ndarray, k: np.ndarray, error: np.ndarray | None = None) -> IsoCurve:
    """k over ISO from a table: iso (n,) ascending, k (n, 4) > 0, error (n, 4) standard errors if known."""
    believed = _believed(k, error)
    below, above = (np.stack(laws, axis=1) for laws in _laws(k_law, iso, k, believed))
    return IsoCurve(iso[0], iso[-1], _inside(iso, believed), below, above)


def sigma2_curve(
    iso: np.ndarray, sigma2: np.ndarray, floor: float, error: np.ndarray | None = None
) -> IsoCurve:
    """sigma2 >= floor over ISO from a table: iso (n,) ascending, sigma2 (n, 4), impossible values allowed.

    error: (n, 4) standard errors, None where the table states none.
    """
    sigma2 = np.where(abs(sigma2 - floor) <= DIGITS * floor, floor, sigma2)
    impossible = sigma2[sigma2 < floor]
    absolute = float(np.sqrt(np.mean((impossible - floor) ** 2))) if impossible.size else 0.0

    def law(iso: np.ndarray, values: np.ndarray) -> np.ndarray:
        coefficients = sigma2_law(iso, values, floor, absolute)
        coefficients[0] += floor
        return coefficients

    believed = _believed(sigma2, None if impossible.size else error)
    below, above = (np.stack(laws, axis=1) for laws in _laws(law, iso, sigma2, believed))
    return IsoCurve(iso[0], iso[-1], None if impossible.size else _inside(iso, believed), below, above)


def _laws(
    law: Callable[[np.ndarray, np.ndarray], np.ndarray],
    iso: np.ndarray,
    values: np.ndarray,
    believed: np.ndarray,
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """What `law` makes of each site of a table up to its first fall, and from its last one on."""
    below, above = [], []
    for site, seen in zip(values.T, believed.T, strict=True):
        starts = (0, *(np.flatnonzero(np.diff(seen) < 0) + 1), len(iso))
        below.append(law(iso[: starts[1]], site[: starts[1]]))
        above.append(law(iso[starts[-2] :], site[starts[-2] :]) if len(starts) > 2 else below[-1])
    return below, above


def k_law(iso: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Coefficients (a, b) >= 0 of `k = a + b ISO`, least relative squares; iso, k (n,)."""
    return _nonnegative_fit(iso, k, powers=(1, 0), error=0.0)


def sigma2_law(iso: np.ndarray, sigma2: np.ndarray, floor: float, error: float) -> np.ndarray:
    """Coefficients (c0, c1, c2) >= 0 of `sigma2 = floor + c0 + c1 ISO + c2 ISO^2`; iso, sigma2 (n,).

    error: absolute error of one value; 0 where it is relative only.
    """
    return _nonnegative_fit(iso, sigma2 - floor, powers=(2, 0, 1), error=max(error, floor))


def _believed(values: np.ndarray, error: np.ndarray | None) -> np.ndarray:
    if error is None:
        return _rising(values)
    return np.stack([_pooled(*site) for site in zip(values.T, error.T, strict=True)], axis=1)


def _inside(iso: np.ndarray, believed: np.ndarray) -> PPoly | None:
    return None if len(iso) == 1 else _cubics(np.log(iso), np.log(believed))


def _cubics(x: np.ndarray, y: np.ndarray) -> PPoly:
    """Through y (n, 4) over x (n,), n > 1: a monotone cubic from fall to fall of a site, a fall straight."""
    coefficients = np.zeros((4, len(x) - 1, y.shape[1]))
    for site, values in enumerate(y.T):
        slopes = np.diff(values) / np.diff(x)
        falls = np.flatnonzero(slopes < 0)
        coefficients[2:, falls, site] = slopes[falls], values[falls]
        for first, last in pairwise((0, *(falls + 1), len(x))):
            if last - first > 1:
                cubic = PchipInterpolator(x[first:last], values[first:last])
                coefficients[:, first : last - 1, site] = cubic.c
    return PPoly(coefficients, x)


def _rising(values: np.ndarray) -> np.ndarray:
    """The mean of the tightest rising curves above and below `values` along axis 0; rising input is kept."""
    above = np.maximum.accumulate(values, axis=0)
    below = np.minimum.accumulate(values[::-1], axis=0)[::-1]
    return (above + below) / 2


def _pooled(values: np.ndarray, error: np.ndarray) -> np.ndarray:
    """(n,) `values` in 0..1; neighbours that fall within their standard `error` (n,) have their mean."""
    pools: list[tuple[float, float, int]] = []  # mean, its variance, number of values
    for mean, variance in zip(values, np.clip(np.abs(error), DIGITS * values, 1) ** 2, strict=True):
        count = 1
        while pools and 0 < pools[-1][0] - mean <= SIGNIFICANT * np.sqrt(pools[-1][1] + variance):
            before, variance_before, more = pools.pop()
            mean = (variance_before * mean + variance * before) / (variance + variance_before)
            variance *= variance_before / (variance + variance_before)
            count += more
        pools.append((mean, variance, count))
    means, _, counts = zip(*pools, strict=True)
    return np.repeat(means, counts)


def _nonnegative_fit(
    iso: np.ndarray, values: np.ndarray, powers: tuple[int, ...], error: float
) -> np.ndarray:
    """Polynomial in ISO with coefficients >= 0 in ascending order; weights 1 / hypot(error, 0.1 model).

    powers: of ISO, the indispensable first; a table of n ISOs gets the first n of them. Weights follow the
    model, not the data: a value that is too small by chance would else count too much.
    """
    scale = float(iso[-1])
    used = list(powers[: len(iso)])
    columns = (iso / scale)[:, None] ** np.array(used)
    model = np.full(len(iso), max(float(np.max(np.abs(values))), error))
    fitted = np.zeros(len(used))
    for _ in range(_REWEIGHTINGS):
        weight = 1.0 / np.hypot(error, RELATIVE_ERROR * model)
        fitted, _ = nnls(columns * weight[:, None], values * weight)
        model = columns @ fitted
    coefficients = np.zeros(len(powers))
    coefficients[used] = fitted / scale ** np.array(used)
    return coefficients
