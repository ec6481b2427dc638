"""A patch is an isometric view of the stored image with fresh noise; (seed, step) decide all of it."""

from __future__ import annotations

import io
import json
import multiprocessing
import os
import re
import shutil
import signal
import struct
import sys
import tarfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tifffile

torch = pytest.importorskip("torch")

from fsid.config import save_settings  # noqa: E402
from fsid.dataset import index  # noqa: E402
from fsid.dataset.config import DatasetConfig, GenerateConfig  # noqa: E402
from fsid.dataset.feed import batches  # noqa: E402
from fsid.dataset.index import dataset_digest, index_mosaics  # noqa: E402
from fsid.dataset.loader import Batch, PatchConfig, PatchDataset, packed, window_rand  # noqa: E402
from fsid.dataset.noise_levels import LevelTable  # noqa: E402
from fsid.dataset.patch_grid import Grid  # noqa: E402
from fsid.dataset.permutation import shuffled  # noqa: E402
from fsid.dataset.shards import read_samples, shard_path, write_shard  # noqa: E402
from fsid.errors import FsidError  # noqa: E402
from fsid.sensor import (  # noqa: E402
    CFA_PATTERNS,
    NoiseLevel,
    Raw,
    add_noise,
    load_profile,
    read_raw,
    save_profile,
    write_dng,
)
from fsid.sensor.noise import K_JITTER, SIGMA2_JITTER, level_rand  # noqa: E402
from stated_black import state_black  # noqa: E402

HEIGHT, WIDTH = 40, 60
CONFIG = PatchConfig(size_px=16, batch=3, profiles=("pixel6", "galaxy-s22"), iso_min=400, iso_max=6400)


def raw(dn: np.ndarray, cfa: str = "RGGB", black: int = 0, white: int = 65535) -> Raw:
    x = (dn.astype(np.float32) - black) / (white - black)
    return Raw(x, cfa, black, white, (2.0, 1.0, 1.5), np.eye(3))


