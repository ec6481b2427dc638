"""Printed surfaces: text, charts, wallpaper, stripes, halftone, guilloche. The sharpest edges there are."""

from __future__ import annotations

import numpy as np
from PIL import ImageDraw

from fsid.assets.material_registry import Layers, material_family
from fsid.assets.patterns import Draw, axes, edge, ink, level, noise, warp
from fsid.assets.typeset import averaged, canvas, paragraph, pen, script_rand


def _paper(rng: np.random.Generator, size: int) -> tuple[np.ndarray, np.ndarray]:
    """(fibres, ageing) of paper, mean 0, variance 1."""
    return noise(rng, size, 0.6, low=size / 30, high=size / 5), noise(rng, size, 1.8)


def _on_paper(rng: np.random.Generator, size: int, printed: np.ndarray, gloss: float) -> Layers:
    """`printed` 0..1 in colour_c on aged paper; ink coverage varies a little."""
    fibre, age = _paper(rng, size)
    return Layers(
        mix=0.5 * level(age),
        pattern=np.clip(printed * (0.97 + 0.01 * fibre), 0, 1),
        detail=0.5 + 0.008 * fibre + 0.015 * age,
        roughness=gloss + 0.04 * fibre - 0.05 * printed,
        height=0.5 + 0.1 * fibre + 0.05 * age,
    )


