"""Which families suit which place: floors are planks, walls are plaster, and out of doors things have grown.

A pool only tilts the odds (`BackgroundConfig.pool_share`, `SceneConfig.nature_share`): the rest is drawn from
all families, because a denoiser should see every texture in every place.
"""

from __future__ import annotations

_FLOOR = (
    *("parquet", "wood_planks", "tiles", "carpet", "concrete", "terrazzo", "marble", "granite", "slate"),
    *("bamboo", "cork", "travertine", "checker_plate", "straw", "weave"),
)
_WALL = (
    *("plaster", "wallpaper", "brick", "concrete", "wood_planks", "tiles", "stripes", "paint", "ashlar"),
    *("peeling_paint", "sandstone", "bamboo", "cork", "gradient", "mosaic_picture", "shingles"),
)
_CEILING = ("plaster", "paint", "wood_planks", "concrete", "plywood", "foam")
_TABLE = (
    *("wood_grain", "wood_planks", "marble", "granite", "plastic", "leather", "scratched_metal", "plywood"),
    *("chipboard", "burl", "end_grain", "slate", "travertine", "glossy_plastic", "bamboo", "felt"),
)
_SWEEP = (
    *("paint", "plaster", "weave", "knit", "leather", "fur", "carpet", "plastic", "gradient", "paper"),
    *("felt", "velour", "satin", "suede", "denim", "blurred_scene", "bokeh"),
)
_GROUND = (
    *("grass", "gravel", "sand", "dead_leaves", "leaves", "concrete", "brick", "tiles", "granite"),
    *("asphalt", "cobblestones", "moss", "soil", "snow", "straw", "sandstone", "slate", "foliage"),
)

NATURE = (
    *("bush", "branch", "tuft", "stones", "flower", "rosette", "fallen_leaves", "logs", "mushrooms"),
    *("pine_cones", "potted_plant", "cactus", "seashells"),
)
"""Mesh families that are common out of doors, all alike."""

GROWN: dict[str, tuple[str, ...]] = {
    "leaf": ("leaves", "moss", "grass", "foliage", "dead_leaves"),
    "petal": ("flowers", "gradient", "satin"),
    "wood": ("bark",),
    "stone": ("granite", "sandstone", "slate", "moss", "concrete"),
    "soil": ("soil", "gravel", "dead_leaves"),
}
"""Kind of an object's part (`fsid.assets.PART_KINDS`) -> material families that are common out of doors."""

POOLS: dict[str, tuple[str, ...]] = {
    "floor": _FLOOR,
    "ceiling": _CEILING,
    **dict.fromkeys(("wall_north", "wall_south", "wall_east", "wall_west"), _WALL),
    "table": _TABLE,
    "sweep": _SWEEP,
    "ground": _GROUND,
}
"""Part of a background -> families that are common there."""

_UNORDERED = """
    asphalt bread carpet cast_metal concrete copper_patina coral cork dead_leaves felt flowers foam
    foliage fur galvanised grains granite grass gravel leaves marble moss peeling_paint plaster
    plywood rusty_metal sand sandstone scratched_metal skin snow soil straw suede terrazzo terry
    velour water
"""
WITHOUT_ORDER = frozenset(_UNORDERED.split())
"""Material families that backgrounds show without repetition (`Material.patched`)."""

OFTEN_PLAIN = frozenset({"ceiling", "wall_north", "wall_south", "wall_east", "wall_west", "sweep"})
"""Parts that `BackgroundConfig.plain_share` speaks of."""
