"""Flat step edge: an endless plane, lit for x > 0 and dark elsewhere, whose light by a profile is an integral.

A point at the distance d from the edge gathers from the lit side, where it lies on the dark one itself,

    L(-d) / A = (1/pi) int_d^inf arccos(d/r) p(r) dr = (1/pi) int_0^inf S(d cosh u) / cosh u du,    S = 1 - cdf,

with p = 2 pi r R_d / A: of the circle of radius r the share arccos(d/r) / pi is lit. The second form is the first by
parts with r = d cosh u: no density enters, no end is singular, and u is even in the logarithm of r where d is small, so
that one rule serves every d. On the lit side L(d) = A - L(-d); at the edge A/2.

The estimator of a screen-space gather on that edge, in float64, the slow, plain twin of a GPU's:

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
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from mcml_sim import Setting, exact
from mcml_sim.media.arrays import Floats, require_all
from profilefit.errors import InputError, SettingError
from profilefit.fitting.sampling import ExactTarget, LawTarget, Target
from profilefit.laws.base import ProfileLaw, Sampler
from profilefit.scenes.stage import pattern

NODES, PANEL = 12, 1.0  # Gauss nodes of a panel, and the greatest width in u of one
FARTHEST = 1e7  # radius [mfp] beyond which less than 1e-7 of white light leaves, and none of any other
HALVINGS = 80
ALL = 1.0 - 1e-15  # share of the light that is all of it, to rounding


def step_response(
    x: ArrayLike, alpha: ArrayLike, mfp: ArrayLike = 1.0, setting: Setting | None = None, law: ProfileLaw | None = None
) -> float | Floats:
    """Return L(x) / A: the share of its light that a point gathers from beyond the edge at 0, where x > 0 is lit [-].

    x        place [length], any real number; mfp in the same unit; x, alpha, mfp broadcast
    alpha    reduced albedo in [0, 1]
    setting  of the exact half space, or that of the law; by default the law's, or a searchlight on a matched surface
    law      its cdf instead of the exact one: what no number of samples takes away

    Error below 1e-8 of A for the exact half space and for every law of this project. Raises InputError, and
    SettingError where the setting is not the law's or has no exact solution.
    """
    places, albedos, length = np.broadcast_arrays(*(np.asarray(value, float) for value in (x, alpha, mfp)))
    require_all("x", places, np.isfinite(places), "a finite place")
    require_all("alpha", albedos, (albedos >= 0) & (albedos <= 1), "a reduced albedo in [0, 1]")
    require_all("mfp", length, (length > 0) & np.isfinite(length), "a transport mean free path > 0")
    target: Target
    if law is None:
        target = ExactTarget(setting or Setting())
        if not target.setting.is_solved:
            raise SettingError(f"exact light is not solved for {target.setting}: give a law of that setting")
    elif setting not in (None, law.setting):
        raise SettingError(f"the law belongs to {law.setting}, got a request for {setting}")
    else:
        target = LawTarget(law)
    scaled = np.abs(places) / length
    dark = np.empty(places.shape)
    for value in np.unique(albedos):
        here = albedos == value
        dark[here] = _beyond(target, scaled[here], float(value))
    share = np.where(places > 0, 1.0 - dark, dark)
    return float(share) if share.ndim == 0 else share


def _beyond(target: Target, distance: Floats, alpha: float) -> Floats:
    """Return the share from beyond a straight edge at each distance >= 0 [mfp], (n,)."""
    found = np.full(distance.shape, 0.5)
    last = _last_radius(target, alpha)
    some = (distance > 0) & (distance < last)
    found[distance >= last] = 0.0
    if some.any():
        d = distance[some]
        # Nodes and weights from 0 to each last u, (n, nodes): as many equal panels as the longest needs.
        farthest = np.arccosh(last / d)
        panels = int(np.ceil(np.max(farthest) / PANEL))
        width = farthest[:, None, None] / panels
        nodes, weights = np.polynomial.legendre.leggauss(NODES)
        u = ((np.arange(panels)[:, None] + 0.5 * (nodes + 1.0)) * width).reshape(d.size, -1)
        du = np.repeat(0.5 * width * weights, panels, axis=1).reshape(d.size, -1)
        left = 1.0 - target.cdf((d[:, None] * np.cosh(u)).ravel(), alpha).reshape(u.shape)
        found[some] = np.sum(du * left / np.cosh(u), axis=1) / np.pi
    return found


def _last_radius(target: Target, alpha: float) -> float:
    """Return the radius beyond which, to rounding, no light leaves [mfp]: a law that ends has a kink there."""
    low, high = 0.0, FARTHEST
    if target.cdf(np.array([high]), alpha)[0] < ALL:
        return high
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if target.cdf(np.array([middle]), alpha)[0] < ALL:
            low = middle
        else:
            high = middle
    return high


LAST_XI = 1.0 - 2.0**-24  # the last number below 1 that single-precision generators draw
UNIFORM_SHARE = 0.995  # of the light within the largest of uniform radii, as the stage has it
KNOTS = 1500  # of the exact quantile: within 1e-9 of itself, relative
NEAREST_XI = 1e-9


@dataclass(frozen=True)
class EdgeGather:
    """Draw of radii and their weights, for one albedo; lengths in mfp.

    sample  xi in [0, 1) -> x = r/l;  weight  x -> w of (22), up to a factor that cancels [-]
    """

    sample: Callable[[Floats], Floats]
    weight: Callable[[Floats], Floats]


@dataclass(frozen=True)
class EdgeEstimate:
    """Estimate at each place (m,), as a share of A.

    mean, standard_error of it, variance of one estimate, rmse of one estimate against `truth`, the exact response
    """

    truth: Floats
    mean: Floats
    standard_error: Floats
    variance: Floats
    rmse: Floats

    @property
    def bias(self) -> Floats:
        """Bias of the estimator (m,): that of the law, and that of the ratio of two sums, of order 1/n."""
        return self.mean - self.truth


def by_law(law: ProfileLaw, alpha: float, sampler: Sampler | None = None) -> EdgeGather:
    """Return the gather with radii by the law's sampler, or by another, each with its own density."""
    drawn, target = sampler or law.sampler, LawTarget(law)

    def weight(x: Floats) -> Floats:
        own = np.asarray(drawn.pdf(x, alpha))
        return np.where(own > 0, target.density(x, alpha) / np.where(own > 0, own, 1.0), 0.0)

    return EdgeGather(lambda xi: np.asarray(drawn.sample(np.minimum(xi, LAST_XI), alpha)), weight)


