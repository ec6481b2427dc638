"""Where every mosaic of a dataset lies, so that pixels can be read without opening a file again.

    byte of pixel (i, j) = tar member offset + DNG strip offset + 2 (i W + j)

The DNGs inside the shards hold one uncompressed strip of little-endian uint16, so a mosaic is a window of the
tar file. Indexing reads tar and TIFF headers only, and where there is no config.yaml the samples' JSON.
"""

from __future__ import annotations

import hashlib
import operator
import tarfile
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tifffile

from fsid.config import from_plain
from fsid.dataset.attempt import SAMPLE_KEY
from fsid.dataset.config import DATASET_FILE, DatasetConfig, split_of
from fsid.dataset.shards import find_shards, open_shard, read_heads
from fsid.errors import FsidError
from fsid.evenly_spaced import spaced
from fsid.files import read_whole, stamp
from fsid.sensor import dng_tags
from fsid.sensor.mosaic import check_cfa
from fsid.sensor.quantise import check_levels
from fsid.sensor.raw import NoiseLevel
from fsid.sensor.tiff import quotients
from fsid.yaml_json import read_yaml

_ORIGIN_KEYS = ("crops", "exposures", "noise_levels", "validation_every")
"""Settings that say which scene a sample is from; others may be those of another version of FSID."""

MosaicKind = Literal["clean", "noisy"]


@dataclass(frozen=True)
class StoredMosaic:
    """One mosaic inside a shard: (height, width) uint16 at byte `offset` of the file `shard`.

    noise: None where the DNG states none. scene: number of the scene or picture that it is from; split:
    "train" or "validation", by scene. stamp: of the file, before it was read.
    """

    shard: Path
    key: str
    offset: int
    height: int
    width: int
    cfa: str
    black_level: int
    white_level: int
    noise: NoiseLevel | None = None
    scene: int = 0
    split: str = "train"
    stamp: tuple[int, ...] = ()

    def levels(self) -> np.ndarray:
        """Its DN: (height, width) uint16, mapped from the file. FsidError as `opened`."""
        return self.in_map(self.opened())

    def opened(self) -> np.ndarray:
        """All bytes of the file, mapped. FsidError where it is not the one that was indexed: in a shard that
        was written again pixels lie elsewhere."""
        mapped = np.memmap(self.shard, np.uint8, mode="r").view(np.ndarray)
        if _stamp(self.shard) != self.stamp:
            raise FsidError(f"{self.shard}: has changed since it was indexed; run the same command again")
        return mapped

    def in_map(self, mapped: np.ndarray) -> np.ndarray:
        """Its DN: (height, width) uint16, of all bytes of the file."""
        end = self.offset + 2 * self.height * self.width
        return mapped[self.offset : end].view("<u2").reshape(self.height, self.width)


def index_mosaics(data_dir: str | Path, kind: MosaicKind = "clean") -> tuple[StoredMosaic, ...]:
    """All mosaics of one kind in `data_dir`/shard-*.tar, in the order of shards and samples.

    The dataset read last is remembered until one of its files changes: a training asks more than once, and
    each image costs a millisecond. Raises FsidError where there is no shard, no sample, a key that comes
    twice, or a shard or DNG that is not readable as described above.
    """
    data_dir = Path(data_dir)
    shards = tuple(find_shards(data_dir))
    return _index(data_dir, kind, shards, tuple(map(stamp, (*shards, data_dir / DATASET_FILE))))


def some_mosaics(data_dir: Path, limit: int) -> list[StoredMosaic]:
    """Clean mosaics of `data_dir`, evenly spaced, at most `limit` of as many shards; no other is opened.

    Scene and split are not looked up. FsidError where these shards hold none, or as `index_mosaics`.
    """
    shards = spaced(find_shards(data_dir), limit)
    found = [mosaic for shard in shards for mosaic in _index_shard(shard, ".clean.dng")]
    if not found:
        raise _nothing_in(data_dir, "clean")
    return spaced(found, limit)


def _nothing_in(data_dir: Path, kind: MosaicKind) -> FsidError:
    return FsidError(
        f"{data_dir}: its shards hold no *.{kind}.dng; make the dataset again with `fsid generate`"
    )


