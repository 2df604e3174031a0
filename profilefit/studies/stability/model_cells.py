"""Laws against the exact half space: what no arithmetic can mend, because the formula says so."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from mcml_sim import exact
from mcml_sim.exact.light import unreduced
from profilefit.fitting.quality import ENERGY_WITHIN, NEAREST
from profilefit.laws.liang import Liang
from profilefit.recipes.catalogue import Named
from profilefit.studies.stability.cells import Cells, absolute, judged, relative
from profilefit.studies.stability.law_cells import Limits
from profilefit.studies.stability.layout import CDF, FLOAT64, MODEL, PROFILE, SAMPLE, ArgumentAxis

Floats = NDArray[np.float64]
# What a picture shows at once: R_d off by a third, three hundredths of the light in the wrong place.
BOUNDS = {PROFILE: 1.0 / 3.0, CDF: 0.03, SAMPLE: 0.03}
ALPHA = (0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 0.995, 0.999, 0.9999, 1.0 - 1e-6, 1.0)
RADIUS = tuple(float(one) for one in np.geomspace(NEAREST, 300.0, 19))
SHARE = (1e-3, 5e-3, 0.0099, 0.0101, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 0.995, 0.999)
INVERSE, ENERGY = "g, not clipped (19)", "energy (17)"
ENERGY_BOUND = 0.1  # of cdf(r_max), which (18) hides by dividing


def cells_of(one: Named, limits: Limits) -> Iterator[Cells]:
    """R_d, cdf and radii of a law whose setting has an exact profile; and what only the laws of Liang et al. have."""
    if one.setting.is_solved:
        yield from _against_exact(one, limits)
    if isinstance(one.law, Liang):
        yield unclipped(one, limits)
        yield own_energy(one, limits)


def _against_exact(one: Named, limits: Limits) -> Iterator[Cells]:
    alpha, x, xi = (ArgumentAxis(n, "-", np.array(v)) for n, v in (("α", ALPHA), ("r/l", RADIUS), ("ξ", SHARE)))
    albedo, r, share = alpha.values[:, None], x.values[None], xi.values[None]
    law, setting = one.law.in_reduced(), one.setting
    own = np.asarray(unreduced(albedo, setting.g))  # of the medium that has this reduced albedo, and l* = 1
    medium = own, 1.0 - own * setting.g, setting
    within = np.asarray(exact.cdf(r, *medium))
    with np.errstate(all="ignore"):
        drawn = np.asarray(law.sampler.sample(share, albedo))
        profile, cdf = np.asarray(law.profile(r, albedo)), np.asarray(law.cdf(r, albedo))
    reached = np.asarray(exact.cdf(np.where(drawn >= 0, drawn, np.inf), *medium))
    if np.any(
        law.sampler.jump(alpha.values) < 1.0
    ):  # two shares of the light draw one radius: the law's own nearer one
        reached += np.asarray(law.sampler.undone(drawn, share, albedo)) - np.asarray(law.cdf(drawn, albedo))
    truth = np.asarray(exact.profile(r, *medium))
    held = limits.valid.alpha.holds(albedo) if limits.valid.alpha else np.zeros_like(albedo, bool)
    draws = limits.valid.drawn.holds(albedo) if limits.valid.drawn else np.zeros_like(albedo, bool)
    seen = (within <= ENERGY_WITHIN) & law.entry.profile.holds(albedo)
    stated = {name: limits.stated(name) for name in BOUNDS}
    yield _cells(one, stated, PROFILE, (alpha, x), profile, truth, relative(profile, truth), held & seen)
    yield _cells(one, stated, CDF, (alpha, x), cdf, within, absolute(cdf, within), held & np.ones_like(within, bool))
    right = np.broadcast_to(share, drawn.shape)
    yield _cells(
        one, stated, SAMPLE, (alpha, xi), drawn, drawn, absolute(reached, right), draws & np.ones_like(drawn, bool)
    )


def _cells(
    one: Named, stated: dict[str, float], name: str, places: tuple[ArgumentAxis, ...], value, reference, error, inside
) -> Cells:
    codes = judged(value, reference, error, BOUNDS[name], inside, np.float64)
    return Cells(
        one.label, one.law.entry.own, name, MODEL, places, value, reference, error, BOUNDS[name], inside, codes,
        one.law, stated=stated[name],
    )  # fmt: skip


def unclipped(one: Named, limits: Limits) -> Cells:
    """g(xi) of (19), which should be a radius, and is judged by its sign; the law takes |g|, up to r_max."""
    alpha, xi = (
        ArgumentAxis("α", "-", np.array((0.0, *ALPHA))),
        ArgumentAxis("ξ", "-", np.array((0.0, 1e-6, 1e-4, *SHARE))),
    )
    with np.errstate(all="ignore"):
        value = np.asarray(one.law.sampler.unclipped(xi.values[None], alpha.values[:, None]))
    inside = (
        np.broadcast_to(limits.valid.alpha.holds(alpha.values)[:, None], value.shape) if limits.valid.alpha else None
    )
    inside = np.zeros(value.shape, bool) if inside is None else inside
    error = np.where(value < 0, np.abs(value), 0.0)
    codes = judged(value, np.abs(value), error, 0.0, inside, np.float64)
    return Cells(one.label, False, INVERSE, FLOAT64, (alpha, xi), value, value, error, 0.0, inside, codes, one.law)


def own_energy(one: Named, limits: Limits) -> Cells:
    """cdf(r_max) of (17) before (18) divides by it: the law's own energy over A, which should be 1."""
    alpha = ArgumentAxis("α", "-", np.array((0.0, *ALPHA)))
    with np.errstate(all="ignore"):
        whole = np.asarray(one.law.unscaled_energy(np.inf, alpha.values))
        value = whole / np.asarray(one.law.albedo.reflectance(alpha.values))
    right = np.ones_like(value)
    inside = limits.valid.alpha.holds(alpha.values) if limits.valid.alpha else np.zeros(value.shape, bool)
    codes = judged(value, right, absolute(value, right), ENERGY_BOUND, inside, np.float64)
    return Cells(
        one.label, False, ENERGY, MODEL, (alpha,), value, right, absolute(value, right), ENERGY_BOUND, inside, codes,
        one.law,
    )  # fmt: skip
