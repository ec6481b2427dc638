"""Full-colour prints and screens: magazines, packaging, paintings, colour charts, displays, comics.

Drawn as pictures and turned into masks by the triangle of `fsid.assets.triangle`: many hues on one surface.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from PIL import Image, ImageDraw

from fsid.assets.material_registry import Layers, material_family, pictured
from fsid.assets.patterns import axes, cells, edge, noise, warp
from fsid.assets.pictures import hue_rand, picture_rand
from fsid.assets.streams import branch
from fsid.assets.typeset import averaged, canvas, fitted, font_rand, paragraph, script_rand, words_rand


def _colour(rgb: np.ndarray) -> tuple[int, int, int]:
    r, g, b = (int(c) for c in np.clip(rgb, 0, 1) * 255)
    return r, g, b


def _paste(image: Image.Image, picture: np.ndarray, left: float, top: float) -> None:
    image.paste(Image.fromarray(np.uint8(picture * 255)), (int(left), int(top)))


def _doubled(rng: np.random.Generator, high: float, wide: float) -> np.ndarray:
    """A picture of the texels below so many pixels of a canvas."""
    return picture_rand(rng, int(high) // 2, int(wide) // 2).repeat(2, 0).repeat(2, 1)


def _mirrored(quarter: np.ndarray) -> np.ndarray:
    """A picture and its mirror images: tileable."""
    half = np.concatenate([quarter, quarter[:, ::-1]], axis=1)
    return np.concatenate([half, half[::-1]])


def _printed(rng: np.random.Generator, rgb: np.ndarray, gloss: float) -> Layers:
    """A print (S, S, 3) on coated paper that waves a little."""
    size = len(rgb)
    wave, fibre = noise(rng, size, 2.2), noise(rng, size, 0.6, low=size / 30, high=size / 5)
    layers = pictured(np.clip(rgb * (1 + 0.012 * wave + 0.006 * fibre)[..., None], 0, 1))
    return layers._replace(roughness=gloss + 0.03 * fibre, height=0.5 + 0.12 * wave + 0.03 * fibre)


@material_family("magazine", tile_m=0.45, relief_m=0.0006, colours="picture")
def magazine(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Pages of pictures, headlines and columns on tinted ground. Variant: pages per side."""
    image, draw = canvas(size, (245, 243, 238))
    pages = (1, 2, 2, 3)[variant]
    step = 2 * size / pages
    for i in range(pages):
        for j in range(pages):
            left, top = i * step, j * step
            paper = _colour(0.75 + 0.25 * hue_rand(rng, rng.uniform(0, 0.5), 1.0))
            draw.rectangle((left, top, left + step, top + step), fill=paper)
            ink = _colour(hue_rand(rng, rng.uniform(0, 0.9), rng.uniform(0.05, 0.4)))
            high, wide = step * rng.uniform(0.3, 0.65), step * rng.uniform(0.55, 0.94)
            x, y = left + rng.uniform(0.03, 0.97) * (step - wide), top + 0.04 * step
            _paste(image, _doubled(rng, high, wide), x, y)
            script, y = script_rand(rng), y + high + 0.02 * step
            points = step * rng.uniform(0.04, 0.09)
            face = font_rand(rng, script, points)
            title = fitted(words_rand(rng, script, 4), face, 0.92 * step)
            face.write(draw, (left + 0.04 * step, y), title, ink)
            columns = int(rng.integers(1, 4))
            for k in range(columns):
                x = left + (0.04 + 0.92 * k / columns) * step
                box = (x, y + 1.4 * points, x + 0.86 * step / columns, top + 0.97 * step)
                paragraph(rng, draw, box, max(0.016 * step, 0.018 * size), ink, script)
    return _printed(rng, averaged(image), 0.32)


