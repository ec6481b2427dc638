"""A test material as a relief: colour, height and gloss over a flat sheet, and the light that it sends back.

    L = albedo (a + (1 - a) max(n l, 0) f) o + gloss (n h)^60 f      n from the height, l from one near lamp

f is the lamp's inverse-square fall-off, o a darkening of hollows, a the ambient share. The relief shares
no code with the scene renderer, so a network cannot have met its peculiarities in training. Lengths are
pixels of the drawing, which has `OVERSAMPLING` times as many along each edge as the picture; x right, y down.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter
from skimage.transform import ProjectiveTransform, warp

OVERSAMPLING = 2
GLOSS_EXPONENT = 60.0


@dataclass(eq=False)
class Surface:
    """The drawing. albedo: (H, W, 3) linear 0..1. height: (H, W) pixels. gloss: (H, W) 0..1. All float32."""

    albedo: np.ndarray
    height: np.ndarray
    gloss: np.ndarray

    @property
    def grid(self) -> tuple[np.ndarray, np.ndarray]:
        """Pixel coordinates x (1, W) and y (H, 1)."""
        rows, columns = self.height.shape
        return np.arange(columns, dtype=np.float32)[None, :], np.arange(rows, dtype=np.float32)[:, None]

    def put(
        self,
        window: tuple[slice, slice],
        cover: np.ndarray,
        albedo: np.ndarray | tuple[float, float, float],
        height: np.ndarray | float = 0.0,
        gloss: float = 0.0,
    ) -> None:
        """Lay something over a window: `cover` (h, w) 0..1 says where; height is absolute, in pixels."""
        weight = cover[..., None]
        self.albedo[window] += weight * (np.asarray(albedo, np.float32) - self.albedo[window])
        self.height[window] += cover * (height - self.height[window])
        self.gloss[window] += cover * (gloss - self.gloss[window])


def sheet(rows: int, columns: int, albedo: tuple[float, float, float]) -> Surface:
    """A flat, matt sheet of one colour."""
    colour = np.broadcast_to(np.asarray(albedo, np.float32), (rows, columns, 3)).copy()
    flat = np.zeros((rows, columns), np.float32)
    return Surface(colour, flat, flat.copy())


def dye_rand(rng: np.random.Generator) -> np.ndarray:
    """A colour (3,), linear 0.02..0.85: log-uniform brightness, mostly muted, now and then saturated."""
    level = np.exp(rng.uniform(np.log(0.04), np.log(0.7)))
    tint = np.exp(rng.normal(0, 1, 3) * rng.gamma(2.0, 0.25))
    return np.clip(level * tint / tint.mean(), 0.02, 0.85)


def inside(distance: np.ndarray) -> np.ndarray:
    """Coverage 0..1 from a signed distance in pixels (positive inside), one pixel of transition."""
    return np.clip(distance + 0.5, 0.0, 1.0).astype(np.float32)


def window_around(surface: Surface, x: float, y: float, reach: float) -> tuple[slice, slice]:
    """The part of the drawing within `reach` pixels of (x, y); may be empty."""
    rows, columns = surface.height.shape
    top, left = max(0, int(y - reach)), max(0, int(x - reach))
    return slice(top, max(top, min(rows, int(y + reach) + 1))), slice(
        left, max(left, min(columns, int(x + reach) + 1))
    )


def offsets_around(
    surface: Surface, x: float, y: float, reach: float
) -> tuple[tuple[slice, slice], np.ndarray, np.ndarray]:
    """`window_around`, and how far its pixels lie right of (x, y), (1, w), and below it, (h, 1)."""
    window = window_around(surface, x, y, reach)
    gx, gy = surface.grid
    return window, gx[:, window[1]] - x, gy[window[0]] - y


def light_rand(rng: np.random.Generator, surface: Surface) -> np.ndarray:
    """(H / 2, W / 2, 3) linear light from the surface, 1 = a white sheet in the middle; never negative.

    Drawn: place of the lamp, ambient share, and how the sheet lies before the camera (turned by up to 8
    degrees, tilted a little).
    """
    rows, columns = surface.height.shape
    azimuth, elevation = rng.uniform(0, 2 * np.pi), np.radians(rng.uniform(38, 65))
    distance = rng.uniform(1.2, 2.5) * columns
    lamp = distance * np.array(
        [np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)]
    )
    ambient = rng.uniform(0.15, 0.35)
    x, y = surface.grid
    to_lamp = np.stack(
        np.broadcast_arrays(lamp[0] - (x - columns / 2), lamp[1] - (y - rows / 2), lamp[2] - surface.height),
        axis=-1,
    ).astype(np.float32)
    reach = np.linalg.norm(to_lamp, axis=-1, keepdims=True)
    to_lamp /= reach
    slope_y, slope_x = np.gradient(surface.height)
    normal = np.stack([-slope_x, -slope_y, np.ones_like(slope_x)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    falloff = (distance / reach) ** 2
    cosine = np.maximum((normal * to_lamp).sum(-1, keepdims=True), 0.0) / np.sin(elevation)
    half = to_lamp + np.array((0.0, 0.0, 1.0), np.float32)
    half /= np.linalg.norm(half, axis=-1, keepdims=True)
    mirror = np.maximum((normal * half).sum(-1, keepdims=True), 0.0) ** GLOSS_EXPONENT
    hollow = gaussian_filter(surface.height, 12.0) - surface.height
    open_share = 1.0 / (1.0 + np.maximum(hollow, 0.0) / 12.0)
    matt = surface.albedo * (ambient + (1 - ambient) * cosine * falloff) * open_share[..., None]
    return _seen_rand(rng, (matt + surface.gloss[..., None] * mirror * falloff).astype(np.float32))


def _seen_rand(rng: np.random.Generator, light: np.ndarray) -> np.ndarray:
    """The sheet turned and tilted, averaged down to the picture's pixels; the margin is mirrored."""
    rows, columns = light.shape[:2]
    angle, tilt = np.radians(rng.uniform(-8, 8)), rng.uniform(-0.08, 0.08, 2) / columns
    to_centre = np.array([[1, 0, -columns / 2], [0, 1, -rows / 2], [0, 0, 1]])
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [*tilt, 1]])
    matrix = np.linalg.inv(to_centre) @ turn @ np.diag([0.92, 0.92, 1]) @ to_centre
    seen = warp(light, ProjectiveTransform(matrix), order=1, mode="reflect", preserve_range=True)
    n = OVERSAMPLING
    cells = seen[: rows // n * n, : columns // n * n].reshape(rows // n, n, columns // n, n, 3)
    return np.maximum(cells.mean((1, 3)), 0.0).astype(np.float32)
