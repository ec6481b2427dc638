"""The noise of one RAW image, from nothing but the image: Var(x) = k x + sigma2 per CFA site.

    block (8x8 of one site) -> orthonormal DCT:   mean = DC,   texture? = low AC energy,   V = high AC energy
    V(mean) of the blocks without texture -> line

The coefficients of white noise are independent of each other, so choosing blocks by their low frequencies
leaves the noise in their high ones as it was (Ponomarenko et al. 2007; Colom, Buades & Morel 2014 for RAW). A
block is smooth where its low frequencies hold no more energy than its noise alone would half of the time; the
noise is known better after each round. Blocks of like mean are pooled by their median, and parts of the range
above the line count less than those below it: texture that was missed only ever adds.

In the dark a mean says more of its own noise than of light, and blocks sorted by it show too flat a line
(regression dilution: k came out as 0.06 to 0.5 of itself). So one more coefficient b is taken, whose noise is
independent of that of the mean and of the same size: blocks are sorted by mean + b, and their light is
mean - b, which knows nothing of the noise that sorted them.

Where noise reaches DN 0 it is cut off there, and all of it where black is stored as 0: mean and variance of a
pool are then taken back to those before (`stored_noise`), and it counts less the more was cut off.

The lines of the four sites are fitted together (`blind_lines`). Where hardly any block is smooth, the
smoothest are taken. Texture as fine and random as noise (grain, gravel, grass) cannot be told from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.fft import dctn
from scipy.optimize import nnls
from scipy.special import gammaincinv

from fsid.errors import FsidError
from fsid.sensor.blind_lines import TEXTURE, Lines, Pools, fitted, physical
from fsid.sensor.mosaic import site_offsets
from fsid.sensor.quantise import ROUNDING_DN2
from fsid.sensor.raw import NoiseLevel, Raw, four
from fsid.sensor.stored_noise import before_clipping, censored

UNLIKE = 4.0  # times a variance: two stops of ISO, beyond what texture makes in photographs
LINEAR_SHARE = 0.9  # of the range; brighter blocks are near saturation
_SIDE = 8
_MAX_BLOCKS = 40_000  # of one site
_POOLS = 24
_MIN_POOL = 20  # blocks
_MIN_GROUP = 5  # blocks of a site in a pool, below which their median says nothing
_PART_WIDTH = 0.25  # sigmas of a pixel, which are 2 of the mean of a block
_MIN_BLOCKS = 64  # of all sites
_MIN_SMOOTH = 400  # blocks; a picture with fewer lets in rougher ones, up to `_ROUGHEST`
_ROUGHEST = 4.0  # energy of low frequencies over that of noise
_FIRST_SHARE = 0.05  # of the blocks, the smoothest ones, from which the first line comes
_ROUNDS = 8
_SMOOTH_QUANTILE = 0.5


class NoiselessError(FsidError):
    """The smooth parts of an image hold no noise beyond its rounding."""


@dataclass(frozen=True)
class NoiseEstimate:
    """What one image says of its noise, normalised; errors: one standard error per site R, Gr, Gb, B."""

    level: NoiseLevel
    k_error: tuple[float, float, float, float]
    sigma2_error: tuple[float, float, float, float]


def stated_noise(raw: Raw) -> NoiseLevel | None:
    """The noise that a file states; None where it states none, or zeros, which cameras and converters write
    where they know no better. FsidError: a variance below 0."""
    stated = () if raw.noise is None else (*raw.noise.k, *raw.noise.sigma2)
    if not any(stated):
        return None
    if min(stated) < 0:
        raise FsidError("its NoiseProfile holds a variance below 0")
    return raw.noise


def contradiction(raw: Raw, level: NoiseLevel) -> float | None:
    """Variance that `raw` shows over that of `level`, both in the mean light of the image, where it is above
    `UNLIKE` or below its inverse by two standard errors; None where it is not, or the image does not tell."""
    light = np.array([raw.mosaic[r::2, c::2].clip(0, 1).mean() for r, c in site_offsets(raw.cfa)])
    floor = ROUNDING_DN2 / (raw.white_level - raw.black_level) ** 2
    stated = max(float(np.mean(level.k * light + level.sigma2)), floor)
    try:
        _, lines, _ = _measured(raw)
    except NoiselessError:
        return 0.0 if stated > UNLIKE * floor else None
    except FsidError:
        return None
    variance = lines.sites[:, 0] * light + lines.sites[:, 1]
    fit = np.linalg.norm((lines.spread[:, 0] * light[:, None] + lines.spread[:, 1]).mean(axis=0))
    times, error = variance.mean() / stated, np.hypot(fit, TEXTURE * variance.mean()) / stated
    return times if times - 2 * error > UNLIKE or times + 2 * error < 1 / UNLIKE else None


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Blocks: mean, energy of low frequencies and of high ones, each per coefficient, and CFA site (0..3).

    aside: one number more, of noise that is independent of that of the others and as large as that of the
    mean. share: of a block that no other block holds too; blocks overlap where there are few. lowest: x of
    DN 0, where noise is cut off; -infinity where it does not reach it.
    """

    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray
    aside: np.ndarray
    site: np.ndarray
    share: float
    lowest: float = -np.inf


