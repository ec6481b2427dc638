"""A test set from captures: the truth is the robust mean of a burst, with its own error bar.

    truth = mean_f clip((x_f - o_f) / g_f),         clip: within 4 sigma of the first mean
    error^2 = sigma^2 / F + error^2(g, o) / 2 + |x_0 - truth|^2 without noise
                                                    half of the second: the noise of the first frame

    CAPTURES/<scene>/<level>/*.dng        one burst each: static scene, locked focus, exposure and ISO

The first frame of a burst is the noisy test frame and stays out of the truth, else its noise would be the
truth's, too; further ones are the first that lie on it in the same light. g_f is the flicker of the light,
o_f the drift of the black level; a frame that moved is shifted back where the shift is a whole number of CFA
tiles (`placing`), and left out where it is not, since interpolating would blur the truth. By what is left,
less than a sixth of a tile or hidden by noise, the first frame lies beside the truth, which is blurred by it:
the third part of the error (`beside`). Truth and noisy frames are cut to what all frames show.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import uniform_filter

from fsid.counted import counted
from fsid.errors import FsidError
from fsid.evaluate.beside import Departure, beside2
from fsid.evaluate.cut_off import before_cut_off
from fsid.evaluate.placing import LEAST_FRAMES, Placed, Window, place, read_first, too_few
from fsid.evaluate.testset import Progress, TestImage, TestSet, staged, write_testset
from fsid.files import write_atomically
from fsid.sensor import (
    NoiseLevel,
    Raw,
    clean_levels,
    estimate_noise,
    exact_levels,
    load_profile,
    read_raw,
    write_dng,
)
from fsid.sensor.blind import stated_noise
from fsid.sensor.dng import read_header, read_stored
from fsid.sensor.frames import BESIDE_RAW
from fsid.sensor.quantise import MAX_DN

OUTLIER_SIGMA = 4.0
SPECK_SIGMA = 10.0
"""Of noise: as much a pixel may count for a first frame that lies beside the truth; more is a cosmic ray."""
MAX_NOISY_FLICKER = 0.01
"""Largest difference in brightness of a noisy frame from the first, whose light the truth has."""
_PATCH_TILES = 7


@dataclass(frozen=True)
class TruthQuality:
    """How good the truth of one burst is. frames: used; left_out: moved or flickering ones.

    error: standard error of the truth, normalised, of what changes between frames: what all show (defective
    pixels, fixed pattern) counts as scene; psnr: the best RAW PSNR that could be measured against it, dB.
    outliers: share of samples left out. flicker: largest |g - 1|; shift_px: largest shift undone.
    """

    image: str
    level: str
    frames: int
    left_out: int
    error: float
    psnr: float
    outliers: float
    flicker: float
    shift_px: float


def burst_testset(
    captures: str | Path,
    out: str | Path,
    *,
    camera: str | Path = "",
    frames: int = 1,
    progress: Progress = lambda done, total: None,
) -> tuple[TestSet, list[TruthQuality]]:
    """Make a test set of every burst below `captures`, and say how good its truths are (truth.csv in `out`).

    camera: noise profile of the captures; "" takes the files' NoiseProfile, or estimates the noise of each
    frame. frames: noisy frames per burst. Raises FsidError that names the burst at fault.
    """
    if frames < 1:
        raise FsidError(f"--frames {frames}: at least one noisy frame per burst is needed")
    captures, out = Path(captures), Path(out)
    bursts = _find_bursts(captures, frames)
    scenes = tuple(dict.fromkeys(scene for scene, _ in bursts))
    levels = tuple(sorted({level for _, level in bursts}, key=_level_order))
    for scene in scenes:
        if missing := [level for level in levels if (scene, level) not in bursts]:
            raise FsidError(f"{captures / scene}: has no burst {missing[0]}; every scene needs every level")
    _check_one_camera([paths[0] for paths in bursts.values()])
    qualities = []
    name = load_profile(camera).name if camera else ""
    images = tuple(TestImage(scene, scene) for scene in scenes)
    testset = TestSet(name, levels, images, 0, "", frames)  # refuses a list that cannot be one
    with staged(out) as root:
        for done, ((scene, level), paths) in enumerate(bursts.items()):
            progress(done, len(bursts))
            (root / scene).mkdir(exist_ok=True)
            noisy = _noisy_frames(paths, frames)
            others = [path for path in paths if path not in noisy]
            truth, quality, window = average(others, paths[0], scene, level)
            write_dng(root / scene / f"{level}.clean.dng", clean_levels(_lifted(truth)))
            for frame, path in enumerate(noisy):
                raw = _cut(read_raw(path), window)
                name = name or raw.camera
                target = root / scene / f"{level}.noisy{f'.{frame:02d}' if frame else ''}.dng"
                write_dng(target, exact_levels(replace(raw, noise=_noise(raw, camera, path))))
            qualities.append(quality)
        progress(len(bursts), len(bursts))
        testset = replace(testset, camera=name, notes=_notes(levels, qualities))
        write_testset(root, testset)
        write_atomically(root / "truth.csv", _csv(qualities).encode())
    return testset, qualities


def average(
    paths: Sequence[Path], reference: Path, image: str = "", level: str = ""
) -> tuple[Raw, TruthQuality, Window]:
    """The robust mean of the frames at `paths`, placed on the frame `reference`; reads every file thrice.

    The window is that of `reference` which all frames show; the mean is of it.
    """
    first = read_first(reference)
    every = [place(path, first) for path in paths]
    placed = [p for p in every if not p.fault]
    if len(placed) < LEAST_FRAMES:
        raise too_few(reference, every)
    window = _common_window(placed, first)
    seen = _cut(first, window)
    mean = _trimmed_mean(placed, window, seen, _of_dn_0(reference)[window])
    shared2 = float(np.mean([p.error2 for p in placed])) / 2
    error = float(np.sqrt(mean.noise2 + shared2 + mean.beside2))
    quality = TruthQuality(
        image=image,
        level=level,
        frames=len(placed),
        left_out=len(paths) - len(placed),
        error=error,
        psnr=float(-20 * np.log10(max(error, 1e-9))),
        outliers=mean.outliers,
        flicker=max(abs(p.gain - 1) for p in placed),
        shift_px=float(max(np.hypot(*p.roll) for p in placed)),
    )
    return replace(seen, mosaic=mean.truth, noise=None), quality, window


@dataclass(frozen=True, eq=False)
class _Mean:
    """truth: (H, W) float32. outliers: share of samples left out. noise2, beside2: mean squares of the noise
    that is left in it, and of how far the first frame lies beside it."""

    truth: np.ndarray
    outliers: float
    noise2: float
    beside2: float


def _trimmed_mean(placed: Sequence[Placed], window: Window, first: Raw, lowest: np.ndarray) -> _Mean:
    """lowest: (H, W) x of DN 0."""
    mean, variance = _moments(placed, window)
    used, total, square = (np.zeros(mean.shape) for _ in range(3))
    departures = []
    for x in _frames(placed, window):
        deviation = x - mean
        kept = _is_like_the_others(deviation, variance, len(placed))
        used += kept
        total += np.where(kept, deviation, 0)
        square += np.where(kept, deviation**2, 0)
        departures.append(Departure.of(np.where(kept, deviation, 0)))
    change = total / np.maximum(used, 1)
    spread = np.where(used > 1, (square - total * change) / np.maximum(used - 1, 1), variance)
    unlike = float(np.mean(spread**2) / max(np.mean(spread) ** 2, 1e-30))
    reach = SPECK_SIGMA * np.sqrt(_mean_of_site(variance))
    off = Departure.of(change)
    others, gains = [departure.less(off) for departure in departures], [p.gain for p in placed]
    beside = Departure.of((first.mosaic - mean - change).clip(-reach, reach))
    span = first.white_level - first.black_level
    dn, near_dn2 = span * (mean + change - lowest), span**2 * _mean_of_site(spread)
    light_dn, slope = before_cut_off(dn, _mean_of_site(dn), near_dn2)
    return _Mean(
        truth=(lowest + light_dn / span).astype(np.float32),
        outliers=float(1 - used.mean() / len(placed)),
        noise2=float(np.mean(slope**2 * spread / np.maximum(used, 1))),
        beside2=beside2(beside, others, gains, unlike),
    )


def _of_dn_0(path: Path) -> np.ndarray:
    """(H, W) x of DN 0, that of the pixels' own black levels."""
    stored = read_stored(path)
    return stored.black.normalised(np.zeros_like(stored.dn), stored.black_level, stored.white_level)


