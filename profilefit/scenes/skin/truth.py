"""Exact light that the head is matched with: albedo of a reflectance, and width of a profile."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.optimize import brentq

from mcml_sim import Setting, exact
from mcml_sim.exact.single_scattering import entered

RADII = 4000  # of a profile, at even shares of its energy


@cache
def albedo_of(reflectance: float, setting: Setting) -> float:
    """Return alpha of the exact half space of reflectance A [-]."""
    share = max(reflectance, 0.0)
    if share >= entered(setting):  # a surface that refracts lets no more in
        return 1.0
    return float(brentq(lambda alpha: float(exact.reflectance(alpha, setting)) - share, 0.0, 1.0))


@cache
def exact_quartile(alpha: float, setting: Setting) -> float:
    """Return the distance [mfp] from a step edge at which the exact profile lets 3/4 of the light through.

    A radius r drawn by the profile, in a random direction, crosses an edge at distance q with the chance
    arccos(q / r) / pi; the mean over even shares of the energy is 1/4 there.
    """
    radius = np.asarray(exact.quantile((np.arange(RADII) + 0.5) / RADII, alpha, setting=setting))

    def crossed(distance: float) -> float:
        return float(np.mean(np.arccos(np.minimum(distance / radius, 1.0)))) / np.pi - 0.25

    return float(brentq(crossed, 0.0, radius[-1]))
