"""Texture, edge and colour statistics of pictures, and how far two sets of pictures lie apart.

    distance(a, b) = W1(a, b) / std(b)         W1: mean difference of sorted values (Wasserstein)

A statistic of a set is a list of values: one per picture (edge ratio, spectrum slope, ...) or, where the
distribution inside a picture matters (gradients, contrast, lightness), `QUANTILES` quantiles per picture.
What is measured is what a denoiser sees: the clean RAW at half resolution, where every pixel has all three
colours and nothing is interpolated, sRGB-encoded so that steps look equally large to people. Photographs come
the same way, through the inverse of their tone curve (Brooks et al. 2019) and a CFA. Distances are read
against a yardstick: the distance between two sets of real photographs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.ndimage import gaussian_filter
from skimage.color import rgb2lab
from skimage.feature import canny

QUANTILES = 32
PATCH_PX = 16
CANNY_SIGMA_PX = 1.0
CANNY_LOW, CANNY_HIGH = 0.04, 0.1
"""Hysteresis thresholds of what Sobel's kernels make of encoded luma: 8 times its slope per pixel."""
FLAT_STD = 2.0 / 255.0
"""A patch whose luma varies by less than this (standard deviation, encoded) is flat."""
BLACK, CLIPPED = 0.08, 0.995
AB_CELL, AB_SHARE = 5.0, 1e-3
"""Cell of the a*b* plane, and the share of pixels from which on it counts as covered."""

_LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)

Values = Mapping[str, np.ndarray]

TITLES: Mapping[str, str] = MappingProxyType(
    {
        "edge_ratio": "edge ratio (share of Canny edge pixels)",
        "gradient": "gradient magnitude, log10",
        "orientation": "gradient orientation, degrees from horizontal",
        "spectrum_slope": "slope of the power spectrum",
        "contrast": "local contrast (patch RMS / mean), log10",
        "flat_share": "share of flat patches",
        "clipped_share": "share of clipped pixels",
        "black_share": "share of near-black pixels",
        "lightness": "lightness L*",
        "exposure": "median lightness L* of a picture",
        "colourfulness": "colourfulness (Hasler and Suesstrunk 2003)",
        "cast_a": "cast of a picture, mean a* (green to red)",
        "cast_b": "cast of a picture, mean b* (blue to yellow)",
        "ab_coverage": "covered cells of the a*b* plane",
        "colour_entropy": "patch-colour entropy, bits",
        "colour_regions": "spread of patch colours within a picture, a*b*",
        "colour_texture": "colour of texture (patch RMS of a*b* / of L*), log10",
    }
)


@dataclass(frozen=True)
class Comparison:
    """One statistic of a set beside a reference. yardstick: distance of two real sets, NaN if unknown."""

    name: str
    mean: float
    reference_mean: float
    distance: float
    yardstick: float

    @property
    def ratio(self) -> float:
        """distance / yardstick; at most 2 is the aim where the yardstick is a second real set."""
        if self.yardstick == 0:
            return 1.0 if self.distance == 0 else float("inf")
        return self.distance / self.yardstick


def measure(image: np.ndarray) -> dict[str, np.ndarray]:
    """All statistics of one picture (H, W, 3), sRGB-encoded 0..1, at least 16 pixels on each side."""
    image = np.asarray(image, np.float32)
    luma = image @ _LUMA
    return {
        "edge_ratio": _one(canny(luma, CANNY_SIGMA_PX, CANNY_LOW, CANNY_HIGH).mean()),
        **_gradients(luma),
        "spectrum_slope": _one(spectrum_slope(luma)),
        **_patches(luma),
        "clipped_share": _one((image.max(-1) >= CLIPPED).mean()),
        "black_share": _one((luma <= BLACK).mean()),
        **_colours(image),
    }


def pool(measured: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """The statistics of a set from those of its pictures (at least one)."""
    return {name: np.concatenate([values[name] for values in measured]) for name in TITLES}


def distance(values: np.ndarray, reference: np.ndarray) -> float:
    """The module's equation; 0 for equal sets, about 1 where they lie a standard deviation apart."""
    from scipy.stats import wasserstein_distance  # slow to import, and generating needs none of it

    spread = float(np.std(reference))
    return float(wasserstein_distance(values, reference)) / max(spread, 1e-6)


def compare(values: Values, reference: Values, other: Values | None = None) -> list[Comparison]:
    """Every statistic of a set beside a reference; `other`, a second real set, gives the yardstick."""
    return [
        Comparison(
            name=name,
            mean=float(values[name].mean()),
            reference_mean=float(reference[name].mean()),
            distance=distance(values[name], reference[name]),
            yardstick=float("nan") if other is None else distance(other[name], reference[name]),
        )
        for name in TITLES
    ]


def spectrum_slope(luma: np.ndarray) -> float:
    """Exponent of power ~ frequency^slope over 0.04 .. 0.35 cycles/pixel; about -2 for natural images.

    Central square, Hann window, mean over directions in logarithmic bands (Field 1987); in pictures of fewer
    than 64 pixels some bands hold no frequency and are left out.
    """
    size = min(luma.shape)
    top, left = ((n - size) // 2 for n in luma.shape)
    square = luma[top : top + size, left : left + size]
    window = np.hanning(size)[:, None] * np.hanning(size)
    power = np.abs(np.fft.rfft2((square - square.mean()) * window)) ** 2
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size))
    edges = np.geomspace(0.04, 0.35, 13)
    band = np.digitize(frequency, edges)
    held = [i for i in range(1, len(edges)) if (band == i).any()]
    levels = [np.log(power[band == i].mean() + 1e-12) for i in held]
    slope, _ = np.polyfit(np.log(np.sqrt(edges[1:] * edges[:-1]))[np.array(held) - 1], levels, 1)
    return float(slope)