def _find_bursts(captures: Path, frames: int) -> dict[tuple[str, str], list[Path]]:
    if not captures.is_dir():
        raise FsidError(f"{captures}: is not a folder of captures")
    found: dict[tuple[str, str], list[Path]] = {}
    scenes = _folders(captures)  # not glob, which passes over a folder that it may not read
    for folder in (level for scene in scenes for level in _folders(scene)):
        files = (p for p in folder.iterdir() if p.is_file() and not p.name.startswith("."))
        paths = sorted(p for p in files if p.suffix.lower() not in BESIDE_RAW)
        if len(paths) < frames + LEAST_FRAMES:
            raise FsidError(
                f"{folder}: holds {counted(len(paths), 'frame')}; {frames} noisy and at least "
                f"{LEAST_FRAMES} more for the truth are needed (better 50)"
            )
        found[folder.parent.name, folder.name] = paths
    if not found:
        raise FsidError(
            f"{captures}: holds no bursts; expected <scene>/<level>/frames, for example star/0.5lux/"
        )
    return found


def _check_one_camera(paths: Sequence[Path]) -> None:
    """FsidError where bursts, of which these are the first frames, are of several cameras."""
    name = read_header(paths[0]).camera
    for path in paths:
        if (other := read_header(path).camera) != name:
            raise FsidError(
                f"{path}: is from camera {other!r}, {paths[0]} from {name!r}; a test set is of one camera"
            )


