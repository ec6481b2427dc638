"""The paper's two experiments: the ablation (its Table 1) and synthetic against real (its Table 2).

    for every source of training data, for every seed:  generate -> train -> measure on the same test sets

Sources: the scene variants objects, materials, objects-materials and full; photographs through the same
unprocessing and noise; dead-leaves pictures. Every stage continues where it was stopped, and what is finished
is not done again, so a killed experiment is started again by the same command. Seeds vary the network's first
weights, patches and noise; the data set of a source is one and the same, of the first seed.
"""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, fields, replace
from itertools import product
from pathlib import Path
from typing import Literal

from fsid.config import Override, check_fields, given_keys, load_settings
from fsid.dataset import (
    RENDERED,
    GenerateConfig,
    check_given,
    check_pictures,
    find_photos,
    find_pictures,
    generate,
)
from fsid.dataset.pictures import pictures_digest
from fsid.denoise import TrainConfig, train, train_config
from fsid.errors import FsidError
from fsid.evaluate.claim import claimed
from fsid.evaluate.compare import (
    CLASSICAL,
    NOISY,
    ImageRow,
    Method,
    Row,
    compare,
    summarise,
    write_images,
    write_results,
)
from fsid.evaluate.dead_leaves import write_dead_leaves
from fsid.evaluate.experiment_report import write_experiment_report
from fsid.evaluate.known import known_note
from fsid.evaluate.models import model_method
from fsid.evaluate.simulated import LUXES, simulated_testset
from fsid.evaluate.testbench import MATERIALS
from fsid.evaluate.testset import ALL_SETS, levels_of, photo_testset, read_testset
from fsid.files import make_folder, read_whole
from fsid.scene import VARIANTS
from fsid.sensor import load_bayer_profile

Kind = Literal["ablation", "real-vs-synthetic"]
ProgressBar = Callable[[str, str], AbstractContextManager[Callable[[int, int], None]]]

PHOTOGRAPHS, DEAD_LEAVES, SCENES = "photographs", "dead-leaves", "full"
SOURCES: dict[Kind, tuple[str, ...]] = {
    "ablation": VARIANTS,
    "real-vs-synthetic": (PHOTOGRAPHS, SCENES, DEAD_LEAVES),
}
_PHOTOGRAPH_PX = 1024
"""Windows of photographs are at least so large: small frames suit scenes, but would only cut pictures."""
_NOT_OF_SCENES = {field.name for field in fields(GenerateConfig)} - {*RENDERED, "checks"} | {"variant"}
MATERIALS_SET = "materials"
TEST_ISOS = (800, 1600, 3200, 6400)


@dataclass(frozen=True)
class ExperimentConfig:
    """One experiment: with its folder of photographs, everything that its result depends on.

    count: pairs per source, width x height pixels each (photographs: at least every one of the folder, and
    windows of at least 1024 pixels a side where they have them). steps: of every training, 0 takes those of
    the configuration `network` (a built-in name or a YAML file). seeds: one training per source and seed.
    photos: folder to train the real rival on. tests: folders of photographs to measure on, beside the
    simulated materials (materials_scenes pictures of each, test_width x test_height).
    camera: noise profile of data, trainings and tests. settings: `key=value` of the generator that say how
    scenes are, for every source of scenes. train_settings: of every training.
    """

    kind: Kind
    count: int
    steps: int
    network: str
    seeds: tuple[int, ...]
    width: int
    height: int
    camera: str = "pixel6"
    photos: str = ""
    tests: tuple[str, ...] = ()
    materials_scenes: int = 3
    test_width: int = 768
    test_height: int = 576
    settings: tuple[str, ...] = ()
    train_settings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        check_fields(self)
        if min(self.count, self.materials_scenes) < 1 or self.steps < 0 or not self.seeds:
            raise FsidError("--count and --seeds must name at least one, --steps must not be negative")
        if len(set(self.seeds)) < len(self.seeds):
            raise FsidError(f"--seeds {' '.join(map(str, self.seeds))}: give different ones")
        if not all(0 <= seed < 2**64 for seed in self.seeds):
            raise FsidError(f"--seeds {' '.join(map(str, self.seeds))}: must be at least 0 and below 2^64")
        if self.kind == "real-vs-synthetic" and not self.photos:
            raise FsidError("--photos: name the folder of photographs that the real rival is trained on")
        for key in (setting.partition("=")[0] for setting in self.settings):
            if key.partition(".")[0] in _NOT_OF_SCENES:
                raise FsidError(f"--set {key}: is no setting of the scenes alone; rivals share all others")
        names = [MATERIALS_SET, ALL_SETS, *MATERIALS, *map(_set_name, self.tests)]
        for folder in self.tests:
            if names.count(name := _set_name(folder)) > 1:
                raise FsidError(f"--test {folder}: another test set is called {name}, too; rename the folder")

    def frame_px(self, source: str) -> tuple[int, int]:
        """Width and height of the frames of a source; photographs have them at most."""
        least = _PHOTOGRAPH_PX if source == PHOTOGRAPHS else 0
        return max(self.width, least), max(self.height, least)


