"""Light that falls in aslant: how far its far rings' centre lies from where it enters, which no scale changes.

A ray at angle theta in air goes on at sin theta_t = sin theta / n, and far away its light has forgotten all but where
along the ray it came to rest. In an infinite medium the light of a ray falls off as e^{-kappa d} phi(mu) / d, mu the
cosine to the ray and phi = sum (2 l + 1) a_l P_l, with (l + 1) a_{l+1} + l a_{l-1} = (2 l + 1)(1 - alpha g^l) a_l /
kappa. Sources along the ray at distances of mean phi'(0) / (kappa phi(0)) and mean square phi''(0) / (kappa^2 phi(0))
have the same, to second order in mu; they are taken for a gamma distribution. Each is a dipole of diffusion theory with
the exact kappa and D = (1 - alpha) / kappa^2, seen as exitance (d'Eon and Irving 2011). A circle's centre is where the
first moment cos(azimuth) of its light vanishes. Where alpha -> 1, g -> 1 and r -> infinity that lies at l* sin theta_t,
as Wang and Jacques have it (Appl. Opt. 34, 1995).

Against photons it is within `model_error` from NEAR outwards: where scattering has no direction, light must go farther
before it diffuses.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline
from scipy.special import roots_genlaguerre

from mcml_sim.exact.forwards import decay_rate
from mcml_sim.exact.light import unreduced
from mcml_sim.media.setting import Setting
from profilefit.laws.diffusion import exitance_factors
from profilefit.measured import model

Floats = NDArray[np.float64]
FORWARD, ISOTROPIC, NEAR = 0.02, 0.1, 2.5  # relative errors of a centre where g = 1 and 0, from so many l* outwards
DEGREE = 200  # of phi
SOURCES, AZIMUTHS = 12, 24
S = np.linspace(0.01, 0.85, 22)  # sqrt(1 - alpha), and
LN_X = np.linspace(0.0, np.log(200.0), 25)  # ln r / l*, between which centres lie on cubics
ROUNDS = 8  # of Newton's
STEP = 1e-4  # l*, for its slope


@dataclass(frozen=True)
class Oblique:
    """A circle of light: its radius r, and how far its centre lies from the entry, with an error [unit of r].

    angle  of incidence, in air [degrees]
    """

    angle: float
    r: float
    centre: float
    error: float

    def residuals(self, setting: Setting, points: Floats) -> tuple[Floats, Floats]:
        """Return residuals in standard errors (m,) at points (m, 3) of `model`'s coordinates; derivatives (m, 3)."""
        spline = _spline(setting.n, setting.g, self.angle)
        length = np.exp(points[:, model.LENGTH])
        s = 1.0 / (1.0 + np.exp(-points[:, model.U]))
        x = np.log(self.r / length)
        value, by_s, by_x = (spline.ev(s, x, *order) for order in ((0, 0), (1, 0), (0, 1)))
        slopes = np.zeros((len(points), len(model.NAMES)))
        slopes[:, model.U] = length * by_s * s * (1.0 - s)
        slopes[:, model.LENGTH] = length * (value - by_x)
        error = np.hypot(self.error, model_error(setting.g) * self.centre)
        return (length * value - self.centre) / error, slopes / error


def model_error(g: float) -> float:
    """Relative, of a centre."""
    return g * FORWARD + (1.0 - g) * ISOTROPIC


@lru_cache(maxsize=256)
def _spline(n: float, g: float, angle: float) -> RectBivariateSpline:
    return RectBivariateSpline(S, LN_X, np.stack([centres(1.0 - s * s, n, g, angle, np.exp(LN_X)) for s in S]))


def centres(alpha: float, n: float, g: float, angle: float, x: Floats) -> Floats:
    """Return the centres [l*] of circles of radii x (m,) at a reduced albedo and an angle [degrees]."""
    sine = np.sin(np.radians(angle)) / n
    at, weight, kappa = sources(alpha, g)
    aside, deep = at * sine, at * np.sqrt(1.0 - sine**2)
    diffusion = (1.0 - alpha) / kappa**2
    by_fluence, by_flux, reflecting = exitance_factors(n)
    azimuth = np.pi * (np.arange(AZIMUTHS) + 0.5) / AZIMUTHS
    across, along = x[:, None] * np.cos(azimuth), x[:, None] * np.sin(azimuth)

    def first_moment(centre: Floats) -> Floats:
        rho = (centre[:, None] + across)[..., None] - aside
        light: Floats = np.zeros(rho.shape)
        for depth, sign in ((deep, 1.0), (deep + 4.0 * reflecting * diffusion, -1.0)):
            d = np.sqrt(rho**2 + along[..., None] ** 2 + depth**2)
            light += (by_flux * depth / d * (1.0 / d + kappa) + sign * by_fluence / diffusion) * np.exp(-kappa * d) / d
        return np.asarray(np.cos(azimuth) @ (light @ weight).T, float)

    middle = np.full(x.size, weight @ aside)
    for _ in range(ROUNDS):
        here = first_moment(middle)
        step = here * STEP / (first_moment(middle + STEP) - here)
        middle -= np.clip(step, -0.2, 0.2)
    return middle


def sources(alpha: float, g: float) -> tuple[Floats, Floats, float]:
    """Distances along a ray (k,) [l*], shares of its light that are isotropic from there (k,), and kappa [1/l*]."""
    whole = float(unreduced(alpha, g))
    kappa, length = decay_rate(whole, g), 1.0 / (1.0 - whole * g)
    ell = np.arange(DEGREE + 1)
    h = (2 * ell + 1) * (1.0 - whole * g**ell)
    ratio = np.zeros(DEGREE + 2)  # a_l / a_{l-1}, of the solution that falls off
    for at in range(DEGREE, 0, -1):
        ratio[at] = at / (h[at] / kappa - (at + 1) * ratio[at + 1])
    ratio[0] = 1.0
    series = (2 * ell + 1) * np.cumprod(ratio[:-1])
    phi, slope, bend = (legendre.legval(0.0, legendre.legder(series, order)) for order in range(3))
    mean, square = slope / (kappa * phi), bend / (kappa**2 * phi)
    shape = mean**2 / (square - mean**2)
    nodes, weights = roots_genlaguerre(SOURCES, shape - 1.0)
    return nodes * mean / shape / length, weights / weights.sum(), kappa * length
