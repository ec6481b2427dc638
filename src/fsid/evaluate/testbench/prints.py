"""Prints: banknote-like guilloches with coins, and a page of a magazine."""

from __future__ import annotations

import numpy as np
from PIL import Image, ImageDraw
from scipy.ndimage import gaussian_filter

from fsid.evaluate.testbench.charts import font, text_line
from fsid.evaluate.testbench.surface import Surface, dye_rand, inside, offsets_around, sheet

SCREEN_ANGLES_DEG = (15.0, 75.0, 0.0, 45.0)
"""Of the C, M, Y and K screens of offset print."""


def banknote_and_coins(rng: np.random.Generator, rows: int, columns: int) -> Surface:
    """Fine line work in two inks, rosettes, large numbers; coins with embossed rims and faces on it."""
    surface = sheet(rows, columns, tuple(0.62 + 0.3 * (dye_rand(rng) - 0.4)))
    x, y = surface.grid
    for _ in range(2):
        ink = tuple(0.5 * dye_rand(rng))
        field = y / rng.uniform(9, 14)
        for _ in range(4):
            period = rng.uniform(0.08, 0.5) * columns
            field = field + rng.uniform(1, 3) * np.sin(
                2 * np.pi * (x / period + rng.uniform(-0.4, 0.4) * y / period)
            )
        surface.put(np.s_[:, :], _lines(field, rng.uniform(0.25, 0.4)), ink)
    for _ in range(3):
        _rosette(rng, surface)
    value = str(int(rng.choice((5, 10, 20, 50, 100, 500))))
    image = Image.new("L", (columns, rows))
    at = (rng.uniform(0, 0.5) * columns, rng.uniform(0, 0.5) * rows)
    ImageDraw.Draw(image).text(at, value, fill=255, font=font("DejaVuSerif-Italic", rows // 3))
    ink = tuple(rng.uniform(0.02, 0.2, 3))
    surface.put(np.s_[:, :], np.asarray(image, np.float32) / 255 * _lines((x + y) / 6, 0.6), ink)
    for _ in range(int(rng.integers(3, 6))):
        _coin(rng, surface)
    return surface


def magazine_page(rng: np.random.Generator, rows: int, columns: int) -> Surface:
    """A landscape in four-colour halftone above columns of small text; glossy paper."""
    surface = sheet(rows, columns, (0.8, 0.8, 0.78))
    split = int(rng.uniform(0.55, 0.7) * rows)
    picture = _landscape_rand(rng, split, columns)
    black = 1 - picture.max(-1, keepdims=True)
    inks = np.concatenate([(1 - picture - black) / np.maximum(1 - black, 1e-3), black], axis=-1)
    x, y = np.arange(columns)[None, :], np.arange(split)[:, None]
    pitch = rng.uniform(6.5, 8.5)
    dots = [_screen(x, y, pitch, angle) for angle in SCREEN_ANGLES_DEG]
    cover = [inside((ink - dot) * pitch) for ink, dot in zip(np.moveaxis(inks, -1, 0), dots, strict=True)]
    passed = [1 - 0.92 * np.maximum(cover[i], cover[3]) for i in range(3)]
    surface.albedo[:split] *= np.stack(passed, axis=-1)
    column = columns // 3
    for left in range(0, columns - column + 1, column):
        top = split + 20
        while top < rows - 30:
            line = text_line(rng, 22, column - 40)[: rows - top]
            surface.put(
                (slice(top, top + len(line)), slice(left + 20, left + column - 20)), line, (0.03,) * 3
            )
            top += 30
    surface.gloss[:] = 0.15
    surface.height += gaussian_filter(rng.normal(size=(rows, columns)), 60).astype(np.float32) * 600
    return surface


def _landscape_rand(rng: np.random.Generator, rows: int, columns: int) -> np.ndarray:
    """(rows, columns, 3) linear: sky, sun, three ridges, and haze between them."""
    y = np.linspace(0, 1, rows)[:, None, None]
    sky = rng.uniform(0.2, 0.6, 3) * (1 - y) + rng.uniform(0.5, 0.95, 3) * y
    image = np.broadcast_to(sky, (rows, columns, 3)).copy()
    clouds = gaussian_filter(rng.normal(size=(rows, columns)), (20, 60))
    image += (np.clip(clouds / clouds.std(), 0, 2) * 0.15)[..., None]
    for layer in range(3):
        ridge = gaussian_filter(rng.normal(size=columns), 40 / (layer + 1), mode="wrap")
        level = rows * (0.45 + 0.15 * layer + 0.06 * ridge / ridge.std())
        texture = gaussian_filter(rng.normal(size=(rows, columns)), 2 + layer)
        colour = rng.uniform(0.05, 0.4, 3) * (1 + 0.3 * texture / texture.std())[..., None]
        cover = inside(np.arange(rows)[:, None] - level[None, :])[..., None]
        image += cover * (colour - image)
    return np.clip(image, 0.02, 0.98)


def _screen(x: np.ndarray, y: np.ndarray, pitch: float, angle_deg: float) -> np.ndarray:
    """Threshold 0..1 of a round-dot screen: a dot covers as much area as the ink that is asked for."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    u, v = (x * c + y * s) / pitch, (y * c - x * s) / pitch
    cell = (np.cos(2 * np.pi * u) + np.cos(2 * np.pi * v)) / 2
    return 0.5 - 0.5 * np.sign(cell) * np.abs(cell) ** 0.8


def _lines(field: np.ndarray, duty: float) -> np.ndarray:
    """Coverage of lines at whole numbers of `field`, `duty` of a period wide."""
    slope = np.hypot(*np.gradient(np.broadcast_to(field, np.broadcast_shapes(field.shape)))) + 1e-6
    distance = np.abs(field - np.round(field))
    return inside((duty / 2 - distance) / slope)


def _rosette(rng: np.random.Generator, surface: Surface) -> None:
    rows, columns = surface.height.shape
    x, y = rng.uniform(0.15, 0.85) * columns, rng.uniform(0.15, 0.85) * rows
    radius = rng.uniform(0.1, 0.22) * columns
    window, dx, dy = offsets_around(surface, x, y, radius)
    r, phase = np.hypot(dx, dy), np.arctan2(dy, dx)
    ink = tuple(rng.uniform(0.02, 0.3, 3))
    for petals in rng.integers(5, 17, 2):
        field = r / rng.uniform(8, 13) + rng.uniform(0.8, 2.0) * np.sin(petals * phase)
        surface.put(window, _lines(field, 0.3) * inside(radius - r), ink)


def _coin(rng: np.random.Generator, surface: Surface) -> None:
    rows, columns = surface.height.shape
    x, y = rng.uniform(0.05, 0.95) * columns, rng.uniform(0.05, 0.95) * rows
    radius = rng.uniform(0.06, 0.11) * columns
    window, dx, dy = offsets_around(surface, x, y, radius + 2)
    r, phase = np.hypot(dx, dy), np.arctan2(dy, dx)
    metal = ((0.55, 0.35, 0.22), (0.6, 0.5, 0.25), (0.5, 0.5, 0.5))[int(rng.integers(3))]
    edge, face = 0.93 * radius, 0.7 * radius
    relief = 3 * inside((r - edge) / 2)
    relief = relief + 2 * np.cos(phase * int(rng.integers(40, 90))) * inside((r - 0.86 * edge) / 3) * (
        r < edge
    )
    size = max(8, int(face))
    image = Image.new("L", (r.shape[1], r.shape[0]))
    corner = (r.shape[1] / 2 - 0.6 * size, r.shape[0] / 2 - 0.7 * size)
    ImageDraw.Draw(image).text(
        corner, str(int(rng.integers(1, 99))), fill=255, font=font("DejaVuSerif", size)
    )
    relief = relief + 4 * gaussian_filter(np.asarray(image, np.float32) / 255, 2.5)
    relief = relief + 1.5 * np.sin(r / rng.uniform(5, 9)) * inside((face - r) / 4)
    wear = gaussian_filter(rng.normal(size=r.shape), 6)
    tone = (1 + 0.15 * wear / (wear.std() + 1e-6))[..., None]
    surface.put(window, inside(radius - r), np.asarray(metal) * tone * 0.7, 14 + relief, 0.5)
