"""The experiments run, go on where they were stopped, and their gaps are those of the images."""

from __future__ import annotations

import base64
import io
import json
import re
import shutil
import subprocess
from collections import defaultdict
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from skimage import data

from fsid.cli.main import main
from fsid.cli.progress import progress_bar
from fsid.config import save_settings
from fsid.errors import FsidError
from fsid.evaluate.compare import CLASSICAL, NOISY, Method, summarise
from fsid.evaluate.dead_leaves import RADIUS_PX, _put, dead_leaves_rand, write_dead_leaves
from fsid.evaluate.demo import ISOS, DemoConfig, _copy_photographs
from fsid.evaluate.experiment_config import DEAD_LEAVES, PHOTOGRAPHS, SCENES, SOURCES, scale_config
from fsid.evaluate.experiment_report import gaps, write_experiment_report
from fsid.evaluate.experiments import (
    TEST_ISOS,
    _data,
    _generator,
    _measured,
    _testsets,
    _training,
    experiment,
)
from fsid.evaluate.plots import loss_plot
from fsid.evaluate.results import ImageRow, read_images, write_images
from fsid.evaluate.resumable_folder import claimed
from fsid.evaluate.simulated import LUXES
from fsid.evaluate.testset import TestImage, TestSet, levels_of
from fsid.evaluate.train_test_overlap import copies_in_training, overlap_note
from fsid.sensor import load_profile, save_profile
from fsid.yaml_json import read_yaml

SMOKE = ("--scale", "smoke", "--count", "2", "--steps", "3", "--quiet")


def test_dead_leaves_cover_the_picture_with_edges_of_all_sizes():
    picture = dead_leaves_rand(np.random.default_rng(0), 96, 128)
    assert picture.shape == (96, 128, 3)
    assert picture.min() >= 0
    assert picture.max() <= 1
    assert np.array_equal(picture, dead_leaves_rand(np.random.default_rng(0), 96, 128))
    assert np.mean(np.abs(np.diff(picture.mean(-1), axis=1)) > 0.05) > 0.02
    assert RADIUS_PX[0] < RADIUS_PX[1]


def test_a_gap_is_paired_by_image():
    rows = [
        ImageRow(model, "iso800", "s", name, value, value, 0.9)
        for model, values in (("full-seed0", {"a": 40.0, "b": 30.0}), ("x-seed0", {"b": 29.0, "a": 40.5}))
        for name, value in values.items()
    ]
    rows += [ImageRow(model, "iso800", "t", "a", 9.0, 9.0, 0.9) for model in ("full-seed0", "x-seed0")]
    assert sorted(gaps(rows, "full-seed0", "x-seed0", "iso800", "s", "psnr_raw")) == [-0.5, 1.0]
    assert sorted(gaps(rows, "full-seed0", "x-seed0", "iso800", "all", "psnr_raw")) == [-0.5, 0.0, 1.0]


def test_figures_of_two_seeds_have_a_spread_and_gaps_of_their_own(tmp_path: Path):
    config = scale_config("ablation", "smoke")
    figures = {"noisy": (30, 20), "classical": (33, 21)}
    for n, source in enumerate(SOURCES["ablation"]):
        figures |= {f"{source}-seed{seed}": (34 + n + seed, 25 + n - seed * n) for seed in config.seeds}
    images = [
        ImageRow(model, "iso800", name, "i", each, each, 0.9)
        for model, pair in figures.items()
        for name, each in zip("ab", pair, strict=True)
    ]
    testset = TestSet("pixel6", ("iso800",), (TestImage("i", "a"), TestImage("i2", "b")), 0, "")
    images = [replace(row, image="i2") if row.set == "b" else row for row in images]
    rows = summarise(testset, [Method(model, "", NOISY.denoise) for model in figures], images)
    pairs = dict.fromkeys(SOURCES["ablation"], 2)
    page = write_experiment_report(tmp_path / "r.html", config, pairs, rows, images).read_text()
    full, objects = ([np.mean(figures[f"{s}-seed{n}"]) for n in (0, 1)] for s in ("full", "objects"))
    assert f"<td>full</td><td>{np.mean(full):.2f} ± {np.ptp(full) / 2:.2f}</td>" in page
    gap, medians = np.mean(full) - np.mean(objects), np.subtract(full, objects)
    shown = f"<td>{gap:+.2f} (ISO 800)</td><td>{medians[0]:+.2f} {medians[1]:+.2f}</td>"
    assert f"<td>all materials</td><td>{gap:+.2f}</td>{shown}" in page
    assert "± half the spread between seeds." in page
    assert "paired medians, mean and range of the seeds" in page


