"""Where every mosaic of a dataset lies, so that pixels can be read without opening a file again.

    byte of pixel (i, j) = tar member offset + DNG strip offset + 2 (i W + j)

The DNGs inside the shards hold one uncompressed strip of little-endian uint16, so a mosaic is a window of the
tar file. Indexing reads tar and TIFF headers only.
"""

from __future__ import annotations

import tarfile
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tifffile

from fsid.dataset.shards import find_shards
from fsid.errors import FsidError
from fsid.sensor import dng_tags
from fsid.sensor.mosaic import check_cfa

MosaicKind = Literal["clean", "noisy"]


@dataclass(frozen=True)
class StoredMosaic:
    """One mosaic inside a shard: (height, width) uint16 at byte `offset` of the file `shard`."""

    shard: Path
    key: str
    offset: int
    height: int
    width: int
    cfa: str
    black_level: int
    white_level: int


def index_mosaics(data_dir: Path, kind: MosaicKind = "clean") -> tuple[StoredMosaic, ...]:
    """All mosaics of one kind in `data_dir`/shard-*.tar, in the order of shards and samples.

    Raises FsidError where there is no shard, no sample, or a shard or DNG that is not readable as described
    above.
    """
    found = tuple(mosaic for shard in find_shards(data_dir) for mosaic in _index_shard(shard, f".{kind}.dng"))
    if not found:
        raise FsidError(
            f"{data_dir}: its shards hold no *.{kind}.dng; make the dataset again with `fsid generate`"
        )
    return found


def _index_shard(shard: Path, suffix: str) -> list[StoredMosaic]:
    try:
        with tarfile.open(shard, "r:") as tar:
            members = [m for m in tar if m.isfile() and m.name.endswith(suffix)]
    except (OSError, tarfile.TarError) as error:
        raise FsidError(
            f"{shard}: is not a readable tar file ({error}); delete it and generate again"
        ) from None
    return [_read_header(shard, m, m.name.removesuffix(suffix)) for m in members]


def _read_header(shard: Path, member: tarfile.TarInfo, key: str) -> StoredMosaic:
    where = f"{shard}: {member.name}"
    try:
        with tifffile.TiffFile(shard, offset=member.offset_data, size=member.size) as dng:
            page = _mosaic_page(dng)
            tags = {tag.code: tag.value for tag in page.tags}
            mosaic = StoredMosaic(
                shard=shard,
                key=key,
                offset=member.offset_data + page.dataoffsets[0],
                height=page.imagelength,
                width=page.imagewidth,
                cfa=check_cfa("".join("RGB"[colour] for colour in bytes(tags[dng_tags.CFA_PATTERN])), where),
                black_level=_level(tags[dng_tags.BLACK_LEVEL]),
                white_level=_level(tags[dng_tags.WHITE_LEVEL]),
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
        StopIteration,
    ) as error:
        raise FsidError(
            f"{where} is not a DNG of this dataset ({error}); delete the shard and generate again"
        ) from None
    if not (plain and whole):
        raise FsidError(
            f"{where} is not one uncompressed little-endian uint16 strip; write it with `fsid generate`"
        )
    if mosaic.offset + 2 * mosaic.height * mosaic.width > member.offset_data + member.size:
        raise FsidError(f"{where} is truncated; delete the shard and generate again")
    return mosaic


def _mosaic_page(dng: tifffile.TiffFile) -> tifffile.TiffPage:
    """The CFA image: the first directory, or a sub-directory of it where the first is a preview."""
    first = dng.pages.first
    return next(
        page for page in (first, *(first.pages or ())) if page.photometric == tifffile.PHOTOMETRIC.CFA
    )


def _level(value: object) -> int:
    """A level tag may be one number, one per site, or a rational (numerator, denominator)."""
    numbers = value if isinstance(value, tuple) else (value,)
    return int(numbers[0])
