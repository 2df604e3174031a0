"""Lengths of a medium: each is its transport mean free path l times a function of alpha and g alone.

Three different lengths are called the diffuse mean free path:

    dmfp_classical  1 / sqrt(3 mu_a mu_t') = l / sqrt(3 (1 - alpha)): Jensen et al. 2001, with D = 1 / (3 mu_t').
    dmfp            sqrt(D / mu_a) = l sqrt((2 - alpha) / (3 (1 - alpha))), Grosjean's D: d'Eon and Irving 2011.
    decay_length    l / kappa(alpha), alpha artanh(kappa) / kappa = 1: how the exact profile falls off.

Christensen and Burley (Pixar Technical Memo 15-04, 2015) print no formula for theirs. Their own scales imply
l_d / l = s_dmfp(A) / s_searchlight(A), from which Grosjean's differs by 4 % on average over A in [0.02, 0.95], the
exact one by 7 % and the classical one by 10 %: theirs is taken to be `dmfp`. appleseed has two of them in one file
(appleseedhq/appleseed, renderer/modeling/bssrdf/sss.cpp: diffuse_mean_free_path is Grosjean's,
reduced_extinction_coefficient inverts the classical one). Cycles' skin radius is a classical one. Unreal mentions
Grosjean's in a comment and uses the memo's scales instead.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from mcml_sim import exact
from mcml_sim.media.arrays import Floats
from profilefit.convert.colour import reflectance_of
from profilefit.laws import published

Factor = Callable[[Floats, float], Floats]  # of reduced albedo and g


# Printed constants and power of the memo's s, by illumination: eq. (5) for a normal pencil beam, 5.5 % mean error
# reported, and eq. (6), 3.9 %.
SCALES = {"searchlight": ("published", 3), "diffuse": ("diffuse", 2)}


def scale(illumination: str, reflectance: ArrayLike) -> Floats:
    """Return s = l / d for A under an illumination [-]."""
    printed, power = SCALES[illumination]
    a, s = np.asarray(reflectance, float), published.constants("burley", printed)
    return s["s0"] - s["s1"] * a + s["s2"] * np.abs(a - s["s3"]) ** power


def scale_dmfp(reflectance: ArrayLike) -> Floats:
    """Return s = l_d / d for A under a normal pencil beam [-]: the memo's eq. (8), 7.7 %."""
    a, s = np.asarray(reflectance, float), published.constants("burley_diffuse_mfp")
    return s["s0"] + s["s1"] * (a - s["s2"]) ** 4


def transport(alpha: Floats, g: float = 0.0) -> Floats:
    """Return 1, the transport mean free path over itself."""
    return np.ones_like(alpha)


def unreduced_path(alpha: Floats, g: float = 0.0) -> Floats:
    """Return (mu_s' + mu_a) / (mu_s + mu_a) [-]."""
    return (1.0 - g) * stretch(alpha, g)


def stretch(alpha: Floats, g: float) -> Floats:
    """Return (mu_s' + mu_a) / ((1 - g) (mu_s + mu_a)) [-]."""
    return 1.0 / (1.0 - g * (1.0 - alpha))


def classical(alpha: Floats, g: float = 0.0) -> Floats:
    """Return 1 / sqrt(3 (1 - alpha)) [-]."""
    with np.errstate(divide="ignore"):
        return 1.0 / np.sqrt(3.0 * (1.0 - alpha))


def grosjean(alpha: Floats, g: float = 0.0) -> Floats:
    """Return sqrt((2 - alpha) / (3 (1 - alpha))) [-]."""
    return np.sqrt(2.0 - alpha) * classical(alpha, g)


def decay(alpha: Floats, g: float = 0.0) -> Floats:
    """Return 1 / kappa(alpha) [-], of isotropic scattering."""
    with np.errstate(divide="ignore"):
        return 1.0 / np.asarray(exact.decay_rate(alpha), float)


def falloff(illumination: str, alpha: Floats, g: float = 0.0) -> Floats:
    """Return 1 / s(A) [-], A under an illumination."""
    return 1.0 / scale(illumination, reflectance_of(alpha, illumination))


def falloff_dmfp(alpha: Floats, g: float = 0.0) -> Floats:
    """Return l_d / (l s_dmfp(A)) [-], l_d Grosjean's."""
    return grosjean(alpha, g) / scale_dmfp(reflectance_of(alpha, "searchlight"))


@dataclass(frozen=True)
class Length:
    """A length that stands for a medium: its transport mean free path times `factor(alpha, g)` [-].

    colour   illumination of the A that it depends on: "searchlight", "diffuse" or "" for none
    formula  how it follows from l, the transport mean free path
    """

    name: str
    factor: Factor
    title: str = ""
    colour: str = ""
    formula: str = ""


QUANTITIES = (
    Length("mfp", transport, "transport mean free path l", "", "1 / (mu_s' + mu_a)"),
    Length("mfp_unreduced", unreduced_path, "mean free path, unreduced", "", "1 / (mu_s + mu_a)"),
    Length("dmfp", grosjean, "diffuse mean free path", "", "Grosjean's"),
    Length("dmfp_classical", classical, "  classical", "", "1 / sqrt(3 mu_a (mu_a + mu_s'))"),
    Length("decay_length", decay, "  exact, of g = 0", "", "far away R_d ~ exp(-r / it)"),
    Length("falloff_searchlight", partial(falloff, "searchlight"), "falloff d", "searchlight", "l / s(A)"),
    Length("falloff_diffuse", partial(falloff, "diffuse"), "falloff d", "diffuse", "l / s(A)"),
    Length("falloff_dmfp", falloff_dmfp, "falloff d of l_d", "searchlight", "l_d / s(A), l_d Grosjean's"),
)
