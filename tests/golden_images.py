"""Pictures against references: 8-bit sRGB in tests/golden, and what differs in test-output/ on a failure.

The tolerance is what another driver's rasterisation of edges and rounding of texture filters may cost: a mean
difference of 0.5 % of full scale and 8 % at the 99.9th percentile, after a 3 x 3 average. To make new
references, look at the images in test-output, then run the test with FSID_UPDATE_GOLDEN=1.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.ndimage import uniform_filter

GOLDEN = Path(__file__).parent / "golden"
OUTPUT = Path(__file__).resolve().parents[1] / "test-output"
MEAN_TOLERANCE, PEAK_TOLERANCE = 0.005, 0.08


def encoded(radiance: np.ndarray, exposure: float) -> np.ndarray:
    """sRGB, 0..1."""
    x = np.clip(radiance * exposure, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 1e-9) ** (1 / 2.4) - 0.055)


def difference_from(name: str, image: np.ndarray) -> np.ndarray:
    """|image - reference| after a 3 x 3 average; the reference is made anew where the environment asks."""
    if os.environ.get("FSID_UPDATE_GOLDEN"):
        _save(GOLDEN / f"{name}.png", image)
    return np.asarray(uniform_filter(np.abs(image - _reference(name)), (3, 3, 0)))


def too_different(difference: np.ndarray) -> str:
    """What exceeds the tolerance; empty where nothing does."""
    mean, peak = difference.mean(), np.quantile(difference, 0.999)
    return f"mean {mean:.4f}, 99.9 % {peak:.4f}" if mean > MEAN_TOLERANCE or peak > PEAK_TOLERANCE else ""


def keep_failure(name: str, image: np.ndarray, difference: np.ndarray) -> str:
    """Write image, reference and five times the difference; where they are."""
    for suffix, picture in (
        ("image", image),
        ("reference", _reference(name)),
        ("difference", difference * 5),
    ):
        _save(OUTPUT / f"{name}-{suffix}.png", picture)
    return f"see {OUTPUT.name}/{name}-*.png"


def _reference(name: str) -> np.ndarray:
    return np.asarray(Image.open(GOLDEN / f"{name}.png"), dtype=float) / 255


def _save(path: Path, image: np.ndarray) -> None:
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(np.rint(np.clip(image, 0, 1) * 255).astype(np.uint8)).save(path, optimize=True)
