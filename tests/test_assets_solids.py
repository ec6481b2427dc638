"""Laws of the solid builders that every family is put together from."""

from __future__ import annotations

import numpy as np
import pytest

from fsid.assets.forms import fluted, loft, plate, slab, squared, turns_to
from fsid.assets.solids import (
    Solid,
    ball,
    box,
    copies,
    cylinder,
    join,
    lathe,
    rotation_matrix,
    sheet,
    sheets,
    sweep,
    tubes,
)


def corners(solid: Solid) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    a, b, c = (solid.vertices[solid.faces[:, k]].astype(float) for k in range(3))
    return a, b, c


def volume(solid: Solid) -> float:
    a, b, c = corners(solid)
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


def test_volumes_of_the_solids():
    """V = pi r^2 h, 2 pi^2 R r^2, 4/3 pi r^3, area x thickness; polygons stay a little inside."""
    assert volume(cylinder(0.1, 0.3, 1e-4, 128)) == pytest.approx(np.pi * 0.1**2 * 0.3, rel=2e-3)
    angle = np.linspace(0, 2 * np.pi, 200, endpoint=False)
    ring = np.c_[np.cos(angle), np.sin(angle), 0 * angle]
    assert volume(sweep(ring, 0.1, 64, closed=True)) == pytest.approx(2 * np.pi**2 * 0.1**2, rel=5e-3)
    assert volume(ball(0.5, 4)) == pytest.approx(4 / 3 * np.pi * 0.5**3, rel=5e-3)
    u, v = np.meshgrid(np.linspace(0, 2, 9), np.linspace(0, 3, 7))
    assert volume(sheet(np.stack([u, v, 0 * u], -1), 0.01)) == pytest.approx(2 * 3 * 0.01, rel=1e-6)
    sharp = volume(box(0.4, 0.2, 0.1, 1e-6))
    assert sharp == pytest.approx(0.4 * 0.2 * 0.1, rel=1e-3)
    assert 0.95 * sharp < volume(box(0.4, 0.2, 0.1, 0.01, 4)) < sharp


def test_volumes_of_the_forms():
    """Prisms are area x height; a loft of equal rings is a prism, too."""
    angle = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    circle = np.c_[np.cos(angle), np.sin(angle)]
    assert volume(plate(circle, 0.3, 1e-5)) == pytest.approx(np.pi * 0.3, rel=2e-3)
    x = np.linspace(0, 2, 12)
    assert volume(slab(np.c_[x, 0.2 + 0 * x], np.c_[x, -0.3 + 0 * x], 0.1, 1e-5)) == pytest.approx(
        0.1, rel=1e-3
    )
    rings = np.stack([np.c_[circle, np.full(90, z)] for z in (0.0, 0.1, 0.3)])
    assert volume(loft(rings)) == pytest.approx(np.pi * 0.3, rel=2e-3)


def test_flat_faces_of_a_rounded_box_have_flat_normals():
    """The bevel turns the normal; the large faces stay exactly axis-aligned."""
    solid = box(0.4, 0.2, 0.1, 0.01)
    on_top = solid.vertices[:, 2] > 0.1 - 1e-9
    np.testing.assert_allclose(solid.normals[on_top], [[0, 0, 1]] * on_top.sum(), atol=1e-12)
    a, b, c = corners(solid)
    assert np.linalg.norm(np.cross(b - a, c - a), axis=1).max() / 2 == pytest.approx(0.38 * 0.18 / 2)


def test_a_lathe_keeps_sharp_turns_and_smooths_shallow_ones():
    sharp = lathe([(0, 0), (1, 0), (1, 1), (0, 1)], 16)
    assert set(np.abs(sharp.normals[:, 2]).round(6)) == {0.0, 1.0}
    shallow = lathe([(1, 0), (1, 1), (0.9, 2)], 16)
    middle = shallow.normals[np.isclose(shallow.vertices[:, 2], 1)]
    assert len(middle) == 16
    assert np.all(middle[:, 2] > 0)


