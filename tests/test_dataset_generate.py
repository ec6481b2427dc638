"""A dataset is a function of (settings, seed): not of workers, order or interruptions."""

from __future__ import annotations

import hashlib
import io
import json
import os
import shutil
import subprocess
import sys
import tarfile
import weakref
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rawpy
import webdataset
import yaml
from PIL import Image

from fsid.assets.survey import KNOWN
from fsid.cli.main import main
from fsid.config import load_settings
from fsid.dataset import (
    GenerateConfig,
    attempt,
    dataset_config,
    encode,
    find_pictures,
    generate,
    make_frame,
    make_only,
    make_sample,
    pairs_to_make,
    read_member,
    shard_keys,
    shard_path,
    write_shard,
)
from fsid.dataset.attempt import Attempt
from fsid.dataset.generate import _Shard
from fsid.dataset.near_duplicates import settle
from fsid.dataset.sample import Sample
from fsid.dataset.shards import find_shards, read_samples
from fsid.dataset.worker import Worker
from fsid.errors import FsidError
from fsid.sensor import NoiseTerms, load_profile, read_raw, save_profile
from fsid.sensor.light import LONGEST_EXPOSURE_S
from fsid.yaml_json import read_yaml

SMALL = ["width=128", "height=96"]


def small(*overrides: str) -> GenerateConfig:
    return load_settings(GenerateConfig, None, [*SMALL, *overrides])


def digests(folder: Path) -> dict[str, str]:
    """Digest of every file of every sample, whatever shard it is in."""
    return {
        f"{key}.{extension}": hashlib.sha256(read_member(shard, f"{key}.{extension}")).hexdigest()
        for shard in sorted(folder.glob("shard-*.tar"))
        for key in shard_keys(shard)
        for extension in ("clean.dng", "noisy.dng", "rgb.png", "json")
    }


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scenes")
    generate(folder, small(), count=4, seed=7, workers=1, shard_size=2)
    return folder


def test_workers_and_shard_size_do_not_change_a_sample(scenes: Path, tmp_path: Path):
    generate(tmp_path, small(), count=4, seed=7, workers=2, shard_size=3)
    assert digests(tmp_path) == digests(scenes)
    assert len(digests(tmp_path)) == 16


def test_a_lost_shard_comes_back_byte_for_byte(scenes: Path):
    before = [shard.read_bytes() for shard in sorted(scenes.glob("shard-*.tar"))]
    shard_path(scenes, 1).unlink()
    assert generate(scenes, small(), count=4, seed=7, shard_size=2) == 2
    assert [shard.read_bytes() for shard in sorted(scenes.glob("shard-*.tar"))] == before
    assert generate(scenes, small(), count=4, seed=7, shard_size=2) == 0


def test_a_shard_that_was_cut_between_two_files_is_made_again(photos: Path, tmp_path: Path):
    """By a copy that was stopped: a tar without its end is read like one with it."""
    config, path = small("width=64", "height=48", f"images={photos}"), shard_path(tmp_path, 1)
    generate(tmp_path, config, count=4, shard_size=2)
    whole = path.read_bytes()
    with tarfile.open(path) as tar:
        (end,) = (member.offset for member in tar if member.name == "00000003.json")
    path.write_bytes(whole[:end])
    assert generate(tmp_path, config, count=4, shard_size=2) == 1
    assert path.read_bytes() == whole


def test_a_frame_is_let_go_before_the_next_is_made(photos: Path, tmp_path: Path, monkeypatch):
    """A frame of full HD and its files would take 30 MB while the next one is rendered."""
    made: list[weakref.ref[Sample]] = []

    def frame_alone(*arguments) -> list[Sample]:
        assert all(sample() is None for sample in made)
        samples = make_frame(*arguments)
        made.extend(map(weakref.ref, samples))
        return samples

    monkeypatch.setattr(sys.modules[_Shard.__module__], "make_frame", frame_alone)
    config = small("width=64", "height=48", f"images={photos}")
    _Shard(shard_path(tmp_path, 0), 0, range(3), dataset_config(config, 0, 3)).do(Worker(None, {}))
    assert len(made) == 3


