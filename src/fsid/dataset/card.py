"""The dataset card: README.md beside the shards of a finished dataset, from its records and images.

What is in it, from what it was made and under which licences, how often the checks refused a frame, what
`fsid inspect` measures on some of it, and the command that makes it again. No clock and no machine: the same
dataset has the same card.
"""

from __future__ import annotations

import io
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from fsid import __version__
from fsid.assets.file_names import PREFIX
from fsid.assets.sources import split_source, survey_meshes
from fsid.dataset.config import DATASET_FILE, DatasetConfig
from fsid.dataset.contact_sheet import grid
from fsid.dataset.index import some_mosaics
from fsid.dataset.png import stored_preview
from fsid.dataset.shards import read_records, records_of, shard_keys
from fsid.errors import FsidError
from fsid.files import check_file, write_atomically
from fsid.plurals import counted

CARD, SHEET = "README.md", "samples.png"
_TITLE = "# RAW pairs made by FSID"
_TILES, _TILE_PX = 12, 240
_FAMILIES_SHOWN = 200
_MEASURED = 64
"""Images whose statistics the card states; `fsid inspect` measures more."""
_SMALLEST_PX = 128
_LICENCE_LETTERS = 20_000


@dataclass
class _Tally:
    """What the records of a dataset say, added up."""

    counts: dict[str, Counter[str]] = field(default_factory=dict)
    isos: list[float] = field(default_factory=list)
    frames: set[int] = field(default_factory=set)

    def add(self, record: dict[str, Any]) -> None:
        self._count("split", record["split"])
        self._count("camera", record["camera"])
        self.isos.append(float(record["iso"]))
        if record["frame"] in self.frames:
            return
        self.frames.add(record["frame"])
        for reason in record["refused"]:
            self._count("refused", reason)
        if "image" in record:
            self._count("picture", record["image"])
        scene = record.get("scene", {"objects": (), "materials": (), "background": None})
        for item in scene["objects"]:
            self._count("mesh", item["family"])
        for materials in scene["materials"]:
            for material in materials:
                self._count("material", material["family"])
        if scene["background"]:
            self._count("background", scene["background"]["kind"])
            for material in scene["background"]["materials"].values():
                self._count("material", material["family"])
        if scene.get("sky"):
            self._count("sky", scene["sky"]["source"])

    def _count(self, what: str, which: Any) -> None:
        self.counts.setdefault(what, Counter())[str(which)] += 1


def check_card(out: Path) -> None:
    """FsidError where the card of a dataset in `out` would replace files of something else."""
    card, is_begun = out / CARD, (out / DATASET_FILE).exists()
    if card.exists():
        check_file(card)
        with card.open("rb") as file:
            if file.read(len(_TITLE)) == _TITLE.encode():
                return
    elif is_begun or not (out / SHEET).exists():
        return
    other = CARD if card.exists() else SHEET
    raise FsidError(
        f"{out}: holds another {other}, which the dataset's would replace; "
        "move it away, or use another folder"
    )


def write_card(
    out: Path,
    dataset: DatasetConfig,
    shards: Sequence[Path],
    command: str,
    read: Callable[[int], None],
) -> None:
    """Write README.md and samples.png of the dataset in `out`. command: what made it, "" where unknown.

    read(shards): called after every one.
    """
    tally = _Tally()
    for number, shard in enumerate(shards, 1):
        with records_of(shard):
            for record in read_records(shard):
                tally.add(record)
        read(number)
    write_atomically(out / SHEET, _sheet(shards))
    text = _text(dataset, tally, list(_statistics(out)), command)
    write_atomically(out / CARD, text.encode(errors="backslashreplace"))


def _text(dataset: DatasetConfig, tally: _Tally, statistics: Sequence[str], command: str) -> str:
    config = dataset.generate
    splits, refused = tally.counts["split"], tally.counts.get("refused", Counter())
    drawn = len(tally.frames) + refused.total()
    lowest, middle, highest = np.percentile(tally.isos, (0, 50, 100))
    size = f"{config.crop_width or config.width} x {config.crop_height or config.height}"
    if config.images:
        sources, of_scenes = counted(len(tally.counts["picture"]), "picture"), []
    else:
        sources = counted(len(tally.frames), "rendered scene")
        backgrounds = _listed(tally.counts.get("background", Counter()), "scenes")
        of_scenes = [f"| variant | {config.variant} |", f"| backgrounds | {backgrounds} |"]
    lines = [
        _TITLE,
        "",
        f"{counted(len(tally.isos), 'pair')} for {config.task}, {size} pixels at most, from {sources} "
        f"(fsid {__version__}, seed {dataset.seed}). "
        "WebDataset shards; `config.yaml` has every setting, each pair's JSON all that makes it again.",
        "",
        "Noise of a pair: `Var(x) = k x + sigma2` with `k` and `sigma2` of its JSON, of R, Gr (in rows with "
        "R), Gb and B; x = (DN - black) / (white - black) with the levels that a DNG states.",
        "",
        f"![Some of the clean images, developed]({SHEET})",
        "",
        "| | |",
        "|---|---|",
        *(f"| {name} | {counted(count, 'pair')} |" for name, count in sorted(splits.items())),
        f"| cameras | {_listed(tally.counts['camera'], 'pairs')} |",
        f"| ISO | {lowest:.0f} to {highest:.0f}, median {middle:.0f} |",
        *of_scenes,
        f"| refused by the checks | {refused.total()} of {drawn} frames: {_listed(refused, 'times')} |",
        "",
        "## Sources and licences",
        "",
        *_sources(tally),
        *statistics,
    ]
    if command:
        lines += ["", "## Made with", "", "```sh", command, "```"]
    return "\n".join(lines) + "\n"


