"""Measure denoisers on a test set: RAW PSNR, and PSNR and SSIM after develop, per light level and set."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter

from fsid.errors import FsidError
from fsid.evaluate.classical import denoise_classical
from fsid.evaluate.metrics import psnr, ssim
from fsid.evaluate.testset import TestImage, TestSet, read_testset
from fsid.sensor import Raw, develop, read_raw


@dataclass(frozen=True)
class Method:
    """A denoiser under test. training: what it was trained on, in words ("" for the baselines)."""

    name: str
    training: str
    denoise: Callable[[Raw], Raw]


@dataclass(frozen=True)
class Row:
    """A line of results.json: the mean over the `n` images of a set at one level; dB, dB, 0..1."""

    model: str
    training: str
    camera: str
    level: str
    set: str
    n: int
    psnr_raw: float
    psnr: float
    ssim: float


@dataclass(frozen=True)
class Crops:
    """A window of one image at one level, developed: (h, w, 3) sRGB 0..1, by method name."""

    title: str
    truth: np.ndarray
    by_method: dict[str, np.ndarray]
    psnr_raw: dict[str, float]


@dataclass(frozen=True)
class Comparison:
    """All rows, and the crops that were asked for."""

    testset: TestSet
    rows: tuple[Row, ...]
    crops: tuple[Crops, ...]


NOISY = Method("noisy", "", lambda raw: raw)
CLASSICAL = Method("classical", "", denoise_classical)

ALL_SETS = "all"


def compare(
    root: Path,
    methods: Sequence[Method],
    *,
    crop_levels: Sequence[str] = (),
    crop_px: int = 128,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Comparison:
    """Run every method on every capture of the test set in `root`.

    crop_levels: levels of which a window of every image is kept; crop_px: its edge in pixels.
    Rows cover each set, and all sets together where there is more than one.
    """
    testset = read_testset(root)
    if len({method.name for method in methods}) < len(methods):
        raise FsidError("two models have the same name; copy one to another folder name")
    if unknown := set(crop_levels) - set(testset.levels):
        raise FsidError(f"{root}: has no level {', '.join(sorted(unknown))}")
    figures: dict[tuple[str, str, str], list[tuple[float, float, float]]] = {}
    crops = []
    tasks = list(product(testset.images, testset.levels))
    for done, (image, level) in enumerate(tasks):
        progress(done, len(tasks))
        truth = read_raw(testset.clean(root, image))
        noisy = read_raw(testset.noisy(root, image, level))
        if truth.mosaic.shape != noisy.mosaic.shape or truth.cfa != noisy.cfa:
            raise FsidError(f"{testset.noisy(root, image, level)}: size or CFA differs from its clean.dng")
        developed_truth = develop(truth)
        outputs = {}
        for method in methods:
            output = method.denoise(noisy)
            developed = develop(output)
            outputs[method.name] = developed
            figures.setdefault((method.name, level, image.set), []).append(
                (
                    psnr(output.mosaic, truth.mosaic),
                    psnr(developed, developed_truth),
                    ssim(developed, developed_truth),
                )
            )
        if level in crop_levels:
            raw_psnr = {m.name: figures[m.name, level, image.set][-1][0] for m in methods}
            crops.append(_crops(image, level, developed_truth, outputs, raw_psnr, crop_px))
    progress(len(tasks), len(tasks))
    return Comparison(testset, tuple(_rows(testset, methods, figures)), tuple(crops))


def detailed_window(srgb: np.ndarray, size_px: int) -> tuple[tuple[slice, slice], float]:
    """The window of (H, W, 3) with the most detail, and how much it is: mean gradient of the smoothed image.

    Smoothed, so that it shows the edges of things rather than the finest texture, where nobody sees noise.
    """
    grey = gaussian_filter(srgb.mean(axis=2), 3.0)
    detail = np.hypot(*np.gradient(grey))
    height, width = (min(size_px, edge) for edge in grey.shape)
    tops = range(0, grey.shape[0] - height + 1, max(1, height // 2))
    lefts = range(0, grey.shape[1] - width + 1, max(1, width // 2))
    windows = [np.s_[top : top + height, left : left + width] for top, left in product(tops, lefts)]
    best = max(windows, key=lambda window: float(detail[window].mean()))
    return best, float(detail[best].mean())


def write_results(rows: Sequence[Row], file: Path) -> None:
    """Write results.json: a list of rows, figures rounded to 1e-4."""
    plain = [
        {key: round(value, 4) if isinstance(value, float) else value for key, value in asdict(row).items()}
        for row in rows
    ]
    file.write_text(json.dumps(plain, indent=1) + "\n", encoding="utf-8")


def _rows(
    testset: TestSet,
    methods: Sequence[Method],
    figures: dict[tuple[str, str, str], list[tuple[float, float, float]]],
) -> Iterator[Row]:
    sets = sorted({image.set for image in testset.images})
    for method, level in product(methods, testset.levels):
        by_set = {name: figures[method.name, level, name] for name in sets}
        if len(sets) > 1:
            by_set[ALL_SETS] = [triple for triples in by_set.values() for triple in triples]
        for name, triples in by_set.items():
            mean = np.mean(triples, axis=0)
            yield Row(
                method.name, method.training, testset.camera, level, name, len(triples), *map(float, mean)
            )


def _crops(
    image: TestImage,
    level: str,
    truth: np.ndarray,
    outputs: dict[str, np.ndarray],
    psnr_raw: dict[str, float],
    size: int,
) -> Crops:
    window, _ = detailed_window(truth, size)
    return Crops(
        f"{image.name.partition('-')[2]}, {level}",
        truth[window],
        {name: output[window] for name, output in outputs.items()},
        psnr_raw,
    )
