"""FSID: RAW denoisers trained on nothing but rendered scenes.

    raw = fsid.read_raw("photo.dng")
    clean = fsid.denoise(raw, "pixel6")       # fsid.denoise(raw): the noise level of the file, or the image's
    fsid.write_dng("clean.dng", clean)

`denoise` is a package that can be called: `help(fsid.denoise)` says how, the functions below are the others.

Data flows one way, and each step is a package: assets -> scene -> render -> sensor -> dataset ->
denoise -> evaluate -> cli. See docs/architecture.md. Importing `fsid` loads none of them: these names do, and
so does `fsid.sensor`.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from fsid.denoise import CallablePackage, load_model
    from fsid.sensor import develop, read_raw, write_dng

    denoise: CallablePackage

__version__ = "0.1.0"
__all__ = ["denoise", "develop", "load_model", "read_raw", "write_dng"]

_HOMES = {
    "load_model": "fsid.denoise",
    "develop": "fsid.sensor",
    "read_raw": "fsid.sensor",
    "write_dng": "fsid.sensor",
}

_PACKAGES = ("assets", "dataset", "denoise", "evaluate", "render", "scene", "sensor")


def __getattr__(name: str) -> Any:
    if name in _PACKAGES:  # denoise is one that can be called
        return import_module(f"fsid.{name}")
    if name in _HOMES:
        return getattr(import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'fsid' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*__all__, *_PACKAGES, "__version__"})
