"""Laws of geometry: what a renderer and a sampler rely on, for every mesh family."""

from __future__ import annotations

import runpy
import time
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import maximum_filter
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, cKDTree

from fsid.assets import PART_KINDS, Mesh, build_mesh, mesh_families, part_kind, registry
from fsid.assets.meshes.cords import _lying_rand
from fsid.assets.meshes.soft import pillow
from fsid.assets.solids import Solid
from fsid.assets.streams import rng_of
from fsid.errors import FsidError

REPOSITORY = Path(__file__).resolve().parents[1]
SEEDS = range(4)
STRANDS = {"tuft", "fur", "brush", "rug", "wig", "feathers"}
"""Families of many thin strands, which may have 25000 triangles; the others have 20000 at most."""


def corners(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(float) for k in range(3))
    return a, b, c


@cache
def meshes(family: str) -> tuple[Mesh, ...]:
    return tuple(build_mesh(family, seed) for seed in SEEDS)


def test_there_are_fifty_five_families():
    assert len(mesh_families()) >= 55
    assert mesh_families() == tuple(sorted(set(mesh_families())))


ISSUE = {
    "table desk dining_chair office_chair armchair stool bench couch bed cabinet bookshelf drawer_unit",
    "monitor television laptop keyboard lamp desk_lamp pendant_lamp potted_plant flower vase bottle",
    "glass bowl plate mug parcel cushion curtain draped_cloth rug rope cable yarn_ball toy_blocks clock",
    "picture_frame coins banknotes hammer wrench screwdriver shoe stones fruit revolution",
    "sweep blob sheet_stack tuft fur",
}


def test_what_the_paper_and_a_household_need_is_there():
    assert {name for line in ISSUE for name in line.split()} <= set(mesh_families())


@pytest.mark.parametrize("family", mesh_families())
class TestEveryFamily:
    def test_types_and_counts(self, family):
        for mesh in meshes(family):
            assert mesh.vertices.dtype == mesh.normals.dtype == np.float32
            assert mesh.faces.dtype == mesh.face_parts.dtype == np.int32
            assert np.isfinite(mesh.vertices).all()
            assert 4 <= len(mesh.faces) <= (25000 if family in STRANDS else 20000)
            assert mesh.faces.min() >= 0
            assert mesh.faces.max() < len(mesh.vertices) == len(mesh.normals)
            assert set(mesh.face_parts.tolist()) == set(range(len(mesh.part_names)))

    def test_stands_centred_on_the_floor_in_metres(self, family):
        for mesh in meshes(family):
            used = mesh.vertices[np.unique(mesh.faces)]
            low, high = used.min(0), used.max(0)
            assert abs(low[2]) < 1e-3
            np.testing.assert_allclose(low[:2] + high[:2], 0, atol=2e-3)
            assert 0.01 < (high - low).max() < 3.0

    def test_no_degenerate_triangle(self, family):
        for mesh in meshes(family):
            a, b, c = corners(mesh)
            assert np.linalg.norm(np.cross(b - a, c - a), axis=1).min() / 2 > 1e-11

    def test_normals_are_unit_and_agree_with_the_winding(self, family):
        for mesh in meshes(family):
            used = np.unique(mesh.faces)
            np.testing.assert_allclose(np.linalg.norm(mesh.normals[used], axis=1), 1, atol=1e-3)
            a, b, c = corners(mesh)
            cross = np.cross(b - a, c - a)
            against = (cross * mesh.normals[mesh.faces].sum(1)).sum(1) <= 0
            areas = np.linalg.norm(cross, axis=1)
            assert against.mean() < 0.03
            assert areas[against].sum() < 0.01 * areas.sum()

    def test_no_triangle_interpolates_its_normal_through_zero(self, family):
        """Opposed normals at two corners have no direction half-way: a shader would divide by zero."""
        for mesh in meshes(family):
            a, b, c = (mesh.normals[mesh.faces[:, k]] for k in range(3))
            assert min((p * q).sum(1).min() for p, q in ((a, b), (b, c), (c, a))) > -0.9

    def test_every_part_encloses_a_volume(self, family):
        """Outward winding everywhere: a sheet too has two sides and a rim."""
        for mesh in meshes(family):
            a, b, c = corners(mesh)
            volumes = np.bincount(mesh.face_parts, np.einsum("fi,fi->f", a, np.cross(b, c)) / 6)
            assert volumes.min() > 0, mesh.part_names[volumes.argmin()]

    def test_no_two_faces_fight_for_the_same_pixels(self, family):
        """Coplanar faces that look the same way do not overlap (z-fighting): never two parts, and hardly
        ever one part with itself, where nobody could see it."""
        for mesh in meshes(family)[:2]:
            assert fighting_share(mesh, between_parts=True) < 1e-4, fighting_parts(mesh)
            assert fighting_share(mesh) < 1e-2, fighting_parts(mesh)

    def test_name_and_seed_decide_alone(self, family):
        again = build_mesh.__wrapped__(family, 0)
        np.testing.assert_array_equal(again.vertices, meshes(family)[0].vertices)
        for one, other in zip(meshes(family), meshes(family)[1:], strict=False):
            same = one.vertices.shape == other.vertices.shape
            assert not same or np.abs(one.vertices - other.vertices).max() > 1e-3

    def test_parts_are_named_in_words(self, family):
        for mesh in meshes(family):
            assert all(name.replace("_", "").isalpha() and name.islower() for name in mesh.part_names)

    def test_has_a_line_for_the_guide(self, family):
        assert len(registry.mesh_family_summary(family)) > 10


