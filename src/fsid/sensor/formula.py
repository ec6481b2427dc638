"""The sensor's formulas on arrays of NumPy or torch alike; everything that makes noise goes through here.

    variance = k max(x, 0) + sigma2,      noisy = x + sqrt(variance) n
    stored = clip(round(x span), -black, span) / span

Sources: Foi et al. 2008, eq. 5, and the NoiseProfile of the DNG specification. Arguments broadcast: k and
sigma2 may be (4, 1, 1) for packed images, (B, 4, 1, 1) for batches, or a map.
"""

from __future__ import annotations

from typing import Any

from fsid.sensor.arrays import lit, namespace


def noise_variance(x: Any, k: Any, sigma2: Any, out: Any = None) -> Any:
    """Variance of the clean signal `x`; `out` of its shape, or a new array."""
    v = namespace(x).multiply(lit(x), k, out=out)
    v += sigma2
    return v


def with_noise(x: Any, normal: Any, k: Any, sigma2: Any, out: Any = None) -> Any:
    """`x` plus noise from standard `normal` numbers of its shape; `out` of its shape, or a new array."""
    v = noise_variance(x, k, sigma2, out)
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
