"""Sums of Gaussians fitted to the light of a stack, for blurs that are separable: constants, errors and quality."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls
from scipy.special import expit, log_softmax

from mcml_sim import Medium, exact
from mcml_sim.media.arrays import Floats, require
from mcml_sim.media.setting import require_illumination
from profilefit.fitting.discrepancy import FAILED, Residuals, of_residuals
from profilefit.fitting.estimate import JACKKNIFE_GROUPS, jackknife_error, judged, misfit_covariance, scaled_inverse
from profilefit.fitting.solver import Solution, solve, with_curvature
from profilefit.laws.gaussians import MOST, MediumGaussians
from profilefit.materials import CHANNELS
from profilefit.recipes.record import ERRORS
from profilefit.recipes.stack import fit
from profilefit.recipes.stack.fit import USUAL, Tracing

NARROWEST = (5.0, 20.0, 1.0)  # radii of the narrowest Gaussian that fits start from, over that of the first ring
WIDEST = 0.5  # and of the widest, over that within which all light counts
# Narrowest and widest sigma of a dense sum, over the first and the last ring; steps of ln sigma.
DENSE = (0.25, 0.7, 0.4)
ALONE = 8  # starts of one Gaussian
OFFSET = 299  # of the seed of traced light
# Of the row by which non-negative least squares makes weights sum to one: the optimum that follows does so to rounding.
TO_ONE = 1e3
SEARCH_WORTH = 1e-5  # as `worth` in `solve`, for the starts. `joint` goes on from the best of them
TURNS = 10  # of weights that are held at 0 and variances that move, and of fits that go on; three do
# Neighbouring rings that a refit of the jackknife leaves out together, of some ten to each Gaussian: their residuals
# are alike, and all of a Gaussian's rings would take the Gaussian along.
TOGETHER = 3
NOT_OF = ("statistical_error", "discretisation_error")  # what exact light has none of, and what traced light


class SumLight(NamedTuple):
    """Rings of light that a sum is fitted to.

    edges   (n + 1,) radii [mfp of the first layer];  energy  (n,) between them [-];  whole  A [-]
    weight  (n,) of a relative residual, their squares sum to 1;  noise  (n,) relative standard errors, 0 of exact light
    inside  of the light within the first edge [-], NaN where photons are too few to say
    """

    edges: Floats
    energy: Floats
    weight: Floats
    whole: float
    noise: Floats
    inside: float


class JointSum(NamedTuple):
    """One set of variances for several lights, each with weights of its own.

    variances  (N,) [length^2], rising;  weights (m, N) [-], each row sums to 1; those that would be negative are 0
    slopes     (N + m N, p) of ln variances and then weights by the parameters of `best`, all of which move something
    best       the optimum in ln variances and the weights that are free, but the largest of each light
    """

    variances: Floats
    weights: Floats
    slopes: Floats
    best: Solution

    @property
    def free(self) -> NDArray[np.bool_]:
        """(N + m N,) whether a constant was fitted: neither a weight that is held at 0 nor one that is alone."""
        return np.any(self.slopes != 0, axis=1)


def sum_light(medium: Medium, illumination: str, nodes: exact.Nodes = fit.NODES, tracing: Tracing = USUAL) -> SumLight:
    """Return rings even in ln r to 99.5 % of the light: exact, or of photons where a layer scatters forward."""
    fit.require(medium)
    first = medium.layers[0]
    unit = first.mfp
    if any(layer.g > 0 for layer in medium.layers):
        edges = fit.ring_edges(first, medium.layers)
        rings = tracing.rings(medium, illumination, edges, fit.STACK_PHOTONS, OFFSET)
        counts = rings.weight > 0
        begin, end = np.flatnonzero(counts)[[0, -1]] + [0, 1]
        weight = np.where(counts, 1.0, 0.0)[begin:end] / np.sqrt(np.count_nonzero(counts))
        edges = rings.edges[begin : end + 1] / unit
        return SumLight(edges, rings.energy[begin:end], weight, rings.whole, rings.noise[begin:end], np.nan)
    light, r = exact.solve(medium, illumination, nodes), fit.radii(medium)
    share = np.asarray(light.cdf(r))
    seen = share <= fit.LAST_SHARE
    energy = np.diff(share[seen]) * light.reflectance
    weight = np.full(energy.size, 1.0 / np.sqrt(energy.size))
    return SumLight(r[seen] / unit, energy, weight, light.reflectance, np.zeros(energy.size), float(share[0]))


def lights_of(
    media: Sequence[Medium], illumination: str, nodes: exact.Nodes = fit.NODES, tracing: Tracing = USUAL
) -> tuple[SumLight, ...]:
    """Return `sum_light` of media of one unit of length, edges in that unit; of equal media once."""
    found = {medium: sum_light(medium, illumination, nodes, tracing) for medium in dict.fromkeys(media)}
    return tuple(found[medium]._replace(edges=found[medium].edges * medium.layers[0].mfp) for medium in media)


def shared_gaussians(
    media: Sequence[Medium], illumination: str = "searchlight", count: int = 6
) -> tuple[MediumGaussians, ...]:
    """Fit sums of the same 1 to 8 variances to media of one unit of length, for example red, green and blue.

    Each x is in mean free paths of its own first layer.
    """
    is_count = not isinstance(count, bool) and count in range(1, MOST + 1)
    require(is_count, "count", f"a number of Gaussians in 1 ... {MOST}", count)
    require_illumination(illumination)
    lights = lights_of(media, illumination)
    found = joint(lights, count)
    each = zip(media, lights, found.weights, strict=True)
    return tuple(medium_sum(one, illumination, light.whole, found.variances, own) for one, light, own in each)


def medium_sum(medium: Medium, illumination: str, whole: float, variances: Floats, weights: Floats) -> MediumGaussians:
    """Return the sum of variances (N,) [length^2] and weights (N,) [-], in the medium's own mean free paths."""
    scaled = tuple((variances / medium.layers[0].mfp ** 2).tolist())
    return MediumGaussians(fit.setting_of(medium, illumination), whole, scaled, tuple(weights.tolist()))