_ORDER = np.add.outer(np.arange(_SIDE), np.arange(_SIDE))
_LOW, _HIGH = (_ORDER > 0) & (_ORDER < _SIDE), _ORDER >= _SIDE + 2
_ASIDE = (_ORDER >= _SIDE) & (_ORDER < _SIDE + 2)
_LOW_LIMIT = 2 * gammaincinv(_LOW.sum() / 2, _SMOOTH_QUANTILE) / _LOW.sum()  # chi2 quantiles per degree of
_HIGH_MEDIAN = 2 * gammaincinv(_HIGH.sum() / 2, 0.5) / _HIGH.sum()  # freedom; scipy.stats is slow to import
_NEAR_0 = 0.75  # of the way from black to DN 0, beyond which the least value is taken for DN 0
_SEEN = 6  # power of the share that DN 0 leaves, in the weight of a pool (17 photographs: 2 and 6 tried)
_SIGMAS = np.linspace(-0.5, 5, 276)  # of light above DN 0; none is below, but for chance
_NO_WHITE = 1e9  # blocks with saturated pixels do not count
_SHIFT, _LEFT, _ = censored(-_SIGMAS, np.full_like(_SIGMAS, _NO_WHITE))
_MEDIAN_EFFICIENCY = 2 / np.pi  # of the median against the mean


def estimate_noise(raw: Raw) -> NoiseEstimate:
    """k and sigma2 of `raw`, one noisy image of at least 64x64 pixels, with their standard errors.

    sigma2 is never below the rounding noise of the camera's integers. Fixed pattern noise counts as noise.
    FsidError: an image without smooth parts, saturated or without noise: nothing to measure.
    """
    pools, lines, floor = _measured(raw)
    sites = [physical(pools, number, lines, floor) for number in range(4)]
    (k, sigma2), (k_error, sigma2_error) = np.transpose(sites, (1, 2, 0))
    return NoiseEstimate(NoiseLevel(four(k), four(sigma2)), four(k_error), four(sigma2_error))


def _measured(raw: Raw) -> tuple[Pools, Lines, float]:
    """The pools of `raw`, the lines through them, and the variance of its rounding. FsidError: as above."""
    span = raw.white_level - raw.black_level
    near_0 = (1 - _NEAR_0 * raw.black_level) / span
    planes = [raw.mosaic[r::2, c::2] for r, c in site_offsets(raw.cfa)]
    blocks = _together([_blocks(plane, number, near_0) for number, plane in enumerate(planes)])
    floor = ROUNDING_DN2 / span**2
    if blocks.mean.size < _MIN_BLOCKS:
        raise FsidError(
            "the image is too small, or saturated or at DN 0 almost everywhere, to tell its noise"
        )
    first = _first_line(blocks, floor)
    lines = Lines(first, np.tile(first, (4, 1)), np.zeros((4, 2, 0)))
    for _ in range(_ROUNDS):
        pools = _pools(blocks, lines)
        lines = fitted(pools, lines, floor)
    if lines.common[0] == 0 and lines.common[1] <= floor:
        raise NoiselessError("the image holds no noise beyond its rounding; there is nothing to measure")
    light = np.array([np.average(pools.mean.clip(min=0), weights=pools.freedom.clip(min=1e-9)), 1.0])
    if np.linalg.norm(light @ lines.spread.mean(axis=0)) > light @ lines.common:
        raise FsidError("the image does not tell its noise: too few smooth parts")
    return pools, lines, floor


def _together(sites: Sequence[_Blocks]) -> _Blocks:
    parts = ("mean", "low", "high", "aside", "site")
    mean, low, high, aside, site = (np.concatenate([getattr(s, part) for s in sites]) for part in parts)
    return _Blocks(mean, low, high, aside, site, sites[0].share, max(s.lowest for s in sites))


