"""Scene + camera -> Frame: a headless OpenGL rasteriser, free of noise and bit-identical between runs."""

from fsid.render.context import GlInfo, egl_devices, gpu_device
from fsid.render.frame import Frame
from fsid.render.renderer import Renderer

__all__ = ["Frame", "GlInfo", "Renderer", "egl_devices", "gpu_device"]