def test_a_larger_count_keeps_the_whole_frames_of_a_shard_that_was_not_full(photos: Path, tmp_path: Path):
    config = small("width=64", "height=48", "crops=3", "crop_width=32", "crop_height=32", f"images={photos}")
    generate(tmp_path / "at-once", config, count=8, shard_size=9)
    generate(tmp_path / "grown", config, count=5, shard_size=9)
    path, mark = shard_path(tmp_path / "grown", 0), {"mark.txt": b"kept"}
    write_shard(path, [(key, mark | files) for key, files in read_samples(path).items()])
    assert pairs_to_make(tmp_path / "grown", dataset_config(config, 0, 9), 8) == (5, 1)
    assert generate(tmp_path / "grown", config, count=8, shard_size=9) == 5
    expected = read_samples(shard_path(tmp_path / "at-once", 0))
    for key in ("00000000", "00000001", "00000002"):  # of the second frame there were two pairs of three
        expected[key] |= mark
    assert read_samples(path) == expected


def test_a_smaller_count_in_between_leaves_nothing_unfinished(photos: Path, tmp_path: Path):
    """Of a run that was killed before near-duplicates were settled and its card was written."""
    config = small("width=64", "height=48", f"images={photos}")
    generate(tmp_path, config, count=6, shard_size=2)
    card = (tmp_path / "README.md").read_text()
    assert "6 pairs for denoise" in card
    assert "`k` and `sigma2` of its JSON, of R, Gr (in rows with R), Gb and B" in card
    (tmp_path / "README.md").unlink()
    for count in (2, 6):
        assert generate(tmp_path, config, count=count, shard_size=2) == 0
    assert (tmp_path / "README.md").read_text() == card
    shard_path(tmp_path, 1).unlink()
    (tmp_path / "README.md").unlink()
    assert generate(tmp_path, config, count=6, shard_size=2) == 2
    assert (tmp_path / "README.md").read_text() == card


@pytest.mark.parametrize(("count", "gap"), [(1, 1), (2, 1), (3, 2), (4, 2)])
def test_a_smaller_count_leaves_no_shards_beyond_a_gap(photos: Path, tmp_path: Path, count: int, gap: int):
    """Workers of a larger run that was killed had made them: the card did not count what all readers take."""
    config = small("width=64", "height=48", f"images={photos}")
    generate(tmp_path, config, count=8, shard_size=2)
    shard_path(tmp_path, gap).unlink()
    (tmp_path / "README.md").unlink()
    before = sorted(tmp_path.iterdir())
    told = rf"{4 - gap - 1} shards? from shard-0000{gap + 1}\.tar on would lie beyond a gap"
    with pytest.raises(FsidError, match=told):
        generate(tmp_path, config, count=count, shard_size=2)
    with pytest.raises(FsidError, match=told):
        pairs_to_make(tmp_path, dataset_config(config, 0, 2), count)
    assert sorted(tmp_path.iterdir()) == before
    assert generate(tmp_path, config, count=2 * gap + 2, shard_size=2) == 2  # which closes it
    assert "8 pairs for denoise" in (tmp_path / "README.md").read_text()


def test_a_shard_that_is_not_full_is_a_gap(photos: Path, tmp_path: Path):
    config = small("width=64", "height=48", f"images={photos}")
    generate(tmp_path / "some", config, count=3, shard_size=2)
    generate(tmp_path / "more", config, count=6, shard_size=2)
    shutil.copy(shard_path(tmp_path / "more", 2), tmp_path / "some")
    with pytest.raises(FsidError, match=r"1 shard from shard-00002\.tar on would lie beyond a gap"):
        generate(tmp_path / "some", config, count=3, shard_size=2)
    assert generate(tmp_path / "some", config, count=4, shard_size=2) == 1
    assert "6 pairs for denoise" in (tmp_path / "some" / "README.md").read_text()


def test_what_is_read_again_at_the_end_has_progress(photos: Path, scenes: Path, tmp_path: Path):
    """At 175,000 pairs that takes minutes. Pictures may look alike, so their shards are read once."""
    told: list[tuple[int, int]] = []
    config = small("width=64", "height=48", f"images={photos}")
    generate(tmp_path, config, count=6, shard_size=2, finishing=lambda *now: told.append(now))
    assert told == [(4, 6), (5, 6), (6, 6)]
    shards = find_shards(scenes)
    read: list[int] = []
    settle(shards, small(), 0, lambda task: pytest.fail(f"{task} is settled already"), read.append)
    assert read == list(range(1, len(shards) + 1))


def test_looking_at_what_is_there_has_progress(photos: Path, tmp_path: Path):
    """It takes half a minute where there are many shards, and ended in a bar that was full at once."""
    told: list[tuple[int, int]] = []
    config = small("width=64", "height=48", f"images={photos}")
    for shards in (0, 2):
        generate(tmp_path, config, count=4, shard_size=2, looking=lambda *now: told.append(now))
        assert told == [(number + 1, 2) for number in range(shards)]
    assert pairs_to_make(tmp_path, dataset_config(config, 0, 2), 4, lambda *now: told.append(now)) == (0, 0)
    assert told == [(1, 2), (2, 2)] * 2


