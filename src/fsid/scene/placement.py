"""T: where objects stand. Two arrangements of one list of meshes around the origin of the ground.

    arranged   variants v1-v3: upright in slots that depend on no seed, tops below z = 0.19 m + 0.32 rho
    scattered  variant v4: random rotation (20 angles per axis, or for a share upright), scale and place, at
               rest or floating

Density matters more than order: objects may touch and overlap, but none may swallow a camera or a light.
`arranged` guarantees that by its funnel shape (cameras and lights start at 20 degrees above the focus, or
outside of it), `scattered` by shrinking whatever comes too near; neither draws a random number for it, so the
streams of the camera and of the lights are the same whatever the objects do.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fsid.assets import build_mesh
from fsid.assets.solids import rotation_matrix
from fsid.scene.choice import log_uniform_rand, power_law_rand
from fsid.scene.config import PlacementConfig
from fsid.scene.model import Object, Transform
from fsid.scene.relief import Relief, surface_points
from fsid.scene.surroundings import Space
from fsid.scene.vectors import vec3

ARRANGED_M = 0.85
"""Radius of the slots of v1-v3; their objects end at 1.2 m."""

_CANDIDATES = 6
_CLEARANCE = 0.75
"""An object's bounding sphere stays smaller than this part of its distance to a camera or light."""
_PILE_LIMIT_M = 0.6
"""Things come to rest on others whose top is lower than this."""
_FAR_ANGLE = 0.7
"""Radians to either side of the camera's direction within which the far objects lie."""
_BESIDE = 0.75
"""Copies of what is large and far lie within this part of its distance from the focus."""
_SINK = 0.01
"""Part of its size by which a resting object sinks in: contact has no gap."""


def arranged(rng: np.random.Generator, objects: Sequence[Object], spread_m: float) -> list[Transform]:
    """Upright objects, uniformly scaled to fit slots on a sunflower spiral, low at the focus.

    rng: a generator that is the same for every scene.
    """
    out = []
    for i, S in enumerate(objects):
        rho = min(spread_m, ARRANGED_M) * np.sqrt((i + 0.3) / len(objects))
        angle = 2.399963 * i
        width = (0.3 + 0.3 * rho) * rng.uniform(0.8, 1.25)
        turn_deg = 90.0 * int(rng.integers(4))
        extent = np.ptp(build_mesh(S.family, S.seed).vertices, axis=0)
        height = 0.19 + 0.32 * max(rho - width / 2, 0.0)
        scale = float(min(width / extent[:2].max(), height / extent[2]))
        place = (float(rho * np.cos(angle)), float(rho * np.sin(angle)), 0.0)
        out.append(Transform(place, (0.0, 0.0, turn_deg), (scale, scale, scale)))
    return out


class _Draw(NamedTuple):
    """What one object's generator says, before the object meets the others."""

    turn_deg: np.ndarray
    size_m: float
    stretch: np.ndarray
    floating: bool
    spots: np.ndarray
    likeness: float


def scattered(
    rngs: Sequence[np.random.Generator],
    objects: Sequence[Object],
    space: Space,
    focus_m: np.ndarray,
    keep_clear_m: np.ndarray,
    config: PlacementConfig,
) -> list[Transform]:
    """Random transforms, one generator per object so that no object disturbs the draws of the next.

    focus_m: (3,). keep_clear_m: (P, 3), a camera first, then the other cameras and lights.
    """
    out: list[Transform] = []
    spheres: list[tuple[np.ndarray, float]] = []
    relief = Relief(space)
    first: dict[Object, tuple[np.ndarray, float]] = {}
    for rng, S in zip(rngs, objects, strict=True):
        draw = _draw_rand(rng, space, focus_m, focus_m - keep_clear_m[0], config)
        if S in first:
            draw = _beside(draw, *first[S], focus_m, space, config)
        points = surface_points(S.family, S.seed)
        shape = draw.stretch * draw.size_m / (np.ptp(points, axis=1) * draw.stretch).max()
        crowding = _crowding(draw.spots, draw.size_m, spheres, keep_clear_m[0], focus_m)
        spot = draw.spots[int(crowding.argmin())]
        turned = (rotation_matrix(*draw.turn_deg) * shape).astype(np.float32) @ points
        offset, shrink = _placed(turned, spot, draw.floating, relief, keep_clear_m)
        world = turned * np.float32(shrink) + offset[:, None].astype(np.float32)
        if not draw.floating:
            relief.add(world)
        spheres.append((world.mean(1), float(np.ptp(world, axis=1).max())))
        first.setdefault(S, spheres[-1])
        out.append(Transform(vec3(offset), vec3(draw.turn_deg), vec3(shape * shrink)))
    return out


