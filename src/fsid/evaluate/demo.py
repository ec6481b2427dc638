"""The whole chain, small, on a CPU: scenes -> pairs -> network -> proof on photographs -> report.

The network sees rendered scenes alone. It is then measured on photographs that come with installed packages
(so that it works offline), pushed through a Pixel 6 at four ISOs, against the noisy input and a classical
denoiser.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from importlib.resources import as_file, files
from pathlib import Path

import numpy as np

from fsid.config import check_fields
from fsid.dataset import (
    GenerateConfig,
    find_shards,
    generate,
    grid,
    read_member,
    save_png,
    shard_keys,
    to_uint8,
)
from fsid.dataset.png import stored_preview
from fsid.denoise import TrainConfig, load_history, train, train_config
from fsid.errors import FsidError
from fsid.evaluate.compare import CLASSICAL, NOISY, Comparison, Method, compare, detailed_window
from fsid.evaluate.comparison_report import comparison_sections
from fsid.evaluate.models import model_method
from fsid.evaluate.plots import loss_plot, noise_profile_plot
from fsid.evaluate.report import Section, picture, write_report
from fsid.evaluate.results import write_results
from fsid.evaluate.resumable_folder import claimed
from fsid.evaluate.testset import TESTSET_FILE, photo_testset
from fsid.files import make_folder, write_atomically
from fsid.plurals import counted
from fsid.sensor import develop, load_profile, read_raw

PHOTOGRAPHS = (
    ("skimage", "data/astronaut.png"),
    ("skimage", "data/chelsea.png"),
    ("skimage", "data/coffee.png"),
    ("skimage", "data/motorcycle_left.png"),
    ("skimage", "data/rocket.jpg"),
    ("matplotlib", "mpl-data/sample_data/grace_hopper.jpg"),
)
CAMERA = "pixel6"
ISOS = (800, 1600, 3200, 6400)
CROP_LEVEL = "iso3200"
_WINDOW_PX = 180  # side of the window of the scene that is shown

ProgressBar = Callable[[str, str], AbstractContextManager[Callable[[int, int], None]]]


@dataclass(frozen=True)
class DemoConfig:
    """scenes: rendered frames of width x height pixels; photographs: how many of PHOTOGRAPHS to test on.

    steps: of the training of configs/nafnet-tiny.yaml; 0 takes the file's number.
    """

    scenes: int = 40
    width: int = 960
    height: int = 540
    steps: int = 0
    photographs: int = len(PHOTOGRAPHS)
    seed: int = 0

    def __post_init__(self) -> None:
        check_fields(self)


def demo(out: Path, config: DemoConfig, bar: ProgressBar) -> Path:
    """Run the chain in `out`; running it again continues it. Returns the path of the report.

    bar(label, unit): a context manager that yields progress(done, total).
    """
    if not 1 <= config.photographs <= len(PHOTOGRAPHS):
        raise FsidError(f"--photographs {config.photographs}: there are 1 to {len(PHOTOGRAPHS)}")
    if config.scenes < 1 or config.seed < 0:
        raise FsidError(
            f"--scenes {config.scenes} --seed {config.seed}: at least 1 scene, and no negative seed"
        )
    generated, training = GenerateConfig(width=config.width, height=config.height), _training(config)
    least = 2 * training.patch_px + 2
    if min(config.width, config.height) < least:
        raise FsidError(
            f"--width {config.width} --height {config.height}: patches of the training need {least}x{least}"
        )
    with claimed(out, config, "demo"):
        return _run(out, config, generated, training, bar)


def _run(
    out: Path, config: DemoConfig, generated: GenerateConfig, training: TrainConfig, bar: ProgressBar
) -> Path:
    data, run, testset = out / "data", out / "run", out / "testset"
    with bar("rendering scenes", "pairs") as progress:
        generate(data, generated, count=config.scenes, seed=config.seed, shard_size=8, progress=progress)
    with bar("training on them", "steps") as progress:
        train(data, run, training, progress=progress)
    ours = model_method(run, "ours")
    if not (testset / TESTSET_FILE).exists():
        photographs = _copy_photographs(out / "photographs", config.photographs)
        with bar("photographs to RAW", "photographs") as progress:
            photo_testset([photographs], testset, camera=CAMERA, isos=ISOS, progress=progress)
    with bar("measuring", "captures") as progress:
        comparison = compare(testset, [NOISY, CLASSICAL, ours], crop_levels=[CROP_LEVEL], progress=progress)
    write_results(comparison.rows, out / "results.json")
    report = out / "report.html"
    sections = [*comparison_sections(comparison), *_chain_sections(out, ours)]
    write_report(
        report, "FSID: trained on scenes, tested on photographs", _lead(config, comparison), sections
    )
    return report


def _chain_sections(out: Path, ours: Method) -> list[Section]:
    """What the network was made from: scenes, a pair, the noise, the course of the training."""
    overview = _overview(out, ours)
    save_png(out / "overview.png", overview)
    scenes = "All that the network was trained on."
    pair = "Scene, then a window of the clean RAW, the noisy RAW and the denoised RAW, all developed."
    noise = noise_profile_plot(load_profile(CAMERA), ISOS)
    return [
        Section("Scenes", scenes, pictures=((picture(_contact_sheet(out / "data")),),)),
        Section("A training pair", pair, pictures=((picture(overview),),)),
        Section("Noise", "Var(x) = k x + sigma2, per CFA site.", pictures=((noise,),)),
        Section("Training", pictures=((loss_plot(*load_history(out / "run")),),)),
    ]


def _training(config: DemoConfig) -> TrainConfig:
    steps = [f"steps={config.steps}"] if config.steps else []
    return train_config("nafnet-tiny", ["shrink=[1]", *steps])


def _copy_photographs(folder: Path, count: int) -> Path:
    """Photographs that installed packages ship, as a folder."""
    make_folder(folder)
    for package, name in PHOTOGRAPHS[:count]:
        with as_file(files(package).joinpath(name)) as file:
            write_atomically(folder / file.name, file.read_bytes())
    return folder


def _lead(config: DemoConfig, comparison: Comparison) -> str:
    psnr = {(row.model, row.level): row.psnr_raw for row in comparison.rows}
    gain = psnr["ours", CROP_LEVEL] - psnr["noisy", CROP_LEVEL]
    over = psnr["ours", CROP_LEVEL] - psnr["classical", CROP_LEVEL]
    return (
        f"A small network, trained on {config.scenes} rendered scenes and nothing else, measured on "
        f"{counted(config.photographs, 'photograph')} with Pixel 6 noise. "
        f"At ISO 3200: {gain:+.2f} dB over the noisy input, "
        f"{over:+.2f} dB over the classical denoiser (RAW PSNR). "
        "ISO 6400 is beyond the published noise fit (ISO 49 to 3199) and extrapolated."
    )


def _samples(data: Path) -> list[tuple[Path, str]]:
    return [(shard, key) for shard in find_shards(data) for key in shard_keys(shard)]


def _contact_sheet(data: Path) -> np.ndarray:
    return grid([np.asarray(stored_preview(shard, key).reduce(4)) for shard, key in _samples(data)])


def _overview(out: Path, ours: Method) -> np.ndarray:
    """A scene; then a window of it as clean RAW, noisy RAW and denoised, all developed: (h, w, 3) uint8.

    The RAW files of the pair are left in `out`.
    """
    shard, key = _pair_to_show(out / "data")
    for name in ("clean", "noisy"):
        write_atomically(out / f"pair.{name}.dng", read_member(shard, f"{key}.{name}.dng"))
    clean, noisy = (read_raw(out / f"pair.{name}.dng") for name in ("clean", "noisy"))
    scene, *others = (develop(raw) for raw in (clean, noisy, ours.denoise(noisy)))
    window, _ = detailed_window(scene, _WINDOW_PX)
    scale = max(1, scene.shape[0] // _WINDOW_PX)
    windows = [image[window].repeat(scale, 0).repeat(scale, 1) for image in (scene, *others)]
    rows = len(windows[0])
    gap = np.ones((rows, 8, 3), np.float32)
    top = (len(scene) - rows) // 2
    return to_uint8(np.hstack([scene[top : top + rows], gap, windows[0], gap, windows[1], gap, windows[2]]))


def _pair_to_show(data: Path) -> tuple[Path, str]:
    """Of the eight noisiest pairs the one of middling detail: noise shows on things, not in gravel."""

    def iso(sample: tuple[Path, str]) -> float:
        return json.loads(read_member(sample[0], f"{sample[1]}.json"))["iso"]

    def detail(sample: tuple[Path, str]) -> float:
        return detailed_window(np.asarray(stored_preview(*sample)) / 255, _WINDOW_PX)[1]

    noisiest = sorted(sorted(_samples(data), key=iso)[-8:], key=detail)
    return noisiest[len(noisiest) // 2]
