"""config + seed -> Scene: the paper's I^t = f(S_i^t, M_i^t, T_i^t, B_j^t), one random stream per letter.

    S objects   M materials   T transforms   B background   + lights, camera, rig, motion, lens

The streams are children of one `SeedSequence`, so switching a property off, or adding a knob to it,
leaves every other property of the same seed as it was. The variants are the paper's v1-v4:

    objects            (v1)  S varies; one plain default material, upright
    materials          (v2)  M varies on one fixed arrangement of objects
    objects-materials  (v3)  S and M vary, upright
    full               (v4)  S, M and T vary: random rotation, scale and placement

Background, lights and cameras vary alike in all four.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fsid.assets import build_mesh
from fsid.assets.file_names import PREFIX
from fsid.errors import FsidError, check_kind, whole
from fsid.scene.choice import pick_rand
from fsid.scene.colour import Mood
from fsid.scene.config import SceneConfig
from fsid.scene.lens import lens_rand
from fsid.scene.lights import lighting_rand
from fsid.scene.materials import PLAIN, cast_rand, material_rand
from fsid.scene.model import Background, Camera, Material, Object, Scene, Transform
from fsid.scene.placement import arranged, scattered
from fsid.scene.pools import GROWN, NATURE
from fsid.scene.sources import mesh_rand, sky_rand
from fsid.scene.surroundings import Space, background_rand, space_of
from fsid.scene.view import burst_rand, camera_rand, motions_rand, rig_rand

VARIANTS = ("objects", "materials", "objects-materials", "full")
"""v1 .. v4 of the paper."""

_FIXED_SEED = 20
"""Seed of what a variant keeps fixed: the objects of v2 and the slots of v1-v3."""


class Streams(NamedTuple):
    """One independent seed sequence per property of a scene; new ones are added at the end."""

    S: np.random.SeedSequence
    M: np.random.SeedSequence
    T: np.random.SeedSequence
    B: np.random.SeedSequence
    lights: np.random.SeedSequence
    camera: np.random.SeedSequence
    rig: np.random.SeedSequence
    shake: np.random.SeedSequence
    motion: np.random.SeedSequence
    lens: np.random.SeedSequence
    sky: np.random.SeedSequence
    nature: np.random.SeedSequence
    cast: np.random.SeedSequence


def sample(
    config: SceneConfig, seed: int, *, width: int = 1920, height: int = 1080, variant: str = "full"
) -> Scene:
    """The scene of (config, seed, variant), its cameras of width x height pixels.

    seed: >= 0. width, height: even, 16 .. 16384. variant: one of VARIANTS. Raises FsidError.
    """
    check_kind(config, SceneConfig, "SceneConfig(objects=(4, 6)) makes one")
    seed, width, height = whole(seed, "seed"), whole(width, "width"), whole(height, "height")
    _check(seed, width, height, variant)
    streams, fixed = _streams(seed), _streams(_FIXED_SEED)
    B, mood = background_rand(np.random.default_rng(streams.B), config)
    space, outdoors = space_of(B), B.kind == "open-air"
    low, rng = variant != "full", np.random.default_rng(streams.camera)
    view, focus, depth_m = camera_rand(rng, config.camera, B, width, height, low=low)
    cameras = _cameras_rand(streams, config, view, depth_m, B)
    sky_source = sky_rand(np.random.default_rng(streams.sky), config) if outdoors else None
    lighting = lighting_rand(
        streams.lights, config.lights, space, focus, np.array(view.position_m), sky_source
    )
    S = _objects_rand(fixed.S if variant == "materials" else streams.S, config)
    if outdoors and variant != "materials":
        S = _grown_rand(streams.nature, S, config)
    paint = PLAIN if variant == "objects" else cast_rand(np.random.default_rng(streams.cast), config)
    M = _materials_rand(streams.M, S, config, mood, paint=paint, outdoors=outdoors)
    if variant == "full":
        places = [light.position_m for light in lighting.lights if light.kind != "sun"]
        keep_clear = np.array([view.position_m, *(camera.position_m for camera in cameras), *places])
        T = _scattered_rand(streams.T, S, space, focus, keep_clear, config)
    else:
        T = tuple(arranged(np.random.default_rng(fixed.T), S, config.placement.spread_m))
    return Scene(
        seed=seed,
        variant=variant,
        objects=S,
        materials=M,
        transforms=T,
        background=B,
        lights=lighting.lights,
        ambient=lighting.ambient,
        cameras=cameras,
        sky=lighting.sky,
        motions=motions_rand(streams.motion, config.motion, len(S)),
    )


def _streams(seed: int) -> Streams:
    return Streams(*np.random.SeedSequence(seed).spawn(len(Streams._fields)))


def _objects_rand(stream: np.random.SeedSequence, config: SceneConfig) -> tuple[Object, ...]:
    """Objects; some are another one's copies, and copies are copied too, so that heaps of all sizes arise."""
    rng = np.random.default_rng(stream)
    low, high = config.objects
    out: list[Object] = []
    for _ in range(int(rng.integers(low, high + 1))):
        own = Object(mesh_rand(rng, config), int(rng.integers(2**31)))
        repeated, which = rng.random() < config.repeat_share, int(rng.random() * len(out))
        out.append(out[which] if repeated and out else own)
    return tuple(out)


