"""Where other laws leave the half space, by the limits that they lack; and what formats do to any law: too few bits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcml_sim import exact
from profilefit.laws.base import ProfileLaw
from profilefit.laws.better_dipole import BetterDipole
from profilefit.laws.burley import NormalizedDiffusion
from profilefit.laws.chiang import Chiang
from profilefit.laws.diffusion import DiffusionLaw
from profilefit.laws.dipole import Dipole
from profilefit.laws.gaussians import Gaussians
from profilefit.laws.quantile import Quantile
from profilefit.laws.van_de_hulst import VanDeHulst
from profilefit.studies.stability.cause import Cause, as_stated, unseen
from profilefit.studies.stability.cells import Cells, Mask, Verdict, red
from profilefit.studies.stability.layout import (
    ALPHA_OF,
    FLOAT32,
    FLOAT64,
    MODEL,
    PDF,
    PROFILE,
    REFLECTANCE_OF,
    STORED16,
    TEXT16,
    accepted,
)

Floats = NDArray[np.float64]
OTHER_RATE = 0.2  # relative: a law whose tail decays at a rate this far off is not the half space's
WHITE = 0.98  # alpha from which x^-3 precedes the exponential


def _nothing(cells: Cells) -> Mask:
    return np.zeros(cells.shape, bool)


def _alpha(cells: Cells) -> Floats:
    return cells.spread("α", 0.5)


def _other_decay(cells: Cells) -> Mask:
    """The slower exponential, q/3, is not the half space's kappa."""
    if not (isinstance(cells.law, NormalizedDiffusion) and cells.arithmetic == MODEL):
        return _nothing(cells)
    alpha = np.unique(_alpha(cells))
    rate, kappa = np.asarray(cells.law.falloff_rate(alpha)) / 3.0, np.asarray(exact.decay_rate(alpha))
    off = np.abs(rate - kappa) > OTHER_RATE * np.maximum(kappa, 1e-3)
    return np.isin(_alpha(cells), alpha[off]) & (unseen(cells) | as_stated(cells))


def _no_source(cells: Cells) -> Mask:
    """2 pi x R_d tends to 0 at the source, the half space's to alpha/2."""
    if cells.arithmetic != MODEL or not (isinstance(cells.law, ProfileLaw) and cells.law.is_finite_at_source):
        return _nothing(cells)
    if cells.along("r/l") is None:
        return (isinstance(cells.law, DiffusionLaw) | (cells.spread("ξ", 1.0) < 0.1)) & as_stated(cells)
    within = _narrowest(cells.law, _alpha(cells)) if isinstance(cells.law, Gaussians) else 5.0
    return (cells.spread("r/l", np.inf) <= within) & as_stated(cells)


def _narrowest(law: Gaussians, alpha: Floats) -> Floats:
    """Two standard deviations of the narrowest Gaussian [mfp]."""
    own = law.constants()
    s = np.sqrt(1.0 - alpha)
    return 2.0 * np.exp(0.5 * (own["v1"] + s * (own["f1"] + s * own["f2"])))


def _too_few(cells: Cells) -> Mask:
    return as_stated(cells) & isinstance(cells.law, Gaussians)


def _once_and_diffuse(cells: Cells) -> Mask:
    return as_stated(cells) & isinstance(cells.law, Dipole | BetterDipole)


def _near_white(cells: Cells) -> Mask:
    """Nearer to white than the record's albedos its map goes as t^3, and its slope no longer as R_d."""
    whole = isinstance(cells.law, Quantile) and cells.arithmetic == MODEL and cells.quantity == PROFILE
    return (_alpha(cells) > 0.995) & whole


def _short_of_one(cells: Cells) -> Mask:
    """alpha(1) < 1: albedos beyond it have no A below 1."""
    if not isinstance(cells.law, Chiang):
        return _nothing(cells)
    white = 1.0 - float(cells.law.alpha(1.0))
    if cells.quantity == ALPHA_OF:
        return cells.spread("A", 0.0) > 0.9
    return (1.0 - _alpha(cells) < 5.0 * white) & (cells.quantity == REFLECTANCE_OF)