@material_family("packaging", tile_m=0.3, relief_m=0.0005, colours="picture")
def packaging(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Labels of boxes, cans and bottles: saturated fields, stripes, discs, big letters, small print."""
    image, draw = canvas(size, _colour(hue_rand(rng, 0.8, 0.8)))
    count = (1, 2, 3, 4)[variant]
    pitch = 2 * size / count
    step = 0.97 * pitch
    for i in range(count):
        for j in range(count):
            left, top = (i + 0.015) * pitch, (j + 0.015) * pitch
            ground, accent = hue_rand(rng, rng.uniform(0.2, 1), rng.uniform(0.3, 1)), hue_rand(rng, 0.8, 0.9)
            draw.rectangle((left, top, left + step, top + step), fill=_colour(ground))
            for _ in range(int(rng.integers(2, 7))):
                y, tall = top + rng.uniform(0, 0.9) * step, step * rng.uniform(0.01, 0.12)
                tone = _colour(accent * rng.uniform(0.5, 1.1))
                draw.rectangle((left, y, left + step, min(y + tall, top + step)), fill=tone)
            side = step * rng.uniform(0.25, 0.45)
            x, y = left + rng.uniform(0.05, 0.5) * step, top + rng.uniform(0.3, 0.5) * step
            if rng.random() < 0.6:
                _paste(image, picture_rand(rng, int(side) // 2, int(side)).repeat(2, 0), x, y)
            else:
                draw.ellipse((x, y, x + side, y + side), fill=_colour(hue_rand(rng, 0.9, 0.95)))
            script, points = script_rand(rng), step * rng.uniform(0.1, 0.2)
            light = (250, 248, 240) if ground.mean() < 0.6 else (25, 20, 20)
            for k, share in enumerate((1.0, 0.4)):
                face = font_rand(rng, script, points * share)
                text = fitted(words_rand(rng, script, 3), face, 0.9 * step)
                at = (left + 0.05 * step, top + 0.05 * step + 1.2 * k * points)
                face.write(draw, at, text, light)
            box = (left + 0.05 * step, top + 0.86 * step, left + 0.95 * step, top + 0.98 * step)
            paragraph(rng, draw, box, max(0.018 * step, 0.016 * size), light, script)
    return _printed(rng, averaged(image), (0.25, 0.4, 0.3, 0.5)[variant])


@material_family("painting", tile_m=0.8, relief_m=0.0015, colours="picture")
def painting(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """A picture in strokes of a brush, smeared along its own contours, with impasto and canvas."""
    kind = ("landscape", "blossoms", "still life", "abstract")[variant]
    picture = _mirrored(picture_rand(rng, size // 2, size // 2, kind))
    strokes = noise(rng, size, 0.9, low=12, stretch=(6, 1))
    other = noise(rng, size, 0.9, low=12, stretch=(1, 6))
    turn = noise(rng, size, 2.0, low=2, high=12) > 0
    bristle = np.where(turn, strokes, other)
    du, dv = np.where(turn, 0.014, 0.003) * strokes, np.where(turn, 0.003, 0.014) * other
    smeared = np.stack([warp(picture[..., k], du, dv) for k in range(3)], axis=-1)
    u, v = axes(size)
    threads = np.cos(2 * np.pi * 128 * u) * np.cos(2 * np.pi * 128 * v) * (size > 256)  # finer ones are grey
    rgb = smeared * (1 + 0.05 * bristle + 0.015 * threads)[..., None]
    layers = pictured(np.clip(rgb, 0, 1))
    return layers._replace(
        roughness=0.4 + 0.05 * bristle, height=np.clip(0.5 + 0.12 * bristle + 0.04 * threads, 0, 1)
    )


@material_family("colour_chart", tile_m=0.4, relief_m=0.0004, colours="picture")
def colour_chart(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Cards of flat patches: random hues, hue by lightness, grey wedges, swatches with labels."""
    image, draw = canvas(size, (30, 30, 30) if variant % 2 == 0 else (235, 235, 232))
    wide, count = 2 * size, (6, 12, 9, 20)[variant]
    step = wide / count
    gap = step * (0.08, 0.05, 0.15, 0.06)[variant]
    hues = [hue_rand(rng, 0.9, 1.0) for _ in range(count)]
    for j in range(count):
        for i in range(count):
            if variant == 1:
                tone = hues[i] * (1 - 0.9 * j / count) * (1 - 0.2 * (j % 4)) + 0.15 * (j % 4)
            elif j % 3 == 2:
                tone = np.full(3, (i + 0.5) / count)
            else:
                tone = hue_rand(rng, rng.beta(1.2, 1.2), rng.uniform(0.08, 1))
            x, y = i * step + gap, j * step + gap
            draw.rectangle((x, y, x + step - 2 * gap, y + step - 2 * gap), fill=_colour(tone))
            if variant == 2:
                box = (x + 0.04 * step, y + step * 0.55, x + step - 3 * gap, y + step - 2 * gap)
                draw.rectangle(box, fill=(240, 240, 238))
                paragraph(rng, draw, box, 0.07 * step, (40, 40, 40), "latin")
    return _printed(rng, averaged(image), 0.7)


@material_family("comic", tile_m=0.4, relief_m=0.0003, colours="picture")
def comic(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Panels with flat colours, black outlines, dot screens and lettering."""
    image, draw = canvas(size, (248, 246, 235))
    wide, rows = 2 * size, (2, 3, 3, 4)[variant]
    gap, pen, pitch = 0.006 * wide, max(1, round(wide / 250)), wide / 204.8
    for row in range(rows):
        cuts = np.r_[0, np.cumsum(rng.dirichlet(np.full(rng.integers(1, 4), 4.0)))] * wide
        for left, right in pairwise(cuts):
            box = (left + gap, row * wide / rows + gap, right - gap, (row + 1) * wide / rows - gap)
            high, across = int(box[3] - box[1]), int(box[2] - box[0])
            if across < 10 * gap:
                continue
            picture = picture_rand(rng, max(high // 4, 8), max(across // 4, 8))
            flat = np.round(picture * 4) / 4
            small = Image.fromarray(np.uint8(flat * 255))
            panel = np.asarray(small.resize((across, high), Image.Resampling.NEAREST))
            y, x = (np.mgrid[0:high, 0:across] + 0.5) % pitch - pitch / 2
            dots = np.clip(0.3 * pitch + 0.5 - np.hypot(x, y), 0, 1)[..., None]
            if pitch < 4:  # two texels: dots that are finer are grey
                dots = np.full_like(dots, np.pi * 0.3**2)
            drawn = (np.abs(panel - np.roll(panel, (pen // 2 + 1,) * 2, (0, 1)).astype(float)) > 30).any(
                -1, keepdims=True
            )
            shown = np.where(drawn, 12.0, panel * (1 - 0.2 * dots)) / 255
            _paste(image, shown, box[0], box[1])
            draw.rectangle(box, outline=(10, 10, 10), width=pen)
            balloon = (box[0] + gap, box[1] + gap, box[0] + 0.6 * across, box[1] + 0.3 * high)
            draw.ellipse(balloon, fill=(250, 250, 250), outline=(10, 10, 10), width=max(1, pen // 2))
            inner = (balloon[0] + 0.1 * across, balloon[1] + 0.06 * high, balloon[2], balloon[3])
            paragraph(rng, draw, inner, 0.014 * wide, (10, 10, 10), "latin")
    return _printed(rng, averaged(image), 0.65)


@material_family("screen", tile_m=0.5, relief_m=0.0001, colours="picture")
def screen(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Windows of a desktop: programs in coloured type, plots, buttons, pictures. Variant 1, 3: dark."""
    dark = variant % 2 == 1
    image, draw = canvas(size, (24, 26, 32) if dark else (70, 110, 150))
    wide = 2 * size
    em = wide / 100
    for _ in range((9, 12, 16, 22)[variant]):
        w, h = rng.uniform(0.25, 0.6) * wide, rng.uniform(0.2, 0.5) * wide
        x, y = rng.beta(0.6, 0.6, 2) * (0.98 * wide - w, 0.98 * wide - h) + 0.01 * wide
        body = _colour(np.full(3, 0.1 if dark else 0.95) + 0.04 * rng.normal(size=3))
        draw.rectangle((x, y, x + w, y + h), fill=body, outline=(128, 128, 128))
        draw.rectangle((x, y, x + w, y + 1.8 * em), fill=_colour(hue_rand(rng, 0.3, 0.35 if dark else 0.8)))
        for k, tone in enumerate(((230, 90, 80), (230, 180, 60), (90, 190, 90))):
            left = x + (0.5 + 1.3 * k) * em
            draw.ellipse((left, y + 0.5 * em, left + 0.8 * em, y + 1.3 * em), fill=tone)
        kind = int(rng.integers(3))
        if kind == 0:
            _program(rng, draw, (x + em, y + 2.3 * em, x + w, y + h), dark, em)
        elif kind == 1:
            _paste(image, _doubled(rng, h - 2.8 * em, w - em), x + em / 2, y + 2.3 * em)
        else:
            for _ in range(int(rng.integers(2, 6))):
                t = np.linspace(x + em, x + w - em, 120)
                curve = y + 3 * em + (h - 4 * em) * (0.5 + 0.4 * np.tanh(np.cumsum(rng.normal(size=120)) / 8))
                line = np.c_[t, curve].ravel().tolist()
                tone = _colour(hue_rand(rng, 0.8, 0.9))
                draw.line(line, fill=tone, width=max(1, round(em * rng.uniform(0.1, 0.3))))
    layers = pictured(averaged(image))
    return layers._replace(roughness=0.12, height=0.5)


def _program(
    rng: np.random.Generator,
    draw: ImageDraw.ImageDraw,
    box: tuple[float, float, float, float],
    dark: bool,
    em: float,
) -> None:
    """Indented lines of words in five colours, as tall as 0.7 to 1.3 em."""
    rng = branch(rng)
    points = em * rng.uniform(0.7, 1.3)
    face = font_rand(rng, "latin", points)
    tones = [_colour(hue_rand(rng, 0.6, 0.9 if dark else 0.45)) for _ in range(5)]
    y = box[1]
    while y + 1.3 * points < box[3]:
        x = box[0] + points * 2 * int(rng.integers(0, 5))
        for _ in range(int(rng.integers(0, 7))):
            text = words_rand(rng, "latin", 1) + " "
            if x + face.length(text) > box[2]:
                break
            face.write(draw, (x, y), text, tones[int(rng.integers(5))])
            x += face.length(text)
        y += 1.3 * points


@material_family("screen_pixels", tile_m=0.06, relief_m=0.0001, colours="picture")
def screen_pixels(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """A display from so near that its red, green and blue stripes are seen."""
    pixels = (64, 32, 64, 32)[variant]
    picture = _mirrored(picture_rand(rng, pixels // 2, pixels // 2))
    picture = picture.repeat(size // pixels, 0).repeat(size // pixels, 1)
    t = axes(max(size, 8 * pixels))[0] * pixels % 1

    def seen(line: np.ndarray) -> np.ndarray:
        return line.reshape(size, -1).mean(1)

    masks = [seen(np.exp(-((((t - c + 0.5) % 1 - 0.5) / 0.14) ** 2))) for c in (1 / 6, 1 / 2, 5 / 6)]
    if variant >= 2:
        masks = [np.ones(size, np.float32)] * 3
    rows = seen(1 - 0.85 * edge(np.abs(t - 0.5), 0.4, 0.2))
    stripes = np.stack(masks, axis=-1)[None] * rows[:, None, None]
    layers = pictured(np.clip(picture * (0.25 + 0.75 * stripes), 0, 1))
    return layers._replace(roughness=0.15, height=0.5)


@material_family("mosaic_picture", tile_m=1.0, relief_m=0.002, colours="picture")
def mosaic_picture(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Stained glass or pebbles: cells of many colours after a picture, between dark joints."""
    count = (24, 40, 64, 16)[variant]
    near, second, value = cells(rng, size, count, 0.9)
    picture = _mirrored(picture_rand(rng, size // 2, size // 2))
    _, cell = np.unique(value, return_inverse=True)
    cell = cell.ravel()
    area = np.bincount(cell)
    means = [np.bincount(cell, picture[..., k].ravel()) / area for k in range(3)]
    tone = np.stack(means, axis=-1).astype(np.float32)[cell].reshape(picture.shape)
    joint = 1 - edge(second - near, 0.12, 0.06)
    streak = noise(rng, size, 1.4, low=4)
    rgb = tone * (0.85 + 0.3 * value + 0.05 * streak)[..., None] * (1 - 0.85 * joint)[..., None]
    layers = pictured(np.clip(rgb, 0, 1))
    return layers._replace(
        roughness=0.12 + 0.6 * joint, height=np.clip(0.85 - 0.6 * joint + 0.03 * streak, 0, 1)
    )
