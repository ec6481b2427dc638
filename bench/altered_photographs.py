"""What one network knows of photographs and another does not: python bench/altered_photographs.py PHOTOS OUT.

Writes a folder of photographs once per alteration, each in a folder of its own. Make test sets of them (`fsid
testset photos OUT/grey OUT/swapped ... -o TEST --iso 3200`) and evaluate both networks on them: where a gap
between the two closes, it may have come from what the alteration takes away. An altered photograph is also
stranger to a network that was trained on photographs, so this hints, it does not prove (docs/rounds.md).

    as-is      nothing is altered             grey      luma alone (Rec. 601)
    swapped    blue, red, green for red,      negative  1 - x
               green, blue: other hues        doubled   twice the size, cubic spline: nothing finer than 2 px
    plain      median of 5x5: no texture      soft      Gaussian, 0.7 px
    sharpened  unsharp mask, 0.8 px, amount 1 muted     half the contrast about mid grey
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.ndimage import gaussian_filter, median_filter, zoom

from fsid.dataset.photos import find_photos, read_photo
from fsid.errors import FsidError

Alteration = Callable[[np.ndarray], np.ndarray]

LUMA = np.array([0.299, 0.587, 0.114])


def _soft(picture: np.ndarray, sigma_px: float) -> np.ndarray:
    return gaussian_filter(picture, (sigma_px, sigma_px, 0), mode="reflect")


ALTERATIONS: dict[str, Alteration] = {
    "as-is": lambda x: x,
    "grey": lambda x: np.repeat((x @ LUMA)[..., None], 3, axis=2),
    "swapped": lambda x: x[..., [2, 0, 1]],
    "negative": lambda x: 1 - x,
    "doubled": lambda x: zoom(x, (2, 2, 1), order=3),
    "plain": lambda x: median_filter(x, (5, 5, 1)),
    "soft": lambda x: _soft(x, 0.7),
    "sharpened": lambda x: 2 * x - _soft(x, 0.8),
    "muted": lambda x: 0.25 + 0.5 * x,
}
"""Name -> what it makes of a picture (H, W, 3), sRGB-encoded, 0..1."""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("photos", type=Path)
    parser.add_argument("out", type=Path, help="must not exist")
    parser.add_argument("--only", nargs="+", choices=tuple(ALTERATIONS), default=tuple(ALTERATIONS))
    parser.add_argument("--step", type=int, default=1, help="every STEP-th photograph")
    given = parser.parse_args()
    if given.out.exists():
        parser.error(f"{given.out}: exists")
    try:
        photos = {file.stem: read_photo(file) for file in find_photos(given.photos)[:: given.step]}
    except FsidError as problem:
        parser.error(str(problem))
    for name in given.only:
        (given.out / name).mkdir(parents=True)
        for stem, photo in photos.items():
            altered = np.clip(ALTERATIONS[name](photo), 0.0, 1.0)
            Image.fromarray(np.rint(altered * 255).astype(np.uint8)).save(given.out / name / f"{stem}.png")


if __name__ == "__main__":
    main()
