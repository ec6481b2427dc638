"""fsid generate: what it estimates, and one sample again from a key or its JSON."""

from __future__ import annotations

import json
import pickle
import re
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from fsid import __version__
from fsid.assets import mesh_sources, texture_sources
from fsid.assets.survey import KNOWN
from fsid.cli.libraries import read_libraries
from fsid.cli.main import main
from fsid.cli.progress import progress_bar
from fsid.dataset import Workforce, contact_sheet, generate_config, make_only, shard_path, write_shard
from fsid.dataset.estimate import pairs_of_busiest
from fsid.dataset.index import index_mosaics
from fsid.dataset.png import to_uint8
from fsid.dataset.sample import make_sample
from fsid.dataset.shards import read_member, read_samples
from fsid.errors import FsidError
from fsid.scene import SceneConfig
from fsid.sensor import develop
from fsid.yaml_json import read_yaml

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
REPOSITORY = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of five pairs from tiny pictures."""
    folder = tmp_path_factory.mktemp("only")
    (folder / "pictures").mkdir()
    rng = np.random.default_rng(0)
    for i in range(3):
        Image.fromarray(rng.integers(0, 255, (64, 48, 3), np.uint8)).save(folder / "pictures" / f"{i}.png")
    main([*words(folder), "--count", "5"])
    return folder


def words(folder: Path) -> list[str]:
    """The command of the dataset, without its count."""
    size = ["--width", "32", "--height", "32", "--quiet"]
    return ["generate", str(folder / "data"), "--images", str(folder / "pictures"), "--seed", "4", *size]


def loose(folder: Path, key: str) -> dict[str, bytes]:
    return {path.name.partition(".")[2]: path.read_bytes() for path in folder.glob(f"{key}.*")}


def test_only_makes_the_same_bytes_from_a_key_and_from_json(data: Path, tmp_path: Path) -> None:
    stored = read_samples(shard_path(data / "data", 0))["00000003"]
    main([*words(data)[:1], str(data / "data"), "--only", "00000003", "--quiet"])
    assert loose(data / "data", "00000003") == stored
    file = tmp_path / "00000003.json"
    file.write_bytes(stored["json"])
    main(["generate", str(tmp_path / "again"), "--only", str(file), "--quiet"])
    assert loose(tmp_path / "again", "00000003") == stored
    main([*(word.replace("/data", "/elsewhere") for word in words(data)), "--only", "3"])
    assert loose(data / "elsewhere", "00000003") == stored


def test_only_says_that_a_sample_is_not_there_yet(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a mistyped key, nobody would see it; its files are no part of the dataset."""
    out = Path(shutil.copytree(data / "data", tmp_path / "data"))
    for key, words_ in (("00000004", ""), ("00000005", "has sample 00000005 yet")):
        main(["generate", str(out), "--only", key])
        said = capsys.readouterr().err
        assert words_ in said
        assert ("note:" in said) == bool(words_)
    assert len(index_mosaics(out)) == 5
    main([*words(data)[:1], str(out), *words(data)[2:], "--count", "6"])
    assert loose(out, "00000005") == read_samples(shard_path(out, 0))["00000005"]
    main(["generate", str(tmp_path / "fresh"), "--only", "0", "--images", str(data / "pictures")])
    assert "note:" not in capsys.readouterr().err


