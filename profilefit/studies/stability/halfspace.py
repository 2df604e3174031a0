"""The exact half space: A, profile, cdf, quantile and decay rate, in float64, the only precision that it has.

Profile and cdf are judged by half as many nodes again, none in common; radii by the share within them; A by the map
that is fitted to it; kappa by its own equation.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jax import Array
from numpy.typing import NDArray

from mcml_sim import exact
from mcml_sim.exact import hankel
from mcml_sim.exact.by_albedo import by_alpha
from mcml_sim.exact.half_space import FINER
from mcml_sim.exact.transform import Transform
from mcml_sim.media.setting import Setting
from profilefit.laws.rational import Normalisation
from profilefit.studies.stability import layout
from profilefit.studies.stability.cells import DIMMEST, Cells, absolute, judged, relative, steps_down, steps_up
from profilefit.studies.stability.layout import CDF, FLOAT64, LENGTHS, PROFILE, REFLECTANCE_OF, SAMPLE, ArgumentAxis

Floats = NDArray[np.float64]
DECAY = "κ(α)"
# What its own docstring promises of profile and cdf, and of a map that is fitted to A.
BOUNDS = {PROFILE: 1e-6, CDF: 1e-9, SAMPLE: 1e-9, REFLECTANCE_OF: 1e-5, DECAY: 1e-10}
SURE_ALPHA, SURE_X = 0.05, (1e-6, 100.0)
NO_LIMIT = "closer than 1e-6 mfp under diffuse light R_d's limit is not known"
NEAR_SOURCE = 1e-4  # of R_d closer than 1e-6 mfp, where its limit stands for it


def cells_of(setting: Setting, normalisation: Normalisation) -> Iterator[Cells]:
    """Every function, over all arguments. Errors are those that more nodes show, or those of an identity."""
    alpha, x, xi = layout.alpha(np.float64), layout.radius(np.float64), layout.share(np.float64)
    low, high = LENGTHS[np.float64]
    mfp = ArgumentAxis("l", "length", np.array([low, 1.0, high]))
    a = alpha.values[:, None, None]
    with np.errstate(all="ignore"):
        r = x.values[:, None] * mfp.values
        profile, cdf = (np.asarray(each(r, a, mfp.values, setting)) for each in (exact.profile, exact.cdf))
        drawn = np.asarray(exact.quantile(xi.values[None, :, None], a, mfp.values, setting))
        within = exact.cdf(drawn, a, mfp.values, setting)
        yield _profile(setting, (alpha, x, mfp), profile)
    finer = finer_cdf(x.values, alpha.values, setting)
    yield _cells(setting, CDF, (alpha, x, mfp), cdf, finer, absolute(cdf, finer), steps_down(cdf, 1, np.float64, 1.0))
    missed = absolute(np.asarray(within), np.broadcast_to(xi.values[None, :, None], drawn.shape))
    yield _cells(setting, SAMPLE, (alpha, xi, mfp), drawn, drawn, missed, steps_down(drawn, 1, np.float64, drawn))
    yield from _of_alpha(setting, alpha, normalisation)


def finer_cdf(x: Floats, alpha: Floats, setting: Setting) -> Floats:
    """(alphas, radii, 1)."""
    return np.asarray(by_alpha(_share_within, x, alpha[:, None], setting, FINER))[..., None]


def _share_within(transform: Transform, alpha: Array, x: Array) -> Array:
    return hankel.cdf(transform, x)


def _profile(setting: Setting, places: tuple[ArgumentAxis, ...], value: Floats) -> Cells:
    """Against its own limit next to the source; beyond, what more nodes change.

    Where nothing is promised of it, for dark media and beyond 100 mfp, what they change is outside its range.
    """
    alpha, x, mfp = places
    a, near = alpha.values[:, None, None], x.values[None, :, None]
    limit = (
        a / (4.0 * np.pi * near) / mfp.values / mfp.values * (1.0 if setting.illumination == "searchlight" else np.nan)
    )
    limit = np.where((near == 0) & (a > 0), np.inf, limit)
    with np.errstate(all="ignore"):
        stated = np.asarray(exact.error_estimate(x.values, alpha.values[:, None], setting=setting))[..., None]
    at_limit = near < SURE_X[0]
    error = np.where(at_limit, relative(value, limit) * BOUNDS[PROFILE] / NEAR_SOURCE, stated)
    promised = at_limit | ((a >= SURE_ALPHA) & (near <= SURE_X[1]))
    inside = promised | ~(error > BOUNDS[PROFILE])
    reference = np.where(at_limit, limit, value)
    lost = ((near > 0) & (near < 4.0 * np.finfo(float).tiny)) | (a < DIMMEST[np.float64])
    depth = np.abs(np.log(np.maximum(value * mfp.values**2, 1e-300)))
    codes = judged(
        value, reference, error, BOUNDS[PROFILE], inside, np.float64, lost,
        steps_up(value, 1, np.float64, value * depth + 1e-9 * value),
    )  # fmt: skip
    return Cells(
        _name(setting), True, PROFILE, FLOAT64, places, value, reference, error, BOUNDS[PROFILE], inside, codes,
        unjudged=NO_LIMIT,
    )  # fmt: skip


def _of_alpha(setting: Setting, alpha: ArgumentAxis, normalisation: Normalisation) -> Iterator[Cells]:
    value, near = (
        np.asarray(exact.reflectance(alpha.values, setting)),
        np.asarray(normalisation.reflectance(alpha.values)),
    )
    rise = steps_down(value, 0, np.float64, 1.0)
    yield _cells(setting, REFLECTANCE_OF, (alpha,), value, near, absolute(value, near), rise)
    kappa = np.asarray(exact.decay_rate(alpha.values))
    with np.errstate(all="ignore"):
        left = np.abs(
            np.where(alpha.values > 0, kappa - np.tanh(kappa / np.maximum(alpha.values, 1e-300)), kappa - 1.0)
        )
    yield _cells(setting, DECAY, (alpha,), kappa, kappa, left, steps_up(kappa, 0, np.float64))


def _cells(setting: Setting, name: str, places: tuple[ArgumentAxis, ...], value, reference, error, wrong_way) -> Cells:
    value, reference, error = (np.asarray(each) for each in np.broadcast_arrays(value, reference, error))
    inside = np.ones(value.shape, bool)
    if name == SAMPLE:
        inside = np.broadcast_to(places[1].values[None, :, None] < 1.0, value.shape)
    codes = judged(value, reference, error, BOUNDS[name], inside, np.float64, wrong_way=wrong_way)
    return Cells(_name(setting), True, name, FLOAT64, places, value, reference, error, BOUNDS[name], inside, codes)


def _name(setting: Setting) -> str:
    return "exact" if setting.illumination == "searchlight" else "exact, diffuse light"
