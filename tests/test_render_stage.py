"""What is drawn of a scene, and what the passes are given of it: places, lights, surroundings; no device."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fsid.assets import BACKGROUND_PARTS
from fsid.errors import FsidError
from fsid.render.drawable import BACKGROUND_ID, Drawable, View, object_drawables, panel_drawable, view_of
from fsid.render.layers import Layer
from fsid.render.stage import Stage, stage_of
from fsid.scene import SceneConfig, sample
from fsid.scene.model import ZERO, Background, Camera, Light, Motion, Scene, Sky, Transform
from render_scenes import STILL, block, grid, lambertian, plain, point_light, view

FEW = SceneConfig(objects=(2, 2), mesh_families=("toy_blocks",))
SIDES = ("wall_east", "wall_west", "wall_north", "wall_south", "ceiling", "floor")
PANEL = Light("area", (0.3, -0.2, 1.5), (0.0, 0.6, -0.8), (3.0, 2.0, 1.0), 0.0, 180.0, (0.4, 0.2))
SUN = Light("sun", ZERO, (0.0, 0.0, -1.0), (2.0, 2.0, 2.0), 0.0047, 0.0)


def scene(kind: str, **changes: object) -> Scene:
    """Two objects before a background of which every part has another colour."""
    parts = BACKGROUND_PARTS[kind]
    materials = {name: plain((0.1 * (i + 1),) * 3) for i, name in enumerate(parts)}
    found = sample(FEW, 3, width=64, height=48)
    background = Background(kind, (4.0, 5.0, 2.6), materials)
    return replace(found, background=background, lights=(), sky=None, motions=(), **changes)


def staged(what: View, *, time_s: float = 0.0, shadow_px: int = 256, **shares: tuple) -> Stage:
    """The stage of a view; shares: of the three colours in the mean albedo of a family, the first alone
    where none are given."""
    layers = {
        (m.family, m.variant): Layer(0, 1.0, np.array(shares.get(m.family, (1.0, 0.0, 0.0))), 1.0, 0.0)
        for m in (*(m for drawable in what.drawables for m in drawable.materials), *what.room_materials)
    }
    return stage_of(what, layers, time_s, shadow_px)


def test_background_objects_and_panels_are_drawn_with_their_own_places_and_materials() -> None:
    spot = Light("spot", (0.0, 0.0, 2.0), (0.0, 0.0, -1.0), (1.0, 1.0, 1.0), 0.01, 40.0)
    motions = (Motion((0.1, 0.0, 0.0)), Motion(spin_deg_s=(0.0, 0.0, 30.0)))
    ours = replace(scene("room"), lights=(spot, PANEL, replace(PANEL, size_m=(1.0, 1.0))), motions=motions)
    found = view_of(ours, 0)
    background, *things, panel, other = found.drawables
    assert background.object_id == panel.object_id == other.object_id == BACKGROUND_ID
    assert background.materials == tuple(ours.background.materials[name] for name in SIDES)
    assert [thing.object_id for thing in things] == [0, 1]
    assert [thing.materials for thing in things] == list(ours.materials)
    assert [thing.transform for thing in things] == list(ours.transforms)
    assert [thing.motion for thing in things] == list(motions)
    assert [thing.casts for thing in (background, *things)] == [True] * 3
    assert [np.ptp(each.mesh.vertices[:, 0]) for each in (panel, other)] == pytest.approx([0.4, 1.0])
    assert found.lights == ours.lights
    still = view_of(replace(ours, motions=()), 0)
    assert [thing.motion for thing in still.drawables] == [Motion()] * 5


@pytest.mark.parametrize("kind", BACKGROUND_PARTS)
def test_surroundings_are_the_sides_of_the_room_or_the_sky(kind: str) -> None:
    """The sheet of a backdrop is its north wall and its floor; the floor under a table lies 0.75 m deeper."""
    ours = scene(kind, ambient=(0.3, 0.2, 0.1))
    found = view_of(ours, 0)
    if kind == "open-air":
        assert (found.room_materials, found.room_floor_m) == ((), 0.0)
        assert found.sky == Sky("procedural", (0.3, 0.2, 0.1))
        given = Sky("procedural", (1.0, 2.0, 3.0), 5, 0.5)
        assert view_of(replace(ours, sky=given), 0).sky == given
        return
    materials = ours.background.materials
    names = [name if name in materials else "sweep" for name in SIDES]
    assert names.count("sweep") == (2 if kind == "backdrop" else 0)
    assert found.room_materials == tuple(materials[name] for name in names)
    assert found.room_floor_m == pytest.approx(-0.75 if kind == "tabletop" else 0.0)
    assert (found.sky, found.room_size_m, found.ambient) == (None, (4.0, 5.0, 2.6), (0.3, 0.2, 0.1))


def test_a_view_is_of_the_camera_that_was_asked_for() -> None:
    ours = scene("room")
    cameras = tuple(replace(ours.cameras[0], fov_deg=fov, width=w) for fov, w in ((40.0, 64), (50.0, 32)))
    assert [view_of(replace(ours, cameras=cameras), i).camera for i in (0, 1)] == list(cameras)


def test_a_thing_is_scaled_turned_moved_and_turns_about_its_own_place() -> None:
    """Against SciPy: 0.5 s of 1, 2, -4 m/s and of 100 degrees/s about an axis of the world, after its own
    rotation about x, then y, then z."""
    at = Transform((1.0, 2.0, 3.0), (20.0, 30.0, 40.0), (2.0, 1.0, 0.5))
    axis = np.array([2.0, -1.0, 2.0]) / 3
    motion = Motion((1.0, 2.0, -4.0), tuple(100.0 * axis))
    thing = Drawable(block((1.0, 1.0, 1.0)), at, (plain(),), 0, motion=motion)
    own = Rotation.from_euler("xyz", (20, 30, 40), degrees=True)
    turned = Rotation.from_rotvec(np.radians(50.0) * axis) * own
    rotation, position = thing.pose(0.5)
    np.testing.assert_allclose(rotation, turned.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(position, (1.5, 3.0, 1.0))
    rotation, position = thing.pose(0.0)
    np.testing.assert_allclose(rotation, own.as_matrix(), atol=1e-12)
    np.testing.assert_allclose(position, (1.0, 2.0, 3.0))
    corners = thing.mesh.vertices * (2.0, 1.0, 0.5)
    world = staged(view(thing), time_s=0.5).geometry.world
    np.testing.assert_allclose(world, turned.apply(corners) + np.array([1.5, 3.0, 1.0]), atol=1e-5)


def test_a_panel_is_a_rectangle_of_its_size_that_looks_where_its_light_goes() -> None:
    """0.4 m along x and 0.2 m along (0, 0.8, 0.6), black but for its glow, and in nobody's way."""
    panel = panel_drawable(PANEL, replace(plain(), emission=5.0, clearcoat=1.0, transmission=1.0))
    corners = {tuple(corner) for corner in np.round(panel.mesh.vertices.astype(float), 6).tolist()}
    assert corners == {(x, y, z) for x in (-0.2, 0.2) for y, z in ((-0.08, -0.06), (0.08, 0.06))}
    a, b, c = panel.mesh.vertices[panel.mesh.faces].transpose(1, 0, 2)
    twice = np.cross(b - a, c - a)
    np.testing.assert_allclose(np.abs(twice.sum(0)) / 2, (0.0, 0.048, 0.064), atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(twice, axis=1) / 2, 0.04, rtol=1e-6)
    np.testing.assert_allclose(panel.mesh.normals, [(0.0, 0.6, -0.8)] * 4, rtol=1e-6)
    assert panel.transform == Transform(PANEL.position_m, ZERO, (1.0, 1.0, 1.0))
    assert (panel.glow, panel.specular, panel.casts) == (PANEL.colour, 0.0, False)
    (material,) = panel.materials
    assert material.colours == (ZERO,) * 3
    assert (material.emission, material.clearcoat, material.transmission) == (0, 0, 0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"transforms": lambda given: given[1:]}, "must have the same length"),
        ({"materials": lambda given: given[1:]}, "must have the same length"),
        ({"motions": lambda given: (Motion(),)}, "give no motions, or one for every object"),
        ({"materials": lambda given: (given[0], ())}, r"scene.materials\[1\]: 0 materials, but"),
    ],
)
def test_lists_of_a_scene_that_do_not_belong_together_are_named(changes: dict, message: str) -> None:
    ours = scene("room")
    with pytest.raises(FsidError, match=message):
        view_of(replace(ours, **{key: change(getattr(ours, key)) for key, change in changes.items()}), 0)