@material_family("printed_text", tile_m=0.25, relief_m=0.0001, colours="f1ece0 e2d9c4 1d1b1a")
def printed_text(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Columns of text in many fonts, scripts and sizes, with headings and rules. Variant: columns."""
    image, draw = canvas(size)
    wide, columns = 2 * size, (1, 2, 3, 4)[variant]
    for column in range(columns):
        left, right = (column + 0.06) * wide / columns, (column + 0.94) * wide / columns
        top = 0.02 * wide
        while top < 0.97 * wide:
            script = script_rand(rng)
            points = wide * rng.choice((0.008, 0.011, 0.014, 0.02, 0.045), p=(0.25, 0.3, 0.25, 0.12, 0.08))
            lines = 1.3 * points * (1 if points > wide * 0.03 else int(rng.integers(2, 9)))
            bottom = min(top + lines + 0.1 * points, 0.99 * wide)
            top = max(paragraph(rng, draw, (left, top, right, bottom), points, 255, script), top + points)
            if rng.random() < 0.15:
                draw.line((left, top, right, top), fill=255, width=pen(size, int(rng.integers(1, 6))))
            top += points * rng.uniform(0.2, 1.2)
    return _on_paper(rng, size, averaged(image), 0.75)


@material_family("test_chart", tile_m=0.4, relief_m=0.0001)
def test_chart(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Checkers of falling size, bars of rising frequency, Siemens stars, zone plates."""
    u, v = axes(size)
    if variant == 0:
        fine = 2.0 ** np.floor(2 + 6 * np.abs(2 * v - 1)) * np.ones_like(u)
        printed = ((np.floor(u * fine) + np.floor(v * fine)) % 2).astype(np.float32)
    elif variant == 1:
        x, y = u * 4 % 1, v * 4 % 1
        block = (np.floor(u * 4) + 4 * np.floor(v * 4)).astype(int)
        frequency = rng.choice((3, 5, 8, 12, 20, 32, 48, 64), 16)[block]
        phase = np.where(rng.random(16)[block] < 0.5, x, y) * frequency
        frame = np.maximum(np.abs(x - 0.5), np.abs(y - 0.5)) < 0.46
        printed = edge(np.cos(2 * np.pi * phase), 0, 0.15 + 6.3 * frequency * 4 / size) * frame
    elif variant == 2:
        count = 3
        x, y = u * count % 1 - 0.5, v * count % 1 - 0.5
        spokes = np.array((24, 36, 48, 72, 18, 60, 30, 42, 90))[
            (np.floor(u * count) + count * np.floor(v * count)).astype(int)
        ]
        radius = np.hypot(x, y)
        wave = np.cos(spokes * np.arctan2(y, x))
        printed = edge(wave, 0, 0.1 + spokes * count / (size * radius + 1)) * (radius < 0.46)
    else:
        x, y = u * 2 % 1 - 0.5, v * 2 % 1 - 0.5
        reach = np.array((60.0, 110.0, 180.0, 260.0))[(np.floor(u * 2) + 2 * np.floor(v * 2)).astype(int)]
        shown = 1 - edge(reach * np.hypot(x, y) * 4 / size, 0.42, 0.16)  # of cycles per texel, up to a half
        printed = 0.5 + 0.5 * shown * np.cos(np.pi * reach * (x * x + y * y) * 2)
    return _on_paper(rng, size, printed, 0.5)


@material_family("wallpaper", tile_m=0.6, relief_m=0.0006)
def wallpaper(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Two layers of rotation-symmetric flowers on a half-drop lattice, over pinstripes, embossed."""
    wide, count = size * 2, (4, 6, 8, 2)[variant]

    def flowers(dx: float, dy: float, scale: float) -> list[Draw]:
        petals, bends = int(rng.integers(3, 9)), rng.uniform(0.15, 0.6, 3)
        angle = np.linspace(0, 2 * np.pi, 240)
        radius = 1 + bends[0] * np.cos(petals * angle) + bends[1] * 0.5 * np.cos(2 * petals * angle)
        radius *= scale * wide / count * 0.3 / radius.max()
        shape = np.c_[radius * np.cos(angle), radius * np.sin(angle)]

        def mark(cx: float, cy: float) -> Draw:
            def draw_one(draw: ImageDraw.ImageDraw, x: float, y: float) -> None:
                for shrink, fill in ((1.0, 255), (0.72, 60), (0.5, 255), (0.22, 0)):
                    draw.polygon((shape * shrink + (cx + x, cy + y)).ravel().tolist(), fill=fill)

            return draw_one

        return [
            mark((i + dx) * wide / count, (j + dy + 0.5 * (i % 2)) * wide / count)
            for i in range(count)
            for j in range(count)
        ]

    big, small = ink(size, flowers(0.25, 0.25, 1.3)), ink(size, flowers(0.75, 0.5, 0.6))
    u, _ = axes(size)
    stripe = edge(np.cos(2 * np.pi * u * count * int(rng.integers(4, 12))), 0.6, 0.4)
    fibre, age = _paper(rng, size)
    return Layers(
        mix=np.clip(0.45 * stripe + 0.85 * small + 0.08 * age, 0, 1),
        pattern=0.9 * big,
        detail=0.5 + 0.02 * fibre + 0.015 * age,
        roughness=0.7 - 0.3 * big + 0.03 * fibre,
        height=0.3 + 0.35 * big + 0.25 * small + 0.05 * fibre,
    )


@material_family("stripes", tile_m=0.5, relief_m=0.0003)
def stripes(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Stripes of random widths down to a few texels; wavy for variant 2, chevrons for 3."""
    u, v = axes(size)
    shift = (
        np.float32(0) * v,
        np.float32(0) * v,
        0.03 * np.sin(2 * np.pi * 3 * v) + 0.01 * np.sin(2 * np.pi * 8 * v),
        np.abs((v * 6) % 1 - 0.5) / 6,
    )[variant]
    count = (24, 70, 30, 40)[variant]
    starts = np.sort(rng.random(count))
    band = np.searchsorted(starts, (u + shift) % 1.0) % count
    fibre, age = _paper(rng, size)
    return Layers(
        mix=np.clip(rng.random(count)[band] + 0.05 * age, 0, 1),
        pattern=(rng.random(count)[band] > 0.6) * 0.95,
        detail=0.5 + 0.02 * fibre + 0.02 * age,
        roughness=0.55 + 0.05 * fibre,
        height=0.5 + 0.1 * fibre,
    )


@material_family("halftone", tile_m=0.3, relief_m=0.0001)
def halftone(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """A blurry picture in two inks through rotated dot screens, as in a magazine."""
    u, v = axes(size)
    screen = (40, 64, 96, 128)[variant]

    def dots(p: int, q: int, tone: np.ndarray) -> np.ndarray:
        wave = np.cos(2 * np.pi * (p * u + q * v)) + np.cos(2 * np.pi * (p * v - q * u))
        return edge(wave / 2, 1 - 2 * tone, 0.25 + 4.0 * screen / size)

    picture = np.sign(noise(rng, size, 2.0, low=2)) * 0.3 + noise(rng, size, 1.8)
    other = warp(noise(rng, size, 2.2), 0.05 * picture, 0)
    first = dots(screen, screen // 4, level(picture, 1.2))
    second = dots(screen, -screen // 3, level(other, 1.2))
    layers = _on_paper(rng, size, 0.9 * first, 0.35)
    return layers._replace(mix=np.clip(second, 0, 1))


@material_family("guilloche", tile_m=0.12, relief_m=0.0001)
def guilloche(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Banknote-like line work: families of thin lines whose phase is a sum of sines, and rosettes."""
    u, v = axes(size)

    def lines(count: int, horizontal: bool) -> np.ndarray:
        a, b = (u, v) if horizontal else (v, u)
        wave = sum(
            rng.uniform(0.3, 1.6)
            / k
            * np.sin(2 * np.pi * (k * a + int(rng.integers(-2, 3)) * b + rng.random()))
            for k in (1, 2, 3, 5)
        )
        phase = count * b + wave * rng.uniform(0.5, 2)
        return edge(np.abs(phase % 1 - 0.5), 0.36, 0.12 + 2.0 * count / size)

    density = (24, 36, 48, 64)[variant]
    first = lines(density, True)
    second = lines(density + int(rng.integers(3, 9)), True)
    third = lines(density // 2, False)
    x, y = u * 2 % 1 - 0.5, v * 2 % 1 - 0.5
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    petals = np.cos(2 * np.pi * (radius * density / 2 + 0.9 * np.cos(12 * angle) * radius))
    rosette = edge(petals, 0.4, 0.5) * (radius < 0.42)
    layers = _on_paper(rng, size, np.maximum(first, np.where(radius < 0.42, rosette, second * 0.8)), 0.7)
    return layers._replace(mix=np.clip(0.9 * third, 0, 1))
