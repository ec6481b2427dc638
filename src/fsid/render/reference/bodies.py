"""Parts of a scene as Mitsuba's meshes, shaded per vertex.

Every part is one mesh of micropolygons (`dicing`) with the attributes colour, roughness and metallic, and
normals that carry the relief. Lobes, as far as Disney's model (Burley 2012, 2015) has them:

    diffuse + GGX of index 1.5   half of twice each: Mitsuba blends, it does not add; seen along the surface
                                 the mirror is weaker by half
    metal                        principled, blended in by the metallic map
    clearcoat, sheen             principled (its clearcoat is half as strong as ours)
    translucency                 principledthin with that share of diffuse transmission
    transmission                 principled with specular transmission; both sides must be modelled
    emission                     the part's mean albedo, so that it lights its neighbourhood
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fsid.assets import MaterialMaps
from fsid.render.parts import Part, Surface
from fsid.render.reference.dicing import View, dice
from fsid.render.reference.footprint import footprints
from fsid.render.reference.surface import Points, Pyramid, Shading, shade
from fsid.scene.model import Material

_DIELECTRIC = 0.04
"""Reflectance of index 1.5 at normal incidence; what it reflects does not reach the diffuse layer."""

_OPEN_SHARE = 12.0
"""Footprint of what is not seen, in pixels at its distance: as much coarser as its micropolygons."""


Bsdfs = Callable[[frozenset[str]], Any]


@dataclass(frozen=True, eq=False)
class Body:
    """mesh: Mitsuba's. surface: its micropolygons in the world. albedo: (V, 3). object_id: as in `Frame`."""

    mesh: Any
    surface: Surface
    albedo: np.ndarray
    object_id: int

    def albedo_at(self, points: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """(N, 3) at points (N, 3) on the faces numbered (N,)."""
        corners = self.surface.faces[faces]
        a, b, c = (self.surface.vertices[corners[:, i]] for i in range(3))
        normal = np.cross(b - a, c - a)
        area2 = (normal * normal).sum(1)
        shares = [
            (np.cross(end - start, points - start) * normal).sum(1) / area2 for start, end in ((b, c), (c, a))
        ]
        weights = np.clip(np.stack([*shares, 1 - shares[0] - shares[1]], axis=-1), 0, 1)[..., None]
        return np.asarray((self.albedo[corners] * weights).sum(1) / weights.sum(1))


def body_of(
    mi: Any, name: str, part: Part, view: View, pyramid: Callable[[Material], Pyramid], bsdf: Bsdfs
) -> Body:
    """A part as a Mitsuba mesh; `bsdf` is `bsdf_of` with a memory."""
    world = Surface(
        part.surface.vertices @ part.rotation.T + part.position,
        part.surface.normals @ part.rotation.T,
        part.surface.faces,
    )
    diced = dice(world, view)
    shading = _shaded(part, diced, view, pyramid(part.material))
    properties = mi.Properties()
    attributes = _attributes(part.material, shading)
    properties["bsdf"] = bsdf(frozenset(attributes))
    if part.material.emission > 0:
        radiance = (shading.albedo.mean(0) * part.material.emission).tolist()
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": {"type": "rgb", "value": radiance}})
    mesh = mi.Mesh(name, len(diced.vertices), len(diced.faces), has_vertex_normals=True, props=properties)
    for key, values in attributes.items():
        mesh.add_attribute(f"vertex_{key}", 3 if values.ndim == 2 else 1, _flat(values))
    state = mi.traverse(mesh)
    state["vertex_positions"] = _flat(diced.vertices)
    state["vertex_normals"] = _flat(shading.normal @ part.rotation.T)
    state["faces"] = diced.faces.astype(np.uint32).ravel()
    state.update()
    return Body(mesh, diced, shading.albedo.astype(np.float32), part.object_id)


def _shaded(part: Part, world: Surface, view: View, pyramid: Pyramid) -> Shading:
    right, down = footprints(world.vertices, world.normals, view)
    wide = np.where(view.seen(world.vertices, world.normals, 2.0), 1.0, _OPEN_SHARE)[:, None]
    scale = view.edge_px * wide
    points = Points(
        (world.vertices - part.position) @ part.rotation,
        world.normals @ part.rotation,
        (right * scale) @ part.rotation,
        (down * scale) @ part.rotation,
    )
    return shade(points, part.material, pyramid)


def _attributes(material: Material, shading: Shading) -> dict[str, np.ndarray]:
    """Name -> (V,) or (V, 3) of what the part's BSDF looks up; its keys tell which BSDF that is."""
    count = len(shading.roughness)
    found = {"color": shading.albedo, "roughness": shading.roughness}
    if material.transmission > 0:
        return found | {"transmission": np.full(count, material.transmission)}
    if material.translucency > 0:
        return found | {"translucency": np.full(count, 2 * material.translucency)}
    if shading.metallic.max() > 0:
        found["metallic"] = shading.metallic
    if material.clearcoat > 0 or material.sheen > 0:
        gloss = np.clip((0.1 - material.clearcoat_roughness**2) / 0.099, 0.0, 1.0)
        lobes = {"clearcoat": material.clearcoat, "gloss": gloss, "sheen": material.sheen}
        found |= {name: np.full(count, value) for name, value in lobes.items()}
    return found


def bsdf_of(mi: Any, names: frozenset[str]) -> Any:
    """The BSDF of all parts with attributes of these names: few in a scene, which keeps compiling short."""

    def look_up(name: str, scale: float = 1.0) -> dict[str, Any]:
        return {"type": "mesh_attribute", "name": f"vertex_{name}", "scale": scale}

    rough = {"roughness": look_up("roughness")}
    base = {"type": "principled", "base_color": look_up("color"), **rough}
    if "transmission" in names:
        return mi.load_dict(base | {"eta": 1.5, "spec_trans": look_up("transmission")})
    if "translucency" in names:
        return mi.load_dict(
            base | {"type": "principledthin", "eta": 1.5, "diff_trans": look_up("translucency")}
        )
    matt = {"type": "diffuse", "reflectance": look_up("color", 2 * (1 - _DIELECTRIC))}
    gloss = {"type": "principled", "base_color": 0.0, "eta": _index(2 * _DIELECTRIC), **rough}
    if "gloss" in names:
        gloss |= {
            "clearcoat": look_up("clearcoat", 2.0),
            "clearcoat_gloss": look_up("gloss"),
            "sheen": look_up("sheen", 2.0),
        }
    body = {"type": "blendbsdf", "weight": 0.5, "a": matt, "b": gloss}
    if "metallic" in names:
        metal = base | {"metallic": 1.0}
        body = {"type": "blendbsdf", "weight": look_up("metallic"), "a": body, "b": metal}
    return mi.load_dict({"type": "twosided", "bsdf": body})


def _index(reflectance: float) -> float:
    """Refractive index with that reflectance at normal incidence."""
    root = float(np.sqrt(reflectance))
    return (1 + root) / (1 - root)


def _flat(array: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(array, np.float32).ravel()


def pyramids(bake: Callable[[str, int, int], MaterialMaps], size: int) -> Callable[[Material], Pyramid]:
    """Material -> its maps with mip levels; the last one is kept, for parts that share it."""
    last: dict[tuple[str, int], Pyramid] = {}

    def find(material: Material) -> Pyramid:
        key = (material.family, material.variant)
        if key not in last:
            last.clear()
            last[key] = Pyramid(bake(*key, size))
        return last[key]

    return find
