"""Plants: an artificial flower of glossy plastic, and a heap of leaves."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from fsid.evaluate.testbench.surface import Surface, dye_rand, inside, offsets_around, sheet, window_around


def plastic_flower(rng: np.random.Generator, rows: int, columns: int) -> Surface:
    """Rings of domed petals with a colour gradient around a studded centre, leaves below; glossy."""
    surface = sheet(rows, columns, tuple(dye_rand(rng)))
    x, y = columns * rng.uniform(0.4, 0.6), rows * rng.uniform(0.4, 0.6)
    size = 0.45 * rows
    for _ in range(7):
        _leaf(rng, surface, x, y, rng.uniform(0, 360), size * rng.uniform(0.9, 1.3), gloss=0.4)
    inner, outer = dye_rand(rng), dye_rand(rng)
    for ring in range(4):
        length = size * (1 - 0.2 * ring)
        petals = int(rng.integers(6, 11))
        for n in range(petals):
            angle = 360 / petals * (n + 0.5 * ring) + rng.normal(0, 4)
            _petal(rng, surface, x, y, angle, length, inner, outer, 20.0 + 16 * ring)
    for n in range(90):
        r, phase = 0.018 * size * np.sqrt(n), n * 2.39996
        window = window_around(surface, x + r * np.cos(phase), y + r * np.sin(phase), 14)
        gx, gy = surface.grid
        d = np.hypot(gx[:, window[1]] - x - r * np.cos(phase), gy[window[0]] - y - r * np.sin(phase))
        bead = 90 + np.sqrt(np.maximum(100 - d**2, 0))
        surface.put(window, inside(10 - d), (0.7, 0.5, 0.08), bead, 0.5)
    return surface


def plant_leaves(rng: np.random.Generator, rows: int, columns: int) -> Surface:
    """Sixty overlapping leaves with veins, from yellow-green to dark green, a few turning red."""
    surface = sheet(rows, columns, (0.05, 0.04, 0.03))
    for n in range(60):
        x, y = rng.uniform(-0.05, 1.05) * columns, rng.uniform(-0.05, 1.05) * rows
        _leaf(
            rng,
            surface,
            x,
            y,
            rng.uniform(0, 360),
            columns * rng.uniform(0.12, 0.4),
            base=0.8 * n,
            gloss=0.12,
        )
    return surface


def _leaf(
    rng: np.random.Generator,
    surface: Surface,
    x: float,
    y: float,
    angle_deg: float,
    length: float,
    *,
    base: float = 0.0,
    gloss: float,
) -> None:
    window, along, across = _frame(surface, x, y, angle_deg, length)
    if not along.size:
        return
    t = np.clip(along / length, 1e-4, 1 - 1e-4)
    width = rng.uniform(0.14, 0.3) * length
    teeth = 1 + rng.uniform(0, 0.08) * np.sin(t * rng.uniform(40, 120))
    half = width * (4 * t * (1 - t)) ** rng.uniform(0.55, 0.9) * (1.25 - 0.5 * t) * teeth
    cover = inside(np.minimum(half - np.abs(across), np.minimum(along, length - along)))
    side = t * rng.uniform(9, 16) - np.abs(across) / width * rng.uniform(1.5, 3.0)
    vein = np.exp(-((side - np.round(side)) ** 2) / 0.006) * (1 - np.abs(across) / (half + 1))
    middle = np.exp(-((across / (0.02 * length)) ** 2))
    green = np.array([rng.uniform(0.04, 0.25), rng.uniform(0.12, 0.4), rng.uniform(0.01, 0.08)])
    if rng.random() < 0.12:
        green = np.array([rng.uniform(0.25, 0.5), rng.uniform(0.03, 0.15), 0.03])
    mottle = gaussian_filter(rng.normal(size=along.shape), 5)
    tone = 1 + 0.1 * mottle / (mottle.std() + 1e-6) + 0.35 * np.maximum(vein, middle)
    curl = rng.uniform(0.2, 0.8)
    height = 10 + base + curl * np.abs(across) + 1.5 * vein + 20 * np.sin(np.pi * t) * rng.uniform(0.2, 1)
    surface.put(window, cover, np.clip(green * tone[..., None], 0.005, 0.9), height, gloss)


def _petal(
    rng: np.random.Generator,
    surface: Surface,
    x: float,
    y: float,
    angle_deg: float,
    length: float,
    inner: np.ndarray,
    outer: np.ndarray,
    base: float,
) -> None:
    window, along, across = _frame(surface, x, y, angle_deg, length)
    if not along.size:
        return
    t = np.clip(along / length, 1e-4, 1 - 1e-4)
    half = 0.24 * length * (t * (1 - t**3)) ** 0.5 * 1.6
    cover = inside(np.minimum(half - np.abs(across), np.minimum(along, length - along)))
    streak = 1 + 0.08 * np.sin(across / (0.012 * length))
    colour = (inner + (outer - inner) * t[..., None]) * streak[..., None]
    dome = 0.5 * np.sqrt(np.maximum(half**2 - across**2, 0)) + 12 * np.sin(np.pi * t) * rng.uniform(0.7, 1.3)
    surface.put(window, cover, np.clip(colour, 0.01, 0.95), base + dome, 0.35)


def _frame(
    surface: Surface, x: float, y: float, angle_deg: float, length: float
) -> tuple[tuple[slice, slice], np.ndarray, np.ndarray]:
    """The window that a leaf of `length` from (x, y) needs, and pixels along and across its axis in it."""
    window, dx, dy = offsets_around(surface, x, y, length + 2)
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return window, dx * c + dy * s, dy * c - dx * s
