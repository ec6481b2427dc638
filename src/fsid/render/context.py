"""The process's one OpenGL context: EGL without a window, OpenGL 4.3 core.

Two contexts in one process corrupt each other silently (a moderngl object does not know which context it
belongs to), so a second one is refused. The libraries are opened by their run-time names, because the
unversioned ones exist only where development packages are installed.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from ctypes import c_char_p, c_void_p
from dataclasses import dataclass
from functools import cache
from typing import Any

import moderngl

from fsid.errors import FsidError

REQUIRED_VERSION = 430
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3
_LARGE_BYTES, _KEPT_BYTES = 2**20, 2**26
_MOST_BYTES, _ALL_BYTES = 2**25, 2**30  # glibc's largest threshold for large blocks; more than is ever free
_MAX_DEVICES = 16
_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "swiftshader")
_HELP = (
    "install the Debian packages libegl1 libgl1 libgl1-mesa-dri for software rendering; in an NVIDIA "
    "container set NVIDIA_DRIVER_CAPABILITIES=graphics (or all) for the GPU"
)


@dataclass(frozen=True)
class GlInfo:
    """What renders. version: OpenGL version with the driver's. is_software: on the CPU, not on a GPU."""

    vendor: str
    renderer: str
    version: str
    is_software: bool


def open_context(device_index: int | None) -> moderngl.Context:
    """A current context on EGL device `device_index`; None takes the first GPU, or else the CPU.

    Raises FsidError where no device of that index gives OpenGL 4.3.
    """
    if device_index is not None:
        return _create(device_index)
    fault = ""  # not the error, whose traceback would hold the caller's frames
    software: int | None = None
    for index in range(_MAX_DEVICES):
        try:
            context = _create(index)
        except FsidError as error:
            fault = fault or str(error)
            continue
        if not gl_info(context).is_software:
            return context
        context.release()
        software = index if software is None else software
    if software is None:
        raise FsidError(fault)
    return _create(software)


def release_context(context: moderngl.Context) -> None:
    """Give a context and its memory back; a child by fork leaves alone what is its parent's."""
    if _used_in == os.getpid():
        context.release()


def egl_devices() -> dict[int, GlInfo]:
    """EGL device index -> what it is, of all that give OpenGL 4.3. Not while a Renderer is open.

    FsidError in a process forked from one that has used OpenGL.
    """
    check_not_forked()
    found: dict[int, GlInfo] = {}
    for index in range(_MAX_DEVICES):
        try:
            context = _create(index)
        except FsidError:
            continue
        found[index] = gl_info(context)
        context.release()
    return found


def gpu_device(number: int) -> int:
    """EGL device index of the GPU with that number, counted without software drivers, which EGL lists too.

    Not while a Renderer is open. FsidError where there are not as many GPUs.
    """
    gpus = [index for index, info in egl_devices().items() if not info.is_software]
    if number >= len(gpus):
        raise FsidError(
            f"--workers-per-gpu: GPU {number} is needed, and OpenGL finds {len(gpus)} (fsid doctor)"
        )
    return gpus[number]


_used_in: int | None = None  # the process that was the first to use OpenGL


def check_not_forked() -> None:
    """FsidError in a child, by fork, of a process that has used OpenGL: the driver would wait for ever."""
    if _used_in not in (None, os.getpid()):
        raise FsidError(
            "this process was forked from one that had used OpenGL, whose driver waits for threads that a "
            "fork does not copy: start workers afresh (multiprocessing_context='spawn' of PyTorch's "
            "DataLoader), or use OpenGL in them alone"
        )


def gl_info(context: moderngl.Context) -> GlInfo:
    """Vendor, device and version of the context."""
    info: dict[str, Any] = context.info
    renderer = str(info["GL_RENDERER"])
    return GlInfo(
        vendor=str(info["GL_VENDOR"]),
        renderer=renderer,
        version=str(info["GL_VERSION"]),
        is_software=any(name in renderer.lower() for name in _SOFTWARE),
    )


@cache
def gl(name: str, *arguments: Any) -> Callable[..., None]:
    """An OpenGL function of the current context that moderngl has no call for; arguments: ctypes."""
    address = ctypes.CDLL("libEGL.so.1").eglGetProcAddress
    address.restype, address.argtypes = c_void_p, [c_char_p]
    return ctypes.CFUNCTYPE(None, *arguments)(address(name.encode()))


def return_large_blocks() -> None:
    """Have glibc give freed blocks of a MiB and more back at once: the frames' arrays, each scene's of
    another size, would leave holes that hold a tenth more memory. Of what small blocks leave free, 64 MiB
    stay: every pass needs them again, and fresh pages cost a tenth of a frame. Elsewhere nothing happens."""
    _set_malloc(_LARGE_BYTES, _KEPT_BYTES)


def keep_blocks() -> None:
    """Have glibc keep what is freed, because the next frame needs it again: for processes beside a GPU, where
    the processor is scarcer than memory. Elsewhere nothing happens."""
    _set_malloc(_MOST_BYTES, _ALL_BYTES)


def _set_malloc(mapped_bytes: int, kept_bytes: int) -> None:
    """From which size on blocks are mapped one by one, and how much that is free is kept."""
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, mapped_bytes)
        mallopt(_M_TRIM_THRESHOLD, kept_bytes)


def return_free_blocks() -> None:
    """Have glibc give back every page that holds nothing. Elsewhere nothing happens."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:
        trim(0)


def _create(device_index: int) -> moderngl.Context:
    global _used_in
    settings: Any = {"backend": "egl", "libgl": "libGL.so.1", "libegl": "libEGL.so.1"}
    settings["device_index"] = device_index
    # llvmpipe filters textures of 8 bits in 8 bits, in steps as large as read noise, unless it is told not
    # to before the process's first context.
    os.environ.setdefault("GALLIVM_PERF", "no_aos_sampling")
    # NVIDIA's waits for the GPU by asking all the time, in two threads, unless it is told to sleep: several
    # processes that share a GPU would take the processor from each other.
    os.environ.setdefault("__GL_YIELD", "USLEEP")
    os.environ.setdefault("__GL_THREADED_OPTIMIZATIONS", "0")
    try:
        context = moderngl.create_context(require=REQUIRED_VERSION, standalone=True, **settings)
    except Exception as error:  # the EGL backend raises bare Exception
        raise FsidError(f"no OpenGL 4.3 on EGL device {device_index} ({error}): {_HELP}") from None
    _used_in = os.getpid()
    return context
