"""Time to bake each material family, and to read it back from the cache; best of three, interleaved.

python bench/materials.py [--size 1024] [FAMILY...]
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
from collections.abc import Callable

from fsid.assets import bake_material, material_families
from fsid.assets.bake_cache import pack
from fsid.assets.material_registry import draw_material


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
    baked, read = 0.0, 0.0
    with tempfile.TemporaryDirectory() as folder:
        os.environ["FSID_CACHE"] = folder
        names = options.families or material_families()
        for family in names:
            bake_material(family, 1, options.size)
            pairs = [
                (
                    seconds(lambda name=family: pack(draw_material(name, 1, options.size))),
                    seconds(lambda name=family: bake_material(name, 1, options.size)),
                )
                for _ in range(3)
            ]
            bake, load = (min(column) for column in zip(*pairs, strict=True))
            baked, read = baked + bake, read + load
            print(f"{family:22s} bake {bake:.3f} s   cached {load:.3f} s", flush=True)
    print(f"mean of {len(names)}: bake {baked / len(names):.3f} s, cached {read / len(names):.3f} s")


if __name__ == "__main__":
    main()
