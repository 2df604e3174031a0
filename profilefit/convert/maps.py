"""Maps between a renderer's colour and the reduced albedo alpha, each with its inverse.

Renderers turn the colour that is typed into an albedo by a formula of their own: what to type is its inverse at alpha.
Four are closed forms of A alone; that of Wrenninge et al. has g as well.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from mcml_sim import Setting
from mcml_sim.exact.light import unreduced
from profilefit.convert.colour import LEAST_ROOT, TIGHTEST
from profilefit.laws import published
from profilefit.laws.printed_maps import Chiang, VanDeHulst

Floats = NDArray[np.float64]
VAN_DE_HULST = VanDeHulst(Setting("diffuse"), **published.constants("van_de_hulst_albedo"))
CHIANG = Chiang(Setting("diffuse"), **published.constants("chiang_albedo"))
# With internal reflection at n = 1.4: B. Burley et al., The design and evolution of Disney's Hyperion renderer, ACM
# Transactions on Graphics 37(3), 2018; Unreal Engine PathTracingCore.ush.
HYPERION = Chiang(Setting("diffuse", n=1.4), -11.43, 15.38, -13.91)
# appleseed, randomwalkbssrdf.cpp: two digits of q0 = 9.59217 are transposed.
APPLESEED = VanDeHulst(Setting("diffuse"), **{**published.constants("van_de_hulst_albedo"), "q0": 9.59271})

# M. Wrenninge, R. Villemin and C. Hery, Path traced subsurface scattering using anisotropic phase functions and
# non-exponential free flights, Pixar Technical Memo 17-07, 2017, as in blender/cycles subsurface_random_walk.h
# (Apache-2.0). Polynomials in g from its power 0; B and E are c + e exp(polynomial from the power 1).
WRENNINGE_A = (
    *(1.8260523782, -1.28451056436, -1.79904629312, 9.19393289202),
    *(-22.8215585862, 32.0234874259, -23.6264803333, 7.21067002658),
)
WRENNINGE_B = (4.98511194385, 0.127355959438)
WRENNINGE_B_EXPONENT = (
    *(0.0, 31.1491581433, -201.847017512, 841.576016723),
    *(-2018.09288505, 2731.71560286, -1935.41424244, 559.009054474),
)
WRENNINGE_C = (
    *(1.09686102424, -0.394704063468, 1.05258115941, -8.83963712726),
    *(28.8643230661, -46.8802913581, 38.5402837518, -12.7181042538),
)
WRENNINGE_D = (
    *(0.496310210422, 0.360146581622, -2.15139309747, 17.8896899217),
    *(-55.2984010333, 82.065982243, -58.5106008578, 15.8478295021),
)
WRENNINGE_E = (4.23190299701, 0.00310603949088)
WRENNINGE_E_EXPONENT = (
    *(0.0, 76.7316253952, -594.356773233, 2448.8834203),
    *(-5576.68528998, 7116.60171912, -4763.54467887, 1303.5318055),
)
WRENNINGE_F = (
    *(2.40602999408, -2.51814844609, 9.18494908356, -79.2191708682),
    *(259.082868209, -403.613804597, 302.85712436, -87.4370473567),
)


def wrenninge_alpha(colour: float, g: float = 0.0) -> float:
    """Return the albedo mu_s / (mu_s + mu_a) [-], not reduced, of Wrenninge et al.'s fit; it may end above 1.

    (1 - b) A atan(B C)^Cc + b D atan(E C)^F at colour C, b = C^(1/4), for an index-matched medium and 0 <= g <= 0.9.
    """
    at = partial(np.polynomial.polynomial.polyval, g)
    b = WRENNINGE_B[0] + WRENNINGE_B[1] * np.exp(at(WRENNINGE_B_EXPONENT))
    e = WRENNINGE_E[0] + WRENNINGE_E[1] * np.exp(at(WRENNINGE_E_EXPONENT))
    blend = colour**0.25
    dark = at(WRENNINGE_A) * np.arctan(b * colour) ** at(WRENNINGE_C)
    bright = at(WRENNINGE_D) * np.arctan(e * colour) ** at(WRENNINGE_F)
    return float((1.0 - blend) * dark + blend * bright)


def wrenninge_colour(alpha: Floats, g: float = 0.0) -> Floats:
    """Return the colour [-] that Wrenninge et al. map to this reduced albedo; van de Hulst's where g < 0, as Cycles."""
    if g < 0.0:
        return van_de_hulst_colour(alpha)

    def colour(albedo: float) -> float:
        if albedo <= 0.0 or wrenninge_alpha(1.0, g) <= albedo:
            return float(albedo > 0.0)
        return float(brentq(lambda c: wrenninge_alpha(c, g) - albedo, 0.0, 1.0, xtol=LEAST_ROOT, rtol=TIGHTEST))

    return np.vectorize(colour, otypes=[float])(unreduced(alpha, g))


def van_de_hulst_colour(alpha: Floats) -> Floats:
    """Return the colour [-] of van de Hulst's map; its similarity makes it one of the reduced albedo, whatever g."""
    return np.asarray(VAN_DE_HULST.reflectance(alpha))


def chiang_colour(alpha: Floats) -> Floats:
    """Return the colour [-] of Chiang et al.'s map; 1 from its last albedo, 0.9989, on."""
    return np.asarray(CHIANG.reflectance(alpha))


def hyperion_colour(alpha: Floats) -> Floats:
    """Return the colour [-] of the map with internal reflection at n = 1.4."""
    return np.asarray(HYPERION.reflectance(alpha))


def appleseed_colour(alpha: Floats) -> Floats:
    """Return the colour [-] of van de Hulst's map with appleseed's transposed digits."""
    return np.asarray(APPLESEED.reflectance(alpha))
