"""Misfit of a fit: whether errors as stated explain the residuals, and if not, the Gaussian process that they show.

The residuals R of n rows, in standard errors, are projected onto what the p fitted coordinates cannot take up: n - p
numbers z whose covariance is known, S = N^T (1 + B) N, B being the law's own error. Two tests are made of them:

scatter  chi-square z^T S^-1 z, of n - p degrees of freedom
waves    the score z^T S^-1 D S^-1 z of a relative error that is correlated along ln r (D): a layer underneath, a wrong
         unit or a wrong law leave residuals that are no independent noise. Its distribution, a weighted sum of
         chi-squares, is sampled
Errors made from replicates share the error of their trend: with `pooled` degrees of freedom behind it chi-square is an
F, and the waves' draws are divided likewise. Both p-values are combined by Sidak's rule. The misfit is the relative
error, row by row, that brings chi-square to n - p.

Which error of the model would leave such residuals is a question to a restricted likelihood (REML), that of what the
fitted constants cannot take up. `lack_of_fit` sums over relative standard deviations d and some correlations along
ln r; `likeliest` finds amplitude and lengths of a process over two coordinates, with Matern's covariance (nu = 3/2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import special, stats
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpotri
from scipy.optimize import brentq

from mcml_sim.media.arrays import Floats
from profilefit.fitting.solver import minimise

DETECTED = 1e-3  # p-value below which a misfit counts as one
DRAWS = 10_000
TINY = float(np.finfo(float).tiny)
LARGEST = 1e3  # relative error beyond which a misfit is no longer measured
# Relative errors d of a lack of fit that are tried, over that of a row: how many, the least, and the largest, or as
# many times the root mean square of the residuals.
SIZES, LEAST, MOST, TIMES = 20, 0.05, 20.0, 4.0
NUGGET = 1e-3  # of the amplitude's square, left to each ring alone: without it the finest scale decides on the largest
MAX_STEPS = 300
TOLERANCE = 1e-3  # of the likelihood's slope by ln of amplitude and lengths: a hundredth of what data resolve
FARTHEST = 12.0  # of ln amplitude from that of the residuals
STEP = 1e-3  # in ln of amplitude and lengths, between gradients that make a curvature


@dataclass(frozen=True)
class Misfit:
    """Goodness of fit.

    chi2, freedom    by the data's errors alone; chance its p-value
    scatter, waves   p-values where data and law have the errors stated; joined that of both
    along_r          lag-1 autocorrelation of the residuals; runs the number of sign runs, and that expected of noise
    relative         relative error [-] that brings chi-square to its degrees of freedom
    """

    chi2: float
    freedom: int
    chance: float
    scatter: float
    waves: float
    joined: float
    along_r: float
    runs: tuple[int, float]
    relative: float

    @property
    def detected(self) -> bool:
        return self.joined < DETECTED

    @property
    def within_law(self) -> bool:
        """True where a misfit by the data's errors alone is explained by the law's own error."""
        return self.chance < DETECTED and not self.detected


def misfit(
    residuals: Floats,
    jacobian: Floats,
    law: Floats,
    shape: Floats,
    rows: int,
    uneven: Floats | None = None,
    pooled: float = np.inf,
) -> Misfit:
    """Judge residuals of a fit; all arguments are in standard errors.

    Args:
        residuals: (m,), the first `rows` of them along r.
        jacobian: (m, p) their derivatives.
        law: (m, m) covariance of the law's own error.
        shape: (m, m) that of a relative error 1 in waves.
        rows: how many lie along r.
        uneven: (m, m) that of a relative error 1 of each row; by default, shape without its correlations.
        pooled: degrees of freedom of what the rows' errors share.
    """
    free = np.linalg.qr(jacobian, mode="complete")[0][:, jacobian.shape[1] :]
    z, along = free.T @ residuals, residuals[:rows]
    own, waved = np.eye(z.size) + free.T @ law @ free, free.T @ shape @ free
    scatter = scatter_chance(float(z @ np.linalg.solve(own, z)), z.size, pooled)
    score = wave_chance(z, own, waved, pooled)
    signs, chi2 = np.sign(along), float(residuals @ residuals)
    lag = float(along[1:] @ along[:-1]) / max(float(along @ along), TINY)
    runs = 1 + int(np.sum(signs[1:] != signs[:-1])), 1 + (rows - 1) / 2
    relative = amplitude(z, own, free.T @ (np.diag(np.diag(shape)) if uneven is None else uneven) @ free)
    chances = scatter_chance(chi2, z.size, pooled), scatter, score, 1.0 - (1.0 - min(scatter, score)) ** 2
    return Misfit(chi2, z.size, *chances, lag, runs, relative)


def lack_of_fit(
    residuals: Floats, jacobian: Floats, law: Floats, shapes: Floats, pooled: float = np.inf
) -> tuple[Floats, float]:
    """Estimate the relative variances (k,) of errors of these shapes (k, m, m), of which the residuals show the sum.

    The prior is flat in ln d and among the shapes. The second value is ln of how many times likelier z is with such
    errors than without any, over the prior; -inf where there is nothing to estimate.
    """
    free = np.linalg.qr(jacobian, mode="complete")[0][:, jacobian.shape[1] :]
    root = np.linalg.cholesky(np.eye(free.shape[1]) + free.T @ law @ free)
    z = np.linalg.solve(root, free.T @ residuals)
    own = np.diag(shapes[0])
    if not (z.size and np.any(own > 0) and np.isfinite(z @ z)):
        return np.zeros(len(shapes)), -np.inf
    d = np.median(own[own > 0]) ** -0.5 * np.geomspace(LEAST, max(MOST, TIMES * float(np.sqrt(z @ z / z.size))), SIZES)
    gain = np.zeros((len(shapes), SIZES))
    for at, shape in enumerate(shapes):
        inner = np.linalg.solve(root, np.linalg.solve(root, free.T @ shape @ free).T)
        values, vectors = np.linalg.eigh(0.5 * (inner + inner.T))
        growth = 1.0 + np.outer(d**2, np.maximum(values, 0.0))
        gain[at] = likelihood(np.sum((z @ vectors) ** 2 / growth, axis=1), z.size, pooled)
        gain[at] -= 0.5 * np.sum(np.log(growth), axis=1) + likelihood(z @ z, z.size, pooled)
    top = float(gain.max())
    share = np.exp(gain - top)
    return np.asarray(share / share.sum() @ d**2, float), top + float(np.log(share.mean()))


def scatter_chance(square: float, freedom: int, pooled: float) -> float:
    """Return the p-value of a chi-square whose errors share a scale of `pooled` degrees of freedom."""
    if np.isinf(pooled):
        return float(stats.chi2.sf(square, freedom))
    return float(stats.f.sf(square / freedom, freedom, pooled))


def wave_chance(z: Floats, own: Floats, shape: Floats, pooled: float) -> float:
    """Return the p-value of the score z^T S^-1 D S^-1 z under the covariance S = `own` of z."""
    there = np.linalg.solve(own, z)
    root = np.linalg.cholesky(own)
    inner = np.linalg.solve(root, np.linalg.solve(root, shape).T)
    weights = np.linalg.eigvalsh(0.5 * (inner + inner.T))
    weights = weights[weights > 1e-6 * weights.max()]
    generator = np.random.default_rng(0)
    drawn = generator.chisquare(1.0, (DRAWS, weights.size)) @ weights
    if np.isfinite(pooled):
        drawn /= generator.chisquare(pooled, DRAWS) / pooled
    return float((1 + np.sum(drawn >= there @ shape @ there)) / (1 + DRAWS))


def amplitude(z: Floats, own: Floats, relative: Floats) -> float:
    """Return the relative error d for which z^T (S + d^2 D)^-1 z is its degrees of freedom; 0 if d = 0 gives less."""

    def excess(d: float) -> float:
        return float(z @ np.linalg.solve(own + d**2 * relative, z)) - z.size

    if excess(0.0) <= 0:
        return 0.0
    return LARGEST if excess(LARGEST) > 0 else float(brentq(excess, 0.0, LARGEST, xtol=1e-8))


def gaussianised(residuals: Floats, freedom: Floats, pooled: float = np.inf) -> Floats:
    """Return residuals (m,), the first of which are over errors of `freedom` (n,), as normal ones of equal chance."""
    # Of what each row's error has for itself: errors of ln variance, 2 / d, add up.
    own = np.where(np.isfinite(freedom), 1.0 / freedom, 0.0) - 1.0 / pooled
    own = np.where(own > 0, 1.0 / np.where(own > 0, own, 1.0), np.inf)
    rows, rest = np.split(residuals, [freedom.size])
    size = np.abs(rows)
    tail = stats.t.logsf(size, own)
    # Where Student's tail has no float left, so many degrees of freedom are behind it that it is a normal one.
    few = np.isfinite(own) & np.isfinite(tail)
    return np.append(np.sign(rows) * np.where(few, -special.ndtri_exp(np.where(few, tail, 0.0)), size), rest)


def likelihood(rise: Floats, free: int, pooled: float) -> Floats:
    """Return ln likelihood (m,) where chi-square has risen by `rise`: normal, or Student's in `free` coordinates."""
    if np.isinf(pooled):
        return -0.5 * rise
    return -0.5 * (pooled + free) * np.log1p(np.maximum(rise, 0.0) / pooled)


