"""How fast the sensor is: python bench/sensor.py [MEGAPIXELS].

Per operation, NumPy and torch: ns per pixel, in times of a memory copy of the same array, and how many times
as fast as the formula written out in NumPy (tests/sensor_transcribed.py; for counts, numpy's own). All of an
operation's ways take turns in one run, one thread each, and the best of seven counts.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import sensor_transcribed as transcribed
from fsid.sensor import Raw, add_noise, load_profile, mosaic, noisy_from_clean, pack, quantise, unprocess
from fsid.sensor.colour import srgb_to_camera_matrix
from fsid.sensor.formula import stored, with_noise
from fsid.sensor.poisson import poisson

RUNS = 7
Work = Callable[[], object]


def seconds(works: list[Work | None]) -> list[float]:
    """Best time of each, taking turns, after one round that warms up; nan for None."""
    best = [float("inf") if work else float("nan") for work in works]
    for run in range(RUNS + 1):
        for place, work in enumerate(works):
            if work is not None:
                start = time.perf_counter()
                work()
                if run:
                    best[place] = min(best[place], time.perf_counter() - start)
    return best


def report(name: str, array: np.ndarray, own: Work, tensors: Work | None, direct: Work | None = None) -> None:
    """One line. own: with arrays; tensors: with tensors; direct: the formula written out."""
    pixels = array.shape[0] * array.shape[1]
    copy, *times, written_out = seconds([array.copy, own, tensors, direct])
    columns = [f"{1e9 * t / pixels:8.2f} {t / copy:7.1f} {written_out / t:7.1f}" for t in times]
    print(f"{name:28s} {' |'.join(columns)}".replace("nan", "  -"))


def main(megapixels: float) -> None:
    torch.set_num_threads(1)
    side = round((megapixels * 1e6) ** 0.5 / 2) * 2
    rng = np.random.default_rng(0)
    x, photo = rng.random((side, side), np.float32), rng.random((side, side, 3), np.float32)
    profile = load_profile("pixel6")
    cfa, level = profile.cfa, profile.level(3200)
    matrix, gains = profile.xyz_to_camera[0], (2.1, 1.0, 1.7)
    raw = Raw(x, cfa, 64, 1023, gains, matrix)
    light, picture = torch.from_numpy(x), torch.from_numpy(photo)
    packed = pack(light, cfa)
    k, sigma2 = (torch.tensor(v, dtype=torch.float32)[:, None, None] for v in (level.k, level.sigma2))
    camera = srgb_to_camera_matrix(matrix)

    def noise() -> Any:
        return with_noise(packed, torch.randn_like(packed), k, sigma2)

    print(f"{side}x{side}, pixel6 at ISO 3200{'NumPy':>15s}{'torch':>25s}")
    print(f"{'':28s} {' |'.join(2 * ['   ns/px  x copy x faster'])}")
    report(
        "noise", x, lambda: add_noise(rng, raw, level), noise, lambda: transcribed.noise(rng, x, level, cfa)
    )
    both = lambda: noisy_from_clean(rng, raw, 3200, level)  # noqa: E731
    report("noise and quantisation", x, both, lambda: stored(noise(), 64, 959))
    report("quantisation", x, lambda: quantise(raw), lambda: stored(packed, 64, 959))
    report(
        "unprocessing",
        photo,
        lambda: unprocess(photo, matrix, gains),
        lambda: unprocess(picture, matrix, gains),
        lambda: transcribed.unprocess(photo, camera, gains),
    )
    report("mosaic", x, lambda: mosaic(photo, cfa), lambda: mosaic(picture, cfa))
    report("pack", x, lambda: pack(x, cfa), lambda: pack(light, cfa), lambda: transcribed.pack(x, cfa))
    for electrons in (1, 10, 100, 5000):
        lam = x * np.float32(electrons)
        works = (
            partial(poisson, rng, lam),
            partial(torch.poisson, torch.from_numpy(lam)),
            partial(rng.poisson, lam),
        )
        report(f"Poisson, 0..{electrons} electrons", x, *works)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 4.0)