@pytest.mark.parametrize("kind", ["real-vs-synthetic", "ablation"])
def test_every_figure_of_an_experiment_is_in_its_place(tmp_path: Path, monkeypatch, kind):
    """Against sums by hand: of three images of two materials each, four of photographs, and two seeds."""
    written: dict[str, list] = {}
    monkeypatch.setattr(
        "fsid.evaluate.experiment_report.write_report",
        lambda file, title, lead, sections: written.update(lead=lead, sections=sections),
    )
    figures = []
    monkeypatch.setattr(
        "fsid.evaluate.experiment_report.plot", lambda figure, caption: figures.append(figure)
    )
    rng, seeds = np.random.default_rng(0), (3, 7)
    config = replace(
        scale_config("real-vs-synthetic", "smoke"), seeds=seeds, settings=("scene.objects=[1,2]",)
    )
    config = replace(config, kind=kind)
    sources = SOURCES[kind]
    names = ["noisy", "classical", *(f"{source}-seed{seed}" for source in sources for seed in seeds)]
    methods = [Method(name, "", NOISY.denoise) for name in names]
    luxes, isos = [f"{lux:g}lux" for lux in LUXES], ["iso800", "iso3200"]
    materials = [TestImage(f"{name}{i}", name) for name in ("linen", "leather") for i in range(3)]
    photographs = [TestImage(f"p{i}", "p") for i in range(4)]
    values = {
        (name, level, image.name): rng.lognormal(3, 0.2, 3)
        for members, levels in ((materials, luxes), (photographs, isos))
        for name, level, image in product(names, levels, members)
    }
    images, rows = [], []
    for members, levels in ((materials, luxes), (photographs, isos)):
        some = [
            ImageRow(name, level, image.set, image.name, *values[name, level, image.name])
            for name in names
            for level in levels
            for image in members
        ]
        images += some
        rows += summarise(TestSet("pixel6", tuple(levels), tuple(members), 0, ""), methods, some)
    write_experiment_report(tmp_path / "r.html", config, dict.fromkeys(sources, 2), rows, images)
    assert ", scene.objects=[1,2], " in written["lead"]
    assert ("(from photographs 2 of up to 1024x1024)" in written["lead"]) == (kind == "real-vs-synthetic")
    assert written["lead"].count("(from") <= 1

    def mean(source, members, level, metric, seed):
        name = source if source in names else f"{source}-seed{seed}"
        return np.mean([values[name, level, image.name][metric] for image in members])

    def gap(rival, members, level, metric):
        ours, theirs = ([mean(s, members, level, metric, seed) for seed in seeds] for s in ("full", rival))
        return np.mean(ours) - np.mean(theirs)

    def median(rival, members, level, metric, seed):
        pairs = [
            [values[f"{s}-seed{seed}", level, image.name][metric] for image in members]
            for s in ("full", rival)
        ]
        return np.median(np.subtract(*pairs))

    standing, whole, photos, single = written["sections"]
    assert [each.title for each in (whole, photos)] == ["all materials", "p"]
    rivals = [source for source in sources if source != "full"]
    tables, panels = iter(standing.tables), iter(figures.pop(0).axes)
    for rival, metric in product(rivals, (0, 1)):
        table, panel = next(tables), next(panels)
        assert panel.get_title() == table.title
        assert table.title.startswith(f"full - {rival}, PSNR {('in RAW', 'after develop')[metric]}")
        for row, name, members, levels in zip(
            table.rows, ("all materials", "p"), (materials, photographs), (luxes, isos), strict=True
        ):
            each = [gap(rival, members, level, metric) for level in levels]
            lowest = levels[int(np.argmin(each))].replace("iso", "ISO ").replace("lux", " lux")
            medians = [
                np.mean([median(rival, members, level, metric, seed) for level in levels]) for seed in seeds
            ]
            shown = f"{medians[0]:+.2f} {medians[1]:+.2f}"
            assert row == (name, f"{np.mean(each):+.2f}", f"{min(each):+.2f} ({lowest})", shown)
            place = [label.get_text() for label in panel.get_xticklabels()].index(name)
            bar = panel.patches[place]
            assert bar.get_x() + bar.get_width() / 2 == place
            assert bar.get_height() == pytest.approx(np.mean(each))
            np.testing.assert_allclose(panel.lines[place].get_xydata(), [(place, g) for g in each])
    for section, members, levels in ((whole, materials, luxes), (photos, photographs, isos)):
        for metric, table in enumerate(section.tables[:3]):
            form = ".3f" if metric == 2 else ".2f"
            for row, source in zip(table.rows, ("noisy", "classical", *sources), strict=True):
                by = np.array([[mean(source, members, level, metric, s) for s in seeds] for level in levels])
                trained = source in sources
                cells = [f"{np.mean(v):{form}}{f' ± {np.ptp(v) / 2:{form}}' if trained else ''}" for v in by]
                assert row[1:] == (*cells, f"{by.mean():{form}}")
                assert row[0] in (source, "noisy input") or source == "classical"
        for metric, table in enumerate(section.tables[3:]):
            body = list(table.rows)
            axes = figures[members is photographs].axes[metric]
            for rival, line in zip(rivals, axes.lines, strict=False):
                each = [gap(rival, members, level, metric) for level in levels]
                assert line.get_label() == f"full - {rival}"
                medians = [[median(rival, members, level, metric, s) for s in seeds] for level in levels]
                np.testing.assert_allclose(line.get_ydata(), np.mean(medians, axis=1))
                assert body.pop(0) == (
                    f"full - {rival}", *(f"{g:+.2f}" for g in each), f"{np.mean(each):+.2f}"
                )  # fmt: skip
                cells = [f"{first:+.2f} {second:+.2f}" for first, second in medians]
                assert body.pop(0) == ("   paired medians", *cells, "")
            papers = kind == "real-vs-synthetic" and metric == 1 and members is materials
            assert body == ([("the paper's gap", "-0.40", "-0.74", "+0.01", "-0.14", "-0.32")] * papers)
    tables = iter(single.tables)
    for rival, metric in product(rivals, (0, 1)):
        for row, name in zip(next(tables).rows, ("linen", "leather"), strict=True):
            members = [image for image in materials if image.set == name]
            each = [gap(rival, members, level, metric) for level in luxes]
            assert row == (name, *(f"{g:+.2f}" for g in each), f"{np.mean(each):+.2f}")


def test_synthetic_against_real_goes_on_where_it_was_stopped(photos: Path, tmp_path: Path, refused, capsys):
    out = tmp_path / "experiment"
    held_back = tmp_path / "other"
    shutil.copytree(photos, held_back)
    command = ["experiment", "real-vs-synthetic", "-o", str(out), "--photos", str(photos), *SMOKE]
    command += ["--seeds", "3", "--test", str(held_back)]
    main(command)
    rows = json.loads((out / "results.json").read_text())
    assert set(rows[0]) == {"model", "training", "camera", "level", "set", "n", "psnr_raw", "psnr", "ssim"}
    models = {row["model"] for row in rows}
    assert models == {"noisy", "classical", "photographs-seed3", "full-seed3", "dead-leaves-seed3"}
    assert {r["training"] for r in rows if r["model"] == "photographs-seed3"} == {"3 pairs from photographs"}
    assert {"0.5lux", "5lux", "iso800", "iso6400"} <= {row["level"] for row in rows}
    page = (out / "report.html").read_text()
    assert "full - photographs" in page
    assert "2 pairs of 128x96 pixels per source (from photographs 3 of up to 1024x1024)" in page
    assert "network nafnet-tiny, 3 steps, seeds 3, camera pixel6, network.width=8, " in page
    assert "the paper&#39;s gap" in page
    assert "Means over images and seeds." in page  # of one seed there is no spread
    known = "3 of 3 test photographs of other are trained on by the real rival, which flatters it"
    assert known in page
    by = {(r["model"], r["level"]): r["psnr"] for r in rows if r["set"] == "other"}
    gap = {iso: by["full-seed3", f"iso{iso}"] - by["photographs-seed3", f"iso{iso}"] for iso in TEST_ISOS}
    shown = re.findall(r"<td>([+-]\d+\.\d\d)</td><td>([+-]\d+\.\d\d) \(ISO (\d+)\)</td>", page)
    mean, least = (
        pytest.approx(value, abs=0.0051) for value in (np.mean([*gap.values()]), min(gap.values()))
    )
    assert any((float(a), float(b), gap[int(iso)]) == (mean, least, least) for a, b, iso in shown)

    before = {p: p.stat().st_mtime_ns for p in out.rglob("*.tar")}
    (out / "measured" / "full-seed3.csv").unlink()
    shutil.rmtree(out / "runs" / "full-seed3")
    capsys.readouterr()
    main(command)
    (line,) = capsys.readouterr().err.splitlines()  # a warning is said although nothing else is
    assert line.startswith(f"note: {known}")
    assert json.loads((out / "results.json").read_text()) == rows
    assert before == {p: p.stat().st_mtime_ns for p in out.rglob("*.tar")}

    for bulky in ("data", "runs"):
        shutil.rmtree(out / bulky)
    (out / "report.html").unlink()
    main(command)  # what is measured needs neither
    assert "full - photographs" in (out / "report.html").read_text()
    assert json.loads((out / "results.json").read_text()) == rows
    assert not (out / "data").exists()

    refused(*command, "--count", "3")
    next(held_back.iterdir()).unlink()
    said = refused(*command)
    assert f"{held_back}: holds other photographs than those that {out}/testsets/other was made of" in said


