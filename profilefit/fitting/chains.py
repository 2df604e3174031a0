"""Posteriors: emcee samples the constants of a law or of a medium, in coordinates that straighten what they trade.

Where parameters trade against each other, what fits is a thin bent ridge, along which walkers hardly move: they can
miss half of its length, and their autocorrelation does not show it. So they walk in straight coordinates: the first
parameter, and the others less their best values where the first is fixed, over their errors there (`Ridge`). Chains
start as draws of the ridge, propose such draws, and run until they are 50 autocorrelation times long or say that they
are not.

A fit of a law to profiles has two posteriors:

statistical   exp(-Q(theta*) / 2 s^2) with theta* = theta^ + C (theta - theta^): the working misfit Q with its curvature
              adjusted to the sandwich covariance (Chandler and Bate, Biometrika 94, 2007), which is the spread that
              photon noise really causes when the working weights are not the inverse noise; s makes det C = 1, so
              that Q is probed as far from its optimum as the photons move it
misfit        exp(-Q(theta) / 2 s^2), s^2 the misfit per degree of freedom: what the law's misfit leaves open if it were
              noise. It is not, so read it beside the fit's jackknife
Priors are flat in the constants, each within ten times its size or its own misfit error, whichever is larger.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import emcee
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.interpolate import BSpline, CubicHermiteSpline, make_interp_spline

from mcml_sim.exact.compiled import WIDE, filter_jit
from mcml_sim.media.arrays import Floats, require, require_own_process
from profilefit.errors import InputError
from profilefit.fitting.estimate import Fit, ResidualFunction, scaled_inverse
from profilefit.fitting.solver import Solution

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
WIDEST = 1.0  # error of a coordinate that the data leave open
STRIDE, LONGER, NODES = 0.4, 1.15, 30  # errors between the first two nodes of a ridge, and on; nodes to either side
FALL = 15.0  # of ln density from its top, beyond which a ridge is not followed
NORMAL = np.linspace(-6.0, 6.0, 49)  # standard errors of the first parameter, at the nodes of a normal density's ridge


# Differential evolution with snooker steps: a third of the evaluations of stretches.
EVOLUTION: Moves = ((emcee.moves.DEMove(), 0.8), (emcee.moves.DESnookerMove(), 0.2))
# Degrees of freedom of Student's t: tails beyond a normal's, so that no walker stays for ever where few proposals fall,
# and so few that forty constants still accept every other draw.
FREEDOM = 20
LAPLACE_SHARE = 0.5  # of the moves; the others walk where the density is nothing like its curvature at the optimum


def laplace_move(centre: Floats, covariance: Floats) -> emcee.moves.MHMove:
    """Return proposals that do not depend on where a walker is: t about `centre` (p,) with `covariance` (p, p)."""
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
    """Return moves of which half are draws from Laplace's approximation, and the others evolve."""
    others = tuple((move, (1.0 - LAPLACE_SHARE) * weight) for move, weight in EVOLUTION)
    return (laplace_move(centre, covariance), LAPLACE_SHARE), *others


@dataclass(frozen=True)
class Node:
    """Best values of all parameters but the first where that has one value, and their errors there.

    slope  (p - 1,) derivatives of the others by the first; root (p - 1, p - 1) of their covariance: triangular
    log    ln density of the first, the others integrated over as a normal; -inf where it is not finite
    """

    first: float
    others: Floats
    slope: Floats
    root: Floats
    log: float

    @classmethod
    def of(cls, there: Solution, free: Sequence[int], log_density: Callable[[Floats], Floats]) -> Node:
        """Return the node of a fit of the others, whose residuals are in standard errors.

        free  places of the p parameters in the fit; log_density there for ln of the volume of the others' errors
        """
        first, others = free[0], list(free[1:])
        ways, point = there.jacobian[:, others], there.parameters
        if not (np.isfinite(there.cost) and np.all(np.isfinite(ways))):
            return cls(float(point[first]), point[others], 0.0 * point[others], np.eye(len(others)), -np.inf)
        r = np.linalg.qr(np.vstack([ways, np.eye(len(others)) / WIDEST]), mode="r")
        root = np.asarray(np.linalg.inv(np.sign(np.diag(r))[:, None] * r), float)
        slope = np.asarray(-root @ root.T @ ways.T @ there.jacobian[:, first], float)
        log = float(log_density(np.sum(np.log(np.diag(root)))))
        return cls(float(point[first]), point[others], slope, root, log)


