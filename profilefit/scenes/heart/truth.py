"""Light that scatters under a whole surface, hidden parts included: the sum over all pairs of points.

On a sphere there is an oracle without any sum: there a Gaussian of the chord is von Mises and Fisher's function of the
angle, with kappa = radius^2 / v (`sphere_blur`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from mcml_sim.media.arrays import Floats, checked_finite, checked_numbers, require
from profilefit.errors import InputError
from profilefit.scenes.stage.reference.surface_sum import Elements, gaussian_sums

NEIGHBOURS = 24  # points that gather together
MERGED = 1.0 / 6.0  # side of the cubes in which elements are merged [sigma]
NOTHING = 16.0  # d^2 / 2 v from which on e^-that, 1e-7, counts as none


def surface_blur(
    points: ArrayLike,
    areas: ArrayLike,
    irradiance: ArrayLike,
    variances: ArrayLike,
    weights: ArrayLike,
    at: ArrayLike | None = None,
) -> Floats:
    """Return sum_j E_j area_j sum_k w_k e^{-d^2 / 2 v_k} / (2 pi v_k), d the straight distance: (n,) or (n, c).

    points, areas  (n, 3), (n,) of a surface, as fine as the narrowest Gaussian [length, length^2]
    irradiance     (n,) or (n, c) [-];  variances, weights  v (N,) [length^2] and w (N,) or (N, c) [-]
    at             (m, 3) points that gather, in place of all of them

    Not renormalised: where the surface ends, or is bent, less or more than all of the light comes out. InputError.
    """
    where, area, light = _finite("points", points), _finite("areas", areas), _finite("irradiance", irradiance)
    variance, weight = _finite("variances", variances), _finite("weights", weights)
    if where.ndim != 2 or where.shape[1] != 3 or not len(where):
        raise InputError(f"points must have shape (n, 3), got {where.shape}")
    if area.shape != where.shape[:1] or not np.all(area >= 0):
        raise InputError(f"areas must be {len(where)} numbers >= 0, one a point, got shape {area.shape}")
    if light.shape[:1] != where.shape[:1] or light.ndim > 2:
        raise InputError(f"irradiance must be of shape ({len(where)},) or ({len(where)}, c), got {light.shape}")
    are_positive = variance.ndim == 1 and variance.size and np.all(variance > 0)
    require(are_positive, "variances", "a list of numbers > 0", variances)
    if weight.shape[:1] != variance.shape or weight.ndim > light.ndim:
        raise InputError(f"weights must be one for each of {variance.size} variances, got shape {weight.shape}")
    gathering = where if at is None else _finite("at", at)
    centre = where.mean(axis=0)  # differences of large numbers would lose the near pairs
    own, others = gathering - centre, where - centre
    square, powers = np.sum(others**2, axis=1), light * area.reshape(-1, *[1] * (light.ndim - 1))
    found = np.zeros((len(own), *light.shape[1:]))
    order = cKDTree(own, leafsize=NEIGHBOURS).indices  # leaf by leaf: neighbours in space
    tree = cKDTree(others, balanced_tree=False, compact_nodes=False)
    for start in range(0, len(own), NEIGHBOURS):
        part = order[start : start + NEIGHBOURS]
        here = own[part]
        middle = 0.5 * (here.min(axis=0) + here.max(axis=0))
        radius = float(np.linalg.norm(here - middle, axis=1).max())
        for v, w in zip(variance, weight, strict=True):
            near = tree.query_ball_point(middle, radius + np.sqrt(2.0 * NOTHING * v))
            apart = np.sum(here**2, axis=1)[:, None] + square[near] - 2.0 * here @ others[near].T
            found[part] += w / (2.0 * np.pi * v) * (np.exp(-np.maximum(apart, 0.0) / (2.0 * v)) @ powers[near])
    return found


def summed(elements: Elements, variances: ArrayLike, weights: ArrayLike, at: ArrayLike, own: ArrayLike) -> Floats:
    """Return `surface_blur` at points (m, 3) for Gaussians of any width: (m, c).

    own  (m, c) irradiance of those points, which is what Gaussians narrower than the elements leave there
    """
    found = np.zeros(np.shape(own))
    sums = gaussian_sums(elements, np.asarray(at, float), np.asarray(own, float), np.sqrt(variances), MERGED)
    for weight, light in zip(np.asarray(weights, float), sums, strict=True):
        found += weight * light[:, 1:]
    return found


def sphere_blur(radius: float, cosine: ArrayLike, variances: ArrayLike, weights: ArrayLike) -> Floats:
    """Return `surface_blur` of a sphere under E = 1 + cosine, exactly, at points of these cosines to the light [-].

    A Gaussian of the chord has the integral 1 - e^{-2 kappa}, and shrinks the cosine by coth kappa - 1 / kappa.
    """
    kappa = radius**2 / np.asarray(variances, float)
    whole = -np.expm1(-2.0 * kappa)
    shrunk = np.where(kappa > 1e-3, 1.0 / np.tanh(kappa) - 1.0 / kappa, kappa / 3.0)
    terms = np.asarray(weights, float) * whole * (1.0 + np.asarray(cosine, float)[..., None] * shrunk)
    return np.sum(terms, axis=-1)


def _finite(name: str, value: ArrayLike) -> Floats:
    return checked_finite(name, checked_numbers(name, value, "numbers"))
