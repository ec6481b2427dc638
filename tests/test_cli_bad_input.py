"""Bad input to any command: one line that names it, exit code 2, nothing half-written."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from fsid.cli.main import COMMANDS, main
from fsid.errors import FsidError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with files that are not what their names say."""
    (tmp_path / "text.dng").write_text("not a RAW")
    (tmp_path / "text.yaml").write_text("a: [")
    (tmp_path / "wrong.yaml").write_text("no_such_key: 1")
    (tmp_path / "mixed.yaml").write_text("{seed: 1, shard_size: 2, generate: {width: 64}, width: 96}")
    (tmp_path / "part.yaml").write_text("generate: 3")
    (tmp_path / "text.safetensors").write_text("not weights")
    (tmp_path / "empty").mkdir()
    (tmp_path / "zeros.raw").write_bytes(bytes(768 * 512 * 2))  # as long as the RAW of some camera
    (tmp_path / "loop.dng").symlink_to(tmp_path / "loop.dng")
    np.save(tmp_path / "nan.npy", np.full((64, 64), np.nan, np.float32))
    Image.new("L", (64, 64)).save(tmp_path / "gray8.png")
    Image.new("I;16", (64, 64)).save(tmp_path / "gray16.tif")  # LibRaw takes it for a RAW
    return tmp_path


