"""From a table of noise levels at a few ISOs to the level at any ISO.

    k(ISO) = a + b ISO,      sigma2(ISO) = floor + c0 + c1 ISO + c2 ISO^2,      all coefficients >= 0

Analog gain multiplies the electrons, so k rises with ISO and the amplified part of the read noise with
its square; c1 lets the transition curve. Real sensors depart from the law (a dual conversion gain steps
between two such lines), so the table is believed where it exists and the law carries it beyond its ends:

- between table points: monotone cubic through log(value) over log(ISO) (Fritsch & Carlson 1980);
- outside: the law, scaled to join the last point;
- a value that falls while ISO rises is a fit's error: it is averaged with its neighbours until none falls.

sigma2 below the rounding noise of the converter, 1/12 DN^2, is impossible for an image made of integers; a
published table holds such values, even negative ones, when its intercepts were fitted without that bound.
The size of the impossible values is then the size of the error of all intercepts of that camera, and the
points carry no more than a trend: the law, fitted with that error in its weights, replaces the whole table.
Both results are monotone and continuous in ISO, and never below the floor.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import nnls

RELATIVE_ERROR = 0.1  # of a published value against the law, where no absolute error dominates
_REWEIGHTINGS = 10


def k_law(iso: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Coefficients (a, b) >= 0 of `k = a + b ISO`, least relative squares; iso, k (n,)."""
    return _nonnegative_fit(iso, k, degree=1, error=0.0)


def sigma2_law(iso: np.ndarray, sigma2: np.ndarray, floor: float, error: float) -> np.ndarray:
    """Coefficients (c0, c1, c2) >= 0 of `sigma2 = floor + c0 + c1 ISO + c2 ISO^2`; iso, sigma2 (n,).

    error: absolute error of one value; 0 where it is relative only.
    """
    return _nonnegative_fit(iso, sigma2 - floor, degree=2, error=max(error, floor))


def k_at(iso: float, table_iso: np.ndarray, k: np.ndarray) -> np.ndarray:
    """k of the four sites at `iso`; table_iso (n,) ascending, k (n, 4) > 0. Returns (4,)."""
    return np.array([_at(iso, table_iso, site, k_law(table_iso, site)) for site in _rising(k).T])


def sigma2_at(iso: float, table_iso: np.ndarray, sigma2: np.ndarray, floor: float) -> np.ndarray:
    """sigma2 of the four sites at `iso`, >= floor; table_iso (n,) ascending, sigma2 (n, 4). Returns (4,)."""
    impossible = sigma2[sigma2 < floor]
    error = float(np.sqrt(np.mean((impossible - floor) ** 2))) if impossible.size else 0.0
    laws = [sigma2_law(table_iso, site, floor, error) for site in sigma2.T]
    if impossible.size:
        return np.array([floor + np.polynomial.polynomial.polyval(iso, law) for law in laws])
    total = [law + np.array([floor, 0.0, 0.0]) for law in laws]
    return np.array([_at(iso, table_iso, s, law) for s, law in zip(_rising(sigma2).T, total, strict=True)])


def _at(iso: float, table_iso: np.ndarray, values: np.ndarray, law: np.ndarray) -> float:
    first, last = table_iso[0], table_iso[-1]
    if first < iso < last:
        curve = PchipInterpolator(np.log(table_iso), np.log(values))
        return float(np.exp(curve(np.log(iso))))
    end, value = (first, values[0]) if iso <= first else (last, values[-1])
    polyval = np.polynomial.polynomial.polyval
    return float(value * polyval(iso, law) / polyval(end, law))


def _rising(values: np.ndarray) -> np.ndarray:
    """The mean of the tightest rising curves above and below `values` along axis 0; rising input is kept."""
    above = np.maximum.accumulate(values, axis=0)
    below = np.minimum.accumulate(values[::-1], axis=0)[::-1]
    return (above + below) / 2


def _nonnegative_fit(iso: np.ndarray, values: np.ndarray, degree: int, error: float) -> np.ndarray:
    """Polynomial in ISO with coefficients >= 0, weights 1 / hypot(error, RELATIVE_ERROR * model).

    Weights follow the model, not the data: a value that is too small by chance would else count too much.
    """
    scale = float(iso[-1])
    powers = (iso / scale)[:, None] ** np.arange(degree + 1)
    model = np.full(len(iso), max(float(np.max(np.abs(values))), error))
    coefficients = np.zeros(degree + 1)
    for _ in range(_REWEIGHTINGS):
        weight = 1.0 / np.hypot(error, RELATIVE_ERROR * model)
        coefficients, _ = nnls(powers * weight[:, None], values * weight)
        model = powers @ coefficients
    return coefficients / scale ** np.arange(degree + 1)
