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
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from fsid.assets.file_names import PREFIX
from fsid.assets.sources import licence_beside, split_source, survey_meshes
from fsid.dataset.config import DATASET_FILE, DatasetConfig
from fsid.dataset.contact_sheet import grid
from fsid.dataset.index import some_mosaics
from fsid.dataset.png import stored_preview
from fsid.dataset.shards import read_records, records_of, shard_keys
from fsid.errors import FsidError
from fsid.files import check_file, write_atomically
from fsid.plurals import counted
from fsid.scene import SceneConfig

CARD, SHEET = "README.md", "samples.png"
_TITLE = "# RAW pairs made by FSID"
_TILES, _TILE_PX = 12, 240
_FAMILIES_SHOWN = 200
_MEASURED = 64
"""Images whose statistics the card states; `fsid inspect` measures more."""
_SMALLEST_PX = 128
_LOOK = "look at their source before you publish."


@dataclass
class _Tally:
    """What the records of a dataset say, added up."""

    counts: dict[str, Counter[str]] = field(default_factory=dict)
    isos: list[float] = field(default_factory=list)
    frames: set[int] = field(default_factory=set)

    def add(self, record: dict[str, Any]) -> None:
        self._count("split", record["split"])
        self._count("camera", record["camera"])
        self._count("version", record.get("fsid_version", "unknown"))
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
        f"(seed {dataset.seed}). "
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
        f"| version of fsid | {_listed(tally.counts['version'], 'pairs')} |",
        f"| ISO | {lowest:.0f} to {highest:.0f}, median {middle:.0f} |",
        *of_scenes,
        f"| refused by the checks | {refused.total()} of {drawn} frames: {_listed(refused, 'times')} |",
        "",
        "## Sources and licences",
        "",
        *_sources(tally, config.scene),
        *statistics,
    ]
    if command:
        lines += ["", "## Made with", "", "```sh", command, "```"]
    return "\n".join(lines) + "\n"


def _sources(tally: _Tally, scene: SceneConfig) -> Iterable[str]:
    """What was used of each kind: of FSID's own, and of every folder of `scene`, with the licences there."""
    names = {"mesh": "meshes", "material": "materials", "sky": "skies"}
    skies = (scene.hdri_folder,) if scene.hdri_folder else ()
    folders = {"mesh": scene.mesh_folders, "material": scene.texture_folders, "sky": skies}
    for what, name in names.items():
        used = tally.counts.get(what, Counter())
        own = Counter({key: n for key, n in used.items() if not key.startswith(PREFIX)})
        if own:
            yield f"- FSID's own {name} (Apache-2.0, made by formula): {_listed(own, 'uses')}."
        for folder, (known, theirs) in sorted(_by_folder(used - own, folders[what]).items()):
            place, uses = " ".join(folder.replace("`", "'").split()), counted(theirs.total(), "use")
            surveyed = known and what == "mesh"
            stated = _surveyed_licences(folder, scene.mesh_folders_cc0_only) if surveyed else {}
            licences = {n: stated[n] if n in stated else _nearest_licence(n, Path(folder)) for n in theirs}
            yield f"- {name} from `{place}`: {uses}. {_said(theirs, licences)}"
    pictures = tally.counts.get("picture", Counter())
    if pictures:
        number = counted(len(pictures), "picture")
        yield f"- {number} that the maker of this dataset supplied, under their own licences."


def _by_folder(used: Counter[str], folders: Sequence[str]) -> dict[str, tuple[bool, Counter[str]]]:
    """The counts by the innermost of `folders` that a file lies in (True), or by its own, as of a folder that
    has moved since (False)."""
    found: dict[str, tuple[bool, Counter[str]]] = {}
    for name, count in used.items():
        path, member = split_source(name)
        around = [folder for folder in folders if path.is_relative_to(folder)]
        own = str(path if member else path.parent)
        folder = max(around, key=lambda folder: len(Path(folder).parts), default=own)
        found.setdefault(folder, (bool(around), Counter()))[1][name] += count
    return found


def _surveyed_licences(folder: str, cc0_only: bool) -> dict[str, str]:
    """By name, of all usable meshes; the survey is the one that the scenes were drawn from."""
    return {source.name: source.licence for source in survey_meshes(folder, cc0_only).usable}


def _nearest_licence(name: str, root: Path) -> str:
    path, _ = split_source(name)
    place = path if path.is_dir() else path.parent
    return licence_beside(place, root) if place.is_dir() else ""


def _said(used: Counter[str], licences: Mapping[str, str]) -> str:
    """The licences by use, and of how many uses none is known."""
    stated = _summed(Counter({n: c for n, c in used.items() if licences[n]}), lambda name: licences[name])
    unknown = used.total() - stated.total()
    if not stated:
        return f"No licence file was found with them: {_LOOK}"
    rest = f" With {unknown} of them no licence file was found: {_LOOK}" if unknown else ""
    return f"Licences: {_listed(stated, 'uses')}.{rest}"


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
