"""Which material families suit which surface of a background: floors are planks, walls are plaster ...

A pool only tilts the odds (`BackgroundConfig.pool_share`): the rest is drawn from all families, because a
denoiser should see every texture in every place.
"""

from __future__ import annotations

_FLOOR = ("parquet", "wood_planks", "tiles", "carpet", "concrete", "terrazzo", "marble", "granite", "weave")
_WALL = ("plaster", "wallpaper", "brick", "concrete", "wood_planks", "tiles", "stripes", "paint")
_CEILING = ("plaster", "paint", "wood_planks", "concrete")
_TABLE = ("wood_grain", "wood_planks", "marble", "granite", "plastic", "leather", "scratched_metal")
_SWEEP = ("paint", "plaster", "weave", "knit", "leather", "fur", "carpet", "plastic")
_GROUND = (
    "grass",
    "gravel",
    "sand",
    "dead_leaves",
    "leaves",
    "concrete",
    "brick",
    "tiles",
    "granite",
    "bark",
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
