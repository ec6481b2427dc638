"""Plots of the report: the camera's noise, and the course of a training."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from fsid.evaluate.report import Picture, plot
from fsid.sensor import CameraProfile

SITE_COLOURS = {"R": "tab:red", "Gr": "tab:green", "Gb": "tab:olive", "B": "tab:blue"}


def noise_profile_plot(profile: CameraProfile, isos: Sequence[float]) -> Picture:
    """k and sigma2 against ISO: the published points, and the line that is used."""
    figure = Figure(figsize=(8, 3.2))
    left, right = figure.subplots(1, 2)
    grid = np.geomspace(min(*profile.iso, *isos), max(*profile.iso, *isos), 64)
    levels = [profile.level(iso) for iso in grid]
    published_k, published_sigma2 = np.asarray(profile.k), np.asarray(profile.sigma2)
    for site, (name, colour) in enumerate(SITE_COLOURS.items()):
        left.loglog(grid, [level.k[site] for level in levels], color=colour, label=name)
        left.loglog(profile.iso, published_k[:, site], "o", color=colour, markersize=3)
        right.loglog(grid, [level.sigma2[site] for level in levels], color=colour)
        positive = published_sigma2[:, site] > 0
        right.loglog(
            np.asarray(profile.iso)[positive],
            published_sigma2[positive, site],
            "o",
            color=colour,
            markersize=3,
        )
    left.set(xlabel="ISO", ylabel="k (normalised)")
    right.set(xlabel="ISO", ylabel="sigma2 (normalised)")
    left.legend(fontsize=8)
    for axis in (left, right):
        axis.grid(alpha=0.3, which="both")
        for iso in isos:
            axis.axvline(iso, color="grey", linewidth=0.6, linestyle=":")
    figure.tight_layout()
    return plot(
        figure,
        f"{profile.camera}: lines as used, points as published (negative published sigma2 cannot be drawn), "
        "dotted: the ISOs of the test",
    )


def loss_plot(steps: Sequence[int], losses: Sequence[float], psnrs: Sequence[float]) -> Picture:
    """The training loss and PSNR (dB, RAW, of the training batches) against the step."""
    figure = Figure(figsize=(8, 2.8))
    left, right = figure.subplots(1, 2)
    for axis, values, label in ((left, losses, "training loss"), (right, psnrs, "training PSNR (dB)")):
        axis.plot(steps, values, linewidth=1)
        axis.set(xlabel="step", ylabel=label)
        axis.grid(alpha=0.3)
    left.set_yscale("log")
    figure.tight_layout()
    return plot(figure, "course of the training")
