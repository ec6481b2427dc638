"""Test sets and comparisons: what is written is read, and the figures are those of the files."""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
import struct
from collections.abc import Callable
from html.parser import HTMLParser
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import rawpy
from PIL import Image
from scipy.ndimage import gaussian_filter

from fsid.cli.main import main
from fsid.errors import FsidError
from fsid.evaluate import (
    CLASSICAL,
    NOISY,
    Method,
    compare,
    photo_testset,
    psnr,
    read_testset,
    simulated_testset,
    write_comparison,
    write_results,
)
from fsid.evaluate.compare import Comparison, Crops, detailed_window, summarise
from fsid.evaluate.comparison_report import comparison_sections
from fsid.evaluate.metrics import ssim
from fsid.evaluate.models import evaluate_models, model_names
from fsid.evaluate.report import METRICS, level_label, method_label, write_report
from fsid.evaluate.results import (
    MOST_DB,
    ImageRow,
    Row,
    confidence,
    perfect_note,
    read_images,
    write_images,
)
from fsid.evaluate.testset import TestImage, TestSet, staged, write_testset
from fsid.files import write_atomically
from fsid.sensor import NoiseLevel, Raw, develop, read_raw, write_dng
from fsid.sensor.gain_maps import shading_gains
from fsid.sensor.metadata import OPCODES_2, Metadata, exposure_metadata
from fsid.sensor.tiff import Tag


