"""How large an OpenEXR file is by its headers, before a pixel of it is decoded."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any


def stated_size(header: Mapping[str, Any]) -> tuple[int, int]:
    """(width, height) of a part with this header. KeyError where it states none."""
    (left, top), (right, bottom) = (corner.tolist() for corner in header["dataWindow"])
    return right - left + 1, bottom - top + 1


def stated_values(file: Any) -> int:
    """How many numbers an opened `OpenEXR.File` holds: those of all channels of all parts, which it decodes
    together. KeyError where a part states no size."""
    return sum(math.prod(stated_size(part.header)) * len(part.header["channels"]) for part in file.parts)
