"""Small scenes for the renderer's tests: plain materials, a plane, a sphere, a box, one light."""

from __future__ import annotations

import numpy as np

from fsid.assets import MaterialMaps, Mesh, build_background
from fsid.render import Renderer
from fsid.render.drawable import Drawable, View
from fsid.render.frame import Frame
from fsid.render.texels import Texels, texels_of
from fsid.scene.model import Camera, Light, Material, Transform, Vec3

STILL = Transform((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
FROM_ABOVE = Camera((0.0, 0.0, 2.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 60.0, 96, 96)


def bake_plain(family: str, variant: int, size: int) -> Texels:
    """Flat maps: `family` is "plain" (rough) or "metal"; the variant is the roughness in per cent."""
    constant = {"mix": 0.0, "pattern": 0.0, "detail": 0.5, "roughness": variant / 100, "height": 0.5}
    maps = {name: np.full((size, size), value, np.float32) for name, value in constant.items()}
    metallic = np.full((size, size), float(family == "metal"), np.float32)
    return texels_of(MaterialMaps(**maps, metallic=metallic, relief_m=0.001, tile_m=1.0))


def plain(colour: Vec3 = (0.5, 0.5, 0.5), *, roughness: int = 100, family: str = "plain") -> Material:
    """A material of `bake_plain`."""
    return Material(family, roughness, (colour, colour, colour), 1.0, 0.0, 1.0, 1.0)


def lambertian(
    mesh: Mesh, colour: Vec3 = (0.5, 0.5, 0.5), at: Transform = STILL, object_id: int = 0
) -> Drawable:
    """A matt drawable without any mirror reflection, to compare with closed formulas."""
    return Drawable(mesh, at, (plain(colour),) * len(mesh.part_names), object_id, specular=0.0)


def grid(size_m: float, cells: int = 1) -> Mesh:
    """A square in z = 0 that looks up."""
    t = (np.arange(cells + 1) / cells - 0.5) * size_m
    x, y = np.meshgrid(t, t)
    vertices = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    quad = corner[:, None] + np.array([0, 1, cells + 2, 0, cells + 2, cells + 1])
    faces = quad.reshape(-1, 3).astype(np.int32)
    normals = np.tile(np.float32([0, 0, 1]), (len(vertices), 1))
    return Mesh(vertices, normals, faces, np.zeros(len(faces), np.int32), ("square",))


def sphere(radius_m: float, segments: int = 96) -> Mesh:
    """A sphere around the origin with exact normals."""
    theta, phi = np.meshgrid(np.linspace(0, np.pi, segments), np.linspace(0, 2 * np.pi, 2 * segments))
    normals = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    index = np.arange(theta.size).reshape(theta.shape)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3).astype(np.int32)
    normals = normals.reshape(-1, 3).astype(np.float32)
    return Mesh(normals * np.float32(radius_m), normals, faces, np.zeros(len(faces), np.int32), ("ball",))


def block(size_m: Vec3) -> Mesh:
    """A box on z = 0 that looks outward, in one part."""
    inside = build_background("room", size_m)
    parts = np.zeros(len(inside.faces), np.int32)
    return Mesh(inside.vertices, -inside.normals, inside.faces[:, ::-1].copy(), parts, ("block",))


def point_light(position_m: Vec3, intensity: float = 1.0, radius_m: float = 0.001) -> Light:
    """A white point light."""
    return Light("point", position_m, (0.0, 0.0, -1.0), (intensity,) * 3, radius_m, 360.0)


def view(
    *drawables: Drawable,
    lights: tuple[Light, ...] = (),
    ambient: float = 0.0,
    camera: Camera = FROM_ABOVE,
) -> View:
    """A view of drawables in white surroundings of 8 x 8 x 4 m."""
    return View(drawables, lights, (ambient,) * 3, camera, (8.0, 8.0, 4.0))


def pixel_rays(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """World directions (H, W, 3) through the sample that depth and normals belong to, with unit depth; and
    the rotation, rows right, up, forward. Supersampling 2: the sample (1, 1) of each pixel."""
    forward = np.subtract(camera.target_m, camera.position_m)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, camera.up)
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(right, forward), forward])
    half = np.tan(np.radians(camera.fov_deg) / 2)
    x = (np.arange(camera.width) + 0.75) / camera.width * 2 - 1
    y = (np.arange(camera.height) + 0.75) / camera.height * 2 - 1
    u, v = np.meshgrid(x * half, -y * half * camera.height / camera.width)
    return np.stack([u, v, np.ones_like(u)], axis=-1) @ rotation, rotation


def draw(renderer: Renderer, what: View, **options: tuple[float, float]) -> Frame:
    """The frame of a view whose materials are those of `bake_plain`."""
    return renderer.draw(what, bake=bake_plain, **options)


def floor_points(camera: Camera) -> np.ndarray:
    """(H, W, 3) points of the plane z = 0 behind each pixel's centre."""
    rays, rotation = pixel_rays(camera)
    half_sample = 0.25 / camera.width * 2 * np.tan(np.radians(camera.fov_deg) / 2)
    rays = rays - half_sample * (rotation[0] - rotation[1])
    origin = np.array(camera.position_m)
    return origin + rays * (-origin[2] / rays[..., 2:])
