"""Printed sheets: tables, barcodes, bar targets, handwriting, music, maps, circuit boards. Fine lines."""

from __future__ import annotations

import itertools

import numpy as np
from PIL import Image, ImageDraw

from fsid.assets.material_registry import Layers, material_family
from fsid.assets.patterns import axes, cells, edge, level, noise
from fsid.assets.streams import branch
from fsid.assets.typeset import averaged, canvas, fitted, font_rand, paragraph, pen, script_rand, words_rand

Box = tuple[float, float, float, float]


def _sheet(rng: np.random.Generator, size: int, printed: np.ndarray, second: np.ndarray | float) -> Layers:
    """Ink `printed` (colour_c) and a tint `second` (colour_b) on slightly uneven paper."""
    fibre = noise(rng, size, 0.6, low=size / 30, high=size / 5)
    age = noise(rng, size, 1.8)
    return Layers(
        mix=np.clip(second + 0.08 * age, 0, 1),
        pattern=np.clip(printed, 0, 1) * 0.97,
        detail=0.5 + 0.007 * fibre + 0.015 * age,
        roughness=0.7 + 0.03 * fibre - 0.06 * printed,
        height=0.5 + 0.08 * fibre + 0.05 * age,
    )


@material_family("tables", tile_m=0.25, relief_m=0.0001, colours="f3f1ea cfd6dd 20242c")
def tables(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Ruled tables of numbers and words with shaded rows; ledgers, time tables, forms."""
    image, draw = canvas(size)
    tint, tint_draw = canvas(size)
    wide, blocks = 2 * size, (1, 2, 2, 3)[variant]
    step = wide / blocks
    for i in range(blocks):
        for j in range(blocks):
            box = (i * step + 0.03 * step, j * step + 0.04 * step, (i + 0.97) * step, (j + 0.96) * step)
            own, points = branch(rng), wide * rng.uniform(0.009, 0.022)
            _table(own, size, (draw, tint_draw), box, points)
    return _sheet(rng, size, averaged(image), 0.9 * averaged(tint))


def _table(
    rng: np.random.Generator,
    size: int,
    sheets: tuple[ImageDraw.ImageDraw, ImageDraw.ImageDraw],
    box: Box,
    points: float,
) -> None:
    draw, tint = sheets
    left, top, right, bottom = box
    ends = left + (right - left) * np.r_[0, np.cumsum(rng.dirichlet(np.full(rng.integers(3, 9), 4.0)))]
    row_height = points * rng.uniform(1.3, 2.0)
    rows = int((bottom - top) / row_height)
    rule, script = int(rng.integers(1, 4)), script_rand(rng)
    face = font_rand(rng, script, points)
    digits = font_rand(rng, "digits", points)
    worded = rng.random(len(ends)) < 0.35
    shaded = rng.random() < 0.6
    for row in range(rows):
        y = top + row * row_height
        if row == 0 or (shaded and row % 2):
            tint.rectangle((left, y, right, y + row_height), fill=255 if row == 0 else 120)
        for k in range(len(ends) - 1):
            room = ends[k + 1] - ends[k] - 0.6 * points
            text = (
                words_rand(rng, script, 3)
                if row == 0 or worded[k]
                else f"{rng.lognormal(4, 3):.{rng.integers(0, 3)}f}"
            )
            used = face if row == 0 or worded[k] else digits
            text = fitted(text, used, room)
            shift = 0.0 if row == 0 or worded[k] else room - used.length(text)
            used.write(draw, (ends[k] + 0.3 * points + shift, y + 0.15 * points), text, 255)
        draw.line((left, y, right, y), fill=255, width=pen(size, rule))
    y = top + rows * row_height
    draw.rectangle((left, top, right, y), outline=255, width=pen(size, rule + 1))
    for x in ends[1:-1]:
        draw.line((x, top, x, y), fill=180, width=pen(size, rule))


@material_family("barcodes", tile_m=0.2, relief_m=0.0001, colours="f2f1ed e0d0ae 131313")
def barcodes(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Bar codes, matrix codes and labels of all sizes."""
    image, _ = canvas(size)
    wide, count = 2 * size, (2, 3, 4, 6)[variant]
    step = wide / count
    for i in range(count):
        for j in range(count):
            x, y = (i + 0.08) * step, (j + 0.08) * step
            if rng.random() < 0.6:
                _bars(rng, image, (x, y, x + 0.84 * step, y + rng.uniform(0.4, 0.8) * step))
            else:
                _matrix(rng, image, (x, y, x + 0.8 * step, y + 0.8 * step))
    blank = edge(noise(rng, size, 2.0, low=2, high=8), 0.4, 0.02)
    return _sheet(rng, size, averaged(image), 0.8 * blank)


def _bars(rng: np.random.Generator, image: Image.Image, box: Box) -> None:
    """As dark as the bars in a pixel, which may be finer than it."""
    left, top, right, bottom = box
    unit = (right - left) / rng.integers(70, 180)
    edges = int(left) + np.arange(int(right - left + 3 * unit) + 3)
    ink, x = np.zeros(len(edges)), left
    while x < right:
        ink += np.clip(edges - x, 0, unit * rng.integers(1, 4))
        x += unit * rng.integers(2, 7)
    row = np.uint8(255 * np.clip(np.diff(ink), 0, 1))
    image.paste(Image.fromarray(np.tile(row, (int(bottom - top) + 1, 1))), (int(left), int(top)))
    face = font_rand(rng, "digits", (right - left) / 14)
    digits = "".join(rng.choice(list("0123456789"), 13))
    face.write(ImageDraw.Draw(image), (left, bottom), digits, 255)


def _matrix(rng: np.random.Generator, image: Image.Image, box: Box) -> None:
    left, top, right, _ = box
    count = int(rng.choice((21, 25, 29, 33, 41)))
    on = rng.random((count, count)) < 0.48
    for i, j in ((0, 0), (count - 7, 0), (0, count - 7)):
        on[j : j + 7, i : i + 7] = True
        on[j + 1 : j + 6, i + 1 : i + 6] = False
        on[j + 2 : j + 5, i + 2 : i + 5] = True
    side = round(right - left)
    code = Image.fromarray(np.uint8(255 * on)).resize((side, side), Image.Resampling.BOX)
    image.paste(code, (round(left), round(top)))


@material_family("resolution_chart", tile_m=0.3, relief_m=0.0001, colours="f4f4f2 9a9a9a 101010")
def resolution_chart(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Groups of three bars that shrink by 2^(1/6), wedges, slanted squares, rings with numbers."""
    image, draw = canvas(size)
    wide = 2 * size
    for _ in range((50, 80, 120, 160)[variant]):
        x, y = rng.uniform(0.02, 0.77, 2) * wide
        reach = wide * rng.uniform(0.04, 0.14)
        draw.rectangle((x - 0.003 * wide, y - 0.003 * wide, x + 1.5 * reach, y + 1.1 * reach), fill=0)
        kind = int(rng.integers(4))
        if kind == 0:
            for k in range(10):
                bar = reach / 5 * 2 ** (-k / 3)
                top = y + reach * (1 - 2 ** (-k / 3))
                for m in range(3):
                    draw.rectangle((x + 2 * m * bar, top, x + (2 * m + 1) * bar, top + bar * 0.9), fill=255)
                    across = (x + reach, top + 2 * m * bar / 6, x + reach + bar, top + (2 * m + 1) * bar / 6)
                    draw.rectangle(across, fill=255)
        elif kind == 1:
            lines = int(rng.integers(5, 14))
            for k in range(lines):
                t = (k + 0.25) / lines, (k + 0.75) / lines
                corners = [(x, y + reach * t[0]), (x, y + reach * t[1])]
                corners += [(x + 1.3 * reach, y + reach * (0.4 + 0.1 * e)) for e in t[::-1]]
                draw.polygon(corners, fill=255)
        elif kind == 2:
            turn = np.radians(rng.uniform(3, 12)) + np.pi / 4 + np.arange(4) * np.pi / 2
            square = np.c_[x + 0.5 * reach * (1 + np.cos(turn)), y + 0.5 * reach * (1 + np.sin(turn))]
            draw.polygon(square.ravel().tolist(), fill=int(rng.integers(120, 256)))
        else:
            for k in range(int(rng.integers(4, 16))):
                r = reach / 2 * 0.85**k
                c = (x + reach / 2, y + reach / 2)
                draw.ellipse((c[0] - r, c[1] - r, c[0] + r, c[1] + r), fill=255 * ((k + 1) % 2))
        number = f"{rng.uniform(0.5, 20):.1f}"
        font_rand(rng, "digits", size / 50).write(draw, (x, y + reach), number, 255)
    u, v = axes(size)
    steps = np.floor(7.999 * np.abs(2 * u - 1)) / 7 * (np.abs(v - 0.5) < 0.04)
    return _sheet(rng, size, averaged(image), steps)


@material_family("handwriting", tile_m=0.25, relief_m=0.0001, colours="f4efdf b9cbe0 1f2a66")
def handwriting(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Cursive loops on ruled, squared or blank paper, with corrections."""
    image, draw = canvas(size)
    wide, lines = 2 * size, (18, 26, 34, 14)[variant]
    pitch = wide / lines
    for row in range(lines):
        if rng.random() < 0.12:
            continue
        end = wide * rng.uniform(0.5, 0.97)
        x, points = wide * 0.03, []
        slant, height = rng.uniform(0.1, 0.5), pitch * rng.uniform(0.22, 0.3)
        while x < end:
            letters = int(rng.integers(2, 9))
            t = np.arange(letters * 14) / 14 * 2 * np.pi
            tall = np.repeat(np.where(rng.random(letters) < 0.25, 2.2, 1.0), 14)
            loop = np.repeat(rng.uniform(0.35, 1.0, letters), 14)
            step = height * 0.19 * t
            up = height * tall * np.sin(t) * 0.5
            points = np.c_[x + step + slant * up + height * loop * 0.5 * np.cos(t), (row + 0.62) * pitch - up]
            if points[:, 0].max() < 0.98 * wide:
                draw.line(points.ravel().tolist(), fill=255, width=pen(size, 1.6), joint="curve")
            x = float(points[-1, 0]) + height * rng.uniform(0.8, 1.8)
        if rng.random() < 0.15:
            draw.line(
                (wide * 0.2, (row + 0.5) * pitch, wide * 0.4, (row + 0.55) * pitch),
                fill=255,
                width=pen(size, 5),
            )
    u, v = axes(size)
    ruled = 1 - edge(np.abs((v * lines + 0.2) % 1 - 0.5), lines / size, lines / size)
    squared = 1 - edge(np.abs((u * lines + 0.2) % 1 - 0.5), lines / size, lines / size)
    grid = (ruled + 0 * u, np.maximum(ruled, squared), 0 * u * v, ruled + 0 * u)[variant]
    return _sheet(rng, size, averaged(image) * (0.8 + 0.1 * level(noise(rng, size, 1.0))), 0.9 * grid)


@material_family("sheet_music", tile_m=0.3, relief_m=0.0001, colours="f3ead2 dccfae 1a1712")
def sheet_music(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Staves with notes, stems, beams and bar lines."""
    image, draw = canvas(size)
    wide, staves = 2 * size, (6, 8, 10, 14)[variant]
    pitch = wide / staves
    gap = pitch / 11
    thin = max(1, round(wide / 1400))
    for row in range(staves):
        top = row * pitch + 3.5 * gap
        for k in range(5):
            draw.line((0.02 * wide, top + k * gap, 0.98 * wide, top + k * gap), fill=255, width=thin)
        x, beam = 0.06 * wide, None
        while x < 0.96 * wide:
            y = top + gap * rng.integers(-2, 11) / 2
            head = (x - 0.62 * gap, y - 0.45 * gap, x + 0.62 * gap, y + 0.45 * gap)
            draw.ellipse(head, fill=255 if rng.random() < 0.75 else 0, outline=255, width=2 * thin)
            down = y < top + 2 * gap
            tip = (x + (-0.6 if down else 0.6) * gap, y + (3.4 if down else -3.4) * gap)
            draw.line((tip[0], y, *tip), fill=255, width=thin)
            if beam is not None and rng.random() < 0.6:
                draw.line((*beam, *tip), fill=255, width=max(2, round(gap * 0.45)))
            beam = tip if rng.random() < 0.7 else None
            x += gap * rng.uniform(1.8, 5)
            if rng.random() < 0.12:
                draw.line((x, top, x, top + 4 * gap), fill=255, width=2 * thin)
                x += 2 * gap
    return _sheet(rng, size, averaged(image), 0.5 * level(noise(rng, size, 2.0)))


@material_family("street_map", tile_m=0.4, relief_m=0.0001, colours="efe9dc a9cfa4 5b6f9a")
def street_map(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """A city map: blocks between streets of three widths, parks, contour lines, names."""
    count = (10, 16, 24, 7)[variant]
    shift = 0.25 * np.stack([noise(rng, size, 2.2, low=1, high=count) for _ in range(2)])
    near, second, value = cells(rng, size, count, 0.75, shift)
    fine_near, fine_second, _ = cells(rng, size, count * 3, 0.6, shift * 3)
    street = 1 - edge(second - near, 0.09, 0.02)
    lane = (1 - edge(fine_second - fine_near, 0.1, 0.05)) * (value < 0.8)
    hill = noise(rng, size, 2.3, low=1, high=30)
    contour = 1 - edge(np.abs((hill * 8) % 1 - 0.5), 0.05, 0.05)
    image, draw = canvas(size)
    for _ in range(60):
        x, y = np.minimum(rng.uniform(0, 0.9, 2), (0.87, 0.9)) * 2 * size
        box = (x, y, x + 0.25 * size, y + 0.04 * size)
        paragraph(rng, draw, box, size * rng.uniform(0.015, 0.03), 255, script_rand(rng))
    water = edge(hill, 1.1, 0.02)
    printed = np.maximum(0.8 * np.maximum(street, 0.6 * lane), averaged(image))
    layers = _sheet(rng, size, np.maximum(printed * (1 - water), 0.35 * water), 0.9 * (value > 0.72))
    return layers._replace(detail=layers.detail * (1 - 0.15 * contour))


@material_family("circuit_board", tile_m=0.12, relief_m=0.0008, colours="1f5a37 2f7a4c c9b26a")
def circuit_board(rng: np.random.Generator, variant: int, size: int) -> Layers:
    """Copper tracks at right angles and 45 degrees, pads, vias, chips with legs, silk-screen text."""
    tracks, draw = canvas(size)
    chips, chip_draw = canvas(size)
    wide = 2 * size
    grid = wide / (48, 64, 96, 40)[variant]
    for _ in range((260, 420, 800, 200)[variant]):
        x, y = rng.integers(0, int(wide / grid), 2) * grid
        points = [(x, y)]
        for _ in range(int(rng.integers(2, 5))):
            dx, dy = ((1, 0), (0, 1), (1, 1), (1, -1), (-1, 0), (0, -1))[int(rng.integers(6))]
            reach = grid * int(rng.integers(1, 9))
            x, y = x + dx * reach, y + dy * reach
            points.append((x, y))
        across, down = (_shifts([p[k] for p in points], grid, wide) for k in (0, 1))
        for du, dv in itertools.product(across, down):
            _track(draw, [(px + du, py + dv) for px, py in points], grid)
    for _ in range((10, 16, 30, 8)[variant]):
        w, h = grid * rng.integers(2, 12, 2)
        x, y = rng.uniform(0, wide - w), rng.uniform(0, wide - h)
        for leg in np.arange(x + grid / 4, x + w - grid / 4, grid / 2):
            for dv in _shifts([y, y + h], grid, wide):
                ends = y + dv - grid * 0.5, y + dv + h + grid * 0.5
                draw.rectangle((leg, ends[0], leg + grid * 0.22, ends[1]), fill=255)
        chip_draw.rectangle((x, y, x + w, y + h), fill=255)
        label = (x + grid * 0.2, y + grid * 0.1, x + w - grid * 0.2, y + h)
        paragraph(rng, chip_draw, label, 0.7 * grid, 90, "digits")
    copper, chip = averaged(tracks), averaged(chips)
    solder = noise(rng, size, 1.2, low=4)
    bare, marked = edge(copper, 0.8, 0.2) * (chip < 0.2), (chip > 0.15) * (chip < 0.6)
    return Layers(
        mix=np.clip(1.5 * copper, 0, 1) * (1 - bare),
        pattern=np.clip(bare, 0, 1),
        detail=(0.5 + 0.015 * solder) * (1 - 0.85 * edge(chip, 0.25, 0.3) + 0.25 * marked),
        roughness=0.3 + 0.1 * bare + 0.3 * chip,
        height=np.clip(0.2 + 0.1 * copper + 0.1 * bare + 0.6 * (chip > 0.1), 0, 1),
        metallic=bare,
    )


def _shifts(at: list[float], reach: float, wide: int) -> list[int]:
    """Shifts in pixels of a thing at these places, `reach` to both sides, on the canvas, which repeats."""
    return [s for s in (-wide, 0, wide) if max(at) + reach + s > 0 and min(at) - reach + s < wide]


def _track(draw: ImageDraw.ImageDraw, points: list[tuple[float, float]], grid: float) -> None:
    """A track from pad to pad."""
    draw.line(points, fill=150, width=max(2, round(grid * 0.3)), joint="curve")
    for px, py in (points[0], points[-1]):
        for reach, fill in ((0.4 * grid, 255), (0.15 * grid, 60)):
            draw.ellipse((px - reach, py - reach, px + reach, py + reach), fill=fill)
