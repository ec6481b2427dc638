"""How much memory a calibration takes: python bench/calibration_memory.py [FRAMES...] [--megapixels N].

Each number of frames is a process of its own: a burst of simulated frames (Pixel 6 at ISO 1600, a ramp) goes
through the statistics one by one, then the line is fitted. Per number: peak resident memory and seconds per
frame; at the end the slope of the memory over the frames, in MB per frame. It should be 0.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time

import numpy as np

from fsid.sensor import Raw, TemporalStatistics, fit_noise, load_profile, noisy_from_clean, to_dn

PROFILE, ISO = load_profile("pixel6"), 1600


def burst(frames: int, megapixels: float) -> None:
    """Print peak memory in MB and seconds per frame."""
    height = round((megapixels * 1e6 * 3 / 4) ** 0.5 / 2) * 2
    ramp = np.linspace(0, 0.9, 4 * height // 3 // 2 * 2, dtype=np.float32)
    clean = Raw(np.tile(ramp, (height, 1)), PROFILE.cfa, 64, 1023, (2, 1, 1.6), np.eye(3))
    rng, stats = np.random.default_rng(0), TemporalStatistics(1023)
    seconds = 0.0
    for _ in range(frames):
        dn = to_dn(noisy_from_clean(rng, clean, ISO, PROFILE.level(ISO)))
        started = time.perf_counter()
        stats.add(dn)
        seconds += time.perf_counter() - started
    started = time.perf_counter()
    fit = fit_noise([stats], cfa=PROFILE.cfa, white_level=1023, black_level=64)
    fitting = time.perf_counter() - started
    error = 100 * np.max(np.abs(fit.k_dn / PROFILE.span / PROFILE.level(ISO).k - 1))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{peak:.1f} {seconds / frames:.3f} {fitting:.1f} {error:.2f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("frames", nargs="*", type=int, default=[5, 20, 40])
    parser.add_argument("--megapixels", type=float, default=12.0)
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.one:
        burst(given.frames[0], given.megapixels)
        return
    print(f"{given.megapixels:g} MP\nframes  peak MB  s/frame  s to fit  largest error of k in percent")
    peaks = []
    for frames in given.frames:
        command = [sys.executable, __file__, str(frames), "--one", f"--megapixels={given.megapixels}"]
        run = subprocess.run(command, capture_output=True, text=True, check=True)
        peak, per_frame, fitting, error = run.stdout.split()
        peaks.append(float(peak))
        print(f"{frames:6d} {peak:>8s} {per_frame:>8s} {fitting:>9s} {error:>7s}", flush=True)
    if len(peaks) > 1:
        print(f"slope {np.polyfit(given.frames, peaks, 1)[0]:+.3f} MB per frame")


if __name__ == "__main__":
    main()
