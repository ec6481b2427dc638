"""RAW to picture, the plain way: the same for every image, so that pictures can be compared.

    srgb = e(2^b CCM demosaic(min(white_balance shading x, saturation)))

The shading is what the gain maps of a phone's DNG make even, 1 where there are none. b is its
BaselineExposure: a phone that exposed for the highlights means its pictures to be shown brighter. One below
0 is left to converters that have a tone curve, since it would make white grey.

White balance comes before demosaicing (the interpolation mixes colours and wants them alike) and is followed
by a clip at the level that every channel can reach, so that a saturated highlight is white and not pink.
Nothing is clipped at black before the last step: noise below black must average out, not brighten shadows.
"""

from __future__ import annotations

import numpy as np

from fsid.sensor.colour import apply_matrix, camera_to_srgb_matrix
from fsid.sensor.demosaic import demosaic
from fsid.sensor.gain_maps import shading_gains
from fsid.sensor.mosaic import SITE_CHANNEL, site_offsets
from fsid.sensor.raw import Raw, check_raw
from fsid.sensor.tone import srgb_encode

_TURNED, _UPSIDE_DOWN, _MIRRORED = {5, 6, 7, 8}, {3, 4, 7, 8}, {2, 3, 6, 7}  # orientations
_MOST_STOPS = 8.0  # more than any camera means
_STRIP = 8  # rows at once: what is in between stays in the cache


def develop(raw: Raw) -> np.ndarray:
    """Picture (H, W, 3) float32, sRGB-encoded 0..1, of a RAW of at least 4x4 pixels. No tone curve.

    A phone's DNG is shown as bright and as even as it asks for (BaselineExposure, gain maps).
    """
    check_raw(raw)
    exposure = 2 ** min(max(0.0, raw.metadata.baseline_exposure), _MOST_STOPS)  # 0 where it is NaN
    picture, matrix = _camera_rgb(raw), camera_to_srgb_matrix(raw.xyz_to_camera) * np.float32(exposure)
    for first in range(0, len(picture), _STRIP):
        rows = slice(first, first + _STRIP)
        picture[rows] = srgb_encode(apply_matrix(matrix, picture[rows]))
    return picture


def develop_linear(raw: Raw) -> np.ndarray:
    """Linear sRGB (H, W, 3) float32; 1 is sensor saturation, values below 0 and above 1 are kept."""
    check_raw(raw)
    return apply_matrix(camera_to_srgb_matrix(raw.xyz_to_camera), _camera_rgb(raw))


def _camera_rgb(raw: Raw) -> np.ndarray:
    """(H, W, 3) float32, white-balanced."""
    gains = np.asarray(raw.white_balance, np.float32) / np.float32(min(raw.white_balance))
    balanced = raw.mosaic.astype(np.float32)
    shading = shading_gains(raw.metadata.opcodes_of_linear, raw.mosaic.shape)
    if shading is not None:
        balanced *= shading
    for (r, c), channel in zip(site_offsets(raw.cfa), SITE_CHANNEL, strict=True):
        balanced[r::2, c::2] *= gains[channel]
    np.minimum(balanced, 1, out=balanced)
    return demosaic(balanced, raw.cfa)


def upright(picture: np.ndarray, orientation: int) -> np.ndarray:
    """A picture (H, W, ...) as it is to be looked at; orientation: 1..8 of TIFF 6.0, else as it is."""
    turned = picture.swapaxes(0, 1) if orientation in _TURNED else picture
    return turned[:: -1 if orientation in _UPSIDE_DOWN else 1, :: -1 if orientation in _MIRRORED else 1]
