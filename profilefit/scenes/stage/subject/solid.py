"""Solids as functions: about the distance to a surface [mm], below 0 inside; put together with rounded seams.

A function takes points (3, n) [mm] and returns (n,).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import maximum_filter, minimum_filter

from mcml_sim.media.arrays import Floats

Solid = Callable[[Floats], Floats]
Along = Callable[[Floats | float], Floats]
COARSE = 8  # of a first grid, each row and column one of so many
SCANS, STEPS = 64, 12  # points along a ray of the first grid, and then of each ray
SLACK = 8.0  # beyond the neighbours' distances [mm]


def ellipsoid(points: Floats, at: ArrayLike, radii: ArrayLike, turn: ArrayLike = (0.0, 0.0, 0.0)) -> Floats:
    """Return the distance to an ellipsoid, turned about x, then y, then z [degrees]."""
    a, b, c = np.radians(turn)
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    about_z = np.array([[np.cos(c), -np.sin(c), 0], [np.sin(c), np.cos(c), 0], [0, 0, 1]])
    scaled = (about_z @ about_y @ about_x).T @ (points - np.reshape(at, (3, 1))) / np.reshape(radii, (3, 1))
    near = np.sqrt(np.sum(scaled**2, axis=0))
    slope = np.sqrt(np.sum((scaled / np.reshape(radii, (3, 1))) ** 2, axis=0))
    return np.asarray(near * (near - 1.0) / np.maximum(slope, 1e-9))


def rod(points: Floats, first: ArrayLike, last: ArrayLike, radii: tuple[float, float]) -> Floats:
    """Return the distance to a rod between two points, whose radius goes from the first to the second."""
    way = np.subtract(last, first)
    rest = points - np.reshape(first, (3, 1))
    share = np.clip(way @ rest / np.dot(way, way), 0.0, 1.0)
    apart = np.sqrt(np.sum((rest - way[:, None] * share) ** 2, axis=0))
    return np.asarray(apart - radii[0] - (radii[1] - radii[0]) * share)


def joined(first: Floats, second: Floats, seam: float) -> Floats:
    """Return the union of two solids, its seam filled over a width [mm]."""
    return np.asarray(np.minimum(first, second) - 0.25 / seam * np.maximum(seam - np.abs(first - second), 0.0) ** 2)


def carved(first: Floats, second: Floats, seam: float) -> Floats:
    """Return one solid without another, the edge rounded over a width [mm]."""
    return -joined(-first, second, seam)


def ends(solid: Solid, way: Floats, farthest: float, origin: Floats | None = None) -> Floats:
    """Return the distance (rows, columns) at which rays leave a solid for good.

    A coarse grid is scanned from outside; between its rays false position finds the ends.

    Args:
        solid: around the origins, a star as seen from there but for what hides behind what is farther out.
        way: of the rays, unit vectors (rows, columns, 3).
        farthest: distance beyond which nothing is [mm].
        origin: points inside the solid (rows, columns, 3); by default 0.
    """
    rows, columns = way.shape[:2]
    start = np.zeros_like(way) if origin is None else origin
    r, c = (np.unique(np.r_[0:n:COARSE, n - 1]) for n in (rows, columns))
    first = np.ix_(r, c)
    found = _scanned(_along(solid, start[first], way[first]), farthest).reshape(r.size, c.size)
    low, high = minimum_filter(found, 3) - SLACK, maximum_filter(found, 3) + SLACK
    at_r, at_c = np.interp(np.arange(rows), r, np.arange(r.size)), np.interp(np.arange(columns), c, np.arange(c.size))
    nearest = np.ix_(np.round(at_r).astype(int), np.round(at_c).astype(int))
    return _between(_along(solid, start, way), low[nearest].ravel(), high[nearest].ravel()).reshape(rows, columns)


def _along(solid: Solid, origin: Floats, way: Floats) -> Along:
    """Return the function of distances (n,) along rays that a solid is there."""
    start, direction = origin.reshape(-1, 3).T, way.reshape(-1, 3).T
    return lambda distance: solid(start + direction * distance)


def _scanned(rays: Along, farthest: float) -> Floats:
    tried = farthest * (1.0 - np.arange(SCANS) / SCANS)
    last = np.argmax([rays(one) < 0.0 for one in tried], axis=0)
    return _between(rays, tried[last], tried[np.maximum(last - 1, 0)])


def _between(rays: Along, low: Floats, high: Floats) -> Floats:
    """Return where a solid ends between two distances; Illinois' false position."""
    at_low, at_high = rays(low), rays(high)
    distance, side = 0.5 * (low + high), np.zeros_like(low)
    for _ in range(STEPS):
        share = at_low / np.where(at_low == at_high, 1.0, at_low - at_high)
        distance = low + np.clip(share, 0.02, 0.98) * (high - low)
        here = rays(distance)
        inside = here < 0.0
        # The end that has stayed twice counts half.
        at_high = np.where(inside, np.where(side > 0, 0.5, 1.0) * at_high, here)
        at_low = np.where(inside, here, np.where(side < 0, 0.5, 1.0) * at_low)
        low, high, side = np.where(inside, distance, low), np.where(inside, high, distance), np.where(inside, 1, -1)
    return distance
