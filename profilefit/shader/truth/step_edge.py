"""The flat step edge: an endless plane, lit for x > 0 and dark elsewhere. What a profile makes of it is an integral.

A point at the distance d from the edge gathers from the lit side, where it lies on the dark one itself,

    L(-d) / A = (1/pi) int_d^inf arccos(d/r) p(r) dr = (1/pi) int_0^inf S(d cosh u) / cosh u du,    S = 1 - cdf,

with p = 2 pi r R_d / A: of the circle of radius r the share arccos(d/r) / pi is lit. The second form is the first by
parts with r = d cosh u: no density enters, no end is singular, and u is even in the logarithm of r where d is small, so
that one rule serves every d. On the lit side L(d) = A - L(-d); at the edge A/2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim import Setting
from profilefit.errors import InputError, SettingError
from profilefit.laws.base import ProfileLaw
from profilefit.sampling import ExactTarget, LawTarget, Target

Floats = NDArray[np.float64]
NODES, PANEL = 12, 1.0  # Gauss nodes of a panel, and the greatest width in u of one
FARTHEST = 1e7  # radius [mfp] beyond which less than 1e-7 of white light leaves, and none of any other
HALVINGS = 80
ALL = 1.0 - 1e-15  # share of the light that is all of it, to rounding


def step_response(
    x: ArrayLike, alpha: ArrayLike, mfp: ArrayLike = 1.0, setting: Setting | None = None, law: ProfileLaw | None = None
) -> float | Floats:
    """L(x) / A: the share of its light that a point gathers from beyond the edge at 0, where x > 0 is lit [-].

    x        place [length], any real number; mfp in the same unit; x, alpha, mfp broadcast
    alpha    single-scattering albedo in [0, 1]
    setting  of the exact half space, or that of the law; by default the law's, or a searchlight on a matched surface
    law      its cdf instead of the exact one: what no number of samples takes away

    Error below 1e-8 of A for the exact half space and for every law of this project. Raises InputError, and
    SettingError where the setting is not the law's or has no exact solution.
    """
    places, albedos, length = np.broadcast_arrays(*(np.asarray(value, float) for value in (x, alpha, mfp)))
    _require("x", places, np.isfinite(places), "a finite place")
    _require("alpha", albedos, (albedos >= 0) & (albedos <= 1), "a single-scattering albedo in [0, 1]")
    _require("mfp", length, (length > 0) & np.isfinite(length), "a mean free path > 0")
    target = target_of(setting, law)
    scaled = np.abs(places) / length
    dark = np.empty(places.shape)
    for value in np.unique(albedos):
        here = albedos == value
        dark[here] = _beyond(target, scaled[here], float(value))
    share = np.where(places > 0, 1.0 - dark, dark)
    return float(share) if share.ndim == 0 else share


def target_of(setting: Setting | None, law: ProfileLaw | None) -> Target:
    """The light of a law, or of the exact half space; SettingError where there is none."""
    if law is not None:
        if setting is not None and setting != law.setting:
            raise SettingError(f"the law belongs to {law.setting}, got a request for {setting}")
        return LawTarget(law)
    where = setting or Setting()
    if not where.is_matched_isotropic:
        raise SettingError(f"the exact half space has n = 1 and g = 0, got {where}: give a law of that setting")
    return ExactTarget(where)


def _require(name: str, values: Floats, good: NDArray[np.bool_], what: str) -> None:
    if not np.all(good):
        raise InputError(f"{name} must be {what}, got {values[~good].flat[0]:g}")


def _beyond(target: Target, distance: Floats, alpha: float) -> Floats:
    """The share from beyond a straight edge at each distance >= 0 [mfp], (n,)."""
    found = np.full(distance.shape, 0.5)
    last = _last_radius(target, alpha)
    some = (distance > 0) & (distance < last)
    found[distance >= last] = 0.0
    if some.any():
        d = distance[some]
        u, du = _rule(np.arccosh(last / d))
        left = 1.0 - target.cdf((d[:, None] * np.cosh(u)).ravel(), alpha).reshape(u.shape)
        found[some] = np.sum(du * left / np.cosh(u), axis=1) / np.pi
    return found


def _rule(last: Floats) -> tuple[Floats, Floats]:
    """Nodes and weights from 0 to each last u, (n,) -> (n, nodes): as many equal panels as the longest needs."""
    nodes, weights = np.polynomial.legendre.leggauss(NODES)
    panels = int(np.ceil(np.max(last) / PANEL))
    width = last[:, None, None] / panels
    u = (np.arange(panels)[:, None] + 0.5 * (nodes + 1.0)) * width
    return u.reshape(last.size, -1), np.broadcast_to(0.5 * width * weights, u.shape).reshape(last.size, -1)


def _last_radius(target: Target, alpha: float) -> float:
    """The radius beyond which, to rounding, no light leaves [mfp]: a law that ends has a kink there."""
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
