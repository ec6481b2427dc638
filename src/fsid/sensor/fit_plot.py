"""The picture of a calibration: what was measured, the line through it, and what is left over.

Per ISO a column: variance over signal with the line, and the residuals in percent of the line. Open symbols
are measured but not used: beyond 70 % of the range (shaded), or below the resolution of the converter. A
last column shows k and sigma2 over ISO with the profile's law, where there are several ISOs.
"""

from __future__ import annotations

from collections.abc import Collection
from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fsid.errors import FsidError
from fsid.evenly_spaced import spaced
from fsid.files import check_output, same_files
from fsid.sensor.calibrate import NoiseFit
from fsid.sensor.camera_fit import Calibration
from fsid.sensor.camera_profile import MONO, CameraProfile
from fsid.sensor.mosaic import SITES
from fsid.sensor.pools import LINEAR_SHARE

COLOURS = ("tab:red", "tab:green", "tab:olive", "tab:blue")
PICTURES = (".png", ".pdf", ".svg")
PROFILES = (".yaml", ".yml")
_MAX_COLUMNS = 4  # ISOs in one picture; of more, evenly chosen ones


def check_picture(path: Path, beside: Path | None = None) -> None:
    """FsidError unless a picture can be written to `path`: before the work of which it is made.

    beside: another file that is written, too.
    """
    if beside is not None and same_files([path], [beside]):
        raise FsidError(f"{path}: would be both profile and plot; give two names")
    if path.suffix.lower() not in PICTURES:
        raise FsidError(f"{path}: a plot is written as {', '.join(PICTURES)}")
    check_output(path)


def check_profile(path: Path, frames: Collection[Path], plot: Path | None) -> None:
    """FsidError unless a profile can be written to `path`, a picture to `plot`, and neither is of `frames`.

    Profiles are .yaml: a shell puts the first frame after an -o that was left without a name.
    """
    if path.suffix.lower() not in PROFILES:
        raise FsidError(f"{path}: a profile is written as {' or '.join(PROFILES)}")
    check_output(path)
    if plot is not None:
        check_picture(plot, path)
    for written in (path, plot):
        if written is not None and same_files([written], frames):
            raise FsidError(f"{written}: is one of the frames; write to another file")


def calibration_picture(calibration: Calibration, suffix: str) -> bytes:
    """The picture as a file of the kind `suffix`, one of `PICTURES`."""
    profile, fits = calibration.profile, calibration.fits
    chosen = spaced(range(len(fits)), _MAX_COLUMNS)
    laws = len(fits) > 1
    figure = Figure(figsize=(4.6 * (len(chosen) + laws), 7), layout="constrained")
    axes = figure.subplots(2, len(chosen) + laws, squeeze=False)
    for column, index in enumerate(chosen):
        _plot_fit(axes[0, column], axes[1, column], fits[index], profile, profile.iso[index])
    if laws:
        plot_levels(axes[0, -1], axes[1, -1], profile)
    figure.suptitle(f"{profile.camera}: Var = k (DN - black) + sigma2")
    return _file(figure, suffix)


def profile_picture(profile: CameraProfile, suffix: str) -> bytes:
    """The picture of k and sigma2 over ISO as a file of the kind `suffix`, one of `PICTURES`."""
    figure = Figure(figsize=(11, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    plot_levels(left, right, profile)
    figure.suptitle(profile.camera)
    return _file(figure, suffix)


def plot_levels(k_axes: Axes, sigma2_axes: Axes, profile: CameraProfile) -> None:
    """k and sigma2 over ISO: the table of the profile as symbols, what `level` makes of it as lines."""
    iso = np.geomspace(min(profile.iso) / 1.4, max(profile.iso) * 2, 200)
    k_curve, sigma2_curve = ([curve(value) for value in iso] for curve in profile.curves)
    none = np.full_like(profile.k, np.nan)
    measured = profile.measured
    k_error, sigma2_error = (none, none) if measured is None else (measured.k_error, measured.sigma2_error)
    tables = (
        (k_axes, "k", profile.k, k_error, k_curve),
        (sigma2_axes, "sigma2", profile.sigma2, sigma2_error, sigma2_curve),
    )
    for axes, name, table, error, curve in tables:
        for site, (label, colour) in enumerate(_sites(profile)):
            axes.plot(iso, np.array(curve)[:, site], color=colour, linewidth=1)
            axes.errorbar(
                profile.iso, table[:, site], error[:, site], fmt="o", ms=4, color=colour, label=label
            )
        axes.set(xscale="log", yscale="log", xlabel="ISO", title=f"{name} (normalised) over ISO")
        axes.legend(fontsize="small")
        axes.grid(alpha=0.3)


def _file(figure: Figure, suffix: str) -> bytes:
    buffer = BytesIO()
    figure.savefig(buffer, dpi=110, format=suffix.lower().removeprefix("."))
    return buffer.getvalue()


def _plot_fit(top: Axes, bottom: Axes, fit: NoiseFit, profile: CameraProfile, iso: float) -> None:
    limit = LINEAR_SHARE * profile.span
    for site, (samples, (label, colour)) in enumerate(zip(fit.samples, _sites(profile), strict=False)):
        line = fit.k_dn[site] * samples.signal + fit.sigma2_dn[site]
        text = f"{label}: k {fit.k_dn[site]:.4g}, sigma2 {fit.sigma2_dn[site]:.4g} DN^2"
        residual = 100 * (samples.variance / line - 1)
        for used, fill, name in ((samples.used, colour, text), (~samples.used, "none", None)):
            for axes, values in ((top, samples.variance), (bottom, residual)):
                axes.plot(samples.signal[used], values[used], "o", ms=3, color=colour, mfc=fill, label=name)
        order = np.argsort(samples.signal)
        top.plot(samples.signal[order], line[order], color=colour, linewidth=1)
    for axes in (top, bottom):
        axes.axvspan(limit, profile.span, color="0.9", zorder=0)
        axes.set_xlim(-0.02 * profile.span, profile.span)
        axes.grid(alpha=0.3)
    largest = max((np.max(np.abs(s.variance[s.used])) for s in fit.samples if s.used.any()), default=1.0)
    top.set(ylim=(0, 1.6 * largest), ylabel="variance (DN^2)", title=f"ISO {iso:g}")
    top.legend(fontsize="x-small", loc="upper left")
    bottom.axhline(0, color="0.3", linewidth=0.8)
    bottom.set(ylim=(-15, 15), ylabel="residual (%)", xlabel="signal above black (DN)")


def _sites(profile: CameraProfile) -> tuple[tuple[str, str], ...]:
    return (("mono", "0.3"),) if profile.cfa == MONO else tuple(zip(SITES, COLOURS, strict=True))
