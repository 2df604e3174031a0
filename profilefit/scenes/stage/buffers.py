"""G-buffer: the surface that the camera sees of a scene, pixel by pixel, as numpy arrays."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim.media.arrays import Floats, checked_range
from profilefit.errors import InputError

Singles = NDArray[np.float32]
VECTORS = ("irradiance", "reflectance", "position", "normal")
NUMBERS = ("mask", "thickness", "visibility", "roughness")
INSIDE = 0.5  # the shaders' threshold of the mask: light scatters inside where it is beyond
LARGEST = float(np.finfo(float).max)
ROUNDING = 1e-6  # a float32 that came from a texture's filter may end so far beyond 1
SURFACE = ("irradiance_map", "reflectance_map", "position_map", "normal_map")
PLACE = "place_map"  # u, v, and 1 where a surface is


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
        given = {name: array for name in VECTORS + NUMBERS if (array := getattr(self, name)) is not None}
        for name, array in given.items():
            accepted = (rows, columns, 3) if name in VECTORS else (rows, columns)
            if np.shape(array) != accepted:
                raise InputError(f"{name} must have shape {accepted}, as mask has, got {np.shape(array)}")
        mask = np.asarray(self.mask)
        finite("mask", mask)  # NaN would be neither inside nor outside
        inside = mask > INSIDE
        for name, array in given.items():
            finite(name, np.asarray(array)[inside], f"finite where mask > {INSIDE}")
        albedo = np.asarray(self.reflectance)[inside]
        good = (albedo >= 0) & (albedo <= 1 + ROUNDING)
        require("reflectance", albedo, good, f"in [0, 1] where mask > {INSIDE}")

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows."""
        rows, columns = self.mask.shape
        return columns, rows

    def maps(self) -> dict[str, Singles]:
        """Return the four float maps (h, w, 4) of `SURFACE`, by name."""
        ones = np.ones_like(self.mask)
        fourth = (
            self.thickness,
            ones if self.visibility is None else self.visibility,
            self.mask,
            0.42 * ones if self.roughness is None else self.roughness,
        )
        return {
            name: np.concatenate([getattr(self, vector), last[..., None]], axis=-1).astype(np.float32)
            for name, vector, last in zip(SURFACE, VECTORS, fourth, strict=True)
        }

    @classmethod
    def of_maps(cls, maps: Iterable[Singles], pixel: float, is_perspective: bool) -> Buffers:
        """Return the G-buffer of four maps (h, w, 4), in the order of `SURFACE`."""
        one, two, three, four = maps
        vectors = one[..., :3], two[..., :3], three[..., :3], four[..., :3]
        return cls(*vectors, three[..., 3], one[..., 3], pixel, is_perspective, two[..., 3], four[..., 3])


def finite(name: str, value: ArrayLike, accepted: str = "finite") -> Floats:
    """Return numbers as `checked_numbers` does; InputError on the first that is not finite."""
    return checked_range(name, value, accepted, -LARGEST, LARGEST)


def require(name: str, values: NDArray[np.floating], good: NDArray[np.bool_], accepted: str) -> None:
    """Raise InputError where values are not good, with the first of those."""
    if not np.all(good):
        raise InputError(f"{name} must be {accepted}, got {values[~good].flat[0]:g}")
