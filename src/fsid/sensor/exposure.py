"""Auto-exposure and auto white balance: how many times the scene's light becomes the sensor's full scale.

    gains = e o b,   b = (world / c)^w,   e = min(key / median(Y b), 1 / percentile(Y b, 100 - clipped))

Y is the luminance of a pixel and c, per channel, the mean over the frame of colour / luminance. White balance
as cameras do it, by what they see: an average scene is taken for the `world`, and the frame is moved towards
it by a share w, uniform over 0.1 to 0.8. So a red floor fills few photographs with as much red as it has.
A camera meters the scene to a mid-grey and backs off for highlights, and neither exactly. So `key` is
log-uniform over 0.07 to 0.36 (an 18 % card, from a stop over to one and a third under) and the share of
pixels that may reach saturation is log-uniform over 0.005 % to 25 %: a white sky or snow burns out in one
photograph in twenty, and a denoiser that never saw it loses most there (docs/rounds.md). In 3 % of frames
o is 2 to 6 instead of 1, log-uniform: overexposed, so that red and blue saturate too, as they do in the skies
of photographs; where a network has never seen that, it darkens them.
Low light needs no darker image: the camera answers it with ISO, and ISO sets the noise.
"""

from __future__ import annotations

import numpy as np

from fsid.errors import FsidError
from fsid.sensor.arrays import check_generator
from fsid.sensor.colour import SRGB_TO_XYZ
from fsid.sensor.unprocess import check_light

KEY_RANGE = (0.07, 0.36)
CLIPPED_PERCENT_RANGE = (0.005, 25.0)
BALANCED_RANGE = (0.1, 0.8)
OVEREXPOSED_SHARE = 0.03
OVEREXPOSED_RANGE = (2.0, 6.0)
WORLD_RGB = (0.98, 1.02, 0.74)
"""What photographs average to at luminance 1, linear sRGB: 100 of BSDS500, geometric mean."""

_LUMINANCE = SRGB_TO_XYZ[1].astype(np.float32)
_STRIP = 32  # rows at once: as double precision they stay in the cache


def exposure_rand(rng: np.random.Generator, radiance: np.ndarray) -> np.ndarray:
    """Draw the factors (3,) that take linear sRGB `radiance` (H, W, 3) >= 0 to units of sensor saturation.

    FsidError for another shape, for integers (a photograph is not linear) and for NaN or infinity.
    """
    check_generator(rng)
    check_light(radiance)
    if not np.all(np.isfinite(radiance)):
        raise FsidError("the frame holds NaN or infinite radiance; check its lights and materials")
    light = radiance.astype(np.float32, copy=False)
    key = np.exp(rng.uniform(*np.log(KEY_RANGE)))
    clipped_percent = np.exp(rng.uniform(*np.log(CLIPPED_PERCENT_RANGE)))
    balance = _to_world(light) ** rng.uniform(*BALANCED_RANGE)
    middle, highlight = np.percentile(light @ (_LUMINANCE * balance), (50, 100 - clipped_percent))
    if highlight <= 0:
        return np.ones(3, np.float32)
    gain = min(key / middle, 1 / highlight) if middle > 0 else 1 / highlight
    overexposed, times = rng.random() < OVEREXPOSED_SHARE, np.exp(rng.uniform(*np.log(OVEREXPOSED_RANGE)))
    gain *= times if overexposed else 1.0
    return (gain * balance).astype(np.float32)


def expose(rng: np.random.Generator, radiance: np.ndarray) -> np.ndarray:
    """`radiance` (H, W, 3) scaled so that 1 is saturation; (H, W, 3) float32, highlights above 1 kept.

    The sensor's channels saturate one by one, so `unprocess.linear_to_camera` does the clipping.
    """
    gains = exposure_rand(rng, radiance)
    return radiance.astype(np.float32, copy=False) * gains


def _to_world(light: np.ndarray) -> np.ndarray:
    """(3,) float32 gains under which the average pixel has the colour `WORLD_RGB`; bounded by 1/4 and 4."""
    luminance = light @ _LUMINANCE
    lit = luminance > 0
    if not lit.any():
        return np.ones(3, np.float32)
    weights = np.divide(1, luminance, out=np.zeros_like(luminance), where=lit)
    total = np.zeros(3)
    for first in range(0, len(light), _STRIP):
        rows = slice(first, first + _STRIP)
        total += weights[rows].ravel().astype(float) @ light[rows].reshape(-1, 3).astype(float)
    mean = total / np.count_nonzero(lit)
    gains = np.clip(np.array(WORLD_RGB) / np.maximum(mean, 1e-6), 0.25, 4.0)
    return gains.astype(np.float32)