def test_another_version_of_fsid_is_told_and_the_card_counts_the_pairs_of_each(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its pairs may be of other scenes, and the card credited all of them to it."""
    out = Path(shutil.copytree(data / "data", tmp_path / "data"))
    grow = [*words(data)[:1], str(out), *words(data)[2:], "--count"]
    samples = read_samples(shard_path(out, 0))
    for files in samples.values():
        files["json"] = files["json"].replace(b'"fsid_version": "', b'"fsid_version": "0.0.')
    write_shard(shard_path(out, 0), samples.items())
    made_by = f"0.0.{__version__}"
    main([*grow, "5"])
    assert "note:" not in capsys.readouterr().err  # nothing is to be made
    for arguments in ([*grow, "6", "--dry-run"], [*grow, "6"]):
        main(arguments)
        told = f"note: {out} was begun by fsid {made_by}, this is {__version__}: its pairs may be of other "
        assert capsys.readouterr().err == told + "scenes\n"
    assert f"| version of fsid | {made_by} (5), {__version__} (1) pairs |" in (out / "README.md").read_text()
    for only in ("00000002", str(out / "00000002.json")):
        main(["generate", str(out), "--only", only, "--quiet"])
        (out / "00000002.json").write_bytes(samples["00000002"]["json"])
        assert f"was made by fsid {made_by}, this is {__version__}: its" in capsys.readouterr().err
    monkeypatch.setattr("fsid.cli.generate.__version__", made_by)
    main([*grow, "7"])
    assert "note:" not in capsys.readouterr().err


def test_what_changes_nothing_may_stand_in_a_file(data: Path, tmp_path: Path) -> None:
    """Only single settings are refused: every config.yaml states some that have no effect."""
    (tmp_path / "c.yaml").write_text(f"variant: objects\nscale: 4\nimages: {data / 'pictures'}\n")
    options = ["--count", "1", "--width", "32", "--height", "32", "--quiet"]
    main(["generate", str(tmp_path / "out"), "--config", str(tmp_path / "c.yaml"), *options])
    assert len(index_mosaics(tmp_path / "out")) == 1


def test_the_settings_of_a_dataset_make_it_grow_and_make_another(data: Path, tmp_path: Path) -> None:
    out = Path(shutil.copytree(data / "data", tmp_path / "data"))
    settings = ["--config", str(out / "config.yaml"), "--quiet"]
    before = (out / "config.yaml").read_bytes()
    main(["generate", str(out), "--count", "6", "--seed", "4", *settings])
    assert (out / "config.yaml").read_bytes() == before
    assert len(index_mosaics(out)) == 6
    main(["generate", str(tmp_path / "other"), "--count", "1", *settings, "--set", "noise_levels=2"])
    dataset = read_yaml(tmp_path / "other" / "config.yaml")
    assert (dataset["seed"], dataset["generate"]) == (
        0,
        {**read_yaml(out / "config.yaml")["generate"], "noise_levels": 2},
    )


@pytest.mark.parametrize(
    ("option", "words"), [(["--seed", "5"], "another seed"), (["--width", "64"], "width (32 there, 64 here)")]
)
def test_only_makes_nothing_of_another_dataset(
    data: Path, option: list[str], words: str, refused: Callable[..., str]
) -> None:
    before = sorted(data.rglob("*"))
    assert words in refused("generate", data / "data", "--only", "2", *option)
    assert sorted(data.rglob("*")) == before


def test_a_contact_sheet_shows_the_samples_in_order_made_twice_as_large(photos: Path) -> None:
    """Pixel by pixel, fine texture behind a mosaic is full of false colour."""
    small, large = (
        generate_config(None, [f"width={width}", f"height={height}", f"images={photos}"])
        for width, height in ((64, 48), (128, 96))
    )
    sheet = contact_sheet(small, 0, 3)
    assert sheet.shape == (2 * 48 + 4, 2 * 64 + 4, 3)
    for number, (top, left) in enumerate([(0, 0), (0, 68), (52, 0)]):
        frame = Image.fromarray(to_uint8(develop(make_sample(large, 0, number, None).clean)))
        reduced = np.asarray(frame.reduce(2), np.int16)
        assert np.abs(sheet[top : top + 48, left : left + 64] - reduced).max() <= 1
    assert (sheet[52:, 68:] == 255).all()


def test_a_contact_sheet_has_room_for_upright_photographs(tmp_path: Path) -> None:
    for name, size in (("lying", (96, 64)), ("upright", (64, 96))):
        Image.new("RGB", size, (90, 120, 60)).save(tmp_path / f"{name}.png")
    config = generate_config(None, ["width=96", "height=96", f"images={tmp_path}"])
    sheet = contact_sheet(config, 0, 2)
    assert sheet.shape == (48, 2 * 48 + 4, 3)
    assert [(sheet[:, left : left + 48] < 255).all(2).sum() for left in (0, 52)] == [48 * 32] * 2


def test_meshes_that_are_skipped_are_counted_and_the_first_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "good.obj").write_text(TETRAHEDRON)
    (tmp_path / "junk.ply").write_bytes(b"junk")
    read_libraries(SceneConfig(mesh_folders=(str(tmp_path),)), quiet=False)
    said = capsys.readouterr().err
    assert "reading" in said
    assert re.search(r"1 mesh, 1 skipped, first \S*junk\.ply: \w+", said.replace("\n", " "))
    read_libraries(SceneConfig(mesh_folders=(str(tmp_path),)), quiet=True)
    said = capsys.readouterr().err
    assert said.startswith(f"{tmp_path}: 1 mesh, 1 skipped, first ")
    assert said.count("\n") == 1
    with pytest.raises(FsidError, match="no usable mesh"):
        read_libraries(SceneConfig(mesh_folders=(str(tmp_path / "junk.ply"),)), quiet=True)


def test_texture_sets_are_read_behind_a_bar_before_the_first_pair(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A library of a thousand takes minutes, which passed without a word."""
    Image.new("RGB", (16, 16), (90, 120, 60)).save(tmp_path / "wall_Color.png")
    Image.new("RGB", (16, 16)).save(tmp_path / "wall_Normal.png")
    command = ["--count", "1", "--width", "32", "--height", "32", "--dry-run"]
    settings = f"scene.texture_folders=[{tmp_path}]", "scene.objects=[1,1]"
    main(["generate", str(tmp_path / "out"), *command, "--set", *settings])
    said = " ".join(capsys.readouterr().err.split())
    assert "reading" in said
    assert f"{tmp_path}: 1 texture set, 1 skipped, first {tmp_path}/wall_Normal.png: wall_Normal" in said


def test_panoramas_that_are_skipped_are_counted_and_the_first_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    good = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16 +X 32\n" + bytes([128]) * (16 * 32 * 4)
    (tmp_path / "good.hdr").write_bytes(good)
    (tmp_path / "page.hdr").write_text("<html>404</html>")
    read_libraries(SceneConfig(hdri_folder=str(tmp_path)), quiet=False)
    said = " ".join(capsys.readouterr().err.split())
    assert f"{tmp_path}: 1 panorama, 1 skipped, first {tmp_path}/page.hdr: is no Radiance" in said


def test_pictures_of_formats_that_are_not_read_are_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], refused: Callable[..., str]
) -> None:
    (folder := tmp_path / "photos").mkdir()
    for name in ("a.HEIC", "b.heic", "c.gif", "._d.avif"):
        (folder / name).touch()
    told = "left out are 1 .gif, 2 .heic, which are not read here: save them as .png or .jpg"
    command = ["generate", tmp_path / "out", "--images", folder, "--count", "1", "--quiet"]
    for refusal in (refused(*command), refused("testset", "photos", folder, "-o", tmp_path / "set")):
        assert f"; {told}" in refusal
    noise = np.random.default_rng(0).integers(0, 255, (64, 64, 3), np.uint8)
    Image.fromarray(noise).save(folder / "e.png")
    main([*map(str, command), "--width", "32", "--height", "32"])
    assert capsys.readouterr().err == f"note: {folder}: {told}\n"
    main(["testset", "photos", str(folder), "-o", str(tmp_path / "set"), "--iso", "800", "--quiet"])
    main(["inspect", str(folder), "--quiet"])
    assert capsys.readouterr().err.count(f"note: {folder}: {told}\n") == 2


