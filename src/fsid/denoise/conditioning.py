"""How the network is told the noise: three ways from (RAW, k, sigma2) to its input, and back.

    stabilise:  y = VST(x),  image = 2 y / y(1) - 1/2,  planes = 40 / y(1) - 1,      clean = VST^-1(y + r)
    k-sigma:    f = x / k + sigma2 / k^2,  image = f at the anchor,  no planes,      clean = f^-1(f + r)
    noise-map:  image = 2 x - 1/2,  planes = sqrt(k x + sigma2) scaled,              clean = x + r std(x)

`stabilise` gives the noise of every pixel, camera and ISO the variance 1 and says with four constant planes
how large the image is relative to it. `k-sigma` (Wang et al., "Practical Deep Raw Image Denoising on Mobile
Devices", ECCV 2020, section 3.2) makes the noise a function of the transformed signal alone, Var(f) = E(f),
so that one network serves all ISOs without being told; like the authors we undo the transform with the k and
sigma2 of one reference ISO, the anchor, so that the input stays of order 1. `noise-map` leaves x as it is and
gives the standard deviation of every pixel (Brooks et al. 2019). In all three the residual r is in units of
the noise, so that none has to learn its size; bench/conditioning.py compares them.
"""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor

from fsid.denoise.stabilise import stabilise, unstabilise

Conditioning = Literal["stabilise", "k-sigma", "noise-map"]
TYPICAL_TOP = 40.0  # of y at ISO 3200: brings the noise planes to order 1
ANCHOR_K, ANCHOR_SIGMA2 = 2e-3, 1e-5  # of a phone at ISO 1600
_GREY = 0.1  # where the noise at the anchor is taken for typical
_TINY = 1e-12


def network_input(noisy: Tensor, k: Tensor, sigma2: Tensor, kind: Conditioning) -> tuple[Tensor, Tensor]:
    """noisy (B, 4, H, W), k, sigma2 (B, 4, 1, 1) -> image and noise planes, (B, 4, H, W) each."""
    if kind == "stabilise":
        top = stabilise(torch.ones_like(k), k, sigma2)
        image = 2 * stabilise(noisy, k, sigma2) / top - 0.5
        return image, (TYPICAL_TOP / top - 1).expand_as(noisy)
    if kind == "k-sigma":
        image = 2 * _to_anchor(noisy, k, sigma2) - 0.5
        return image, torch.zeros_like(noisy)
    return 2 * noisy - 0.5, TYPICAL_TOP / 2 * _deviation(noisy, k, sigma2) - 1


def clean_estimate(noisy: Tensor, residual: Tensor, k: Tensor, sigma2: Tensor, kind: Conditioning) -> Tensor:
    """The clean RAW from the network's residual, clean minus noisy in units of the noise."""
    if kind == "stabilise":
        return unstabilise(stabilise(noisy, k, sigma2) + residual, k, sigma2)
    if kind == "k-sigma":
        typical = (ANCHOR_K * _GREY + ANCHOR_SIGMA2) ** 0.5
        return noisy + typical * residual * k.clamp(min=_TINY) / ANCHOR_K
    return noisy + residual * _deviation(noisy, k, sigma2)


def _to_anchor(x: Tensor, k: Tensor, sigma2: Tensor) -> Tensor:
    """x of a camera as the anchor would have it: f(x) is the same for both."""
    k = k.clamp(min=_TINY)
    return ANCHOR_K * (x / k + sigma2 / k**2) - ANCHOR_SIGMA2 / ANCHOR_K


def _deviation(x: Tensor, k: Tensor, sigma2: Tensor) -> Tensor:
    return torch.sqrt(k * x.clamp(min=0) + sigma2)
