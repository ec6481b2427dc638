"""Fit the GGX lobes for area lights: python tools/fit_lobes.py (writes src/fsid/render/lobes.npy)

    D(w) = cos(W w) |det W| / (pi |W w|^3),   W = [[a, 0, b], [0, c, 0], [d, 0, 1]] up to scale

is a clamped cosine that W has bent ("linearly transformed cosines", Heitz et al. 2016): its integral over a
polygon is the form factor of the polygon under W. Here W is the one whose D is nearest to what GGX with
height-correlated Smith masking reflects, without Fresnel: the integral of |D - GGX|^1.5 is least, one cell
after the other. (Heitz et al. have 3 for 1.5: with 3 and 2 the tails are off by more, and with the largest
likelihood the peaks.) Frame: x along the viewer's projection, z the normal.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.optimize import minimize

SIZE = 32
TARGET = Path(__file__).parents[1] / "src" / "fsid" / "render" / "lobes.npy"
POINTS = 1500
POWER = 1.5


def main() -> None:
    table = np.zeros((SIZE, SIZE, 4), np.float32)
    centres = (np.arange(SIZE) + 0.5) / SIZE
    for row in range(SIZE):
        width = float(np.log(0.6 * max(centres[row], 0.05) ** 2 + 0.02))
        start = [width, width, 0.0, 0.0]
        for column in reversed(range(SIZE)):
            table[row, column], start = fit(centres[row], centres[column], start)
        print(f"roughness {centres[row]:.2f}: {table[row, SIZE // 2]}", flush=True)
    np.save(TARGET, table, allow_pickle=False)


def fit(roughness: float, nv: float, start: list[float]) -> tuple[np.ndarray, list[float]]:
    """(a, b, c, d) of one cell, and where the next search may begin."""
    a2, v = max(roughness, 0.05) ** 4, np.array([np.sqrt(1 - nv * nv), 0.0, nv])
    directions, weight = spread(a2, v)
    lobe = ggx(a2, v, directions)
    lobe /= (lobe * weight).sum()
    middle = (lobe * weight) @ directions
    z = np.array([middle[0], 0.0, middle[2]]) / np.hypot(middle[0], middle[2])
    frame = np.stack([np.array([z[2], 0.0, -z[0]]), np.array([0.0, 1.0, 0.0]), z])

    def bend(parameters: np.ndarray) -> np.ndarray:
        m11, m22 = np.exp(parameters[:2])
        cosine, sine = np.cos(parameters[3]), np.sin(parameters[3])
        turned = np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]]) @ frame
        return np.linalg.inv(np.array([[m11, 0, parameters[2]], [0, m22, 0], [0, 0, 1.0]])) @ turned

    def cost(parameters: np.ndarray) -> float:
        W = bend(parameters)
        bent = directions @ W.T
        length = np.linalg.norm(bent, axis=1)
        density = np.maximum(bent[:, 2], 0) / length**4 * abs(np.linalg.det(W)) / np.pi
        return float((np.abs(lobe - density) ** POWER * weight).sum() / (lobe**POWER * weight).sum())

    simplex = np.array(start) + np.concatenate([np.zeros((1, 4)), 0.1 * np.eye(4)])
    options = {"xatol": 1e-3, "fatol": 1e-6, "maxiter": 400, "initial_simplex": simplex}
    found = minimize(cost, start, method="Nelder-Mead", options=options)
    W = bend(found.x)
    W = W / W[2, 2]
    return np.array([W[0, 0], W[0, 2], W[1, 1], W[2, 0]], np.float32), found.x.tolist()


def spread(a2: float, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) directions above the horizon, a third each as dense as the lobe of squared alpha a2, as a wider
    one, and even; (N,) the solid angle that each stands for."""
    u, phi = (np.arange(POINTS) + 0.5) / POINTS, np.arange(POINTS) * np.pi * (3 - np.sqrt(5))
    widths = (a2, min(9 * a2, 1.0))
    around = [ring(np.sqrt((1 - u) / (1 + (width - 1) * u)), phi) for width in widths]
    mirrored = [2 * (half @ v)[:, None] * half - v for half in around]
    directions = np.concatenate([*mirrored, ring(u, phi)])
    directions = directions[directions[:, 2] > 1e-4]
    half = v + directions
    half /= np.linalg.norm(half, axis=1)[:, None]
    slope = half[:, 2] / (4 * np.maximum(half @ v, 1e-6))
    density = 1 / (2 * np.pi) + sum(facets(width, half[:, 2]) * slope for width in widths)
    return directions, 1 / (density * POINTS)


def ring(cosine: np.ndarray, phi: np.ndarray) -> np.ndarray:
    """(N, 3) unit vectors."""
    sine = np.sqrt(np.maximum(1 - cosine * cosine, 0))
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), cosine], axis=1)


def facets(a2: float, nh: np.ndarray) -> np.ndarray:
    """GGX's density of microfacets."""
    return np.asarray(a2 / (np.pi * (nh * nh * (a2 - 1) + 1) ** 2))


def ggx(a2: float, v: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(N,) what comes to v from each direction, up to scale."""
    half = v + directions
    half /= np.linalg.norm(half, axis=1)[:, None]
    nl, nv = directions[:, 2], v[2]
    masking = nl * np.sqrt(nv * nv * (1 - a2) + a2) + nv * np.sqrt(nl * nl * (1 - a2) + a2)
    return np.asarray(facets(a2, half[:, 2]) * nl / masking)


if __name__ == "__main__":
    main()
