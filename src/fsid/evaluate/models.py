"""Evaluate trained models on a test set: `fsid evaluate`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from fsid.errors import FsidError
from fsid.evaluate.compare import CLASSICAL, NOISY, Comparison, Method, compare
from fsid.evaluate.results import perfect_note, write_images, write_results
from fsid.evaluate.testset import read_testset
from fsid.files import make_folder, paths_of
from fsid.plurals import counted
from fsid.sensor import NoiseLevel, read_raw
from fsid.sensor.blind import stated_noise

if TYPE_CHECKING:
    from fsid.denoise import Network


def model_method(model: Network | str | Path, name: str, *, ensemble: int = 1) -> Method:
    """A trained model, loaded or as `load_model` takes it, as a method; its card says what it was trained on.
    ensemble: as for `denoise_raw`."""
    from fsid.denoise import denoise_raw, load_model
    from fsid.denoise.denoise import check_network, most_noise

    network = load_model(model) if isinstance(model, str | Path) else model
    check_network(network)
    denoise = partial(denoise_raw, model=network, ensemble=ensemble)
    return Method(name, network.card.training, denoise, most_noise(network.card))


def model_names(models: Sequence[str | Path]) -> list[str]:
    """What models are called in results: by folder or file, or as given where those names are the same."""
    short = [_short_name(Path(path)) for path in models]
    taken = Counter([NOISY.name, CLASSICAL.name, *short])
    names = [str(path) if taken[name] > 1 else name for path, name in zip(models, short, strict=True)]
    for at, name in enumerate(names):
        if name in (NOISY.name, CLASSICAL.name, *names[:at]):
            why = "is given twice" if name in names[:at] else "is the name of a baseline; rename it"
            raise FsidError(f"--model {name}: {why}")
    return names


def _short_name(path: Path) -> str:
    """A run folder's name (dots belong to it), or that of a file without its ending."""
    from fsid.denoise.model import MODEL_FILE

    path = path.resolve()
    if path.name == MODEL_FILE:
        path = path.parent
    return path.name if path.is_dir() else path.stem


def evaluate_models(
    testset: str | Path,
    models: str | Path | Iterable[str | Path],
    *,
    ensemble: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
    note: Callable[[str], None] = lambda line: None,
) -> Comparison:
    """Compare the baselines and `models`, as `load_model` takes them, one or more, with crops of the middle
    level.

    ensemble: of each model, as for `denoise_raw`; where it is not 1 their names say so. note: told in one
    line of each model at which levels the test set holds more noise than it knows, and which results have no
    error. FsidError also where a capture states no noise, or zeros.
    """
    models = paths_of(models)
    made = read_testset(testset)
    levels = made.levels
    copies = "" if ensemble == 1 else f" (mean of {ensemble})"
    methods = [
        model_method(path, f"{name}{copies}", ensemble=ensemble)
        for path, name in zip(models, model_names(models), strict=True)
    ]
    noises = {path: _stated_noise(path) for path in made.captures(testset)}  # before the first is denoised
    firsts = {level: noises[made.noisy(testset, made.images[0], level)] for level in levels}
    for method in methods:
        if beyond := [level for level in levels if _is_beyond(method, firsts[level])]:
            note(f"{method.name}: at {', '.join(beyond)} there is more noise than it knows")
    comparison = compare(
        testset, [NOISY, CLASSICAL, *methods], crop_levels=levels[len(levels) // 2 :][:1], progress=progress
    )
    if perfect := perfect_note(comparison.images):
        note(perfect)
    return comparison


def _stated_noise(capture: Path) -> NoiseLevel:
    noise = stated_noise(read_raw(capture))
    if noise is None:
        raise FsidError(
            f"{capture}: states no noise, which every denoiser needs; write its NoiseProfile, in Python: "
            "write_dng(path, replace(raw, noise=profile.level(iso)))"
        )
    return noise


def _is_beyond(method: Method, noise: NoiseLevel) -> bool:
    """Whether it is more, at mid-grey, than the method knows."""
    from fsid.denoise.denoise import variance_at_grey

    return variance_at_grey(noise) > method.most_noise


def write_comparison(comparison: Comparison, testset: str | Path, out: str | Path) -> None:
    """Write results.json, images.csv and report.html of the comparison on `testset` into `out`.

    The report shows the crops that `compare` was asked for.
    """
    from fsid.evaluate.comparison_report import comparison_sections  # they take a second to import
    from fsid.evaluate.report import write_report

    testset, out = Path(testset), Path(out)
    make_folder(out)
    write_results(comparison.rows, out / "results.json")
    write_images(comparison.images, out / "images.csv")
    made = comparison.testset
    lead = f"{counted(len(made.images), 'image')}, {counted(len(made.levels), 'level')}: {made.notes}."
    write_report(out / "report.html", f"FSID: {testset.name}", lead, comparison_sections(comparison))
