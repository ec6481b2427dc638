"""Planar reflection: what a flat smooth surface shows of the things before it is an image from behind it.

    a camera at M x with axes M R, M the reflection in the plane, sees at each pixel what is shown there

because p on the plane and the mirror image of what it reflects lie on one ray of the camera. The image is a
third as large, or a quarter where the mirror blurs it anyway, without glass and without what shines: lights
have highlights of their own. Walls and grounds that shine are no lights, so they are in it.

A picture has two at most. One is the ground's indoors, or that of a table's top, which `Background` has at
z = 0, wherever it is smooth enough to show any; out of doors the ground is flat for a few metres only, and
its reflection would end in a line. The other is that of the plane that shows most among the rest, walls and
flat sides of objects: of what is seen in an overview of the picture, the share times the reflectance.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fsid.render.drawable import BACKGROUND_ID, View
from fsid.render.exposure import Shot
from fsid.render.layers import Layer
from fsid.render.overview import Overview

MOST = 2
"""Mirrors in one picture."""

ROUGHEST = 0.5
"""Mean roughness from which a surface shows nothing but the walls; shaders/planar.glsl fades towards it."""

_CLEAREST = 0.35
"""Mean roughness up to which the image is not faded."""

_BLURRING = 0.25
"""Mean roughness from which an image of a quarter of the size does."""

LEAST_SHOWN = 0.01
"""Share of the picture times reflectance from which walls and objects have an image: a quarter of a picture
that reflects 4 %, or 1.25 % that reflect 80 %."""

_LEAST_COAT = 0.05
_COAT_REFLECTS = 0.04
_FLAT_M = 1e-3
_NEAR_M = 3e-3
_OFF_M = 5e-4
_LEVEL = 0.999  # cosine
_NORMAL_STEPS, _STEPS_PER_M = 50, 50

Layers = Mapping[tuple[str, int], Layer]


@dataclass(frozen=True, eq=False)
class Mirror:
    """plane: (4,) unit normal n towards the viewer and offset d, n x = d. shot: the image that it shows."""

    plane: np.ndarray
    shot: Shot

    @property
    def kept(self) -> np.ndarray:
        """(4,) the plane before which things are mirrored, a little off the mirror itself."""
        return self.plane + np.array([0.0, 0.0, 0.0, _OFF_M])


def ground_mirror(view: View, shot: Shot, layers: Layers) -> Mirror | None:
    """That of smooth ground in z = 0; None without any, out of doors, or below it."""
    indoors, above = view.sky is None, shot.lens.position[2] > 10 * _FLAT_M
    roughness = _least_roughness(view, layers) if indoors and above else 1.0
    if roughness >= ROUGHEST:
        return None
    return _mirror(np.array([0.0, 0.0, 1.0, 0.0]), shot, roughness)


def clearest_mirror(view: View, overview: Overview, shot: Shot, layers: Layers) -> Mirror | None:
    """That of the plane, other than the ground, that shows most; None if none shows LEAST_SHOWN."""
    n, x = overview.face_normal, overview.position
    polish = _Polish.of(view, layers, overview.surface)
    ground = (np.abs(x[:, 2]) < 2 * _FLAT_M) & (n[:, 2] > _LEVEL) & polish.background
    flat = np.abs((n * overview.normal).sum(1)) > _LEVEL
    to_eye = shot.lens.position - x
    facing = (n * to_eye).sum(1)
    shown = polish.reflectance(facing / np.linalg.norm(to_eye, axis=1)) / overview.count
    shown[ground | ~flat | (facing < 10 * _FLAT_M)] = 0.0
    if shown.sum() < LEAST_SHOWN:
        return None
    offset = (n * x).sum(1)
    cells = np.column_stack([np.rint(n * _NORMAL_STEPS), np.rint(offset * _STEPS_PER_M)])
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    cell = cell.ravel()
    inside = cell == np.argmax(np.bincount(cell, shown))
    weight = (shown * inside)[:, None]
    normal = (weight * n).sum(0)
    normal /= np.linalg.norm(normal)
    level = (weight[:, 0] * (x @ normal)).sum() / weight.sum()
    inside = (n @ normal > _LEVEL) & (np.abs(x @ normal - level) < _NEAR_M)
    if shown[inside].sum() < LEAST_SHOWN:
        return None
    roughness = np.average(polish.roughness[inside], weights=shown[inside])
    return _mirror(np.array([*normal, level]), shot, float(roughness))


@dataclass(frozen=True, eq=False)
class _Polish:
    """Of the surfaces at some places, (N,) each. roughness: mean, 0..1. body, coat: how clear an image they
    show, 0..1. specular: reflectance of the body at normal incidence. background: no object."""

    roughness: np.ndarray
    body: np.ndarray
    specular: np.ndarray
    coat: np.ndarray
    background: np.ndarray

    @classmethod
    def of(cls, view: View, layers: Layers, surface: np.ndarray) -> _Polish:
        """surface: numbers in the order of `fsid.render.geometry.merge`."""
        table = [(drawable, material) for drawable in view.drawables for material in drawable.materials]
        found, place = np.unique(surface, return_inverse=True)
        rows = []
        for drawable, material in (table[i] for i in found):
            layer = layers[material.family, material.variant]
            rough = min(layer.roughness * material.roughness_scale, 1.0)
            bright = float((layer.shares @ np.array(material.colours)).mean())
            specular = drawable.specular + layer.metallic * (bright - drawable.specular)
            body = _clearness(rough) if drawable.casts else 0.0  # the shining face of a light mirrors nothing
            coat = material.clearcoat * _clearness(material.clearcoat_roughness)
            least = min(rough, material.clearcoat_roughness) if coat >= _LEAST_COAT else rough
            rows.append((least, body, specular, coat, drawable.object_id == BACKGROUND_ID))
        roughness, body, specular, coat, background = np.array(rows, float).reshape(-1, 5)[place.ravel()].T
        return cls(roughness, body, specular, coat, background > 0)

    def reflectance(self, cosine: np.ndarray) -> np.ndarray:
        """By Schlick's approximation."""
        grazing = (1 - np.clip(cosine, 0.0, 1.0)) ** 5
        body = self.specular + (1 - self.specular) * grazing
        return np.asarray(self.body * body + self.coat * (_COAT_REFLECTS + (1 - _COAT_REFLECTS) * grazing))


