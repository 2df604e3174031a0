"""Estimates: the constants of a law that fit profiles best, with errors of four kinds.

statistical   what another run's photons would change: the closed-form covariance of the ring energies carried to the
              constants through the exact derivative of the optimum (implicit function theorem, full Hessian), so it
              holds for a law that is not the truth (the sandwich of White, Econometrica 50, 1982)
misfit        what the law's misfit leaves open if its residuals were independent noise: least squares'
              s^2 (J^T J)^-1; the process that they are in truth is `fitting.discrepancy`'s
jackknife     how much the constants move when the fit does not see a sixth of the albedos: a misfit is no noise, its
              neighbours repeat each other, and then this is the larger and the honest number
structure     what the residuals still show: a law that is the truth leaves none

A fit minimises an objective: a function from a law and ring energies to tables of residuals, a row for each albedo.
Tables of one objective stay apart: XLA would compute what they share for each column anew if they were joined. An
objective is a differentiable function of the law **and** of the ring energies, weights included, so that the photon
noise of the energies propagates to the constants without another formula. The weighting decides the constants of a law
that is not the truth: it belongs to the objective's name, and each record states it. None is differentiated by alpha,
whose derivatives are infinite at alpha = 1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from mcml_sim.errors import InputError, SettingError
from mcml_sim.exact.compiled import BRIEF, filter_jit
from mcml_sim.media.arrays import Floats, require, require_own_process
from profilefit.fitting.profiles import FEWEST_EFFECTIVE_SAMPLES, Profiles
from profilefit.fitting.quality import ENERGY_WITHIN, NEAREST
from profilefit.fitting.solver import Solution, least_squares, solve_batch
from profilefit.laws.base import AlbedoLaw, Constants
from profilefit.laws.liang import QUANTILES
from profilefit.laws.surface import RefractingSurface, surfaces_of

JACKKNIFE_GROUPS = 6
JACKKNIFE_WORTH = 1e-7  # as of `solve`, of its refits: errors are right to a hundredth
# Half of float64's digits: J^T J has the square of this condition number, and nothing is left of its inverse.
DEGENERATE = 1e7
Values = Array | NDArray[np.float64]
Tables = tuple[Any, ...]  # of residuals, a row for each albedo
# A radius [mfp] beyond all light; infinity itself would turn 0 * inf into NaN in a derivative.
EVERYWHERE = 1e9
# An error of the cdf weighs as much as a relative error of the profile twenty times its size.
SHARE_WEIGHT = 20.0
NO_LIMITS = (0.0, 0.0, 0.0)
# Next to white A and kappa go with v = sqrt(1 - alpha), exact R_d at one radius with v^2 only. What a law has in v must
# not be light that absorption adds: its slope in ln R_d, seen this near to white, must be less than -`LEAST_FALL`.
NEXT_TO_WHITE, LEAST_FALL = 1e-8, 3e-3
DARK = 1e-12  # energy of a ring that holds none


class Rings(eqx.Module):
    """The part of `Profiles` that residuals read, as one pytree.

    used (m, n), weight (m,)  1 where a ring, an albedo counts, else 0; xi (k,) shares of energy for quantiles
    limits (3,)  weights of the energy limit, of the source limit and of rising with alpha
    surface, surfaces  closed numbers of each profile (m, 1), and of each setting (j, 1), profiles of one after those of
    another; None where all belong to the law's own
    """

    alpha: Values
    r_edges: Values
    energy: Values
    beyond: Values
    used: Values
    weight: Values
    limits: Values
    xi: Values
    surface: RefractingSurface | None = None
    surfaces: RefractingSurface | None = None

    @property
    def reflectance(self) -> Array:
        """A (m,) [-]."""
        return self.energy.sum(axis=-1) + self.beyond

    @property
    def cdf(self) -> Array:
        """(m, n + 1) share of energy within each edge."""
        inside = jnp.cumsum(self.energy, axis=-1)
        return jnp.concatenate([jnp.zeros_like(inside[:, :1]), inside], axis=-1) / self.reflectance[:, None]


def energy(law, rings: Rings) -> Tables:
    """Whole profile: ring energies, each ring's relative error weighted by its share of the energy; and the limits.

    The sum of squares of a profile's rings is the energy-weighted mean of (law/data - 1)^2. Two more rows an albedo
    hold the unscaled law to its limits: total energy A, and 2 pi r R_d -> alpha/2 at the source.
    """
    alpha, law = rings.alpha[:, None], law.under(rings.surface)
    inside = law.unscaled_energy(rings.r_edges, alpha)
    data = jnp.where((rings.used > 0) & (rings.energy > 0), rings.energy, 1.0)
    weight = rings.used / jnp.sqrt(data * rings.reflectance[:, None])
    misfit = weight * (jnp.diff(inside, axis=-1) - rings.energy)
    total = law.unscaled_energy(EVERYWHERE, alpha) / rings.reflectance[:, None] - 1.0
    source = law.source_strength(alpha) / (0.5 * alpha) - 1.0
    return misfit, rings.limits[0] * total, rings.limits[1] * source


def relative(law, rings: Rings) -> Tables:
    """Whole profile on a log-spaced eye: relative errors of ring energies, even in ln r; and of the cumulated energy.

    The rings from `NEAREST` to the radius of `ENERGY_WITHIN` weigh as much as they are wide in ln r, so that their sum
    of squares is the mean square of (law/data - 1), the `rel` of `quality`. Then come the errors of the cdf at all
    edges, then what resists a law that falls with alpha next to white, ring by ring: absorption must not add light.
    """
    # d ln E / d sqrt(1 - alpha) of each ring next to white plus `LEAST_FALL` (j, n), at each index; 0 if negative.
    near = jnp.array([1.0 - NEXT_TO_WHITE, 1.0])[:, None, None]
    darker, white = jnp.diff(law.under(rings.surfaces).unscaled_energy(rings.r_edges, near), axis=-1)
    lit = (darker > DARK) & (white > DARK)
    slope = jnp.log(jnp.where(lit, darker, 1.0) / jnp.where(lit, white, 1.0)) / np.sqrt(NEXT_TO_WHITE)
    added = jnp.where(lit, jnp.maximum(slope + LEAST_FALL, 0.0), 0.0)
    alpha, law = rings.alpha[:, None], law.under(rings.surface)
    inside = law.unscaled_energy(rings.r_edges, alpha)
    widths = jnp.diff(jnp.log(jnp.maximum(rings.r_edges, rings.r_edges[1])))
    judged = (rings.r_edges[:-1] >= NEAREST * (1.0 - 1e-9)) & (rings.cdf[:, 1:] <= ENERGY_WITHIN)
    weight = jnp.where(judged, rings.used * widths, 0.0)
    weight = jnp.sqrt(weight / jnp.maximum(weight.sum(axis=-1, keepdims=True), 1e-300))
    # 1 also where nothing counts: E^2 in a derivative must not underflow.
    data = jnp.where((weight > 0) & (rings.energy > 0), rings.energy, 1.0)
    misfit = weight * (jnp.diff(inside, axis=-1) / data - 1.0)
    shares = inside / law.unscaled_energy(EVERYWHERE, alpha) - rings.cdf
    of_each = rings.alpha.size // len(added)
    added = rings.limits[2] / np.sqrt(of_each) * jnp.repeat(added, of_each, axis=0)
    return misfit, SHARE_WEIGHT / np.sqrt(rings.r_edges.size) * shares, added


def radial(law, rings: Rings) -> Tables:
    """Compare r R_d at the ring centres, unweighted, over the rings that the trimming (6) keeps: as published."""
    r = 0.5 * (rings.r_edges[1:] + rings.r_edges[:-1])
    a, b, c = law.coefficients(rings.alpha[:, None])
    data = rings.energy / (2.0 * jnp.pi * jnp.diff(rings.r_edges))  # r R_d: the area is 2 pi r dr
    return (rings.used * ((a * r + b) / (r + c) - data),)


def albedo(law, rings: Rings) -> Tables:
    """alpha(A) - alpha, unweighted over those given."""
    return (law.under(rings.surface).alpha(rings.reflectance[:, None]) - rings.alpha[:, None],)


def reflectance(law, rings: Rings) -> Tables:
    """A(alpha) - A, unweighted over the albedos given."""
    return (law.under(rings.surface).reflectance(rings.alpha[:, None]) - rings.reflectance[:, None],)


def relative_reflectance(law, rings: Rings) -> Tables:
    """A(alpha) / A - 1, unweighted over the albedos given."""
    return (reflectance(law, rings)[0] / rings.reflectance[:, None],)


def radius(law, rings: Rings) -> Tables:
    """g(xi) minus the radius within which the share xi of the energy leaves [mfp], unweighted in xi."""
    return (law.sampler.unclipped(rings.xi, rings.alpha[:, None]) - _quantile(rings),)


def relative_radius(law, rings: Rings) -> Tables:
    """g(xi) over the radius within which the share xi of the energy leaves, minus 1 [-], unweighted in xi."""
    return (law.sampler.unclipped(rings.xi, rings.alpha[:, None]) / _quantile(rings) - 1.0,)


def share(law, rings: Rings) -> Tables:
    """Whole profile: the share of the energy within g(xi), minus xi, unweighted in xi [-]."""
    x = law.sampler.unclipped(rings.xi, rings.alpha[:, None])
    inner = _interpolate(jnp.abs(x), rings.r_edges, rings.cdf) * jnp.sign(x)
    return (inner - rings.xi,)


OBJECTIVES: dict[str, Callable] = {
    one.__name__: one
    for one in (energy, relative, radial, albedo, reflectance, relative_reflectance, radius, relative_radius, share)
}


def rings_of(profiles: Profiles, used=None, limits=NO_LIMITS, xi=()) -> Rings:
    """Return the residuals' view of `profiles`: rings and albedos that rest on enough photons. InputError of none."""
    keep = profiles.trusted & (profiles.energy > 0)
    if used is not None:
        keep &= used
    smallest = min([*xi, *(1.0 - np.asarray(xi)), 1.0])
    weight = profiles.albedo_samples * smallest >= FEWEST_EFFECTIVE_SAMPLES
    if not np.any(weight):
        needed = f"{FEWEST_EFFECTIVE_SAMPLES / smallest:.0f}"
        raise InputError(f"too few photons: no albedo rests on {needed} effective ones, as this fit needs; trace more")
    each = profiles.settings
    surfaces = (surfaces_of(each), surfaces_of(tuple(dict.fromkeys(each)))) if each else ()
    flags = keep.astype(float), weight.astype(float), np.asarray(limits, float), np.asarray(xi, float)
    return Rings(profiles.alpha, profiles.r_edges, profiles.energy, profiles.beyond, *flags, *surfaces)