def fighting(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Areas and numbers of the larger triangles, and pairs (i, j): i has inner points on j, facing alike."""
    a, b, c = corners(mesh)
    cross = np.cross(b - a, c - a)
    area = np.linalg.norm(cross, axis=1) / 2
    extent = float(np.ptp(mesh.vertices, axis=0).max())
    large = np.flatnonzero(area > (0.006 * extent) ** 2)
    a, b, c, normal = a[large], b[large], c[large], cross[large] / (2 * area[large, None])
    level = (a * normal).sum(1)
    flatness = 5e-5 * extent
    planes = cKDTree(np.c_[normal * (flatness / 0.002), level])
    near = planes.query_pairs(flatness, output_type="ndarray")
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    meet = (low[near[:, 0]] <= high[near[:, 1]] + flatness).all(1)
    meet &= (low[near[:, 1]] <= high[near[:, 0]] + flatness).all(1)
    near = np.vstack([near[meet], near[meet][:, ::-1]])
    hit = np.zeros(len(near), bool)
    i, j = near.T
    for weights in ((1 / 3, 1 / 3, 1 / 3), (0.7, 0.15, 0.15), (0.15, 0.7, 0.15), (0.15, 0.15, 0.7)):
        point = weights[0] * a[i] + weights[1] * b[i] + weights[2] * c[i]
        inside = np.abs(((point - a[j]) * normal[j]).sum(1)) < flatness
        for p, q in ((a, b), (b, c), (c, a)):
            side = (np.cross(q[j] - p[j], point - p[j]) * normal[j]).sum(1)
            inside &= side > 1e-3 * area[large][j]
        hit |= inside
    return area[large], near[hit], large


def fighting_share(mesh: Mesh, *, between_parts: bool = False) -> float:
    """Share of the surface that lies on another face in the same plane, facing the same way."""
    area, pairs, large = fighting(mesh)
    if between_parts:
        part = mesh.face_parts[large]
        pairs = pairs[part[pairs[:, 0]] != part[pairs[:, 1]]]
    return float(area[np.unique(pairs[:, 0])].sum() / area.sum()) if len(pairs) else 0.0


def fighting_parts(mesh: Mesh) -> set[tuple[str, str]]:
    """Names of the parts whose faces coincide."""
    _, pairs, large = fighting(mesh)
    parts = mesh.face_parts[large]
    return {(mesh.part_names[parts[i]], mesh.part_names[parts[j]]) for i, j in pairs}


def test_the_law_against_coincident_faces_can_fail():
    square = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], np.float32)
    up = np.tile(np.float32([0, 0, 1]), (8, 1))
    faces = np.array([(0, 1, 2), (0, 2, 3)], np.int32)

    def two(shift: np.ndarray, flip: bool = False) -> Mesh:
        second = faces[:, ::-1] if flip else faces
        both = np.vstack([square, square + shift]).astype(np.float32)
        return Mesh(both, up, np.vstack([faces, second + 4]), np.array([0, 0, 1, 1], np.int32), ("a", "b"))

    assert fighting_share(two(np.array((0.3, 0.2, 0.0)))) > 0.3
    assert fighting_share(two(np.array((0.3, 0.2, 0.0))), between_parts=True) > 0.3
    assert fighting_share(two(np.array((0.3, 0.2, 0.001)))) == 0
    assert fighting_share(two(np.array((1.0, 0.0, 0.0)))) == 0
    assert fighting_share(two(np.array((0.3, 0.2, 0.0)), flip=True)) == 0


def solids_of(family: str, seed: int) -> dict[str, list[Solid]]:
    """The solids of each part, before they are one mesh."""
    build_mesh(family, seed)  # fills the registry
    return {name: list(group) for name, group in registry._MESHES[family](rng_of(family, seed)).items()}


HEAPS = {
    "fruit": ("peel",),
    "bowl": ("peel",),
    "dice": ("plastic_dice",),
    "coins": ("metal_coins", "metal_other"),
    "mushrooms": ("peel_cap",),
    "bolts": ("metal_bolts", "metal_nuts", "metal_washers"),
    "pencils": ("shaft", "shaft_other"),
    "scissors": ("plastic_grips",),
    "screwdriver": ("plastic_handles",),
    "polyhedron": ("glass_gem", "stone"),
    "seashells": ("ceramic_spirals", "ceramic_fans"),
    "springs": ("metal",),
    "vegetables": ("peel",),
    "towels": ("cloth", "cloth_other"),
    "toy_car": ("rubber_tyres",),
}
"""Families of bodies that are beside or on each other, and the parts that are such bodies."""


@pytest.mark.parametrize("family", HEAPS)
def test_bodies_of_a_heap_do_not_enter_each_other(family):
    """No vertex of one lies in the convex hull of another."""
    for seed in range(8):
        parts = solids_of(family, seed)
        bodies = [solid.vertices for name in HEAPS[family] for solid in parts.get(name, [])]
        hulls = [ConvexHull(points).equations for points in bodies]
        for i, points in enumerate(bodies):
            for j, planes in enumerate(hulls):
                if i != j:
                    depth = -(points @ planes[:, :3].T + planes[:, 3]).max(1)
                    assert depth.max() < 1e-5, (family, seed, i, j)


def points_on(solid: Solid, step: float) -> np.ndarray:
    """Points on all triangles, hardly farther apart than `step`: the middles of sides as they are halved."""
    triangles, points = solid.vertices[solid.faces], [solid.vertices]
    while len(triangles):
        sides = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
        long = sides.max(1) > step
        triangles, first = triangles[long], sides[long].argmax(1)
        a, b, c = (triangles[np.arange(len(first)), (first + k) % 3] for k in range(3))
        points.append((a + b) / 2)
        triangles = np.concatenate([np.stack([a, points[-1], c], 1), np.stack([points[-1], b, c], 1)])
    return np.concatenate(points)


def separate(solid: Solid) -> list[Solid]:
    """The bodies that are in one solid: faces that share points."""
    place = np.unique(solid.vertices.round(6), axis=0, return_inverse=True)[1].ravel()
    a, b, c = place[solid.faces].T
    links = coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, c])), shape=(len(place),) * 2)
    body = connected_components(links, directed=False)[1][a]
    return [Solid(solid.vertices, solid.normals, solid.faces[body == k]) for k in np.unique(body)]


def heights(solid: Solid, low: np.ndarray, shape: tuple[int, int], step: float) -> np.ndarray:
    """(2, rows, columns): its lower and its upper height at the points of a net, where it has one."""
    out = np.stack([np.full(shape, np.inf), np.full(shape, -np.inf)])
    triangles = solid.vertices[solid.faces]
    triangles[..., :2] = (triangles[..., :2] - low) / step
    for a, b, c in triangles:
        first, last = np.ceil(np.minimum(a, np.minimum(b, c))), np.maximum(a, np.maximum(b, c))
        x, y = np.mgrid[int(first[0]) : int(last[0]) + 1, int(first[1]) : int(last[1]) + 1]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if not x.size or abs(area) < 1e-9:
            continue
        v = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
        w = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
        on = (v > -1e-9) & (w > -1e-9) & (v + w < 1 + 1e-9)
        at, z = (x[on], y[on]), (a[2] + v * (b[2] - a[2]) + w * (c[2] - a[2]))[on]
        out[0][at], out[1][at] = np.minimum(out[0][at], z), np.maximum(out[1][at], z)
    return out


def cuts_and_gaps(sheets: list[Solid], step: float) -> tuple[list[float], list[float]]:
    """Of each sheet: how deep it cuts another, and its least height above what is below, or 2 steps aside."""
    used = np.concatenate([s.vertices[np.unique(s.faces)] for s in sheets])
    low, floor = used[:, :2].min(0), used[:, 2].min()
    rows, columns = (np.ptp(used[:, :2], axis=0) / step).astype(int) + 2
    maps = [heights(s, low, (rows, columns), step) for s in sheets]
    wide = [maximum_filter(top, 5) for _, top in maps]
    cuts, gaps = [], []
    for one, (bottom, top) in enumerate(maps):
        on, cut = np.isfinite(top), 0.0
        below = np.full((rows, columns), floor)
        for other in set(range(len(maps))) - {one}:
            both = on & np.isfinite(maps[other][1])
            if both.any():
                above = ((bottom + top) - maps[other].sum(0))[both] / 2
                cut = max(cut, min(above.max(), -above.min()))
            beneath = on & (wide[other] < (bottom + top) / 2)
            below[beneath] = np.maximum(below, wide[other])[beneath]
        cuts.append(cut)
        gaps.append(float((bottom - below)[on].min()))
    return cuts, gaps


@pytest.mark.parametrize("family", ["fallen_leaves", "sheet_stack", "banknotes", "cards"])
@pytest.mark.filterwarnings("ignore:invalid value")
def test_what_is_thin_lies_on_what_is_below_it(family):
    """It cuts nothing by more than a millimetre, and hovers by less than 2 % of the width of its heap."""
    for seed in (0, 2, 4, 6):
        parts = {
            name: group
            for name, group in solids_of(family, seed).items()
            if name not in ("band", "paper_bundle")
        }
        sheets = [sheet for group in parts.values() for solid in group for sheet in separate(solid)]
        width = np.ptp(np.concatenate([s.vertices for s in sheets]), axis=0)
        if family != "cards" or width[2] < 0.05:  # a house stands
            cuts, gaps = cuts_and_gaps(sheets, 0.002)
            assert max(cuts) < 0.001, (family, seed)
            assert max(gaps) < 0.02 * width[:2].max(), (family, seed)


def test_bricks_stand_on_bricks_and_enter_none():
    for seed in range(12):
        parts = solids_of("studded_bricks", seed)
        boxes = np.array([(s.vertices.min(0), s.vertices.max(0)) for g in parts.values() for s in g])
        low, high = boxes[:, 0], boxes[:, 1] - np.where(np.arange(len(boxes))[:, None] > 0, (0, 0, 0.0017), 0)
        shared = np.minimum(high[:, None], high) - np.maximum(low[:, None], low)
        both = shared.min(2) > 1e-4
        np.fill_diagonal(both, False)
        assert not both.any(), seed
        under = (np.abs(low[:, None, 2] - high[:, 2]) < 1e-4) & (shared[..., :2].min(2) > 0.002)
        assert under[1:].any(1).all(), seed


def times_through(one: np.ndarray, other: np.ndarray) -> float:
    """How often a closed path (n, 3) goes through another: Gauss's linking number, without its sign."""
    steps = [np.roll(path, -1, axis=0) - path for path in (one, other)]
    a, b = (path + step / 2 for path, step in zip((one, other), steps, strict=True))
    apart = a[:, None] - b
    turned = np.cross(steps[0][:, None], steps[1])
    return abs(float(((apart * turned).sum(2) / np.linalg.norm(apart, axis=2) ** 3).sum())) / (4 * np.pi)


def test_links_and_ring_of_a_chain_are_linked():
    """Each goes through the next once, the ring through the first; wires share less than half a radius."""
    for seed in range(12):
        parts = solids_of("chain", seed)
        rings, radii = [], []
        for solid, sides in ((parts["metal_ring"][0], 8), (parts["metal"][0], 7)):
            tubes = solid.vertices.reshape(-1, 18, sides, 3)
            middles = tubes.mean(2)
            share = np.linspace(0, 1, 10, endpoint=False)[:, None, None]
            fine = middles[:, :, None] + share[:, 0] * (np.roll(middles, -1, axis=1) - middles)[:, :, None]
            rings += list(fine.reshape(len(tubes), -1, 3))
            radii += [float(np.linalg.norm(tubes[0, 0, 0] - middles[0, 0]))] * len(tubes)
        for one in range(len(rings) - 1):
            assert times_through(rings[one], rings[one + 1]) == pytest.approx(1, abs=0.1), (seed, one)
        trees = [cKDTree(ring) for ring in rings]
        for one, tree in enumerate(trees):
            for other in range(one):
                near = tree.query(rings[other])[0].min()
                assert near > radii[one] + radii[other] - 0.5 * radii[-1], (seed, one, other)


def groups_that_touch(solids: list[Solid]) -> list[set[int]]:
    """Numbers of solids: from each of a group a path of solids that touch leads to all of it."""
    step = 0.008 * float(np.ptp(np.concatenate([s.vertices for s in solids]), axis=0).max())
    clouds = [points_on(s, step) for s in solids]
    lows, highs = (np.array([fn(s.vertices, axis=0) for s in solids]) for fn in (np.min, np.max))
    left, groups = set(range(len(solids))), []
    while left:
        group = {left.pop()}
        waiting = list(group)
        while waiting:
            one = waiting.pop()
            tree = cKDTree(clouds[one])
            for other in left - group:
                low, high = (
                    np.maximum(lows[one], lows[other]) - step,
                    np.minimum(highs[one], highs[other]) + step,
                )
                near = clouds[other][((clouds[other] > low) & (clouds[other] < high)).all(1)]
                if len(near) and tree.query(near, distance_upper_bound=step)[0].min() < step:
                    group.add(other)
                    waiting.append(other)
        left -= group
        groups.append(group)
    return groups


def flat(parts: dict[str, list[Solid]]) -> list[Solid]:
    return [solid for group in parts.values() for solid in group]


def lowest(solids: list[Solid]) -> float:
    return min(float(solid.vertices[:, 2].min()) for solid in solids)


@pytest.mark.parametrize(
    "family",
    ["armchair", "bench", "lamp", "office_chair", "parcel", "pendant_lamp", "scissors", "spectacles"],
)
def test_all_of_a_thing_hangs_together(family):
    """From any of its solids a path of solids that touch leads to any other: nothing is held by nothing."""
    for seed in (1, 2, 6):
        assert len(groups_that_touch(flat(solids_of(family, seed)))) == 1, (family, seed)


@pytest.mark.parametrize("family", ["logs", "towels", "toy_blocks"])
def test_what_is_piled_up_lies_on_what_is_below(family):
    """Everything that touches reaches down to the floor."""
    for seed in range(8):
        solids = flat(solids_of(family, seed))
        for group in groups_that_touch(solids):
            assert lowest([solids[k] for k in group]) < lowest(solids) + 1e-3, (family, seed)


def extent(solid: Solid) -> np.ndarray:
    return np.ptp(solid.vertices, axis=0)


@pytest.mark.parametrize("family", ["couch", "armchair"])
def test_a_back_cushion_is_as_square_as_a_seat(family):
    """Seen from the front it fills the corners of its box: an ellipse would fill 79 % of it."""
    for seed in range(4):
        for cushion in solids_of(family, seed)["cloth_cushions"]:
            flat = (
                cushion.vertices[:, :2]
                if extent(cushion)[1] > extent(cushion)[2]
                else cushion.vertices[:, ::2]
            )
            assert ConvexHull(flat).volume > 0.83 * np.prod(np.ptp(flat, axis=0))


def test_rings_hold_their_curtain():
    """They reach below its upper edge, at places where it passes below the rod."""
    for seed in range(6):
        parts = solids_of("curtain", seed)
        (cloth,), (rings,) = parts["cloth"], parts["metal_rings"]
        top = float(cloth.vertices[:, 2].max())
        assert rings.vertices[:, 2].min() < top - 0.001
        low = rings.vertices[rings.vertices[:, 2] < top + 0.002]
        edge = cloth.vertices[cloth.vertices[:, 2] > top - 0.002]
        corners = np.concatenate([edge[:-1] + s * (edge[1:] - edge[:-1]) for s in np.linspace(0, 1, 9)])
        assert cKDTree(corners[:, :2]).query(low[:, :2])[0].max() < 0.02


def test_books_stand_within_their_shelf():
    for seed in range(30):
        parts = solids_of("bookshelf", seed)
        frame = np.concatenate([s.vertices for s in parts.pop("frame")])
        books = np.concatenate([s.vertices for group in parts.values() for s in group])
        assert (books.min(0) > frame.min(0)).all()
        assert (books.max(0) < frame.max(0)).all()


def test_a_keyboard_and_its_cable_lie_on_the_desk():
    """Front and back edge of the case, and the free end of the cable."""
    for seed in range(4):
        parts = solids_of("keyboard", seed)
        case, cable = (np.concatenate([s.vertices for s in parts[name]]) for name in ("case", "rubber_cable"))
        floor = min(case[:, 2].min(), cable[:, 2].min())
        for edge in (
            case[case[:, 1] < 0],
            case[case[:, 1] > 0],
            cable[cable[:, 1] > cable[:, 1].max() - 0.01],
        ):
            assert edge[:, 2].min() - floor < 5e-4


def test_a_cushion_has_no_wrinkles_where_its_piping_is(rng):
    plain, wrinkled = pillow(0.4, 0.5, 0.15, 3.0, level=4), pillow(0.4, 0.5, 0.15, 3.0, rng, 4)
    seam = np.abs(plain.vertices[:, 2]) < 1e-9
    assert seam.sum() > 16
    np.testing.assert_allclose(wrinkled.vertices[seam], plain.vertices[seam], atol=1e-9)


def test_a_lying_cord_is_on_the_floor_or_on_itself():
    """And never in itself: strands that cross are one thickness apart."""
    bare = 0
    for seed in range(12):
        path = _lying_rand(np.random.default_rng(seed), 0.01, 260)
        walked = np.r_[0, np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))]
        far = np.abs(walked[:, None] - walked) > 0.04
        assert np.linalg.norm(path[:, None] - path, axis=-1)[far].min() > 0.0085
        assert path[:, 2].min() == pytest.approx(0.005)
        if np.linalg.norm(path[:, None, :2] - path[:, :2], axis=-1)[far].min() > 0.01:
            np.testing.assert_allclose(path[:, 2], 0.005)
            bare += 1
    assert bare


