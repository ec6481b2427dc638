"""Which material families suit which surface of a background: floors are planks, walls are plaster ...

A pool only tilts the odds (`BackgroundConfig.pool_share`): the rest is drawn from all families, because a
denoiser should see every texture in every place.
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

POOLS: dict[str, tuple[str, ...]] = {
    "floor": _FLOOR,
    "ceiling": _CEILING,
    **dict.fromkeys(("wall_north", "wall_south", "wall_east", "wall_west"), _WALL),
    "table": _TABLE,
    "sweep": _SWEEP,
    "ground": _GROUND,
}
"""Part of a background -> families that are common there."""

OFTEN_PLAIN = frozenset({"ceiling", "wall_north", "wall_south", "wall_east", "wall_west", "sweep"})
"""Parts that `BackgroundConfig.plain_share` speaks of."""
