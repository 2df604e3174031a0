"""What fails in the laws of Liang et al., by the numbers of their own formulas; equation numbers are the paper's."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import equinox as eqx
import numpy as np
from numpy.typing import NDArray

from profilefit.laws.liang import Liang
from profilefit.laws.liang_albedo import LiangAlbedo
from profilefit.studies.stability.cause import Cause, as_stated, near_stated, unseen
from profilefit.studies.stability.cells import Cells, Mask, Verdict, absolute, relative
from profilefit.studies.stability.layout import ALPHA_OF, CDF, MODEL, PDF, PROFILE, REFLECTANCE_OF, SAMPLE
from profilefit.studies.stability.model_cells import ENERGY, INVERSE

Floats = NDArray[np.float64]
PRINTED_B0, MENDED_B0 = 0.461, 0.0641
TURNS = np.linspace(0.0, 1.0, 2001)  # xi at which a turn is looked for
NEAR_WHITE = 0.9  # of A: (8) is right to 0.005 in alpha up to 0.75, and sqrt(1 - alpha) is what counts beyond


def of_liang(condition: Callable[[Cells], Mask]) -> Callable[[Cells], Mask]:
    """A condition on cells of these laws alone."""
    return lambda cells: condition(cells) if isinstance(cells.law, Liang) else np.zeros(cells.shape, bool)


def of_map(condition: Callable[[Cells], Mask]) -> Callable[[Cells], Mask]:
    """A condition on cells of the map (8) alone."""
    return lambda cells: condition(cells) if isinstance(cells.law, LiangAlbedo) else np.zeros(cells.shape, bool)


def _albedos(cells: Cells) -> Floats:
    return cells.spread("α", 0.5)


def _no_reach(cells: Cells) -> Mask:
    """r_max = -b/a is no positive number in the format at hand."""
    law = cells.law
    alpha: NDArray[Any] = _albedos(cells).astype(cells.dtype)
    a = law.a1 * alpha + law.a2 * cells.dtype(0.1) ** (-law.a3 * (alpha - 1.0))
    k = (law.b1 * (alpha - law.b2) ** 2 + law.b3) * alpha + law.b4
    reach = -(law.b0 * alpha**k) / a
    small = float(np.finfo(cells.dtype).tiny)
    return ~(np.isfinite(reach) & (reach > small))


def _largest(cells: Cells) -> Floats:
    law, alpha = cells.law, np.maximum(_albedos(cells), 1e-6)
    a = law.a1 * alpha + law.a2 * 0.1 ** (-law.a3 * (alpha - 1.0))
    k = (law.b1 * (alpha - law.b2) ** 2 + law.b3) * alpha + law.b4
    found: Floats = -law.b0 * alpha**k / a
    return found


def _levers(cells: Cells) -> tuple[Floats, Floats]:
    """k1 and k2 of (20)."""
    law, alpha = cells.law, np.maximum(_albedos(cells), 1e-300)
    k1 = law.g1 * alpha ** (law.g2 * alpha**law.g3 + law.g4)
    return k1, law.h1 * alpha ** (law.h2 * alpha + law.h3)


def _opposite(cells: Cells) -> Mask:
    """ln(1 + eps - xi) > 0, so that g < 0, and |g| has a hill below xi = eps."""
    return (cells.spread("ξ", 0.5) <= cells.law.eps) & (cells.quantity in (INVERSE, SAMPLE))


def _turns_back(cells: Cells) -> Mask:
    """k1 xi nears k2 below xi = 1, and xi lies beyond the first fall of |g|."""
    k1, k2 = _levers(cells)
    if cells.quantity == PDF:
        return k1 > 0.95 * k2
    if cells.quantity not in (INVERSE, SAMPLE):
        return np.zeros(cells.shape, bool)
    first = (slice(None), *[slice(0, 1)] * (len(cells.axes) - 1))  # an albedo has one turn
    with np.errstate(invalid="ignore"):
        g = (k2[first][..., None] - k1[first][..., None] * TURNS) * np.sqrt(TURNS) * np.log1p(cells.law.eps - TURNS)
        falls = (np.diff(np.abs(g), axis=-1) < 0) & (TURNS[1:] > float(cells.law.eps) + TURNS[1])
    turn: Floats = np.where(np.any(falls, axis=-1), TURNS[np.argmax(falls, axis=-1)], np.inf)
    return cells.spread("ξ", 0.5) >= turn - TURNS[1]


def _branch_ends(cells: Cells) -> Mask:
    """Below the hill of |g| two more xi draw the same radius, and at the hill itself the density has no end."""
    k1, k2 = _levers(cells)
    u = np.linspace(0.0, 1.0, 2001)
    eps = cells.law.eps
    hill = np.max((k2[..., None] - k1[..., None] * eps * u**2) * eps**0.5 * u * np.log1p(eps * (1.0 - u**2)), axis=-1)
    return (cells.spread("r/l", 1.0) <= 1.01 * hill) & (cells.quantity == PDF)


def _printed_b0(cells: Cells) -> Mask:
    """The b0 of print, and with the other one in its place alone the albedo is as stated."""
    if cells.law.b0 != PRINTED_B0 or cells.arithmetic != MODEL or cells.quantity not in (PROFILE, CDF, ENERGY):
        return np.zeros(cells.shape, bool)
    mended = eqx.tree_at(lambda law: law.b0, cells.law, MENDED_B0)
    alpha, x = cells.along("α"), cells.along("r/l")
    if cells.quantity == ENERGY:
        value = np.asarray(mended.unscaled_energy(np.inf, alpha)) / np.asarray(mended.albedo.reflectance(alpha))
        return absolute(value, cells.reference) <= cells.bound
    value = np.asarray((mended.profile if cells.quantity == PROFILE else mended.cdf)(x, alpha))
    error = (relative if cells.quantity == PROFILE else absolute)(value, cells.reference)
    return as_stated(replace(cells, value=value, error=error))


def _no_tail(cells: Cells) -> Mask:
    """Within a factor three of r_max, or beyond it: a rational law ends there, the half space does not."""
    return (cells.spread("r/l", 0.0) > _largest(cells) / 3.0) & (cells.quantity == PROFILE) & as_stated(cells)


def _shape(cells: Cells) -> Mask:
    """As far off as the record says; of (17) at albedos that no fit saw."""
    if cells.quantity == ENERGY:
        return unseen(cells)
    return as_stated(cells) & (cells.quantity in (PROFILE, CDF))


def _inverse(cells: Cells) -> Mask:
    return as_stated(cells) & (cells.quantity == SAMPLE)


def _by_halvings(cells: Cells) -> Mask:
    """A root found by halving a bracket does not move with the constants."""
    return np.full(cells.shape, cells.quantity.startswith("∂pdf"))


def _beyond_fold(cells: Cells) -> Mask:
    return (cells.spread("A", 0.0) > cells.law.fold) & (cells.quantity == ALPHA_OF)


def _above_largest(cells: Cells) -> Mask:
    """Under the root of the inverse stands a negative number."""
    law, alpha = cells.law, _albedos(cells)
    left = (0.5 * (law.p - law.q * alpha)) ** 2 - law.w * alpha**2
    derived = cells.quantity.startswith("∂")
    return (left < (1e-3 if derived else 0.0)) & (REFLECTANCE_OF in cells.quantity)  # its slope ends before it does


def _not_white(cells: Cells) -> Mask:
    if cells.arithmetic != MODEL:
        return np.zeros(cells.shape, bool)
    near = (cells.spread("A", 0.0) > 0.7) | (_albedos(cells) > NEAR_WHITE)
    return near & near_stated(cells)


LIANG = (
    Cause(
        "r_max is 0/0",
        "r_max = -b/a: b underflows and a changes its sign as alpha goes to 0, 0/0 at 0 itself",
        "take alpha >= 1e-6, as shader sources do; hazard or quantile hold at 0",
        of_liang(_no_reach),
    ),
    Cause(
        "misprint of b0",
        "the printed b0 = 0.461 gives cdf(r_max) of (17) as 13.6 to 15.5, and r_max seven times too far; (18) hides it",
        "b0 = 0.0641 (constants `corrected`), or the regenerated ones",
        of_liang(_printed_b0),
    ),
    Cause(
        "g turns back",
        "k1 xi - k2 of (19) nears or passes 0 before xi = 1, as k1 nears k2 for dark media",
        "stay with the albedos of the record, or draw with hazard or quantile",
        of_liang(_turns_back),
    ),
    Cause(
        "g < 0 for xi < eps",
        "ln(1 + eps - xi) > 0 where xi < eps = 0.01: the radius is negative, and |g| rises and falls again",
        "take |g| and divide by the density of that map (sampler.pdf), or draw with hazard or quantile",
        of_liang(_opposite),
    ),
    Cause(
        "three xi for one radius",
        "below its hill |g| takes each radius three times and its density has no end at the hill; at 0 no limit is set",
        "use the density of the map as it is and no radius below 1e-3 l, or draw with hazard or quantile",
        of_liang(_branch_ends),
        frozenset({Verdict.INACCURATE}),
    ),
    Cause(
        "pdf by halvings",
        "the density of the map is taken at roots that halvings find: they have no derivative",
        "differentiate the log of `sampler.sample` by xi instead, or hazard's pdf",
        of_liang(_by_halvings),
        frozenset({Verdict.INACCURATE}),
    ),
    Cause(
        "no exponential tail",
        "a rational law falls to 0 at r_max = -b/a, the half space as e^(-kappa r) / r^2 beyond any radius",
        "hazard or quantile, which have kappa; else state r_max as the reach",
        of_liang(_no_tail),
    ),
    Cause(
        "shape of (7)",
        "(a r + b) / (r + c) with coefficient laws in alpha is not the profile: (18) scales the energy, not the shape",
        "hazard; the measures `rel` and `ks` of the record state the error",
        of_liang(_shape),
    ),
    Cause(
        "form of (19)",
        "sqrt(xi) ln(1 + eps - xi) rises as xi^1.5 where the exact one is linear, and eps fixes the largest radius",
        "quantile, whose two limits are exact, or the inverse of hazard's cdf",
        of_liang(_inverse),
    ),
    Cause(
        "fold of (8)",
        "alpha(A) falls beyond A = sqrt(w): two reflectances share one alpha, and alpha(1) = p / (1 + q + w)",
        "the rational map, which rises to alpha(1) = 1; else clamp A at the fold",
        of_map(_beyond_fold),
    ),
    Cause(
        "no A above the fold",
        "no A of (8) gives an alpha above that at its fold: the root of a negative number",
        "clamp as the shader source does, or the rational map",
        of_map(_above_largest),
    ),
    Cause(
        "(8) misses white",
        "(8) was fitted in alpha, while everything near white goes with sqrt(1 - alpha)",
        "the rational map, 3e-6 in A",
        of_map(_not_white),
    ),
)
