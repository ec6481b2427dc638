"""What a part is made of, said by its name: one word of PART_KINDS in the part's name, or none.

A part name is words joined by "_": what it is and, where only one sort of matter makes sense, the kind:
"cloth_seat", "glass", "metal_blade", but "legs" (wood, steel, plastic: anything goes). The first word of the
vocabulary decides. A sampler may give a share of such parts the optical property that their kind has; all
else about a material stays random, because variety is what a network learns from. The rule also reads names
that others gave to the materials of mesh files: "Glass_01", "mat.Metal".
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from types import MappingProxyType

PART_KINDS: Mapping[str, str] = MappingProxyType(
    {
        "glass": "clear, walls with both sides modelled: transmission, smooth",
        "liquid": "inside glass, nearly touching it: transmission, smooth",
        "screen": "flat display: emission of a picture, clearcoat",
        "bulb": "source of light: emission",
        "shade": "thin sheet around a bulb: translucency, often lit from inside",
        "leaf": "thin: translucency, some clearcoat",
        "petal": "thin: translucency",
        "paper": "thin, matt, printed or plain: a little translucency",
        "cloth": "woven or knitted: sheen",
        "yarn": "threads, cords, hair, fringe: sheen",
        "leather": "supple: some clearcoat or sheen",
        "metal": "metallic",
        "wood": "often varnished: clearcoat",
        "ceramic": "glazed: clearcoat",
        "plastic": "moulded: clearcoat or plain",
        "rubber": "dark, rough",
        "wax": "candle, soap, cheese: translucency",
        "peel": "skin of fruit and vegetables: clearcoat, a little translucency",
        "stone": "mineral, rough or polished",
        "soil": "loose, rough",
    }
)
"""Vocabulary of part names -> which lobes of `fsid.scene.Material` fit."""


def part_kind(part_name: str) -> str | None:
    """The first word of `part_name` that is in PART_KINDS, in lower case; None where anything fits."""
    return next((word for word in re.findall(r"[a-z]+", part_name.lower()) if word in PART_KINDS), None)
