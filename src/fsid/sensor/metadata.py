"""What a RAW file says besides its pixels, kept so that a rewritten file develops like the original.

    read:   tags of the source -> Metadata -> Raw.metadata       write:   Raw.metadata -> tags of the DNG

Kept are the tags that describe camera, colour, lens, exposure and time, value for value. Not kept are those
that describe pixels as they were stored (compression, levels, linearisation: FSID writes its own), maker
notes, whose inner offsets break when they move, and where the picture was taken: GPS, and XMP and IPTC, which
may hold it. Files that are no TIFF (CR3, RAF) say orientation, exposure and lens through LibRaw instead.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import rawpy

from fsid.sensor.tiff import ASCII, RATIONAL, SHORT, Tag, rationals

ORIENTATION, EXPOSURE_TIME, F_NUMBER, FOCAL_LENGTH, LENS_MODEL = 274, 33434, 33437, 37386, 42036
DATE_TAKEN, BASELINE_EXPOSURE = 36867, 50730
CROP_ORIGIN, CROP_SIZE, NOISE_REMOVED, OPCODES_2 = 50719, 50720, 50935, 51009
COLOUR_MATRICES = frozenset((*range(50721, 50728), 50778, 50779, 50964, 50965))  # and their analog balance

# Description, make, model, orientation, date, artist, copyright; DNG: camera, colour, lens, profile.
_FIRST = frozenset((270, 271, 272, ORIENTATION, 306, 315, 33432, 50707, 50708, 50709)) | COLOUR_MATRICES
_FIRST |= frozenset((BASELINE_EXPOSURE, 50731, 50732, 50734, 50735, 50736, 50739, 50931, 50932))
_FIRST |= frozenset((*range(50936, 50943), 50981, 50982, 51107, 51108, 51109, 51110))
# Crop, green split, chroma blur, anti-alias, scale; lens corrections that converters apply to linear data.
_MOSAIC = frozenset(
    (CROP_ORIGIN, CROP_SIZE, NOISE_REMOVED, 50718, 50733, 50737, 50738, 50780, OPCODES_2, 51022, 51125)
)
_GEOMETRY = frozenset((CROP_ORIGIN, CROP_SIZE, OPCODES_2, 51022, 51125))
_EXIF = frozenset((EXPOSURE_TIME, F_NUMBER, 34850, 34855, 34864, 34865, 34866, 34867, 36864, 36867, 36868))
_EXIF |= frozenset((*range(37377, 37387), 37510, 37520, 37521, 37522, 41985, 41986, 41987, 41989, 41990))
_EXIF |= frozenset((36880, 36881, 36882, 42033, 42034, 42035, FOCAL_LENGTH, LENS_MODEL, 42037))

_ORIENTATION_OF_FLIP = {0: 1, 3: 3, 5: 8, 6: 6}  # LibRaw's flip to TIFF's orientation


@dataclass(frozen=True)
class Metadata:
    """Tags for a DNG's first directory, its mosaic's directory and its EXIF directory."""

    first: tuple[Tag, ...] = ()
    mosaic: tuple[Tag, ...] = ()
    exif: tuple[Tag, ...] = ()

    @property
    def orientation(self) -> int:
        """How the picture is to be turned, 1..8 of TIFF 6.0; 1 where nothing is said."""
        values = next((tag.values for tag in self.first if tag.code == ORIENTATION), ())
        return int(values[0]) if len(values) and not isinstance(values, bytes) else 1

    @property
    def exposure_s(self) -> float:
        """Exposure time in seconds; 0 where nothing is said."""
        return next((value for tag in self.exif if tag.code == EXPOSURE_TIME for value in _numbers(tag)), 0.0)

    @property
    def noise_removed(self) -> float:
        """Share of the noise that was removed from the pixels (NoiseReductionApplied); 0 where nothing is
        said."""
        return next(
            (value for tag in self.mosaic if tag.code == NOISE_REMOVED for value in _numbers(tag)), 0.0
        )

    @property
    def baseline_exposure(self) -> float:
        """By how many stops the camera wants its picture shown brighter; 0 where nothing is said."""
        numbers = (number for tag in self.first if tag.code == BASELINE_EXPOSURE for number in _numbers(tag))
        return next(numbers, 0.0)

    @property
    def opcodes_of_linear(self) -> bytes:
        """A DNG's OpcodeList2, b"" where there is none."""
        values = next((tag.values for tag in self.mosaic if tag.code == OPCODES_2), b"")
        return values if isinstance(values, bytes) else b""

    def with_noise_removed(self, share: float) -> Metadata:
        """The same for an image that was denoised, so that converters need not smooth it once more."""
        removed = Tag(NOISE_REMOVED, RATIONAL, rationals([max(share, self.noise_removed)]))
        return replace(self, mosaic=(*(t for t in self.mosaic if t.code != NOISE_REMOVED), removed))

    def within(self, width: int, height: int) -> Metadata:
        """The same for an image of that many pixels: a crop that reaches beyond them ends there."""
        crop = {tag.code: tag for tag in self.mosaic if tag.code in (CROP_ORIGIN, CROP_SIZE)}
        if len(crop) < 2:
            return self
        first, size = (_numbers(crop[code]) for code in (CROP_ORIGIN, CROP_SIZE))
        if len(first) != 2 or len(size) != 2:
            return self
        ends = [min(n, max(side - o, 0.0)) for o, n, side in zip(first, size, (width, height), strict=True)]
        if ends == size:
            return self
        fitting = Tag(CROP_SIZE, RATIONAL, rationals(ends))
        return replace(self, mosaic=tuple(fitting if t.code == CROP_SIZE else t for t in self.mosaic))

    def without_geometry(self) -> Metadata:
        """The same for an image that was cropped: crop and lens corrections are off."""
        return Metadata(self.first, tuple(t for t in self.mosaic if t.code not in _GEOMETRY), self.exif)