def test_another_seed_gives_other_pictures(photos: Path, tmp_path: Path):
    made = []
    for seed in (7, 8):
        generate(tmp_path / f"{seed}", small(f"images={photos}"), count=1, seed=seed)
        made.append(read_member(shard_path(tmp_path / f"{seed}", 0), "00000000.rgb.png"))
    assert made[0] != made[1]
    assert Attempt(small(), 7, 0).drawn_scene() != Attempt(small(), 8, 0).drawn_scene()


def test_another_configuration_in_the_same_folder_is_refused(scenes: Path):
    with pytest.raises(FsidError, match=r"generate\.width \(128 there, 160 here\)"):
        generate(scenes, small("width=160"), count=4, seed=7, shard_size=2)
    with pytest.raises(FsidError, match=r"seed \(7 there, 9 here\)"):
        generate(scenes, small(), count=4, seed=9, shard_size=2)


def test_a_subject_before_a_black_backdrop_stops_no_run(tmp_path: Path):
    pictures, data = tmp_path / "pictures", tmp_path / "data"
    pictures.mkdir()
    picture = Image.new("RGB", (64, 64))
    picture.paste((200, 120, 60), (24, 24, 40, 40))
    picture.save(pictures / "a.png")
    generate(data, small("width=64", "height=64", f"images={pictures}"), count=1)
    record = json.loads(read_member(shard_path(data, 0), "00000000.json"))
    assert record["refused"] == ["black"] * 3


def test_the_corrected_command_goes_into_the_folder_of_the_one_that_failed(photos: Path, tmp_path: Path):
    tiny, night, data = ("width=32", "height=32"), tmp_path / "night", tmp_path / "data"
    night.mkdir()
    Image.new("RGB", (64, 64)).save(night / "dark.png")
    with pytest.raises(FsidError, match=r"frame 0 \(.*night/dark\.png\): 8 attempts were refused \(black"):
        generate(data, small(*tiny, f"images={night}"), count=1)
    assert generate(data, small(*tiny, f"images={photos}"), count=1) == 1
    assert read_yaml(data / "config.yaml")["generate"]["images"] == str(photos)
    shard_path(data, 0).unlink()
    (data / "00000000.clean.dng").touch()
    with pytest.raises(FsidError, match=r"generate\.images"):
        generate(data, small(*tiny, f"images={night}"), count=1)


def test_settings_of_something_else_are_not_replaced(photos: Path, tmp_path: Path):
    (tmp_path / "config.yaml").write_text("steps: 30\n")
    with pytest.raises(FsidError, match=r"config\.yaml: seed"):
        generate(tmp_path, small(f"images={photos}"), count=1)
    assert (tmp_path / "config.yaml").read_text() == "steps: 30\n"


@pytest.mark.parametrize("name", ["README.md", "samples.png"])
def test_files_of_something_else_are_not_replaced(photos: Path, tmp_path: Path, name: str):
    """OUT may be the folder of a project, as with `fsid generate .`"""
    (tmp_path / name).write_text("mine")
    config = small(f"images={photos}")
    for make in (generate, lambda out, config, count: pairs_to_make(out, dataset_config(config, 0), count)):
        with pytest.raises(FsidError, match=f"holds another {name}, which the dataset's would replace"):
            make(tmp_path, config, count=1)
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {name: "mine"}


def test_a_card_that_was_edited_is_kept(photos: Path, tmp_path: Path):
    config, card = small(f"images={photos}"), tmp_path / "README.md"
    generate(tmp_path, config, count=1)
    card.write_text("mine\n" + card.read_text())
    before = card.read_text()
    assert generate(tmp_path, config, count=1) == 0
    with pytest.raises(FsidError, match="holds another README"):
        generate(tmp_path, config, count=2)
    assert card.read_text() == before


@pytest.mark.parametrize(
    ("key", "value"),
    [("split", None), ("frame", {}), ("iso", "x"), ("refused", 5), ("scene", {"objects": 1})],
)
def test_a_record_of_something_else_is_named(photos: Path, tmp_path: Path, key: str, value: object):
    """A dataset that goes on here may be from anywhere; None: without the key."""
    config = small(f"images={photos}")
    generate(tmp_path, config, count=1)
    shard = shard_path(tmp_path, 0)
    samples = read_samples(shard)
    for files in samples.values():
        record = json.loads(files["json"]) | {key: value}
        files["json"] = json.dumps({k: v for k, v in record.items() if v is not None}).encode()
    write_shard(shard, samples.items())
    (tmp_path / "README.md").unlink()
    with pytest.raises(FsidError, match=r"shard-00000\.tar: .* generate again"):
        generate(tmp_path, config, count=1)
    assert not (tmp_path / "README.md").exists()


