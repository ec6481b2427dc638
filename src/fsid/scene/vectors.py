"""Small vectors between NumPy and the plain tuples of the model."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fsid.scene.model import Vec3


def vec3(values: Iterable[float]) -> Vec3:
    """Three numbers as a tuple of floats."""
    x, y, z = (float(v) for v in values)
    return (x, y, z)


def direction_of(azimuth_deg: float, elevation_deg: float) -> np.ndarray:
    """(3,) unit vector; azimuth from +x towards +y, elevation above the horizon."""
    a, e = np.radians((azimuth_deg, elevation_deg))
    return np.array([np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)])
