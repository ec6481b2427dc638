"""What the network is told: in each of its domains the noise has the law that it should have."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from hypothesis import given  # noqa: E402
from hypothesis import strategies as st  # noqa: E402

from fsid.denoise.conditioning import (  # noqa: E402
    ANCHOR_K,
    ANCHOR_SIGMA2,
    clean_estimate,
    network_input,
)
from fsid.denoise.stabilise import stabilise, unstabilise  # noqa: E402
from fsid.sensor import load_profile  # noqa: E402

gains = st.floats(0, 0.05)


def full(value: float) -> torch.Tensor:
    return torch.full((1, 4, 1, 1), value, dtype=torch.double)


@given(k=gains, sigma2=st.floats(0, 1e-2), x=st.lists(st.floats(-0.3, 1.5), min_size=1, max_size=8))
def test_round_trip_and_order(k: float, sigma2: float, x: list[float]) -> None:
    image = torch.tensor(sorted(x), dtype=torch.double).expand(1, 4, 1, len(x))
    y = stabilise(image, full(k), full(sigma2))
    torch.testing.assert_close(unstabilise(y, full(k), full(sigma2)), image, atol=1e-9, rtol=1e-9)
    assert (y.diff(dim=-1) >= 0).all()


@given(sigma2=st.floats(1e-6, 1e-2), x=st.floats(-0.3, 1.5))
def test_without_shot_noise_it_is_a_division_by_sigma(sigma2: float, x: float) -> None:
    y = stabilise(full(x), full(0.0), full(sigma2))
    assert y[0, 0, 0, 0].item() == pytest.approx(x / sigma2**0.5, rel=1e-5)


@pytest.mark.parametrize("camera", ["pixel6", "galaxy-s22"])
@pytest.mark.parametrize("iso", [400, 1600, 6400])
def test_unit_variance_at_every_brightness(camera: str, iso: float, rng: np.random.Generator) -> None:
    level = load_profile(camera).level(iso)
    k, sigma2 = (torch.tensor(v, dtype=torch.double)[None, :, None, None] for v in (level.k, level.sigma2))
    for x in (0.02, 0.1, 0.4, 0.9):
        noise = torch.from_numpy(rng.standard_normal((1, 4, 100, 100)))
        y = stabilise(x + torch.sqrt(k * x + sigma2) * noise, k, sigma2)
        torch.testing.assert_close(y.var((0, 2, 3)), torch.ones(4, dtype=torch.double), atol=0.08, rtol=0)


@pytest.mark.parametrize("kind", ["stabilise", "k-sigma", "noise-map"])
def test_no_residual_is_the_identity_and_gradients_reach_it(kind: str) -> None:
    noisy = torch.rand(2, 4, 6, 6, dtype=torch.double) - 0.1
    k, sigma2 = (torch.full((2, 4, 1, 1), value, dtype=torch.double) for value in (2e-3, 1e-5))
    residual = torch.zeros_like(noisy, requires_grad=True)
    clean = clean_estimate(noisy, residual, k, sigma2, kind)
    torch.testing.assert_close(clean.detach(), noisy, atol=1e-9, rtol=1e-9)
    clean.sum().backward()
    assert (residual.grad > 0).all()


@pytest.mark.parametrize("kind", ["stabilise", "k-sigma", "noise-map"])
def test_a_residual_is_in_units_of_the_noise(kind: str) -> None:
    """Of the pixel, and with k-sigma of a grey at the anchor, in the middle of what is usual."""
    x, k, sigma2 = full(0.1), full(ANCHOR_K), full(ANCHOR_SIGMA2)
    left = clean_estimate(x, full(-1.0), k, sigma2, kind) - x
    assert -left.mean().item() == pytest.approx((ANCHOR_K * 0.1 + ANCHOR_SIGMA2) ** 0.5, rel=0.05)


def test_after_k_sigma_the_noise_depends_on_the_signal_alone(rng: np.random.Generator) -> None:
    """Two ISOs, signals that transform to one value: noise of one variance, that of the anchor there."""
    for value in (0.1, 0.4, 1.5):
        for k, sigma2 in ((5e-4, 1e-6), (8e-3, 4e-4)):
            clean = k * (value / ANCHOR_K + ANCHOR_SIGMA2 / ANCHOR_K**2 - sigma2 / k**2)
            noise = np.sqrt(k * clean + sigma2) * rng.standard_normal((1, 4, 200, 200))
            x = clean + torch.from_numpy(noise)
            image, planes = network_input(x, full(k), full(sigma2), "k-sigma")
            anchored = (image + 0.5) / 2
            assert anchored.mean().item() == pytest.approx(value, rel=0.01)
            assert anchored.var().item() == pytest.approx(ANCHOR_K * value + ANCHOR_SIGMA2, rel=0.03)
            assert (planes == 0).all()


@pytest.mark.parametrize("kind", ["stabilise", "k-sigma", "noise-map"])
def test_the_network_is_told_what_the_formulas_say(kind: str) -> None:
    """In NumPy, of a camera that is not the anchor: image, planes, and what a residual of 1 makes of it."""
    x, k, sigma2 = np.linspace(0, 1.2, 7), 4e-3, 3e-5
    noisy = torch.from_numpy(x).expand(1, 4, 1, 7)

    def vst(x: np.ndarray | float) -> np.ndarray:
        black = 3 / 8 + sigma2 / k**2
        return 2 * np.sqrt(x / k + black) - 2 * np.sqrt(black)

    image, planes = network_input(noisy, full(k), full(sigma2), kind)
    clean = clean_estimate(noisy, torch.ones_like(noisy), full(k), full(sigma2), kind)[0, 0, 0].numpy()
    deviation = np.sqrt(k * x + sigma2)
    at_anchor = ANCHOR_K * (x / k + sigma2 / k**2) - ANCHOR_SIGMA2 / ANCHOR_K
    typical = np.sqrt(ANCHOR_K * 0.1 + ANCHOR_SIGMA2) * k / ANCHOR_K
    expected = {
        "stabilise": (2 * vst(x) / vst(1) - 0.5, 40 / vst(1) - 1, vst(clean) - vst(x), 1),
        "k-sigma": (2 * at_anchor - 0.5, 0, clean - x, typical),
        "noise-map": (2 * x - 0.5, 20 * deviation - 1, clean - x, deviation),
    }[kind]
    np.testing.assert_allclose(image[0, 1, 0], expected[0], rtol=1e-9)
    np.testing.assert_allclose(planes[0, 1, 0], np.broadcast_to(expected[1], 7), rtol=1e-9)
    np.testing.assert_allclose(expected[2], np.broadcast_to(expected[3], 7), rtol=1e-9)
