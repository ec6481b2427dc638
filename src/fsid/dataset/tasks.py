"""What a task makes of a frame: the truth and what the camera sees instead, both still noise-free light.

    denoise            seen = truth
    super-resolution   seen = truth * PSF, averaged over scale x scale pixels        PSF: Gaussian

The PSF is the lens: its sigma is drawn between a quarter and half a pixel of the small image, for each axis
by itself (astigmatism), so that the lens resolves neither much more than the pixels do nor much less. The
average is the pixel, which collects light over its whole area. Both are linear, and come before the colour
filters.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

PSF_SIGMA_PX = (0.25, 0.5)
"""Range of the lens' sigma in pixels of the small image."""


@dataclass(frozen=True)
class Views:
    """What one frame gives. Light of any unit, linear unless it comes from a photograph.

    truth: (H, W, 3). seen: images (H / scale, W / scale, 3) of which noisy RAWs are made, the first one the
    task's main input. facts: what was drawn, for the record.
    """

    truth: np.ndarray
    seen: tuple[np.ndarray, ...]
    scale: int = 1
    facts: dict[str, Any] = field(default_factory=dict)


def smaller(rng: np.random.Generator, truth: np.ndarray, scale: int) -> Views:
    """Super-resolution: `truth` (H, W, 3), linear, as a lens and `scale` times larger pixels see it.

    Rows and columns beyond a multiple of 2 * scale are dropped.
    """
    height, width = (size // (2 * scale) * 2 * scale for size in truth.shape[:2])
    truth = truth[:height, :width]
    sigma_px = [float(sigma) for sigma in rng.uniform(*PSF_SIGMA_PX, size=2)]
    blurred = gaussian_filter(truth, [sigma * scale for sigma in sigma_px] + [0], mode="nearest")
    small = blurred.reshape(height // scale, scale, width // scale, scale, 3).mean((1, 3), dtype=np.float32)
    return Views(truth, (small,), scale, {"scale": scale, "psf_sigma_px": sigma_px})