@pytest.mark.parametrize(("family", "foot"), [("potted_plant", "pot"), ("bush", "wood_bark")])
def test_no_leaf_holds_a_plant_above_the_floor(family, foot):
    for seed in range(20):
        parts = solids_of(family, seed)
        low = {name: min(float(s.vertices[:, 2].min()) for s in group) for name, group in parts.items()}
        assert low[foot] < low["leaf"] + 0.01, seed


def test_leaves_do_not_pass_through_a_vase():
    """No triangle of a leaf is partly within and partly without the cylinder of its mouth, below its rim."""
    vases = 0
    for seed in range(12):
        parts = solids_of("flower", seed)
        if "glass_vase" not in parts or "leaf" not in parts:
            continue
        vases += 1
        vase, leaf = parts["glass_vase"][0], parts["leaf"]
        rim = float(vase.vertices[:, 2].max())
        mouth = float(np.hypot(*vase.vertices[vase.vertices[:, 2] > rim - 0.004, :2].T).max())
        corner = np.concatenate([s.vertices[s.faces] for s in leaf])
        reach = np.hypot(corner[..., 0], corner[..., 1])
        crosses = (reach.min(1) < 0.85 * mouth) & (reach.max(1) > 0.87 * mouth)
        assert not (crosses & (corner[..., 2].max(1) < rim - 0.01)).any()
    assert vases