def test_a_dataset_is_not_made_among_its_pictures(album: Path):
    """Its contact sheet would be a picture of the next run."""
    before = sorted(album.iterdir())
    (album.parent / "link").symlink_to(album)
    with pytest.raises(FsidError, match="link: is the folder of the pictures"):
        generate(album.parent / "link", small(f"images={album}"), count=1)
    assert sorted(album.iterdir()) == before


def test_a_sample_of_numpys_numbers_is_that_of_pythons(photos: Path):
    config = small("width=64", "height=64", f"images={photos}")
    made = encode(make_sample(config, 3, 2, None))
    assert encode(make_sample(config, np.int64(3), np.uint8(2), None)) == made
    assert encode(make_frame(config, np.int64(3), np.int32(2), None)[0]) == made


def test_there_is_no_sample_before_the_first():
    with pytest.raises(FsidError, match="index -1: must not be negative"):
        make_sample(small(), 0, -1, None)
    with pytest.raises(FsidError, match="seed -1: must not be negative"):
        make_sample(small(), -1, 0, None)
    with pytest.raises(FsidError, match="frame -1: must not be negative"):
        make_frame(small(), 0, -1, None)


def test_a_pair_opens_in_libraw_and_differs_by_its_stated_noise(scenes: Path):
    shard = shard_path(scenes, 0)
    record = json.loads(read_member(shard, "00000000.json"))
    mosaics = {}
    for name in ("clean", "noisy"):
        with rawpy.imread(io.BytesIO(read_member(shard, f"00000000.{name}.dng"))) as raw:
            black, white = raw.black_level_per_channel[0], raw.white_level
            mosaics[name] = (raw.raw_image.astype(np.float64) - black) / (white - black)
    clean, noisy = mosaics["clean"], mosaics["noisy"]
    assert clean.shape == (96, 128)
    k, sigma2 = np.mean(record["k"]), np.mean(record["sigma2"])
    unclipped = clean < 0.5
    expected = np.mean(k * clean[unclipped] + sigma2)
    assert np.var((noisy - clean)[unclipped]) == pytest.approx(expected, rel=0.15)


def test_webdataset_reads_the_shards(scenes: Path):
    samples = list(webdataset.WebDataset([str(shard_path(scenes, 0))], shardshuffle=False))
    assert [sample["__key__"] for sample in samples] == ["00000000", "00000001"]
    assert {"clean.dng", "noisy.dng", "rgb.png", "json"} <= samples[0].keys()


def test_photographs_go_through_the_same_chain(photos: Path, tmp_path: Path):
    config = small(f"images={photos}")
    generate(tmp_path / "one", config, count=5, seed=1, workers=1)
    generate(tmp_path / "two", config, count=5, seed=1, workers=2, shard_size=2)
    assert digests(tmp_path / "one") == digests(tmp_path / "two")
    record = json.loads(read_member(shard_path(tmp_path / "one", 0), "00000004.json"))
    assert record["image"] == "coffee-1.png"


def with_terms(file: Path, terms: NoiseTerms) -> str:
    save_profile(file, replace(load_profile("pixel6"), terms=terms))
    return f"cameras=[{file}]"


def test_every_frame_is_of_another_specimen_of_the_camera(photos: Path, tmp_path: Path):
    cameras = with_terms(tmp_path / "broken.yaml", NoiseTerms(defective=0.05))
    config = small(f"images={photos}", cameras, "noise_levels=2")
    samples = [make_sample(config, 0, i, None) for i in range(4)]
    units = [sample.record["unit"] for sample in samples]
    assert units[0] == units[1] != units[2] == units[3]
    for one, two in (samples[:2], samples[2:]):
        broken = np.random.default_rng([one.record["unit"], 2]).random((96, 128), np.float32) < 0.05
        assert np.array_equal(one.noisy.mosaic[broken], two.noisy.mosaic[broken])
        assert np.mean(one.noisy.mosaic[~broken] == two.noisy.mosaic[~broken]) < 0.2


