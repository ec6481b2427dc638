"""A texture array whose mip levels are written one layer at a time, which moderngl has no call for.

    storage   glTexStorage3D: all levels at once, and nothing besides
    write     glTexSubImage3D: straight from memory, for the processor's driver little more than a copy; the
              driver of a GPU would wait for it at every level, so there a buffer lies between
    growth    glCopyImageSubData: a level of all layers in one call

A compute shader that stores the texels takes thirty times as long on llvmpipe, and levels that exist because
they were generated cost the base level's memory twice while the array is made.
"""

from __future__ import annotations

import ctypes
from ctypes import c_int, c_uint, c_void_p

import moderngl
import numpy as np

from fsid.errors import FsidError
from fsid.render.context import gl
from fsid.render.texels import level_ranges

_TEXTURE_2D_ARRAY, _TEXTURE0, _UNPACK_BUFFER = 0x8C1A, 0x84C0, 0x88EC
_RGBA8, _RGBA, _UNSIGNED_BYTE = 0x8058, 0x1908, 0x1401
_MIN_FILTER, _LINEAR_MIPMAP_LINEAR = 0x2801, 0x2703


class TextureArray:
    """`capacity` RGBA8 layers of `size` x `size` texels with all their mip levels, trilinear, repeating.
    buffered: write by way of a buffer."""

    def __init__(
        self, context: moderngl.Context, size: int, capacity: int, *, buffered: bool = False
    ) -> None:
        most = int(context.info["GL_MAX_ARRAY_TEXTURE_LAYERS"])
        if capacity > most:
            raise FsidError(
                f"{capacity} materials are more than the {most} that this driver takes in a scene"
            )
        self.capacity = capacity
        self._context = context
        self._buffered = buffered
        self._levels = level_ranges(size)
        self._name = c_uint()
        gl("glGenTextures", c_int, c_void_p)(1, ctypes.byref(self._name))
        self.use(0)
        _ = context.error  # of an earlier call, which would be taken for that of the next
        storage = gl("glTexStorage3D", c_uint, c_int, c_uint, c_int, c_int, c_int)
        storage(_TEXTURE_2D_ARRAY, len(self._levels), _RGBA8, size, size, capacity)
        if context.error != "GL_NO_ERROR":
            self.release()
            raise FsidError(
                f"no texture memory for {capacity} materials of {size} x {size} texels: "
                "set a smaller texture_size"
            )
        gl("glTexParameteri", c_uint, c_uint, c_int)(_TEXTURE_2D_ARRAY, _MIN_FILTER, _LINEAR_MIPMAP_LINEAR)

    def use(self, unit: int) -> None:
        """Bind it to a texture unit."""
        gl("glActiveTexture", c_uint)(_TEXTURE0 + unit)
        gl("glBindTexture", c_uint, c_uint)(_TEXTURE_2D_ARRAY, self._name)

    def write(self, layer: int, texels: np.ndarray) -> None:
        """All mip levels of one layer, (T, 4) uint8, contiguous."""
        self.use(0)
        write = gl("glTexSubImage3D", c_uint, *[c_int] * 7, c_uint, c_uint, c_void_p)
        buffer = self._context.buffer(texels) if self._buffered else None
        if buffer is not None:
            gl("glBindBuffer", c_uint, c_uint)(_UNPACK_BUFFER, buffer.glo)
        for number, (size, level) in enumerate(self._levels):
            box = (0, 0, layer, size, size, 1)
            start = texels[level].ctypes.data if buffer is None else level.start * texels.strides[0]
            write(_TEXTURE_2D_ARRAY, number, *box, _RGBA, _UNSIGNED_BYTE, start)
        if buffer is not None:
            gl("glBindBuffer", c_uint, c_uint)(_UNPACK_BUFFER, 0)
            buffer.release()

    def take(self, other: TextureArray) -> None:
        """The layers of a smaller array, in the same places."""
        copy = gl("glCopyImageSubData", *[c_uint, c_uint, c_int, c_int, c_int, c_int] * 2, *[c_int] * 3)
        for number, (size, _) in enumerate(self._levels):
            source, target = (
                (name, _TEXTURE_2D_ARRAY, number, 0, 0, 0) for name in (other._name, self._name)
            )
            copy(*source, *target, size, size, other.capacity)

    def release(self) -> None:
        """Give its memory back."""
        gl("glDeleteTextures", c_int, c_void_p)(1, ctypes.byref(self._name))
