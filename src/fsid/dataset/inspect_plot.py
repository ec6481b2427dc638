"""The figure of `fsid inspect`: the distribution of every statistic, the set beside its reference."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from fsid.assets.file_names import shown
from fsid.dataset.inspect import Inspection
from fsid.dataset.statistics import TITLES

_COLUMNS = 4
_BINS = 40


def inspection_picture(inspection: Inspection) -> bytes:
    """The histograms as a PNG file; their outermost bars hold what lies beyond, too."""
    distances = {c.name: c for c in inspection.comparisons}
    rows = -(-len(TITLES) // _COLUMNS)
    figure = Figure(figsize=(4.2 * _COLUMNS, 2.8 * rows), layout="constrained")
    places = list(figure.subplots(rows, _COLUMNS).flat)
    for axes in places[len(TITLES) :]:
        axes.remove()
    for axes, (name, title) in zip(places, TITLES.items(), strict=False):
        sets = {as_label(_name(inspection.data)): inspection.values[name]}
        if inspection.reference is not None:
            sets[as_label(f"{_name(inspection.reference_name)} (reference)")] = inspection.reference[name]
        both = np.concatenate(list(sets.values()))
        low, high = (float(q) for q in np.quantile(both, (0.002, 0.998)))
        edges = np.linspace(low, high if high > low else low + 1.0, _BINS + 1)
        for label, values in sets.items():
            weights = np.full(len(values), 100 / len(values))
            axes.hist(values.clip(low, high), edges, weights=weights, label=label, alpha=0.55)
        distance = f"\ndistance {distances[name].distance:.2f}" if name in distances else ""
        axes.set_title(title + distance, fontsize=9)
        axes.set_ylabel("%", fontsize=8)
        axes.tick_params(labelsize=7)
    figure.axes[0].legend(fontsize=7)
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=90)
    return data.getvalue()


def as_label(name: str) -> str:
    """`name` as matplotlib shows it literally: no mathematics, not left out of a legend, and text."""
    literal = shown(name).replace("$", r"\$")
    return f" {literal}" if name.startswith("_") else literal


def _name(folder: str) -> str:
    return Path(folder).resolve().name
