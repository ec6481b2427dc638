"""Image distances, pinned: PSNR with peak 1, and SSIM with a Gaussian window of sigma 1.5 (11x11).

    PSNR = -10 log10(mean((a - b)^2))

Both images are clipped to 0..1 first, for every method alike: what lies outside cannot be displayed.
"""

from __future__ import annotations

import numpy as np
from skimage.metrics import structural_similarity

from fsid.errors import FsidError

_WINDOW_PX = 11
_BRIGHTEST_MEAN = 2.0
"""Of a truth: one of 0..1 has less even where a sensor is saturated, one of 0..255 more unless black."""


def psnr(image: np.ndarray, truth: np.ndarray) -> float:
    """Peak signal-to-noise ratio in dB of two arrays of equal shape, 0..1; inf where equal.

    NaN where a value is infinite or NaN: clipped, an image of such values would be white, and comparable.
    Tensors of PyTorch on a CPU will do, too.

    FsidError for arrays of different shapes or of integers, and for a truth that looks like 0..255.
    """
    image, truth = np.asarray(image), np.asarray(truth)
    _check_alike(image, truth)
    if not (np.isfinite(image).all() and np.isfinite(truth).all()):
        return float("nan")
    _check_range(truth)
    error = np.mean(np.square(np.clip(image, 0, 1) - np.clip(truth, 0, 1), dtype=np.float64))
    return float(-10.0 * np.log10(error)) if error != 0 else float("inf")


def ssim(image: np.ndarray, truth: np.ndarray) -> float:
    """Structural similarity (Wang et al. 2004) of two (H, W, 3) images, range 0..1, mean over channels.

    NaN as in `psnr`.
    FsidError as in `psnr`, and for images of less than 11x11 pixels.
    """
    image, truth = np.asarray(image), np.asarray(truth)
    _check_alike(image, truth)
    if image.ndim != 3 or min(image.shape[:2]) < _WINDOW_PX:
        raise FsidError(
            f"SSIM takes (H, W, 3) images of at least {_WINDOW_PX}x{_WINDOW_PX}, not {image.shape}"
        )
    if not (np.isfinite(image).all() and np.isfinite(truth).all()):
        return float("nan")
    _check_range(truth)
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


def _check_alike(image: np.ndarray, truth: np.ndarray) -> None:
    """NumPy would stretch one shape to the other, and the clip to 0..1 makes white of all whole numbers."""
    if image.shape != truth.shape:
        raise FsidError(f"images of shapes {image.shape} and {truth.shape} cannot be compared")
    if image.dtype.kind != "f" or truth.dtype.kind != "f":
        raise FsidError(
            f"images of {image.dtype} and {truth.dtype}: give values in 0..1; divide 8-bit ones by 255"
        )


def _check_range(truth: np.ndarray) -> None:
    """Clipped, a picture of 0..255 is white. An image may hold anything: a diverged network has a figure."""
    if truth.size and (mean := float(np.mean(truth, dtype=np.float64))) > _BRIGHTEST_MEAN:
        raise FsidError(f"truth: its mean is {mean:.4g}, of values in 0..1; divide those of 8 bits by 255")
