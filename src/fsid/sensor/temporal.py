"""Mean and variance over time of every pixel of a burst, from one frame after the other.

    frame_f = gain_f scene + offset_f + noise_f,      change_f = frame_f - offset_f - gain_f frame_0

A lamp flickers and a black level drifts: gain and offset of a frame are those of its 8x8 block means against
the first frame's, where they are significant (`light_change`), so that a steady burst is left alone and its
variance unbiased. Changes are not divided by the gain: so the noise of frames counts as they have it, and
mean and variance are both those of the burst's mean light.
A block that still differs afterwards, and by enough to count as noise, has moved: it is left out, and where a
quarter moved the burst is refused.

The noise of dark frames is counted for each place in the 2x2 tile of the filters by itself: a camera's sites
differ in noise, and four normal distributions of different width make one with a tail. A sensor without
filters has four such places, all alike.

Sums count from the first frame, so that they stay small. Memory is 22 bytes per pixel, 30 where the noise of
dark frames is counted, however many frames.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fsid.errors import FsidError
from fsid.sensor.light_change import MAX_CLIPPED_SHARE, MIN_BLOCKS, SIGNIFICANT, Blocks, gain_and_offset
from fsid.sensor.mosaic import TILE, site_offsets
from fsid.sensor.quantise import MAX_DN, ROUNDING_DN2

LARGEST_FLICKER = 0.1  # of the light; beyond it this is another exposure, and its noise another noise
MOVED_SHARE = 0.25  # of the blocks, from which on the burst shows no static scene
CONTAMINATION = 0.1  # of a pixel's noise variance, from which on a changed block spoils the fit
STUCK = 0.9  # of the frames at 0 or white; what noise carries there less often still tells its variance
LARGEST_CORRELATION = 0.1  # between the changes of neighbours; noise has none
_THINNING = 4
_LEAST_LINES = 8  # that tell how much their means scatter
_LEAST_WHITE_TEST_PX = 64


@dataclass(frozen=True)
class ReadStatistics:
    """Parts of the noise of a burst in DN^2: of a pixel, of its rows and of its columns; excess kurtosis.

    pixel_dn2, excess_kurtosis: mean over the sites, of all that a pixel shows. sigma_dn: mean over the sites
    of the standard deviation before the converter, DN; row_dn2, column_dn2: what banding would be in a site
    of that sigma, since each has banding in proportion to its own. level_dn2: variance of the frames' levels,
    as a drifting black level has it. kurtosis_error: standard error of excess_kurtosis of Gaussian noise.
    """

    pixel_dn2: float
    sigma_dn: float
    row_dn2: float
    column_dn2: float
    excess_kurtosis: float
    kurtosis_error: float
    level_dn2: float


class TemporalStatistics:
    """Statistics of one burst of a static scene; feed it the frames one by one."""

    def __init__(self, white_level: int, *, dark: bool = False) -> None:
        """white_level: DN. dark: count `read_statistics` too."""
        self.frames = 0
        self._dark = dark
        self.gains: list[float] = []
        self.offsets_dn: list[float] = []
        self._white_level = white_level
        self._first: np.ndarray | None = None

    def add(self, dn: np.ndarray, name: str = "a frame") -> None:
        """One more frame, (H, W) integers, of the same size as the others; `name` for messages.

        FsidError: no integers of 16 bits, another size, the light changed by more than 10 %, or the scene
        moved. A frame that is refused does not count; the burst may go on without it.
        """
        dn = np.asarray(dn)
        _check_dn(dn, name)
        if self._first is None:
            self._start(dn)
        assert self._first is not None
        if dn.shape != self._first.shape:
            raise FsidError(f"{name} of the burst is {dn.shape}, the first one {self._first.shape} (H, W)")
        white = dn >= self._white_level
        change = dn - self._first.astype(np.float64)
        if self.frames:
            whites = self._whites + white
            gain, offset, moved = self._match(change, whites, name)
            if (gain, offset) != (1.0, 0.0):
                change += self._first * (1 - gain) - offset
            _check_white(np.where(whites, 0.0, np.sign(change)), name)
            if self._dark:
                self._count_noise(change)
            self._moved = moved
            self.gains.append(gain)
            self.offsets_dn.append(offset)
        self._whites += white
        self._zeros += dn <= 0
        self._sum += change
        change *= change
        self._squares += change
        self.frames += 1

    def mean(self) -> np.ndarray:
        """(H, W) float64 mean in DN, in the mean light of the burst and not in that of its first frame."""
        self._check()
        assert self._first is not None
        gain, offset = np.mean([1.0, *self.gains]), sum(self.offsets_dn) / self.frames
        return gain * self._first + self._sum / self.frames + offset

    def sites(
        self, cfa: str | None, left_out: np.ndarray | None = None
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """(mean, variance) in DN of the usable pixels of each site; of all pixels if `cfa` is None.

        left_out: (H, W) bool, pixels that shall not count.
        """
        mean, usable = self.mean(), self._usable(left_out)
        freedom = (self.frames - 1) * self._counted_noise()
        found = []
        for place in _places(cfa):
            keep = usable[place]
            total, squares = self._sum[place][keep], self._squares[place][keep]
            found.append((mean[place][keep], (squares - total**2 / self.frames) / freedom))
        return found

    def banding_factors(self, cfa: str | None, left_out: np.ndarray, largest: float) -> list[float]:
        """Squared error of each site's mean variance, relative to that of independent pixels: 1 or more.

        Pixels of a row or column with noise in common are not independent: the mean variances of neighbouring
        lines then differ by more than those of their pixels explain. left_out: (H, W) bool, as for `sites`.
        largest: up to so many times the median of its site the variance of a pixel counts.
        """
        usable = self._usable(left_out)
        found = []
        for place in _places(cfa):
            variance = self._squares[place] - self._sum[place] ** 2 / self.frames
            keep = usable[place] & (variance <= largest * np.median(variance[usable[place]]))
            of_pixels = float(variance[keep].var())
            lines = (_excess(variance, keep), _excess(variance.T, keep.T)) if of_pixels else (0.0, 0.0)
            found.append(1 + sum(max(line / max(of_pixels, 1e-9), 0.0) for line in lines))
        return found

    def _usable(self, left_out: np.ndarray | None) -> np.ndarray:
        return ~self._unusable() if left_out is None else ~self._unusable() & ~left_out

    def _counted_noise(self) -> float:
        """How often the sum of squared changes holds the noise of each frame but one; 1 in steady light.

        change_f - mean(change) = noise_f - mean(noise) - d_f noise_0,      d_f = gain_f - mean(gain)
        """
        deviations = np.array([1.0, *self.gains]) - np.mean([1.0, *self.gains])
        return 1.0 + float((deviations**2).sum() - 2 * deviations[0]) / (self.frames - 1)

    @property
    def clipped_share(self) -> float:
        """Share of the pixels that are stuck at 0 or white, or moved."""
        return float(self._unusable().mean())

    @property
    def zero_share(self) -> float:
        """Share of all values that are 0: noise that was cut off."""
        self._check()
        return float(self._zeros.mean()) / self.frames

    @property
    def moved_share(self) -> float:
        """Share of the blocks in which something moved."""
        return float(self._moved.mean())

    @property
    def level_dn(self) -> float:
        """Mean of the first frame."""
        self._check()
        return float(self._reference.mean())

    @property
    def contrast_dn(self) -> float:
        """Difference between the lightest and the darkest block of the first frame."""
        self._check()
        return float(np.ptp(self._reference))

    def read_statistics(self, left_out: np.ndarray | None = None) -> ReadStatistics:
        """What the noise is made of; for bursts of dark frames.

        left_out: (H, W) bool, pixels whose own noise shall not count: that of a hot one is another.
        """
        self._check()
        counted = np.ones(self._powers.shape[1:], bool) if left_out is None else ~left_out
        second, fourth = (
            np.array([power[site][counted[site]].mean(dtype=np.float64) for site in TILE]) / (self.frames - 1)
            for power in self._powers
        )
        row, column = self._banding / (self.frames - 1)
        kurtosis = fourth[second > 0] / second[second > 0] ** 2
        sigma = np.sqrt(np.maximum(second / 2 - ROUNDING_DN2, 0)).reshape(2, 2)
        mean_sigma = float(sigma.mean())
        in_rows, in_columns = (float((sigma.mean(axis) ** 2).mean()) or 1.0 for axis in (1, 0))
        pixel_dn2 = float(second.mean()) / 2
        row_share, column_share = self._banding / (self.frames - 1) / 2 / max(pixel_dn2, ROUNDING_DN2)
        return ReadStatistics(
            pixel_dn2=pixel_dn2,
            sigma_dn=mean_sigma,
            row_dn2=max(row / 2, 0.0) * mean_sigma**2 / in_rows,
            column_dn2=max(column / 2, 0.0) * mean_sigma**2 / in_columns,
            excess_kurtosis=2 * (float(kurtosis.mean()) - 3) if kurtosis.size else 0.0,
            kurtosis_error=self._kurtosis_error(row_share, column_share, int(counted.sum())),
            level_dn2=float(np.var([0.0, *self.offsets_dn], ddof=1)),
        )

    def _kurtosis_error(self, row: float, column: float, pixels: int) -> float:
        """Of Gaussian noise of which these shares are common to a row and to a column.

        A mean fourth power has the variance 24 / n of n independent normal numbers of variance 1, and two of
        correlation r share r^4 of it: changes from the same first frame are of correlation 1/2.
        """
        height, width = self._powers.shape[1:]
        changes = self.frames - 1
        of_time = (1 + (changes - 1) / 16) / changes
        of_lines = 1 + width * row**4 + height * column**4
        return 2 * float(np.sqrt(24 / max(pixels, 1) * of_time * of_lines))

    def _unusable(self) -> np.ndarray:
        """Pixels that are stuck at 0 or white, or moved.

        Pixels that touched a limit once are not left out: that would keep the quiet ones and bias sigma2.
        """
        stuck = np.maximum(self._zeros, self._whites) > STUCK * self.frames
        height, width = self._blocks.size
        for row, column in np.argwhere(self._moved):
            stuck[row * height : (row + 1) * height, column * width : (column + 1) * width] = True
        return stuck

    def _check(self) -> None:
        if self._first is None or self.frames < 2:
            raise FsidError("a burst needs at least two frames: a single one has no variance over time")

    def _start(self, dn: np.ndarray) -> None:
        self._first = dn.astype(np.uint16)
        self._sum, self._squares = np.zeros(dn.shape), np.zeros(dn.shape)
        self._zeros, self._whites = np.zeros(dn.shape, np.uint16), np.zeros(dn.shape, np.uint16)
        if self._dark:
            self._powers = np.zeros((2, *dn.shape), np.float32)  # sums over frames: d^2 and d^4 of each pixel
        self._banding = np.zeros(2)  # sums over frames: variance of row means, of column means
        self._blocks = Blocks.of(dn.shape)  # as much of each site in every block
        self._moved = np.zeros(self._blocks.grid, bool)
        self._reference = self._blocks.reduce(self._first, np.mean)

    def _match(self, change: np.ndarray, whites: np.ndarray, name: str) -> tuple[float, float, np.ndarray]:
        """(gain, offset, moved blocks) of a frame against the first one; (1, 0) where neither is significant.

        whites: how often each pixel was white, this frame included.
        """
        usable = ~self._moved & (self._blocks.reduce(whites > 0, np.mean) < MAX_CLIPPED_SHARE)
        if usable.sum() < MIN_BLOCKS:
            return 1.0, 0.0, self._moved
        means, (noise, error2) = self._blocks.reduce(change, np.mean), self._blocks.noise(change)
        gain, offset = gain_and_offset(means[usable], self._reference[usable], 1 / error2[usable])
        left2 = (means - (gain - 1) * self._reference - offset) ** 2
        changed = usable & (left2 > CONTAMINATION * noise / 2) & (left2 > SIGNIFICANT**2 * error2)
        moved = self._moved | changed
        _check_still(moved, name)
        if abs(gain - 1) > LARGEST_FLICKER:
            raise FsidError(
                f"{name}: its light differs by {100 * (gain - 1):+.0f} % from the first frame of the burst, "
                f"or the scene moved; use steady light and a tripod, or leave it out (dark frames: --dark)"
            )
        return gain, offset, moved

    def _count_noise(self, change: np.ndarray) -> None:
        height, width = change.shape
        d = change - change.mean()
        squares = d * d
        pixel = float(squares.mean())
        rows, columns = d.mean(axis=1), d.mean(axis=0)
        self._banding += rows.var() - pixel / width, columns.var() - pixel / height
        for power in self._powers:
            power += squares
            squares *= squares


def _places(cfa: str | None) -> list[tuple[slice, slice]]:
    return [np.s_[:, :]] if cfa is None else [np.s_[r::2, c::2] for r, c in site_offsets(cfa)]


def _excess(values: np.ndarray, keep: np.ndarray) -> float:
    """Pixels per row times the variance of row means, less what independent pixels would give of it.

    From differences between neighbouring rows, since shading is smooth.
    """
    count = keep.sum(axis=1)
    full = count > count.max() / 2
    if full.sum() < _LEAST_LINES:
        return 0.0
    means = np.where(keep, values, 0.0).sum(axis=1)[full] / count[full]
    return float(count[full].mean() * (np.diff(means) ** 2).mean() / 2 - values[keep].var())


def _check_dn(dn: np.ndarray, name: str) -> None:
    """FsidError unless `dn` is (H, W) whole numbers that 16 bits hold, of whatever type."""
    if dn.ndim != 2:
        raise FsidError(f"{name}: holds an array of shape {dn.shape}, not a mosaic (height, width)")
    whole = dn.dtype.kind in "ui" or (dn.dtype.kind == "f" and bool(np.all(dn == np.rint(dn))))
    if not whole or not 0 <= dn.min(initial=0) <= dn.max(initial=0) <= MAX_DN:
        raise FsidError(
            f"{name}: holds {dn.dtype} values that are no DN, integers from 0 to {MAX_DN} as the camera "
            "stores them, black level included"
        )


def _check_still(moved: np.ndarray, name: str) -> None:
    if moved.mean() >= MOVED_SHARE:
        raise FsidError(
            f"{name}: the scene differs from the first frame's in {100 * moved.mean():.0f} % of "
            f"the image; a burst must show a static scene from a tripod, in steady light"
        )


def _check_white(sign: np.ndarray, name: str) -> None:
    """FsidError where the sign of a pixel's change tells that of its next neighbour of the same colour.

    Noise is white, and banding is only along rows or columns; a picture that shifts is correlated both ways.
    The sign, because one moving object, which `_match` leaves out, must not decide for the whole picture.
    """
    across, down = sign[::_THINNING], sign[:, ::_THINNING].T
    count = min(across.size, down.size)
    if count < _LEAST_WHITE_TEST_PX or min(sign.shape) < 3:
        return
    found = [float(np.mean(c[:, 2:] * c[:, :-2]) / max(np.mean(c * c), 1e-6)) for c in (across, down)]
    if min(found) > max(LARGEST_CORRELATION, 2 * SIGNIFICANT / np.sqrt(count)):
        raise FsidError(
            f"{name}: it is shifted against the first frame of the burst, the camera or the scene moved; "
            f"use a tripod and a static scene"
        )
