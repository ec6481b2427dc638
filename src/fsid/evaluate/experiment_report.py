"""The report of an experiment: where "full" stands beside its rivals, then a section per test set.

    gap(rival) = mean over images and seeds of the metric of "full" - that of the rival
    paired     = median over images of their differences, per seed

A few bright images lift a mean, so both are there. Below 0.05 dB a gap is nothing; 0.10 dB with the same
sign in two seeds is real.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from fsid.dataset.inspect_plot import as_label
from fsid.evaluate.experiment_config import ExperimentConfig
from fsid.evaluate.report import METRICS, Section, Table, level_label, method_label, plot, write_report
from fsid.evaluate.results import ImageRow, Row, perfect_note
from fsid.evaluate.testset import ALL_SETS

DECIBELS = METRICS[:2]
PAPER_GAP = {"0.5lux": -0.40, "1lux": -0.74, "2lux": 0.01, "5lux": -0.14}
"""Synthetic minus real, PSNR in dB, the paper's Table 2."""


def write_experiment_report(
    file: Path,
    config: ExperimentConfig,
    pairs: Mapping[str, int],
    rows: Sequence[Row],
    images: Sequence[ImageRow],
    overlap: str = "",
) -> Path:
    """Gaps of "full" to its rivals, the means over seeds with their spread, and plots; one file.

    pairs: how many every source has, in the order of the tables. overlap: what is said of test photographs
    that a rival has seen.
    """
    results = _Results(config.seeds, tuple(pairs), tuple(rows), tuple(images))
    materials = results.levels[ALL_SETS]
    common = [name for name in results.levels if name == ALL_SETS or results.levels[name] != materials]
    single = [name for name in results.levels if name not in common]
    sections = [_standing(results, common), *(_of_set(results, name, config.kind) for name in common)]
    if single:
        sections.append(_by_material(results, single))
    title = "FSID: ablation" if config.kind == "ablation" else "FSID: synthetic against real"
    said = [f"{line}." for line in (overlap, perfect_note(images)) if line]
    write_report(file, title, " ".join([_lead(config, pairs), *said]), sections)
    return file


def _lead(config: ExperimentConfig, pairs: Mapping[str, int]) -> str:
    """What was compared; sources whose data differ are named."""
    data = {source: (count, *config.frame_px(source)) for source, count in pairs.items()}
    count, width, height = data["full"]
    others = "".join(
        f" (from {source} {n} of up to {w}x{h})"
        for source, (n, w, h) in data.items()
        if (n, w, h) != data["full"]
    )
    settings = "".join(f", {setting}" for setting in (*config.settings, *config.train_settings))
    return (
        f"{count} pairs of {width}x{height} pixels per source{others}, network {config.network}, "
        f"{config.steps or 'its own number of'} steps, seeds {', '.join(map(str, config.seeds))}, "
        f"camera {config.camera}{settings}."
    )


def gaps(
    images: Sequence[ImageRow], source: str, rival: str, level: str, name: str, metric: str
) -> np.ndarray:
    """Differences source - rival of one metric over the images of a set at a level; dB (0..1 for ssim)."""

    def of(model: str) -> dict[tuple[str, str], float]:
        return {
            (row.set, row.image): getattr(row, metric)
            for row in images
            if (row.model, row.level) == (model, level) and name in (row.set, ALL_SETS)
        }

    ours, theirs = of(source), of(rival)
    return np.array([ours[key] - theirs[key] for key in ours if key in theirs])


@dataclass(frozen=True)
class _Results:
    """What was measured; models are called SOURCE-seedN, the baselines by their names."""

    seeds: tuple[int, ...]
    sources: tuple[str, ...]
    rows: tuple[Row, ...]
    images: tuple[ImageRow, ...]

    @property
    def rivals(self) -> list[str]:
        return [source for source in self.sources if source != "full"]

    @property
    def levels(self) -> dict[str, tuple[str, ...]]:
        """The levels of every set, all materials together first."""
        found: dict[str, dict[str, None]] = {}
        for row in self.rows:
            found.setdefault(row.set, {})[row.level] = None
        return {name: tuple(found[name]) for name in sorted(found, key=lambda name: name != ALL_SETS)}

    def by_seed(self, source: str, name: str, metric: str) -> np.ndarray:
        """(levels, seeds) means over the images of a set; of a baseline (levels, 1)."""
        by = {(r.model, r.level): getattr(r, metric) for r in self.rows if r.set == name}
        levels = self.levels[name]
        is_baseline = (source, levels[0]) in by
        models = [source] if is_baseline else [f"{source}-seed{seed}" for seed in self.seeds]
        return np.array([[by[model, level] for model in models] for level in levels])

    def gap(self, rival: str, name: str, metric: str) -> np.ndarray:
        """(levels,) means over images and seeds, "full" minus the rival."""
        ours, theirs = (self.by_seed(source, name, metric).mean(1) for source in ("full", rival))
        return np.asarray(ours - theirs)

    def medians(self, rival: str, name: str, metric: str) -> np.ndarray:
        """(levels, seeds) paired medians, "full" minus the rival."""
        return np.array(
            [
                [
                    np.median(gaps(self.images, f"full-seed{s}", f"{rival}-seed{s}", level, name, metric))
                    for s in self.seeds
                ]
                for level in self.levels[name]
            ]
        )


def _set_label(name: str) -> str:
    return "all materials" if name == ALL_SETS else name


