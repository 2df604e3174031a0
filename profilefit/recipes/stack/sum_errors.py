"""Errors of the constants of a sum of Gaussians, and its distance from the light of each colour."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mcml_sim import Medium
from profilefit.fitting.discrepancy import FAILED, Residuals, of_residuals
from profilefit.fitting.estimate import JACKKNIFE_GROUPS, misfit_covariance, scaled_inverse
from profilefit.materials import CHANNELS
from profilefit.recipes.schema import ERRORS
from profilefit.recipes.stack.gaussians import JointSum, SumLight, curvature, refitted, ring_shares

Floats = NDArray[np.float64]
# Neighbouring rings that a refit of the jackknife leaves out together, of some ten to each Gaussian: their residuals
# are alike, and all of a Gaussian's rings would take the Gaussian along.
TOGETHER = 3
NOT_OF = ("statistical_error", "discretisation_error")  # what exact light has none of, and what traced light


def constant_names(count: int, channels: Sequence[str] = CHANNELS) -> list[str]:
    """Return the names of a sum's constants in their order: v1 ... vN, red.w1 ... red.wN, ..."""
    places = range(1, count + 1)
    return [*(f"v{i}" for i in places), *(f"{channel}.w{i}" for channel in channels for i in places)]


def errors(
    found: JointSum, lights: Sequence[SumLight], media: Sequence[Medium], fewer: Sequence[SumLight] | None
) -> dict[str, Floats | None]:
    """Return the errors (N + m N,) of variances [length^2] and weights [-], by the names that records have for them.

    fewer  the same lights of fewer nodes, None where they are traced

    statistical     that of the photons: their variances carried through the derivative of the optimum, the curvature
                    of the residuals included; None where light is exact
    discretisation  what a refit to light of fewer nodes changes; None of traced light, whose rings are integrals
    model           the misfit as a random function of ln r and sqrt(1 - alpha) of the first layer, by which colours
                    are alike (`fitting.discrepancy`), carried through the same derivative; NaN where no process fits
    misfit          s^2 (J^T J)^-1, as if residuals were independent
    jackknife       refits without a sixth of the rings, of every colour at once; NaN where one does not converge
    What was not fitted has NaN in each, and so has all where the fit failed.
    """
    is_traced = fewer is None
    if not found.best.converged:
        none = np.full(len(found.slopes), np.nan)
        return {name: None if name == NOT_OF[is_traced] else none for name in ERRORS}
    own = np.concatenate([np.log(found.variances), found.weights.ravel()])
    gain = _gain(found, lights)
    noise = np.concatenate([light.noise for light in lights])

    def spread(covariance: Floats) -> Floats:
        return np.sqrt(np.diag(found.slopes @ covariance @ found.slopes.T))

    by_name: dict[str, Floats | None] = {
        "statistical_error": spread((gain * noise**2) @ gain.T) if is_traced else None,
        "discretisation_error": None if fewer is None else np.abs(refitted(found, fewer) - own),
        "model_error": spread(_model(found, lights, media, gain)),
        "misfit_error": spread(misfit_covariance(found.best)),
        "jackknife_error": _jackknife(found, lights),
    }
    # From those of ln v to those of v.
    unit = np.where(found.free, np.append(found.variances, np.ones(found.weights.size)), np.nan)
    return {name: None if one is None else one * unit for name, one in by_name.items()}


def quality(light: SumLight, variances: Floats, weights: Floats) -> dict[str, float]:
    """Measure a sum of variances (N,) [length^2] and weights (N,) [-] against light whose edges are in that length.

    rel  mean relative error of the rings [-];  rms  its root mean square;  ks  largest error of the cdf at their edges
    """
    counts, own = light.weight > 0, ring_shares(light.edges, variances) @ weights
    data = np.where(counts, light.energy / light.whole, own)
    off = own[counts] / data[counts] - 1.0
    first = float(weights @ -np.expm1(-0.5 * light.edges[0] ** 2 / variances))
    inside = light.inside if np.isfinite(light.inside) else first
    apart = np.cumsum(np.append(first - inside, own - data))
    return {
        "rel": float(np.mean(np.abs(off))),
        "rms": float(np.sqrt(np.mean(off**2))),
        "ks": float(np.max(np.abs(apart))),
    }


def _gain(found: JointSum, lights: Sequence[SumLight]) -> Floats:
    """d parameters / d ln energy (p, n) of the rings, A the sum of its rings and of what lies beyond them."""
    weight = np.concatenate([light.weight for light in lights])
    # With r = w (m / e - 1): the slope J^T r moves by -J^T (w + 2 r) d ln e.
    slope = found.best.jacobian * (weight + 2.0 * found.best.residuals)[:, None]
    raw = scaled_inverse(curvature(found, lights)) @ slope.T
    parts, end = [], 0
    for light in lights:
        begin, end = end, end + len(light.energy)
        block = raw[:, begin:end]  # of what a sum is fitted to, e / A, not of e
        parts.append(block - np.outer(block.sum(axis=1), light.energy / light.whole))
    return np.concatenate(parts, axis=1)


def _model(found: JointSum, lights: Sequence[SumLight], media: Sequence[Medium], gain: Floats) -> Floats:
    """Covariance (p, p) of the parameters by the process that the residuals are a draw of; NaN where none fits."""
    weight, noise, middle = (
        np.concatenate(column)
        for column in zip(
            *((one.weight, one.noise, 0.5 * np.log(one.edges[1:] * one.edges[:-1])) for one in lights), strict=True
        )
    )
    counts = weight > 0
    of = np.repeat(np.arange(len(lights)), [len(light.energy) for light in lights])[counts]
    live = of == np.arange(len(lights))[:, None]  # (m, k): no ring of one light is one of another

    def placed(values: Floats) -> Floats:
        """(m, k, ...) of rings (k, ...)."""
        return live.reshape(*live.shape, *(1,) * (values.ndim - 1)) * values

    off = placed(found.best.residuals[counts] / weight[counts])
    slope = placed(found.best.jacobian[counts] / weight[counts, None])
    process = of_residuals(
        Residuals(
            table=off,
            live=live,
            u=middle[counts],
            s=np.sqrt([1.0 - medium.layers[0].similar.alpha for medium in media]),
            slope=slope,
            noise=placed(noise[counts]).T[:, :, None],
            influence=np.moveaxis(placed(gain[:, counts].T), -1, 0),
        )
    )
    return process.covariance if process.result != FAILED else np.full_like(process.covariance, np.nan)


def _jackknife(found: JointSum, lights: Sequence[SumLight]) -> Floats:
    """Standard errors of a grouped jackknife over rings (Efron, The Jackknife, 1982, ch. 2)."""
    moved = []
    for group in range(JACKKNIFE_GROUPS):
        fewer = []
        for light in lights:
            kept = np.arange(len(light.energy)) // TOGETHER % JACKKNIFE_GROUPS != group
            fewer.append(light._replace(weight=light.weight * kept))
        moved.append(refitted(found, fewer))
    apart = np.array(moved) - np.mean(moved, axis=0)
    return np.sqrt((JACKKNIFE_GROUPS - 1) / JACKKNIFE_GROUPS * np.sum(apart**2, axis=0))
