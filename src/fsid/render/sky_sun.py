"""The sun in a picture of the sky: what is small and bright enough to cast shadows becomes a light.

    E = sum of (L - most) dw over texels brighter than `most`, around the brightest above the horizon

is its irradiance at normal incidence, `most` being what is left in the sky. Ambient light knows a sky by the
irradiance along its axes (`fsid.render.room`), which is nearly all that there is of a smooth one; of a sun it
would light faces that the sun does not reach, with three times what a grazed one gets, and shade none.
"""

from __future__ import annotations

import numpy as np

from fsid.render.sky import angles
from fsid.scene.colour import LUMINANCE
from fsid.scene.model import ZERO, Light
from fsid.scene.vectors import vec3

_PEAK = 10.0
"""Radiance relative to the mean from which on a sky casts shadows."""

_AROUND = np.cos(np.radians(5.0))
"""Cosine of the angle from its brightest place within which a sun is."""

_LEAST = 0.05
"""Irradiance of a sun, relative to pi times the mean radiance, that is worth a shadow."""


def part_sun(panorama: np.ndarray) -> tuple[Light | None, np.ndarray]:
    """The sun, None where there is none, and the panorama (H, 2 H, 3) without it, radiance as in it."""
    mean = float(panorama.mean())
    most = np.float32(_PEAK * mean)
    above = panorama[: len(panorama) // 2]
    row, column = np.nonzero((above > most).any(-1))
    if not len(row):
        return None, panorama
    elevation, azimuth = angles(len(panorama))
    up, around = elevation[row], azimuth[column]
    towards = np.stack([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)], axis=-1)
    excess = np.maximum(above[row, column] - most, 0.0).astype(float)
    near = towards @ towards[np.argmax(excess @ LUMINANCE)] > _AROUND
    texel = np.pi / len(panorama)
    power = excess[near] * (np.cos(up[near]) * texel**2)[:, None]
    weight = power @ LUMINANCE
    if weight.sum() < _LEAST * np.pi * mean:
        return None, panorama
    middle = weight @ towards[near]
    middle /= np.linalg.norm(middle)
    away = np.sum((towards[near] - middle) ** 2, axis=-1)
    radius = np.sqrt(2 * (weight @ away / weight.sum() + texel**2 / 6))  # of the even disc of that spread
    rest = panorama.copy()
    rest[row[near], column[near]] = np.minimum(above[row[near], column[near]], most)
    return Light("sun", ZERO, vec3(-middle), vec3(power.sum(0)), float(radius), 0.0), rest