def test_test_photographs_that_were_trained_on_are_found_as_copies(photos: Path, tmp_path: Path):
    training = sorted(photos.iterdir())
    blank = tmp_path / "blank.png"
    Image.new("RGB", (200, 160), (90, 90, 90)).save(blank)
    turned = tmp_path / "turned.png"
    seen = Image.open(training[2])
    seen.rotate(180).save(turned)
    smaller, other = tmp_path / "smaller.jpg", tmp_path / "other.jpg"
    seen.resize((131, 105)).save(smaller, quality=70)
    Image.fromarray(data.astronaut()[:160, :200]).save(other)
    tests = [turned, smaller, blank, other, tmp_path / "missing.png"]
    assert copies_in_training(tests, [*training[:2], blank], 2) == []
    assert copies_in_training(tests, [*training, blank], 2) == [(smaller, training[2])]


def test_a_copy_is_known_whatever_its_light_and_no_picture_by_a_part_that_it_shares(
    photos: Path, tmp_path: Path
):
    """Darker, tinted, foggy; with a tenth of another picture in it, not with a fifth (its distance is 0.30).
    What is a level brighter on one side than on the other is flat."""
    training = sorted(photos.iterdir())
    first, other = (np.asarray(Image.open(path), float) for path in training[:2])
    flat = np.full_like(first, 90)
    flat[:, :100] = 91
    made = {
        "dark": first * 0.5,
        "tinted": first * 0.8 + (50, 0, 20),
        "foggy": first * 0.2 + 100,
        "a-tenth": 0.9 * first + 0.1 * other,
        "a-fifth": 0.8 * first + 0.2 * other,
        "flat": flat,
    }
    for name, pixels in made.items():
        Image.fromarray(np.uint8(pixels.round())).save(tmp_path / f"{name}.png")
    tests = sorted(tmp_path.iterdir())
    found = copies_in_training(tests, [tmp_path / "flat.png", *reversed(training)], 1)
    assert {test.stem: rival for test, rival in found} == dict.fromkeys(
        ("a-tenth", "dark", "foggy", "tinted"), training[0]
    )


def test_what_was_trained_on_is_counted_set_by_set(photos: Path, tmp_path: Path):
    training = sorted(photos.iterdir())
    paths = {name: tmp_path / name for name in ("a.png", "b.png", "c.png", "d.png", "e.png")}
    Image.fromarray(data.astronaut()[:160, :200]).save(paths["a.png"])
    Image.fromarray(data.astronaut()[200:360, :200]).save(paths["e.png"])
    for name, path in zip("bcd", training, strict=True):
        shutil.copy(path, paths[f"{name}.png"])
    a, b, c, d, e = paths.values()
    last = "1 of 1 test photograph of last are trained on by the real rival, which flatters it"
    assert overlap_note({"one": [a, b, c], "none": [e], "last": [d]}, training, 1) == (
        "2 of 3 test photographs of one are trained on by the real rival, which flatters it "
        f"(b.png is its coffee-0.png); {last} (d.png is its coffee-2.png)"
    )
    assert overlap_note({"one": [a, e]}, training, 1) == ""


def test_a_demo_is_gone_on_with_by_the_same_command_alone(tmp_path: Path, refused):
    with claimed(tmp_path, DemoConfig(photographs=1), "demo"):
        told = refused("demo", "-o", tmp_path, "--photographs", "1", "--quiet")
    assert "another fsid demo is at work in it" in told
    assert "these differ: scenes, photographs" in refused(
        "demo", "-o", tmp_path, "--photographs", "2", "--scenes", "3", "--quiet"
    )


def test_the_demo_ends_in_a_report_and_makes_nothing_twice(tmp_path: Path):
    command = ["demo", "-o", str(tmp_path), "--scenes", "1", "--steps", "2", "--photographs", "1", "--quiet"]
    command += ["--width", "132", "--height", "130"]
    main(command)
    rows = json.loads((tmp_path / "results.json").read_text())
    assert {row["model"] for row in rows} == {"noisy", "classical", "ours"}
    assert {row["level"] for row in rows} == {f"iso{iso}" for iso in ISOS}
    page = (tmp_path / "report.html").read_text()
    for title in ("Scenes", "A training pair", "Noise", "Training"):
        assert f">{title}</h2>" in page
    assert (tmp_path / "overview.png").stat().st_size > 0

    made = {
        p: p.stat().st_mtime_ns for kind in ("data/*.tar", "testset/**/*.dng") for p in tmp_path.glob(kind)
    }
    assert {p.suffix for p in made} == {".tar", ".dng"}
    main(command)
    assert made == {p: p.stat().st_mtime_ns for p in made}
    assert json.loads((tmp_path / "results.json").read_text()) == rows


