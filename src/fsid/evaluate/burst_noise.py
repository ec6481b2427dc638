"""Whether a burst has the noise that a camera's profile states, by its first frame and its truth.

    ratio = (mean (frame - truth)^2 - error^2) / mean (k truth + sigma2),      error: of the truth

The median over blocks: what moved in a few of them counts for nothing. Pixels whose noise DN 0 or white cuts
off are left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fsid.sensor import CameraProfile, Raw
from fsid.sensor.dng import Stored
from fsid.sensor.noise import variance

UNLIKE = 1.25
"""Times the variance that a profile states, or its inverse, from which on it is not that of the burst."""
_BLOCK_PX = 16
_CUT = 3.0  # standard deviations of noise from DN 0 or white, within which it is cut off


def times_stated(frame: Raw, truth: Raw, error: float) -> float:
    """How many times the variance that `frame` states it has around `truth`; nan where all is cut off."""
    assert frame.noise is not None
    stated = variance(truth.mosaic, frame.noise, frame.cfa)
    lowest = -frame.black_level / (frame.white_level - frame.black_level)
    near = _CUT * np.sqrt(stated)
    whole = (truth.mosaic - near > lowest) & (truth.mosaic + near < 1)
    found, told, count = (
        _sums(np.where(whole, values, 0.0))
        for values in ((frame.mosaic - truth.mosaic) ** 2 - error**2, stated, 1.0)
    )
    used = count >= _BLOCK_PX**2 / 2
    return float(np.median(found[used] / told[used])) if used.any() else float("nan")


def unlike_notes(
    profile: CameraProfile, first: Stored, where: str, ratios: Sequence[tuple[float, str]]
) -> Iterator[str]:
    """Lines where captures are not as `profile` says. first: a capture, at `where`. ratios: `times_stated` of
    each burst, and its name."""
    ours, theirs = (first.cfa, first.white_level), (profile.cfa, profile.white_level)
    if ours != theirs:
        yield (
            f"{where}: its CFA and white level are {ours[0]} and {ours[1]}, those of profile {profile.name} "
            f"{theirs[0]} and {theirs[1]}; is it of this camera?"
        )
    off = [(ratio, name) for ratio, name in ratios if ratio > UNLIKE or ratio < 1 / UNLIKE]
    if off:
        ratio, name = max(off, key=lambda each: abs(np.log(max(each[0], 1e-9))))
        yield (
            f"profile {profile.name} states another noise than {len(off)} of {len(ratios)} bursts have: that "
            f"of {name} has {ratio:.2g} times its variance; is it of this camera, in this mode?"
        )


def _sums(values: np.ndarray) -> np.ndarray:
    """Of whole blocks of a (H, W) image."""
    rows, columns = (side // _BLOCK_PX for side in values.shape)
    blocks = values[: rows * _BLOCK_PX, : columns * _BLOCK_PX].reshape(rows, _BLOCK_PX, columns, _BLOCK_PX)
    return np.asarray(blocks.sum(axis=(1, 3)))
