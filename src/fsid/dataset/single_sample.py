"""One sample again, as loose files: from a dataset's settings and a key, or from the sample's JSON alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from fsid import __version__
from fsid.config import from_plain
from fsid.dataset.attempt import SAMPLE_KEY, Sample, sample_key
from fsid.dataset.config import DATASET_FILE, DatasetConfig, GenerateConfig
from fsid.dataset.identity import check_same_origins, dataset_config, is_begun
from fsid.dataset.sample import encode, make_sample, remake
from fsid.dataset.shards import read_record, read_records, shard_path
from fsid.dataset.worker import rendering
from fsid.errors import FsidError
from fsid.files import make_folder, read_whole, write_atomically
from fsid.yaml_json import read_yaml


def make_only(
    out: str | Path,
    key: str,
    config: GenerateConfig | None,
    seed: int | None,
    note: Callable[[str], None] = lambda line: None,
) -> list[Path]:
    """Make the sample `key` into `out` as KEY.clean.dng, KEY.noisy.dng ...; the paths of its files.

    key: of a sample, or the path of its .json. config, seed: of the dataset; None takes those of the dataset
    in `out`, or the defaults where there is none. Where the sample is in a shard of `out`, its record says
    what it is, redrawn or not. note(line) is called where there are shards and none of them has it, and where
    another version of FSID made it.
    FsidError: unusable key or settings, or others than those of the dataset.
    """
    out = Path(out)
    make_folder(out)
    sample = _from_json(Path(key), note) if key.endswith(".json") else _from_key(out, key, config, seed, note)
    paths = []
    for extension, data in encode(sample).items():
        paths.append(out / f"{sample.key}.{extension}")
        write_atomically(paths[-1], data)
    return paths


def _from_json(file: Path, note: Callable[[str], None]) -> Sample:
    return _remake(read_record(read_whole(file), str(file)), str(file), note)


def _from_key(
    out: Path, key: str, config: GenerateConfig | None, seed: int | None, note: Callable[[str], None]
) -> Sample:
    if not SAMPLE_KEY.fullmatch(key):
        raise FsidError(f"--only {key}: is neither the key of a sample, like 00000012, nor a .json file")
    index, file = int(key), out / DATASET_FILE
    if file.exists():
        dataset = from_plain(DatasetConfig, read_yaml(file), source=str(file))
        if seed not in (None, dataset.seed):
            raise FsidError(f"{out}: holds a dataset of another seed; leave it out")
        if config not in (None, dataset.generate):  # folders that have moved since, or a refusal
            is_begun(out, dataset_config(config, dataset.seed, dataset.shard_size))
        else:
            check_same_origins(out, dataset)
            config = dataset.generate
        seed = dataset.seed
        shard = shard_path(out, index // dataset.shard_size)
        records = read_records(shard) if shard.exists() else iter(())
        try:
            found = next((record for record in records if record["index"] == index), None)
        except KeyError:
            raise FsidError(
                f"{shard}: a sample's JSON states no index; delete it and generate again"
            ) from None
        if found is not None:
            settings = found.get("settings")
            if config.images and isinstance(settings, dict):
                found = found | {"settings": settings | {"images": config.images}}
            return _remake(found, f"{shard}: sample {index}", note)
        if any(out.glob("shard-*.tar")):
            note(f"no shard of {out} has sample {sample_key(index)} yet; this is what it would be")
    config, seed = config or GenerateConfig(), seed or 0
    dataset_config(config, seed)  # names what does not exist
    with rendering(config) as renderer:
        return make_sample(config, seed, index, renderer)


def _remake(record: dict[str, Any], where: str, note: Callable[[str], None]) -> Sample:
    version = record.get("fsid_version", __version__)
    if version != __version__:
        note(f"{where} was made by fsid {version!s:.40}, this is {__version__}: its files may be others")
    config = from_plain(GenerateConfig, record.get("settings"), source=f"{where}: settings")
    with rendering(config) as renderer:
        try:
            return remake(record, renderer)
        except FsidError as error:
            raise FsidError(f"{where}: {error}") from None
