"""Exact light of half spaces and stacks, in float64, the only precision that it has: alpha up to 1, both ends of radii.

Profile and cdf are judged by half as many nodes again, none in common, next to the source by its limit, and where n
tends to 1 by the closed form there; radii by the share within them; A by the map that is fitted to it; kappa by its own
equation. Plates are judged by all that is known of them without their equation: nothing is lost where nothing is
absorbed, thick ones are the half space, thin ones scatter once; and their profiles by more nodes.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from mcml_sim import Layer, Medium, Setting, exact
from mcml_sim.exact import by_albedo
from mcml_sim.exact.half_space import FINER
from mcml_sim.exact.single_scattering import source_strength
from mcml_sim.exact.stack import solution
from mcml_sim.media.arrays import Floats
from profilefit.laws.base import Normalisation, Range
from profilefit.studies.stability import cells
from profilefit.studies.stability.cells import Axes, Cells, Mask, absolute, axis, relative, steps_down, steps_up

DECAY = "κ(α)"
# What its own docstring promises of profile and cdf, and of a map that is fitted to A.
BOUNDS = {cells.PROFILE: 1e-6, cells.CDF: 1e-9, cells.SAMPLE: 1e-9, cells.REFLECTANCE_OF: 1e-5, DECAY: 1e-10}
SURE_ALPHA, SURE_X = 0.05, (1e-6, 100.0)
NO_LIMIT = "closer than 1e-6 mfp under diffuse light R_d's limit is not known"
NEAR_SOURCE = 1e-4  # relative, of R_d closer than 1e-6 mfp, where its limit stands for it


def half_space_cells(setting: Setting, normalisation: Normalisation) -> Iterator[Cells]:
    """Yield every function of a matched half space. Errors are those that more nodes show, or those of an identity."""
    name = "exact" if setting.illumination == "searchlight" else "exact, diffuse light"
    alpha, xi = (cells.unit_axis(symbol, np.float64) for symbol in ("α", "ξ"))
    x = cells.radius_axis(np.float64)
    low, high = cells.LENGTHS[np.float64]
    mfp = axis("l", (low, 1.0, high), "length")
    a = alpha.values[:, None, None]
    with np.errstate(all="ignore"):
        r = x.values[:, None] * mfp.values
        profile, cdf = (np.asarray(each(r, a, mfp.values, setting)) for each in (exact.profile, exact.cdf))
        drawn = np.asarray(exact.quantile(xi.values[None, :, None], a, mfp.values, setting))
        within = exact.cdf(drawn, a, mfp.values, setting)
        yield _profile(name, setting, (alpha, x, mfp), profile)
    finer = finer_cdf(x.values, alpha.values, setting)
    falls = steps_down(cdf, 1, np.float64, 1.0)
    yield _cells(name, cells.CDF, (alpha, x, mfp), cdf, finer, absolute(cdf, finer), wrong_way=falls)
    missed = absolute(np.asarray(within), np.broadcast_to(xi.values[None, :, None], drawn.shape))
    falls, below = steps_down(drawn, 1, np.float64, drawn), xi.values[None, :, None] < 1.0
    yield _cells(name, cells.SAMPLE, (alpha, xi, mfp), drawn, drawn, missed, inside=below, wrong_way=falls)
    value = np.asarray(exact.reflectance(alpha.values, setting))
    near = np.asarray(normalisation.reflectance(alpha.values))
    rise = steps_down(value, 0, np.float64, 1.0)
    yield _cells(name, cells.REFLECTANCE_OF, (alpha,), value, near, absolute(value, near), wrong_way=rise)
    kappa = np.asarray(exact.decay_rate(alpha.values))
    with np.errstate(all="ignore"):
        left = np.where(alpha.values > 0, kappa - np.tanh(kappa / np.maximum(alpha.values, 1e-300)), kappa - 1.0)
    yield _cells(name, DECAY, (alpha,), kappa, kappa, np.abs(left), wrong_way=steps_up(kappa, 0, np.float64))


def finer_cdf(x: Floats, alpha: Floats, setting: Setting) -> Floats:
    """Return the cdf by more nodes, (alphas, radii, 1)."""
    return np.asarray(by_albedo.by_alpha(by_albedo.cdf, x, alpha[:, None], setting, FINER))[..., None]


def _profile(name: str, setting: Setting, places: Axes, value: Floats) -> Cells:
    """Return R_d against its own limit next to the source; beyond, what more nodes change.

    Where nothing is promised of it, for dark media and beyond 100 mfp, what they change is outside its range.
    """
    alpha, x, mfp = places
    a, near = alpha.values[:, None, None], x.values[None, :, None]
    known = 1.0 if setting.illumination == "searchlight" else np.nan
    limit = a / (4.0 * np.pi * near) / mfp.values / mfp.values * known
    limit = np.where((near == 0) & (a > 0), np.inf, limit)
    with np.errstate(all="ignore"):
        stated = np.asarray(exact.error_estimate(x.values, alpha.values[:, None], setting=setting))[..., None]
    at_limit = near < SURE_X[0]
    error = np.where(at_limit, relative(value, limit) * BOUNDS[cells.PROFILE] / NEAR_SOURCE, stated)
    inside = at_limit | ((a >= SURE_ALPHA) & (near <= SURE_X[1])) | ~(error > BOUNDS[cells.PROFILE])
    reference = np.where(at_limit, limit, value)
    lost = ((near > 0) & (near < 4.0 * np.finfo(float).tiny)) | (a < cells.DIMMEST[np.float64])
    depth = np.abs(np.log(np.maximum(value * mfp.values**2, 1e-300)))
    rise = steps_up(value, 1, np.float64, value * depth + 1e-9 * value)
    return _cells(name, cells.PROFILE, places, value, reference, error, inside=inside, dim=lost, wrong_way=rise)


def _cells(
    name: str, quantity: str, axes: Axes, *triple: Floats, bound: float = 0.0, inside: Mask | bool = True, **more: Any
) -> Cells:
    """Return cells of value, reference and error, by default within the bound of the quantity."""
    value, reference, error = triple
    given = axes, value, reference, error, bound or BOUNDS[quantity], inside
    more["unjudged"] = NO_LIMIT if quantity == cells.PROFILE else ""
    return Cells(name, True, quantity, cells.FLOAT64, *given, judge=inside, **more)


BARELY = 1.0 + 1e-9  # an index that hardly refracts
SETTINGS = (Setting(n=BARELY), Setting(n=1.4), Setting("diffuse", n=3.0))
# What the docstrings of `exact` and of `exact.solve` promise where surfaces refract.
REFRACTING = {cells.PROFILE: 1e-7, cells.CDF: 2e-7, cells.REFLECTANCE_OF: 1e-7}
REFRACTING_ALPHA, REFRACTING_X = Range(0.05, 0.999), Range(1e-3, 15.0)
PLATE_ALPHA = (0.0, 0.05, 0.5, 0.9, 0.99, 0.999, 1.0 - 1e-6, 1.0)
THICKNESS = (1e-3, 0.03, 0.5, 3.0, 30.0, 1e3)  # [mfp]
PLATE_INDEX = (1.0, 1.4, 3.0)
PROFILED = (1e-2, 1.5, 1e3)  # thicknesses, of alpha 0.9 and n = 1.4
PROFILE_BOUND, THIN_BOUND, THIN, SEEN = 1e-5, 1e-2, 1.0, 1e-3  # SEEN of R_d at one mfp
PLATE_X = (0.0, 1e-12, 1e-6, 1e-3, 0.01, 0.1, 0.3, 1.0, 2.0, 3.0, 5.0, 10.0, 100.0, 1e6, np.inf)


def refracting_cells() -> Iterator[Cells]:
    """Yield half spaces by albedo and radius, plates by albedo and thickness, and the profile of some of them."""
    for setting in SETTINGS:
        yield from _refracting(setting)
    yield from map(plates, PLATE_INDEX)
    yield _plate_profiles()


def _refracting(setting: Setting) -> Iterator[Cells]:
    name = f"exact, n = {setting.n:.10g}" + ("" if setting.illumination == "searchlight" else ", diffuse light")
    alpha, x = cells.unit_axis("α", np.float64), cells.radius_axis(np.float64)
    a, r = alpha.values[:, None], x.values[None]
    closed, barely = Setting(setting.illumination), setting.n == BARELY
    promised = REFRACTING[cells.PROFILE]
    with np.errstate(all="ignore"):
        profile = np.asarray(exact.profile(r, a, setting=setting))
        if barely:
            error = relative(profile, np.asarray(exact.profile(r, a, setting=closed)))
        else:
            error = np.asarray(exact.error_estimate(r, a, setting=setting))
        limit = np.where(r == 0, np.inf, a * source_strength(setting) / (2 * np.pi * r))
    sure = REFRACTING_ALPHA.holds(a)
    near = (r < SURE_X[0]) & sure
    error = np.where(near, relative(profile, limit) * promised / NEAR_SOURCE, error)
    reference, inside = np.where(near, limit, profile), near | sure & REFRACTING_X.holds(r)
    bound = 1e-6 if barely else promised
    yield _cells(name, cells.PROFILE, (alpha, x), profile, reference, error, bound=bound, inside=inside)
    cdf = np.asarray(exact.cdf(r, a, setting=setting))
    finer = (
        np.asarray(exact.cdf(r, a, setting=closed)) if barely else finer_cdf(x.values, alpha.values, setting)[..., 0]
    )
    bound = REFRACTING[cells.CDF]
    falls = steps_down(cdf, 1, np.float64, bound / np.finfo(float).eps / 16.0)
    given = cdf, finer, absolute(cdf, finer)
    yield _cells(name, cells.CDF, (alpha, x), *given, bound=bound, inside=sure, wrong_way=falls)


def plates(n: float) -> Cells:
    """Return A of one layer, judged by what holds without its equation."""
    alpha = axis("α", PLATE_ALPHA)
    thickness = axis("thickness", THICKNESS, "mfp")
    solved = [[exact.solve(plate(a, d, n)) for d in THICKNESS] for a in PLATE_ALPHA]
    finer = [[exact.solve(plate(a, d, n), nodes=solution.FINE) for d in THICKNESS] for a in PLATE_ALPHA]
    value, reference = (np.array([[one.reflectance for one in row] for row in all]) for all in (solved, finer))
    error = relative(value, reference)
    entered = 1.0 - np.array([[one.specular for one in row] for row in solved])
    whole = value + 1.0 - entered + np.array([[one.transmittance for one in row] for row in solved])
    error[-1] = np.maximum(error[-1], np.abs(whole[-1] - 1.0))
    deep = np.array([exact.reflectance(a, Setting(n=n)) for a in PLATE_ALPHA[1:-2]])
    error[1:-2, -1] = np.maximum(error[1:-2, -1], relative(value[1:-2, -1], deep))
    if n == 1.0:  # half of what a thin plate scatters comes back; the next order is d ln d of it
        thin = value[:, 0] - np.array(PLATE_ALPHA) * THICKNESS[0] / 2
        error[:, 0] = np.maximum(error[:, 0], np.where(np.abs(thin) > 0.02 * value[:, 0], np.abs(thin), 0.0))
    falls = steps_down(value, 0, np.float64) | steps_down(value, 1, np.float64) & (n == 1.0)
    name, bound = f"stack, n = {n:g}", REFRACTING[cells.REFLECTANCE_OF]
    return _cells(name, cells.REFLECTANCE_OF, (alpha, thickness), value, reference, error, bound=bound, wrong_way=falls)


def plate(alpha: float, thickness: float, n: float) -> Medium:
    """Return one layer of one mean free path in one unit of length."""
    return Medium((Layer(n, 1.0 - alpha, alpha, 0.0, thickness),))


def _plate_profiles() -> Cells:
    x, thickness = axis("r/l", PLATE_X), axis("thickness", PROFILED, "mfp")
    media = [plate(0.9, d, 1.4) for d in PROFILED]
    value, finer = (
        np.array([exact.solve(one, nodes=nodes).profile(PLATE_X) for one in media])
        for nodes in (solution.STANDARD, solution.FINE)
    )
    seen = finer > SEEN * finer[:, [PLATE_X.index(1.0)]]
    error = relative(value, finer) * np.where(thickness.values[:, None] < THIN, PROFILE_BOUND / THIN_BOUND, 1.0)
    inside = seen & (x.values >= REFRACTING_X.low) | (x.values == 0)
    given = value, finer, error
    return _cells("stack, n = 1.4", cells.PROFILE, (thickness, x), *given, bound=PROFILE_BOUND, inside=inside)
