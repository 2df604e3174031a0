"""Exact total reflectance A of a semi-infinite medium, and its inverse: A is a function of alpha, n and g alone.

alpha is the reduced albedo mu_s' / (mu_s' + mu_a). Exact light with g is known under a refracting surface only; where
n = 1 the isotropic medium of the same alpha stands for it (similarity relation), whose A is too large in dark media.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from mcml_sim import Setting, exact
from mcml_sim.exact.light import unreduced
from mcml_sim.media.checks import checked_numbers
from profilefit.errors import InputError

Floats = NDArray[np.float64]
# Below this A the root is sought in alpha, above it in sqrt(1 - alpha): each is where A has a finite slope.
MIDDLE = 0.5
LEAST_ROOT = 1e-16  # of sqrt(1 - alpha): below 1e-8 alpha is 1 to the last bit, and A has steps
TIGHTEST = 4 * np.finfo(float).eps
LARGEST = np.finfo(float).max
SMALL = 1e-3  # angle below which t cot t is its series
NODES = 96  # of each Gauss-Legendre rule: 1e-12 of a reflectance by direction


def reflectance_of(alpha: ArrayLike, illumination: str, n: float = 1.0, g: float = 0.0) -> Floats:
    """Return the exact total reflectance A [-] under "searchlight" (a pencil beam) or "diffuse" illumination.

    alpha is the reduced albedo [-], n >= 1 the index of the medium over that outside, g the mean cosine of scattering.
    """
    setting = Setting(illumination, n, g)
    if n == 1.0:
        setting = Setting(illumination)  # by similarity
    return np.asarray(exact.reflectance(unreduced(np.asarray(alpha, float), setting.g), setting), float)


def alpha_of(reflectance: ArrayLike, illumination: str, n: float = 1.0, g: float = 0.0) -> Floats:
    """Return the one reduced albedo alpha [-] with this total reflectance A [-], in [0, what enters]: 1 where n = 1.

    Inverts `reflectance_of` to 1e-12 for A <= 0.9995 (g = 0); beyond, the rounding of alpha moves A by up to 1e-8.
    """
    white = float(reflectance_of(1.0, illumination, n, g))
    values = checked("reflectance", reflectance, 0.0, white)
    return np.vectorize(lambda value: _alpha(value, white, illumination, n, g), otypes=[float])(values)


def _alpha(reflectance: float, white: float, illumination: str, n: float, g: float) -> float:
    def excess(alpha: float) -> float:
        return float(reflectance_of(alpha, illumination, n, g)) - reflectance

    if reflectance in (0.0, white):
        return float(reflectance > 0.0)
    if reflectance < MIDDLE:
        return float(brentq(excess, 0.0, 1.0, xtol=1e-300, rtol=TIGHTEST))
    return 1.0 - float(brentq(lambda s: excess(1.0 - s * s), 0.0, 1.0, xtol=LEAST_ROOT, rtol=TIGHTEST)) ** 2


def reflectance_by_cosine(alpha: ArrayLike, cosine: ArrayLike) -> Floats:
    """Return A [-] for a beam that travels at this cosine to the normal inside an index-matched isotropic medium.

    1 - H(mu) sqrt(1 - alpha), with ln H = -mu/pi int_0^(pi/2) ln(1 - alpha t cot t) / (cos^2 t + mu^2 sin^2 t) dt
    (Chandrasekhar, Radiative Transfer, 1950, sec. 39). The last axis of `cosine` is kept behind those of alpha, which
    may be complex: orders of scattering are the coefficients of A in powers of alpha.
    """
    nodes, weights = _unit_rule()
    t = 0.5 * np.pi * nodes**3  # the logarithm is steep at 0
    dt = 1.5 * np.pi * nodes**2 * weights
    albedo, mu = np.asarray(alpha)[..., None, None], np.asarray(cosine, float)[..., None]
    defect = np.where(t < SMALL, t * t / 3.0, 1.0 - t / np.tan(t))  # 1 - t cot t
    logarithm = np.log((1.0 - albedo) + albedo * defect)
    exponent = -mu / np.pi * np.sum(dt * logarithm / (np.cos(t) ** 2 + (mu * np.sin(t)) ** 2), axis=-1, keepdims=True)
    return (1.0 - np.sqrt(1.0 - albedo) * np.exp(exponent))[..., 0]


def reflectance_rough(alpha: ArrayLike, index: float) -> Floats:
    """Return A [-] seen from the normal through a surface of roughness 1 that refracts and loses nothing.

    GGX normals seen from above are cosine-weighted about the surface's; none is reflected, in or out.
    """
    nodes, weights = _unit_rule()
    sine = np.sqrt(nodes)  # sin^2 is uniform
    cosine = np.cos(np.arcsin(sine) - np.arcsin(sine / index))
    return reflectance_by_cosine(alpha, cosine) @ weights


@lru_cache(maxsize=1)
def _unit_rule() -> tuple[Floats, Floats]:
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    return 0.5 * (nodes + 1.0), 0.5 * weights


def checked(name: str, values: ArrayLike, low: float, high: float) -> Floats:
    """Return the numbers as an array; InputError of one that is not in [low, high]."""
    accepted = f"in [{low:g}, {high:.9g}]" if high < LARGEST else f">= {low:g} and finite"
    numbers = checked_numbers(name, values, f"numbers {accepted}")
    outside = ~((numbers >= low) & (numbers <= high))
    if np.any(outside):
        raise InputError(f"{name} must be {accepted}, got {numbers[outside].flat[0]:g}")
    return numbers
