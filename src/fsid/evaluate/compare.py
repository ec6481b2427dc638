"""Measure denoisers on a test set: RAW PSNR, and PSNR and SSIM after develop, per light level and set."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter

from fsid.errors import FsidError
from fsid.evaluate.classical import denoise_classical
from fsid.evaluate.metrics import psnr, ssim
from fsid.evaluate.results import MOST_DB, ImageRow, Row
from fsid.evaluate.testset import ALL_SETS, TestImage, TestSet, listed, read_testset
from fsid.evenly_spaced import spaced
from fsid.sensor import Raw, develop, read_raw, upright

MOST_CROPS = 100
"""Images of which windows are kept: under three methods each takes half a megabyte of a report, and 1,000
would make a page that opens nowhere."""


@dataclass(frozen=True)
class Method:
    """A denoiser under test. training: what it was trained on, in words ("" for the baselines). most_noise:
    variance at mid-grey up to which it knows noise, where that is known.

    denoise: may change what it is given, which is a copy; returns a finite Raw of the same size and CFA, of
    which the mosaic is measured: it is developed with the colours of what was given.
    """

    name: str
    training: str
    denoise: Callable[[Raw], Raw]
    most_noise: float = math.inf


@dataclass(frozen=True, eq=False)
class Crops:
    """A window of one image at one level, developed: (h, w, 3) sRGB 0..1, by method name."""

    image: str
    level: str
    truth: np.ndarray
    by_method: dict[str, np.ndarray]
    psnr_raw: dict[str, float]


@dataclass(frozen=True)
class Comparison:
    """All rows, those of the single images, and the crops that were asked for."""

    testset: TestSet
    rows: tuple[Row, ...]
    images: tuple[ImageRow, ...]
    crops: tuple[Crops, ...]


NOISY = Method("noisy", "", lambda raw: raw)
CLASSICAL = Method("classical", "", denoise_classical)


def compare(
    root: str | Path,
    methods: Iterable[Method],
    *,
    crop_levels: Sequence[str] = (),
    crop_px: int = 128,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Comparison:
    """Run every method on every capture of the test set in `root`.

    crop_levels: levels of which a window of every image is kept, of many those of `MOST_CROPS` evenly spaced;
    crop_px: its edge in pixels.
    Rows cover each set, and all sets together where there is more than one. FsidError: an unusable test set,
    of which every file is read before anything is measured, or a method whose result is not as `Method` says.
    """
    root = Path(root)
    testset = read_testset(root)
    methods = tuple(methods)
    names = [method.name for method in methods]
    if not names:
        raise FsidError(f"{root}: there is no method to compare")
    if twice := [name for name in names if names.count(name) > 1]:
        raise FsidError(f"{twice[0]}: two models have this name")
    crop_levels = listed(crop_levels, "crop_levels")
    if unknown := set(crop_levels) - set(testset.levels):
        raise FsidError(f"{root}: has no level {', '.join(sorted(unknown))}")
    images: list[ImageRow] = []
    crops, shown = [], spaced(testset.images, MOST_CROPS)
    tasks = list(product(testset.images, testset.levels))
    progress(0, len(tasks))
    for image, level in tasks:
        _read(root, testset, image, level)  # a broken file is named now, not after an hour
    for done, (image, level) in enumerate(tasks):
        progress(done, len(tasks))
        truth, frames, paths = _read(root, testset, image, level)
        developed_truth = develop(truth)
        outputs, shown_psnr = {}, {}
        for method in methods:
            results = [_denoised(method, frame, path) for frame, path in zip(frames, paths, strict=True)]
            developed = [develop(result) for result in results]
            outputs[method.name] = developed[0]
            figures = [
                (_db(r.mosaic, truth.mosaic), _db(d, developed_truth), ssim(d, developed_truth))
                for r, d in zip(results, developed, strict=True)
            ]
            shown_psnr[method.name] = figures[0][0]
            mean = map(float, np.mean(figures, axis=0))
            images.append(ImageRow(method.name, level, image.set, image.name, *mean))
        if level in crop_levels and image in shown:
            turn = truth.metadata.orientation
            crops.append(_crops(image, level, developed_truth, outputs, shown_psnr, crop_px, turn))
    progress(len(tasks), len(tasks))
    return Comparison(testset, tuple(summarise(testset, methods, images)), tuple(images), tuple(crops))


def _db(image: np.ndarray, truth: np.ndarray) -> float:
    return min(psnr(image, truth), MOST_DB)


def _read(root: Path, testset: TestSet, image: TestImage, level: str) -> tuple[Raw, list[Raw], list[Path]]:
    """The truth of an image at a level, its captures, and their paths."""
    truth = read_raw(testset.clean(root, image, level))
    paths = [testset.noisy(root, image, level, n) for n in range(testset.frames)]
    return truth, [_noisy(path, truth) for path in paths], paths


def _noisy(path: Path, truth: Raw) -> Raw:
    """A capture, to be developed as its truth is: a phone may balance white in each frame of a burst anew."""
    noisy = read_raw(path)
    if truth.mosaic.shape != noisy.mosaic.shape or truth.cfa != noisy.cfa:
        raise FsidError(f"{path}: size or CFA differs from its clean.dng")
    return replace(
        noisy,
        white_balance=truth.white_balance,
        xyz_to_camera=truth.xyz_to_camera,
        metadata=truth.metadata,
    )


def _denoised(method: Method, frame: Raw, path: Path) -> Raw:
    try:
        result = method.denoise(deepcopy(frame))
    except FsidError as error:
        raise FsidError(f"{path}: {method.name}: {error}") from None
    if not isinstance(result, Raw):
        kind = type(result).__name__
        raise FsidError(f"{method.name}: denoise returns a Raw, replace(raw, mosaic=...); got {kind}")
    if (result.mosaic.shape, result.cfa) != (frame.mosaic.shape, frame.cfa):
        (height, width), (high, wide) = result.mosaic.shape, frame.mosaic.shape
        raise FsidError(
            f"{method.name}: denoise makes {width}x{height} {result.cfa} of {wide}x{high} {frame.cfa}; "
            "it must keep size and CFA"
        )
    if not np.isfinite(result.mosaic).all():
        raise FsidError(f"{method.name}: denoise makes NaN or infinity, which nothing can be measured of")
    return replace(frame, mosaic=result.mosaic)


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


def summarise(testset: TestSet, methods: Sequence[Method], images: Sequence[ImageRow]) -> list[Row]:
    """The means over each set of `testset`, and over all where there are several, from `images`."""
    sets = list(dict.fromkeys(image.set for image in testset.images))
    names = [*sets, ALL_SETS] if len(sets) > 1 else sets
    members = {(image.set, image.name) for image in testset.images}
    rows = []
    for method, level, name in product(methods, testset.levels, names):
        triples = [
            (row.psnr_raw, row.psnr, row.ssim)
            for row in images
            if (row.model, row.level) == (method.name, level)
            and (row.set, row.image) in members
            and name in (row.set, ALL_SETS)
        ]
        mean = map(float, np.mean(triples, axis=0))
        rows.append(Row(method.name, method.training, testset.camera, level, name, len(triples), *mean))
    return rows


def _crops(
    image: TestImage,
    level: str,
    truth: np.ndarray,
    outputs: dict[str, np.ndarray],
    psnr_raw: dict[str, float],
    size: int,
    orientation: int,
) -> Crops:
    window, _ = detailed_window(truth, size)
    return Crops(
        image.name,
        level,
        upright(truth[window], orientation),
        {name: upright(output[window], orientation) for name, output in outputs.items()},
        psnr_raw,
    )