def write_dataset(folder: Path, images: list[Raw], per_shard: int = 2) -> Path:
    def sample(number: int) -> tuple[str, dict[str, bytes]]:
        buffer = io.BytesIO()
        write_dng(buffer, images[number])
        return f"{number:08d}", {"clean.dng": buffer.getvalue(), "json": b"{}"}

    for first in range(0, len(images), per_shard):
        numbers = range(first, min(first + per_shard, len(images)))
        write_shard(shard_path(folder, first // per_shard), [sample(n) for n in numbers])
    return folder


@pytest.fixture
def dataset(tmp_path: Path, rng: np.random.Generator) -> Path:
    levels = {"black": 4096, "white": 65472}
    images = [raw(rng.integers(4096, 65472, (HEIGHT, WIDTH)), cfa, **levels) for cfa in CFA_PATTERNS]
    return write_dataset(tmp_path, images)


def write_pairs(folder: Path, clean: list[Raw], noisy: list[Raw]) -> Path:
    def dng(image: Raw) -> bytes:
        buffer = io.BytesIO()
        write_dng(buffer, image)
        return buffer.getvalue()

    pairs = enumerate(zip(clean, noisy, strict=True))
    files = [(f"{i:08d}", {"clean.dng": dng(c), "noisy.dng": dng(n), "json": b"{}"}) for i, (c, n) in pairs]
    write_shard(shard_path(folder, 0), files)
    return folder


def equal(a: Batch, b: Batch) -> bool:
    return all(map(torch.equal, a.tensors, b.tensors))


def test_the_index_points_at_the_pixels_that_libraw_reads(dataset: Path, tmp_path: Path) -> None:
    for mosaic in index_mosaics(dataset):
        stored = np.fromfile(mosaic.shard, "<u2", mosaic.height * mosaic.width, offset=mosaic.offset)
        file = tmp_path / "one.dng"
        with tarfile.open(mosaic.shard) as tar:
            file.write_bytes(tar.extractfile(f"{mosaic.key}.clean.dng").read())
        read = read_raw(file)
        assert (mosaic.cfa, mosaic.black_level, mosaic.white_level) == (read.cfa, 4096, 65472)
        x = (stored.reshape(mosaic.height, mosaic.width) - 4096.0) / (65472 - 4096)
        np.testing.assert_allclose(x, read.mosaic, atol=1e-6)


def test_headers_are_read_once_until_a_file_changes(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A start of a training asks three times, and 175,000 images cost minutes each time."""
    opened: list[Path] = []
    read = index._index_shard
    monkeypatch.setattr(index, "_index_shard", lambda *what: opened.append(what[0]) or read(*what))
    first = index_mosaics(dataset)
    PatchDataset(dataset, CONFIG, seed=0)
    assert index_mosaics(dataset) == first
    assert len(opened) == 2
    samples = read_samples(shard_path(dataset, 1))
    write_shard(shard_path(dataset, 1), [(f"{int(key) + 5:08d}", files) for key, files in samples.items()])
    assert [mosaic.key[-1] for mosaic in index_mosaics(dataset)] == ["0", "1", "7", "8"]
    save_settings(DatasetConfig(0, 2, GenerateConfig(noise_levels=2)), dataset / "config.yaml")
    assert [mosaic.scene for mosaic in index_mosaics(dataset)] == [0, 0, 3, 4]
    shard_path(dataset, 0).unlink()
    assert [mosaic.key[-1] for mosaic in index_mosaics(dataset)] == ["7", "8"]


@pytest.mark.parametrize("processes", [0, 1])
def test_a_shard_that_was_written_again_is_not_read_at_the_old_places(dataset: Path, processes: int) -> None:
    """Near-duplicates are drawn again when all others are there, and a training may have begun."""
    patches, mosaics = PatchDataset(dataset, CONFIG, seed=0), index_mosaics(dataset)
    for shard in {mosaic.shard for mosaic in mosaics}:
        samples = read_samples(shard)
        write_shard(shard, [(key, {"json": bytes(5000)} | files) for key, files in samples.items()])
    with pytest.raises(FsidError, match=r"^\S+shard-0000.\.tar: has changed .*; run the same command again$"):
        next(batches(patches, range(4), processes))
    with pytest.raises(FsidError, match="has changed"):
        mosaics[0].levels()
    index_mosaics(dataset)[0].levels()


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
def test_a_patch_is_an_isometry_of_the_image_in_rggb_geometry(
    cfa: str, tmp_path: Path, rng: np.random.Generator
) -> None:
    """Pixels carry their own address: packed site s at (i, j) came from origin + A (2i + r_s, 2j + c_s)."""
    address = np.arange(HEIGHT * WIDTH, dtype=np.uint16).reshape(HEIGHT, WIDTH)
    mosaic = index_mosaics(write_dataset(tmp_path, [raw(address, cfa)]))[0]
    colours = np.array(list(cfa)).reshape(2, 2)
    symmetries = set()
    for _ in range(100):
        corner = int(rng.integers(HEIGHT - 18 + 1)), int(rng.integers(WIDTH - 18 + 1))
        cut, is_transposed = window_rand(rng, mosaic, corner, 8)
        patch = np.empty((4, 8, 8), np.float32)
        packed(address, mosaic, cut, patch)
        found = np.rint(patch * 65535).astype(int)
        view = np.empty((16, 16), int)
        for site, (r, c) in zip(found, ((0, 0), (0, 1), (1, 0), (1, 1)), strict=True):
            view[r::2, c::2] = site
        place = np.stack(np.divmod(view, WIDTH), -1)
        down, right = place[1, 0] - place[0, 0], place[0, 1] - place[0, 0]
        i, j = np.mgrid[:16, :16]
        np.testing.assert_array_equal(place, place[0, 0] + i[..., None] * down + j[..., None] * right)
        assert abs(down @ right) == 0
        assert abs(down).sum() == abs(right).sum() == 1
        seen = colours[place[..., 0] % 2, place[..., 1] % 2]
        assert (seen[:2, :2] == [["R", "G"], ["G", "B"]]).all()
        symmetries.add((*down, *right))
        assert is_transposed == (down[0] == 0)
        assert (place.min((0, 1)) >= corner).all()
        assert (place.max((0, 1)) < np.add(corner, 18)).all()
    assert len(symmetries) == 8


@pytest.mark.parametrize("cfa", CFA_PATTERNS)
@pytest.mark.parametrize("shrink", [2, 4])
def test_a_smaller_image_is_the_same_scene_in_rggb_geometry(cfa: str, shrink: int, tmp_path: Path) -> None:
    """A pixel of a slope in light tells where the middle of what it covers lies in the stored image."""
    height, width = 96, 112
    slope = (128 * np.arange(height)[:, None] + np.arange(width)).astype(np.uint16)
    config = replace(CONFIG, size_px=5, batch=32, shrink=(shrink,))
    patches = PatchDataset(write_dataset(tmp_path, [raw(slope, cfa)]), config, seed=1)
    colours = np.array(list(cfa)).reshape(2, 2)
    directions = set()
    for patch in patches[0].clean.numpy():
        view = np.empty((10, 10))
        for site, (r, c) in zip(patch * 65535.0, ((0, 0), (0, 1), (1, 0), (1, 1)), strict=True):
            view[r::2, c::2] = site
        number = (view - 129 * (shrink - 1) / 2) / shrink  # 128 row + column of the smaller image
        np.testing.assert_allclose(number, np.rint(number), atol=0.01)
        place = np.stack(np.divmod(np.rint(number).astype(int), 128), -1)
        down, right = place[1, 0] - place[0, 0], place[0, 1] - place[0, 0]
        i, j = np.mgrid[:10, :10]
        np.testing.assert_array_equal(place, place[0, 0] + i[..., None] * down + j[..., None] * right)
        assert (colours[place[:2, :2, 0] % 2, place[:2, :2, 1] % 2] == [["R", "G"], ["G", "B"]]).all()
        directions.add((*down, *right))
    assert len(directions) == 8


def test_sizes_take_turns_and_each_has_its_epochs(tmp_path: Path) -> None:
    """48 rows and 70 columns: fifteen cells of 14 pixels as it is, two at half the size."""
    level = np.arange(48 * 70, dtype=np.uint16).reshape(48, 70)
    config = replace(CONFIG, size_px=6, batch=2, shrink=(1, 2))
    patches = PatchDataset(write_dataset(tmp_path, [raw(level)]), config, seed=1)
    assert patches.patches == 15 + 2
    large, small = zip(*(patches[step].clean.numpy() * 65535 for step in range(15)), strict=True)
    assert len({round(float(patch.min())) for patch in large}) == 15
    assert all(np.ptp(patch) > 1.5 * np.ptp(large[0]) for patch in small)
    columns = [(float(patch.mean()) - 35) % 70 for patch in small]  # where the middle of a patch lies
    for one, other in ((0, 1), (2, 3), (4, 5)):
        assert abs(columns[one] - columns[other]) == pytest.approx(28, abs=3)


@pytest.mark.parametrize("shrink", [(3,), (0,), (2, 2), (-2,)])
def test_sizes_are_different_powers_of_two(shrink: tuple[int, ...]) -> None:
    with pytest.raises(FsidError, match="powers of 2"):
        replace(CONFIG, shrink=shrink)


@pytest.mark.parametrize(
    ("width", "height", "size_px", "sizes"),
    [
        (1920, 1080, 64, (1, 2, 4)),
        (1080, 1920, 64, (1, 2, 4)),
        (4000, 3000, 64, (1, 2, 4, 8)),
        (960, 540, 64, (1, 2)),
        (958, 540, 64, (1,)),
        (1920, 500, 64, (1, 2)),
        (1920, 1080, 200, (1, 2)),
    ],
)
def test_large_images_are_drawn_at_several_sizes(
    width: int, height: int, size_px: int, sizes: tuple[int, ...], tmp_path: Path
) -> None:
    data = write_dataset(tmp_path, [raw(np.zeros((height, width)))])
    config = replace(CONFIG, size_px=size_px, shrink=())
    assert PatchDataset(data, config, seed=0).shrink == sizes


def test_most_images_say_how_large_they_all_are(tmp_path: Path) -> None:
    images = [raw(np.zeros(shape)) for shape in ((40, 60), (600, 1000), (600, 1000))]
    patches = PatchDataset(write_dataset(tmp_path, images), replace(CONFIG, shrink=()), seed=0)
    assert patches.shrink == (1, 2)


def test_stored_noise_is_of_the_size_it_was_made_for(tmp_path: Path) -> None:
    with pytest.raises(FsidError, match="stored noise"):
        replace(CONFIG, shrink=(2,), noise="stored")
    image = Raw(np.full((600, 1000), 0.3, np.float32), "RGGB", 64, 1023, (1.0, 1.0, 1.0), np.eye(3))
    noisy = replace(image, noise=NoiseLevel(k=(1e-3,) * 4, sigma2=(1e-5,) * 4))
    pairs = write_pairs(tmp_path, [image], [noisy])
    assert PatchDataset(pairs, replace(CONFIG, shrink=(), noise="stored"), seed=0).shrink == (1,)


def test_a_size_that_no_image_is_large_enough_for_is_refused(dataset: Path) -> None:
    with pytest.raises(FsidError, match=r"60x40 to be made 2 times smaller, .* \(needs 68x68\)"):
        PatchDataset(dataset, replace(CONFIG, shrink=(1, 2)), seed=0)


def test_images_that_are_too_small_are_only_drawn_as_they_are(tmp_path: Path) -> None:
    images = [raw(np.full(shape, level)) for shape, level in (((36, 60), 9000), ((40, 60), 20000))]
    config = replace(CONFIG, size_px=9, batch=2, shrink=(1, 2))
    patches = PatchDataset(write_dataset(tmp_path, images), config, seed=1)
    levels = np.array([patches[step].clean.mean((1, 2, 3)).numpy() * 65535 for step in range(12)])
    assert {round(level, -2) for level in levels[:, 0].tolist()} == {9000, 20000}
    assert {round(level, -2) for level in levels[:, 1].tolist()} == {20000}


def test_noise_follows_the_profile_and_the_converter(tmp_path: Path) -> None:
    """A shadow at low ISO, where the 1/12 DN^2 of rounding, which sigma2 contains, is a twentieth of it."""
    grey = raw(np.full((HEIGHT, WIDTH), 0.02 * 61376 + 4096), black=4096, white=65472)
    config = replace(CONFIG, batch=256, profiles=("pixel6",), iso_min=50, iso_max=50)
    batch = PatchDataset(write_dataset(tmp_path, [grey]), config, seed=1)[0]
    expected = batch.k * 0.02 + batch.sigma2
    measured = (batch.noisy - batch.clean).square().mean((2, 3))
    assert (measured / expected).mean().item() == pytest.approx(1, abs=0.015)  # 262,144 values: 0.3 % sigma
    assert (batch.noisy - batch.clean).mean().item() == pytest.approx(0, abs=1e-5)
    assert batch.k.mean().item() == pytest.approx(np.mean(load_profile("pixel6").level(50).k), rel=0.03)


def test_noisy_values_are_whole_dn_of_the_camera_and_clipped_at_white(tmp_path: Path) -> None:
    white = raw(np.full((HEIGHT, WIDTH), 65472), black=4096, white=65472)
    config = replace(CONFIG, profiles=("pixel6",))
    noisy = PatchDataset(write_dataset(tmp_path, [white]), config, seed=1)[0].noisy * 959 + 64
    torch.testing.assert_close(noisy, noisy.round(), atol=1e-3, rtol=0)
    assert noisy.max() <= 1023.001
    assert (noisy > 1022.5).float().mean() == pytest.approx(0.5, abs=0.05)


def test_a_batch_depends_on_seed_and_step_alone(dataset: Path) -> None:
    patches = PatchDataset(dataset, CONFIG, seed=3)
    patches[0]
    assert equal(patches[7], PatchDataset(dataset, CONFIG, seed=3)[7])
    others = [
        patches[8],
        PatchDataset(dataset, CONFIG, 4)[7],
        PatchDataset(dataset, CONFIG, 3, rank=1, world=2)[7],
    ]
    assert not any(equal(patches[7], other) for other in others)


@pytest.mark.parametrize("processes", [0, 1, 2])
def test_loading_processes_change_nothing(processes: int, dataset: Path) -> None:
    """Slow as this consumer is, no process writes into the batch that it holds; memory is used again."""
    patches, steps = PatchDataset(dataset, CONFIG, seed=3), range(2, 22)
    patches[0]
    places = set()
    for step, batch in zip(steps, batches(patches, steps, processes), strict=True):
        time.sleep(0.02)
        assert equal(batch, patches[step])
        places.add(batch.noisy.data_ptr())
    assert not processes or len(places) == 2 * processes + 1


def test_signals_to_all_processes_end_no_loading_process_with_an_error(dataset: Path) -> None:
    """A closed terminal and Ctrl-C: the parent decides. SIGTERM: it ends, and PyTorch says nothing of it."""
    patches, steps = PatchDataset(dataset, CONFIG, seed=3), range(12)
    feed = batches(patches, steps, 1)
    next(feed)
    (process,) = multiprocessing.active_children()
    os.kill(process.pid, signal.SIGHUP)
    os.kill(process.pid, signal.SIGINT)
    assert len(list(zip(range(10), feed, strict=False))) == 10
    assert process.is_alive()
    os.kill(process.pid, signal.SIGTERM)
    process.join(10)
    assert process.exitcode == 0


def test_too_little_shared_memory_is_one_line(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a container has, whose /dev/shm is of 64 MB."""

    def full(tensor: torch.Tensor) -> None:
        raise RuntimeError("unable to allocate shared memory(shm) for file </torch_1>: No space left (28)")

    monkeypatch.setattr(torch.Tensor, "share_memory_", full)
    with pytest.raises(FsidError, match=r"loader_processes: these need \d+ MB .*--shm-size"):
        next(batches(PatchDataset(dataset, CONFIG, seed=3), range(2), 1))


def test_the_loop_of_the_guide_runs(dataset: Path, monkeypatch, capsys) -> None:
    guide = Path(__file__).resolve().parents[1] / "docs" / "generate.md"
    (block,) = re.findall(r"```python\n(from torch.*?)```", guide.read_text(encoding="utf-8"), re.S)
    (dataset / "data").symlink_to(dataset)
    monkeypatch.chdir(dataset)
    exec(compile(block, "generate.md", "exec"), {})
    assert capsys.readouterr().out.count("torch.Size([4, 4, 16, 16])") == 20


def test_there_is_no_step_before_the_first(dataset: Path) -> None:
    with pytest.raises(FsidError, match="seed -1: must not be negative"):
        PatchDataset(dataset, CONFIG, seed=-1)
    with pytest.raises(FsidError, match="step -1: must not be negative"):
        PatchDataset(dataset, CONFIG, seed=0)[-1]


def test_unusable_datasets_are_named(dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(FsidError, match="too small for patches"):
        PatchDataset(dataset, replace(CONFIG, size_px=20), seed=0)
    with pytest.raises(FsidError, match="no-such"):
        PatchDataset(tmp_path / "no-such", CONFIG, seed=0)
    with pytest.raises(FsidError, match="no-such"):
        PatchDataset(dataset, replace(CONFIG, profiles=("no-such",)), seed=0)
    with pytest.raises(FsidError, match=r"no \*\.noisy\.dng"):
        index_mosaics(dataset, "noisy")
    shard = shard_path(dataset, 0)
    shard.write_bytes(shard.read_bytes()[:5000])
    with pytest.raises(FsidError, match=r"shard-00000\.tar"):
        index_mosaics(dataset)


@pytest.mark.parametrize(("kind", "offset"), [("<f", 264.0), ("<i", -264)])
def test_pixels_at_no_place_of_the_file_are_refused(kind: str, offset: float, dataset: Path) -> None:
    """A fraction was a traceback when the pixels were asked for, in training too."""
    shard = shard_path(dataset, 0)
    data = bytearray(shard.read_bytes())
    at = data.index(struct.pack("<HHI", 273, 4, 1))  # StripOffsets, LONG
    data[at + 2 : at + 12] = struct.pack("<HI", {"<f": 11, "<i": 9}[kind], 1) + struct.pack(kind, offset)
    shard.write_bytes(data)
    with pytest.raises(FsidError, match=r"shard-00000\.tar: 00000000\.clean\.dng is (not a DNG|truncated)"):
        index_mosaics(dataset)


def test_a_profile_without_colour_filters_is_refused(dataset: Path, tmp_path: Path) -> None:
    save_profile(tmp_path / "mono.yaml", replace(load_profile("pixel6"), cfa="MONO"))
    with pytest.raises(FsidError, match=r"mono\.yaml: is of a sensor without colour filters"):
        PatchDataset(dataset, PatchConfig(8, 1, (str(tmp_path / "mono.yaml"),), 100, 800), 0)


def test_crops_of_a_frame_are_of_one_scene(tmp_path: Path) -> None:
    dataset = write_dataset(tmp_path, [raw(np.zeros((HEIGHT, WIDTH)))] * 4)
    crops = GenerateConfig(crops=2, crop_width=WIDTH, crop_height=HEIGHT)
    save_settings(DatasetConfig(0, 4, crops), dataset / "config.yaml")
    assert [mosaic.scene for mosaic in index_mosaics(dataset)] == [0, 0, 1, 1]


def write_stated(folder: Path, records: list[dict]) -> Path:
    """A dataset without config.yaml, of one sample with this JSON for each record."""
    image = io.BytesIO()
    write_dng(image, raw(np.zeros((HEIGHT, WIDTH))))
    samples = [
        (f"b{i:08d}", {"clean.dng": image.getvalue(), "json": json.dumps(record).encode()})
        for i, record in enumerate(records)
    ]
    write_shard(shard_path(folder, 0), samples)
    return folder


def test_without_settings_samples_say_themselves_which_scene_they_are_of(tmp_path: Path) -> None:
    own = {"key": "00000000", "seed": 5, "frame": 7, "split": "train"}
    rendered = {**own, "scene": {"parts": [{}]}, "settings": {"scene": {}}}
    validation = {**rendered, "frame": 8, "split": "validation"}
    data = write_stated(tmp_path, [rendered, validation, rendered, {**rendered, "seed": 6}])
    assert [mosaic.scene for mosaic in index_mosaics(data)] == [0, 1, 0, 2]
    assert [mosaic.split for mosaic in index_mosaics(data)] == ["train", "validation", "train", "train"]
    pictures = [{**own, "frame": frame, "image": f"{frame % 2}.png", "settings": {}} for frame in range(4)]
    assert [mosaic.scene for mosaic in index_mosaics(write_stated(tmp_path, pictures))] == [0, 1, 0, 1]
    assert PatchDataset(tmp_path, replace(CONFIG, held_out=1), seed=0).mosaics == 2
    with pytest.raises(FsidError, match=r"b00000000\.json: is not the JSON of a sample"):
        index_mosaics(write_stated(tmp_path, [[]]))


def test_samples_that_say_nothing_of_their_scene_are_one_each(tmp_path: Path) -> None:
    """Pairs of one's own, beside a scene of the dataset that counts as the first."""
    data = write_stated(tmp_path, [{}, {"seed": 5, "frame": 0}, {}, {}])
    assert [mosaic.scene for mosaic in index_mosaics(data)] == [0, 1, 2, 3]
    assert PatchDataset(data, replace(CONFIG, held_out=1), seed=0).mosaics == 3


def test_a_picture_that_two_datasets_share_is_of_one_split(tmp_path: Path) -> None:
    """Each second of a.png, c.png is for validation, and each second of a.png, b.png, c.png."""
    albums = (("a.png", "c.png"), ("a.png", "b.png", "c.png"))
    numbered = [pair for album in albums for pair in enumerate(album)]
    records = [{"image": name, "split": ("train", "validation")[i % 2]} for i, name in numbered]
    data = write_stated(tmp_path, [*records, {"image": "d.png", "split": "train"}])
    splits = {name: {m.split for m in index_mosaics(data) if m.scene == i} for i, name in enumerate("acbd")}
    assert splits == {"a": {"train"}, "c": {"validation"}, "b": {"validation"}, "d": {"train"}}
    assert PatchDataset(data, CONFIG, seed=0).mosaics == 3


def test_a_key_that_comes_twice_is_refused(tmp_path: Path) -> None:
    """Two datasets in one folder: which noisy image belongs to which clean one would be a guess."""
    image = raw(np.zeros((HEIGHT, WIDTH)))
    write_dataset(tmp_path, [image] * 2)
    shutil.copy(shard_path(tmp_path, 0), shard_path(tmp_path, 1))
    with pytest.raises(FsidError, match=r"shard-00001\.tar: 00000000 is also in .*shard-00000\.tar; .*keys"):
        index_mosaics(tmp_path)


def test_the_two_images_of_a_pair_are_of_one_shard(tmp_path: Path) -> None:
    image = raw(np.full((HEIGHT, WIDTH), 9000))
    noisy = replace(image, noise=NoiseLevel(k=(1e-3,) * 4, sigma2=(1e-5,) * 4))
    write_pairs(tmp_path, [image], [noisy])
    (sample,) = read_samples(shard_path(tmp_path, 0)).values()
    for number, kind in enumerate(("clean.dng", "noisy.dng")):
        write_shard(shard_path(tmp_path, number), [("00000000", {kind: sample[kind]})])
    with pytest.raises(FsidError, match=r"shard-00000\.tar: 00000000 has no noisy image"):
        PatchDataset(tmp_path, replace(CONFIG, noise="stored"), seed=0)


def test_a_dataset_without_config_yaml_is_told_by_its_first_clean_image(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    write_dataset(tmp_path / "a", [raw(np.full((HEIGHT, WIDTH), 9000))])
    write_dataset(tmp_path / "b", [raw(np.full((HEIGHT, WIDTH), 9001))])
    first = dataset_digest(tmp_path / "a")
    assert (
        first == dataset_digest((tmp_path / "a").rename(tmp_path / "moved")) != dataset_digest(tmp_path / "b")
    )
    write_shard(shard_path(tmp_path, 0), [("00000000", {"rgb.png": b""})])
    with pytest.raises(FsidError, match=r"its shards hold no \*\.clean\.dng"):
        dataset_digest(tmp_path)


@pytest.mark.parametrize("key", ["./scene_a_0001", "abc", "../../evil", "9" * 5000])
def test_a_key_that_is_no_number_is_named(key: str, tmp_path: Path) -> None:
    image = io.BytesIO()
    write_dng(image, raw(np.zeros((HEIGHT, WIDTH))))
    with tarfile.open(shard_path(tmp_path, 0), "w") as tar:
        member = tarfile.TarInfo(f"{key}.clean.dng")
        member.size = len(image.getvalue())
        tar.addfile(member, io.BytesIO(image.getvalue()))
    assert [mosaic.scene for mosaic in index_mosaics(tmp_path)] == [0]
    save_settings(DatasetConfig(0, 4, GenerateConfig()), tmp_path / "config.yaml")
    with pytest.raises(FsidError, match=r"shard-00000\.tar: '.*' is no key") as caught:
        index_mosaics(tmp_path)
    assert key in str(caught.value)


@pytest.mark.parametrize(
    ("settings", "named"),
    [
        *((f"generate: {value}", "generate") for value in ("null", "[]", "{crops: x}")),
        *((f"pictures: {value}", "pictures") for value in ("x", "[1]", "null", ".nan", ".inf", "-1")),
    ],
)
def test_settings_that_say_nothing_are_named(settings: str, named: str, dataset: Path) -> None:
    (dataset / "config.yaml").write_text(settings)
    with pytest.raises(FsidError, match=rf"config\.yaml: {named}"):
        index_mosaics(dataset)


@pytest.mark.parametrize(("black", "white"), [(500, 500), (0, 0), (900, 800)])
def test_levels_that_are_no_range_are_named(
    black: int, white: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    quantise = sys.modules["fsid.sensor.quantise"]
    monkeypatch.setattr(quantise, "check_levels", lambda *_: None)  # else it is not written
    monkeypatch.setattr(Raw, "_check_levels", lambda _: None)
    image = replace(raw(np.zeros((HEIGHT, WIDTH))), black_level=black, white_level=white)
    write_dataset(tmp_path, [image])
    monkeypatch.undo()
    with pytest.raises(
        FsidError, match=rf"00000000\.clean\.dng: black level {black} and white level {white}"
    ):
        index_mosaics(tmp_path)


@pytest.mark.parametrize(("numerator", "named"), [(6400, ""), (6450, r"states 64\.5; one whole number")])
def test_levels_are_what_a_rational_says(numerator: int, named: str, tmp_path: Path) -> None:
    """Black levels as phones state them: 6400 / 100 is 64, and no training takes 64.5 for another number."""
    file = tmp_path / "phone.dng"
    write_dng(file, raw(np.full((HEIGHT, WIDTH), 30_000), black=64))
    state_black(file, numerator, 100)
    write_shard(shard_path(tmp_path, 0), [("00000000", {"clean.dng": file.read_bytes()})])
    if named:
        with pytest.raises(FsidError, match=rf"00000000\.clean\.dng is not a DNG of this dataset .*{named}"):
            index_mosaics(tmp_path)
    else:
        assert index_mosaics(tmp_path)[0].black_level == read_raw(file).black_level == 64


@pytest.mark.parametrize("k", [-1e-3, 5.0])
def test_stored_noise_that_cannot_be_is_named(k: float, tmp_path: Path) -> None:
    """Of a variance below 0 the network makes NaN, and NaN of itself."""
    clean = raw(np.full((HEIGHT, WIDTH), 30_000))
    write_pairs(tmp_path, [clean], [replace(clean, noise=NoiseLevel((k,) * 4, (1e-5,) * 4))])
    with pytest.raises(FsidError, match=rf"00000000\.noisy\.dng: .*{k}.* are variances"):
        PatchDataset(tmp_path, replace(CONFIG, noise="stored"), seed=0)


@pytest.mark.parametrize(
    ("tag", "named"),
    [
        ((50829, "I", 4, (0, 0, HEIGHT, WIDTH)), ""),
        ((50829, "I", 4, (3, 5, HEIGHT, WIDTH)), "an active area"),
        ((50716, "2i", HEIGHT, (0, 1) * HEIGHT), ""),
        ((50716, "2i", HEIGHT, (3, 1) * HEIGHT), "black levels of rows or columns"),
        ((50715, "2i", WIDTH, (-3, 2) * WIDTH), "black levels of rows or columns"),
        ((50712, "H", 2, (0, 700)), "a linearization table"),
    ],
)
def test_pixels_that_are_not_what_is_stored_are_refused(tag: tuple, named: str, tmp_path: Path) -> None:
    """As the masked margins of a stranger's DNG, which were trained on as black parts of a clean image."""
    cfa, levels = (33422, "B", 4, (0, 1, 1, 2)), [(50714, "H", 1, 64), (50717, "H", 1, 1023)]
    tags = [(*each, True) for each in (cfa, *levels, tag)]
    page, file = np.full((HEIGHT, WIDTH), 300, np.uint16), io.BytesIO()
    tifffile.imwrite(file, page, photometric=32803, byteorder="<", extratags=tags)
    write_shard(shard_path(tmp_path, 0), [("00000000", {"clean.dng": file.getvalue()})])
    if named:
        with pytest.raises(FsidError, match=rf"clean\.dng states {named}.*; rewrite it with read_raw"):
            index_mosaics(tmp_path)
    else:
        assert index_mosaics(tmp_path)[0].black_level == 64


@pytest.mark.parametrize("how", [{"byteorder": ">"}, {"rowsperstrip": 8}, {"compression": "zlib"}])
def test_pixels_that_are_no_plain_strip_are_refused(how: dict, tmp_path: Path) -> None:
    """They are mapped from the file: other bytes would be trained on as noise."""
    tags = [(33422, "B", 4, (0, 1, 1, 2)), (50714, "H", 1, 64), (50717, "H", 1, 1023)]
    page, file = np.full((HEIGHT, WIDTH), 300, np.uint16), io.BytesIO()
    tagged = [(*each, True) for each in tags]
    tifffile.imwrite(file, page, photometric=32803, extratags=tagged, **({"byteorder": "<"} | how))
    write_shard(shard_path(tmp_path, 0), [("00000000", {"clean.dng": file.getvalue()})])
    with pytest.raises(FsidError, match="is not one uncompressed little-endian uint16 strip"):
        index_mosaics(tmp_path)


def addresses(tmp_path: Path, per_shard: tuple[int, ...]) -> Path:
    """Mosaics whose pixels carry their own address, in shards of different sizes."""
    number = 0
    for shard, count in enumerate(per_shard):
        samples = []
        for _ in range(count):
            pixels = (
                np.arange(HEIGHT * WIDTH, dtype=np.uint16).reshape(HEIGHT, WIDTH) + number * HEIGHT * WIDTH
            )
            buffer = io.BytesIO()
            write_dng(buffer, raw(pixels))
            samples.append((f"{number:08d}", {"clean.dng": buffer.getvalue(), "json": b"{}"}))
            number += 1
        write_shard(shard_path(tmp_path, shard), samples)
    return tmp_path


def pixels_of(batch: Batch) -> list[np.ndarray]:
    return [np.rint(patch.numpy() * 65535).astype(int).ravel() for patch in batch.clean]


@pytest.mark.parametrize(("world", "size"), [(1, 3), (2, 3), (3, 2), (5, 4)])
def test_an_epoch_has_every_patch_once_on_whatever_ranks(world: int, size: int, tmp_path: Path) -> None:
    """Uneven shards, and batches and ranks that do not divide the number of patches."""
    data = addresses(tmp_path, (1, 4, 2, 1))
    config = replace(CONFIG, size_px=6, batch=size)
    ranks = [PatchDataset(data, config, seed=1, rank=rank, world=world) for rank in range(world)]
    total = ranks[0].patches
    assert total == 8 * (HEIGHT // 14) * (WIDTH // 14)
    steps = -(-total // (world * size))
    epoch = [patch for step in range(steps) for rank in ranks for patch in pixels_of(rank[step])][:total]
    seen = np.concatenate(epoch)
    assert len(np.unique(seen)) == len(seen) == total * 4 * 6 * 6
    following = [
        patch for step in range(steps, 2 * steps) for rank in ranks for patch in pixels_of(rank[step])
    ]
    assert {patch.min() for patch in following[:total]} != {patch.min() for patch in epoch}


def test_the_cells_start_elsewhere_in_every_epoch(dataset: Path) -> None:
    """40 and 60 pixels hold two and four cells of 14: what is left, 12 and 4, is before them in any share."""
    grid = Grid(index_mosaics(dataset), size_px=6)
    starts = np.array([grid.cell(grid.patches * epoch, seed=1).corner for epoch in range(400)]) % grid.pitch
    for axis, left in enumerate((HEIGHT % 14, WIDTH % 14)):
        counts = np.bincount(starts[:, axis], minlength=left + 1)
        assert len(counts) == left + 1
        assert counts.min() > 0.4 * counts.mean()


def test_rows_and_columns_of_a_square_start_by_themselves(tmp_path: Path) -> None:
    grid = Grid(index_mosaics(write_dataset(tmp_path, [raw(np.zeros((40, 40), int))])), size_px=6)
    starts = np.array([grid.cell(grid.patches * epoch, seed=1).corner for epoch in range(400)]) % grid.pitch
    assert abs(np.corrcoef(starts.T)[0, 1]) < 0.2


def test_every_epoch_has_an_order_of_its_own(dataset: Path) -> None:
    grid = Grid(index_mosaics(dataset), size_px=6)
    cells = [grid.cell(place, seed=1) for place in range(2 * grid.patches)]
    order = [(cell.mosaic.key, cell.corner[0] // grid.pitch, cell.corner[1] // grid.pitch) for cell in cells]
    first, second = order[: grid.patches], order[grid.patches :]
    assert sorted(first) == sorted(second)
    assert first != second


def test_a_cell_has_only_whole_tiles_of_an_image_made_smaller(tmp_path: Path) -> None:
    """30 rows become 15, of which 14 are tiles: there is one place for a cell of 14."""
    data = write_dataset(tmp_path, [raw(np.zeros((30, 2 * WIDTH), int))])
    grid = Grid(index_mosaics(data), size_px=6, shrink=2)
    for position in range(100):
        rows, _ = grid.cell(position, seed=1).window
        assert (rows.start, rows.stop) == (0, 28)


def test_every_length_is_permuted() -> None:
    for length in (1, 2, 3, 64, 100, 1000):
        orders = [[shuffled(place, length, seed, epoch) for place in range(length)] for seed, epoch in SEEDS]
        assert all(sorted(order) == list(range(length)) for order in orders)
    assert len({tuple(order) for order in orders}) == len(SEEDS)


SEEDS = ((0, 0), (0, 1), (1, 0))


def test_numbers_may_be_those_of_numpy(dataset: Path) -> None:
    config = replace(CONFIG, size_px=np.int64(16), batch=np.int64(3), iso_min=np.float64(400))
    patches = PatchDataset(dataset, config, np.int64(0), rank=np.int64(0), world=np.int64(1))
    assert equal(patches[np.int64(5)], PatchDataset(dataset, CONFIG, seed=0)[5])
    with pytest.raises(FsidError, match=r"^size_px: 16\.0 is not a whole number"):
        PatchDataset(dataset, replace(CONFIG, size_px=16.0), seed=0)


@pytest.mark.parametrize("wrong", [{"size_px": 0}, {"batch": 0}, {"noise": "Fresh"}, {"split": "test"}])
def test_patches_that_are_none_are_refused(wrong: dict) -> None:
    with pytest.raises(FsidError, match=next(iter(wrong))):
        replace(CONFIG, **wrong)


def test_neighbours_of_an_order_are_unrelated() -> None:
    order = np.array([shuffled(place, 4096, 5, 2) for place in range(4096)])
    assert abs(np.corrcoef(order[:-1], order[1:])[0, 1]) < 0.05
    assert abs(np.corrcoef(order, np.arange(4096))[0, 1]) < 0.05


def test_real_processes_share_an_epoch(tmp_path: Path) -> None:
    """torch.distributed (gloo) tells each of two processes how many there are, and which one it is."""
    (tmp_path / "data").mkdir()
    data = addresses(tmp_path / "data", (1, 4))
    store = f"file://{tmp_path / 'store'}"
    torch.multiprocessing.spawn(take_part, (2, store, data, tmp_path), nprocs=2)
    first, second = (set(np.load(tmp_path / f"{rank}.npy").tolist()) for rank in range(2))
    assert first
    assert second
    assert not first & second


def take_part(rank: int, world: int, store: str, data: Path, out: Path) -> None:
    torch.distributed.init_process_group("gloo", init_method=store, rank=rank, world_size=world)
    patches = PatchDataset(data, replace(CONFIG, size_px=6), seed=1)
    steps = patches.patches // (world * CONFIG.batch)
    np.save(
        out / f"{rank}.npy", np.concatenate([np.concatenate(pixels_of(patches[s])) for s in range(steps)])
    )
    torch.distributed.destroy_process_group()


def test_stored_noise_comes_with_its_level(tmp_path: Path, rng: np.random.Generator) -> None:
    """Gr and Gb have levels far apart, so that a transpose that forgets them is seen."""
    level = NoiseLevel(k=(1e-3, 2e-3, 8e-3, 4e-3), sigma2=(1e-6,) * 4)
    grey = [raw(np.full((400, 600), 0.3 * 65535), cfa) for cfa in CFA_PATTERNS]
    noisy = [replace(add_noise(rng, image, level), iso=800.0) for image in grey]
    config = replace(CONFIG, size_px=32, batch=64, noise="stored")
    batch = PatchDataset(write_pairs(tmp_path, grey, noisy), config, seed=1)[0]
    measured = (batch.noisy - batch.clean).square().mean((2, 3))
    torch.testing.assert_close(measured, batch.k * 0.3 + batch.sigma2, rtol=0.25, atol=0)
    assert len(batch.k.unique(dim=0)) == 2


@pytest.mark.parametrize(("width", "cfa"), [(WIDTH - 2, "RGGB"), (WIDTH, "BGGR")])
def test_stored_noise_of_another_size_or_pattern_is_no_pair(width: int, cfa: str, tmp_path: Path) -> None:
    """One window is cut out of both: R of the one would be B of the other."""
    level = NoiseLevel(k=(1e-3,) * 4, sigma2=(1e-6,) * 4)
    noisy = replace(raw(np.full((HEIGHT, width), 9000), cfa), noise=level)
    data = write_pairs(tmp_path, [raw(np.full((HEIGHT, WIDTH), 9000))], [noisy])
    with pytest.raises(FsidError, match=r"00000000 is no denoising pair, .* in size or CFA"):
        PatchDataset(data, replace(CONFIG, noise="stored"), seed=0)


def test_stored_noise_of_a_blurred_image_is_no_noise(tmp_path: Path) -> None:
    """Its difference from the clean one is blur as well; fresh noise needs clean images alone."""
    image = raw(np.full((HEIGHT, WIDTH), 9000))
    data = write_pairs(tmp_path, [image], [replace(image, noise=NoiseLevel((1e-3,) * 4, (1e-6,) * 4))])
    with tarfile.open(shard_path(data, 0)) as tar:
        names = tar.getnames()
        files = {name.partition(".")[2]: tar.extractfile(name).read() for name in names}
    write_shard(shard_path(data, 0), [("00000000", {**files, "degraded.dng": files["clean.dng"]})])
    with pytest.raises(FsidError, match=r"shard-00000\.tar: noisy images of --task deblur"):
        PatchDataset(data, replace(CONFIG, noise="stored"), seed=0)
    PatchDataset(data, CONFIG, seed=0)


def test_stored_noise_that_does_not_exist_is_named(dataset: Path) -> None:
    with pytest.raises(FsidError, match=r"no \*\.noisy\.dng"):
        PatchDataset(dataset, replace(CONFIG, noise="stored"), seed=0)


def test_validation_scenes_and_held_out_ones_are_not_drawn(dataset: Path) -> None:
    settings = GenerateConfig(width=WIDTH, height=HEIGHT, validation_every=3)
    save_settings(DatasetConfig(0, 2, settings), dataset / "config.yaml")
    assert [mosaic.split for mosaic in index_mosaics(dataset)] == ["train", "train", "validation", "train"]
    assert PatchDataset(dataset, CONFIG, seed=0).mosaics == 3
    save_settings(DatasetConfig(0, 2, settings, pictures=2), dataset / "config.yaml")
    of_pictures = [(mosaic.scene, mosaic.split) for mosaic in index_mosaics(dataset)]
    assert of_pictures == [(0, "train"), (1, "train")] * 2  # the third frame is of the first picture again
    pairs = replace(settings, validation_every=0, noise_levels=2)
    save_settings(DatasetConfig(0, 2, pairs), dataset / "config.yaml")
    assert [mosaic.scene for mosaic in index_mosaics(dataset)] == [0, 0, 1, 1]
    assert PatchDataset(dataset, replace(CONFIG, held_out=1), seed=0).mosaics == 2
    assert PatchDataset(dataset, CONFIG, seed=0, without={0, 9}).mosaics == 2


def test_validation_patches_are_of_exactly_the_images_that_training_leaves_out(tmp_path: Path) -> None:
    """Twelve images of six scenes, of which each third is for validation, and the last image is held out."""
    data = addresses(tmp_path, (5, 7))
    settings = GenerateConfig(width=WIDTH, height=HEIGHT, validation_every=3, noise_levels=2)
    save_settings(DatasetConfig(0, 4, settings), data / "config.yaml")
    config = replace(CONFIG, size_px=6, batch=8, held_out=3)
    seen = {}
    for split in ("train", "validation"):
        patches = PatchDataset(data, replace(config, split=split), seed=0)
        steps = range(-(-patches.patches // config.batch))
        seen[split] = {int(p[0]) // (HEIGHT * WIDTH) for step in steps for p in pixels_of(patches[step])}
    assert seen == {"train": {0, 1, 2, 3, 6, 7}, "validation": {4, 5, 8, 9, 10, 11}}
    save_settings(DatasetConfig(0, 4, replace(settings, validation_every=0)), data / "config.yaml")
    with pytest.raises(FsidError, match="none of its images is for validation; set held_out"):
        PatchDataset(data, replace(config, held_out=0, split="validation"), seed=0)


def test_a_batch_moves_as_a_whole(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    batch = PatchDataset(dataset, CONFIG, seed=0)[0]
    assert all(tensor.device.type == "meta" for tensor in batch.to("meta").tensors)
    monkeypatch.setattr(torch.Tensor, "pin_memory", lambda tensor: tensor + 1)  # what needs a GPU
    pinned = batch.pin_memory()
    assert all(torch.equal(pin, own + 1) for pin, own in zip(pinned.tensors, batch.tensors, strict=True))


def test_the_table_of_levels_is_the_profile(rng: np.random.Generator) -> None:
    """Log-uniform ISO, jitter as `level_rand` has it, and levels that the profile gives for that ISO."""
    camera, count = load_profile("pixel6"), 20_000
    drawn = LevelTable([camera], (400, 6400)).draw_rand(rng, count)
    assert not drawn[0].any()
    expected = [level_rand(rng, camera, (400, 6400))[1] for _ in range(2000)]
    for found, name in zip(drawn[1:], ("k", "sigma2"), strict=True):
        wanted = np.array([getattr(level, name) for level in expected])
        shares = np.linspace(0.05, 0.95, 10)
        np.testing.assert_allclose(
            np.quantile(np.log(found), shares, axis=0), np.quantile(np.log(wanted), shares, axis=0), atol=0.2
        )
    calm = LevelTable([camera], (1000, 1000)).draw_rand(rng, count)
    level = camera.level(1000)
    for found, wanted, jitter in ((calm[1], level.k, K_JITTER), (calm[2], level.sigma2, SIGMA2_JITTER)):
        scatter = np.log(found / wanted)
        np.testing.assert_allclose(np.median(scatter, axis=0), 0, atol=0.05 * jitter)
        np.testing.assert_allclose(scatter.std(axis=0), jitter, rtol=0.03)
        assert np.ptp(scatter, axis=1).max() < 1e-5  # of the unit, not of a site
    assert abs(np.corrcoef(calm[1][:, 0], calm[2][:, 0])[0, 1]) < 0.03
    dark = LevelTable([camera, load_profile("galaxy-s22")], (50, 100)).draw_rand(rng, count)
    assert dark[2][dark[0] == 0].min() * camera.span**2 == pytest.approx(1 / 12)  # rounding
