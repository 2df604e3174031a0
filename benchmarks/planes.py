"""G-buffers of a plane that faces an orthographic camera, evenly lit or as a step edge, for a stage to take."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from profilefit.errors import InputError
from profilefit.scenes.stage.world import Buffers


def flat(size: tuple[int, int], pixel: float, reflectance: ArrayLike, irradiance: ArrayLike = 1.0) -> Buffers:
    """Return a plane that faces an orthographic camera and fills its view.

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
    """Return `flat`, lit where x > 0 only: the edge is a border of pixels, so `size` has an even number of columns."""
    columns, rows = size
    if columns % 2:
        raise InputError(f"size must have an even number of columns, so that a border is at x = 0, got {columns}")
    lit = np.broadcast_to((np.arange(columns) >= columns // 2).astype(float)[None, :, None], (rows, columns, 3))
    return flat(size, pixel, reflectance, lit)
