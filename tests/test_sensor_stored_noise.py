"""The noise before the converter is found again from what rounding and clipping left of it."""

import numpy as np
import pytest

from fsid.sensor.stored_noise import PLACES, before_clipping, before_rounding, dark_noise

FRAMES, PIXELS = 50, 4096


def stored(rng: np.random.Generator, levels: np.ndarray, tau: float) -> tuple[np.ndarray, np.ndarray]:
    """Mean and variance over time of pixels of these levels, DN 0..1023."""
    dn = np.clip(np.rint(levels + tau * rng.standard_normal((FRAMES, levels.size))), 0, 1023)
    return dn.mean(axis=0), dn.var(axis=0, ddof=1)


@pytest.mark.parametrize(
    ("level", "tau", "fixed"),
    [
        (64, 0.16, 0),  # one DN in 600 is not 64
        (64, 0.3, 0),
        (64.3, 0.5, 0),
        (64, 0.2, 0.2),
        (64, 0.3, 0.7),
        (64, 1.5, 1),
        (64, 43, 0),  # 7 % are cut off
        (64, 85, 20),
        (0, 3, 0),  # half of the noise is cut off
    ],
)
def test_dark_noise_is_found_within_its_error(level, tau, fixed):
    z = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        found = dark_noise(*stored(rng, level + fixed * rng.standard_normal(PIXELS), tau), FRAMES, 1023)
        z.append((found.variance - tau**2 - 1 / 12) / found.variance_error)
        assert found.variance_error < 0.05 * found.variance
        assert found.level == pytest.approx(level, abs=0.05 + 0.02 * (tau + fixed))
    assert abs(np.mean(z)) < 4 / np.sqrt(6)
    assert np.max(np.abs(z)) < 4.5


@pytest.mark.parametrize(("level", "tau"), [(64, 0.05), (64.2, 0.1), (64.4, 0.1), (64.5, 0.05)])
def test_noise_that_integers_do_not_show_is_said_to_be_uncertain(level, tau, rng):
    found = dark_noise(*stored(rng, np.full(PIXELS, level), tau), FRAMES, 1023)
    assert abs(found.variance - tau**2 - 1 / 12) < 3.5 * found.variance_error
    assert found.variance_error > 0.002


@pytest.mark.parametrize(
    ("level", "tau"), [(64.2, 0.1), (64.3, 0.14), (64.6, 0.14), (63.7, 0.1), (64.35, 0.2)]
)
def test_the_level_of_noise_that_reaches_one_integer_alone_is_not_the_mean(level, tau, rng):
    mean, variance = stored(rng, np.full(PIXELS, level), tau)
    assert abs(mean.mean() - level) > 0.1
    assert dark_noise(mean, variance, FRAMES, 1023).level == pytest.approx(level, abs=0.06)


@pytest.mark.parametrize("tau2", [0.1, 0.25, 0.5, 2.0])
@pytest.mark.parametrize("places", [(0, 3), (0, 0.1), (0.2, 0.3)])
def test_rounding_is_undone_wherever_the_pixels_lie(tau2, places, rng):
    mean, variance = stored(rng, 100 + rng.uniform(*places, PIXELS), np.sqrt(tau2))
    shares = np.histogram(mean % 1, PLACES, (0, 1))[0] / PIXELS
    found, slope = before_rounding(np.array([variance.mean()]), shares[None])
    error = np.sqrt(2 / PIXELS / FRAMES) * variance.mean() * slope[0]
    assert found[0] == pytest.approx(tau2, abs=4.5 * error + 0.03 * tau2 * (tau2 < 0.2))


@pytest.mark.parametrize(
    ("mu", "tau"), [(64.0, 20.0), (64.0, 85.0), (200.0, 60.0), (980.0, 40.0), (500.0, 5.0)]
)
def test_clipping_is_undone(mu, tau, rng):
    dn = np.clip(np.rint(mu + tau * rng.standard_normal(400_000)), 0, 1023)
    level, tau2, clipped = before_clipping(np.array([dn.mean()]), np.array([dn.var()]), 0, 1023)
    assert level[0] == pytest.approx(mu, abs=0.01 * tau)
    assert tau2[0] == pytest.approx(tau**2 + 1 / 12, rel=0.015)
    share = np.mean((dn <= 0) | (dn >= 1023))
    assert clipped[0] == pytest.approx(share, abs=0.005)
