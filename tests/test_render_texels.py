"""Texels kept on disk are, byte for byte, the mip levels that are averaged in float from the maps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fsid.assets import MaterialMaps, bake_material, material_registry
from fsid.assets.bake_cache import _read
from fsid.errors import FsidError
from fsid.render import texels
from fsid.render.texels import bake_texels, level_ranges, pack, texels_of, unpack

SIZE = 64
FAMILIES = ("brick", "rusty_metal", "screen", "paint", "wicker+dust")


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("FSID_CACHE", str(tmp_path))
    return tmp_path / "materials"


def same(first: texels.Texels, second: texels.Texels) -> bool:
    numbers = first.slope_scale == second.slope_scale and np.array_equal(first.shares, second.shares)
    return numbers and np.array_equal(first.data, second.data)


def float_levels(maps: MaterialMaps) -> list[tuple[np.ndarray, np.ndarray]]:
    """All mip levels (5, s, s) masks and (3, s, s) slopes in [-1, 1] and spread, never rounded."""
    height = maps.height
    slopes = np.stack([np.roll(height, -1, axis) - np.roll(height, 1, axis) for axis in (1, 0)])
    slopes *= np.float32(maps.relief_m * SIZE / (2 * maps.tile_m))
    scale = max(np.quantile(np.abs(slopes[:, ::2, ::2]), 0.999), 1e-4)
    slopes = np.clip(slopes / np.float32(scale), -1, 1)
    masks = np.stack([maps.mix, maps.pattern, maps.detail, maps.roughness, maps.metallic])
    steps = [(np.roll(slopes, -1, axis) - np.roll(slopes, 1, axis)) / 2 for axis in (1, 2)]
    inside = sum((step**2).sum(0) for step in steps)[None] * np.float32(0.5 / 12)  # of a line over its length
    planes = np.concatenate([masks, slopes, (slopes[:1] ** 2 + slopes[1:] ** 2) * np.float32(0.5) + inside])
    levels = []
    while True:
        variance = planes[7] - (planes[5] ** 2 + planes[6] ** 2) * np.float32(0.5)
        spread = np.sqrt(np.maximum(variance, 0))
        levels.append((planes[:5], np.stack([planes[5], planes[6], spread])))
        if planes.shape[1] == 1:
            return levels
        rows = planes[:, ::2] + planes[:, 1::2]
        planes = (rows[:, :, ::2] + rows[:, :, 1::2]) * np.float32(0.25)


@pytest.mark.parametrize("family", FAMILIES)
def test_stored_levels_are_the_averaged_ones(folder, family, monkeypatch):
    fresh = bake_texels(family, 1, SIZE)
    monkeypatch.setattr(texels, "texels_of", lambda maps: pytest.fail("made again"))
    monkeypatch.setattr(texels, "draw_material", lambda *key: pytest.fail("drawn again"))
    read = bake_texels(family, 1, SIZE)
    assert same(fresh, read)
    levels = float_levels(bake_material(family, 1, SIZE))
    assert len(levels) == len(level_ranges(SIZE)) == 7
    for (masks, slopes), (size, level) in zip(levels, level_ranges(SIZE), strict=True):
        data = np.moveaxis(read.data[:, level].reshape(2, size, size, 4), -1, 1)
        tops = np.float32([255, 255, 254, 255])[:, None, None]
        np.testing.assert_array_equal(data[0], np.rint(masks[:4] * tops))
        np.testing.assert_array_equal(data[1, :2], np.rint(slopes[:2] * np.float32(127)) + 128)
        np.testing.assert_allclose(data[1, 2], slopes[2] * np.float32(255), atol=0.501)
        np.testing.assert_array_equal(data[1, 3], np.rint(masks[4] * np.float32(255)))


def test_without_a_cache_the_texels_are_the_same(folder, monkeypatch):
    kept = bake_texels("brick", 2, SIZE)
    monkeypatch.setenv("FSID_CACHE", "off")
    assert same(kept, bake_texels("brick", 2, SIZE))


def test_packing_keeps_every_byte_and_drops_constant_channels():
    made = texels_of(bake_material("paint", 0, SIZE))
    packed = pack(made)
    assert same(unpack(packed, SIZE), made)
    assert sum(plane.size == 1 for plane in packed.values()) >= 1  # paint is no metal
    with pytest.raises(ValueError, match="shape"):
        unpack(packed, 2 * SIZE)


def test_only_what_shrinks_much_is_deflated(folder):
    bake_texels("brick", 1, SIZE)
    bake_texels("circuit_board", 1, SIZE)
    arrays = [_read(path) for path in folder.iterdir()]
    raw = sum(array.nbytes for entry in arrays for array in entry.values())
    kept = sum(path.stat().st_size for path in folder.iterdir())
    assert 0.2 * raw < kept < 0.95 * raw


def test_a_damaged_entry_is_made_again(folder):
    """A flipped bit anywhere, every tenth byte of the file in turn, and every length of it."""
    expected = bake_texels("brick", 1, SIZE)
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    rng = np.random.default_rng(0)
    damaged = [whole[:n] for n in rng.integers(0, len(whole), 10)]
    places = [*range(0, 80), *range(len(whole) - 700, len(whole)), *rng.integers(0, len(whole), 100)]
    for place in places[:: len(places) // 150]:
        flipped = bytearray(whole)
        flipped[place] ^= 1 << int(rng.integers(8))
        damaged.append(bytes(flipped))
    for data in damaged:
        path.write_bytes(data)
        assert same(bake_texels("brick", 1, SIZE), expected)


def test_what_does_not_exist_is_said():
    with pytest.raises(FsidError, match="no_such"):
        bake_texels("no_such", 0, SIZE)
    with pytest.raises(FsidError, match="variant 7"):
        bake_texels("brick", 7, SIZE)


def test_a_changed_source_is_another_entry(folder, monkeypatch):
    bake_texels("brick", 1, SIZE)
    monkeypatch.setattr(texels, "code_key", lambda modules: "edited")
    bake_texels("brick", 1, SIZE)
    monkeypatch.setattr(material_registry, "code_key", lambda modules: "edited")
    bake_texels("brick", 1, SIZE)
    assert len(list(folder.iterdir())) == 3
