"""Make the noise of every pixel, camera and ISO the same: unit variance.

    y = 2 x / (sqrt(k max(x, 0) + v) + sqrt(v)),      v = sigma2 + 3/8 k^2
    x = sqrt(v) y + k/4 max(y, 0)^2

This is the generalised Anscombe transform 2 sqrt(x/k + 3/8 + sigma2/k^2) (Anscombe 1948; Starck, Murtagh and
Bijaoui 1998) minus its own value at black, rewritten so that nothing divides by k: k = 0 is simply x/sigma.
Below black it continues along its tangent, so that negative x, which a dark frame is full of, map one to one
and no clipping biases the shadows. The network then meets one noise, N(0, 1), instead of a family with
parameters k, sigma2, as with the k-Sigma transform of PMRID (Wang et al. 2020) but with the signal dependence
gone as well.

The inverse here is algebraic. The "exact unbiased" inverse corrects E[y(noisy)] != y(clean), a bias
that a network trained on clean targets has already learnt.
"""

from __future__ import annotations

import torch
from torch import Tensor

_READ_FLOOR = 1e-12  # keeps k = sigma2 = 0, a noise-free image, finite: far below any converter's rounding


def _black_variance(k: Tensor, sigma2: Tensor) -> Tensor:
    return (sigma2 + 0.375 * k * k).clamp(min=_READ_FLOOR)  # the ONNX exporter drops so small a summand


def stabilise(x: Tensor, k: Tensor, sigma2: Tensor) -> Tensor:
    """Normalised RAW x (B, 4, H, W) with noise k, sigma2 (B, 4, 1, 1) to y, of unit noise variance."""
    v = _black_variance(k, sigma2)
    return 2 * x / (torch.sqrt(k * x.clamp(min=0) + v) + torch.sqrt(v))


def unstabilise(y: Tensor, k: Tensor, sigma2: Tensor) -> Tensor:
    """Exact inverse of `stabilise`."""
    return torch.sqrt(_black_variance(k, sigma2)) * y + 0.25 * k * y.clamp(min=0) ** 2
