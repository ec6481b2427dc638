"""Laws of material maps: range, tiling, determinism, and detail down to the texel."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import median_filter

from fsid.assets import (
    MATERIAL_VARIANTS,
    MaterialMaps,
    bake_material,
    material_colours,
    material_families,
    material_layers,
    material_tile_m,
)
from fsid.assets.material_registry import draw_material
from fsid.assets.materials import images, sheets
from fsid.assets.patterns import cells, joint, level, noise, shade, stack, warp
from fsid.assets.triangle import PICTURE, decode
from fsid.errors import FsidError

REPOSITORY = Path(__file__).resolve().parents[1]
MAPS = ("mix", "pattern", "detail", "roughness", "height", "metallic")
SIZE = 128


@pytest.fixture(scope="module")
def baked():
    names = material_families()
    return {(name, v): bake_material(name, v, SIZE) for name in names for v in range(MATERIAL_VARIANTS)}


def test_the_guide_lists_what_the_registry_has():
    """docs/materials.md is written by tools/materials.py; run it after a change of families or layers."""
    tool = runpy.run_path(str(REPOSITORY / "tools" / "materials.py"))
    assert (REPOSITORY / "docs" / "materials.md").read_text(encoding="utf-8") == tool["guide"]()


NAMED = """
wood_planks parquet burl plywood brushed_metal scratched_metal cast_metal rusty_metal anodised_metal
hammered_metal weave satin knit corduroy denim felt lace tartan embroidery carpet thread_spools leather
suede plastic glossy_plastic translucent_plastic granite slate sandstone marble terrazzo concrete brick
tiles plaster wallpaper paper cardboard printed_text tables barcodes test_chart resolution_chart
colour_chart guilloche halftone magazine screen leaves bark grass gravel sand fur water bread cheese salad
skin
"""
"""What a household, a print shop and a garden need at the least."""


def test_there_are_sixty_four_families():
    assert len(material_families()) >= 64
    assert set(NAMED.split()) <= set(material_families())
    assert {"dirt", "dust", "stains", "wear"} <= set(material_layers())


@pytest.mark.parametrize("family", material_families())
class TestEveryFamily:
    def test_maps_are_float32_in_range(self, baked, family):
        for variant in range(MATERIAL_VARIANTS):
            maps = baked[family, variant]
            for name in MAPS:
                field = getattr(maps, name)
                assert field.shape == (SIZE, SIZE), name
                assert field.dtype == np.float32, name
                assert 0 <= field.min() <= field.max() <= 1, name
            assert maps.relief_m > 0
            assert maps.tile_m == material_tile_m(family) > 0

    def test_tiles_without_a_seam(self, baked, family):
        """Across the border, neighbours differ little more than somewhere inside (some have few rows)."""
        for variant in range(MATERIAL_VARIANTS):
            for name in ("mix", "pattern", "detail", "height"):
                field = getattr(baked[family, variant], name)
                for image in (field, field.T):
                    steps = np.abs(np.roll(image, -1, axis=0) - image).mean(1)
                    assert steps[-1] <= 1.6 * steps[:-1].max() + 1e-4, (variant, name)

    def test_the_smallest_size_works_too(self, family):
        for variant in (0, MATERIAL_VARIANTS - 1):
            assert np.isfinite(draw_material(family, variant, 64).detail).all()

    def test_no_map_is_mostly_clipped(self, baked, family):
        for variant in range(MATERIAL_VARIANTS):
            detail = baked[family, variant].detail
            assert np.mean((detail <= 0) | (detail >= 1)) < 0.12

    def test_no_colour_of_nature_is_brighter_than_white(self, baked, family):
        """Bright grain would be cut to flat white. A picture may be white, where it shows white paper."""
        for variant in range(MATERIAL_VARIANTS):
            colours = material_colours(family, variant)
            if colours in (None, PICTURE):
                continue
            maps = baked[family, variant]
            albedo = decode(maps.mix, maps.pattern, maps.detail, colours)
            assert np.mean(albedo.max(-1) > 0.95) < 1.5e-3, variant

    def test_family_and_variant_decide_alone(self, baked, family):
        again = bake_material(family, 1, SIZE)
        for name in MAPS:
            np.testing.assert_array_equal(getattr(again, name), getattr(baked[family, 1], name))
        assert any(
            not np.array_equal(getattr(again, name), getattr(baked[family, 2], name))
            for name in ("mix", "height")
        )


FINE = {
    "as fine as two texels of the smaller tile": (
        "bamboo coral corduroy denim guilloche handwriting lace metal_mesh reptile ribbons straw terry "
        "test_chart weave wicker"
    ),
    "grain, some texels wide at every size": "bark cast_metal cork fur granite plywood sand wood_grain",
}
"""Families of which a variant is mostly so: that is another thing at another size, the rest is not."""


def brightness(maps: MaterialMaps) -> np.ndarray:
    """Of a typical albedo."""
    return ((0.3 + 0.25 * maps.mix) * (1 - maps.pattern) + 0.1 * maps.pattern) * 2 * maps.detail


def likeness(one: np.ndarray, other: np.ndarray, size: int) -> float:
    """Correlation of two squares averaged down to `size`."""
    small, large = (
        field.reshape(size, len(field) // size, size, -1).mean((1, 3)).ravel() for field in (one, other)
    )
    return float(np.corrcoef(small, large)[0, 1])


@pytest.mark.parametrize("family", material_families())
def test_a_material_is_the_same_picture_at_every_size(baked, family):
    fine = family in " ".join(FINE.values()).split()
    for variant in range(MATERIAL_VARIANTS):
        small, large = (
            brightness(m) for m in (baked[family, variant], draw_material(family, variant, 2 * SIZE))
        )
        assert likeness(small, large, SIZE // 4) > (0.5 if fine else 0.9), variant


@pytest.mark.parametrize("family", ["brick", "marble", "wood_planks", "printed_text", "screen", "painting"])
def test_a_tile_of_1024_texels_is_that_of_128_seen_sharper(baked, family):
    large = brightness(draw_material(family, 2, 1024))
    assert likeness(brightness(baked[family, 2]), large, SIZE // 4) > 0.9


@pytest.mark.parametrize(("family", "name", "count"), [("comic", "detail", 205), ("painting", "height", 128)])
def test_dots_and_threads_are_as_many_at_every_size(family, name, count):
    """Of all periods from 30 per tile on, theirs stands out most from those beside it."""
    for size in (512, 1024):
        field = getattr(draw_material(family, 0, size), name)
        power = np.abs(np.fft.rfft(field, axis=1)).mean(0)
        beside = median_filter(power, 25)
        assert 30 + int((power / beside)[30:250].argmax()) == pytest.approx(count, abs=1), size


@pytest.mark.parametrize("layer", material_layers())
def test_a_layer_lies_in_the_same_places_at_every_size(layer):
    for variant in range(MATERIAL_VARIANTS):
        small, large = (
            draw_material(f"tiles+{layer}", variant, size).roughness
            - draw_material("tiles", variant, size).roughness
            for size in (SIZE, 2 * SIZE)
        )
        assert likeness(small, large, SIZE // 4) > (0.7 if layer == "cracks" else 0.9), variant  # hair lines


@pytest.mark.parametrize("variant", range(MATERIAL_VARIANTS))
def test_ribbons_go_over_and_under_across_the_border_as_inside(variant):
    """A plain weave passes over one band, a twill over two: never over more where the tile meets itself."""
    height = draw_material("ribbons", variant, 1024).height
    bands = int(np.abs(np.fft.rfft(height.mean(0)))[2:100].argmax()) + 2
    middle = (np.arange(bands) + 0.5) * 1024 / bands
    side = (middle + 0.47 * 1024 / bands) % 1024

    def at(v: np.ndarray, u: np.ndarray) -> np.ndarray:
        return height[np.ix_(v.astype(int), u.astype(int))]

    over = at(middle, side) < at(side, middle)
    for lines in (over, over.T, ~over, ~over.T):
        rows = ("".join("-#"[int(i)] for i in (*line, *line)) for line in lines)
        assert max(len(run) for row in rows for run in row.split("-")) <= 1 + variant % 2


@pytest.mark.parametrize("variant", range(MATERIAL_VARIANTS))
def test_every_second_cane_passes_before_a_stake(variant):
    """And behind the next, so that each stake can be seen in half of the rows."""
    stakes, canes = (14, 20, 10, 16)[variant], (40, 60, 28, 18)[variant]
    height = draw_material("wicker", variant, 1024).height
    v, u = ((np.arange(n) + 0.5) * 1024 / n for n in (canes, stakes))
    before = height[np.ix_(v.astype(int), u.astype(int))] > 0.75
    assert before.mean() == pytest.approx(0.5, abs=0.1)
    assert (before[1:] != before[:-1]).mean() > 0.8
    assert (before[:, 1:] != before[:, :-1]).mean() > 0.8


@pytest.mark.parametrize("variant", range(MATERIAL_VARIANTS))
def test_wallpaper_has_one_lattice_across_the_border(variant):
    """It lies on itself where it is moved by a column and dropped by half a row."""
    flowers = draw_material("wallpaper", variant, 256).pattern
    misses = [np.abs(flowers - warp(flowers, 1 / n, 0.5 / n)).mean() for n in range(2, 9)]
    assert min(misses) < 0.15 * flowers.std()


@pytest.mark.parametrize("variant", [0, 2])
def test_cross_stitches_repeat_with_their_colours(variant):
    maps = draw_material("embroidery", variant, 256)
    colour = maps.mix - maps.pattern
    for axis in (0, 1):
        assert np.abs(colour - np.roll(colour, 128, axis)).mean() < 0.05 * colour.std()


@pytest.mark.parametrize(
    ("family", "size", "limit"),
    [("circuit_board", 1024, 0.05), ("handwriting", 256, 0), ("magazine", 256, 0), ("street_map", 256, 0)],
)
def test_nothing_drawn_is_cut_by_the_border(family, size, limit, monkeypatch):
    """Words end before it, tracks go on behind it; a track that runs along it is on one side."""
    shares = []

    def averaged(image):
        canvas = np.asarray(image, float)
        shares.append(np.mean(np.abs(canvas[:, 0] - canvas[:, -1]) > 40))
        return np.asarray(image.reduce(2), np.float32) / 255

    for module in (images, sheets):
        monkeypatch.setattr(module, "averaged", averaged)
    for variant in range(MATERIAL_VARIANTS):
        draw_material(family, variant, size)
    assert max(shares) <= limit


@pytest.mark.parametrize("cells_per_tile", [3, 8, 16, 24, 28, 32])
def test_a_joint_takes_the_same_share_at_every_size(cells_per_tile):
    def share(size: int) -> float:
        x = (np.arange(size) + 0.5) / size * cells_per_tile
        return float(joint(np.abs(x % 1 - 0.5), 0.485, 0.03, cells_per_tile / size).mean())

    for size in (128, 256, 512, 1024):
        assert share(size) == pytest.approx(share(8192), rel=0.4)


@pytest.mark.parametrize("family", ["wood_planks", "parquet", "end_grain"])
def test_joints_of_boards_and_blocks_are_there_at_every_size(family):
    """They lie between the centres of two texels, where nothing is drawn that is finer than a texel."""
    for variant in range(MATERIAL_VARIANTS):
        coarse, fine = (draw_material(family, variant, size).pattern.mean() for size in (128, 512))
        assert coarse == pytest.approx(fine, rel=0.35), variant


@pytest.mark.parametrize("family", ["weave", "tartan"])
def test_cloth_is_as_bright_where_threads_are_finer_than_texels(family):
    for variant in range(MATERIAL_VARIANTS):
        coarse, middle, fine = (draw_material(family, variant, s).detail.mean() for s in (128, 256, 512))
        assert coarse == pytest.approx(fine, abs=0.02)
        assert middle == pytest.approx(fine, abs=0.02)


def test_rings_of_a_zone_plate_that_are_finer_than_texels_are_grey():
    """Sampled at texels they would be other, wider rings around other centres."""
    pattern = draw_material("test_chart", 3, 128).pattern
    at = np.abs((np.arange(128) + 0.5) / 64 % 1 - 0.5)
    far = np.hypot(*np.meshgrid(at, at)) > 0.29  # the widest of the four has a ring per two texels here
    assert pattern[far].std() < 0.01
    assert pattern[~far].std() > 0.05


def test_rows_of_a_table_are_as_high_as_their_letters():
    """Nothing is set in less than six pixels: lower rows were written over each other."""
    for variant in range(MATERIAL_VARIANTS):
        assert draw_material("tables", variant, 128).pattern.mean() < 0.45


@pytest.mark.parametrize("layer", material_layers())
def test_a_layer_changes_a_material_and_stays_tileable(layer):
    for variant in range(MATERIAL_VARIANTS):
        below = bake_material("brick", variant, SIZE)
        maps = bake_material(f"brick+{layer}", variant, SIZE)
        assert maps.tile_m == below.tile_m
        assert any(not np.array_equal(getattr(maps, name), getattr(below, name)) for name in MAPS)
        for name in MAPS:
            field = getattr(maps, name)
            assert field.dtype == np.float32
            assert 0 <= field.min() <= field.max() <= 1, name
            for image in (field, field.T):
                steps = np.abs(np.roll(image, -1, axis=0) - image).mean(1)
                assert steps[-1] <= 1.5 * steps[:-1].max() + 1e-4, (variant, name)


def test_layers_lie_over_each_other():
    both = bake_material("tiles+dirt+dust", 0, 64)
    assert not np.array_equal(both.detail, bake_material("tiles+dirt", 0, 64).detail)
    assert material_tile_m("tiles+dirt+dust") == material_tile_m("tiles")
    assert material_colours("tiles+dirt+dust", 0) == material_colours("tiles", 0)


def test_most_families_carry_detail_at_the_texel(baked):
    """RMS difference of neighbouring texels of a typical albedo, relative to its mean."""
    strengths = []
    for maps in baked.values():
        albedo = brightness(maps)
        strengths.append(np.sqrt(np.mean(np.diff(albedo, axis=1) ** 2)) / albedo.mean())
    assert np.mean(np.array(strengths) > 0.04) > 0.75
    assert np.mean(np.array(strengths) < 0.03) > 0.03, "homogeneous surfaces exist in reality too"


@pytest.mark.parametrize(
    ("family", "variant", "size", "message"),
    [
        ("chiffon", 0, 256, "'chiffon'"),
        ("chiffon+dust", 0, 256, "'chiffon'"),
        ("brick+glitter", 0, 256, r"'brick\+glitter'"),
        ("brick", 4, 256, "variant 4"),
        ("brick", -1, 256, "variant -1"),
        ("brick", 0, 300, "size 300"),
        ("brick", 0, 32, "size 32"),
    ],
)
def test_bad_requests_name_the_value(family, variant, size, message):
    with pytest.raises(FsidError, match=message):
        bake_material(family, variant, size)


def test_noise_has_the_spectrum_it_promises():
    """Amplitude ~ f^-slope: log power against log frequency falls by 2 slope."""
    field = noise(np.random.default_rng(0), 512, 1.5)
    power = np.abs(np.fft.fft2(field)) ** 2
    f = np.hypot(*np.meshgrid(np.fft.fftfreq(512, 1 / 512), np.fft.fftfreq(512, 1 / 512)))
    bands = [power[(f > lo) & (f < 1.5 * lo)].mean() for lo in (4, 8, 16, 32, 64)]
    slope = np.polyfit(np.log2((4, 8, 16, 32, 64)), np.log2(bands), 1)[0]
    assert slope == pytest.approx(-3.0, abs=0.15)
    assert field.mean() == pytest.approx(0, abs=1e-4)
    assert field.std() == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize(
    ("slope", "low", "high", "stretch"),
    [(1.6, 1, np.inf, (1, 1)), (0.8, 8, 30, (1, 1)), (1.6, 3, np.inf, (4, 1)), (2.2, 1, 6, (1, 1))],
)
def test_noise_is_the_same_at_every_size_and_so_is_what_is_drawn_after_it(slope, low, high, stretch):
    rngs = [np.random.default_rng(8) for _ in range(3)]
    small, middle, large = (
        noise(rng, size, slope, low, high, stretch) for rng, size in zip(rngs, (128, 256, 1024), strict=True)
    )
    for finer in (middle, large):
        k = len(finer) // 128
        seen = finer.reshape(128, k, 128, k).mean((1, 3))
        assert np.corrcoef(small.ravel(), seen.ravel())[0, 1] > 0.93
    assert len({rng.random() for rng in rngs}) == 1


def test_level_makes_gaussian_noise_uniform():
    values = level(noise(np.random.default_rng(1), 512, 0.0))
    counts, _ = np.histogram(values, bins=10, range=(0, 1))
    np.testing.assert_allclose(counts / values.size, 0.1, atol=0.003)


def test_cells_find_the_nearest_seeds():
    """Against brute force over all periodic copies of the seeds."""
    near, second, value = cells(np.random.default_rng(2), 64, 5, 0.9)
    rng = np.random.default_rng(2)
    seeds = 0.5 + 0.9 * (rng.random((5, 5, 2)) - 0.5) + np.stack(np.meshgrid(range(5), range(5)), -1)
    values = rng.random((5, 5), dtype=np.float32)
    t = (np.arange(64) + 0.5) / 64 * 5
    points = np.stack(np.meshgrid(t, t), -1)
    gap = points[:, :, None] - seeds.reshape(-1, 2)
    distance = np.linalg.norm((gap + 2.5) % 5 - 2.5, axis=-1)
    order = np.sort(distance, axis=-1)
    np.testing.assert_allclose(near, order[..., 0], atol=1e-5)
    np.testing.assert_allclose(second, order[..., 1], atol=1e-5)
    np.testing.assert_array_equal(value, values.ravel()[distance.argmin(-1)])


def test_warp_by_whole_texels_is_a_roll():
    field = np.random.default_rng(3).random((64, 64)).astype(np.float32)
    np.testing.assert_allclose(warp(field, 5 / 64, -3 / 64), np.roll(field, (3, -5), axis=(0, 1)), atol=1e-5)


def test_stacked_polygons_wrap_and_cover():
    square = np.array([(-0.25, -0.25), (0.25, -0.25), (0.25, 0.25), (-0.25, 0.25)])
    above = square * 0.5 + 0.5
    field = shade(stack(64, [square, above]), np.array([0.4, 0.8]), ground=0.1)
    corners = field[[0, 0, -1, -1], [0, -1, 0, -1]]
    np.testing.assert_allclose(corners, 0.4)
    assert field[32, 32] == pytest.approx(0.8)
    assert field[32, 0] == pytest.approx(0.1)
