"""Exact light, or a law, as an instrument sees it, given alpha, a length and a scale: at radii or over annuli.

Three coordinates without bounds describe the medium and the instrument, in this order:

u     s = sqrt(1 - alpha) = 1 / (1 + e^-u): laws are smooth in s, and both ends of alpha lie at infinity
ln l  of the transport mean free path [ln unit]
ln k  of the scale: the value column is k times the reflectance per area

The light of a row is a sum over the radii that its instrument gathers (`instrument`). Their number is
filled up to a multiple of one size, so that data of many lengths share one compiled function.

Exact light is that of `mcml_sim.exact.light`. Where scattering has a direction it is that of the table. Where it has
none, between its nodes it is within 1e-5 of `mcml_sim.exact` for x up to 20 mfp, within 3e-4 farther out, until light
has fallen by e^-20. Beyond x = 28 / kappa, where the exact solution runs out of digits (12 / kappa next to white), R_d
goes on as e^{-kappa x} (1 + kappa x) / x^3.

Light of a beam aslant: a ray at angle theta in air goes on at sin theta_t = sin theta / n, and far away its light has
forgotten all but where along the ray it came to rest. In an infinite medium the light of a ray falls off as
e^{-kappa d} phi(mu) / d, mu the cosine to the ray and phi = sum (2 l + 1) a_l P_l, with (l + 1) a_{l+1} + l a_{l-1} =
(2 l + 1)(1 - alpha g^l) a_l / kappa. Sources along the ray at distances of mean phi'(0) / (kappa phi(0)) and mean
square phi''(0) / (kappa^2 phi(0)) have the same, to second order in mu; they are taken for a gamma distribution. Each
is a dipole of diffusion theory with the exact kappa and D = (1 - alpha) / kappa^2, seen as exitance (d'Eon and Irving
2011). A circle's centre is where the first moment cos(azimuth) of its light vanishes. Where alpha -> 1, g -> 1 and
r -> infinity that lies at l* sin theta_t, as Wang and Jacques have it (Appl. Opt. 34, 1995). Against photons it is
within `model_error` from NEAR outwards.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.polynomial import legendre
from scipy.interpolate import CubicSpline, RectBivariateSpline
from scipy.special import expit, roots_genlaguerre

from mcml_sim import exact
from mcml_sim.exact import forwards
from mcml_sim.exact.by_albedo import blocks
from mcml_sim.exact.compiled import jit
from mcml_sim.exact.half_space import require_solved
from mcml_sim.exact.light import LEAST, ExactLight, coefficients, log_once, nodes, tabulated, unreduced
from mcml_sim.files.npz import kept
from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import FORWARD_N, Setting
from profilefit.laws.base import ProfileLaw
from profilefit.laws.diffusion import exitance_factors
from profilefit.measured.instrument import PENCIL, Instrument

NAMES = ("alpha", "l", "scale")
U, LENGTH, SCALE = range(3)
BLOCK = 32  # radii
FLOCK = 16  # points of the three coordinates that are evaluated at once
QUANTITIES = ("A", "alpha", "l", "mu_s'", "mu_a", "scale")
POWERS = {"A": 0, "alpha": 0, "l": 1, "mu_s'": -1, "mu_a": -1, "scale": 0}  # of the unit of length
# Quantities whose relative error is judged: each is zero or infinite only where there is no medium.
STRENGTHS = ("mu_s'", "mu_a", "scale")
EXACT = "exact"  # its name among laws
DEGREES = 64  # Chebyshev polynomials in s
STEP = 0.06  # of ln x
NEAREST, FARTHEST = 1e-4, 1e3  # mfp, of f
# kappa x that the exact solution reaches; the second where kappa < WHITE
SOLVED, SOLVED_WHITE, WHITE = 28.0, 12.0, 0.06
VERSION = 1  # of what `_solved` gives
FORWARD, ISOTROPIC, NEAR = 0.02, 0.1, 2.5  # relative errors of a centre where g = 1 and 0, from so many l* outwards
DEGREE = 200  # of phi
SOURCES, AZIMUTHS = 12, 24
S = np.linspace(0.01, 0.85, 22)  # sqrt(1 - alpha), and
LN_X = np.linspace(0.0, np.log(200.0), 25)  # ln r / l*, between which centres lie on cubics
ROUNDS, SLOPE_STEP = 8, 1e-4  # of Newton's; l*, for its slope

Light = ProfileLaw | ExactLight


@dataclass(frozen=True)
class Model:
    """Exact light, or a law with fixed constants, as an instrument sees it."""

    law: Light
    instrument: Instrument = PENCIL

    @cached_property
    def traced(self) -> Light:
        """The light as compiled functions take it: exact light without its setting, which nothing there needs."""
        own = self.law.unlabelled if isinstance(self.law, ExactLight) else self.law
        with jax.enable_x64(True):
            traced: Light = jax.tree.map(jnp.asarray, own)
        return traced

    def linearised(self, point: Floats, inner: Floats, outer: Floats) -> tuple[Floats, Floats]:
        """Predictions (n + 1,) at one point (3,), the last being A, and their derivatives (n + 1, 3)."""
        values, slopes = _linearised(self.traced, point, *_nodes(self.instrument, inner.tobytes(), outer.tobytes()))
        rows = np.append(np.arange(inner.size), -1)
        return np.asarray(values)[rows], np.asarray(slopes)[:, rows].T

    def density(self, point: Floats, rho: Floats) -> tuple[Floats, Floats]:
        """Compute 2 pi rho R_d at radii (m,) for one point (3,), A last (m + 1,), and derivatives (m + 1, 3)."""
        values, slopes = _linearised(self.traced, point, rho, np.eye(rho.size))
        return np.asarray(values), np.asarray(slopes).T

    def densities(self, points: Floats, rho: Floats) -> Floats:
        """Compute 2 pi rho R_d (k, m) at radii (m,) for points (k, 3)."""
        return self._in_flocks(points, rho, np.eye(rho.size))[:, :-1]

    def predicted(self, points: Floats, inner: Floats, outer: Floats) -> Floats:
        """Predictions (m, n + 1) at points (m, 3), the last column being A."""
        nodes = _nodes(self.instrument, inner.tobytes(), outer.tobytes())
        return self._in_flocks(points, *nodes)[:, np.append(np.arange(inner.size), -1)]

    def _in_flocks(self, points: Floats, *nodes: Array | Floats) -> Floats:
        """Return sums over radii, and A, (m, n + 1) at points (m, 3)."""
        flocks = -(-len(points) // FLOCK)
        filled = np.concatenate([points, np.repeat(points[-1:], flocks * FLOCK - len(points), axis=0)])
        light = [np.asarray(_predicted(self.traced, flock, *nodes)) for flock in np.split(filled, flocks)]
        return np.concatenate(light)[: len(points)]

    def shares(self, point: Floats, r: Floats) -> Floats:
        """Shares of the reflected energy within radii (n,) [-]."""
        return np.concatenate([np.asarray(_shares(self.traced, point, one)) for one in blocks(r, BLOCK)])[: r.size]


def alpha_of(u) -> Floats:
    """Return alpha [-] at the coordinate u, to rounding also where it is small."""
    return expit(-np.asarray(u, float)) * (1.0 + expit(np.asarray(u, float)))


def u_of(alpha: float) -> float:
    """Return the coordinate u of an albedo in (0, 1)."""
    s = np.sqrt(1.0 - alpha)
    return float(np.log(s) - np.log(alpha / (1.0 + s)))


@lru_cache(maxsize=32)
def _nodes(instrument: Instrument, inner: bytes, outer: bytes) -> tuple[Array, Array]:
    """Return nodes of the rows, and of more like the last up to a multiple of BLOCK."""
    near, far = (np.concatenate(blocks(np.frombuffer(one), BLOCK)) for one in (inner, outer))
    nodes = instrument.nodes(near, far)
    with jax.enable_x64(True):
        return jnp.asarray(nodes[0]), jnp.asarray(nodes[1])


def _light(law: Light, point, rho, weight):
    alpha = _alpha(point[U])
    mfp, scale = jnp.exp(point[LENGTH]), jnp.exp(point[SCALE])
    x = rho / mfp
    light = weight @ (2.0 * jnp.pi * x * law.scaled_profile(x, alpha)) / mfp
    return jnp.append(scale * light, law.total(alpha))


def _alpha(u):
    return jax.nn.sigmoid(-u) * (1.0 + jax.nn.sigmoid(u))  # 1 - s^2 without cancellation


def _double(function):
    """Compile a function of numpy arrays in double precision; the law's class and its setting select it."""
    compiled = jit(function)

    def call(law, *arrays):
        with jax.enable_x64(True):
            return compiled(law, *arrays)

    return call