def scale_config(kind: Kind, scale: str) -> ExperimentConfig:
    """The settings of a scale: "smoke" (minutes), "cpu" (hours on two cores), "paper" (175,000 pairs)."""
    photos = "." if kind == "real-vs-synthetic" else ""
    if scale == "smoke":
        tiny = (
            "network.width=8",
            "held_out=0",
            "batch=2",
            "patch_px=16",
            "warmup_steps=2",
            "validate_every=1000",
        )
        return ExperimentConfig(
            kind, 4, 30, "nafnet-tiny", (0, 1), 128, 96, photos=photos, materials_scenes=1,
            test_width=96, test_height=96, train_settings=tiny,
        )  # fmt: skip
    if scale == "cpu":
        return ExperimentConfig(kind, 800, 6000, "nafnet-tiny", (0, 1), 480, 270, photos=photos)
    if scale == "paper":
        return ExperimentConfig(kind, 175_000, 0, "paper", (0, 1), 1920, 1080, photos=photos)
    raise FsidError(f"--scale {scale}: choose smoke, cpu or paper")


@contextmanager
def _silent(label: str, unit: str) -> Iterator[Callable[[int, int], None]]:
    yield lambda done, total: None


def experiment(
    out: str | Path,
    config: ExperimentConfig,
    bar: ProgressBar = _silent,
    *,
    workers: int = 1,
    note: Callable[[str], None] = lambda line: None,
) -> Path:
    """Run it in `out`, or go on with it; returns the path of the report.

    Writes results.json (the rows of all test sets), images.csv and report.html. config: of `scale_config`, or
    one's own. bar(label, unit): for every stage a context manager that yields its progress(done, total).
    workers: processes that render; they import the calling script, so a script calls this under `if __name__
    == "__main__":`. note(line): called before the work where test photographs are copies of what the real
    rival is trained on.
    """
    out = Path(out)
    _check(out, config, bar, workers)
    with claimed(out, config, "experiment"):
        _check_noise(out, config)
        return _run(out, config, bar, workers, note)


def _run(
    out: Path, config: ExperimentConfig, bar: ProgressBar, workers: int, note: Callable[[str], None]
) -> Path:
    known = _known(config, workers)
    if known:
        note(f"note: {known}")
    testsets = _testsets(out, config, bar)
    rows, images = _measured(out / "baselines", [NOISY, CLASSICAL], testsets, bar)
    for source in SOURCES[config.kind]:
        data = _data(out, config, source, bar, workers)
        for seed in config.seeds:
            name = f"{source}-seed{seed}"
            run = out / "runs" / name
            if not (out / "measured" / f"{name}.csv").exists():
                with bar(f"training {name}", "steps") as progress:
                    train(data, run, _training(config, seed), progress=progress)
            trained = model_method(run, name)
            method = Method(name, f"{_count(config, source)} pairs from {source}", trained.denoise)
            new_rows, new_images = _measured(out / "measured" / name, [method], testsets, bar)
            rows += new_rows
            images += new_images
    write_results(rows, out / "results.json")
    write_images(images, out / "images.csv")
    pairs = {source: _count(config, source) for source in SOURCES[config.kind]}
    return write_experiment_report(out / "report.html", config, pairs, rows, images, known)


def _check(out: Path, config: ExperimentConfig, bar: ProgressBar, workers: int) -> None:
    """Refuse before anything is written what would stop the experiment on its way.

    Its folder is taken once it has begun: the corrected command would be another experiment. Until then every
    photograph is decoded, to see that it can be.
    """
    levels_of(load_bayer_profile(config.camera), TEST_ISOS, LUXES)
    _training(config, config.seeds[0])
    for source in SOURCES[config.kind]:
        _generator(out, config, source)
        _count(config, source)
    check_given(_generator(out, config, SCENES), given_keys(config.settings))
    pictures = [path for folder in config.tests for path in find_photos(Path(folder))]
    if PHOTOGRAPHS in SOURCES[config.kind]:
        pictures += find_pictures(Path(config.photos))
    if pictures and not (out / "experiment.yaml").exists():
        with bar("checking photographs", "pictures") as progress:
            check_pictures(pictures, min(workers, os.cpu_count() or 1), progress)


def _known(config: ExperimentConfig, workers: int) -> str:
    """Which test photographs the real rival is trained on, for note and report."""
    if PHOTOGRAPHS not in SOURCES[config.kind]:
        return ""
    tests = {_set_name(folder): find_photos(folder) for folder in config.tests}
    threads = max(min(workers, os.cpu_count() or 1), 1)
    return known_note(tests, find_pictures(Path(config.photos)), threads)


