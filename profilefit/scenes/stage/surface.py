"""Surface that a view sees: the G-buffer of a render as float64 arrays, and the patch that each pixel shows."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profilefit.errors import InputError
from profilefit.scenes.stage.buffers import INSIDE, Buffers
from profilefit.scenes.stage.world import Camera

Floats = NDArray[np.float64]
# Of normal and ray, at the least: a pixel on an outline has no tangent plane, and shows no more than this makes it.
LEAST_COSINE = 0.05
# A point may lie so many pixels off the one that shows it, over the cosine of normal and ray, that at least.
NEAR, LEAST_SHOWN = 1.5, 0.25


@dataclass(frozen=True)
class View:
    """A camera: which way it looks, and what a pixel covers.

    right, up, forward  orthonormal axes (3,): along a row, across rows, into the scene
    pixel               side of a pixel [length], or with an eye that at unit depth [-]: 2 tan(fov / 2) / pixels
    eye                 (3,) [length] of a perspective view; None of an orthographic one
    """

    right: Floats
    up: Floats
    forward: Floats
    pixel: float
    eye: Floats | None = None

    def __post_init__(self) -> None:
        axes = np.stack([np.asarray(axis, float) for axis in (self.right, self.up, self.forward)])
        if axes.shape != (3, 3) or not np.allclose(axes @ axes.T, np.eye(3), atol=1e-6):
            raise InputError(f"right, up, forward must be three orthonormal axes, got {axes.tolist()}")
        if not (np.isfinite(self.pixel) and self.pixel > 0):
            raise InputError(f"pixel must be a length > 0, got {self.pixel!r}")

    def footprint(self, position: Floats, normal: Floats) -> tuple[Floats, Floats]:
        """Return sides of the parallelogram of the tangent plane that a pixel shows, along and across rows (..., 3)."""
        forward = np.asarray(self.forward, float)
        ray, scale = np.broadcast_to(forward, position.shape), np.full(position.shape[:-1], float(self.pixel))
        if self.eye is not None:
            depth = (position - self.eye) @ forward
            scale = self.pixel * depth
            # The background's positions are the eye's own: any ray will do there, for its footprint is 0.
            ray = np.where(depth[..., None] > 0, position - self.eye, forward)
            ray = ray / np.where(depth > 0, depth, 1.0)[..., None]
        facing = -np.sum(normal * ray, axis=-1)
        facing = np.maximum(facing, LEAST_COSINE * np.linalg.norm(ray, axis=-1))
        across, along = (
            scale[..., None] * (axis + ((normal @ axis) / facing)[..., None] * ray)
            for axis in (np.asarray(self.right, float), np.asarray(self.up, float))
        )
        return across, along

    def coarsened(self, factor: int) -> View:
        """Return the view with pixels that many times as large."""
        return replace(self, pixel=self.pixel * factor)


@dataclass(frozen=True)
class Surface:
    """A G-buffer (h, w, ...); what the mask leaves out is not read.

    position [length], normal (unit, towards the eye), irradiance E [any unit], reflectance A [-], each (h, w, 3), the
    last two by channel;  mask (h, w), True where the surface is seen
    For a sum over a scene's own `CurveTable` reflectance is what that maps to curves, in [0, 1] too.
    """

    position: Floats
    normal: Floats
    irradiance: Floats
    reflectance: Floats
    mask: NDArray[np.bool_]

    def __post_init__(self) -> None:
        object.__setattr__(self, "mask", np.asarray(self.mask, bool))
        if self.mask.ndim != 2 or not self.mask.any():
            raise InputError(f"mask must be (h, w) with a visible pixel, got shape {self.mask.shape}")
        for field in fields(self)[:-1]:
            object.__setattr__(self, field.name, self._checked(field.name))
        seen = self.reflectance[self.mask]
        if not np.all((seen >= 0) & (seen <= 1)):
            raise InputError(f"reflectance must be in [0, 1], got {seen[~((seen >= 0) & (seen <= 1))][0]:g}")
        lengths = np.linalg.norm(self.normal[self.mask], axis=-1)
        if not np.allclose(lengths, 1.0, atol=1e-3):
            raise InputError(f"normal must have length 1, got one of {lengths[np.argmax(np.abs(lengths - 1))]:g}")

    def _checked(self, name: str) -> Floats:
        value = np.asarray(getattr(self, name), float)
        if value.shape != (*self.mask.shape, 3):
            raise InputError(f"{name} must be {(*self.mask.shape, 3)} as the mask, got {value.shape}")
        if not np.all(np.isfinite(value[self.mask])):
            raise InputError(f"{name} must be finite where the mask is True, got {value[self.mask].ravel()[0]}...")
        return np.where(self.mask[..., None], value, 0.0)

    def coarsened(self, factor: int) -> Surface:
        """Return means over blocks of factor x factor pixels, seen where all are; InputError if blocks do not fit."""
        h, w = self.mask.shape
        if factor < 1 or h % factor or w % factor:
            raise InputError(f"factor must divide {h} and {w}, got {factor}")

        def mean(value: ArrayLike) -> Floats:
            return np.asarray(value, float).reshape(h // factor, factor, w // factor, factor, -1).mean(axis=(1, 3))

        normal = mean(self.normal)
        length = np.linalg.norm(normal, axis=-1, keepdims=True)
        mask = mean(self.mask)[..., 0] == 1.0
        unit = normal / np.where(length > 0, length, 1.0)
        return Surface(mean(self.position), unit, mean(self.irradiance), mean(self.reflectance), mask)


def seen(buffers: Buffers) -> tuple[Surface, View]:
    """Return the scattering part of a render's G-buffer, in view space, and the camera that it was seen by."""
    reflectance = np.clip(np.asarray(buffers.reflectance, float), 0.0, 1.0)  # a float32 may end beyond
    position, normal, irradiance = (
        np.asarray(value, float) for value in (buffers.position, buffers.normal, buffers.irradiance)
    )
    right, up, forward = np.diag([1.0, 1.0, -1.0])
    view = View(right, up, forward, buffers.pixel, np.zeros(3) if buffers.is_perspective else None)
    return Surface(position, normal, irradiance, reflectance, buffers.mask > INSIDE), view