@dataclass(frozen=True)
class Ridge:
    """Nodes whose first parameter rises, two at least; `spread` is the covariance of the others, None for 1."""

    nodes: tuple[Node, ...]
    spread: Floats | None = None

    @classmethod
    def normal(cls, centre: Floats, covariance: Floats) -> Ridge:
        """Return the straight ridge of a normal density of `centre` (p,) and `covariance` (p, p)."""
        root = np.linalg.cholesky(covariance + 1e-12 * np.diag(np.diag(covariance)))
        across = root[1:, 0] / root[0, 0]
        firsts = centre[0] + NORMAL * root[0, 0]
        nodes = (
            Node(float(at), centre[1:] + (at - centre[0]) * across, across, np.eye(across.size), -0.5 * float(z) ** 2)
            for at, z in zip(firsts, NORMAL, strict=True)
        )
        return cls(tuple(nodes), root[1:, 1:] @ root[1:, 1:].T)

    @classmethod
    def along(cls, best: Node, moved: Callable[[Node, float], Node], ends: tuple[float, float], error: float) -> Ridge:
        """Follow a ridge from its best node to either side, in strides of the first parameter's standard `error`.

        moved  the node where that has another value, from one near it; ends its lowest and highest value
        """
        nodes = [best]
        for side in (-1.0, 1.0):
            last, step = best, side * STRIDE * min(error or WIDEST, WIDEST)
            for _ in range(NODES):
                last, step = moved(last, float(np.clip(last.first + step, *ends))), step * LONGER
                if not np.isfinite(last.log):
                    break
                nodes.append(last)
                if last.first in ends or last.log < max(one.log for one in nodes) - FALL:
                    break
        return cls(tuple(sorted(nodes, key=lambda one: one.first)))

    @cached_property
    def first(self) -> Floats:
        return np.array([one.first for one in self.nodes])

    @cached_property
    def _others(self) -> CubicHermiteSpline:
        values, slopes = zip(*((one.others, one.slope) for one in self.nodes), strict=True)
        return CubicHermiteSpline(self.first, np.array(values), np.array(slopes))

    @cached_property
    def _root(self) -> BSpline:
        return make_interp_spline(self.first, [one.root for one in self.nodes], k=1)

    def bent(self, straight: Floats) -> tuple[Floats, Floats]:
        """Return parameters (m, p) at straight coordinates (m, p), and ln of the volume (m,) of those in these."""
        within = np.clip(straight[:, 0], self.first[0], self.first[-1])
        if self.spread is not None:  # every root is 1
            return np.column_stack([straight[:, 0], self._others(within) + straight[:, 1:]]), np.zeros(len(within))
        root = self._root(within)
        others = self._others(within) + np.einsum("mij,mj->mi", root, straight[:, 1:])
        return np.column_stack([straight[:, 0], others]), np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1)

    @property
    def moments(self) -> tuple[Floats, Floats]:
        """Mean (p,) and covariance (p, p) of the straight coordinates."""
        log = np.array([one.log for one in self.nodes])
        share = np.exp(log - log.max()) * np.gradient(self.first)
        share /= share.sum()
        size = 1 + self.nodes[0].others.size
        centre, covariance = np.zeros(size), np.eye(size)
        centre[0] = share @ self.first
        covariance[0, 0] = share @ (self.first - centre[0]) ** 2
        if self.spread is not None:
            covariance[1:, 1:] = self.spread
        return centre, covariance


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


