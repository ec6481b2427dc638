"""What a scene may contain: every knob of the sampler with its unit, default and limits.

The groups follow the paper's letters: `placement` (T), `materials` (M), `background` (B), then light and
cameras; S is the top level. The defaults give close, densely filled, texture-rich views by one sharp camera,
because a denoiser is trained on patches.
"""

# ruff: noqa: RUF009  (a knob is a dataclass field)
from __future__ import annotations

from dataclasses import dataclass, field

from fsid.assets import material_families, mesh_families
from fsid.errors import FsidError
from fsid.scene.camera_config import CameraConfig, LensConfig, MotionConfig, RigConfig
from fsid.scene.knobs import Range, check_knobs, knob, shares


@dataclass(frozen=True)
class PlacementConfig:
    """T: position, scale, rotation (variant full)."""

    size_m: Range = knob((0.1, 1.2), 0.01, 10.0)
    """Largest side of an object after scaling."""
    size_exponent: float = knob(1.2, 0.0, 6.0)
    """p of the density of sizes, r^-p: 1 is log-uniform, 3 that of dead leaves (scale invariance in 2-D)."""
    spread_m: float = knob(0.9, 0.3, 20.0)
    """Objects lie within this distance of the focus: with the count N, their density."""
    far_share: float = knob(0.3, 0.0, 1.0)
    """Share of objects farther away, larger in proportion: what is seen behind the others."""
    far_factor: float = knob(15.0, 1.0, 100.0)
    """Largest distance of these relative to `spread_m`; walls keep them nearer."""
    floating_share: float = knob(0.2, 0.0, 1.0)
    """Share of objects in the air instead of at rest on the ground or on each other."""
    rotation_steps: int = knob(20, 1, 360)
    """Number of equally spaced rotation angles per axis; 20 in the paper."""
    upright_share: float = knob(0.6, 0.0, 1.0)
    """Share of the objects at rest that stand as they are used, turned about the vertical alone."""
    stretch: Range = knob((0.8, 1.25), 0.1, 10.0)
    """Extra scale per axis; log-uniform."""

    def __post_init__(self) -> None:
        check_knobs(self)


@dataclass(frozen=True)
class MaterialConfig:
    """M: how baked families are coloured and finished."""

    plain_share: float = knob(0.14, 0.0, 1.0)
    """Share of surfaces in plain paint: homogeneous areas exist in reality too."""
    cast_share: float = knob(0.25, 0.0, 1.0)
    """Share of scenes whose objects are all in one paint, as painted casts are: form without texture."""
    tile_scale: Range = knob((0.12, 1.2), 0.01, 100.0)
    """Texture tile width on objects relative to the natural width of its family; log-uniform."""
    roughness_scale: Range = knob((0.5, 1.4), 0.0, 10.0)
    """Factor on the roughness maps."""
    relief_scale: Range = knob((0.3, 2.0), 0.0, 20.0)
    """Factor on the relief of the height maps."""
    albedo: Range = knob((0.02, 0.9), 0.0, 1.0)
    """Limits of the linear albedo of surface colours, per channel."""
    palette_shares: tuple[float, float, float, float] = shares(0.66, 0.12, 0.06, 0.16)
    """Shares of the palette models natural, harmonised, lab, grey."""
    contrast: Range = knob((0.3, 1.0), 0.0, 1.0)
    """How far the colours of one material may lie apart: 1 as drawn, 0 all alike."""
    natural_share: float = knob(0.4, 0.0, 1.0)
    """Share of materials in the colours that their family has in nature, where it has some."""
    calm_share: float = knob(0.4, 0.0, 1.0)
    """Share of scenes whose textures vary in light and dark more than in colour."""
    variation: Range = knob((0.15, 0.8), 0.0, 1.0)
    """How much of the colour differences within one material is left in those scenes."""
    layer_share: float = knob(0.03, 0.0, 1.0)
    """Share of materials but plain paint under dust, dirt, scratches or another layer of wear."""
    lobe_share: float = knob(0.7, 0.0, 1.0)
    """Share of parts with the extra lobe that their kind suggests (glass transmits, cloth has sheen ...)."""
    coat_share: float = knob(0.1, 0.0, 1.0)
    """Share of other parts with a clear coat."""
    emission_share: float = knob(0.3, 0.0, 1.0)
    """Share of screens, bulbs and lamp shades that are switched on."""

    def __post_init__(self) -> None:
        check_knobs(self)


@dataclass(frozen=True)
class BackgroundConfig:
    """B: what surrounds the objects."""

    kind_shares: tuple[float, float, float, float] = shares(0.33, 0.08, 0.11, 0.48)
    """Shares of room, backdrop, tabletop, open-air."""
    width_m: Range = knob((3.0, 6.0), 2.0, 100.0)
    """Width of a closed room along x and along y."""
    height_m: Range = knob((2.4, 3.2), 1.5, 100.0)
    """Height of a closed room."""
    ground_m: Range = knob((150.0, 500.0), 20.0, 5000.0)
    """Width of the ground out of doors."""
    hills_m: Range = knob((0.0, 20.0), 0.0, 500.0)
    """Height of the hills towards the horizon."""
    pool_share: float = knob(0.7, 0.0, 1.0)
    """Share of surfaces whose material comes from the pool of their sort (`fsid.scene.pools`)."""
    plain_share: float = knob(0.25, 0.0, 1.0)
    """Share of walls, ceilings and backdrops in plain paint."""
    tile_scale: Range = knob((0.25, 1.6), 0.01, 100.0)
    """Texture tile width on backgrounds relative to the natural width of its family; log-uniform."""
    aligned_share: float = knob(0.95, 0.0, 1.0)
    """Share of surfaces whose texture lies along their edges, as planks and bricks do."""

    def __post_init__(self) -> None:
        check_knobs(self)


