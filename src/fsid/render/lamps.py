"""Surfaces that shine light their neighbourhood: each becomes a light of the same power.

    I(u) = L / 2 sum of A_i |n_i u|,  mean L A / 4      facets A_i of the convex hull A (Cauchy 1832)

of a body of radiance L in direction u, of which sqrt(u Q u) is kept: the law of an ellipsoid, and of a flat
sheet. It stands at the centroid, as large as a sphere of that surface, and is shaded by everything but itself
and what it touches. The inside of a shade shines on itself and out of its openings, which the hull closes; of
a sheet both sides shine. A flat one with something behind it, as the display of a screen, becomes an area
light in its place, which shines to the front alone and is shaded by the rest of its own object, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import ConvexHull, QhullError
from trimesh.triangles import closest_point

from fsid.assets import Mesh
from fsid.assets.surfaces import cross
from fsid.render.drawable import BACKGROUND_ID, CLEAR, Display, Drawable
from fsid.render.shadows import Source, unit
from fsid.scene.model import Light, Material
from fsid.scene.vectors import vec3

MAX_LAMPS = 12
"""The strongest ones; each costs as much as a point or area light."""

_FLAT = 0.8
"""Share of a surface that faces one way, to and fro, from which on it is flat."""

_ROUND = 0.95
"""A convex hull smaller than this part of the surface is that of a hollow body, not of too few corners."""

_BEHIND = 0.3
"""How far behind a display its back is looked for, relative to the edge of a square of its size."""


def lamps_of(
    drawables: Sequence[Drawable], albedo_of: Callable[[Material], np.ndarray], time_s: float
) -> list[Source]:
    """A light per shining part of an object, strongest first. albedo_of: mean albedo (3,) of a material."""
    found: list[tuple[float, Source]] = []
    for number, drawable in enumerate(drawables):
        if drawable.object_id == BACKGROUND_ID:
            continue
        for part, material in enumerate(drawable.materials):
            if material.emission <= 0 or part not in drawable.mesh.face_parts:
                continue
            radiance, pose = material.emission * albedo_of(material), drawable.pose(time_s)
            if part in drawable.displays:
                source = _panel(drawable.displays[part], radiance, pose, number)
            else:
                source = _ball(*_body(drawable, part), radiance, pose, number)
            ahead = np.prod(source.light.size_m) if source.light.kind == "area" else 1.0
            found.append((sum(source.light.colour) * float(ahead), source))
    found.sort(key=lambda pair: -pair[0])
    return [source for _, source in found[:MAX_LAMPS]]


_Pose = tuple[np.ndarray, np.ndarray]


def _ball(centroid: np.ndarray, facets: np.ndarray, radiance: np.ndarray, pose: _Pose, number: int) -> Source:
    rotation, position = pose
    area = _area(facets)
    radius = float(np.sqrt(area / (4 * np.pi)))
    place, intensity = vec3(rotation @ centroid + position), vec3(radiance * area / 4)
    light = Light("point", place, (0.0, 0.0, -1.0), intensity, radius, 360.0)
    return Source(light, number, shape=rotation @ _shape(facets) @ rotation.T)


def _shape(facets: np.ndarray) -> np.ndarray:
    """(3, 3) Q such that sqrt(u Q u) is nearly the intensity in direction u relative to its mean."""
    shown = np.abs(facets @ _DIRECTIONS.T).sum(0)
    x, y, z = _DIRECTIONS.T
    terms = np.stack([x * x, y * y, z * z, 2 * y * z, 2 * z * x, 2 * x * y], axis=-1)
    a, b, c, d, e, f = np.linalg.lstsq(terms, (shown / max(float(shown.mean()), 1e-12)) ** 2)[0]
    values, axes = np.linalg.eigh(np.array([[a, f, e], [f, b, d], [e, d, c]]))
    Q = axes * np.maximum(values, 0.0) @ axes.T
    mean = float(np.sqrt(np.einsum("ni,ij,nj->n", _DIRECTIONS, Q, _DIRECTIONS).clip(0)).mean())
    return np.asarray(Q / max(mean, 1e-12) ** 2)


def _panel(display: Display, radiance: np.ndarray, pose: _Pose, number: int) -> Source:
    rotation, position = pose
    axes = (rotation @ display.half_width, rotation @ display.half_height)
    width, height = (2 * float(np.linalg.norm(axis)) for axis in axes)
    place, ahead = vec3(rotation @ display.centre + position), vec3(unit(np.cross(axes[1], axes[0])))
    light = Light("area", place, ahead, vec3(radiance), 0.0, 180.0, (width, height))
    return Source(light, number, axes)


def hoods_apart(drawables: Sequence[Drawable]) -> tuple[Drawable, ...]:
    """The same with displays found, and hoods of lamps as drawables of their own: what shades their light."""
    return tuple(piece for drawable in drawables for piece in _hood_apart(drawable))


def _hood_apart(drawable: Drawable) -> list[Drawable]:
    """The parts of a lamp that its light passes through or that touch what shines, and the others."""
    if drawable.object_id == BACKGROUND_ID or all(m.emission <= 0 for m in drawable.materials):
        return [drawable]
    parts = np.unique(drawable.mesh.face_parts)
    lamps = [part for part in parts if drawable.materials[part].emission > 0]
    if not lamps:
        return [drawable]
    found = {int(part): _display(drawable, part) for part in lamps}
    displays = {part: display for part, display in found.items() if display is not None}
    bodies = [_body(drawable, part) for part in lamps if part not in displays]
    balls = [(centroid, _area(facets)) for centroid, facets in bodies]
    hood = np.zeros(len(drawable.materials), bool)
    hood[parts] = [_is_hood(drawable, part, balls) for part in parts]
    if not hood.any():
        return [replace(drawable, displays=displays)]
    number = np.cumsum(~hood) - 1  # of each part among those that are no hood
    displays = {int(number[part]): display for part, display in displays.items()}
    return [replace(_pieces(drawable, ~hood), displays=displays), _pieces(drawable, hood)]


def _is_hood(drawable: Drawable, part: int, balls: Sequence[tuple[np.ndarray, float]]) -> bool:
    """Whether a part keeps off the spheres of all lamps, centroid and surface, and lets no light through."""
    if not _is_opaque(drawable.materials[part]):
        return False
    triangles = _triangles(drawable, part)
    return all(
        np.linalg.norm(closest_point(triangles, np.tile(centre, (len(triangles), 1))) - centre, axis=1).min()
        > np.sqrt(area / (4 * np.pi))
        for centre, area in balls
    )


def _is_opaque(material: Material) -> bool:
    return material.emission <= 0 and material.translucency <= 0 and material.transmission < CLEAR


def _display(drawable: Drawable, part: int) -> Display | None:
    """The rectangle of a part that is flat and has a back close behind it and nothing before it."""
    triangles = _triangles(drawable, part)
    doubled = cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    doubled *= np.sign(np.prod(drawable.transform.scale))  # a mirrored mesh keeps its order of corners
    areas = np.linalg.norm(doubled, axis=1) / 2
    normals = doubled / np.maximum(2 * areas, 1e-18)[:, None]
    shares, axes = np.linalg.eigh((normals * areas[:, None]).T @ normals)
    if shares[2] < _FLAT * max(areas.sum(), 1e-12):
        return None
    others = [p for p in np.unique(drawable.mesh.face_parts) if _is_opaque(drawable.materials[p])]
    solid = np.concatenate([np.empty((0, 3, 3)), *(_triangles(drawable, p) for p in others)])
    for ahead in (axes[:, 2], -axes[:, 2]):
        front = normals @ ahead > 0.5
        if not front.any():
            continue
        display = _rectangle(triangles[front], areas[front], ahead)
        if _covered(display, -ahead, solid) and not _covered(display, ahead, solid):
            return display
    return None


def _rectangle(triangles: np.ndarray, areas: np.ndarray, ahead: np.ndarray) -> Display:
    """As large as the triangles (F, 3, 3), as wide and high as these are along the axes of their object."""
    aside = np.eye(3)[int(np.argmin(np.abs(ahead[:2])))]
    width = unit(aside - (aside @ ahead) * ahead)
    height = np.cross(ahead, width)
    edges = [float(np.ptp(triangles @ axis)) for axis in (width, height)]
    filled = np.sqrt(areas.sum() / max(edges[0] * edges[1], 1e-12))
    centre = np.average(triangles.mean(1), axis=0, weights=areas)
    half_width, half_height = (
        axis * edge * filled / 2 for axis, edge in zip((width, height), edges, strict=True)
    )
    return Display(centre, half_width, -half_height)


def _covered(display: Display, direction: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether most of a display has one of the triangles (F, 3, 3) close to it in a direction."""
    w, h = display.half_width, display.half_height
    reach = _BEHIND * 2 * np.sqrt(np.linalg.norm(w) * np.linalg.norm(h))
    places = display.centre + np.array([0 * w, w + h, w - h, h - w, -w - h]) / 2
    return _met(places, direction * reach, triangles) >= 3


