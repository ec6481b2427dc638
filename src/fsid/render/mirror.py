"""Planar reflection: what smooth ground shows of the things on it is an image of the scene from below.

    a camera at M x with axes M R, M = diag(1, 1, -1), sees at each pixel what a mirror in z = 0 shows there

because p on the plane and the mirror image of what it reflects lie on one ray of the camera. `Background` has
its ground, or the top of its table, at z = 0. The image is a third as large, or a quarter where the ground
blurs it anyway, without glass and without what shines: lights have highlights of their own. It is made only
where the ground is smooth enough to show any, and indoors: out of doors the ground is flat for a few metres
only, and its reflection would end in a line.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fsid.render.drawable import BACKGROUND_ID, View
from fsid.render.exposure import Shot
from fsid.scene.model import Material

ROUGHEST = 0.5
"""Mean roughness from which ground shows nothing but the walls; shaders/shade.frag fades towards it."""

_BLURRING = 0.25
"""Mean roughness from which an image of a quarter of the size does."""
_LEAST_COAT = 0.05
_FLAT_M = 1e-3


def mirror_shot(view: View, shot: Shot, roughness_of: Callable[[Material], float]) -> Shot | None:
    """The smaller shot from below; None without smooth ground in z = 0, or below it."""
    indoors, above = view.sky is None, shot.lens.position[2] > 10 * _FLAT_M
    roughness = _least_roughness(view, roughness_of) if indoors and above else 1.0
    if roughness >= ROUGHEST:
        return None
    lens, times = shot.lens, 3 if roughness < _BLURRING else 4
    size = (-(-lens.seen_px[0] // times), -(-lens.seen_px[1] // times))
    below = replace(
        lens,
        rotation=lens.rotation * (1.0, 1.0, -1.0),
        position=lens.position * (1.0, 1.0, -1.0),
        focal=lens.seen_focal,
        seen_px=size,
        model=0,
    )
    # The same shift of the G-buffer as seen by the camera, in the pixels of this image.
    x, y = shot.seen_shift
    return replace(shot, lens=below, shift_px=(x * size[0] / 2, y * size[1] / 2), lens_offset=(0.0, 0.0))


def _least_roughness(view: View, roughness_of: Callable[[Material], float]) -> float:
    """Mean roughness of the smoothest ground or coat in z = 0; 1 without ground there."""
    least = 1.0
    for drawable in view.drawables:
        if drawable.object_id != BACKGROUND_ID or not drawable.casts:
            continue
        mesh = drawable.mesh
        flat = (np.abs(mesh.vertices[:, 2]) < _FLAT_M) & (mesh.normals[:, 2] > 0.999)
        for part in np.unique(mesh.face_parts[flat[mesh.faces].all(1)]):
            material = drawable.materials[int(part)]
            coat = material.clearcoat_roughness if material.clearcoat >= _LEAST_COAT else 1.0
            least = min(least, roughness_of(material), coat)
    return least