def test_renders_and_raw_files_beside_photographs_are_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of those in the folder of a dataset nothing is said: loose pairs and its contact sheet lie there."""
    (folder := tmp_path / "photos").mkdir()
    noise = np.random.default_rng(0).integers(0, 255, (64, 64, 3), np.uint8)
    Image.fromarray(noise).save(folder / "a.png")
    channels = {name: np.float32(noise[..., i] / 255) for i, name in enumerate("RGB")}
    OpenEXR.File({"type": OpenEXR.scanlineimage}, channels).write(str(folder / "b.exr"))
    for name in ("c.NEF", "d.dng", "e.txt"):
        (folder / name).touch()
    size, read = ["--width", "32", "--height", "32", "--quiet"], "not read here: save them as .png or .jpg"
    main(["testset", "photos", str(folder), "-o", str(tmp_path / "set"), "--iso", "800", "--quiet"])
    assert (
        f"note: {folder}: left out are 1 .dng, 1 .exr, 1 .nef, which are {read}\n" == capsys.readouterr().err
    )
    out = tmp_path / "data"
    main(["generate", str(out), "--images", str(folder), "--count", "2", *size])
    assert f"note: {folder}: left out are 1 .dng, 1 .nef, which are {read}\n" == capsys.readouterr().err
    main(["generate", str(out), "--only", "0", "--quiet"])
    main(["inspect", str(out), "--quiet"])
    assert "left out" not in capsys.readouterr().err


def test_folders_are_surveyed_once_and_workers_are_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every file was read and hashed again by the sampler, and by each new worker."""
    Image.new("RGB", (16, 16), (90, 120, 60)).save(tmp_path / "wall_Color.png")
    (tmp_path / "cube.obj").write_text(TETRAHEDRON)
    folder = str(tmp_path)
    read_libraries(SceneConfig(mesh_folders=(folder,), texture_folders=(folder,)), quiet=True)
    make_worker = pickle.dumps(Workforce().crew(1)._make_work)
    for module in ("textures", "sources.library"):
        monkeypatch.setattr(f"fsid.assets.{module}._survey", None)
    for _ in range(2):
        assert texture_sources(folder) == (f"file:{tmp_path}/wall",)
        assert mesh_sources(folder) == (f"file:{tmp_path}/cube.obj",)
        KNOWN.clear()
        pickle.loads(make_worker)(None)  # as in a new process


