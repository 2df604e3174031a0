"""One medium in everybody's units: mean free paths, falloff lengths, coefficients, and the "radius" of each engine.

The hub is `Optical(alpha, mfp)`, an isotropic medium under an index-matched surface; a colour under a surface that
refracts has the alpha that `alpha_of` finds. A colour is a function of alpha (and n) alone, and every length is the
transport mean free path times a function of alpha alone, so each converts to and from the hub.

Three different lengths are called the diffuse mean free path (l the mean free path):

    dmfp_classical  1 / sqrt(3 mu_a mu_t') = l / sqrt(3 (1 - alpha)): Jensen et al. 2001, with D = 1 / (3 mu_t').
    dmfp            sqrt(D / mu_a) = l sqrt((2 - alpha) / (3 (1 - alpha))), Grosjean's D: d'Eon and Irving 2011.
    decay_length    l / kappa(alpha), alpha artanh(kappa) / kappa = 1: how the exact profile falls off.

Christensen and Burley (Pixar Technical Memo 15-04, 2015) print no formula for theirs. Their own scales imply
l_d / l = s_dmfp(A) / s_searchlight(A), from which Grosjean's differs by 4 % on average over A in [0.02, 0.95], the
exact one by 7 % and the classical one by 10 %: theirs is taken to be `dmfp`. appleseed has two of them in one file
(appleseedhq/appleseed, renderer/modeling/bssrdf/sss.cpp: diffuse_mean_free_path is Grosjean's,
reduced_extinction_coefficient inverts the classical one). Cycles' skin radius is a classical one. Unreal mentions
Grosjean's in a comment and uses the memo's scales instead.

An engine's "radius" is here the number to type in, its scale at 1, so that its profile is the one that its own
parametrisation has for this medium. Each takes an A for colour, and which one is stated:

    Cycles  radius / 4 pi is l, for random walk as it stands, for Christensen-Burley divided by the diffuse s. The skin
            radius is multiplied by sqrt(3 (1 - alpha')), alpha' from A by the standard dipole.
    HDRP    the scattering distance is d; its path tracer walks with l = d s(A), s the diffuse one.
    Unreal  typed is a mean free path since 5.1, before a diffuse one. It draws d = dmfp / s_dmfp(A), dmfp being
            mfp s_dmfp(A) / (0.6 s_searchlight(A)): an l of 1 is typed as 0.6. World unit scales are not included.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from mcml_sim import Setting, exact
from mcml_sim.media.checks import checked_numbers
from profilefit.errors import InputError
from profilefit.laws import published

Floats = NDArray[np.float64]
# Below this A the root is sought in alpha, above it in sqrt(1 - alpha): each is where A has a finite slope.
MIDDLE = 0.5
LEAST_ROOT = 1e-16  # of sqrt(1 - alpha): below 1e-8 alpha is 1 to the last bit, and A has steps
TIGHTEST = 4 * np.finfo(float).eps
LARGEST = np.finfo(float).max

# blender/cycles, src/kernel/closure/bssrdf.h: bssrdf_setup_radius, bssrdf_dipole_compute_alpha_prime; the default index
# of refraction from src/kernel/svm/closure.h, CLOSURE_BSSRDF_RANDOM_WALK_SKIN_ID.
CYCLES_SHRINK = 0.25 / np.pi
CYCLES_SKIN_INDEX = 1.4
CYCLES_HALVINGS = 12
CYCLES_DARKEST, CYCLES_BRIGHTEST, CYCLES_HIGHEST = 1e-4, 0.995, 0.999999
# Unity-Technologies/Graphics, .../Runtime/Material/DiffusionProfile/DiffusionProfileSettings.cs: UpdateKernel.
HDRP_SHARE = 0.997
# r/d within which normalized diffusion has that share of its light.
HDRP_REACH = float(brentq(lambda t: 0.25 * np.exp(-t) + 0.75 * np.exp(-t / 3.0) - (1.0 - HDRP_SHARE), 0.0, 100.0))
# EpicGames/UnrealEngine, Engine/Source/Runtime/Engine/Private/Rendering/SubsurfaceProfile.cpp: Dmfp2MfpMagicNumber.
UNREAL_MAGIC = 0.6


def reflectance_of(alpha: ArrayLike, illumination: str, n: float = 1.0) -> Floats:
    """Exact total reflectance A [-] of a half space of index n >= 1 under "searchlight" or "diffuse" light."""
    return np.asarray(exact.reflectance(alpha, Setting(illumination, n)), float)


def alpha_of(reflectance: ArrayLike, illumination: str, n: float = 1.0) -> Floats:
    """The one single-scattering albedo with this A, which rises with alpha from 0 to what enters: 1 where n = 1.

    Inverts `reflectance_of` to 1e-12 for A <= 0.9995; beyond, the rounding of alpha itself moves A by up to 1e-8.
    Lengths of other parametrisations belong to n = 1, whatever index alpha comes from.
    """
    setting = Setting(illumination, n)
    values = _checked("reflectance", reflectance, 0.0, float(exact.reflectance(1.0, setting)))
    return np.vectorize(lambda value: _alpha(value, setting), otypes=[float])(values)


def _alpha(reflectance: float, setting: Setting) -> float:
    if reflectance in (0.0, float(exact.reflectance(1.0, setting))):
        return float(reflectance > 0.0)
    options = {"xtol": 1e-300, "rtol": TIGHTEST}
    if reflectance < MIDDLE:
        return float(brentq(lambda alpha: exact.reflectance(alpha, setting) - reflectance, 0.0, 1.0, **options))
    options["xtol"] = LEAST_ROOT
    s = brentq(lambda s: exact.reflectance(1.0 - s * s, setting) - reflectance, 0.0, 1.0, **options)
    return 1.0 - float(s) ** 2


def scale_searchlight(reflectance: ArrayLike) -> Floats:
    """s = l / d for A under a normal pencil beam [-]: the memo's eq. (5), 5.5 % mean error reported."""
    return _scale("published", 3, reflectance)