CASES = [
    ("generate {0}/out --count 0", "--count"),
    ("generate {0}/out --count 99999999999999999999", "--count 99999999999999999999: at most 100,000,000"),
    ("generate {0}/out --count 100000001 --dry-run", "--count 100000001: at most 100,000,000"),
    ("generate {0}/out --count 1 --width 33", "width"),
    ("generate {0}/out --count 1 --set no_such_key=1", "no_such_key"),
    ("generate {0}/out --count 1 --set cameras=[nokia]", "nokia"),
    ("generate {0}/out --count 1 --set scene.rig.eyes=2", "scene.rig.eyes"),
    ("generate {0}/out --count 1 --set cameras=[nokia] scene.mesh_folders=[{0}/empty]", "nokia"),
    ("generate {0}/out --count 1 --set scene.mesh_folders=[{0}/chairs]", "chairs"),
    ("preview {0}/out.png --set cameras=[nokia] scene.mesh_folders=[{0}/empty]", "nokia"),
    ("generate {0}/out --count 1 --set scene.mesh_folders={0}/chairs", "is not a list"),
    ("generate {0}/out --count 1 --set scene.hdri_folder={0}/skies", "skies"),
    ("generate {0}/out --count 1 --config {0}/none.yaml", "none.yaml"),
    ("generate {0}/out --count 1 --config {0}/text.yaml", "text.yaml"),
    ("generate {0}/out --count 1 --config {0}/wrong.yaml", "no_such_key"),
    ("generate {0}/out --count 1 --images {0}/empty", "empty"),
    ("generate {0}/text.dng/out --count 1", "text.dng"),
    ("generate {0}/out --count 1 --task deblur --set scene.motion.exposure_s=[0,0]", "take [0.02, 0.12] ins"),
    ("generate {0}/out --count 1 --task deblur --set scene.motion.moving_share=0", "take 0.3 instead"),
    ("generate {0}/out --count 1 --task burst --set scene.motion.frames=1", "take 5 instead of 1"),
    ("generate {0}/out --count 1 --seed -1", "seed -1: must not be negative"),
    *(
        (f"generate {{0}}/out --count 1 --images {{0}} {option}", f"{key}: has no effect on pictures")
        for option, key in (
            ("--variant full", "variant"),
            ("--renderer raster", "renderer"),
            ("--quality high", "quality"),
            ("--set scene.objects=[1,2]", "scene.objects"),
            ("--set checks.duplicate_bits=4", "checks.duplicate_bits"),
        )
    ),
    ("generate {0}/out --count 1 --set scale=2", "scale: has no effect on --task denoise"),
    ("generate {0}/out --count 1 --task deblur --set scale=4", "scale: has no effect on --task deblur"),
    ("generate {0}/out --count 1 --set scene.motion.frames=2", "frames: has no effect on --task denoise"),
    ("generate {0}/out --count 1 --task deblur --set scene.motion.frames=2", "frames: has no effect on"),
    (
        "generate {0}/out --count 1 --task burst --set scene.motion.exposure_s=[0.01,0.2]",
        "scene.motion.exposure_s = (0.01, 0.2): frames of a burst",
    ),
    ("generate {0}/out --count 1 --set scene.motion.moving_share=1", "moving_share: has no effect on"),
    (
        "generate {0}/out --count 1 --renderer reference --quality fast",
        "quality: has no effect on",
    ),
    ("generate {0}/out --only {0}/a.json --count 1", "a.json: the file says all"),
    ("generate {0}/out --only {0}/a.json --seed 0", "a.json: the file says all"),
    ("generate {0}/out --only {0}/a.json --width 64", "a.json: the file says all"),
    *(
        (f"generate {{0}}/out --only {key} {option}", f"{option.split()[0]}: is of a dataset")
        for key, option in (
            ("3", "--count 4"),
            ("3", "--count 1"),
            ("3", "--workers 2"),
            ("3", "--ray local"),
            ("{0}/a.json", "--workers-per-gpu 1"),
        )
    ),
    (
        "generate {0}/out --count 1 --set scene.hdri_share=1",
        "hdri_share: has no effect while scene.hdri",
    ),
    (
        "generate {0}/out --count 1 --variant objects --set scene.placement.size_m=[1,2]",
        "size_m: has no effect on --variant objects",
    ),
    (
        "generate {0}/out --count 1 --task burst --set scene.motion.speed_m_s=[1,2]",
        "speed_m_s: has no effect while scene.motion.moving_share is 0",
    ),
    ("preview {0}/out.png --set iso_range=[800,800]", "iso_range: has no effect on fsid preview"),
    ("scene 3 -o {0}/s.json --set texture_size=256", "texture_size: has no effect on fsid scene"),
    ("scene 3 -o {0}/s.json --set renderer=reference", "renderer: has no effect on fsid scene"),
    ("preview {0}/out.png --seed -1", "seed -1"),
    ("preview {0}/out.png --set scene.objects=5", "fsid: --set: scene.objects: 5 is not a list; write [5,5]"),
    ("generate {0}/out --count 1 --config {0}/mixed.yaml", "mixed.yaml: no such key: width"),
    ("generate {0}/out --count 1 --config {0}/part.yaml --width 64", "part.yaml: seed"),
    ("demo -o {0}/out --seed -1", "seed -1"),
    ("testset photos {0} -o {0}/out --seed -1", "seed -1"),
    ("testset simulate -o {0}/out --seed -1", "seed -1"),
    ("experiment ablation -o {0}/out --seeds 0 -1", "--seeds 0 -1"),
    ("experiment ablation -o {0}/out --seeds 99999999999999999999999", "--seeds 9999"),
    ("train {0}/empty -o {0}/out --set seed=99999999999999999999999", "seed: must be below"),
    ("preview {0}/out.jpg --count 1", "out.jpg"),
    ("preview {0}/out.png --count 0", "--count"),
    ("scene 1 -o {0}/scene.txt", "scene.txt"),
    ("scene 1 -o {0}/scene.json --texture-size 64", "--texture-size"),
    ("scene 1 -o {0}/none/scene.json", "scene.json"),
    ("calibrate -o {0}/out.yaml", "at least one burst"),
    ("calibrate {0}/none.dng -o {0}/out.yaml", "none.dng"),
    ("calibrate {0}/text.dng -o {0}/out.yaml", "text.dng"),
    ("calibrate {0}/nan.npy -o {0}/out.yaml", "nan.npy"),
    ("calibrate {0}/gray8.png -o {0}/out.yaml --black-level 0", "gray8.png"),
    ("calibrate {0}/gray8.png -o {0}/out.yaml --black-level nan", "--black-level: must be numbers"),
    ("calibrate {0}/gray8.png -o {0}/out.yaml --black-level 900 --white-level 255", "gray8.png"),
    ("profiles nokia", "nokia"),
    ("profiles {0}/text.yaml", "text.yaml"),
    ("develop {0}/none.dng {0}/out.png", "none.dng"),
    ("develop {0}/text.dng {0}/out.png", "text.dng"),
    *(
        (f"develop {{0}}/{name} {{0}}/out.png", f"{name}: is a bare mosaic: write it as DNG first, see docs/")
        for name in ("zeros.raw", "nan.npy", "gray8.png", "gray16.tif")
    ),
    ("train {0}/none -o {0}/out", "none"),
    ("train {0}/empty -o {0}/out", "empty"),
    ("train {0}/empty -o {0}/out --set no_such_key=1", "no_such_key"),
    ("denoise {0}/none.dng {0}/out.dng --model {0}/none", "none"),
    ("denoise {0}/text.dng {0}/out.dng --model {0}/text.safetensors", "text.safetensors"),
    ("denoise {0}/empty {0}/out --model {0}/none", "empty"),
    ("denoise {0}/text.dng {0}/loop.dng", "loop.dng"),
    ("denoise {0}/text.dng {0}/out.dng --model {0}/text.safetensors --strength -1", "text.safetensors"),
    ("export {0}/none {0}/out.onnx", "none"),
    ("export {0}/text.safetensors {0}/out.onnx", "text.safetensors"),
    ("export {0}/text.safetensors {0}/out.pth", "out.pth"),
    ("testset photos {0}/empty -o {0}/out", "empty"),
    ("testset photos {0}/none -o {0}/out", "none"),
    ("testset photos {0}/empty -o {0}/out --camera nokia", "nokia"),
    ("evaluate {0}/empty", "testset.json"),
    ("evaluate {0}/empty --model a --model b", "testset.json"),
    ("evaluate {0}/empty --ensemble 2", "--ensemble 2: is for networks"),
    ("generate --cuont 3 {0}/out", "--cuont: fsid generate has no such option; did you mean --count?"),
    ("generate --out {0}/out", "--out: fsid generate has no such option; it is fsid generate OUT"),
    ("denoise {0}/a.dng -o {0}/b.dng", "has no such option; it is fsid denoise INPUT OUTPUT"),
    ("profiles -o {0}/out", "-o: fsid profiles has no such option"),
    ("generate {0}/out --count 1 --set width=64 --set height=64", "--set: is given twice"),
    ("calibrate {0}/gray8.png -o {0}/out.yaml --dark=a --dark b", "--dark: is given twice"),
    ("experiment ablation -o {0}/out --seeds -1 -1 -o {0}/out2", "-o: is given twice"),
    ("inspect {0}/none", "none"),
    ("experiment ablation -o {0}/out --count 0", "--count"),
    ("evaluate {0}/empty --model {0}/none", "empty"),
    ("demo -o {0}/out --photographs 99", "--photographs"),
    ("demo -o {0}/out --width 31", "width"),
    ("demo -o {0}/out --width 320 --height 128", "need 130x130"),
]


