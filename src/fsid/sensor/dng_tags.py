"""The DNG tags of a `Raw`, there and back (Adobe, Digital Negative Specification 1.7).

    NoiseProfile of a plane: (S, O) with Var(x) = S x + O on x after black subtraction: S = k, O = sigma2
    AsShotNeutral = 1 / white_balance,      ColorMatrix1 = XYZ -> camera for CalibrationIlluminant1 = D65

NoiseProfile has one pair per colour plane, R, G, B, and so no place for the difference between Gr and Gb: its
green pair is their mean. The four exact pairs and the exact ISO (the tag holds integers) stand in
DNGPrivateData as JSON behind the owner name "FSID"; without that, and where the tags say something else, both
greens get the green pair.
"""

from __future__ import annotations

import json
import math
import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fsid.config import to_plain
from fsid.errors import FsidError
from fsid.sensor.metadata import COLOUR_MATRICES, DATE_TAKEN, EXPOSURE_TIME, ORIENTATION, merged
from fsid.sensor.raw import NoiseLevel, Raw
from fsid.sensor.tiff import (
    ASCII,
    BYTE,
    CFA,
    DOUBLE,
    LONG,
    PHOTOMETRIC,
    RATIONAL,
    SHORT,
    SRATIONAL,
    Tag,
    Values,
    rationals,
)

Tags = dict[int, Values]
"""The numbers of tags, fractions divided out (`Tag.numbers`), by code."""

MAKE, MODEL = 271, 272
CFA_REPEAT, CFA_PATTERN = 33421, 33422
EXIF_ISO = 34855
DNG_VERSION, DNG_BACKWARD_VERSION, UNIQUE_CAMERA_MODEL = 50706, 50707, 50708
CFA_PLANE_COLOUR, CFA_LAYOUT, BLACK_REPEAT, BLACK_LEVEL, WHITE_LEVEL = 50710, 50711, 50713, 50714, 50717
COLOUR_MATRIX_1, COLOUR_MATRIX_2, AS_SHOT_NEUTRAL, PRIVATE_DATA = 50721, 50722, 50728, 50740
CALIBRATION_1, CALIBRATION_2, ANALOG_BALANCE = 50723, 50724, 50727
CALIBRATION_SIGNATURE, PROFILE_SIGNATURE = 50931, 50932
LINEARIZATION, BLACK_DELTA_H, BLACK_DELTA_V, OPCODES_1 = 50712, 50715, 50716, 51008
ILLUMINANT_1, ILLUMINANT_2, NOISE_PROFILE, ACTIVE_AREA = 50778, 50779, 51041, 50829

D65 = 21  # EXIF LightSource
_KELVIN: dict[float, int] = {1: 5500, 2: 4150, 3: 2850, 4: 5500, 9: 5500, 10: 6500, 11: 7500}
_KELVIN |= {12: 6400, 13: 5050, 14: 4150, 15: 3450, 16: 2950, 17: 2850, 18: 5500, 19: 6500}
_KELVIN |= {20: 5500, D65: 6500, 22: 7500, 23: 5000, 24: 3200}  # of each LightSource; of a range, its middle
_UNKNOWN_KELVIN = 5000  # between lamps and daylight
MAX_EXIF_ISO = 65535
SENSITIVITY_TYPE, RECOMMENDED_INDEX = 34864, 34866
_TYPE_RECOMMENDED, _MAX_LONG = 2, 2**32 - 1
LARGE_ISOS = (34865, 34866, 34867)  # standard output sensitivity, recommended exposure index, ISO speed
MAX_SIDE = 65535  # pixels that LibRaw opens
MAX_REPEAT = 16  # rows and columns of a pattern of black levels; LibRaw rounds them and keeps 2 x 2

_OWNER = b"FSID\0"
_same = partial(math.isclose, rel_tol=1e-5)  # a tag and what FSID wrote there, in single precision too