def _standing(results: _Results, names: Sequence[str]) -> Section:
    """The gaps of all sets, a table per rival and metric."""

    def cells(rival: str, name: str, metric: str) -> tuple[str, ...]:
        gap = results.gap(rival, name, metric)
        lowest = int(gap.argmin())
        medians = results.medians(rival, name, metric).mean(0)
        return (
            f"{gap.mean():+.2f}",
            f"{gap[lowest]:+.2f} ({level_label(results.levels[name][lowest])})",
            " ".join(f"{m:+.2f}" for m in medians),
        )

    tables = _gap_tables(results, names, ("mean", "lowest level", "paired medians"), cells)
    text = (
        "What a network gains by training on the full variant of the scenes. Mean: over images, seeds "
        "and levels. Paired medians: of the differences image by image, mean of levels, one figure per seed. "
        "Below 0.05 dB a gap is nothing; 0.10 dB with the same sign in two seeds is real."
    )
    picture = plot(
        _standing_plot(results, names), "means over images and seeds: a bar for each set, dots for its levels"
    )
    return Section("Where the full variant stands", text, tables, ((picture,),))


def _gap_tables(
    results: _Results,
    names: Sequence[str],
    head: Sequence[str],
    cells: Callable[[str, str, str], tuple[str, ...]],
) -> tuple[Table, ...]:
    """A table per rival and metric in dB, a row per set; cells(rival, set, metric) of a row."""
    return tuple(
        Table(
            f"full - {rival}, {title}",
            ("", *head),
            tuple((_set_label(name), *cells(rival, name, metric)) for name in names),
        )
        for rival in results.rivals
        for metric, title, _ in DECIBELS
    )


def _of_set(results: _Results, name: str, kind: str) -> Section:
    """Means of every source, then gaps level by level, in figures and as a plot."""
    levels = results.levels[name]
    head = ("", *map(level_label, levels), "mean")
    tables = []
    for metric, title, form in METRICS:
        body = []
        for source in ("noisy", "classical", *results.sources):
            values = results.by_seed(source, name, metric)
            half = np.ptp(values, axis=1) / 2
            spread = [f" ± {h:{form}}" if values.shape[1] > 1 else "" for h in half]
            cells = [f"{v:{form}}{s}" for v, s in zip(values.mean(1), spread, strict=True)]
            body.append((method_label(source), *cells, f"{values.mean():{form}}"))
        tables.append(Table(title, head, tuple(body)))
    for metric, title, _ in DECIBELS:
        body = []
        for rival in results.rivals:
            gap = results.gap(rival, name, metric)
            body.append((f"full - {rival}", *(f"{g:+.2f}" for g in gap), f"{gap.mean():+.2f}"))
            cells = [" ".join(f"{m:+.2f}" for m in each) for each in results.medians(rival, name, metric)]
            body.append(("   paired medians", *cells, ""))
        if kind == "real-vs-synthetic" and metric == "psnr" and levels == tuple(PAPER_GAP):
            paper = list(PAPER_GAP.values())
            body.append(("the paper's gap", *(f"{g:+.2f}" for g in paper), f"{np.mean(paper):+.2f}"))
        tables.append(Table(f"Gap of {title}", head, tuple(body)))
    text, medians = "Means over images and seeds.", "paired medians"
    if len(results.seeds) > 1:
        text = "Means over images and seeds, ± half the spread between seeds."
        medians = "paired medians, mean and range of the seeds"
    return Section(_set_label(name), text, tuple(tables), ((plot(_gap_plot(results, name), medians),),))


def _by_material(results: _Results, names: Sequence[str]) -> Section:
    """The gaps of single materials, a table per rival and metric."""

    def cells(rival: str, name: str, metric: str) -> tuple[str, ...]:
        gap = results.gap(rival, name, metric)
        return (*(f"{g:+.2f}" for g in gap), f"{gap.mean():+.2f}")

    head = (*map(level_label, results.levels[names[0]]), "mean")
    text = "Gaps by material, means over images and seeds. What each source comes to is in results.json."
    return Section("By material", text, _gap_tables(results, names, head, cells))


def _standing_plot(results: _Results, names: Sequence[str]) -> Figure:
    """A row per rival, a column per metric; bars for the gaps of sets, dots for those of their levels."""
    rivals = results.rivals
    figure = Figure(figsize=(8, 2.3 * len(rivals)), layout="constrained")
    labels = [as_label(_set_label(name)) for name in names]
    grid = figure.subplots(len(rivals), len(DECIBELS), sharey="row", squeeze=False)
    for axes, (rival, (metric, title, _)) in zip(grid.flat, product(rivals, DECIBELS), strict=True):
        for place, name in enumerate(names):
            gap = results.gap(rival, name, metric)
            axes.bar(place, gap.mean(), 0.5, color="C0", alpha=0.5)
            axes.plot(np.full(len(gap), place), gap, ".", color="C0", markersize=4)
        axes.axhline(0, color="grey", linewidth=0.8)
        axes.set_xticks(range(len(names)), labels, fontsize=8, rotation=0 if len(names) < 6 else 30)
        axes.set_title(f"full - {rival}, {title}", fontsize=9)
        axes.grid(alpha=0.3, axis="y")
    return figure


def _gap_plot(results: _Results, name: str) -> Figure:
    figure = Figure(figsize=(8, 3), layout="constrained")
    levels = [as_label(level_label(level)) for level in results.levels[name]]
    for axes, (metric, title, _) in zip(figure.subplots(1, 2), DECIBELS, strict=True):
        for rival in results.rivals:
            medians = results.medians(rival, name, metric)
            axes.plot(levels, medians.mean(axis=1), "o-", label=f"full - {rival}")
            axes.fill_between(levels, medians.min(axis=1), medians.max(axis=1), alpha=0.2)
        axes.axhline(0, color="grey", linewidth=0.8)
        axes.set_title(f"gap of {title}", fontsize=9)
        axes.grid(alpha=0.3)
    axes.legend(fontsize=7)
    return figure