def test_as_many_objects_are_drawn_as_have_numbers_of_their_own(monkeypatch) -> None:
    """65533: of 16 bits three numbers are left for what is none."""
    mesh = grid(1.0)
    monkeypatch.setattr("fsid.render.drawable.build_mesh", lambda family, seed: mesh)
    ours = scene("room")
    many = {"objects": ours.objects[:1] * 65534, "transforms": ours.transforms[:1] * 65534}
    many |= {"materials": ((plain(),),) * 65534}
    with pytest.raises(FsidError, match=r"scene.objects: 65534 objects; at most 65533 can be drawn"):
        object_drawables(replace(ours, **many))
    most = object_drawables(replace(ours, **{key: each[1:] for key, each in many.items()}))
    assert most[-1].object_id == 65532


def test_a_room_is_as_bright_as_its_materials_its_glow_and_what_shines_in_it_make_it() -> None:
    """Without lights, wall by wall: mean albedo, cut at 1, times ambient light and emission. A ball of 0.1 m
    that shines in the middle adds albedo L (0.1 / r)^2 right before a wall at r."""
    dull, bright = plain(), replace(plain(), family="bright", emission=0.5)
    dull = replace(dull, colours=((0.2, 0.4, 0.6), (0.6, 0.2, 0.2), ZERO))
    bright = replace(bright, colours=((0.5, 0.5, 0.5), (1.4, 1.1, 0.9), ZERO))
    what = replace(view(lambertian(grid(1.0))), ambient=(0.1, 0.2, 0.3), room_size_m=(4.0, 4.0, 4.0))
    np.testing.assert_allclose(staged(what).room.radiance, np.full((6, 16, 16, 3), (0.1, 0.2, 0.3)))
    what = replace(what, room_materials=(dull,) * 5 + (bright,), room_floor_m=-1.0)
    shares = {"plain": (0.5, 0.5, 0.0), "bright": (0.0, 1.0, 0.0)}
    room = staged(what, **shares).room
    expected = np.array([0.4, 0.3, 0.4]) * (0.1, 0.2, 0.3)
    np.testing.assert_allclose(room.radiance[:5], np.broadcast_to(expected, (5, 16, 16, 3)))
    expected = np.array([1.0, 1.0, 0.9]) * (0.6, 0.7, 0.8)
    np.testing.assert_allclose(room.radiance[5], np.broadcast_to(expected, (16, 16, 3)))
    np.testing.assert_allclose(room.centre_m, (0.0, 0.0, 1.0))
    at = replace(STILL, position_m=(0.0, 0.0, 1.0))
    ball = Drawable(block((0.02, 0.02, 0.02)), at, (replace(bright, emission=100.0),), 0)
    lit = staged(replace(what, drawables=(ball,)), **shares).room.radiance[4] - room.radiance[4]
    power = 100.0 * 6 * 0.02**2 / 4 * np.array([1.0, 1.0, 0.9])  # L A / 4 of a convex body
    expected = np.array([0.4, 0.3, 0.4]) * power / np.pi / 2.0**2
    np.testing.assert_allclose(lit[7:9, 7:9].mean((0, 1)), expected, rtol=0.05)


