"""What is left of sharpness behind a real lens: radiance convolved with its point spread.

    softened = G(softness_px) * radiance,      G a Gaussian, the usual model of aberrations, diffraction and
                                               low-pass filter together

Photographs are seldom as sharp as their pixels. A denoiser trained on nothing but pixel-sharp renders keeps
noise of the highest frequencies, because it takes it for detail (docs/results.md).
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

_TRUNCATE = 3.0  # standard deviations; beyond lie 0.3 % of the light


def soften(radiance: np.ndarray, softness_px: float) -> np.ndarray:
    """`radiance` (H, W, 3) through a Gaussian of standard deviation `softness_px` pixels; 0 leaves it."""
    for axis in (0, 1) if softness_px > 0 else ():
        radiance = gaussian_filter1d(radiance, softness_px, axis=axis, mode="nearest", truncate=_TRUNCATE)
    return radiance
