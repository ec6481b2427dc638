"""The numbers in the file of a photograph as sRGB, whatever colour space and number of bits the file states.

Pillow hands out the upper 8 bits of 16-bit colours. Steps of 8 bits are, unprocessed, as large in the shadows
as the read noise of a phone's camera at its lowest ISO: so the lower 8 bits are read, too. LittleCMS, as
Pillow has it, converts colours of another space with 8 bits.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from PIL import ExifTags, Image, ImageCms

from fsid.sensor import srgb_encode
from fsid.sensor.colour import SRGB_TO_XYZ, apply_matrix

_WITHOUT_ALPHA = {"P": "RGB", "PA": "RGB", "RGBA": "RGB", "RGBX": "RGB", "LA": "L", "1": "L"}
_BITS, _PHOTOMETRIC, _PLANAR = 258, 262, 284
_WHITE_IS_ZERO, _SEPARATE = 0, 2
"""Tags of TIFF 6.0, and what they may say."""
_OTHER_ORDER = {"B": "L", "L": "B", "N": "B" if sys.byteorder == "little" else "L"}
"""Of the bytes of a number, by the last letter of Pillow's "raw mode" of it."""
_SAME_LEVELS = 2
"""Of 255: profiles of sRGB differ by less."""
_USUAL_GAMMA, _GAMMAS = 1 / 2.2, (1 / 3, 1.0)
"""Of PNG files: what stands for sRGB, and what is believed."""
_ADOBE_GAMMA = 563 / 256
_ADOBE_TO_SRGB = np.linalg.inv(SRGB_TO_XYZ) @ [
    [0.57667, 0.18556, 0.18823],
    [0.29734, 0.62736, 0.07529],
    [0.02703, 0.07069, 0.99134],
]
"""Adobe RGB (1998), section 4.3.5."""


def srgb_values(image: Image.Image, again: Callable[[], Image.Image]) -> np.ndarray:
    """(H, W, 3) float32 0..1, sRGB-encoded, of an opened photograph, as it lies in the file (not upright).

    again: opens it once more, at the same page. ValueError for numbers that are none of 8 or 16 bits.
    """
    icc = image.info.get("icc_profile") or b""
    is_converted = bool(icc) and not _is_srgb(icc)
    if image.mode.startswith("I;16") or (image.mode, image.format) == ("I", "PNG"):
        levels = _grey(image)
        if is_converted:  # by Pillow's LittleCMS for 256 levels, and in between by interpolation
            known = np.asarray(_converted(Image.fromarray(np.arange(256, dtype=np.uint8)[None]), icc))[0]
            curves = [np.interp(levels * 255, np.arange(256), known[:, c] / 255) for c in range(3)]
            return np.stack(curves, axis=-1).astype(np.float32)
        values = levels[..., None].repeat(3, axis=2)
    elif image.mode in ("I", "F"):
        raise ValueError("its values are not 8-bit or 16-bit unsigned integers")
    elif is_converted:
        if _lower_tiles(image):
            image = Image.fromarray(np.rint(_colours(image, again) * 255).astype(np.uint8))
        return _unit(np.asarray(_converted(image, icc)), 255)
    else:
        values = _colours(image, again)
    return values if icc else _in_stated_space(image, values)


def _grey(image: Image.Image) -> np.ndarray:
    """(H, W) float32 0..1 of 16-bit grey; Pillow's own conversion would clip it to white."""
    levels = _unit(np.asarray(image), 65535)
    if getattr(image, "tag_v2", {}).get(_PHOTOMETRIC) == _WHITE_IS_ZERO:  # of 8 bits Pillow sees to it
        return 1 - levels
    return levels


def _colours(image: Image.Image, again: Callable[[], Image.Image]) -> np.ndarray:
    """(H, W, 3) float32 0..1 of 8 bits, or of 16 where Pillow decodes them."""
    lower_tiles = _lower_tiles(image)
    upper = np.asarray(_bare(image).convert("RGB"))
    if not lower_tiles:
        return _unit(upper, 255)
    with again() as lower:
        lower.tile = lower_tiles  # type: ignore[attr-defined]
        levels = np.asarray(lower.convert("RGB")).astype(np.uint16)
    levels += upper.astype(np.uint16) << 8
    return _unit(levels, 65535)


