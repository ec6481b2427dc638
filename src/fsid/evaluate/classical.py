"""The classical denoiser: stabilise the variance, average similar patches, invert without bias.

    y = 2 sqrt(p + 3/8 + s^2),  p = x / k,  s^2 = sigma2 / k^2      (generalised Anscombe: Var(y) = 1)

Non-local means runs on the four CFA planes together, since an edge is an edge in all of them. The inverse is
the closed form of the exact unbiased one; the algebraic inverse would darken the shadows.
Sources: Buades et al. 2005 (non-local means); Mäkitalo & Foi, "Optimal Inversion of the Generalized
Anscombe Transformation for Poisson-Gaussian Noise", IEEE TIP 2013, the closed-form approximation.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from skimage.restoration import denoise_nl_means

from fsid.errors import FsidError
from fsid.sensor import NoiseLevel, Raw, pack, unpack

# The best RAW PSNR over ISO 800 to 6400 on photographs, so that the rival is at its best.
STRENGTH = 0.5
PATCH_PX = 3
SEARCH_PX = 7


def denoise_classical(raw: Raw, level: NoiseLevel | None = None) -> Raw:
    """Denoise a RAW by non-local means in the variance-stabilised domain.

    level: the noise; by default that of the file. FsidError where neither is known.
    """
    level = level or raw.noise
    if level is None:
        raise FsidError(f"{raw.camera}: the noise level is unknown, give a profile and an ISO")
    k = np.maximum(np.asarray(level.k, np.float32), 1e-8)[:, None, None]
    s2 = np.asarray(level.sigma2, np.float32)[:, None, None] / k**2
    stable = _anscombe(pack(raw.mosaic, raw.cfa) / k, s2)
    smooth = denoise_nl_means(
        stable,
        patch_size=PATCH_PX,
        patch_distance=SEARCH_PX,
        h=STRENGTH,
        sigma=1.0,
        fast_mode=True,
        channel_axis=0,
    )
    return dataclasses.replace(raw, mosaic=unpack(_unbiased_inverse(smooth, s2) * k, raw.cfa), noise=None)


def _anscombe(counts: np.ndarray, s2: np.ndarray) -> np.ndarray:
    return 2.0 * np.sqrt(np.maximum(counts + 0.375 + s2, 0.0))


def _unbiased_inverse(y: np.ndarray, s2: np.ndarray) -> np.ndarray:
    """E(x) from E(y), for y above the value 2 sqrt(3/8 + s^2) that y has at x = 0; linear below it."""
    y = np.maximum(y, 1.0)
    root = np.sqrt(1.5)
    return y**2 / 4 + root / 4 / y - 11 / 8 / y**2 + 5 * root / 8 / y**3 - 0.125 - s2
