"""Auto-exposure: how many times the scene's light becomes the sensor's full scale.

    gain = min(key / median(Y), 1 / percentile(Y, 100 - clipped)),      Y = luminance of the frame

A camera meters the scene to a mid-grey and backs off for highlights, and neither exactly. So `key` is
log-uniform over 0.05 to 0.5 (an 18 % card, from 1.5 stops over to two under) and the share of pixels that
may reach saturation is log-uniform over 0.005 % to 25 %: a white sky or snow burns out in one photograph in
twenty, and a denoiser that never saw it loses most there (docs/results.md).
Low light needs no darker image: the camera answers it with ISO, and ISO sets the noise.
"""

from __future__ import annotations

import numpy as np

from fsid.errors import FsidError
from fsid.sensor.colour import SRGB_TO_XYZ

KEY_RANGE = (0.05, 0.5)
CLIPPED_PERCENT_RANGE = (0.005, 25.0)


def exposure_rand(rng: np.random.Generator, radiance: np.ndarray) -> float:
    """Draw the factor that takes linear sRGB `radiance` (H, W, 3) >= 0 to units of sensor saturation."""
    if not np.all(np.isfinite(radiance)):
        raise FsidError("the frame holds NaN or infinite radiance; check its lights and materials")
    luminance = radiance.astype(np.float32, copy=False) @ SRGB_TO_XYZ[1].astype(np.float32)
    key = np.exp(rng.uniform(*np.log(KEY_RANGE)))
    clipped_percent = np.exp(rng.uniform(*np.log(CLIPPED_PERCENT_RANGE)))
    middle, highlight = np.percentile(luminance, (50, 100 - clipped_percent))
    if highlight <= 0:
        return 1.0
    return float(min(key / middle, 1 / highlight)) if middle > 0 else float(1 / highlight)


def expose(rng: np.random.Generator, radiance: np.ndarray) -> np.ndarray:
    """`radiance` (H, W, 3) scaled so that 1 is saturation; (H, W, 3) float32, highlights above 1 kept.

    The sensor's channels saturate one by one, so `unprocess.linear_to_camera` does the clipping.
    """
    return radiance.astype(np.float32, copy=False) * np.float32(exposure_rand(rng, radiance))
