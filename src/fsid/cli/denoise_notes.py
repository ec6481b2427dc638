"""What fsid denoise says of files beside its results, each in one line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fsid.cli.notes import note

if TYPE_CHECKING:
    from fsid.denoise import Noise
    from fsid.sensor import Layout


def note_other_frames(layout: Layout, profile: str | None) -> None:
    """Lines where the options state something else than the frames had that the profile was measured on."""
    from fsid.sensor import load_bayer_profile
    from fsid.sensor.camera_fit import apart_dn
    from fsid.sensor.fitted_profile import site_blacks

    camera = None if profile is None else load_bayer_profile(profile)
    if camera is None or camera.measured is None or layout.black_level is None:
        return
    measured = f"profile {profile} was measured on frames of"
    if layout.cfa != camera.cfa:
        line = f"--cfa {layout.cfa}: {measured} {camera.cfa}"
        note(f"{line}; if this frame is one of those, red and blue are wrong")
    if layout.white_level != camera.white_level:
        line = f"--white-level {layout.white_level}: {measured} {camera.white_level}"
        note(f"{line}; if this frame is one of those, its noise is misjudged")
        return
    sigma2_dn = camera.sigma2 * camera.span**2
    black = site_blacks(camera.measured.black, sigma2_dn)
    if np.abs(black - np.asarray(layout.black_level)).max() > apart_dn(sigma2_dn):
        levels = ",".join(f"{round(level, 1):g}" for level in black.tolist())
        line = f"without --black-level {levels}, as profile {profile} measured, a colour cast stays"
        note(line)


def note_guessed(noises: Mapping[Path, Noise]) -> None:
    """A line on the files whose noise nothing states."""
    if guessed := [path for path, noise in noises.items() if noise.is_estimated]:
        line = (
            f"the noise of {len(guessed)} of {len(noises)} files, the first one {guessed[0]}, is "
            "estimated from the images; --profile and --iso state it"
        )
        note(line)


def note_noises(noises: Mapping[Path, Noise], most_noise: float) -> None:
    """Lines on the files that may not be denoised as they should be: those that hold more noise than the
    network knows, that were denoised before, that show far more noise than was taken off, or far less.

    most_noise: variance at mid-grey up to which the network knows noise.
    """
    from fsid.denoise.denoise import variance_at_grey

    if strong := [path for path, noise in noises.items() if variance_at_grey(noise.level) > most_noise]:
        line = f"{_named(strong)}: more noise than the network knows"
        note(f"{line} (variance at mid-grey above {most_noise:.2g}); look at the result")
    if left := [path for path, noise in noises.items() if noise.is_left]:
        said = "denoised before, as NoiseReductionApplied says; what is smoothed now may be detail"
        note(f"{_named(left)}: {said}")
    shown = {path: noise.shown for path, noise in noises.items() if noise.shown is not None}
    for result, digits, unlike in (
        ("noisy", 0, [path for path, times in shown.items() if times > 1]),
        ("too smooth", 2, [path for path, times in shown.items() if times < 1]),
    ):
        if unlike:
            times, source = f"{shown[unlike[0]]:.{digits}f}", noises[unlike[0]].source
            line = f"{_named(unlike)}: shows {times} times the noise variance of {source}"
            note(f"{line}; the result may be {result}")


def note_hot_pixels(noises: Mapping[Path, Noise]) -> None:
    """A line on how many pixels were mended."""
    counts = [noise.hot for noise in noises.values()]
    if len(counts) == 1:
        note(f"hot and dead pixels: {counts[0]} mended")
    elif counts:
        note(f"hot and dead pixels: {min(counts)} to {max(counts)} mended in a file")


def _named(paths: Sequence[Path]) -> str:
    """The first of `paths`, and how many there are beside it."""
    return f"{paths[0]} and {len(paths) - 1} more" if len(paths) > 1 else str(paths[0])


def note_left_out(folder: Path, output: Path, *, bare: bool) -> None:
    """A line on the files in subfolders (an `output` among them holds results), one on the other kind's."""
    from fsid.denoise.files import raws_below, raws_inside

    below = [p for p in raws_below(folder, bare=bare) if output.resolve() not in p.resolve().parents]
    others = raws_inside(folder, bare=not bare)
    kind = f"RAW files in {folder}" if bare else f"files in {folder} that may be bare mosaics"
    how = f"denoise them {'without' if bare else 'with'} --cfa, --black-level and --white-level"
    inside, each = f"files in folders inside {folder}", "give each folder by itself"
    for what, left_out, advice in ((inside, below, each), (kind, others, how)):
        if left_out:
            line = f"{what} are left out ({len(left_out)}, the first one {left_out[0]}); {advice}"
            note(line)