@_double
def _linearised(law, point, rho, weight):
    light = partial(_light, law, rho=rho, weight=weight)
    values, slopes = jax.vmap(lambda way: jax.jvp(light, (point,), (way,)), out_axes=(None, 0))(jnp.eye(len(NAMES)))
    return values, slopes


@_double
def _predicted(law, points, rho, weight):
    return jax.vmap(lambda point: _light(law, point, rho, weight))(points)


@_double
def _shares(law, point, r):
    return law.scaled_cdf(r / jnp.exp(point[LENGTH]), _alpha(point[U]))


def quantities(points: Floats, reflectance: Floats) -> dict[str, Floats]:
    """Each quantity (m,) at points (m, 3) whose total reflectances A are (m,)."""
    s = expit(points[:, U])
    alpha, length = alpha_of(points[:, U]), np.exp(points[:, LENGTH])
    values = (reflectance, alpha, length, alpha / length, s**2 / length, np.exp(points[:, SCALE]))
    return dict(zip(QUANTITIES, values, strict=True))


def slopes(point: Floats, reflectance_slope: Floats) -> dict[str, Floats]:
    """Return the derivatives (3,) of each quantity by the coordinates; of A they are given."""
    s = float(1.0 / (1.0 + np.exp(-point[U])))
    alpha, length = float(alpha_of(point[U])), float(np.exp(point[LENGTH]))
    steep = 2.0 * s**2 * (1.0 - s)  # of 1 - alpha by u
    u, ln_l, ln_k = np.eye(3)[[U, LENGTH, SCALE]]
    return {
        "A": reflectance_slope,
        "alpha": -steep * u,
        "l": length * ln_l,
        "mu_s'": -(steep * u + alpha * ln_l) / length,
        "mu_a": (steep * u - s**2 * ln_l) / length,
        "scale": float(np.exp(point[SCALE])) * ln_k,
    }


