"""T: where objects stand. Two arrangements of one list of meshes around the origin of the floor.

    arranged   variants v1-v3: upright in slots that depend on no seed, tops below z = 0.19 m + 0.32 rho
    scattered  variant v4: random rotation (20 angles per axis), scale and place, at rest or floating

Density matters more than order: objects may touch and overlap, but none may swallow the camera or a
light. `arranged` guarantees that by its funnel shape (cameras and lights start at 20 degrees above the
focus), `scattered` by shrinking whatever comes too near; neither draws a random number for it, so the
streams of the camera and of the lights are the same whatever the objects do.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fsid.assets import Mesh
from fsid.assets.solids import rotation_matrix
from fsid.scene.config import SceneConfig
from fsid.scene.materials import log_uniform_rand
from fsid.scene.model import Transform, Vec3

_CANDIDATES = 6
_CLEARANCE = 0.75
"""An object's bounding sphere stays smaller than this part of its distance to a camera or light."""
_PILE_LIMIT_M = 0.5
"""Things come to rest on others whose top is lower than this."""


def arranged(rng: np.random.Generator, meshes: Sequence[Mesh], spread_m: float) -> list[Transform]:
    """Upright objects, uniformly scaled to fit slots on a sunflower spiral, low at the focus.

    rng: a generator that is the same for every scene.
    """
    out = []
    for i, mesh in enumerate(meshes):
        rho = spread_m * np.sqrt((i + 0.3) / len(meshes))
        angle = 2.399963 * i
        width = (0.3 + 0.3 * rho) * rng.uniform(0.8, 1.25)
        turn_deg = 90.0 * int(rng.integers(4))
        extent = np.ptp(mesh.vertices, axis=0)
        height = 0.19 + 0.32 * max(rho - width / 2, 0.0)
        scale = float(min(width / extent[:2].max(), height / extent[2]))
        place = (float(rho * np.cos(angle)), float(rho * np.sin(angle)), 0.0)
        out.append(Transform(place, (0.0, 0.0, turn_deg), (scale, scale, scale)))
    return out


def scattered(
    rngs: Sequence[np.random.Generator],
    meshes: Sequence[Mesh],
    room_m: Vec3,
    focus_m: np.ndarray,
    keep_clear_m: np.ndarray,
    config: SceneConfig,
) -> list[Transform]:
    """Random transforms, one generator per object so that no object disturbs the draws of the next.

    room_m: width, depth, height. focus_m: (3,). keep_clear_m: (P, 3), the camera first, then the lights.
    """
    out: list[Transform] = []
    boxes: list[np.ndarray] = []
    for rng, mesh in zip(rngs, meshes, strict=True):
        turn = rng.integers(config.rotation_steps, size=3) * (360.0 / config.rotation_steps)
        size_m = log_uniform_rand(rng, config.object_size_m)
        shape = np.array([log_uniform_rand(rng, config.stretch) for _ in range(3)])
        shape *= size_m / (np.ptp(mesh.vertices, axis=0) * shape).max()
        floating = rng.random() < config.floating_share
        spots = _spots_rand(rng, room_m, focus_m, config.spread_m)
        spot = min(spots, key=lambda s: _crowding(s, size_m, boxes, keep_clear_m[0], focus_m))
        box = _rotated_box(mesh, shape, turn)
        for _ in range(40):
            offset = _offset(box, spot, boxes, floating)
            if _is_clear(box + offset, keep_clear_m):
                break
            box, shape = box * 0.85, shape * 0.85
        boxes.append(box + offset)
        out.append(Transform(_vec3(offset), _vec3(turn), _vec3(shape)))
    return out


def _spots_rand(rng: np.random.Generator, room_m: Vec3, focus_m: np.ndarray, spread_m: float) -> np.ndarray:
    """(K, 3) candidate centres, denser towards the focus, inside the room."""
    rho = spread_m * rng.random(_CANDIDATES)
    phi = rng.uniform(0, 2 * np.pi, _CANDIDATES)
    z = focus_m[2] + rng.normal(0.15, 0.4, _CANDIDATES)
    spots = np.c_[focus_m[0] + rho * np.cos(phi), focus_m[1] + rho * np.sin(phi), z]
    half = np.array(room_m) / (2, 2, 1) - 0.1
    return np.clip(spots, (-half[0], -half[1], 0.1), half)


def _crowding(
    spot: np.ndarray, size_m: float, boxes: Sequence[np.ndarray], camera_m: np.ndarray, focus_m: np.ndarray
) -> float:
    """How bad a spot is: overlap with what is there, and blocking the view at close range."""
    to_focus = focus_m - camera_m
    distance = np.linalg.norm(to_focus)
    offset = spot - camera_m
    ahead = offset @ to_focus / distance
    aside = np.linalg.norm(offset - to_focus * (ahead / distance))
    blocked = 0 < ahead < 0.6 * distance + size_m / 2 and aside < 0.5 * ahead + size_m / 2
    overlap = 0.0
    for box in boxes:
        reach = (size_m + np.ptp(box, axis=0).max()) * 0.4
        overlap += max(0.0, 1 - float(np.linalg.norm(spot[:2] - box.mean(0)[:2])) / reach)
    return overlap + 10.0 * blocked


def _rotated_box(mesh: Mesh, scale: np.ndarray, turn_deg: np.ndarray) -> np.ndarray:
    """(2, 3) lowest and highest corner of the scaled and rotated mesh about its own origin."""
    vertices = (mesh.vertices * scale) @ rotation_matrix(*turn_deg).T
    return np.stack([vertices.min(0), vertices.max(0)])


def _offset(box: np.ndarray, spot: np.ndarray, boxes: Sequence[np.ndarray], floating: bool) -> np.ndarray:
    """(3,) translation that centres the box at the spot, or lets it rest below the spot."""
    offset = spot - box.mean(0)
    core = box[:, :2].mean(0) + 0.5 * (box[:, :2] - box[:, :2].mean(0)) + offset[:2]
    under = [b[1, 2] for b in boxes if (b[0, :2] < core[1]).all() and (b[1, :2] > core[0]).all()]
    support = max((top for top in under if top < _PILE_LIMIT_M), default=0.0)
    lowest = -box[0, 2]
    offset[2] = max(offset[2], lowest) if floating else support + lowest
    return offset


def _is_clear(box: np.ndarray, points: np.ndarray) -> bool:
    """Whether the bounding sphere of the box keeps its distance from every point."""
    radius = np.linalg.norm(np.ptp(box, axis=0)) / 2
    return bool((np.linalg.norm(points - box.mean(0), axis=1) * _CLEARANCE >= radius).all())


def _vec3(values: np.ndarray) -> Vec3:
    x, y, z = (float(v) for v in values)
    return (x, y, z)