@dataclass(frozen=True)
class LightConfig:
    """Lamps, sun, sky and the light that comes back from everywhere."""

    count: tuple[int, int] = knob((1, 4), 1, 16)
    """Number of lamps, both ends included."""
    kind_shares: tuple[float, float, float] = shares(0.45, 0.3, 0.25)
    """Shares of point, spot and area lights among lamps."""
    irradiance: Range = knob((1.0, 10.0), 1e-6, 1e6)
    """Irradiance of all lights together at the focus, radiance units x sr; log-uniform."""
    temperature_k: Range = knob((1800.0, 10000.0), 1000.0, 40000.0)
    """Colour temperature of a light; uniform in 1 / temperature (mired), as steps look alike there."""
    adaptation: Range = knob((0.85, 1.0), 0.0, 1.0)
    """How far the camera's white balance has removed the common colour of the lights: 1 all of it."""
    tinted_share: float = knob(0.06, 0.0, 1.0)
    """Share of lamps that are coloured LEDs."""
    radius_m: Range = knob((0.01, 0.3), 0.001, 1.0)
    """Radius of the emitting sphere of point and spot; log-uniform."""
    area_m: Range = knob((0.2, 1.4), 0.01, 20.0)
    """Edges of an area light; log-uniform."""
    distance_m: Range = knob((0.9, 2.4), 0.1, 100.0)
    """Distance of a lamp from the focus."""
    ambient_share: Range = knob((1.5, 6.0), 1e-4, 10.0)
    """Irradiance from the surroundings relative to that from the lights; log-uniform."""
    sun_share: float = knob(0.6, 0.0, 1.0)
    """Share with sunlight of those open-air scenes that `night_share` leaves in daylight; else overcast."""
    night_share: float = knob(0.1, 0.0, 1.0)
    """Share of open-air scenes lit by lamps under the sky of dusk, about as bright as what they light."""
    sun_to_sky: Range = knob((0.5, 3.0), 0.01, 100.0)
    """Irradiance of the sun relative to that of the sky; log-uniform."""

    def __post_init__(self) -> None:
        check_knobs(self)


@dataclass(frozen=True)
class SceneConfig:
    """Settings of `fsid.scene.sample`. Raises FsidError that names the key of a value out of its limits."""

    objects: tuple[int, int] = knob((40, 130), 1, 1000)
    """N, number of objects, both ends included."""
    repeat_share: float = knob(0.5, 0.0, 1.0)
    """Share of objects that are copies of another one, in the same materials, near it: heaps, rows, sets."""
    nature_share: float = knob(0.6, 0.0, 1.0)
    """Share of objects out of doors that have grown there: bushes, stones, leaves, in their own colours."""
    backgrounds: int = knob(0, 0, 10**6)
    """K, number of different backgrounds in all scenes; 0 gives every scene its own."""
    mesh_families: tuple[str, ...] = ()
    """Mesh families to draw from; empty = all."""
    material_families: tuple[str, ...] = ()
    """Material families to draw from; empty = all."""
    mesh_folders: tuple[str, ...] = ()
    """Folders of meshes (.glb .gltf .obj .ply .stl) and furniture libraries (.sh3f)."""
    mesh_folders_cc0_only: bool = False
    """Whether to leave out meshes that are not stated to be in the public domain (CC0)."""
    mesh_folder_share: float = knob(0.5, 0.0, 1.0)
    """Share of objects from these folders, if there are any."""
    texture_folders: tuple[str, ...] = ()
    """Folders of texture sets, named as ambientCG or Poly Haven name them."""
    texture_folder_share: float = knob(0.5, 0.0, 1.0)
    """Share of materials from these folders, if there are any."""
    hdri_folder: str = ""
    """Folder of equirectangular panoramas (.hdr .exr) for the sky, with its subfolders."""
    hdri_share: float = knob(0.7, 0.0, 1.0)
    """Share of skies from that folder, if there is one."""

    placement: PlacementConfig = field(default_factory=PlacementConfig)
    materials: MaterialConfig = field(default_factory=MaterialConfig)
    background: BackgroundConfig = field(default_factory=BackgroundConfig)
    lights: LightConfig = field(default_factory=LightConfig)
    camera: CameraConfig = field(default_factory=CameraConfig)
    rig: RigConfig = field(default_factory=RigConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    lens: LensConfig = field(default_factory=LensConfig)

    def __post_init__(self) -> None:
        check_knobs(self)
        _check_names("mesh_families", self.mesh_families, mesh_families())
        _check_names("material_families", self.material_families, material_families())

    @property
    def panoramas(self) -> str:
        """`hdri_folder`; "" where no scene has a sky."""
        return self.hdri_folder if self.background.kind_shares[-1] else ""


def _check_names(key: str, names: tuple[str, ...], known: tuple[str, ...]) -> None:
    for name in names:
        if name not in known:
            raise FsidError(f"{key}: '{name}' does not exist; choose from {', '.join(known)}")
