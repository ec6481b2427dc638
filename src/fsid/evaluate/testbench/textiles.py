"""Textiles: patches of coloured weaves, and cards of coloured thread."""

from __future__ import annotations

import numpy as np

from fsid.evaluate.testbench.surface import Surface, dye_rand, sheet

WEAVES = ("plain", "twill", "satin", "rib", "herringbone")


def fabric_patches(rng: np.random.Generator, rows: int, columns: int) -> Surface:
    """A grid of woven patches: warp and weft of two colours, five weaves, 5 to 14 pixels per yarn."""
    surface = sheet(rows, columns, (0.4, 0.4, 0.4))
    across, down = 5, 4
    for i in range(across * down):
        window = (
            slice(i // across * rows // down, (i // across + 1) * rows // down),
            slice(i % across * columns // across, (i % across + 1) * columns // across),
        )
        _weave(rng, surface, window)
    return surface


def threads(rng: np.random.Generator, rows: int, columns: int) -> Surface:
    """Bands of parallel thread, each band of one colour: round yarns with a visible twist."""
    surface = sheet(rows, columns, (0.5, 0.5, 0.5))
    x, y = surface.grid
    left = 0
    while left < columns:
        width = int(rng.uniform(0.05, 0.16) * columns)
        part = (slice(None), slice(left, left + width))
        pitch = rng.uniform(9, 22)
        sway = 3 * np.sin(y / rng.uniform(90, 250) + rng.uniform(0, 6.28))
        u = (x[:, part[1]] - left + sway) / pitch
        across = u - np.floor(u) - 0.5
        yarn = np.floor(u).astype(int)
        shift = rng.uniform(0, 1, yarn.max() - yarn.min() + 1)[yarn - yarn.min()]
        twist = np.cos(2 * np.pi * (y / (2.2 * pitch) + across * 1.3 + shift))
        height = pitch * (np.sqrt(np.maximum(0.25 - across**2, 0)) + 0.05 * twist)
        colour = dye_rand(rng)
        tone = (1 + 0.12 * twist + 0.2 * (shift - 0.5))[..., None]
        cover = np.ones_like(height, dtype=np.float32)
        surface.put(part, cover, np.clip(colour * tone, 0, 0.95), height, float(rng.uniform(0, 0.25)))
        left += width
    return surface


def _weave(rng: np.random.Generator, surface: Surface, window: tuple[slice, slice]) -> None:
    gx, gy = surface.grid
    pitch = rng.uniform(5, 14)
    u, v = np.broadcast_arrays(gx[:, window[1]] / pitch, gy[window[0]] / pitch)
    i, j = np.floor(u).astype(int), np.floor(v).astype(int)
    warp_up = _interlacing(str(rng.choice(WEAVES)), i, j)
    profile_u, profile_v = (np.sqrt(np.maximum(1 - (2 * (t - np.floor(t)) - 1) ** 2, 0)) for t in (u, v))
    bow_u, bow_v = np.sin(np.pi * (u - i)), np.sin(np.pi * (v - j))
    height = 0.25 * pitch * np.where(warp_up, profile_u + 0.6 * bow_v, profile_v + 0.6 * bow_u)
    uneven = rng.normal(1, 0.06, 512)
    first, second = dye_rand(rng), dye_rand(rng)
    if rng.random() < 0.5:
        second = np.clip(first * rng.uniform(0.6, 1.2), 0, 0.9)
    yarn = np.where(warp_up, uneven[i % 512], uneven[(j * 7 + 3) % 512])[..., None]
    colour = np.where(warp_up[..., None], first, second) * yarn
    cover = np.ones(height.shape, np.float32)
    surface.put(window, cover, np.clip(colour, 0.01, 0.95), height, float(rng.choice((0.0, 0.0, 0.2))))


def _interlacing(weave: str, i: np.ndarray, j: np.ndarray) -> np.ndarray:
    """Where the warp lies above the weft."""
    if weave == "plain":
        return (i + j) % 2 == 0
    if weave == "twill":
        return (i + j) % 4 < 2
    if weave == "satin":
        return (i + 3 * j) % 8 != 0
    if weave == "rib":
        return (i // 2 + j) % 2 == 0
    return np.where(i // 8 % 2 == 0, i + j, i - j) % 4 < 2
