"""How far a law is from photons, for settings that have no exact profile: surfaces that refract.

The measures have the names and meanings of `quality`, with integrals over rings for values at radii. The photons may
be those that the law was fitted to: it cannot follow their noise, since it has a dozen constants and they have hundreds
of rings, and every measure stands beside what noise alone would make of it (`_noise`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim import Orders
from profilefit.fitting.profiles import Profiles
from profilefit.fitting.quality import ENERGY_WITHIN, NEAREST
from profilefit.laws.base import AlbedoLaw, ProfileLaw
from profilefit.recipes.recipe import RingLayout
from profilefit.recipes.targets import ring_edges

Floats = NDArray[np.float64]
RINGS = RingLayout(first=NEAREST, last=400.0, count=70)  # fifteen a decade
NODES, WEIGHTS = np.polynomial.legendre.leggauss(4)  # 2 pi r R_d over such a ring, to 1e-7
# Nearer to white the photons' own noise exceeds every law's error, and the maps are exact at white itself.
WHITEST = 0.999
TYPICAL = np.sqrt(2.0 / np.pi)  # mean |x| of a normal deviate


@dataclass(frozen=True)
class TallyQuality:
    """Measures of a profile law at each albedo (m,).

    rel        mean over ln r of |law/photons - 1| of ring energies, r from 0.01 mfp to 99.5 % of the energy
    rel_noise  what a law without error would have
    ks         max over the rings' edges of |cdf_law - cdf_photons|; ks_noise the standard error of that share at 1/2
    l1         half the sum over rings of |law - photons| of the energy's shares
    """

    alpha: Floats
    rel: Floats
    rel_noise: Floats
    ks: Floats
    ks_noise: Floats
    l1: Floats


def profile_quality(law: ProfileLaw, light: Orders, alpha: ArrayLike) -> TallyQuality:
    """Measure a law against photons of its own setting at each albedo in `alpha` (m,)."""
    data = Profiles.from_orders(light.merged(ring_edges(RINGS)), alpha, correlated=False)
    rows = [_at(law, data, i) for i in range(data.alpha.size)]
    return TallyQuality(data.alpha, *(np.array(column) for column in zip(*rows, strict=True)))


def ring_energies(law: ProfileLaw, r_edges: Floats, alpha: float) -> Floats:
    """Integrals of 2 pi r R_d over rings (n,) [-] between `r_edges` (n + 1,) > 0 [mfp], by quadrature."""
    half = 0.5 * np.diff(r_edges)[:, None]
    r = 0.5 * (r_edges[1:] + r_edges[:-1])[:, None] + half * NODES
    return np.asarray((half * 2.0 * np.pi * r * np.asarray(law.profile(r, alpha))) @ WEIGHTS)


def _at(law: ProfileLaw, data: Profiles, i: int) -> tuple[float, float, float, float, float]:
    alpha, energy, cdf = float(data.alpha[i]), data.energy[i], data.cdf[i]
    seen = (cdf[1:] <= ENERGY_WITHIN) & data.trusted[i] & (data.r_edges[:-1] > 0)
    width = np.log(data.r_edges[1:][seen] / data.r_edges[:-1][seen])
    modelled = ring_energies(law, data.r_edges[1:], alpha)[seen[1:]]
    rel = np.average(np.abs(modelled / energy[seen] - 1.0), weights=width)
    noise = np.average(TYPICAL * data.standard_error[i][seen] / energy[seen], weights=width)
    law_cdf = np.asarray(law.cdf(data.r_edges, alpha))
    ks = np.max(np.abs(law_cdf - cdf))
    ks_noise = 0.5 / np.sqrt(data.albedo_samples[i])
    l1 = 0.5 * np.sum(np.abs(np.diff(law_cdf) - np.diff(cdf)))
    return float(rel), float(noise), float(ks), float(ks_noise), float(l1)


@dataclass(frozen=True)
class TallyAlbedoQuality:
    """Measures of a map between alpha and A, as in `quality.AlbedoQuality`, for alpha up to 0.999.

    delta_A_noise  standard error of the photons' A where the law is farthest from it
    at_one         alpha at the largest A there is, the share of the light that enters
    """

    delta_A: float
    delta_A_noise: float
    delta_alpha: float
    largest_s: float
    monotone: bool
    at_one: float
    fold: float


def albedo_quality(law: AlbedoLaw, light: Orders) -> TallyAlbedoQuality:
    """Measure a map on albedos even in sqrt(1 - alpha), and its shape on reflectances up to the largest."""
    s = np.linspace(np.sqrt(1.0 - WHITEST), 1.0, 200, endpoint=False)
    alpha = 1.0 - s**2
    truth = light.reflectance(alpha)
    value, error = np.asarray(truth.value), np.asarray(truth.standard_error)
    gap = np.abs(np.asarray(law.reflectance(alpha)) - value)
    mapped_alpha = np.asarray(law.alpha(value))
    even = np.linspace(0.0, light.entered, 20001)
    rising = np.diff(np.asarray(law.alpha(np.minimum(even, 1.0)))) > 0
    farthest = int(np.nanargmax(gap))
    return TallyAlbedoQuality(
        float(gap[farthest]),
        float(error[farthest]),
        float(np.max(np.abs(mapped_alpha - alpha))),
        float(np.max(np.abs(np.sqrt(1.0 - mapped_alpha) / s - 1.0))),
        bool(rising.all()),
        float(law.alpha(even[-1])),
        1.0 if rising.all() else float(even[np.argmax(~rising)]),
    )
