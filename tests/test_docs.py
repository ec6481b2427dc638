"""The guides' commands run, in the order in which a reader meets them."""

from __future__ import annotations

import io
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fsid.cli.main import COMMANDS, main
from fsid.dataset import read_member
from fsid.dataset.index import index_mosaics
from fsid.evaluate import read_testset
from fsid.sensor import Raw, load_profile, noisy_from_clean, pack, read_raw, to_dn, write_dng

REPOSITORY = Path(__file__).resolve().parents[1]
GUIDES = (
    "noise-profiles.md",
    "generate.md",
    "scenes.md",
    "calibrate.md",
    "train-and-denoise.md",
    "evaluate.md",
    "inspect.md",
    "capture-a-test-set.md",
    "experiments.md",
    "bring-your-own-meshes.md",
    "other-engines.md",
    "stereo-and-labels.md",
)


def blocks(page: str, language: str) -> list[str]:
    """The blocks of a page that are in a language, in its order."""
    text = (REPOSITORY / page).read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, re.S)


def commands(guide: str) -> list[str]:
    return [line for block in blocks(f"docs/{guide}", "sh") for line in block.splitlines()]


def run_python(page: str, python: str = "", **names: Any) -> dict[str, Any]:
    """What is named after the Python of a page, or after `python`, which is some of it."""
    exec(compile(python or "\n".join(blocks(page, "python")), page, "exec"), names)
    return names


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory, photos: Path) -> Path:
    """A folder with what the guides take as given: photographs."""
    folder = tmp_path_factory.mktemp("desk")
    shutil.copytree(photos, folder / "photographs")
    write_bursts(folder)
    write_captures(folder / "captures")
    write_mesh(folder / "meshes")
    write_render(folder / "renders")
    return folder


def write_bursts(folder: Path) -> None:
    """Twelve frames of a ramp and six dark ones at two ISOs, as arrays."""
    rng, profile = np.random.default_rng(0), load_profile("galaxy-s22")
    for kind, light, count in (("frames", 0.8, 12), ("dark", 0.0, 6)):
        ramp = np.broadcast_to(np.linspace(0, light, 128, dtype=np.float32), (128, 128))
        clean = Raw(ramp, "GBRG", 64, 1023, (2.0, 1.0, 1.6), np.eye(3))
        (folder / kind).mkdir()
        for iso, number in product((800, 3200), range(count)):
            noisy = noisy_from_clean(rng, clean, iso, profile.level(iso))
            np.save(folder / kind / f"iso{iso}_{number:02d}.npy", to_dn(noisy))


def write_captures(folder: Path) -> None:
    """Bursts of six frames of a smooth picture at two light levels, as a phone would store them."""
    rng, profile = np.random.default_rng(1), load_profile("pixel6")
    x, y = np.meshgrid(np.arange(96), np.arange(64))
    picture = (0.3 + 0.2 * np.sin(x / 9) * np.cos(y / 7)).astype(np.float32)
    clean = Raw(picture, profile.cfa, profile.black_level, profile.white_level, (2.0, 1.0, 1.6), np.eye(3))
    for level, iso in (("0.5lux", 3200), ("2lux", 800)):
        (folder / "star" / level).mkdir(parents=True)
        for number in range(6):
            noisy = noisy_from_clean(rng, clean, iso, profile.level(iso))
            write_dng(folder / "star" / level / f"{number:04d}.dng", noisy)


def write_mesh(folder: Path) -> None:
    """A wedge."""
    folder.mkdir()
    points = ("0 0 0", "1 0 0", "0 1 0", "0 0 1")
    faces = ("1 3 2", "1 2 4", "2 3 4", "1 4 3")
    text = "".join([*(f"v {p}\n" for p in points), *(f"f {f}\n" for f in faces)])
    (folder / "wedge.obj").write_text(text)


def write_render(folder: Path) -> None:
    """A linear picture as another engine would store it."""
    import OpenEXR

    folder.mkdir()
    pixels = np.random.default_rng(2).gamma(2.0, 0.5, (96, 128, 3)).astype(np.float32)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": pixels}) as file:
        file.write(str(folder / "scene.exr"))


