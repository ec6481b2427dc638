"""What the report of a comparison shows: tables per metric and per set, plots over levels, crops."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from fsid.dataset.inspect_plot import as_label
from fsid.evaluate.compare import Comparison, Crops
from fsid.evaluate.report import (
    METRICS,
    Picture,
    Section,
    Slider,
    Table,
    level_label,
    method_label,
    picture,
    plot,
)
from fsid.evaluate.results import Row, confidence, perfect_note
from fsid.evaluate.testset import ALL_SETS
from fsid.plurals import counted

ERROR_GAIN = 8.0
"""Error maps show |output - truth| of the developed pictures this many times."""


def comparison_sections(comparison: Comparison) -> list[Section]:
    """The tables, the plots over levels, and the crops side by side."""
    *single, whole = dict.fromkeys(row.set for row in comparison.rows)
    images = next(row.n for row in comparison.rows if row.set == whole)
    over_sets = f" over the {len(single)} sets, since images of a set are alike" if single else ""
    interval = f", ± half the width of the 95 % confidence interval{over_sets}" if images > 1 else ""
    perfect = perfect_note(comparison.images)
    text = (
        f"{'All sets together' if single else whole}: means over {counted(images, 'image')}{interval}; "
        f"bold is best.{f' {perfect}.' if perfect else ''}"
    )
    tables = tuple(_metric_table(comparison, whole, *metric) for metric in METRICS)
    sections = [
        Section(f"Figures on {comparison.testset.camera}", text, tables, ((_level_plot(comparison, whole),),))
    ]
    if single:
        text = "PSNR in RAW in dB / PSNR after develop in dB / SSIM after develop; bold is best in RAW."
        sections.append(Section("Set by set", text, tuple(_set_table(comparison.rows, s) for s in single)))
    if not comparison.crops:
        return sections
    shown, count = len({crops.image for crops in comparison.crops}), len(comparison.testset.images)
    some = f"Of {shown} of the {count} images. " if shown < count else ""
    before_after = Section(
        "Before and after",
        f"{some}Drag the border. Left of it the first method of the tables, right of it the last.",
        sliders=tuple(_chunks([_slider(crops) for crops in comparison.crops], 3)),
    )
    side_by_side = Section(
        "Side by side",
        "The window of each image with the most detail, developed. Figures: RAW PSNR of the whole image. "
        f"Below each: its error against the truth, {ERROR_GAIN:g} times.",
        pictures=tuple(row for crops in comparison.crops for row in (_crop_row(crops), _error_row(crops))),
    )
    return [*sections, before_after, side_by_side]


def _metric_table(comparison: Comparison, set_name: str, key: str, title: str, form: str) -> Table:
    """A metric of every method at every level, and the mean of levels."""
    levels = comparison.testset.levels
    rows = {(row.model, row.level): row for row in comparison.rows if row.set == set_name}
    methods = list(dict.fromkeys(row.model for row in comparison.rows))
    means = np.array([[getattr(rows[method, level], key) for level in levels] for method in methods])
    means = np.hstack([means, means.mean(1, keepdims=True)])
    body = []
    for method, values in zip(methods, means, strict=True):
        halves = [_half_width(comparison, rows[method, level], key) for level in levels]
        cells = [_with_interval(f"{v:{form}}", h, form) for v, h in zip(values[:-1], halves, strict=True)]
        body.append((method_label(method), *cells, f"{values[-1]:{form}}"))
    best = {(int(i), int(j) + 1) for i, j in zip(*np.nonzero(means == means.max(0)), strict=True)}
    return Table(title, ("", *map(level_label, levels), "mean"), tuple(body), frozenset(best))


def _half_width(comparison: Comparison, row: Row, key: str) -> float:
    images = [
        image
        for image in comparison.images
        if (image.model, image.level) == (row.model, row.level) and row.set in (image.set, ALL_SETS)
    ]
    return confidence([getattr(image, key) for image in images], [image.set for image in images])


def _with_interval(value: str, half: float, form: str) -> str:
    return f"{value} ± {half:{form}}" if np.isfinite(half) else value


def _set_table(rows: Sequence[Row], set_name: str) -> Table:
    """All metrics of every method at every level, in a single set."""
    found = {(row.model, row.level): row for row in rows if row.set == set_name}
    methods, levels = (list(dict.fromkeys(key[i] for key in found)) for i in (0, 1))
    body = tuple(
        (method_label(method), *(_figures(found[method, level]) for level in levels)) for method in methods
    )
    best = {
        (i, j)
        for j, level in enumerate(levels, 1)
        for i, method in enumerate(methods)
        if found[method, level].psnr_raw == max(found[m, level].psnr_raw for m in methods)
    }
    count = next(row.n for row in found.values())
    title = f"{set_name}, {counted(count, 'image')}"
    return Table(title, ("", *map(level_label, levels)), body, frozenset(best))


def _figures(row: Row) -> str:
    """RAW PSNR / PSNR / SSIM of a row."""
    return " / ".join(f"{getattr(row, key):{form}}" for key, _, form in METRICS)


def _level_plot(comparison: Comparison, set_name: str) -> Picture:
    figure = Figure(figsize=(10, 3.2))
    levels = [as_label(level_label(level)) for level in comparison.testset.levels]
    for axis, (key, title, _) in zip(figure.subplots(1, 3), METRICS, strict=True):
        for method in dict.fromkeys(row.model for row in comparison.rows):
            cells = [row for row in comparison.rows if (row.model, row.set) == (method, set_name)]
            values = [getattr(row, key) for row in cells]
            axis.plot(levels, values, "o-", label=as_label(method_label(method)))
        axis.set_title(title, fontsize=9)
        axis.grid(alpha=0.3)
        axis.tick_params(labelsize=8)
    figure.axes[0].legend(fontsize=7)
    figure.tight_layout()
    return plot(figure, "quality against the light level")


def _crop_row(crops: Crops) -> tuple[Picture, ...]:
    outputs = [
        picture(pixels, f"{method_label(name)} {crops.psnr_raw[name]:.2f} dB", pixelated=True)
        for name, pixels in crops.by_method.items()
    ]
    return (*outputs, picture(crops.truth, f"truth: {_title(crops)}", pixelated=True))


def _error_row(crops: Crops) -> tuple[Picture, ...]:
    maps = [
        picture(ERROR_GAIN * np.abs(pixels - crops.truth), f"error of {method_label(name)}", pixelated=True)
        for name, pixels in crops.by_method.items()
    ]
    return (*maps, picture(np.zeros_like(crops.truth), "no error", pixelated=True))


def _title(crops: Crops) -> str:
    return f"{crops.image}, {level_label(crops.level)}"


def _slider(crops: Crops) -> Slider:
    names = list(crops.by_method)
    before, after = (
        picture(crops.by_method[name], f"{_title(crops)}: {method_label(name)}", pixelated=True)
        for name in (names[0], names[-1])
    )
    return Slider(before, after)


def _chunks(items: Sequence[Slider], size: int) -> list[tuple[Slider, ...]]:
    return [tuple(items[i : i + size]) for i in range(0, len(items), size)]
