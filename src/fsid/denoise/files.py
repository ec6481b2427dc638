"""A RAW file in, a denoised DNG out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from fsid.denoise.denoise import denoise_raw
from fsid.denoise.model import Denoiser
from fsid.errors import FsidError
from fsid.sensor import NoiseLevel, Raw, clean_levels, load_profile, read_mosaic, read_raw, write_dng
from fsid.sensor.bare import BARE_SUFFIXES


@dataclass(frozen=True)
class MosaicLayout:
    """What a bare mosaic file does not say of itself. width, height: pixels; None where the file knows."""

    cfa: str
    black_level: int
    white_level: int
    width: int | None = None
    height: int | None = None


def read_input(path: Path, layout: MosaicLayout | None) -> Raw:
    """Any Bayer file that LibRaw opens, or a bare mosaic with its `layout`. FsidError where unreadable."""
    if layout is not None:
        return read_mosaic(
            path,
            cfa=layout.cfa,
            black_level=layout.black_level,
            white_level=layout.white_level,
            width=layout.width,
            height=layout.height,
        )
    if path.suffix.lower() in BARE_SUFFIXES:
        raise FsidError(
            f"{path}: is a bare mosaic, say what it holds: --cfa RGGB --black-level DN --white-level DN"
        )
    return read_raw(path)


def noise_level(raw: Raw, profile: str | None, iso: float | None, path: Path) -> NoiseLevel:
    """The level of a profile at an ISO (by default the file's ISO), or else the file's own `NoiseProfile`."""
    if profile is not None:
        iso = iso if iso is not None else raw.iso
        if not iso > 0:
            raise FsidError(f"{path}: its ISO is unknown, give --iso")
        return load_profile(profile).level(iso)
    if iso is not None:
        raise FsidError("--iso: names a level of a camera; give --profile too (fsid profiles lists them)")
    if raw.noise is None:
        raise FsidError(
            f"{path}: holds no NoiseProfile; give --profile NAME --iso N (fsid profiles lists them)"
        )
    return raw.noise


def denoise_file(
    source: Path,
    target: Path,
    model: Denoiser,
    *,
    profile: str | None = None,
    iso: float | None = None,
    layout: MosaicLayout | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Denoise one RAW file into a DNG with 64 times finer levels (a denoised value is no whole DN)."""
    if target.suffix.lower() != ".dng":
        raise FsidError(f"{target}: a denoised RAW is written as .dng")
    raw = read_input(source, layout)
    if iso is not None:
        raw = replace(raw, iso=iso)
    denoised = denoise_raw(raw, model, noise_level(raw, profile, iso, source), progress=progress)
    write_dng(target, clean_levels(denoised))