@pytest.mark.parametrize(
    ("lie", "named"),
    [
        *(({"index": value}, "index") for value in (-1, 1.5, "x", None)),
        *(({"seed": value}, "seed") for value in (-1, 1.5, "x", None)),
        ({"settings": None}, "settings"),
        ({"settings": {"seed": 3}}, "settings"),
        ({"refused": 3}, "JSON of a sample"),
        ({"scene": {}}, "scene"),
        (None, "JSON"),
    ],
    ids=str,
)
def test_a_record_that_lies_is_named(data: Path, lie: dict | None, named: str, tmp_path: Path) -> None:
    record = json.loads(read_samples(shard_path(data / "data", 0))["00000003"]["json"])
    file = tmp_path / "lie.json"
    file.write_text("[" * 200_000 if lie is None else json.dumps(record | lie))
    with pytest.raises(FsidError, match=rf"lie\.json: .*{named}"):
        make_only(tmp_path / "out", str(file), None, 0)
    assert not list((tmp_path / "out").iterdir())


@pytest.mark.parametrize("record", [b"{}", b"null", b"[" * 200_000])
def test_a_shard_whose_record_is_none_is_named(data: Path, record: bytes, tmp_path: Path) -> None:
    shutil.copy(data / "data" / "config.yaml", tmp_path)
    write_shard(shard_path(tmp_path, 0), [("00000001", {"json": record})])
    with pytest.raises(FsidError, match=r"shard-00000\.tar"):
        make_only(tmp_path, "00000001", None, None)


