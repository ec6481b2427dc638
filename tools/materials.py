"""Write docs/materials.md (the material families and layers) and docs/images/materials.jpg (their sheet).

python tools/materials.py                                both
python tools/materials.py sheet OUT.png [NAME...]        the four variants of each named family (default: all)
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from fsid.assets import (
    MATERIAL_VARIANTS,
    material_colours,
    material_families,
    material_layers,
    material_tile_m,
)
from fsid.assets.material_registry import material_summary
from fsid.render import Renderer
from fsid.scene import Background, Camera, Light, Material, Object, Scene, Transform

DOCS = Path(__file__).resolve().parents[1] / "docs"
PITCH_M, COLUMNS, CELL_PX = 0.44, 14, 92

INTRODUCTION = """# Materials

A surface is (family, variant, three colours): `fsid.assets.bake_material("brick", 2)` makes tileable maps at
any power of two from 64 to 8192 texels, and every use recolours them. Every size is the same picture, seen
more or less sharply; grain alone is some texels wide at all of them. A family is one function in
`src/fsid/assets/materials/`; adding one touches one file. `src/fsid/scene/pools.py` names those that are
common on floors, walls or grounds, and those without order. This page is written by
`python tools/materials.py`.

![Every family on a cushion](images/materials.jpg)

```python
from fsid.assets import bake_material, material_colours, material_families, material_layers

maps = bake_material("brick", 2, 1024)  # (S, S): mix, pattern, detail, roughness, height, metallic
material_colours("brick", 2)  # what its three colours are in nature; None where any will do
bake_material("brick+dirt+dust", 2, 1024)  # the same under layers, see below
bake_material("file:textures/Bricks001_1K-JPG", 0, 1024)  # a texture set of your own
```

How the maps and three colours give an albedo is the equation of `fsid/assets/maps.py`. Families marked "full
colour" are drawn as pictures and put into the maps by a triangle of colours (`fsid/assets/triangle.py`).
Texture folders are described in [bring your own textures](bring-your-own-textures.md).

"""

FAMILIES = """
| family | what | tile | colours |
|---|---|---|---|
"""

LAYERS = """
## Layers

Any family, and any texture set, can lie under layers: `brick+dust`, `wood_planks+wear+stains`.

| layer | what |
|---|---|
"""

CACHE = """
## The cache

A bake takes tenths of a second, so it is kept in a folder: `$FSID_CACHE`, else `$XDG_CACHE_HOME/fsid`, else
`~/.cache/fsid`. `FSID_CACHE=off` keeps nothing. The result is the same with and without: maps are rounded
(8 bit, height 16 bit) before they are returned, not only when they are stored. The name of an entry holds a
hash of the sources that made it and of the versions of NumPy, SciPy, Pillow and Matplotlib, so an entry
cannot be stale; the folder stays below 4 GiB, what was used longest ago leaves first; a damaged entry is
baked again; any number of processes may share it. Deleting it costs time and nothing else.
"""


def guide() -> str:
    """The text of docs/materials.md."""
    families, layers = material_families(), material_layers()
    count = f"## Families\n\n{len(families)} families with {MATERIAL_VARIANTS} variants each.\n"
    rows = [
        f"| `{name}` | {material_summary(name)} | {100 * material_tile_m(name):.0f} cm | {_colours(name)} |\n"
        for name in families
    ]
    below = [f"| `{name}` | {material_summary(name)} |\n" for name in layers]
    return INTRODUCTION + count + FAMILIES + "".join(rows) + LAYERS + "".join(below) + CACHE


def _colours(name: str) -> str:
    colours = material_colours(name, 0)
    if colours is None:
        return "any"
    return "full colour" if max(max(c) for c in colours) > 1 else "own"


def material(name: str, variant: int, rng: np.random.Generator) -> Material:
    """In its own colours, or in three random ones of different lightness."""
    own = material_colours(name, variant)
    tone = rng.uniform(0.25, 1.0, 3)
    drawn = tuple(tuple(float(c) for c in level * tone / tone.max()) for level in (0.35, 0.55, 0.08))
    tile_m = min(material_tile_m(name), 0.6)
    r, g, b = own or drawn
    return Material(name, variant, (r, g, b), tile_m, 0.0, 1.0, 1.0)  # type: ignore[arg-type]


def sheet(names: Sequence[tuple[str, int]], columns: int) -> Image.Image:
    """One frame: cushions in rows on a table, seen from above."""
    rng = np.random.default_rng(7)
    rows = -(-len(names) // columns)
    width, height = columns * PITCH_M, rows * PITCH_M
    x = (np.arange(columns) + 0.5) * PITCH_M - width / 2
    y = height / 2 - (np.arange(rows) + 0.5) * PITCH_M
    places = [(float(x[k % columns]), float(y[k // columns]), 0.0) for k in range(len(names))]
    grey = Material("paint", 0, ((0.2, 0.2, 0.2),) * 3, 0.8, 0.0, 1.0, 0.2)
    surfaces = ("floor", "ceiling", "wall_north", "wall_south", "wall_east", "wall_west")
    distance = 12.0
    pixels = (columns * CELL_PX // 2 * 2, rows * CELL_PX // 2 * 2)
    scene = Scene(
        seed=0,
        variant="full",
        objects=(Object("cushion", 1),) * len(names),
        materials=tuple((material(name, variant, rng),) * 2 for name, variant in names),
        transforms=tuple(Transform(place, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)) for place in places),
        background=Background("room", (14.0, 14.0, 14.0), dict.fromkeys(surfaces, grey)),
        lights=(Light("point", (-4.5, 4.0, 4.5), (0.0, 0.0, -1.0), (170.0, 165.0, 155.0), 0.3, 360.0),),
        ambient=(0.3, 0.32, 0.35),
        cameras=(
            Camera(
                (0.0, -0.01, distance),
                (0.0, 0.0, 0.0),
                (0.0, 1.0, 0.0),
                float(np.degrees(2 * np.arctan(width / 2 / (distance - 0.15)))),
                *pixels,
            ),
        ),
    )
    with Renderer(texture_size=256) as renderer:
        linear = np.clip(renderer.render(scene).radiance, 0, 1)
    return Image.fromarray((255 * linear ** (1 / 2.2)).astype(np.uint8))


def main(arguments: Sequence[str]) -> None:
    if arguments and (arguments[0] != "sheet" or len(arguments) < 2):
        sys.exit(__doc__)
    if arguments:
        families = tuple(arguments[2:]) or material_families()
        pairs = [(family, variant) for family in families for variant in range(MATERIAL_VARIANTS)]
        sheet(pairs, 8).save(arguments[1])
        return
    (DOCS / "materials.md").write_text(guide(), encoding="utf-8")
    pairs = [(family, k % MATERIAL_VARIANTS) for k, family in enumerate(material_families())]
    sheet(pairs, COLUMNS).save(DOCS / "images" / "materials.jpg", quality=84)


if __name__ == "__main__":
    main(sys.argv[1:])
