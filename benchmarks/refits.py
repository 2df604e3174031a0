"""Fit repeated many times at once: on other photons for the bootstrap, on data drawn anew for interval coverage.

The bootstrap knows nothing of scattering orders, weights or covariances: batches are drawn with replacement, added up
and fitted again (Efron, Annals of Statistics 7, 1979), so it checks the closed forms from outside. B batches know an
error to 1 / sqrt(2 B) of it, and B drawn from B scatter by sqrt(1 - 1/B) too little, which is put right.

Coverage is whether the stated intervals of constants hold the true ones as often as they say, on runs made anew. The
true constants are those that the fit finds without noise: of a law that is the truth its own ones, of a law that is
not the pseudo-true ones (White, Econometrica 50, 1982), which more photons would lead to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.stats import beta, norm

from mcml_sim.errors import InputError
from mcml_sim.results.orders import Orders
from profilefit.fitting.estimate import Fit, ResidualFunction, scaled_inverse
from profilefit.fitting.profiles import Covariance
from profilefit.fitting.solver import solve_batch

Floats = NDArray[np.float64]
CHUNK = 100  # fits at once: a thousand Jacobians of a dozen constants do not fit into a cache
# Directions of a ring below this share of its largest are rounding where few photons arrived: E has no part in them.
FAINTEST = 1e-3


def drawn_noise(of: Covariance, number: int, seed: int) -> Floats:
    """Noise of ring energies (number, alphas, rings + 1) as another run's photons would have it, taken for normal.

    Photons are shared out: what one ring gets, another lacks. So noise that is independent between rings, as of
    Poisson counts, is drawn first, and then freed of the fluctuation t of its total [standard deviations]. Within
    the directions L that each ring keeps, E = sqrt(photons - 1) L y: v of covariance 1 + y y^T, less t y.
    """
    generator = np.random.default_rng(seed)
    root = of.energy.T[:, :, None] / np.sqrt(max(of.photons - 1, 1))
    unit = np.linalg.norm(of.factor, axis=2, keepdims=True)
    unit = np.where(unit > 0, unit, 1.0)
    y = np.einsum("ika,iao->ik", np.linalg.pinv(of.factor / unit, rcond=FAINTEST), root / unit)
    size = 1.0 + np.sum(y**2, axis=1)
    rest = np.sqrt(max(1.0 - float(np.sum(1.0 - 1.0 / size)), 0.0))  # photons that no ring saw
    v = generator.standard_normal((number, *y.shape)) + generator.standard_normal((number, len(y), 1)) * y
    total = np.einsum("rik,ik->r", v, y / size[:, None]) + rest * generator.standard_normal(number)
    return np.einsum("iak,rik->rai", of.factor, v - total[:, None, None] * y, optimize=True)


def refitted(fit: Fit, energy: Floats, start: Floats | None = None) -> tuple[Floats, NDArray[np.bool_]]:
    """Return constants (k, p) of `fit` on other energies (k, m, n + 1), light beyond last, and convergence (k,).

    What counts in `fit` counts in all of them. `start` (p,) is where they begin, by default at the fit's own optimum.
    """
    begin = fit.solution.parameters if start is None else start
    parts = [_chunk(fit, energy[first : first + CHUNK], begin) for first in range(0, len(energy), CHUNK)]
    return np.concatenate([found for found, _ in parts]), np.concatenate([converged for _, converged in parts])


def whole_chunk(count: int) -> NDArray[np.intp]:
    """Return rows that fill a chunk with `count` of them: always one shape, which compiles once."""
    return np.arange(CHUNK) % count


def _chunk(fit: Fit, energy: Floats, start: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    starts = np.tile(start, (CHUNK, 1))
    data = _data(fit, energy[whole_chunk(len(energy))])
    solutions = solve_batch(ResidualFunction(fit.objective, fit.free), starts, data)[: len(energy)]
    return np.stack([one.parameters for one in solutions]), np.array([one.converged for one in solutions])


def _data(fit: Fit, energy: Floats) -> Any:
    """Return the data that `ResidualFunction` reads, once for each of `energy` (k, m, n + 1)."""
    data = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (len(energy), *np.shape(leaf))), (fit.law, fit.rings))
    return eqx.tree_at(lambda tree: (tree[1].energy, tree[1].beyond), data, (energy[..., :-1], energy[..., -1]))


FEWEST = 10  # batches: fewer know their own scatter to worse than a quarter


@dataclass(frozen=True)
class Bootstrap:
    """Constants of refits (k, p), how many refits failed, and the covariance (p, p) that their scatter gives."""

    names: tuple[str, ...]
    constants: Floats
    failed: int
    batches: int

    @property
    def covariance(self) -> Floats:
        scale = self.batches / (self.batches - 1)
        return np.atleast_2d(scale * np.cov(self.constants, rowvar=False))

    @property
    def standard_error(self) -> Floats:
        return np.sqrt(np.diag(self.covariance))


def bootstrap(batches: Sequence[Orders], fit: Fit, number: int = 400, seed: int = 0) -> Bootstrap:
    """Refit `fit` to `number` resamples of the runs in `batches`, equally large ones on the rings of the fit.

    InputError for fewer than ten batches, unequal ones, or other rings or light.
    """
    energy = energies(batches, fit)
    drawn = np.random.default_rng(seed).multinomial(len(batches), np.full(len(batches), 1.0 / len(batches)), number)
    found, converged = refitted(fit, np.einsum("kb,bai->kai", drawn / len(batches), energy))
    return Bootstrap(fit.free, found[converged], int(np.sum(~converged)), len(batches))


def energies(batches: Sequence[Orders], fit: Fit) -> Floats:
    """Return energies (b, m, n + 1) of each batch on the rings of `fit`, the light beyond the last one last."""
    if len(batches) < FEWEST:
        raise InputError(f"batches must be at least {FEWEST}, got {len(batches)}")
    if len({batch.photons for batch in batches}) > 1:
        raise InputError("batches must be of equally many photons, got different ones")
    if len({batch.seed for batch in batches}) < len(batches):
        raise InputError("batches must be of different seeds, got one twice: it would be the same photons")
    if any(batch.setting != fit.law.setting for batch in batches):
        raise InputError(f"batches must belong to {fit.law.setting}, as the fit does, got another setting")
    alpha, edges = np.asarray(fit.rings.alpha), np.asarray(fit.rings.r_edges)
    return np.stack([_energy(batch.merged(edges), alpha) for batch in batches])


def _energy(batch: Orders, alpha: Floats) -> Floats:
    return np.column_stack([batch.energy(alpha).value, batch.overflow(alpha).value])


LEVELS = (0.68, 0.95)
BAND = 0.99  # of all shares together, so each one's band is wider (Sidak)


@dataclass(frozen=True)
class Refits:
    """Fits to runs made anew.

    truth     (p,) constants that a fit without noise finds
    found     (k, p) of the replicates that converged; failed how many did not
    gain      (k, p, m, n) d constants / d ring energies at each one's own optimum
    """

    names: tuple[str, ...]
    truth: Floats
    found: Floats
    failed: int
    gain: Floats

    def sandwich_errors(self, covariance: Covariance) -> Floats:
        """Return standard errors (k, p), each replicate's by the derivative of its own optimum."""
        return np.sqrt(np.stack([np.diag(covariance.sandwich(one)) for one in self.gain]))

    def independent_errors(self, covariance: Covariance) -> Floats:
        """Return errors (k, p) if each ring and albedo had noise of its own, which photons of one run do not give."""
        variance = np.sum(covariance.factor**2, axis=2).T
        rings = min(variance.shape[1], self.gain.shape[-1])
        return np.sqrt(np.einsum("kpai,ai->kp", self.gain[..., :rings] ** 2, variance[:, :rings]))