def _folders(folder: Path) -> list[Path]:
    """Those in a folder, sorted, hidden ones left out; OSError where it may not be read."""
    return sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))


def _noisy_frames(paths: Sequence[Path], frames: int) -> list[Path]:
    """The first frame of a burst, and the next ones that lie on it in the same light."""
    first = read_first(paths[0])
    found = [paths[0]]
    for path in paths[1:]:
        if len(found) == frames:
            break
        placed = place(path, first)
        if not placed.fault and placed.roll == (0, 0) and abs(placed.brightness - 1) <= MAX_NOISY_FLICKER:
            found.append(path)
    if len(found) < frames:
        raise FsidError(
            f"{paths[0].parent}: --frames {frames}: only {len(found)} of {len(paths)} frames lie on the "
            "first one in the same light"
        )
    return found


def _common_window(placed: Sequence[Placed], first: Raw) -> Window:
    """Rows and columns of `first` that every frame has once it is put back."""
    height, width = first.mosaic.shape
    rolls = np.array([(0, 0), *(p.roll for p in placed)])
    (top, left), (bottom, right) = rolls.max(axis=0), rolls.min(axis=0)
    return slice(top, height + bottom), slice(left, width + right)


def _cut(raw: Raw, window: Window) -> Raw:
    mosaic = raw.mosaic[window]
    height, width = mosaic.shape
    return replace(raw, mosaic=mosaic, metadata=raw.metadata.within(width, height))


def _frames(placed: Sequence[Placed], window: Window) -> Iterator[np.ndarray]:
    """What the frames, in place, have in the window, without flicker and drift."""
    for p in placed:
        rolled = np.roll(read_raw(p.path).mosaic, p.roll, axis=(0, 1))[window]
        yield (rolled - np.float32(p.offset)) / np.float32(p.gain)


def _moments(placed: Sequence[Placed], window: Window) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance over the frames, pixel by pixel (Welford 1962)."""
    mean = square = np.zeros(())
    for count, x in enumerate(_frames(placed, window), 1):
        delta = x - mean
        mean = mean + delta / count
        square = square + delta * (x - mean)
    return mean, square / (len(placed) - 1)


def _is_like_the_others(deviation: np.ndarray, variance: np.ndarray, frames: int) -> np.ndarray:
    """Whether a frame, by its deviation from the mean of all, lies where the others do: within OUTLIER_SIGMA
    of their mean, by their spread, since in a short burst an outlier widens that of all beyond itself."""
    share = frames / (frames - 1)
    others = ((frames - 1) * variance - share * deviation**2) / (frames - 2)
    limit = OUTLIER_SIGMA * np.sqrt(_mean_of_site(others))
    return np.asarray(np.sqrt(share) * np.abs(deviation) <= limit + 1e-9)


def _mean_of_site(values: np.ndarray) -> np.ndarray:
    """Averages over neighbours of the same CFA site: a pixel's own variance is from too few frames."""
    out = np.empty_like(values)
    for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
        out[row::2, column::2] = uniform_filter(values[row::2, column::2], _PATCH_TILES, mode="reflect")
    return np.maximum(out, 0)


def _noise(raw: Raw, camera: str | Path, path: Path) -> NoiseLevel:
    if camera:
        if not raw.iso > 0:
            raise FsidError(f"{path}: its ISO is unknown; --camera {camera} needs files that state it")
        return load_profile(camera).level(raw.iso)
    try:
        return stated_noise(raw) or estimate_noise(raw).level
    except FsidError as error:
        raise FsidError(f"{path}: {error}; --camera names a profile of its noise") from None


def _notes(levels: Sequence[str], qualities: Sequence[TruthQuality]) -> str:
    """What the report says of the truths: how good the least one of each level is."""
    least = {level: min(q.psnr for q in qualities if q.level == level) for level in levels}
    limits = ", ".join(f"{psnr:.1f} dB at {level}" for level, psnr in least.items())
    return (
        f"captured bursts, truth by robust averaging; no method can be measured beyond its own PSNR in RAW "
        f"({limits}, of the least image)"
    )


def _level_order(level: str) -> tuple[float, str]:
    digits = "".join(c for c in level if c.isdigit() or c == ".")
    try:
        return float(digits), level
    except ValueError:
        return float("inf"), level


def _lifted(truth: Raw) -> Raw:
    """The same truth with levels as many DN higher as it reaches below DN 0, which a file cuts off."""
    least_dn = truth.black_level + float(truth.mosaic.min()) * (truth.white_level - truth.black_level)
    lift = min(max(-math.floor(least_dn), 0), MAX_DN - truth.white_level)
    return replace(truth, black_level=truth.black_level + lift, white_level=truth.white_level + lift)


def _csv(qualities: Sequence[TruthQuality]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, [field.name for field in fields(TruthQuality)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(quality) for quality in qualities)
    return text.getvalue()
