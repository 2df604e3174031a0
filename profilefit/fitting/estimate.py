"""Estimates: the constants of a law that fit profiles best, with errors of four kinds.

statistical   what another run's photons would change: the closed-form covariance of the ring energies carried to the
              constants through the exact derivative of the optimum (implicit function theorem, full Hessian), so it
              holds for a law that is not the truth (the sandwich of White, Econometrica 50, 1982)
misfit        what the law's misfit leaves open if its residuals were independent noise: least squares'
              s^2 (J^T J)^-1; the process that they are in truth is `fitting.discrepancy`'s
jackknife     how much the constants move when the fit does not see a sixth of the albedos: a misfit is no noise, its
              neighbours repeat each other, and then this is the larger and the honest number
structure     what the residuals still show: a law that is the truth leaves none
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from mcml_sim.errors import InputError, SettingError
from mcml_sim.exact.compiled import filter_jit
from mcml_sim.media.checks import require_own_process
from profilefit.fitting.objectives import NO_LIMITS, OBJECTIVES, Rings, rings_of
from profilefit.fitting.profiles import Profiles
from profilefit.fitting.solver import Solution, least_squares, solve_batch
from profilefit.laws.base import AlbedoLaw, Constants
from profilefit.laws.liang import QUANTILES

Floats = NDArray[np.float64]
JACKKNIFE_GROUPS = 6
JACKKNIFE_WORTH = 1e-7  # as of `solve`, of its refits: errors are right to a hundredth
# Half of float64's digits: J^T J has the square of this condition number, and nothing is left of its inverse.
DEGENERATE = 1e7


@dataclass(frozen=True)
class Fit:
    """A law fitted to profiles.

    law          the law at the optimum
    free         (p,) the names of the constants that were free; the others stayed where they were
    objective    the name of what was minimised; rings its data
    solution     optimum, residuals, Jacobian, result
    statistical  (p, p) covariance from photon noise; None where the truth has none
    misfit       (p, p) covariance from the law's misfit, taken for independent noise
    jackknife    (p,) standard errors from leaving out one group of neighbouring albedos after the other; NaN with fewer
                 than six albedos, where a refit fails, or where none was requested
    Covariances are NaN where the fit failed.
    structure    measures of what is left in the residuals
    """

    law: Constants
    free: tuple[str, ...]
    objective: str
    rings: Rings
    solution: Solution
    statistical: Floats | None
    misfit: Floats
    jackknife: Floats
    structure: Structure

    @property
    def constants(self) -> dict[str, float]:
        """The fitted constants by name."""
        return dict(zip(self.free, map(float, self.solution.parameters), strict=True))

    @property
    def variance(self) -> float:
        """s^2: the misfit per degree of freedom."""
        return self.solution.variance

    @property
    def result(self) -> str:
        return self.solution.result

    @cached_property
    def second_derivatives(self) -> tuple[Floats, Floats]:
        """Derivatives of half the sum of squares, by two constants (p, p) and by an energy and one (m, n + 1, p)."""
        return _second_derivatives(ResidualFunction(self.objective, self.free), self.solution, self.law, self.rings)


@dataclass(frozen=True)
class Structure:
    """Structure in the residuals of a fit.

    rms           root mean square residual, in the objective's own weight
    largest       the largest |residual|
    along_r       lag-1 autocorrelation along the rings (or xi), along_alpha along the albedos: 0 if only noise is left
    half_waves    number of sign runs, along r times along alpha: the effective number of independent residuals
    """

    rms: float
    largest: float
    along_r: float
    along_alpha: float
    half_waves: float


def fit(
    profiles: Profiles,
    law: Constants,
    objective: str | None = None,
    free: Sequence[str] | None = None,
    used: NDArray[np.bool_] | None = None,
    limits: tuple[float, ...] = NO_LIMITS,
    xi: Sequence[float] = (),
    counted: NDArray[np.bool_] | None = None,
    jackknife: bool = True,
) -> Fit:
    """Fit the constants named in `free` (all, if None) of `law` to `profiles`.

    objective  a name in `objectives.OBJECTIVES`: it fixes the weighting; by default "energy" for a profile law and
               "albedo" for a map between alpha and A
    used       (m, n) rings that count, counted (m,) albedos that do, as far as they rest on enough photons
    limits     the weights of the energy limit, the source limit and of rising with alpha; xi shares for quantiles
    jackknife  whether to refit for the jackknife, which takes longer than the fit itself
    A fit that does not converge is returned with the reason in `result`. Derivatives are by the constants and by the
    light, never by alpha: that of A is infinite at alpha = 1, which may be among the profiles. A law of one's own whose
    constant stands with 1 - alpha under a root has no finite derivative there. Raises InputError on an unknown
    objective or constant, SettingError if the law and the profiles belong to different light or surface.
    """
    require_own_process()
    target = objective or ("albedo" if isinstance(law, AlbedoLaw) else "energy")
    if target not in OBJECTIVES:
        raise InputError(f"objective must be one of {', '.join(OBJECTIVES)}, got {target!r}")
    if law.setting != profiles.setting:
        raise SettingError(f"the law belongs to {law.setting}, the profiles to {profiles.setting}: they do not mix")
    names = tuple(free) if free is not None else law.seen_by(target)
    if not law.seen_by(target):
        raise InputError(f"objective {target!r} does not apply to {type(law).__name__}")
    if target in QUANTILES and not len(xi):
        raise InputError(f"objective {target!r} needs shares xi of the energy, got none")
    if not names or len(set(names)) < len(names):
        raise InputError(f"free must name at least one constant, each once, got {', '.join(names) or '(none)'}")
    if unknown := [name for name in names if name not in law.constant_names()]:
        raise InputError(f"free must name constants of the law ({', '.join(law.constant_names())}), got {unknown[0]!r}")
    problem = ResidualFunction(target, names)
    rings = rings_of(profiles, used, limits, xi)
    if counted is not None:
        rings = eqx.tree_at(lambda tree: tree.weight, rings, np.asarray(rings.weight) * counted)
    solution = judged(least_squares(problem, law.vector(names), (law, rings)), names)
    return Fit(
        law.with_vector(names, [float(value) for value in solution.parameters]),
        names,
        target,
        rings,
        solution,
        _statistical(problem, solution, law, rings, profiles),
        misfit_covariance(solution),
        _jackknife(problem, solution, law, rings) if jackknife else np.full(len(names), np.nan),
        residual_structure(solution.residuals.reshape(profiles.alpha.size, -1)),
    )


@dataclass(frozen=True)
class ResidualFunction:
    """The residual of a fit: which constants of a law move, and what is made small.

    A callable value and not a method: jax compiles anew for what does not compare equal, and bound methods of equal
    objects don't.
    """

    objective: str
    free: tuple[str, ...]

    def __call__(self, vector, data):
        law, rings = data
        tables = OBJECTIVES[self.objective](law.with_vector(self.free, vector), rings)
        return tuple(rings.weight[:, None] * table for table in tables)

    def cost(self, vector, data) -> jax.Array:
        """Sum of squared residuals."""
        return jnp.sum(jnp.stack([jnp.sum(table**2) for table in self(vector, data)]))


def misfit_covariance(solution: Solution) -> Floats:
    """s^2 (J^T J)^-1 (p, p); NaN where the fit failed."""
    if not solution.converged:
        return np.full((solution.parameters.size,) * 2, np.nan)
    return solution.variance * solution.covariance


def scaled_inverse(matrix: Floats) -> Floats:
    """Inverse of a symmetric matrix whose rows differ by decades in size."""
    scale = np.sqrt(np.abs(np.diag(matrix)))
    return np.linalg.inv(matrix / np.outer(scale, scale)) / np.outer(scale, scale)


def judged(solution: Solution, names: tuple[str, ...]) -> Solution:
    """Return a solution, as failed where its constants are not separately identifiable."""
    if not solution.converged or (condition := solution.condition_number) <= DEGENERATE:
        return solution
    blind = [name for name, column in zip(names, solution.jacobian.T, strict=True) if not np.any(column)]
    what = f"{', '.join(blind)} moves nothing" if blind else "constants trade against each other"
    return replace(solution, result=f"degenerate, condition number {condition:.1g}: {what}; hold a constant")


def residual_structure(table: Floats) -> Structure:
    """Measure the structure of residuals (m, k), a row per albedo; zeros are rings that do not count."""
    live = table[table != 0]
    rms = float(np.sqrt(np.mean(live**2))) if live.size else 0.0
    waves = _half_waves(table) * _half_waves(table.T)
    return Structure(rms, float(np.max(np.abs(table), initial=0.0)), _lag_one(table), _lag_one(table.T), waves)


def _jackknife(problem: ResidualFunction, solution: Solution, law: Constants, rings: Rings) -> Floats:
    """Return standard errors (p,) by a grouped jackknife over neighbouring albedos (Efron, The Jackknife, 1982)."""
    m = rings.alpha.size
    if not solution.converged or m < JACKKNIFE_GROUPS:
        return np.full(solution.parameters.size, np.nan)
    groups = np.array_split(np.arange(m), JACKKNIFE_GROUPS)
    weights = np.tile(np.asarray(rings.weight), (len(groups), 1))
    for row, group in zip(weights, groups, strict=True):
        row[group] = 0.0
    data = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (len(groups), *np.shape(leaf))), (law, rings))
    data = eqx.tree_at(lambda tree: tree[1].weight, data, weights)
    refits = solve_batch(problem, np.tile(solution.parameters, (len(groups), 1)), data, JACKKNIFE_WORTH)
    if not all(judged(refit, problem.free).converged for refit in refits):
        return np.full(solution.parameters.size, np.nan)
    moved = np.stack([refit.parameters for refit in refits])
    spread = np.sum((moved - moved.mean(axis=0)) ** 2, axis=0)
    return np.sqrt((len(groups) - 1) / len(groups) * spread)


def sensitivity(problem: ResidualFunction, solution: Solution, law: Constants, rings: Rings) -> Floats:
    """Return d constants / d energies (p, m, n + 1) at the optimum, of rings and then of the light beyond."""
    return followed(*_second_derivatives(problem, solution, law, rings))


def followed(hessian: Floats, mixed: Floats) -> Floats:
    """Return the result of `sensitivity`, from second derivatives (p, p) and (m, n + 1, p) that are known."""
    return -np.einsum("pq,aiq->pai", scaled_inverse(hessian), mixed)


def _second_derivatives(
    problem: ResidualFunction, solution: Solution, law: Constants, rings: Rings
) -> tuple[Floats, Floats]:
    """Compute `Fit.second_derivatives` by one compiled program."""
    with jax.enable_x64(True):
        law = jax.tree.map(jnp.asarray, law)  # traced, so that other constants compile nothing
        here = jnp.asarray(solution.parameters)
        columns = [_curved(problem, here, along, law, rings) for along in np.eye(here.size)]
    hessian, mixed = (np.stack([np.asarray(one) for one in each], axis=-1) for each in zip(*columns, strict=True))
    return hessian, mixed


def _statistical(problem, solution, law, rings, profiles) -> Floats | None:
    if profiles.covariance is None:
        return None
    if not solution.converged:
        return np.full((solution.parameters.size,) * 2, np.nan)
    return profiles.covariance.sandwich(sensitivity(problem, solution, law, rings))


@filter_jit
def _curved(residual, vector, along, law, rings):
    """One column of both: all at once would compile as long as a fit."""

    def cost(theta, energies):
        data = eqx.tree_at(lambda tree: (tree.energy, tree.beyond), rings, (energies[:, :-1], energies[:, -1]))
        return 0.5 * residual.cost(theta, (law, data))

    energies = jnp.column_stack([jnp.asarray(rings.energy), jnp.asarray(rings.beyond)])
    slopes = jax.grad(cost, argnums=(0, 1))
    return jax.jvp(lambda theta: slopes(theta, energies), (vector,), (along,))[1]


def _half_waves(table: Floats) -> float:
    """Mean number of sign runs along the rows of a table; zeros (rings that do not count) are skipped."""
    signs = [np.sign(row[row != 0]) for row in table]
    counts = [1 + np.count_nonzero(np.diff(row)) for row in signs if row.size]
    return float(np.mean(counts)) if counts else 0.0


def _lag_one(table: Floats) -> float:
    """Lag-1 autocorrelation along the rows of a table, about zero: a fit's residuals have no mean to remove."""
    if table.shape[1] < 2 or not np.any(table):
        return 0.0
    table = table / np.max(np.abs(table))  # squares of small ones would be 0
    return float(np.sum(table[:, 1:] * table[:, :-1]) / np.sqrt(np.sum(table[:, 1:] ** 2) * np.sum(table[:, :-1] ** 2)))
