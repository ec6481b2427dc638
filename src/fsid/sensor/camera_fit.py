"""From frames on disk to the noise profile of their camera: the whole calibration.

    per ISO:  dark frames -> black, sigma2;   bursts -> (mean, variance) of every pixel -> line per site
    k = k_dn / span,      sigma2 = sigma2_dn / span^2,      span = white - black

Only one burst is in memory at a time, as sums; what remains of it is some hundred pooled samples. Dark frames
of the shortest exposure give the black level, and those of longer ones lie on the same line: dark current is
light to the noise. What was found and left out on the way is said in `Calibration.notes`, one line each.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fsid.errors import FsidError
from fsid.files import paths_of
from fsid.plurals import counted
from fsid.sensor.calibrate import NoiseFit, black_too_low_dn, departure, fit_samples
from fsid.sensor.camera_profile import CameraProfile
from fsid.sensor.defects import defective
from fsid.sensor.fitted_profile import profile_of, site_blacks
from fsid.sensor.frames import Frame, FrameSet, Layout, bursts, find_frames
from fsid.sensor.pools import Samples, pool, pool_dark
from fsid.sensor.temporal import TemporalStatistics
from fsid.sensor.terms_fit import CUT_OFF, DarkFinding, dark_finding, fit_terms, prnu_of, shortest_dark

MIN_FRAMES = 3  # of one ISO; a variance from two is one number per pixel, and a defect looks like noise
DARK_LEVEL = 0.05  # of the range, above which a dark frame saw light
DARK_CONTRAST = 0.02  # of the range between blocks, above which a dark frame shows a picture
BLACK_DIFFERS = 0.01  # of the range, from which on dark frames contradict a black level that the user states
BLACK_NOTED_DN = 1.0  # from which on it is noted, and from their own noise on
SITES_APART_DN = 0.5  # from which on one black level for all sites leaves a cast in the dark
BLACK_TOO_LOW_DN = 0.1  # from which on it is noted where there are no dark frames
BELOW_BLACK = 0.01  # of the pixels that may have a mean as far below the black level
SITES_APART_SIGMA = 0.05  # of the read noise, below which nobody sees the cast
UNCERTAIN = 0.02  # relative standard error of k that deserves a note
SIGMA2_UNCERTAIN = 0.2  # of sigma2, which hardly shows in bright pictures
UNRESOLVED = 0.5  # squared steps of the integers, the read noise below which their gaps hide it
CROOKED = 0.1  # relative departure of the samples from their line that does

Progress = Callable[[int, int], None]
_Pooled = tuple[Samples, ...]


@dataclass(frozen=True)
class Calibration:
    """A profile, the lines it is made of (one per ISO of the profile), and notes for the user."""

    profile: CameraProfile
    fits: tuple[NoiseFit, ...]
    notes: tuple[str, ...]


def calibrate(
    paths: str | Path | Iterable[str | Path],
    *,
    name: str,
    dark: str | Path | Iterable[str | Path] = (),
    layout: Layout = Layout(),
    camera: str | None = None,
    tie_greens: bool = False,
    terms: bool = False,
    progress: Progress | None = None,
) -> Calibration:
    """Noise profile `name` of a camera from bursts of static scenes, `paths`, and of the covered lens.

    paths, dark: files and folders, or one of them.
    layout: what bare mosaics do not say. camera: name for the profile, else the files'. tie_greens: one
    line for Gr and Gb. terms: measure what there is beyond k and sigma2 too (`terms_fit`) and switch it on.
    FsidError: mixed cameras, lone frames, moving scene, saturated or too few frames, dark frames that are
    not dark.
    """
    found = find_frames(paths_of(paths), paths_of(dark), layout)
    isos = sorted({frame.iso for frame in found.frames})
    reader = _Reader(found, layout, progress, terms=terms)
    seen = found.camera
    fits = [_fit_iso(reader, iso, tie_greens) for iso in isos]
    fits = [replace(fit, black=fit.black + seen.moved()) for fit in fits]
    profile = profile_of(
        dict(zip(isos, fits, strict=True)),
        name=name,
        cfa=seen.cfa,
        white_level=seen.white_level,
        black_level=seen.black_level,
        xyz_to_camera=seen.xyz_to_camera,
        camera=camera or seen.name or "unknown",
        frames=Counter(frame.iso for frame in found.frames),
        dark_frames=Counter(frame.iso for frame in found.dark),
        date=found.date,
        notes=". ".join(found.notes),
    )
    if terms:
        k_dn = {iso: float(fit.k_dn.mean()) for iso, fit in zip(isos, fits, strict=True)}
        profile = replace(profile, terms=fit_terms(reader.dark, reader.prnu, k_dn))
    return Calibration(profile, tuple(fits), (*found.notes, *_notes(reader, isos, fits)))


class _Reader:
    """Streams bursts, counts the frames for the progress bar, and keeps what is worth a note."""

    def __init__(self, found: FrameSet, layout: Layout, progress: Progress | None, *, terms: bool) -> None:
        self.found, self._layout, self._progress = found, layout, progress
        self.terms = terms  # wanted: they take seconds per burst of a full frame
        self.drifts_dn: list[float] = []  # of bursts that drifted
        self.moved: list[Path] = []
        self.saturated: list[Path] = []
        self.cut_off: list[float] = []  # ISOs whose read noise reaches DN 0
        self.blacks: list[tuple[int, float, Path]] = []  # stated and measured black level that differ
        self.dark: list[DarkFinding] = []
        self.prnu: list[float] = []
        self._done, self._total = 0, len(found.frames) + len(found.dark)

    def statistics(self, burst: Sequence[Frame], *, dark: bool = False) -> TemporalStatistics:
        if len(burst) < 2:
            alone = "ISO and exposure"
            if self.found.camera.bare:
                alone = f"light, {burst[0].level:.1f} DN on the mean, unlike the file before it"
            raise FsidError(
                f"{burst[0].path}: the only frame of its {alone}; a burst needs the same picture several "
                f"times: add frames, give those of one exposure one after the other, or leave it out"
            )
        stats = TemporalStatistics(self.found.camera.white_level, dark=dark and self.terms)
        for frame in burst:
            stats.add(self.found.read(frame, self._layout), str(frame.path))
            self._done += 1
            if self._progress is not None:
                self._progress(self._done, self._total)
        levels = [
            offset + (gain - 1) * stats.level_dn
            for gain, offset in zip(stats.gains, stats.offsets_dn, strict=True)
        ]
        if any(levels):
            self.drifts_dn.append(max(map(abs, levels)))
        if stats.moved_share > 0:
            self.moved.append(burst[0].path)
        return stats


def _fit_iso(reader: _Reader, iso: float, tie_greens: bool) -> NoiseFit:
    lights = [frame for frame in reader.found.frames if frame.iso == iso]
    darks = [frame for frame in reader.found.dark if frame.iso == iso]
    if len(lights) + len(darks) < MIN_FRAMES:
        raise FsidError(
            f"{lights[0].path}: only {counted(len(lights), 'frame')} and "
            f"{counted(len(darks), 'dark frame')} of ISO {iso:g}; a "
            f"calibration needs at least {MIN_FRAMES} in all, and 20 or more to be good"
        )
    black, left_out, pooled = _pool_dark(reader, iso, darks)
    if black is None:
        raise FsidError(
            f"{lights[0].path}: ISO {iso:g} has no dark frames and no black level; "
            f"give --dark frames or --black-level"
        )
    pooled += _pool_lights(reader, iso, lights, black, left_out)
    try:
        fit = fit_samples(pooled, black, tie_greens=tie_greens)
    except FsidError as error:
        raise FsidError(f"{lights[0].path}: ISO {iso:g}: {error}") from error
    if fit.k_dn.min() <= 0:
        site = int(fit.k_dn.argmin())
        raise FsidError(
            f"{lights[0].path}: ISO {iso:g}: noise does not grow with light (k is {fit.k_dn[site]:.2g} "
            f"+- {fit.k_dn_error[site]:.2g} DN); take brighter frames, or more of them"
        )
    return fit


def _pool_dark(
    reader: _Reader, iso: float, frames: list[Frame]
) -> tuple[np.ndarray | None, np.ndarray | None, list[_Pooled]]:
    """(black level per site in DN, from the file where there are no frames; pixels that are defective in any
    of them; what the frames pool to).

    The shortest exposure is the black level, of bare mosaics the lowest one; the others are dark current.
    """
    camera = reader.found.camera
    black = camera.site_black()
    left_out: np.ndarray | None = None
    pooled: list[_Pooled] = []
    shortest_first = sorted(bursts(frames), key=lambda burst: (burst[0].exposure_s, burst[0].level))
    for number, burst in enumerate(shortest_first):
        stats = reader.statistics(burst, dark=True)
        _check_dark(stats, burst[0].path, camera.black_level, camera.white_level)
        if reader.terms and (finding := dark_finding(stats, iso, burst[0].exposure_s)) is not None:
            reader.dark.append(finding)
        if stats.zero_share > CUT_OFF:
            reader.cut_off.append(iso)
        far = defective(stats.mean())
        left_out = far if left_out is None else left_out | far
        shortest = black if number > 0 else None
        samples, levels = pool_dark(stats, camera.cfa, camera.white_level, shortest, left_out=far)
        if number == 0:
            noise_dn = float(np.sqrt(np.mean([site.variance.mean() for site in samples])))
            _check_black(reader, float(levels.mean()), noise_dn, burst[0].path)
            black = levels
        pooled.append(samples)
    return black, left_out, pooled


def _check_black(reader: _Reader, measured: float, noise_dn: float, path: Path) -> None:
    """A stated black level that dark frames contradict is noted, or refused where the user is far off."""
    camera = reader.found.camera
    stated = camera.black_level
    if stated is None or abs(stated - measured) <= max(BLACK_NOTED_DN, noise_dn):
        return
    if camera.bare and abs(stated - measured) > BLACK_DIFFERS * (camera.white_level - measured):
        raise FsidError(f"{path}: dark frames of mean {measured:.1f} DN contradict --black-level {stated}")
    reader.blacks.append((stated, measured, path))


def _pool_lights(
    reader: _Reader, iso: float, frames: list[Frame], black: np.ndarray, left_out: np.ndarray | None
) -> list[_Pooled]:
    """What the lit bursts pool to, a burst each; at least one has to be usable in every site."""
    camera = reader.found.camera
    shortest = shortest_dark(reader.dark, iso)
    fixed_dn2 = shortest.fixed_dn2 if shortest else 0.0
    pooled: list[_Pooled] = []
    usable = False
    for burst in bursts(frames):
        stats = reader.statistics(burst)
        _check_above(stats, float(black.mean()), camera.white_level, burst[0].path)
        try:
            samples = pool(stats, camera.cfa, black, camera.white_level, left_out)
        except FsidError as error:
            raise FsidError(f"{burst[0].path}: {error}") from error
        if all(site.used.any() for site in samples):
            usable = True
            if reader.terms and (prnu := prnu_of(stats, float(black.mean()), fixed_dn2)) is not None:
                reader.prnu.append(prnu)
        else:
            reader.saturated.append(burst[0].path)
        pooled.append(samples)
    if not usable:
        raise FsidError(
            f"{frames[0].path}: every burst of ISO {iso:g} is saturated or without light; "
            f"expose so that the scene stays below 70 % of the range"
        )
    return pooled


def _check_dark(stats: TemporalStatistics, path: Path, black: int | None, white: int) -> None:
    level = float(np.median(stats.mean()))
    floor, limit = (black, DARK_LEVEL) if black is not None else (0, 5 * DARK_LEVEL)
    if level - floor > limit * (white - floor):
        raise FsidError(f"{path}: a dark frame of mean {level:.0f} DN is not dark; cover the lens")
    if stats.contrast_dn > DARK_CONTRAST * white:
        raise FsidError(f"{path}: a dark frame that shows a picture is not dark; cover the lens")


def _check_above(stats: TemporalStatistics, black: float, white: int, path: Path) -> None:
    mean, variance = stats.sites(None)[0]
    if not mean.size:
        return
    tolerance = BLACK_DIFFERS * (white - black) + 5 * float(np.sqrt(np.median(variance) / stats.frames))
    below = float(np.mean(mean < black - tolerance))
    if below > BELOW_BLACK:
        raise FsidError(
            f"{path}: {100 * below:.0f} % of its pixels lie below the black level, {black:.0f} DN"
        )


def apart_dn(sigma2_dn: np.ndarray) -> float:
    """DN between black levels beyond which a cast is seen in the dark; sigma2_dn: (n, sites) of all ISOs."""
    read_dn2 = max(float(np.mean(sigma2_dn, axis=1).min()), 0.0)
    return max(SITES_APART_DN, SITES_APART_SIGMA * read_dn2**0.5)


def _notes(reader: _Reader, isos: Sequence[float], fits: Sequence[NoiseFit]) -> Iterator[str]:
    if unmatched := {frame.iso for frame in reader.found.dark} - set(isos):
        yield f"dark frames of ISO {', '.join(f'{i:g}' for i in sorted(unmatched))} have no bursts: unused"
    if reader.found.camera.cfa is not None and reader.found.camera.xyz_to_camera is None:
        yield "no colour matrix is stated: xyz_to_camera has the published ones of other cameras"
    if reader.drifts_dn:
        yield (
            f"the level of {counted(len(reader.drifts_dn), 'burst')} drifted by up to "
            f"{max(reader.drifts_dn):.2g} DN between frames (flicker, black level): compensated"
        )
    for paths, what in (
        (reader.moved, "something moved; that part of the image is left out"),
        (reader.saturated, "beyond 70 % of the range or without light; left out"),
    ):
        if paths:
            yield f"{counted(len(paths), 'burst')}, the first one that of {paths[0]}: {what}"
    for stated, measured, path in reader.blacks:
        source = "--black-level" if reader.found.camera.bare else "the files' black level"
        yield f"{path}: dark frames have a mean of {measured:.1f} DN, {source} is {stated}, which is kept"
    yield from _notes_on_integers(reader.found, fits)
    for iso in sorted(set(reader.cut_off)):
        yield f"ISO {iso:g}: dark noise reaches DN 0 and is cut off; corrected as far as it is Gaussian"
    for iso, fit in zip(isos, fits, strict=True):
        if (low_dn := black_too_low_dn(fit)) > BLACK_TOO_LOW_DN:
            yield (
                f"ISO {iso:g}: noise falls to nothing before light does: the black level is at least "
                f"{low_dn:.2g} DN too low, and sigma2 unknown; give --dark frames or the right level"
            )
        elif (off := departure(fit)) > CROOKED:
            yield (
                f"ISO {iso:g}: noise is no straight line in light (off by {100 * off:.0f} %, see --plot), so "
                f"k and sigma2 mean little; are DN compressed, is the white level too high, are ISOs mixed?"
            )
        else:
            k_error, sigma2_error = (
                float(np.max(error / value))
                for error, value in ((fit.k_dn_error, fit.k_dn), (fit.sigma2_dn_error, fit.sigma2_dn))
            )
            if k_error > UNCERTAIN:
                yield f"ISO {iso:g}: k is uncertain by {100 * k_error:.1f} %; take more frames"
            if sigma2_error > SIGMA2_UNCERTAIN:
                yield (
                    f"ISO {iso:g}: sigma2 is uncertain by {100 * sigma2_error:.0f} %; take dark frames, or "
                    f"more of them"
                )


def _notes_on_integers(found: FrameSet, fits: Sequence[NoiseFit]) -> Iterator[str]:
    """What black level the stored integers have, and whether they are too coarse for their noise."""
    sigma2_dn = np.array([fit.sigma2_dn for fit in fits])
    black = site_blacks(np.array([fit.black for fit in fits]), sigma2_dn)
    off_dn = float(np.abs(black - round(float(black.mean()))).max())
    if found.camera.bare and max(np.ptp(black), 2 * off_dn) > apart_dn(sigma2_dn):
        rounded = [f"{round(level, 1):g}" for level in black.tolist()]
        levels = ",".join(rounded if len(set(rounded)) > 1 else rounded[:1])
        yield (
            f"the black level is {levels} and not one whole number: denoise such mosaics with --black-level "
            f"{levels}"
        )
    if found.step_dn > 1 and sigma2_dn.min() < UNRESOLVED * found.step_dn**2:
        yield (
            f"all DN are multiples of {found.step_dn}, and read noise is hardly larger: k, sigma2 and their "
            f"errors are wrong; give the integers, and the levels, divided by {found.step_dn}"
        )