def sample(
    log_density: Callable[[Floats, Floats], Floats],
    along: Ridge,
    walkers: int,
    seed: int,
    max_steps: int,
    kept: int,
    pilot: int = 0,
) -> Walk:
    """Sample a density by walkers in the straight coordinates of a ridge.

    Args:
        log_density: of points (m, p), (m,), vectorised; -inf where there is none. Its second argument, to be added, is
            ln of the volume (m,) that straight coordinates have there.
        along: the ridge.
        walkers: how many.
        seed: of starts and proposals.
        max_steps: after which a chain ends though it is too short.
        kept: how many draws to keep at most.
        pilot: steps of a first chain, whose spread makes the proposals of the one that counts.
    """

    def straight_density(straight: Floats) -> Floats:
        points, volume = along.bent(straight)
        return log_density(points, volume)

    centre, covariance = along.moments
    start = np.random.default_rng(seed).multivariate_normal(centre, covariance, walkers)
    if pilot:
        near = default_moves(centre, covariance)
        first = walk(straight_density, start, centre, seed, min(pilot, max_steps), pilot * walkers, near)
        start, seed = first.samples[-walkers:], seed + 1
        centre, covariance = first.samples.mean(axis=0), np.atleast_2d(np.cov(first.samples.T))
    chosen = default_moves(centre, covariance)
    walked = walk(straight_density, start, centre, seed, max_steps, kept, chosen, LAPLACE_LOOK)
    samples, volume = along.bent(walked.samples)
    return replace(walked, samples=samples, log_density=walked.log_density - volume)


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

    A walker that starts where there is no density moves towards `centre` (p,), by halves; other arguments as of
    `sample`. The chain is judged first after `first_look` steps.
    """
    start = start.copy()
    for _ in range(HALVINGS):
        outside = ~np.isfinite(log_density(start))
        if not np.any(outside):
            break
        start[outside] = 0.5 * (start[outside] + centre)
    sampler = emcee.EnsembleSampler(*start.shape, log_density, vectorize=True, moves=list(moves))
    sampler.random_state = np.random.RandomState(np.random.MT19937(np.random.SeedSequence(seed))).get_state()
    state, steps = start, min(first_look, max_steps)
    while True:  # looking at each doubling at most
        state = sampler.run_mcmc(state, steps - sampler.iteration, progress=False)
        with np.errstate(invalid="ignore"):  # a walker that has not moved yet has no autocorrelation
            tau = float(np.max(sampler.get_autocorr_time(quiet=True, tol=0)))
        steps, enough = sampler.iteration, bool(np.isfinite(tau) and sampler.iteration >= LENGTHS * tau)
        if enough or steps >= max_steps:
            break
        least = 1.1 * LENGTHS * tau if np.isfinite(tau) else np.inf  # tau itself grows with the chain
        steps = int(min(np.ceil(least), 2 * steps, max_steps))
    burn = int(min(steps // 2, 5 * tau if np.isfinite(tau) else steps // 2))
    keep = np.linspace(burn, steps - 1, max(min(kept // len(start), steps - burn), 1)).astype(int)
    samples, density = sampler.get_chain()[keep].reshape(-1, start.shape[1]), sampler.get_log_prob()[keep].ravel()
    result = "converged" if enough else f"chain of {steps} steps is under {LENGTHS} autocorrelation times ({tau:.0f})"
    return Walk(samples, density, tau, float(np.mean(sampler.acceptance_fraction)), len(start), steps, result)


@dataclass(frozen=True)
class Posterior(Walk):
    """Chains of one fit's constants (p,), of a kind "statistical" or "misfit"."""

    kind: str
    law: str
    objective: str
    names: tuple[str, ...]

    def interval(self, level: float) -> Floats:
        """Return equal-tailed credible intervals (p, 2) at `level` in (0, 1)."""
        return np.quantile(self.samples, [0.5 - level / 2, 0.5 + level / 2], axis=0).T

    @property
    def standard_deviation(self) -> Floats:
        return self.samples.std(axis=0, ddof=1)

    def to_arviz(self) -> Any:
        """Return the draws as an xarray.DataTree of ArviZ, a walker a chain, with the log density as `lp`.

        Walkers of one ensemble learn from each other, so ArviZ's comparison of chains flatters them: `tau` does not.
        InputError without the package arviz-base.
        """
        try:
            from arviz_base import from_dict
        except ImportError:
            raise InputError("to_arviz needs the package arviz-base: pip install arviz-base") from None
        shape = (-1, self.walkers)
        draws = {name: column.reshape(shape).T for name, column in zip(self.names, self.samples.T, strict=True)}
        groups = {"posterior": draws, "sample_stats": {"lp": self.log_density.reshape(shape).T}}
        facts = ("law", "objective", "kind", "tau", "acceptance", "steps", "result")
        named = {"/": {"inference_library": "emcee", **{name: getattr(self, name) for name in facts}}}
        return from_dict(groups, attrs=named, check_conventions=False)  # it warns of more chains than draws