@pytest.mark.parametrize("guide", GUIDES)
def test_the_commands_of_a_guide_run(guide: str, desk: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(desk)
    monkeypatch.setenv("PATH", str(Path(sys.executable).parent), prepend=os.pathsep)
    lines = commands(guide)
    assert lines
    for line in lines:
        program, *arguments = shlex.split(line)
        if program == "fsid":
            main(arguments)
        else:
            assert program in ("tar", "python")
            subprocess.run(line, shell=True, check=True)


def test_what_the_guides_promise_is_there(desk: Path):
    """Runs after the guides: pytest keeps the order of a file."""
    assert (desk / "scenes.png").exists()
    assert (desk / "denoised.png").exists()
    assert (desk / "results" / "report.html").exists()
    denoised, noisy = read_raw(desk / "denoised.dng"), read_raw(desk / "noisy.dng")
    assert denoised.mosaic.shape == noisy.mosaic.shape
    assert denoised.cfa == noisy.cfa
    assert denoised.iso == pytest.approx(noisy.iso)
    assert denoised.white_balance == pytest.approx(noisy.white_balance, rel=1e-4)
    assert read_raw(desk / "mosaic.dng").cfa == "GBRG"


def test_the_python_of_the_calibration_guide_runs(desk: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(desk)
    run_python("docs/calibrate.md")
    profile, true = load_profile(desk / "arrays.yaml"), load_profile("galaxy-s22")
    assert profile.iso == (800, 3200)
    np.testing.assert_allclose(profile.k[1], true.level(3200).k, rtol=0.1)


def test_the_python_of_the_guide_to_measuring_runs(desk: Path, monkeypatch: pytest.MonkeyPatch):
    """Another program's images are found by name: here they are the truths. Runs after the guides."""
    monkeypatch.chdir(desk)
    testset = read_testset("testset")
    for image, level in product(testset.images, testset.levels):
        target = "theirs" / testset.noisy(Path(), image, level)
        target.parent.mkdir(parents=True, exist_ok=True)
        write_dng(target, read_raw(testset.clean(Path("testset"), image, level)))
    run_python("docs/evaluate.md")
    rows = json.loads((desk / "compared.json").read_text())
    assert {row["model"] for row in rows} == {"noisy", "classical", "mine", "theirs"}
    assert all(row["psnr_raw"] is None or row["psnr_raw"] > 90 for row in rows if row["model"] == "theirs")


def test_the_python_of_the_guide_to_stereo_makes_a_pair_whose_labels_lead_from_one_image_to_the_other(
    desk: Path, monkeypatch: pytest.MonkeyPatch
):
    """Runs after the guides: one of them writes the scene."""
    monkeypatch.chdir(desk)
    page = "docs/stereo-and-labels.md"
    of_frames, of_pairs = blocks(page, "python")
    names = run_python(page, of_frames)
    with np.load("pair.npz") as pair:
        left, right, disparity, visible = (pair[k] for k in ("left", "right", "disparity", "visible"))
    assert 0.6 < visible.mean() < 1
    rows, columns = np.indices(visible.shape)
    there = np.rint(columns - disparity).astype(int).clip(0, visible.shape[1] - 1)
    apart = np.abs(right[rows, there] - left)[visible].mean()
    assert apart < 0.25 * np.abs(right - left)[visible].mean()
    names = run_python(page, of_pairs.replace('"data"', '"many"'), **names)  # has crops
    clean = read_raw(io.BytesIO(read_member(names["shard"], f"{names['key']}.clean.dng")))
    with np.load(f"{names['key']}.labels.npz") as labels:
        assert labels["depth"].shape == labels["object_id"].shape == clean.mosaic.shape
    light, seen = names["frame"].radiance[names["window"]][::2, ::2, 1], pack(clean.mosaic, clean.cfa)[1]
    assert np.corrcoef(np.sqrt(light.ravel()), np.sqrt(seen.clip(0).ravel()))[0, 1] > 0.8


def test_the_python_for_bare_mosaics_makes_captures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    write_captures(tmp_path / "taken")
    for path in sorted(Path("taken").glob("*/*/*.dng")):
        target = ("mosaics" / path.relative_to("taken")).with_suffix(".npy")
        target.parent.mkdir(parents=True, exist_ok=True)
        np.save(target, to_dn(read_raw(path)))
    run_python("docs/capture-a-test-set.md")
    main(["testset", "from-bursts", "captures", "-o", "set", "--camera", "pixel6", "--quiet"])
    first = read_raw("set/star/0.5lux.noisy.dng")
    np.testing.assert_array_equal(to_dn(first), np.load("mosaics/star/0.5lux/0000.npy"))
    assert (first.iso, first.cfa) == (3200, "RGGB")


def test_the_python_of_the_guide_to_clusters_makes_one_dataset_of_two(
    photos: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    for seed in ("0", "1"):
        small = ["--count", "3", "--width", "64", "--height", "64", "--quiet"]
        main(["generate", f"node{seed}", "--seed", seed, "--images", str(photos), *small])
    run_python("docs/cluster.md")
    found = index_mosaics("all")
    assert [m.key for m in found] == [f"{seed}-{i:08d}" for seed in range(2) for i in range(3)]
    assert [m.scene for m in found] == 2 * [0, 1, 2]  # the pictures that both are of


def test_the_guide_to_python_runs_and_makes_what_the_commands_make(
    photos: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(photos, tmp_path / "photographs")
    found = run_python("docs/python.md", __name__="__main__")
    frame, scene = found["frame"], found["scene"]
    assert (frame.object_id == len(scene.objects) - 1).any()  # the mug that was put into the picture
    pairs = found["Pairs"](found["config"], seed=0, count=2)
    np.testing.assert_array_equal(pairs[1][0], pack(found["noisy"].mosaic, found["noisy"].cfa))
    pairs.opened.__exit__(None, None, None)
    assert "mine" in Path("measured/report.html").read_text(encoding="utf-8")
    assert read_raw("grainy.dng").iso == 800


def test_the_readme_names_every_command_and_no_other():
    text = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^\| `fsid ([a-z]+)", text, re.M))
    assert named == set(COMMANDS)


def test_the_readme_says_what_every_extra_adds():
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    text = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    assert [name for name in extras if f"| `.[{name}]` |" not in text] == ["all", "test"]
    assert "fsid[train]" in extras["onnx"]  # whose commands load PyTorch, too


def test_the_python_of_the_readme_runs(desk: Path, monkeypatch: pytest.MonkeyPatch):
    """With the network that ships; runs after the guides, which leave noisy.dng behind."""
    monkeypatch.chdir(desk)
    run_python("README.md")
    clean, noisy = read_raw(desk / "clean.dng"), read_raw(desk / "noisy.dng")
    assert clean.mosaic.shape == noisy.mosaic.shape
    assert np.abs(np.diff(clean.mosaic[::2, ::2])).mean() < np.abs(np.diff(noisy.mosaic[::2, ::2])).mean()