def dense(lights: Sequence[SumLight]) -> tuple[Floats, Floats]:
    """Return many Gaussians in place of exact light: variances (N,) [length^2], even in ln, weights (lights, N) >= 0.

    Of exact lights with edges in one unit. Rings are right to 1e-3 (root mean square, relative) by some twenty-five
    Gaussians: too many to draw with, but they sum over any surface. Weights sum to 1.
    """
    shortest, longest = min(light.edges[0] for light in lights), max(light.edges[-1] for light in lights)
    count = int(np.ceil(np.log(longest / shortest) / DENSE[2])) + 1
    variances = np.geomspace(DENSE[0] * shortest, DENSE[1] * longest, count) ** 2
    found = []
    for light in lights:
        rings = light.energy / light.whole
        share = np.concatenate([[light.inside], rings, [1.0 - light.inside - rings.sum()]])
        edges = np.concatenate([[0.0], light.edges, [np.inf]])
        weight, _ = nnls(ring_shares(edges, variances) / share[:, None], np.ones(share.size), maxiter=100 * count)
        found.append(weight / weight.sum())
    return variances, np.array(found)


def joint(lights: Sequence[SumLight], count: int) -> JointSum:
    """Fit the sum nearest to all lights, whose edges are in one unit; weights that would be negative are held at 0.

    Given the variances, the weights are a problem of least squares with one optimum, which says which of them are 0.
    """
    variances, _ = shared_sum(fitted(lights, count).parameters, len(lights))
    weights = _weights(lights, variances)
    for _ in range(TURNS):
        offset, slopes = _places(weights)
        start = slopes.T @ (np.concatenate([np.log(variances), weights.ravel()]) - offset)
        best = _settled(start, lights, offset, slopes)
        constants = offset + slopes @ best.parameters
        variances, own = np.exp(constants[:count]), constants[count:].reshape(weights.shape)
        held, weights = weights == 0, _weights(lights, variances)
        if np.array_equal(weights == 0, held):
            break
    names = [f"v{i + 1}" if i < count else f"w{i % count + 1} of light {i // count}" for i in range(len(offset))]
    return JointSum(variances, own, slopes, judged(best, tuple(names[i] for i in np.argmax(slopes != 0, axis=0))))