def _clearness(roughness: float) -> float:
    """As shaders/planar.glsl fades images: by the square of the roughness."""
    low, high = _CLEAREST**2, ROUGHEST**2
    t = min(max((roughness**2 - low) / (high - low), 0.0), 1.0)
    return 1.0 - t * t * (3 - 2 * t)


def _mirror(plane: np.ndarray, shot: Shot, roughness: float) -> Mirror:
    """The smaller shot from behind the plane."""
    n, d, lens = plane[:3], plane[3], shot.lens
    times = 3 if roughness < _BLURRING else 4
    size = (-(-lens.seen_px[0] // times), -(-lens.seen_px[1] // times))
    behind = replace(
        lens,
        rotation=lens.rotation - 2 * np.outer(lens.rotation @ n, n),
        position=lens.position - 2 * (lens.position @ n - d) * n,
        focal=lens.seen_focal,
        seen_px=size,
        model=0,
    )
    # The same shift of the G-buffer as seen by the camera, in the pixels of this image.
    x, y = shot.seen_shift
    shift_px = (x * size[0] / 2, y * size[1] / 2)
    return Mirror(plane, replace(shot, lens=behind, shift_px=shift_px, lens_offset=(0.0, 0.0)))


def _least_roughness(view: View, layers: Layers) -> float:
    """Mean roughness of the smoothest ground or coat in z = 0; 1 without ground there."""
    least = 1.0
    for drawable in view.drawables:
        if drawable.object_id != BACKGROUND_ID or not drawable.casts:
            continue
        mesh = drawable.mesh
        flat = (np.abs(mesh.vertices[:, 2]) < _FLAT_M) & (mesh.normals[:, 2] > _LEVEL)
        for part in np.unique(mesh.face_parts[flat[mesh.faces].all(1)]):
            material = drawable.materials[int(part)]
            coat = material.clearcoat_roughness if material.clearcoat >= _LEAST_COAT else 1.0
            rough = layers[material.family, material.variant].roughness * material.roughness_scale
            least = min(least, rough, coat)
    return least