def camera_tags(raw: Raw) -> tuple[Tag, ...]:
    """Tags of the file's first directory: what camera, what colour, what light.

    What the source said of its camera stays, as long as `raw` still says the same: its name, and the matrix
    that was read from those of several illuminants.
    """
    kept = {tag.code: tag for tag in raw.metadata.first}
    said = {code: tag.numbers for code, tag in kept.items()}
    read = d65_matrix(said)
    if read is None or not np.array_equal(read, raw.xyz_to_camera):
        kept = {code: tag for code, tag in kept.items() if code not in COLOUR_MATRICES}
    if raw.camera != camera_name(said):
        kept = {code: tag for code, tag in kept.items() if code not in (MAKE, MODEL, UNIQUE_CAMERA_MODEL)}
    matrices = COLOUR_MATRICES if COLOUR_MATRIX_1 in kept else frozenset()
    own = (tag for tag in _own_camera_tags(raw) if tag.code not in kept and tag.code not in matrices)
    return merged((*own, *kept.values()), (Tag(ORIENTATION, SHORT, (1,)),))


def _own_camera_tags(raw: Raw) -> tuple[Tag, ...]:
    camera = raw.camera.encode("ascii", "replace").strip() or b"unknown"
    make, _, model = camera.partition(b" ")
    return (
        Tag(DNG_VERSION, BYTE, bytes((1, 4, 0, 0))),
        Tag(DNG_BACKWARD_VERSION, BYTE, bytes((1, 1, 0, 0))),
        Tag(UNIQUE_CAMERA_MODEL, ASCII, camera + b"\0"),
        Tag(MAKE, ASCII, make + b"\0"),
        Tag(MODEL, ASCII, (model or make) + b"\0"),
        Tag(COLOUR_MATRIX_1, SRATIONAL, rationals(np.ravel(raw.xyz_to_camera))),
        Tag(ILLUMINANT_1, SHORT, (D65,)),
        Tag(AS_SHOT_NEUTRAL, RATIONAL, rationals([1 / gain for gain in raw.white_balance])),
        Tag(PRIVATE_DATA, BYTE, _private_data(raw)),
    )


def mosaic_tags(raw: Raw) -> tuple[Tag, ...]:
    """Tags of the directory that holds the mosaic: filter pattern, levels, noise."""
    tags: tuple[Tag, ...] = (
        Tag(CFA_REPEAT, SHORT, (2, 2)),
        Tag(CFA_PATTERN, BYTE, bytes("RGB".index(colour) for colour in raw.cfa)),
        Tag(CFA_PLANE_COLOUR, BYTE, bytes((0, 1, 2))),
        Tag(CFA_LAYOUT, SHORT, (1,)),
        Tag(BLACK_LEVEL, LONG, (raw.black_level,)),
        Tag(WHITE_LEVEL, LONG, (raw.white_level,)),
    )
    if raw.noise is not None:
        tags += (Tag(NOISE_PROFILE, DOUBLE, noise_profile(raw.noise)),)
    return merged(tags, raw.metadata.mosaic)


def exif_tags(raw: Raw) -> tuple[Tag, ...]:
    """Tags of the EXIF directory: what the source said, and the ISO as the integer that the tag holds.

    More than it holds stands in RecommendedExposureIndex, unless the source said it (EXIF 2.3, 4.6.5).
    """
    iso, said = whole_iso(raw.iso), {tag.code for tag in raw.metadata.exif}
    own: tuple[Tag, ...] = (Tag(EXIF_ISO, SHORT, (iso,)),) if iso > 0 else ()
    if raw.iso > MAX_EXIF_ISO and not said.intersection(LARGE_ISOS):
        own += (Tag(SENSITIVITY_TYPE, SHORT, (_TYPE_RECOMMENDED,)),)
        own += (Tag(RECOMMENDED_INDEX, LONG, (round(min(raw.iso, _MAX_LONG)),)),)
    return merged(own, raw.metadata.exif)


def whole_iso(iso: float) -> int:
    """As the EXIF tag holds it; 0 where it cannot."""
    return max(round(min(iso, MAX_EXIF_ISO)), 0)


def noise_profile(level: NoiseLevel) -> tuple[float, ...]:
    """`level` as the NoiseProfile tag: (S, O) of R, G, B; G is the mean of Gr and Gb."""
    pairs = list(zip(level.k, level.sigma2, strict=True))
    green = ((pairs[1][0] + pairs[2][0]) / 2, (pairs[1][1] + pairs[2][1]) / 2)
    return (*pairs[0], *green, *pairs[3])


