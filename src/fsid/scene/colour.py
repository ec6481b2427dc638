"""Colours of lights and surfaces, linear sRGB (D65).

    light    Planck's law through the CIE 1931 observer, luminance 1
    surface  a point of CIELAB from one of four palette models, clipped into gamut and albedo limits

CIELAB because its distances follow the eye: uniform there is uniform in what an image can show, while
uniform in RGB is mostly garish. Real photographs are far less colourful than that, hence the other models.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

PALETTES = ("natural", "harmonised", "lab", "grey")
"""natural: muted, mostly earth, leaf and sky hues. harmonised: one hue per scene. lab: anything in gamut."""

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Y of linear sRGB."""

_XYZ_TO_RGB = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
_WHITE = np.array([0.9505, 1.0, 1.089])
_DESATURATED = np.array([(1.0, keep, keep) for keep in (1.0, 0.8, 0.6, 0.4, 0.2, 0.0)])
_NATURAL_HUES_DEG = (62.0, 80.0, 108.0, 138.0, 262.0, 225.0, 35.0, 15.0, 320.0)
_NATURAL_SHARES = (0.08, 0.15, 0.2, 0.25, 0.22, 0.05, 0.03, 0.01, 0.01)


class Mood(NamedTuple):
    """What the colours of one scene share, as those of one photograph do.

    hue_deg: CIELAB hue that the harmonised palette keeps to. hues_deg: two to four of the natural hues.
    chroma: factor on all chromas but lab's. variation: of chromaticity within one material, 0 none .. 1 all.
    """

    hue_deg: float
    hues_deg: tuple[float, ...]
    chroma: float
    variation: float


def mood_rand(rng: np.random.Generator, calm_share: float, variation: tuple[float, float]) -> Mood:
    """Hues, how colourful the scene is (mostly muted), and how far its textures vary in colour."""
    hue_deg, count = float(rng.uniform(0, 360)), int(rng.integers(2, 5))
    hues_deg = rng.choice(_NATURAL_HUES_DEG, 5, replace=False, p=_NATURAL_SHARES) + rng.normal(0, 10, 5)
    chroma = float(np.exp(rng.normal(0.0, 0.6)))
    varied, left = rng.random() < 1 - calm_share, float(rng.uniform(*variation))
    return Mood(hue_deg, tuple(hues_deg[:count].tolist()), chroma, 1.0 if varied else left)


def lab_to_rgb(lab: np.ndarray) -> np.ndarray:
    """CIELAB (..., 3) under D65 to linear sRGB, unclipped (CIE 15:2004; IEC 61966-2-1 primaries)."""
    level, a, b = lab[..., 0], lab[..., 1], lab[..., 2]
    fy = (level + 16) / 116
    f = np.stack([fy + a / 500, fy, fy - b / 200], axis=-1)
    linear = np.where(f > 6 / 29, f**3, 3 * (6 / 29) ** 2 * (f - 4 / 29))
    return (linear * _WHITE) @ _XYZ_TO_RGB.T


def blackbody_rgb(temperature_k: float) -> np.ndarray:
    """(3,) linear sRGB of a black body, luminance 1, never negative.

    Planck's law summed over 380..780 nm with the multi-lobe fit of the CIE 1931 observer of Wyman, Sloan and
    Shirley, "Simple Analytic Approximations to the CIE XYZ Color Matching Functions", JCGT 2(2), 2013.
    """
    nm = np.arange(380.0, 781.0, 5.0)
    radiance = nm**-5 / np.expm1(1.4388e7 / (nm * temperature_k))

    def lobe(mean: float, below: float, above: float) -> np.ndarray:
        return np.exp(-0.5 * ((nm - mean) * np.where(nm < mean, below, above)) ** 2)

    x = (
        1.056 * lobe(599.8, 0.0264, 0.0323)
        + 0.362 * lobe(442.0, 0.0624, 0.0374)
        - 0.065 * lobe(501.1, 0.0490, 0.0382)
    )
    y = 0.821 * lobe(568.8, 0.0213, 0.0247) + 0.286 * lobe(530.9, 0.0613, 0.0322)
    z = 1.217 * lobe(437.0, 0.0845, 0.0278) + 0.681 * lobe(459.0, 0.0385, 0.0725)
    xyz = np.array([(radiance * curve).sum() for curve in (x, y, z)])
    rgb = np.clip(_XYZ_TO_RGB @ (xyz / xyz[1]), 0.0, None)
    return rgb / (rgb @ LUMINANCE)


def lab_rand(rng: np.random.Generator, palette: str, mood: Mood) -> np.ndarray:
    """(3,) one CIELAB colour of a palette model of `PALETTES`."""
    if palette == "lab":
        while True:
            lab = np.array([rng.uniform(10, 95), *rng.uniform(-75, 75, 2)])
            if np.all((rgb := lab_to_rgb(lab)) > 0) and np.all(rgb < 1):
                return lab
    level = rng.uniform(8, 96, 2).mean()
    if palette == "grey":
        hue, chroma = rng.uniform(0, 360), rng.uniform(0, 5)
    elif palette == "harmonised":
        hue, chroma = mood.hue_deg + rng.normal(0, 14), rng.gamma(2.2, 7.0)
    else:
        hue = mood.hues_deg[int(rng.integers(len(mood.hues_deg)))] + rng.normal(0, 12)
        chroma = rng.gamma(2.0, 6.5)
    return np.array([level, *_polar(chroma * mood.chroma, hue)])


def related_rand(rng: np.random.Generator, lab: np.ndarray) -> np.ndarray:
    """(3,) CIELAB colour of the same stuff as `lab`: lighter or darker, nearly the same hue."""
    step = rng.uniform(7, 32) * (1 if rng.random() > (lab[0] - 8) / 86 else -1)
    return np.array([np.clip(lab[0] + step, 6, 96), *(lab[1:] * rng.uniform(0.6, 1.3) + rng.normal(0, 2, 2))])


def albedo_rgb(lab: np.ndarray, low: float, high: float) -> np.ndarray:
    """(N, 3) linear albedos of `lab` (N, 3), desaturated until inside the gamut, clipped to [low, high]."""
    rgb = lab_to_rgb(lab[:, None] * _DESATURATED)
    inside = np.asarray(((rgb >= 0) & (rgb <= 1)).all(axis=2))
    inside[:, -1] = True
    return np.clip(rgb[np.arange(len(rgb)), inside.argmax(1)], low, high)


def calmed(colours: np.ndarray, variation: float) -> np.ndarray:
    """(N, 3) linear albedos that keep a share `variation` of their distance from their common chromaticity.

    colours: (N, 3) linear sRGB. Their luminance stays, and no channel leaves the range of `colours`.
    """
    light = colours @ LUMINANCE
    common = light[:, None] * (colours.mean(axis=0) / max(float(light.mean()), 1e-6))
    return np.clip(common + variation * (colours - common), colours.min(), colours.max())


def _polar(chroma: float, hue_deg: float) -> tuple[float, float]:
    return chroma * np.cos(np.radians(hue_deg)), chroma * np.sin(np.radians(hue_deg))