def _blocks(plane: np.ndarray, site: int, near_0: float) -> _Blocks:
    """Blocks of `plane` (h, w) in an even grid, overlapping where there are few; without saturated ones.

    site: whose plane it is. near_0: x below which the least value is that of DN 0; where that lies, sites
    differ in a little.
    """
    height, width = plane.shape
    step = _SIDE
    while step > 2 and (height // step) * (width // step) < _MAX_BLOCKS:
        step //= 2
    share = (step / _SIDE) ** 2
    if min(height, width) < _SIDE:
        none = np.empty(0, np.float32)
        return _Blocks(none, none, none, none, np.empty(0, np.intp), share)
    tiles = np.lib.stride_tricks.sliding_window_view(plane, (_SIDE, _SIDE))[::step, ::step]
    tiles = tiles.reshape(-1, _SIDE, _SIDE)
    tiles = tiles[:: max(1, len(tiles) // _MAX_BLOCKS)]
    tiles = tiles[tiles.max(axis=(1, 2)) < LINEAR_SHARE]
    least = float(plane.min())
    lowest = least if least < near_0 else -np.inf
    tiles = tiles[tiles.max(axis=(1, 2)) > lowest]  # what is all DN 0 shows no noise
    waves = dctn(tiles, axes=(1, 2), norm="ortho")
    aside = waves[:, _ASIDE].sum(axis=1) / (_SIDE * np.sqrt(_ASIDE.sum()))
    energy = waves**2
    low, high = (energy[:, part].mean(axis=1) for part in (_LOW, _HIGH))
    return _Blocks(tiles.mean(axis=(1, 2)), low, high, aside, np.full(len(tiles), site), share, lowest)


def _first_line(blocks: _Blocks, floor: float) -> np.ndarray:
    """(k, sigma2) from the smoothest blocks of each part of the range."""
    order = np.argsort(blocks.mean)
    parts = [part for part in np.array_split(order, _POOLS) if part.size]
    chosen = np.concatenate(
        [part[np.argsort(blocks.low[part])[: max(3, int(_FIRST_SHARE * part.size))]] for part in parts]
    )
    mean, variance = blocks.mean[chosen].clip(min=0), np.maximum(blocks.high[chosen], floor)
    scale = 1 / np.maximum(variance, np.median(variance) / 4)
    design = np.stack([mean, np.ones_like(mean)], axis=1)
    line, _ = nnls(design * scale[:, None], variance * scale)
    return np.maximum(line, (0, floor))


def _pools(blocks: _Blocks, lines: Lines) -> Pools:
    k, sigma2 = lines.sites[blocks.site].T
    expected = k * blocks.mean.clip(min=0) + sigma2
    expected *= _left((blocks.mean - blocks.lowest) / np.sqrt(expected))
    parts = _parts_of_like_mean(blocks.mean + blocks.aside, blocks.low / expected, lines.common)
    light, ratio = blocks.mean - blocks.aside, blocks.high / expected
    rows = [
        (light[own].mean(), np.median(ratio[own]) * expected[own].mean(), own.size, site, number)
        for number, part in enumerate(parts)
        for site in range(4)
        if (own := part[blocks.site[part] == site]).size >= _MIN_GROUP
    ]
    mean, variance, size, *where = np.array(rows, np.float64).reshape(-1, 5).T
    freedom = size * blocks.share * _HIGH.sum() * _MEDIAN_EFFICIENCY
    mean, variance, clipped = before_clipping(mean, variance / _HIGH_MEDIAN, blocks.lowest, _NO_WHITE)
    return Pools(mean, variance, freedom * (1 - clipped) ** _SEEN, *np.array(where, np.intp))


def _parts_of_like_mean(mean: np.ndarray, roughness: np.ndarray, line: np.ndarray) -> list[np.ndarray]:
    """Indices of smooth blocks, pool by pool, from dark to light.

    mean, roughness: (n,), of blocks: normalised light, and energy of low frequencies over that of noise.
    line: (2,) k and sigma2, normalised.
    Every part of the range has its own pool: else the black of a picture that is full of it speaks for its
    light too, in which it says nothing of k. No part is narrower than `_PART_WIDTH` sigmas of noise, which
    would sort blocks by their noise alone. Where smooth blocks are of one light, the least rough ones of
    every other count, too.
    """
    sigma = np.sqrt(line[0] * mean.clip(min=0) + line[1])
    sigmas = 2 * mean / (sigma + np.sqrt(line[1]))  # from black: integral of 1 / sigma
    width = max(_PART_WIDTH, float(sigmas.max(initial=0)) / _POOLS)
    part_of = np.floor(sigmas / width + 0.5)  # black is in the middle of the first one
    order = np.argsort(part_of, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(part_of[order])) + 1)
    smooth = _smooth(roughness, _MIN_SMOOTH)
    pools = _joined([part[smooth[part]] for part in parts])
    if len(pools) > 1:
        return pools
    return _joined([part[_smooth(roughness[part], _MIN_POOL)] for part in parts])


def _joined(parts: list[np.ndarray]) -> list[np.ndarray]:
    """`parts`, those of too few blocks together with the next ones."""
    pools: list[np.ndarray] = []
    left = np.empty(0, np.intp)
    for part in parts:
        left = np.concatenate([left, part])
        if left.size >= _MIN_POOL:
            pools.append(left)
            left = left[:0]
    return pools


def _smooth(roughness: np.ndarray, least: int) -> np.ndarray:
    """(n,) bool: the smooth blocks, or the `least` rough ones up to `_ROUGHEST` where these are fewer."""
    enough = np.partition(roughness, least)[least] if roughness.size > least else np.inf
    return roughness <= max(_LOW_LIMIT, min(enough, _ROUGHEST))


def _left(sigmas: np.ndarray) -> np.ndarray:
    """(n,) share of its variance that noise keeps whose mean DN 0 leaves so many sigmas above itself."""
    return np.interp(sigmas, _SIGMAS + _SHIFT, _LEFT)
