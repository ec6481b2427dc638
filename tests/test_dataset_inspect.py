"""Statistics of pictures: known answers, distances that behave like distances, and the command."""

import io
import json
import os
import shutil

import numpy as np
import pytest
from PIL import Image
from skimage.color import lab2rgb

from fsid.cli.main import main
from fsid.dataset import find_photos, find_pictures
from fsid.dataset.inspect import _picture, inspect
from fsid.dataset.inspect_plot import inspection_picture
from fsid.dataset.shards import shard_path, write_shard
from fsid.dataset.statistics import TITLES, compare, distance, measure, pool, spectrum_slope
from fsid.errors import FsidError
from fsid.sensor import Raw, write_dng
from fsid.sensor.colour import published_matrices


def _noise(slope: float, size: int = 256, seed: int = 0) -> np.ndarray:
    """(size, size) Gaussian field whose power falls as frequency^slope, mean 0.5, std 0.1."""
    rng = np.random.default_rng(seed)
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size))
    frequency[0, 0] = 1
    field = np.fft.irfft2(np.fft.rfft2(rng.normal(size=(size, size))) * frequency ** (slope / 2))
    return (0.5 + 0.1 * (field - field.mean()) / field.std()).astype(np.float32)


def _grey(luma: np.ndarray) -> np.ndarray:
    return np.repeat(luma[..., None], 3, axis=-1)


@pytest.mark.parametrize("slope", [-1.0, -2.0, -3.0])
def test_slope_of_a_known_spectrum(slope):
    assert spectrum_slope(_noise(slope)) == pytest.approx(slope, abs=0.15)


def test_slope_is_of_the_middle_of_the_spectrum():
    """Neither light and shade of a whole picture nor what demosaicing and noise reduction leave count."""
    frequency = np.hypot(np.fft.fftfreq(256)[:, None], np.fft.rfftfreq(256))
    outside = (frequency < 0.03) | (frequency > 0.37)
    altered = np.fft.irfft2(np.fft.rfft2(_noise(-2)) * np.where(outside, 4, 1))
    assert spectrum_slope(altered) == pytest.approx(spectrum_slope(_noise(-2)), abs=0.1)


@pytest.mark.parametrize("size", [16, 24, 32, 48])
def test_small_pictures_have_all_statistics_too(size):
    image = np.random.default_rng(0).uniform(0.2, 0.8, (size, size + 6, 3))
    assert all(np.isfinite(values).all() for values in measure(image).values())


def test_a_uniform_grey_picture_has_no_edges_no_colour_and_is_flat():
    values = measure(np.full((96, 96, 3), 0.5, np.float32))
    assert values["edge_ratio"] == 0
    assert values["flat_share"] == 1
    assert values["colourfulness"] == pytest.approx(0, abs=1e-6)
    assert values["colour_entropy"].max() == 0
    assert values["ab_coverage"] == 1


def test_shares_of_black_and_clipped_pixels_are_counted():
    image = np.full((100, 100, 3), 0.5, np.float32)
    image[:10], image[-20:] = 0, 1
    values = measure(image)
    assert values["black_share"] == pytest.approx(0.1)
    assert values["clipped_share"] == pytest.approx(0.2)


def test_black_is_told_by_luma_and_clipped_by_the_brightest_colour():
    """Rec. 709: 0.9 of blue is 0.065 of luma, 0.3 of red 0.064, 0.12 of green 0.086."""
    colours = [
        (0, 0, 0.9),
        (0.3, 0, 0),
        (0, 0.12, 0),
        (0.07, 0.07, 0.07),
        (0.2, 0.3, 0.996),
        (0.99, 0.99, 0.99),
    ]
    image = np.array(colours, np.float32).repeat(16, axis=0)[None].repeat(16, axis=0)
    values = measure(image)
    assert values["black_share"] == pytest.approx(3 / 6)
    assert values["clipped_share"] == pytest.approx(1 / 6)


def test_a_patch_is_flat_whose_luma_varies_by_less_than_two_levels_of_eight_bits():
    wave = np.where(np.indices((16, 16)).sum(0) % 2, 1.0, -1.0)
    patches = np.concatenate([0.5 + level / 255 * wave for level in (1.0, 1.9, 2.1, 4.0)]).astype(np.float32)
    assert measure(_grey(patches))["flat_share"] == 0.5


