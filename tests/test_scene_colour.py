"""Colour laws: CIELAB against an independent implementation, Planck's locus, palette models."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skimage.color import lab2rgb

from fsid.scene.colour import (
    PALETTES,
    Mood,
    albedo_rgb,
    blackbody_rgb,
    calmed,
    lab_rand,
    lab_to_rgb,
    related_rand,
)


def test_lab_agrees_with_skimage():
    lab = np.array([(l, a, b) for l in (20, 50, 80) for a in (-20, 0, 20) for b in (-20, 0, 20)], float)  # noqa: E741
    linear = lab_to_rgb(lab)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.abs(linear) ** (1 / 2.4) - 0.055)
    inside = np.all((linear > 0) & (linear < 1), axis=1)
    assert inside.sum() > 15
    np.testing.assert_allclose(encoded[inside], lab2rgb(lab[inside]), atol=2e-3)


def test_white_and_mid_grey():
    np.testing.assert_allclose(lab_to_rgb(np.array([100.0, 0, 0])), 1, atol=1e-3)
    np.testing.assert_allclose(lab_to_rgb(np.array([50.0, 0, 0])), 0.1842, atol=1e-3)


def test_black_bodies_run_from_red_to_blue_through_white():
    ratio = [blackbody_rgb(t)[0] / blackbody_rgb(t)[2] for t in (2000, 3000, 4500, 6500, 9000)]
    assert ratio == sorted(ratio, reverse=True)
    np.testing.assert_allclose(blackbody_rgb(6500), 1, atol=0.06)
    assert np.all(blackbody_rgb(1800) >= 0)


@given(st.floats(1000, 40000))
def test_a_black_body_has_luminance_one(temperature):
    assert blackbody_rgb(temperature) @ (0.2126, 0.7152, 0.0722) == pytest.approx(1)


@given(st.integers(0, 2**32), st.sampled_from(PALETTES), st.floats(0, 360))
def test_palettes_give_albedos_within_the_limits(seed, palette, hue):
    rng = np.random.default_rng(seed)
    lab = lab_rand(rng, palette, Mood(hue, (60.0, 110.0), 1.0, 1.0))
    rgb = albedo_rgb(np.stack([lab, related_rand(rng, lab)]), 0.02, 0.9)
    assert rgb.shape == (2, 3)
    assert np.all(rgb >= 0.02)
    assert np.all(rgb <= 0.9)


def test_palettes_differ_in_how_colourful_they_are():
    rng = np.random.default_rng(0)
    mood = Mood(40.0, (60.0, 110.0), 1.0, 1.0)
    draws = {p: np.array([lab_rand(rng, p, mood) for _ in range(400)]) for p in PALETTES}
    chroma = {p: np.hypot(*lab[:, 1:].T).mean() for p, lab in draws.items()}
    assert chroma["grey"] < 5 < chroma["natural"] < 20 < chroma["lab"]


def test_the_harmonised_palette_keeps_to_its_hue():
    rng = np.random.default_rng(0)
    lab = np.array([lab_rand(rng, "harmonised", Mood(200.0, (60.0, 110.0), 1.0, 1.0)) for _ in range(400)])
    away = (np.degrees(np.arctan2(lab[:, 2], lab[:, 1])) - 200 + 180) % 360 - 180
    assert np.abs(away).mean() < 20


def test_calmed_colours_keep_their_light_and_lose_their_hues():
    colours = np.array([(0.5, 0.3, 0.3), (0.2, 0.3, 0.25), (0.4, 0.45, 0.6)])
    light = np.array([0.2126, 0.7152, 0.0722])
    for variation in (0.0, 0.3, 1.0):
        calm = calmed(colours, variation)
        np.testing.assert_allclose(calm @ light, colours @ light, rtol=1e-9)
        chromaticity = [c / c.sum(axis=1, keepdims=True) for c in (calm, colours)]
        assert (
            np.ptp(chromaticity[0], axis=0).max() <= variation * np.ptp(chromaticity[1], axis=0).max() + 1e-9
        )
    np.testing.assert_allclose(calmed(colours, 1.0), colours)
    dark = calmed(np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 1.0)]), 0.0)
    assert dark.min() >= 0
    assert dark.max() <= 1


def test_related_colours_are_lighter_than_dark_ones_and_darker_than_light_ones():
    """Lighter with probability 1 - (L - 8) / 86."""
    rng = np.random.default_rng(0)
    for level in (20.0, 80.0):
        lighter = np.mean([related_rand(rng, np.array([level, 5, 5]))[0] > level for _ in range(600)])
        assert lighter == pytest.approx(1 - (level - 8) / 86, abs=0.06)
