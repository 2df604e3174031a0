"""The render's own textures on the GPU: the G-buffer's four, what scattered, what is shown."""

from __future__ import annotations

import moderngl
import numpy as np

from profilefit.shader.stage.buffers import Buffers, Singles

SURFACE = ("irradiance_map", "reflectance_map", "position_map", "normal_map")


class Targets:
    """Float textures of one size, each four channels, with the framebuffers that fill them."""

    def __init__(self, context: moderngl.Context, size: tuple[int, int]):
        self.context, self.size = context, size
        self.maps = {name: float_texture(context, size, 4) for name in SURFACE}
        self._depth = context.depth_renderbuffer(size)
        self.surface = context.framebuffer(list(self.maps.values()), self._depth)
        self.halfway, self.exitance, self.radiance = (float_texture(context, size, 4) for _ in range(3))
        self.into = {texture: context.framebuffer([texture]) for texture in self._shown()}

    def upload(self, buffers: Buffers) -> None:
        for texture, array in zip(self.maps.values(), buffers.targets(), strict=True):
            texture.write(np.ascontiguousarray(array).tobytes())

    def read(self, pixel: float, is_perspective: bool) -> Buffers:
        irradiance, reflectance, position, normal = (pixels(self.maps[name]) for name in SURFACE)
        return Buffers(
            irradiance[..., :3],
            reflectance[..., :3],
            position[..., :3],
            normal[..., :3],
            position[..., 3],
            irradiance[..., 3],
            pixel,
            is_perspective,
            reflectance[..., 3],
            normal[..., 3],
        )

    def release(self) -> None:
        for framebuffer in (self.surface, *self.into.values()):
            framebuffer.release()
        for texture in (*self.maps.values(), *self._shown()):
            texture.release()
        self._depth.release()

    def _shown(self) -> tuple[moderngl.Texture, moderngl.Texture, moderngl.Texture]:
        return self.halfway, self.exitance, self.radiance


def float_texture(
    context: moderngl.Context, size: tuple[int, int], channels: int, array: Singles | None = None
) -> moderngl.Texture:
    """A float32 texture without a filter, of an array (rows, columns, channels) if one is given."""
    data = None if array is None else np.ascontiguousarray(array, np.float32).tobytes()
    texture = context.texture(size, channels, data, dtype="f4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture


def pixels(texture: moderngl.Texture) -> Singles:
    """(h, w, channels) float32, row 0 at the bottom; a copy."""
    columns, rows = texture.size
    return np.frombuffer(texture.read(), np.float32).reshape(rows, columns, texture.components).copy()
