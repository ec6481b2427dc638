"""Alignment of the frames of a burst with its first one, and what keeps them out of its truth.

A frame that moved by a whole number of CFA tiles can be put back. A shift that the noise of two frames
explains is none: on smooth scenes the estimate wanders by tiles, and the less a shift shows the less it does
to the truth.

Light and black level of a frame are set against the first one's once it lies on it, as in calibration
(`fsid.sensor.light_change`). Where blocks are too alike to tell the two apart, all of it counts as light.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.ndimage import uniform_filter
from skimage.registration import phase_cross_correlation

from fsid.errors import FsidError
from fsid.sensor import Raw, pack, read_raw
from fsid.sensor.light_change import (
    MAX_CLIPPED_SHARE,
    MIN_BLOCKS,
    Blocks,
    gain_and_offset,
    line_error2,
    tells_gain,
)

MAX_FLICKER = 0.2
"""A frame whose brightness differs by more from the first is left out."""
MAX_SUBPIXEL = 0.15
"""Largest rest of a shift, in CFA tiles, that a frame of the truth may have."""
MAX_SHIFT_TILES = 32
MAX_SHIFT_SHARE = 1 / 8
"""Largest shift, in edges of the image."""
SAME_BLACK = 0.01
"""Of the range: largest difference of the black levels that two frames of one mode state."""
SIGNIFICANT = 5.0
"""Standard errors by which a shift must show."""
LEAST_LIGHT_DN = 0.5
"""Mean signal of the first frame, below which brightness is that of the black level."""
MOST_SATURATED = 0.5
"""Share of the first frame that may be at white."""
LEAST_FRAMES = 3
_FLICKERED = f"differ from the first in brightness by more than {100 * MAX_FLICKER:.0f} %"
_MOVED = "moved by a part of a CFA tile, or too far"
_ADVICE = {_FLICKERED: "Lock the exposure and use a lamp that does not flicker", _MOVED: "Use a tripod"}
_NEARLY_ALL = 0.8  # of the frames that are left out


Window = tuple[slice, slice]


@dataclass(frozen=True)
class Alignment:
    """Where a frame goes: roll by (rows, columns) pixels, subtract the offset, then divide by the gain.

    offset: normalised. error2: squared standard error of both, normalised, on the mean over the image.
    brightness: mean of the frame, relative to the first one's. rest: rows and columns, in tiles, that
    rolling leaves. fault: what keeps the frame out of the truth, or "".
    """

    path: Path
    roll: tuple[int, int]
    gain: float
    offset: float
    error2: float
    brightness: float
    rest: tuple[float, float]
    fault: str = ""


def read_first(path: Path) -> Raw:
    """The first frame of a burst, with which all others are compared; FsidError where it shows no picture."""
    first = read_raw(path)
    span = first.white_level - first.black_level
    if green(first).mean() * span < LEAST_LIGHT_DN:
        raise FsidError(f"{path}: shows no light, the first frame of its burst; expose longer, or remove it")
    if (share := float(np.mean(first.mosaic >= 1 - 0.5 / span))) > MOST_SATURATED:
        raise FsidError(
            f"{path}: {100 * share:.0f} % of the first frame of its burst are saturated; expose shorter"
        )
    return first


def too_few(reference: Path, frames: Sequence[Alignment]) -> FsidError:
    """What keeps so many frames of a burst out of its truth."""
    left_out = [p for p in frames if p.fault]
    faults = Counter(p.fault for p in left_out)
    if len(left_out) >= LEAST_FRAMES and _are_alike(left_out):
        return FsidError(
            f"{reference}: {len(left_out)} of the {len(frames)} other frames of its burst "
            f"{faults.most_common()[0][0]}, and are alike; remove this first frame"
        )
    reasons = "".join(f"; {number} {fault}" for fault, number in faults.most_common())
    advice = "".join(f". {_ADVICE[fault]}" for fault, _ in faults.most_common())
    return FsidError(
        f"{reference.parent}: only {len(frames) - len(left_out)} of {len(frames)} frames lie still and have "
        f"steady light, at least {LEAST_FRAMES} are needed{reasons}{advice}"
    )


def _are_alike(frames: Sequence[Alignment]) -> bool:
    """Whether nearly all of these lie on each other in the same light."""
    light = np.array([p.gain for p in frames]) / np.median([p.gain for p in frames])
    place = np.array([np.add(np.divide(p.roll, 2), p.rest) for p in frames])
    still = np.abs(place - np.median(place, axis=0)).max(axis=1) <= MAX_SUBPIXEL
    return bool(np.mean(still & (np.abs(light - 1) <= MAX_FLICKER)) >= _NEARLY_ALL)


def align(path: Path, first: Raw) -> Alignment:
    """How a frame lies on the first, which has light, and whether it moved or flickered too much."""
    raw = read_raw(path)
    _check_alike(path, raw, first)
    ours, theirs = (green(r) for r in (raw, first))
    brightness = float(ours.sum() / theirs.sum())
    whole, rest = shift_between(ours - (ours.mean() - theirs.mean()), theirs)
    gain, offset, error2 = _light(whole, ours, theirs, first.white_level - first.black_level)
    most = min(MAX_SHIFT_TILES, MAX_SHIFT_SHARE * min(ours.shape))
    fault = _MOVED if np.abs(rest).max() > MAX_SUBPIXEL or np.abs(whole).max() > most else ""
    return Alignment(
        path,
        roll=(2 * int(whole[0]), 2 * int(whole[1])),
        gain=gain,
        offset=offset,
        error2=error2,
        brightness=brightness,
        rest=(float(rest[0]), float(rest[1])),
        fault=fault if abs(gain - 1) <= MAX_FLICKER else _FLICKERED,
    )


def _check_alike(path: Path, raw: Raw, first: Raw) -> None:
    """FsidError where a frame states another camera, mode or setting than the first one."""
    stated: list[tuple[str, str | float, str | float]] = [
        ("camera", raw.camera, first.camera),
        ("size", _size(raw), _size(first)),
        ("filter pattern", raw.cfa, first.cfa),
        ("white level", raw.white_level, first.white_level),
        ("ISO", raw.iso, first.iso),
    ]
    if abs(raw.black_level - first.black_level) > SAME_BLACK * (first.white_level - first.black_level):
        stated.append(("black level", raw.black_level, first.black_level))
    ours_s, theirs_s = raw.metadata.exposure_s, first.metadata.exposure_s
    if ours_s and theirs_s and abs(ours_s / theirs_s - 1) > MAX_FLICKER:
        stated.append(("exposure time in s", ours_s, theirs_s))
    check_setting(path, stated)


def check_setting(path: Path, stated: Sequence[tuple[str, str | float, str | float]]) -> None:
    """FsidError where a frame states something else than the first one; stated: (what, frame, first)."""
    for what, ours, theirs in stated:
        if ours != theirs:
            ours, theirs = (f"{v:.6g}" if isinstance(v, float) else v for v in (ours, theirs))
            raise FsidError(
                f"{path}: {what} {ours} differs from {theirs} of the burst's first frame; "
                f"a burst is of one camera in one setting"
            )


def _size(raw: Raw) -> str:
    return "x".join(map(str, raw.mosaic.shape[::-1]))


def _light(whole: np.ndarray, ours: np.ndarray, theirs: np.ndarray, span: int) -> tuple[float, float, float]:
    """(gain, offset, squared error) of `ours`, rolled by `whole`, against `theirs`; normalised."""
    seen = _shown(whole)
    ours, theirs = (plane[seen] for plane in (np.roll(ours, tuple(whole), axis=(0, 1)), theirs))
    blocks, change = Blocks.of(theirs.shape), span * (ours - theirs)
    clipped = np.maximum(ours, theirs) >= 1 - 0.5 / span
    usable = blocks.reduce(clipped, np.mean) < MAX_CLIPPED_SHARE
    level = span * blocks.reduce(theirs, np.mean)[usable]
    noise, error2 = (values[usable] for values in blocks.noise(change))
    weight = 1 / error2
    if usable.sum() < MIN_BLOCKS or not tells_gain(level, weight):
        return float(ours.sum() / theirs.sum()), 0.0, 0.0
    gain, offset_dn = gain_and_offset(blocks.reduce(change, np.mean)[usable], level, weight)
    white_noise = blocks.size[0] * blocks.size[1] / noise
    return gain, offset_dn / span, line_error2(level, white_noise, span * theirs) / span**2


def shift_between(ours: np.ndarray, theirs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns that `ours` must be rolled by, in tiles: whole ones, and what is left then.

    Phase correlation finds the whole shift among many; the peak of the plain, windowed correlation then tells
    the rest, which the phases of pure noise would blur. 0 where noise explains what is found.
    """
    window = np.hanning(ours.shape[0])[:, None] * np.hanning(ours.shape[1])
    smooth_ours, smooth = uniform_filter(ours, 3), uniform_filter(theirs, 3)
    whole = np.round(phase_cross_correlation(smooth, smooth_ours)[0]).astype(int)
    if not _brings_nearer(whole, ours, theirs):
        whole = np.zeros(2, int)
    near = np.roll(smooth_ours, tuple(whole), axis=(0, 1))
    a, b = ((plane - plane.mean()) * window for plane in (smooth, near))
    rest = phase_cross_correlation(a, b, upsample_factor=20, normalization=None)[0]
    if np.abs(rest).max() > MAX_SUBPIXEL:
        seen, far = _shown(whole), np.round(rest).astype(int)
        ours, theirs = np.roll(ours, tuple(whole), axis=(0, 1))[seen], theirs[seen]
        if not (_lies_beside(ours, theirs) or (far.any() and _brings_nearer(far, ours, theirs))):
            rest = np.zeros(2)
    return whole, rest