@pytest.mark.parametrize(("command", "named"), CASES)
def test_bad_input_is_one_line(
    command: str,
    named: str,
    folder: Path,
    refused: Callable[..., str],
):
    before = sorted(folder.rglob("*"))
    line = refused(*command.format(folder).split())
    assert named in line
    assert "\n" not in line
    assert sorted(folder.rglob("*")) == before


def test_every_command_is_in_the_list_of_cases():
    covered = {command.split()[0] for command, _ in CASES}
    assert covered == set(COMMANDS) - {"doctor"}, "doctor takes no input"


def test_the_doctor_shows_what_it_found_before_it_fails(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    def no_renderer(**_: object) -> None:
        raise FsidError("no headless OpenGL here")

    monkeypatch.setattr("fsid.evaluate.doctor.Renderer", no_renderer)
    with pytest.raises(SystemExit) as stop:
        main(["doctor"])
    assert stop.value.code == 2
    printed = capsys.readouterr()
    assert "LibRaw" in printed.out
    assert printed.err.strip() == "fsid: no headless OpenGL here"


@pytest.mark.parametrize("command", [*COMMANDS, ""])
def test_help_says_what_a_command_does(command: str, capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit) as stop:
        main([*command.split(), "--help"])
    assert stop.value.code == 0
    words = " ".join(re.sub("[│•]", " ", capsys.readouterr().out).split())
    for name in [command] if command else COMMANDS:
        summary = (inspect.getdoc(COMMANDS[name]) or "").partition("\n")[0]
        assert summary
        assert summary in words


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_is_described(command: str):
    function = COMMANDS[command]
    for name in inspect.signature(function).parameters:
        assert re.search(rf"^ +{name}: \S", inspect.getdoc(function) or "", re.M), name
