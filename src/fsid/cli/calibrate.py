"""fsid calibrate: a noise profile of your own camera, from repeated frames of a static scene."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from rich.table import Table
from rich.text import Text
from tyro.conf import Positional, arg

from fsid.cli.arguments import Output, black_levels
from fsid.cli.notes import note
from fsid.cli.progress import progress_bar
from fsid.cli.tables import print_table

if TYPE_CHECKING:
    from fsid.sensor.camera_fit import Calibration


def calibrate(
    frames: Annotated[Positional[tuple[Path, ...]], arg(metavar="FRAME...", help_behavior_hint="(required)")],
    *,
    output: Output,
    dark: tuple[Path, ...] = (),
    iso: float | None = None,
    plot: Path | None = None,
    cfa: Literal["RGGB", "BGGR", "GRBG", "GBRG", "MONO"] | None = None,
    black_level: str | None = None,
    white_level: int | None = None,
    width: int | None = None,
    height: int | None = None,
    camera: str | None = None,
    tie_greens: bool = False,
    terms: bool = False,
    quiet: bool = False,
) -> None:
    """Fit Var(x) = k x + sigma2 per CFA site and ISO to bursts of static scenes; write it as a profile.

    Frames are sorted into bursts by the ISO and exposure time that they state. Notes say what was
    compensated or left out.

    Args:
        frames: RAW files that LibRaw opens, or bare mosaics (.npy, 16-bit .png or .tif, .raw); folders
            stand for the files in them, at any depth. The ISO of bare mosaics is in their path
            (iso3200/a.png), or --iso.
        output: Profile to write, .yaml. One that is there is replaced, and a note says what it had and the
            new one lacks.
        dark: Frames with the lens covered, of the same ISOs: they give black level and sigma2.
        iso: ISO of all frames that state none. One that they do state is replaced, and a note says so; frames
            of several ISOs are refused.
        plot: Picture of samples, lines and residuals to write (.png, .pdf or .svg).
        cfa: Colours of a bare mosaic's first 2x2 pixels, read row by row; MONO for no colour filters.
        black_level: Black level of bare mosaics in DN; where they differ those of R, Gr, Gb and B, as in
            60,66,64,70. Needed where there are no dark frames.
        white_level: White level (saturation) of bare mosaics in DN; by default from the largest value.
        width: Width of .raw or .bin mosaics in pixels.
        height: Height of .raw or .bin mosaics in pixels.
        camera: Name of the camera for the profile; by default the files'.
        tie_greens: Fit one line to Gr and Gb.
        terms: Measure banding, fixed pattern, PRNU, heavy tails, drift, dark current and defects too, as far
            as the frames show them, and switch them on in the profile.
        quiet: No progress bar, no table; notes are printed.
    """
    from fsid.files import write_together
    from fsid.sensor import Layout
    from fsid.sensor import calibrate as calibrate_frames
    from fsid.sensor.fit_plot import calibration_picture, check_profile
    from fsid.sensor.frames import frame_files
    from fsid.sensor.profiles import left_behind, profile_file

    check_profile(output, [*frame_files(frames), *frame_files(dark)], plot)
    layout = Layout(iso, cfa, black_levels(black_level), white_level, width, height)
    with progress_bar("reading", "frames", quiet=quiet) as progress:
        found = calibrate_frames(
            frames,
            name=output.stem,
            dark=dark,
            layout=layout,
            camera=camera,
            tie_greens=tie_greens,
            terms=terms,
            progress=progress,
        )
    lost = left_behind(output, found.profile)
    pictures = {} if plot is None else {plot: calibration_picture(found, plot.suffix)}
    write_together({**pictures, output: profile_file(found.profile)})
    for line in found.notes:
        note(line)
    if lost:
        note(f"{output}: was replaced; the one before had what this one lacks: {lost}")
    print_table(_table(found), quiet=quiet)


def _table(found: Calibration) -> Table:
    """The lines that were fitted, a row per ISO and CFA site."""
    title = Text(found.profile.camera)
    table = Table("ISO", "site", "black (DN)", "k (DN)", "±", "sigma2 (DN²)", "±", title=title)
    for level, fit in zip(found.profile.iso, found.fits, strict=True):
        for site, label in enumerate(("R", "Gr", "Gb", "B") if len(fit.k_dn) == 4 else ("mono",)):
            values = (fit.k_dn, fit.k_dn_error, fit.sigma2_dn, fit.sigma2_dn_error)
            figures = [f"{value[site]:.4g}" for value in values]
            table.add_row(f"{level:g}", label, f"{fit.black[site]:.2f}", *figures)
    return table
