"""From a table of noise levels at a few ISOs to the level at any ISO.

    k(ISO) = a + b ISO,      sigma2(ISO) = floor + c0 + c1 ISO + c2 ISO^2,      all coefficients >= 0

Analog gain multiplies the electrons, so k rises with ISO and the amplified part of the read noise with
its square; c1 lets the transition curve. Real sensors depart from the law (a dual conversion gain steps
between two such lines), so the table is believed where it exists and the law carries it beyond its ends:

- between table points: monotone cubic (Fritsch & Carlson 1980) through log(value) over log(law). Points on
  the law are joined by the law itself; over log(ISO) they would be by powers of ISO, which a floor is not. A
  law that stands still says nothing of the points and is replaced by ISO;
- outside: the law, scaled to join the last point;
- a published value that falls while ISO rises is a fit's error: it is averaged with its neighbours until none
  falls;
- where a table states standard errors, as a calibrated one does, neighbours that fall within three errors of
  their difference are pooled, weighted by their errors (Ayer et al. 1955). A fall beyond them is the
  camera's: another conversion gain, with less read noise. It is kept, and so is all that does not fall. Each
  gain has a law and a cubic of its own: a common cubic would level out at both sides of the fall, and a
  common law finds read noise that does not grow with ISO. The fall itself is straight, over log(ISO).

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
from scipy.interpolate import PchipInterpolator
from scipy.optimize import nnls

RELATIVE_ERROR = 0.1  # of a published value against the law, where no absolute error dominates
DIGITS = 1e-5  # relative; a value this near the floor is the floor, written to the six digits of a file
SIGNIFICANT = 3.0  # standard errors of a difference, beyond which a fall is real
_ISO = np.array([0.0, 1.0])  # the polynomial
_REWEIGHTINGS = 10


@dataclass(frozen=True, eq=False)
class IsoCurve:
    """Values of the four sites R, Gr, Gb, B at any ISO.

    iso: (n,) of the table. laws: (powers, n - 1, 4) between its points. cubics: (4, n - 1, 4) there,
    log(values) over log(law), from the lower point on; none where the law alone holds. below, above:
    (powers, 4) the law at both ends. Coefficients of polynomials are in ascending order.
    """

    iso: np.ndarray
    laws: np.ndarray
    cubics: np.ndarray
    below: np.ndarray
    above: np.ndarray

    def __call__(self, iso: float) -> np.ndarray:
        """(4,) values at `iso` > 0."""
        end = self.below if iso < self.iso[0] else self.above
        intervals = self.cubics.shape[1]
        if not intervals:
            return polyval(iso, end)
        nearest = min(max(iso, self.iso[0]), self.iso[-1])
        at = min(int(np.searchsorted(self.iso, nearest, side="right")), intervals) - 1
        law, cubic = self.laws[:, at], self.cubics[:, at]
        x = np.log(polyval(nearest, law) / polyval(self.iso[at], law))
        return np.exp(polyval(x, cubic, tensor=False)) * polyval(iso, end) / polyval(nearest, end)


def k_curve(iso: np.ndarray, k: np.ndarray, error: np.ndarray | None = None) -> IsoCurve:
    """k over ISO from a table: iso (n,) ascending, k (n, 4) > 0, error (n, 4) standard errors if known."""
    return _curve(k_law, iso, k, _believed(k, error))


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

    if impossible.size:
        laws = np.stack([law(iso, site) for site in sigma2.T], axis=1)
        return IsoCurve(iso, np.empty((3, 0, 4)), np.empty((4, 0, 4)), laws, laws)
    return _curve(law, iso, sigma2, _believed(sigma2, error))


def _curve(
    law: Callable[[np.ndarray, np.ndarray], np.ndarray],
    iso: np.ndarray,
    values: np.ndarray,
    believed: np.ndarray,
) -> IsoCurve:
    """Through `believed`: from fall to fall of a site over what `law` makes of `values`, a fall straight."""
    laws, cubics = np.zeros((3, len(iso) - 1, 4)), np.zeros((4, len(iso) - 1, 4))
    below, above = [], []
    for site in range(4):
        starts = (0, *(np.flatnonzero(np.diff(believed[:, site]) < 0) + 1), len(iso))
        pieces = [slice(*ends) for ends in pairwise(starts)]
        own = [law(iso[piece], values[piece, site]) for piece in pieces]
        falls = [slice(start - 1, start + 1) for start in starts[1:-1]]
        for piece, polynomial in zip((*pieces, *falls), (*own, *[_ISO] * len(falls)), strict=True):
            inside = slice(piece.start, piece.stop - 1)
            used, cubic = _joined(iso[piece], believed[piece, site], polynomial)
            laws[: len(used), inside, site] = used[:, None]
            cubics[:, inside, site] = cubic
        below.append(own[0])
        above.append(own[-1])
    return IsoCurve(iso, laws, cubics, np.stack(below, axis=1), np.stack(above, axis=1))


def _joined(iso: np.ndarray, values: np.ndarray, law: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What to join (n,) `values` over, `law` or ISO itself, and the (4, n - 1) cubics, ascending powers."""
    if len(iso) == 1:
        return law, np.empty((4, 0))
    x = np.log(polyval(iso, law))
    if np.diff(x).min() <= DIGITS:
        law, x = _ISO, np.log(iso)
    return law, PchipInterpolator(x, np.log(values)).c[::-1]


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
