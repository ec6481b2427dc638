"""The DNG tags of a `Raw`, there and back (Adobe, Digital Negative Specification 1.7).

    NoiseProfile of a plane: (S, O) with Var(x) = S x + O on x after black subtraction: S = k, O = sigma2
    AsShotNeutral = 1 / white_balance,      ColorMatrix1 = XYZ -> camera for CalibrationIlluminant1 = D65

NoiseProfile has one pair per colour plane, R, G, B, and so no place for the difference between Gr and Gb: its
green pair is their mean. The four exact pairs and the exact ISO (the tag holds integers) stand in
DNGPrivateData as JSON behind the owner name "FSID"; without that, both greens get the green pair.
"""

from __future__ import annotations

import json
from fractions import Fraction
from typing import Any

import numpy as np

from fsid.sensor.raw import NoiseLevel, Raw
from fsid.sensor.tiff import ASCII, BYTE, DOUBLE, LONG, RATIONAL, SHORT, SRATIONAL, Tag

MAKE, MODEL, ORIENTATION, SUB_IFD = 271, 272, 274, 330
CFA_REPEAT, CFA_PATTERN = 33421, 33422
EXIF_IFD, EXIF_ISO = 34665, 34855
DNG_VERSION, DNG_BACKWARD_VERSION, UNIQUE_CAMERA_MODEL = 50706, 50707, 50708
CFA_PLANE_COLOUR, CFA_LAYOUT, BLACK_LEVEL, WHITE_LEVEL = 50710, 50711, 50714, 50717
COLOUR_MATRIX_1, COLOUR_MATRIX_2, AS_SHOT_NEUTRAL, PRIVATE_DATA = 50721, 50722, 50728, 50740
ILLUMINANT_1, ILLUMINANT_2, NOISE_PROFILE = 50778, 50779, 51041

D65 = 21  # EXIF LightSource
MAX_EXIF_ISO = 65535

_OWNER = b"FSID\0"
_DENOMINATOR = 1_000_000  # of rationals: numbers return within 1e-11 of themselves


def camera_tags(raw: Raw) -> tuple[Tag, ...]:
    """Tags of the file's first directory: what camera, what colour, what light."""
    camera = raw.camera.encode("ascii", "replace").strip() or b"unknown"
    make, _, model = camera.partition(b" ")
    return (
        Tag(DNG_VERSION, BYTE, bytes((1, 4, 0, 0))),
        Tag(DNG_BACKWARD_VERSION, BYTE, bytes((1, 1, 0, 0))),
        Tag(UNIQUE_CAMERA_MODEL, ASCII, camera + b"\0"),
        Tag(MAKE, ASCII, make + b"\0"),
        Tag(MODEL, ASCII, (model or make) + b"\0"),
        Tag(ORIENTATION, SHORT, (1,)),
        Tag(COLOUR_MATRIX_1, SRATIONAL, _rationals(np.ravel(raw.xyz_to_camera))),
        Tag(ILLUMINANT_1, SHORT, (D65,)),
        Tag(AS_SHOT_NEUTRAL, RATIONAL, _rationals([1 / gain for gain in raw.white_balance])),
        Tag(PRIVATE_DATA, BYTE, _private_data(raw)),
    )


def mosaic_tags(raw: Raw) -> tuple[Tag, ...]:
    """Tags of the directory that holds the mosaic: filter pattern, levels, noise."""
    tags = (
        Tag(CFA_REPEAT, SHORT, (2, 2)),
        Tag(CFA_PATTERN, BYTE, bytes("RGB".index(colour) for colour in raw.cfa)),
        Tag(CFA_PLANE_COLOUR, BYTE, bytes((0, 1, 2))),
        Tag(CFA_LAYOUT, SHORT, (1,)),
        Tag(BLACK_LEVEL, LONG, (raw.black_level,)),
        Tag(WHITE_LEVEL, LONG, (raw.white_level,)),
    )
    return tags if raw.noise is None else (*tags, Tag(NOISE_PROFILE, DOUBLE, noise_profile(raw.noise)))


def exif_tags(raw: Raw) -> tuple[Tag, ...]:
    """Tags of the EXIF directory: the ISO, rounded to the integer that the tag holds; none if unknown."""
    iso = round(min(raw.iso, MAX_EXIF_ISO))
    return (Tag(EXIF_ISO, SHORT, (iso,)),) if iso > 0 else ()


def noise_profile(level: NoiseLevel) -> tuple[float, ...]:
    """`level` as the NoiseProfile tag: (S, O) of R, G, B; G is the mean of Gr and Gb."""
    pairs = list(zip(level.k, level.sigma2, strict=True))
    green = ((pairs[1][0] + pairs[2][0]) / 2, (pairs[1][1] + pairs[2][1]) / 2)
    return (*pairs[0], *green, *pairs[3])


def noise_level(tags: dict[int, Any]) -> NoiseLevel | None:
    """The noise that `tags` state, exact where FSID wrote them; None where they state none."""
    private = _private_values(tags)
    if "k" in private:
        return NoiseLevel(k=tuple(private["k"]), sigma2=tuple(private["sigma2"]))
    values = tags.get(NOISE_PROFILE, ())
    if len(values) == 2:
        values = tuple(values) * 3
    if len(values) != 6 or not np.all(np.isfinite(values)):
        return None
    red, green, blue = (tuple(map(float, values[i : i + 2])) for i in (0, 2, 4))
    return NoiseLevel(k=(red[0], green[0], green[0], blue[0]), sigma2=(red[1], green[1], green[1], blue[1]))


def iso_speed(tags: dict[int, Any]) -> float:
    """The ISO that `tags` state, exact where FSID wrote it; 0 where they state none."""
    private = _private_values(tags)
    if "iso" in private:
        return float(private["iso"])
    if EXIF_ISO in tags:
        return float(np.max(tags[EXIF_ISO]))
    exif = tags.get(EXIF_IFD)
    return float(np.max(exif.get("ISOSpeedRatings", 0))) if isinstance(exif, dict) else 0.0


def d65_matrix(tags: dict[int, Any]) -> np.ndarray | None:
    """(3, 3) XYZ -> camera matrix for D65, else for the other illuminant that `tags` offer, else None."""
    first = (tags.get(ILLUMINANT_1, D65), tags.get(COLOUR_MATRIX_1))
    second = (tags.get(ILLUMINANT_2), tags.get(COLOUR_MATRIX_2))
    for _, numbers in sorted((first, second), key=lambda pair: pair[0] != D65):
        if numbers is not None and len(numbers) == 18:
            return np.array([n / d for n, d in zip(numbers[::2], numbers[1::2], strict=True)]).reshape(3, 3)
    return None


def _private_data(raw: Raw) -> bytes:
    values: dict[str, Any] = {"iso": raw.iso}
    if raw.noise is not None:
        values |= {"k": list(raw.noise.k), "sigma2": list(raw.noise.sigma2)}
    return _OWNER + json.dumps(values).encode("ascii")


def _private_values(tags: dict[int, Any]) -> dict[str, Any]:
    data = bytes(tags.get(PRIVATE_DATA, b""))
    return json.loads(data[len(_OWNER) :]) if data.startswith(_OWNER) else {}


def _rationals(values: Any) -> tuple[int, ...]:
    fractions = [Fraction(float(value)).limit_denominator(_DENOMINATOR) for value in values]
    return tuple(n for f in fractions for n in (f.numerator, f.denominator))
