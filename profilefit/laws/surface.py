"""Closed forms of a semi-infinite medium under a refracting interface: numbers of the light, the index and g.

A fit to several media gives arrays of them, one number for each profile; a law of one has floats.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from mcml_sim.exact import single_scattering
from mcml_sim.media.setting import Setting

Number = Any  # a float, or an array of jax or numpy


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