def refitted(sums: JointSum, lights: Sequence[SumLight]) -> Floats:
    """Refit: ln variances and then weights (N + m N,) of the sum nearest to other lights, those at 0 held there.

    NaN where that fit does not converge.
    """
    offset, slopes = _places(sums.weights)
    best = _settled(sums.best.parameters, lights, offset, slopes)
    return offset + slopes @ best.parameters if best.converged else np.full(len(offset), np.nan)


def _settled(start: Floats, lights: Sequence[SumLight], offset: Floats, slopes: Floats) -> Solution:
    """Return the optimum from a start. Few Gaussians leave large residuals, whose curvature counts."""

    def at(parameters: Floats) -> tuple[Floats, Floats, Floats]:
        constants = offset + slopes @ parameters
        count = constants.size // (len(lights) + 1)
        return expanded(np.exp(constants[:count]), constants[count:].reshape(len(lights), count), slopes, lights)

    for _ in range(TURNS):
        best = solve(lambda parameters: with_curvature(*at(parameters)), start)
        if best.converged:
            break
        start = best.parameters
    values, jacobian, _ = at(best.parameters)
    return replace(best, residuals=values, jacobian=jacobian)


def expanded(
    variances: Floats, weights: Floats, slopes: Floats, lights: Sequence[SumLight]
) -> tuple[Floats, Floats, Floats]:
    """Return residuals (n,), their Jacobian (n, p), and the Hessian (p, p) of half their sum of squares, all of it."""
    count = variances.size
    values, jacobian = _off(variances, weights, lights)
    whole, levels = jacobian.T @ jacobian, np.arange(count)
    residuals = np.split(values, np.cumsum([light.energy.size for light in lights])[:-1])
    for number, (own, light, off) in enumerate(zip(weights, lights, residuals, strict=True)):
        pull = off * light.weight * light.whole / light.energy
        _, bent, more = (pull @ part for part in _shares(light.edges, variances))
        places = levels + count * (1 + number)
        whole[levels, levels] += more * own
        whole[levels, places] += bent
        whole[places, levels] += bent
    return values, jacobian @ slopes, slopes.T @ whole @ slopes


def _weights(lights: Sequence[SumLight], variances: Floats) -> Floats:
    one = np.full((1, variances.size), TO_ONE)
    found = []
    for light in lights:
        rings = ring_shares(light.edges, variances) * (light.weight * light.whole / light.energy)[:, None]
        found.append(nnls(np.vstack([rings, one]), np.append(light.weight, TO_ONE))[0])
    return np.array(found)


def _places(weights: Floats) -> tuple[Floats, Floats]:
    """Return offset (N + m N,) and slopes (N + m N, p): ln variances and weights are offset + slopes @ parameters.

    Parameters are ln variances and the weights that are not 0, except the largest weight of each light, which is 1 less
    the others.
    """
    lights, count = weights.shape
    size = count * (1 + lights)
    offset, columns = np.zeros(size), list(np.eye(size)[:count])
    for number, row in enumerate(weights):
        first, largest = count * (1 + number), int(np.argmax(row))
        offset[first + largest] = 1.0
        for place in np.flatnonzero(row):
            if place != largest:
                column = np.zeros(size)
                column[[first + place, first + largest]] = 1.0, -1.0
                columns.append(column)
    return offset, np.array(columns).T


