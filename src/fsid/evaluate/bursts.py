"""A test set from captures: noisy frames, and the mean of each burst as their truth (`burst_truth`).

    CAPTURES/<scene>/<level>/*.dng        one burst each: static scene, locked focus, exposure and ISO

The first frame of a burst is the noisy test frame and stays out of the truth, else its noise would be the
truth's, too; further ones are the first that lie on it in the same light. Truth and noisy frames are cut to
what all frames show.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, fields, replace
from pathlib import Path

from fsid.errors import FsidError
from fsid.evaluate.alignment import LEAST_FRAMES, align, check_setting, read_first
from fsid.evaluate.burst_noise import times_stated, unlike_notes
from fsid.evaluate.burst_truth import TruthQuality, average, cut
from fsid.evaluate.testset import Progress, TestImage, TestSet, staged, write_testset
from fsid.files import write_atomically
from fsid.plurals import counted
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

MAX_NOISY_FLICKER = 0.01
"""Largest difference in brightness of a noisy frame from the first, whose light the truth has."""


def burst_testset(
    captures: str | Path,
    out: str | Path,
    *,
    camera: str | Path = "",
    frames: int = 1,
    progress: Progress = lambda done, total: None,
    note: Callable[[str], None] = lambda line: None,
) -> tuple[TestSet, list[TruthQuality]]:
    """Make a test set of every burst below `captures`, and say how good its truths are (truth.csv in `out`).

    camera: noise profile of the captures; "" takes the files' NoiseProfile, or estimates the noise of each
    frame. frames: noisy frames per burst. note: is told where the captures are not as `camera` says. Raises
    FsidError that names the burst at fault.
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
    _check_stated(list(bursts.values()), camera)
    qualities, ratios = [], []
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
                raw = cut(read_raw(path), window)
                name = name or raw.camera
                target = root / scene / f"{level}.noisy{f'.{frame:02d}' if frame else ''}.dng"
                raw = replace(raw, noise=_noise(raw, camera, path))
                write_dng(target, exact_levels(raw))
                if camera and frame == 0:
                    ratios.append((times_stated(raw, truth, quality.error), f"{scene}/{level}"))
            qualities.append(quality)
        progress(len(bursts), len(bursts))
        testset = replace(testset, camera=name, notes=_notes(levels, qualities))
        write_testset(root, testset)
        write_atomically(root / "truth.csv", _csv(qualities).encode())
    if camera:
        first = next(iter(bursts.values()))[0]
        for line in unlike_notes(load_profile(camera), read_stored(first), str(first), ratios):
            note(line)
    return testset, qualities


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


def _check_stated(bursts: Sequence[Sequence[Path]], camera: str | Path) -> None:
    """Before the first burst is averaged, which takes minutes: FsidError where files are of several cameras,
    those of a burst of several ISOs, or the noise of its first frame cannot be told."""
    name = read_header(bursts[0][0]).camera
    for paths in bursts:
        first, *others = (read_header(path) for path in paths)
        if first.camera != name:
            raise FsidError(
                f"{paths[0]}: is from camera {first.camera!r}, {bursts[0][0]} from {name!r}; "
                "a test set is of one camera"
            )
        for path, header in zip(paths[1:], others, strict=True):
            check_setting(path, [("camera", header.camera, name), ("ISO", header.iso, first.iso)])
        _noise(read_raw(paths[0]), camera, paths[0])


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
        aligned = align(path, first)
        if not aligned.fault and aligned.roll == (0, 0) and abs(aligned.brightness - 1) <= MAX_NOISY_FLICKER:
            found.append(path)
    if len(found) < frames:
        raise FsidError(
            f"{paths[0].parent}: --frames {frames}: only {len(found)} of {len(paths)} frames lie on the "
            "first one in the same light"
        )
    return found


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
