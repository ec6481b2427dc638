"""What one network knows of photographs and another does not: python bench/altered_photographs.py PHOTOS OUT.

Writes a folder of photographs once per alteration, each in a folder of its own. Make test sets of them (`fsid
testset photos OUT/grey OUT/swapped ... -o TEST --iso 3200`) and evaluate both networks on them: where a gap
between the two closes, it came from what the alteration takes away (docs/rounds.md).

    as-is      nothing is altered             grey      luma alone (Rec. 601)
    swapped    blue, red, green for red,      negative  255 - x
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

Alteration = Callable[[np.ndarray], np.ndarray]

LUMA = np.array([0.299, 0.587, 0.114])
EXTENSIONS = (".png", ".jpg", ".jpeg", ".tif", ".tiff")


def _soft(picture: np.ndarray, sigma_px: float) -> np.ndarray:
    return gaussian_filter(picture, (sigma_px, sigma_px, 0), mode="reflect")


ALTERATIONS: dict[str, Alteration] = {
    "as-is": lambda x: x,
    "grey": lambda x: np.repeat((x @ LUMA)[..., None], 3, axis=2),
    "swapped": lambda x: x[..., [2, 0, 1]],
    "negative": lambda x: 255 - x,
    "doubled": lambda x: zoom(x, (2, 2, 1), order=3),
    "plain": lambda x: median_filter(x, (5, 5, 1)),
    "soft": lambda x: _soft(x, 0.7),
    "sharpened": lambda x: 2 * x - _soft(x, 0.8),
    "muted": lambda x: 128 + 0.5 * (x - 128),
}
"""Name -> what it makes of a picture (H, W, 3), sRGB-encoded, 0..255."""


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
    files = sorted(f for f in given.photos.glob("*") if f.suffix.lower() in EXTENSIONS)[:: given.step]
    if not files:
        parser.error(f"{given.photos}: no photographs in it")
    for name in given.only:
        (given.out / name).mkdir(parents=True)
        for file in files:
            with Image.open(file) as image:
                picture = np.asarray(image.convert("RGB"), np.float64)
            altered = np.clip(np.rint(ALTERATIONS[name](picture)), 0, 255).astype(np.uint8)
            height, width = (size // 2 * 2 for size in altered.shape[:2])
            Image.fromarray(altered[:height, :width]).save(given.out / name / f"{file.stem}.png")


if __name__ == "__main__":
    main()
