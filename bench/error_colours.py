"""On which colours a denoiser errs: python bench/error_colours.py TESTSET LEVEL MODEL MODEL ...

Every picture in windows of 16 x 16 pixels, grouped by the mean colour of the truth after develop: grey
(CIELAB chroma below 12) or one of six hues, and plain (standard deviation below 0.015 of the range) or
textured. For every group its share of the windows and of the first model's error, and the others' error in
dB relative to the first's (above 0: smaller). A picture's errors count relative to its own, so that no
noisy one decides. A network loses on the colours that it has seen too little of: this is how docs/rounds.md
found that scenes lacked sky and leaves.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table
from skimage.color import rgb2lab

from fsid.denoise import denoise_raw, load_model
from fsid.evaluate.testset import read_testset
from fsid.sensor import develop, read_raw

WINDOW_PX = 16
GREY, PLAIN = 12.0, 0.015
HUES = {"red": 0, "orange": 45, "yellow": 75, "green": 105, "cyan": 195, "blue": 240, "purple": 300}
"""CIELAB hues from which on, degrees; purple to 360."""
GROUPS = [f"{name}, {kind}" for name in ("grey", *HUES) for kind in ("textured", "plain")]


def windows(image: np.ndarray) -> np.ndarray:
    """(N, WINDOW_PX^2, 3) of (H, W, 3); what is left over at the right and lower edge is dropped."""
    rows, columns = (side // WINDOW_PX for side in image.shape[:2])
    cut = image[: rows * WINDOW_PX, : columns * WINDOW_PX]
    tiles = cut.reshape(rows, WINDOW_PX, columns, WINDOW_PX, 3).swapaxes(1, 2)
    return tiles.reshape(rows * columns, WINDOW_PX**2, 3)


def group_of(truth: np.ndarray) -> np.ndarray:
    """(N,) index into GROUPS of `windows` of a developed picture, 0..1."""
    lab = rgb2lab(truth.mean(1))
    hue_deg = np.degrees(np.arctan2(lab[:, 2], lab[:, 1])) % 360
    colour = np.where(np.hypot(lab[:, 1], lab[:, 2]) < GREY, 0, np.digitize(hue_deg, list(HUES.values())))
    return 2 * colour + (truth.std(1).mean(1) < PLAIN)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("testset", type=Path)
    parser.add_argument("level", help="one of the test set's, such as iso3200")
    parser.add_argument("models", type=Path, nargs="+")
    given = parser.parse_args()
    testset = read_testset(given.testset)
    models = [load_model(path) for path in given.models]
    count, errors = np.zeros(len(GROUPS)), np.zeros((len(models), len(GROUPS)))
    for image in testset.images:
        truth = windows(np.clip(develop(read_raw(testset.clean(given.testset, image, given.level))), 0, 1))
        noisy = read_raw(testset.noisy(given.testset, image, given.level))
        group = group_of(truth)
        count += np.bincount(group, minlength=len(GROUPS)) / len(group)
        results = (windows(np.clip(develop(denoise_raw(noisy, model)), 0, 1)) for model in models)
        squared = np.array([((result - truth) ** 2).mean((1, 2)) for result in results])
        squared /= squared[0].sum()
        errors += [np.bincount(group, of_one, len(GROUPS)) for of_one in squared]
    print_table([path.name for path in given.models], count / len(testset.images), errors)


def print_table(names: list[str], share: np.ndarray, errors: np.ndarray) -> None:
    """share: (groups,) of all windows. errors: (models, groups)."""
    table = Table("windows", "share", f"error of {names[0]}", *(f"{name}, dB" for name in names[1:]))
    table.title = "dB relative to the first model"
    for i, group in enumerate(GROUPS):
        if errors[0, i] > 0:
            gains = 10 * np.log10(errors[0, i] / errors[1:, i])
            of_all = errors[0, i] / errors[0].sum()
            table.add_row(group, f"{share[i]:.1%}", f"{of_all:.1%}", *(f"{gain:+.2f}" for gain in gains))
    gains = 10 * np.log10(errors[0].sum() / errors[1:].sum(1))
    table.add_row("all", "", "", *(f"{gain:+.2f}" for gain in gains))
    Console(width=140).print(table)


if __name__ == "__main__":
    main()
