"""What noise profiles are asked for and have not measured."""

from __future__ import annotations

from collections.abc import Iterable

from rich.console import Console


def note_extrapolation(names: Iterable[str], iso_min: float, iso_max: float, *, quiet: bool) -> None:
    """A line for each profile whose measured ISOs the range exceeds by more than two stops."""
    from fsid.sensor import far_extrapolated

    console = Console(stderr=True, quiet=quiet)
    for profile in far_extrapolated(names, iso_min, iso_max):
        first, last = profile.iso[0], profile.iso[-1]
        measured = f"ISO {first:g}" if first == last else f"ISO {first:g} to {last:g}"
        console.print(
            f"note: profile {profile.name} was measured at {measured}; "
            f"its noise at ISO {iso_min:g} to {iso_max:g} is extrapolated far",
            soft_wrap=True,
            markup=False,
        )