def _lower_tiles(image: Image.Image) -> list[Any]:
    """What has Pillow decode the lower bytes of 16-bit colours in place of the upper; [] for other numbers.

    It takes the first byte of a big-endian number and the second of a little-endian one: the order of bytes
    is stated the other way round. ValueError for 16-bit TIFF that it would take for one of 8 bits.
    """
    tags = getattr(image, "tag_v2", {})
    is_separate = tags.get(_PLANAR) == _SEPARATE
    tiles = []
    for tile in getattr(image, "tile", ()):
        codec, box, offset, arguments = tile
        if is_separate and codec == "raw" and 16 in tags.get(_BITS, ()):
            raise ValueError("its 16-bit channels lie one after the other; save them interleaved")
        mode, *others = (arguments,) if isinstance(arguments, str) else arguments or ("",)
        kind, _, order = str(mode).partition(";16")
        if is_separate or kind not in ("RGB", "RGBA", "RGBX") or order not in _OTHER_ORDER:
            return []
        other = f"{kind};16{_OTHER_ORDER[order]}"
        make = getattr(type(tile), "_make", tuple)
        tiles.append(make((codec, box, offset, (other, *others) if others else other)))
    return tiles


def _bare(image: Image.Image) -> Image.Image:
    """Without transparency, palette and single bits: RGB, L or what it was."""
    kind = _WITHOUT_ALPHA.get(image.mode, image.mode)
    return image if kind == image.mode else image.convert(kind)


def _unit(levels: np.ndarray, most: int) -> np.ndarray:
    """`levels` as a share of `most`, float32."""
    values = levels.astype(np.float32)
    values /= most
    return values


@lru_cache(64)
def _is_srgb(icc: bytes) -> bool:
    """Whether a profile leaves greys and primaries as they are, or cannot be read.

    Names do not tell: "sRGB-elle-V2-g10" is linear.
    """
    ramp = np.arange(256, dtype=np.uint8)[:, None]
    levels = np.stack(
        [ramp * np.array(share, np.uint8) for share in ((1, 1, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1))]
    )
    try:
        if _space(_profile(icc)) != "RGB":
            return False
        found = _to_srgb(Image.fromarray(levels), _profile(icc))
    except (OSError, ImageCms.PyCMSError):
        return True
    return bool(np.abs(np.asarray(found) - levels.astype(float)).max() <= _SAME_LEVELS)


def _converted(image: Image.Image, icc: bytes) -> Image.Image:
    """RGB, from the colour space of an ICC profile to sRGB; as it is where the profile does not fit."""
    bare = _bare(image)
    try:
        profile = _profile(icc)
        if bare.mode == "L" and _space(profile) == "RGB":
            bare = bare.convert("RGB")
        return _to_srgb(bare, profile)
    except (OSError, ImageCms.PyCMSError):
        return bare.convert("RGB")


def _profile(icc: bytes) -> ImageCms.ImageCmsProfile:
    return ImageCms.ImageCmsProfile(io.BytesIO(icc))


def _space(profile: ImageCms.ImageCmsProfile) -> str:
    return profile.profile.xcolor_space.strip()


def _to_srgb(image: Image.Image, profile: ImageCms.ImageCmsProfile) -> Image.Image:
    found = ImageCms.profileToProfile(image, profile, ImageCms.createProfile("sRGB"), outputMode="RGB")
    assert found is not None  # where not inPlace
    return found


def _in_stated_space(image: Image.Image, values: np.ndarray) -> np.ndarray:
    """`values` of a picture without a profile, from the gamma of a PNG or the Adobe RGB that EXIF states."""
    gamma = image.info.get("gamma", _USUAL_GAMMA) if image.format == "PNG" else _USUAL_GAMMA
    is_other = abs(gamma - _USUAL_GAMMA) > 0.01 and _GAMMAS[0] <= gamma <= _GAMMAS[1]
    if is_other and "srgb" not in image.info:
        return np.asarray(srgb_encode(values ** np.float32(1 / gamma)))
    if _is_adobe_rgb(image):
        return np.asarray(srgb_encode(apply_matrix(_ADOBE_TO_SRGB, values ** np.float32(_ADOBE_GAMMA))))
    return values


def _is_adobe_rgb(image: Image.Image) -> bool:
    """Whether EXIF says so, as of cameras that embed no profile (DCF 2.0: interoperability "R03")."""
    try:
        return image.getexif().get_ifd(ExifTags.IFD.Interop).get(ExifTags.Interop.InteropIndex) == "R03"
    except Exception:  # of any kind: whoever wrote the file may have written anything
        return False