@pytest.fixture(scope="module")
def small_set(photos: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("sets") / "testset"
    photo_testset([photos], root, camera="pixel6", isos=[800, 3200], seed=3)
    return root


def test_a_test_set_is_dng_files_with_their_noise_level(small_set: Path):
    testset = read_testset(small_set)
    assert testset.levels == ("iso800", "iso3200")
    assert len(testset.images) == 3
    with rawpy.imread(str(testset.noisy(small_set, testset.images[0], "iso3200"))) as raw:
        assert raw.other.iso_speed == 3200
    truth, noisy = (
        read_raw(small_set / testset.images[0].name / name) for name in ("clean.dng", "iso3200.noisy.dng")
    )
    assert noisy.noise is not None
    error = (noisy.mosaic - truth.mosaic)[truth.mosaic < 0.5]
    expected = np.mean(noisy.noise.k) * truth.mosaic[truth.mosaic < 0.5].mean() + np.mean(noisy.noise.sigma2)
    assert error.var() == pytest.approx(expected, rel=0.1)


def test_the_same_seed_gives_the_same_files(small_set: Path, photos: Path, tmp_path: Path):
    photo_testset([photos], tmp_path / "again", camera="pixel6", isos=[800, 3200], seed=3)
    for file in sorted(path for path in small_set.rglob("*") if path.is_file()):
        assert file.read_bytes() == (tmp_path / "again" / file.relative_to(small_set)).read_bytes()


def test_rows_are_means_over_the_files(small_set: Path, tmp_path: Path):
    testset = read_testset(small_set)
    comparison = compare(small_set, [NOISY, CLASSICAL], crop_levels=["iso3200"], crop_px=64)
    rows = {(row.model, row.level): row for row in comparison.rows}
    expected = np.mean(
        [
            psnr(
                read_raw(testset.noisy(small_set, image, "iso800")).mosaic,
                read_raw(testset.clean(small_set, image)).mosaic,
            )
            for image in testset.images
        ]
    )
    assert rows["noisy", "iso800"].psnr_raw == pytest.approx(expected)
    assert rows["noisy", "iso800"].n == 3
    assert rows["classical", "iso3200"].psnr_raw > rows["noisy", "iso3200"].psnr_raw
    assert {crops.truth.shape for crops in comparison.crops} == {(64, 64, 3)}

    write_results(comparison.rows, tmp_path / "results.json")
    written = json.loads((tmp_path / "results.json").read_text())
    assert set(written[0]) == {"model", "training", "camera", "level", "set", "n", "psnr_raw", "psnr", "ssim"}
    assert [row["camera"] for row in written] == ["pixel6"] * 4


def test_a_report_shows_some_of_many_images(
    small_set: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, _, last = read_testset(small_set).images
    for most, told in ((3, ""), (2, "Of 2 of the 3 images. ")):
        monkeypatch.setitem(compare.__globals__, "MOST_CROPS", most)
        comparison = compare(small_set, [NOISY], crop_levels=["iso3200"], crop_px=16)
        write_comparison(comparison, small_set, tmp_path)
        assert f"{told}Drag the border" in (tmp_path / "report.html").read_text()
    assert [crops.image for crops in comparison.crops] == [first.name, last.name]
    assert len(comparison.images) == 6


def test_figures_are_those_of_their_frames_and_sets(tmp_path: Path):
    """Two sets of one image and three frames: each metric of its own pictures, the crop that of the first."""
    root = tmp_path / "set"
    made = simulated_testset(
        root,
        camera="pixel6",
        isos=[3200],
        frames=3,
        scenes=1,
        width=64,
        height=64,
        materials=["fabric", "threads"],
    )
    found = compare(root, [NOISY], crop_levels=["iso3200"], crop_px=32)
    expected = {}
    for image, crop in zip(made.images, found.crops, strict=True):
        truth = read_raw(made.clean(root, image, "iso3200"))
        frames = [read_raw(made.noisy(root, image, "iso3200", n)) for n in range(3)]
        figures = [
            (psnr(f.mosaic, truth.mosaic), psnr(develop(f), develop(truth)), ssim(develop(f), develop(truth)))
            for f in frames
        ]
        expected[image.set] = np.mean(figures, axis=0)
        assert crop.psnr_raw == {"noisy": pytest.approx(figures[0][0])}
        window, _ = detailed_window(develop(truth), 32)
        np.testing.assert_array_equal(crop.by_method["noisy"], develop(frames[0])[window])
    expected["all"] = np.mean([*expected.values()], axis=0)
    assert {row.set for row in found.rows} == expected.keys()
    for row in found.rows:
        np.testing.assert_allclose((row.psnr_raw, row.psnr, row.ssim), expected[row.set], rtol=1e-6)


def test_the_truth_scores_perfectly(small_set: Path):
    testset = read_testset(small_set)
    truths = iter(testset.images)
    perfect = Method(
        "perfect",
        "",
        lambda raw: dataclasses.replace(raw, mosaic=read_raw(testset.clean(small_set, next(truths))).mosaic),
    )
    one_level = dataclasses.replace(testset, levels=("iso800",))
    (small_set / "testset.json").write_text(json.dumps(dataclasses.asdict(one_level)))
    try:
        (row,) = compare(small_set, [perfect]).rows
    finally:
        (small_set / "testset.json").write_text(json.dumps(dataclasses.asdict(testset)))
    assert (row.psnr_raw, row.psnr) == (MOST_DB, MOST_DB)
    assert row.ssim == pytest.approx(1.0)


def test_a_picture_without_noise_leaves_its_set_a_mean(photos: Path, tmp_path: Path, capsys, monkeypatch):
    """Black at a low ISO is stored as it is: its PSNR was infinite, and the mean of the set null."""
    monkeypatch.setattr("fsid.evaluate.testset.check_pictures", lambda *_: None)
    shutil.copytree(photos, tmp_path / "photos")
    Image.new("RGB", (64, 64)).save(tmp_path / "photos" / "black.png")
    photo_testset([tmp_path / "photos"], tmp_path / "set", camera="pixel6", isos=[50])
    main(["evaluate", str(tmp_path / "set"), "-o", str(tmp_path)])
    told = capsys.readouterr().err
    perfect = "result without error (noisy of 0000-black at iso50 for one): a PSNR counts as 100 dB at most"
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert perfect in told
    assert perfect in page
    noisy = json.loads((tmp_path / "results.json").read_text())[0]
    figures = [float(line.split(",")[4]) for line in (tmp_path / "images.csv").read_text().splitlines()[1::2]]
    assert max(figures) == MOST_DB
    assert noisy["psnr_raw"] == pytest.approx(np.mean(figures), abs=1e-4)


def test_a_method_may_work_in_place(small_set: Path):
    """And methods may come from a generator."""

    def blackened(raw: Raw) -> Raw:
        raw.mosaic[:] = 0
        return raw

    alone = compare(small_set, [NOISY]).rows
    rows = compare(small_set, iter([Method("mine", "", blackened), NOISY])).rows
    assert [row for row in rows if row.model == "noisy"] == list(alone)


def test_a_capture_is_developed_with_the_colours_of_its_truth(small_set: Path, tmp_path: Path):
    """Further frames of a burst state white balance and lens shading of their own, by which no error is to be
    measured."""
    darker = struct.pack(">I4I10I4dIf", 1, 9, 0, 0, 80, 0, 0, 99, 99, 0, 1, 1, 1, 1, 1, 1, 1, 0, 0, 1, 0.5)
    metadata = Metadata(mosaic=(Tag(OPCODES_2, 7, darker),))
    shutil.copytree(small_set, tmp_path / "set")
    for capture in read_testset(tmp_path / "set").captures(tmp_path / "set"):
        raw = read_raw(capture)
        colours = {"white_balance": (1.5, 1.0, 2.4), "xyz_to_camera": raw.xyz_to_camera[::-1]}
        write_dng(capture, dataclasses.replace(raw, metadata=metadata, **colours))
    assert shading_gains(read_raw(capture).metadata.opcodes_of_linear, (8, 8)).max() == 0.5
    assert compare(tmp_path / "set", [NOISY]).rows == compare(small_set, [NOISY]).rows


def test_all_methods_are_developed_with_the_same_colours(small_set: Path):
    """Those of the capture, whatever a method makes of them in its result or in its copy."""

    def recoloured(raw: Raw) -> Raw:
        raw.xyz_to_camera[:] = np.eye(3)
        return dataclasses.replace(raw, white_balance=(9.0, 1.0, 3.0), black_level=0, white_level=9)

    expected, found = compare(small_set, [NOISY, Method("mine", "", recoloured)]).rows[::2]
    assert (found.psnr_raw, found.psnr, found.ssim) == (expected.psnr_raw, expected.psnr, expected.ssim)


@pytest.mark.parametrize(
    ("denoise", "words"),
    [
        (lambda raw: raw.mosaic, r"mine: denoise returns a Raw, replace\(raw, mosaic=...\); got ndarray"),
        (lambda raw: None, "got NoneType"),
        (lambda raw: dataclasses.replace(raw, mosaic=raw.mosaic[:-2]), "makes 200x158 GBRG of 200x160 GBRG"),
        (lambda raw: dataclasses.replace(raw, cfa="RGGB"), "makes 200x160 RGGB of 200x160 GBRG"),
        (lambda raw: dataclasses.replace(raw, mosaic=raw.mosaic * np.nan), "mine: .*NaN"),
    ],
)
def test_a_method_that_breaks_the_image_is_named(small_set: Path, denoise: Callable, words: str):
    with pytest.raises(FsidError, match=words):
        compare(small_set, [NOISY, Method("mine", "", denoise)])


def test_nothing_to_compare_is_said(small_set: Path):
    with pytest.raises(FsidError, match="no method"):
        compare(small_set, [])


def test_the_report_is_one_file_that_loads_nothing(small_set: Path, tmp_path: Path):
    class Links(HTMLParser):
        def __init__(self) -> None:
            super().__init__()
            self.sources: list[str] = []

        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            self.sources += [value or "" for name, value in attrs if name in ("src", "href")]

    comparison = compare(small_set, [NOISY, CLASSICAL], crop_levels=["iso800"], crop_px=64)
    write_report(tmp_path / "r.html", "<script>", "lead", comparison_sections(comparison))
    page = (tmp_path / "r.html").read_text()
    links = Links()
    links.feed(page)
    assert links.sources
    assert all(source.startswith("data:image/png;base64,") for source in links.sources)
    assert "<script>" not in page
    noisy = next(row for row in comparison.rows if (row.model, row.level) == ("noisy", "iso800"))
    assert f"{noisy.psnr_raw:.2f}" in page


def test_a_table_names_levels_and_marks_the_best(small_set: Path):
    comparison = compare(small_set, [NOISY, CLASSICAL])
    figures = comparison_sections(comparison)[0]
    assert [table.title for table in figures.tables] == [title for _, title, _ in METRICS]
    for table, (key, _, form) in zip(figures.tables, METRICS, strict=True):
        assert table.head == ("", "ISO 800", "ISO 3200", "mean")
        values = [getattr(row, key) for row in comparison.rows if row.model == "classical"]
        assert [cell.split(" ± ")[0] for cell in table.rows[1][1:3]] == [f"{v:{form}}" for v in values]
        assert table.rows[1][3] == f"{np.mean(values):{form}}"
        assert table.best == {(1, 1), (1, 2), (1, 3)}
    assert level_label("0.5lux") == "0.5 lux"
    assert level_label("isolated") == "isolated"


def test_every_figure_of_a_comparison_is_in_its_place(monkeypatch):
    """Against sums by hand: two images of one set and one of another, two levels, three methods."""
    plots, pictures = [], {}
    monkeypatch.setattr(
        "fsid.evaluate.comparison_report.plot", lambda figure, caption: plots.append(figure) or caption
    )
    monkeypatch.setattr(
        "fsid.evaluate.comparison_report.picture",
        lambda pixels, caption, pixelated: pictures.setdefault(caption, pixels) is None or caption,
    )
    rng = np.random.default_rng(0)
    names, levels = ("mine", "noisy", "other"), ("iso800", "2lux")
    members = (("s", "a"), ("s", "b"), ("t", "c"))
    values = {key: rng.lognormal(3, 0.2, 3) for key in product(names, levels, members)}
    images = [ImageRow(m, level, *member, *figures) for (m, level, member), figures in values.items()]
    testset = TestSet("pixel6", levels, tuple(TestImage(name, s) for s, name in members), 0, "")
    others = [
        dataclasses.replace(images[0], set="u"),
        dataclasses.replace(images[0], image="z"),
    ]  # of another test set
    rows = summarise(testset, [Method(name, "", NOISY.denoise) for name in names], [*images, *others])
    shown = {name: rng.random((4, 6, 3)) for name in names}
    truth = rng.random((4, 6, 3))
    crops = (Crops("a", "iso800", truth, shown, {"mine": 31.234, "noisy": 20.0, "other": 33.0}),)
    found = comparison_sections(Comparison(testset, tuple(rows), tuple(images), crops))
    whole, single, before_after, side_by_side = found

    def mean(name: str, level: str, metric: int, among: tuple = ("s", "t")) -> float:
        return np.mean([values[name, level, member][metric] for member in members if member[0] in among])

    def half(name: str, level: str, metric: int) -> float:
        """t of two sets is 12.706; n / (n - 1) is 2, of the sums of departures."""
        of_s = sum(values[name, level, member][metric] - mean(name, level, metric) for member in members[:2])
        return 12.7062 * np.sqrt(2 * 2 * of_s**2) / 3

    assert whole.text.startswith("All sets together: means over 3 images, ± half the width of the 95 %")
    for metric, (table, (_, title, form)) in enumerate(zip(whole.tables, METRICS, strict=True)):
        means = np.array([[mean(name, level, metric) for level in levels] for name in names])
        means = np.column_stack([means, means.mean(1)])
        assert (table.title, table.head) == (title, ("", "ISO 800", "2 lux", "mean"))
        assert table.best == {(int(means[:, j].argmax()), j + 1) for j in range(3)}
        for row, name, each in zip(table.rows, names, means, strict=True):
            cells = [f"{each[j]:{form}} ± {half(name, levels[j], metric):{form}}" for j in (0, 1)]
            assert row == (method_label(name), *cells, f"{each[2]:{form}}")
        for line, each in zip(plots[0].axes[metric].lines, means, strict=True):
            np.testing.assert_allclose(line.get_ydata(), each[:2])
    assert [line.get_label() for line in plots[0].axes[0].lines] == ["mine", "noisy input", "other"]
    assert [table.title for table in single.tables] == ["s, 2 images", "t, 1 image"]
    for table in single.tables:
        among = (table.title[0],)
        raw = np.array([[mean(name, level, 0, among) for level in levels] for name in names])
        assert table.best == {(int(raw[:, j].argmax()), j + 1) for j in (0, 1)}
        for row, name in zip(table.rows, names, strict=True):
            each = [[mean(name, level, metric, among) for metric in range(3)] for level in levels]
            assert row == (method_label(name), *(f"{r:.2f} / {p:.2f} / {s:.3f}" for r, p, s in each))
    assert before_after.text.startswith("Of 1 of the 3 images. Drag the border. Left of it the first method")
    (((slider,),),) = [before_after.sliders]
    assert (slider.before, slider.after) == ("a, ISO 800: mine", "a, ISO 800: other")
    captions = ("mine 31.23 dB", "noisy input 20.00 dB", "other 33.00 dB", "truth: a, ISO 800")
    errors = ("error of mine", "error of noisy input", "error of other", "no error")
    assert side_by_side.pictures == (captions, errors)
    for name, caption, error in zip(names, captions, errors, strict=False):
        np.testing.assert_array_equal(pictures[caption], shown[name])
        np.testing.assert_allclose(pictures[error], 8 * np.abs(shown[name] - truth))
    np.testing.assert_array_equal(pictures[captions[3]], truth)
    assert not pictures["no error"].any()


def test_crops_are_shown_upright_and_progress_is_that_of_captures(small_set: Path, tmp_path: Path):
    """Orientation 6 of TIFF: what was held turned left is turned right."""
    shutil.copytree(small_set, tmp_path / "set")
    testset = read_testset(small_set)
    plain = compare(small_set, [NOISY], crop_levels=["iso800"], crop_px=64).crops[0]
    clean = testset.clean(tmp_path / "set", testset.images[0])
    write_dng(clean, dataclasses.replace(read_raw(clean), metadata=exposure_metadata(orientation=6)))
    done = []
    found = compare(
        tmp_path / "set",
        [NOISY],
        crop_levels=["iso800"],
        crop_px=64,
        progress=lambda *each: done.append(each),
    )
    lying = (plain.truth, plain.by_method["noisy"])
    for turned, pixels in zip((found.crops[0].truth, found.crops[0].by_method["noisy"]), lying, strict=True):
        np.testing.assert_allclose(turned, np.rot90(pixels, -1), atol=0.01)
        assert np.abs(turned - pixels).max() > 0.1
    assert (done[0], done[-1]) == ((0, 6), (6, 6))
    assert sorted({each for each, _ in done}) == list(range(7))
    with pytest.raises(FsidError, match="has no level iso50"):
        compare(small_set, [NOISY], crop_levels=["iso800", "iso50"])
    with pytest.raises(FsidError, match="noisy: two models have this name"):
        compare(small_set, [NOISY, CLASSICAL, NOISY])


def test_a_capture_that_a_method_refuses_is_named(small_set: Path, tmp_path: Path):
    shutil.copytree(small_set, tmp_path / "set")
    testset = read_testset(small_set)
    capture = testset.noisy(tmp_path / "set", testset.images[1], "iso3200")
    write_dng(capture, dataclasses.replace(read_raw(capture), noise=None))
    with pytest.raises(FsidError, match=rf"{capture}: classical: the noise level of this RAW is unknown"):
        compare(tmp_path / "set", [NOISY, CLASSICAL])


@pytest.mark.parametrize("noise", [None, NoiseLevel((0.0,) * 4, (0.0,) * 4)])
def test_a_capture_without_noise_is_named_before_anything_is_measured(small_set: Path, tmp_path: Path, noise):
    """Zeros are no noise that any denoiser could take away: the table said that none does anything."""
    shutil.copytree(small_set, tmp_path / "set")
    testset = read_testset(small_set)
    last = testset.noisy(tmp_path / "set", testset.images[-1], testset.levels[-1])
    write_dng(last, dataclasses.replace(read_raw(last), noise=noise))
    measured: list[int] = []
    with pytest.raises(FsidError, match=f"^{last}: states no noise"):
        evaluate_models(tmp_path / "set", (), progress=lambda done, total: measured.append(done))
    assert not measured


def test_a_broken_capture_is_named_before_anything_is_measured(small_set: Path, tmp_path: Path):
    shutil.copytree(small_set, tmp_path / "set")
    testset = read_testset(small_set)
    last = testset.noisy(tmp_path / "set", testset.images[-1], testset.levels[-1])
    last.write_bytes(last.read_bytes()[:1000])
    measured = []

    def denoise(raw: Raw) -> Raw:
        measured.append(raw)
        return raw

    with pytest.raises(FsidError, match=f"^{last}: "):
        compare(tmp_path / "set", [Method("mine", "", denoise)])
    assert not measured


def test_a_crop_is_of_the_edges_of_things_and_not_of_the_finest_texture():
    """Upright stripes at the lower right, and pixels black and white in turn at the upper left."""
    picture = np.full((90, 150, 3), 0.5)
    picture[:40, :40] = (np.indices((40, 40)).sum(0) % 2)[..., None]
    picture[50:, 110:] = (np.arange(40) // 10 % 2)[:, None]
    (rows, columns), detail = detailed_window(picture, 40)
    assert (rows, columns) == (slice(40, 80), slice(100, 140))
    grey = gaussian_filter(picture.mean(2), 3)
    assert detail == pytest.approx(np.hypot(*np.gradient(grey))[rows, columns].mean())
    assert detailed_window(picture.swapaxes(0, 1), 40)[0] == (slice(100, 140), slice(40, 80))
    assert detailed_window(picture, 500)[0] == (slice(0, 90), slice(0, 150))


def test_names_are_text_and_nothing_else(small_set: Path, tmp_path: Path, capsys):
    shutil.copytree(small_set, tmp_path / "set")
    testset = read_testset(small_set)
    named = [dataclasses.replace(image, set="[/b] <i>[red]") for image in testset.images]
    plain = dataclasses.asdict(dataclasses.replace(testset, images=tuple(named)))
    (tmp_path / "set" / "testset.json").write_text(json.dumps(plain))
    main(["evaluate", str(tmp_path / "set"), "--quiet"])
    assert "[/b] <i>[red]: PSNR raw" in capsys.readouterr().out
    strange = dataclasses.replace(NOISY, name=r"$\no$")
    comparison = compare(tmp_path / "set", [NOISY, strange], crop_levels=["iso800"], crop_px=64)
    write_report(tmp_path / "r.html", "title", "lead", comparison_sections(comparison))
    page = (tmp_path / "r.html").read_text()
    assert "[/b] &lt;i&gt;[red]" in page
    assert "<i>" not in page


def test_equal_images_leave_valid_json(tmp_path: Path):
    row = Row("m", "", "c", "iso50", "s", 2, float("inf"), 40.0, 1.0)
    write_results([row], tmp_path / "results.json")
    (written,) = json.loads((tmp_path / "results.json").read_text(), parse_constant=pytest.fail)
    assert (written["psnr_raw"], written["psnr"]) == (None, 40.0)
    assert np.isnan(confidence([float("inf"), 40.0]))


def test_pictures_of_one_set_are_no_independent_draws():
    """Three pictures each of ten materials: 95 % of intervals hold the truth; of 30 draws 74 % would."""
    rng = np.random.default_rng(0)
    sets = [f"material{i // 3}" for i in range(30)]
    between, within = rng.normal(0, 4, (2000, 10, 1)), rng.normal(0, 1, (2000, 10, 3))
    runs = (30 + between + within).reshape(2000, 30)
    held = [abs(run.mean() - 30) <= confidence(run, sets) for run in runs]
    assert np.mean(held) == pytest.approx(0.95, abs=0.015)
    means = runs[0].reshape(10, 3).mean(axis=1)
    assert confidence(runs[0], sets) == pytest.approx(confidence(means))
    assert confidence(runs[0], ["one"] * 30) == confidence(runs[0])
    assert confidence([39.0, 41.0, 43.0]) == pytest.approx(4.303 * 2 / np.sqrt(3), rel=1e-3)


def test_the_report_says_what_its_intervals_count(small_set: Path, tmp_path: Path):
    of_one = comparison_sections(compare(small_set, [NOISY]))[0]
    assert "confidence interval; bold" in of_one.text
    assert all(" ± " in cell for cell in of_one.tables[0].rows[0][1:3])
    shutil.copytree(small_set, tmp_path / "set")
    testset = read_testset(small_set)
    named = [dataclasses.replace(image, set=f"s{i // 2}") for i, image in enumerate(testset.images)]
    plain = dataclasses.asdict(dataclasses.replace(testset, images=tuple(named)))
    (tmp_path / "set" / "testset.json").write_text(json.dumps(plain))
    comparison = compare(tmp_path / "set", [NOISY])
    figures = comparison_sections(comparison)[0]
    assert "confidence interval over the 2 sets" in figures.text
    values = [image.psnr_raw for image in comparison.images if image.level == "iso800"]
    half = confidence(values, [image.set for image in comparison.images if image.level == "iso800"])
    assert figures.tables[0].rows[0][1].endswith(f" ± {half:.2f}")


def test_the_report_speaks_of_no_interval_of_one_image(small_set: Path, tmp_path: Path):
    shutil.copytree(small_set, tmp_path / "set")
    testset = read_testset(small_set)
    write_testset(tmp_path / "set", dataclasses.replace(testset, images=testset.images[:1]))
    (figures, *_) = comparison_sections(compare(tmp_path / "set", [NOISY]))
    assert "means over 1 image; bold is best." in figures.text
    assert "±" not in "".join(figures.tables[0].rows[0])


def test_an_image_with_nan_is_not_perfect():
    image = np.full((16, 16), 0.5, np.float32)
    assert np.isnan(psnr(np.full_like(image, np.nan), image))
    assert psnr(image, image) == float("inf")


def test_photographs_may_have_long_names_and_such_that_are_no_text(photos: Path, tmp_path: Path):
    (tmp_path / "photos").mkdir()
    names = ["é" * 120 + ".png", os.fsdecode(b"\xff.png")]
    try:
        for name in names:
            shutil.copy(min(photos.iterdir()), tmp_path / "photos" / name)
    except OSError:
        pytest.skip("this file system takes names in UTF-8 alone")
    photo_testset([tmp_path / "photos"], tmp_path / "set", camera="pixel6", isos=[800])
    assert len(compare(tmp_path / "set", [NOISY]).images) == 2


@pytest.mark.parametrize("lux", [float("inf"), float("nan"), 0.0])
def test_light_that_no_scene_has_is_refused(photos: Path, tmp_path: Path, lux: float):
    with pytest.raises(FsidError, match="--lux"):
        photo_testset([photos], tmp_path / "set", camera="pixel6", isos=[], luxes=[lux])


def test_a_narrow_table_loses_no_level(small_set: Path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "24")
    main(["evaluate", str(small_set), "--quiet"])
    assert "…" not in capsys.readouterr().out


@pytest.mark.parametrize(
    "option",
    [
        *("photos --frames 3", "photos --material fabric", "photos --scenes 3", "photos --width 1024"),
        *("photos --height 64", "from-bursts --iso 800", "from-bursts --seed 0", "from-bursts --width 64"),
        "from-bursts --scenes 2",
    ],
)
def test_options_without_effect_are_refused(photos: Path, tmp_path: Path, option: str, refused):
    source, name, value = option.split()
    assert f"{name}: fsid testset {source} has no use" in refused(
        "testset", source, photos, name, value, "-o", tmp_path / "set", "--quiet"
    )


def test_noise_far_beyond_the_profile_is_said_once(photos: Path, tmp_path: Path, capsys):
    for isos, count in ((("800", "3200"), 0), (("800", "51200"), 1)):
        out = str(tmp_path / f"set{count}")
        main(["testset", "photos", str(photos), "-o", out, "--iso", *isos])
        assert capsys.readouterr().err.count("at ISO 800 to 51200 is extrapolated far") == count
        main(["evaluate", out])
        assert capsys.readouterr().err.count("at ISO 800 to 51200 is extrapolated far") == count
    main(["evaluate", out, "--quiet"])
    assert capsys.readouterr().err.count("\n") == 1


def test_models_are_told_apart_by_name(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for run in ("lr-0.1", "lr-0.2", "b/lr-0.2"):
        (tmp_path / run).mkdir(parents=True)
    assert model_names([Path("lr-0.1"), Path("lr-0.2/model.safetensors")]) == ["lr-0.1", "lr-0.2"]
    assert model_names([Path("a.onnx"), Path("a.safetensors")]) == ["a.onnx", "a.safetensors"]
    assert model_names([Path("lr-0.2"), Path("b/lr-0.2"), Path("c/noisy")]) == [
        "lr-0.2",
        "b/lr-0.2",
        "c/noisy",
    ]
    with pytest.raises(FsidError, match=r"--model lr-0\.1: is given twice"):
        model_names([Path("lr-0.1"), Path("lr-0.1")])
    with pytest.raises(FsidError, match="--model noisy: is the name of a baseline"):
        model_names([Path("noisy")])


def _described(**changes: object) -> str:
    plain = {"camera": "x", "levels": ["iso1"], "images": [{"name": "a", "set": "s"}], "seed": 0, "notes": ""}
    return json.dumps(plain | changes)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("{", "not valid JSON"),
        ('{"camera": "x"}', "testset"),
        (
            '{"camera": "x", "levels": ["iso1"], "images": [{"name": "..", "set": "s"}], '
            '"seed": 0, "notes": ""}',
            "'..' is not a plain file name",
        ),
        (
            '{"camera": "x", "levels": ["iso1"], "images": [{"name": "../../etc", "set": "s"}], '
            '"seed": 0, "notes": ""}',
            "plain file name",
        ),
        (_described(images=[]), "images: there must be"),
        (_described(levels=[]), "levels: there must be"),
        (_described(images=[{"name": "a", "set": "s"}] * 2), "images: .* each given once"),
        (_described(frames=0), "frames 0"),
    ],
)
def test_a_broken_test_set_is_named(tmp_path: Path, text: str, named: str):
    (tmp_path / "testset.json").write_text(text)
    with pytest.raises(FsidError, match=named):
        read_testset(tmp_path)


def test_a_missing_capture_is_named(small_set: Path, tmp_path: Path):
    (tmp_path / "testset.json").write_text((small_set / "testset.json").read_text())
    with pytest.raises(FsidError, match=r"clean\.dng"):
        compare(tmp_path, [NOISY])


def test_a_broken_photograph_leaves_no_test_set(photos: Path, tmp_path: Path):
    shutil.copytree(photos, tmp_path / "photos")
    (tmp_path / "photos" / "zzz.png").write_bytes(b"\x89PNG\r\n\x1a\n but not really")
    with pytest.raises(FsidError, match=r"zzz\.png"):
        photo_testset([tmp_path / "photos"], tmp_path / "out", camera="pixel6", isos=[800])
    assert sorted(path.name for path in tmp_path.iterdir()) == ["photos"]


def test_all_photographs_that_are_of_no_use_are_named_before_the_first_is_captured(
    photos: Path, tmp_path: Path, refused, monkeypatch
):
    """One after the other, the last of a thousand would cost an hour; and what is black measures nothing."""
    monkeypatch.setattr("fsid.evaluate.testset.read_photo", lambda path: pytest.fail("captured before"))
    shutil.copytree(photos, tmp_path / "photos")
    Image.new("RGB", (64, 64)).save(tmp_path / "photos" / "zy.png")
    (tmp_path / "photos" / "zz.png").write_bytes(b"\x89PNG\r\n\x1a\n but not really")
    command = ("testset", "photos", tmp_path / "photos", "-o", tmp_path / "out", "--quiet")
    said = refused(*command)
    assert said.startswith("fsid: 2 of 5 pictures cannot be used")
    assert "zy.png: is black all over; " in said
    assert "zz.png: cannot be read as a photograph" in said
    assert not (tmp_path / "out").exists()


def test_a_set_has_the_name_of_its_folder(photos: Path, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(photos)
    assert photo_testset([Path()], tmp_path / "a", camera="pixel6", isos=[800]).images[0].set == photos.name
    shutil.copytree(photos, tmp_path / "all")
    with pytest.raises(FsidError, match="all: means all sets together"):
        photo_testset([photos, tmp_path / "all"], tmp_path / "b", camera="pixel6", isos=[800])


def test_the_current_folder_is_no_name_for_a_test_set(photos: Path, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FsidError, match="name a new folder"):
        photo_testset([photos], Path(), camera="pixel6", isos=[800])


def test_levels_may_be_an_array_or_made_one_by_one(photos: Path, tmp_path: Path):
    isos = np.array([800, 3200])
    for name, given in (("array", isos), ("floats", isos * 1.0), ("generator", (int(iso) for iso in isos))):
        testset = photo_testset(iter([photos]), tmp_path / name, camera="pixel6", isos=given)
        assert testset.levels == ("iso800", "iso3200")
    drawn = simulated_testset(
        tmp_path / "drawn",
        camera="pixel6",
        luxes=np.array([1.0, 5.0]),
        materials=iter(["text"]),
        scenes=1,
        width=64,
        height=64,
    )
    assert drawn.levels == ("1lux", "5lux")


def test_an_existing_folder_is_not_overwritten(photos: Path, tmp_path: Path):
    (tmp_path / "mine.txt").write_text("precious")
    with pytest.raises(FsidError, match="not empty"):
        photo_testset([photos], tmp_path, camera="pixel6", isos=[800])


def test_a_confidence_interval_is_student_s():
    """Of 0 and 2: t = 12.706 with one degree of freedom, standard error 1; of 1, 2, 3: 4.303 / sqrt 3."""
    assert confidence([0.0, 2.0]) == pytest.approx(12.706, abs=1e-3)
    assert confidence([1.0, 2.0, 3.0]) == pytest.approx(4.3027 / np.sqrt(3), abs=1e-3)
    # sets of two and of one: sums of departures from the mean 3 are -4 and 4, and n / (n - 1) is 2
    assert confidence([0.0, 2.0, 7.0], ["a", "a", "b"]) == pytest.approx(12.706 * 8 / 3, abs=3e-3)
    assert np.isnan([confidence([30.0]), confidence([30.0, np.nan]), confidence([])]).all()


def test_figures_that_are_written_have_four_digits(tmp_path: Path):
    row = Row("m", "t", "c", "iso50", "s", 2, 31.123456, float("nan"), 0.98766)
    write_results([row], tmp_path / "results.json")
    (written,) = json.loads((tmp_path / "results.json").read_text())
    assert written == {
        **{"model": "m", "training": "t", "camera": "c", "level": "iso50", "set": "s", "n": 2},
        **{"psnr_raw": 31.1235, "psnr": None, "ssim": 0.9877},
    }
    images = [
        ImageRow("m", "iso50", "s, t", 'a "b"\r\n', 31.123456, float("inf"), 0.98766),
        ImageRow("n", "iso50", "s", "b", 40.0, 30.0, 0.5),
    ]
    write_images(images, tmp_path / "images.csv")
    assert read_images(tmp_path / "images.csv") == [
        dataclasses.replace(images[0], psnr_raw=31.1235, ssim=0.9877),
        images[1],
    ]


def test_results_without_error_are_counted_in_raw_and_after_develop():
    rows = [
        ImageRow("first", "iso50", "s", "a", 99.9, 99.9, 1.0),
        ImageRow("second", "iso100", "s", "b", 50.0, 100.0, 1.0),
        ImageRow("third", "iso50", "s", "c", 100.0, 60.0, 1.0),
    ]
    assert perfect_note(rows).startswith("2 results without error (second of b at iso100 for one): ")
    assert perfect_note(rows[:1]) == ""


def test_two_cannot_fill_one_folder(photos: Path, tmp_path: Path):
    out = tmp_path / "set"
    with staged(out) as root:
        (root / "mine").mkdir()
        with pytest.raises(FsidError, match="another fsid testset is filling it"):
            photo_testset([photos], out, camera="pixel6", isos=[800])
    assert [path.name for path in out.iterdir()] == ["mine"]


def test_a_test_set_fills_the_folder_that_is_there(photos: Path, tmp_path: Path, monkeypatch):
    """A mount point and the aim of a link stay what they are; what a killed run left there is no content."""
    folder, link = tmp_path / "folder", tmp_path / "link"
    (folder / ".testset.part" / "0000-coffee").mkdir(parents=True)
    link.symlink_to(folder)
    before = folder.stat().st_ino
    moved: list[str] = []
    rename = Path.rename
    monkeypatch.setattr(
        Path, "rename", lambda path, target: (moved.append(path.name), rename(path, target))[1]
    )
    photo_testset([photos], link, camera="pixel6", isos=[800])
    assert folder.stat().st_ino == before
    assert link.is_symlink()
    assert len(read_testset(folder).images) == 3
    assert len(list(folder.iterdir())) == 4
    assert moved[-1] == "testset.json"


def test_a_run_that_was_killed_while_its_set_appeared_leaves_no_content(photos: Path, tmp_path: Path):
    """An image was in its place already, and testset.json, the last, was not."""
    out, part = tmp_path / "out", tmp_path / "out" / ".testset.part"
    photo_testset([photos], out, camera="pixel6", isos=[800])
    part.mkdir()
    for name in ("testset.json", "0001-coffee-1", "0002-coffee-2"):
        (out / name).rename(part / name)
    (out / "mine").touch()
    before = sorted(out.rglob("*"))
    with pytest.raises(FsidError, match="is not empty"):
        photo_testset([photos], out, camera="pixel6", isos=[1600])
    assert sorted(out.rglob("*")) == before
    (out / "mine").unlink()
    photo_testset([photos], out, camera="pixel6", isos=[1600])
    assert read_testset(out).levels == ("iso1600",)
    assert not list(out.rglob("iso800*"))


@pytest.mark.parametrize("left", ['{"images": [{"name": "NAME"}]}', "[]", "{}", '{"images": 1}', "TESTSET"])
def test_what_a_killed_run_is_said_to_have_left_elsewhere_stays(left: str, photos: Path, tmp_path: Path):
    """The file may be anyone's: it names nothing outside the folder of the test set, and need not be one."""
    out, part, other = tmp_path / "out", tmp_path / "out" / ".testset.part", tmp_path / "other"
    photo_testset([photos], tmp_path / "good", camera="pixel6", isos=[800])
    testset = (tmp_path / "good" / "testset.json").read_text(encoding="utf-8")
    part.mkdir(parents=True)
    other.mkdir()
    for name in (str(other), "../other"):
        text = testset.replace("0000-coffee-0", name) if left == "TESTSET" else left.replace("NAME", name)
        (part / "testset.json").write_text(text, encoding="utf-8")
        with staged(out) as root:
            (root / "image").mkdir()
        assert other.is_dir()
        (out / "image").rmdir()
        part.mkdir()


def test_a_test_set_that_fails_leaves_a_folder_as_it_was(tmp_path: Path):
    for out in (tmp_path / "new", tmp_path / "there"):
        with pytest.raises(FsidError, match="/image/clean"), staged(out) as root:
            write_atomically(root / "image" / "clean.dng", b"")
        (tmp_path / "there").mkdir(exist_ok=True)
    assert [path.name for path in tmp_path.iterdir()] == ["there"]
    assert not list((tmp_path / "there").iterdir())


def test_a_folder_of_results_is_tried_before_the_work_and_costs_no_table(
    small_set: Path, tmp_path: Path, capsys
):
    out, file = tmp_path / "out", tmp_path / "file"
    file.touch()
    command = ["evaluate", str(small_set), "--quiet", "-o"]
    with pytest.raises(SystemExit):
        main([*command, str(file / "out")])
    assert capsys.readouterr().out == ""
    (out / "results.json").mkdir(parents=True)
    with pytest.raises(SystemExit):
        main([*command, str(out)])
    told = capsys.readouterr()
    assert "results.json: cannot be written" in told.err
    assert "PSNR raw" in told.out


def test_a_folder_by_itself_is_a_list_of_one(small_set: Path, photos: Path, tmp_path: Path):
    """A text is a list of letters for Python."""
    made = photo_testset(str(photos), tmp_path / "one", camera="pixel6", isos=[800, 3200], seed=3)
    assert made == read_testset(small_set)
    assert [*made.captures(str(small_set))] == [*made.captures(small_set)]


def test_one_s_own_denoiser_has_the_report_too(small_set: Path, tmp_path: Path):
    mine = Method("mine", "nothing", lambda raw: dataclasses.replace(raw, mosaic=0.9 * raw.mosaic))
    write_comparison(compare(small_set, [NOISY, mine], crop_levels=["iso800"]), str(small_set), str(tmp_path))
    assert "mine" in (tmp_path / "report.html").read_text(encoding="utf-8")
    assert {path.name for path in tmp_path.iterdir()} == {"report.html", "results.json", "images.csv"}
