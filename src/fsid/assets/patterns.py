"""Tileable building blocks of textures: everything is periodic on the unit square.

    noise     white noise shaped in frequency: amplitude(f) ~ f^-slope within [low, high] cycles per tile
    cells     jittered-grid Voronoi: distance to the nearest and second nearest seed, and the cell's own value
    warp      periodic look-up at displaced coordinates
    ink       lines, shapes and glyphs drawn with PIL, with anti-aliasing, wrapped at the borders

Frequencies and lengths are in cycles or fractions of a tile, and no number of random draws depends on the
size, so a pattern is the same at every size, seen sharper or less sharp. Edges are as sharp as the texel
allows, and grain is some texels wide and ends at three: fine texture is what a denoiser must learn to keep,
noise of single texels what it must learn to remove.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from PIL import Image, ImageDraw
from scipy.fft import ifft, irfft
from scipy.ndimage import map_coordinates
from scipy.special import ndtr

from fsid.assets.streams import branch

Draw = Callable[[ImageDraw.ImageDraw, float, float], None]


def axes(size: int) -> tuple[np.ndarray, np.ndarray]:
    """u (1, S) and v (S, 1): texel centres in [0, 1), float32, to broadcast against each other."""
    t = (np.arange(size, dtype=np.float32) + 0.5) / size
    return t[None, :], t[:, None]


def grid(size: int, u_count: int, v_count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(x, y, i, j) of `u_count` x `v_count` cells: where in its cell a texel is, -0.5..0.5, and the cell's
    numbers; x and i (1, S), y and j (S, 1), to broadcast against each other."""
    u, v = axes(size)
    x, y = u * u_count, v * v_count
    return x % 1 - 0.5, y % 1 - 0.5, np.floor(x).astype(int), np.floor(y).astype(int)


def noise(
    rng: np.random.Generator,
    size: int,
    slope: float,
    low: float = 1.0,
    high: float = np.inf,
    stretch: tuple[float, float] = (1.0, 1.0),
) -> np.ndarray:
    """(S, S) float32 Gaussian noise, mean 0, variance 1, amplitude ~ f^-slope between low and high.

    low, high: cycles per tile, soft edges; high is at most S / 3, because noise of single texels looks like a
    sensor's. stretch: how many times longer the features are along u and v; across them such a field is cut
    off there, too, and proportionally earlier along them.

    A larger tile has the waves of a smaller one and adds its own; its field is the same seen sharper. `rng`
    gives one number whatever the size, so that what is drawn after it is the same, too.
    """
    high = min(high, size / 3)
    rows = 32
    while rows < min(size, 4 * high):
        rows *= 2
    columns = rows // 2
    white = _waves_rand(branch(rng), rows)
    fx = np.arange(columns, dtype=np.float32)[None] * np.float32(stretch[0])
    fy = (np.fft.fftfreq(rows, 1 / rows).astype(np.float32) * np.float32(stretch[1]))[:, None]
    f2 = fx * fx + fy * fy
    f2[0, 0] = 1.0
    gain = f2 ** np.float32(-slope / 2)
    if low > 1.0:
        gain *= np.exp(-((low * low / f2) ** 2))
    gain *= np.exp(-np.minimum((f2 / (high * high)) ** 2, 80))
    gain[0, 0] = 0.0
    gain[:, 0] *= np.float32(np.sqrt(2))  # the inverse keeps but the symmetric half of this column
    white *= gain
    turns = np.exp(np.fft.fftfreq(rows, size / rows) * 1j * np.pi).astype(np.complex64)
    white *= turns[:, None]  # to the centres of texels, which are others at another size
    white *= turns[:columns]
    if rows < size:
        white = np.insert(white, columns, np.zeros((size - rows, 1), np.complex64), axis=0)
    field = irfft(ifft(white, axis=0, overwrite_x=True), n=size, axis=1)
    return field / (field.std() + np.float32(1e-12))


