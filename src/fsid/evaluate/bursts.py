"""A test set from captures: the truth is the robust mean of a burst, with its own error bar.

    truth = mean_f clip(x_f / g_f),    clip: within 4 sigma of the first mean,    error = sigma / sqrt(F)

    CAPTURES/<scene>/<level>/*.dng        one burst each: static scene, locked focus, exposure and ISO

The first frame of a burst is the noisy test frame and stays out of the truth, else its noise would be the
truth's, too; further ones are the first that lie on it in the same light. g_f is the flicker of the light; a
frame that moved is shifted back where the shift is a whole number of CFA tiles, and left out where it is not,
since interpolating would blur the truth. A shift that the noise of two frames explains is none: on smooth
scenes the estimate wanders by tiles, and the less a shift shows the less it does to the truth. Truth and
noisy frames are cut to what all frames show.
"""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np
from scipy.ndimage import uniform_filter
from skimage.registration import phase_cross_correlation

from fsid.errors import FsidError
from fsid.evaluate.testset import Progress, TestImage, TestSet, staged, write_testset
from fsid.files import write_atomically
from fsid.sensor import (
    NoiseLevel,
    Raw,
    clean_levels,
    estimate_noise,
    exact_levels,
    load_profile,
    pack,
    read_raw,
    write_dng,
)

OUTLIER_SIGMA = 4.0
MAX_FLICKER = 0.2
"""A frame whose brightness differs by more from the first is left out."""
MAX_NOISY_FLICKER = 0.01
"""The same for a noisy frame beside the first: the truth has the light of the first."""
MAX_SUBPIXEL = 0.15
"""Largest rest of a shift, in CFA tiles, that a frame of the truth may have."""
MAX_SHIFT_TILES = 32
MAX_SHIFT_SHARE = 1 / 8
"""Largest shift, in edges of the image."""
SIGNIFICANT = 5.0
"""Standard errors by which a shift must show."""
LEAST_LIGHT_DN = 0.5
"""Mean signal of the first frame, below which brightness is that of the black level."""
MOST_SATURATED = 0.5
"""Share of the first frame that may be at white."""
LEAST_FRAMES = 3
_PATCH_TILES = 7
_FLICKERED = f"differ from the first in brightness by more than {100 * MAX_FLICKER:.0f} %"
_MOVED = "moved by a part of a CFA tile, or too far"
_ADVICE = {_FLICKERED: "Lock the exposure and use a lamp that does not flicker", _MOVED: "Use a tripod"}
_NEARLY_ALL = 0.8  # of the frames that are left out
_BESIDE_RAW = frozenset((".jpg", ".jpeg", ".heic", ".heif", ".xmp"))
"""What phones and converters store beside a RAW file."""

Window = tuple[slice, slice]


