"""Laws of geometry: what a renderer and a sampler rely on, for every mesh family."""

import numpy as np
import pytest

from fsid.assets import Mesh, build_mesh, mesh_families, registry
from fsid.assets.solids import ball, box, copies, cylinder, join, lathe, rotation_matrix, sheet, sweep
from fsid.errors import FsidError

SEEDS = (0, 1, 2)


def corners(mesh_or_solid):
    vertices = mesh_or_solid.vertices.astype(float)
    return (vertices[mesh_or_solid.faces[:, k]] for k in range(3))


def volume(mesh_or_solid) -> float:
    a, b, c = corners(mesh_or_solid)
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


def part(mesh: Mesh, index: int) -> Mesh:
    keep = mesh.face_parts == index
    return Mesh(mesh.vertices, mesh.normals, mesh.faces[keep], mesh.face_parts[keep], mesh.part_names)


def test_there_are_a_dozen_families():
    assert len(mesh_families()) >= 12
    assert mesh_families() == tuple(sorted(set(mesh_families())))


@pytest.mark.parametrize("family", mesh_families())
@pytest.mark.parametrize("seed", SEEDS)
class TestEveryMesh:
    def test_types_and_sizes(self, family, seed):
        mesh = build_mesh(family, seed)
        assert mesh.vertices.dtype == mesh.normals.dtype == np.float32
        assert mesh.faces.dtype == mesh.face_parts.dtype == np.int32
        assert 300 <= len(mesh.faces) <= 21000
        assert mesh.faces.min() >= 0
        assert mesh.faces.max() < len(mesh.vertices) == len(mesh.normals)
        assert set(mesh.face_parts.tolist()) == set(range(len(mesh.part_names)))

    def test_stands_centred_on_the_floor_in_metres(self, family, seed):
        vertices = build_mesh(family, seed).vertices
        low, high = vertices.min(0), vertices.max(0)
        assert abs(low[2]) < 1e-6
        np.testing.assert_allclose(low[:2] + high[:2], 0, atol=1e-5)
        assert 0.05 < (high - low).max() < 3.0

    def test_no_degenerate_triangle(self, family, seed):
        a, b, c = corners(build_mesh(family, seed))
        assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() / 2 > 1e-11

    def test_normals_are_unit_and_agree_with_the_winding(self, family, seed):
        mesh = build_mesh(family, seed)
        used = np.unique(mesh.faces)
        np.testing.assert_allclose(np.linalg.norm(mesh.normals[used], axis=1), 1, atol=1e-3)
        a, b, c = corners(mesh)
        against = (np.cross(b - a, c - a) * mesh.normals[mesh.faces].sum(1)).sum(1) <= 0
        assert against.mean() < 0.03

    def test_no_triangle_interpolates_its_normal_through_zero(self, family, seed):
        """Opposed normals at two corners have no direction half-way: a shader would divide by zero."""
        mesh = build_mesh(family, seed)
        a, b, c = (mesh.normals[mesh.faces[:, k]] for k in range(3))
        assert min((p * q).sum(1).min() for p, q in ((a, b), (b, c), (c, a))) > -0.9

    def test_every_part_encloses_a_volume(self, family, seed):
        """Outward winding everywhere: a sheet too has two sides and a rim."""
        mesh = build_mesh(family, seed)
        for index, name in enumerate(mesh.part_names):
            assert volume(part(mesh, index)) > 0, name

    def test_name_and_seed_decide_alone(self, family, seed):
        again = build_mesh.__wrapped__(family, seed)
        np.testing.assert_array_equal(again.vertices, build_mesh(family, seed).vertices)
        other = build_mesh(family, seed + 100)
        assert again.vertices.shape != other.vertices.shape or not np.allclose(again.vertices, other.vertices)


def test_a_new_family_needs_only_its_decorator(monkeypatch):
    monkeypatch.setattr(registry, "_MESHES", dict(registry._MESHES))

    @registry.mesh_family("brick_of_the_test")
    def brick(rng):
        return {"clay": [box(0.2, 0.1, rng.uniform(0.05, 0.07))]}

    assert "brick_of_the_test" in mesh_families()
    assert build_mesh("brick_of_the_test", 1).part_names == ("clay",)


def test_an_unknown_family_names_itself():
    with pytest.raises(FsidError, match="'sofa'"):
        build_mesh("sofa", 0)


def test_cached_meshes_cannot_be_changed():
    with pytest.raises(ValueError, match="read-only"):
        build_mesh(mesh_families()[0], 0).vertices[0] = 1


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


def test_stretched_normals_stay_perpendicular():
    solid = ball(1.0, 4).stretched(1, 2, 0.3)
    exact = solid.vertices / np.array([1, 2, 0.3]) ** 2
    exact /= np.linalg.norm(exact, axis=1, keepdims=True)
    assert (solid.normals * exact).sum(1).min() > 0.995


def test_copies_equal_placing_one_by_one():
    solid, turn = box(1, 2, 3), (10.0, 20.0, 30.0)
    one = solid.turned(*turn).at(4, 5, 6)
    many = copies(solid, np.stack([np.eye(3), rotation_matrix(*turn)]), np.array([(0, 0, 0), (4, 5, 6)]))
    both = join([solid, one])
    np.testing.assert_allclose(many.vertices, both.vertices)
    np.testing.assert_allclose(many.normals, both.normals)
    np.testing.assert_array_equal(many.faces, both.faces)
