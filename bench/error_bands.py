"""Where in the spectrum a denoiser errs: python bench/error_bands.py TESTSET LEVEL MODEL MODEL ...

For every model the squared error after develop, by octave of spatial frequency, in luma and in chroma
(Rec. 601), in dB relative to the first model (above 0: smaller error), median over the pictures of the
test set; and the share of each octave in the error of the first. A network that loses in fine chroma
keeps noise there or blurs colour; one that loses at low frequencies keeps blotches. This is how
docs/rounds.md found what scenes lacked.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from fsid.denoise import denoise_raw, load_model
from fsid.errors import FsidError
from fsid.evaluate.testset import read_testset
from fsid.sensor import develop, read_raw

EDGES = (1 / 64, 1 / 32, 1 / 16, 1 / 8, 1 / 4)
"""Cycles per pixel."""
YCC = np.array([[0.299, 0.587, 0.114], [-0.1687, -0.3313, 0.5], [0.5, -0.4187, -0.0813]])


def bands(error: np.ndarray) -> np.ndarray:
    """(2, octaves) squared error of luma and of chroma; error: (H, W, 3)."""
    height, width = error.shape[:2]
    power = np.abs(np.fft.fft2(error @ YCC.T, axes=(0, 1)) / (height * width)) ** 2
    frequency = np.hypot(np.fft.fftfreq(height)[:, None], np.fft.fftfreq(width))
    octave = np.digitize(frequency, EDGES)
    parts = (power[..., 0], power[..., 1] + power[..., 2])
    return np.array([np.bincount(octave.ravel(), part.ravel(), len(EDGES) + 1) for part in parts])


def results_on_a_testset(doc: str) -> tuple[list[str], int, Iterator[tuple[np.ndarray, list[np.ndarray]]]]:
    """What TESTSET LEVEL MODEL MODEL ... of the command line ask for: the models' names, the number of
    pictures, and of each picture the truth and every model's result, developed (H, W, 3). doc: of --help."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("testset", type=Path)
    parser.add_argument("level", help="one of the test set's, such as iso3200")
    parser.add_argument("models", type=Path, nargs="+")
    given = parser.parse_args()
    try:
        testset = read_testset(given.testset)
        models = [load_model(path) for path in given.models]
    except FsidError as problem:
        parser.error(str(problem))
    if given.level not in testset.levels:
        parser.error(f"{given.testset} has no level '{given.level}', but {', '.join(testset.levels)}")

    def pictures() -> Iterator[tuple[np.ndarray, list[np.ndarray]]]:
        for image in testset.images:
            truth = develop(read_raw(testset.clean(given.testset, image, given.level)))
            noisy = read_raw(testset.noisy(given.testset, image, given.level))
            yield truth, [develop(denoise_raw(noisy, model)) for model in models]

    return [path.name for path in given.models], len(testset.images), pictures()


def main() -> None:
    names, count, pictures = results_on_a_testset(__doc__ or "")
    errors = np.empty((len(names), count, 2, len(EDGES) + 1))
    for i, (truth, results) in enumerate(pictures):
        errors[:, i] = [bands(result - truth) for result in results]
    print_table(names, errors)


def print_table(names: list[str], errors: np.ndarray) -> None:
    """errors: (models, pictures, 2, octaves)."""
    title = ("below 1/64", *(f"from 1/{round(1 / edge)}" for edge in EDGES))
    table = Table("", "cycles per pixel", *title, title="dB relative to the first model")
    share = np.median(errors[0] / errors[0].sum(axis=(1, 2), keepdims=True), axis=0)
    for part, name in enumerate(("luma", "chroma")):
        table.add_row(name, "share of the first's error", *(f"{value:.1%}" for value in share[part]))
        for number, model in enumerate(names):
            gain = np.median(10 * np.log10(errors[0, :, part] / errors[number, :, part]), axis=0)
            table.add_row(name, model, *(f"{value:+.2f}" for value in gain))
    Console(width=140).print(table)


if __name__ == "__main__":
    main()