def test_dark_current_flows_for_the_longest_exposure(photos: Path, tmp_path: Path):
    dark = with_terms(tmp_path / "dark.yaml", NoiseTerms(dark_current_e_s=1000.0))
    sample, without = (
        make_sample(small(f"images={photos}", cameras), 0, 0, None) for cameras in (dark, "cameras=[pixel6]")
    )
    assert sample.record["exposure_s"] == LONGEST_EXPOSURE_S
    assert not {"exposure_s", "unit"} & without.record.keys()
    brighter = np.mean(sample.noisy.mosaic - without.noisy.mosaic)
    assert brighter == pytest.approx(100 * np.mean(sample.record["k"]), rel=0.05)


def test_noise_without_rounding_is_not_rounded_by_its_file(photos: Path, tmp_path: Path):
    """The file rounded it to the camera's DN: the dark of low ISO had 1.4 times the stated variance."""
    cameras = with_terms(tmp_path / "fine.yaml", NoiseTerms(quantisation=False))
    sample = make_sample(small(f"images={photos}", cameras), 0, 0, None)
    stored = read_raw(io.BytesIO(encode(sample)["noisy.dng"]))
    assert (stored.black_level, stored.white_level) == (64 * 64, 64 * 1023)
    assert sample.record["white_level"] == stored.white_level
    inside = (sample.noisy.mosaic > -64 / 959) & (sample.noisy.mosaic < 1)
    np.testing.assert_allclose(stored.mosaic[inside], sample.noisy.mosaic[inside], rtol=0, atol=0.51 / 61376)


def test_photographs_are_the_same_data_whatever_scenes_would_be(photos: Path, tmp_path: Path):
    """So data made before the defaults of scenes changed is gone on with."""
    generate(tmp_path, small(f"images={photos}", "scene.objects=[3, 4]", "variant=objects"), count=1)
    assert generate(tmp_path, small(f"images={photos}"), count=2) == 1
    with pytest.raises(FsidError, match=r"generate\.iso_range"):
        generate(tmp_path, small(f"images={photos}", "iso_range=[100, 200]"), count=2)


@pytest.mark.parametrize(
    ("override", "named"),
    [
        ("width=127", "width"),
        ("height=0", "height"),
        ("height=16386", "height"),
        ("variant=all", "variant"),
        ("iso_range=[800, 100]", "iso_range"),
        ("iso_range=[1, .inf]", "iso_range"),
        ("iso_range=[1, 1e300]", "iso_range"),
        ("iso_range=[.nan, 2]", "iso_range"),
        ("cameras=[]", "cameras"),
        ("supersampling=9", "supersampling"),
        ("texture_size=1000", "texture_size"),
        ("scene.no_such_key=1", "no_such_key"),
    ],
)
def test_a_bad_setting_is_named(override: str, named: str):
    with pytest.raises(FsidError, match=named):
        small(override)


def test_an_unknown_camera_is_named_before_anything_is_written(tmp_path: Path):
    with pytest.raises(FsidError, match="nokia3310"):
        generate(tmp_path / "out", small("cameras=[nokia3310]"), count=1)
    assert not (tmp_path / "out").exists()


def test_an_iso_of_more_noise_than_light_is_named_before_anything_is_written(photos: Path, tmp_path: Path):
    """The run ended at the first pair that drew one, and neither the setting nor the camera was named."""
    config = small(f"images={photos}", "cameras=[pixel6]", "iso_range=[400,1e6]")
    with pytest.raises(FsidError, match=r"^iso_range: profile pixel6: ISO .* is too high"):
        generate(tmp_path / "out", config, count=1)
    assert not (tmp_path / "out").exists()
    dataset_config(small("iso_range=[400,1e5]"), 0)


def test_a_renderer_that_is_not_installed_is_named_before_anything_is_written(tmp_path: Path):
    """From a worker it came as a traceback."""
    (tmp_path / "mitsuba.py").write_text("raise ModuleNotFoundError(name='mitsuba')")
    paths = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    options = ["--count", "1", "--width", "32", "--height", "32", "--renderer", "reference"]
    ended = subprocess.run(
        [sys.executable, "-m", "fsid", "generate", str(tmp_path / "out"), *options],
        env={**os.environ, "PYTHONPATH": paths},
        capture_output=True,
        text=True,
    )
    told = "fsid: this command needs mitsuba, which is not installed: pip install 'fsid[reference]'\n"
    assert (ended.returncode, ended.stderr) == (2, told)
    assert not (tmp_path / "out").exists()


def test_a_folder_without_skies_is_named_before_anything_is_written(tmp_path: Path):
    """Not at the first scene in open air, which may be the thousandth."""
    skies = tmp_path / "skies"
    skies.mkdir()
    with pytest.raises(FsidError, match="holds no panorama"):
        generate(tmp_path / "out", small(f"scene.hdri_folder={skies}"), count=1)
    assert not (tmp_path / "out").exists()
    dataset_config(small(f"scene.hdri_folder={skies}", "scene.background.kind_shares=[1,0,0,0]"), 0)


