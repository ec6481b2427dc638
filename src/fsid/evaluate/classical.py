"""The classical denoiser: stabilise the variance, average similar patches, invert without bias.

    y = 2 sqrt(p + 3/8 + s^2),  p = x / k,  s^2 = sigma2 / k^2      (generalised Anscombe: Var(y) = 1)

The smoother is BM3D where the package `bm3d` is installed (its licence is non-commercial, so FSID never
depends on it), else non-local means; it runs on the four CFA planes together, since an edge is an edge in
all of them. The inverse is the closed form of the exact unbiased one; the algebraic inverse would darken the
shadows. Sources: Dabov et al. 2007 (BM3D); Buades et al. 2005 (non-local means); Mäkitalo & Foi,
"Optimal Inversion of the Generalized Anscombe Transformation for Poisson-Gaussian Noise", IEEE TIP 2013, the
closed-form approximation.
"""

from __future__ import annotations

import dataclasses
from importlib.util import find_spec

import numpy as np
from skimage.restoration import denoise_nl_means

from fsid.sensor import NoiseLevel, Raw, pack, unpack
from fsid.sensor.raw import check_raw, noise_to_remove

# The best RAW PSNR over ISO 800 to 6400 on photographs, so that the rival is at its best.
STRENGTH = 0.5
PATCH_PX = 3
SEARCH_PX = 7
HADAMARD = np.array([[1, 1, 1, 1], [1, 1, -1, -1], [1, -1, -1, 1], [1, -1, 1, -1]], np.float32) / 2


def denoise_classical(raw: Raw, level: NoiseLevel | None = None) -> Raw:
    """Denoise a RAW by BM3D, or else non-local means, in the variance-stabilised domain.

    level: the noise; by default that of the file. FsidError where `raw` is no `Raw` or holds NaN or infinity,
    and where the noise is unknown or not physical.
    """
    check_raw(raw)
    level = noise_to_remove(raw, level)
    k = np.maximum(np.asarray(level.k, np.float32), 1e-8)[:, None, None]
    s2 = np.asarray(level.sigma2, np.float32)[:, None, None] / k**2
    stable = _anscombe(pack(raw.mosaic, raw.cfa) / k, s2)
    smooth = _bm3d(stable) if bm3d_installed() else _nl_means(stable)
    return dataclasses.replace(raw, mosaic=unpack(_unbiased_inverse(smooth, s2) * k, raw.cfa), noise=None)


def bm3d_installed() -> bool:
    """Whether the classical denoiser is BM3D."""
    return find_spec("bm3d") is not None


def _bm3d(stable: np.ndarray) -> np.ndarray:
    """Groups are matched on the first plane of a Hadamard transform, the planes' mean, and filtered in all.

    It is orthonormal, so noise stays of variance 1 and independent from plane to plane.
    """
    import bm3d

    planes = np.tensordot(HADAMARD, stable, axes=1)
    smooth = bm3d.bm3d(np.moveaxis(planes, 0, -1), np.ones(4))
    return np.tensordot(HADAMARD, smooth, axes=(0, -1))


def _nl_means(stable: np.ndarray) -> np.ndarray:
    return denoise_nl_means(
        stable,
        patch_size=PATCH_PX,
        patch_distance=SEARCH_PX,
        h=STRENGTH,
        sigma=1.0,
        fast_mode=True,
        channel_axis=0,
    )


def _anscombe(counts: np.ndarray, s2: np.ndarray) -> np.ndarray:
    return 2.0 * np.sqrt(np.maximum(counts + 0.375 + s2, 0.0))


def _unbiased_inverse(y: np.ndarray, s2: np.ndarray) -> np.ndarray:
    """E(x) from E(y) in closed form; its pole is at y = 0, so what is below 1 counts as 1."""
    y = np.maximum(y, 1.0)
    root = np.sqrt(1.5)
    return y**2 / 4 + root / 4 / y - 11 / 8 / y**2 + 5 * root / 8 / y**3 - 0.125 - s2
