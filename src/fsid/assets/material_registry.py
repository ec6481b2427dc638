"""The registry of material families: name and variant -> tileable maps.

A family is one small function that registers itself by decorator; the modules of `assets/materials` are
found by walking the package, so adding a family touches one file:

    @material_family("brick", tile_m=1.0, relief_m=0.012, colours="a4553f c98a6b b9b2a6")
    def brick(rng, variant, size): return Layers(...)

Other names that work everywhere: "file:PATH" is a texture set (`fsid.assets.textures`), and "NAME+dust" is
any of these under a layer of dust (`material_layers()`); layers can follow each other.

Everything is a function of (name, variant, size) alone: the same scene gives the same texels in every
process. Bakes are kept on disk by `fsid.assets.bake_cache`; what a family draws with must come from the
modules of SHARED, because their sources are part of its key there.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from fsid.assets.bake_cache import cached, code_key, content_key
from fsid.assets.file_names import PREFIX
from fsid.assets.maps import MaterialMaps
from fsid.assets.streams import rng_of
from fsid.assets.textures import TILE_M, bake_texture, texture_key
from fsid.assets.triangle import PICTURE, Triple, encode, hex_colours, srgb_to_linear
from fsid.errors import FsidError

MATERIAL_VARIANTS = 4
"""Bakes per material family; few, so that a renderer can keep all of them."""

SHARED = tuple(
    f"fsid.assets.{name}"
    for name in (
        "bake_cache",
        "maps",
        "material_registry",
        "patterns",
        "pictures",
        "streams",
        "triangle",
        "typeset",
    )
)
"""What the modules of families may import from FSID, and what is in the key of every bake."""

Field = np.ndarray | float


class Layers(NamedTuple):
    """What a material family returns: the maps of `fsid.assets.maps`, (S, S) arrays or constants."""

    mix: Field = 0.0
    pattern: Field = 0.0
    detail: Field = 0.5
    roughness: Field = 0.5
    height: Field = 0.5
    metallic: Field = 0.0


LayerFamily = Callable[[np.random.Generator, int, int], Layers]
Overlay = Callable[[np.random.Generator, int, MaterialMaps], MaterialMaps]


@dataclass(frozen=True)
class _Material:
    draw: LayerFamily
    tile_m: float
    relief_m: float
    colours: tuple[Triple, ...]


_MATERIALS: dict[str, _Material] = {}
_OVERLAYS: dict[str, Overlay] = {}


def material_family(
    name: str, *, tile_m: float, relief_m: float, colours: str | tuple[str, ...] = ()
) -> Callable[[LayerFamily], LayerFamily]:
    """Register `function(rng, variant, size) -> Layers` under `name`.

    tile_m: natural width of one tile. relief_m: height range that `height` 0..1 spans on such a tile.
    colours: three sRGB colours that colour_a, colour_b, colour_c have in nature, "b07a4a d7b58a 3b2a1e"; one
    such text for all variants, one per variant, or none where any colours will do. "picture": the wide
    triangle of `pictured`, for families that draw in full colour.
    """
    texts = (colours,) * MATERIAL_VARIANTS if isinstance(colours, str) else colours
    triples = tuple(PICTURE if text == "picture" else hex_colours(text) for text in texts)
    assert len(triples) in (0, MATERIAL_VARIANTS), name
    assert all(len(triple) == 3 for triple in triples), name

    def register(function: LayerFamily) -> LayerFamily:
        assert name not in _MATERIALS, f"material family {name} is registered twice"
        _MATERIALS[name] = _Material(function, tile_m, relief_m, triples)
        return function

    return register


def pictured(encoded: np.ndarray) -> Layers:
    """The masks of a picture (S, S, 3), sRGB 0..1, in a family whose colours are "picture"."""
    mix, pattern, detail = encode(srgb_to_linear(encoded), PICTURE)
    return Layers(mix, pattern, detail)


def material_layer(name: str) -> Callable[[Overlay], Overlay]:
    """Register `function(rng, variant, maps) -> maps`, a layer over any material, under `name`."""

    def register(function: Overlay) -> Overlay:
        assert name not in _OVERLAYS, f"material layer {name} is registered twice"
        _OVERLAYS[name] = function
        return function

    return register


def material_families() -> tuple[str, ...]:
    """Names of all material families, sorted."""
    _discover()
    return tuple(sorted(_MATERIALS))


def material_summary(name: str) -> str:
    """What a family or a layer is: the first line of its docstring, without the full stop."""
    _discover()
    function = _OVERLAYS[name] if name in _OVERLAYS else _material(name).draw
    return (function.__doc__ or "").strip().splitlines()[0].rstrip(".")


def material_layers() -> tuple[str, ...]:
    """Names of all layers, sorted: "FAMILY+LAYER" is the family under that layer."""
    _discover()
    return tuple(sorted(_OVERLAYS))


def material_tile_m(family: str) -> float:
    """Natural width in metres of one tile of a material, known without baking it."""
    base, _ = _split(family)
    return TILE_M if base.startswith(PREFIX) else _material(base).tile_m


def material_colours(family: str, variant: int) -> Triple | None:
    """What colour_a, colour_b, colour_c are in nature, linear; None where any colours will do.

    Those of a texture set make its picture; they may exceed 1 where the product with the masks does not.
    """
    base, _ = _split(family)
    if base.startswith(PREFIX):
        return bake_texture(base, 64).colours
    colours = _material(base).colours
    return colours[variant % MATERIAL_VARIANTS] if colours else None


def bake_material(family: str, variant: int, size: int = 1024) -> MaterialMaps:
    """The tileable maps of (family, variant) at `size` x `size` texels, from the cache where they are.

    family: a name of `material_families()` or "file:PATH", with any "+LAYER" behind it. variant:
    0 .. MATERIAL_VARIANTS - 1; a texture set has but one, whatever the number. size: a power of two from 64
    to 8192. Raises FsidError.
    """
    _check(family, variant, size)
    base, layers = _split(family)
    if base.startswith(PREFIX) and not layers:
        return bake_texture(base, size)
    name, key = material_key(family, variant, size)
    return cached(name, key, size, lambda: draw_material(family, variant, size))


def material_key(family: str, variant: int, size: int) -> tuple[str, str]:
    """A readable name of a bake, and the key of all that it depends on but its size. Raises FsidError."""
    _check(family, variant, size)
    base, layers = _split(family)
    modules = tuple(_OVERLAYS[layer].__module__ for layer in layers)
    if base.startswith(PREFIX):
        key = content_key([texture_key(base).encode(), code_key((*modules, *SHARED)).encode()])
        name = "file"
    else:
        key = code_key((_material(base).draw.__module__, *modules, *SHARED))
        name = base
    label = "+".join((name, *layers))
    return f"{label}-{variant}", key


def draw_material(family: str, variant: int, size: int) -> MaterialMaps:
    """What `bake_material` keeps: the functions of a family and its layers called, before any rounding."""
    base, layers = _split(family)
    if base.startswith(PREFIX):
        maps = bake_texture(base, size)
    else:
        material = _material(base)
        fields = material.draw(rng_of(base, variant), variant, size)._asdict()
        finished: dict[str, Any] = {name: _finished(field, size) for name, field in fields.items()}
        colours = material_colours(base, variant)
        maps = MaterialMaps(**finished, relief_m=material.relief_m, tile_m=material.tile_m, colours=colours)
    for number, layer in enumerate(layers):
        maps = _OVERLAYS[layer](rng_of(f"{layer}{number}", variant), variant, maps)
    return maps


def _check(family: str, variant: int, size: int) -> None:
    if variant not in range(MATERIAL_VARIANTS):
        raise FsidError(f"material variant {variant} of '{family}': must be 0 .. {MATERIAL_VARIANTS - 1}")
    if not 64 <= size <= 8192 or size & (size - 1):
        raise FsidError(f"material size {size}: must be a power of two from 64 to 8192")


def _split(family: str) -> tuple[str, tuple[str, ...]]:
    """The material and the layers over it; a "+" in a path is part of the path."""
    _discover()
    parts = family.split("+")
    layers: list[str] = []
    while len(parts) > 1 and parts[-1] in _OVERLAYS:
        layers.insert(0, parts.pop())
    return "+".join(parts), tuple(layers)


def _finished(field: Field, size: int) -> np.ndarray:
    return np.clip(np.broadcast_to(np.asarray(field, np.float32), (size, size)), 0.0, 1.0)


def _material(family: str) -> _Material:
    if family not in _MATERIALS:
        raise FsidError(
            f"material family '{family}' does not exist; choose one of: {', '.join(material_families())}"
        )
    return _MATERIALS[family]


@cache
def _discover() -> None:
    """Import every module of the package of families, which fills the registry."""
    package = importlib.import_module("fsid.assets.materials")
    for module in pkgutil.iter_modules(package.__path__, package.__name__ + "."):
        importlib.import_module(module.name)
