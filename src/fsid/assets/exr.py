"""How large an OpenEXR picture is by its header, before a pixel of it is decoded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def stated_size(header: Mapping[str, Any]) -> tuple[int, int]:
    """(width, height) of a part with this header. KeyError where it states none."""
    (left, top), (right, bottom) = (corner.tolist() for corner in header["dataWindow"])
    return right - left + 1, bottom - top + 1
