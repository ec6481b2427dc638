"""The small picture inside a DNG: what file managers and galleries show.

    site -> mean over f x f of its pixels -> mosaic f times smaller -> develop

Averaging each colour by itself keeps the small mosaic a RAW, so that it develops like the large one, at the
cost of the small one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fsid.dataset import to_uint8
from fsid.sensor import Raw, develop, pack, unpack

PREVIEW_PX = 1024  # longest side


def preview_of(raw: Raw) -> np.ndarray | None:
    """(h, w, 3) uint8 sRGB, at most `PREVIEW_PX` long; None for images too small to be developed."""
    factor = -(-max(raw.mosaic.shape) // PREVIEW_PX)
    packed = pack(raw.mosaic, raw.cfa)
    height, width = (length // factor for length in packed.shape[1:])
    if min(height, width) < 2:
        return None
    cells = packed[:, : height * factor, : width * factor].reshape(4, height, factor, width, factor)
    return to_uint8(develop(replace(raw, mosaic=unpack(cells.mean((2, 4)), raw.cfa))))
