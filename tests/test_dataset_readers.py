"""A finished dataset: its card, and the libraries that others read it with."""

from __future__ import annotations

import io
import json
import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rawpy
from PIL import Image

from fsid.config import from_plain, load_settings
from fsid.dataset import DatasetConfig, GenerateConfig, generate, shard_path, write_shard
from fsid.dataset.card import _listed, _sources, _Tally
from fsid.dataset.inspect import inspect
from fsid.dataset.shards import read_records, read_samples
from fsid.dataset.statistics import TITLES
from fsid.errors import FsidError
from fsid.scene import SceneConfig
from fsid.yaml_json import read_yaml

SETTINGS = ["width=64", "height=48", "texture_size=64", "supersampling=1", "scene.objects=[1,3]"]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six pairs of three scenes with different backgrounds and lenses, in two shards."""
    folder = tmp_path_factory.mktemp("readers") / "data"
    varied = ["scene.background.kind_shares=[0.4,0.2,0.2,0.2]", "scene.lens.distortion_share=0.5"]
    families = "scene.material_families=[brick,paint,carpet]"
    config = load_settings(
        GenerateConfig, None, [*SETTINGS, *varied, families, "noise_levels=2", "validation_every=3"]
    )
    generate(folder, config, count=6, seed=2, shard_size=4, command="fsid generate data --count 6")
    return folder


def test_plain_webdataset_reads_it(data: Path) -> None:
    webdataset = pytest.importorskip("webdataset")
    shards = [str(shard_path(data, number)) for number in range(2)]
    samples = list(webdataset.WebDataset(shards, shardshuffle=False))
    assert [sample["__key__"] for sample in samples] == [f"{i:08d}" for i in range(6)]
    with rawpy.imread(io.BytesIO(samples[5]["noisy.dng"])) as raw:
        assert raw.raw_image.shape == (48, 64)


@pytest.mark.parametrize("streaming", [False, True])
def test_hugging_face_datasets_reads_it(data: Path, streaming: bool, tmp_path: Path) -> None:
    """It infers the form of all records from the first five, and a record is of what its scene has."""
    datasets = pytest.importorskip("datasets")
    datasets.disable_progress_bars()
    stored = [files for number in range(2) for files in read_samples(shard_path(data, number)).values()]
    kinds = [json.loads(files["json"])["scene"]["background"]["kind"] for files in stored]
    first, other = kinds.index(kinds[0]), next(i for i, kind in enumerate(kinds) if kind != kinds[0])
    in_order = [stored[first]] * 5 + [stored[other]]
    write_shard(shard_path(tmp_path, 0), [(f"{i:08d}", files) for i, files in enumerate(in_order)])
    columns = {"__key__": datasets.Value("string"), "__url__": datasets.Value("string")}
    columns |= {"clean.dng": datasets.Value("binary"), "noisy.dng": datasets.Value("binary")}
    rows = datasets.load_dataset(
        "webdataset",
        data_files={"train": str(tmp_path / "shard-*.tar")},
        split="train",
        streaming=streaming,
        cache_dir=str(tmp_path),
        features=datasets.Features({**columns, "rgb.png": datasets.Image(), "json": datasets.Json()}),
    )
    samples = list(rows)
    assert [sample["__key__"] for sample in samples] == [f"{i:08d}" for i in range(6)]
    assert isinstance(samples[0]["rgb.png"], Image.Image)
    for sample, files in zip(samples, in_order, strict=True):
        texts = (json.dumps(sample["json"]), files["json"])
        read, written = (json.loads(text, parse_float=lambda _: "rounded") for text in texts)
        assert read == written
    with rawpy.imread(io.BytesIO(samples[5]["clean.dng"])) as raw:
        assert raw.raw_image.shape == (48, 64)


def test_the_card_says_what_is_there(data: Path) -> None:
    card = (data / "README.md").read_text()
    for line in (
        "6 pairs for denoise, 64 x 48 pixels at most, from 3 rendered scenes",
        "| train | 4 pairs |",
        "| validation | 2 pairs |",
        "fsid generate data --count 6",
        "FSID's own meshes (Apache-2.0",
    ):
        assert line in card
    with Image.open(data / "samples.png") as sheet:
        assert sheet.width > 64


def test_a_card_is_written_when_all_is_there_and_only_then(data: Path) -> None:
    before = {name: (data / name).read_bytes() for name in ("README.md", "samples.png")}
    shard = shard_path(data, 1)
    stored = shard.read_bytes()
    shard.unlink()
    config = load_settings(GenerateConfig, None, ())
    with pytest.raises(FsidError, match="already holds another dataset"):
        generate(data, config, count=6, seed=2, shard_size=4)
    from fsid.config import from_plain
    from fsid.dataset import DatasetConfig
    from fsid.yaml_json import read_yaml

    same = from_plain(DatasetConfig, read_yaml(data / "config.yaml"), source="config.yaml").generate
    generate(data, same, count=6, seed=2, shard_size=4, command="fsid generate data --count 6")
    assert shard.read_bytes() == stored
    assert {name: (data / name).read_bytes() for name in before} == before


def test_the_card_states_what_inspect_measures(tmp_path: Path, rng: np.random.Generator) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for i in range(2):
        Image.fromarray(rng.integers(0, 255, (320, 320, 3), np.uint8)).save(pictures / f"{i}.png")
    generate(tmp_path / "data", GenerateConfig(images=str(pictures), width=144, height=144), count=2)
    card = (tmp_path / "data" / "README.md").read_text()
    measured = inspect(tmp_path / "data").values
    assert "Means over 2 of the clean images" in card
    for name, title in TITLES.items():
        assert f"| {title} | {measured[name].mean():.3g} |" in card


def test_the_card_counts_what_the_checks_refused(tmp_path: Path, rng: np.random.Generator) -> None:
    """Pictures of 32 pixels, most of them black: windows of them are drawn until one is not."""
    pixels = np.zeros((32, 400, 3), np.uint8)
    pixels[:, 300:] = rng.integers(40, 200, (32, 100, 3), np.uint8)
    Image.fromarray(pixels).save(tmp_path / "mostly-black.png")
    generate(tmp_path / "data", GenerateConfig(images=str(tmp_path), width=32, height=32), count=4, seed=3)
    refused = [record["refused"] for record in read_records(shard_path(tmp_path / "data", 0))]
    times = sum(map(len, refused))
    assert times > 0
    card = (tmp_path / "data" / "README.md").read_text()
    assert f"| refused by the checks | {times} of {4 + times} frames: black ({times}) times |" in card


def test_the_card_counts_pictures_once_and_has_nothing_of_scenes_where_there_are_none(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    for i in range(2):
        Image.fromarray(rng.integers(40, 200, (64, 64, 3), np.uint8)).save(tmp_path / f"{i}.png")
    generate(tmp_path / "data", GenerateConfig(images=str(tmp_path), width=32, height=32), count=5)
    card = (tmp_path / "data" / "README.md").read_text()
    assert "5 pairs for denoise, 32 x 32 pixels at most, from 2 pictures (seed 0)" in card
    assert "| variant |" not in card
    assert "| backgrounds |" not in card


def with_changes(data: Path, out: Path, extension: str, changed: Callable[[bytes], bytes]) -> Path:
    """A copy of a dataset without its card; its first shard's files of that kind are changed."""
    shutil.copytree(data, out)
    (out / "README.md").unlink()
    shard = shard_path(out, 0)
    samples = read_samples(shard)
    for files in samples.values():
        files[extension] = changed(files[extension])
    write_shard(shard, samples.items())
    return out


