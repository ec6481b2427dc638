"""B: the kind of background, its size, one material per surface, and the space that it leaves free."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fsid.assets import BACKGROUND_PARTS, sweep_radius_m, table_size_m
from fsid.scene.choice import share_rand
from fsid.scene.colour import Mood, mood_rand
from fsid.scene.config import SceneConfig
from fsid.scene.materials import surface_rand
from fsid.scene.model import Background, Vec3

KINDS = ("room", "backdrop", "tabletop", "open-air")
"""The order of `BackgroundConfig.kind_shares`."""

_FIXED_BACKGROUNDS = 7
"""Entropy of the K backgrounds of a config with K > 0: the same for every seed."""
_WITHIN = 0.8
"""Part of the half width of open ground within which things are: they are larger than their centres."""


class Space(NamedTuple):
    """Where things may be. low, high: (3,) corners of the box for cameras, lights and centres of objects.

    ground: (2,) half widths within which the ground is at z = 0. floor_m: height of the floor around it.
    open_air_m: size of a background without walls, where hills rise out of the ground; else None.
    """

    low: np.ndarray
    high: np.ndarray
    ground: np.ndarray
    floor_m: float
    open_air_m: Vec3 | None = None

    def reach(self, start: np.ndarray, direction: np.ndarray, wanted: float, margin: float = 0.0) -> float:
        """`wanted`, shortened so that start + direction * reach stays `margin` inside the box."""
        limit = np.where(direction >= 0, self.high - margin, self.low + margin)
        with np.errstate(divide="ignore"):
            return float(min(wanted, ((limit - start) / direction)[direction != 0].min()))


def background_rand(rng: np.random.Generator, config: SceneConfig) -> tuple[Background, Mood]:
    """A background and the colours that its scene keeps to; one of K if `config.backgrounds` is K > 0."""
    which = int(rng.integers(2**62))
    if config.backgrounds:
        rng = np.random.default_rng((_FIXED_BACKGROUNDS, which % config.backgrounds))
    kind = KINDS[share_rand(rng, config.background.kind_shares)]
    sizes = rng.random(5)
    mood = mood_rand(rng, config.materials.calm_share, config.materials.variation)
    materials = {
        name: surface_rand(child, config, mood, name)
        for child, name in zip(rng.spawn(len(BACKGROUND_PARTS[kind])), BACKGROUND_PARTS[kind], strict=True)
    }
    return Background(kind, _size(kind, sizes, config), materials), mood


def space_of(background: Background) -> Space:
    """The free space of a background, 0.2 m inside its walls and 0.1 m above its ground."""
    x, y, z = background.size_m
    half = np.array((x / 2, y / 2))
    if background.kind == "open-air":
        edge = np.minimum(_WITHIN * half, 50.0)
        return Space(np.array((*-edge, 0.1)), np.array((*edge, 50.0)), half, 0.0, background.size_m)
    low, high = (
        np.array((0.2 - half[0], 0.2 - half[1], 0.1)),
        np.array((half[0] - 0.2, half[1] - 0.2, z - 0.2)),
    )
    if background.kind == "tabletop":
        high[2] -= 0.75
        return Space(low, high, np.array(table_size_m(background.size_m)) / 2, -0.75)
    if background.kind == "backdrop":
        high[1] -= sweep_radius_m(background.size_m)
    return Space(low, high, half, 0.0)


def _size(kind: str, sizes: np.ndarray, config: SceneConfig) -> tuple[float, float, float]:
    """Width, depth, height from uniform numbers; all are drawn whatever the kind."""
    knobs = config.background
    if kind == "open-air":
        width = float(np.exp(np.interp(sizes[3], (0, 1), np.log(knobs.ground_m))))
        return (width, width, float(np.interp(sizes[4], (0, 1), knobs.hills_m)))
    x, y = (float(np.interp(s, (0, 1), knobs.width_m)) for s in sizes[:2])
    return (x, y, float(np.interp(sizes[2], (0, 1), knobs.height_m)))