def test_a_brush_has_a_handle_as_wide_as_its_ferrule():
    for seed in range(6):
        parts = solids_of("brush", seed)
        handle, ferrule = extent(parts["wood_handle"][0]), extent(parts["metal_ferrule"][0])
        assert handle[0] > 0.75 * ferrule[0]


def test_the_claw_of_a_hammer_bends_towards_its_handle():
    """And a hammer lies on its head and the end of its handle, whatever its head."""
    claws = 0
    for seed in range(12):
        parts = solids_of("hammer", seed)
        head, handle = parts["metal_head"], parts["wood_handle"][0].vertices
        for prong in head[2:] if len(head) == 4 else []:
            tip = prong.vertices[prong.vertices[:, 1] > prong.vertices[:, 1].max() - 1e-3]
            root = prong.vertices[prong.vertices[:, 1] < prong.vertices[:, 1].min() + 1e-3]
            assert tip[:, 0].mean() < root[:, 0].mean() - 0.008
            claws += 1
        low = min(float(s.vertices[:, 2].min()) for s in head)
        assert abs(low - handle[:, 2].min()) < 0.006
    assert claws


def test_teeth_of_gears_meet_gaps():
    """No point of a rim lies deeper in the next wheel than a quarter of a tooth is high."""
    for seed in range(6):
        rims = []
        for solid in solids_of("gears", seed)["metal_gears"]:
            middle = (solid.vertices[:, :2].min(0) + solid.vertices[:, :2].max(0)) / 2
            rims.append((middle, solid.vertices[:, :2]))
        axles = [s.vertices[:, :2].mean(0) for s in solids_of("gears", seed)["axles"]]
        wheels = []
        for axle in axles:
            near = [p for m, p in rims if np.hypot(*(m - axle)) < np.hypot(*np.ptp(p, axis=0)) / 3]
            wheels.append(np.concatenate(near) - axle)
        for k in range(len(axles) - 1):
            one, other = wheels[k], wheels[k + 1] + axles[k + 1] - axles[k]
            reach = np.hypot(*one.T)
            rim = one[reach > 0.8 * reach.max()]
            angle = np.arctan2(rim[:, 1], rim[:, 0])
            bins = np.round(angle / (2 * np.pi) * 720).astype(int) % 720
            outline = np.zeros(720)
            np.maximum.at(outline, bins, np.hypot(*rim.T))
            known = np.flatnonzero(outline)
            at = np.arctan2(other[:, 1], other[:, 0]) / (2 * np.pi) * 720 % 720
            inside = np.interp(at, known, outline[known], period=720) - np.hypot(*other.T)
            tooth = reach.max() - outline[known].min()
            assert inside.max() < 0.25 * tooth, (seed, k)


