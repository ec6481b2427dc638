"""RAW files in, denoised DNGs out.

noise of a file = profile at an ISO, if one is named | its own `NoiseProfile` | what the image itself shows
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fsid.denoise.denoise import Network, check_strength, denoise_raw
from fsid.denoise.preview import preview_of
from fsid.errors import FsidError
from fsid.files import DiskError, check_output, make_folder, paths_of, same_files
from fsid.sensor import (
    Layout,
    NoiseLevel,
    Raw,
    clean_levels,
    estimate_noise,
    load_bayer_profile,
    read_raw,
    without_hot_pixels,
    write_dng,
)
from fsid.sensor.bare import BARE_SUFFIXES, HEADERLESS_SUFFIXES
from fsid.sensor.blind import contradiction, stated_noise
from fsid.sensor.frames import RAW_SUFFIXES

_SMALLEST_PX = 22  # LibRaw takes no smaller image for a RAW


@dataclass(frozen=True)
class Noise:
    """A noise level, and in words where it came from.

    is_estimated: from the image itself. is_left: the file states that a denoiser removed all noise before.
    shown: where neither holds and the image contradicts the level (`fsid.sensor.blind.contradiction`), the
    variance that it shows over that of the level. hot: how many hot or dead pixels were mended.
    """

    level: NoiseLevel
    source: str
    is_estimated: bool = False
    is_left: bool = False
    shown: float | None = None
    hot: int = 0


def find_raws(folder: str | Path, *, bare: bool = False) -> list[Path]:
    """The RAW files directly inside `folder`, sorted by name; FsidError where there is none.

    bare: those of bare mosaics instead, which a `Layout` is given for.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FsidError(f"{folder}: is not a folder of RAW files")
    raws = raws_inside(folder, bare=bare)
    if not raws:
        what = "bare mosaic" if bare else "RAW file"
        below = raws_below(folder, bare=bare)
        where = f"; {below[0]} lies deeper, give its folder" if below else ""
        raise FsidError(f"{folder}: holds no {what} ({', '.join(_suffixes(bare))}){where}")
    return raws


def raws_inside(folder: Path, *, bare: bool) -> list[Path]:
    """As `find_raws`, and none where there is none; FsidError where the folder cannot be read.

    A link that leads nowhere is one of them: it stands for a file that cannot be read.
    """
    try:
        inside = sorted(path for path in folder.iterdir() if not path.is_dir())
    except OSError as error:
        raise FsidError(f"{folder}: cannot be read ({error.strerror})") from None
    return [p for p in inside if p.suffix.lower() in _suffixes(bare) and not p.name.startswith(".")]


def raws_below(folder: Path, *, bare: bool) -> list[Path]:
    """What `find_raws` leaves out: the RAW files in folders inside `folder`, hidden ones excepted."""
    files = (p for p in folder.glob("*/**/*") if p.suffix.lower() in _suffixes(bare) and p.is_file())
    return sorted(p for p in files if not any(n.startswith(".") for n in p.relative_to(folder).parts))


def _suffixes(bare: bool) -> Sequence[str]:
    return BARE_SUFFIXES if bare else sorted(RAW_SUFFIXES)


def read_input(path: Path, layout: Layout | None) -> Raw:
    """Any Bayer file that LibRaw opens, or a bare mosaic with its `layout`. FsidError where unreadable."""
    if layout is not None:
        return layout.read(path)
    if path.suffix.lower() in BARE_SUFFIXES:
        size = " --width PX --height PX" if path.suffix.lower() in HEADERLESS_SUFFIXES else ""
        raise FsidError(
            f"{path}: is a bare mosaic, say what it holds: --cfa RGGB --black-level DN --white-level DN{size}"
        )
    return read_raw(path)


def check_options(
    profile: str | None, iso: float | None, strength: float = 1.0, layout: Layout | None = None
) -> None:
    """FsidError for what no file can be denoised with, whatever it holds."""
    _check_iso(profile, iso)
    camera = None if profile is None else load_bayer_profile(profile)
    if camera is not None and iso is None and layout is not None and layout.iso is None:
        raise FsidError(f"--profile {profile}: a bare mosaic states no ISO, give --iso")
    check_strength(None if camera is None or iso is None else camera.level(iso), strength)


def _check_iso(profile: str | None, iso: float | None) -> None:
    if iso is not None and not 0 < iso < math.inf:
        raise FsidError(f"--iso {iso:g}: must be a number above 0")
    if iso is not None and profile is None:
        raise FsidError("--iso: names a level of a camera; give --profile too (fsid profiles lists them)")


def noise_of(raw: Raw, profile: str | None, iso: float | None, path: Path) -> Noise:
    """The level of a profile at an ISO (by default the file's), else the file's own, else the image's.

    path: names the file in errors. FsidError: an ISO without a profile or an unknown one, a profile that is
    none, noise below 0, an image that does not tell its noise.
    """
    _check_iso(profile, iso)
    if profile is not None:
        iso = iso if iso is not None else raw.iso
        if not iso > 0:
            raise FsidError(f"{path}: its ISO is unknown, give --iso")
        return Noise(load_bayer_profile(profile).level(iso), f"profile {profile} at ISO {iso:g}")
    advice = "give --profile NAME --iso N (fsid profiles lists them)"
    try:
        stated = stated_noise(raw)
    except FsidError as error:
        raise FsidError(f"{path}: {error}; {advice}") from None
    if stated is not None:
        return Noise(stated, "the file's NoiseProfile")
    lack = "holds no NoiseProfile" if raw.noise is None else "its NoiseProfile states no noise at all"
    if raw.metadata.noise_removed >= 1:
        lack = "was denoised before, as NoiseReductionApplied says"
    try:
        level = estimate_noise(raw).level
    except FsidError as error:
        raise FsidError(f"{path}: {lack}, and {error}; {advice}") from None
    source = "estimated from the image" if raw.noise is None else f"estimated from the image ({lack})"
    return Noise(level, source, is_estimated=True)


