"""The noise of one RAW image, from nothing but the image: Var(x) = k x + sigma2 per CFA site.

    block (8x8 of one site) -> orthonormal DCT:   mean = DC,   texture? = low AC energy,   V = high AC energy
    V(mean) of the blocks without texture -> line

The coefficients of white noise are independent of each other, so choosing blocks by their low frequencies
leaves the noise in their high ones as it was (Ponomarenko et al. 2007; Colom, Buades & Morel 2014 for RAW). A
block is smooth where its low frequencies hold no more energy than its noise alone would half of the time; the
noise is known better after each round. Blocks of like mean are pooled by their median, and pools above the
line count less than those below it: texture that was missed only ever adds.

Where noise reaches DN 0 it is cut off there, and all of it where black is stored as 0: mean and variance of a
pool are then taken back to those before (`stored_noise`), and it counts less the more was cut off.

A picture rarely shows every colour in every light, so a site that says little is drawn to the mean of all
four, from which the sites of published phones differ by `SITE_SPREAD`. Where hardly any block is smooth, the
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
from fsid.sensor.mosaic import site_offsets
from fsid.sensor.quantise import ROUNDING_DN2
from fsid.sensor.raw import NoiseLevel, Raw, four
from fsid.sensor.stored_noise import before_clipping, censored

UNLIKE = 4.0  # times a variance: two stops of ISO, beyond what texture makes in photographs
SITE_SPREAD = (0.1, 0.3)  # relative, of k and sigma2: twelve published phones
LINEAR_SHARE = 0.9  # of the range; brighter blocks are near saturation
_SIDE = 8
_MAX_BLOCKS = 40_000  # of one site
_POOLS = 24
_MIN_POOL = 20  # blocks
_PART_WIDTH = 1.0  # sigmas of a pixel, which are 8 of the mean of a block
_MIN_BLOCKS = 64  # of all sites
_MIN_SMOOTH = 400  # blocks; a picture with fewer lets in rougher ones, up to `_ROUGHEST`
_ROUGHEST = 4.0  # energy of low frequencies over that of noise
_FIRST_SHARE = 0.05  # of the blocks, the smoothest ones, from which the first line comes
_ROUNDS = 8
_SMOOTH_QUANTILE = 0.5
_REWEIGHTINGS = 12
_TEXTURE = 0.08  # of a variance: error that texture makes in an ordinary photograph (bench/blind_noise.py)


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
    light = [float(raw.mosaic[r::2, c::2].clip(0, 1).mean()) for r, c in site_offsets(raw.cfa)]
    floor = ROUNDING_DN2 / (raw.white_level - raw.black_level) ** 2
    stated = max(_in_light(level.k, level.sigma2, light), floor)
    try:
        shown = estimate_noise(raw)
    except NoiselessError:
        return 0.0 if stated > UNLIKE * floor else None
    except FsidError:
        return None
    times = _in_light(shown.level.k, shown.level.sigma2, light) / stated
    error = _in_light(shown.k_error, shown.sigma2_error, light) / stated
    return times if times - 2 * error > UNLIKE or times + 2 * error < 1 / UNLIKE else None


def _in_light(k: Sequence[float], sigma2: Sequence[float], light: Sequence[float]) -> float:
    """Mean over the sites of k x + sigma2; of errors it is the most that they can be."""
    return sum(a * x + b for a, b, x in zip(k, sigma2, light, strict=True)) / 4


@dataclass(frozen=True, eq=False)
class _Blocks:
    """Blocks of one site: mean, energy of low frequencies and of high ones, each per coefficient.

    share: of a block that no other block holds too; blocks overlap where there are few. lowest: x of DN 0,
    where noise is cut off; -infinity where it does not reach it.
    """

    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray
    share: float
    lowest: float = -np.inf


@dataclass(frozen=True, eq=False)
class _Pools:
    """Medians of smooth blocks: mean, variance, and how many independent coefficients stand behind each."""

    mean: np.ndarray
    variance: np.ndarray
    freedom: np.ndarray


_ORDER = np.add.outer(np.arange(_SIDE), np.arange(_SIDE))
_LOW, _HIGH = (_ORDER > 0) & (_ORDER < _SIDE), _ORDER >= _SIDE + 2
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
    span = raw.white_level - raw.black_level
    near_0 = (1 - _NEAR_0 * raw.black_level) / span
    blocks = [_blocks(raw.mosaic[r::2, c::2], near_0) for r, c in site_offsets(raw.cfa)]
    floor = ROUNDING_DN2 / span**2
    mean, low, high = (np.concatenate([getattr(b, n) for b in blocks]) for n in ("mean", "low", "high"))
    together = _Blocks(mean, low, high, blocks[0].share, max(b.lowest for b in blocks))
    if together.mean.size < _MIN_BLOCKS:
        raise FsidError(
            "the image is too small, or saturated or at DN 0 almost everywhere, to tell its noise"
        )
    line = _first_line(together, floor)
    for _ in range(_ROUNDS):
        pools = _pools(together, line)
        line, errors = _line(pools, floor)
    if line[0] == 0 and line[1] <= floor:
        raise NoiselessError("the image holds no noise beyond its rounding; there is nothing to measure")
    if np.all(errors > line):
        raise FsidError("the image does not tell its noise: too few smooth parts, or all of one brightness")
    errors = np.hypot(
        errors, _TEXTURE * np.array([line[0], line[0] * pools.mean.clip(min=0).min() + line[1]])
    )
    sites = [_site_line(_pools(site, line), line, errors, floor) for site in blocks]
    (k, sigma2), (k_error, sigma2_error) = np.transpose(sites, (1, 2, 0))
    return NoiseEstimate(NoiseLevel(four(k), four(sigma2)), four(k_error), four(sigma2_error))


def _blocks(plane: np.ndarray, near_0: float) -> _Blocks:
    """Blocks of `plane` (h, w) in an even grid, overlapping where there are few; without saturated ones.

    near_0: x below which the least value is that of DN 0; where that lies, sites differ in a little.
    """
    height, width = plane.shape
    step = _SIDE
    while step > 2 and (height // step) * (width // step) < _MAX_BLOCKS:
        step //= 2
    share = (step / _SIDE) ** 2
    if min(height, width) < _SIDE:
        none = np.empty(0, np.float32)
        return _Blocks(none, none, none, share)
    tiles = np.lib.stride_tricks.sliding_window_view(plane, (_SIDE, _SIDE))[::step, ::step]
    tiles = tiles.reshape(-1, _SIDE, _SIDE)
    tiles = tiles[:: max(1, len(tiles) // _MAX_BLOCKS)]
    tiles = tiles[tiles.max(axis=(1, 2)) < LINEAR_SHARE]
    least = float(plane.min())
    lowest = least if least < near_0 else -np.inf
    tiles = tiles[tiles.max(axis=(1, 2)) > lowest]  # what is all DN 0 shows no noise
    energy = dctn(tiles, axes=(1, 2), norm="ortho") ** 2
    low, high = (energy[:, part].mean(axis=1) for part in (_LOW, _HIGH))
    return _Blocks(tiles.mean(axis=(1, 2)), low, high, share, lowest)


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


def _pools(blocks: _Blocks, line: np.ndarray) -> _Pools:
    expected = line[0] * blocks.mean.clip(min=0) + line[1]
    expected *= _left((blocks.mean - blocks.lowest) / np.sqrt(expected))
    parts = _parts_of_like_mean(blocks.mean, blocks.low / expected, line)
    mean = np.array([blocks.mean[part].mean() for part in parts])
    variance = np.array(
        [np.median(blocks.high[part] / expected[part]) * expected[part].mean() for part in parts]
    )
    freedom = np.array([part.size * blocks.share * _HIGH.sum() * _MEDIAN_EFFICIENCY for part in parts])
    light, noise, clipped = before_clipping(mean, variance / _HIGH_MEDIAN, blocks.lowest, _NO_WHITE)
    return _Pools(light, noise, freedom * (1 - clipped) ** _SEEN)


def _parts_of_like_mean(mean: np.ndarray, roughness: np.ndarray, line: np.ndarray) -> list[np.ndarray]:
    """Indices of smooth blocks, pool by pool, from dark to light.

    mean, roughness: (n,), of blocks: normalised light, and energy of low frequencies over that of noise.
    line: (2,) k and sigma2, normalised.
    Every part of the range has its own pool: else the black of a picture that is full of it speaks for its
    light too, in which it says nothing of k. No part is narrower than `_PART_WIDTH` sigmas of noise: blocks
    of the same light would be sorted by their noise, and show k = 0. Where smooth blocks are of one light,
    the least rough ones of every other count, too.
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


