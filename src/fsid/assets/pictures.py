"""Pictures for printed pages and screens: small procedural scenes in colour, (H, W, 3) sRGB in 0..1.

    landscape   sky, sun, clouds, ridges that fade with distance, water or fields
    still life  lit balls with shadows before a soft ground
    blossoms    overlapping petals, sharp and out of focus
    streets     a skyline with windows, at day or night
    abstract    warped stripes and blobs

They are what a camera sees when it photographs a magazine: 1/f spectra, true shading, many hues at once.
"""

from __future__ import annotations

import colorsys

import numpy as np
from PIL import Image, ImageDraw
from scipy.ndimage import gaussian_filter

from fsid.assets.patterns import noise
from fsid.assets.streams import branch

KINDS = ("landscape", "still life", "blossoms", "streets", "abstract")


def picture_rand(rng: np.random.Generator, height: int, width: int, kind: str | None = None) -> np.ndarray:
    """(height, width, 3) float32 sRGB-encoded picture of a kind of KINDS, or of any.

    The same at every size; one below 64 pixels is the mean of a larger one.
    """
    rng = branch(rng)
    chosen = kind or str(rng.choice(KINDS))
    longer = max(height, width)
    fine = 1 << (63 // longer).bit_length()
    size = 1 << (fine * longer - 1).bit_length()
    make = {
        "landscape": _landscape,
        "still life": _still_life,
        "blossoms": _blossoms,
        "streets": _streets,
        "abstract": _abstract,
    }[chosen]
    high, wide = fine * height, fine * width
    image = np.clip(make(rng, high, wide, noise(rng, size, 1.6)[:high, :wide]), 0, 1).astype(np.float32)
    return image.reshape(height, fine, width, fine, 3).mean((1, 3)) if fine > 1 else image


def hue_rand(rng: np.random.Generator, saturation: float, value: float) -> np.ndarray:
    """(3,) a colour of random hue."""
    return np.array(colorsys.hsv_to_rgb(float(rng.random()), saturation, value), np.float32)


def _grid(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """x (1, W) and y (H, 1), the longer side from 0 to 1, y downwards."""
    longer = max(height, width)
    x = (np.arange(width, dtype=np.float32) + 0.5) / longer
    y = (np.arange(height, dtype=np.float32) + 0.5) / longer
    return x[None], y[:, None]


def _rgb(r: float, g: float, b: float) -> np.ndarray:
    return np.array((r, g, b), np.float32)


def _mixed(a: np.ndarray, b: np.ndarray, share: np.ndarray) -> np.ndarray:
    return a + (b - a) * share[..., None]


def _landscape(rng: np.random.Generator, height: int, width: int, cloud: np.ndarray) -> np.ndarray:
    x, y = _grid(height, width)
    low = rng.random() < 0.35
    zenith = np.array((0.2, 0.4, 0.75) if not low else (0.25, 0.25, 0.5), np.float32)
    horizon = np.array((0.75, 0.85, 0.95) if not low else (0.98, 0.6, 0.3), np.float32)
    horizon_y = float(y.max() * rng.uniform(0.4, 0.65))
    sky = _mixed(zenith, horizon, np.clip(y / horizon_y, 0, 1) ** 1.5 + 0 * x)
    sun = np.exp(-((x - rng.uniform(0, x.max())) ** 2 + (y - horizon_y * rng.uniform(0.2, 1)) ** 2) / 0.01)
    white = _rgb(1.0, 0.98, 0.95)
    image = _mixed(_mixed(sky, white, np.clip(0.6 * cloud - 0.2, 0, 0.9)), white, np.clip(sun, 0, 0.8))
    ridges = int(rng.integers(2, 5))
    near = np.array(rng.choice([(0.12, 0.25, 0.1), (0.3, 0.22, 0.12), (0.15, 0.2, 0.25)]), np.float32)
    for k in range(ridges):
        depth = (k + 1) / ridges
        line = sum(
            rng.normal() / f**1.1 * np.sin(2 * np.pi * (f * x + rng.random())) for f in 2.0 ** np.arange(0, 8)
        )
        top = horizon_y * (0.8 + 0.35 * depth) + 0.05 * line
        tone = near * (0.6 + 0.5 * rng.random()) * (1 + 0.25 * cloud[..., None])
        image = np.where((y > top)[..., None], _mixed(horizon * 0.8, tone, 0 * x + 0 * y + depth), image)
    if rng.random() < 0.4:
        shore = float(y.max() - (y.max() - horizon_y) * rng.uniform(0.2, 0.6))
        row = int(np.searchsorted(y[:, 0], shore))
        mirrored = image[::-1][-max(row, 1) :][: height - row]
        image[row : row + len(mirrored)] = mirrored * 0.75 + 0.03 * cloud[: len(mirrored), :, None]
    return image


def _still_life(rng: np.random.Generator, height: int, width: int, cloud: np.ndarray) -> np.ndarray:
    x, y = _grid(height, width)
    wall, table = hue_rand(rng, 0.3, 0.7), hue_rand(rng, 0.4, 0.5)
    edge_y = float(y.max() * rng.uniform(0.45, 0.65))
    lit = (0.7 + 0.4 * (1 - np.hypot(x - 0.3, y - 0.2)))[..., None]
    image = np.where((y < edge_y)[..., None], wall, table) * lit * (1 + 0.06 * cloud[..., None])
    for _ in range(int(rng.integers(3, 8))):
        radius, cx = rng.uniform(0.06, 0.2), rng.uniform(0, x.max())
        cy = rng.uniform(edge_y, y.max() * 0.95) - radius * 0.7
        dx, dy = (x - cx) / radius, (y - cy) / radius
        shadow = np.exp(-(((dx - 0.9) / 1.2) ** 2) - ((dy - 0.8) / 0.35) ** 2)
        image = image * (1 - 0.6 * shadow[..., None])
        r2 = dx * dx + dy * dy
        nz = np.sqrt(np.clip(1 - r2, 0, 1))
        diffuse = np.clip(-0.5 * dx - 0.6 * dy + 0.6 * nz, 0, 1)
        shine = np.clip(-0.35 * dx - 0.45 * dy + 0.82 * nz, 0, 1) ** 60
        skin = hue_rand(rng, rng.uniform(0.3, 0.95), rng.uniform(0.4, 0.95))
        ball = skin * (0.12 + 0.9 * diffuse + 0.08 * cloud)[..., None] + 0.8 * shine[..., None]
        cover = np.clip((1 - np.sqrt(r2)) * radius * max(height, width) + 0.5, 0, 1)
        image = _mixed(image, ball, cover)
    return image


def _blossoms(rng: np.random.Generator, height: int, width: int, cloud: np.ndarray) -> np.ndarray:
    longer = max(height, width)
    ground = _rgb(0.15, 0.3, 0.1) * (1 + 0.4 * cloud[..., None])
    base = Image.fromarray(np.uint8(np.clip(ground, 0, 1) * 255))
    for blurred in (True, False):
        draw = ImageDraw.Draw(base)
        for _ in range(int(rng.integers(6, 16))):
            cx, cy = rng.uniform(0, width), rng.uniform(0, height)
            reach, petals = rng.uniform(0.05, 0.16) * longer, int(rng.integers(4, 10))
            tone = hue_rand(rng, rng.uniform(0.2, 0.9), rng.uniform(0.6, 1.0))
            for k in range(petals):
                angle = 2 * np.pi * k / petals + rng.random() * 0.3
                t = np.linspace(0, 2 * np.pi, 20)
                px, py = reach * (0.55 + 0.5 * np.cos(t)), reach * 0.26 * np.sin(t)
                shape = np.c_[
                    cx + px * np.cos(angle) - py * np.sin(angle), cy + px * np.sin(angle) + py * np.cos(angle)
                ]
                r, g, b = (int(v) for v in np.clip(tone * rng.uniform(0.75, 1.05), 0, 1) * 255)
                draw.polygon(shape.ravel().tolist(), fill=(r, g, b))
            heart = reach * 0.18
            draw.ellipse((cx - heart, cy - heart, cx + heart, cy + heart), fill=(200, 150, 30))
        if blurred:
            base = Image.fromarray(gaussian_filter(np.asarray(base), (longer / 50, longer / 50, 0)))
    return np.asarray(base, np.float32) / 255 * (1 + 0.05 * cloud[..., None])


def _streets(rng: np.random.Generator, height: int, width: int, cloud: np.ndarray) -> np.ndarray:
    _, y = _grid(height, width)
    night = rng.random() < 0.5
    top, low = ((0.02, 0.03, 0.1), (0.2, 0.12, 0.2)) if night else ((0.45, 0.6, 0.85), (0.9, 0.9, 0.9))
    sky = _mixed(_rgb(*top), _rgb(*low), y / y.max() + np.zeros((1, width), np.float32))
    image = Image.fromarray(np.uint8(np.clip(sky * (1 + 0.08 * cloud[..., None]), 0, 1) * 255))
    draw = ImageDraw.Draw(image)
    for layer in range(3):
        left = -rng.uniform(0, 0.1) * width
        while left < width:
            wide = rng.uniform(0.06, 0.2) * width
            roof = height * rng.uniform(0.15, 0.5 + 0.15 * layer)
            shade = (0.3 + 0.2 * layer if night else 0.95 - 0.2 * layer) * hue_rand(rng, 0.15, 0.5)
            r, g, b = (int(c) for c in shade * 255)
            draw.rectangle((left, roof, left + wide, height), fill=(r, g, b))
            pitch = max(wide / rng.integers(3, 8), 0.012 * width)
            rows = np.arange(roof + pitch / 2, height, pitch)
            lights = branch(rng).random((len(rows), 8)) < 0.45
            for wy, lit in zip(rows, lights, strict=True):
                columns = np.arange(left + pitch / 3, left + wide - pitch / 2, pitch)
                for wx, on in zip(columns, lit, strict=False):
                    tone = (255, 220, 130) if night and on else (r // 2, g // 2, b // 2 + 20)
                    draw.rectangle((wx, wy, wx + pitch * 0.5, wy + pitch * 0.6), fill=tone)
            left += wide
    return np.asarray(image, np.float32) / 255


def _abstract(rng: np.random.Generator, height: int, width: int, cloud: np.ndarray) -> np.ndarray:
    x, y = _grid(height, width)
    angle = rng.uniform(0, np.pi)
    phase = (x * np.cos(angle) + y * np.sin(angle)) * rng.uniform(2, 12) + 0.5 * cloud
    colours = np.stack([hue_rand(rng, rng.uniform(0.1, 1), rng.uniform(0.2, 1)) for _ in range(7)])
    if rng.random() < 0.5:
        return colours[np.floor(phase).astype(int) % 7]
    smooth = (phase % 7)[..., None]
    low = np.floor(smooth).astype(int)[..., 0]
    share = smooth - low[..., None]
    return colours[low % 7] * (1 - share) + colours[(low + 1) % 7] * share
