"""What a scene may contain: every knob of the sampler with its unit, default and limits.

A pair is (lowest, highest); a draw is uniform between them, or log-uniform where the comment says so.
The defaults give close, densely filled, texture-rich views, because a denoiser is trained on patches.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from fsid.assets import material_families, mesh_families
from fsid.errors import FsidError

Range = tuple[float, float]


@dataclass(frozen=True)
class SceneConfig:
    """Settings of `fsid.scene.sample`. Raises FsidError that names the key of a value out of its limits."""

    objects: tuple[int, int] = (25, 45)
    """N, number of objects, both ends included."""
    object_size_m: Range = (0.18, 0.9)
    """Largest side of an object after scaling (variant full); log-uniform."""
    spread_m: float = 1.1
    """Objects lie within this distance of the focus."""
    floating_share: float = 0.35
    """Share of objects in the air instead of at rest on the floor or on each other (variant full)."""
    rotation_steps: int = 20
    """Number of equally spaced rotation angles per axis (variant full); 20 in the paper."""
    stretch: Range = (0.8, 1.25)
    """Extra scale per axis (variant full); log-uniform."""
    mesh_families: tuple[str, ...] = ()
    """Mesh families to draw from; empty = all."""

    material_families: tuple[str, ...] = ()
    """Material families to draw from; empty = all."""
    plain_share: float = 0.08
    """Share of surfaces in plain paint: homogeneous areas exist in reality too."""
    tile_scale: Range = (0.5, 1.6)
    """Texture tile width relative to the natural width of its family; log-uniform."""
    roughness_scale: Range = (0.5, 1.4)
    """Factor on the roughness maps."""
    relief_scale: Range = (0.3, 1.5)
    """Factor on the relief of the height maps."""
    albedo: Range = (0.02, 0.9)
    """Limits of the linear albedo of surface colours, per channel."""
    palette_shares: tuple[float, float, float, float] = (0.5, 0.25, 0.07, 0.18)
    """Shares of the palette models natural, harmonised, lab, grey; sum 1."""

    room_width_m: Range = (3.0, 6.0)
    """Width of the room along x and along y."""
    room_height_m: Range = (2.4, 3.2)
    """Height of the room."""

    lights: int = 3
    """Number of point and spot lights."""
    spot_share: float = 0.35
    """Share of lights that are spots; the rest are points."""
    irradiance: Range = (1.0, 10.0)
    """Irradiance of all lights together at the focus, radiance units x sr; log-uniform."""
    light_temperature_k: Range = (3000.0, 9000.0)
    """Colour temperature of a light; log-uniform."""
    tinted_light_share: float = 0.1
    """Share of lights with a coloured filter (LED) on top of their temperature."""
    light_radius_m: Range = (0.01, 0.2)
    """Radius of the emitting sphere; log-uniform."""
    light_distance_m: Range = (0.9, 2.2)
    """Distance of a light from the focus."""
    ambient_share: Range = (0.06, 0.3)
    """Irradiance from the surroundings relative to that from the lights; log-uniform."""

    camera_distance_m: Range = (0.6, 2.5)
    """Distance of the camera from the focus; log-uniform."""
    camera_elevation_deg: Range = (20.0, 62.0)
    """Angle of the camera above the horizon as seen from the focus."""
    fov_deg: Range = (32.0, 70.0)
    """Horizontal field of view."""
    roll_deg: float = 8.0
    """Standard deviation of the camera's roll."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.type == "Range" or field.name == "objects":
                _check_range(field.name, value)
            elif field.name.endswith("_share"):
                _check(field.name, value, 0.0, 1.0)
        _check("spread_m", self.spread_m, 0.3, 20.0)
        _check("rotation_steps", self.rotation_steps, 1, 360)
        _check("lights", self.lights, 1, 16)
        _check("roll_deg", self.roll_deg, 0.0, 180.0)
        _check("objects", self.objects[1], 1, 1000)
        for key, low, high in _LIMITS:
            for value in getattr(self, key):
                _check(key, value, low, high)
        if min(self.palette_shares) < 0 or not math.isclose(sum(self.palette_shares), 1.0, abs_tol=1e-6):
            raise FsidError(f"palette_shares = {self.palette_shares}: give four shares >= 0 that sum to 1")
        _check_names("mesh_families", self.mesh_families, mesh_families())
        _check_names("material_families", self.material_families, material_families())


_LIMITS = (
    ("object_size_m", 0.01, 10.0),
    ("stretch", 0.1, 10.0),
    ("tile_scale", 0.01, 100.0),
    ("roughness_scale", 0.0, 10.0),
    ("relief_scale", 0.0, 20.0),
    ("albedo", 0.0, 1.0),
    ("room_width_m", 2.0, 100.0),
    ("room_height_m", 1.5, 100.0),
    ("irradiance", 1e-6, 1e6),
    ("light_temperature_k", 1000.0, 40000.0),
    ("light_radius_m", 0.001, 1.0),
    ("light_distance_m", 0.1, 100.0),
    ("ambient_share", 1e-4, 1.0),
    ("camera_distance_m", 0.2, 100.0),
    ("camera_elevation_deg", 20.0, 85.0),
    ("fov_deg", 5.0, 150.0),
)


def _check(key: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise FsidError(f"{key} = {value}: must be between {low} and {high}")


def _check_range(key: str, value: tuple[float, float]) -> None:
    if len(value) != 2 or not all(math.isfinite(v) for v in value) or not value[0] <= value[1]:
        raise FsidError(f"{key} = {value}: give two finite numbers (lowest, highest)")


def _check_names(key: str, names: tuple[str, ...], known: tuple[str, ...]) -> None:
    for name in names:
        if name not in known:
            raise FsidError(f"{key}: '{name}' does not exist; choose from {', '.join(known)}")