def scale_diffuse(reflectance: ArrayLike) -> Floats:
    """s = l / d for A under diffuse light [-]: the memo's eq. (6), 3.9 %."""
    return _scale("diffuse", 2, reflectance)


def _scale(printed: str, power: int, reflectance: ArrayLike) -> Floats:
    a, s = np.asarray(reflectance, float), published.constants("burley", printed)
    return s["s0"] - s["s1"] * a + s["s2"] * np.abs(a - s["s3"]) ** power


def scale_dmfp(reflectance: ArrayLike) -> Floats:
    """s = l_d / d for A under a normal pencil beam [-]: the memo's eq. (8), 7.7 %."""
    a, s = np.asarray(reflectance, float), published.constants("burley_diffuse_mfp")
    return s["s0"] + s["s1"] * (a - s["s2"]) ** 4


def _classical(alpha: Floats) -> Floats:
    with np.errstate(divide="ignore"):
        return 1.0 / np.sqrt(3.0 * (1.0 - alpha))


def _grosjean(alpha: Floats) -> Floats:
    return np.sqrt(2.0 - alpha) * _classical(alpha)


def _decay(alpha: Floats) -> Floats:
    with np.errstate(divide="ignore"):
        return 1.0 / np.asarray(exact.decay_rate(alpha), float)


def _falloff_searchlight(alpha: Floats) -> Floats:
    return 1.0 / scale_searchlight(reflectance_of(alpha, "searchlight"))


def _falloff_diffuse(alpha: Floats) -> Floats:
    return 1.0 / scale_diffuse(reflectance_of(alpha, "diffuse"))


def _falloff_dmfp(alpha: Floats) -> Floats:
    return _grosjean(alpha) / scale_dmfp(reflectance_of(alpha, "searchlight"))


def _unreal_dmfp(alpha: Floats) -> Floats:
    return scale_dmfp(reflectance_of(alpha, "searchlight")) * _falloff_searchlight(alpha)


def _cycles_skin(alpha: Floats) -> Floats:
    return _classical(cycles_skin_alpha(reflectance_of(alpha, "diffuse")))


