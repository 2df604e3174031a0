"""A Gaussian process over two coordinates, and its restricted likelihood: amplitude, two lengths, curvature."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpotri

from profilefit.fitting.solver import minimise

Floats = NDArray[np.float64]
NUGGET = 1e-3  # of the amplitude's square, left to each ring alone: without it the finest scale decides on the largest
MAX_STEPS = 300
TOLERANCE = 1e-3  # of the likelihood's slope by ln of amplitude and lengths: a hundredth of what data resolve
FARTHEST = 12.0  # of ln amplitude from that of the residuals
STEP = 1e-3  # in ln of amplitude and lengths, between gradients that make a curvature


def apart(one: Floats, other: Floats) -> Floats:
    """Distances (k, l) of numbers, or of points in a plane or in space."""
    between = one[:, None] - other
    return np.abs(between) if one.ndim == 1 else np.linalg.norm(between, axis=-1)


def kernel(x: Floats, length: float) -> Floats:
    """Correlations (k, k) between places."""
    return matern(apart(x, x) / length)


def matern(distance: Floats) -> Floats:
    """Correlation at distances in units of the length."""
    scaled = np.sqrt(3.0) * distance
    return (1.0 + scaled) * np.exp(-scaled)


def _bent(distance: Floats) -> Floats:
    """d `matern` / d ln length."""
    scaled = np.sqrt(3.0) * distance
    return scaled**2 * np.exp(-scaled)


def _loss(theta: Floats, apart_u, apart_s, y, slope, noise) -> tuple[float, Floats]:
    """Minus the restricted log likelihood at ln of amplitude and lengths, and its gradient (3,)."""
    square, far_u, far_s = np.exp(2.0 * theta[0]), apart_u * np.exp(-theta[1]), apart_s * np.exp(-theta[2])
    along_u, along_s = matern(far_u), matern(far_s)
    kernel = square * (along_u * along_s + NUGGET * np.eye(y.size))
    value, by_covariance = _restricted(kernel + noise, y, slope)
    parts = 2.0 * kernel, square * _bent(far_u) * along_s, square * along_u * _bent(far_s)
    return value, np.array([np.vdot(by_covariance, part) for part in parts])


def _restricted(covariance: Floats, y: Floats, slope: Floats) -> tuple[float, Floats]:
    """Minus log likelihood of `y` but for `slope` times anything (Patterson, Thompson's (3)), and d / d covariance."""
    root = np.linalg.cholesky(covariance)
    lower = np.tril(dpotri(root, lower=1)[0])  # of the inverse: a third of what solving for it takes
    across, triangle = np.linalg.qr(solve_triangular(root, slope, lower=True))
    seen = solve_triangular(root, across, lower=True, trans=1)
    inverse = lower + np.tril(lower, -1).T - seen @ seen.T  # of what `slope` leaves
    rest = inverse @ y
    logs = np.sum(np.log(np.diag(root))) + np.sum(np.log(np.abs(np.diag(triangle))))
    return float(logs + 0.5 * (y @ rest)), 0.5 * (inverse - np.outer(rest, rest))


def likeliest(begin: Floats, limits: Floats, args) -> tuple[Floats, Floats, float, bool]:
    """theta, the curvature of the loss there, the gain over noise alone, and whether it converged.

    A length at a limit is held there: it has no curvature.
    """
    theta, loss, converged = minimise(
        lambda x: _loss(x, *args), begin, (limits[:, 0], limits[:, 1]), TOLERANCE, MAX_STEPS
    )
    around = [[_loss(theta + sign * STEP * axis, *args)[1] for sign in (1, -1)] for axis in np.eye(3)]
    curved = np.array([(after - before) / (2.0 * STEP) for after, before in around])
    free = (limits[:, 0] < theta) & (theta < limits[:, 1])
    _, _, y, slope, noise = args
    floor = np.diag(np.where(np.diag(noise) > 0, 0.0, 1.0))
    gain = _restricted(noise + floor, y, slope)[0] - loss
    return theta, 0.5 * (curved + curved.T) * np.outer(free, free), gain, converged