def test_the_lights_of_a_stage_are_those_of_the_scene_of_what_shines_and_of_the_sky(monkeypatch) -> None:
    """The sun that a picture of the sky holds is one; what is left of it is the most that the rest has."""
    glowing = replace(plain(), emission=9.0)
    lamp = Drawable(block((0.1, 0.1, 0.1)), STILL, (glowing,), 0, motion=Motion((2.0, 0.0, 0.0)))
    glass = Drawable(grid(1.0), STILL, (plain(), replace(plain(), transmission=0.5)), 1)
    dim = replace(lambertian(grid(1.0)), materials=(replace(plain(), transmission=0.49),), casts=False)
    what = view(lamp, glass, dim, lights=(SUN, point_light((0.0, 0.0, 1.0))))
    indoors = staged(what, time_s=0.5)
    np.testing.assert_allclose(indoors.plan.table["position"][2], (1.0, 0.0, 0.05), atol=1e-6)
    kinds = indoors.plan.table["kind"]  # point and spot 0, sun 1, area 2
    assert (indoors.plan.light_count, kinds.tolist()) == (3, [1.0, 0.0, 0.0])
    np.testing.assert_allclose(indoors.plan.table["colour"][2], 9.0 * 0.5 * 6 * 0.1**2 / 4)
    assert (indoors.sky, indoors.sunless) == (None, 0.0)
    assert indoors.casts.tolist() == [True, True, False]
    assert indoors.glass.tolist() == [False, True, False]
    picture = np.ones((64, 128, 3), np.float32)
    picture[16, 0] = 2000.0  # 45 degrees above +x
    picture[40] = 7.0
    monkeypatch.setattr("fsid.render.stage.panorama", lambda sky: picture)
    outdoors = staged(replace(what, sky=Sky("file:any", (1.0, 1.0, 1.0))))
    assert outdoors.plan.table["kind"].tolist() == [1.0, 0.0, 0.0, 1.0]
    direction = outdoors.plan.table["direction"][3]
    np.testing.assert_allclose(direction, np.array([-1.0, 0.0, -1.0]) / np.sqrt(2), atol=0.04)
    assert outdoors.sky is picture
    most = 10 * picture.mean()
    assert outdoors.sunless == pytest.approx(most)
    assert outdoors.room.radiance.max() < 3 * most  # of 2000 nothing is ambient light
    even = np.where(picture > most, 1.0, picture)
    monkeypatch.setattr("fsid.render.stage.panorama", lambda sky: even)
    without = staged(replace(what, sky=Sky("file:any", (1.0, 1.0, 1.0))))
    assert (without.plan.light_count, without.sunless) == (3, 7.0)
    np.testing.assert_allclose(without.room.radiance.max(), 7.0)