def _met(starts: np.ndarray, step: np.ndarray, triangles: np.ndarray) -> int:
    """From how many of `starts` (N, 3) the way by `step` crosses a triangle (Moeller and Trumbore 1997)."""
    a, b, c = (triangles[:, i] for i in range(3))
    across = cross(step, c - a)
    volume = ((b - a) * across).sum(1)
    wide = np.abs(volume) > 1e-18
    a, b, c, across, volume = (each[wide] for each in (a, b, c, across, volume))
    found = 0
    for start in starts:
        u = ((start - a) * across).sum(1) / volume
        near = np.flatnonzero((u >= 0) & (u <= 1))  # few of all
        turned = cross(start - a[near], b[near] - a[near])
        v, t = turned @ step / volume[near], ((c[near] - a[near]) * turned).sum(1) / volume[near]
        found += bool(((v >= 0) & (u[near] + v <= 1) & (t > 0) & (t <= 1)).any())
    return found


def _pieces(drawable: Drawable, wanted: np.ndarray) -> Drawable:
    """The parts of a drawable that are `wanted` (P,)."""
    mesh, numbers = drawable.mesh, np.flatnonzero(wanted)
    faces = wanted[mesh.face_parts]
    used, corners = np.unique(mesh.faces[faces], return_inverse=True)
    pieces = Mesh(
        vertices=mesh.vertices[used],
        normals=mesh.normals[used],
        faces=corners.reshape(-1, 3).astype(np.int32),
        face_parts=np.searchsorted(numbers, mesh.face_parts[faces]).astype(np.int32),
        part_names=tuple(mesh.part_names[number] for number in numbers),
    )
    return replace(drawable, mesh=pieces, materials=tuple(drawable.materials[number] for number in numbers))


