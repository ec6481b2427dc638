"""How much work goes into a frame: numbers of taps and sizes of shadow maps.

All taps lie on sunflower spirals (Vogel 1979), the same for every pixel: no dither, no noise. Those of
occlusion are four, one for each block of a square of 2 x 2; what they differ by is smoothed away.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

_GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


@dataclass(frozen=True)
class Quality:
    """search_taps, filter_taps: per shadow. occlusion_taps: per block. probes: per texture footprint.

    shadow_px: edge of a shadow map's tile, texels. shots: at most so many images for one blurred by movement.
    """

    search_taps: int
    filter_taps: int
    occlusion_taps: int
    probes: float
    shadow_px: int
    shots: int


QUALITIES = {
    "high": Quality(search_taps=8, filter_taps=16, occlusion_taps=128, probes=4.0, shadow_px=1024, shots=64),
    "fast": Quality(search_taps=6, filter_taps=9, occlusion_taps=32, probes=2.0, shadow_px=512, shots=24),
}


def tap_table(quality: Quality) -> np.ndarray:
    """(3, N, 2) float32 points of the unit disc: search, filter, where the spirals of occlusion begin; the
    rest of a row is unused."""
    rows = (
        spiral(quality.search_taps),
        spiral(quality.filter_taps),
        first_of_woven(quality.occlusion_taps),
    )
    table = np.zeros((3, max(len(row) for row in rows), 2), np.float32)
    for target, row in zip(table, rows, strict=True):
        target[: len(row)] = row
    return table


def spiral(count: int) -> np.ndarray:
    """(count, 2) points of a sunflower spiral on the unit disc, centred."""
    i = np.arange(count)
    points = _polar(np.sqrt((i + 0.5) / count), i * _GOLDEN_ANGLE)
    return np.asarray(points - points.mean(0))


def first_of_woven(count: int) -> np.ndarray:
    """(4, 2) first points of four spirals of `count` points each, radius ~ index, that together are one;
    in the unit disc. shaders/occlusion.frag goes on from them."""
    i = np.arange(4)
    return _polar((i + 0.5) / (4 * count), i * _GOLDEN_ANGLE)


def _polar(radius: np.ndarray, angle: np.ndarray) -> np.ndarray:
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
