"""Deblurring pairs and bursts from moving scenes, and linear renders of other engines as a source."""

from __future__ import annotations

import io
import struct
from dataclasses import fields, replace
from operator import attrgetter
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import skimage
import tifffile
from PIL import ExifTags, Image, ImageCms, ImageOps
from scipy.ndimage import gaussian_filter, map_coordinates

from fsid.config import given_keys, load_settings
from fsid.dataset import GenerateConfig, Sample, check_given, encode, make_sample, pictures, read_photo
from fsid.dataset.attempt import _half_precision
from fsid.dataset.pictures import check_pictures, find_pictures, read_exr
from fsid.dataset.tasks import BURST_FRAMES, scene_config, smaller, views_of_scene
from fsid.dataset.unused_settings import _FIXED, _NEEDS
from fsid.errors import FsidError
from fsid.render import Renderer
from fsid.scene import Scene, sample
from fsid.sensor import Raw, clean_from_linear, exposure_rand, load_profile, pack

SETTINGS = [
    "width=160",
    "height=96",
    "cameras=[pixel6]",
    "iso_range=[100,100]",
    "texture_size=64",
    "supersampling=1",
    "scene.objects=[3,3]",
    "scene.material_families=[brick,wood_planks]",
    "scene.materials.plain_share=0",
]


def config(*settings: str) -> GenerateConfig:
    return load_settings(GenerateConfig, None, [*SETTINGS, *settings])


@pytest.fixture(scope="module")
def renderer():
    with Renderer(supersampling=1, texture_size=64) as renderer:
        yield renderer


def sharpness(sample: Sample, name: str) -> float:
    raw = sample.clean if name == "clean" else sample.more[name]
    green = pack(raw.mosaic, raw.cfa)[1]
    return float(np.mean(np.diff(green, axis=0) ** 2) + np.mean(np.diff(green, axis=1) ** 2))


CAMERA_MOVES = ["scene.motion.shake_deg=[1,1]"]
OBJECTS_MOVE = [
    "scene.motion.shake_deg=[0,0]",
    "scene.motion.shake_m=[0,0]",
    "scene.motion.moving_share=1",
    "scene.motion.speed_m_s=[1,1]",
]


@pytest.mark.parametrize("motion", [CAMERA_MOVES, OBJECTS_MOVE])
def test_a_blurred_image_has_the_light_of_the_sharp_one_and_less_detail(
    motion: list[str], renderer: Renderer
) -> None:
    sample = make_sample(config("task=deblur", "scene.motion.exposure_s=[0.2,0.2]", *motion), 6, 0, renderer)
    blurred = sample.more["degraded"]
    assert blurred.mosaic.shape == sample.clean.mosaic.shape
    assert blurred.mosaic.mean() == pytest.approx(sample.clean.mosaic.mean(), rel=0.05)
    assert sharpness(sample, "degraded") < 0.9 * sharpness(sample, "clean")
    assert sample.record["scene"]["cameras"][0]["exposure_s"] == pytest.approx(0.2)
    assert np.std(sample.noisy.mosaic - blurred.mosaic) < 0.02
    assert {"clean.dng", "noisy.dng", "degraded.dng", "rgb.png", "json"} == encode(sample).keys()
    for raw in (sample.clean, sample.noisy, blurred):
        assert raw.metadata.exposure_s == pytest.approx(0.2)


