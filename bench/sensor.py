"""How fast the sensor is: python bench/sensor.py [MEGAPIXELS].

Per operation: ns per pixel, the time of a memory copy of the same array, and that of the
formula transcribed directly into NumPy (tests/sensor_transcribed.py). One thread; the best of five runs.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import sensor_transcribed as transcribed
from fsid.sensor import Raw, add_noise, load_profile, mosaic, noisy_from_clean, pack, quantise, unprocess
from fsid.sensor.colour import srgb_to_camera_matrix
from fsid.sensor.poisson import poisson

RUNS = 5


def seconds(work: Callable[[], object]) -> float:
    """Best time of several runs, after one that warms up."""
    work()
    times = []
    for _ in range(RUNS):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def report(
    name: str, work: Callable[[], object], array: np.ndarray, pixels: int, reference: float | None = None
) -> None:
    """One line; reference: seconds of the direct formula, where there is one to compare with."""
    copy, own = seconds(array.copy), seconds(work)
    line = f"{name:32s} {1e9 * own / pixels:7.2f} ns/px   {own / copy:6.1f} x copy"
    print(line if reference is None else f"{line}   {reference / own:5.1f} x faster than direct")


def main(megapixels: float) -> None:
    side = round((megapixels * 1e6) ** 0.5 / 2) * 2
    rng = np.random.default_rng(0)
    x = rng.random((side, side), np.float32)
    photo = rng.random((side, side, 3), np.float32)
    profile = load_profile("pixel6")
    level, matrix, gains = profile.level(3200), profile.xyz_to_camera[0], (2.1, 1.0, 1.7)
    raw = Raw(x, profile.cfa, 64, 1023, gains, matrix)
    pixels = x.size
    noise = seconds(lambda: transcribed.noise(rng, x, level, raw.cfa))
    report("noise", lambda: add_noise(rng, raw, level), x, pixels, noise)
    report("noise and quantisation", lambda: noisy_from_clean(rng, raw, 3200, level), x, pixels)
    report("quantisation", lambda: quantise(raw), x, pixels)
    camera = srgb_to_camera_matrix(matrix)
    direct = seconds(lambda: transcribed.unprocess(photo, camera, gains))
    report("unprocessing", lambda: unprocess(photo, matrix, gains), photo, pixels, direct)
    report("mosaic", lambda: mosaic(photo, raw.cfa), x, pixels)
    report("pack", lambda: pack(x, raw.cfa), x, pixels, seconds(lambda: transcribed.pack(x, raw.cfa)))
    for name, electrons in (("0 .. 10", 10.0), ("0 .. 100", 100.0), ("0 .. 5000", 5000.0)):
        lam = x * np.float32(electrons)
        numpy = seconds(lambda lam=lam: rng.poisson(lam))
        report(f"Poisson, {name} electrons", lambda lam=lam: poisson(rng, lam), x, pixels, numpy)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 4.0)