def test_a_spanner_is_one_piece_and_its_ring_is_open():
    for seed in range(8):
        metal = solids_of("wrench", seed)["metal"]
        shafts, rings = metal[::3], metal[1::3]
        assert len(groups_that_touch(metal)) == len(rings), seed
        for shaft, ring in zip(shafts, rings, strict=True):
            middle = (ring.vertices[:, :2].min(0) + ring.vertices[:, :2].max(0)) / 2
            hole = np.hypot(*(ring.vertices[:, :2] - middle).T).min()
            assert np.hypot(*(shaft.vertices[:, :2] - middle).T).min() > hole


def test_an_open_umbrella_lies_on_two_ribs_and_its_handle():
    for seed in range(8):
        parts = solids_of("umbrella", seed)
        ribs, handle = parts["metal_ribs"][0].vertices, parts["wood_handle"]
        canopy = [*parts["cloth_panels"], *parts["cloth_other"], parts["metal_ribs"][0]]
        assert lowest(canopy) == pytest.approx(lowest(handle), abs=1e-4)
        low = ribs[ribs[:, 2] < lowest(canopy) + 0.01, 1]
        assert low.min() < -0.1
        assert low.max() > 0.1


@pytest.mark.parametrize(
    ("family", "vessel", "handles"), [("vase", "body", "handles"), ("mug", "ceramic_cup", "ceramic_handle")]
)
def test_handles_end_in_the_wall(family, vessel, handles):
    """They do not come through it: in their plane nothing of them is nearer to the middle."""
    eared = 0
    for seed in range(24):
        parts = solids_of(family, seed)
        body = parts[vessel][0]
        for ear, side in zip(parts.get(handles, []), (1, -1), strict=False):
            eared += 1
            plane = (np.abs(body.vertices[:, 1]) < 1e-6) & (side * body.vertices[:, 0] > 0)
            points, facing = side * body.vertices[plane], side * body.normals[plane, 0]
            height, radius = np.abs(body.vertices[plane, 2]), points[:, 0]
            inner, outer = (
                np.c_[height[k], radius[k]][np.argsort(height[k])]
                for k in ((facing < -0.2) & (height > 0.02), facing > 0.2)
            )
            x, z = side * ear.vertices[:, 0], ear.vertices[:, 2]
            assert (x > np.interp(z, *inner.T))[z > inner[0, 0]].all(), seed
            assert (x < np.interp(z, *outer.T)).any(), seed
    assert eared


