"""The scene as pure data: the paper's I^t = f(S_i^t, M_i^t, T_i^t, B_j^t), plus lights, sky and cameras.

Object i is `objects[i]` (S), `materials[i]` (M, one per named part of its mesh) and `transforms[i]` (T,
moved by `motions[i]` where time passes); `background` is B. Nothing here holds pixels or vertices: a mesh is
(family, seed), a material is (family, variant, colours), so a scene is a few kilobytes of JSON that any
machine renders alike. World: right-handed, z up, metres, seconds. Colours are linear sRGB primaries (D65),
not gamma encoded.
"""

from __future__ import annotations

from dataclasses import dataclass

Vec3 = tuple[float, float, float]
ZERO: Vec3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Object:
    """S: a mesh by name. `fsid.assets.build_mesh(family, seed)` makes the geometry.

    family: a name of `fsid.assets.mesh_families()`, or "file:PATH" (a mesh file) or "file:PATH!MEMBER" (a
    model of a Sweet Home 3D library), where the seed plays no part.
    """

    family: str
    seed: int


@dataclass(frozen=True)
class Material:
    """M: a baked family recoloured. `fsid.assets.bake_material(family, variant)` makes the maps.

    family: a name of `fsid.assets.material_families()`, or "file:PATH" (a texture folder or the common
    prefix of its maps). colours: colour_a, colour_b, colour_c of `fsid.assets.maps`, linear; what they mix to
    is cut at 1.
    tile_m: edge of one texture tile in metres. rotation_deg: of the tile in the surface.
    roughness_scale multiplies the roughness map. relief_scale multiplies the family's relief.
    clearcoat: 0..1, weight of a clear dielectric layer (index 1.5) of roughness clearcoat_roughness above it.
    sheen: 0..1, weight of the fuzz of cloth. translucency: 0..1, share of the diffuse light that leaves on
    the other side (leaves, paper, lamp shades). transmission: 0..1, share of light that passes through as
    through clear glass of index 1.5, tinted by the albedo. emission: radiance of the surface = emission x
    albedo, on top of what it reflects. patched: laid in patches from random places of the tile, so that
    nothing repeats: for matter without order, grass and gravel and plaster.
    """

    family: str
    variant: int
    colours: tuple[Vec3, Vec3, Vec3]
    tile_m: float
    rotation_deg: float
    roughness_scale: float
    relief_scale: float
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.1
    sheen: float = 0.0
    translucency: float = 0.0
    transmission: float = 0.0
    emission: float = 0.0
    patched: bool = False


@dataclass(frozen=True)
class Transform:
    """T at time 0: x_world = rotation(x_object * scale) + position; rotation = Rz(c) Ry(b) Rx(a), degrees."""

    position_m: Vec3
    rotation_deg: Vec3
    scale: Vec3


@dataclass(frozen=True)
class Motion:
    """How T changes: at time t the object is moved by velocity * t and turned about the world axis of `spin`
    through its position by |spin| * t. velocity: m/s. spin: degrees/s times a unit axis."""

    velocity_m_s: Vec3 = ZERO
    spin_deg_s: Vec3 = ZERO


@dataclass(frozen=True)
class Background:
    """B: what surrounds the objects, centred on the origin, the ground at z = 0; one material per named part.

    `fsid.assets.build_background(kind, size_m)` makes its mesh, whose part names are the keys of `materials`:

    room: closed box 0 <= z <= height with floor, ceiling, wall_north (+y), wall_south, wall_east (+x),
        wall_west.
    backdrop: the same closed box, whose north wall meets the floor in a curve: one sheet, `sweep`, in place
        of floor and wall_north.
    tabletop: the same closed box, 0.75 m lower, with a table in the middle whose top is at z = 0: part
        `table`.
    open-air: `ground` only, size_m wide, rolling by size_m[2] beyond the objects; above it is the sky.
    """

    kind: str
    size_m: Vec3
    materials: dict[str, Material]