def _check_noise(out: Path, config: ExperimentConfig) -> None:
    """A run of an older FSID drew other noise than the camera's, and no two rivals may differ in that."""
    profiles = _training(config, config.seeds[0]).profiles
    for file in sorted((out / "runs").glob("*/config.yaml")):
        begun = load_settings(TrainConfig, file).profiles
        if begun != profiles:
            raise FsidError(
                f"{file}: was trained on the noise of {', '.join(begun)}, and the others would be on that of "
                f"{', '.join(profiles)}; use another folder"
            )


def _training(config: ExperimentConfig, seed: int) -> TrainConfig:
    steps = [f"steps={config.steps}"] if config.steps else []
    noise: list[Override] = [("profiles", [config.camera])]
    training = train_config(config.network, [*noise, f"seed={seed}", *config.train_settings, *steps])
    # scenes and photographs differ in size, and their trainings must not
    return training if training.shrink else replace(training, shrink=(1,))


def _count(config: ExperimentConfig, source: str) -> int:
    """How many pairs of a source there are to be: of photographs, at least one of each."""
    if source != PHOTOGRAPHS:
        return config.count
    return max(config.count, len(find_pictures(Path(config.photos))))


def _generator(out: Path, config: ExperimentConfig, source: str) -> GenerateConfig:
    width, height = config.frame_px(source)
    overrides: list[Override] = [("width", width), ("height", height), ("cameras", [config.camera])]
    if source in VARIANTS:
        overrides += [("variant", source), *config.settings]
    else:
        pictures = Path(config.photos) if source == PHOTOGRAPHS else out / "dead-leaves"
        overrides.append(("images", str(pictures.resolve())))
    return load_settings(GenerateConfig, None, overrides)


def _data(out: Path, config: ExperimentConfig, source: str, bar: ProgressBar, workers: int) -> Path:
    """The training pairs of a source."""
    data = out / "data" / source
    seed, count = config.seeds[0], _count(config, source)
    settings = _generator(out, config, source)
    if source == DEAD_LEAVES:
        pictures = Path(settings.images)
        with bar("drawing dead leaves", "pictures") as progress:
            write_dead_leaves(
                pictures, count, height=config.height, width=config.width, seed=seed, progress=progress
            )
    with bar(f"pairs from {source}", "pairs") as progress:
        generate(data, settings, count=count, seed=seed, workers=workers, progress=progress)
    return data


def _testsets(out: Path, config: ExperimentConfig, bar: ProgressBar) -> list[Path]:
    """The simulated materials in lux, and every folder of photographs at TEST_ISOS."""
    root = out / "testsets"
    found = [root / MATERIALS_SET]
    if not (found[0] / "testset.json").exists():
        with bar("drawing test materials", "pictures") as progress:
            simulated_testset(
                found[0],
                camera=config.camera,
                scenes=config.materials_scenes,
                width=config.test_width,
                height=config.test_height,
                seed=1000,
                progress=progress,
            )
    for folder in config.tests:
        path = root / _set_name(folder)
        found.append(path)
        if not (path / "testset.json").exists():
            with bar(f"test set {path.name}", "photographs") as progress:
                photo_testset([Path(folder)], path, camera=config.camera, isos=TEST_ISOS, progress=progress)
        digest = read_testset(path).pictures_digest
        if digest and digest != pictures_digest(find_photos(folder)):
            raise FsidError(
                f"{folder}: holds other photographs than those that {path} was made of (names or sizes "
                "differ); put those back, or use another folder"
            )
    return found


def _set_name(folder: str) -> str:
    return Path(folder).resolve().name


def _measured(
    stem: Path, methods: Sequence[Method], testsets: Sequence[Path], bar: ProgressBar
) -> tuple[list[Row], list[ImageRow]]:
    """Figures of methods on all test sets; kept in stem.csv, and read from there the next time."""
    file = stem.with_suffix(".csv")
    if not file.exists():
        make_folder(file.parent)
        images: list[ImageRow] = []
        for testset in testsets:
            with bar(f"measuring {stem.name} on {testset.name}", "captures") as progress:
                images += compare(testset, methods, progress=progress).images
        write_images(images, file)
    images = _read_images(file)
    there = {(row.model, row.level, row.set, row.image) for row in images}
    rows: list[Row] = []
    for made in map(read_testset, testsets):
        for method, level, image in product(methods, made.levels, made.images):
            if (method.name, level, image.set, image.name) not in there:
                raise FsidError(f"{file}: lacks {image.name} at {level}; delete it to measure all again")
        rows += summarise(made, methods, images)
    return rows, images


def _read_images(file: Path) -> list[ImageRow]:
    names = [field.name for field in fields(ImageRow)]
    numbers = {field.name for field in fields(ImageRow) if field.type == "float"}
    try:
        header, *lines = csv.reader(io.StringIO(read_whole(file).decode(), newline=""))
        if header != names:
            raise ValueError
        return [
            ImageRow(*(float(v) if n in numbers else v for n, v in zip(names, line, strict=True)))  # type: ignore[arg-type]
            for line in lines
        ]
    except (ValueError, csv.Error):
        raise FsidError(
            f"{file}: holds no figures of images; delete it, and they are measured again"
        ) from None