@dataclass(frozen=True)
class Coverage:
    """Shares of intervals that held the true constants.

    levels (L,) asked for; share (L, p) found; replicates behind each share; band (L, 2) where 99 of 100 honest tables
    have every one of their shares
    """

    names: tuple[str, ...]
    levels: tuple[float, ...]
    share: Floats
    replicates: int
    band: Floats

    @property
    def inside(self) -> NDArray[np.bool_]:
        """Whether each share lies in its band, (L, p)."""
        return (self.share >= self.band[:, :1]) & (self.share <= self.band[:, 1:])

    @property
    def honest(self) -> bool:
        return bool(np.all(self.inside))


def refits(fit: Fit, energy: Floats, noise: Floats) -> Refits:
    """Repeat `fit` on `energy` (m, n + 1), the light beyond last, with each of `noise` (k, m, n + 1) added.

    The rings and albedos that count stay those of `fit`. InputError where the fit fails without noise.
    """
    clean, ok = refitted(fit, energy[None])
    if not ok[0]:
        raise InputError(f"energy must let {type(fit.law).__name__} converge without noise, got one where it does not")
    whole = energy + noise
    found, converged = refitted(fit, whole, clean[0])
    kept, count = found[converged], int(np.sum(~converged))
    return Refits(fit.free, clean[0], kept, count, gains(fit, kept, whole[converged]))


