"""On which colours a denoiser errs: python bench/error_colours.py TESTSET LEVEL MODEL MODEL ...

Every picture in windows of 16 x 16 pixels, grouped by the mean colour of the truth after develop: grey
(CIELAB chroma below 12) or one of six hues, and plain (standard deviation below 0.015 of the range) or
textured. For every group its share of the windows and of the first model's error, and the others' error in
dB relative to the first's (above 0: smaller). A picture's errors count relative to its own, so that no
noisy one decides. A network loses on the colours that it has seen too little of: this is how docs/rounds.md
found that scenes lacked sky and leaves.
"""

from __future__ import annotations

import numpy as np
from rich.console import Console
from rich.table import Table
from skimage.color import rgb2lab

from error_bands import results_on_a_testset

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
    names, pictures_count, pictures = results_on_a_testset(__doc__ or "")
    share, errors = np.zeros(len(GROUPS)), np.zeros((len(names), len(GROUPS)))
    for truth, results in pictures:
        true = windows(np.clip(truth, 0, 1))
        group = group_of(true)
        share += np.bincount(group, minlength=len(GROUPS)) / len(group) / pictures_count
        squared = [((windows(np.clip(result, 0, 1)) - true) ** 2).mean((1, 2)) for result in results]
        errors += [np.bincount(group, of_one / squared[0].sum(), len(GROUPS)) for of_one in squared]
    print_table(names, share, errors)


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
