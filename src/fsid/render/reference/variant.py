"""Which Mitsuba to use: compiled by LLVM where that works, else the scalar one (several times slower).

Mitsuba ends the process when its LLVM is missing an instruction (versions before 17 do), so a second process
tries first: `llvm_ad_rgb` is taken only after it has rendered there.
"""

from __future__ import annotations

import subprocess
import sys
from functools import cache
from typing import Any

_PROBE = """
import mitsuba as mi
mi.set_variant("llvm_ad_rgb")
scene = mi.cornell_box()
scene["sensor"]["film"] |= {"width": 4, "height": 4}
scene["white"] = {"type": "principled", "roughness": 0.5, "clearcoat": 0.5, "sheen": 0.5}
assert float(mi.render(mi.load_dict(scene), spp=1).array[0]) >= 0
"""
_SECONDS = 120


@cache
def variant() -> str:
    """Name of the best Mitsuba variant of this machine."""
    try:
        probe = subprocess.run([sys.executable, "-c", _PROBE], capture_output=True, timeout=_SECONDS)
    except (OSError, subprocess.TimeoutExpired):
        return "scalar_rgb"
    return "scalar_rgb" if probe.returncode else "llvm_ad_rgb"


def load_mitsuba() -> Any:
    """The module `mitsuba`, set to `variant()`. ModuleNotFoundError where it is not installed."""
    import mitsuba

    if mitsuba.variant() != variant():
        mitsuba.set_variant(variant())
    return mitsuba
