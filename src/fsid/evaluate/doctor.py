"""What this machine has, and whether it can render: the answers to "why does it not run here?"."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fsid import __version__
from fsid.errors import FsidError
from fsid.render import Renderer, egl_devices
from fsid.scene import SceneConfig, sample

LIBRARIES = (
    "numpy",
    "moderngl",
    "trimesh",
    "rawpy",
    "tifffile",
    "scikit-image",
    "torch",
    "accelerate",
    "onnxruntime",
    "ray",
    "mitsuba",
    "OpenEXR",
)


def examine() -> Iterator[tuple[str, str]]:
    """(name, finding) lines, the test render last. FsidError where rendering is impossible."""
    yield "FSID", __version__
    yield "Python", f"{platform.python_version()} on {platform.platform()}"
    yield "CPU", f"{os.cpu_count()} cores"
    for name in LIBRARIES:
        yield name, _version(name)
    yield "LibRaw", _libraw()
    yield "PyTorch device", _torch_device()
    yield from _render_one()


def _why_no_gpu() -> str:
    """What to do where a GPU is there, but its OpenGL is not."""
    if not any(Path("/dev").glob("nvidia[0-9]*")):
        return "No GPU was found."
    wanted = os.environ.get("NVIDIA_DRIVER_CAPABILITIES", "")
    if "graphics" not in wanted and "all" not in wanted:
        return "There is an NVIDIA GPU: set NVIDIA_DRIVER_CAPABILITIES=graphics (or all) for the container."
    return "There is an NVIDIA GPU: install the driver's libnvidia-gl (libEGL_nvidia.so.0) beside it."


def _version(package: str) -> str:
    try:
        return importlib.metadata.version(package)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def _libraw() -> str:
    import rawpy

    return ".".join(map(str, rawpy.libraw_version))


def _torch_device() -> str:
    if importlib.util.find_spec("torch") is None:
        return "none: training and denoising need pip install 'fsid[train]'"
    import torch

    if torch.cuda.is_available():
        return ", ".join(torch.cuda.get_device_name(i) for i in range(torch.cuda.device_count()))
    return f"CPU, {torch.get_num_threads()} threads"


def _render_one() -> Iterator[tuple[str, str]]:
    devices = egl_devices()
    for index, info in devices.items():
        where = "CPU" if info.is_software else "GPU"
        yield f"EGL device {index}", f"{where}: {info.renderer} ({info.vendor}), OpenGL {info.version}"
    with Renderer(texture_size=256) as renderer:
        info = renderer.info
        yield "Renders on", f"{info.renderer} ({info.vendor})"
        if info.is_software:
            yield "", f"software rendering on the CPU: correct, slower than a GPU. {_why_no_gpu()}"
        scene = sample(SceneConfig(), 0, width=480, height=270, variant="full")
        renderer.render(scene)
        start = time.perf_counter()
        frame = renderer.render(scene)
        seconds = time.perf_counter() - start
    if not np.isfinite(frame.radiance).all() or frame.radiance.max() <= 0:
        raise FsidError("the test render is black or not finite: this OpenGL driver does not work with FSID")
    yield "Test render", f"ok, 480x270 in {seconds:.2f} s"
