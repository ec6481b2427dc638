"""The formulas as the papers print them, in plain NumPy: reference of the tests and of bench/sensor.py."""

from __future__ import annotations

import numpy as np

from fsid.sensor import NoiseLevel


def site_map(values: tuple[float, ...], cfa: str, shape: tuple[int, ...]) -> np.ndarray:
    """A value per pixel from one per site R, Gr, Gb, B."""
    out = np.empty(shape)
    red_row = cfa.index("R") // 2
    for r in (0, 1):
        for c in (0, 1):
            colour = cfa[2 * r + c]
            site = {"R": 0, "B": 3}.get(colour, 1 if r == red_row else 2)
            out[r::2, c::2] = values[site]
    return out


def noise(rng: np.random.Generator, x: np.ndarray, level: NoiseLevel, cfa: str) -> np.ndarray:
    """y = x + sqrt(k x + sigma2) n."""
    k, sigma2 = site_map(level.k, cfa, x.shape), site_map(level.sigma2, cfa, x.shape)
    return x + np.sqrt(k * np.maximum(x, 0) + sigma2) * rng.normal(size=x.shape)


def unprocess(srgb: np.ndarray, matrix: np.ndarray, white_balance: tuple[float, float, float]) -> np.ndarray:
    """Brooks et al. 2019, sections 3.1 to 3.4, for the matrix linear sRGB -> camera."""
    v = 0.5 - np.sin(np.arcsin(1 - 2 * srgb) / 3)
    linear = np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
    camera = np.einsum("ij,hwj->hwi", matrix, linear)
    gains = 1 / np.array(white_balance)
    white = (np.maximum(camera.mean(axis=-1, keepdims=True) - 0.9, 0) / 0.1) ** 2
    return np.clip(camera * np.maximum(white + (1 - white) * gains, gains), 0, 1)


def pack(mosaic: np.ndarray, cfa: str) -> np.ndarray:
    """R, Gr, Gb, B planes, pixel by pixel of the tile."""
    planes = np.zeros((4, mosaic.shape[0] // 2, mosaic.shape[1] // 2))
    names = site_map((0.0, 1.0, 2.0, 3.0), cfa, mosaic.shape)
    for site in range(4):
        planes[site] = mosaic[names == site].reshape(planes[site].shape)
    return planes
