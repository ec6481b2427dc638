"""One self-contained HTML file: sections of text, tables and pictures, nothing loaded from elsewhere."""

from __future__ import annotations

import base64
import io
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
from fsid.dataset.inspect_plot import as_label
from fsid.evaluate.classical import bm3d_installed
from fsid.evaluate.compare import Comparison, Crops, Row, confidence
from fsid.evaluate.testset import ALL_SETS
from fsid.files import write_atomically

ERROR_GAIN = 8.0
"""Error maps show |output - truth| of the developed pictures this many times."""


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
    """Text cells; `best` marks the cells (row, column) to print bold."""

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
    write_atomically(file, page.encode())


def picture(srgb: np.ndarray, caption: str = "", *, pixelated: bool = False) -> Picture:
    """A (H, W, 3) sRGB 0..1 array (or uint8) as a picture."""
    data = io.BytesIO()
    pixels = srgb if srgb.dtype == np.uint8 else to_uint8(srgb)
    Image.fromarray(pixels).save(data, format="PNG", optimize=True)
    return Picture(_uri(data.getvalue()), caption, pixelated)


def plot(figure: Figure, caption: str = "") -> Picture:
    """A matplotlib figure as a picture."""
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=110, bbox_inches="tight")
    return Picture(_uri(data.getvalue()), caption)


def comparison_sections(comparison: Comparison) -> list[Section]:
    """The tables per set, the plot over levels, and the crops side by side."""
    rows = comparison.rows
    sets = list(dict.fromkeys(row.set for row in rows))
    tables = tuple(_table(comparison, name) for name in sets)
    n = {row.set: row.n for row in rows}
    text = (
        "PSNR in dB in RAW, then PSNR and SSIM after develop; means over images, with the half width of the "
        "95 % confidence interval of the RAW PSNR. "
    ) + " ".join(f"Table {i}: {name}, {n[name]} images." for i, name in enumerate(sets, 1))
    figures = Section(
        f"Figures on {comparison.testset.camera}", text, tables, ((_level_plot(comparison, sets[-1]),),)
    )
    if not comparison.crops:
        return [figures]
    before_after = Section(
        "Before and after",
        "Drag the border. Left of it the noisy input, right of it the last method of the tables.",
        sliders=tuple(_chunks([_slider(crops) for crops in comparison.crops], 3)),
    )
    side_by_side = Section(
        "Side by side",
        "The window of each image with the most detail, developed. Figures: RAW PSNR of the whole image. "
        f"Below each: its error against the truth, {ERROR_GAIN:g} times.",
        pictures=tuple(row for crops in comparison.crops for row in (_crop_row(crops), _error_row(crops))),
    )
    return [figures, before_after, side_by_side]


def method_label(name: str) -> str:
    """How a method is called in tables and captions."""
    smoother = "BM3D" if bm3d_installed() else "non-local means"
    return {"noisy": "noisy input", "classical": f"classical (VST + {smoother})"}.get(name, name)


def _table(comparison: Comparison, set_name: str) -> Table:
    levels = comparison.testset.levels
    rows = {(row.model, row.level): row for row in comparison.rows if row.set == set_name}
    methods = list(dict.fromkeys(row.model for row in comparison.rows))
    head = ("", *levels)
    body, best = [], set()
    for i, method in enumerate(methods):
        cells = [rows[method, level] for level in levels]
        body.append((method_label(method), *(_cell(comparison, cell) for cell in cells)))
        best |= {
            (i, j)
            for j, cell in enumerate(cells, 1)
            if cell.psnr_raw == max(rows[other, cell.level].psnr_raw for other in methods)
        }
    return Table(head, tuple(body), frozenset(best))


def _cell(comparison: Comparison, row: Row) -> str:
    values = [
        image.psnr_raw
        for image in comparison.images
        if (image.model, image.level) == (row.model, row.level) and row.set in (image.set, ALL_SETS)
    ]
    half = confidence(values)
    interval = f" ± {half:.2f}" if np.isfinite(half) else ""
    return f"{row.psnr_raw:.2f}{interval} / {row.psnr:.2f} / {row.ssim:.3f}"


def _level_plot(comparison: Comparison, set_name: str) -> Picture:
    figure = Figure(figsize=(7, 3.2))
    axes = figure.subplots(1, 2)
    levels = [as_label(level) for level in comparison.testset.levels]
    for method in dict.fromkeys(row.model for row in comparison.rows):
        cells = [row for row in comparison.rows if (row.model, row.set) == (method, set_name)]
        axes[0].plot(levels, [row.psnr_raw for row in cells], "o-", label=as_label(method_label(method)))
        axes[1].plot(levels, [row.ssim for row in cells], "o-")
    axes[0].set_ylabel("PSNR in RAW (dB)")
    axes[1].set_ylabel("SSIM after develop")
    for axis in axes:
        axis.grid(alpha=0.3)
        axis.tick_params(labelsize=8)
    axes[0].legend(fontsize=7)
    figure.tight_layout()
    return plot(figure, f"{set_name}: quality against the light level")


def _crop_row(crops: Crops) -> tuple[Picture, ...]:
    outputs = [
        picture(pixels, f"{method_label(name)} {crops.psnr_raw[name]:.2f} dB", pixelated=True)
        for name, pixels in crops.by_method.items()
    ]
    return (*outputs, picture(crops.truth, f"truth: {crops.title}", pixelated=True))


def _error_row(crops: Crops) -> tuple[Picture, ...]:
    maps = [
        picture(ERROR_GAIN * np.abs(pixels - crops.truth), f"error of {method_label(name)}", pixelated=True)
        for name, pixels in crops.by_method.items()
    ]
    return (*maps, picture(np.zeros_like(crops.truth), "no error", pixelated=True))


def _slider(crops: Crops) -> Slider:
    names = list(crops.by_method)
    before, after = (
        picture(crops.by_method[name], f"{crops.title}: {method_label(name)}", pixelated=True)
        for name in (names[0], names[-1])
    )
    return Slider(before, after)


def _chunks(items: Sequence[Slider], size: int) -> list[tuple[Slider, ...]]:
    return [tuple(items[i : i + size]) for i in range(0, len(items), size)]


def _uri(png: bytes) -> str:
    return "data:image/png;base64," + base64.b64encode(png).decode()
