"""Goodness of fit: whether one layer under one law explains the data, and if not, how large the misfit is.

The residuals R of n rows, in standard errors, are projected onto what the p fitted coordinates cannot take up: n - p
numbers z whose covariance is known, S = N^T (1 + B) N, B being the law's own error. Two tests are made of them:

scatter  chi-square z^T S^-1 z, of n - p degrees of freedom
waves    the score z^T S^-1 D S^-1 z of a relative error that is correlated along ln r (D): a layer underneath, a wrong
         unit or a wrong law leave residuals that are no independent noise. Its distribution, a weighted sum of
         chi-squares, is sampled
Errors made from replicates share the error of their trend: with `pooled` degrees of freedom behind it chi-square is an
F, and the waves' draws are divided likewise. Both p-values are combined by Sidak's rule. The misfit is the relative
error, row by row, that brings chi-square to n - p.

`lack_of_fit` estimates which error of the model would leave such residuals: a Gaussian process of relative standard
deviation d and of some correlation along ln r, by the likelihood of z under S + d^2 D (restricted likelihood, REML).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats
from scipy.optimize import brentq

from profilefit.measured.solving import likelihood

Floats = NDArray[np.float64]
DETECTED = 1e-3  # p-value below which a misfit counts as one
DRAWS = 10_000
TINY = float(np.finfo(float).tiny)
LARGEST = 1e3  # relative error beyond which a misfit is no longer measured
# Relative errors d of a lack of fit that are tried, over that of a row: how many, the least, and the largest, or as
# many times the root mean square of the residuals.
SIZES, LEAST, MOST, TIMES = 20, 0.05, 20.0, 4.0


@dataclass(frozen=True)
class Misfit:
    """How well a fit explains its data.

    chi2, freedom    by the data's errors alone; chance its p-value
    scatter, waves   p-values where data and law have the errors stated; joined that of both
    along_r          lag-1 autocorrelation of the residuals; runs the number of sign runs, and that expected of noise
    relative         relative error [-] that brings chi-square to its degrees of freedom; 0 if nothing is left
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
    """Judge residuals (m,) of a fit with derivatives (m, p), the first `rows` of them along r.

    law    (m, m) covariance of the law's own error, shape (m, m) that of a relative error 1 in waves, uneven (m, m)
           that of one which differs from row to row (by default, shape without its correlations); all in errors
    pooled degrees of freedom of what the rows' errors share
    """
    free = np.linalg.qr(jacobian, mode="complete")[0][:, jacobian.shape[1] :]
    z = free.T @ residuals
    own, waved = np.eye(z.size) + free.T @ law @ free, free.T @ shape @ free
    scatter = scatter_chance(float(z @ np.linalg.solve(own, z)), z.size, pooled)
    score = wave_chance(z, own, waved, pooled)
    signs = np.sign(residuals[:rows])
    chi2 = float(residuals @ residuals)
    along = residuals[:rows]
    return Misfit(
        chi2,
        z.size,
        scatter_chance(chi2, z.size, pooled),
        scatter,
        score,
        1.0 - (1.0 - min(scatter, score)) ** 2,
        float(along[1:] @ along[:-1]) / max(float(along @ along), TINY),
        (1 + int(np.sum(signs[1:] != signs[:-1])), 1 + (rows - 1) / 2),
        amplitude(z, own, free.T @ (np.diag(np.diag(shape)) if uneven is None else uneven) @ free),
    )


def lack_of_fit(
    residuals: Floats, jacobian: Floats, law: Floats, shapes: Floats, pooled: float = np.inf
) -> tuple[Floats, float]:
    """Estimate the relative variances (k,) of errors of these shapes (k, m, m), of which the residuals show the sum.

    The prior is flat in ln d and among the shapes; a variance is the posterior's mean of d^2 times the shape's share.
    Arguments are those of `misfit`. The second value is ln of how many times likelier z is with such errors, over the
    prior, than without any; -inf where there is nothing to estimate.
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
    """p-value of a chi-square whose errors share a scale of `pooled` degrees of freedom."""
    if np.isinf(pooled):
        return float(stats.chi2.sf(square, freedom))
    return float(stats.f.sf(square / freedom, freedom, pooled))


def wave_chance(z: Floats, own: Floats, shape: Floats, pooled: float = np.inf, seed: int = 0) -> float:
    """p-value of the score z^T S^-1 D S^-1 z under the covariance S = `own` of z."""
    there = np.linalg.solve(own, z)
    root = np.linalg.cholesky(own)
    inner = np.linalg.solve(root, np.linalg.solve(root, shape).T)
    weights = np.linalg.eigvalsh(0.5 * (inner + inner.T))
    weights = weights[weights > 1e-6 * weights.max()]
    generator = np.random.default_rng(seed)
    drawn = generator.chisquare(1.0, (DRAWS, weights.size)) @ weights
    if np.isfinite(pooled):
        drawn /= generator.chisquare(pooled, DRAWS) / pooled
    return float((1 + np.sum(drawn >= there @ shape @ there)) / (1 + DRAWS))


def amplitude(z: Floats, own: Floats, relative: Floats) -> float:
    """The relative error d for which z^T (S + d^2 D)^-1 z is its degrees of freedom; 0 if it is less at d = 0."""

    def excess(d: float) -> float:
        return float(z @ np.linalg.solve(own + d**2 * relative, z)) - z.size

    if excess(0.0) <= 0:
        return 0.0
    return LARGEST if excess(LARGEST) > 0 else float(brentq(excess, 0.0, LARGEST, xtol=1e-8))


def own_degrees_of_freedom(freedom: Floats, pooled: float) -> Floats:
    """Degrees of freedom (n,) of what each row's error has for itself: errors of ln variance, 2 / d each, add up."""
    own = np.where(np.isfinite(freedom), 1.0 / freedom, 0.0) - 1.0 / pooled
    return np.where(own > 0, 1.0 / np.where(own > 0, own, 1.0), np.inf)


def gaussianised(residuals: Floats, freedom: Floats) -> Floats:
    """Residuals over errors of few degrees of freedom, which are Student's, as normal ones of equal chance."""
    size = np.abs(residuals)
    tail = stats.t.logsf(size, freedom)
    # Where Student's tail has no float left, so many degrees of freedom are behind it that it is a normal one.
    few = np.isfinite(freedom) & np.isfinite(tail)
    return np.sign(residuals) * np.where(few, -special.ndtri_exp(np.where(few, tail, 0.0)), size)
