"""How good a law of a stack is, against light that it was not fitted to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mcml_sim import exact
from profilefit.laws.stack import StackLaw
from profilefit.recipes.stack import fit
from profilefit.recipes.stack.photons import TracedRings

NEAR_TRACED = 0.1  # radius from which on rel is of traced light [mfp]


class StackQuality(NamedTuple):
    """How good a law is at one thickness.

    rel  mean relative error of R_d [-];  noise  that was taken off it in quadrature;  ks  largest error of the cdf
    delta_A  relative error of A [-]
    """

    rel: float
    noise: float
    ks: float
    delta_A: float


def between(one: fit.Interface) -> dict[str, list[float]]:
    """rel, ks and the relative error of A at thicknesses that were not fitted, between those that were [length]."""
    d, illumination = np.sqrt(one.thicknesses[:-1] * one.thicknesses[1:]), one.law.setting.illumination
    if one.is_traced:
        fresh = [fit.rings_of(one.medium, each, illumination, len(d) + 1 + i) for i, each in enumerate(d)]
        found = [of_rings(one.law, each, rings) for each, rings in zip(d, fresh, strict=True)]
    else:
        found = [_of_exact(one, float(each)) for each in d]
    kept = {name: [getattr(each, name) for each in found] for name in ("rel", "ks", "delta_A")}
    return {"thickness": d.tolist(), **kept}


def of_rings(law: StackLaw, thickness: float, rings: TracedRings) -> StackQuality:
    """By traced light; rel is of rings from a tenth of the first layer's mean free path."""
    within = np.asarray(law.cdf(rings.edges, thickness)) * float(law.total(thickness))
    counts = (rings.weight > 0) & (rings.edges[:-1] > NEAR_TRACED * law.layers[0].mfp)
    off = float(np.mean(np.abs(np.diff(within)[counts] / rings.energy[counts] - 1.0)))
    # The mean size of a Gaussian's values is sqrt(2 / pi) of its spread.
    noise = float(np.sqrt(2.0 / np.pi) * np.mean(rings.noise[counts]))
    light = np.cumsum(np.where(rings.weight > 0, rings.energy, np.diff(within)))
    ks = float(np.max(np.abs(light - within[1:]))) / rings.whole
    return StackQuality(
        float(np.sqrt(max(off**2 - noise**2, 0.0))), noise, ks, float(law.total(thickness)) / rings.whole - 1
    )


def _of_exact(one: fit.Interface, thickness: float) -> StackQuality:
    light = exact.solve(one.medium.with_first(thickness), one.law.setting.illumination, fit.NODES)
    r = fit.radii(one.medium)
    share = np.asarray(light.cdf(r))
    near = r[share <= fit.LAST_SHARE]
    relative = np.asarray(one.law.profile(near, thickness)) / np.asarray(light.profile(near)) - 1.0
    ks = float(np.max(np.abs(np.asarray(one.law.cdf(r, thickness)) - share)))
    return StackQuality(
        float(np.mean(np.abs(relative))), 0.0, ks, float(one.law.total(thickness)) / light.reflectance - 1
    )