@dataclass(frozen=True)
class Light:
    """One light. E is the irradiance of a surface that faces it at distance r, without shadow.

    kind "point" or "spot": `colour` is radiant intensity (linear RGB, radiance x m^2), E = colour / r^2.
    kind "sun": parallel light along `direction`; `colour` is E itself, radius_m the tangent of its angular
        radius (0.0047 for the sun); position_m is ignored.
    kind "area": a rectangle size_m (width along `direction` x world z, or world x where that vanishes;
        height across) around position_m that emits the radiance `colour` to the side of `direction`,
        Lambertian; it is seen by the camera and mirrored, too.
    radius_m: of the emitting sphere of a point or spot (softness of the shadow). cone_deg: full outer angle,
    spot only.
    """

    kind: str
    position_m: Vec3
    direction: Vec3
    colour: Vec3
    radius_m: float
    cone_deg: float
    size_m: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Sky:
    """Radiance from outside by direction: seen, mirrored, and arriving as ambient light through no wall.

    source: "procedural" (horizon to zenith gradient, clouds of `cloudiness` drawn from `seed`, ground glow)
    or "file:PATH" of an equirectangular .hdr or .exr picture. colour: mean radiance of the upper half.
    azimuth_deg: rotation about z. The sun of a procedural sky is a `Light` of kind "sun"; a picture may have
    its own.
    """

    source: str
    colour: Vec3
    seed: int = 0
    cloudiness: float = 0.0
    azimuth_deg: float = 0.0


@dataclass(frozen=True)
class Distortion:
    """Lens distortion of normalised image coordinates (x, y) = (X/Z, Y/Z), y down, as OpenCV defines it.

    model "brown-conrady": coefficients k1, k2, p1, p2, k3. model "fisheye": k1, k2, k3, k4 of
    theta_d = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8).
    """

    model: str
    coefficients: tuple[float, ...]


@dataclass(frozen=True)
class Camera:
    """One camera at one time: a rig of E eyes over F frames is E x F cameras, `eye` and `frame` say which.

    fov_deg: horizontal field of view before distortion. Width and height in pixels, both even.
    time_s: middle of the exposure. exposure_s: shutter time; with velocity_m_s and spin_deg_s (of the camera
    about its position, world axis) and the objects' motions it gives motion blur; 0 = none.
    aperture_m: diameter of the lens opening, 0 = everything is sharp. focus_m: depth of the sharp plane.
    vignetting: a1, a2, a3 of gain = 1 + a1 r^2 + a2 r^4 + a3 r^6, r = 1 in the corner of the image.
    chromatic_aberration: magnification of red and of blue relative to green, minus 1.
    softness_px: standard deviation of the point spread (Gaussian) of lens and low-pass filter; 0 = none.
    sharpening: how much of the detail finer than a pixel or so is added once more; 0 = none.
    colour_contrast: contrast of red and of blue relative to green, minus 1: slopes on luminance, logarithms.
    """

    position_m: Vec3
    target_m: Vec3
    up: Vec3
    fov_deg: float
    width: int
    height: int
    eye: int = 0
    frame: int = 0
    time_s: float = 0.0
    exposure_s: float = 0.0
    velocity_m_s: Vec3 = ZERO
    spin_deg_s: Vec3 = ZERO
    aperture_m: float = 0.0
    focus_m: float = 1.0
    distortion: Distortion | None = None
    vignetting: Vec3 = ZERO
    chromatic_aberration: tuple[float, float] = (0.0, 0.0)
    softness_px: float = 0.0
    sharpening: float = 0.0
    colour_contrast: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True)
class Scene:
    """Everything a renderer needs. `ambient` is the radiance of the unlit surroundings, linear RGB (indoors);
    out of doors, and through openings, it is the sky's. `motions` is empty where nothing moves."""

    seed: int
    variant: str
    objects: tuple[Object, ...]
    materials: tuple[tuple[Material, ...], ...]
    transforms: tuple[Transform, ...]
    background: Background
    lights: tuple[Light, ...]
    ambient: Vec3
    cameras: tuple[Camera, ...]
    sky: Sky | None = None
    motions: tuple[Motion, ...] = ()