def noise_level(tags: Tags) -> NoiseLevel | None:
    """The noise that `tags` state, exact where FSID wrote them; None where they state none."""
    private, values = _private_numbers(tags), _numbers(tags, NOISE_PROFILE)
    if len(private) == 9:
        exact = NoiseLevel(k=private[1:5], sigma2=private[5:9])
        told = noise_profile(exact)
        if len(values) == len(told) and all(map(_same, values, told)):  # else corrected since
            return exact
    if len(values) == 2:
        values *= 3
    if len(values) != 6 or not np.all(np.isfinite(values)):
        return None
    red, green, blue = values[0:2], values[2:4], values[4:6]
    return NoiseLevel(k=(red[0], green[0], green[0], blue[0]), sigma2=(red[1], green[1], green[1], blue[1]))


def iso_speed(tags: Tags) -> float:
    """The ISO that `tags` state, exact where FSID wrote it; 0 where they state none.

    65535 is the largest that the tag holds and means more; then others say how much (EXIF 2.3, 4.6.5).
    """
    iso = float(_number(tags, EXIF_ISO, 0))
    private = _private_numbers(tags)
    if private and whole_iso(private[0]) == iso:  # else corrected since
        return float(private[0])
    if iso < MAX_EXIF_ISO:
        return iso
    return max(iso, *(float(_number(tags, code, 0)) for code in LARGE_ISOS))


def exposure_time_s(tags: Tags) -> float:
    """Exposure time in seconds; 0 where `tags` state none."""
    return float(_number(tags, EXPOSURE_TIME, 0.0))


def date_taken(tags: Tags) -> str:
    """Day on which the picture was taken, "2026-11-21"; "" where `tags` state none."""
    day = _text(tags, DATE_TAKEN)[:10].replace(":", "-")
    return day if re.fullmatch(r"\d{4}-\d\d-\d\d", day) else ""


def active_area(tags: Tags, shape: tuple[int, int]) -> tuple[int, int, int, int] | None:
    """(top, left, bottom, right) of a DNG's pixels that saw light: of all, (height, width), where it states
    no area. None where `tags` are not of a DNG's mosaic, or state an area that cannot be."""
    area = _numbers(tags, ACTIVE_AREA) or (0, 0, *shape)
    is_mosaic = DNG_VERSION in tags and _numbers(tags, PHOTOMETRIC) == (CFA,)
    if not is_mosaic or len(area) != 4 or not all(0 <= edge <= MAX_SIDE for edge in area):
        return None
    top, left, bottom, right = map(int, area)
    return (top, left, bottom, right) if top < bottom and left < right else None


def black_tile(tags: Tags, path: Path) -> np.ndarray | None:
    """(rows, columns) black levels in DN that repeat from the first pixel of the active area on.

    None where `tags` are not a DNG's, or state none. Equal ones are one, however many. FsidError, naming
    `path`, where others do not fit their pattern, and for a fraction over 0.
    """
    if DNG_VERSION not in tags or BLACK_LEVEL not in tags:
        return None
    values = _numbers(tags, BLACK_LEVEL)
    if not values:
        raise FsidError(f"{path}: its BlackLevel states no number, or a fraction over 0; correct this tag")
    repeat = _numbers(tags, BLACK_REPEAT) or (1, 1)
    fits = len(repeat) == 2 and all(1 <= n <= MAX_REPEAT for n in repeat)
    rows, columns = map(int, repeat) if fits else (0, 0)
    if len(values) == rows * columns:
        return np.array(values, np.float64).reshape(rows, columns)
    if len(set(values)) == 1:
        return np.full((1, 1), values[0])
    raise FsidError(
        f"{path}: its {len(values)} numbers of BlackLevel fit no BlackLevelRepeatDim of "
        f"{' x '.join(f'{n:g}' for n in repeat)}; correct these tags"
    )


