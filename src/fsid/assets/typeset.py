"""Text and simple figures for printed surfaces: fonts of matplotlib, words of random letters in many scripts.

Lines break where the outlines of their letters end, not the pixels, and every line has random numbers of its
own: a sheet says the same at every size.

Nothing is written that means anything; letter frequencies are roughly those of the languages. The basic
layout engine is asked for, because the other one is not there on every machine and would set other texels.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from fsid.assets.streams import branch

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

_ENDS = ("", "", "", "", "", "", ",", ".", ";", ":")
_SHARES = (0.42, 0.09, 0.08, 0.13, 0.05, 0.05, 0.06, 0.04, 0.02, 0.04, 0.02)


@dataclass(frozen=True)
class Face:
    """A font of matplotlib by its file's name; points: its size in pixels."""

    name: str
    points: float

    def length(self, text: str) -> float:
        """Of a line, in pixels."""
        return self.points * sum(_advance(self.name, letter) for letter in text)

    def write(
        self,
        draw: ImageDraw.ImageDraw,
        at: tuple[float, float],
        text: str,
        fill: int | tuple[int, int, int],
    ) -> None:
        """Word by word: letters of small fonts are whole pixels wide, and a line of them would run away."""
        face = _font(self.name, max(round(4 * self.points) / 4, 2.0))
        x, y = at
        for word in text.split(" "):
            draw.text((x, y), word, font=face, fill=fill)
            x += self.length(word + " ")


@lru_cache(maxsize=512)
def _font(name: str, points: float) -> ImageFont.FreeTypeFont:
    path = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / f"{name}.ttf"
    return ImageFont.truetype(str(path), points, layout_engine=ImageFont.Layout.BASIC)


@cache
def _advance(name: str, letter: str) -> float:
    """Of a letter in a font of one pixel."""
    return _font(name, 256.0).getlength(letter) / 256


def font_rand(rng: np.random.Generator, script: str, points: float) -> Face:
    """A font that has the letters of `script`."""
    return Face(str(rng.choice(SCRIPTS[script][1])), points)


def script_rand(rng: np.random.Generator) -> str:
    """A script, Latin most often."""
    return str(rng.choice(list(SCRIPTS), p=_SHARES))


def words_rand(rng: np.random.Generator, script: str, count: int) -> str:
    """`count` words of random letters, some with capitals and punctuation."""
    return " ".join(_word_rand(rng, SCRIPTS[script][0]) for _ in range(count))


def _word_rand(rng: np.random.Generator, letters: str) -> str:
    word = "".join(letters[k] for k in rng.integers(0, len(letters), rng.integers(1, 11)))
    return (word.capitalize() if rng.random() < 0.15 else word) + _ENDS[int(rng.integers(len(_ENDS)))]


def fitted(text: str, face: Face, width: float) -> str:
    """As much of the beginning of `text` as is `width` pixels wide."""
    if width <= 0:
        return ""
    while (length := face.length(text)) > width:
        text = text[: min(len(text) - 1, int(len(text) * width / length))]
    return text


def paragraph(
    rng: np.random.Generator,
    draw: ImageDraw.ImageDraw,
    box: tuple[float, float, float, float],
    points: float,
    fill: int | tuple[int, int, int],
    script: str,
) -> float:
    """Fill a box (left, top, right, bottom) with lines of one font, ragged right; returns the end's y.

    points: size of the font in pixels.
    """
    left, y, right, bottom = box
    lines = branch(rng)
    face = font_rand(lines, script, points)
    while y + points * 1.3 <= bottom:
        own = branch(lines)
        last = own.random() < 0.12
        text = words_rand(own, script, int((right - left) / points / 2.4) + 2)
        face.write(draw, (left, y), fitted(text, face, (right - left) * (0.5 if last else 1)), fill)
        y += points * (1.9 if last else 1.3)
    return y


def pen(size: int, pixels: float) -> int:
    """Width of a line on a `canvas`, at least a pixel; pixels: on that of 512 texels."""
    return max(1, round(pixels * size / 512))


def canvas(size: int, colour: int | tuple[int, int, int] = 0) -> tuple[Image.Image, ImageDraw.ImageDraw]:
    """An image twice as fine as the tile, grey or RGB by its colour, and what draws on it; `averaged` brings
    it back."""
    image = Image.new("L" if isinstance(colour, int) else "RGB", (2 * size, 2 * size), colour)
    return image, ImageDraw.Draw(image)


def averaged(image: Image.Image) -> np.ndarray:
    """(S, S) or (S, S, 3) float32 in 0..1: 2 x 2 averages of a canvas."""
    return np.asarray(image.reduce(2), dtype=np.float32) / np.float32(255)
