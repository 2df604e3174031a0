"""Posteriors: emcee samples a law's constants, once for the photon noise and once for the law's misfit.

statistical   exp(-Q(theta*) / 2 s^2) with theta* = theta^ + C (theta - theta^): the working misfit Q with its curvature
              adjusted to the sandwich covariance (Chandler and Bate, Biometrika 94, 2007), which is the spread that
              photon noise really causes when the working weights are not the inverse noise; s makes det C = 1, so
              that Q is probed as far from its optimum as the photons move it
misfit        exp(-Q(theta) / 2 s^2), s^2 the misfit per degree of freedom: what the law's misfit leaves open if it were
              noise. It is not, so read it beside the fit's jackknife
Priors are flat in the constants, each within ten times its size or its own misfit error, whichever is larger: a
misfit that is blind to a constant leaves it to the prior, and the interval then shows it. Chains start as draws of
Laplace's approximation, propose such draws, and run until they are 50 autocorrelation times long or say that they are
not.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import emcee
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

from mcml_sim.exact.compiled import filter_jit
from mcml_sim.media.checks import require_own_process
from profilefit.errors import InputError
from profilefit.fitting.estimate import Fit, ResidualFunction, scaled_inverse

Floats = NDArray[np.float64]
# emcee's own advice: a chain shorter than this many autocorrelation times does not know its autocorrelation time.
LENGTHS = 50
FIRST_LOOK = 1000  # steps after which the autocorrelation time is estimated first
LAPLACE_LOOK = 250  # the same of `default_moves`, whose tau is below five wherever the approximation holds
PILOT = 200  # steps from draws of Laplace's approximation, of which the later half makes the proposals of the chain
HALVINGS = 20
PRIOR_WIDTH = 10.0
LEVELS = (0.68, 0.95)
KEPT = 1000
Moves = Sequence[tuple[emcee.moves.Move, float]]


# Differential evolution with snooker steps: a third of the evaluations of stretches.
EVOLUTION: Moves = ((emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2))
# Degrees of freedom of Student's t: tails beyond a normal's, so that no walker stays for ever where few proposals fall,
# and so few that forty constants still accept every other draw.
FREEDOM = 20
LAPLACE_SHARE = 0.5  # of the moves; the others walk where the density is nothing like its curvature at the optimum


def laplace_move(centre: Floats, covariance: Floats) -> emcee.moves.MHMove:
    """Proposals that do not depend on where a walker is: t about `centre` (p,), scaled to `covariance` (p, p).

    Accepted by pi(x') q(x) / pi(x) q(x'), so what is sampled is the density and not the approximation to it.
    """
    root = np.linalg.cholesky(covariance + 1e-12 * np.diag(np.diag(covariance)))

    def log_q(white: Floats) -> Floats:
        return -0.5 * (FREEDOM + white.shape[1]) * np.log1p(np.sum(white**2, axis=1) / FREEDOM)

    def propose(points: Floats, random: Any) -> tuple[Floats, Floats]:
        stretch = np.sqrt(FREEDOM / random.chisquare(FREEDOM, len(points)))
        white = stretch[:, None] * random.standard_normal(points.shape)
        before = np.linalg.solve(root, (points - centre).T).T
        return centre + white @ root.T, log_q(before) - log_q(white)

    return emcee.moves.MHMove(propose)


def default_moves(centre: Floats, covariance: Floats) -> Moves:
    """Half of them draws from Laplace's approximation: tau is a few steps wherever it is one. The others evolve."""
    others = tuple((move, (1.0 - LAPLACE_SHARE) * weight) for move, weight in EVOLUTION)
    return (laplace_move(centre, covariance), LAPLACE_SHARE), *others


@dataclass(frozen=True)
class Walk:
    """Chains of walkers.

    samples     (k, p) draws after burn-in, thinned, all walkers of a step together; log_density (k,) there
    tau         the longest integrated autocorrelation time of any coordinate [steps]
    acceptance  mean share of accepted proposals; walkers, steps of the chain
    result      "converged" or what is missing
    """

    samples: Floats
    log_density: Floats
    tau: float
    acceptance: float
    walkers: int
    steps: int
    result: str


