"""Processor time of a layer of every material family, drawn and from the cache; best of three, interleaved.

python bench/materials.py [--size 1024] [FAMILY...]

"maps": maps are kept, read and made into texels, and not yet uploaded. "layer": what the renderer does;
finished texels are kept, read and uploaded. Cold is without an entry, warm with one; drawing the maps is the
same in both and subtracted from cold. The tiles of all families and variants take `disk` times 444.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from fsid.assets import bake_material, material_families
from fsid.assets.material_registry import draw_material
from fsid.render.context import open_context
from fsid.render.layers import LayerStore
from fsid.render.texels import bake_texels, texels_of

COLUMNS = ("drawn", "maps cold", "layer cold", "maps warm", "layer warm")


def seconds(work: Callable[[], object]) -> float:
    """Processor time of one call."""
    start = time.process_time()
    work()
    return time.process_time() - start


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=1024)
    parser.add_argument("families", nargs="*")
    options = parser.parse_args()
    store = LayerStore(open_context(None), options.size, budget_bytes=1)
    names = options.families or material_families()
    rows, disk = [], 0
    print(f"{'family':22s}" + "".join(f"{column:>12s}" for column in COLUMNS))
    for name in names:
        row, used = family(store, name, options.size)
        rows.append(row)
        disk += used
        print(f"{name:22s}" + "".join(f"{value:12.4f}" for value in row), flush=True)
    mean = np.mean(rows, axis=0)
    print(f"{'mean':22s}" + "".join(f"{value:12.4f}" for value in mean))
    print(f"cold {mean[1] / mean[2]:.1f} times as fast, warm {mean[3] / mean[4]:.1f} times")
    print(f"disk: {disk / len(names) / 2**20:.2f} MiB a layer")


def family(store: LayerStore, name: str, size: int) -> tuple[np.ndarray, int]:
    """(seconds in the order of COLUMNS, bytes of its entry)."""
    held = bake_texels(name, 1, size)

    def maps() -> None:
        texels_of(bake_material(name, 1, size))

    def layer() -> None:
        store.load([(name, 1)], bake_texels)

    runs = []
    for _ in range(3):
        drawn = seconds(lambda: draw_material(name, 1, size))
        times = []
        for work in (maps, layer):
            with tempfile.TemporaryDirectory() as folder:
                os.environ["FSID_CACHE"] = folder
                store.load([("another", 0)], lambda *key: held)  # the store holds one layer
                cold = seconds(work)
                store.load([("another", 0)], lambda *key: held)
                times.append((cold, seconds(work)))
                used = sum(path.stat().st_size for path in Path(folder).rglob("*.npz"))
        runs.append((drawn, times[0][0], times[1][0], times[0][1], times[1][1]))
    best = np.min(runs, axis=0)
    return best - best[0] * np.array([0, 1, 1, 0, 0]), used


if __name__ == "__main__":
    main()