def test_folders_and_cameras_are_taken_as_named(photos: Path, tmp_path: Path):
    folder, camera = tmp_path / "photos #1", tmp_path / "my, camera.yaml"
    shutil.copytree(photos, folder)
    save_profile(camera, load_profile("pixel6"))
    config = replace(scale_config("real-vs-synthetic", "smoke"), photos=str(folder), camera=str(camera))
    data = _data(tmp_path, config, PHOTOGRAPHS, partial(progress_bar, quiet=True), workers=1)
    generated = read_yaml(data / "config.yaml")["generate"]
    assert (generated["images"], generated["cameras"]) == (str(folder), [str(camera)])
    assert min(generated["width"], generated["height"]) > max(config.width, config.height)  # never cut small
    assert _training(config, 3).profiles == (str(camera),)
    assert _training(scale_config("ablation", "cpu"), 3).profiles == ("pixel6",)


def test_networks_are_trained_on_the_noise_that_they_are_tested_on():
    """At 0.5 lux a Pixel 6 takes ISO 15358, where trainings ended at 8000: that cost all rivals half a dB."""
    config = scale_config("ablation", "cpu")
    training = _training(config, 0)
    isos = [setting.iso for setting in levels_of(load_profile(config.camera), TEST_ISOS, LUXES).values()]
    assert max(isos) > 15_000
    assert training.iso_min <= min(isos)
    assert training.iso_max >= max(isos)
    chosen = replace(config, train_settings=("iso_max=3200",))
    assert _training(chosen, 0).iso_max == 3200


@pytest.mark.parametrize("camera", ["pixel6", "galaxy-s22"])
def test_the_noise_of_a_training_spans_what_is_tested_and_what_its_configuration_says(
    tmp_path: Path, camera: str
):
    """Tested are ISO 800 to 6400, and 0.5 to 5 lux, at which these two take up to ISO 15358 and 13629."""
    tested = {"pixel6": (800, 15358), "galaxy-s22": (800, 13629)}[camera]
    network = tmp_path / "network.yaml"
    config = replace(scale_config("ablation", "cpu"), camera=camera, network=str(network))
    for stated, expected in (((3000, 4000), tested), ((100, 50_000), (100, 50_000))):
        network.write_text("iso_min: {}\niso_max: {}".format(*stated))
        found = _training(config, 0)
        assert (found.iso_min, found.iso_max) == pytest.approx(expected, abs=1)
        assert found.profiles == (camera,)


def test_a_training_is_that_of_its_seed_and_of_the_settings_that_were_given():
    """Steps that are given are those of all trainings."""
    config = replace(scale_config("ablation", "cpu"), steps=7, train_settings=("steps=9", "batch=3"))
    found = _training(config, 11)
    assert (found.steps, found.batch, found.seed) == (7, 3, 11)
    usual = _training(replace(config, steps=0, train_settings=()), 12)
    assert found == replace(usual, steps=7, batch=3, seed=11)
    assert usual.seed == 12


def test_rivals_are_made_of_their_own_settings_and_of_one_camera(photos: Path, tmp_path: Path, monkeypatch):
    """Settings of scenes are those of every variant; frames of photographs are 1024 pixels at least, and the
    same command may go on from another folder."""
    monkeypatch.chdir(tmp_path)
    config = replace(
        scale_config("real-vs-synthetic", "smoke"),
        **{"photos": str(photos), "camera": "galaxy-s22", "settings": ("scene.objects=[3,4]",)},
        **{"width": 1200, "height": 640},
    )
    found = {name: _generator(Path(), config, name) for name in (*SOURCES["ablation"], *SOURCES[config.kind])}
    assert set(found) == {"objects", "materials", "objects-materials", "full", "photographs", "dead-leaves"}
    for name, made in found.items():
        assert made.cameras == ("galaxy-s22",)
        assert (made.width, made.height) == (1200, 1024 if name == PHOTOGRAPHS else 640)
        if name in SOURCES["ablation"]:
            assert (made.variant, made.scene.objects, made.images) == (name, (3, 4), "")
    assert found[PHOTOGRAPHS].images == str(photos)
    assert found[DEAD_LEAVES].images == str(tmp_path / "dead-leaves")


@pytest.mark.parametrize("count", [2, 4])
def test_every_source_is_trained_on_with_every_seed_and_made_with_the_first(
    photos: Path, tmp_path: Path, monkeypatch, count: int
):
    """Of photographs as many pairs as there are, if that is more; every network is measured as itself.
    Nothing here is rendered or trained."""
    module, calls = "fsid.evaluate.experiments", []
    config = replace(
        scale_config("real-vs-synthetic", "smoke"), photos=str(photos), count=count, seeds=(5, 8)
    )

    def recorded(name):
        return lambda *given, **options: calls.append((name, given, options))

    def measured(stem, methods, testsets, bar):
        rows = [(stem.parent.name, stem.name, m.name, m.training, m.denoise) for m in methods]
        return rows, [stem.name]

    networks = defaultdict(lambda: lambda raw: raw)
    for name in ("generate", "train", "write_dead_leaves", "write_results", "write_images"):
        monkeypatch.setattr(f"{module}.{name}", recorded(name))
    monkeypatch.setattr(f"{module}._testsets", lambda out, config, bar: [])
    monkeypatch.setattr(f"{module}._measured", measured)
    monkeypatch.setattr(f"{module}.model_method", lambda run, name: Method(name, "", networks[run]))
    monkeypatch.setattr(f"{module}.write_experiment_report", lambda path, config, *rest: (path, *rest))
    out, notes = tmp_path / "out", []
    report, pairs, *shown, overlap = experiment(out, config, workers=3, note=notes.append)
    assert report == out / "report.html"
    assert (notes, overlap) == ([], "")  # without test photographs none is trained on
    assert pairs == {PHOTOGRAPHS: max(count, 3), SCENES: count, DEAD_LEAVES: count}
    order = [(source, seed) for source in SOURCES[config.kind] for seed in config.seeds]
    trained = [given for name, given, _ in calls if name == "train"]
    assert [(data, run, settings.seed) for data, run, settings in trained] == [
        (out / "data" / source, out / "runs" / f"{source}-seed{seed}", seed) for source, seed in order
    ]
    made = [(*given, options) for name, given, options in calls if name == "generate"]
    assert [(data, each["count"], each["seed"], each["workers"]) for data, _, each in made] == [
        (out / "data" / source, pairs[source], 5, 3) for source, _ in order
    ]
    drawn = [(*given, options) for name, given, options in calls if name == "write_dead_leaves"]
    assert {(path, number, each["width"], each["height"], each["seed"]) for path, number, each in drawn} == {
        (out / "dead-leaves", count, 128, 96, 5)
    }
    ((rows, written),) = [given for name, given, _ in calls if name == "write_results"]
    ((images, written_images),) = [given for name, given, _ in calls if name == "write_images"]
    assert (written, written_images) == (out / "results.json", out / "images.csv")
    assert shown == [rows, images]
    names = [f"{source}-seed{seed}" for source, seed in order]
    assert images == ["baselines", *names]
    assert rows == [
        ("out", "baselines", "noisy", "", NOISY.denoise),
        ("out", "baselines", "classical", "", CLASSICAL.denoise),
        *(
            ("measured", name, name, f"{pairs[source]} pairs from {source}", networks[out / "runs" / name])
            for name, (source, _) in zip(names, order, strict=True)
        ),
    ]


