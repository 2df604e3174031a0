"""The estimator of a screen-space gather on the flat step edge, in float64: the slow, plain twin of a GPU's.

    L = sum_i w_i E_i / sum_i w_i,   w_i = R_d(r_i) / p2(r_i),   p2 = p / (2 pi r)                 (Liang et al., 22)

with radii r_i = r(xi_i) of density p, uniform angles, and E = 1 for x > 0, 0 elsewhere. Where all weights are 0 there
is nothing to gather, and L is the point's own E. A clip draws one radius with a finite chance, an atom, from which no
light leaves: it weighs nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from mcml_sim import Setting, exact
from profilefit.errors import InputError
from profilefit.laws.base import ProfileLaw, Sampler
from profilefit.sampling import LawTarget
from profilefit.shader.stage import lattice
from profilefit.shader.truth.step_edge import step_response, target_of

Floats = NDArray[np.float64]
LAST_XI = 1.0 - 2.0**-24  # the last number below 1 that single-precision generators draw
UNIFORM_SHARE = 0.995  # of the light within the largest of uniform radii, as the stage has it
KNOTS = 1500  # of the exact quantile: within 1e-9 of itself, relative
NEAREST_XI = 1e-9


@dataclass(frozen=True)
class Gather:
    """How radii are drawn and what they weigh, for one albedo; lengths in mfp.

    sample  xi in [0, 1) -> x = r/l;  weight  x -> w of (22), up to a factor that cancels [-]
    """

    sample: Callable[[Floats], Floats]
    weight: Callable[[Floats], Floats]


@dataclass(frozen=True)
class EdgeEstimate:
    """What the estimator gives at each place x (m,), as a share of A.

    mean, standard_error of it, variance of one estimate, rmse of one estimate against `truth`, the exact response
    law_bias  of the law's own integral against the truth; `mean` - truth tends to it with the number of samples
    """

    x: Floats
    truth: Floats
    mean: Floats
    standard_error: Floats
    variance: Floats
    rmse: Floats
    law_bias: Floats

    @property
    def bias(self) -> Floats:
        """Of the estimator (m,): that of the law, and that of the ratio of two sums, of order 1/n."""
        return self.mean - self.truth


def by_law(law: ProfileLaw, alpha: float, sampler: Sampler | None = None) -> Gather:
    """Radii by the law's sampler, or by another, each with its own density."""
    drawn, target = sampler or law.sampler, LawTarget(law)

    def weight(x: Floats) -> Floats:
        own = np.asarray(drawn.pdf(x, alpha))
        return np.where(own > 0, target.density(x, alpha) / np.where(own > 0, own, 1.0), 0.0)

    return Gather(lambda xi: np.asarray(drawn.sample(np.minimum(xi, LAST_XI), alpha)), weight)


def by_quantile(alpha: float, setting: Setting | None = None) -> Gather:
    """The exact profile with radii by its exact quantile: every weight is 1."""
    curve = _quantile_curve(alpha, setting or Setting())
    return Gather(lambda xi: np.exp(curve(np.log(_depth(xi)))), np.ones_like)


def by_uniform(alpha: float, setting: Setting | None = None, law: ProfileLaw | None = None) -> Gather:
    """Radii uniform up to that of 99.5 % of the light, for a law or the exact profile."""
    target = target_of(setting, law)
    low, high = 0.0, 1e6
    while high - low > 1e-9 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if target.cdf(np.array([middle]), alpha)[0] < UNIFORM_SHARE else (low, middle)
    return Gather(lambda xi: xi * high, lambda x: target.density(x, alpha))


def random_points(samples: int, trials: int, seed: int) -> Floats:
    """Independent (xi, angle / 2 pi), (trials, samples, 2)."""
    return np.random.default_rng(seed).random((trials, samples, 2))


def shifted_points(samples: int, trials: int, seed: int, points: ArrayLike | None = None) -> Floats:
    """One set of points on [0, 1)^2 with a random shift for each trial (Cranley and Patterson).

    points  (samples, 2), shifted over the whole torus; by default the stage's lattice, shifted within one of its cells,
            which gives the same sets. -> (trials, samples, 2)
    """
    shift = np.random.default_rng(seed).random((trials, 1, 2))
    if points is None:
        return (lattice.points(samples) + shift @ lattice.best(samples).cell) % 1.0
    chosen = np.asarray(points, float)
    if chosen.shape != (samples, 2):
        raise InputError(f"points must be {samples} pairs (xi, angle / 2 pi), got an array of shape {chosen.shape}")
    return (chosen + shift) % 1.0


def edge_estimate(
    gather: Gather, points: Floats, x: ArrayLike, alpha: float, setting: Setting, law: ProfileLaw | None = None
) -> EdgeEstimate:
    """The estimator at places x (m,) [mfp] with each trial's points (trials, samples, 2), the same at every place.

    setting  of the exact response that it is judged by;  law  whose own response `law_bias` compares
    """
    places = np.atleast_1d(np.asarray(x, float))
    if points.ndim != 3 or points.shape[2] != 2 or points.shape[0] < 2:
        raise InputError(f"points must be (trials >= 2, samples, 2), got an array of shape {points.shape}")
    truth = np.atleast_1d(step_response(places, alpha, setting=setting))
    r = gather.sample(points[..., 0].ravel())
    weight = gather.weight(r).reshape(points.shape[:2])
    across = r.reshape(weight.shape) * np.cos(2.0 * np.pi * points[..., 1])
    found = np.stack([_ratio(weight, place + across > 0, float(place > 0)) for place in places])
    own = truth if law is None else np.atleast_1d(step_response(places, alpha, law=law))
    variance = found.var(axis=1, ddof=1)
    return EdgeEstimate(
        places,
        truth,
        found.mean(axis=1),
        np.sqrt(variance / points.shape[0]),
        variance,
        np.sqrt(np.mean((found - truth[:, None]) ** 2, axis=1)),
        own - truth,
    )


def _ratio(weight: Floats, lit: NDArray[np.bool_], own: float) -> Floats:
    """(22) for each trial (trials,)."""
    total = weight.sum(axis=1)
    some = total > 0
    return np.where(some, np.sum(weight * lit, axis=1) / np.where(some, total, 1.0), own)


def _depth(xi: Floats) -> Floats:
    """-ln(1 - xi), where radii are smooth at both ends."""
    return -np.log1p(-np.clip(xi, NEAREST_XI, LAST_XI))


@lru_cache(maxsize=16)
def _quantile_curve(alpha: float, setting: Setting) -> CubicSpline:
    """ln x over ln(-ln(1 - xi))."""
    depth = np.geomspace(_depth(np.zeros(1))[0], _depth(np.ones(1))[0], KNOTS)
    return CubicSpline(np.log(depth), np.log(exact.quantile(-np.expm1(-depth), alpha, setting=setting)))