def waves(r: Floats, length: float, rough: bool = False) -> Floats:
    """Return correlations (n, n) of an error in smooth waves along ln r, of this length [ln r]; 0: independent rows.

    Rows are weighed by rough ones: by smooth ones neighbours would be trusted for what they say beside the error.
    """
    distance = apart(np.log(r), np.log(r))
    far = distance / length if length else np.where(np.eye(r.size) > 0, 0.0, np.inf)
    return np.asarray(np.exp(-far if rough else -0.5 * far**2), float)


def apart(first: Floats, other: Floats) -> Floats:
    """Return distances (k, l) of numbers, or of points in a plane or in space."""
    between = first[:, None] - other
    return np.abs(between) if first.ndim == 1 else np.linalg.norm(between, axis=-1)


def matern(distance: Floats) -> Floats:
    """Return the correlation at distances in units of the length."""
    return _bent(distance)[0]


def _bent(distance: Floats) -> tuple[Floats, Floats]:
    """Return `matern` and its derivative by ln length."""
    scaled = np.sqrt(3.0) * distance
    decay = np.exp(-scaled)
    return (1.0 + scaled) * decay, scaled**2 * decay


def _loss(theta: Floats, apart_u, apart_s, y, slope, noise) -> tuple[float, Floats]:
    """Return minus the restricted log likelihood at ln of amplitude and lengths, and its gradient (3,)."""
    square = np.exp(2.0 * theta[0])
    (along_u, bent_u), (along_s, bent_s) = _bent(apart_u * np.exp(-theta[1])), _bent(apart_s * np.exp(-theta[2]))
    kernel = square * along_u * along_s
    kernel.flat[:: y.size + 1] += square * NUGGET
    value, by_covariance = _restricted(kernel + noise, y, slope)
    parts = kernel, bent_u * along_s, along_u * bent_s
    return value, np.array([2.0, square, square]) * [np.vdot(by_covariance, part) for part in parts]


