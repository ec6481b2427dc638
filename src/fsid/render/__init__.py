"""Scene + camera -> Frame: a headless OpenGL rasteriser, free of noise and bit-identical between runs."""

from fsid.render.context import GlInfo, egl_devices, gpu_device
from fsid.render.frame import Frame
from fsid.render.renderer import Renderer
from fsid.render.sky import check_skies

__all__ = ["Frame", "GlInfo", "Renderer", "check_skies", "egl_devices", "gpu_device"]