def _passes_white(cells: Cells) -> Mask:
    """s = 0, so alpha = 1, before A = 1."""
    if not (isinstance(cells.law, VanDeHulst) and cells.quantity == ALPHA_OF):
        return _nothing(cells)
    law, a = cells.law, cells.spread("A", 0.0)
    return law.p0 + law.p1 * a - np.sqrt(law.q0 + a * (law.q1 + a * law.q2)) < 1e-4


def _source_less_image(cells: Cells) -> Mask:
    """1/d of the source less 1/d of its image is the rounding of either."""
    computed = isinstance(cells.law, BetterDipole) and cells.arithmetic in (FLOAT64, FLOAT32)
    if not computed or cells.quantity not in (PROFILE, PDF):
        return _nothing(cells)
    image = np.asarray(cells.law.image(np.array([0.5])))[0]
    left = (image**2 - 1.0) / (2.0 * np.maximum(cells.spread("r/l", 1.0), 1.0) ** 2)
    return left * cells.bound < 16.0 * float(np.finfo(cells.dtype).eps)


def _radius_by_halvings(cells: Cells) -> Mask:
    """Radii of a dipole come from a bracket 1e-11 to 1e17 mfp, halved."""
    return np.full(cells.shape, isinstance(cells.law, DiffusionLaw) and cells.quantity.startswith("∂sample"))


def _foreign(cells: Cells) -> Mask:
    return as_stated(cells) & (not cells.own)


MODELS = (
    Cause(
        "another decay rate",
        "both exponentials have the rate of one s(A), and q/3 is not kappa(alpha): near white R_d goes as r^-3 first",
        "hazard or quantile; up to alpha = 0.98 the law is what its record says",
        _other_decay,
    ),
    Cause(
        "no source",
        "2 pi r R_d tends to 0 at r = 0, the half space's to alpha/2: light scattered once is missing",
        "add light scattered once, or a law that diverges as 1/r: hazard, quantile, burley",
        _no_source,
    ),
    Cause(
        "too few Gaussians",
        "e^(-r^2 / 2v) has neither the source's 1/r nor the tail e^(-kappa r), and between N widths it oscillates",
        "more Gaussians, up to 8, or another law",
        _too_few,
    ),
    Cause(
        "diffusion",
        "a dipole is diffusion of one or more sources under a plane boundary condition: not right within some mfp",
        "hazard; of the kind beam diffusion is the nearest",
        _once_and_diffuse,
    ),
    Cause(
        "fitted as a map",
        "only radii were fitted: next to white the slope of the map, which is R_d, leaves the half space's far out",
        "hazard beyond alpha = 0.995, whose profile was fitted",
        _near_white,
    ),
    Cause(
        "alpha(1) < 1",
        "the printed polynomial ends at alpha(1) = 0.9989; every albedo beyond maps to A = 1",
        "the rational map, exact at both ends",
        _short_of_one,
    ),
    Cause(
        "s < 0 before A = 1",
        "with the printed digits s passes 0 just before A = 1, so that alpha = 1 - s^2 falls again, by 3e-11",
        "clamp s at 0; harmless",
        _passes_white,
    ),
    Cause(
        "source less image",
        "far out 1/d of the source less 1/d of its image is less than the rounding of either",
        "the shader source, which sorts the difference; or hazard",
        _source_less_image,
    ),
    Cause(
        "radius by halvings",
        "halvings of a bracket that ends at 1e17 mfp, where the derivative of the share by alpha is Inf - Inf",
        "by the implicit function: dr/dalpha = -(dcdf/dalpha) / pdf, both of which are finite",
        _radius_by_halvings,
        frozenset({Verdict.NOT_FINITE}),
    ),
    Cause(
        "stated error",
        "the formula is not the half space; at this albedo it is as far off as its record says, and no farther",
        "hazard or quantile, a few thousandths off",
        _foreign,
    ),
)


