"""How good a calibration is: python bench/calibration.py [CAMERA] [SEEDS] [SIDE] [FRAMES].

Simulated bursts of a ramp, with the shot noise of electrons, and dark frames at ten ISOs. Per ISO, over all
seeds and sites: bias and scatter of k and sigma2 in percent of the truth, the largest error of the mean over
the sites of one seed, and the scatter in units of the stated standard error, which should be 1.
"""

from __future__ import annotations

import sys

import numpy as np

from fsid.sensor import (
    NoiseTerms,
    Raw,
    TemporalStatistics,
    fit_noise,
    load_profile,
    noisy_from_clean,
    to_dn,
)
from fsid.sensor.camera_profile import CameraProfile

SHOT = NoiseTerms(poisson=True)
ISOS = tuple(50.0 * 2**stop for stop in range(10))  # 50 .. 25600


def burst(
    rng: np.random.Generator, clean: Raw, iso: float, profile: CameraProfile, frames: int
) -> TemporalStatistics:
    stats = TemporalStatistics(profile.white_level)
    for _ in range(frames):
        stats.add(to_dn(noisy_from_clean(rng, clean, iso, profile.level(iso), SHOT)))
    return stats


def main(camera: str, seeds: int, side: int, frames: int) -> None:
    profile = load_profile(camera)
    ramp = np.broadcast_to(np.linspace(0, 0.95, side, dtype=np.float32) ** 2, (side, side))
    scenes = [
        Raw(
            np.ascontiguousarray(m),
            profile.cfa,
            profile.black_level,
            profile.white_level,
            (2, 1, 1.6),
            np.eye(3),
        )
        for m in (ramp, 0 * ramp)
    ]
    print(f"{camera}: {seeds} seeds, {frames} + {frames} dark frames of {side}x{side}; errors in percent")
    print("   ISO  read DN |  k bias  scatter  largest    z | sigma2 bias  scatter  largest    z")
    for iso in ISOS:
        level = profile.level(iso)
        truth = np.array([level.k, level.sigma2])
        error, z = [], []
        for seed in range(seeds):
            rng = np.random.default_rng([seed, int(iso)])
            light, dark = (burst(rng, scene, iso, profile, frames) for scene in scenes)
            fit = fit_noise([light], cfa=profile.cfa, white_level=profile.white_level, dark=dark)
            unit = np.array([[profile.span], [profile.span**2]])
            found, stated = (
                np.array([fit.k_dn, fit.sigma2_dn]) / unit,
                np.array([fit.k_dn_error, fit.sigma2_dn_error]) / unit,
            )
            error.append(100 * (found / truth - 1))
            z.append((found - truth) / stated)
        e, scatter = np.array(error), np.sqrt(np.mean(np.square(z), axis=(0, 2)))
        columns = [
            f"{v.mean():8.2f} {v.std():8.2f} {np.abs(v.mean(axis=1)).max():8.2f} {z_scatter:5.2f}"
            for v, z_scatter in zip((e[:, 0], e[:, 1]), scatter, strict=True)
        ]
        read = np.sqrt(np.mean(level.sigma2)) * profile.span
        print(f"{iso:6.0f} {read:8.2f} |{columns[0]} |   {columns[1]}", flush=True)


if __name__ == "__main__":
    given = sys.argv[1:]
    defaults = ["pixel6", "20", "256", "50"]
    camera, *numbers = given + defaults[len(given) :]
    main(camera, *map(int, numbers))