def test_a_prism_keeps_corners_hard_and_round_outlines_smooth():
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
    walls = plate(square, 1.0, 1e-5).normals[:-10]
    assert set(np.abs(walls[:, :2]).round(6).ravel()) == {0.0, 1.0}
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    round_ = plate(np.c_[np.cos(angle), np.sin(angle)], 1.0, 1e-5)
    side = np.abs(round_.normals[:, 2]) < 0.5
    radial = round_.vertices[side, :2] / np.linalg.norm(round_.vertices[side, :2], axis=1, keepdims=True)
    assert (round_.normals[side, :2] * radial).sum(1).min() > 0.999


def test_stretched_normals_stay_perpendicular():
    solid = ball(1.0, 4).stretched(1, 2, 0.3)
    exact = solid.vertices / np.array([1, 2, 0.3]) ** 2
    exact /= np.linalg.norm(exact, axis=1, keepdims=True)
    assert (solid.normals * exact).sum(1).min() > 0.995


def test_warped_normals_stay_perpendicular():
    """A warp that is a stretch gives the normals of `stretched`; flutes agree with the triangles."""
    solid = box(0.4, 0.2, 0.3, 0.02)
    warped = solid.warped(lambda p: p * (1.5, 1.0, 0.5))
    np.testing.assert_allclose(warped.normals, solid.stretched(1.5, 1.0, 0.5).normals, atol=1e-6)
    for warp in (fluted(7, 0.1, 3.0), squared(4.0)):
        tube = lathe([(0.1, 0.005 * k) for k in range(40)], 160).warped(warp)
        a, b, c = corners(tube)
        facet = np.cross(b - a, c - a)
        facet /= np.linalg.norm(facet, axis=1, keepdims=True)
        assert (facet * tube.normals[tube.faces].mean(1)).sum(1).min() > 0.97


def test_copies_equal_placing_one_by_one():
    solid, turn = box(1, 2, 3), (10.0, 20.0, 30.0)
    one = solid.turned(*turn).at(4, 5, 6)
    many = copies(solid, np.stack([np.eye(3), rotation_matrix(*turn)]), np.array([(0, 0, 0), (4, 5, 6)]))
    both = join([solid, one])
    np.testing.assert_allclose(many.vertices, both.vertices)
    np.testing.assert_allclose(many.normals, both.normals)
    np.testing.assert_array_equal(many.faces, both.faces)


def test_many_tubes_and_sheets_equal_them_one_by_one(rng):
    paths = np.cumsum(rng.normal(0.3, 0.1, (3, 8, 3)), axis=1)
    many, each = tubes(paths, 0.02, 6), join([sweep(path, 0.02, 6) for path in paths])
    np.testing.assert_allclose(many.vertices, each.vertices, atol=1e-12)
    np.testing.assert_allclose(many.normals, each.normals, atol=1e-12)
    u, v = np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 5))
    grids = np.stack([np.stack([u, v, bend * u * v], -1) for bend in (0.1, 0.5)])
    assert volume(sheets(grids, 0.01)) == pytest.approx(sum(volume(sheet(g, 0.01)) for g in grids), rel=1e-9)


def test_turns_carry_the_axis_to_its_direction(rng):
    directions = rng.normal(size=(20, 3))
    turns = turns_to(directions, rng.uniform(0, 6.3, 20))
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    np.testing.assert_allclose(turns @ (0.0, 0.0, 1.0), unit, atol=1e-12)
    np.testing.assert_allclose(turns @ turns.transpose(0, 2, 1), np.tile(np.eye(3), (20, 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(turns), 1, atol=1e-12)


def test_resting_stands_on_its_lowest_point():
    assert ball(0.3, 2).turned(10, 20, 30).resting(0.1).vertices[:, 2].min() == pytest.approx(0.1)


def test_a_bevel_takes_at_most_49_percent_of_the_shortest_side():
    """What is left of the flat top of a cube is 2 % wide."""
    cube = box(1.0, 1.0, 1.0, bevel=9.0)
    top = cube.vertices[cube.vertices[:, 2] > 1 - 1e-9]
    np.testing.assert_allclose(np.ptp(top, axis=0)[:2], 0.02, atol=1e-9)