@pytest.mark.parametrize(
    "overrides",
    [
        ("crops=2", "crop_width=126"),
        ("crops=2", "checks.duplicate_bits=-1"),
        ("crops=2", "task=super-resolution", "scale=4", "crop_height=88"),
    ],
)
def test_crops_may_be_as_many_as_there_are_windows(overrides: tuple[str, ...]):
    assert dataset_config(small(*overrides), 0).generate.crops == 2


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (("scale=4", "crop_width=92"), "crop_width: 92 is no multiple of 8 .*; take 88 or 96$"),
        (("scale=2", "height=94", "crop_height=94"), "crop_height: 94 is no multiple of 4 .*; take 92$"),
    ],
)
def test_a_crop_that_super_resolution_would_make_smaller_is_refused(overrides: tuple[str, ...], message: str):
    small(*(each for each in overrides if not each.startswith("scale")))
    with pytest.raises(FsidError, match=message):
        small("task=super-resolution", *overrides)


def test_more_crops_than_windows_are_named_before_anything_is_written(tmp_path: Path):
    with pytest.raises(FsidError, match="crops: 2"):
        generate(tmp_path / "out", small("crops=2"), count=1)
    assert not (tmp_path / "out").exists()


def test_more_pairs_of_a_frame_than_memory_holds_are_named():
    """All of a frame are made before the first is written."""
    with pytest.raises(FsidError, match=r"noise_levels: 10002 pairs of a frame, .* at most 10000"):
        small("noise_levels=5001", "exposures=2")


@pytest.fixture
def album(photos: Path, tmp_path: Path) -> Path:
    """A folder of three photographs that a test may change."""
    return Path(shutil.copytree(photos, tmp_path / "album"))


def test_a_folder_of_pictures_is_listed_again_where_it_changed(album: Path, monkeypatch: pytest.MonkeyPatch):
    listings = []
    monkeypatch.setattr(attempt, "find_pictures", lambda folder: listings.append(0) or find_pictures(folder))
    config = small(f"images={album}")
    drawn = [Attempt(config, 0, frame).drawn_picture()[1].name for frame in range(4)]
    assert drawn == ["coffee-0.png", "coffee-1.png", "coffee-2.png", "coffee-0.png"]
    assert len(listings) == 1
    (album / "coffee-0.png").unlink()
    os.utime(album, ns=(1, 1))  # a clock may be too coarse to tell
    assert Attempt(config, 0, 0).drawn_picture()[1].name == "coffee-1.png"
    assert len(listings) == 2


def test_pictures_that_change_while_a_dataset_is_made_end_it(album: Path, tmp_path: Path):
    """The frames after would take others, and be of other scenes and splits than their numbers say."""
    dataset = dataset_config(small(f"images={album}"), 0, shard_size=1)
    shards = [_Shard(shard_path(tmp_path, i), 0, range(i, i + 1), dataset) for i in range(2)]
    worker = Worker(None, {})
    assert shards[0].do(worker) == 1
    shutil.copy(album / "coffee-0.png", album / "coffee-3.png")
    os.utime(album, ns=(1, 1))
    with pytest.raises(FsidError, match=r"album: holds other pictures .* 3 then, 4 now"):
        shards[1].do(worker)
    assert not shards[1].path.exists()


def test_pictures_that_changed_are_not_mixed_into_a_dataset(album: Path, tmp_path: Path):
    out, config = tmp_path / "out", small(f"images={album}")
    generate(out, config, count=2)
    first = album / "coffee-0.png"
    pixels = Image.open(first)
    pixels.crop((0, 0, 128, 128)).save(first)
    with pytest.raises(FsidError, match=r"album: holds other pictures .* 3 then, 3 now"):
        generate(out, config, count=4)
    for key in ("00000000", "00000009"):
        with pytest.raises(FsidError, match="album: holds other pictures"):
            make_only(out, key, None, None)
    pixels.save(first)
    assert generate(out, config, count=4) == 2
    first.rename(album / "later.png")
    with pytest.raises(FsidError, match="album: holds other pictures"):
        generate(out, config, count=6)
    record = tmp_path / "00000000.json"
    record.write_bytes(read_member(shard_path(out, 0), "00000000.json"))
    with pytest.raises(FsidError, match=r"made from coffee-0\.png, but .*album now has coffee-1\.png"):
        make_only(tmp_path / "again", str(record), None, None)


