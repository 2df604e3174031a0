"""Check of a fit to the exact half space, which is repeated on the tracer's photons and must agree with it.

Both fits make the same objective small, with the working weights of that objective and not the inverse covariance of
the photons, on the same rings and albedos: what rests on too few photons is left out of both. A law that is not the
truth has another optimum for every weighting, so only then is the photons' noise all that can part them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from mcml_sim import Orders
from profilefit.fitting.estimate import Fit, fit, rings_of
from profilefit.fitting.profiles import Profiles

Floats = NDArray[np.float64]
# Directions of the constants' correlation below this share of the largest are rounding, not photons: the derivative
# of the optimum loses as many digits as its condition number, up to 1e7, has.
SMALLEST_SHARE = 1e-7
# A difference that photon noise exceeds less often than this is one: three standard errors of a single constant.
LARGEST_CUT = 0.1  # of a standard error of A: what the end of the longest paths may take away
LEAST_CHANCE = 0.0027
AGREE, DIFFER = "the fits agree", "the fits differ by more than the photons' noise"


@dataclass(frozen=True)
class CrossCheck:
    """Constants from photons beside those from the exact half space.

    names               (p,) of the constants
    exact, photons      (p,) constants from either, on the rings and albedos that count in both
    statistical_error   (p,) of those from photons, by the sandwich; z their difference in units of it
    chi2                of the whole difference under the sandwich covariance, within the `rank` directions it knows
    chance              that photon noise alone gives a larger chi2 [-]
    traced              photons; rings_left_out and albedos_left_out rest on too few of them
    result              whether the fits agree, or which one failed and how
    """

    names: tuple[str, ...]
    exact: Floats
    photons: Floats
    statistical_error: Floats
    chi2: float
    rank: int
    chance: float
    traced: int
    rings_left_out: int
    albedos_left_out: int
    result: str

    @property
    def z(self) -> Floats:
        return (self.photons - self.exact) / self.statistical_error

    def content(self) -> dict[str, Any]:
        """Return what a record says of it."""
        columns = zip(self.names, self.exact, self.photons, self.statistical_error, self.z, strict=True)
        keys = ("exact", "photons", "statistical_error", "z")
        facts = ("chi2", "rank", "chance", "rings_left_out", "albedos_left_out", "result")
        return {
            "constants": {name: dict(zip(keys, values, strict=True)) for name, *values in columns},
            "photons": self.traced,
            **{name: getattr(self, name) for name in facts},
        }


def crosscheck(own: Fit, exact: Profiles, light: Orders) -> CrossCheck:
    """Repeat the fit `own`, which was to `exact`, on photons of the same setting."""
    run, xi = light.merged(exact.r_edges), tuple(np.asarray(own.rings.xi))
    photons = Profiles.from_orders(run, exact.alpha)
    seen = np.asarray(own.rings.used) > 0
    used = seen & photons.trusted & (photons.energy > 0)
    # Albedos that rest on enough photons, none of which were cut to an extent that matters.
    error = np.asarray(run.reflectance(photons.alpha).standard_error)
    uncut = np.asarray(run.cut(photons.alpha)) <= LARGEST_CUT * error
    counted = uncut & (np.asarray(rings_of(photons, xi=xi).weight) > 0)
    limits = tuple(np.asarray(own.rings.limits))
    one, other = (
        fit(profiles, own.law, own.objective, own.free, used, limits, xi, counted, jackknife=False)
        for profiles in (exact, photons)
    )
    return compared(one, other, light.photons, int(np.sum(seen & ~used)), int(np.sum(~counted)))


def compared(exact: Fit, photons: Fit, traced: int, rings_left_out: int, albedos_left_out: int) -> CrossCheck:
    """Compare two fits of the same constants, in units of the photons' noise."""
    one, other = exact.solution.parameters, photons.solution.parameters
    covariance = np.asarray(photons.statistical)
    if problem := _problem(exact, photons):
        result, covariance = problem, np.full((one.size,) * 2, np.nan)
        distance, rank, chance = np.nan, 0, np.nan
    else:
        distance, rank = mahalanobis(other - one, covariance)
        chance = float(chi2.sf(distance, rank))
        result = AGREE if chance >= LEAST_CHANCE else DIFFER
    error = np.sqrt(np.diag(covariance))
    left_out = rings_left_out, albedos_left_out
    return CrossCheck(exact.free, one, other, error, distance, rank, chance, traced, *left_out, result)


def _problem(exact: Fit, photons: Fit) -> str | None:
    for name, one in (("exact", exact), ("photon", photons)):
        if not one.solution.converged:
            return f"the {name} fit failed: {one.result}"
    if photons.statistical is None or not np.all(np.isfinite(photons.statistical)):
        return "the photon fit has no finite errors: leave out radial bins that hold next to no light"
    return None


def mahalanobis(difference: Floats, covariance: Floats) -> tuple[float, int]:
    """Return chi2 of a difference (p,) under a covariance (p, p), and the number of directions that count."""
    error = np.sqrt(np.diag(covariance))
    share, axes = np.linalg.eigh(covariance / np.outer(error, error))
    known = share > SMALLEST_SHARE * share.max()
    along = axes.T[known] @ (difference / error)
    return float(np.sum(along**2 / share[known])), int(known.sum())
