"""Noise levels for whole batches: ISO log-uniform, jittered, from a table of each camera's curve.

    log level(u) ~ table,      u = log(ISO / low) / log(high / low) uniform in 0..1

`sensor.noise.level_rand` asks the profile's interpolants anew for every level, which took a tenth of the time
of a training patch. Log-uniform ISO is a uniform place in a table with even steps of log(ISO), and between
two of its `_STEPS` steps the logarithm of a level is all but a straight line.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fsid.errors import FsidError
from fsid.sensor.noise import K_JITTER, SIGMA2_JITTER
from fsid.sensor.profiles import CameraProfile
from fsid.sensor.quantise import ROUNDING_DN2

_STEPS = 512


class LevelTable:
    """What cameras' k and sigma2 are over `iso_range` = (low, high), 0 < low <= high."""

    def __init__(self, cameras: Sequence[CameraProfile], iso_range: tuple[float, float]) -> None:
        low, high = iso_range
        if not 0 < low <= high:
            raise FsidError(f"iso_range ({low}, {high}): give two ISO values, 0 < low <= high")
        iso = np.geomspace(low, high, _STEPS + 1)
        levels = [[camera.level(value) for value in iso] for camera in cameras]
        self._log = np.log([[(level.k, level.sigma2) for level in curve] for curve in levels])
        self._floor = np.array([[ROUNDING_DN2 / camera.span**2] for camera in cameras], np.float32)

    def draw_rand(self, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """`count` levels, jittered as by `level_rand`: camera (count,), k and sigma2 (count, 4) float32."""
        camera = rng.integers(len(self._log), size=count)
        place = rng.uniform(0, _STEPS, count)
        step = np.minimum(place.astype(int), _STEPS - 1)
        share = (place - step)[:, None, None]
        before, after = self._log[camera, step], self._log[camera, step + 1]
        jitter = rng.normal(0.0, (K_JITTER, SIGMA2_JITTER), (count, 2))[..., None]
        levels = np.exp(before + share * (after - before) + jitter).astype(np.float32)
        return camera, levels[:, 0], np.maximum(levels[:, 1], self._floor[camera])