@dataclass(frozen=True)
class TruthQuality:
    """How good the truth of one burst is. frames: used; left_out: moved or flickering ones.

    error: standard error of the truth, normalised; psnr: the best RAW PSNR that could be measured against it,
    dB. outliers: share of samples left out. flicker: largest |g - 1|; shift_px: largest shift undone.
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


@dataclass(frozen=True)
class _Placed:
    """Where a frame goes: roll by (rows, columns) pixels, then divide by the gain.

    fault: what keeps it out of the truth, or "". rest: rows and columns, in tiles, that rolling leaves.
    """

    path: Path
    roll: tuple[int, int]
    gain: float
    fault: str = ""
    rest: tuple[float, float] = (0.0, 0.0)


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
    qualities = []
    name = load_profile(camera).name if camera else ""
    with staged(out) as root:
        for done, ((scene, level), paths) in enumerate(bursts.items()):
            progress(done, len(bursts))
            (root / scene).mkdir(exist_ok=True)
            noisy = _noisy_frames(paths, frames)
            others = [path for path in paths if path not in noisy]
            truth, quality, window = average(others, paths[0], scene, level)
            write_dng(root / scene / f"{level}.clean.dng", clean_levels(truth))
            for frame, path in enumerate(noisy):
                raw = _cut(read_raw(path), window)
                name = name or raw.camera
                target = root / scene / f"{level}.noisy{f'.{frame:02d}' if frame else ''}.dng"
                write_dng(target, exact_levels(replace(raw, noise=_noise(raw, camera, path))))
            qualities.append(quality)
        progress(len(bursts), len(bursts))
        images = tuple(TestImage(scene, scene) for scene in scenes)
        testset = TestSet(name, levels, images, 0, "captured bursts, truth by robust averaging", frames)
        write_testset(root, testset)
        write_atomically(root / "truth.csv", _csv(qualities).encode())
    return testset, qualities


def average(
    paths: Sequence[Path], reference: Path, image: str = "", level: str = ""
) -> tuple[Raw, TruthQuality, Window]:
    """The robust mean of the frames at `paths`, placed on the frame `reference`; reads every file thrice.

    The window is that of `reference` which all frames show; the mean is of it.
    """
    first = _read_first(reference)
    every = [_place(path, first) for path in paths]
    placed = [p for p in every if not p.fault]
    if len(placed) < LEAST_FRAMES:
        raise _too_few(reference, every)
    window = _common_window(placed, first)
    mean, variance = _moments(placed, window)
    total, used = np.zeros(mean.shape), np.zeros(mean.shape)
    for x in _frames(placed, window):
        kept = _is_like_the_others(x - mean, variance, len(placed), first.cfa)
        total += np.where(kept, x, 0)
        used += kept
    truth = np.where(used > 0, total / np.maximum(used, 1), mean).astype(np.float32)
    error = float(np.sqrt(np.mean(variance, dtype=np.float64) / len(placed)))
    quality = TruthQuality(
        image=image,
        level=level,
        frames=len(placed),
        left_out=len(paths) - len(placed),
        error=error,
        psnr=float(-20 * np.log10(max(error, 1e-9))),
        outliers=float(1 - used.mean() / len(placed)),
        flicker=max(abs(p.gain - 1) for p in placed),
        shift_px=float(max(np.hypot(*p.roll) for p in placed)),
    )
    return replace(_cut(first, window), mosaic=truth, noise=None), quality, window


def _find_bursts(captures: Path, frames: int) -> dict[tuple[str, str], list[Path]]:
    if not captures.is_dir():
        raise FsidError(f"{captures}: is not a folder of captures")
    found: dict[tuple[str, str], list[Path]] = {}
    scenes = _folders(captures)  # not glob, which passes over a folder that it may not read
    for folder in (level for scene in scenes for level in _folders(scene)):
        files = (p for p in folder.iterdir() if p.is_file() and not p.name.startswith("."))
        paths = sorted(p for p in files if p.suffix.lower() not in _BESIDE_RAW)
        if len(paths) < frames + LEAST_FRAMES:
            raise FsidError(
                f"{folder}: holds {len(paths)} frames; {frames} noisy and at least {LEAST_FRAMES} more for "
                "the truth are needed (better 50)"
            )
        found[folder.parent.name, folder.name] = paths
    if not found:
        raise FsidError(
            f"{captures}: holds no bursts; expected <scene>/<level>/frames, for example star/0.5lux/"
        )
    return found


def _folders(folder: Path) -> list[Path]:
    """Those in a folder, sorted, hidden ones left out; OSError where it may not be read."""
    return sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))


def _noisy_frames(paths: Sequence[Path], frames: int) -> list[Path]:
    """The first frame of a burst, and the next ones that lie on it in the same light."""
    first = _read_first(paths[0])
    found = [paths[0]]
    for path in paths[1:]:
        if len(found) == frames:
            break
        placed = _place(path, first)
        if not placed.fault and placed.roll == (0, 0) and abs(placed.gain - 1) <= MAX_NOISY_FLICKER:
            found.append(path)
    if len(found) < frames:
        raise FsidError(
            f"{paths[0].parent}: --frames {frames}: only {len(found)} of {len(paths)} frames lie on the "
            "first one in the same light"
        )
    return found


def _read_first(path: Path) -> Raw:
    """The first frame of a burst, with which all others are compared; FsidError where it shows no picture."""
    first = read_raw(path)
    span = first.white_level - first.black_level
    if _green(first).mean() * span < LEAST_LIGHT_DN:
        raise FsidError(f"{path}: shows no light, the first frame of its burst; expose longer, or remove it")
    if (share := float(np.mean(first.mosaic >= 1 - 0.5 / span))) > MOST_SATURATED:
        raise FsidError(
            f"{path}: {100 * share:.0f} % of the first frame of its burst are saturated; expose shorter"
        )
    return first


def _too_few(reference: Path, placed: Sequence[_Placed]) -> FsidError:
    """What keeps so many frames of a burst out of its truth."""
    left_out = [p for p in placed if p.fault]
    faults = Counter(p.fault for p in left_out)
    if len(left_out) >= LEAST_FRAMES and _are_alike(left_out):
        return FsidError(
            f"{reference}: {len(left_out)} of the {len(placed)} other frames of its burst "
            f"{faults.most_common()[0][0]}, and are alike; remove this first frame"
        )
    reasons = "".join(f"; {number} {fault}" for fault, number in faults.most_common())
    advice = "".join(f". {_ADVICE[fault]}" for fault, _ in faults.most_common())
    return FsidError(
        f"{reference.parent}: only {len(placed) - len(left_out)} of {len(placed)} frames lie still and have "
        f"steady light, at least {LEAST_FRAMES} are needed{reasons}{advice}"
    )


def _are_alike(frames: Sequence[_Placed]) -> bool:
    """Whether nearly all of these lie on each other in the same light."""
    light = np.array([p.gain for p in frames]) / np.median([p.gain for p in frames])
    place = np.array([np.add(np.divide(p.roll, 2), p.rest) for p in frames])
    still = np.abs(place - np.median(place, axis=0)).max(axis=1) <= MAX_SUBPIXEL
    return bool(np.mean(still & (np.abs(light - 1) <= MAX_FLICKER)) >= _NEARLY_ALL)


def _place(path: Path, first: Raw) -> _Placed:
    """How a frame lies on the first, which has light, and whether it moved or flickered too much."""
    raw = read_raw(path)
    if raw.mosaic.shape != first.mosaic.shape or raw.cfa != first.cfa:
        raise FsidError(f"{path}: size or CFA differs from the other frames of the burst")
    if raw.iso != first.iso:
        raise FsidError(f"{path}: ISO {raw.iso:g} differs from ISO {first.iso:g} of the burst's first frame")
    ours, theirs = (_green(r) for r in (raw, first))
    gain = float(ours.sum() / theirs.sum())
    if not abs(gain - 1) <= MAX_FLICKER:
        return _Placed(path, (0, 0), gain, _FLICKERED)
    whole, rest = _shift(ours / gain, theirs)
    most = min(MAX_SHIFT_TILES, MAX_SHIFT_SHARE * min(ours.shape))
    moved = np.abs(rest).max() > MAX_SUBPIXEL or np.abs(whole).max() > most
    roll = 2 * int(whole[0]), 2 * int(whole[1])
    return _Placed(path, roll, gain, _MOVED if moved else "", (float(rest[0]), float(rest[1])))


def _shift(ours: np.ndarray, theirs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
    gained = ((ours - theirs) ** 2 - (rolled - theirs) ** 2)[seen]
    return bool(gained.mean() > SIGNIFICANT * gained.std() / np.sqrt(gained.size))


def _lies_beside(ours: np.ndarray, theirs: np.ndarray) -> bool:
    """Whether a small shift explains, beyond noise, how two planes (h, w) of equal light differ.

    ours - theirs = -shift . gradient + noise: the correlation with the gradient, less what of it looks like
    another light, has the error that the differences themselves tell (White 1980).
    """
    smooth = uniform_filter(theirs.astype(np.float64), 3)
    slopes = np.stack([slope.ravel() for slope in np.gradient(smooth)], axis=1)
    light = np.stack([np.ones(smooth.size), smooth.ravel()], axis=1)
    slopes -= light @ np.linalg.lstsq(light, slopes, rcond=None)[0]
    scores = slopes * (ours - theirs).reshape(-1, 1)
    total = scores.sum(axis=0)
    return bool(total @ np.linalg.pinv(scores.T @ scores) @ total > SIGNIFICANT**2)


def _green(raw: Raw) -> np.ndarray:
    """(H/2, W/2) mean of the greens."""
    packed = pack(raw.mosaic, raw.cfa)
    return (packed[1] + packed[2]) / 2


def _common_window(placed: Sequence[_Placed], first: Raw) -> Window:
    """Rows and columns of `first` that every frame has once it is put back."""
    height, width = first.mosaic.shape
    rolls = np.array([(0, 0), *(p.roll for p in placed)])
    (top, left), (bottom, right) = rolls.max(axis=0), rolls.min(axis=0)
    return slice(top, height + bottom), slice(left, width + right)


def _cut(raw: Raw, window: Window) -> Raw:
    mosaic = raw.mosaic[window]
    height, width = mosaic.shape
    return replace(raw, mosaic=mosaic, metadata=raw.metadata.within(width, height))


def _frames(placed: Sequence[_Placed], window: Window) -> Iterator[np.ndarray]:
    """What the frames, in place, have in the window, without flicker."""
    for p in placed:
        yield np.roll(read_raw(p.path).mosaic, p.roll, axis=(0, 1))[window] / np.float32(p.gain)


def _moments(placed: Sequence[_Placed], window: Window) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance over the frames, pixel by pixel (Welford 1962)."""
    mean = square = np.zeros(())
    for count, x in enumerate(_frames(placed, window), 1):
        delta = x - mean
        mean = mean + delta / count
        square = square + delta * (x - mean)
    return mean, square / (len(placed) - 1)