def _quantile(rings: Rings) -> Array:
    """(m, k) radii at the shares xi, linear in the cdf between edges."""
    return _interpolate(jnp.broadcast_to(rings.xi, (rings.alpha.size, rings.xi.size)), rings.cdf, rings.r_edges)


def _interpolate(x: Array, nodes: Values, values: Values) -> Array:
    """Row by row linear interpolation; `nodes` and `values` broadcast to a row for each row of x."""
    nodes = jnp.broadcast_to(nodes, (x.shape[0], nodes.shape[-1]))
    values = jnp.broadcast_to(values, (x.shape[0], values.shape[-1]))
    return eqx.filter_vmap(jnp.interp)(x, nodes, values)


@dataclass(frozen=True)
class Fit:
    """A law fitted to profiles.

    law          the law at the optimum
    free         (p,) the names of the constants that were free; the others stayed where they were
    objective    the name of what was minimised; rings its data
    statistical  (p, p) covariance from photon noise; None where the truth has none
    misfit       (p, p) covariance from the law's misfit, taken for independent noise
    jackknife    (p,) standard errors from leaving out one group of neighbouring albedos after the other; NaN with fewer
                 than six albedos, where a refit fails, or where none was requested
    Covariances are NaN where the fit failed.
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
        problem = ResidualFunction(self.objective, self.free)
        with jax.enable_x64(True):
            law = jax.tree.map(jnp.asarray, self.law)  # traced, so that other constants compile nothing
            here = jnp.asarray(self.solution.parameters)
            columns = [_curved(problem, here, along, law, self.rings) for along in np.eye(here.size)]
        hessian, mixed = (np.stack([np.asarray(one) for one in each], axis=-1) for each in zip(*columns, strict=True))
        return hessian, mixed


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
    """Fit the constants named in `free` (all, if None) of `law` to `profiles`; a failure is named in `result`.

    objective  a name in `OBJECTIVES`: it fixes the weighting; by default "energy" for a profile law and "albedo" for a
               map between alpha and A
    used       (m, n) rings that count, counted (m,) albedos that do, as far as they rest on enough photons
    limits     the weights of the energy limit, the source limit and of rising with alpha; xi shares for quantiles
    jackknife  whether to refit for the jackknife, which takes longer than the fit itself
    Raises InputError on an unknown objective or constant, SettingError if the law and the profiles belong to different
    light or surface.
    """
    require_own_process()
    target = objective or ("albedo" if isinstance(law, AlbedoLaw) else "energy")
    require(target in OBJECTIVES, "objective", f"one of {', '.join(OBJECTIVES)}", target)
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
    spread = _jackknife(problem, solution, law, rings) if jackknife else np.full(len(names), np.nan)
    structure = residual_structure(solution.residuals.reshape(profiles.alpha.size, -1))
    best = law.with_vector(names, [float(value) for value in solution.parameters])
    own = Fit(best, names, target, rings, solution, None, misfit_covariance(solution), spread, structure)
    if profiles.covariance is None:
        return own
    if not solution.converged:
        return replace(own, statistical=np.full((len(names),) * 2, np.nan))
    return replace(own, statistical=profiles.covariance.sandwich(followed(*own.second_derivatives)))


@dataclass(frozen=True)
class ResidualFunction:
    """The residual of a fit, as a value: jax compiles anew for bound methods, which do not compare equal."""

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
    """Return standard errors (p,) by a grouped jackknife over neighbouring albedos."""
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
    return jackknife_error([refit.parameters for refit in refits])


def jackknife_error(moved: Sequence[Floats]) -> Floats:
    """Return standard errors (p,) from refits, each without one group (Efron, The Jackknife, 1982, ch. 2)."""
    apart = np.array(moved) - np.mean(moved, axis=0)
    return np.sqrt((len(moved) - 1) / len(moved) * np.sum(apart**2, axis=0))


def followed(hessian: Floats, mixed: Floats) -> Floats:
    """Return d constants / d energies (p, m, n + 1) at an optimum, from its second derivatives; light beyond last."""
    return -np.einsum("pq,aiq->pai", scaled_inverse(hessian), mixed)


@partial(filter_jit, options=BRIEF)
def _curved(residual, vector, along, law, rings):
    """One column of both: all at once would compile as long as a fit."""

    def cost(theta, energies):
        data = eqx.tree_at(lambda tree: (tree.energy, tree.beyond), rings, (energies[:, :-1], energies[:, -1]))
        return 0.5 * residual.cost(theta, (law, data))

    energies = jnp.column_stack([jnp.asarray(rings.energy), jnp.asarray(rings.beyond)])
    slopes = jax.grad(cost, argnums=(0, 1))
    return jax.jvp(lambda theta: slopes(theta, energies), (vector,), (along,))[1]


def _half_waves(table: Floats) -> float:
    """Return the mean number of sign runs along the rows of a table; zeros (rings that do not count) are skipped."""
    signs = [np.sign(row[row != 0]) for row in table]
    counts = [1 + np.count_nonzero(np.diff(row)) for row in signs if row.size]
    return float(np.mean(counts)) if counts else 0.0


def _lag_one(table: Floats) -> float:
    """Return the lag-1 autocorrelation along the rows of a table, about zero: residuals have no mean to remove."""
    if table.shape[1] < 2 or not np.any(table):
        return 0.0
    table = table / np.max(np.abs(table))  # squares of small ones would be 0
    return float(np.sum(table[:, 1:] * table[:, :-1]) / np.sqrt(np.sum(table[:, 1:] ** 2) * np.sum(table[:, :-1] ** 2)))