@pytest.mark.parametrize(
    ("only", "named"),
    [
        ("cat", "cat"),
        ("9" * 5000, "999"),
        ("missing.json", "missing.json"),
        ("broken.json", "broken.json"),
        ("list.json", "JSON"),
        ("3 --seed -1", "seed -1"),
        ("3 --images nowhere", "nowhere"),
        ("3 --dry-run", "--dry-run"),
    ],
)
def test_only_names_what_is_wrong(
    only: str, named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, refused: Callable[..., str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("broken.json").write_text("{")
    Path("list.json").write_text("[]")
    assert named in refused("generate", "out", "--only", *only.split())
    assert not list(tmp_path.glob("out/*"))


def test_a_dry_run_estimates_and_writes_nothing(data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main([*words(data)[:-1], "--count", "5", "--dry-run"])
    before = sorted(path.name for path in (data / "data").iterdir())
    main([*words(data)[:-1], "--count", "165", "--dry-run", "--workers", "2"])
    assert sorted(path.name for path in (data / "data").iterdir()) == before
    text = capsys.readouterr().out
    assert "160 pairs in 11 shards; 5 more are there" in text
    per_pair_mb = [float(mb) for mb in re.findall(r"([\d.e+-]+) MB per pair", text)]
    assert re.search(r"time   0 h \d\d min with 2 workers \([\d.e-]+ s per pair\)", text)
    stored_mb = shard_path(data / "data", 0).stat().st_size / 5e6
    assert per_pair_mb == pytest.approx([stored_mb], rel=0.2)
    assert "has 5 pairs already" in text


def test_a_dry_run_is_of_what_the_run_would_do(data: Path, tmp_path: Path, capsys, refused) -> None:
    for name in ("shard-00000.tar", "config.yaml"):
        shutil.copy(data / "data" / name, tmp_path / name)
    samples = read_samples(tmp_path / "shard-00000.tar")
    whole = [(f"{index:08d}", samples["00000000"]) for index in range(16)]
    write_shard(tmp_path / "shard-00000.tar", whole)
    command = [words(data)[0], str(tmp_path), *words(data)[2:], "--count", "20", "--dry-run"]
    main([*command, "--workers", "1000"])
    told = capsys.readouterr().out
    assert "4 pairs in 1 shard; 16 more are there" in told
    assert "with 1 worker (" in told
    of_another_seed = ["5" if word == "4" else word for word in command]
    assert "already holds another dataset" in refused(*of_another_seed)


def test_progress_shows_rate_time_left_and_failures(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar("pairs", "pairs", quiet=False) as progress:
        for done in (0, 2, 4):
            progress(done, 8)
            time.sleep(0.01)
        for line in ("worker 1 died", "worker 0 died"):
            progress.failed(line)
        progress._bar.refresh()
        task = progress._bar.tasks[0]
        cells = [column(task) for column in progress._bar.columns]
    shown = " ".join(getattr(cell, "plain", str(cell)) for cell in cells)
    assert "4/8" in shown
    assert "2 failures" in shown
    assert re.search(r"\d pairs/s", shown)
    assert re.search(r"\d:\d\d", shown)
    assert "worker 1 died" in capsys.readouterr().err


def test_a_failure_is_said_where_progress_is_not(capsys: pytest.CaptureFixture[str]) -> None:
    with progress_bar("pairs", "pairs", quiet=True) as progress:
        progress(1, 8)
        progress.failed("worker 1 died")
    assert capsys.readouterr().err == "worker 1 died\n"


@pytest.mark.parametrize("name", ["photos #1", "2024", "photos: a"])
def test_a_folder_of_pictures_is_taken_as_typed(
    data: Path, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(data / "pictures", name)
    size = ["--width", "32", "--height", "32"]
    main(["generate", "out", "--count", "1", "--images", name, *size, "--quiet"])
    assert read_yaml(Path("out/config.yaml"))["generate"]["images"] == name


def test_a_count_is_needed(tmp_path: Path, refused: Callable[..., str]) -> None:
    assert "--count" in refused("generate", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_gpus_that_are_not_there_are_missed_before_anything_is_written(
    tmp_path: Path, refused: Callable[..., str]
) -> None:
    assert "GPU 998 is needed" in refused(
        "generate", tmp_path / "out", "--count", "1", "--workers", "999", "--workers-per-gpu", "1"
    )
    assert not (tmp_path / "out").exists()


def test_the_papers_configuration_is_found_by_name_and_by_path() -> None:
    config = generate_config("fsid-175k")
    assert (config.width, config.height, config.variant) == (1920, 1080, "full")
    assert generate_config(REPOSITORY / "configs" / "fsid-175k.yaml") == config


def test_a_place_that_takes_no_picture_is_said_before_scenes_are_rendered(
    tmp_path: Path, refused: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError("rendered what cannot be written")

    monkeypatch.setattr("fsid.dataset.contact_sheet", never)
    (tmp_path / "folder.png").mkdir()
    assert "it is no file" in refused("preview", tmp_path / "folder.png", "--quiet")
    monkeypatch.setattr("fsid.files.os.access", lambda *_: False)
    assert "no folder that you may write to" in refused("preview", tmp_path / "new.png", "--quiet")


def test_pictures_that_a_larger_count_adds_are_decoded_before_anything_is_written(
    photos: Path, tmp_path: Path, refused
) -> None:
    album, out = shutil.copytree(photos, tmp_path / "album"), tmp_path / "out"
    for name in ("coffee-1.png", "coffee-2.png"):
        (album / name).write_bytes((album / name).read_bytes()[:2000])
    command = ["generate", str(out), "--images", str(album), "--width", "64", "--height", "48", "--quiet"]
    main([*command, "--count", "1"])
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    told = refused(*command, "--count", "3")
    assert "coffee-1.png" in told
    assert "coffee-2.png" in told
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    main([*command, "--count", "1"])


def test_one_sample_of_a_dataset_whose_pictures_have_moved(photos: Path, tmp_path: Path, refused) -> None:
    album, moved, out = shutil.copytree(photos, tmp_path / "album"), tmp_path / "moved", tmp_path / "out"
    command = ["generate", str(out), "--width", "64", "--height", "48", "--quiet", "--images"]
    main([*command, str(album), "--count", "1"])
    stored = read_member(shard_path(out, 0), "00000000.noisy.dng")
    album.rename(moved)
    for key in ("00000000", "00000002"):  # in a shard, and not yet
        assert "album" in refused(*command[:2], "--only", key)
        main([*command, str(moved), "--only", key])
    assert (out / "00000000.noisy.dng").read_bytes() == stored
    wider = [*command[:2], "--images", moved, "--width", "80", "--only", "00000000"]
    assert "width (64 there, 80 here)" in refused(*wider)


@pytest.mark.parametrize(
    ("count", "shards", "workers", "busiest"),
    [
        (17, 2, 2, 16),
        (48, 3, 2, 32),
        (1040, 65, 64, 32),
        (5, 5, 2, 3),
        (175_000, 10_938, 4, 43_760),
        (7, 1, 1, 7),
    ],
)
def test_the_busiest_worker_makes_whole_shards(count: int, shards: int, workers: int, busiest: int) -> None:
    assert pairs_of_busiest(count, shards, workers, 16) == busiest
