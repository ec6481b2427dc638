"""Text and simple figures for printed surfaces: fonts of matplotlib, words of random letters in many scripts.

Nothing is written that means anything; letter frequencies are roughly those of the languages. The basic
layout engine is asked for, because the other one is not there on every machine and would set other texels.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

_WIDE_FONTS = ("DejaVuSans", "DejaVuSans-Bold", "DejaVuSans-Oblique", "DejaVuSansMono")
_EUROPEAN_FONTS = (*_WIDE_FONTS, "DejaVuSerif", "DejaVuSerif-Italic", "DejaVuSerif-Bold", "STIXGeneral")
_LATIN_FONTS = (*_EUROPEAN_FONTS, "STIXGeneralItalic", "STIXGeneralBol", "cmr10", "cmss10", "cmtt10", "cmb10")
SCRIPTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "latin": ("eeeeettttaaaooiinnssrrhhlldcumfpgwybvkxjqz", _LATIN_FONTS),
    "accented": ("eéèaàâioôuùüçñßøåäöčšžłęąnrstldm", _EUROPEAN_FONTS),
    "greek": ("οοαααιιεεττσσννηηυρπκμλωδγχθφβξζψ", _EUROPEAN_FONTS),
    "cyrillic": ("ооеаааииинтттссрвллкммддпуяыьгзбчйхжшюцщэф", _EUROPEAN_FONTS),
    "armenian": ("աաեինրտկսմլդուհգոյբպվզքշցփթխծձղճ", ("DejaVuSans", "DejaVuSans-Bold", "DejaVuSerif")),
    "georgian": ("აააიიეესრნმდლბვთოგუქკშხცჩზტწჯყფღპჟძ", ("DejaVuSans", "DejaVuSans-Bold", "DejaVuSerif")),
    "arabic": ("اااللينمترهوبكعدسفقحجشصخطضثزذظغ", ("DejaVuSans", "DejaVuSans-Bold")),
    "hebrew": ("ייוהלאתרבמשנחדקעפטזגכסצ", ("DejaVuSans", "DejaVuSans-Bold")),
    "tifinagh": ("ⴰⵏⵉⵜⵙⵔⵎⴷⵓⵖⴳⵍⵡⵢⴽⵣⵟⴼⵃⵛⴱ", ("DejaVuSans",)),
    "digits": ("00112345678999", _LATIN_FONTS),
    "mathematics": ("∑∫∂√∞≤≥≠≈∈∀∃αβγδλμπσφω→⇒±×+=−(){}xyzn", ("DejaVuSans", "DejaVuSerif", "STIXGeneral")),
}
"""Name -> (letters, as often as they come; fonts that have them)."""

_SHARES = (0.42, 0.09, 0.08, 0.13, 0.05, 0.05, 0.06, 0.04, 0.02, 0.04, 0.02)


@lru_cache(maxsize=512)
def font(name: str, points: int) -> ImageFont.FreeTypeFont:
    """A font of matplotlib by its file's name; points: its size in pixels."""
    path = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / f"{name}.ttf"
    return ImageFont.truetype(str(path), max(points, 6), layout_engine=ImageFont.Layout.BASIC)


def font_rand(rng: np.random.Generator, script: str, points: int) -> ImageFont.FreeTypeFont:
    """A font that has the letters of `script`."""
    return font(str(rng.choice(SCRIPTS[script][1])), points)


def script_rand(rng: np.random.Generator) -> str:
    """A script, Latin most often."""
    return str(rng.choice(list(SCRIPTS), p=_SHARES))


def words_rand(rng: np.random.Generator, script: str, count: int) -> str:
    """`count` words of random letters, some with capitals and punctuation."""
    letters = list(SCRIPTS[script][0])
    words = ["".join(rng.choice(letters, rng.integers(1, 11))) for _ in range(count)]
    ends = rng.choice(["", "", "", "", "", "", ",", ".", ";", ":"], count)
    shown = [w.capitalize() if rng.random() < 0.15 else w for w in words]
    return " ".join(word + end for word, end in zip(shown, ends, strict=True))


def fitted(text: str, face: ImageFont.FreeTypeFont, width: float) -> str:
    """As much of the beginning of `text` as is `width` pixels wide."""
    if width <= 0:
        return ""
    while face.getlength(text) > width:
        text = text[: min(len(text) - 1, int(len(text) * width / face.getlength(text)))]
    return text


def paragraph(
    rng: np.random.Generator,
    draw: ImageDraw.ImageDraw,
    box: tuple[float, float, float, float],
    points: int,
    fill: int | tuple[int, int, int],
    script: str,
) -> float:
    """Fill a box (left, top, right, bottom) with lines of one font, ragged right; returns the end's y.

    points: size of the font in pixels, at least 6.
    """
    left, y, right, bottom = box
    points = max(points, 6)
    face = font_rand(rng, script, points)
    while y + points * 1.3 <= bottom:
        text = words_rand(rng, script, int((right - left) / points / 2.4) + 2)
        last = rng.random() < 0.12
        draw.text((left, y), fitted(text, face, (right - left) * (0.5 if last else 1)), font=face, fill=fill)
        y += points * (1.9 if last else 1.3)
    return y


def canvas(size: int, colour: int | tuple[int, int, int] = 0) -> tuple[Image.Image, ImageDraw.ImageDraw]:
    """An image twice as fine as the tile, grey or RGB by its colour, and what draws on it; `averaged` brings
    it back."""
    image = Image.new("L" if isinstance(colour, int) else "RGB", (2 * size, 2 * size), colour)
    return image, ImageDraw.Draw(image)


def averaged(image: Image.Image) -> np.ndarray:
    """(S, S) or (S, S, 3) float32 in 0..1: 2 x 2 averages of a canvas."""
    return np.asarray(image.reduce(2), dtype=np.float32) / np.float32(255)
