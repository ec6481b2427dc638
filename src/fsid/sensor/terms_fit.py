"""The terms beyond k and sigma2, from what calibration streams anyway; see `terms` for their meaning.

    row, column         variance of row (column) means of dark frames beyond what pixel noise leaves in them
    tail, drift         kurtosis of the changes of dark pixels, of their own part; variance of frames' levels
    fixed, prnu         spatial variance of the mean image, dark or evenly lit, less the noise left in it
    dark_current_e_s    slope of the dark level over exposure time, in electrons (k DN each)
    defective           share of dark pixels far from the median of their 5x5 neighbours of the same site

All but the dark current are those of an ISO's shortest dark frames: longer ones hold its shot noise, too.

Spatial variance is that of differences between neighbours of the same site: vignetting is smooth and cancels.
All shares are those of noise before the converter, as simulation draws it: of the mean sigma of the sites,
which rows, columns and frames have in common, or site by site. Every site is measured by itself. Its pattern
counts in DN^2, and the mean over the sites is set against that of their noise, or of their squared signals,
which differ even on a grey card. A term that does not stand out of its own error is left off. Poisson
statistics and quantisation are no measurements: they are how sensors work, and stay the user's choice.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fsid.sensor.defects import GAUSS_MAD, defective
from fsid.sensor.mosaic import TILE
from fsid.sensor.pools import RESOLVED_DN2
from fsid.sensor.quantise import ROUNDING_DN2
from fsid.sensor.temporal import TemporalStatistics
from fsid.sensor.terms import NoiseTerms

FLAT = 0.1  # contrast of an evenly lit burst, relative to its signal; beyond it texture looks like PRNU
CUT_OFF = 0.002  # of the dark values at DN 0, from which on noise is no longer symmetric
_STANDING_OUT = 0.02  # share of the noise from which on a term is worth having
_SIGNIFICANT = 4.0  # standard errors of a tail, which few dark frames leave larger than that
_LEAST_ALONE = 0.1  # of the noise; with less, the pixels' own part drowns in that of rows and columns
_CUT = 3.0  # standard deviations, beyond which a step is an edge or a defect
_LEFT_BY_CUT = 0.9733  # of the variance of a normal number, within the cut
_REWEIGHTINGS = 10


@dataclass(frozen=True)
class DarkFinding:
    """What one dark burst shows: terms, and the level in DN (black included) at its ISO and exposure time."""

    iso: float
    exposure_s: float
    level_dn: float
    fixed_dn2: float
    terms: NoiseTerms


def dark_finding(stats: TemporalStatistics, iso: float, exposure_s: float) -> DarkFinding | None:
    """The terms that dark frames show; None where their noise drowns in rounding or is cut off at DN 0."""
    mean = stats.mean()
    far = defective(mean)
    found = stats.read_statistics(left_out=far)
    if found.pixel_dn2 < RESOLVED_DN2 or stats.zero_share > CUT_OFF:
        return None
    left = (found.pixel_dn2 - found.row_dn2) / stats.frames  # between neighbours in a row
    fixed2 = max(_spread2(mean) - left, 0.0)
    before2 = found.pixel_dn2 - ROUNDING_DN2
    row, column = (part / found.sigma_dn**2 for part in (found.row_dn2, found.column_dn2))
    alone = max(1 - row - column, _LEAST_ALONE) * before2 / found.pixel_dn2
    terms = NoiseTerms(
        row=_standing_out(row),
        column=_standing_out(column),
        tail=_standing_out(found.excess_kurtosis / alone**2, found.kurtosis_error / alone**2),
        drift=float(np.sqrt(_standing_out(found.level_dn2 / found.sigma_dn**2))),
        fixed=float(np.sqrt(_standing_out(fixed2 / before2))),
        defective=float(far.mean()),
    )
    return DarkFinding(iso, exposure_s, float(mean[~far].mean()), fixed2, terms)


def prnu_of(stats: TemporalStatistics, black_dn: float, fixed_dn2: float) -> float | None:
    """Relative gain pattern of an evenly lit burst; None where the burst is not even, or too dark to tell.

    fixed_dn2: variance of the pattern that is there without light.
    """
    signal = stats.level_dn - black_dn
    if signal <= 0 or stats.contrast_dn > FLAT * signal or stats.clipped_share > FLAT:
        return None
    mean = stats.mean()
    variance = np.concatenate([site[1] for site in stats.sites(None)])
    left = float(np.mean(variance)) / stats.frames
    pattern2 = _spread2(mean) - left - fixed_dn2
    signal2 = float(np.mean([(mean[site].mean() - black_dn) ** 2 for site in TILE]))
    return float(np.sqrt(pattern2 / signal2)) if pattern2 > 0.1 * left else 0.0


def fit_terms(
    dark: Sequence[DarkFinding], prnu: Sequence[float], k_dn_at_iso: dict[float, float]
) -> NoiseTerms:
    """The mean of what the bursts of all ISOs show, the shortest dark one of each."""
    shortest = [found for found in dark if found is shortest_dark(dark, found.iso)]

    def mean(name: str) -> float:
        return _rounded(float(np.mean([getattr(f.terms, name) for f in shortest]))) if shortest else 0.0

    return NoiseTerms(
        row=mean("row"),
        column=mean("column"),
        tail=mean("tail"),
        drift=mean("drift"),
        fixed=mean("fixed"),
        defective=mean("defective"),
        prnu=_rounded(float(np.median(prnu))) if prnu else 0.0,
        dark_current_e_s=_dark_current(dark, k_dn_at_iso),
    )


def shortest_dark(dark: Sequence[DarkFinding], iso: float) -> DarkFinding | None:
    """The dark burst of an ISO that holds least dark current; None where it has none."""
    of_iso = [found for found in dark if found.iso == iso]
    return min(of_iso, key=lambda found: (found.exposure_s, found.level_dn), default=None)


def _spread2(mean: np.ndarray) -> float:
    """Variance in DN^2 of a pixel among its neighbours in `mean` (H, W), the mean over the sites."""
    steps = [mean[site][:, 1:] - mean[site][:, :-1] for site in TILE]
    return float(np.mean([_variance_without_outliers(step) / 2 for step in steps]))


def _variance_without_outliers(steps: np.ndarray) -> float:
    """Mean square of `steps` but for outliers.

    Means of a few integers are multiples of 1/frames, among which a median jumps by more than what is sought.
    """
    square = steps**2
    found = float(np.median(square)) / GAUSS_MAD**2
    for _ in range(_REWEIGHTINGS):
        within = square[square <= _CUT**2 * found]
        found = float(within.mean()) / _LEFT_BY_CUT if within.size else found
    return found


def _dark_current(dark: Sequence[DarkFinding], k_dn_at_iso: dict[float, float]) -> float:
    """Electrons per second; 0 where no ISO has dark frames of two exposure times."""
    slopes = []
    for iso, k_dn in k_dn_at_iso.items():
        points = [(found.exposure_s, found.level_dn / k_dn) for found in dark if found.iso == iso]
        times = {time for time, _ in points}
        if len(times) > 1:
            seconds, electrons = np.array(points).T
            slopes.append(float(np.polyfit(seconds, electrons, 1)[0]))
    return _rounded(max(float(np.mean(slopes)), 0.0)) if slopes else 0.0


def _standing_out(share: float, error: float = 0.0) -> float:
    return share if share > max(_STANDING_OUT, _SIGNIFICANT * error) else 0.0


def _rounded(value: float) -> float:
    return float(f"{value:.3g}")
