"""Fit the angle over its sine for area lights: python tools/fit_arc.py (prints `arc` of shaders/lights.glsl)

    arccos(c) / sqrt(1 - c^2) = (a0 + a1 c + a2 c^2) / (1 + b1 c + b2 c^2),   0 <= c <= 1,   exact at c = 1

with the least greatest relative error, by least squares whose weights grow where the error is large (Lawson
1961). An edge of a light is seen under this angle. The fraction takes the place of an arc tangent.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

ROUNDS = 200


def main() -> None:
    cosine = np.cos(np.linspace(1e-4, np.pi / 2, 4000))
    exact = np.arccos(cosine) / np.sqrt(1 - cosine**2)
    weight, found = np.ones_like(cosine), np.array([np.pi / 2, 1.0, 0.1, 1.0])

    def error(numbers: np.ndarray, weight: np.ndarray | float = 1.0) -> np.ndarray:
        return np.asarray(weight * (arc(numbers, cosine) / exact - 1))

    for _ in range(ROUNDS):
        tight = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}
        found = least_squares(error, found, args=(weight,), **tight).x
        off = np.abs(error(found))
        weight *= np.sqrt(off / off.max() + 0.3)
        weight /= weight.max()
    a0, a1, a2, b1 = found
    print(f"a {a0:.8f} {a1:.8f} {a2:.8f}, b {b1:.8f} {a0 + a1 + a2 - 1 - b1:.8f}: off by {off.max():.1e}")


def arc(numbers: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """The fraction; b2 makes it 1 at 1."""
    a0, a1, a2, b1 = numbers
    b2 = a0 + a1 + a2 - 1 - b1
    return np.asarray((a0 + cosine * (a1 + cosine * a2)) / (1 + cosine * (b1 + cosine * b2)))


if __name__ == "__main__":
    main()