def test_figures_that_lack_an_image_are_not_taken_for_all(tmp_path: Path, monkeypatch):
    """An image of another set, or of another level, is not the one that is missing."""
    testset = TestSet("pixel6", ("iso800", "iso1600"), (TestImage("i", "a"), TestImage("j", "b")), 0, "")
    monkeypatch.setattr("fsid.evaluate.experiments.read_testset", lambda path: testset)
    method = Method("m", "", NOISY.denoise)
    images = [
        ImageRow("m", level, each.set, each.name, 40.0 + len(each.name), value, 0.9)
        for each in testset.images
        for level, value in (("iso800", 30.0), ("iso1600", 20.0))
    ]
    write_images(images, tmp_path / "m.csv")
    rows, found = _measured(tmp_path / "m", [method], [tmp_path], partial(progress_bar, quiet=True))
    assert found == images
    assert {(row.level, row.psnr) for row in rows} == {("iso800", 30.0), ("iso1600", 20.0)}
    for lacking in images:
        others = [row for row in images if row != lacking]
        write_images([*others, replace(lacking, set="c")], tmp_path / "m.csv")
        with pytest.raises(FsidError, match=rf"m\.csv: lacks {lacking.image} at {lacking.level}; delete it"):
            _measured(tmp_path / "m", [method], [tmp_path], partial(progress_bar, quiet=True))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"count": 0}, "--count and --seeds must name at least one"),
        ({"materials_scenes": 0}, "must name at least one"),
        ({"seeds": ()}, "must name at least one"),
        ({"steps": -1}, "--steps must not be negative"),
        ({"seeds": (-1, 2)}, "--seeds -1 2: must be at least 0 and below 2"),
        ({"seeds": (2**64,)}, "--seeds 18446744073709551616: must be at least 0 and below 2"),
        ({"seeds": (3, 4, 3)}, "--seeds 3 4 3: give different ones"),
        ({"count": 2.5}, "count: 2.5"),
        ({"kind": "real-vs-synthetic"}, "--photos: name the folder"),
    ],
)
def test_an_experiment_that_cannot_be_is_refused(changes: dict, words: str):
    with pytest.raises(FsidError, match=words):
        replace(scale_config("ablation", "smoke"), **changes)


def test_the_least_and_the_most_that_an_experiment_may_be():
    """The smallest one; seeds of all 64 bits; settings of scenes and of which of them are left out."""
    least = {"count": 1, "materials_scenes": 1, "steps": 0, "seeds": (0, 2**64 - 1)}
    settings = ("scene.objects=[1,2]", "checks.duplicate_bits=-1", "quality=fast")
    config = replace(scale_config("ablation", "smoke"), **least, settings=settings)
    assert (config.settings, config.seeds) == (settings, least["seeds"])


def test_scales_are_those_of_the_guide():
    """docs/experiments.md: pairs, size of frames, network and steps; 0 are those of the network."""
    for kind in SOURCES:
        found = {
            name: (config.count, config.width, config.height, config.network, config.steps, config.seeds)
            for name, config in ((name, scale_config(kind, name)) for name in ("smoke", "cpu", "paper"))
        }
        assert found == {
            "smoke": (4, 128, 96, "nafnet-tiny", 30, (0, 1)),
            "cpu": (800, 480, 270, "nafnet-tiny", 6000, (0, 1)),
            "paper": (175_000, 1920, 1080, "paper", 0, (0, 1)),
        }
    with pytest.raises(FsidError, match="--scale large: choose smoke, cpu or paper"):
        scale_config("ablation", "large")


def test_sources_of_all_sizes_are_trained_on_alike(tmp_path: Path):
    config = scale_config("ablation", "paper")
    assert _training(config, 3).shrink == (1,)
    network = tmp_path / "network.yaml"
    network.write_text("shrink: [1, 2]")
    assert _training(replace(config, network=str(network)), 3).shrink == (1, 2)


def test_an_experiment_s_seeds_are_those_of_its_trainings():
    config = replace(scale_config("ablation", "cpu"), train_settings=("seed=7", "batch=2"))
    assert [(_training(config, seed).seed, _training(config, seed).batch) for seed in (0, 3)] == [
        (0, 2),
        (3, 2),
    ]


def test_rivals_differ_in_nothing_but_their_data(tmp_path: Path, refused):
    """A file of settings that was edited since: the others would be trained with what it says now."""
    network, out = tmp_path / "network.yaml", tmp_path / "out"
    network.write_text("learning_rate: 0.002")
    config = replace(scale_config("ablation", "smoke"), network=str(network), count=2, steps=3)
    with claimed(out, config, "experiment"):
        pass
    run = out / "runs" / "objects-seed1"
    run.mkdir(parents=True)
    save_settings(replace(_training(config, 1), profiles=("pixel6", "galaxy-s22")), run / "config.yaml")
    (run / "checkpoint.safetensors").touch()
    network.write_text("learning_rate: 0.005")
    before = sorted(out.rglob("*"))
    command = ["experiment", "ablation", "-o", out, *SMOKE, "--network", network]
    told = refused(*command)
    assert f"{run}/config.yaml: this run was started with another learning_rate, profiles" in told
    assert sorted(out.rglob("*")) == before


def test_a_test_set_of_another_noise_than_the_camera_has_now_is_not_measured_on(photos: Path, tmp_path: Path):
    """A profile that was mended after the test sets were made: trainings would be on the noise of today."""
    camera, profile = tmp_path / "camera.yaml", load_profile("pixel6")
    save_profile(camera, profile)
    config = replace(scale_config("ablation", "smoke"), camera=str(camera), tests=(str(photos),))
    bar = partial(progress_bar, quiet=True)
    made = _testsets(tmp_path, config, bar)
    assert _testsets(tmp_path, config, bar) == made
    save_profile(camera, replace(profile, k=2 * profile.k))
    for path in made:
        with pytest.raises(FsidError, match=rf"camera\.yaml: says another noise than that which {path} was"):
            _testsets(tmp_path, config, bar)
        shutil.rmtree(path)


