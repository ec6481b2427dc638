"""Plots of the report: the camera's noise, and the course of a training."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

from matplotlib.figure import Figure

from fsid.evaluate.report import Picture, plot
from fsid.sensor import CameraProfile
from fsid.sensor.fit_plot import plot_levels


def noise_profile_plot(profile: CameraProfile, isos: Sequence[float]) -> Picture:
    """k and sigma2 against ISO, and where the ISOs of a test are."""
    figure = Figure(figsize=(8, 3.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    plot_levels(left, right, profile)
    for axis, iso in product((left, right), isos):
        axis.axvline(iso, color="grey", linewidth=0.6, linestyle=":")
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
        axis.plot(steps, values, "." if len(steps) == 1 else "-", linewidth=1)
        axis.set(xlabel="step", ylabel=label)
        axis.grid(alpha=0.3)
    left.set_yscale("log")
    figure.tight_layout()
    return plot(figure, "course of the training")
