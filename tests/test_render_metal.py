"""A rough metal gives back what a random walk on its microsurface does, however often that bounces.

The walk is that of Heitz, Hanika, d'Eon and Dachsbacher (2016, "Multiple-Scattering Microfacet BSDFs with
the Smith Model"), heights uniform; visible normals as Dupuy and Benyoub (2023) draw them. The renderer's
closed form is Turquin's (2019), exact for white.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fsid.render import Renderer
from fsid.render.drawable import Drawable, View, background_drawable
from fsid.scene.model import Background, Transform
from render_scenes import FROM_ABOVE, STILL, bake_plain, grid, plain, sphere, view

WALKS, MOST_BOUNCES = 40_000, 40
WHITE, BRIGHT, DARK = (1.0, 1.0, 1.0), (0.9, 0.9, 0.9), (0.02, 0.02, 0.02)


def smith_lambda(cosine: np.ndarray, alpha: float) -> np.ndarray:
    """Smith's Lambda of GGX, of directions on either side."""
    tangent = np.sqrt(np.maximum(1 - cosine**2, 1e-12)) / np.where(np.abs(cosine) < 1e-6, 1e-6, cosine)
    return 0.5 * (np.sign(tangent) * np.sqrt(1 + (alpha * tangent) ** 2) - 1)


def visible_normals(rng: np.random.Generator, w: np.ndarray, alpha: float) -> np.ndarray:
    """(N, 3) microfacet normals as they are seen from directions w."""
    seen = w * (alpha, alpha, 1.0)
    seen /= np.linalg.norm(seen, axis=1, keepdims=True)
    z = (1 - rng.random(len(w))) * (1 + seen[:, 2]) - seen[:, 2]
    phi, r = 2 * np.pi * rng.random(len(w)), np.sqrt(np.clip(1 - z * z, 0, 1))
    m = (np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=1) + seen) * (alpha, alpha, 1.0)
    m[:, 2] = np.maximum(m[:, 2], 1e-9)
    return m / np.linalg.norm(m, axis=1, keepdims=True)


def walked(rng: np.random.Generator, roughness: float, nv: float, f0: float) -> float:
    """Share of even surroundings that the surface shows: mean energy of the walks that leave it.

    below: share of the heights that lie below the walk.
    """
    alpha, out = roughness**2, 0.0
    w = np.tile((-np.sqrt(1 - nv * nv), 0.0, -nv), (WALKS, 1))
    below, energy = np.full(WALKS, 1 - 1e-7), np.ones(WALKS)
    for _ in range(MOST_BOUNCES):
        u, hidden = rng.random(len(w)), smith_lambda(w[:, 2], alpha)
        leaves = (w[:, 2] > 0) & (u > 1 - below ** np.maximum(hidden, 0))
        out += energy[leaves].sum()
        w, below, energy, u, hidden = (a[~leaves] for a in (w, below, energy, u, hidden))
        hidden = np.where(np.abs(hidden) < 1e-9, 1e-9, hidden)
        below = np.clip(below / np.maximum(1 - u, 1e-12) ** (1 / hidden), 1e-12, 1 - 1e-9)
        m = visible_normals(rng, -w, alpha)
        cosine = np.clip(-(w * m).sum(1), 0, 1)
        energy = energy * (f0 + (1 - f0) * (1 - cosine) ** 5)
        w = w + 2 * cosine[:, None] * m
    return out / WALKS


def test_the_walk_loses_nothing_on_white() -> None:
    assert walked(np.random.default_rng(0), 0.8, 0.6, 1.0) == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("f0", [0.2, 0.5, 0.8])
@pytest.mark.parametrize("roughness", [30, 60, 80])
def test_a_rough_metal_shows_what_a_random_walk_does(renderer: Renderer, roughness: int, f0: float) -> None:
    """Seen at 53 degrees, within 5 %; single scattering alone would miss 25 % at roughness 0.8 and f0 0.5."""
    camera = replace(FROM_ABOVE, position_m=(0.0, -1.6, 1.2), up=(0.0, 0.0, 1.0), width=32, height=32)
    metal = plain((f0, f0, f0), roughness=roughness, family="metal")
    what = view(Drawable(grid(6.0), STILL, (metal,), 0), ambient=1.0, camera=camera)
    shown = renderer.draw(what, bake=bake_plain).radiance[15:17, 15:17].mean()
    walk = walked(np.random.default_rng(1), roughness / 100, 0.6, f0)
    assert shown == pytest.approx(walk, rel=0.05)


def test_a_rough_metal_blurs_the_edges_of_the_room(renderer: Renderer) -> None:
    """A lobe at an edge meets walls on both sides of it, so no step runs over a ball of metal."""
    names = ("floor", "ceiling", "wall_north", "wall_south", "wall_east", "wall_west")
    materials = {name: plain(DARK if name in ("floor", "wall_east") else BRIGHT) for name in names}
    room = background_drawable(Background("room", (4.0, 4.0, 3.0), materials))
    at = Transform((0.0, 0.0, 0.9), (0.0, 0.0, 0.0), WHITE)
    ball = Drawable(sphere(0.6), at, (plain(WHITE, roughness=30, family="metal"),), 0)
    what = View((room, ball), (), WHITE, FROM_ABOVE, (4.0, 4.0, 3.0), room.materials)
    frame = renderer.draw(what, bake=bake_plain)
    light, inside = frame.radiance[..., 1], (frame.object_id == 0) & (frame.normal[..., 2] > 0.85)
    assert np.ptp(light[inside]) > 0.6
    steps = np.abs(np.diff(light, axis=1))[inside[:, 1:] & inside[:, :-1]]
    assert steps.max() < 0.2 * np.ptp(light[inside])