def test_all_are_measured_on_materials_in_lux_and_on_every_folder_of_photographs(tmp_path: Path, monkeypatch):
    """As large and as many as the experiment says, of its camera; nothing is drawn or captured here."""
    module, calls = "fsid.evaluate.experiments", []
    monkeypatch.chdir(tmp_path)
    (tmp_path / "one" / "kept").mkdir(parents=True)
    (tmp_path / "two").mkdir()
    save_profile(tmp_path / "camera.yaml", load_profile("galaxy-s22"))
    config = replace(
        scale_config("ablation", "cpu"),
        **{"camera": "camera.yaml", "seeds": (5,), "tests": ("one/kept", str(tmp_path / "two"))},
        **{"materials_scenes": 4, "test_width": 640, "test_height": 320},
    )

    def drawn(path, **options):
        del options["progress"]
        calls.append((path, options))

    def captured(folders, path, **options):
        drawn(path, folders=folders, **options)

    monkeypatch.setattr(f"{module}.simulated_testset", drawn)
    monkeypatch.setattr(f"{module}.photo_testset", captured)
    written_before_digests = TestSet("galaxy-s22", ("iso800",), (TestImage("i", "a"),), 0, "")
    monkeypatch.setattr(f"{module}.read_testset", lambda path: written_before_digests)
    names = ("materials", "kept", "two")
    paths = [tmp_path / "out" / "testsets" / name for name in names]
    bar = partial(progress_bar, quiet=True)
    assert _testsets(tmp_path / "out", config, bar) == paths
    of_all = {"camera": "camera.yaml"}
    isos = of_all | {"isos": (800, 1600, 3200, 6400)}
    assert calls == [
        (paths[0], of_all | {"scenes": 4, "width": 640, "height": 320, "seed": 1000}),
        (paths[1], isos | {"folders": [Path("one/kept")]}),
        (paths[2], isos | {"folders": [tmp_path / "two"]}),
    ]
    for path in paths:
        path.mkdir(parents=True)
        (path / "testset.json").touch()
    assert _testsets(tmp_path / "out", config, bar) == paths
    assert len(calls) == 3  # what is there stays


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["real-vs-synthetic"], "--photos: name the folder"),
        (["real-vs-synthetic", "--photos", "nowhere"], "nowhere: is not a folder"),
        (["ablation", "--photos", "."], "only real-vs-synthetic"),
        (["ablation", "--seeds", "1", "1"], "give different ones"),
        (["real-vs-synthetic", "--photos", ".", "--test", "."], "test on other photographs"),
        (["ablation", "--camera", "nosuch"], "profile 'nosuch'"),
        (["ablation", "--network", "nosuch"], "nosuch: is no file and no built-in configuration"),
        (["ablation", "--set", "nokey=1"], "no such key: nokey"),
        (["ablation", "--set", "scene.objects=[1,2]", "variant=objects"], "--set variant: is no setting of"),
        (["ablation", "--set", "images=materials"], "--set images: is no setting of the scenes"),
        (["ablation", "--set", "cameras=[galaxy-s22]"], "--set cameras: is no setting of the scenes"),
        (["ablation", "--set", "scene.hdri_share=1"], "scene.hdri_share: has no effect while"),
        (["ablation", "--width", "101"], "width: 101"),
        (["ablation", "--workers", "0"], "--workers must be at least 1"),
        (["ablation", "--height", "128"], "--width 480 --height 128: patches of the training need 130x130"),
        (["ablation", "--width", "128"], "--width 128 --height 270: patches of the training need 130x130"),
        (["real-vs-synthetic", "--photos", "."], "holds no picture"),
        (["ablation", "--test", "."], "holds no photograph"),
        (["ablation", "--set", "noise_levels=2"], "--set noise_levels: is no setting of the scenes"),
        (["ablation", "--test", "a/val", "b/val"], "another test set is called val"),
        (["ablation", "--test", "all"], "another test set is called all"),
        (["ablation", "--test", "materials"], "another test set is called materials"),
        (["ablation", "--test", "fabric"], "another test set is called fabric"),
    ],
)
def test_bad_input_is_one_line(tmp_path: Path, arguments: list[str], words: str, monkeypatch, refused):
    monkeypatch.chdir(tmp_path)
    for folder in ("a/val", "b/val", "all", "materials", "fabric"):
        (tmp_path / folder).mkdir(parents=True)
    assert words in refused("experiment", *arguments, "-o", tmp_path / "out", "--quiet")
    assert not (tmp_path / "out").exists()


def test_unreadable_photographs_are_named_before_anything_is_written(photos: Path, tmp_path: Path, refused):
    for name in ("train", "test"):
        shutil.copytree(photos, tmp_path / name)
        (tmp_path / name / f"broken-{name}.jpg").write_bytes(b"no picture")
    command = ["experiment", "real-vs-synthetic", "-o", str(tmp_path / "out"), *SMOKE]
    shutil.copytree(photos, tmp_path / "good")
    folders = ["--photos", tmp_path / "train", "--test", tmp_path / "good", tmp_path / "test"]
    told = refused(*command, *folders)
    assert "2 of 11 pictures cannot be used" in told
    assert "broken-train.jpg: cannot be read" in told
    assert "broken-test.jpg: cannot be read" in told
    assert not (tmp_path / "out").exists()


def test_photographs_too_small_to_train_on_are_named_before_anything_is_written(
    photos: Path, tmp_path: Path, refused
):
    """Smoke trains on patches of 24 packed pixels; a test photograph of that size can be measured on, down to
    32 pixels."""
    for name, size in (("train", (120, 49)), ("test", (32, 32)), ("tiny", (31, 48))):
        shutil.copytree(photos, tmp_path / name)
        Image.open(min(photos.iterdir())).resize(size).save(tmp_path / name / f"icon-{name}.png")
    command = ["experiment", "real-vs-synthetic", "-o", str(tmp_path / "out"), *SMOKE]
    told = refused(*command, "--photos", tmp_path / "train", "--test", tmp_path / "test")
    assert "1 of 8 pictures cannot be used" in told
    assert "icon-train.png: is 120x49 pixels, at least 50x50 are needed" in told
    told = refused(*command, "--photos", photos, "--test", tmp_path / "tiny")
    assert "icon-tiny.png: is 31x48 pixels, at least 32x32 are needed" in told
    assert not (tmp_path / "out").exists()