def _is_like_the_others(deviation: np.ndarray, variance: np.ndarray, frames: int, cfa: str) -> np.ndarray:
    """Whether a frame, by its deviation from the mean of all, lies where the others do: within OUTLIER_SIGMA
    of their mean, by their spread, since in a short burst an outlier widens that of all beyond itself."""
    share = frames / (frames - 1)
    others = ((frames - 1) * variance - share * deviation**2) / (frames - 2)
    limit = OUTLIER_SIGMA * np.sqrt(_spread_over_site(others, cfa))
    return np.asarray(np.sqrt(share) * np.abs(deviation) <= limit + 1e-9)


def _spread_over_site(variance: np.ndarray, cfa: str) -> np.ndarray:
    """The variance averaged over neighbours of the same CFA site: one pixel's own is from too few frames."""
    out = np.empty_like(variance)
    for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
        out[row::2, column::2] = uniform_filter(variance[row::2, column::2], _PATCH_TILES, mode="reflect")
    return np.maximum(out, 0)


def _noise(raw: Raw, camera: str | Path, path: Path) -> NoiseLevel:
    if camera:
        return load_profile(camera).level(raw.iso)
    if raw.noise is not None:
        return raw.noise
    try:
        return estimate_noise(raw).level
    except FsidError as error:
        raise FsidError(f"{path}: {error}; --camera names a profile of its noise") from None


def _level_order(level: str) -> tuple[float, str]:
    digits = "".join(c for c in level if c.isdigit() or c == ".")
    try:
        return float(digits), level
    except ValueError:
        return float("inf"), level


def _csv(qualities: Sequence[TruthQuality]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, [field.name for field in fields(TruthQuality)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(quality) for quality in qualities)
    return text.getvalue()
