"""config + seed -> Scene: the paper's I^t = f(S_i^t, M_i^t, T_i^t, B_j^t), one random stream per letter.

    S objects   M materials   T transforms   B background   + lights, camera

The six streams are children of one `SeedSequence`, so switching a property off, or adding a knob to it,
leaves every other property of the same seed as it was. The variants are the paper's v1-v4:

    objects            (v1)  S varies; one plain default material, upright
    materials          (v2)  M varies on one fixed arrangement of objects
    objects-materials  (v3)  S and M vary, upright
    full               (v4)  S, M and T vary: random rotation, scale and placement

Background, lights and camera vary alike in all four.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fsid.assets import Mesh, build_mesh, mesh_families
from fsid.errors import FsidError
from fsid.scene.colour import blackbody_rgb
from fsid.scene.config import SceneConfig
from fsid.scene.materials import PLAIN, log_uniform_rand, material_rand
from fsid.scene.model import Background, Camera, Light, Material, Object, Scene, Vec3
from fsid.scene.placement import arranged, scattered

VARIANTS = ("objects", "materials", "objects-materials", "full")
"""v1 .. v4 of the paper."""

SURFACES = ("floor", "ceiling", "wall_north", "wall_south", "wall_east", "wall_west")
"""Keys of `Background.materials` of a room; +y is north, +x is east."""

_FIXED_SEED = 20
"""Seed of what a variant keeps fixed: the objects of v2 and the slots of v1-v3."""


class Streams(NamedTuple):
    """One independent seed sequence per property of a scene."""

    S: np.random.SeedSequence
    M: np.random.SeedSequence
    T: np.random.SeedSequence
    B: np.random.SeedSequence
    lights: np.random.SeedSequence
    camera: np.random.SeedSequence


def sample(
    config: SceneConfig, seed: int, *, width: int = 1920, height: int = 1080, variant: str = "full"
) -> Scene:
    """The scene of (config, seed, variant) with one camera of width x height pixels.

    seed: >= 0. width, height: even, 16 .. 16384. variant: one of VARIANTS. Raises FsidError.
    """
    _check(seed, width, height, variant)
    streams = _streams(seed)
    fixed = _streams(_FIXED_SEED)
    B, hue_deg = _background_rand(np.random.default_rng(streams.B), config)
    focus = np.array([0.0, 0.0, 0.0])
    camera, focus[2] = _camera_rand(np.random.default_rng(streams.camera), config, B.size_m, width, height)
    lights, ambient = _lights_rand(streams.lights, config, B.size_m, focus)
    S = _objects_rand(fixed.S if variant == "materials" else streams.S, config)
    meshes = [build_mesh(o.family, o.seed) for o in S]
    if variant == "objects":
        M = tuple((PLAIN,) * len(mesh.part_names) for mesh in meshes)
    else:
        M = _materials_rand(streams.M, meshes, config, hue_deg)
    if variant == "full":
        keep_clear = np.array([camera.position_m, *(light.position_m for light in lights)])
        rngs = [np.random.default_rng(s) for s in streams.T.spawn(len(S))]
        T = scattered(rngs, meshes, B.size_m, focus, keep_clear, config)
    else:
        T = arranged(np.random.default_rng(fixed.T), meshes, min(config.spread_m, config.room_width_m[0] / 2))
    return Scene(seed, variant, S, M, tuple(T), B, lights, ambient, (camera,))


def _streams(seed: int) -> Streams:
    return Streams(*np.random.SeedSequence(seed).spawn(len(Streams._fields)))


def _objects_rand(stream: np.random.SeedSequence, config: SceneConfig) -> tuple[Object, ...]:
    rng = np.random.default_rng(stream)
    low, high = config.objects
    families = config.mesh_families or mesh_families()
    count = int(rng.integers(low, high + 1))
    return tuple(Object(str(rng.choice(families)), int(rng.integers(2**31))) for _ in range(count))


def _materials_rand(
    stream: np.random.SeedSequence, meshes: Sequence[Mesh], config: SceneConfig, hue_deg: float
) -> tuple[tuple[Material, ...], ...]:
    """One material per part; one stream per object, so that its number of parts disturbs no other."""
    rngs = [np.random.default_rng(s) for s in stream.spawn(len(meshes))]
    return tuple(
        tuple(material_rand(rng, config, hue_deg) for _ in mesh.part_names)
        for rng, mesh in zip(rngs, meshes, strict=True)
    )


def _background_rand(rng: np.random.Generator, config: SceneConfig) -> tuple[Background, float]:
    """A room and the hue (CIELAB, degrees) that harmonised palettes of this scene keep to."""
    x, y = (float(v) for v in rng.uniform(*config.room_width_m, size=2))
    size_m = (x, y, float(rng.uniform(*config.room_height_m)))
    hue_deg = float(rng.uniform(0, 360))
    return Background(
        "room", size_m, {name: material_rand(rng, config, hue_deg) for name in SURFACES}
    ), hue_deg


def _camera_rand(
    rng: np.random.Generator, config: SceneConfig, room_m: Vec3, width: int, height: int
) -> tuple[Camera, float]:
    """A camera inside the room that looks down at the focus, and the height of the focus in metres."""
    focus = np.array([0.0, 0.0, rng.uniform(0.2, 0.5)])
    distance = log_uniform_rand(rng, config.camera_distance_m)
    direction = _direction(rng.uniform(0, 360), rng.uniform(*config.camera_elevation_deg))
    position = focus + direction * _reach(focus, direction, distance, room_m)
    target = focus + rng.normal(0, 0.12, 3) * np.linalg.norm(position - focus)
    roll = np.radians(rng.normal(0, config.roll_deg))
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    up = np.cos(roll) * np.cross(right, forward) + np.sin(roll) * right
    fov_deg = float(rng.uniform(*config.fov_deg))
    return Camera(_vec3(position), _vec3(target), _vec3(up), fov_deg, width, height), float(focus[2])


def _lights_rand(
    stream: np.random.SeedSequence, config: SceneConfig, room_m: Vec3, focus: np.ndarray
) -> tuple[tuple[Light, ...], Vec3]:
    """Lights that share the irradiance drawn for the focus, and the ambient radiance."""
    scene_stream, *light_streams = stream.spawn(1 + config.lights)
    rng = np.random.default_rng(scene_stream)
    irradiance = log_uniform_rand(rng, config.irradiance)
    ambient = irradiance / np.pi * log_uniform_rand(rng, config.ambient_share)
    tint = blackbody_rgb(log_uniform_rand(rng, config.light_temperature_k))
    shares = rng.dirichlet(np.full(config.lights, 1.5))
    rngs = [np.random.default_rng(s) for s in light_streams]
    lights = [
        _light_rand(r, config, room_m, focus, irradiance * s) for r, s in zip(rngs, shares, strict=True)
    ]
    return tuple(lights), _vec3(ambient * tint)


def _light_rand(
    rng: np.random.Generator, config: SceneConfig, room_m: Vec3, focus: np.ndarray, irradiance: float
) -> Light:
    direction = _direction(rng.uniform(0, 360), rng.uniform(30, 85))
    reach = _reach(focus, direction, rng.uniform(*config.light_distance_m), room_m)
    rgb = blackbody_rgb(log_uniform_rand(rng, config.light_temperature_k))
    filtered = rng.random() < config.tinted_light_share
    tint = rng.uniform(0.15, 1.0, 3)
    if filtered:
        rgb = rgb * tint / (rgb * tint @ (0.2126, 0.7152, 0.0722))
    cone_deg = float(rng.uniform(35, 100))
    aim = -direction + rng.normal(0, np.tan(np.radians(cone_deg / 2)) * 0.3, 3)
    radius_m = log_uniform_rand(rng, config.light_radius_m)
    kind = "spot" if rng.random() < config.spot_share else "point"
    return Light(
        kind=kind,
        position_m=_vec3(focus + direction * reach),
        direction=_vec3(aim / np.linalg.norm(aim)),
        colour=_vec3(rgb * irradiance * reach**2),
        radius_m=min(radius_m, 0.3 * reach),
        cone_deg=cone_deg if kind == "spot" else 360.0,
    )


def _direction(azimuth_deg: float, elevation_deg: float) -> np.ndarray:
    a, e = np.radians((azimuth_deg, elevation_deg))
    return np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])


def _reach(start: np.ndarray, direction: np.ndarray, wanted: float, room_m: Vec3) -> float:
    """`wanted`, shortened so that start + direction * reach stays 0.2 m inside the room."""
    half = np.array(room_m) / (2, 2, 1) - 0.2
    limit = np.where(direction >= 0, half, (-half[0], -half[1], 0.2))
    with np.errstate(divide="ignore"):
        return float(min(wanted, ((limit - start) / direction)[direction != 0].min()))


def _vec3(values: np.ndarray) -> Vec3:
    x, y, z = (float(v) for v in values)
    return (x, y, z)


def _check(seed: int, width: int, height: int, variant: str) -> None:
    if seed < 0:
        raise FsidError(f"seed {seed}: must not be negative")
    for key, value in (("width", width), ("height", height)):
        if not 16 <= value <= 16384 or value % 2:
            raise FsidError(f"{key} {value}: must be an even number of pixels from 16 to 16384")
    if variant not in VARIANTS:
        raise FsidError(f"variant '{variant}' does not exist; choose one of: {', '.join(VARIANTS)}")
