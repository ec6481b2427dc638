"""Many pairs from one frame, checked, redrawn, split by scene, and made again from their record alone."""

from __future__ import annotations

import io
import json
import pickle
from pathlib import Path

import numpy as np
import pytest
import rawpy

from fsid.config import load_settings
from fsid.dataset import GenerateConfig, encode, make_frame, make_sample, remake, shard_path, write_shard
from fsid.dataset.checks import distance, fingerprint, flaw
from fsid.dataset.config import Checks, split_of
from fsid.dataset.near_duplicates import REDRAWS, Looks, Settle, settle
from fsid.dataset.shards import read_records, read_samples
from fsid.errors import FsidError
from fsid.scene import Scene
from fsid.sensor import Raw, mosaic, pack

SIZE = ["width=128", "height=96", "scene.objects=[1,2]"]


def config(*settings: str) -> GenerateConfig:
    return load_settings(GenerateConfig, None, [*SIZE, *settings])


class Painter:
    """Stands for a renderer: smooth random light that depends on the scene alone, and counts its frames."""

    def __init__(self, bad: int = 0) -> None:
        self.frames, self._bad = 0, bad

    def radiance(self, scene: Scene, camera_index: int = 0) -> np.ndarray:
        camera = scene.cameras[camera_index]
        rng = np.random.default_rng(scene.seed)
        coarse = rng.uniform(0.05, 1.0, (camera.height // 8 + 1, camera.width // 8 + 1, 3))
        light = coarse.repeat(8, 0).repeat(8, 1)[: camera.height, : camera.width].astype(np.float32)
        self.frames += 1
        if self.frames <= self._bad:
            light[0, 0] = np.nan
        return light


def test_a_frame_gives_crops_times_exposures_times_noise_levels() -> None:
    painter = Painter()
    settings = config("crops=2", "crop_width=64", "crop_height=32", "exposures=2", "noise_levels=2")
    samples = make_frame(settings, 5, 3, painter)
    assert painter.frames == 1
    assert [sample.record["index"] for sample in samples] == list(range(24, 32))
    assert {sample.clean.mosaic.shape for sample in samples} == {(32, 64)}
    by_crop = [samples[:4], samples[4:]]
    for crop in by_crop:
        assert len({tuple(sample.record["window"]) for sample in crop}) == 1
        np.testing.assert_array_equal(crop[0].clean.mosaic, crop[1].clean.mosaic)
        assert len({sample.record["iso"] for sample in crop}) == 4
    assert by_crop[0][0].record["window"] != by_crop[1][0].record["window"]
    for exposure in range(2):
        shots = [crop[2 * exposure] for crop in by_crop]
        assert shots[0].record["white_balance"] == shots[1].record["white_balance"]
    assert samples[0].record["white_balance"] != samples[2].record["white_balance"]


def test_a_crop_is_a_window_of_the_whole_frame() -> None:
    whole = make_sample(config("cameras=[pixel6]"), 5, 0, Painter()).clean.mosaic
    part = make_sample(config("cameras=[pixel6]", "crop_width=64", "crop_height=48"), 5, 0, Painter())
    left, top, width, height = part.record["window"]
    np.testing.assert_array_equal(part.clean.mosaic, whole[top : top + height, left : left + width])


def test_one_sample_of_a_frame_is_the_same_as_all_of_them() -> None:
    settings = config("exposures=2", "noise_levels=2")
    frame = make_frame(settings, 1, 2, Painter())
    for place, sample in enumerate(frame):
        assert encode(make_sample(settings, 1, 8 + place, Painter())) == encode(sample)


@pytest.mark.parametrize("task", ["denoise", "super-resolution"])
def test_a_sample_is_made_again_from_its_json_alone(task: str) -> None:
    settings = config("noise_levels=2", f"task={task}")
    sample = make_sample(settings, 1, 5, Painter(bad=1))
    assert sample.record["refused"] == ["not finite"]
    files = encode(sample)
    assert encode(remake(json.loads(files["json"]), Painter())) == files


def test_an_incomplete_record_is_refused() -> None:
    record = make_sample(config(), 1, 0, Painter()).record
    with pytest.raises(FsidError, match="settings"):
        remake({key: value for key, value in record.items() if key != "settings"}, Painter())


@pytest.mark.parametrize("noise", ["x", [1, 2], [[]], 10**400, None])
def test_a_record_whose_noise_is_none_is_refused(noise: object) -> None:
    record = make_sample(config(), 1, 0, Painter()).record
    with pytest.raises(FsidError, match=r"k: .* is not that of four sites"):
        remake({**record, "k": noise}, Painter())


def test_a_broken_record_behind_a_near_duplicate_is_named(tmp_path: Path) -> None:
    """It was met where the shard is made again, which had not looked at it before."""
    samples = [make_sample(config(), 1, i, Painter()) for i in (0, 0, 1)]
    files = [(f"{i:08d}", encode(sample)) for i, sample in enumerate(samples)]
    files[1][1]["json"] = json.dumps(samples[1].record | {"frame": 1, "index": 1}).encode()
    files[2][1]["json"] = b"{"
    write_shard(shard_path(tmp_path, 0), files)
    for never in (config("images=photos"), config("checks.duplicate_bits=-1")):
        settle([shard_path(tmp_path, 0)], never, 1, pytest.fail)
    with pytest.raises(FsidError, match=r"shard-00000\.tar: 00000002\.json: is not valid JSON"):
        settle([shard_path(tmp_path, 0)], config(), 1, lambda task: task.do(PaintingWorker()))


def test_frames_that_never_pass_are_one_line() -> None:
    with pytest.raises(FsidError, match=r"frame 0: 8 attempts were refused \(not finite"):
        make_frame(config(), 0, 0, Painter(bad=100))
    with pytest.raises(FsidError, match="black"):
        make_frame(config("checks.black_share=0"), 0, 0, Dark())


class Dark(Painter):
    def radiance(self, scene: Scene, camera_index: int = 0) -> np.ndarray:
        light = super().radiance(scene, camera_index)
        return np.where(np.arange(light.shape[1])[:, None] < 40, 0, light).astype(np.float32)


def clean(x: np.ndarray) -> Raw:
    return Raw(x.astype(np.float32), "RGGB", 64, 1023, (2.0, 1.0, 1.5), np.eye(3))


def test_flaws_are_found(rng: np.random.Generator) -> None:
    checks = Checks(black_share=0.1, blown_share=0.1)
    x = rng.uniform(0.1, 0.9, (40, 60))
    assert flaw(clean(x), checks) is None
    for name, change in (("black", 0.0), ("blown", 1.0)):
        y = x.copy()
        y[:, :8] = change
        assert flaw(clean(y), checks) == name
        y[:, 4:8] = 0.5
        assert flaw(clean(y), checks) is None
    for wrong, places in ((None, ((0, 0), (1, 1))), ("blown", ((0, 1), (1, 0)))):  # red and blue, both greens
        y = x.copy()
        for row, column in places:
            y[row::2, column::2] = 1.0
        assert flaw(clean(y), checks) == wrong
    for name, value in (("not finite", np.nan), ("out of range", 1.01), ("out of range", -0.01)):
        y = x.copy()
        y[3, 3] = value
        assert flaw(clean(y), checks) == name


def test_a_fingerprint_knows_an_image_again(rng: np.random.Generator) -> None:
    coarse = rng.uniform(0.1, 0.6, (2, 12, 20, 3)).repeat(16, 1).repeat(16, 2)
    one, other = (mosaic(image, "GBRG") for image in coarse)
    looks = fingerprint(clean(one))
    assert len(looks) == 64
    assert distance(looks, fingerprint(clean(one * 0.5 + rng.normal(0, 1e-3, one.shape)))) <= 8
    assert distance(looks, fingerprint(clean(other))) > 64
    fingerprint(clean(one[:32, :32]))  # the smallest there are


def test_splits_are_cut_by_scene() -> None:
    settings = config("exposures=2", "noise_levels=2", "validation_every=3")
    splits = {f: {s.record["split"] for s in make_frame(settings, 0, f, Painter())} for f in range(4)}
    assert splits == {0: {"train"}, 1: {"train"}, 2: {"validation"}, 3: {"train"}}
    assert split_of(settings, 5) == "validation"


def test_splits_of_pictures_are_cut_by_picture(photos: Path) -> None:
    settings = config(f"images={photos}", "validation_every=3")
    splits = [make_frame(settings, 0, f, None)[0].record for f in range(6)]
    assert {record["image"]: record["split"] for record in splits[:3]} == {
        record["image"]: record["split"] for record in splits[3:]
    }
    assert [record["split"] for record in splits] == ["train", "train", "validation"] * 2


def test_super_resolution_keeps_the_light_and_loses_the_detail() -> None:
    for scale in (2, 4):
        sample = make_sample(config("task=super-resolution", f"scale={scale}"), 3, 0, Painter())
        small = sample.more["degraded"].mosaic
        assert small.shape == (96 // scale, 128 // scale)
        assert sample.noisy.mosaic.shape == small.shape
        large, little = (pack(x, sample.clean.cfa).mean((1, 2)) for x in (sample.clean.mosaic, small))
        np.testing.assert_allclose(large, little, rtol=0.02)
        files = encode(sample)
        with rawpy.imread(io.BytesIO(files["degraded.dng"])) as raw:
            assert raw.raw_image.shape == small.shape


def test_photographs_are_no_source_for_super_resolution(photos: Path) -> None:
    with pytest.raises(FsidError, match="needs scenes or linear"):
        make_sample(config(f"images={photos}", "task=super-resolution"), 0, 0, None)


class PaintingWorker:
    def renderer(self, config: GenerateConfig) -> Painter:
        return Painter()


def test_alike_are_fingerprints_of_which_at_most_so_many_bits_differ(rng: np.random.Generator) -> None:
    """In whichever of their words, and among more than memory is taken for at first."""
    known = rng.integers(0, 2**64, (3000, 4), dtype=np.uint64)
    looks = Looks(8)
    looks.add(known[:1000])
    looks.add(known[1000:])
    for bits in (0, 8, 9):
        for word in range(4):
            like = known[[17, 2900]].copy()
            like[:, word] ^= np.uint64(2**bits - 1) << np.uint64(20)
            assert looks.has(like[:1]) == looks.has(like[1:]) == (bits <= 8)
            assert looks.has(np.concatenate([~known[:1], like[1:]])) == (bits <= 8)  # crops of one frame
        across = known[2900:2901].copy().view(np.uint8)
        across[0, rng.permutation(32)[:bits]] ^= 1
        assert looks.has(across.view(np.uint64)) == (bits <= 8)
    looks.forget(2000)
    assert not looks.has(known[2900:2901])


def settled(
    folder: Path, settings: GenerateConfig, frames: int, per_shard: int, interrupt: bool
) -> list[Path]:
    """A dataset of `frames` samples, settled; interrupt: stopped after the first shard, and settled again."""
    folder.mkdir()
    shards = []
    for number in range(frames // per_shard):
        shards.append(shard_path(folder, number))
        indices = range(number * per_shard, (number + 1) * per_shard)
        samples = [make_sample(settings, 1, i, Painter()) for i in indices]
        write_shard(shards[-1], [(sample.key, encode(sample)) for sample in samples])
    if interrupt:
        settle(shards[:1], settings, 1, lambda task: task.do(PaintingWorker()))
    settle(shards, settings, 1, lambda task: task.do(PaintingWorker()))
    return shards


def test_of_many_shards_a_worker_settles_some_at_a_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bar stood still from the first near-duplicate of 175,000 pairs on. All of these look alike."""
    monkeypatch.setitem(settle.__globals__, "_TOGETHER", 2)
    settings = config("checks.duplicate_bits=256")
    shards = [shard_path(tmp_path, number) for number in range(6)]
    for number, path in enumerate(shards):
        sample = make_sample(settings, 1, number, Painter())
        write_shard(path, [(sample.key, encode(sample))])
    done: list[list[Path] | int] = []

    def do(task: Settle) -> Looks:
        done.append(list(task.paths))
        return pickle.loads(pickle.dumps(task)).do(PaintingWorker())

    settle(shards, settings, 1, do, done.append)
    assert done == [1, shards[1:3], 3, shards[3:5], 5, shards[5:], 6]
    refused = [len(record["refused"]) for path in shards for record in read_records(path)]
    assert refused == [0, *5 * [REDRAWS]]


def test_near_duplicates_are_drawn_again_by_order_alone(tmp_path: Path) -> None:
    """With 120 of 256 bits as the limit, some of these random pictures look alike."""
    near_bits = 120
    settings = config(f"checks.duplicate_bits={near_bits}")
    one = settled(tmp_path / "one", settings, 12, 12, interrupt=False)
    two = settled(tmp_path / "two", settings, 12, 4, interrupt=True)
    samples = read_samples(one[0])
    assert samples == {key: files for shard in two for key, files in read_samples(shard).items()}
    earlier: list[str] = []
    redrawn = []
    for record in read_records(one[0]):
        near = any(distance(record["fingerprint"], other) <= near_bits for other in earlier)
        assert not near or len(record["refused"]) >= REDRAWS
        earlier.append(record["fingerprint"])
        if "near-duplicate" in record["refused"]:
            redrawn.append(record)
    assert 0 < len(redrawn) < 12
    assert encode(remake(redrawn[-1], Painter())) == samples[redrawn[-1]["key"]]