def walk(
    log_density: Callable[[Floats], Floats],
    start: Floats,
    centre: Floats,
    seed: int,
    max_steps: int,
    kept: int,
    moves: Moves = EVOLUTION,
    first_look: int = FIRST_LOOK,
) -> Walk:
    """Sample from `start` (walkers, p) until the chain is 50 autocorrelation times long, or `max_steps`.

    log_density  of points (m, p), (m,), vectorised; -inf where there is none. A walker that starts there moves towards
                 `centre` (p,), by halves
    kept         how many draws to keep at most; moves emcee's, with their weights
    first_look   steps after which the chain is judged first
    """
    start = start.copy()
    for _ in range(HALVINGS):
        outside = ~np.isfinite(log_density(start))
        start[outside] = 0.5 * (start[outside] + centre)
    sampler = emcee.EnsembleSampler(*start.shape, log_density, vectorize=True, moves=list(moves))
    sampler.random_state = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(seed))).get_state()
    tau, steps = _long_enough(sampler, start, min(first_look, max_steps), max_steps)
    enough = np.isfinite(tau) and steps >= LENGTHS * tau
    burn = int(min(steps // 2, 5 * tau if np.isfinite(tau) else steps // 2))
    keep = np.linspace(burn, steps - 1, max(min(kept // len(start), steps - burn), 1)).astype(int)
    samples, density = sampler.get_chain()[keep].reshape(-1, start.shape[1]), sampler.get_log_prob()[keep].ravel()
    result = "converged" if enough else f"chain of {steps} steps is under {LENGTHS} autocorrelation times ({tau:.0f})"
    return Walk(samples, density, tau, float(np.mean(sampler.acceptance_fraction)), len(start), steps, result)


def _long_enough(sampler: emcee.EnsembleSampler, start: Floats, steps: int, max_steps: int) -> tuple[float, int]:
    """Run `steps`, and on until the chain is long enough for its own autocorrelation time, looking at most at each
    doubling."""
    state = start
    while True:
        state = sampler.run_mcmc(state, steps - sampler.iteration, progress=False)
        with np.errstate(invalid="ignore"):  # a walker that has not moved yet has no autocorrelation
            tau = float(np.max(sampler.get_autocorr_time(quiet=True, tol=0)))
        if sampler.iteration >= max_steps or (np.isfinite(tau) and sampler.iteration >= LENGTHS * tau):
            return tau, sampler.iteration
        wanted = 1.1 * LENGTHS * tau if np.isfinite(tau) else np.inf  # tau itself grows with the chain
        steps = int(min(np.ceil(wanted), 2 * sampler.iteration, max_steps))


@dataclass(frozen=True)
class Posterior:
    """Chains of one fit's constants.

    names       (p,) of the constants; kind "statistical" or "misfit"
    law         its name, and objective what it was fitted by
    samples     (k, p) thinned draws after burn-in, all walkers of a step together; log_density (k,) of the target there
    tau         the longest integrated autocorrelation time of any constant [steps]
    acceptance  mean share of accepted proposals; walkers, steps of the chain
    result      "converged" or what is missing
    """

    kind: str
    law: str
    objective: str
    names: tuple[str, ...]
    samples: Floats
    log_density: Floats
    tau: float
    acceptance: float
    walkers: int
    steps: int
    result: str

    def interval(self, level: float) -> Floats:
        """Equal-tailed credible intervals (p, 2) at `level` in (0, 1)."""
        return np.quantile(self.samples, [0.5 - level / 2, 0.5 + level / 2], axis=0).T

    @property
    def standard_deviation(self) -> Floats:
        return self.samples.std(axis=0, ddof=1)

    def to_arviz(self) -> Any:
        """The draws as ArviZ has them: an xarray.DataTree, a walker a chain, with the log density as `lp`.

        Walkers of one ensemble learn from each other, so ArviZ's comparison of chains flatters them: `tau` does not.
        Needs the package arviz-base; InputError without it.
        """
        try:
            from arviz_base import from_dict
        except ImportError:
            raise InputError("to_arviz needs the package arviz-base: pip install arviz-base") from None
        shape = (-1, self.walkers)
        draws = {name: column.reshape(shape).T for name, column in zip(self.names, self.samples.T, strict=True)}
        groups = {"posterior": draws, "sample_stats": {"lp": self.log_density.reshape(shape).T}}
        facts = ("law", "objective", "kind", "tau", "acceptance", "steps", "result")
        told = {name: getattr(self, name) for name in facts}
        named = {"/": {"inference_library": "emcee", **told}}
        return from_dict(groups, attrs=named, check_conventions=False)  # it warns of more chains than draws


def posterior(
    fit: Fit, kind: str = "statistical", seed: int = 0, max_steps: int = 20_000, moves: Moves | None = None
) -> Posterior:
    """Sample the constants of `fit`; `kind` "statistical" (photon noise) or "misfit" (the law's, taken for noise).

    moves  emcee's, with their weights; by default `default_moves` about the optimum
    A chain that is not 50 autocorrelation times long after `max_steps` is returned with that result, not refused.
    """
    require_own_process()
    if kind not in ("statistical", "misfit"):
        renamed = ", which is called 'misfit' now" if kind == "discrepancy" else ""
        raise InputError(f"kind must be 'statistical' or 'misfit', got {kind!r}{renamed}")
    if not fit.solution.converged:
        raise InputError(f"a posterior needs a fit that converged, got: {fit.result}")
    if max_steps < 1:
        raise InputError(f"max_steps must be at least 1, got {max_steps!r}")
    covariance = fit.statistical if kind == "statistical" else fit.variance * scaled_inverse(_positive_curvature(fit))
    if covariance is None:
        raise InputError("the truth of this fit has no photon noise: only kind='misfit' applies, got 'statistical'")
    density = _Density.of(fit, kind, covariance)
    return _walk(density, covariance, fit, kind, seed, max_steps, moves)


class _Density(eqx.Module):
    """Logarithm of a posterior density at many points at once.

    Every number is an array: one that is a Python float would be compiled in, and every fit would compile anew.
    """

    law: eqx.Module
    rings: eqx.Module
    centre: Floats | jax.Array
    adjust: Floats | jax.Array
    variance: float | jax.Array
    least: float | jax.Array
    bound: Floats | jax.Array
    problem: ResidualFunction = eqx.field(static=True)

    @classmethod
    def of(cls, fit: Fit, kind: str, covariance: Floats) -> _Density:
        if kind == "statistical":
            adjust, variance = curvature_adjustment(_positive_curvature(fit), covariance)
        else:
            adjust, variance = np.eye(len(fit.free)), fit.variance
        problem = ResidualFunction(fit.objective, fit.free)
        centre = fit.solution.parameters
        bound = PRIOR_WIDTH * np.maximum(np.abs(centre), np.sqrt(np.diag(fit.misfit)))
        with jax.enable_x64(True):
            density = cls(fit.law, fit.rings, centre, adjust, variance, fit.solution.cost, bound, problem)
            return jax.tree.map(jnp.asarray, density)

    @filter_jit
    def __call__(self, points):
        def one(theta):
            moved = self.centre + self.adjust @ (theta - self.centre)
            misfit = self.problem.cost(moved, (self.law, self.rings))
            return -0.5 * (misfit - self.least) / self.variance

        value = jnp.where(jnp.all(jnp.abs(points) < self.bound, axis=1), jax.vmap(one)(points), -jnp.inf)
        return jnp.where(jnp.isfinite(value), value, -jnp.inf)


def _positive_curvature(fit: Fit) -> Floats:
    """The Hessian of Q/2, or J^T J where a saddle of the residuals' own curvature has made it indefinite."""
    hessian, _ = fit.second_derivatives
    scale = np.sqrt(np.abs(np.diag(hessian)))
    if np.all(np.linalg.eigvalsh(hessian / np.outer(scale, scale)) > 0):
        return hessian
    return fit.solution.jacobian.T @ fit.solution.jacobian


def curvature_adjustment(hessian: Floats, covariance: Floats) -> tuple[Floats, float]:
    """C of determinant 1 and s^2 with C^T H C / s^2 = covariance^-1, in scaled constants to keep digits."""
    scale = np.sqrt(np.diag(covariance))
    working = hessian * np.outer(scale, scale)
    root = np.linalg.inv(np.linalg.cholesky(covariance / np.outer(scale, scale)))
    adjust = np.linalg.inv(np.linalg.cholesky(working)).T @ root
    size = np.exp(np.linalg.slogdet(adjust)[1] / scale.size)
    return scale[:, None] * adjust / size / scale[None, :], float(size**-2)


def _walk(density, covariance, fit, kind, seed, max_steps, moves) -> Posterior:
    size = fit.solution.parameters.size
    walkers = max(4 * size, 32)
    generator = np.random.default_rng(seed)
    centre = fit.solution.parameters
    root = np.linalg.cholesky(covariance + 1e-12 * np.diag(np.diag(covariance)))
    start = centre + generator.standard_normal((walkers, size)) @ root.T

    def log_probability(points):
        block = walkers // 4  # which the moves ask for; all of them, or half of them, would compile anew
        full = np.pad(points, ((0, -len(points) % block), (0, 0)), mode="edge").reshape(-1, block, size)
        with jax.enable_x64(True):
            return np.concatenate([np.asarray(density(jnp.asarray(part))) for part in full])[: len(points)]

    chosen, look = moves, FIRST_LOOK
    if not moves:
        # What the walkers themselves have spread to proposes better than a curvature that holds near the optimum only.
        near = default_moves(centre, covariance)
        pilot = walk(log_probability, start, centre, seed, min(PILOT, max_steps), PILOT * walkers, near)
        start, spread = pilot.samples[-walkers:], np.atleast_2d(np.cov(pilot.samples.T))
        chosen, look = default_moves(pilot.samples.mean(axis=0), spread), LAPLACE_LOOK
    done = walk(log_probability, start, centre, seed + 1, max_steps, KEPT, chosen, look)
    return Posterior(kind, type(fit.law).__name__, fit.objective, fit.free, **vars(done))