def errors(gradients: dict[str, Floats], covariance: Floats) -> dict[str, float]:
    """Return standard error of each quantity, from the covariance (3, 3) of the coordinates."""
    return {name: math.sqrt(max(float(row @ covariance @ row), 0.0)) for name, row in gradients.items()}


def correlation(gradients: dict[str, Floats], covariance: Floats, names: tuple[str, ...]) -> Floats:
    """Correlations (k, k) of the named quantities."""
    rows = np.stack([gradients[name] for name in names])
    joint = rows @ covariance @ rows.T
    spread = np.sqrt(np.diag(joint))
    with np.errstate(invalid="ignore", divide="ignore"):
        return joint / np.outer(spread, spread)


def unit_of(name: str, unit: str) -> str:
    """Return the unit of a quantity where lengths are in `unit`."""
    if POWERS[name] == 0:
        return ""
    return (unit or "unit of r") if POWERS[name] > 0 else f"1/{unit or 'unit of r'}"


@lru_cache(maxsize=64)
def exact_light(setting: Setting) -> ExactLight:
    """Return exact light of a semi-infinite medium; SettingError of one not solved. Seconds at first, if g = 0."""
    require_solved(setting)
    if not setting.is_isotropic:
        return _filled(forwards.light(setting))
    parts = ("rest", "kappa", "share")
    name = f"light-{setting.illumination}-n{setting.n!r}-{DEGREES}-v{VERSION}"
    arrays = kept(name, parts, lambda: dict(zip(parts, _solved(setting), strict=True)))
    return tabulated(setting, NEAREST, STEP, *(arrays[part] for part in parts))


