"""Light of a profile at the step edge, flat or around a cylinder, at a place or over a pixel: integrals, no noise.

On a plane the light from beyond an edge at the distance d is a share F(d) of A (`step_edge`), and what a line at
the distance c adds is -F'(c). On a cylinder of radius R the line at the arc s is c = 2R sin(s/2R) away, straight
through, so that what lies within the arc s adds

    I(s) = int_0^s -F'(c) ds = int -dF / cos(s / 2R)

and the light at a place is the lit part of what is visible over all that is visible: half the cylinder.

The reference is the exact half space.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from mcml_sim import Setting
from profilefit.errors import InputError
from profilefit.laws.base import ProfileLaw
from profilefit.laws.refracting_rational import REFRACTING
from profilefit.scenes.skin.law import DARKEST
from profilefit.scenes.skin.truth import albedo_of
from profilefit.scenes.stage.step_edge import step_response

Floats = NDArray[np.float64]
NEAR = 0.03  # d = NEAR sinh u [mfp]: F is smooth in d at the edge and in ln d far away
FARTHEST = 300.0  # [mfp]
KNOTS = 72  # of F: within 2e-5 of itself
ARCS = 600  # of I(s)
FAINT = 1e-15
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)


@dataclass(frozen=True)
class Beyond:
    """F(d), the share of the light from beyond a straight edge at the distance d >= 0 [mfp] on a plane."""

    curve: CubicSpline

    def __call__(self, d: Floats) -> Floats:
        near = np.clip(np.asarray(d, float), 0.0, FARTHEST)
        return np.where(np.isinf(d), 0.0, np.exp(self.curve(np.arcsinh(near / NEAR))))

    @property
    def quartile(self) -> float:
        """The distance [mfp] at which a quarter comes from beyond."""
        return float(NEAR * np.sinh(brentq(lambda u: float(self.curve(u)) - np.log(0.25), 0.0, self.curve.x[-1])))


@lru_cache(maxsize=512)
def beyond(alpha: float, setting: Setting, law: ProfileLaw | None = None) -> Beyond:
    """Return F(d) of the exact half space, or of a law."""
    u = np.linspace(0.0, np.arcsinh(FARTHEST / NEAR), KNOTS)
    d = NEAR * np.sinh(u)
    share = step_response(-d, alpha, setting=setting) if law is None else step_response(-d, alpha, law=law)
    return Beyond(CubicSpline(u, np.log(np.maximum(share, FAINT))))


def response(share: Beyond, x: Floats, mfp: float, radius: float, window: float = np.inf) -> Floats:
    """Return L / A at distances x > 0 (...) from the edge on the screen, on the lit side; all lengths in the same unit.

    window  how far the picture shows the plane on either side of the edge; a cylinder ends by itself
    """
    if np.isinf(radius):
        dark, unseen = share(x / mfp), share((window + np.array([-1.0, 1.0]) * x[..., None]) / mfp)
        return (1.0 - dark - unseen[..., 0]) / (1.0 - unseen.sum(axis=-1))
    arc = radius * np.arcsin(x / radius)
    within = _within(share, mfp, radius)
    quarter = 0.5 * np.pi * radius
    lit = within(arc) + within(quarter - arc)
    dark = within(quarter + arc) - within(arc)
    return lit / (lit + dark)


def averaged(share: Beyond, x: Floats, pixel: float, mfp: float, radius: float, window: float = np.inf) -> Floats:
    """Return the mean of `response` over pixels (m,) whose middles are at x: what their footprints show."""
    t = 0.5 * (NODES + 1.0)
    inside = x[:, None] + pixel * (t**3 - 0.5)  # close together at the edge, where short paths are all there is
    if not np.isinf(radius):
        inside = np.minimum(inside, radius)
    return response(share, inside, mfp, radius, window) @ (1.5 * WEIGHTS * t**2)


def _within(share: Beyond, mfp: float, radius: float) -> CubicSpline:
    """Return I(s) of arcs up to half the circle, by the way from u to u of s = s0 sinh u."""
    first = 1e-3 * min(mfp, radius)
    last = np.arcsinh(np.pi * radius / first)
    u = np.linspace(0.0, last, ARCS)
    s = first * np.sinh(u)
    middle = 0.5 * (s[1:] + s[:-1])
    fall = -np.diff(share(2.0 * radius * np.sin(np.minimum(0.5 * s / radius, 0.5 * np.pi)) / mfp))
    total = np.append(0.0, np.cumsum(fall / np.cos(0.5 * middle / radius)))
    return lambda arc: np.interp(np.arcsinh(arc / first), u, total)


@dataclass(frozen=True)
class ReferenceLight:
    """The light of a setting, exact; InputError where no law has constants for its index."""

    setting: Setting

    def __post_init__(self) -> None:
        if not 1.0 <= self.setting.n <= REFRACTING.high:
            raise InputError(f"index must be a refractive index in [1, {REFRACTING.high:g}], got {self.setting.n:g}")

    def alpha(self, reflectance: float) -> float:
        """Return the single-scattering albedo [-] of a reflectance A [-]."""
        return max(albedo_of(reflectance, self.setting), DARKEST)

    def beyond(self, reflectance: float) -> Beyond:
        """Return F(d) of a reflectance A [-]."""
        return beyond(self.alpha(reflectance), self.setting)