def test_the_flow_of_a_burst_leads_each_frame_to_the_first(renderer: Renderer) -> None:
    shake = ["scene.motion.shake_deg=[0.8,0.8]", "scene.motion.shake_m=[0.003,0.003]"]
    sample = make_sample(config("task=burst", "iso_range=[100,100]", *shake), 7, 0, renderer)
    files = encode(sample)
    assert len([name for name in files if name.startswith("noisy")]) == BURST_FRAMES
    first, y, x = green(sample.noisy), *np.mgrid[:48, :80].astype(float)
    for number in range(1, BURST_FRAMES):
        flow = np.load(io.BytesIO(files[f"flow{number}.npy"])).astype(float)
        assert flow.shape == (96, 160, 2)
        right, down = (flow[::2, ::2, axis] / 2 for axis in range(2))
        there = map_coordinates(first, [y + down, x + right], order=1, mode="nearest")
        frame, inside = green(sample.more[f"noisy{number}"]), (slice(8, -8), slice(8, -8))
        followed, ignored = (np.mean((frame - other)[inside] ** 2) for other in (there, first))
        assert followed < 0.7 * ignored


def green(raw: Raw) -> np.ndarray:
    """Half-size green without most of the noise."""
    return gaussian_filter(pack(raw.mosaic, raw.cfa)[1], 1.5)


def test_a_motion_of_one_s_own_is_taken_as_it_is_and_nothing_replaces_what_was_asked_for() -> None:
    still = ("task=deblur", "scene.motion.moving_share=0")
    with pytest.raises(FsidError, match=r"moving_share: .* take 0\.3 .*give scene\.motion\.exposure_s"):
        check_given(config(*still), given_keys(still))
    shaken = (*still, "scene.motion.exposure_s=[0.1,0.1]")
    check_given(config(*shaken), given_keys(shaken))
    assert scene_config(config(*shaken)).motion == config(*shaken).scene.motion
    check_given(config(*still), [])  # stated by a file: as if it were not


IDLE = [
    *(
        (f"{needed}=0", f"{needed}=1", key)
        for needed in _NEEDS
        for key in _NEEDS[needed]
        if "_share" in needed
    ),
    *(("scene.rig.eyes=1", "scene.rig.eyes=2", key) for key in _NEEDS["scene.rig.eyes"]),
    *((f"{folders}=[]", "", key) for folders in _NEEDS for key in _NEEDS[folders] if "_folders" in folders),
    *(("scene.hdri_folder=''", "", key) for key in _NEEDS["scene.hdri_folder"]),
    *((f"variant={each}", "variant=full", key) for each in _FIXED for key in sorted(_FIXED[each])),
]


@pytest.mark.parametrize(("idle", "followed", "key"), [row for row in IDLE if row[2] != "lens_images"])
def test_what_is_refused_changes_no_scene_and_what_is_taken_does(idle: str, followed: str, key: str) -> None:
    group, _, name = key.rpartition(".")
    knobs = attrgetter(group)(config())
    limits = next(field for field in fields(knobs) if field.name == name).metadata.get("limits", (True,))
    most = [limits[-1]] * 2 if isinstance(getattr(knobs, name), tuple) else limits[-1]
    others = [
        "scene.mesh_families=[desk_lamp,bottle,bush,tuft,branch]",
        "scene.background.kind_shares=[0,0,0,1]",
        "scene.motion.exposure_s=[0.1,0.1]",
    ]
    given = f"{key}={most}".lower()

    def scenes(*settings: str) -> list[Scene]:
        settled = config(*others, *settings)
        return [sample(settled.scene, seed, variant=settled.variant) for seed in range(6)]

    assert scenes(idle) == scenes(idle, given)
    with pytest.raises(FsidError, match=f"{key}: has no effect"):
        check_given(config(*others, idle, given), [key])
    if followed:
        assert scenes(followed) != scenes(followed, given)
        check_given(config(*others, followed, given), [key])


def test_commands_follow_what_they_show_alone() -> None:
    check_given(config("scene.motion.frames=2"), ["scene.motion.frames", "width", "variant"], "scene")
    check_given(config("images=photographs"), ["images", "cameras", "width"], "preview")
    for command, key in (("scene", "texture_size"), ("scene", "images"), ("preview", "crops")):
        with pytest.raises(FsidError, match=f"{key}: has no effect on fsid {command}"):
            check_given(config(), [key], command)
    with pytest.raises(FsidError, match="moving_share: has no effect on one frame while"):
        check_given(config("scene.motion.moving_share=1"), ["scene.motion.moving_share"], "scene")