def black_deltas(tags: Tags, code: int, length: int) -> np.ndarray:
    """(length,) DN that each row (code BLACK_DELTA_V) or column (BLACK_DELTA_H) of the active area adds to
    the black level; 0 where `tags` state another number of them."""
    deltas = _numbers(tags, code)
    return np.array(deltas) if len(deltas) == length else np.zeros(length)


def opcodes_of_stored(tags: Tags) -> bytes:
    """A DNG's OpcodeList1, b"" where there is none."""
    opcodes = tags.get(OPCODES_1, b"") if DNG_VERSION in tags else b""
    return opcodes if isinstance(opcodes, bytes) else b""


def linearization(tags: Tags) -> np.ndarray | None:
    """The DN that a DNG's stored integers stand for; None where they stand for themselves."""
    table = _numbers(tags, LINEARIZATION) if DNG_VERSION in tags else ()
    return np.array(table) if table else None


def d65_matrix(tags: Tags) -> np.ndarray | None:
    """(3, 3) XYZ -> camera matrix of the illuminant nearest to D65 that `tags` offer one for, else None.

    AnalogBalance CameraCalibration ColorMatrix: that of the model, and what this unit of it differs by (DNG
    specification, "Mapping Camera Color Space to CIE XYZ Space"). A calibration counts where its signature is
    that of the profile.
    """
    first = (_number(tags, ILLUMINANT_1, D65), COLOUR_MATRIX_1, CALIBRATION_1)
    second = (_number(tags, ILLUMINANT_2, 0), COLOUR_MATRIX_2, CALIBRATION_2)
    for _, matrix, calibration in sorted((first, second), key=lambda light: _mired_from_d65(light[0])):
        numbers, of_unit = _numbers(tags, matrix), _numbers(tags, calibration)
        if len(numbers) == 9:
            found = np.reshape(numbers, (3, 3))
            signatures = (_text(tags, code) for code in (CALIBRATION_SIGNATURE, PROFILE_SIGNATURE))
            if len(of_unit) == 9 and len(set(signatures)) == 1:
                found = np.reshape(of_unit, (3, 3)) @ found
            balance = _numbers(tags, ANALOG_BALANCE)
            return np.diag(balance) @ found if len(balance) == 3 else found
    return None


def _mired_from_d65(illuminant: float) -> float:
    """How far the colour temperature of an EXIF LightSource lies from that of D65."""
    return abs(1e6 / _KELVIN.get(illuminant, _UNKNOWN_KELVIN) - 1e6 / _KELVIN[D65])


def camera_name(tags: Tags) -> str:
    """UniqueCameraModel, else make and model ("Canon", "Canon EOS R5": once), else "unknown"."""
    make, model = _text(tags, MAKE), _text(tags, MODEL)
    brand = make.partition(" ")[0].lower()
    told = model if brand and model.lower().startswith(brand) else f"{make} {model}".strip()
    return _text(tags, UNIQUE_CAMERA_MODEL) or told or "unknown"


def _private_data(raw: Raw) -> bytes:
    values: dict[str, Any] = {"iso": raw.iso}
    if raw.noise is not None:
        values |= {"k": tuple(raw.noise.k), "sigma2": tuple(raw.noise.sigma2)}
    return _OWNER + json.dumps(to_plain(values)).encode("ascii")


def _private_numbers(tags: Tags) -> Any:
    """(iso,) or (iso, four k, four sigma2) of FSID's private data, () where it is not there or broken."""
    data = tags.get(PRIVATE_DATA)
    if not isinstance(data, bytes) or not data.startswith(_OWNER):
        return ()
    try:
        values = json.loads(data[len(_OWNER) :])
        numbers = tuple(float(v) for v in (values["iso"], *values.get("k", ()), *values.get("sigma2", ())))
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
        return ()
    return numbers if np.all(np.isfinite(numbers)) else ()


def _numbers(tags: Tags, code: int) -> tuple[float, ...]:
    values = tags.get(code, ())
    return () if isinstance(values, bytes) else values


def _number(tags: Tags, code: int, default: float) -> float:
    return next(iter(_numbers(tags, code)), default)


def _text(tags: Tags, code: int) -> str:
    values = tags.get(code, b"")
    return values.split(b"\0")[0].decode("ascii", "replace").strip() if isinstance(values, bytes) else ""