def _line(pools: _Pools, floor: float) -> tuple[np.ndarray, np.ndarray]:
    """(k, sigma2) and their standard errors; pools above the line, which texture lifts, count less."""
    if pools.mean.size == 0:
        raise FsidError("the image has no smooth part in which its noise could be seen")
    design = np.stack([pools.mean.clip(min=0), np.ones_like(pools.mean)], axis=1)
    model = np.maximum(pools.variance, floor)
    weight = np.ones_like(model)
    for _ in range(_REWEIGHTINGS):
        root = np.sqrt(weight * pools.freedom / 2) / model
        line, _ = nnls(design * root[:, None], (pools.variance - floor) * root)
        line[1] += floor
        model = design @ line
        z = (pools.variance / model - 1) / np.sqrt(2 / pools.freedom)
        weight = 1 / (1 + (z.clip(min=0) / 2) ** 2)
    root = np.sqrt(weight * pools.freedom / 2) / model
    scatter = max(1.0, float(np.sum((root * (pools.variance - model)) ** 2) / max(len(model) - 2, 1)))
    normal = (design * root[:, None]).T @ (design * root[:, None])
    return line, np.sqrt(np.diag(np.linalg.pinv(normal)) * scatter)


def _site_line(
    pools: _Pools, line: np.ndarray, errors: np.ndarray, floor: float
) -> tuple[np.ndarray, np.ndarray]:
    """(k, sigma2) of one site and their errors, its own pools weighed against the line of all sites."""
    prior = np.hypot(errors, np.array(SITE_SPREAD) * line)
    if pools.mean.size == 0:
        return line, prior
    design = np.stack([pools.mean.clip(min=0), np.ones_like(pools.mean)], axis=1)
    model = design @ line
    z = (pools.variance / model - 1) / np.sqrt(2 / pools.freedom)
    root = np.sqrt(pools.freedom / 2 / (1 + (z.clip(min=0) / 2) ** 2)) / model
    rows = np.concatenate([design * root[:, None], np.diag(1 / prior)])
    values = np.concatenate([pools.variance * root, line / prior])
    found, *_ = np.linalg.lstsq(rows, values, rcond=None)
    return np.maximum(found, (0, floor)), np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))
