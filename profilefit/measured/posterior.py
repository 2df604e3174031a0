"""The posterior of a fit's coordinates, by emcee.

Priors are flat in s = sqrt(1 - alpha), in ln l and in ln k: nothing is known of the units, and alpha may be 1. Errors
estimated from replicates share a scale that is itself an estimate: with that unknown the likelihood is Student's t.

Where a scale is free, what fits is often a thin bent ridge, along which walkers hardly move: they can miss half of its
length, and by their autocorrelation nothing is missed. So they walk in straight coordinates: the first free one, and
the others less their best values where the first is fixed, over their errors there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, CubicHermiteSpline, make_interp_spline

from profilefit.fitting.chains import LAPLACE_LOOK, Walk, default_moves, walk
from profilefit.measured.fitting import MediumFit
from profilefit.measured.model import FLOCK, U
from profilefit.measured.solving import FARTHEST_LN, FARTHEST_U, Minimum, descended, likelihood, log_prior

Floats = NDArray[np.float64]
KEPT = 4000
WALKERS = 2 * FLOCK  # which move by halves
MAX_STEPS = 20_000
ROOM = 1.0  # in u beyond where a search may end: a fit at the edge has a density
WIDEST = 1.0  # error of a coordinate that the data leave open
STRIDE, LONGER, NODES = 0.4, 1.15, 30  # errors between the first two nodes of a ridge, and on; nodes to either side
FALL = 15.0  # of ln density from its top, beyond which a ridge is not followed


@dataclass(frozen=True)
class Node:
    """The best of p free coordinates where the first has a value."""

    fit: MediumFit
    there: Minimum

    @property
    def first(self) -> float:
        return float(self.there.point[self.fit.spec.free[0]])

    @property
    def others(self) -> Floats:
        """(p - 1,)."""
        return self.there.point[self._others]

    @property
    def slope(self) -> Floats:
        """Derivatives (p - 1,) of the others by the first."""
        way = self.there.jacobian[:, self.fit.spec.free[0]]
        return np.asarray(-self.root @ self.root.T @ self._ways.T @ way, float)

    @cached_property
    def root(self) -> Floats:
        """(p - 1, p - 1) of the others' covariance: triangular, its diagonal positive."""
        r = np.linalg.qr(np.vstack([self._ways, np.eye(len(self._others)) / WIDEST]), mode="r")
        return np.asarray(np.linalg.inv(np.sign(np.diag(r))[:, None] * r), float)

    @cached_property
    def log(self) -> float:
        """ln density of the first, up to a constant, the others integrated over as a normal; -inf where not finite."""
        free, rise = self.fit.spec.free, self.there.cost - self.fit.minimum.cost
        if not (np.isfinite(rise) and np.all(np.isfinite(self._ways))):
            return -np.inf
        log = likelihood(np.array(rise), len(free), self.fit.data.pooled) + np.sum(np.log(np.diag(self.root)))
        return float(log + log_prior(np.array(self.first)) if U in free else log)

    @property
    def _others(self) -> list[int]:
        return list(self.fit.spec.free[1:])

    @property
    def _ways(self) -> Floats:
        """(m, p - 1) derivatives of the residuals by the others."""
        return self.there.jacobian[:, self._others]

    def moved(self, first: float) -> Node:
        """The same where the first has another value."""
        start = self.there.point.copy()
        start[self._others] += self.slope * (first - self.first)
        start[self.fit.spec.free[0]] = first
        return replace(self, there=descended(self.fit.problem, start, tuple(self._others)))


@dataclass(frozen=True)
class Ridge:
    """Nodes whose first coordinate rises, two at least, and what is between them."""

    nodes: tuple[Node, ...]

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
        """Coordinates (m, p) of straight ones (m, p), and ln of the volume (m,) of these in those."""
        within = np.clip(straight[:, 0], self.first[0], self.first[-1])
        root = self._root(within)
        others = self._others(within) + np.einsum("mij,mj->mi", root, straight[:, 1:])
        return np.column_stack([straight[:, 0], others]), np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1)

    @property
    def moments(self) -> tuple[float, float]:
        """Mean and variance of the first coordinate."""
        log = np.array([one.log for one in self.nodes])
        share = np.exp(log - log.max()) * np.gradient(self.first)
        share /= share.sum()
        mean = float(share @ self.first)
        return mean, float(share @ (self.first - mean) ** 2)


def ridge(fit: MediumFit) -> Ridge:
    """That of a fit: its first free coordinate is moved to either side, and the others are fitted again."""
    first, best = fit.spec.free[0], Node(fit, fit.minimum)
    ends = np.array([-1.0, 1.0]) * (FARTHEST_U + ROOM) if first == U else best.first + np.array([-1, 1]) * FARTHEST_LN
    error = float(np.sqrt(fit.conditional[first, first])) or WIDEST
    nodes = [best]
    for side in (-1.0, 1.0):
        last, step = best, side * STRIDE * min(error, WIDEST)
        for _ in range(NODES):
            last, step = last.moved(float(np.clip(last.first + step, *ends))), step * LONGER
            if not np.isfinite(last.log):
                break
            nodes.append(last)
            if last.first in ends or last.log < max(one.log for one in nodes) - FALL:
                break
    return Ridge(tuple(sorted(nodes, key=lambda one: one.first)))


def posterior(fit: MediumFit, seed: int = 0, max_steps: int = MAX_STEPS) -> Walk:
    """Posterior of the free coordinates of a fit, by emcee: samples (k, p)."""
    free, best, along = list(fit.spec.free), fit.point, ridge(fit)
    reach = np.full(best.size, FARTHEST_LN)

    def log_density(straight: Floats) -> Floats:
        samples, volume = along.bent(straight)
        full = points(fit, samples)
        inside = np.all(np.abs(full - best)[:, U + 1 :] < reach[U + 1 :], axis=1) & (
            np.abs(full[:, U]) < FARTHEST_U + ROOM
        )
        rise = fit.problem.costs(np.clip(full, best - 3 * reach, best + 3 * reach)) - fit.minimum.cost
        value = likelihood(rise, len(free), fit.data.pooled) + volume
        if U in free:
            value = value + log_prior(full[:, U])
        return np.where(inside & np.isfinite(value), value, -np.inf)

    centre, covariance = np.zeros(len(free)), np.eye(len(free))
    centre[0], covariance[0, 0] = along.moments
    start = np.random.default_rng(seed).multivariate_normal(centre, covariance, WALKERS)
    walked = walk(log_density, start, centre, seed, max_steps, KEPT, default_moves(centre, covariance), LAPLACE_LOOK)
    samples, volume = along.bent(walked.samples)
    return replace(walked, samples=samples, log_density=walked.log_density - volume)


def points(fit: MediumFit, samples: Floats) -> Floats:
    """The coordinates (k, 3) of samples (k, p) of the free ones."""
    full = np.repeat(fit.point[None], len(samples), axis=0)
    full[:, list(fit.spec.free)] = samples
    return full
