"""Single pixels of an image that show no light: hot ones, and dead ones, which no list names.

    |x - nearest of the 8 around| > FAR sigma,     and > DETAIL times what those vary by beyond their noise,
    in each colour;      steps of the 4 beside it  < SPREAD of its own

x and the 8 around it are of one site. A lens spreads every point of light over pixels of other colours, a hot
pixel is alone; what is fine detail varies in all colours. Gains of the white balance make colours comparable.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fsid.errors import FsidError
from fsid.sensor.bad_pixels import mended
from fsid.sensor.mosaic import SITE_CHANNEL, site_offsets
from fsid.sensor.raw import NoiseLevel, Raw

_FAR = 5.0  # sigmas; less is noise, in a few pixels of an image
_DETAIL = 2.0
_BY_NOISE = 4.0  # sigmas, what 8 pixels of one light are apart
_SPREAD = 0.1  # share of a point's light in the pixels beside it; lenses leave 0.2 and more
_REACH = 4  # pixels, of all that is looked at around one
_BESIDE = ((0, 1), (0, -1), (1, 0), (-1, 0))


def hot_pixels(raw: Raw, level: NoiseLevel | None = None) -> np.ndarray:
    """(H, W) bool: pixels of `raw` that are far brighter than all around them, or far darker.

    level: noise of `raw`; None takes `raw.noise`. Found are single pixels in calm places, which is where they
    are seen. So would be a light of one colour that no lens spreads. FsidError: an unknown noise level, or
    none that can be.
    """
    level = level if level is not None else raw.noise
    if level is None:
        raise FsidError(
            "the noise level of this RAW is unknown; give one (CameraProfile.level, estimate_noise)"
        )
    level.check()
    light, noise, step = (np.empty_like(raw.mosaic) for _ in range(3))  # as grey surfaces show it
    found = np.zeros(raw.mosaic.shape, bool)
    sites = zip(site_offsets(raw.cfa), level.k, level.sigma2, SITE_CHANNEL, strict=True)
    for (r, c), k, sigma2, channel in sites:
        site, gain = np.s_[r::2, c::2], raw.white_balance[channel]
        plane = raw.mosaic[site]
        lowest, highest = _range_around(plane)
        sigma = np.sqrt(k * highest.clip(min=0) + sigma2)
        beyond = np.maximum(plane - highest, lowest - plane)
        found[site] = beyond > np.maximum(_FAR * sigma, _DETAIL * (highest - lowest - _BY_NOISE * sigma))
        light[site], noise[site], step[site] = gain * plane, gain * sigma, gain * beyond
    rows, columns = np.nonzero(found)
    light, noise = (np.pad(plane, _REACH, mode="reflect") for plane in (light, noise))
    found[rows, columns] = _is_alone(light, noise, step[rows, columns], rows + _REACH, columns + _REACH)
    return found


def without_hot_pixels(raw: Raw, level: NoiseLevel | None = None) -> tuple[Raw, int]:
    """`raw` with its `hot_pixels` made of those of their site around them, and how many they are."""
    found = hot_pixels(raw, level)
    return replace(raw, mosaic=mended(raw.mosaic, found)), int(np.count_nonzero(found))


def _range_around(plane: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The least and the greatest of the 8 values around each of `plane` (h, w), mirrored at its borders."""
    padded, (height, width) = np.pad(plane, 1, mode="reflect"), plane.shape
    lowest, highest = np.full_like(plane, np.inf), np.full_like(plane, -np.inf)
    for r in range(3):
        for c in range(3):
            if (r, c) != (1, 1):
                part = padded[r : r + height, c : c + width]
                np.minimum(lowest, part, out=lowest)
                np.maximum(highest, part, out=highest)
    return lowest, highest


def _is_alone(
    light: np.ndarray, noise: np.ndarray, step: np.ndarray, rows: np.ndarray, columns: np.ndarray
) -> np.ndarray:
    """(n,) bool: pixels (rows, columns) of `step` (n,) around which no other colour varies or takes part."""
    alone = np.ones(step.shape, bool)
    for offsets in _other_sites():
        around = np.array([light[rows + r, columns + c] for r, c in offsets])
        by_noise = _BY_NOISE * noise[rows + offsets[0][0], columns + offsets[0][1]]
        alone &= step > _DETAIL * (np.ptp(around, axis=0) - by_noise)
    share = np.zeros(step.shape, np.float32)
    for r, c in _BESIDE:
        farther = ((3 * r, 3 * c), (r + 2 * c, c + 2 * r), (r - 2 * c, c - 2 * r))
        share += light[rows + r, columns + c]
        share -= np.mean([light[rows + a, columns + b] for a, b in farther], axis=0)
    return alone & (np.abs(share) / len(_BESIDE) < _SPREAD * step)


def _other_sites() -> Iterator[list[tuple[int, int]]]:
    """Offsets to the pixels of each other site among 5 x 5."""
    for row, column in ((0, 1), (1, 0), (1, 1)):
        yield [(r, c) for r in range(-2, 3) for c in range(-2, 3) if (r % 2, c % 2) == (row, column)]