def test_a_slope_is_as_steep_as_both_its_parts():
    down, right = np.indices((64, 64)).astype(np.float32)
    values = measure(_grey(0.1 + 0.004 * down + 0.003 * right))
    assert 10 ** np.median(values["gradient"]) - 1e-3 == pytest.approx(0.005, rel=1e-3)


def test_an_edge_begins_at_a_step_of_ten_levels_of_eight_bits():
    """Smoothed by 1 pixel, a step of h has 4 x 0.68 h under Sobel's kernel: 0.1 from h = 0.037 on."""
    for height, is_edge in ((0.033, False), (0.041, True)):
        luma = np.full((32, 32), 0.3, np.float32)
        luma[:, 16:] += height
        assert (measure(_grey(luma))["edge_ratio"][0] > 0) == is_edge


def test_orientation_tells_stripes_from_each_other():
    stripes = _grey((np.arange(128) // 8 % 2 * 0.5 + 0.25)[:, None] + np.zeros((1, 128), np.float32))
    assert np.median(measure(stripes)["orientation"]) > 85
    assert np.median(measure(stripes.swapaxes(0, 1))["orientation"]) < 5


def test_orientation_is_that_of_contrast_and_not_of_area():
    """Strong stripes in a quarter of the picture, across faint ones everywhere."""
    faint = (np.arange(128) // 8 % 2 * 0.01 + 0.25)[:, None] + np.zeros((1, 128))
    faint[:, :32] += np.arange(32) // 8 % 2 * 0.5
    assert np.median(measure(_grey(faint))["orientation"]) < 5


def test_colourfulness_is_that_of_hasler_and_suesstrunk():
    """Half of it (0.8, 0.4, 0.2), half (0.2, 0.5, 0.6): R - G is 0.4 and -0.3, (R + G) / 2 - B 0.4, -0.25."""
    image = np.full((32, 32, 3), (0.8, 0.4, 0.2), np.float32)
    image[16:] = (0.2, 0.5, 0.6)
    expected = np.hypot(0.35, 0.325) + 0.3 * np.hypot(0.05, 0.075)
    assert measure(image)["colourfulness"] == pytest.approx(expected, rel=1e-5)


def test_a_saturated_mosaic_is_white_whatever_its_white_balance():
    matrix = published_matrices()[0]
    np.testing.assert_allclose(_picture(np.ones((4, 4)), "RGGB", (2.0, 1.0, 1.6), matrix), 1, atol=1e-5)


def test_more_colours_give_more_entropy_and_coverage():
    rng = np.random.default_rng(1)
    blocks = np.kron(rng.uniform(0, 1, (24, 24, 3)), np.ones((4, 4, 1)))
    colourful, grey = measure(blocks), measure(_grey(blocks.mean(-1)))
    for name in ("colourfulness", "ab_coverage", "colour_entropy"):
        assert colourful[name].mean() > grey[name].mean(), name


def test_exposure_and_cast_tell_what_a_whole_picture_has():
    picture = np.random.default_rng(3).uniform(0.2, 0.6, (96, 96, 1)).repeat(3, axis=2).astype(np.float32)
    plain, dark, red, blue = (
        measure(picture * np.array(gains, np.float32))
        for gains in ((1, 1, 1), (0.5, 0.5, 0.5), (1.3, 1, 1), (1, 1, 1.3))
    )
    assert dark["exposure"] < plain["exposure"] - 10
    assert red["cast_a"] > plain["cast_a"] + 5
    assert blue["cast_b"] < plain["cast_b"] - 5
    assert abs(plain["cast_a"]) + abs(plain["cast_b"]) < 0.1


def test_colour_of_things_and_colour_of_texture_are_told_apart():
    """Two plain halves of different hue, and a pixel-wise mixture of the same two colours."""
    colours = np.array([(0.7, 0.4, 0.4), (0.4, 0.5, 0.7)], np.float32)
    halves = colours[(np.indices((96, 96))[1] >= 48).astype(int)]
    mixed = colours[np.random.default_rng(0).integers(2, size=(96, 96))]
    things, texture = measure(halves), measure(mixed)
    assert things["colour_regions"] > 5 * texture["colour_regions"]
    assert np.median(texture["colour_texture"]) > np.median(things["colour_texture"]) - 1e-6
    assert np.median(texture["colour_texture"]) > 0.3
    lighter = measure(
        np.float32(0.3) + 0.4 * np.random.default_rng(1).random((96, 96, 1)).astype(np.float32).repeat(3, 2)
    )
    assert np.median(lighter["colour_texture"]) < -1


def test_distance_is_zero_for_equal_sets_and_one_for_a_shift_by_a_standard_deviation():
    values = np.random.default_rng(2).normal(3, 2, 4000)
    assert distance(values, values) == 0
    assert distance(values + values.std(), values) == pytest.approx(1)


def test_a_second_real_set_is_the_yardstick():
    sets = [pool([measure(_grey(_noise(-2, seed=seed + 10 * s))) for seed in range(3)]) for s in range(3)]
    for found in compare(*sets):
        assert found.yardstick == distance(sets[2][found.name], sets[1][found.name])
        assert np.isfinite(found.distance)


@pytest.fixture(scope="module")
def photos(tmp_path_factory):
    folder = tmp_path_factory.mktemp("photos")
    for seed in range(4):
        image = np.stack([_noise(-2, 144, 3 * seed + c) for c in range(3)], axis=-1)
        Image.fromarray((image.clip(0, 1) * 255).astype(np.uint8)).save(folder / f"{seed}.png")
    return folder


def test_photographs_and_the_dataset_made_from_them_are_seen_alike(photos, tmp_path):
    """The RAW of a photograph holds its light, but for exposure, so what does not depend on that stays."""
    size = ("--width", "144", "--height", "144", "--images", str(photos))
    main(["generate", str(tmp_path / "data"), "--count", "4", *size, "--quiet"])
    main(
        [
            "inspect",
            str(tmp_path / "data"),
            "--reference",
            str(photos),
            "--out",
            str(tmp_path / "out"),
            "--quiet",
        ]
    )
    found = json.loads((tmp_path / "out" / "statistics.json").read_text())
    by_name = {row["name"]: row for row in found["statistics"]}
    assert set(by_name) == set(TITLES)
    assert by_name["spectrum_slope"]["mean"] == pytest.approx(
        by_name["spectrum_slope"]["reference_mean"], abs=0.1
    )
    assert by_name["orientation"]["mean"] == pytest.approx(by_name["orientation"]["reference_mean"], abs=2)
    assert by_name["contrast"]["mean"] == pytest.approx(by_name["contrast"]["reference_mean"], abs=0.1)
    colour = by_name["colour_texture"]
    assert colour["mean"] == pytest.approx(colour["reference_mean"], abs=0.02), "one skipped the camera"
    assert (tmp_path / "out" / "statistics.png").stat().st_size > 10_000


def test_every_picture_is_in_every_histogram_and_no_axes_are_empty(photos, monkeypatch):
    """The one of the most near-black pixels was beyond the axis."""
    drawn = []
    monkeypatch.setattr(
        "fsid.dataset.inspect_plot.Figure.savefig", lambda figure, *_, **__: drawn.append(figure)
    )
    inspection_picture(inspect(photos, photos))
    (figure,) = drawn
    assert len(figure.axes) == len(TITLES)
    for axes in figure.axes:
        bars = [bar.get_height() for bar in axes.patches]
        assert sum(bars) == pytest.approx(200), axes.get_title()


def test_a_folder_that_refuses_files_is_said_before_the_work(photos, tmp_path, refused, monkeypatch):
    """Else minutes of measuring would be lost; and neither file is written without the other."""

    def never(*_, **__):
        raise AssertionError("measured what cannot be written")

    command = ["inspect", str(photos), "--quiet", "--out"]
    (tmp_path / "file").write_text("")
    (tmp_path / "out" / "statistics.png").mkdir(parents=True)
    assert "statistics.png: cannot be written" in refused(*command, tmp_path / "out")
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["statistics.png"]
    monkeypatch.setattr("fsid.dataset.inspect.inspect", never)
    assert "file is no folder that you may write to" in refused(*command, tmp_path / "file" / "out")
    monkeypatch.setattr("fsid.files.os.access", lambda *_: False)
    assert "that you may write to" in refused(*command, tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_a_photograph_may_have_a_name_that_is_no_text(photos, tmp_path):
    name = os.fsdecode(b"\xff.png")
    try:
        shutil.copy(photos / "0.png", tmp_path / name)
    except OSError:
        pytest.skip("this file system takes names in UTF-8 alone")
    assert inspect(tmp_path).pictures == 1


def test_hidden_files_are_no_photographs(photos, tmp_path):
    shutil.copy(photos / "0.png", tmp_path)
    (tmp_path / "._0.png").write_bytes(b"\0\5\x16\7Mac OS X")
    assert find_photos(tmp_path) == find_pictures(tmp_path) == [tmp_path / "0.png"]
    assert inspect(tmp_path).pictures == 1


def test_pictures_in_folders_inside_a_folder_are_pointed_at(photos, tmp_path):
    (tmp_path / "2024" / "may").mkdir(parents=True)
    (tmp_path / ".thumbnails").mkdir()
    for place in (tmp_path / ".thumbnails", tmp_path / "2024" / "may"):
        shutil.copy(photos / "0.png", place)
    for find in (find_photos, find_pictures):
        with pytest.raises(FsidError, match=r"2024/may/0\.png lies deeper, give its folder"):
            find(tmp_path)


def test_halves_of_few_pictures_are_no_yardstick(photos, monkeypatch, capsys):
    """Two halves of one collection differ by chance alone: a small reference makes everything look real."""
    few = inspect(photos, photos)
    assert all(np.isnan(found.yardstick) for found in few.comparisons)
    assert few.yardstick.startswith("none: halves of 4 pictures")
    main(["inspect", str(photos), "--reference", str(photos), "--quiet"])
    assert "relative: none: halves of 4 pictures" in capsys.readouterr().out
    monkeypatch.setattr("fsid.dataset.inspect.LEAST_PICTURES", 4)
    many = inspect(photos, photos)
    assert any(np.isfinite(found.yardstick) for found in many.comparisons)
    assert "halves of the 4 pictures" in many.yardstick
    assert "the aim of 2x is for --other" in many.yardstick


def test_the_yardstick_of_a_second_real_set_is_named(photos, monkeypatch):
    found = inspect(photos, photos, photos)
    assert found.yardstick.startswith(f"1x is how far {photos} (4 pictures) lies from the 4 of")
    assert "sets of fewer than 50 differ by chance" in found.yardstick
    monkeypatch.setattr("fsid.dataset.inspect.LEAST_PICTURES", 4)
    assert "by chance" not in inspect(photos, photos, photos).yardstick


EYE = "[[1,0,0],[0,1,0],[0,0,1]]"


@pytest.mark.parametrize(
    "record",
    [
        b"{}",
        b"[]",
        b"null",
        b"\xff\xfe",
        b"{",
        b"[" * 200_000,
        *(
            f'{{"white_balance": {balance}, "xyz_to_camera": {EYE}}}'.encode()
            for balance in (
                "3",
                '"red"',
                "[1, 1]",
                "[0, 1, 1]",
                "[NaN, 1, 1]",
                "[1e300, 1, 1]",
                f"[1{'0' * 400}, 1, 1]",
            )
        ),
        *(
            f'{{"white_balance": [2, 1, 2], "xyz_to_camera": {matrix}}}'.encode()
            for matrix in ("{}", "[[1, 0], [0, 1]]", "[[0,0,0],[0,0,0],[0,0,0]]", EYE.replace("1", "NaN"))
        ),
    ],
    ids=lambda record: record[:70].decode("latin1"),
)
def test_a_sample_without_its_colours_is_named(record, tmp_path):
    image = io.BytesIO()
    write_dng(image, Raw(np.zeros((32, 32), np.float32), "RGGB", 0, 65535, (2.0, 1.0, 1.5), np.eye(3)))
    write_shard(shard_path(tmp_path, 0), [("00000000", {"clean.dng": image.getvalue(), "json": record})])
    with pytest.raises(FsidError, match=r"shard-00000\.tar: 00000000\.json: ") as caught:
        inspect(tmp_path)
    assert "\n" not in str(caught.value)


def test_of_a_large_dataset_only_the_shards_of_the_measured_pictures_are_opened(tmp_path):
    record = b'{"white_balance": [2, 1, 2], "xyz_to_camera": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}'
    for number in range(9):
        image = io.BytesIO()
        mosaic = np.full((32, 32), 0.1 * number, np.float32)
        write_dng(image, Raw(mosaic, "RGGB", 0, 65535, (2.0, 1.0, 1.5), np.eye(3)))
        files = {"clean.dng": image.getvalue(), "json": record}
        write_shard(shard_path(tmp_path, number), [(f"{number:08d}", files)])
    lightness = inspect(tmp_path).values["exposure"]
    for number in set(range(9)) - {0, 4, 8}:
        shard_path(tmp_path, number).write_bytes(b"no shard")
    np.testing.assert_array_equal(inspect(tmp_path, limit=3).values["exposure"], lightness[[0, 4, 8]])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["nowhere"], "nowhere: is neither a dataset nor a folder"),
        (["PHOTOS", "--reference", "nowhere"], "nowhere: is neither a dataset nor a folder"),
        (["PHOTOS", "--other", "PHOTOS"], "--other needs --reference"),
        (["PHOTOS", "--limit", "0"], "--limit 0"),
        (["PHOTOS", "--reference", "PHOTOS", "--limit", "1"], "one picture has no spread"),
    ],
)
def test_bad_input_is_one_line(photos, arguments, words, refused):
    assert words in refused("inspect", *(a.replace("PHOTOS", str(photos)) for a in arguments), "--quiet")


def test_colours_are_counted_on_both_axes_of_their_plane():
    """Patches of one lightness on a grid of four a* by four b*: 16 cells, and 125 of variance along each."""
    a, b = np.meshgrid((-15.0, -5.0, 5.0, 15.0), (-15.0, -5.0, 5.0, 15.0))
    patches = lab2rgb(np.stack([np.full((4, 4), 60.0), a + 1, b + 1], axis=-1))
    found = measure(patches.repeat(16, axis=0).repeat(16, axis=1))
    assert found["ab_coverage"] == 16
    assert found["colour_regions"] == pytest.approx(np.sqrt(250), rel=0.01)
    assert found["colour_entropy"].max() == 0


def test_grey_with_a_trace_of_colour_has_no_entropy():
    """Cells that meet at grey made it the most colourful of all: 2 bits."""
    lab = np.full((32, 32, 3), (56.0, 0.0, 0.0))
    lab[..., 1:] += np.random.default_rng(0).uniform(-2, 2, (32, 32, 2))
    assert measure(lab2rgb(lab))["colour_entropy"].max() == 0


def test_greens_and_blues_are_told_apart_in_the_entropy():
    """Two colours of negative a*, two of negative b*, half a patch of each: one bit."""
    for pair in ([(80.0, -30.0, 40.0), (80.0, -55.0, 40.0)], [(40.0, 20.0, -30.0), (40.0, 20.0, -55.0)]):
        halves = lab2rgb(np.array([pair]))
        found = measure(halves.repeat(16, axis=0).repeat(8, axis=1))
        np.testing.assert_allclose(found["colour_entropy"], 1)


def test_a_step_climbs_as_its_gaussian_says():
    """Smoothed by 0.7 pixels, the steepest central difference is half the two largest weights."""
    luma = np.full((32, 32), 0.3, np.float32)
    luma[:, 16:] = 0.8
    weights = np.exp(-0.5 * (np.arange(-4, 5) / 0.7) ** 2)
    weights /= weights.sum()
    steepest = 10 ** measure(_grey(luma))["gradient"][-1] - 1e-3
    assert steepest == pytest.approx(0.5 * (weights[4] + weights[5]) / 2, rel=0.01)