def posterior(fit: Fit, kind: str = "statistical", seed: int = 0, max_steps: int = 20_000) -> Posterior:
    """Sample the constants of a fit.

    Args:
        fit: one that converged.
        kind: "statistical" (photon noise) or "misfit" (the law's, taken for noise).
        seed: of the walkers.
        max_steps: the longest that a chain may get; one that is not 50 autocorrelation times long then says so.
    """
    require_own_process()
    if kind not in ("statistical", "misfit"):
        renamed = ", which is called 'misfit' now" if kind == "discrepancy" else ""
        raise InputError(f"kind must be 'statistical' or 'misfit', got {kind!r}{renamed}")
    if not fit.solution.converged:
        raise InputError(f"a posterior needs a fit that converged, got: {fit.result}")
    require(max_steps >= 1, "max_steps", "at least 1", max_steps)
    covariance = fit.statistical if kind == "statistical" else fit.variance * scaled_inverse(_positive_curvature(fit))
    if covariance is None:
        raise InputError("the truth of this fit has no photon noise: only kind='misfit' applies, got 'statistical'")
    density, size = _Density.of(fit, kind, covariance), len(fit.free)
    walkers = max(4 * size, 32)

    def log_density(points: Floats, volume: Floats) -> Floats:
        block = walkers // 4  # which the moves ask for; all of them, or half of them, would compile anew
        full = np.pad(points, ((0, -len(points) % block), (0, 0)), mode="edge").reshape(-1, block, size)
        with jax.enable_x64(True):
            return np.concatenate([np.asarray(density(jnp.asarray(part))) for part in full])[: len(points)] + volume

    along = Ridge.normal(fit.solution.parameters, covariance)
    chain = sample(log_density, along, walkers, seed, max_steps, KEPT, PILOT)
    return Posterior(**vars(chain), kind=kind, law=type(fit.law).__name__, objective=fit.objective, names=fit.free)


class _Density(eqx.Module):
    """Logarithm of a posterior density at many points at once; every number is an array, lest it be compiled in."""

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
        centre = fit.solution.parameters
        bound = PRIOR_WIDTH * np.maximum(np.abs(centre), np.sqrt(np.diag(fit.misfit)))
        numbers = centre, adjust, variance, fit.solution.cost, bound
        with jax.enable_x64(True):
            density = cls(fit.law, fit.rings, *numbers, ResidualFunction(fit.objective, fit.free))
            return jax.tree.map(jnp.asarray, density)

    @partial(filter_jit, options=WIDE)
    def __call__(self, points):
        def log_density(theta):
            moved = self.centre + self.adjust @ (theta - self.centre)
            misfit = self.problem.cost(moved, (self.law, self.rings))
            return -0.5 * (misfit - self.least) / self.variance

        value = jnp.where(jnp.all(jnp.abs(points) < self.bound, axis=1), jax.vmap(log_density)(points), -jnp.inf)
        return jnp.where(jnp.isfinite(value), value, -jnp.inf)


def _positive_curvature(fit: Fit) -> Floats:
    """Return the Hessian of Q/2, or J^T J where a saddle of the residuals' own curvature has made it indefinite."""
    hessian, _ = fit.second_derivatives
    scale = np.sqrt(np.abs(np.diag(hessian)))
    if np.all(np.linalg.eigvalsh(hessian / np.outer(scale, scale)) > 0):
        return hessian
    return fit.solution.jacobian.T @ fit.solution.jacobian


def curvature_adjustment(hessian: Floats, covariance: Floats) -> tuple[Floats, float]:
    """Return C of determinant 1 and s^2 with C^T H C / s^2 = covariance^-1, in scaled constants to keep digits."""
    scale = np.sqrt(np.diag(covariance))
    working = hessian * np.outer(scale, scale)
    root = np.linalg.inv(np.linalg.cholesky(covariance / np.outer(scale, scale)))
    adjust = np.linalg.inv(np.linalg.cholesky(working)).T @ root
    size = np.exp(np.linalg.slogdet(adjust)[1] / scale.size)
    return scale[:, None] * adjust / size / scale[None, :], float(size**-2)