def _shown(whole: np.ndarray) -> Window:
    """What a plane still shows of its scene when it is rolled by `whole` rows and columns."""
    rows, columns = (slice(max(n, 0), min(n, 0) or None) for n in whole)
    return rows, columns


def _brings_nearer(whole: np.ndarray, ours: np.ndarray, theirs: np.ndarray) -> bool:
    """Whether `ours` rolled by `whole` differs less from `theirs` than it does in place, beyond noise."""
    seen = _shown(whole)
    rolled = np.roll(ours, tuple(whole), axis=(0, 1))
    here, there = (unbanded((plane - theirs)[seen]) for plane in (ours, rolled))
    gained = here**2 - there**2
    return bool(gained.mean() > SIGNIFICANT * gained.std() / np.sqrt(gained.size))


def _lies_beside(ours: np.ndarray, theirs: np.ndarray) -> bool:
    """Whether a small shift explains, beyond noise, how two planes (h, w) of like light differ.

    The correlation of the difference with the gradient has the error that the differences themselves tell
    (White 1980).
    """
    slopes, change = _less_light(ours - theirs, theirs)
    scores = slopes * change
    total = scores.sum(axis=0)
    return bool(total @ np.linalg.pinv(scores.T @ scores) @ total > SIGNIFICANT**2)


def _less_light(change: np.ndarray, theirs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The smoothed gradient of `theirs` (h w, 2) and its `change` (h w, 1): -shift . gradient + noise.

    What of both looks like another light is taken out.
    """
    smooth = uniform_filter(theirs.astype(np.float64), 3)
    slopes = np.stack([unbanded(slope).ravel() for slope in np.gradient(smooth)], axis=1)
    light = unbanded(smooth).reshape(-1, 1)
    both = (slopes, unbanded(change).reshape(-1, 1))
    slopes, change = (v - light @ np.linalg.lstsq(light, v, rcond=None)[0] for v in both)
    return slopes, change


def unbanded(plane: np.ndarray) -> np.ndarray:
    """A plane (h, w) less the means of its rows and columns, whose noise is common to many pixels.

    Stripes that run from edge to edge along the pixels are lost with it, and tell no shift.
    """
    return plane - plane.mean(axis=1, keepdims=True) - plane.mean(axis=0) + plane.mean()


def green(raw: Raw) -> np.ndarray:
    """(H/2, W/2) mean of the greens."""
    packed = pack(raw.mosaic, raw.cfa)
    return (packed[1] + packed[2]) / 2
