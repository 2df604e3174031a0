"""The index-matched, isotropic half space solved exactly: no photons, no noise.

The reflectance profile is an inverse Hankel transform of a product of Chandrasekhar's H functions for a
"pseudo" medium of transverse wave number k (Chandrasekhar 1950; Rybicki, J. Quant. Spectrosc. Radiat. Transf. 11,
1971; Williams, J. Fluid Mech. 2007; d'Eon, A Hitchhiker's Guide to Multiple Scattering, 2016):

    ln H_k(v) = -(v/pi) int_0^inf ln(1 - alpha arctan(K)/K) / (1 + v^2 x^2) dx,          K = sqrt(k^2 + x^2)
    searchlight  R^(k) = (alpha/2) H_k(1) int_0^1 H_k(1/s) / (1 + s) dm,                 s = sqrt(1/m^2 + k^2)
    diffuse      R^(k) = alpha int_0^1 int_0^1 H_k(1/s) H_k(1/s') / (s + s') dm dm'
    R_d(r) = (1/2 pi) int_0^inf k R^(k) J0(k r) dk

The Hankel integral is taken along k = 0.9 i kappa + rho e^{i pi/4}, where J0 becomes a decaying Hankel function: no
zeros, no cancellation, full relative accuracy far into the exponential tail. kappa is the decay rate of the
profile, alpha artanh(kappa)/kappa = 1.

Every function takes lengths in any one unit with `mfp` in that unit, broadcasts `r` (or `xi`) against `alpha`, and
gives a float for scalars. Relative error of `profile` for alpha in [0.05, 1]: below 1e-9 for r in [1e-3, 35] mfp, below
2e-7 up to 100 mfp, where the profile of alpha = 0.05 has fallen to 1e-51.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq
from scipy.special import hankel1

from mcml_sim.errors import InputError, SettingError
from mcml_sim.setting import Setting

Floats = NDArray[np.float64]
SEARCHLIGHT = Setting()

# Closer to the source than this the profile is its own limit, alpha / (4 pi r), to 1e-5 [mfp].
NEAREST_RADIUS = 1e-6
# The normalised shape of alpha -> 0, where no photon scatters twice, to 1e-9.
SINGLE_SCATTERING = 1e-9
# All integrands are analytic within an angle of pi/4 of the real axis, so a trapezoid in the logarithm of the
# variable has the error e^{-2 pi (pi/4) / step}: 1e-14 here.
LOG_STEP = 0.15
X_NODES = np.exp(np.arange(-38.0, 45.0, LOG_STEP))
M_NODES, M_WEIGHTS = np.polynomial.legendre.leggauss(64)


def reflectance(alpha: ArrayLike, setting: Setting = SEARCHLIGHT) -> float | Floats:
    """Total diffuse reflectance A of the half space [-]; `alpha` the single-scattering albedo in [0, 1].

    R^(0), which equals 1 - H(1) sqrt(1 - alpha) under a searchlight and 1 - 2 sqrt(1 - alpha) int_0^1 H(mu) mu dmu
    under diffuse light (Chandrasekhar 1950, ch. V) without their cancellation. Relative error below 1e-12.
    """
    _require_solved(setting)
    values = np.vectorize(lambda a: _reflectance(a, setting.illumination), otypes=[float])(_checked_alpha(alpha))
    return _scalar_or_array(values)


def profile(r: ArrayLike, alpha: ArrayLike, mfp: ArrayLike = 1.0, setting: Setting = SEARCHLIGHT) -> float | Floats:
    """Reflectance profile R_d(r) [1/length^2]: 2 pi r R_d integrates to A. 2 pi r R_d tends to alpha/2 at r = 0."""
    _require_solved(setting)
    length = _checked_mfp(mfp)
    values = _by_alpha(_profile, _checked_radius(r) / length, _checked_alpha(alpha), setting.illumination)
    return _scalar_or_array(values / length**2)


def cdf(r: ArrayLike, alpha: ArrayLike, mfp: ArrayLike = 1.0, setting: Setting = SEARCHLIGHT) -> float | Floats:
    """Share of the reflected energy that leaves within radius r [-]: 0 at r = 0, 1 at infinity."""
    _require_solved(setting)
    values = _by_alpha(_cdf, _checked_radius(r) / _checked_mfp(mfp), _checked_alpha(alpha), setting.illumination)
    return _scalar_or_array(values)


def quantile(xi: ArrayLike, alpha: ArrayLike, mfp: ArrayLike = 1.0, setting: Setting = SEARCHLIGHT) -> float | Floats:
    """Radius within which the share `xi` in [0, 1] of the reflected energy leaves [length]; cdf(quantile(xi)) = xi."""
    _require_solved(setting)
    must = "xi must be a share of the energy in [0, 1]"
    share = _numbers(xi, must)
    if not np.all((share >= 0) & (share <= 1)):
        raise InputError(f"{must}, got {_offender(share, 0, 1)}")
    values = _by_alpha(_quantile, share, _checked_alpha(alpha), setting.illumination)
    return _scalar_or_array(values * _checked_mfp(mfp))


def decay_rate(alpha: ArrayLike) -> float | Floats:
    """kappa(alpha), the root of alpha artanh(kappa)/kappa = 1: R_d falls off as e^{-kappa r / mfp} r^-2 [-]."""
    return _scalar_or_array(np.vectorize(_decay_rate, otypes=[float])(_checked_alpha(alpha)))


def _dispersion(alpha: float, k_squared: NDArray) -> NDArray:
    """1 - alpha arctan(K)/K, by its series near K = 0 where the difference would cancel."""
    small = np.abs(k_squared) < 0.01
    series = np.zeros_like(k_squared)
    t = np.where(small, k_squared, 0.0)
    for n in range(9, 0, -1):
        series = t * ((-1) ** (n + 1) / (2 * n + 1) + series)
    root = np.sqrt(np.where(small, 1.0, k_squared) + 0j)
    difference = np.where(small, series, 1.0 - np.arctan(root) / root)
    return (1.0 - alpha) + alpha * difference


@lru_cache(maxsize=512)
def _decay_rate(alpha: float) -> float:
    if alpha == 1.0:
        return 0.0
    highest = 1.0 - 1e-15
    if alpha * np.arctanh(np.sqrt(highest)) < 1.0:  # 1 - kappa is below rounding
        return 1.0
    square = brentq(lambda t: float(_dispersion(alpha, np.array([-t + 0j])).real[0]), 0.0, highest, xtol=1e-300)
    return float(np.sqrt(square))


def _ln_h(nu: NDArray, ln_dispersion: NDArray) -> NDArray:
    """ln H_k(nu) for `nu` (k, m), from the logarithm of the dispersion function on X_NODES, (k, x)."""
    kernel = X_NODES / (1.0 + nu[..., None] ** 2 * X_NODES**2)
    return -(nu / np.pi) * LOG_STEP * np.einsum("kmx,kx->km", kernel, ln_dispersion)


@lru_cache(maxsize=8192)
def _reflectance(alpha: float, illumination: str) -> float:
    if alpha == 1.0:
        return 1.0
    return float(_transform_values(alpha, illumination, np.zeros(1, complex))[0].real)


@dataclass(frozen=True)
class _Transform:
    """R^(k) on the contour: `k` and `weights` (dk) complex, `value` = R^(k); `reflectance` A."""

    k: NDArray
    weights: NDArray
    value: NDArray
    reflectance: float

    def hankel(self, order: int, x: Floats) -> Floats:
        """Re of the sum over the contour of R^(k) k^(1 - order) H_order(k x) dk, for x of shape (n,)."""
        factor = self.weights * self.value * self.k ** (1 - order)
        argument = np.multiply.outer(x, self.k)
        # Where the wave has decayed by e^{-60} nothing is left to add, and the Bessel function is the cost.
        live = argument.imag - argument.imag[:, :1] < 60.0
        terms = np.zeros_like(argument)
        terms[live] = hankel1(order, argument[live])
        return (terms @ factor).real


@lru_cache(maxsize=256)
def _transform(alpha: float, illumination: str) -> _Transform:
    kappa = _decay_rate(alpha)
    rho = np.exp(np.arange(np.log(1e-17 * max(kappa, 1e-3)), np.log(90.0 / NEAREST_RADIUS), LOG_STEP))
    direction = np.exp(0.25j * np.pi)
    k = 0.9j * kappa + rho * direction
    value = np.concatenate([_transform_values(alpha, illumination, part) for part in np.array_split(k, 16)])
    return _Transform(k, LOG_STEP * rho * direction, value, _reflectance(alpha, illumination))


def _transform_values(alpha: float, illumination: str, k: NDArray) -> NDArray:
    ln_dispersion = np.log(_dispersion(alpha, k[:, None] ** 2 + X_NODES[None, :] ** 2))
    # m = sinh(y)/|k| resolves the layer m ~ 1/|k|, and y = t^2 the m ln m at grazing angles.
    scale = np.maximum(np.abs(k), 1e-3)[:, None]
    t = 0.5 * (M_NODES + 1.0)
    y = np.arcsinh(scale) * t**2
    m, dm = np.sinh(y) / scale, np.cosh(y) / scale * np.arcsinh(scale) * 2.0 * t * 0.5 * M_WEIGHTS
    s = np.sqrt(1.0 / m**2 + k[:, None] ** 2)
    h = np.exp(_ln_h(1.0 / s, ln_dispersion))
    if illumination == "searchlight":
        h_normal = np.exp(_ln_h(np.ones((k.size, 1)), ln_dispersion))[:, 0]
        return 0.5 * alpha * h_normal * np.sum(dm * h / (1.0 + s), axis=1)
    pairs = 1.0 / (s[:, :, None] + s[:, None, :])
    return alpha * np.einsum("km,kn,kmn->k", dm * h, dm * h, pairs)


def _profile(x: Floats, alpha: float, illumination: str) -> Floats:
    value = np.zeros_like(x)
    if alpha == 0.0:
        return value
    inside = np.isfinite(x)
    near = np.maximum(x[inside], NEAREST_RADIUS)
    with np.errstate(divide="ignore"):
        source = np.maximum(NEAREST_RADIUS / x[inside], 1.0)
    value[inside] = source * _transform(alpha, illumination).hankel(0, near) / (2.0 * np.pi)
    return np.maximum(value, 0.0)


def _complement(x: Floats, alpha: float, illumination: str) -> Floats:
    """Share of the energy beyond x, for NEAREST_RADIUS <= x < inf."""
    transform = _transform(alpha, illumination)
    # A contour that starts at the origin itself (kappa = 0) passes half of the pole of H1 there.
    pole = 0.5 if alpha == 1.0 else 0.0
    return np.clip(pole - x * transform.hankel(1, x) / transform.reflectance, 0.0, 1.0)


def _cdf(x: Floats, alpha: float, illumination: str) -> Floats:
    value = np.where(x > 0, 1.0, 0.0)
    inside = (x > 0) & np.isfinite(x)
    near = np.maximum(x[inside], NEAREST_RADIUS)
    inner = 1.0 - _complement(near, max(alpha, SINGLE_SCATTERING), illumination)
    value[inside] = inner * np.minimum(x[inside] / NEAREST_RADIUS, 1.0)
    return value


def _quantile(xi: Floats, alpha: float, illumination: str) -> Floats:
    x = np.where(xi < 1, 0.0, np.inf)
    inside = (xi > 0) & (xi < 1)
    x[inside] = _invert(xi[inside], max(alpha, SINGLE_SCATTERING), illumination)
    return x


def _invert(xi: Floats, alpha: float, illumination: str) -> Floats:
    """Newton on the cdf, kept inside a bracket of tabulated radii that halves where Newton would leave it."""
    table_x = np.geomspace(NEAREST_RADIUS, 1e12, 700)
    table = np.minimum.accumulate(_complement(table_x, alpha, illumination))
    beyond = 1.0 - xi
    index = np.clip(np.searchsorted(-table, -beyond), 1, table_x.size - 1)
    nearest = beyond > table[0]
    low, high = np.where(nearest, 0.0, table_x[index - 1]), np.where(nearest, NEAREST_RADIUS, table_x[index])
    x = 0.5 * (low + high)
    for _ in range(60):
        error = _cdf(x, alpha, illumination) - xi
        low, high = np.where(error < 0, x, low), np.where(error < 0, high, x)
        density = 2.0 * np.pi * x * _profile(x, alpha, illumination) / _reflectance(alpha, illumination)
        with np.errstate(divide="ignore", invalid="ignore"):
            step = x - error / density
        bounded = (step > low) & (step < high)
        new = np.where(bounded, step, 0.5 * (low + high))
        if np.all(np.abs(new - x) <= 4e-16 * x) or np.all(np.abs(error) < 1e-15):
            break
        x = new
    return x


def _by_alpha(function, x: Floats, alpha: Floats, illumination: str) -> Floats:
    """Broadcast x against alpha and evaluate once an alpha: a transform serves all its radii."""
    x, alpha = np.broadcast_arrays(x, alpha)
    out = np.empty(x.shape)
    for value in np.unique(alpha):
        here = alpha == value
        out[here] = function(x[here], float(value), illumination)
    return out


def _require_solved(setting: Setting) -> None:
    if not (isinstance(setting, Setting) and setting.is_matched_isotropic):
        raise SettingError(f"the exact half space has n = 1 and g = 0, got {setting}: simulate it instead")


def _checked_alpha(alpha: ArrayLike) -> Floats:
    must = "alpha must be a single-scattering albedo in [0, 1]"
    values = _numbers(alpha, must)
    if not np.all((values >= 0) & (values <= 1)):
        raise InputError(f"{must}, got {_offender(values, 0, 1)}")
    return values


def _checked_mfp(mfp: ArrayLike) -> Floats:
    must = "mfp must be a mean free path > 0"
    values = _numbers(mfp, must)
    if not np.all((values > 0) & np.isfinite(values)):
        raise InputError(f"{must}, got {_offender(values, 5e-324, np.finfo(float).max)}")
    return values


def _checked_radius(r: ArrayLike) -> Floats:
    must = "r must be a radius >= 0"
    values = _numbers(r, must)
    if not np.all(values >= 0):
        raise InputError(f"{must}, got {_offender(values, 0, np.inf)}")
    return values


def _numbers(values: ArrayLike, must: str) -> Floats:
    try:
        return np.asarray(values, float)
    except (TypeError, ValueError):
        raise InputError(f"{must}, got {values!r}") from None


def _offender(values: Floats, low: float, high: float) -> float:
    return float(np.ravel(values)[~((values >= low) & (values <= high)).ravel()][0])


def _scalar_or_array(values: NDArray) -> float | Floats:
    return float(values) if np.ndim(values) == 0 else np.asarray(values)
