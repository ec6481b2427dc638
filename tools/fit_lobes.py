"""Fit the GGX lobes for area lights: python tools/fit_lobes.py (writes src/fsid/render/lobes.npy)

    D(w) = cos(W w) |det W| / (pi |W w|^3),   W = [[a, 0, b], [0, c, 0], [d, 0, 1]] up to scale

is a clamped cosine that W has bent ("linearly transformed cosines", Heitz et al. 2016): its integral over a
polygon is the form factor of the polygon under W. Here W is the one of largest likelihood given directions
that GGX with height-correlated Smith masking reflects, without Fresnel, one cell after the other; Heitz et
al. minimise an L3 norm instead. Frame: x along the viewer's projection, z the normal.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from fsid.render.reflectance import reflected_directions

SIZE = 32
TARGET = Path(__file__).parents[1] / "src" / "fsid" / "render" / "lobes.npy"


def main() -> None:
    table = np.zeros((SIZE, SIZE, 4), np.float32)
    centres = (np.arange(SIZE) + 0.5) / SIZE
    for row in range(SIZE):
        width = float(np.log(0.6 * max(centres[row], 0.05) ** 2 + 0.02))
        start = [width, width, 0.0]
        for column in reversed(range(SIZE)):
            table[row, column], start = fit(centres[row], centres[column], start)
        print(f"roughness {centres[row]:.2f}: {table[row, SIZE // 2]}", flush=True)
    np.save(TARGET, table, allow_pickle=False)


def fit(roughness: float, nv: float, start: list[float]) -> tuple[np.ndarray, list[float]]:
    """(a, b, c, d) of one cell, and where the next search may begin."""
    directions, weights = reflected_directions(roughness, nv)
    weights = weights / weights.sum()
    middle = weights @ directions
    z = np.array([middle[0], 0.0, middle[2]]) / np.hypot(middle[0], middle[2])
    frame = np.stack([np.array([z[2], 0.0, -z[0]]), np.array([0.0, 1.0, 0.0]), z])

    def bend(parameters: np.ndarray) -> np.ndarray:
        m11, m22 = np.exp(parameters[:2])
        return np.linalg.inv(np.array([[m11, 0, parameters[2]], [0, m22, 0], [0, 0, 1.0]])) @ frame

    def cost(parameters: np.ndarray) -> float:
        W = bend(parameters)
        bent = directions @ W.T
        length = np.linalg.norm(bent, axis=1)
        density = np.maximum(bent[:, 2], 0) / length**4 * abs(np.linalg.det(W))
        return float(-weights @ np.log(np.maximum(density, 1e-9)))

    found = minimize(
        cost, start, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-6, "maxiter": 300}
    )
    W = bend(found.x)
    W = W / W[2, 2]
    return np.array([W[0, 0], W[0, 2], W[1, 1], W[2, 0]], np.float32), found.x.tolist()


if __name__ == "__main__":
    main()