def test_things_that_move_need_scenes(photos: Path) -> None:
    for task in ("deblur", "burst"):
        with pytest.raises(FsidError, match=f"--task {task}: needs scenes, in which"):
            make_sample(config(f"task={task}", f"images={photos}"), 0, 0, None)
    with pytest.raises(FsidError, match="knows no flow"):
        config("task=burst", "renderer=reference")


def write_exr(path: Path, pixels: np.ndarray, **header: object) -> None:
    openexr = pytest.importorskip("OpenEXR")
    channels = {name: np.ascontiguousarray(pixels[..., i]) for i, name in enumerate("RGB")}
    plain = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}
    with openexr.File({**plain, **header}, channels) as file:
        file.write(str(path))


@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_a_linear_render_takes_the_exact_linear_path(
    dtype: type, tmp_path: Path, rng: np.random.Generator
) -> None:
    """Light far above 1, as renders have it: one factor, then the camera; no curve is inverted."""
    light = rng.lognormal(0, 1.5, (64, 96, 3)).astype(dtype)
    write_exr(tmp_path / "a.exr", light)
    np.testing.assert_array_equal(read_exr(tmp_path / "a.exr"), light.astype(np.float32))
    settings = replace(config(f"images={tmp_path}"), width=96, height=64)
    sample = make_sample(settings, 0, 0, None)
    assert sample.record["image"] == "a.exr"
    stream = np.random.SeedSequence(0, spawn_key=(0, 0, 2, 0))
    exposure = np.random.default_rng(stream)
    exposure.integers(1)  # the camera
    gain = exposure_rand(exposure, light.astype(np.float32))
    colour = np.random.default_rng(np.random.SeedSequence(0, spawn_key=(0, 0, 3, 0)))
    expected = clean_from_linear(colour, light.astype(np.float32) * gain, load_profile("pixel6"))
    np.testing.assert_array_equal(sample.clean.mosaic, expected.mosaic)


def test_a_black_render_is_named_before_a_dataset_begins(tmp_path: Path) -> None:
    """Of one that is dim the exposure makes an image."""
    write_exr(tmp_path / "dim.exr", np.full((64, 96, 3), 1e-30, np.float32))
    write_exr(tmp_path / "off.exr", np.zeros((64, 96, 3), np.float32))
    with pytest.raises(FsidError, match=r"1 of 2 pictures cannot be used.*: \S*off\.exr: is black all over$"):
        check_pictures(find_pictures(tmp_path), 1)


def write_layers(path: Path, layers: dict[str, str], in_parts: bool) -> None:
    """A file of layers, name: channels; each pixel of the n-th layer is n + 1, its second channel 10 more."""
    openexr = pytest.importorskip("OpenEXR")
    header = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}
    parts = [
        {
            f"{layer}.{channel}" if layer else channel: np.full((64, 96), n + 1 + 10 * i, np.float32)
            for i, channel in enumerate(channels)
        }
        for n, (layer, channels) in enumerate(layers.items())
    ]
    if in_parts:
        named = [openexr.Part({**header, "name": f"part {n}"}, part) for n, part in enumerate(parts)]
        file = openexr.File(named)
    else:
        file = openexr.File(header, {name: pixels for part in parts for name, pixels in part.items()})
    file.write(str(path))


