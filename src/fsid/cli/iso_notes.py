"""What noise profiles are asked for and have not measured."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

from fsid.cli.notes import note
from fsid.errors import FsidError


def note_extrapolation(names: Iterable[str], iso_min: float, iso_max: float) -> None:
    """A line for each profile whose measured ISOs the range exceeds by more than two stops."""
    from fsid.sensor import far_extrapolated

    for profile in far_extrapolated(names, iso_min, iso_max):
        measured = f"profile {profile.name} was measured at {_range(profile.iso[0], profile.iso[-1])}"
        note(f"{measured}; its noise at {_range(iso_min, iso_max)} is extrapolated far")


def note_files(profile: str, paths: Iterable[Path]) -> None:
    """The same for one profile and the ISOs that RAW files state; one that cannot be read states none."""
    from fsid.sensor.dng import read_header

    isos = []
    for path in paths:
        with suppress(FsidError):
            isos.append(read_header(path).iso)
    if known := [iso for iso in isos if iso > 0]:
        note_extrapolation([profile], min(known), max(known))


def _range(first: float, last: float) -> str:
    return f"ISO {first:g}" if first == last else f"ISO {first:g} to {last:g}"