def denoise_file(
    source: str | Path,
    target: str | Path,
    model: Network,
    *,
    profile: str | None = None,
    iso: float | None = None,
    strength: float = 1.0,
    ensemble: int = 1,
    mend_hot_pixels: bool = False,
    layout: Layout | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Noise:
    """Denoise one RAW file into a DNG with finer levels (a denoised value is no whole DN) and a preview.

    mend_hot_pixels: make pixels that show no light (`fsid.sensor.hot_pixels`) of those around them first. The
    noise level that was used is returned. FsidError: `denoise_raw`, unreadable input, another suffix, a
    folder that is not there, and `source` as `target`: an original cannot be made again.
    """
    source, target = Path(source), Path(target)
    if target.suffix.lower() != ".dng":
        raise FsidError(f"{target}: a denoised RAW is written as .dng")
    if same_files([target], [source]):
        raise FsidError(f"{target}: is the original, which would be overwritten; give another name")
    check_output(target)
    raw = read_input(source, layout)
    if min(raw.mosaic.shape) < _SMALLEST_PX:
        height, width = raw.mosaic.shape
        raise FsidError(
            f"{source}: is {width}x{height}; a DNG of less than {_SMALLEST_PX} pixels a side opens nowhere"
        )
    noise = noise_of(raw, profile, iso, source)
    if iso is not None and not raw.iso > 0:
        raw = replace(raw, iso=iso)
    try:
        if mend_hot_pixels:
            raw, hot = without_hot_pixels(raw, noise.level)
            noise = replace(noise, hot=hot)
        clean = denoise_raw(raw, model, noise.level, strength=strength, ensemble=ensemble, progress=progress)
    except FsidError as error:
        raise FsidError(f"{source}: {error}") from None
    write_dng(target, clean_levels(clean), preview_of(clean))
    is_left = raw.metadata.noise_removed >= 1
    known = noise.is_estimated or is_left
    return replace(noise, is_left=is_left, shown=None if known else contradiction(raw, noise.level))


def target_in(folder: Path, source: Path) -> Path:
    """What `denoise_folder` makes of `source`."""
    return folder / f"{source.stem}.dng"


def denoise_folder(
    sources: Sequence[str | Path],
    target: str | Path,
    model: Network,
    *,
    profile: str | None = None,
    iso: float | None = None,
    strength: float = 1.0,
    ensemble: int = 1,
    mend_hot_pixels: bool = False,
    layout: Layout | None = None,
    skip_existing: bool = False,
    progress: Callable[[int, int], None] | None = None,
    denoised: Callable[[Path, Noise], None] = lambda source, noise: None,
    failed: Callable[[FsidError], None] | None = None,
) -> dict[Path, Noise]:
    """Denoise each of `sources` into a DNG of its name in the folder `target`, which is made.

    The noise level that was used for each is returned. skip_existing: leave alone what is in `target`
    already; it is whole, as a DNG appears when all of it is written. denoised: told of each that is done.
    failed: told of each file that cannot be denoised. FsidError says in the end how many they were, and of
    the first why where `failed` is not given, or how many are left where the disk takes no more. What is
    wrong with all of them `check_options` tells before.
    """
    target, paths = Path(target), paths_of(sources)
    names = [path.stem for path in paths]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise FsidError(f"{paths[0].parent}: several files would become {twice[0]}.dng; rename one")
    targets = [target_in(target, path) for path in paths]
    if same_files(targets, paths):
        raise FsidError(f"{target}: is the folder of the originals, which would be overwritten")
    if skip_existing:
        left = [pair for pair in zip(paths, targets, strict=True) if not pair[1].is_file()]
        paths, targets = [source for source, _ in left], [out for _, out in left]
    is_new = not target.exists()
    make_folder(target)
    noises: dict[Path, Noise] = {}
    why = ""
    try:
        for done, (source, out) in enumerate(zip(paths, targets, strict=True)):
            try:
                noises[source] = denoise_file(
                    source,
                    out,
                    model,
                    profile=profile,
                    iso=iso,
                    strength=strength,
                    ensemble=ensemble,
                    mend_hot_pixels=mend_hot_pixels,
                    layout=layout,
                )
            except DiskError as error:  # before the others are denoised for nothing
                where = f"{len(paths) - done} of {len(paths)} files are left"
                raise FsidError(f"{error}; {where}, --skip-existing goes on from there") from None
            except FsidError as error:
                if failed is not None:
                    failed(error)
                else:
                    why = why or f": {error}"
            else:
                denoised(source, noises[source])
            if progress is not None:
                progress(done + 1, len(paths))
    finally:
        if is_new and paths and not noises:
            with contextlib.suppress(OSError):  # something else came to lie in it
                target.rmdir()
    if failures := len(paths) - len(noises):
        raise FsidError(f"{failures} of {len(paths)} files could not be denoised{why}")
    return noises