def _no_square(cells: Cells) -> Mask:
    """l^2, 1/l or R_d l^-2 is not a normal number, and with l = 1 the same cell is not red."""
    length = next((i for i, axis in enumerate(cells.axes) if axis.name == "l"), None)
    if length is None:
        return np.zeros(cells.shape, bool)
    unit = cells.codes.take([cells.axes[length].nearest(1.0)], axis=length)
    return ~accepted(cells.spread("l", 1.0), cells.dtype) & ~red(unit)


def _right_in_single(cells: Cells) -> Mask:
    """The same text at the same arguments is not red in single precision."""
    if cells.arithmetic != TEXT16 or cells.twin is None:
        return np.zeros(cells.shape, bool)
    return ~red(cells.twin)


def _alpha_in_half(cells: Cells) -> Mask:
    """sqrt(1 - alpha) changes by more than it may when alpha is kept in half."""
    if cells.arithmetic != STORED16 or cells.quantity != REFLECTANCE_OF:
        return np.zeros(cells.shape, bool)
    alpha = cells.spread("α", 0.5)
    kept = alpha.astype(np.float16).astype(float)
    return np.abs(np.sqrt(1.0 - np.minimum(kept, 1.0)) - np.sqrt(1.0 - alpha)) > 0.2 * cells.bound


def _misused(cells: Cells) -> Mask:
    """A shader cannot refuse an argument that the law in Python refuses by name."""
    return np.zeros(cells.shape, bool) if cells.refused is None else cells.refused


def _no_derivative(cells: Cells) -> Mask:
    """At an end: alpha = 1, r = 0 or infinite, xi = 0."""
    if not cells.quantity.startswith("∂"):
        return np.zeros(cells.shape, bool)
    x = cells.spread("r/l", 1.0)
    return (
        (cells.spread("α", 0.5) == 1.0)
        | (cells.spread("A", 0.5) == 1.0)
        | (x == 0)
        | np.isinf(x)
        | (cells.spread("ξ", 0.5) == 0)
    )


NUMBERS = frozenset({Verdict.NOT_FINITE, Verdict.NEGATIVE})
ERRORS = frozenset({Verdict.INACCURATE, Verdict.NOT_MONOTONE})
FORMAT = (
    Cause(
        "sources do not check",
        "a shader refuses nothing: an infinite alpha or l = 0 is Inf - Inf or 0/0",
        "check once a material: alpha in [0, 1], l > 0, r >= 0, as the law in Python does",
        _misused,
        frozenset({Verdict.NOT_FINITE}),
    ),
    Cause(
        "no derivative at an end",
        "A goes with sqrt(1 - alpha), whose slope is infinite at alpha = 1, and Inf times 0 is NaN; so at r or xi = 0",
        "differentiate inside, alpha < 1, or by sqrt(1 - alpha)",
        _no_derivative,
        frozenset({Verdict.NOT_FINITE}),
    ),
    Cause(
        "l^2 leaves the format",
        "R_d = f(r/l) / l^2: the square of l, or 1/l, is no normal number of the format",
        "another unit of length, l from 1e-12 to 1e12 in float32, 1e-100 to 1e100 in float64",
        _no_square,
    ),
    Cause(
        "alpha near 1 in half",
        "half has no number between 1 - 2^-11 and 1, and everything near white goes with sqrt(1 - alpha)",
        "keep A or sqrt(1 - alpha) in half",
        _alpha_in_half,
    ),
    Cause(
        "constants outside half",
        "1e-25, 1e8 and 1 - 2^-24, which keep the source finite, are 0, Inf and 1 in half; x^2, 1/x and 1/l^2 overflow",
        "compute in float32; keep only A, radii and results in half",
        _right_in_single,
        NUMBERS,
    ),
    Cause(
        "eleven bits",
        "differences such as 1 - e^-t and 1 - xi keep few of half's eleven bits: in float32 the same source is right",
        "compute in float32; keep only A, radii and results in half",
        _right_in_single,
        ERRORS,
    ),
)