def test_layers_that_would_fill_memory_are_not_decoded(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(pictures, "_MOST_VALUES", 6 * 64 * 96 - 1)
    write_layers(tmp_path / "render.exr", {"": "RGB", "rest": "XYZ"}, in_parts=True)
    with pytest.raises(FsidError, match=r"render\.exr: has 36,864 values in all its layers"):
        read_exr(tmp_path / "render.exr")


@pytest.mark.parametrize("in_parts", [False, True], ids=["one part", "a part per layer"])
def test_of_many_layers_the_one_with_all_light_is_read(in_parts: bool, tmp_path: Path) -> None:
    """The layers that Blender 5.0 writes as OpenEXR MultiLayer, and files of other engines."""
    path = tmp_path / "layers.exr"
    blender = {
        "View.Depth": "Z",
        "View.Normal": "XYZ",
        "View.Diffuse Color": "RGB",
        "View.Combined": "RGBA",
        "View.Noisy Image": "RGBA",
    }
    for layers, expected in [
        (blender, (4, 14, 24)),
        ({"depth": "Z", "": "RGB", "albedo": "RGB"}, (2, 12, 22)),
        ({"normal": "XYZ", "beauty": "RGBA"}, (2, 12, 22)),
        ({"normal": "XYZ", "": "Y"}, (2, 2, 2)),
    ]:
        write_layers(path, layers, in_parts)
        np.testing.assert_array_equal(read_exr(path), np.broadcast_to(np.float32(expected), (64, 96, 3)))
    write_layers(path, {"diffuse": "RGB", "specular": "RGB"}, in_parts)
    with pytest.raises(FsidError, match=r"layers\.exr: has the layers diffuse, specular; write one"):
        read_exr(path)
    write_layers(path, {"normal": "XYZ", "depth": "Z"}, in_parts)
    with pytest.raises(FsidError, match=r"layers\.exr: has the channels depth\.Z, normal\.X"):
        read_exr(path)


def test_the_brightness_of_a_picture_in_colour_is_not_read_as_grey(tmp_path: Path) -> None:
    """Luminance and chroma are what OpenEXR itself writes where small files are asked for."""
    openexr = pytest.importorskip("OpenEXR")
    channels = {name: np.ones((64, 96), np.float32) for name in ("Y", "RY", "BY")}
    openexr.File({"type": openexr.scanlineimage}, channels).write(str(tmp_path / "chroma.exr"))
    with pytest.raises(FsidError, match=r"chroma\.exr: has the channels BY, RY, Y; R, G and B"):
        read_exr(tmp_path / "chroma.exr")


def test_bad_renders_are_named(tmp_path: Path) -> None:
    light = np.ones((64, 64, 3), np.float32)
    rec2020 = (0.708, 0.292, 0.17, 0.797, 0.131, 0.046, 0.3127, 0.329)
    write_exr(tmp_path / "wide.exr", light, chromaticities=rec2020)
    with pytest.raises(FsidError, match=r"wide\.exr: its primaries"):
        read_exr(tmp_path / "wide.exr")
    light[3, 4] = np.nan
    write_exr(tmp_path / "nan.exr", light)
    with pytest.raises(FsidError, match=r"nan\.exr: holds NaN"):
        read_exr(tmp_path / "nan.exr")
    broken, whole = tmp_path / "broken.exr", (tmp_path / "nan.exr").read_bytes()
    for size in (0, 200, len(whole) // 2):
        broken.write_bytes(whole[:size])
        with pytest.raises(FsidError, match=r"broken\.exr: cannot be read as OpenEXR, it is truncated"):
            read_exr(broken)
    start = whole.index(b"dataWindow\0box2i\0") + len(b"dataWindow\0box2i\0") + 4
    last = (19999).to_bytes(4, "little")
    broken.write_bytes(whole[: start + 8] + last + last + whole[start + 16 :])
    with pytest.raises(FsidError, match=r"broken\.exr: is 20000x20000 pixels, more than 128 million"):
        read_exr(broken)
    write_exr(tmp_path / "small.exr", np.ones((8, 64, 3), np.float32))
    with pytest.raises(FsidError, match=r"small\.exr: is 64x8"):
        read_exr(tmp_path / "small.exr")


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_photograph_stands_upright_whatever_else_its_exif_says(orientation: int, tmp_path: Path) -> None:
    image = Image.fromarray(np.arange(40 * 48 * 3, dtype=np.uint8).reshape(40, 48, 3))
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = orientation
    exif[ExifTags.Base.Make] = "a camera"
    data = exif.tobytes()
    order = ">" if b"MM" in data[:8] else "<"
    text, ratio = (struct.pack(f"{order}HHI", ExifTags.Base.Make, *kind) for kind in ((2, 9), (5, 1)))
    assert text in data
    image.save(tmp_path / "sound.png", exif=data)
    image.save(tmp_path / "faulty.png", exif=data.replace(text, ratio))
    expected = np.asarray(ImageOps.exif_transpose(Image.open(tmp_path / "sound.png")))
    for name in ("sound.png", "faulty.png"):
        np.testing.assert_array_equal(np.rint(read_photo(tmp_path / name) * 255), expected)


@pytest.mark.parametrize("name", ["grey.png", "grey.tif", "big-endian.tif", "white-is-0.tif", "turned.png"])
def test_sixteen_bit_grey_keeps_its_values(name: str, tmp_path: Path) -> None:
    levels = np.linspace(0, 65535, 40 * 32).reshape(40, 32).astype(np.uint16)
    if name == "turned.png":
        exif = Image.Exif()
        exif[0x0112] = 3
        Image.fromarray(levels[::-1, ::-1].copy()).save(tmp_path / name, exif=exif)
    elif name == "big-endian.tif":
        tifffile.imwrite(tmp_path / name, levels, byteorder=">")
    elif name == "white-is-0.tif":
        tifffile.imwrite(tmp_path / name, 65535 - levels, photometric="miniswhite")
    else:
        Image.fromarray(levels).save(tmp_path / name)
    pixels = read_photo(tmp_path / name)
    assert pixels.dtype == np.float32
    np.testing.assert_allclose(pixels, np.stack([levels / 65535] * 3, axis=-1), atol=1e-6)


@pytest.mark.parametrize(("pages", "size"), [("tP", 64), ("ttPt", 64), ("Pt", 64), ("t", 32), ("tt", 0)])
def test_a_thumbnail_is_not_the_picture(pages: str, size: int, tmp_path: Path) -> None:
    """A smaller copy (t) may be a TIFF's first page; one alone is the picture that there is."""
    with tifffile.TiffWriter(tmp_path / "a.tif") as file:
        for page in pages:
            side = 64 if page == "P" else 32
            file.write(np.zeros((side, side, 3), np.uint8), photometric="rgb", subfiletype=page == "t")
    if size:
        assert read_photo(tmp_path / "a.tif").shape == (size, size, 3)
    else:
        with pytest.raises(FsidError, match=r"a\.tif: .* thumbnails alone"):
            read_photo(tmp_path / "a.tif")


@pytest.mark.parametrize("kind", [np.float32, np.int32, np.int16])
def test_photographs_of_other_numbers_are_refused(kind: type, tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "odd.tif", np.ones((40, 32), kind))
    with pytest.raises(FsidError, match=r"odd\.tif: cannot be read as a photograph \(its values"):
        read_photo(tmp_path / "odd.tif")


def test_a_program_that_is_called_a_photograph_is_not_run(tmp_path: Path) -> None:
    """PostScript, for which Pillow starts Ghostscript."""
    Image.new("RGB", (64, 64), "red").save(tmp_path / "page.png", format="EPS")
    with pytest.raises(FsidError, match=r"page\.png: cannot be read as a photograph \(cannot identify"):
        read_photo(tmp_path / "page.png")


def test_a_photograph_of_a_wider_colour_space_is_brought_to_srgb():
    """One in Adobe RGB (1998), against the formulas of its specification."""
    path = Path(skimage.__file__).parent / "data" / "rocket.jpg"
    pixels = read_photo(path)
    height, width = pixels.shape[:2]
    with Image.open(path) as image:
        assert b"Adobe RGB" in image.info["icc_profile"]
        light = (np.asarray(image)[:height, :width] / 255.0) ** (563 / 256)
    to_xyz = [[0.57667, 0.18556, 0.18823], [0.29734, 0.62736, 0.07529], [0.02703, 0.07069, 0.99134]]
    to_srgb = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
    linear = light @ (np.array(to_srgb) @ to_xyz).T
    inside = ((linear > 0.002) & (linear < 0.998)).all(-1)
    expected = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * abs(linear) ** (1 / 2.4) - 0.055)
    assert inside.mean() > 0.5
    np.testing.assert_allclose(pixels[inside], expected[inside], atol=2.5 / 255)


LAB = ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB")).tobytes()


@pytest.mark.parametrize("profile", [b"no profile", LAB])
def test_a_profile_that_does_not_fit_is_left_aside(profile: bytes, tmp_path: Path):
    colours = np.arange(40 * 40 * 3, dtype=np.uint8).reshape(40, 40, 3)
    Image.fromarray(colours).save(tmp_path / "a.png", icc_profile=profile)
    np.testing.assert_array_equal(np.rint(read_photo(tmp_path / "a.png") * 255), colours)


def test_flow_that_half_precision_cannot_hold_is_none():
    flow = np.array([1e5, -1e5, np.nan, 1.5], np.float32)
    np.testing.assert_array_equal(_half_precision(flow), np.array([np.nan, np.nan, np.nan, 1.5], np.float16))


def test_the_lens_of_a_smaller_image_blurs_each_axis_by_its_own_quarter_to_half_pixel() -> None:
    """Second moments of a blob: sigma^2 is added to its own and to that of a pixel, which both axes have."""
    blob = np.exp(-0.5 * ((np.arange(128) - 63.5) / 10) ** 2)
    blob = np.repeat(np.outer(blob, blob)[..., None], 3, axis=2)
    sigmas = []
    for seed in range(60):
        views = smaller(np.random.default_rng(seed), blob, 4)
        blurred = views.seen[0][..., 1].astype(float)
        rows, columns = (_second_moment(blurred.sum(axis)) for axis in (1, 0))
        first, second = views.facts["psf_sigma_px"]
        assert rows - columns == pytest.approx(first**2 - second**2, abs=1e-3)
        sigmas += [first, second]
    assert 0.25 <= min(sigmas) < 0.27 < 0.48 < max(sigmas) <= 0.5


def _second_moment(profile: np.ndarray) -> float:
    at = np.arange(len(profile)) - (profile * np.arange(len(profile))).sum() / profile.sum()
    return float((profile * at**2).sum() / profile.sum())


def test_frames_of_a_burst_come_in_their_order_whatever_that_of_the_cameras() -> None:
    class Numbers:
        """A renderer whose images say which frame they are, and to which their flow leads."""

        def radiance(self, scene: Scene, camera_index: int = 0) -> np.ndarray:
            return np.full((2, 2, 3), scene.cameras[camera_index].frame)

        def render(self, scene: Scene, camera_index: int = 0, flow_to: int | None = None) -> SimpleNamespace:
            to = np.full((2, 2, 2), scene.cameras[flow_to].frame)
            return SimpleNamespace(radiance=self.radiance(scene, camera_index), flow=to)

    settings = config("task=burst", "scene.motion.frames=4")
    scene = sample(scene_config(settings), 0, width=32, height=32)
    shuffled = replace(scene, cameras=tuple(scene.cameras[i] for i in (2, 0, 3, 1)))
    views = views_of_scene(np.random.default_rng(0), settings, shuffled, Numbers())
    assert views.truth[0, 0, 0] == 0
    assert [seen[0, 0, 0] for seen in views.seen] == [0, 1, 2, 3]
    assert [flow[0, 0, 0] for flow in views.flow] == [0, 0, 0]