@pytest.mark.parametrize("name", ["clearcoat", "sheen", "translucency"])
def test_one_surface_with_a_lobe_is_enough_to_draw_lobes(name: str) -> None:
    what = view(lambertian(grid(1.0)), lambertian(grid(1.0)))
    assert not staged(what).has_lobes
    shiny = replace(plain(), **{name: 0.01})
    thing = Drawable(grid(1.0), STILL, (plain(), shiny), 0)
    assert staged(replace(what, drawables=(*what.drawables, thing))).has_lobes


def test_there_are_area_lights_where_one_was_given() -> None:
    assert not staged(view(lambertian(grid(1.0)))).has_areas
    assert not staged(view(lambertian(grid(1.0)), lights=(SUN, point_light((0.0, 0.0, 1.0))))).has_areas
    assert staged(view(lambertian(grid(1.0)), lights=(SUN, PANEL))).has_areas


def test_the_shadows_of_the_sun_are_those_of_what_casts_them() -> None:
    """Within a square of 1 m around a block of that diagonal, in texels as fine as is asked for; indoors
    the background casts shadows, too, and the sun's square is as wide as it."""
    thing = lambertian(block((2**-0.5, 0.5, 0.5)))
    ground = replace(lambertian(grid(200.0)), object_id=BACKGROUND_ID)
    flag = replace(lambertian(grid(100.0)), casts=False)
    indoors = view(thing, ground, flag, lights=(SUN,))
    outdoors = replace(indoors, sky=Sky("procedural", (1.0, 1.0, 1.0)))
    for what, half in ((outdoors, 0.5), (indoors, 100 * 2**0.5)):
        found = staged(what, shadow_px=512).plan
        assert found.tiles[0].range_m == pytest.approx(2 * half + 0.02)
        assert 1 / found.tiles[0].focal == pytest.approx(1.02 * half + 0.0047 * (2 * half + 0.02))
        assert found.tile_px == 512


@pytest.mark.parametrize(
    ("fov_deg", "height", "direction", "size"),
    [
        (60.0, 100, (0.0, 0.0, -1.0), 4 * 3**-0.5),  # from above: 2 x 4 m tan 30 wide
        (150.0, 100, (0.0, 0.0, -1.0), 4.0),  # no wider than 2 x 4 m tan 45
        (20.0, 100, (0.0, 0.0, -1.0), 2.0),  # 4 m deep
        (60.0, 300, (-1.0, 0.0, 0.0), 4 * 3**-0.5 * 1.5),  # from the side: high as an upright image
        (150.0, 300, (-1.0, 0.0, 0.0), 4.0),
    ],
)
def test_the_sun_s_finer_shadows_are_of_twice_as_far_as_the_camera_looks(
    fov_deg: float, height: int, direction: tuple, size: float
) -> None:
    """The camera looks along +y at what is 2 m away. Its tile is the next of four sizes per doubling, and a
    fifth wider; in its middle is the middle of all that is seen."""
    camera = Camera((0.0, 0.0, 1.0), (0.0, 2.0, 1.0), (0.0, 0.0, 1.0), fov_deg, 200, height)
    wide = lambertian(block((300.0, 300.0, 300.0)))
    sun = replace(SUN, direction=direction)
    _, nearer = staged(view(wide, lights=(sun,), camera=camera)).plan.tiles
    half = 2 ** (np.ceil(4 * np.log2(size)) / 4)
    assert 1 / nearer.focal == pytest.approx(1.2 * half)
    middle = nearer.axes @ (0.0, 2.0, 1.0)
    np.testing.assert_allclose((nearer.axes @ nearer.origin)[:2], middle[:2], atol=half / 64)
