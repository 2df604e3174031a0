"""Scene: parts with a mesh and a texture, lamps far away, light from all of the sky, and a camera.

Its G-buffer is the surface that the camera sees, pixel by pixel, as numpy arrays.

World and view space are in millimetres, y up; a view looks along -z.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim.media.arrays import Floats, checked_finite, require, require_all
from profilefit.errors import InputError
from profilefit.scenes.stage.light.environment import Environment

ROUGHNESS = 0.42  # of skin, GGX [-]
EVEN = np.array([[[0.0, 0.0, 1.0, 1.0]]], np.float32)  # relief of a part that has none
Rgb = tuple[float, float, float]
Singles = NDArray[np.float32]
VECTORS = ("irradiance", "reflectance", "position", "normal")
NUMBERS = ("mask", "thickness", "visibility", "roughness")
INSIDE = 0.5  # the shaders' threshold of the mask: light scatters inside where it is beyond
ROUNDING = 1e-6  # a float32 that came from a texture's filter may end so far beyond 1
SURFACE = ("irradiance_map", "reflectance_map", "position_map", "normal_map")
PLACE = "place_map"  # u, v, and 1 where a surface is
KINDS = ("perspective", "orthographic")
MOST_LAMPS = 4
# Of central differences, over the largest coordinate: there rounding, eps / step, is as large as the rest, step^2.
DIFFERENCE = float(np.cbrt(np.finfo(float).eps))


@dataclass(frozen=True)
class Camera:
    """Camera: eye, target  points [mm];  height  of what is visible at the target [mm];  kind  one of `KINDS`."""

    eye: tuple[float, float, float] = (0.0, 0.0, 700.0)
    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    height: float = 300.0
    kind: str = "perspective"

    def __post_init__(self) -> None:
        require(self.kind in KINDS, "camera kind", f"one of {', '.join(KINDS)}", self.kind)
        require(0 < self.height < np.inf, "camera height", "a length > 0 [mm]", self.height)

    @property
    def is_perspective(self) -> bool:
        return self.kind == "perspective"

    @property
    def distance(self) -> float:
        """Distance from eye to target [mm]."""
        return float(np.linalg.norm(np.subtract(self.eye, self.target)))

    def pixel(self, rows: int) -> float:
        """Return the side of a pixel [mm]; in perspective at a depth of 1 mm."""
        return self.height / rows / (self.distance if self.is_perspective else 1.0)

    def view(self) -> Floats:
        """Return (4, 4) from world to view space."""
        return looking(self.eye, self.target)

    def projection(self, aspect: float, near: float, far: float) -> Floats:
        """Return (4, 4) from view to clip space; near and far depths [mm]."""
        if not self.is_perspective:
            return orthographic(0.5 * self.height * aspect, 0.5 * self.height, near, far)
        half = 0.5 * self.height / self.distance
        depth = [(near + far) / (near - far), 2.0 * near * far / (near - far)]
        return np.array([[1 / (half * aspect), 0, 0, 0], [0, 1 / half, 0, 0], [0, 0, *depth], [0, 0, -1, 0]])


@dataclass(frozen=True)
class Mesh:
    """Mesh of position (n, 3) [mm], normal (n, 3), uv (n, 2) in [0, 1], triangles (m, 3) counter-clockwise outside.

    tangent  (n, 4) direction in which u grows, and 1 or -1, by which v grows along normal x tangent; where it is 0, as
             by default, the part has no relief
    tint     (n, 3) factors of the reflectance; 1 by default
    """

    position: Floats
    normal: Floats
    uv: Floats
    triangles: NDArray[np.int32]
    tangent: Floats | None = None
    tint: Floats | None = None

    def vertices(self) -> NDArray[np.float32]:
        """Return (n, 15) position, normal, uv, tangent, tint, as a vertex buffer holds them."""
        tangent = np.zeros((len(self.position), 4)) if self.tangent is None else self.tangent
        tint = np.ones((len(self.position), 3)) if self.tint is None else self.tint
        return np.concatenate([self.position, self.normal, self.uv, tangent, tint], axis=1).astype(np.float32)


@dataclass(frozen=True)
class Part:
    """Mesh with its reflectance A (rows, columns, 3) over u and v, and its GGX roughness [-].

    is_translucent  light scatters inside; else it is Lambert's
    relief  (rows, columns, 4) over u and v: normals along tangent, across it and along the normal, and a factor of the
            roughness
    """

    mesh: Mesh
    reflectance: NDArray[np.float32]
    roughness: float = ROUGHNESS
    is_translucent: bool = True
    relief: NDArray[np.float32] | None = None


@dataclass(frozen=True)
class Light:
    """Lamp far away: direction to it, in the world; irradiance of a surface that faces it [-], in its unit."""

    direction: tuple[float, float, float] = (-0.90, 0.26, 0.36)
    irradiance: Rgb = (3.6, 3.4, 3.1)

    def __post_init__(self) -> None:
        is_direction = np.all(np.isfinite(self.direction)) and np.linalg.norm(self.direction) > 0
        require(is_direction, "light direction", "a direction, not 0", self.direction)
        _require_light("light irradiance", self.irradiance)


@dataclass(frozen=True)
class Scene:
    """Parts under lamps and a sky.

    light, more  the first lamp, and others
    ambient  irradiance of a surface under an even sky [-];  environment  another sky, added to it
    has_occlusion  whether parts are in the way of the sky's light;  f0  share of light that is mirrored head-on [-]
    """

    parts: tuple[Part, ...]
    light: Light = field(default_factory=Light)
    ambient: Rgb = (0.16, 0.18, 0.21)
    camera: Camera = field(default_factory=Camera)
    f0: float = 0.028  # of skin, n = 1.4
    more: tuple[Light, ...] = ()
    environment: Environment | None = None
    has_occlusion: bool = True

    def __post_init__(self) -> None:
        _require_light("ambient", self.ambient)
        require(len(self.more) < MOST_LAMPS, "more", f"at most {MOST_LAMPS - 1} lamps beside the first", len(self.more))

    @property
    def has_sky(self) -> bool:
        """Whether any light comes from the sky."""
        return self.environment is not None or any(self.ambient)

    def zoomed(self, height: float) -> Self:
        """Return the scene seen by a camera that shows `height` [mm] at its target."""
        return replace(self, camera=replace(self.camera, height=height))


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
        require(0 < self.pixel < np.inf, "pixel", "a length > 0 [mm]", self.pixel)
        rows, columns = np.shape(self.mask)[:2]
        given = {name: array for name in VECTORS + NUMBERS if (array := getattr(self, name)) is not None}
        for name, array in given.items():
            accepted = (rows, columns, 3) if name in VECTORS else (rows, columns)
            if np.shape(array) != accepted:
                raise InputError(f"{name} must have shape {accepted}, as mask has, got {np.shape(array)}")
        mask = np.asarray(self.mask)
        checked_finite("mask", mask)  # NaN would be neither inside nor outside
        inside = mask > INSIDE
        for name, array in given.items():
            checked_finite(name, np.asarray(array)[inside], f"finite where mask > {INSIDE}")
        albedo = np.asarray(self.reflectance)[inside]
        good = (albedo >= 0) & (albedo <= 1 + ROUNDING)
        require_all("reflectance", albedo, good, f"in [0, 1] where mask > {INSIDE}")

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
            ROUGHNESS * ones if self.roughness is None else self.roughness,
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


def _require_light(name: str, light: Rgb) -> None:
    holds = np.shape(light) == (3,) and np.all(np.isfinite(light)) and min(light) >= 0
    require(holds, name, "three finite numbers >= 0", light)


def rgb(values: Iterable[float]) -> Rgb:
    """Return three numbers, of red, green and blue, as floats."""
    red, green, blue = (float(value) for value in values)
    return red, green, blue


def looking(eye: ArrayLike, target: ArrayLike) -> Floats:
    """Return (4, 4) from the world to a space whose origin is the eye and whose -z points at the target."""
    back = unit(np.subtract(eye, target))
    up = (0.0, 1.0, 0.0) if abs(back[1]) < 0.99 else (0.0, 0.0, 1.0)
    right = unit(np.cross(up, back))
    turn = np.stack([right, np.cross(back, right), back])
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn, -turn @ np.asarray(eye, float)
    return matrix


def orthographic(half_width: float, half_height: float, near: float, far: float) -> Floats:
    """Return (4, 4) parallel projection of depths near ... far."""
    matrix = np.diag([1 / half_width, 1 / half_height, 2 / (near - far), 1.0])
    matrix[2, 3] = (near + far) / (near - far)
    return matrix


def unit(vectors: ArrayLike) -> Floats:
    """Return the directions with length 1 along the last axis."""
    array = np.asarray(vectors, float)
    return array / np.linalg.norm(array, axis=-1, keepdims=True)


def parameters(rows: int, columns: int) -> tuple[Floats, Floats]:
    """Return u and v (rows + 1, columns + 1), even over [0, 1]; u along a row."""
    v, u = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    return u, v


def sheet(points: Floats, u: Floats, v: Floats, closed: bool = False) -> Mesh:
    """Return a grid of points (rows, columns, 3), outside where d/du x d/dv points; `closed`: last column is first."""
    rows, columns = u.shape
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    uv = np.stack([u, v], -1).reshape(-1, 2)
    return Mesh(points.reshape(-1, 3), normals(points, closed).reshape(-1, 3), uv, triangles)


def deformed(mesh: Mesh, move: Callable[[Floats], Floats]) -> Mesh:
    """Return the mesh moved by a smooth map of space, (n, 3) -> (n, 3) [mm]; its normals by the map's derivatives.

    Raises InputError where the map turns space inside out, as a mirror does, or is not finite.
    """
    start = np.asarray(mesh.position, float)
    with np.errstate(all="ignore"):  # what is not finite is named below
        position = _moved(move, start)
        a, b, c = _derivatives(move, start)
        # The columns of the inverse transpose, times the determinant, which is > 0.
        by_x, by_y, by_z = np.cross(b, c), np.cross(c, a), np.cross(a, b)
        determinant = np.sum(a * by_x, axis=1)
    good = np.isfinite(determinant) & (determinant > 0) & np.isfinite(position).all(axis=1)
    if not good.all():
        at = int(np.argmin(good))
        place = ", ".join(f"{one:g}" for one in start[at])
        found = f"{determinant[at]:g} at ({place})"
        raise InputError(f"move must keep orientation, with a determinant > 0 of its derivatives, got {found}")
    x, y, z = mesh.normal.T[..., None]
    return replace(mesh, position=position, normal=unit(x * by_x + y * by_y + z * by_z))


def _moved(move: Callable[[Floats], Floats], points: Floats) -> Floats:
    moved = np.asarray(move(points), float)
    if moved.shape != points.shape:
        raise InputError(f"move must return an array of shape {points.shape}, as it is given, got {moved.shape}")
    return moved


def _derivatives(move: Callable[[Floats], Floats], points: Floats) -> list[Floats]:
    """Return d move / dx, d / dy, d / dz, each (n, 3) [-]: central differences."""
    step = DIFFERENCE * (np.max(np.abs(points), initial=0.0) or 1.0)
    found = []
    for axis in np.eye(3):
        high, low = points + step * axis, points - step * axis
        # Over the step that float64 took, which is not quite the one that was asked for.
        found.append((_moved(move, high) - _moved(move, low)) / ((high - low) @ axis)[:, None])
    return found


def normals(points: Floats, closed: bool = False) -> Floats:
    """Return (rows, columns, 3) unit normals of a grid: of each vertex, the mean of its faces by their area."""
    across, along = np.diff(points, axis=1), np.diff(points, axis=0)
    face = np.cross(across[:-1], along[:, 1:]) + np.cross(across[1:], along[:, :-1])
    padded = np.pad(face, ((1, 1), (1, 1), (0, 0)))
    if closed:
        padded[1:-1, 0], padded[1:-1, -1] = face[:, -1], face[:, 0]
    total = padded[:-1, :-1] + padded[:-1, 1:] + padded[1:, :-1] + padded[1:, 1:]
    if closed:  # at a pole all vertices are one
        for row in (0, -1):
            if np.ptp(points[row], axis=0).max() < 1e-9:
                total[row] = total[row].sum(axis=0)
    return unit(total + 1e-30)
