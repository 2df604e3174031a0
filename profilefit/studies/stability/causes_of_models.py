"""Where other laws leave the half space, by the limits that they lack."""

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
from profilefit.studies.stability.cells import Cells, Mask, Verdict
from profilefit.studies.stability.layout import ALPHA_OF, FLOAT32, FLOAT64, MODEL, PDF, PROFILE, REFLECTANCE_OF

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
        "e^(-r^2 / 2v) has neither the source's 1/r nor the tail e^(-kappa r), and between N widths it waves",
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
        "the shader text, which sorts the difference; or hazard",
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