def test_screwdrivers_do_not_lie_across_each_other():
    """No handle or blade meets that of another."""
    for seed in range(30):
        parts = solids_of("screwdriver", seed)
        assert len(groups_that_touch(flat(parts))) == len(parts["plastic_handles"]), seed


def test_a_handle_above_a_teapot_clears_its_lid():
    above = 0
    for seed in range(40):
        parts = solids_of("teapot", seed)
        handle = parts["handle"][0].vertices
        above += handle[:, 0].max() > 0
        for solid in parts["lid"]:
            planes = ConvexHull(solid.vertices).equations
            assert (handle @ planes[:, :3].T + planes[:, 3]).max(1).min() > 1e-4, seed
    assert above


def test_mushrooms_all_stand_on_the_ground():
    for seed in range(12):
        lows = [lowest([stalk]) for stalk in solids_of("mushrooms", seed)["stalk"]]
        assert np.ptp(lows) < 1e-6, seed


@pytest.mark.filterwarnings("ignore:invalid value")
def test_the_lining_of_a_hat_does_not_come_through():
    """Seen from above, what looks up is above what looks down."""
    for seed in range(8):
        (felt,) = solids_of("hat", seed)["cloth_felt"]
        low, step = felt.vertices[:, :2].min(0), 0.004
        shape = tuple((np.ptp(felt.vertices[:, :2], axis=0) / step).astype(int) + 2)
        a, b, c = (felt.vertices[felt.faces[:, k]] for k in range(3))
        up = np.cross(b - a, c - a)[:, 2]
        outside, lining = (
            heights(Solid(felt.vertices, felt.normals, felt.faces[seen]), low, shape, step)[1]
            for seen in (up > 0, up < 0)
        )
        both = np.isfinite(outside) & np.isfinite(lining)
        assert (outside - lining)[both].min() > 0, seed