def cycles_skin_alpha(reflectance: ArrayLike, index: float = CYCLES_SKIN_INDEX) -> Floats:
    """The alpha' that Cycles takes a skin's colour A for [-], as coarse as its twelve halvings make it.

    They solve A = alpha'/2 (1 + e^(-4/3 K s)) e^-s, s = sqrt(3 (1 - alpha')): the dipole, Jensen and Buhler 2002.
    """
    a = np.asarray(reflectance, float)
    low, high = np.zeros_like(a), np.ones_like(a)
    for _ in range(CYCLES_HALVINGS):
        middle = 0.5 * (low + high)
        dark = dipole_reflectance(middle, index) < a
        low, high = np.where(dark, middle, low), np.where(dark, high, middle)
    return np.where(a < CYCLES_DARKEST, 0.0, np.where(a >= CYCLES_BRIGHTEST, CYCLES_HIGHEST, middle))


def dipole_reflectance(alpha: ArrayLike, index: float) -> Floats:
    """Total reflectance of the standard dipole at reduced albedo alpha' [-] and relative index of refraction [-]."""
    values = np.asarray(alpha, float)
    fresnel = -1.440 / index**2 + 0.710 / index + 0.668 + 0.0636 * index
    s = np.sqrt(3.0 * (1.0 - values))
    return 0.5 * values * (1.0 + np.exp(-4.0 / 3.0 * (1.0 + fresnel) / (1.0 - fresnel) * s)) * np.exp(-s)


@dataclass(frozen=True)
class Length:
    """A length that stands for a medium: its transport mean free path times `factor(alpha)` [-].

    colour   the A that an engine or a parametrisation pairs it with: "searchlight", "diffuse" or "" for none
    formula  how it follows from l, the transport mean free path
    source   what defines it
    """

    name: str
    title: str
    colour: str
    formula: str
    source: str
    factor: Callable[[Floats], Floats]


def _times(number: float) -> Callable[[Floats], Floats]:
    return lambda alpha: np.full_like(alpha, number)


def _hdrp_radius(alpha: Floats) -> Floats:
    return HDRP_REACH * _falloff_diffuse(alpha)


MEMO = "Christensen and Burley, Pixar Technical Memo 15-04"
CYCLES = "blender/cycles src/kernel/closure/bssrdf.h, subsurface_random_walk.h"
HDRP = "Unity-Technologies/Graphics DiffusionProfileSettings.cs, PathTracingBSDF.hlsl"
UNREAL = "Unreal Engine SubsurfaceProfile.cpp, BurleyNormalizedSSSCommon.ush"
LENGTHS = (
    Length("mfp", "transport mean free path l", "", "1 / (mu_s' + mu_a)", "", _times(1.0)),
    Length("dmfp", "diffuse mean free path", "", "Grosjean's", "d'Eon and Irving 2011", _grosjean),
    Length("dmfp_classical", "  classical", "", "1 / sqrt(3 mu_a (mu_a + mu_s'))", "Jensen et al. 2001", _classical),
    Length("decay_length", "  exact", "", "far away R_d ~ exp(-r / it)", "", _decay),
    Length("falloff_searchlight", "falloff d", "searchlight", "l / s(A)", MEMO, _falloff_searchlight),
    Length("falloff_diffuse", "falloff d", "diffuse", "l / s(A)", MEMO, _falloff_diffuse),
    Length("falloff_dmfp", "falloff d of l_d", "searchlight", "l_d / s(A), l_d Grosjean's", MEMO, _falloff_dmfp),
    Length("cycles_radius", "Cycles radius x scale", "diffuse", "4 pi l", CYCLES, _times(1.0 / CYCLES_SHRINK)),
    Length(
        "cycles_skin_radius", "  random walk (skin)", "diffuse", "l / sqrt(3 (1 - alpha'(A)))", CYCLES, _cycles_skin
    ),
    Length("hdrp_distance", "HDRP scattering distance", "diffuse", "d (its field: mm)", HDRP, _falloff_diffuse),
    Length("hdrp_radius", "  filter radius", "diffuse", "99.7 % of the light (mm)", HDRP, _hdrp_radius),
    Length("unreal_mfp", "Unreal mean free path", "searchlight", "0.6 s(A) d (cm)", UNREAL, _times(UNREAL_MAGIC)),
    Length("unreal_dmfp", "  before 5.1", "searchlight", "s_dmfp(A) d (cm)", UNREAL, _unreal_dmfp),
)
BY_NAME = {length.name: length for length in LENGTHS}