def ring_shares(edges: Floats, variances: Floats) -> Floats:
    """Return shares (n, N) [-] of Gaussians of variances (N,) [length^2] in rings between edges (n + 1,) [length]."""
    return _shares(edges, variances)[0]


def _shares(edges: Floats, variances: Floats) -> tuple[Floats, Floats, Floats]:
    """`ring_shares`, and the first and second derivatives by ln variances."""
    depth = 0.5 * edges[:, None] ** 2 / variances
    light = np.exp(-depth)
    seen = np.where(light > 0, depth, 0.0)  # the last edge may be infinity
    bent = seen * light
    # e^-p - e^-q = e^-p (1 - e^(p - q)), without the cancellation of narrow rings
    shares = light[:-1] * -np.expm1(depth[:-1] - depth[1:])
    return shares, -np.diff(bent, axis=0), -np.diff((seen - 1.0) * bent, axis=0)


def fitted(lights: Sequence[SumLight], count: int) -> Solution:
    """Return the best of several starts, nearly at its optimum: ln v_1, its rises, ln w_i / w_1 of each, unbounded."""

    def at(parameters: Floats) -> tuple[Floats, Floats]:
        level, weights, slopes = _of(parameters, len(lights))
        values, jacobian = _off(np.exp(level), weights, lights)
        return values, jacobian @ slopes

    shortest, longest = min(light.edges[0] for light in lights), max(light.edges[-1] for light in lights)
    widest = 2.0 * np.log(WIDEST * longest)
    found = []
    lows = 2.0 * np.log(np.array(NARROWEST) * shortest)
    if count == 1:  # one alone has optima of its own near each colour's light
        lows = np.linspace(lows.min(), widest, ALONE, endpoint=False)
    for low in lows:
        rise = (widest - low) / max(count - 1, 1)
        start = [low, *[np.log(np.expm1(rise))] * (count - 1), *[0.0] * ((count - 1) * len(lights))]
        found.append(solve(at, np.array(start), worth=SEARCH_WORTH))
    return fit.lowest(found)


def shared_sum(parameters: Floats, lights: int = 1) -> tuple[Floats, Floats]:
    """Return variances (N,) and weights (lights, N) of unbounded parameters."""
    level, weights, _ = _of(parameters, lights)
    return np.exp(level), weights


def _of(parameters: Floats, lights: int) -> tuple[Floats, Floats, Floats]:
    """Return ln v (N,), weights (lights, N), and their derivatives (N + lights N, p)."""
    count = (parameters.size + lights) // (lights + 1)
    first, rises, logits = parameters[:1], parameters[1:count], parameters[count:].reshape(lights, count - 1)
    level = np.cumsum(np.concatenate([first, np.logaddexp(0.0, rises)]))
    weights = np.exp(log_softmax(np.column_stack([np.zeros(lights), logits]), axis=1))
    slopes = np.zeros((count * (1 + lights), parameters.size))
    slopes[:count, :count] = np.tri(count) * np.append(1.0, expit(rises))
    for number, own in enumerate(weights):
        rows, columns = count * (1 + number), count + number * (count - 1)
        by_logit = np.diag(own) - np.outer(own, own)
        slopes[rows : rows + count, columns : columns + count - 1] = by_logit[:, 1:]
    return level, weights, slopes


def _off(variances: Floats, weights: Floats, lights: Sequence[SumLight]) -> tuple[Floats, Floats]:
    """Weighted relative errors of all rings (n,), and their derivatives (n, N + lights N) by ln variances, weights."""
    count, values, slopes = variances.size, [], []
    for number, (own, light) in enumerate(zip(weights, lights, strict=True)):
        shares, bent, _ = _shares(light.edges, variances)
        unit = (light.weight * light.whole / light.energy)[:, None]
        rows = np.zeros((light.energy.size, count * (1 + len(lights))))
        rows[:, :count] = unit * bent * own
        rows[:, count * (1 + number) : count * (2 + number)] = unit * shares
        values.append(unit[:, 0] * (shares @ own) - light.weight)
        slopes.append(rows)
    return np.concatenate(values), np.concatenate(slopes)