def by_quantile(alpha: float, setting: Setting | None = None) -> EdgeGather:
    """Return the gather of the exact profile with radii by its exact quantile: every weight is 1."""
    curve = _quantile_curve(alpha, setting or Setting())
    return EdgeGather(lambda xi: np.exp(curve(np.log(_depth(xi)))), np.ones_like)


def random_points(samples: int, trials: int, seed: int) -> Floats:
    """Return independent (xi, angle / 2 pi), (trials, samples, 2)."""
    return np.random.default_rng(seed).random((trials, samples, 2))


def shifted_points(samples: int, trials: int, seed: int) -> Floats:
    """Return the stage's lattice with a random shift for each trial (Cranley and Patterson), (trials, samples, 2).

    It is shifted within one of its cells, which gives the same sets as over the whole torus.
    """
    shift = np.random.default_rng(seed).random((trials, 1, 2))
    return (pattern.points(samples) + shift @ pattern.best(samples).cell) % 1.0


def edge_estimate(gather: EdgeGather, points: Floats, x: ArrayLike, alpha: float, setting: Setting) -> EdgeEstimate:
    """Return estimator at places x (m,) [mfp] with each trial's points (trials, samples, 2), the same at every place.

    setting  of the exact response that it is judged by
    """
    places = np.atleast_1d(np.asarray(x, float))
    if points.ndim != 3 or points.shape[2] != 2 or points.shape[0] < 2:
        raise InputError(f"points must be (trials >= 2, samples, 2), got an array of shape {points.shape}")
    truth = np.atleast_1d(step_response(places, alpha, setting=setting))
    r = gather.sample(points[..., 0].ravel())
    weight = gather.weight(r).reshape(points.shape[:2])
    across = r.reshape(weight.shape) * np.cos(2.0 * np.pi * points[..., 1])
    total = weight.sum(axis=1)
    some = total > 0
    gathered = [np.sum(weight * (place + across > 0), axis=1) / np.where(some, total, 1.0) for place in places]
    found = np.where(some, gathered, (places > 0)[:, None].astype(float))  # (22) of each trial
    variance = found.var(axis=1, ddof=1)
    rmse = np.sqrt(np.mean((found - truth[:, None]) ** 2, axis=1))
    return EdgeEstimate(truth, found.mean(axis=1), np.sqrt(variance / points.shape[0]), variance, rmse)


def _depth(xi: Floats) -> Floats:
    """Return -ln(1 - xi), where radii are smooth at both ends."""
    return -np.log1p(-np.clip(xi, NEAREST_XI, LAST_XI))


@lru_cache(maxsize=16)
def _quantile_curve(alpha: float, setting: Setting) -> CubicSpline:
    """Return ln x over ln(-ln(1 - xi))."""
    depth = np.geomspace(_depth(np.zeros(1))[0], _depth(np.ones(1))[0], KNOTS)
    return CubicSpline(np.log(depth), np.log(exact.quantile(-np.expm1(-depth), alpha, setting=setting)))
