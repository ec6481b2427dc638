"""Image distances, pinned: PSNR with peak 1, and SSIM with a Gaussian window of sigma 1.5 (11x11).

    PSNR = -10 log10(mean((a - b)^2))

Both images are clipped to 0..1 first, for every method alike: what lies outside cannot be displayed.
"""

from __future__ import annotations

import numpy as np
from skimage.metrics import structural_similarity


def psnr(image: np.ndarray, truth: np.ndarray) -> float:
    """Peak signal-to-noise ratio in dB of two arrays of equal shape, 0..1; inf where equal, NaN of NaN."""
    error = np.mean(np.square(np.clip(image, 0, 1) - np.clip(truth, 0, 1), dtype=np.float64))
    return float(-10.0 * np.log10(error)) if error != 0 else float("inf")


def ssim(image: np.ndarray, truth: np.ndarray) -> float:
    """Structural similarity (Wang et al. 2004) of two (H, W, 3) images, range 0..1, mean over channels."""
    return float(
        structural_similarity(
            np.clip(image, 0, 1),
            np.clip(truth, 0, 1),
            gaussian_weights=True,
            sigma=1.5,
            use_sample_covariance=False,
            data_range=1.0,
            channel_axis=2,
        )
    )