def _numbers(tag: Tag) -> list[float]:
    """The numbers of `tag`; [] of text and of fractions over 0."""
    return [] if isinstance(tag.numbers, bytes) else [float(value) for value in tag.numbers]


def kept_metadata(directories: Sequence[Mapping[int, Tag]], mosaic: Mapping[int, Tag]) -> Metadata:
    """From the directories of a TIFF-based RAW, the first one first, and the one of its mosaic."""
    everywhere: dict[int, Tag] = {}
    for directory in reversed(directories):
        everywhere |= directory
    first = directories[0] if directories else {}
    return Metadata(
        tuple(tag for code, tag in sorted({**mosaic, **first}.items()) if code in _FIRST),
        tuple(tag for code, tag in sorted(mosaic.items()) if code in _MOSAIC),
        tuple(tag for code, tag in sorted(everywhere.items()) if code in _EXIF),
    )


def exposure_metadata(
    exposure_s: float = 0.0,
    f_number: float = 0.0,
    focal_length_mm: float = 0.0,
    lens: str = "",
    orientation: int = 1,
    taken: str = "",
) -> Metadata:
    """What is known of an exposure; 0 and "" where unknown. taken: "2026:11:21 05:00:00"."""
    numbers = ((EXPOSURE_TIME, exposure_s), (F_NUMBER, f_number), (FOCAL_LENGTH, focal_length_mm))
    exif = [Tag(code, RATIONAL, rationals([value])) for code, value in numbers if value > 0]
    for code, text in ((DATE_TAKEN, taken), (LENS_MODEL, lens)):
        if text:
            exif.append(Tag(code, ASCII, text.encode("ascii", "replace") + b"\0"))
    return Metadata((Tag(ORIENTATION, SHORT, (orientation,)),), (), tuple(exif))


def libraw_metadata(file: rawpy.RawPy) -> Metadata:
    """What LibRaw says of a file that is no TIFF."""
    return exposure_metadata(
        exposure_s=float(file.other.shutter_speed),
        f_number=float(file.other.aperture),
        focal_length_mm=float(file.other.focal_length),
        lens=file.lens.model,
        orientation=_ORIENTATION_OF_FLIP.get(file.sizes.flip, 1),
        taken=taken(file),
    )


def taken(file: rawpy.RawPy) -> str:
    """When LibRaw says that the picture was taken, "2026:11:21 05:00:00"; "" where it does not know."""
    timestamp = file.other.timestamp
    return f"{timestamp:%Y:%m:%d %H:%M:%S}" if timestamp is not None and timestamp.year > 1970 else ""


def merged(own: Sequence[Tag], kept: Sequence[Tag]) -> tuple[Tag, ...]:
    """`own` tags, and those of `kept` with other codes."""
    codes = {tag.code for tag in own}
    return (*own, *(tag for tag in kept if tag.code not in codes))
