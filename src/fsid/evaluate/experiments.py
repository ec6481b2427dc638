"""The paper's two experiments: the ablation (its Table 1) and synthetic against real (its Table 2).

    for every source of training data, for every seed:  generate -> train -> measure on the same test sets

Sources: the scene variants objects, materials, objects-materials and full; photographs through the same
unprocessing and noise; dead-leaves pictures. Every stage continues where it was stopped, and what is finished
is not done again, so a killed experiment is started again by the same command. Seeds vary the network's first
weights, patches and noise; the data set of a source is one and the same, of the first seed.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from itertools import product
from pathlib import Path

from fsid.config import Override, given_keys, load_settings
from fsid.dataset import (
    GenerateConfig,
    Workforce,
    check_given,
    find_photos,
    find_pictures,
    generate,
)
from fsid.dataset.photos import SMALLEST_PX
from fsid.dataset.pictures import picture_faults, pictures_digest
from fsid.denoise import TrainConfig, train, train_config
from fsid.denoise.initial_weights import initial_network
from fsid.denoise.run_folder import check_same_training
from fsid.errors import FsidError, refuse_any
from fsid.evaluate.compare import CLASSICAL, NOISY, Method, compare, summarise
from fsid.evaluate.dead_leaves import write_dead_leaves
from fsid.evaluate.experiment_config import (
    DEAD_LEAVES,
    MATERIALS_SET,
    PHOTOGRAPHS,
    SCENES,
    SOURCES,
    ExperimentConfig,
    set_name,
)
from fsid.evaluate.experiment_report import write_experiment_report
from fsid.evaluate.models import model_method
from fsid.evaluate.results import ImageRow, Row, read_images, write_images, write_results
from fsid.evaluate.resumable_folder import claimed
from fsid.evaluate.simulated import LUXES, simulated_testset
from fsid.evaluate.testset import TESTSET_FILE, levels_of, photo_testset, read_testset
from fsid.evaluate.train_test_overlap import overlap_note
from fsid.files import make_folder
from fsid.plurals import counted
from fsid.scene import VARIANTS
from fsid.sensor import load_bayer_profile
from fsid.sensor.profiles import profiles_digest

ProgressBar = Callable[[str, str], AbstractContextManager[Callable[[int, int], None]]]
TEST_ISOS = (800, 1600, 3200, 6400)


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

    Writes results.json (the rows of all test sets), images.csv and report.html. config: of
    `experiment_config.scale_config`, or one's own. bar(label, unit): for every stage a context manager that
    yields its progress(done, total). workers: processes that render; they import the calling script, so a
    script calls this under `if __name__ == "__main__":`. note(line): called before the work where test
    photographs are copies of what the real rival is trained on.
    """
    out = Path(out)
    _check(out, config, bar, workers)
    with claimed(out, config, "experiment"):
        _check_trainings(out, config)
        return _run(out, config, bar, workers, note)


def _run(
    out: Path, config: ExperimentConfig, bar: ProgressBar, workers: int, note: Callable[[str], None]
) -> Path:
    overlap = _overlap(config, workers)
    if overlap:
        note(overlap)
    testsets = _testsets(out, config, bar)
    rows, images = _measured(out / "baselines", [NOISY, CLASSICAL], testsets, bar)
    for source, seed in product(SOURCES[config.kind], config.seeds):
        run = _run_folder(out, source, seed)
        stem = out / "measured" / run.name
        method = Method(run.name, f"{_count(config, source)} pairs from {source}", NOISY.denoise)
        if not _figures(stem).exists():  # else data and network may have been deleted
            data = _data(out, config, source, bar, workers)
            with bar(f"training {run.name}", "steps") as progress:
                train(data, run, _training(config, seed), progress=progress)
            method = replace(method, denoise=model_method(run, run.name).denoise)
        new_rows, new_images = _measured(stem, [method], testsets, bar)
        rows += new_rows
        images += new_images
    write_results(rows, out / "results.json")
    write_images(images, out / "images.csv")
    pairs = {source: _count(config, source) for source in SOURCES[config.kind]}
    return write_experiment_report(out / "report.html", config, pairs, rows, images, overlap)