def _sources(tally: _Tally) -> Iterable[str]:
    names = {"mesh": "meshes", "material": "materials", "sky": "skies"}
    for what, name in names.items():
        used = tally.counts.get(what, Counter())
        own = Counter({key: n for key, n in used.items() if not key.startswith(PREFIX)})
        if own:
            yield f"- FSID's own {name} (Apache-2.0, made by formula): {_listed(own, 'uses')}."
        for folder, n in sorted(_summed(used - own, _folder).items()):
            place = " ".join(folder.replace("`", "'").split())
            yield f"- {name} from `{place}`: {counted(n, 'use')}. {_licence(what, Path(folder), used)}"
    pictures = tally.counts.get("picture", Counter())
    if pictures:
        number = counted(len(pictures), "picture")
        yield f"- {number} that the maker of this dataset supplied, under their own licences."


def _statistics(out: Path) -> Iterable[str]:
    """Means of what `fsid inspect` measures; nothing where an image is too small for it."""
    from fsid.dataset.inspect import inspect  # with libraries that a worker never needs
    from fsid.dataset.statistics import TITLES

    if min(min(mosaic.height, mosaic.width) for mosaic in some_mosaics(out, _MEASURED)) < _SMALLEST_PX:
        return
    found = inspect(out, limit=_MEASURED)
    yield from ("", "## Statistics", "", f"Means over {found.pictures} of the clean images (`fsid inspect`).")
    yield from ("", "| | mean |", "|---|---|")
    yield from (f"| {TITLES[name]} | {values.mean():.3g} |" for name, values in found.values.items())


def _summed(counts: Counter[str], group: Callable[[str], str]) -> Counter[str]:
    """The counts of each group; of a large dataset they are millions."""
    summed: Counter[str] = Counter()
    for name, count in counts.items():
        summed[group(name)] += count
    return summed


def _folder(source: str) -> str:
    """The folder or library of a "file:PATH" or "file:PATH!MEMBER"."""
    path, member = split_source(source)
    return str(path if member else path.parent)


def _licence(what: str, place: Path, used: Counter[str]) -> str:
    """The licences of the meshes that were used, by their library or nearest file; else the folder's."""
    if what == "mesh" and place.exists():
        licences = {source.name: source.licence for source in survey_meshes(str(place)).usable}
        stated = Counter({name: n for name, n in used.items() if licences.get(name)})
        by_licence = _summed(stated, lambda name: licences[name])
        if by_licence:
            return f"Licences: {_listed(by_licence, 'uses')}."
    return _folder_licence(place)


def _folder_licence(folder: Path) -> str:
    """What a folder says of its licence: the first line of a licence file in it or above it."""
    for place in (folder, folder.parent):
        if place.is_dir():
            for file in sorted(place.iterdir()):
                if file.is_file() and file.stem.lower() in ("license", "licence", "copying"):
                    with file.open(encoding="utf-8", errors="replace") as text:
                        first = text.read(_LICENCE_LETTERS).strip().partition("\n")[0]
                    return f"`{file.name}`: {_plain(first[:200])}"
    return "No licence file was found with them: look at their source before you publish."


def _listed(counts: Counter[str], unit: str) -> str:
    most = counts.most_common(_FAMILIES_SHOWN)
    rest = len(counts) - len(most)
    in_order = sorted(most, key=lambda item: (-item[1], item[0]))
    text = ", ".join(f"{_plain(name)} ({n})" for name, n in in_order)
    return f"{text or 'none'}{f' and {rest} more' if rest else ''}" + (f" {unit}" if counts else "")


def _plain(text: str) -> str:
    """`text` of others, as a licence or a camera's name is, without what Markdown would make of it."""
    return re.sub(r"[<`\[|\\]", r"\\\g<0>", " ".join(text.split()))


def _sheet(shards: Sequence[Path]) -> bytes:
    """Previews of samples spread over the dataset, as PNG."""
    tiles = []
    step = math.ceil(len(shards) / _TILES)
    for shard in shards[::step]:
        keys = shard_keys(shard)
        for key in keys[:: max(1, len(keys) * len(shards[::step]) // _TILES)]:
            image = stored_preview(shard, key)
            image.thumbnail((_TILE_PX, _TILE_PX))
            tiles.append(np.asarray(image))
    file = io.BytesIO()
    smallest = np.min([tile.shape[:2] for tile in tiles], axis=0)
    sheet = grid([tile[: smallest[0], : smallest[1]] for tile in tiles[:_TILES]])
    Image.fromarray(sheet).save(file, format="PNG")
    return file.getvalue()