def _grown_rand(
    stream: np.random.SeedSequence, objects: Sequence[Object], config: SceneConfig
) -> tuple[Object, ...]:
    """`objects` with a share of them, and their copies, grown out of doors."""
    out: dict[Object, Object] = {}
    for S, child in zip(objects, stream.spawn(len(objects)), strict=True):
        if S not in out:
            rng = np.random.default_rng(child)
            wild, family = rng.random() < config.nature_share, pick_rand(rng, NATURE)
            known = not config.mesh_families or family in config.mesh_families
            out[S] = Object(family, S.seed) if wild and known and not S.family.startswith(PREFIX) else S
    return tuple(out[S] for S in objects)


def _materials_rand(
    stream: np.random.SeedSequence,
    objects: Sequence[Object],
    config: SceneConfig,
    mood: Mood,
    *,
    paint: Material | None,
    outdoors: bool,
) -> tuple[tuple[Material, ...], ...]:
    """One material per part, alike for copies; one stream per object, so that its number of parts disturbs no
    other. paint: of all of them."""
    out: dict[Object, tuple[Material, ...]] = {}
    for S, child in zip(objects, stream.spawn(len(objects)), strict=True):
        if S not in out:
            names, rng = build_mesh(S.family, S.seed).part_names, np.random.default_rng(child)
            pools = GROWN if outdoors and S.family in NATURE else {}
            out[S] = tuple(paint or material_rand(rng, config, mood, name, pools) for name in names)
    return tuple(out[S] for S in objects)


def _scattered_rand(
    stream: np.random.SeedSequence,
    objects: Sequence[Object],
    space: Space,
    focus_m: np.ndarray,
    keep_clear_m: np.ndarray,
    config: SceneConfig,
) -> tuple[Transform, ...]:
    rngs = [np.random.default_rng(s) for s in stream.spawn(len(objects))]
    return tuple(scattered(rngs, objects, space, focus_m, keep_clear_m, config.placement))


def _cameras_rand(
    streams: Streams, config: SceneConfig, view: Camera, depth_m: float, B: Background
) -> tuple[Camera, ...]:
    """The drawn view through its lens, then all eyes and frames, alike but for where they stand."""
    rngs = (np.random.default_rng(s) for s in (streams.lens, streams.rig, streams.shake))
    lens, rig, shake = rngs
    eyes = rig_rand(rig, config.rig, lens_rand(lens, config.lens, view, depth_m), B)
    return burst_rand(shake, config.motion, eyes)


def _check(seed: int, width: int, height: int, variant: str) -> None:
    if seed < 0:
        raise FsidError(f"seed {seed}: must not be negative")
    for key, value in (("width", width), ("height", height)):
        if not 16 <= value <= 16384 or value % 2:
            raise FsidError(f"{key} {value}: must be an even number of pixels from 16 to 16384")
    if variant not in VARIANTS:
        raise FsidError(f"variant '{variant}' does not exist; choose one of: {', '.join(VARIANTS)}")