@dataclass(frozen=True, eq=False)
class Optical:
    """A medium: alpha its (reduced) single-scattering albedo [-] in [0, 1], mfp = 1 / (mu_s' + mu_a) [length] > 0.

    Both are arrays of one shape, a channel an element; numbers and lists broadcast. Raises InputError.
    """

    alpha: Floats
    mfp: Floats

    def __post_init__(self) -> None:
        alpha, mfp = _checked("alpha", self.alpha, 0.0, 1.0), _checked_length("mfp", self.mfp)
        alpha, mfp = _broadcast({"alpha": alpha, "mfp": mfp})
        object.__setattr__(self, "alpha", alpha)
        object.__setattr__(self, "mfp", mfp)

    @classmethod
    def from_length(cls, name: str, value: ArrayLike, alpha: ArrayLike) -> Optical:
        """The medium of this albedo whose length `name`, one of `BY_NAME`, has this value [length]."""
        if name not in BY_NAME:
            raise InputError(f"length must be one of {', '.join(BY_NAME)}, got {name!r}")
        albedo, length = _checked("alpha", alpha, 0.0, 1.0), _checked_length(name, value)
        albedo, length = _broadcast({"alpha": albedo, name: length})
        factor = BY_NAME[name].factor(albedo)
        if not np.all(np.isfinite(factor)):
            raise InputError(f"{name} must be another length at alpha = 1: it is infinite where nothing is absorbed")
        return cls(albedo, length / factor)

    @classmethod
    def from_coefficients(cls, mu_a: ArrayLike, mu_s: ArrayLike) -> Optical:
        """The medium with these absorption and reduced scattering coefficients [1/length], >= 0 and not both 0."""
        absorption, scattering = _checked("mu_a", mu_a, 0.0, LARGEST), _checked("mu_s", mu_s, 0.0, LARGEST)
        absorption, scattering = _broadcast({"mu_a": absorption, "mu_s": scattering})
        both = absorption + scattering
        if not np.all(both > 0):
            raise InputError("mu_a + mu_s must be > 0: there is no medium, got 0")
        return cls(scattering / both, 1.0 / both)

    @property
    def mu_a(self) -> Floats:
        """Absorption coefficient [1/length]."""
        return (1.0 - self.alpha) / self.mfp

    @property
    def mu_s(self) -> Floats:
        """Reduced scattering coefficient mu_s' = mu_s (1 - g) [1/length]."""
        return self.alpha / self.mfp

    def reflectance(self, illumination: str, n: float = 1.0) -> Floats:
        """Total reflectance A [-] under "searchlight" or "diffuse" light, of index n >= 1."""
        return reflectance_of(self.alpha, illumination, n)

    def length(self, name: str) -> Floats:
        """The length `name`, one of `BY_NAME` [length]; infinite where the medium has none."""
        if name not in BY_NAME:
            raise InputError(f"length must be one of {', '.join(BY_NAME)}, got {name!r}")
        return self.mfp * BY_NAME[name].factor(self.alpha)


def _checked(name: str, values: ArrayLike, low: float, high: float) -> Floats:
    accepted = f"in [{low:g}, {high:.9g}]" if high < LARGEST else f">= {low:g} and finite"
    numbers = checked_numbers(name, values, f"numbers {accepted}")
    outside = ~((numbers >= low) & (numbers <= high))
    if np.any(outside):
        raise InputError(f"{name} must be {accepted}, got {numbers[outside].flat[0]:g}")
    return numbers


def _checked_length(name: str, values: ArrayLike) -> Floats:
    numbers = _checked(name, values, 0.0, LARGEST)
    if np.any(numbers == 0.0):
        raise InputError(f"{name} must be > 0 and finite, got 0")
    return numbers


def _broadcast(named: dict[str, Floats]) -> list[Floats]:
    try:
        return [np.array(one) for one in np.broadcast_arrays(*named.values())]
    except ValueError:
        shapes = " and ".join(str(one.size) for one in named.values())
        raise InputError(f"{' and '.join(named)} must have one value or equally many, got {shapes}") from None
