"""One self-contained HTML file: sections of text, tables and pictures, nothing loaded from elsewhere."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
from jinja2 import Environment, StrictUndefined
from matplotlib.figure import Figure
from PIL import Image

from fsid import __version__
from fsid.dataset import to_uint8
from fsid.evaluate.classical import bm3d_installed
from fsid.files import write_atomically

METRICS = (
    ("psnr_raw", "PSNR in RAW, dB", ".2f"),
    ("psnr", "PSNR after develop, dB", ".2f"),
    ("ssim", "SSIM after develop", ".3f"),
)
"""What is measured: its name in rows, how it is called, how it is printed."""


@dataclass(frozen=True)
class Picture:
    """An image as a data URI. pixelated: enlarge without smoothing, to judge single pixels."""

    uri: str
    caption: str = ""
    pixelated: bool = False


@dataclass(frozen=True)
class Slider:
    """Two pictures of equal size, one above the other, with a draggable border between them."""

    before: Picture
    after: Picture


@dataclass(frozen=True)
class Table:
    """Text cells under a title; `best` marks the cells (row, column) to print bold."""

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    best: frozenset[tuple[int, int]] = frozenset()


@dataclass(frozen=True)
class Section:
    """A heading with, in this order, text, tables, rows of pictures and rows of sliders."""

    title: str
    text: str = ""
    tables: tuple[Table, ...] = ()
    pictures: tuple[tuple[Picture, ...], ...] = ()
    sliders: tuple[tuple[Slider, ...], ...] = ()


def write_report(file: Path, title: str, lead: str, sections: Sequence[Section]) -> None:
    """Render the report; `lead` is the sentence under the title."""
    template = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    source = files("fsid.evaluate").joinpath("report.html.j2").read_text(encoding="utf-8")
    page = template.from_string(source).render(title=title, lead=lead, sections=sections, version=__version__)
    write_atomically(file, page.encode(errors="backslashreplace"))


def picture(srgb: np.ndarray, caption: str = "", *, pixelated: bool = False) -> Picture:
    """A (H, W, 3) sRGB 0..1 array (or uint8) as a picture."""
    data = io.BytesIO()
    Image.fromarray(to_uint8(srgb)).save(data, format="PNG", optimize=True)
    return Picture(_uri(data.getvalue()), caption, pixelated)


def plot(figure: Figure, caption: str = "") -> Picture:
    """A matplotlib figure as a picture."""
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=110, bbox_inches="tight")
    return Picture(_uri(data.getvalue()), caption)


def method_label(name: str) -> str:
    """How a method is called in tables and captions."""
    smoother = "BM3D" if bm3d_installed() else "non-local means"
    return {"noisy": "noisy input", "classical": f"classical (VST + {smoother})"}.get(name, name)


def level_label(level: str) -> str:
    """How a level is called in tables and plots: "iso800" is ISO 800, "0.5lux" is 0.5 lux."""
    if found := re.fullmatch(r"iso(\d+)|([\d.]+)lux", level):
        return f"ISO {found[1]}" if found[1] else f"{found[2]} lux"
    return level


def _uri(png: bytes) -> str:
    return "data:image/png;base64," + base64.b64encode(png).decode()