def _body(drawable: Drawable, part: int) -> tuple[np.ndarray, np.ndarray]:
    """Centroid (3,) of a part, metres before the drawable is turned and moved, and the facets (F, 3), their
    normals times m^2, of the convex body that is seen as much of: of its hull, or its own where these are
    less, as of several bulbs."""
    points = _triangles(drawable, part)
    own = cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]) / 2
    areas = np.linalg.norm(own, axis=1)
    closed = np.vstack([own, -own.sum(0)])  # with what closes its opening
    hull = _hull_facets(_vertices(drawable, part))
    centroid = (points.mean(1) * areas[:, None]).sum(0) / max(float(areas.sum()), 1e-12)
    is_hull = hull is not None and _area(hull) < _ROUND * _area(closed)
    return centroid, hull if hull is not None and is_hull else closed


def _area(facets: np.ndarray) -> float:
    return float(np.linalg.norm(facets, axis=1).sum())


def _vertices(drawable: Drawable, part: int) -> np.ndarray:
    """(V, 3) metres, as `_body`."""
    mesh = drawable.mesh
    used = np.zeros(len(mesh.vertices), bool)
    used[mesh.faces[mesh.face_parts == part]] = True
    return np.asarray(mesh.vertices[used] * np.array(drawable.transform.scale, np.float32))


def _hull_facets(points: np.ndarray) -> np.ndarray | None:
    """(F, 3), as `_body`, of the points (V, 3) that lie farthest in fixed directions; None where these are
    flat."""
    corners = np.unique((_DIRECTIONS @ points.T).argmax(1))
    try:
        hull = ConvexHull(points[corners])
    except QhullError:
        return None
    a, b, c = np.moveaxis(points[corners][hull.simplices], 1, 0)
    return np.asarray(np.cross(b - a, c - a) / 2)


def _triangles(drawable: Drawable, part: int) -> np.ndarray:
    """(F, 3, 3) metres, as `_body`."""
    mesh = drawable.mesh
    corners = mesh.vertices.take(mesh.faces[mesh.face_parts == part], axis=0)
    return np.asarray(corners * np.array(drawable.transform.scale))


def _evenly_spread(count: int) -> np.ndarray:
    """(count, 3) unit vectors on a spiral."""
    z = (np.arange(count) + 0.5) / count * 2 - 1
    turn = np.arange(count) * np.pi * (3 - np.sqrt(5))
    return np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], axis=-1)


_DIRECTIONS = _evenly_spread(256).astype(np.float32)
