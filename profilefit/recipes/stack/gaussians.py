"""Sums of Gaussians fitted to the light of a stack under its own thicknesses: what blurs that are separable need."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from mcml_sim import Medium, exact
from mcml_sim.media.setting import require_illumination
from profilefit.errors import InputError
from profilefit.fitting.solver import Optimum, solve
from profilefit.laws.gaussians import MOST, MediumGaussians
from profilefit.recipes.stack import fit, photons

Floats = NDArray[np.float64]
NARROWEST = (5.0, 20.0, 1.0)  # radii of the narrowest Gaussian that fits start from, over that of the first ring
WIDEST = 0.5  # and of the widest, over that within which all light counts
DENSE = (
    0.25,
    0.7,
    0.4,
)  # narrowest and widest sigma of a dense sum, over the first and the last ring; steps of ln sigma
SEED = 300


class SumLight(NamedTuple):
    """Rings of light that a sum is fitted to.

    edges   (n + 1,) radii [mfp of the first layer];  energy  (n,) between them [-];  whole  A [-]
    weight  (n,) of a relative residual, their squares sum to 1;  noise  (n,) relative standard errors, 0 of exact light
    """

    edges: Floats
    energy: Floats
    weight: Floats
    whole: float
    noise: Floats


def sum_light(medium: Medium, illumination: str, nodes: exact.Nodes = fit.NODES) -> SumLight:
    """Rings even in ln r to 99.5 % of the light: exact, or of photons where a layer scatters forward."""
    fit.require(medium)
    first = medium.layers[0]
    unit = first.similar.mfp
    if any(layer.g > 0 for layer in medium.layers):
        rings = photons.traced(
            medium, illumination, photons.ring_edges(first, medium.layers), photons.STACK_PHOTONS, SEED
        )
        counts = rings.weight > 0
        first_ring, last_ring = np.flatnonzero(counts)[[0, -1]]
        inside = slice(first_ring, last_ring + 1)
        weight = np.where(counts, 1.0, 0.0)[inside] / np.sqrt(np.count_nonzero(counts))
        edges = rings.edges[first_ring : last_ring + 2] / unit
        return SumLight(edges, rings.energy[inside], weight, rings.whole, rings.noise[inside])
    light, r = exact.solve(medium, illumination, nodes), fit.radii(medium)
    share = np.asarray(light.cdf(r))
    seen = share <= fit.LAST_SHARE
    energy = np.diff(share[seen]) * light.reflectance
    weight = np.full(energy.size, 1.0 / np.sqrt(energy.size))
    return SumLight(r[seen] / unit, energy, weight, light.reflectance, np.zeros(energy.size))


def medium_gaussians(medium: Medium, illumination: str = "searchlight", count: int = 6) -> MediumGaussians:
    """The sum of 1 to 8 Gaussians nearest to the light of a stack of one index, relatively, over rings even in ln r.

    A is the stack's own. InputError as of `stack_law`, and on another count.
    """
    (found,) = alike((medium,), illumination, count)
    return found


def alike(media: Sequence[Medium], illumination: str = "searchlight", count: int = 6) -> tuple[MediumGaussians, ...]:
    """Sums of the same 1 to 8 variances, in one unit of length, for media of one unit: red, green and blue, say.

    Each x is in mean free paths of its own first layer.
    """
    if isinstance(count, bool) or count not in range(1, MOST + 1):
        raise InputError(f"count must be a number of Gaussians in 1 ... {MOST}, got {count!r}")
    require_illumination(illumination)
    lights = [sum_light(medium, illumination) for medium in media]
    units = [medium.layers[0].similar.mfp for medium in media]
    scaled = [light._replace(edges=light.edges * unit) for light, unit in zip(lights, units, strict=True)]
    variances, weights = made(fitted(scaled, count).parameters, len(media))
    return tuple(
        MediumGaussians(
            fit.setting_of(medium, illumination), light.whole, tuple((variances / unit**2).tolist()), tuple(weight)
        )
        for medium, light, unit, weight in zip(media, lights, units, weights.tolist(), strict=True)
    )


def dense(media: Sequence[Medium], illumination: str = "searchlight") -> tuple[Floats, Floats]:
    """Exact light, so to speak: variances (N,) [unit^2], even in their logarithm, and weights (media, N) that sum to 1.

    Of stacks of g = 0 in one unit. Rings to 99.5 % of the light are right to 1e-3 (root mean square, relative) by some
    twenty-five Gaussians >= 0: too many to draw with, but they sum over any surface. InputError as of `exact.solve`.
    """
    lights = {medium: exact.solve(medium, illumination, fit.NODES) for medium in dict.fromkeys(media)}
    radii = {medium: fit.radii(medium) for medium in lights}
    within = {medium: np.asarray(light.cdf(radii[medium])) for medium, light in lights.items()}
    last = {medium: radii[medium][within[medium] <= fit.LAST_SHARE][-1] for medium in lights}
    shortest, longest = min(r[0] for r in radii.values()), max(last.values())
    count = int(np.ceil(np.log(longest / shortest) / DENSE[2])) + 1
    variances = np.geomspace(DENSE[0] * shortest, DENSE[1] * longest, count) ** 2
    weights = {}
    for medium, r in radii.items():
        seen = r <= last[medium]
        share = np.diff(within[medium][seen], prepend=0.0, append=1.0)  # of the disc inside and of all beyond, too
        left = np.exp(-0.5 * r[seen, None] ** 2 / variances)
        rings = -np.diff(left, axis=0, prepend=1.0, append=0.0)
        weights[medium], _ = nnls(rings / share[:, None], np.ones(share.size), maxiter=100 * count)
    found = np.array([weights[medium] for medium in media])
    return variances, found / found.sum(axis=1, keepdims=True)


def fitted(lights: Sequence[SumLight], count: int) -> Optimum:
    """The best optimum of several starts: ln v_1, how ln v rises, and ln w_i / w_1 of each light, unbounded."""
    shortest, longest = min(light.edges[0] for light in lights), max(light.edges[-1] for light in lights)
    widest = 2.0 * np.log(WIDEST * longest)
    data = [(light.edges, light.energy, light.weight, light.whole) for light in lights]
    found = []
    for narrowest in NARROWEST:
        low = 2.0 * np.log(narrowest * shortest)
        rise = (widest - low) / max(count - 1, 1)
        start = [low, *[np.log(np.expm1(rise))] * (count - 1), *[0.0] * ((count - 1) * len(lights))]
        found.append(solve(_residual, np.array(start), data))
    return min(found, key=lambda one: one.cost if np.isfinite(one.cost) else np.inf)


def made(parameters: Floats, lights: int = 1) -> tuple[Floats, Floats]:
    """Variances (N,) and weights (lights, N) of unbounded parameters."""
    with jax.enable_x64(True):
        level, logit = _of(jnp.asarray(parameters), lights)
    return np.exp(np.asarray(level)), np.exp(np.asarray(logit))


def _of(parameters: jax.Array, lights: int) -> tuple[jax.Array, jax.Array]:
    """ln v and, of each light, ln w."""
    count = (parameters.size + lights) // (lights + 1)
    level = jnp.cumsum(jnp.concatenate([parameters[:1], jax.nn.softplus(parameters[1:count])]))
    logits = jnp.concatenate([jnp.zeros((lights, 1)), parameters[count:].reshape(lights, count - 1)], axis=1)
    return level, jax.nn.log_softmax(logits, axis=1)


def _residual(parameters, data):
    level, logits = _of(parameters, len(data))
    found = []
    for logit, (edges, energy, weight, whole) in zip(logits, data, strict=True):
        depth = 0.5 * edges[:, None] ** 2 * jnp.exp(-level)
        # e^-p - e^-q = e^-p (1 - e^(p - q)), without the cancellation of narrow rings
        rings = jnp.exp(logit - depth[:-1]) * -jnp.expm1(depth[:-1] - depth[1:])
        found.append(weight * (whole * jnp.sum(rings, axis=1) / energy - 1.0))
    return jnp.concatenate(found)