def constant_names(count: int) -> list[str]:
    """Return the names of a sum's constants in their order: v1 ... vN, red.w1 ... red.wN, ..."""
    places = range(1, count + 1)
    return [*(f"v{i}" for i in places), *(f"{channel}.w{i}" for channel in CHANNELS for i in places)]


def errors(
    sums: JointSum, lights: Sequence[SumLight], media: Sequence[Medium], fewer: Sequence[SumLight] | None
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
    if not sums.best.converged:
        none = np.full(len(sums.slopes), np.nan)
        return {name: None if name == NOT_OF[is_traced] else none for name in ERRORS}
    own = np.concatenate([np.log(sums.variances), sums.weights.ravel()])
    gain = _gain(sums, lights)
    noise = np.concatenate([light.noise for light in lights])

    def spread(covariance: Floats) -> Floats:
        return np.sqrt(np.diag(sums.slopes @ covariance @ sums.slopes.T))

    by_name: dict[str, Floats | None] = {
        "statistical_error": spread((gain * noise**2) @ gain.T) if is_traced else None,
        "discretisation_error": None if fewer is None else np.abs(refitted(sums, fewer) - own),
        "model_error": spread(_model(sums, lights, media, gain)),
        "misfit_error": spread(misfit_covariance(sums.best)),
        "jackknife_error": _jackknife(sums, lights),
    }
    # From those of ln v to those of v.
    unit = np.where(sums.free, np.append(sums.variances, np.ones(sums.weights.size)), np.nan)
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
    """Return d parameters / d ln energy (p, n) of the rings.

    A is the sum of its rings and of the energy beyond them.
    """
    weight = np.concatenate([light.weight for light in lights])
    # With r = w (m / e - 1): the slope J^T r moves by -J^T (w + 2 r) d ln e.
    slope = found.best.jacobian * (weight + 2.0 * found.best.residuals)[:, None]
    raw = scaled_inverse(expanded(found.variances, found.weights, found.slopes, lights)[2]) @ slope.T
    parts = np.split(raw, np.cumsum([light.energy.size for light in lights])[:-1], axis=1)
    # Those are of what a sum is fitted to, e / A, not of e.
    each = zip(parts, lights, strict=True)
    return np.hstack([part - np.outer(part.sum(axis=1), light.energy / light.whole) for part, light in each])


def _model(found: JointSum, lights: Sequence[SumLight], media: Sequence[Medium], gain: Floats) -> Floats:
    """Covariance (p, p) of the parameters by the process that the residuals are a draw of; NaN where none fits."""
    weight, noise = (np.concatenate([getattr(one, name) for one in lights]) for name in ("weight", "noise"))
    middle = np.concatenate([0.5 * np.log(one.edges[1:] * one.edges[:-1]) for one in lights])
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
            s=np.sqrt([1.0 - medium.layers[0].alpha for medium in media]),
            slope=slope,
            noise=placed(noise[counts]).T[:, :, None],
            influence=np.moveaxis(placed(gain[:, counts].T), -1, 0),
        )
    )
    return process.covariance if process.result != FAILED else np.full_like(process.covariance, np.nan)


def _jackknife(found: JointSum, lights: Sequence[SumLight]) -> Floats:
    """Return the standard errors of a grouped jackknife over rings."""
    moved = []
    for group in range(JACKKNIFE_GROUPS):
        fewer = []
        for light in lights:
            kept = np.arange(len(light.energy)) // TOGETHER % JACKKNIFE_GROUPS != group
            fewer.append(light._replace(weight=light.weight * kept))
        moved.append(refitted(found, fewer))
    return jackknife_error(moved)