def light_at_hand(setting: Setting) -> ExactLight:
    """Return exact light of one of many settings that a search tries: by the table, to 3e-4, where it has these n."""
    if setting.is_isotropic and FORWARD_N[0] <= setting.n <= FORWARD_N[1]:
        return _filled(forwards.light(setting))
    return exact_light(setting)


def _solved(setting: Setting) -> tuple[Floats, Floats, Floats]:
    """Return the spline of f, kappa and A / alpha in Chebyshev polynomials of s."""
    s = np.sqrt(1.0 - LEAST) * 0.5 * (1.0 + nodes(DEGREES))
    alpha = 1.0 - s**2
    log = np.arange(np.log(NEAREST), np.log(FARTHEST) + STEP, STEP)
    kappa = np.asarray(exact.decay_rate(alpha))[:, None]
    x = np.exp(log)[None]
    solved = np.minimum(x, np.where(kappa > WHITE, SOLVED, SOLVED_WHITE) / kappa)
    light = 2.0 * np.pi * solved * exact.profile(solved, alpha[:, None], setting=setting)
    rest = (light - alpha[:, None] * np.exp(log_once(solved, setting))) / alpha[:, None] ** 2
    f = np.log(rest) + kappa * solved - np.log1p(kappa * solved) - 2.0 * np.log(x / solved)
    whole = nodes(DEGREES) * 0.5 + 0.5
    share = coefficients(np.asarray(exact.reflectance(1.0 - whole**2, setting=setting)) / (1.0 - whole**2))
    rest = coefficients(CubicSpline(log, f, axis=1).c.transpose(2, 1, 0))
    return rest, coefficients(kappa[:, 0]), share


def _filled(light: ExactLight) -> ExactLight:
    """Return the light with as many intervals as where g = 0, for one compiled code: more hold f at its end."""
    intervals = np.arange(np.log(NEAREST), np.log(FARTHEST) + STEP, STEP).size - 1
    with jax.enable_x64(True):
        end = light.rest[:, -1] @ jnp.power(light.step, jnp.arange(3.0, -1.0, -1.0))
        shape = end.size, intervals - light.rest.shape[1], 4
        more = jnp.zeros(shape).at[..., 3].set(end[:, None])
        return replace(light, rest=jnp.concatenate([light.rest, more], 1))


@dataclass(frozen=True)
class Oblique:
    """A circle of light: angle of incidence in air [degrees], radius, and its centre's distance from the entry."""

    angle: float
    r: float
    centre: float
    error: float

    def residuals(self, setting: Setting, points: Floats) -> tuple[Floats, Floats]:
        """Return residuals in standard errors (m,) at points (m, 3) of `model`'s coordinates; derivatives (m, 3)."""
        spline = _spline(setting.n, setting.g, self.angle)
        length = np.exp(points[:, LENGTH])
        s = 1.0 / (1.0 + np.exp(-points[:, U]))
        x = np.log(self.r / length)
        value, by_s, by_x = (spline.ev(s, x, *order) for order in ((0, 0), (1, 0), (0, 1)))
        slopes = np.zeros((len(points), len(NAMES)))
        slopes[:, U] = length * by_s * s * (1.0 - s)
        slopes[:, LENGTH] = length * (value - by_x)
        error = np.hypot(self.error, model_error(setting.g) * self.centre)
        return (length * value - self.centre) / error, slopes / error


def model_error(g: float) -> float:
    """Return the relative error of a centre: where scattering has no direction, light must go farther to diffuse."""
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
        step = here * SLOPE_STEP / (first_moment(middle + SLOPE_STEP) - here)
        middle -= np.clip(step, -0.2, 0.2)
    return middle


def sources(alpha: float, g: float) -> tuple[Floats, Floats, float]:
    """Return distances along a ray (k,) [l*], shares of its light isotropic from there (k,), and kappa [1/l*]."""
    whole = float(unreduced(alpha, g))
    kappa, length = forwards.decay_rate(whole, g), 1.0 / (1.0 - whole * g)
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
