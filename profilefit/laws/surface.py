"""Closed forms of a semi-infinite medium: numbers of the light, the index and g of its interface, and its decay rate.

A fit to several media gives arrays of them, one number for each profile; a law of one has floats.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from mcml_sim.exact import single_scattering
from mcml_sim.media.setting import Setting

Number = Any  # a float, or an array of jax or numpy
# Nearer to white than this share of absorption the series alone is right to 2.4e-5, and Newton's step would cancel.
NEAR_WHITE = 0.08
DARKEST = 1e-6  # below this albedo kappa is 1 to the last bit


class RefractingSurface(NamedTuple):
    """Closed numbers of one setting, or arrays of those of several.

    Albedos and lengths are reduced ones: light scattered once is that of the phase function p / (1 - g).

    cosine    mu_c = sqrt(1 - 1/n^2), of the critical angle inside [-]
    trapped   rho, the share of cosine-weighted light from inside that the surface reflects back [-]
    entered   of the light that arrives, the share that enters [-]
    once      A_1, the reflectance by light scattered exactly once, over alpha [-]
    source    lim 2 pi r R_d at r = 0, over alpha [1/l*]
    critical  k_c, with which light scattered once falls off [1/l*]
    g         mean cosine of the scattering angle [-]
    """

    cosine: Number
    trapped: Number
    entered: Number
    once: Number
    source: Number
    critical: Number
    g: Number = 0.0


@lru_cache(maxsize=64)
def surface_of(setting: Setting) -> RefractingSurface:
    """Return the numbers of one setting, n >= 1."""
    forward = 1.0 - setting.g
    return RefractingSurface(
        cosine=float(np.sqrt((setting.n - 1.0) * (setting.n + 1.0))) / setting.n,
        trapped=1.0 - single_scattering.mean_transmittance(setting.n),
        entered=single_scattering.entered(setting),
        once=single_scattering.reflected(setting) / forward,
        source=single_scattering.source_strength(setting) / forward,
        critical=single_scattering.critical_rate(setting),
        g=setting.g,
    )


def surfaces_of(settings: tuple[Setting, ...]) -> RefractingSurface:
    """Return the numbers of several settings, each (k, 1)."""
    return RefractingSurface(*(np.array(column)[:, None] for column in zip(*map(surface_of, settings), strict=True)))


def decay_rate(alpha) -> jax.Array:
    """Return kappa [1/mfp], the root of kappa = tanh(kappa / alpha): R_d falls off as e^{-kappa r} r^-2.

    kappa^2 = q (3 - 12/5 q + 12/175 q^2 + 58/175 q^3), q = 1 - alpha, has the three terms of the root's own series at
    q = 0 and its value at q = 1 (off by 2 % at most between); one step of Newton's method leaves 2.4e-5 (relative).
    No fitted constant. It depends on the scattering only, not on the light or the surface.
    """
    q = 1.0 - alpha
    series = jnp.sqrt(jnp.maximum(q * (3.0 + q * (-12.0 / 5.0 + q * (12.0 / 175.0 + q * (58.0 / 175.0)))), 0.0))
    absorbing = q > NEAR_WHITE
    start = jnp.where(absorbing, series, 0.5)
    bounded = jnp.where(absorbing, jnp.maximum(alpha, DARKEST), 0.9)
    t = jnp.tanh(start / bounded)
    step = (start - t) / (1.0 - (1.0 - t * t) / bounded)
    return jnp.where(absorbing, start - step, series)
