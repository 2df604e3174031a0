"""Exact total reflectance A of a semi-infinite medium and its inverse, and the colours that renderers map to albedos.

A is a function of alpha, n and g alone.

A renderer turns the colour that is typed into an albedo by a formula of its own: what to type is its inverse at alpha.
Four are closed forms of A alone; that of Wrenninge et al. has g as well.

alpha is the reduced albedo mu_s' / (mu_s' + mu_a). Exact light with g is known under a refracting surface only; where
n = 1 the isotropic medium of the same alpha stands for it (similarity relation), whose A is too large in dark media.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from mcml_sim import Setting, exact
from mcml_sim.exact.light import unreduced
from mcml_sim.media.arrays import Floats, checked_numbers, require_all
from profilefit.laws import published
from profilefit.laws.printed_maps import Chiang, VanDeHulst

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
    return np.asarray(exact.reflectance(np.asarray(alpha, float), setting), float)


def alpha_of(reflectance: ArrayLike, illumination: str, n: float = 1.0, g: float = 0.0) -> Floats:
    """Return the one reduced albedo alpha [-] with this total reflectance A [-], in [0, what enters]: 1 where n = 1.

    Inverts `reflectance_of` to 1e-12 for A <= 0.9995 (g = 0); beyond, the rounding of alpha moves A by up to 1e-8.
    """
    white = float(reflectance_of(1.0, illumination, n, g))
    values = checked("reflectance", reflectance, 0.0, white)

    def inverse(value: float) -> float:
        def excess(alpha: float) -> float:
            return float(reflectance_of(alpha, illumination, n, g)) - value

        if value in (0.0, white):
            return float(value > 0.0)
        if value < MIDDLE:
            return float(brentq(excess, 0.0, 1.0, xtol=1e-300, rtol=TIGHTEST))
        return 1.0 - float(brentq(lambda s: excess(1.0 - s * s), 0.0, 1.0, xtol=LEAST_ROOT, rtol=TIGHTEST)) ** 2

    return np.vectorize(inverse, otypes=[float])(values)


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
    require_all(name, numbers, (numbers >= low) & (numbers <= high), accepted)
    return numbers


_OF_HULST = published.constants("van_de_hulst_albedo")
# Maps of A alone, by name. Hyperion's has internal reflection at n = 1.4: B. Burley et al., The design and evolution of
# Disney's Hyperion renderer, ACM Transactions on Graphics 37(3), 2018; Unreal Engine PathTracingCore.ush. In
# appleseed's randomwalkbssrdf.cpp two digits of q0 = 9.59217 are transposed.
MAPS: dict[str, VanDeHulst | Chiang] = {
    "van de Hulst": VanDeHulst(Setting("diffuse"), **_OF_HULST),
    "Chiang": Chiang(Setting("diffuse"), **published.constants("chiang_albedo")),
    "Hyperion": Chiang(Setting("diffuse", n=1.4), -11.43, 15.38, -13.91),
    "appleseed": VanDeHulst(Setting("diffuse"), **{**_OF_HULST, "q0": 9.59271}),
}
# M. Wrenninge, R. Villemin and C. Hery, Path traced subsurface scattering using anisotropic phase functions and
# non-exponential free flights, Pixar Technical Memo 17-07, 2017, as in blender/cycles subsurface_random_walk.h
# (Apache-2.0). Polynomials in g from its power 0: A, exponent of B, C, D, exponent of E, F, where B and E are
# c + e exp(exponent), by these pairs.
WRENNINGE_B, WRENNINGE_E = (4.98511194385, 0.127355959438), (4.23190299701, 0.00310603949088)
WRENNINGE = np.array(
    (
        (1.8260523782, -1.28451056436, -1.79904629312, 9.19393289202),
        (-22.8215585862, 32.0234874259, -23.6264803333, 7.21067002658),
        (0.0, 31.1491581433, -201.847017512, 841.576016723),
        (-2018.09288505, 2731.71560286, -1935.41424244, 559.009054474),
        (1.09686102424, -0.394704063468, 1.05258115941, -8.83963712726),
        (28.8643230661, -46.8802913581, 38.5402837518, -12.7181042538),
        (0.496310210422, 0.360146581622, -2.15139309747, 17.8896899217),
        (-55.2984010333, 82.065982243, -58.5106008578, 15.8478295021),
        (0.0, 76.7316253952, -594.356773233, 2448.8834203),
        (-5576.68528998, 7116.60171912, -4763.54467887, 1303.5318055),
        (2.40602999408, -2.51814844609, 9.18494908356, -79.2191708682),
        (259.082868209, -403.613804597, 302.85712436, -87.4370473567),
    )
).reshape(6, 8)


def mapped_colour(name: str, alpha: Floats, n: float = 1.0, g: float = 0.0) -> Floats:
    """Return the colour [-] of one of `MAPS` at the reduced albedo [-], which by similarity holds whatever g.

    It is the same at any n. Chiang's is 1 from its last albedo, 0.9989, on.
    """
    return np.asarray(MAPS[name].reflectance(alpha))


def wrenninge_alpha(colour: float, g: float = 0.0) -> float:
    """Return the albedo mu_s / (mu_s + mu_a) [-], not reduced, of Wrenninge et al.'s fit; it may end above 1.

    (1 - b) A atan(B C)^Cc + b D atan(E C)^F at colour C, b = C^(1/4), for an index-matched medium and 0 <= g <= 0.9.
    """
    a, of_b, c, d, of_e, f = np.polynomial.polynomial.polyval(g, WRENNINGE.T)
    b, e = (first + second * np.exp(at) for (first, second), at in ((WRENNINGE_B, of_b), (WRENNINGE_E, of_e)))
    blend = colour**0.25
    return float((1.0 - blend) * (a * np.arctan(b * colour) ** c) + blend * (d * np.arctan(e * colour) ** f))


def wrenninge_colour(alpha: Floats, g: float = 0.0) -> Floats:
    """Return the colour [-] that Wrenninge et al. map to this reduced albedo; van de Hulst's where g < 0, as Cycles."""
    if g < 0.0:
        return mapped_colour("van de Hulst", alpha)

    def colour(albedo: float) -> float:
        if albedo <= 0.0 or wrenninge_alpha(1.0, g) <= albedo:
            return float(albedo > 0.0)
        return float(brentq(lambda c: wrenninge_alpha(c, g) - albedo, 0.0, 1.0, xtol=LEAST_ROOT, rtol=TIGHTEST))

    return np.vectorize(colour, otypes=[float])(unreduced(alpha, g))
