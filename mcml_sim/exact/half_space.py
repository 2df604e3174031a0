"""Functions of `mcml_sim.exact`, whose docstring says what they take and how far they hold."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from mcml_sim.errors import InputError, SettingError
from mcml_sim.exact import by_albedo, forwards
from mcml_sim.exact.by_albedo import Surface, by_alpha, elementwise, radius_within, surface, total
from mcml_sim.exact.special_functions import squared_decay_rate
from mcml_sim.exact.transform import STANDARD, Transform
from mcml_sim.media.arrays import Floats, checked_range, require_one_shape, require_own_process, scalar_or_array
from mcml_sim.media.setting import FORWARD_G, FORWARD_N, ILLUMINATIONS, SEARCHLIGHT, Setting, is_traced

Numbers = ArrayLike | jax.Array

FINER = STANDARD.scaled(1.5)

WHERE = (
    f"n >= 1 where g = 0, and n from {FORWARD_N[0]} to {FORWARD_N[1]} where Henyey and Greenstein's g is from 0 to "
    f"{FORWARD_G}"
)
# What an argument of this name is, and its least and greatest value.
ARGUMENTS = {
    "alpha": ("a reduced albedo in [0, 1]", 0.0, 1.0),
    "mfp": ("a transport mean free path > 0, from 1e-100 to 1e+100", 1e-100, 1e100),  # its square is a float64
    "r": ("a radius >= 0", 0.0, np.inf),
    "xi": ("a share of the energy in [0, 1]", 0.0, 1.0),
}


def reflectance(alpha: Numbers, setting: Setting = SEARCHLIGHT) -> float | Floats:
    """Return the total diffuse reflectance A of the half space [-]; `alpha` its reduced albedo in [0, 1].

    R^(0), which where n = 1 equals 1 - H(1) sqrt(1 - alpha) under a searchlight and 1 - 2 sqrt(1 - alpha) int_0^1 H(mu)
    mu dmu under diffuse light (Chandrasekhar 1950, ch. V) without their cancellation. Relative error below 1e-12, where
    n > 1 below 3e-8. Its derivative at alpha = 1 is infinite: differentiate by sqrt(1 - alpha) there.
    """
    (albedo,) = _all_checked(setting, alpha=alpha)
    if not setting.is_isotropic:
        return scalar_or_array(forwards.reflectance(albedo, setting))
    return scalar_or_array(albedo * elementwise(_reflectance[setting.illumination], albedo, surface(setting)))


def profile(r: Numbers, alpha: Numbers, mfp: Numbers = 1.0, setting: Setting = SEARCHLIGHT) -> float | Floats:
    """Return the reflectance profile R_d(r) [1/length^2]: 2 pi r R_d integrates to A.

    2 pi r R_d tends to alpha / (2 mfp) at r = 0 where n = 1 and g = 0, else to alpha / (mfp (1 - g)) times
    `single_scattering.source_strength`.
    """
    radius, albedo, length = _all_checked(setting, r=r, alpha=alpha, mfp=mfp)
    of_kind: Callable[..., Any] = partial(by_alpha, by_albedo.profile) if setting.is_isotropic else forwards.profile
    return scalar_or_array(of_kind(radius / length, albedo, setting) / length**2)


def cdf(r: Numbers, alpha: Numbers, mfp: Numbers = 1.0, setting: Setting = SEARCHLIGHT) -> float | Floats:
    """Return the share of the reflected energy that leaves within radius r [-]: 0 at r = 0, 1 at infinity."""
    radius, albedo, length = _all_checked(setting, r=r, alpha=alpha, mfp=mfp)
    of_kind: Callable[..., Any] = partial(by_alpha, by_albedo.cdf) if setting.is_isotropic else forwards.cdf
    return scalar_or_array(of_kind(radius / length, albedo, setting))


def quantile(xi: Numbers, alpha: Numbers, mfp: Numbers = 1.0, setting: Setting = SEARCHLIGHT) -> float | Floats:
    """Return the radius within which the share `xi` in [0, 1] of the reflected energy leaves [length].

    The derivative at xi = 1, infinite, is given as 0.
    """
    share, albedo, length = _all_checked(setting, xi=xi, alpha=alpha, mfp=mfp)
    if not setting.is_isotropic:
        values = forwards.quantile(share, albedo, setting)
    elif any(isinstance(value, jax.Array) for value in (share, albedo, setting.n)):
        # A number must stay one: as an array it would be an n to differentiate by, and 1 no longer be told from 1 + 0.
        n, known = (setting.n, None) if is_traced(setting.n) else (None, setting.n)
        values = _radius_within(share, albedo, n, known, setting.illumination)
    else:
        values = by_alpha(radius_within, share, albedo, setting)
    return scalar_or_array(values * length)


def decay_rate(alpha: Numbers) -> float | Floats:
    """Return kappa of isotropic scattering, where alpha artanh(kappa) = kappa: R_d falls as e^{-kappa r / mfp} r^-2."""
    return scalar_or_array(elementwise(_decay_rate, *_all_checked(SEARCHLIGHT, alpha=alpha)))


def error_estimate(r: Numbers, alpha: Numbers, mfp: Numbers = 1.0, setting: Setting = SEARCHLIGHT) -> float | Floats:
    """Return the relative change of `profile` with half as many nodes again in each quadrature, none in common [-].

    Their errors fall exponentially with the number of nodes, so nearly all of the change is the error of `profile`:
    that of quadrature, and of rounding, which differs too. It knows nothing of what both take for granted: the
    equation of transfer, and the limit closer to the source than 1e-6 mfp. 0 where the profile is 0 or infinite.

    Where g > 0: its change without the g of the table that is farthest from the setting's.
    """
    radius, albedo, length = _all_checked(setting, r=r, alpha=alpha, mfp=mfp)
    x = radius / length
    if setting.is_isotropic:
        coarse, fine = (by_alpha(by_albedo.profile, x, albedo, setting, rule) for rule in (STANDARD, FINER))
    else:
        coarse, fine = (forwards.profile(x, albedo, setting, coarse) for coarse in (True, False))
    xp = jnp if isinstance(fine, jax.Array) else np
    same = coarse == fine
    return scalar_or_array(xp.abs(xp.where(same, 1.0, coarse) / xp.where(same, 1.0, fine) - 1.0))


_reflectance = {name: partial(total, illumination=name) for name in ILLUMINATIONS}


def _decay_rate(alpha: jax.Array, of: Surface) -> jax.Array:
    return jnp.sqrt(squared_decay_rate(alpha))


def _ring_density(transform: Transform, alpha: jax.Array, x: jax.Array) -> jax.Array:
    return by_albedo.ring_density(transform, x) / transform.reflectance


@partial(jax.custom_jvp, nondiff_argnums=(3, 4))
def _radius_within(
    xi: jax.Array, alpha: jax.Array, n: jax.Array | None, known: float | None, illumination: str
) -> jax.Array:
    """Return the radius under an index `n` by which it can be differentiated, or a `known` one."""
    return by_alpha(radius_within, xi, alpha, _setting(illumination, n, known))


@_radius_within.defjvp
def _radius_within_jvp(
    known: float | None, illumination: str, primals: tuple, tangents: tuple
) -> tuple[jax.Array, jax.Array]:
    """Differentiate the implicit function cdf(x, alpha, n) = xi."""
    (xi, *where), (d_xi, *d_where) = primals, tangents
    radius = _radius_within(xi, *where, known, illumination)
    x = jnp.where(xi == 1.0, 1.0, radius)
    _, d_cdf = jax.jvp(
        lambda a, n: by_alpha(by_albedo.cdf, x, a, _setting(illumination, n, known)), tuple(where), tuple(d_where)
    )
    alpha, n = where
    density = jnp.where(xi == 1.0, jnp.inf, by_alpha(_ring_density, x, alpha, _setting(illumination, n, known)))
    return radius, (d_xi - d_cdf) / density


def _setting(illumination: str, n: Any, known: Any) -> Setting:
    return Setting(illumination, known if n is None else n)


def require_solved(setting: Setting) -> None:
    """Raise SettingError for a half space that is not solved."""
    if not (isinstance(setting, Setting) and setting.is_solved):
        if isinstance(setting, Setting) and is_traced(setting.n) and setting.g != 0:
            raise SettingError(f"exact light has derivatives by n where g = 0 only, got g = {setting.g:g}")
        raise SettingError(f"exact light needs {WHERE}, got {setting}: simulate it instead (mcml_sim.simulate_orders)")


def _all_checked(setting: Setting, **given: Any) -> list[Any]:
    """Return each argument as `_checked`; InputError if their shapes do not broadcast, or `setting` is not solved."""
    require_solved(setting)
    require_own_process()
    values = {name: _checked(name, value) for name, value in given.items()}
    require_one_shape(**values)
    return list(values.values())


def _checked(name: str, value: Any) -> Any:
    """Return a float64 array: of numpy, with InputError for what is out of range, or of jax, with nan for it."""
    what, low, high = ARGUMENTS[name]
    if isinstance(value, jax.Array):
        on = jnp.result_type(float) == np.float64
        if not (on and value.dtype == np.float64):
            got = f"{value.dtype}" + ("" if on else " outside of it")
            raise InputError(f"{name} must be a float64 array within jax.enable_x64(True), got {got}")
        return jnp.where((value >= low) & (value <= high), value, jnp.nan)
    return checked_range(name, value, what, low, high)