def _gradients(luma: np.ndarray) -> dict[str, np.ndarray]:
    """Magnitude per pixel, and direction (0..90 degrees from horizontal) weighted by it."""
    smooth = gaussian_filter(luma, 0.7)
    dy, dx = np.gradient(smooth)
    magnitude = np.hypot(dx, dy).ravel()
    angle_deg = np.degrees(np.arctan2(np.abs(dy), np.abs(dx))).ravel()
    order = np.argsort(angle_deg)
    weight = np.cumsum(magnitude[order]) + 1e-9 * np.arange(1, len(order) + 1)
    at = np.searchsorted(weight, _LEVELS * weight[-1])
    return {
        "gradient": np.quantile(np.log10(magnitude + 1e-3), _LEVELS),
        "orientation": angle_deg[order][np.minimum(at, len(order) - 1)],
    }


def _patches(luma: np.ndarray) -> dict[str, np.ndarray]:
    patches = _patches_of(luma)
    std, mean = patches.std(axis=1), patches.mean(axis=1)
    return {
        "contrast": np.quantile(np.log10(std / np.maximum(mean, 0.02) + 1e-3), _LEVELS),
        "flat_share": _one((std < FLAT_STD).mean()),
    }


def _colours(image: np.ndarray) -> dict[str, np.ndarray]:
    lab = rgb2lab(np.clip(image, 0, 1))
    cells = np.floor(lab[..., 1:] / AB_CELL).astype(int) + 32
    counts = np.bincount((cells[..., 0] * 64 + cells[..., 1]).ravel(), minlength=4096)
    # grey lies in the middle of a cell: at a corner, hardly any colour would be the 2 bits of four cells
    code = (np.clip(lab / (12.5, 25.0, 25.0) + (0, 5.5, 5.5), 0, 15).astype(int) * (256, 16, 1)).sum(-1)
    entropy = [_entropy(patch) for patch in _patches_of(code)]
    red_green = image[..., 0] - image[..., 1]
    yellow_blue = (image[..., 0] + image[..., 1]) / 2 - image[..., 2]
    colourfulness = np.hypot(red_green.std(), yellow_blue.std()) + 0.3 * np.hypot(
        red_green.mean(), yellow_blue.mean()
    )
    return {
        "lightness": np.quantile(lab[..., 0], _LEVELS),
        "exposure": _one(np.median(lab[..., 0])),
        "cast_a": _one(lab[..., 1].mean()),
        "cast_b": _one(lab[..., 2].mean()),
        "colourfulness": _one(colourfulness),
        "ab_coverage": _one((counts > AB_SHARE * counts.sum()).sum()),
        "colour_entropy": np.quantile(entropy, _LEVELS),
        **_colour_scales(lab),
    }


def _colour_scales(lab: np.ndarray) -> dict[str, np.ndarray]:
    """How much colour differs between patches, and within them: in photographs hue belongs to things and
    lightness to their texture."""
    patches = np.stack([_patches_of(lab[..., i]) for i in range(3)])
    spread = np.sqrt(patches.mean(2)[1:].var(1).sum())
    light, *colour = patches.var(2)
    return {
        "colour_regions": _one(spread),
        "colour_texture": np.quantile(0.5 * np.log10((sum(colour) + 0.01) / (light + 0.01)), _LEVELS),
    }


def _entropy(codes: np.ndarray) -> float:
    counts = np.bincount(codes)
    share = counts[counts > 0] / len(codes)
    return float(-(share * np.log2(share)).sum())


def _patches_of(plane: np.ndarray) -> np.ndarray:
    """(n, PATCH_PX^2) patches that tile the plane, the rest at the edge dropped."""
    rows, columns = (n // PATCH_PX for n in plane.shape)
    tiles = plane[: rows * PATCH_PX, : columns * PATCH_PX].reshape(rows, PATCH_PX, columns, PATCH_PX)
    return tiles.swapaxes(1, 2).reshape(-1, PATCH_PX**2)


def _one(value: float) -> np.ndarray:
    return np.array([value], np.float64)


_LEVELS = (np.arange(QUANTILES) + 0.5) / QUANTILES
