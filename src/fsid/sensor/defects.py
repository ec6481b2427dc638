"""Which pixels of a dark image show a value of their own: hot, dead or stuck ones.

    |x - median of the 5x5 around| > FAR sigma,      per site; sigma: of steps to the next neighbour

Dark shading is smooth and belongs to the median.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from fsid.sensor.mosaic import TILE

FAR = 10.0  # robust standard deviations: a defective pixel
GAUSS_MAD = 0.6745  # median absolute deviation of a standard normal number
_AROUND = 5  # pixels of the same site, the side of a neighbourhood
_LEAST_DN = 0.1  # sigma; means of a few integers may all be alike


def defective(mean: np.ndarray) -> np.ndarray:
    """(H, W) bool: pixels of dark frames, `mean` (H, W) in DN over time, that are far from those around."""
    found = np.zeros(mean.shape, bool)
    for site in TILE:
        plane = mean[site]
        steps = np.abs(np.diff(plane, axis=1))
        if not steps.size:
            continue
        limit = FAR * max(float(np.median(steps)) / GAUSS_MAD, _LEAST_DN)
        jumps = np.pad(steps > limit / 2, ((0, 0), (1, 1)))  # only pixels beside a step can be far: a few
        rows, columns = np.nonzero(jumps[:, 1:] | jumps[:, :-1])
        around = sliding_window_view(np.pad(plane, _AROUND // 2, "symmetric"), (_AROUND, _AROUND))
        middle = np.median(around[rows, columns].reshape(rows.size, _AROUND**2), axis=1)
        found[site][rows, columns] = np.abs(plane[rows, columns] - middle) > limit
    return found
