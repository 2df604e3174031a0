"""Sunlight on a floor below waves of one dimension, averaged over pixels exactly: all rays between their edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profilefit.scenes.sea.truth import Rays, Surface

Floats = NDArray[np.float64]
SUN = float(np.radians(0.5 * 0.533))  # half-width of the sun's disc in air [rad]
SUNS = 32  # directions within the sun's disc, in the plane of the waves
# Gauss's points and weights on [0, 1], of the flux between two samples.
GAUSS = [(0.5 * (1.0 + point), 0.5 * weight) for point, weight in zip(*np.polynomial.legendre.leggauss(4), strict=True)]


def caustic_boxes(
    surface: Surface, edges: ArrayLike, depth: float, tilt: float, n: float, *, sun: float = 0.0, aside: float = 0.0
) -> Floats:
    """Return irradiance (m,) [-] averaged over pixels between edges (m + 1,) [m]; others as of `caustic_irradiance`.

    sun  half-width of its even disc in air, `SUN` of the real one [rad]: averaged over 32 directions of it in the
         plane of the waves, weighted by the disc's chords (Chebyshev's points of the second kind)

    Exact: the flux between two edges is that between the places whose rays come to them, so folds need no care.
    """
    border = np.asarray(edges, float)
    if sun:
        angles = np.pi * np.arange(1, SUNS + 1) / (SUNS + 1)
        weights = np.sin(angles) ** 2 / np.sum(np.sin(angles) ** 2)
        each = [caustic_boxes(surface, border, depth, tilt, n, aside=sun * one) for one in np.cos(angles).tolist()]
        return np.asarray(weights @ np.array(each))
    rays = Rays(surface, border, depth, tilt, n, aside=aside)
    before = np.concatenate([[0.0], np.cumsum(_through(rays, rays.nodes[:-1], rays.nodes[1:]))])
    target, place, rises = rays.arrivals(border)
    cell = np.clip(np.searchsorted(rays.nodes, place, "right") - 1, 0, rays.nodes.size - 2)
    sent = before[cell] + _through(rays, rays.nodes[cell], place)  # from the first sample to each place
    landed = np.bincount(target, np.where(rises, 1.0, -1.0) * sent, border.size).astype(float)
    return np.diff(landed) / np.diff(border)


def _through(rays: Rays, near: Floats, far: Floats) -> Floats:
    """Return flux through the surface between places, what crests shade taken off [m]."""
    found = np.zeros_like(near)
    for point, weight in GAUSS:
        here = near + point * (far - near)
        found += weight * np.where(rays.is_lit(here), rays.at(here)[2], 0.0)
    return found * (far - near)