def _draw_rand(
    rng: np.random.Generator, space: Space, focus_m: np.ndarray, ahead: np.ndarray, config: PlacementConfig
) -> _Draw:
    """ahead: (3,) from the camera to the focus; what is far lies behind the rest as seen from there."""
    turn_deg = rng.integers(config.rotation_steps, size=3) * (360.0 / config.rotation_steps)
    size_m = power_law_rand(rng, config.size_m, config.size_exponent)
    stretch = np.array([log_uniform_rand(rng, config.stretch) for _ in range(3)])
    floating, far = rng.random(2) < (config.floating_share, config.far_share)
    distance = log_uniform_rand(rng, (config.spread_m, config.spread_m * config.far_factor))
    rho = config.spread_m * rng.random(_CANDIDATES)
    phi = rng.uniform(0, 2 * np.pi, _CANDIDATES)
    z = focus_m[2] + rng.normal(0.15, 0.4, _CANDIDATES)
    if far:
        phi = np.arctan2(ahead[1], ahead[0]) + _FAR_ANGLE * (phi / np.pi - 1)
        ways = np.stack([np.cos(phi), np.sin(phi), np.zeros(_CANDIDATES)], axis=1)
        wanted = rho * 0.5 + distance
        rho = np.array([space.reach(focus_m, way, far_m) for way, far_m in zip(ways, wanted, strict=True)])
        scale = max(float(np.median(rho)) / config.spread_m, 1.0)
        size_m, z = size_m * scale, focus_m[2] + (z - focus_m[2]) * scale
    spots = np.c_[focus_m[0] + rho * np.cos(phi), focus_m[1] + rho * np.sin(phi), z]
    if rng.random() < config.upright_share and not floating:
        turn_deg[:2] = 0.0
    spots, likeness = np.clip(spots, space.low, space.high), log_uniform_rand(rng, config.stretch)
    return _Draw(turn_deg, size_m, stretch, bool(floating), spots, likeness)


def _beside(
    draw: _Draw,
    place_m: np.ndarray,
    size_m: float,
    focus_m: np.ndarray,
    space: Space,
    config: PlacementConfig,
) -> _Draw:
    """The draw of a copy: nearly as large as the first of its kind at `place_m`, up to three sizes from it.

    But no farther than was drawn or than a part of its distance, so that what is large and far stays far.
    """
    drawn = draw.spots - focus_m
    drawn_m = np.linalg.norm(drawn, axis=1, keepdims=True)
    room_m = np.maximum(drawn_m, _BESIDE * np.linalg.norm(place_m - focus_m))
    away = drawn * np.minimum(3 * size_m / config.spread_m, room_m / drawn_m)
    spots = np.clip(place_m + away, space.low, space.high)
    return draw._replace(size_m=size_m * draw.likeness, spots=spots)


def _crowding(
    spots: np.ndarray,
    size_m: float,
    spheres: Sequence[tuple[np.ndarray, float]],
    camera_m: np.ndarray,
    focus_m: np.ndarray,
) -> np.ndarray:
    """(K,) how bad spots (K, 3) are: overlap with what is there, and blocking the view at close range."""
    to_focus = focus_m - camera_m
    distance = np.sqrt(to_focus @ to_focus)
    offsets = spots - camera_m
    ahead = offsets @ to_focus / distance
    aside = np.sqrt(np.maximum((offsets**2).sum(1) - ahead**2, 0.0))
    blocked = (ahead > 0) & (ahead < 0.6 * distance + size_m / 2) & (aside < 0.5 * ahead + size_m / 2)
    if not spheres:
        return 10.0 * blocked
    centres = np.array([centre[:2] for centre, _ in spheres])
    gaps = np.sqrt(((spots[:, None, :2] - centres) ** 2).sum(2))
    reach = (size_m + np.array([width for _, width in spheres])) * 0.4
    return np.maximum(0.0, 1 - gaps / reach).sum(1) + 10.0 * blocked


def _placed(
    turned: np.ndarray, spot: np.ndarray, floating: bool, relief: Relief, keep_clear_m: np.ndarray
) -> tuple[np.ndarray, float]:
    """Where an object of points (3, P) goes, (3,) metres, and how much it had to shrink to keep clear."""
    low, high = turned.min(1), turned.max(1)
    middle, radius = (low + high) / 2, float(np.linalg.norm(high - low) / 2)
    offset, shrink = spot, 1.0
    for _ in range(40):
        offset = spot - middle * shrink
        if floating:
            offset[2] = max(offset[2], -shrink * float(low[2]))
        else:
            lift_m = relief.rest_m(turned * np.float32(shrink), offset[:2], _PILE_LIMIT_M)
            offset[2] = lift_m - _SINK * 2 * radius * shrink
        offset[2] += relief.hill_m(turned * np.float32(shrink), offset[:2])
        gaps = np.linalg.norm(keep_clear_m - (middle * shrink + offset), axis=1)
        if (gaps * _CLEARANCE >= radius * shrink).all():
            break
        shrink *= 0.85
    return offset, shrink