def gains(fit: Fit, parameters: Floats, energy: Floats) -> Floats:
    """Return d constants / d energies (k, p, m, n + 1) at optima (k, p) of `fit` on energies (k, m, n + 1)."""
    starts = range(0, len(parameters), CHUNK)
    return np.concatenate([_gains(fit, parameters[i : i + CHUNK], energy[i : i + CHUNK]) for i in starts])


def coverage(names: tuple[str, ...], off: Floats, error: Floats, levels: tuple[float, ...] = LEVELS) -> Coverage:
    """Return shares of normal intervals that hold the truth: `off` (k, p) found less true, `error` (k, p) or (p,)."""
    within = np.abs(off)[None] <= norm.isf(0.5 - np.array(levels) / 2)[:, None, None] * error
    return counted(names, within, levels)


def counted(names: tuple[str, ...], within: NDArray[np.bool_], levels: tuple[float, ...] = LEVELS) -> Coverage:
    """Return the table of `within` (L, k, p): whether the interval of each level, replicate and constant held."""
    number = within.shape[1]
    band = np.array([binomial_band(level, number, len(levels) * len(names)) for level in levels])
    return Coverage(names, levels, within.mean(axis=1), number, band)


def binomial_band(level: float, number: int, shares: int) -> tuple[float, float]:
    """Return shares of `number` trials between which all `shares` independent ones lie with probability 0.99.

    Clopper and Pearson (Biometrika 26, 1934) turned round: `level` lies in the interval of every share of the band.
    """
    tail = (1.0 - BAND ** (1.0 / shares)) / 2
    hits = np.arange(number + 1)
    low = np.where(hits > 0, beta.ppf(tail, hits, number - hits + 1), 0.0)
    high = np.where(hits < number, beta.isf(tail, hits + 1, number - hits), 1.0)
    held = hits[(low <= level) & (level <= high)]
    return float(held[0] / number), float(held[-1] / number)


def _gains(fit: Fit, parameters: Floats, energy: Floats) -> Floats:
    count, fill = len(parameters), whole_chunk(len(parameters))
    problem = ResidualFunction(fit.objective, fit.free)
    with jax.enable_x64(True):
        law, rings = (jax.tree.map(jnp.asarray, part) for part in (fit.law, fit.rings))
        points = jnp.asarray(parameters[fill]), jnp.asarray(energy[fill])
        hessian, mixed = (np.asarray(part)[:count] for part in _second_derivatives(problem, law, rings, *points))
    inverse = np.stack([scaled_inverse(one) for one in hessian])
    return -np.einsum("kpq,kaiq->kpai", inverse, mixed, optimize=True)


@eqx.filter_jit
def _second_derivatives(problem, law, rings, parameters, energy):
    def cost(theta, energies):
        data = eqx.tree_at(lambda tree: (tree.energy, tree.beyond), rings, (energies[:, :-1], energies[:, -1]))
        return 0.5 * problem.cost(theta, (law, data))

    hessian = jax.jacfwd(jax.grad(cost))
    mixed = jax.jacfwd(jax.grad(cost, argnums=1))
    return jax.vmap(hessian)(parameters, energy), jax.vmap(mixed)(parameters, energy)
