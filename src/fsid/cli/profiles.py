"""fsid profiles: the built-in camera noise profiles."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from rich.table import Column, Table
from rich.text import Text
from tyro.conf import Positional, arg

from fsid.cli.tables import print_table
from fsid.errors import FsidError
from fsid.terminal import Terminal


def profiles(
    name: Annotated[Positional[str | None], arg(metavar="[NAME]")] = None, *, plot: Path | None = None
) -> None:
    """List the built-in camera noise profiles, or show one: k and sigma2 per ISO and CFA site.

    Args:
        name: A built-in profile or a YAML file. All built-in profiles are listed where it is left out.
        plot: Picture of k and sigma2 over ISO to write (.png, .pdf or .svg).
    """
    from fsid.files import write_atomically
    from fsid.sensor import load_profile, profile_names
    from fsid.sensor.fit_plot import check_picture, profile_picture

    if plot is not None:
        check_picture(plot)
    if name is None:
        if plot is not None:
            raise FsidError("fsid profiles --plot: name the profile to plot")
        table = Table(Column("name", no_wrap=True), "camera", "CFA", "black", "white", "ISO")
        for known in profile_names():
            profile = load_profile(known)
            levels = (profile.cfa, str(profile.black_level), str(profile.white_level))
            table.add_row(
                known, Text(profile.camera), *levels, f"{min(profile.iso):g} .. {max(profile.iso):g}"
            )
        print_table(table)
        return
    profile = load_profile(name)
    console = Terminal()
    integers = f"  CFA {profile.cfa}, DN {profile.black_level}..{profile.white_level}"
    console.print(Text(profile.camera, style="bold"), integers, sep="")
    console.print(
        "Var(x) = k x + sigma2, x = (DN - black) / (white - black), as used (mean of the four CFA sites)"
    )
    table = Table("ISO", "k", "sigma2", "read noise (DN)")
    span = profile.white_level - profile.black_level
    for iso in profile.iso:
        level = profile.level(iso)
        k, sigma2 = sum(level.k) / 4, sum(level.sigma2) / 4
        table.add_row(f"{iso:g}", f"{k:.3e}", f"{sigma2:.3e}", f"{sigma2**0.5 * span:.2f}")
    print_table(table)
    console.print(Text(profile.source))
    if plot is not None:
        write_atomically(plot, profile_picture(profile, plot.suffix))