def test_frames_too_small_for_a_training_that_makes_them_smaller_are_refused_before_they_are_made(
    photos: Path, tmp_path: Path, refused
):
    """Patches of 24 packed pixels of images 4 times smaller: all scenes were made, and then none would do.
    Of photographs those that are too small are left out."""
    for name, size in (("train", (40, 40)), ("test", (31, 31))):
        shutil.copytree(photos, tmp_path / name)
        Image.open(min(photos.iterdir())).resize(size).save(tmp_path / name / f"icon-{name}.png")
    network = tmp_path / "network.yaml"
    network.write_text("shrink: [2, 4]")
    command = ["experiment", "real-vs-synthetic", "-o", str(tmp_path / "out"), *SMOKE, "--network", network]
    command += ["--photos", tmp_path / "train", "--test", tmp_path / "test"]
    told = refused(*command, "--width", "300", "--height", "198")
    assert "--width 300 --height 198: patches of the training need 200x200" in told
    told = refused(*command, "--width", "200", "--height", "200")
    assert "1 of 8 pictures cannot be used" in told
    assert "icon-test.png" in told
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("setting", ["initial_weights: gone", "validation_photos: gone"])
def test_what_a_network_s_file_names_is_looked_for_before_anything_is_made(setting: str, tmp_path, refused):
    network = tmp_path / "network.yaml"
    network.write_text(setting)
    told = refused("experiment", "ablation", "-o", tmp_path / "out", *SMOKE, "--network", network)
    assert "gone" in told
    assert not (tmp_path / "out").exists()


def test_the_slider_of_a_report_moves_in_a_browser(photos: Path, tmp_path: Path):
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        pytest.skip("no headless browser: install chromium")
    main(["testset", "photos", str(photos), "-o", str(tmp_path / "set"), "--iso", "3200", "--quiet"])
    main(["evaluate", str(tmp_path / "set"), "-o", str(tmp_path / "out"), "--quiet"])
    page = (tmp_path / "out" / "report.html").read_text()
    probe = """<script type="module">
      const input = document.querySelector(".slider input");
      input.value = 20; input.dispatchEvent(new Event("input"));
      const over = getComputedStyle(document.querySelector(".slider .over")).clipPath;
      const loaded = [...document.images].every(image => image.complete && image.naturalWidth > 0);
      document.title = `${over} ${loaded}`;
    </script></body>"""
    (tmp_path / "probe.html").write_text(page.replace("</body>", probe))
    flags = ("--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=5000", "--dump-dom")
    command = [browser, *flags, (tmp_path / "probe.html").as_uri()]
    dom = subprocess.run(command, capture_output=True, text=True, timeout=120).stdout
    title = dom[dom.index("<title>") : dom.index("</title>")]
    assert "80%" in title
    assert "true" in title


def test_the_course_of_a_training_of_one_row_can_be_seen():
    """Of fewer steps than `log_every`; a line of one point is none."""
    png = base64.b64decode(loss_plot([8], [1.0], [30.0]).uri.partition(",")[2])
    pixels = np.asarray(Image.open(io.BytesIO(png)).convert("RGB"), np.int16)
    is_coloured = np.ptp(pixels, axis=2) > 100
    half = is_coloured.shape[1] // 2
    assert is_coloured[:, :half].any()
    assert is_coloured[:, half:].any()


def test_figures_of_something_else_are_not_taken_for_measured_ones(tmp_path: Path):
    """Also where columns were moved, which would be other figures without a word."""
    file = tmp_path / "a.csv"
    row = ImageRow("m", "iso800", "s", "i", 40.0, 30.0, 0.5)
    write_images([row], file)
    assert read_images(file) == [row]
    whole = file.read_text()
    for wrong in (
        "",
        whole.replace("30.0000", "x"),
        whole.replace(",0.5000", ""),
        whole.replace("psnr_raw,psnr,ssim", "ssim,psnr_raw,psnr"),
        whole.replace("model,", "model,more,"),
    ):
        file.write_text(wrong)
        with pytest.raises(FsidError, match=r"a\.csv: holds no figures of images; delete it"):
            read_images(file)


def test_nothing_is_written_through_a_link(tmp_path: Path):
    """The folder of an experiment or a demo that goes on here may be a stranger's."""
    mine = tmp_path / "mine"
    mine.write_text("mine")
    for name in ("000000.part", "astronaut.png"):
        (tmp_path / name).symlink_to(mine)
    write_dead_leaves(tmp_path, 1, height=32, width=32, seed=0)
    _copy_photographs(tmp_path, 1)
    assert mine.read_text() == "mine"


@pytest.mark.parametrize("height", [64, 8])
def test_radii_of_dead_leaves_have_the_density_of_scale_invariance(monkeypatch, height: int):
    """1 / r^3 per area between 4 and 64 texels: of the discs that reach h x 128 texels, P(radius > r) from
    the integral of (h + 2 r) (128 + 2 r) / r^3."""

    def reaching(low: float) -> float:
        radii = np.linspace(low, 64, 20_000)
        return float(np.trapezoid((2 * height + 2 * radii) * (128 + 2 * radii) / radii**3, radii))

    radii = []

    def put(rng, picture, bare, radius, colour):
        radii.append(radius)
        return 0 if len(radii) < 16_000 else bare.size

    monkeypatch.setattr("fsid.evaluate.dead_leaves._put", put)
    dead_leaves_rand(np.random.default_rng(0), height, 64)
    assert 4 <= min(radii) < max(radii) <= 64
    for radius in (5.0, 8.0, 16.0, 32.0):
        expected = reaching(radius) / reaching(4.0)
        assert np.mean(np.array(radii) > radius) == pytest.approx(expected, abs=0.01)