def _check(out: Path, config: ExperimentConfig, bar: ProgressBar, workers: int) -> None:
    """Refuse before anything is written what would stop the experiment on its way.

    Once it has begun, the folder belongs to it, and a corrected command would be another experiment. So every
    photograph is decoded before, to see that it can be.
    """
    Workforce(workers)  # FsidError for less than one
    training = _training(config, config.seeds[0])
    for source in SOURCES[config.kind]:
        _generator(out, config, source)
        _count(config, source)
    check_given(_generator(out, config, SCENES), given_keys(config.settings))
    patch = 2 * training.patch_px + 2
    needed = patch * max(training.shrink)  # frames are of one size, and patches are cut at every shrink
    if min(config.width, config.height) < needed:
        raise FsidError(
            f"--width {config.width} --height {config.height}: patches of the training need {needed}x{needed}"
        )
    least = patch if 1 in training.shrink else 0
    tests = [path for folder in config.tests for path in find_photos(Path(folder))]
    photos = find_pictures(Path(config.photos)) if PHOTOGRAPHS in SOURCES[config.kind] else []
    if (out / "experiment.yaml").exists():
        return
    first_run = _run_folder(out, SOURCES[config.kind][0], config.seeds[0])
    initial_network(first_run, training, resume=False)
    if training.validation_photos:
        find_photos(training.validation_photos)
    faults, threads = [], min(workers, os.cpu_count() or 1)
    for name, pictures, smallest_px in (("tests", tests, 0), ("photographs", photos, least)):
        if pictures:
            with bar(f"checking {name}", "pictures") as progress:
                faults += picture_faults(pictures, threads, progress, max(smallest_px, SMALLEST_PX))
    refuse_any(faults, counted(len(tests) + len(photos), "picture"))


def _overlap(config: ExperimentConfig, workers: int) -> str:
    """Which test photographs the real rival is trained on, for note and report."""
    if PHOTOGRAPHS not in SOURCES[config.kind]:
        return ""
    tests = {set_name(folder): find_photos(folder) for folder in config.tests}
    threads = min(workers, os.cpu_count() or 1)
    return overlap_note(tests, find_pictures(Path(config.photos)), threads)


def _check_trainings(out: Path, config: ExperimentConfig) -> None:
    """No two rivals may differ in more than their data: a file of settings may have been edited since."""
    for source, seed in product(SOURCES[config.kind], config.seeds):
        check_same_training(_run_folder(out, source, seed), _training(config, seed))


def _run_folder(out: Path, source: str, seed: int) -> Path:
    return out / "runs" / f"{source}-seed{seed}"


def _training(config: ExperimentConfig, seed: int) -> TrainConfig:
    """On the noise of the camera, at least from the lowest to the highest ISO that is tested."""
    usual = train_config(config.network)
    levels = levels_of(load_bayer_profile(config.camera), TEST_ISOS, LUXES)
    isos = [setting.iso for setting in levels.values()]
    noise: list[Override] = [
        ("profiles", [config.camera]),
        ("iso_min", min(usual.iso_min, *isos)),
        ("iso_max", max(usual.iso_max, *isos)),
    ]
    steps = [f"steps={config.steps}"] if config.steps else []
    training = train_config(config.network, [*noise, *config.train_settings, f"seed={seed}", *steps])
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
    if not (found[0] / TESTSET_FILE).exists():
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
    _check_camera(found[0], config.camera)
    for folder in config.tests:
        path = root / set_name(folder)
        found.append(path)
        if not (path / TESTSET_FILE).exists():
            with bar(f"test set {path.name}", "photographs") as progress:
                photo_testset([Path(folder)], path, camera=config.camera, isos=TEST_ISOS, progress=progress)
        _check_camera(path, config.camera)
        digest = read_testset(path).pictures_digest
        if digest and digest != pictures_digest(find_photos(folder)):
            raise FsidError(
                f"{folder}: holds other photographs than those that {path} was made of (names or sizes "
                "differ); put those back, or use another folder"
            )
    return found


def _check_camera(path: Path, camera: str) -> None:
    """FsidError where the file of the camera says other noise by now than the test set at `path` has."""
    if read_testset(path).profiles_digest not in ("", profiles_digest([camera])):
        raise FsidError(
            f"{camera}: says another noise than that which {path} was made with; "
            "put the file back as it was, or use another folder"
        )


def _measured(
    stem: Path, methods: Sequence[Method], testsets: Sequence[Path], bar: ProgressBar
) -> tuple[list[Row], list[ImageRow]]:
    """Figures of methods on all test sets; kept in a file, and read from there the next time."""
    file = _figures(stem)
    if not file.exists():
        make_folder(file.parent)
        images: list[ImageRow] = []
        for testset in testsets:
            with bar(f"measuring {stem.name} on {testset.name}", "captures") as progress:
                images += compare(testset, methods, progress=progress).images
        write_images(images, file)
    images = read_images(file)
    there = {(row.model, row.level, row.set, row.image) for row in images}
    rows: list[Row] = []
    for made in map(read_testset, testsets):
        for method, level, image in product(methods, made.levels, made.images):
            if (method.name, level, image.set, image.name) not in there:
                raise FsidError(f"{file}: lacks {image.name} at {level}; delete it to measure all again")
        rows += summarise(made, methods, images)
    return rows, images


def _figures(stem: Path) -> Path:
    return stem.with_suffix(".csv")
