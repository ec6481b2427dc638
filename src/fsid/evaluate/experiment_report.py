"""The report of an experiment: a table per test set, and the gaps that the experiment is about.

    gap(source, rival) = median over images of PSNR(source) - PSNR(rival),   per level and seed

Paired medians and not differences of means, because a few bright images lift a mean. Below 0.05 dB a gap is
nothing; 0.10 dB with the same sign in two seeds is real.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from fsid.evaluate.compare import ImageRow, Row
from fsid.evaluate.report import Section, Table, method_label, plot, write_report
from fsid.evaluate.testset import ALL_SETS

if TYPE_CHECKING:
    from fsid.evaluate.experiments import ExperimentConfig

FIGURES = (("psnr_raw", "PSNR in RAW"), ("psnr", "PSNR after develop"))


def write_experiment_report(
    file: Path,
    config: ExperimentConfig,
    sources: Sequence[str],
    rows: Sequence[Row],
    images: Sequence[ImageRow],
) -> Path:
    """Tables of means over seeds with their spread, gaps of "full" to its rivals, and plots; one file."""
    sections = []
    for levels, name in _groups(rows):
        tables = [_mean_table(rows, config, sources, levels, name)]
        gaps = [_gap_table(images, config, sources, levels, name, *figure) for figure in FIGURES]
        text = (
            "First PSNR in RAW / PSNR after develop in dB / SSIM, mean over images and seeds, ± half the "
            "spread of RAW PSNR between seeds. Then the gap of full to each rival in dB: paired median over "
            "images, one figure per seed, in RAW and after develop."
        )
        figure = _gap_plot(images, config, sources, levels, name)
        sections.append(Section(name, text, (*tables, *gaps), ((plot(figure, "gap over light level"),),)))
    title = "FSID: ablation" if config.kind == "ablation" else "FSID: synthetic against real"
    seeds = ", ".join(map(str, config.seeds))
    lead = (
        f"{config.count} pairs of {config.width}x{config.height} pixels per source, "
        f"network {config.network}, {config.steps or 'its own number of'} steps, seeds {seeds}, "
        f"camera {config.camera}."
    )
    write_report(file, title, lead, sections)
    return file


def gaps(
    images: Sequence[ImageRow], source: str, rival: str, level: str, name: str, figure: str
) -> np.ndarray:
    """Differences source - rival of one figure over the images of a set at a level; dB (0..1 for ssim)."""

    def of(model: str) -> dict[tuple[str, str], float]:
        return {
            (row.set, row.image): getattr(row, figure)
            for row in images
            if (row.model, row.level) == (model, level) and name in (row.set, ALL_SETS)
        }

    ours, theirs = of(source), of(rival)
    return np.array([ours[key] - theirs[key] for key in ours if key in theirs])


def _groups(rows: Sequence[Row]) -> list[tuple[tuple[str, ...], str]]:
    """(levels, set) of every table: photographs per set, the materials together and one by one."""
    found: dict[str, dict[str, None]] = {}
    for row in rows:
        found.setdefault(row.set, {})[row.level] = None
    order = sorted(found, key=lambda name: name != ALL_SETS)
    return [(tuple(found[name]), name) for name in order]


def _models(source: str, config: ExperimentConfig) -> list[str]:
    return [f"{source}-seed{seed}" for seed in config.seeds]


def _mean_table(
    rows: Sequence[Row], config: ExperimentConfig, sources: Sequence[str], levels: Sequence[str], name: str
) -> Table:
    by = {(row.model, row.level): row for row in rows if row.set == name}
    body = []
    for source in ("noisy", "classical", *sources):
        models = [source] if (source, levels[0]) in by else _models(source, config)
        cells = []
        for level in levels:
            found = [by[model, level] for model in models]
            raw, developed, ssim = (
                [getattr(row, key) for row in found] for key in ("psnr_raw", "psnr", "ssim")
            )
            spread = f" ± {np.ptp(raw) / 2:.2f}" if len(found) > 1 else ""
            cells.append(f"{np.mean(raw):.2f}{spread} / {np.mean(developed):.2f} / {np.mean(ssim):.3f}")
        body.append((method_label(source), *cells))
    return Table(("", *levels), tuple(body))


def _gap_table(
    images: Sequence[ImageRow],
    config: ExperimentConfig,
    sources: Sequence[str],
    levels: Sequence[str],
    name: str,
    figure: str,
    title: str,
) -> Table:
    body = []
    for rival in sources:
        if rival == "full":
            continue
        cells = [
            " ".join(f"{m:+.2f}" for m in _medians(images, config, rival, level, name, figure))
            for level in levels
        ]
        body.append((f"full - {rival}", *cells))
    return Table((title, *levels), tuple(body))


def _medians(
    images: Sequence[ImageRow], config: ExperimentConfig, rival: str, level: str, name: str, figure: str
) -> list[float]:
    return [
        float(np.median(gaps(images, f"full-seed{seed}", f"{rival}-seed{seed}", level, name, figure)))
        for seed in config.seeds
    ]


def _gap_plot(
    images: Sequence[ImageRow],
    config: ExperimentConfig,
    sources: Sequence[str],
    levels: Sequence[str],
    name: str,
) -> Figure:
    figure = Figure(figsize=(8, 3), layout="constrained")
    for axes, (key, title) in zip(figure.subplots(1, 2), FIGURES, strict=True):
        for rival in (source for source in sources if source != "full"):
            medians = np.array([_medians(images, config, rival, level, name, key) for level in levels])
            axes.plot(levels, medians.mean(axis=1), "o-", label=f"full - {rival}")
            axes.fill_between(levels, medians.min(axis=1), medians.max(axis=1), alpha=0.2)
        axes.axhline(0, color="grey", linewidth=0.8)
        axes.set_title(title, fontsize=9)
        axes.set_ylabel("gap (dB)")
        axes.grid(alpha=0.3)
    axes.legend(fontsize=7)
    return figure
