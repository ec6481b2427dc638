"""Noise that the camera cut off, drawn anew: networks know noise on both sides of black.

    y ~ N(mu, tau^2) where y < lowest,    tau^2 = k mu + sigma2,    mu >= 0:  E max(y, lowest) = first result

Where DN 0 lies less than a few sigma below black (many cameras store black as 0), shadows are brighter than
their light by up to 0.4 sigma, each colour by its own, and a network that was trained on cameras of a higher
black level takes that for light. A first result tells mu, by the mean of a censored normal distribution
(Tobin 1958), and mu what the noise was: every pixel that is cut off gets noise of its own again, down to
where the network has seen it, and is denoised as any other. Of the mean nothing is left to correct.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter
from scipy.special import ndtr, ndtri

from fsid.sensor.mosaic import site_offsets
from fsid.sensor.raw import NoiseLevel, Raw

_NEAR = 0.9
_SIGNIFICANT = 5.0  # standard errors
_BRIGHT = 0.5  # x above which many pixels of one value are saturated, and not a light without noise
_LEAST_SHARE = 1e-3  # of the pixels; fewer do not pay for a second pass
_REACH = 4.5  # sigmas above `lowest`, from which on no noise is cut off
_U = np.linspace(-1.0, _REACH, 1101)  # light is never below black, and a first result by little
_MEAN = _U * ndtr(_U) + np.exp(-_U * _U / 2) / np.sqrt(2 * np.pi)
_AROUND, _BY_CHANCE = 15, 0.2  # side of a neighbourhood, and what the share in it may be off
_PASSES = 3
_LEAST_TAU = 1e-6


def lowest_levels(raw: Raw, known: float) -> tuple[float | None, ...]:
    """Of each site R, Gr, Gb, B the x at which its noise is cut off, half a DN above the least value; None
    where it is not: clearly more pixels have the least value than the next DN, and it is black or below.

    known: the x down to which the network has seen noise; what is cut off near there is nothing new to it.
    All None where few pixels are cut off.
    """
    dn, found, count = _dn(raw), [], 0
    for r, c in site_offsets(raw.cfa):
        site = raw.mosaic[r::2, c::2]
        least = float(site.min())
        at_least = _heaped(site - least, dn) if _NEAR * known < least < dn / 2 else 0
        found.append(least + dn / 2 if at_least else None)
        count += at_least
    return tuple(found) if count >= _LEAST_SHARE * raw.mosaic.size else (None,) * 4


def highest_levels(raw: Raw) -> tuple[float, ...]:
    """Of each site R, Gr, Gb, B the x that nothing in it exceeds: where it saturates, which many sensors do
    below the white level, so that clearly more pixels have the greatest value than the DN before it. Else the
    white level or the brightest pixel of all sites."""
    brightest = max(1.0, float(raw.mosaic.max()))
    greatest = [
        (site, float(site.max())) for site in (raw.mosaic[r::2, c::2] for r, c in site_offsets(raw.cfa))
    ]
    return tuple(x if x > _BRIGHT and _heaped(x - site, _dn(raw)) else brightest for site, x in greatest)


def _dn(raw: Raw) -> float:
    return 1 / (raw.white_level - raw.black_level)


def _heaped(distance: np.ndarray, dn: float) -> int:
    """How many pixels lie at distance 0, where these are clearly more than those one DN on; else 0."""
    here, up_to_next = (int(np.count_nonzero(distance <= x)) for x in (dn / 2, 1.5 * dn))
    return here if 2 * here - up_to_next > _SIGNIFICANT * up_to_next**0.5 else 0


def drawn_anew(
    raw: Raw, first: np.ndarray, level: NoiseLevel, lowest: tuple[float | None, ...], known: float
) -> np.ndarray:
    """The mosaic (H, W) of `raw`, with noise in the place of what is cut off at `lowest`, as far as `known`.

    first: (H, W), the result of denoising it as it is. The same image gets the same noise. Where more pixels
    are cut off than noise at black leaves, they are dark for another reason, and stay.
    """
    rng = np.random.default_rng(0)
    mosaic = raw.mosaic.astype(np.float32)
    for (r, c), k, sigma2, limit in zip(site_offsets(raw.cfa), level.k, level.sigma2, lowest, strict=True):
        if limit is None:
            continue
        site = mosaic[r::2, c::2]
        least, is_cut = float(site.min()), site <= limit
        at_black = ndtr(limit / max(sigma2**0.5, _LEAST_TAU))
        is_cut &= uniform_filter(is_cut.astype(np.float32), _AROUND) < at_black + _BY_CHANCE
        mean = first[r::2, c::2][is_cut].astype(np.float64)
        light = mean.clip(min=0)
        for _ in range(_PASSES):
            tau = np.sqrt(np.maximum(k * light + sigma2, _LEAST_TAU**2))
            u = (mean - least) / tau
            light = np.where(u < _REACH, least + tau * np.interp(u, _MEAN, _U), mean).clip(min=0)
        share = rng.random(light.size) * ndtr((limit - light) / tau)
        site[is_cut] = np.maximum(light + tau * ndtri(share), known)
    return mosaic
