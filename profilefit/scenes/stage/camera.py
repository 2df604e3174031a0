"""Where the camera stands and how it projects; world and view space in millimetres, y up, the view along -z."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profilefit.errors import InputError

Floats = NDArray[np.float64]
KINDS = ("perspective", "orthographic")


@dataclass(frozen=True)
class Camera:
    """eye, target  points of the world [mm];  height  of what is visible at the target [mm];  kind  one of `KINDS`."""

    eye: tuple[float, float, float] = (0.0, 0.0, 700.0)
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    height: float = 300.0
    kind: str = "perspective"

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f"camera kind must be one of {', '.join(KINDS)}, got {self.kind!r}")
        if not 0 < self.height < np.inf:
            raise InputError(f"camera height must be a length > 0 [mm], got {self.height!r}")

    @property
    def is_perspective(self) -> bool:
        return self.kind == "perspective"

    @property
    def distance(self) -> float:
        """From eye to target [mm]."""
        return float(np.linalg.norm(np.subtract(self.eye, self.target)))

    def pixel(self, rows: int) -> float:
        """Side of a pixel [mm]; in perspective at a depth of 1 mm."""
        return self.height / rows / (self.distance if self.is_perspective else 1.0)

    def view(self) -> Floats:
        """(4, 4) from world to view space."""
        return looking(self.eye, self.target)

    def projection(self, aspect: float, near: float, far: float) -> Floats:
        """(4, 4) from view to clip space; near and far depths [mm]."""
        if not self.is_perspective:
            return orthographic(0.5 * self.height * aspect, 0.5 * self.height, near, far)
        half = 0.5 * self.height / self.distance
        depth = [(near + far) / (near - far), 2.0 * near * far / (near - far)]
        return np.array([[1 / (half * aspect), 0, 0, 0], [0, 1 / half, 0, 0], [0, 0, *depth], [0, 0, -1, 0]])


def looking(eye: ArrayLike, target: ArrayLike) -> Floats:
    """(4, 4) from the world to a space whose origin is the eye and whose -z points at the target."""
    back = unit(np.subtract(eye, target))
    up = (0.0, 1.0, 0.0) if abs(back[1]) < 0.99 else (0.0, 0.0, 1.0)
    right = unit(np.cross(up, back))
    turn = np.stack([right, np.cross(back, right), back])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, -turn @ np.asarray(eye, float)
    return matrix


def orthographic(half_width: float, half_height: float, near: float, far: float) -> Floats:
    """(4, 4) parallel projection of depths near ... far."""
    matrix = np.diag([1 / half_width, 1 / half_height, 2 / (near - far), 1.0])
    matrix[2, 3] = (near + far) / (near - far)
    return matrix


def unit(vectors: ArrayLike) -> Floats:
    """The same directions with length 1 along the last axis."""
    array = np.asarray(vectors, float)
    return array / np.linalg.norm(array, axis=-1, keepdims=True)
