"""Charts: Siemens stars, bar groups, a colour checker, and a page of text."""

from __future__ import annotations

from functools import cache
from importlib.resources import as_file, files

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from fsid.evaluate.testbench.surface import Surface, dye_rand, inside, offsets_around, sheet
from fsid.sensor import srgb_decode

PAPER = (0.82, 0.81, 0.78)
INK = (0.03, 0.03, 0.035)

CHECKER_SRGB = (
    "735244 c29682 627a9d 576c43 8580b1 67bdaa d67e2c 505ba6 c15a63 5e3c6c 9dbc40 e0a32e "
    "383d96 469449 af363c e7c71f bb5695 0885a1 f3f3f2 c8c8c8 a0a0a0 7a7a79 555555 343434"
)
"""The 24 patches of the classic colour checker in sRGB, hexadecimal (published averages, BabelColor)."""

FONTS = (
    "DejaVuSans",
    "DejaVuSans-Bold",
    "DejaVuSerif",
    "DejaVuSerif-Italic",
    "DejaVuSansMono",
    "STIXGeneral",
)
ALPHABETS = (
    "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ",
    "0123456789.,:;%+-=/()",
    "абвгдежзиклмнопрстуфхцчшщъыьэюяАБВГДЕЖЗ",
    "αβγδεζηθικλμνξοπρστυφχψωΑΒΓΔΘΛΞΠΣΦΨΩ",
)


def star_chart(rng: np.random.Generator, rows: int, columns: int) -> Surface:
    """Siemens stars of 24 to 144 cycles, black and coloured, on paper."""
    surface = sheet(rows, columns, PAPER)
    across = 3
    step = columns / across
    for i in range(across * int(np.ceil(rows / step))):
        x, y = (i % across + 0.5) * step, (i // across + 0.5) * step
        cycles = int(rng.choice((24, 36, 72, 144)))
        dark = INK if rng.random() < 0.5 else tuple(dye_rand(rng))
        radius = 0.46 * step
        window, dx, dy = offsets_around(surface, x, y, radius + 2)
        r, phase = np.hypot(dx, dy), np.arctan2(dy, dx)
        wedge = np.clip(0.5 + np.sin(cycles * phase) * r / cycles, 0, 1)
        surface.put(window, (inside(radius - r) * wedge).astype(np.float32), dark)
    return surface


def bar_chart(rng: np.random.Generator, rows: int, columns: int) -> Surface:
    """Groups of three bars along both axes, from 40 down to 2 pixels per bar (as in USAF 1951)."""
    surface = sheet(rows, columns, PAPER)
    x, y = surface.grid
    top = 0.04 * rows
    while top < rows:
        left, row_height = 0.04 * columns, 0.0
        width = float(rng.uniform(26, 40))
        dark = INK if rng.random() < 0.6 else tuple(dye_rand(rng))
        while left < columns and width > 2:
            for vertical in (True, False):
                a, b = (x - left, y - top) if vertical else (y - top, x - left)
                bars = sum(_stripe(a, 2 * n * width, width) for n in range(3)) * _stripe(b, 0, 5 * width)
                surface.put(np.s_[:, :], np.asarray(bars, np.float32), dark)
                left += 6.5 * width
            row_height = max(row_height, 6.5 * width)
            width *= 2 ** (-1 / 3)
        top += row_height
    return surface


def colour_checker(rng: np.random.Generator, rows: int, columns: int) -> Surface:
    """The 24 known patches in random order, and a band of 12 random colours."""
    surface = sheet(rows, columns, (0.035, 0.035, 0.035))
    known = [[int(code[i : i + 2], 16) / 255 for i in (0, 2, 4)] for code in CHECKER_SRGB.split()]
    patches = [*srgb_decode(np.array(known))[rng.permutation(24)], *rng.uniform(0.02, 0.9, (12, 3))]
    across = 6
    step_x, step_y = columns / across, rows / (len(patches) // across)
    x, y = surface.grid
    for i, colour in enumerate(patches):
        left, top = (i % across + 0.08) * step_x, (i // across + 0.08) * step_y
        cover = _stripe(x - left, 0, 0.84 * step_x) * _stripe(y - top, 0, 0.84 * step_y)
        surface.put(np.s_[:, :], cover, tuple(colour))
    return surface


def text_page(rng: np.random.Generator, rows: int, columns: int) -> Surface:
    """Lines of random words in many sizes, fonts and scripts, dark on light and light on dark."""
    surface = sheet(rows, columns, PAPER)
    top = 8
    while top < rows:
        size = int(np.exp(rng.uniform(np.log(11), np.log(110))))
        cover = text_line(rng, size, columns - 40)[: rows - top]
        block = (slice(top, top + len(cover)), slice(20, 20 + cover.shape[1]))
        ink, paper = (INK, tuple(rng.uniform(0.5, 0.9, 3)))
        if rng.random() < 0.25:
            ink, paper = paper, tuple(rng.uniform(0.02, 0.15, 3))
        if rng.random() < 0.4:
            surface.put(block, np.ones_like(cover), paper)
        surface.put(block, cover, ink)
        top += int(1.25 * size)
    return surface


def text_line(rng: np.random.Generator, size_px: int, width_px: int) -> np.ndarray:
    """Coverage (about 1.2 size, width) of a line of random words."""
    face = font(str(rng.choice(FONTS)), size_px)
    letters = list(ALPHABETS[int(rng.choice(len(ALPHABETS), p=(0.5, 0.2, 0.15, 0.15)))])
    count = 2 + int(2.5 * width_px / size_px)
    words = ["".join(rng.choice(letters, int(rng.integers(1, 10)))) for _ in range(max(1, count // 5))]
    image = Image.new("L", (width_px, int(1.2 * size_px) + 2))
    ImageDraw.Draw(image).text((2, 0), " ".join(words), fill=255, font=face)
    return np.asarray(image, np.float32) / 255


@cache
def font(name: str, size_px: int) -> ImageFont.FreeTypeFont:
    """A font that comes with matplotlib."""
    with as_file(files("matplotlib").joinpath(f"mpl-data/fonts/ttf/{name}.ttf")) as file:
        return ImageFont.truetype(str(file), size_px)


def _stripe(at: np.ndarray, start: float, width: float) -> np.ndarray:
    """Coverage of pixels at `at` by start <= x < start + width."""
    low, high = np.maximum(at - 0.5, start), np.minimum(at + 0.5, start + width)
    return np.clip(high - low, 0.0, 1.0).astype(np.float32)