@lru_cache(maxsize=2)  # clean and noisy mosaics
def _index(
    data_dir: Path, kind: MosaicKind, shards: tuple[Path, ...], stamps: tuple[tuple[int, ...], ...]
) -> tuple[StoredMosaic, ...]:
    """`index_mosaics` of files that are as `stamps` says."""
    origin = _origin(data_dir)
    found: dict[str, StoredMosaic] = {}
    for shard in shards:
        for mosaic in _index_shard(shard, f".{kind}.dng"):
            if mosaic.key in found:
                raise FsidError(
                    f"{shard}: {mosaic.key} is also in {found[mosaic.key].shard}; to make one dataset of "
                    f"several, give the samples of one other keys, such as b{mosaic.key}, and leave out "
                    "config.yaml"
                )
            scene, split = origin(mosaic)
            found[mosaic.key] = replace(mosaic, scene=scene, split=split)
    if not found:
        raise _nothing_in(data_dir, kind)
    return _split_by_scene(found.values())


def _split_by_scene(mosaics: Collection[StoredMosaic]) -> tuple[StoredMosaic, ...]:
    """With all images of a scene for validation where one of them is: datasets in one folder may share
    pictures, and each dataset numbers its own to choose those for validation."""
    kept = {mosaic.scene for mosaic in mosaics if mosaic.split == "validation"}
    return tuple(replace(m, split="validation") if m.scene in kept else m for m in mosaics)


def dataset_digest(data_dir: Path) -> str:
    """What tells a dataset from others, wherever it lies and however far it has grown.

    A digest of its config.yaml, or where there is none of its first clean image. FsidError as in
    `index_mosaics`.
    """
    file = data_dir / DATASET_FILE
    if file.exists():
        return hashlib.sha256(read_whole(file)).hexdigest()
    return hashlib.sha256(index_mosaics(data_dir)[0].levels().tobytes()).hexdigest()


def degraded_in(data_dir: Path) -> Path | None:
    """The first shard with a pair whose noisy image is of another than the clean one; None: there is none."""
    return next((shard for shard in find_shards(data_dir) if _index_shard(shard, ".degraded.dng")), None)


def task_of(data_dir: Path) -> str:
    """What a dataset's pairs are for, as its config.yaml states; "denoise" where that states nothing."""
    return str(_generate_settings(data_dir).get("task", "denoise"))


def cameras_of(data_dir: Path) -> tuple[str, ...]:
    """The noise profiles of a dataset's noisy images, as config.yaml states; () where that states none."""
    cameras = _generate_settings(data_dir).get("cameras")
    return tuple(map(str, cameras)) if isinstance(cameras, list) else ()


def _generate_settings(data_dir: Path) -> dict[str, Any]:
    file = data_dir / DATASET_FILE
    settings = read_yaml(file).get("generate") if file.exists() else None
    return settings if isinstance(settings, dict) else {}


def _origin(data_dir: Path) -> Callable[[StoredMosaic], tuple[int, str]]:
    """Scene and split of a sample: by its key from config.yaml; where there is none, as its JSON says."""
    file = data_dir / DATASET_FILE
    if not file.exists():
        return _origin_by_json()
    plain = read_yaml(file)
    known = plain.get("generate", {})
    if isinstance(known, dict):
        known = {key: value for key, value in known.items() if key in _ORIGIN_KEYS}
    settings = {"seed": 0, "shard_size": 1, "generate": known, "pictures": plain.get("pictures", 0)}
    dataset = from_plain(DatasetConfig, settings, source=str(file))
    config, pictures = dataset.generate, dataset.pictures
    if pictures < 0:
        raise FsidError(f"{file}: pictures: {pictures} is negative")

    def origin(mosaic: StoredMosaic) -> tuple[int, str]:
        if not SAMPLE_KEY.fullmatch(mosaic.key):
            raise FsidError(
                f"{mosaic.shard}: {mosaic.key!r} is no key that fsid generate gives, like 00000012"
            )
        frame = int(mosaic.key) // config.pairs_per_frame
        scene = frame % pictures if pictures else frame
        return scene, split_of(config, scene)

    return origin


def _origin_by_json() -> Callable[[StoredMosaic], tuple[int, str]]:
    """Scenes are numbered as they come, by seed and frame or by the name of their picture.

    What has no JSON, or one that says nothing of it, is for training and a scene by itself.
    """
    scenes: dict[str, int] = {}

    @lru_cache(maxsize=1)  # a shard's mosaics come one after the other
    def stated(shard: Path) -> dict[str, tuple[str, str]]:
        return {name.removesuffix(".json"): _stated_origin(head) for name, head in read_heads(shard)}

    def origin(mosaic: StoredMosaic) -> tuple[int, str]:
        scene, split = stated(mosaic.shard).get(mosaic.key, ("", "train"))
        return scenes.setdefault(scene or f"sample {mosaic.key}", len(scenes)), split

    return origin


