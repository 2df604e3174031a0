"""Surfaces with an atlas: a ball and a heart, of one chart cut along a meridian, and a sheet of bumps."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from profilefit.scenes.stage.world import Mesh, parameters, sheet

Floats = NDArray[np.float64]


def ball(radius: float, rows: int = 96, columns: int = 192) -> Mesh:
    """A sphere about the origin: u its longitude, v from its south pole up [length]."""
    u, v = parameters(rows, columns)
    turn, height = 2.0 * np.pi * u, np.pi * (v - 0.5)
    across = np.cos(height)
    points = radius * np.stack([across * np.sin(turn), np.sin(height), across * np.cos(turn)], axis=-1)
    return sheet(points, u, v, closed=True)


def bumps(period: float, amplitude: float, side: float, rows: int = 200) -> Mesh:
    """A square sheet that faces +z, z = amplitude cos(2 pi x / period) [length]."""
    u, v = parameters(rows, rows)
    x, y = side * (u - 0.5), side * (v - 0.5)
    return sheet(np.stack([x, y, amplitude * np.cos(2.0 * np.pi * x / period)], axis=-1), u, v)
