"""The paper's own protocol in its own order: (7) at each albedo and mean free path, then laws through the coefficients.

Errors pass from stage to stage: the covariance of the coefficients is that of the photons, and each coefficient law
takes it over through the derivative of its own optimum.
"""

from __future__ import annotations

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from mcml_sim.exact.compiled import filter_jit, jit
from mcml_sim.media.arrays import Floats
from profilefit.fitting.estimate import scaled_inverse
from profilefit.fitting.profiles import Profiles, trimmed_radius
from profilefit.fitting.solver import Solution, least_squares, solve_batch
from profilefit.laws.liang import Liang

COEFFICIENTS = ("a", "b", "c")
CONSTANTS_OF = {"a": ("a1", "a2", "a3"), "b": ("b0", "b1", "b2", "b3", "b4"), "c": ("c1", "c2", "c3")}


@dataclass(frozen=True)
class PerAlbedo:
    """(7) fitted at each albedo (m,) of one mean free path, coefficients in units of the mfp.

    values (m, 3) of a [1/mfp], b [-], c [mfp]; covariance (3 m, 3 m) from photon noise, or None; r_trim (m,) [mfp];
    results (m,) what each fit said; rms (m,) of its residuals
    """

    alpha: Floats
    mfp: float
    values: Floats
    covariance: Floats | None
    r_trim: Floats
    results: tuple[str, ...]
    rms: Floats

    @property
    def standard_error(self) -> Floats:
        """(m, 3), zero where the truth has no noise."""
        if self.covariance is None:
            return np.zeros_like(self.values)
        return np.sqrt(np.diag(self.covariance)).reshape(self.values.shape)


@dataclass(frozen=True)
class CoefficientLaw:
    """One of (11), (13), (15) through the per-albedo coefficients: names, solution, covariance or None."""

    names: tuple[str, ...]
    solution: Solution
    covariance: Floats | None


def trimmed(profiles: Profiles, what: str, epsilon: float, mfp: float = 1.0) -> tuple[NDArray[np.bool_], Floats]:
    """Return rings (m, n) that the trimming keeps, radii (m,) of the cut [mfp]; `what` is "R_d", "r R_d" or "none"."""
    r = profiles.r
    if what == "none":
        return np.ones_like(profiles.energy, bool), np.full(profiles.alpha.size, r[-1])
    quantity = profiles.value * r if what == "r R_d" else profiles.value
    cut = np.array([trimmed_radius(r * mfp, row, epsilon) / mfp for row in quantity])
    return r <= cut[:, None], cut


def fit_per_albedo(profiles: Profiles, start: Liang, mfp: float, what: str, epsilon: float) -> PerAlbedo:
    """Fit (7) at every albedo of `profiles` by unweighted least squares of r R_d on the rings that (6) keeps."""
    used, cut = trimmed(profiles, what, epsilon, mfp)
    used = used & profiles.trusted
    data = profiles.value * profiles.r
    starts = np.stack([[float(v) for v in start.coefficients(float(a))] for a in profiles.alpha])
    radii = np.broadcast_to(profiles.r, data.shape)
    solutions = solve_batch(_rational, starts, (radii, data, used.astype(float)))
    covariance = None
    if profiles.covariance is not None:
        covariance = profiles.covariance.sandwich(_coefficient_sensitivity(solutions, radii, data, used, profiles))
    values = np.stack([s.parameters for s in solutions])
    rms = np.array([np.sqrt(s.cost / max(int(u.sum()), 1)) for s, u in zip(solutions, used, strict=True)])
    return PerAlbedo(profiles.alpha, mfp, values, covariance, cut, tuple(s.result for s in solutions), rms)


def fit_coefficient_laws(points: PerAlbedo, start: Liang, held: tuple[str, ...] = ()) -> dict[str, CoefficientLaw]:
    """Fit (11), (13), (15) to the coefficients by unweighted least squares; constants in `held` stay where they are."""
    laws = {}
    for column, letter in enumerate(COEFFICIENTS):
        names = tuple(name for name in CONSTANTS_OF[letter] if name not in held)
        residual = _CoefficientProblem(letter, names)
        data = points.values[:, column]
        solution = least_squares(residual, start.vector(names), (start, points.alpha, data))
        covariance = None
        if points.covariance is not None:
            with jax.enable_x64(True):
                here = jnp.asarray(solution.parameters), start, jnp.asarray(points.alpha), jnp.asarray(data)
                hessian, mixed = _gain_arrays(residual, *here)
            gain = -scaled_inverse(np.asarray(hessian)) @ np.asarray(mixed).T  # d constants / d coefficients (p, m)
            covariance = gain @ points.covariance[column::3, column::3] @ gain.T
        laws[letter] = CoefficientLaw(names, solution, covariance)
    return laws


def length_exponents(points: tuple[PerAlbedo, ...]) -> dict[str, float]:
    """Return the powers of l in a, b and c, by a straight line through ln|coefficient| over ln l: about -1, 0, 1."""
    ln_l = np.log([p.mfp for p in points])
    in_length = np.stack([p.values * np.array([1.0 / p.mfp, 1.0, p.mfp]) for p in points])
    slopes = np.polyfit(ln_l, np.log(np.abs(in_length)).reshape(len(points), -1), 1)[0].reshape(-1, 3)
    return dict(zip(COEFFICIENTS, map(float, slopes.mean(axis=0)), strict=True))


def _rational(p, item):
    r, data, used = item
    return used * ((p[0] * r + p[1]) / (r + p[2]) - data)


@dataclass(frozen=True)
class _CoefficientProblem:
    """One coefficient law's misfit; hashable, so that each letter compiles once."""

    letter: str
    names: tuple[str, ...]

    def __call__(self, vector, item):
        law, alpha, data = item
        column = COEFFICIENTS.index(self.letter)
        return law.with_vector(self.names, vector).coefficients(alpha)[column] - data


def _coefficient_sensitivity(solutions, radii, data, used, profiles) -> Floats:
    """Return d (a, b, c at every albedo) / d ring energies, (3 m, m, n): each albedo's fit sees its own rings."""
    with jax.enable_x64(True):
        parameters = jnp.asarray(np.stack([s.parameters for s in solutions]))
        arrays = (jnp.asarray(radii), jnp.asarray(data), jnp.asarray(used, float))
        hessian, mixed = _rational_derivatives(parameters, *arrays)
    to_energy = profiles.r / profiles.r_areas
    own = -np.einsum("mpq,miq,i->mpi", np.linalg.inv(np.asarray(hessian)), np.asarray(mixed), to_energy)
    m, p, n = own.shape
    out = np.zeros((m, p, m, n))
    out[np.arange(m), :, np.arange(m), :] = own
    return out.reshape(m * p, m, n)


@jit
def _rational_derivatives(parameters, radii, data, used):
    def cost(p, d, r, u):
        return 0.5 * jnp.sum(_rational(p, (r, d, u)) ** 2)

    hessian = jax.vmap(jax.hessian(cost))(parameters, data, radii, used)
    return hessian, jax.vmap(jax.jacfwd(jax.grad(cost, argnums=1)))(parameters, data, radii, used)


@filter_jit
def _gain_arrays(residual, vector, law, alpha, data):
    def cost(p, d):
        return 0.5 * jnp.sum(residual(p, (law, alpha, d)) ** 2)

    return jax.hessian(cost)(vector, data), jax.jacfwd(jax.grad(cost, argnums=1))(vector, data)
