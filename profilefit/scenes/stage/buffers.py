"""The G-buffer: what the camera sees of a scene, pixel by pixel, as numpy arrays."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from profilefit.errors import InputError

Singles = NDArray[np.float32]
VECTORS = ("irradiance", "reflectance", "position", "normal")
NUMBERS = ("mask", "thickness", "visibility", "roughness")
INSIDE = 0.5  # the shaders' threshold of the mask: light scatters inside where it is beyond
ROUNDING = 1e-6  # a float32 that came from a texture's filter may end so far beyond 1


@dataclass(frozen=True)
class Buffers:
    """Float32 arrays, row 0 at the bottom; (h, w, 3) or (h, w).

    irradiance   E, all light that arrives [-];  reflectance  A [-], both red, green, blue
    position     in view space [mm]: x right, y up, z < 0 before the camera;  normal  in view space, unit length
    mask         1 where light scatters inside, 0 elsewhere
    thickness    way of the light through the part [mm]
    pixel        side of a pixel [mm]; in perspective at a depth of 1 mm
    visibility   share of the light that no shadow takes [-];  roughness  of GGX [-]

    Where mask > 0.5 all are finite and A is in [0, 1]; elsewhere only the mask need be finite. Raises InputError.
    """

    irradiance: Singles
    reflectance: Singles
    position: Singles
    normal: Singles
    mask: Singles
    thickness: Singles
    pixel: float
    is_perspective: bool = False
    visibility: Singles | None = None
    roughness: Singles | None = None

    def __post_init__(self) -> None:
        if not 0 < self.pixel < np.inf:
            raise InputError(f"pixel must be a length > 0 [mm], got {self.pixel!r}")
        rows, columns = np.shape(self.mask)[:2]
        for name in VECTORS + NUMBERS:
            array = getattr(self, name)
            accepted = (rows, columns, 3) if name in VECTORS else (rows, columns)
            if array is not None and np.shape(array) != accepted:
                raise InputError(f"{name} must have shape {accepted}, as mask has, got {np.shape(array)}")
        self._check_inside()

    def _check_inside(self) -> None:
        mask = np.asarray(self.mask)
        _require("mask", mask, np.isfinite(mask), "finite")  # NaN would be neither inside nor outside
        inside = mask > INSIDE
        for name in VECTORS + NUMBERS:
            array = getattr(self, name)
            if array is not None:
                value = np.asarray(array)[inside]
                _require(name, value, np.isfinite(value), f"finite where mask > {INSIDE}")
        albedo = np.asarray(self.reflectance)[inside]
        good = (albedo >= 0) & (albedo <= 1 + ROUNDING)
        _require("reflectance", albedo, good, f"in [0, 1] where mask > {INSIDE}")

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows."""
        rows, columns = self.mask.shape
        return columns, rows

    def targets(self) -> tuple[Singles, Singles, Singles, Singles]:
        """The four float targets, (h, w, 4) each."""
        ones = np.ones_like(self.mask)
        fourth = (
            self.thickness,
            ones if self.visibility is None else self.visibility,
            self.mask,
            0.42 * ones if self.roughness is None else self.roughness,
        )
        irradiance, reflectance, position, normal = (
            np.concatenate([getattr(self, name), last[..., None]], axis=-1).astype(np.float32)
            for name, last in zip(VECTORS, fourth, strict=True)
        )
        return irradiance, reflectance, position, normal


def _require(name: str, values: NDArray[np.floating], good: NDArray[np.bool_], what: str) -> None:
    if not np.all(good):
        raise InputError(f"{name} must be {what}, got {values[~good][0]:g}")


def flat(size: tuple[int, int], pixel: float, reflectance: ArrayLike, irradiance: ArrayLike = 1.0) -> Buffers:
    """A plane that faces an orthographic camera and fills its view.

    size  columns, rows;  pixel [mm];  reflectance, irradiance  broadcast to (rows, columns, 3)
    """
    columns, rows = size
    x = (np.arange(columns) + 0.5 - 0.5 * columns) * pixel
    y = (np.arange(rows) + 0.5 - 0.5 * rows) * pixel
    position = np.stack([*np.meshgrid(x, y), np.full((rows, columns), -100.0)], axis=-1)
    normal = np.broadcast_to(np.array([0.0, 0.0, 1.0]), position.shape)
    mask = np.ones((rows, columns), np.float32)
    colours = (np.broadcast_to(np.asarray(value, float), position.shape) for value in (irradiance, reflectance))
    light, skin, place, upright = (value.astype(np.float32) for value in (*colours, position, normal))
    return Buffers(light, skin, place, upright, mask, np.zeros_like(mask), pixel)


def step_edge(size: tuple[int, int], pixel: float, reflectance: ArrayLike) -> Buffers:
    """`flat`, lit where x > 0 only: the edge is a border of pixels, so `size` has an even number of columns."""
    columns, rows = size
    if columns % 2:
        raise InputError(f"size must have an even number of columns, so that a border is at x = 0, got {columns}")
    lit = np.broadcast_to((np.arange(columns) >= columns // 2).astype(float)[None, :, None], (rows, columns, 3))
    return flat(size, pixel, reflectance, lit)


SURFACE = ("irradiance_map", "reflectance_map", "position_map", "normal_map")
PLACE = "place_map"  # u, v, and 1 where a surface is


class Maps:
    """Float textures of one size by name, four channels each, which passes read and fill."""

    def __init__(self, context: moderngl.Context, size: tuple[int, int]):
        self.context, self.size = context, size
        self._maps: dict[str, moderngl.Texture] = {}
        self._into: dict[str, moderngl.Framebuffer] = {}

    def map(self, name: str) -> moderngl.Texture:
        """The texture of that name, made on first use."""
        if name not in self._maps:
            self._maps[name] = float_texture(self.context, self.size, 4)
        return self._maps[name]

    def into(self, name: str) -> moderngl.Framebuffer:
        """What fills it."""
        if name not in self._into:
            self._into[name] = self.context.framebuffer([self.map(name)])
        return self._into[name]

    def release(self) -> None:
        for framebuffer in self._into.values():
            framebuffer.release()
        for texture in self._maps.values():
            texture.release()


class Targets(Maps):
    """Those of a stage: the maps of `SURFACE` and `PLACE`, which parts are drawn into, and all that passes need."""

    def __init__(self, context: moderngl.Context, size: tuple[int, int]):
        super().__init__(context, size)
        self._depth = context.depth_renderbuffer(size)
        self.surface = context.framebuffer([self.map(name) for name in (*SURFACE, PLACE)], self._depth)

    def upload(self, buffers: Buffers) -> None:
        for name, array in zip(SURFACE, buffers.targets(), strict=True):
            self._maps[name].write(np.ascontiguousarray(array).tobytes())

    def read(self, pixel: float, is_perspective: bool) -> Buffers:
        irradiance, reflectance, position, normal = (pixels(self._maps[name]) for name in SURFACE)
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
        self.surface.release()
        super().release()
        self._depth.release()


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