def _stated_origin(record: Mapping[str, Any]) -> tuple[str, str]:
    """What tells a sample's scene from others, "" where its JSON does not, and its split."""
    of_frame = f"seed {record.get('seed')} frame {record['frame']}" if "frame" in record else ""
    return str(record.get("image", of_frame)), str(record.get("split", "train"))


def _index_shard(shard: Path, suffix: str) -> list[StoredMosaic]:
    stamped = _stamp(shard)
    with open_shard(shard) as (_, plain):
        members = [member for member in plain if member.name.endswith(suffix)]
    return [replace(_read_header(shard, m, m.name.removesuffix(suffix)), stamp=stamped) for m in members]


def _stamp(shard: Path) -> tuple[int, ...]:
    """Device, number, size and time of the file. Without its time of change, which a backup's link moves."""
    return stamp(shard)[:4]


def _read_header(shard: Path, member: tarfile.TarInfo, key: str) -> StoredMosaic:
    where = f"{shard}: {member.name}"
    try:
        with tifffile.TiffFile(shard, offset=member.offset_data, size=member.size) as dng:
            page = _mosaic_page(dng)
            tags = {tag.code: tag.value for tag in page.tags}
            mosaic = StoredMosaic(
                shard=shard,
                key=key,
                offset=member.offset_data + operator.index(page.dataoffsets[0]),
                height=operator.index(page.imagelength),
                width=operator.index(page.imagewidth),
                cfa=check_cfa("".join("RGB"[colour] for colour in bytes(tags[dng_tags.CFA_PATTERN])), where),
                black_level=_level(page.tags[dng_tags.BLACK_LEVEL]),
                white_level=_level(page.tags[dng_tags.WHITE_LEVEL]),
                noise=dng_tags.noise_level(tags),
            )
            plain = dng.byteorder == "<" and page.compression == 1 and page.dtype == "uint16"
            whole = len(page.dataoffsets) == 1 and page.databytecounts[0] == 2 * mosaic.height * mosaic.width
    except (
        OSError,
        tifffile.TiffFileError,
        KeyError,
        IndexError,
        ValueError,
        TypeError,
        OverflowError,
        MemoryError,
        StopIteration,
    ) as error:
        raise FsidError(
            f"{where} is not a DNG of this dataset ({error}); delete the shard and generate again"
        ) from None
    if not (plain and whole):
        raise FsidError(
            f"{where} is not one uncompressed little-endian uint16 strip; write it with `fsid generate`"
        )
    if told := _told_of_pixels(page):
        raise FsidError(
            f"{where} states {told}, and training takes pixels as they are stored; "
            "rewrite it with read_raw and write_dng"
        )
    check_levels(mosaic.black_level, mosaic.white_level, where)
    end = mosaic.offset + 2 * mosaic.height * mosaic.width
    if not member.offset_data <= mosaic.offset <= end <= member.offset_data + member.size:
        raise FsidError(f"{where} is truncated; delete the shard and generate again")
    return mosaic


def _mosaic_page(dng: tifffile.TiffFile) -> tifffile.TiffPage:
    """The CFA image: the first directory, or a sub-directory of it where the first is a preview."""
    first = dng.pages.first
    return next(
        page for page in (first, *(first.pages or ())) if page.photometric == tifffile.PHOTOMETRIC.CFA
    )


def _told_of_pixels(page: tifffile.TiffPage) -> str:
    """What a DNG of another writer says of its pixels that makes them others than those stored, or ""."""
    tags = page.tags
    if dng_tags.LINEARIZATION in tags:
        return "a linearization table"
    whole = [0, 0, page.imagelength, page.imagewidth]
    if dng_tags.ACTIVE_AREA in tags and _numbers(tags[dng_tags.ACTIVE_AREA]) != whole:
        return "an active area within them"
    deltas = (dng_tags.BLACK_DELTA_H, dng_tags.BLACK_DELTA_V)
    if any(code in tags and any(_numbers(tags[code])) for code in deltas):
        return "black levels of rows or columns"
    return ""


def _numbers(tag: tifffile.TiffTag) -> list[float]:
    values = tag.value if isinstance(tag.value, tuple) else (tag.value,)
    is_fraction = tag.dtype in (tifffile.DATATYPE.RATIONAL, tifffile.DATATYPE.SRATIONAL)
    return quotients(values) if is_fraction else list(values)


def _level(tag: tifffile.TiffTag) -> int:
    """A level tag holds one number or one per site, each of them perhaps a rational; here all are one DN."""
    levels = _numbers(tag)
    if len(set(levels)) != 1 or levels[0] != int(levels[0]):
        stated = ", ".join(f"{level:g}" for level in levels) or "no number"
        raise ValueError(f"its {tag.name} states {stated}; one whole number is needed")
    return int(levels[0])