def world(buffers: Buffers, camera: Camera) -> Floats:
    """Return places (h, w, 3) of the world that a camera sees [mm]."""
    view = camera.view()
    return np.asarray((buffers.position.astype(float) - view[:3, 3]) @ view[:3, :3], float)


def evenly(mask: NDArray[np.bool_], most: int) -> tuple[NDArray[np.intp], ...]:
    """Return rows and columns of at most so many pixels of a mask, spread over all of it."""
    found = np.argwhere(mask)
    return tuple(found[np.linspace(0, len(found) - 1, min(most, len(found))).astype(int)].T)


def sees(buffers: Buffers, camera: Camera, points: ArrayLike) -> NDArray[np.bool_]:
    """Return (n,) whether a view sees points (n, 3) of the world [mm]: no other surface lies in front of them."""
    view = camera.view()
    place = np.asarray(points, float) @ view[:3, :3].T + view[:3, 3]
    rows, columns = buffers.mask.shape
    depth = -place[:, 2] if camera.is_perspective else np.ones(len(place))
    side = camera.pixel(rows) * np.maximum(depth, np.finfo(float).tiny)
    column, row = (np.floor(place[:, axis] / side + 0.5 * of).astype(int) for axis, of in ((0, columns), (1, rows)))
    within = (depth > 0) & (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
    at = np.where(within, row, 0), np.where(within, column, 0)
    there = buffers.position[at].astype(float)
    ray = there if camera.is_perspective else np.array([[0.0, 0.0, -1.0]])
    facing = np.abs(np.sum(buffers.normal[at] * ray, axis=1)) / np.linalg.norm(ray, axis=1).clip(np.finfo(float).tiny)
    near = NEAR * side / np.maximum(facing, LEAST_SHOWN)
    return within & (buffers.mask[at] > INSIDE) & (np.linalg.norm(place - there, axis=1) < near)