def test_a_dataset_of_before_pictures_were_told_apart_goes_on(album: Path, tmp_path: Path):
    out, config = tmp_path / "out", small(f"images={album}")
    generate(out, config, count=1)
    plain = read_yaml(out / "config.yaml")
    assert len(plain.pop("pictures_digest")) == 16
    old = yaml.safe_dump(plain)
    (out / "config.yaml").write_text(old)
    (album / "coffee-0.png").rename(album / "coffee.png")
    assert generate(out, config, count=2) == 1
    assert make_only(out, "1", None, None)
    assert (out / "config.yaml").read_text() == old
    (album / "coffee.png").unlink()
    with pytest.raises(FsidError, match="3 then, 2 now"):
        generate(out, config, count=2)


def test_a_folder_of_pictures_may_move(album: Path, tmp_path: Path):
    out, config = tmp_path / "out", small(f"images={album}")
    generate(out, config, count=1)
    moved = album.rename(tmp_path / "elsewhere")
    assert generate(out, replace(config, images=str(moved)), count=2) == 1
    (moved / "coffee-0.png").rename(moved / "coffee.png")
    with pytest.raises(FsidError, match="already holds another dataset"):
        generate(out, replace(config, images=str(moved)), count=3)


def own_files(folder: Path) -> list[str]:
    """Settings of scenes that take meshes, textures and skies of `folder`, where it has some of each."""
    for kind in ("meshes", "textures", "skies"):
        (folder / kind).mkdir(parents=True, exist_ok=True)
    for name in ("a", "b"):
        (folder / "meshes" / f"{name}.obj").write_text(
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 3 4\n"
        )
        Image.new("RGB", (16, 16), (120, 90, 60)).save(folder / "textures" / f"{name}_Color.png")
        header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16 +X 32\n"
        (folder / "skies" / f"{name}.hdr").write_bytes(header + bytes((90, 120, 150, 128)) * 512)
    return [
        f"scene.mesh_folders=[{folder / 'meshes'}]",
        f"scene.texture_folders=[{folder / 'textures'}]",
        f"scene.hdri_folder={folder / 'skies'}",
        *("scene.objects=[1,1]", "scene.hdri_share=1", "checks.duplicate_bits=-1", "width=32", "height=32"),
    ]


def test_folders_of_meshes_textures_and_skies_may_move(tmp_path: Path):
    out = tmp_path / "out"
    generate(out, small(*own_files(tmp_path / "here")), count=1)
    (tmp_path / "here").rename(tmp_path / "there")
    moved = small(*own_files(tmp_path / "there"))
    assert generate(out, moved, count=2, shard_size=16) == 1
    with pytest.raises(FsidError, match=r"these differ: generate\.scene\.objects"):
        generate(out, replace(moved, scene=replace(moved.scene, objects=(2, 2))), count=2)


def test_scenes_of_other_files_do_not_go_on_a_dataset(tmp_path: Path):
    """Whatever is drawn of a folder depends on all that is in it."""
    out, own = tmp_path / "out", tmp_path / "own"
    config = small(*own_files(own))
    generate(out, config, count=1)
    (own / "meshes" / "notes.txt").touch()  # not a file that scenes take
    KNOWN.clear()
    assert generate(out, config, count=2) == 1
    for file in (own / "meshes" / "b.obj", own / "textures" / "b_Color.png", own / "skies" / "b.hdr"):
        other = file.rename(file.with_name(f"c{file.name[1:]}"))
        KNOWN.clear()
        for again in (lambda: generate(out, config, count=3), lambda: make_only(out, "2", None, None)):
            with pytest.raises(
                FsidError, match=r"out: was begun with other files than .*meshes, .*skies can give"
            ):
                again()
        other.rename(file)


def test_broken_panoramas_are_named_before_a_dataset_begins(tmp_path: Path, refused: Callable[..., str]):
    """A scene that has one would end the run hours later, and a mended one is another file."""
    out, own = tmp_path / "out", tmp_path / "own"
    settings = own_files(own)
    (own / "skies" / "b.hdr").write_bytes((own / "skies" / "a.hdr").read_bytes()[:-9])
    told = refused("generate", str(out), "--count", "1", "--set", *settings)
    assert "1 of 2 panoramas cannot be used, mend them or move them elsewhere: " in told
    assert "b.hdr: is no complete Radiance .hdr picture" in told
    assert not out.exists()


