"""Texture folders: names, colours, relief, and images that must not be believed."""

from __future__ import annotations

import os
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fsid.assets import (
    bake_material,
    material_colours,
    material_tile_m,
    survey_textures,
    texture_sources,
    textures,
)
from fsid.assets import texture_files as files
from fsid.assets.patterns import noise
from fsid.assets.survey import KNOWN
from fsid.assets.textures import TILE_M, integrated, slopes_of, texture_key
from fsid.assets.triangle import decode, enclosing, encode, hex_colours, srgb_to_linear
from fsid.errors import FsidError

SIZE = 128


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory, monkeypatch):
    monkeypatch.setenv("FSID_CACHE", str(tmp_path_factory.mktemp("cache")))
    KNOWN.clear()


def picture(seed: int = 0, size: int = SIZE) -> np.ndarray:
    """(S, S, 3) uint8 of many colours."""
    rng = np.random.default_rng(seed)
    fields = [noise(rng, size, 1.2) for _ in range(3)]
    return np.uint8(np.clip(128 + 50 * np.stack(fields, -1), 0, 255))


def hill(size: int = SIZE) -> tuple[np.ndarray, np.ndarray]:
    """(height in tile widths, its OpenGL normal map 0..1)."""
    t = (np.arange(size) + 0.5) / size
    u, v = np.meshgrid(t, t)
    height = 0.02 * np.sin(2 * np.pi * 2 * u) * np.cos(2 * np.pi * 3 * v) + 0.01 * np.sin(2 * np.pi * v)
    slope_u = 0.08 * np.pi * np.cos(4 * np.pi * u) * np.cos(6 * np.pi * v)
    slope_v = -0.12 * np.pi * np.sin(4 * np.pi * u) * np.sin(6 * np.pi * v) + 0.02 * np.pi * np.cos(
        2 * np.pi * v
    )
    normal = np.stack([-slope_u, slope_v, np.ones_like(u)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    return height, (normal + 1) / 2


def save(path: Path, image: np.ndarray) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    if image.dtype != np.uint8 and image.dtype != np.uint16:
        image = np.uint8(np.rint(image * 255))
    Image.fromarray(image).save(path)


@pytest.fixture
def folder(tmp_path) -> Path:
    """Two sets in ambientCG names, two in those of Poly Haven."""
    _, normal = hill()
    grey = np.full((SIZE, SIZE), 0.3)
    save(tmp_path / "Bricks001_1K-PNG" / "Bricks001_1K-PNG_Color.png", picture())
    save(tmp_path / "Bricks001_1K-PNG" / "Bricks001_1K-PNG_NormalGL.png", normal)
    save(tmp_path / "Bricks001_1K-PNG" / "Bricks001_1K-PNG_Roughness.png", grey)
    save(tmp_path / "Metal002_2K-PNG_Color.png", picture(1))
    save(tmp_path / "Metal002_2K-PNG_Metalness.png", grey * 0 + 1)
    save(tmp_path / "rock_wall" / "rock_wall_diff_1k.png", picture(2))
    save(tmp_path / "rock_wall" / "rock_wall_arm_1k.png", np.dstack([grey, grey * 2, grey * 3]))
    save(tmp_path / "rock_wall" / "rock_wall_nor_gl_1k.png", normal)
    save(
        tmp_path / "rock_wall" / "rock_wall_disp_1k.png",
        np.uint16(65535 * np.clip(0.5 + hill()[0] * 9, 0, 1)),
    )
    save(tmp_path / "plain_diff_1k.jpg", picture(3))
    return tmp_path


def test_both_naming_schemes_are_found_with_whatever_maps_they_have(folder):
    names = texture_sources(folder)
    assert names == tuple(
        f"file:{folder / part}"
        for part in (
            "Bricks001_1K-PNG/Bricks001_1K-PNG",
            "Metal002_2K-PNG",
            "plain_1k",
            "rock_wall/rock_wall_1k",
        )
    )
    bricks, metal, plain, rock = (bake_material(name, 0, SIZE) for name in names)
    assert bricks.roughness.mean() == pytest.approx(0.3, abs=0.01)
    assert metal.metallic.min() == 1
    assert (plain.metallic == 0).all()
    assert np.ptp(plain.height) == 0
    assert rock.roughness.mean() == pytest.approx(0.6, abs=0.01)
    assert rock.metallic.mean() == pytest.approx(0.9, abs=0.01)
    assert material_tile_m(names[0]) == bricks.tile_m == TILE_M


def save_exr(path: Path, image: np.ndarray, names: str) -> None:
    import OpenEXR

    planes = np.moveaxis(np.atleast_3d(image).astype(np.float32), -1, 0)
    channels = {name: np.ascontiguousarray(plane) for name, plane in zip(names, planes, strict=True)}
    path.parent.mkdir(parents=True, exist_ok=True)
    OpenEXR.File({"type": OpenEXR.scanlineimage}, channels).write(str(path))


def test_maps_of_data_may_be_openexr_as_in_the_archives_of_poly_haven(tmp_path):
    height, normal = hill()
    for place in ("png", "exr"):
        save(tmp_path / place / "rock_diff_1k.jpg", picture(2))
    save(tmp_path / "png" / "rock_nor_gl_1k.png", normal)
    save(tmp_path / "png" / "rock_rough_1k.png", 0.5 + 10 * height)
    save(tmp_path / "png" / "rock_disp_1k.png", np.uint16(65535 * np.clip(0.5 + 9 * height, 0, 1)))
    save_exr(tmp_path / "exr" / "rock_nor_gl_1k.exr", normal, "RGB")
    save_exr(tmp_path / "exr" / "rock_rough_1k.exr", 0.5 + 10 * height, "Y")
    save_exr(tmp_path / "exr" / "rock_disp_1k.exr", 100 * height, "Y")
    exr, png = (bake_material(f"file:{tmp_path / place}", 0, SIZE) for place in ("exr", "png"))
    for key in ("mix", "pattern", "detail", "roughness", "height", "metallic"):
        np.testing.assert_allclose(getattr(exr, key), getattr(png, key), atol=0.01, err_msg=key)
    assert exr.relief_m == pytest.approx(png.relief_m, rel=0.02)


def test_the_alpha_of_a_grey_exr_is_not_its_map(tmp_path):
    import OpenEXR

    grey = np.full((SIZE, SIZE), 0.25, np.float32)
    save(tmp_path / "rock_diff_1k.jpg", picture())
    channels = {"A": np.ones_like(grey), "Y": grey}
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, channels) as file:
        file.write(str(tmp_path / "rock_rough_1k.exr"))
    np.testing.assert_allclose(bake_material(f"file:{tmp_path}", 0, 64).roughness, 0.25, atol=0.01)


def test_an_exr_whose_other_channels_and_parts_would_fill_memory_is_left_out(tmp_path, monkeypatch):
    """A file of 7 MB had channels of 7 GB, and what it is read for is decoded with all of them."""
    import OpenEXR

    monkeypatch.setattr(files, "MAX_PIXELS", SIZE * SIZE)
    grey = np.full((SIZE, SIZE), 0.5, np.float32)
    for name in ("channels", "parts"):
        save(tmp_path / f"{name}_diff_1k.jpg", picture())
    header = {"type": OpenEXR.scanlineimage}
    planes = dict.fromkeys("RGBAZ", grey)
    OpenEXR.File(header, planes).write(str(tmp_path / "channels_rough_1k.exr"))
    parts = [
        OpenEXR.Part(header | {"name": "map"}, {"Y": grey}),
        OpenEXR.Part(header | {"name": "rest"}, dict.fromkeys("RGBA", grey)),
    ]
    OpenEXR.File(parts).write(str(tmp_path / "parts_rough_1k.exr"))
    with pytest.raises(
        FsidError, match=r"first of 2 skipped: channels_rough_1k\.exr has 81,920 values in all"
    ):
        survey_textures(str(tmp_path))


def test_an_exr_that_is_no_map_is_left_out(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "MAX_PIXELS", SIZE * SIZE)
    grey = np.full((SIZE, SIZE), 0.5)
    for name in ("good", "nan", "large", "small", "page", "cut"):
        save(tmp_path / f"{name}_diff_1k.jpg", picture())
        save_exr(tmp_path / f"{name}_rough_1k.exr", grey, "Y")
    save_exr(tmp_path / "only_diff_1k.exr", picture() / 255, "RGB")
    save_exr(tmp_path / "nan_rough_1k.exr", grey * np.nan, "Y")
    save_exr(tmp_path / "large_rough_1k.exr", np.ones((SIZE, SIZE + 2)), "Y")
    save_exr(tmp_path / "small_rough_1k.exr", np.ones((4, 4)), "Y")
    (tmp_path / "page_rough_1k.exr").write_text("<html>404</html>")
    cut = tmp_path / "cut_rough_1k.exr"
    cut.write_bytes(cut.read_bytes()[:-20])
    survey = survey_textures(str(tmp_path))
    assert survey.usable == (f"file:{tmp_path / 'good_1k'}",)
    reasons = {Path(name).name: reason for name, reason in survey.skipped}
    assert set(reasons) == {"nan_1k", "large_1k", "small_1k", "page_1k", "cut_1k", "only_1k"}
    assert "JPEG or PNG" in reasons["only_1k"]
    assert "more than" in reasons["large_1k"]
    assert "not numbers" in reasons["nan_1k"]


@pytest.mark.parametrize(
    ("colour", "size"), [("BaseColor", ""), ("base_color", ""), ("Albedo", ""), ("basecolor", "_2k")]
)
def test_the_colour_may_have_the_names_of_painting_programs(tmp_path, colour, size):
    save(tmp_path / f"Tile_{colour}{size}.png", picture())
    save(tmp_path / f"Tile_{'rough' if size else 'Roughness'}{size}.png", np.full((SIZE, SIZE), 0.3))
    assert texture_sources(tmp_path) == (f"file:{tmp_path}/Tile{size}",)
    assert bake_material(f"file:{tmp_path}", 0, 64).roughness.mean() == pytest.approx(0.3, abs=0.01)


@pytest.mark.parametrize("normal", ["Normal_OpenGL", "normal-ogl"])
def test_the_maps_of_painting_programs_are_those_of_the_set(tmp_path, normal):
    height, encoded = hill()
    save(tmp_path / "crate_BaseColor.png", picture())
    save(tmp_path / f"crate_{normal}.png", encoded)
    save(tmp_path / "crate_Metallic.png", np.full((SIZE, SIZE), 1.0))
    save(tmp_path / "crate_Height.png", np.uint16(65535 * np.clip(0.5 + 9 * height, 0, 1)))
    assert not survey_textures(str(tmp_path)).skipped
    maps = bake_material(f"file:{tmp_path}", 0, SIZE)
    assert maps.metallic.min() == 1
    assert np.corrcoef(maps.height.ravel(), height.ravel())[0, 1] > 0.999
    assert maps.relief_m == pytest.approx(np.ptp(height) * TILE_M, rel=0.05)


def test_pictures_of_no_set_are_listed_with_the_reason(folder):
    usable = texture_sources(folder)
    KNOWN.clear()
    for name in ("x_Color.tif", "y_Color.webp", "z_Color.tga", "holiday.jpg", "Metal002_2K-PNG_Sheen.png"):
        (folder / name).write_bytes(b"")
    passed_over = ("Metal002.png", "rock_wall/rock_wall.png", "Metal002_2K-PNG_AmbientOcclusion.png")
    for name in (*passed_over, "plain_ao_1k.jpg", "readme.txt"):
        (folder / name).write_bytes(b"")
    survey = survey_textures(str(folder))
    assert survey.usable == usable
    unread, unnamed = "is no JPEG, PNG or OpenEXR", "is not named as ambientCG or Poly Haven do"
    reasons = {
        **dict.fromkeys(("x_Color.tif", "y_Color.webp", "z_Color.tga"), unread),
        **dict.fromkeys(("holiday.jpg", "Metal002_2K-PNG_Sheen.png"), unnamed),
    }
    expected = {(f"file:{folder / name}", f"{name} {reason}") for name, reason in reasons.items()}
    assert set(survey.skipped) == expected


def test_a_folder_of_other_pictures_says_what_is_wrong_with_them(tmp_path):
    (tmp_path / "x_Color.tif").write_bytes(b"")
    with pytest.raises(FsidError, match=r"the first of 1 skipped: x_Color.tif is no JPEG"):
        texture_sources(tmp_path)


def test_a_set_in_several_colours_shows_the_first(tmp_path):
    save(tmp_path / "cloth_07_col_1_1k.png", picture(1))
    save(tmp_path / "cloth_07_col_2_1k.png", picture(2))
    save(tmp_path / "plaid_col_01_2k.png", picture(3))
    names = texture_sources(tmp_path)
    assert names == tuple(f"file:{tmp_path / name}" for name in ("cloth_07_1k", "plaid_2k"))
    assert files.set_at(tmp_path / "cloth_07_1k").files == {"colour": tmp_path / "cloth_07_col_1_1k.png"}


def test_a_name_that_is_no_text_is_left_out(tmp_path):
    save(tmp_path / "good_Color.png", picture())
    bad = os.fsencode(tmp_path) + b"/\xff_Color.png"
    Path(os.fsdecode(bad)).write_bytes((tmp_path / "good_Color.png").read_bytes())
    survey = survey_textures(str(tmp_path))
    assert survey.usable == (f"file:{tmp_path / 'good'}",)
    ((name, reason),) = survey.skipped
    assert name.encode()
    assert "UTF-8" in reason


def test_colours_are_those_of_the_picture(folder):
    name = texture_sources(folder)[0]
    maps = bake_material(name, 0, SIZE)
    assert maps.colours == material_colours(name, 0) == bake_material(name, 3, 64).colours
    shown = decode(maps.mix, maps.pattern, maps.detail, maps.colours)
    error = np.abs(shown - srgb_to_linear(picture() / 255))
    assert error.max() < 2.0 / 255
    assert np.sqrt((error**2).mean()) < 0.5 / 255


def test_a_folder_with_one_set_is_a_name_too(folder):
    by_folder = bake_material(f"file:{folder / 'rock_wall'}", 0, 64)
    by_prefix = bake_material(f"file:{folder / 'rock_wall' / 'rock_wall_1k'}", 0, 64)
    np.testing.assert_array_equal(by_folder.height, by_prefix.height)


def test_a_set_beside_a_folder_of_its_name_is_not_taken_for_the_folder(folder):
    for name in ("wood", "cork"):
        save(folder / "mixed_1k" / f"{name}_diff_1k.png", picture(4))
    save(folder / "mixed_diff_1k.png", picture(5))
    save(folder / "rock_wall_Color.png", picture(6))
    for name, seed in (("mixed_1k", 5), ("rock_wall", 6)):
        assert f"file:{folder / name}" in texture_sources(folder)
        maps = bake_material(f"file:{folder / name}", 0, SIZE)
        shown = decode(maps.mix, maps.pattern, maps.detail, maps.colours)
        np.testing.assert_allclose(shown, srgb_to_linear(picture(seed) / 255), atol=0.02)


def test_a_layer_lies_over_a_texture_set(folder):
    name = texture_sources(folder)[0]
    bare, dusty = bake_material(name, 0, 64), bake_material(f"{name}+dust", 0, 64)
    assert dusty.colours == bare.colours
    assert dusty.detail.std() < bare.detail.std()


def test_height_from_a_normal_map_has_its_slopes(folder):
    truth, _ = hill()
    maps = bake_material(texture_sources(folder)[0], 0, SIZE)
    metres = (maps.height - maps.height.mean()) * maps.relief_m
    np.testing.assert_allclose(metres, (truth - truth.mean()) * maps.tile_m, atol=6e-4)


def test_displacement_gets_its_range_from_the_normal_map(folder):
    """The displacement map alone does not say how many metres it spans."""
    maps = bake_material(f"file:{folder / 'rock_wall'}", 0, SIZE)
    assert maps.relief_m == pytest.approx(np.ptp(hill()[0]) * maps.tile_m, rel=0.03)


@pytest.mark.parametrize("size", [64, 256])
def test_a_fine_displacement_gets_its_range_too(tmp_path, size):
    """Slopes of few texels, which differences of neighbours do not show, are in normal maps."""
    height = noise(np.random.default_rng(3), 512, 1.6)
    height = 0.01 * (height - height.min()) / np.ptp(height)
    waves = 2j * np.pi * np.fft.fftfreq(512, 1 / 512)
    du, dv = (np.real(np.fft.ifft2(np.fft.fft2(height) * w)) for w in (waves[None], waves[:, None]))
    normal = np.stack([-du, dv, np.ones_like(du)], axis=-1)
    save(tmp_path / "a_Color.png", picture())
    save(tmp_path / "a_NormalGL.png", (normal / np.linalg.norm(normal, axis=-1, keepdims=True) + 1) / 2)
    save(tmp_path / "a_Displacement.png", np.uint16(height * 6_553_500))
    maps = bake_material(f"file:{tmp_path}", 0, size)
    seen, truth = maps.height * maps.relief_m, height.reshape(size, 512 // size, size, -1).mean((1, 3))
    assert np.std(seen) == pytest.approx(np.std(truth) * TILE_M, rel=0.03)


@pytest.mark.parametrize("suffix", ["png", "exr"])
def test_a_displacement_alone_has_the_same_metres_at_every_size(tmp_path, suffix):
    """A lone needle a hundredth of a tile wide: of few texels little is left, and no taller ones are made."""
    height = np.zeros((256, 256))
    height[100:103, 50:53] = 1.0
    save(tmp_path / "a_diff_1k.png", picture())
    if suffix == "exr":
        save_exr(tmp_path / "a_disp_1k.exr", 40 * height - 7, "Y")
    else:
        save(tmp_path / "a_disp_1k.png", height)
    fine, coarse = (bake_material(f"file:{tmp_path}", 0, size) for size in (256, 64))
    tops = fine.height.reshape(64, 4, 64, 4).mean((1, 3)) * fine.relief_m
    assert np.ptp(coarse.height) * coarse.relief_m == pytest.approx(np.ptp(tops), rel=0.25)
    assert fine.relief_m == pytest.approx(0.02)


def test_a_displacement_that_hardly_varies_makes_no_mountains(tmp_path):
    levels = np.uint8(np.rint(128 + 0.6 * noise(np.random.default_rng(0), 256, 0.3)))
    save(tmp_path / "a_Color.png", picture())
    save(tmp_path / "a_Displacement.png", levels)
    maps = bake_material(f"file:{tmp_path}", 0, 256)
    assert maps.relief_m == pytest.approx(0.02 * np.ptp(levels) / 255, rel=0.01)


@pytest.mark.parametrize("size", [64, SIZE, 2 * SIZE])
def test_values_of_an_exr_beyond_one_are_one(tmp_path, size):
    """Where the picture is as large as the tile nothing is resampled; 1.004 came out as a mirror."""
    save(tmp_path / "a_diff_1k.png", picture())
    save_exr(tmp_path / "a_rough_1k.exr", np.full((SIZE, SIZE), 1.004), "Y")
    assert bake_material(f"file:{tmp_path}", 0, size).roughness.min() == 1


def test_directx_normals_are_turned_over():
    _, normal = hill()
    other = normal * (1, -1, 1) + (0, 1, 0)
    np.testing.assert_allclose(slopes_of(normal, 1.0), slopes_of(other, -1.0), atol=1e-12)


def test_integration_inverts_differentiation():
    truth, normal = hill()
    np.testing.assert_allclose(integrated(slopes_of(normal, 1.0)), truth - truth.mean(), atol=1e-5)


@pytest.mark.parametrize("shape", [(96, 96), (64, 128), (300, 200), (256, 64)])
def test_any_resolution_and_shape_gives_square_tiles(tmp_path, shape):
    save(tmp_path / "a_diff_1k.png", picture(4, 512)[: shape[0], : shape[1]])
    maps = bake_material(texture_sources(tmp_path)[0], 0, 128)
    assert maps.detail.shape == (128, 128)


def test_resampling_is_periodic():
    """A seam would show as a step between the last and the first row."""
    t = (np.arange(200) + 0.5) / 200
    wave = np.sin(2 * np.pi * t)[:, None, None] * np.ones((1, 200, 1)) / 2.5 + 0.5
    out = files.resampled(wave.astype(np.float32), 64)[..., 0]
    wanted = np.sin(2 * np.pi * (np.arange(64) + 0.5) / 64) / 2.5 + 0.5
    np.testing.assert_allclose(out, np.broadcast_to(wanted[:, None], (64, 64)), atol=2e-3)


def bomb(width: int, height: int) -> bytes:
    """A PNG of a few kilobytes whose header promises width x height pixels."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    data = zlib.compress(bytes(100_000))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")


def test_broken_hostile_and_huge_images_are_skipped_and_counted(folder, monkeypatch):
    monkeypatch.setattr(files, "MAX_FILE_BYTES", 200_000)
    good = len(texture_sources(folder))
    KNOWN.clear()
    truncated = (folder / "rock_wall" / "rock_wall_diff_1k.png").read_bytes()[:2000]
    bad = {
        "truncated_diff_1k.png": truncated,
        "empty_diff_1k.jpg": b"",
        "text_diff_1k.jpg": b"not an image",
        "bomb_diff_1k.png": bomb(60_000, 60_000),
        "wide_diff_1k.png": bomb(9_000, 9_000),
        "lying_diff_1k.png": bomb(4_000, 4_000),
        "tiny_diff_1k.png": bomb(3, 3),
        "huge_diff_1k.png": bytes(200_001),
        "colourless_rough_1k.png": (folder / "plain_diff_1k.jpg").read_bytes(),
    }
    for name, data in bad.items():
        (folder / name).write_bytes(data)
    (folder / "dangling_diff_1k.png").symlink_to(folder / "nowhere.png")
    survey = survey_textures(str(folder))
    assert len(survey.usable) == good
    reasons = {Path(name.removeprefix("file:")).name: reason for name, reason in survey.skipped}
    assert len(reasons) == len(bad) + 1
    assert "no colour map" in reasons["colourless_1k"]
    assert "more than" in reasons["wide_1k"]
    assert all("\n" not in reason for reason in reasons.values())


@pytest.mark.parametrize("name", ["nowhere", "nowhere/set_1k"])
def test_bad_names_raise_one_line(tmp_path, name):
    with pytest.raises(FsidError, match="no texture set"):
        bake_material(f"file:{tmp_path / name}", 0, 64)
    with pytest.raises(FsidError, match="no such folder"):
        texture_sources(tmp_path / name)


def test_a_folder_without_textures_says_so(tmp_path):
    with pytest.raises(FsidError, match="no usable texture set"):
        texture_sources(tmp_path)


def test_files_are_read_for_the_first_scene_that_has_them_alone(folder, monkeypatch):
    """A scene asks for the colours and the texels of dozens of sets; a set of 2K pictures has 10 MB."""
    name = texture_sources(folder)[0]
    colours, key = material_colours(name, 0), texture_key(name)
    monkeypatch.setattr(textures, "read_bounded", None)
    assert (material_colours(name, 0), texture_key(name)) == (colours, key)


def test_a_file_that_changes_while_it_is_read_is_not_kept_as_the_one_before(folder, monkeypatch):
    name = texture_sources(folder)[0]
    texture_key(name)
    monkeypatch.setattr(textures, "read_bounded", lambda file: file.read_bytes() + b"more")
    with pytest.raises(FsidError, match="changed while it was read"):
        bake_material(name, 0, 2 * SIZE)


def test_a_changed_file_is_another_material(folder):
    name = f"file:{folder / 'plain_1k'}"
    before = bake_material(name, 0, 64)
    save(folder / "plain_diff_1k.jpg", picture(9))
    assert not np.array_equal(before.detail, bake_material(name, 0, 64).detail)


class TestTriangle:
    def test_encoding_inverts_decoding(self):
        rng = np.random.default_rng(0)
        masks = [rng.random((50, 50)).astype(np.float32) * 0.9 + 0.05 for _ in range(3)]
        colours = hex_colours("c04030 40b050 3050c0")
        for found, mask in zip(encode(decode(*masks, colours), colours), masks, strict=True):
            np.testing.assert_allclose(found, mask, atol=2e-5)

    @pytest.mark.parametrize("kind", ["gamut", "grey", "black", "white and red", "one colour"])
    def test_every_picture_fits_its_triangle(self, kind):
        rng = np.random.default_rng(1)
        rgb = {
            "gamut": rng.random((4096, 3)),
            "grey": np.repeat(rng.random((4096, 1)), 3, 1),
            "black": np.zeros((4096, 3)),
            "white and red": np.array([(1.0, 1.0, 1.0), (1.0, 0.0, 0.0)] * 2048),
            "one colour": np.tile((0.2, 0.5, 0.1), (4096, 1)),
        }[kind].astype(np.float32)
        colours = enclosing(rgb)
        masks = encode(rgb, colours)
        rounded = [np.rint(m * n) / np.float32(n) for m, n in zip(masks, (255, 255, 254), strict=True)]
        error = np.abs(decode(*rounded, colours) - rgb)
        assert error.max() < 2.0 / 255
        assert np.sqrt((error**2).mean()) < 0.8 / 255

    def test_hex_colours_are_srgb(self):
        np.testing.assert_allclose(
            hex_colours("ffffff 000000 bcbcbc"), [[1] * 3, [0] * 3, [0.5029] * 3], atol=1e-4
        )


def test_noise_is_as_strong_across_as_along(rng):
    """Power of the waves along u alone and of those along v alone."""
    power = sum(np.abs(np.fft.fft2(noise(rng, 64, 1.0))) ** 2 for _ in range(150))
    assert power[0, 2:12].sum() == pytest.approx(power[2:12, 0].sum(), rel=0.15)