def again(out: Path) -> None:
    same = from_plain(DatasetConfig, read_yaml(out / "config.yaml"), source="config.yaml").generate
    generate(out, same, count=6, seed=2, shard_size=4)


@pytest.mark.parametrize(
    "preview", [b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", b"\x89PNG\r\n\x1a\n"]
)
def test_a_preview_that_is_none_is_named(data: Path, tmp_path: Path, preview: bytes) -> None:
    """Pillow would have Ghostscript run PostScript, and what it cannot read was a traceback."""
    out = with_changes(data, tmp_path / "data", "rgb.png", lambda _: preview)
    with pytest.raises(FsidError, match=r"shard-00000\.tar: 00000000\.rgb\.png: is no readable PNG"):
        again(out)


@pytest.mark.parametrize("change", [{"iso": 10**400}, {"frame": []}, {"refused": 3}, {"camera": None}])
def test_records_that_say_anything_end_no_card_in_a_traceback(
    data: Path, tmp_path: Path, change: dict[str, object]
) -> None:
    def changed(record: bytes) -> bytes:
        return json.dumps(json.loads(record) | change).encode()

    out = with_changes(data, tmp_path / "data", "json", changed)
    if "camera" in change:  # beside cameras that are texts
        again(out)
        assert "None (4)" in (out / "README.md").read_text()
        return
    with pytest.raises(FsidError, match=r"shard-00000\.tar: the JSON of a sample is not of fsid generate"):
        again(out)


def test_the_card_shows_what_others_wrote_as_text() -> None:
    """A licence or a camera's name may hold HTML, links and line ends."""
    names = Counter(["<img src=x>", "[a](javascript:b)", "c\n# d", "phone_6+dirt"])
    shown = _listed(names, "uses")
    assert shown == r"\<img src=x> (1), \[a](javascript:b) (1), c # d (1), phone_6+dirt (1) uses"


def boxes(*files: Path) -> None:
    import trimesh

    for file in files:
        file.parent.mkdir(parents=True, exist_ok=True)
        trimesh.creation.box((0.3, 0.2, 0.1)).export(file)


def test_licences_of_meshes_are_counted_by_use(tmp_path: Path) -> None:
    folders = [tmp_path / name for name in ("a", "b!c")]
    boxes(*(folder / "box.glb" for folder in folders))
    (folders[0] / "LICENSE.txt").write_text("CC0 1.0 Universal\n")
    (tmp_path / "LICENSE").write_text("MIT License\n")  # of what the folders lie in, not of the meshes
    most = 10**15  # so many cannot be counted one by one
    used = Counter({f"file:{folder / 'box.glb'}": n for folder, n in zip(folders, (most, 2), strict=True)})
    scene = SceneConfig(mesh_folders=tuple(map(str, folders)))
    stated, unknown = _sources(_Tally({"mesh": used}), scene)
    assert f"{most} uses. Licences: CC0 ({most}) uses." in stated
    assert f"`{folders[1]}`: 2 uses. No licence file was found" in unknown


def test_a_folder_of_sources_is_one_line_with_the_licences_nearest_to_its_files(tmp_path: Path) -> None:
    meshes, textures = tmp_path / "meshes", tmp_path / "textures"
    files = [meshes / "c.obj", meshes / "toys/b.obj", meshes / "furniture/chairs/a.obj"]
    boxes(*files)
    textures.mkdir()
    for folder, text in (
        (meshes / "toys", "CC BY 4.0"),
        (meshes / "furniture", "CC0"),
        (textures, "My own terms"),
    ):
        (folder / "LICENSE.txt").write_text(text)
    used = Counter({f"file:{file}": n for file, n in zip(files, (1, 20, 300), strict=True)})
    used["file:/gone/d.obj"] = 4  # of a folder that has moved since
    materials = Counter({f"file:{textures / 'wood'}+dirt": 5})
    scene = SceneConfig(mesh_folders=(str(meshes),), texture_folders=(str(textures),))
    gone, stated, wood = _sources(_Tally({"mesh": used, "material": materials}), scene)
    assert stated == (
        f"- meshes from `{meshes}`: 321 uses. Licences: CC0 (300), CC BY 4.0 (20) uses. "
        "With 1 of them no licence file was found: look at their source before you publish."
    )
    assert gone.startswith("- meshes from `/gone`: 4 uses. No licence file was found")
    assert wood == f"- materials from `{textures}`: 5 uses. Licences: My own terms (5) uses."