def test_discs_lie_as_often_on_the_corners_of_a_picture_as_on_its_middle(monkeypatch):
    """Of 8 texels, on 32 x 32: each covers a texel with probability pi 8^2 / (32 + 2 x 8)^2."""
    hits, discs, real = np.zeros((32, 32)), [], _put

    def put(rng, picture, bare, radius, colour):
        alone = np.ones_like(bare)
        discs.append(real(rng, picture, alone, radius, colour))
        assert discs[-1] == np.sum(~alone)
        hits[...] += ~alone
        return 0 if len(discs) < 4000 else bare.size

    monkeypatch.setattr("fsid.evaluate.dead_leaves._put", put)
    monkeypatch.setattr("fsid.evaluate.dead_leaves.RADIUS_PX", (4.0, 4.0001))
    dead_leaves_rand(np.random.default_rng(0), 16, 16)
    np.testing.assert_allclose(hits / 4000, np.pi * 64 / 48**2, atol=0.025)
    assert hits.mean() / 4000 == pytest.approx(np.pi * 64 / 48**2, abs=0.002)


def test_dead_leaves_are_discs_that_hide_what_comes_after_them(monkeypatch):
    """Of 8 px, each of a colour of its own: none reaches farther, a few are whole, and all is covered."""
    monkeypatch.setattr("fsid.evaluate.dead_leaves.RADIUS_PX", (8.0, 8.0001))
    monkeypatch.setattr("fsid.evaluate.dead_leaves.OVERSAMPLING", 1)
    monkeypatch.setattr("fsid.evaluate.dead_leaves.SHADED_SHARE", 0.0)
    number = np.arange(1_000_000, dtype=np.float32)
    palette = np.stack([number // 1000, number % 1000, np.zeros_like(number)], axis=-1) / 1024
    monkeypatch.setattr("fsid.evaluate.dead_leaves._palette_rand", lambda rng: palette)
    picture = dead_leaves_rand(np.random.default_rng(0), 100, 150)
    assert picture.shape == (100, 150, 3)
    bare = np.abs(picture - palette.mean(axis=0)).max(-1) < 1e-4
    assert 0 < bare.sum() <= 0.0005 * bare.size
    assert picture.max(-1).min() > 0
    places = np.argwhere(~bare)
    _, owner, areas = np.unique(picture[~bare], axis=0, return_inverse=True, return_counts=True)
    assert areas.max() == pytest.approx(np.pi * 64, abs=10)
    assert np.sum(areas > 0.97 * np.pi * 64) >= 5
    for i in range(len(areas)):
        mine = places[owner.ravel() == i]
        assert np.ptp(mine, axis=0).max() <= 16
        if areas[i] > 0.97 * np.pi * 64:
            middle = (mine.min(0) + mine.max(0)) / 2
            assert np.linalg.norm(mine - middle, axis=1).max() <= 8.8


def test_half_of_dead_leaves_fade_evenly_by_at_most_two_fifths(monkeypatch):
    """From the middle of a disc to its edge, as all three colours do: a plane over its pixels."""
    monkeypatch.setattr("fsid.evaluate.dead_leaves.RADIUS_PX", (10.0, 10.0001))
    monkeypatch.setattr("fsid.evaluate.dead_leaves.OVERSAMPLING", 1)
    share = np.arange(1, 4001, dtype=np.float32) / 4001
    palette = np.stack([0.5 * share, 0.5 * (1 - share), np.zeros_like(share)], axis=-1)
    monkeypatch.setattr("fsid.evaluate.dead_leaves._palette_rand", lambda rng: palette)
    picture = dead_leaves_rand(np.random.default_rng(1), 120, 160)
    sums = picture.sum(-1)
    number = (picture[..., 0] / np.maximum(sums, 1e-9) * 4001).round().astype(int)
    slopes = []
    for i, area in zip(*np.unique(number, return_counts=True), strict=True):
        y, x = np.nonzero(number == i)
        if area < 150 or max(np.ptp(x), np.ptp(y)) > 20:
            continue
        plane = np.stack([x - x.mean(), y - y.mean(), np.ones(len(x))], axis=-1)
        fit = np.linalg.lstsq(plane, sums[y, x].astype(float))[0]
        np.testing.assert_allclose(plane @ fit, sums[y, x], atol=1e-4)
        slopes.append(np.hypot(*fit[:2]) * 10 / 0.5)
    slopes = np.array(slopes)
    assert len(slopes) >= 20
    assert slopes.max() == pytest.approx(0.36, abs=0.05)
    assert 0.25 < np.mean(slopes > 1e-3) < 0.75


def test_a_pixel_of_dead_leaves_is_the_mean_of_its_texels(monkeypatch):
    monkeypatch.setattr("fsid.evaluate.dead_leaves.SHADED_SHARE", 0.0)
    pixels = dead_leaves_rand(np.random.default_rng(0), 24, 32)
    monkeypatch.setattr("fsid.evaluate.dead_leaves.RADIUS_PX", tuple(2 * radius for radius in RADIUS_PX))
    monkeypatch.setattr("fsid.evaluate.dead_leaves.OVERSAMPLING", 1)
    texels = dead_leaves_rand(np.random.default_rng(0), 48, 64)
    by_hand = (texels[::2, ::2] + texels[1::2, ::2] + texels[::2, 1::2] + texels[1::2, 1::2]) / 4
    np.testing.assert_allclose(pixels, by_hand, atol=1e-6)


def test_dead_leaves_of_a_folder_differ_by_number_and_seed_and_are_drawn_once(tmp_path: Path):
    progress = []
    write_dead_leaves(
        tmp_path / "a", 3, height=32, width=48, seed=1, progress=lambda *done: progress.append(done)
    )
    assert (progress[0], progress[-1]) == ((0, 3), (3, 3))
    write_dead_leaves(tmp_path / "b", 2, height=32, width=48, seed=1)
    write_dead_leaves(tmp_path / "c", 1, height=32, width=48, seed=2)
    files = sorted(tmp_path.rglob("*.png"))
    assert [str(file.relative_to(tmp_path)) for file in files] == [
        *("a/000000.png", "a/000001.png", "a/000002.png", "b/000000.png", "b/000001.png", "c/000000.png")
    ]
    a, b, _, again, same, other = (np.asarray(Image.open(file)) for file in files)
    assert a.shape == (32, 48, 3)
    np.testing.assert_array_equal(again, a)
    np.testing.assert_array_equal(same, b)
    assert (a != b).any()
    assert (a != other).any()
    mean = dead_leaves_rand(np.random.default_rng(np.random.SeedSequence(1, spawn_key=(1,))), 32, 48)
    np.testing.assert_allclose(b / 255, mean, atol=0.5001 / 255)
    Image.new("RGB", (48, 32)).save(files[1])
    write_dead_leaves(tmp_path / "a", 3, height=32, width=48, seed=1)
    assert not np.asarray(Image.open(files[1])).any()