def test_pairs_of_another_noise_do_not_go_on_a_dataset(album: Path, tmp_path: Path):
    """A profile that was calibrated again has its name, and other noise."""
    out, mine, profile = tmp_path / "out", tmp_path / "mine.yaml", load_profile("pixel6")
    save_profile(mine, profile)
    config = small(f"images={album}", f"cameras=[{mine}]")
    generate(out, config, count=1)
    record = tmp_path / "00000000.json"
    record.write_bytes(read_member(shard_path(out, 0), "00000000.json"))
    save_profile(mine, replace(profile, notes="the same noise"))
    assert generate(out, config, count=2) == 1
    assert make_only(tmp_path / "again", str(record), None, None)
    save_profile(mine, replace(profile, k=1.1 * profile.k))
    for again in (lambda: generate(out, config, count=3), lambda: make_only(out, "2", None, None)):
        with pytest.raises(FsidError, match=r"out: was begun with another noise than .*mine\.yaml says now"):
            again()
    with pytest.raises(FsidError, match="was made with another k than "):
        make_only(tmp_path / "again", str(record), None, None)


def test_a_dataset_of_before_profiles_were_told_apart_goes_on(album: Path, tmp_path: Path):
    save_profile(tmp_path / "mine.yaml", load_profile("pixel6"))
    out, config = tmp_path / "out", small(f"images={album}", f"cameras=[{tmp_path / 'mine.yaml'}]")
    generate(out, config, count=1)
    plain = read_yaml(out / "config.yaml")
    assert len(plain.pop("profiles_digest")) == 16
    (out / "config.yaml").write_text(yaml.safe_dump(plain))
    assert generate(out, config, count=2) == 1


def test_settings_made_in_python_are_those_of_a_file(tmp_path: Path):
    config = small("width=64", "height=48")
    loose = replace(config, width=np.int64(64), cameras=["pixel6"])
    assert generate(str(tmp_path / "out"), loose, count=np.int64(1), seed=np.int64(3)) == 1
    assert generate(tmp_path / "out", loose, count=1, seed=3) == 0
    assert generate(tmp_path / "out", replace(config, cameras=("pixel6",)), count=1, seed=3) == 0
    with pytest.raises(FsidError, match=r"^seed: 1\.5"):
        generate(tmp_path / "wrong", config, count=1, seed=1.5)
    assert not (tmp_path / "wrong").exists()


def test_unusable_pictures_are_named_before_anything_is_written(
    album: Path, tmp_path: Path, refused: Callable[..., str]
):
    whole = Image.open(album / "coffee-1.png")
    whole.save(album / "cut.jpg", quality=95)
    (album / "cut.jpg").write_bytes((album / "cut.jpg").read_bytes()[:4000])
    (album / "text.webp").write_text("no picture")
    Image.new("RGB", (64, 20)).save(album / "low.png")
    (album / "render.exr").write_bytes(b"v/1\x01")
    command = ["generate", str(tmp_path / "out"), "--images", str(album), "--quiet"]
    line = refused(*command, "--count", "7", "--workers", "2")
    assert "4 of 7 pictures cannot be used" in line
    assert all(name in line for name in ("cut.jpg", "text.webp", "low.png: is 64x20", "render.exr"))
    assert "\n" not in line
    assert not (tmp_path / "out").exists()
    main([*command, "--count", "1"])  # the first alone has a turn
    assert len(shard_keys(shard_path(tmp_path / "out", 0))) == 1


def test_pictures_are_no_source_for_some_tasks(album: Path, tmp_path: Path):
    """Whichever of them is the photograph: it is said at once, and not when its turn comes."""
    with pytest.raises(FsidError, match="needs scenes, in which"):
        generate(tmp_path / "out", small(f"images={album}", "task=deblur"), count=1)
    (album / "a.exr").touch()
    with pytest.raises(FsidError, match=r"coffee-0\.png: --task super-resolution needs"):
        generate(tmp_path / "out", small(f"images={album}", "task=super-resolution"), count=1)
    assert not (tmp_path / "out").exists()


def test_a_broken_photograph_is_named_and_leaves_no_shard(tmp_path: Path):
    folder = tmp_path / "photos"
    folder.mkdir()
    (folder / "broken.png").write_bytes(b"\x89PNG\r\n\x1a\n but not really")
    with pytest.raises(FsidError, match=r"broken\.png"):
        generate(tmp_path / "out", small(f"images={folder}"), count=1)
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["config.yaml"]


@pytest.mark.parametrize("module", ["fsid.dataset.worker", "fsid.cli.main"])
def test_workers_start_without_what_they_do_not_need(module: str):
    """A worker imports both: its task, and the command that started it."""
    script = (
        f"import sys, {module}; print({{'scipy.stats', 'skimage', 'matplotlib', 'torch'}} & set(sys.modules))"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "set()"