def test_a_crate_full_of_bottles_is_light():
    for seed in (15, 29, 132):
        assert len(build_mesh("crate", seed).faces) <= 20000, seed


def test_arms_of_a_desk_lamp_end_beneath_the_faces_of_its_joints():
    assert fighting_share(build_mesh("desk_lamp", 7), between_parts=True) < 1e-4


def test_the_head_under_a_wig_is_under_it():
    """No lock goes into it, and hair is near all of its upper third."""
    for seed in range(6):
        parts = solids_of("wig", seed)
        hair, head = parts["yarn_hair"][0].vertices, parts["head"][0].vertices
        locks = hair.reshape(-1, 4, 3).mean(1)
        size = np.ptp(head, axis=0) / 2
        assert np.linalg.norm(locks / size, axis=1).min() > 0.95
        upper = head[head[:, 2] > size[2] / 3]
        assert np.mean(cKDTree(hair).query(upper)[0] < 0.1 * size[0]) > 0.95


def test_yarn_is_wound_around_its_ball_and_its_end_lies_on_the_floor():
    for seed in range(12):
        parts = solids_of("yarn_ball", seed)
        (strands, tail), (core,) = parts["yarn"], parts["yarn_core"]
        assert lowest([tail]) == pytest.approx(lowest([strands]), abs=1e-3)
        points = points_on(strands, 0.004)
        ways = points / np.linalg.norm(points, axis=1, keepdims=True)
        bare = core.vertices / np.linalg.norm(core.vertices, axis=1, keepdims=True)
        assert np.mean(cKDTree(ways).query(bare)[0] < 0.1) > 0.96, seed


