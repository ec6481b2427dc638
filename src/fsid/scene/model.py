"""The scene as pure data: the paper's I^t = f(S_i^t, M_i^t, T_i^t, B_j^t), plus lights and cameras.

Object i is `objects[i]` (S), `materials[i]` (M, one per named part of its mesh) and `transforms[i]` (T);
`background` is B. Nothing here holds pixels or vertices: a mesh is (family, seed), a material is
(family, variant, colours), so a scene is a few kilobytes of JSON that any machine renders alike.
World: right-handed, z up, metres. Colours are linear sRGB primaries (D65), not gamma encoded.
"""

from __future__ import annotations

from dataclasses import dataclass

Vec3 = tuple[float, float, float]


@dataclass(frozen=True)
class Object:
    """S: a mesh by name. `fsid.assets.build_mesh(family, seed)` makes the geometry."""

    family: str
    seed: int


@dataclass(frozen=True)
class Material:
    """M: a baked family recoloured. `fsid.assets.bake_material(family, variant)` makes the maps.

    colours: colour_a, colour_b, colour_c of `fsid.assets.maps`, linear, 0..1.
    tile_m: edge of one texture tile in metres. rotation_deg: of the tile in the surface.
    roughness_scale multiplies the roughness map. relief_scale multiplies the family's relief.
    """

    family: str
    variant: int
    colours: tuple[Vec3, Vec3, Vec3]
    tile_m: float
    rotation_deg: float
    roughness_scale: float
    relief_scale: float


@dataclass(frozen=True)
class Transform:
    """T: x_world = rotation(x_object * scale) + position; rotation = Rz(c) Ry(b) Rx(a), degrees."""

    position_m: Vec3
    rotation_deg: Vec3
    scale: Vec3


@dataclass(frozen=True)
class Background:
    """B: a closed box room, 0 <= z <= height, centred on the origin; one material per named surface."""

    kind: str
    size_m: Vec3
    materials: dict[str, Material]


@dataclass(frozen=True)
class Light:
    """kind "point" or "spot": radiant intensity `colour` (linear RGB, radiance units x m^2), E = I cos / r^2.

    radius_m: of the emitting sphere (softness of the shadow). cone_deg: full outer angle, spot only.
    """

    kind: str
    position_m: Vec3
    direction: Vec3
    colour: Vec3
    radius_m: float
    cone_deg: float


@dataclass(frozen=True)
class Camera:
    """Pinhole camera. fov_deg: horizontal field of view. Width and height in pixels, both even."""

    position_m: Vec3
    target_m: Vec3
    up: Vec3
    fov_deg: float
    width: int
    height: int


@dataclass(frozen=True)
class Scene:
    """Everything a renderer needs. `ambient` is the radiance of the unlit surroundings, linear RGB."""

    seed: int
    variant: str
    objects: tuple[Object, ...]
    materials: tuple[tuple[Material, ...], ...]
    transforms: tuple[Transform, ...]
    background: Background
    lights: tuple[Light, ...]
    ambient: Vec3
    cameras: tuple[Camera, ...]