def _waves_rand(rng: np.random.Generator, rows: int) -> np.ndarray:
    """(B, B / 2) complex64 white noise at the frequencies -B / 2 .. B / 2 - 1 (rows, in an FFT's order) by
    0 .. B / 2 - 1.

    Drawn from low to high in blocks that double, each around those before it: a larger B adds waves and
    leaves the others as they are.
    """
    white = np.empty((rows, rows // 2), np.complex64)
    half = 16
    white[:half, :half], white[-half:, :half] = _normals(rng, 2, half, half)
    while 2 * half < rows:
        wide = 2 * half
        white[:wide, half:wide], white[-wide:, half:wide] = _normals(rng, 2, wide, half)
        white[half:wide, :half], white[-wide:-half, :half] = _normals(rng, 2, half, half)
        half = wide
    return white


def _normals(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Complex64, real and imaginary part standard normal."""
    return rng.standard_normal((*shape, 2), dtype=np.float32).view(np.complex64)[..., 0]


def level(field: np.ndarray, softness: float = 1.0) -> np.ndarray:
    """Mean 0, variance 1 to [0, 1] by the normal distribution: uniform for softness 1, masks below."""
    return ndtr(field / np.float32(softness))


def edge(field: np.ndarray, at: float | np.ndarray, width: float) -> np.ndarray:
    """Smooth step of `field` from 0 to 1 over `width` centred on `at`."""
    t = np.clip((field - at) / width + 0.5, 0.0, 1.0)
    return t * t * (3 - 2 * t)


def joint(field: np.ndarray, at: float, width: float, texel: float, border: float = 0.5) -> np.ndarray:
    """`edge` of a joint between `at` and the `border` of a cell, the highest value of `field`.

    texel: step of `field` from texel to texel. A joint finer than that lies between their centres: it is
    drawn wider, and as much fainter, so that it is there at every size and takes the same share of the area.
    """
    soft = max(width, 1.5 * texel)
    return edge(field, at, soft) * np.float32(_area(border - at, width) / _area(border - at, soft))


def _area(half: float, width: float) -> float:
    """Below a smooth step over `width`, up to `half` behind its centre."""
    t = min(0.5 + half / width, 1.0)
    return width * (t**3 - t**4 / 2) + max(half - width / 2, 0.0)


def warp(field: np.ndarray, du: np.ndarray | float, dv: np.ndarray | float) -> np.ndarray:
    """`field` looked up at (u + du, v + dv), displacements in fractions of a tile, bilinear, periodic."""
    size = len(field)
    u, v = np.meshgrid(np.arange(size, dtype=np.float32), np.arange(size, dtype=np.float32))
    where = np.stack([(v + np.float32(size) * dv) % size, (u + np.float32(size) * du) % size])
    return map_coordinates(field, where, order=1, mode="grid-wrap")


def cells(
    rng: np.random.Generator, size: int, count: int, jitter: float = 0.9, shift: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Voronoi cells of a jittered `count` x `count` grid of seeds.

    Returns (near, second, value), (S, S) float32: distances to the two nearest seeds in units of the grid
    spacing, and a uniform random value of the cell. shift (2, S, S): displaces the look-up, in spacings.
    """
    seeds = (0.5 + jitter * (rng.random((count, count, 2)) - 0.5)).astype(np.float32)
    values = rng.random((count, count), dtype=np.float32)
    ring = np.arange(-1, count + 1) % count
    seeds_x, seeds_y = (seeds[ring][:, ring, k].ravel() for k in (0, 1))
    table = (seeds_x, seeds_y, values[ring][:, ring].ravel())
    u, v = axes(size)
    out = np.empty((3, size, size), np.float32)
    for top in range(0, size, 64):  # in strips, which stay in the processor's cache
        rows = slice(top, top + 64)
        x, y = np.broadcast_arrays(u * count, v[rows] * count)
        if shift is not None:
            x, y = x + shift[0][rows], y + shift[1][rows]
        out[:, rows] = _nearest(x, y, count, table)
    return out[0], out[1], out[2]


def _nearest(
    x: np.ndarray, y: np.ndarray, count: int, table: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`cells` at points in grid units. table: seeds' x, y and value of the grid with a ring of copies."""
    seeds_x, seeds_y, values = table
    ix, iy = np.floor(x).astype(np.int32), np.floor(y).astype(np.int32)
    x, y = x - ix, y - iy
    home = (iy % count + 1) * (count + 2) + ix % count + 1
    near = np.full(x.shape, np.inf, np.float32)
    second, best = near.copy(), home.copy()
    for oy in (-1, 0, 1):
        for ox in (-1, 0, 1):
            cell = home + (oy * (count + 2) + ox)
            dx, dy = x - seeds_x[cell] - ox, y - seeds_y[cell] - oy
            distance = dx * dx + dy * dy
            np.copyto(best, cell, where=distance < near)
            np.minimum(second, np.maximum(near, distance), out=second)
            np.minimum(near, distance, out=near)
    return np.sqrt(near), np.sqrt(second), values[best]


def ink(size: int, marks: list[Draw], sharpness: int = 2) -> np.ndarray:
    """(S, S) float32 in [0, 1]: every mark drawn in white on black at all places where it wraps around.

    A mark is called as mark(draw, x, y) and draws relative to that origin on a canvas of
    `size * sharpness` pixels a side; the canvas is then averaged down, which anti-aliases the edges.
    """
    wide = size * sharpness
    canvas = Image.new("L", (wide, wide), 0)
    draw = ImageDraw.Draw(canvas)
    for mark in marks:
        for y in (-wide, 0, wide):
            for x in (-wide, 0, wide):
                mark(draw, x, y)
    return np.asarray(canvas.reduce(sharpness), dtype=np.float32) / np.float32(255)


def scratches(
    rng: np.random.Generator,
    size: int,
    count: int,
    length: float,
    spread_deg: float = 180.0,
) -> np.ndarray:
    """(S, S) float32 in [0, 1]: `count` hair lines a texel wide, `length` of a tile long on average."""
    wide = size * 2
    start = rng.random((count, 2)) * wide
    angle = np.radians(spread_deg * (rng.random(count) - 0.5))
    reach = length * rng.exponential(1.0, count).clip(0.05, 3) * wide
    ends = start + np.c_[np.cos(angle), np.sin(angle)] * reach[:, None]
    shade = rng.integers(70, 256, count)
    width = rng.integers(1, 4, count)

    def mark(k: int) -> Draw:
        def line(draw: ImageDraw.ImageDraw, x: float, y: float) -> None:
            (x0, y0), (x1, y1) = start[k], ends[k]
            if (
                max(x0, x1) + x >= 0
                and min(x0, x1) + x <= wide
                and max(y0, y1) + y >= 0
                and min(y0, y1) + y <= wide
            ):
                draw.line((x0 + x, y0 + y, x1 + x, y1 + y), fill=int(shade[k]), width=int(width[k]))

        return line

    return ink(size, [mark(k) for k in range(count)])


def turned(outline: np.ndarray, angle: float) -> np.ndarray:
    """An outline (n, 2) turned by `angle` radians about the origin."""
    c, s = np.cos(angle), np.sin(angle)
    return np.asarray(outline @ np.array([[c, s], [-s, c]]))


def stack(size: int, outlines: Sequence[np.ndarray]) -> np.ndarray:
    """(2S, 2S) int32: which polygon lies on top, 0 for none, k + 1 for outlines[k], later ones above.

    outlines: (n, 2) corners in tile units; they wrap around. Turn it into a map with `shade`.
    """
    wide = size * 2
    canvas = Image.new("I", (wide, wide), 0)
    draw = ImageDraw.Draw(canvas)
    for k, outline in enumerate(outlines):
        low, high = np.floor(outline.min(0)).astype(int), np.floor(outline.max(0)).astype(int)
        for i in range(-high[0], 1 - low[0]):
            for j in range(-high[1], 1 - low[1]):
                draw.polygon(((outline + np.array((i, j))) * wide).ravel().tolist(), fill=k + 1)
    return np.asarray(canvas)


def shade(index: np.ndarray, values: np.ndarray, ground: float = 0.0) -> np.ndarray:
    """(S, S) float32: a value per polygon of `stack`, edges anti-aliased by averaging 2 x 2."""
    table = np.r_[ground, values].astype(np.float32)
    fine = table[index]
    return (fine[::2, ::2] + fine[1::2, ::2] + fine[::2, 1::2] + fine[1::2, 1::2]) / 4