def _restricted(covariance: Floats, y: Floats, slope: Floats) -> tuple[float, Floats]:
    """Return minus Patterson and Thompson's (3) of `y` but for `slope` times anything; derivatives by `covariance`."""
    root = np.linalg.cholesky(covariance)
    lower = dpotri(root, lower=1)[0]  # lower triangle of the inverse, in a third of the time that solving takes
    across, triangle = np.linalg.qr(solve_triangular(root, slope, lower=True))
    seen = solve_triangular(root, across, lower=True, trans=1)
    inverse = lower + lower.T - seen @ seen.T  # of what `slope` leaves
    inverse.flat[:: y.size + 1] -= np.diag(lower)
    rest = inverse @ y
    logs = np.sum(np.log(np.diag(root))) + np.sum(np.log(np.abs(np.diag(triangle))))
    return float(logs + 0.5 * (y @ rest)), 0.5 * (inverse - np.outer(rest, rest))


def likeliest(begin: Floats, limits: Floats, args) -> tuple[Floats, Floats, float, bool]:
    """Return theta, the curvature of the loss there (0 at a limit), the gain over noise alone, and convergence."""
    ends = limits[:, 0], limits[:, 1]
    theta, loss, converged = minimise(lambda x: _loss(x, *args), begin, ends, TOLERANCE, MAX_STEPS)
    around = [[_loss(theta + sign * STEP * axis, *args)[1] for sign in (1, -1)] for axis in np.eye(3)]
    curved = np.array([(after - before) / (2.0 * STEP) for after, before in around])
    free = (limits[:, 0] < theta) & (theta < limits[:, 1])
    _, _, y, slope, noise = args
    floor = np.diag(np.where(np.diag(noise) > 0, 0.0, 1.0))
    gain = _restricted(noise + floor, y, slope)[0] - loss
    return theta, 0.5 * (curved + curved.T) * np.outer(free, free), gain, converged
