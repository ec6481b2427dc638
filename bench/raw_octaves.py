"""How fine the detail of RAW data is, and its colour: python bench/raw_octaves.py DATA DATA ... [--step 1]

For the clean mosaics of datasets (`fsid generate`), packed into R, Gr, Gb, B and in logarithms, by octave of
cycles per packed pixel, medians over patches of 128 x 128 packed pixels:

    luma            variance of the mean of the four
    green-magenta   variance of (R + B) / 2 - (Gr + Gb) / 2 that luma does not explain (a linear fit per patch
                    and octave), relative to luma

R and B lie on either side of the two greens, so what is left in the last octave is colour, or detail finer
than a packed pixel. A network keeps noise there if its training data has more of it than photographs have
(docs/rounds.md).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from fsid.dataset.index import StoredMosaic, index_mosaics
from fsid.errors import FsidError
from fsid.sensor.mosaic import pack

EDGES = (1 / 64, 1 / 32, 1 / 16, 1 / 8, 1 / 4)
PATCH = 128
FLOOR = 0.01
"""Added before the logarithm: noise hides what is darker anyway."""


def packed(stored: StoredMosaic) -> np.ndarray:
    """(4, H / 2, W / 2) normalised R, Gr, Gb, B."""
    count, shape = stored.height * stored.width, (stored.height, stored.width)
    dn = np.fromfile(stored.shard, "<u2", count, offset=stored.offset).reshape(shape)
    return (pack(dn, stored.cfa) - float(stored.black_level)) / (stored.white_level - stored.black_level)


def octaves(patch: np.ndarray) -> np.ndarray:
    """(2, octaves) variance of luma, and of green against magenta relative to it; patch: (4, n, n)."""
    log = np.log(np.maximum(patch, 0) + FLOOR)
    signals = np.stack([log.mean(0), (log[0] + log[3] - log[1] - log[2]) / 2])
    spectrum = np.fft.fft2(signals - signals.mean((1, 2), keepdims=True))
    frequency = np.hypot(np.fft.fftfreq(PATCH)[:, None], np.fft.fftfreq(PATCH))
    out = np.empty((2, len(EDGES)))
    for i, low in enumerate(EDGES):
        inside = (frequency >= low) & (frequency < (EDGES[i + 1] if i + 1 < len(EDGES) else 1))
        luma, colour = spectrum[:, inside]
        power = np.vdot(luma, luma).real + 1e-12
        left = colour - luma * (np.vdot(luma, colour).real / power)
        out[:, i] = power / PATCH**4, np.vdot(left, left).real / power
    return out


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("data", type=Path, nargs="+", help="folders of pairs")
    parser.add_argument("--step", type=int, default=1, help="take every so many-th picture")
    given = parser.parse_args()
    if given.step < 1:
        parser.error(f"--step {given.step}: must be 1 or more")
    titles = [f"1/{round(1 / low)}" for low in EDGES]
    table = Table("data", "patches", "", *titles, title="octaves from, cycles per packed pixel")
    for folder in given.data:
        found = []
        for stored in index_mosaics(folder)[:: given.step]:
            planes = packed(stored)
            for top in range(0, planes.shape[1] - PATCH + 1, PATCH):
                for left in range(0, planes.shape[2] - PATCH + 1, PATCH):
                    found.append(octaves(planes[:, top : top + PATCH, left : left + PATCH]))
        if not found:
            raise SystemExit(f"{folder}: no picture has {2 * PATCH} x {2 * PATCH} pixels")
        luma, colour = np.median(found, axis=0)
        table.add_row(folder.name, str(len(found)), "luma", *(f"{value:.4f}" for value in luma))
        table.add_row("", "", "green-magenta", *(f"{value:.3f}" for value in colour))
    Console(width=120).print(table)


if __name__ == "__main__":
    try:
        main()
    except FsidError as error:
        raise SystemExit(str(error)) from None
