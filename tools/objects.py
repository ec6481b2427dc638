"""Write docs/objects.md (the mesh families) and docs/images/objects.jpg (their sheet).

python tools/objects.py                                  both
python tools/objects.py sheet OUT.png [FAMILY...]        six seeds of each named family (default: all)
"""

from __future__ import annotations

import colorsys
import sys
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from fsid.assets import PART_KINDS, build_mesh, mesh_families, part_kind
from fsid.assets.registry import mesh_family_summary
from fsid.render import Renderer
from fsid.scene import Background, Camera, Light, Material, Object, Scene, Transform

DOCS = Path(__file__).resolve().parents[1] / "docs"
SEEDS = 6

INTRODUCTION = """# Objects

Every object is built from (family, seed) alone: `fsid.assets.build_mesh("vase", 7)`. A family is one function
of a random generator in `src/fsid/assets/meshes/`, with continuous parameters and named material parts;
adding one touches one file. `src/fsid/scene/pools.py` names those that are common out of doors. This page is
written by `python tools/objects.py`.

![One object of each family](images/objects.jpg)

## Families

| family | what | parts |
|---|---|---|
"""

KINDS = """
## What parts are made of

A part's material is random, as in the paper. Where only one sort of matter makes sense, the part's name says
so with one of these words (`fsid.assets.part_kind`), and a sampler can give it that optical property.

| word | what fits |
|---|---|
"""


def guide() -> str:
    """The text of docs/objects.md."""
    rows = []
    for family in mesh_families():
        parts = dict.fromkeys(name for seed in range(SEEDS) for name in build_mesh(family, seed).part_names)
        rows.append(
            f"| `{family}` | {mesh_family_summary(family)} | {', '.join(f'`{p}`' for p in parts)} |\n"
        )
    kinds = [f"| `{word}` | {fits} |\n" for word, fits in PART_KINDS.items()]
    return INTRODUCTION + "".join(rows) + KINDS + "".join(kinds)


def picture(renderer: Renderer, family: str, seed: int, size: int) -> np.ndarray:
    """(size, size, 3) uint8: the object scaled to one metre, its parts in paints of different hues."""
    mesh = build_mesh(family, seed)
    extent = mesh.vertices.max(0) - mesh.vertices.min(0)
    scale = 1.0 / float(np.linalg.norm(extent))
    first = zlib.crc32(family.encode()) % 100 / 100 + 0.1 * seed
    hues = (0.61803 * np.arange(len(mesh.part_names)) + first) % 1
    materials = tuple(
        _paint(colorsys.hsv_to_rgb(hue, 0.5, 0.65), part_kind(name) == "leaf")
        for hue, name in zip(hues, mesh.part_names, strict=True)
    )
    grey = _paint((0.45, 0.45, 0.45), False)
    surfaces = ("floor", "ceiling", "wall_north", "wall_south", "wall_east", "wall_west")
    scene = Scene(
        seed=seed,
        variant="full",
        objects=(Object(family, seed),),
        materials=(materials,),
        transforms=(Transform((0.0, 0.0, 0.0), (0.0, 0.0, 20.0), (scale,) * 3),),
        background=Background("room", (6.0, 6.0, 3.0), dict.fromkeys(surfaces, grey)),
        lights=(Light("point", (-0.9, -1.3, 1.9), (0.0, 0.0, -1.0), (6.0, 5.8, 5.4), 0.08, 360.0),),
        ambient=(0.35, 0.37, 0.4),
        cameras=(
            Camera(
                (0.35, -1.9, 1.25), (0.0, 0.0, 0.45 * float(extent[2]) * scale), (0, 0, 1), 32.0, size, size
            ),
        ),
    )
    linear = np.clip(renderer.render(scene).radiance, 0, 1)
    return (255 * linear ** (1 / 2.2)).astype(np.uint8)


def _paint(colour: tuple[float, float, float], leaf: bool) -> Material:
    r, g, b = (0.3 * colour[0], colour[1], 0.3 * colour[2]) if leaf else colour
    return Material("paint", 0, ((r, g, b),) * 3, 0.8, 0.0, 1.0, 0.5)


def sheet(families: Sequence[str], seeds: Sequence[int], columns: int, size: int) -> Image.Image:
    """A grid of pictures, family by family."""
    with Renderer(texture_size=128) as renderer:
        cells = [picture(renderer, family, seed, size) for family in families for seed in seeds]
    rows = -(-len(cells) // columns)
    canvas = np.full((rows * size, columns * size, 3), 255, np.uint8)
    for k, cell in enumerate(cells):
        row, column = divmod(k, columns)
        canvas[row * size : (row + 1) * size, column * size : (column + 1) * size] = cell
    return Image.fromarray(canvas)


def main(arguments: Sequence[str]) -> None:
    if arguments and (arguments[0] != "sheet" or len(arguments) < 2):
        sys.exit(__doc__)
    if arguments:
        families = tuple(arguments[2:]) or mesh_families()
        sheet(families, range(SEEDS), SEEDS, 200).save(arguments[1])
        return
    (DOCS / "objects.md").write_text(guide(), encoding="utf-8")
    sheet(mesh_families(), (1,), 11, 120).save(DOCS / "images" / "objects.jpg", quality=85)


if __name__ == "__main__":
    main(sys.argv[1:])
