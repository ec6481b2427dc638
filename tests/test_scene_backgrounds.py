"""Geometry of the surroundings: closed where it must be, facing the objects, flat where they stand."""

import numpy as np
import pytest

from fsid.assets import BACKGROUND_PARTS, Mesh, build_background, table_size_m
from fsid.errors import FsidError
from fsid.scene import SceneConfig
from fsid.scene.config import BackgroundConfig
from fsid.scene.model import Background
from fsid.scene.surroundings import KINDS, background_rand, space_of

SIZE = (4.0, 5.0, 3.0)


def triangles(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    vertices = mesh.vertices.astype(float)
    a, b, c = (vertices[mesh.faces[:, k]] for k in range(3))
    return a, b, c


def part(mesh: Mesh, name: str) -> np.ndarray:
    faces = mesh.faces[mesh.face_parts == mesh.part_names.index(name)]
    return mesh.vertices[faces.ravel()]


@pytest.mark.parametrize("kind", BACKGROUND_PARTS)
def test_every_kind_is_a_sound_mesh(kind):
    mesh = build_background(kind, SIZE if kind != "open-air" else (200.0, 240.0, 9.0))
    assert mesh.part_names == BACKGROUND_PARTS[kind]
    assert mesh.vertices.dtype == mesh.normals.dtype == np.float32
    assert mesh.faces.dtype == mesh.face_parts.dtype == np.int32
    assert set(mesh.face_parts.tolist()) == set(range(len(mesh.part_names)))
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    a, b, c = triangles(mesh)
    cross = np.cross(b - a, c - a)
    assert np.linalg.norm(cross, axis=1).min() > 1e-8
    assert ((cross * mesh.normals[mesh.faces].sum(1)).sum(1) > 0).all()


@pytest.mark.parametrize("kind", ["room", "backdrop", "tabletop"])
def test_a_ray_from_inside_always_meets_a_wall(kind):
    """A closed box leaks no light: the solid angles of all triangles but the table's sum to 4 pi."""
    mesh = build_background(kind, SIZE)
    walls = np.array([name != "table" for name in mesh.part_names])[mesh.face_parts]
    a, b, c = (v[walls] - (0.3, -0.2, 1.1) for v in triangles(mesh))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    ab, bc, ca = ((p * q).sum(1) for p, q in ((a, b), (b, c), (c, a)))
    angle = 2 * np.arctan2((a * np.cross(b, c)).sum(1), la * lb * lc + ab * lc + bc * la + ca * lb)
    overlap = 1.0 if kind != "backdrop" else 1.01  # the corner behind the curve is walled twice
    assert 4 * np.pi * 0.999 < -angle.sum() < 4 * np.pi * overlap * 1.001


def test_objects_stand_on_zero():
    assert part(build_background("room", SIZE), "floor")[:, 2].max() == 0
    assert part(build_background("backdrop", SIZE), "sweep")[:, 2].min() == 0
    assert part(build_background("tabletop", SIZE), "table")[:, 2].max() == pytest.approx(0, abs=1e-6)
    assert part(build_background("tabletop", SIZE), "floor")[:, 2].max() == pytest.approx(-0.75)
    ground = build_background("open-air", (200.0, 200.0, 9.0)).vertices
    near = np.hypot(ground[:, 0], ground[:, 1]) < 5
    assert near.sum() > 50
    assert (ground[near, 2] == 0).all()
    assert 2 < ground[:, 2].max() <= 9


def test_the_table_is_as_large_as_stated():
    table = part(build_background("tabletop", SIZE), "table")
    np.testing.assert_allclose(np.ptp(table, axis=0)[:2], table_size_m(SIZE), rtol=1e-6)


@pytest.mark.parametrize(
    ("kind", "size_m", "message"),
    [
        ("cellar", SIZE, "'cellar'"),
        ("room", (0.0, 5.0, 3.0), "size_m"),
        ("room", (4, 5, float("nan")), "size_m"),
    ],
)
def test_bad_arguments_name_themselves(kind, size_m, message):
    with pytest.raises(FsidError, match=message):
        build_background(kind, size_m)


@pytest.mark.parametrize(
    ("kind", "size_m", "low", "high", "ground", "floor_m"),
    [
        ("room", SIZE, (-1.8, -2.3, 0.1), (1.8, 2.3, 2.8), (2.0, 2.5), 0.0),
        ("backdrop", SIZE, (-1.8, -2.3, 0.1), (1.8, 1.7, 2.8), (2.0, 2.5), 0.0),  # before the curve
        ("tabletop", SIZE, (-1.8, -2.3, 0.1), (1.8, 2.3, 2.05), (1.3, 1.3), -0.75),
        ("open-air", (80.0, 100.0, 9.0), (-32.0, -40.0, 0.1), (32.0, 40.0, 50.0), (40.0, 50.0), 0.0),
        ("open-air", (300.0, 300.0, 9.0), (-50.0, -50.0, 0.1), (50.0, 50.0, 50.0), (150.0, 150.0), 0.0),
    ],
)
def test_free_space_is_inside_the_walls_and_above_the_ground(kind, size_m, low, high, ground, floor_m):
    """0.2 m off what the mesh has there; out of doors four fifths of the ground, 50 m at most."""
    space = space_of(Background(kind, size_m, {}))
    np.testing.assert_allclose(space.low, low)
    np.testing.assert_allclose(space.high, high)
    np.testing.assert_allclose(space.ground, ground)
    assert space.floor_m == floor_m
    assert space.open_air_m == (size_m if kind == "open-air" else None)
    mesh = build_background(kind, size_m)
    if kind != "open-air":
        np.testing.assert_allclose(mesh.vertices[:, 2].max() - 0.2, high[2], atol=1e-5)
        np.testing.assert_allclose(mesh.vertices[:, 2].min(), floor_m, atol=1e-5)
        np.testing.assert_allclose(mesh.vertices[:, :2].min(0) + 0.2, low[:2], atol=1e-5)


def test_a_way_ends_at_the_first_side_of_the_box():
    space = space_of(Background("room", SIZE, {}))
    start = np.array((0.5, -0.7, 1.2))
    directions = np.random.default_rng(0).normal(size=(50, 3))
    for margin in (0.0, 0.3):
        for direction in (*directions, (0.0, 0.0, 1.0), (-1.0, 0.0, 0.0)):
            end = start + np.array(direction) * space.reach(start, np.array(direction), np.inf, margin)
            gap = np.minimum(end - space.low, space.high - end).min()
            assert gap == pytest.approx(margin, abs=1e-9)
            assert space.reach(start, np.array(direction), 1e-3, margin) == 1e-3


def test_sizes_of_backgrounds_are_those_that_are_configured(monkeypatch):
    """Each side of a room is even by itself; the ground is square, its width log-uniform."""
    monkeypatch.setattr("fsid.scene.surroundings.surface_rand", lambda *given: None)  # takes a while
    even = (0.0, 0.25, 0.5, 0.75, 1.0)
    for kind, spans in (("room", ((3, 6), (3, 6), (2.4, 3.2))), ("open-air", ((150, 500), (0, 20)))):
        shares = tuple(float(name == kind) for name in KINDS)
        config = SceneConfig(background=BackgroundConfig(kind_shares=shares))
        drawn = [background_rand(np.random.default_rng(seed), config)[0] for seed in range(150)]
        sizes = np.array([each.size_m for each in drawn])
        if kind == "open-air":
            np.testing.assert_array_equal(sizes[:, 0], sizes[:, 1])
            places = np.stack([np.log(sizes[:, 0] / 150) / np.log(500 / 150), sizes[:, 2] / 20], -1)
        else:
            low, high = np.array(spans).T
            places = (sizes - low) / (high - low)
        for place in places.T:
            np.testing.assert_allclose(np.quantile(place, even), even, atol=0.12)
        assert np.abs(np.corrcoef(places.T) - np.eye(places.shape[1])).max() < 0.3