def test_a_spool_lies_on_its_flanges():
    """Not on the thread, which is wound less high."""
    for seed in range(12):
        parts = solids_of("thread_spools", seed)
        assert lowest(parts["yarn"]) > lowest(parts["reels"]) + 2e-4


def test_the_block_of_a_landscape_meets_its_surface():
    """Its upper edge is nowhere farther below the surface than the sheet of the surface is thick."""
    for seed in range(4):
        surface, block = solids_of("terrain", seed)["soil"]
        upper = block.vertices[block.vertices[:, 2] > 1e-6]
        assert cKDTree(surface.vertices).query(upper)[0].max() < 1e-3, seed


def test_the_tip_of_a_banana_can_be_seen():
    for seed in range(4):
        parts = solids_of("bananas", seed)
        for fruit, tip in zip(parts["peel"], parts["tips"], strict=True):
            planes = ConvexHull(fruit.vertices).equations
            assert (tip.vertices @ planes[:, :3].T + planes[:, 3]).max(1).max() > 0.001


def test_loaf_and_slices_lie_on_one_board():
    for seed in range(6):
        lows = [float(s.vertices[:, 2].min()) for group in solids_of("bread", seed).values() for s in group]
        assert np.ptp(lows) < 1e-6


def test_folded_paper_lies_level():
    """The plane through its points is tilted by less than what crumpling does."""
    for seed in range(8):
        points = build_mesh("paper_folds", seed).vertices.astype(float)
        slope = np.linalg.lstsq(np.c_[points[:, :2], np.ones(len(points))], points[:, 2], rcond=None)[0][:2]
        assert np.degrees(np.arctan(np.hypot(*slope))) < 5


def test_a_scene_of_forty_objects_is_light_and_quick():
    """On average 7500 triangles (300000 for 40 objects) and 6 ms of a core (0.24 s), with slack."""
    counts = np.array([np.mean([len(mesh.faces) for mesh in meshes(family)]) for family in mesh_families()])
    assert counts.mean() < 7500
    assert np.mean(counts < 10000) > 0.75
    start = time.process_time()
    for family in mesh_families():
        build_mesh.__wrapped__(family, 0)
    assert (time.process_time() - start) / len(mesh_families()) < 0.02


def test_the_vocabulary_of_parts_reads_any_name():
    assert part_kind("glass") == "glass"
    assert part_kind("cloth_seat") == "cloth"
    assert part_kind("Glass_01") == part_kind("Mat.Glass") == "glass"
    assert part_kind("legs") is None
    assert part_kind("metallic_paint") is None
    used = {part_kind(name) for family in mesh_families() for m in meshes(family) for name in m.part_names}
    assert used - {None} == set(PART_KINDS), "every word of the vocabulary occurs"


def test_a_new_family_needs_only_its_decorator(monkeypatch):
    from fsid.assets.solids import box

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


def test_the_guide_lists_what_the_registry_has():
    """docs/objects.md is written by tools/objects.py; run it after a change of families or part names."""
    tool = runpy.run_path(str(REPOSITORY / "tools" / "objects.py"))
    assert (REPOSITORY / "docs" / "objects.md").read_text(encoding="utf-8") == tool["guide"]()
