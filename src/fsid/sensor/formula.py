"""The sensor's formulas on arrays of NumPy or torch alike; everything that makes noise goes through here.

    variance = k max(x, 0) + sigma2,      noisy = x + sqrt(variance) n
    stored = clip(round(x span), -black, span) / span

Arguments broadcast: k and sigma2 may be (4, 1, 1) for packed images, (B, 4, 1, 1) for batches, or a map.
"""

from __future__ import annotations

from typing import Any

from fsid.sensor.arrays import namespace


def noise_variance(x: Any, k: Any, sigma2: Any) -> Any:
    """Variance of the clean signal `x`; a new array."""
    v = x.clip(min=0)
    v *= k
    v += sigma2
    return v


def with_noise(x: Any, normal: Any, k: Any, sigma2: Any) -> Any:
    """`x` plus noise from standard `normal` numbers of its shape; a new array."""
    v = noise_variance(x, k, sigma2)
    namespace(v).sqrt(v, out=v)
    v *= normal
    v += x
    return v


def stored(x: Any, black: Any, span: Any) -> Any:
    """`x` as read back from a file of integers; black and span = white - black in DN; a new array."""
    v = x * span
    xp = namespace(v)
    xp.round(v, out=v)
    xp.clip(v, -black, span, out=v)
    v /= span
    return v
