"""Objectives, which a fit minimises: a function each, from a law and ring energies to tables of residuals.

A table has a row for each albedo. Tables of one objective stay apart: XLA would compute what they share for each column
anew if they were joined in a compiled program.

Every objective is a differentiable function of the law **and** of the ring energies, weights included, so that the
photon noise of the energies propagates to the constants without another formula. The weighting decides the constants of
a law that is not the truth: it belongs to the objective's name, and each record states it. None is differentiated by
alpha, whose derivatives are infinite at alpha = 1.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from mcml_sim.errors import InputError
from mcml_sim.exact.light import reduced, unreduced
from profilefit.fitting.profiles import FEWEST_EFFECTIVE_SAMPLES, Profiles
from profilefit.fitting.quality import ENERGY_WITHIN, NEAREST
from profilefit.laws.surface import RefractingSurface, surfaces_of

Values = Array | NDArray[np.float64]
Tables = tuple[Any, ...]  # of residuals, a row for each albedo
# A radius [mfp] beyond all light; infinity itself would turn 0 * inf into NaN in a derivative.
EVERYWHERE = 1e9
# An error of the cdf weighs as much as a relative error of the profile twenty times its size.
SHARE_WEIGHT = 20.0
NO_LIMITS = (0.0, 0.0, 0.0)
# Next to white A and kappa go with v = sqrt(1 - alpha), exact R_d at one radius with v^2 only. What a law has in v must
# not be light that absorption adds: its slope in ln R_d, seen this near to white, must be less than -`LEAST_FALL`.
NEXT_TO_WHITE, LEAST_FALL = 1e-8, 3e-3
DARK = 1e-12  # energy of a ring that holds none


class Rings(eqx.Module):
    """The part of `Profiles` that residuals read, as one pytree.

    alpha (m,); r_edges (n + 1,) [mfp]; energy (m, n) [-]; beyond (m,) [-]; used (m, n) 1 where a ring counts, else 0
    weight (m,) 1 where an albedo counts, else 0; limits (3,) weights of the energy limit, of the source limit
    and of rising with alpha
    xi (k,) shares of energy for quantiles
    surface, surfaces  closed numbers of each profile (m, 1), and of each setting (j, 1), profiles of one after those of
    another; None where all belong to the law's own
    """

    alpha: Values
    r_edges: Values
    energy: Values
    beyond: Values
    used: Values
    weight: Values
    limits: Values
    xi: Values
    surface: RefractingSurface | None = None
    surfaces: RefractingSurface | None = None

    @property
    def reflectance(self) -> Array:
        """A (m,) [-]."""
        return self.energy.sum(axis=-1) + self.beyond

    @property
    def cdf(self) -> Array:
        """(m, n + 1) share of energy within each edge."""
        inside = jnp.cumsum(self.energy, axis=-1)
        return jnp.concatenate([jnp.zeros_like(inside[:, :1]), inside], axis=-1) / self.reflectance[:, None]


def energy(law, rings: Rings) -> Tables:
    """Whole profile: ring energies, each ring's relative error weighted by its share of the energy; and the limits.

    The sum of squares of a profile's rings is the energy-weighted mean of (law/data - 1)^2. Two more rows an albedo
    hold the unscaled law to its limits: total energy A, and 2 pi r R_d -> alpha/2 at the source.
    """
    alpha, law = rings.alpha[:, None], law.under(rings.surface)
    inside = law.unscaled_energy(rings.r_edges, alpha)
    data = jnp.where((rings.used > 0) & (rings.energy > 0), rings.energy, 1.0)
    weight = rings.used / jnp.sqrt(data * rings.reflectance[:, None])
    misfit = weight * (jnp.diff(inside, axis=-1) - rings.energy)
    total = law.unscaled_energy(EVERYWHERE, alpha) / rings.reflectance[:, None] - 1.0
    source = law.source_strength(alpha) / (0.5 * alpha) - 1.0
    return misfit, rings.limits[0] * total, rings.limits[1] * source


def relative(law, rings: Rings) -> Tables:
    """Whole profile on a log-spaced eye: relative errors of ring energies, even in ln r; and of the cumulated energy.

    The rings from `NEAREST` to the radius of `ENERGY_WITHIN` weigh as much as they are wide in ln r, so that their sum
    of squares is the mean square of (law/data - 1), the `rel` of `quality`. The rows after them hold the errors of the
    cdf at all edges, `SHARE_WEIGHT` times as heavy, since `ks` must be that much smaller than `rel`. The
    last rows resist a law that falls with alpha next to white, ring by ring: absorption must not add light.
    """
    added = _added_light(law, rings)
    alpha, law = rings.alpha[:, None], law.under(rings.surface)
    inside = law.unscaled_energy(rings.r_edges, alpha)
    widths = jnp.diff(jnp.log(jnp.maximum(rings.r_edges, rings.r_edges[1])))
    judged = (rings.r_edges[:-1] >= NEAREST * (1.0 - 1e-9)) & (rings.cdf[:, 1:] <= ENERGY_WITHIN)
    weight = jnp.where(judged, rings.used * widths, 0.0)
    weight = jnp.sqrt(weight / jnp.maximum(weight.sum(axis=-1, keepdims=True), 1e-300))
    data = jnp.where(
        (weight > 0) & (rings.energy > 0), rings.energy, 1.0
    )  # also where nothing counts: E^2 in a derivative must not underflow
    misfit = weight * (jnp.diff(inside, axis=-1) / data - 1.0)
    shares = inside / law.unscaled_energy(EVERYWHERE, alpha) - rings.cdf
    of_each = rings.alpha.size // len(added)
    added = rings.limits[2] / np.sqrt(of_each) * jnp.repeat(added, of_each, axis=0)
    return misfit, SHARE_WEIGHT / np.sqrt(rings.r_edges.size) * shares, added


def _added_light(law, rings: Rings) -> Array:
    """(j, n) d ln E / d sqrt(1 - alpha) of each ring next to white plus `LEAST_FALL`, at each index; 0 if negative."""
    alpha = jnp.array([1.0 - NEXT_TO_WHITE, 1.0])[:, None, None]
    darker, white = jnp.diff(law.under(rings.surfaces).unscaled_energy(rings.r_edges, alpha), axis=-1)
    lit = (darker > DARK) & (white > DARK)
    slope = jnp.log(jnp.where(lit, darker, 1.0) / jnp.where(lit, white, 1.0)) / np.sqrt(NEXT_TO_WHITE)
    return jnp.where(lit, jnp.maximum(slope + LEAST_FALL, 0.0), 0.0)


def radial(law, rings: Rings) -> Tables:
    """Compare r R_d at the ring centres, unweighted, over the rings that the trimming (6) keeps: as published."""
    r = 0.5 * (rings.r_edges[1:] + rings.r_edges[:-1])
    a, b, c = law.coefficients(rings.alpha[:, None])
    data = rings.energy / (2.0 * jnp.pi * jnp.diff(rings.r_edges))  # r R_d: the area is 2 pi r dr
    return (rings.used * ((a * r + b) / (r + c) - data),)


def albedo(law, rings: Rings) -> Tables:
    """alpha(A) - alpha of reduced albedos, unweighted over those given."""
    mapped = law.under(rings.surface).alpha(rings.reflectance[:, None])
    return (reduced(mapped, law.setting.g).alpha - rings.alpha[:, None],)


def reflectance(law, rings: Rings) -> Tables:
    """A(alpha) - A, unweighted over the albedos given."""
    alpha = unreduced(rings.alpha[:, None], law.setting.g)
    return (law.under(rings.surface).reflectance(alpha) - rings.reflectance[:, None],)


def relative_reflectance(law, rings: Rings) -> Tables:
    """A(alpha) / A - 1, unweighted over the albedos given."""
    return (reflectance(law, rings)[0] / rings.reflectance[:, None],)


def radius(law, rings: Rings) -> Tables:
    """g(xi) minus the radius within which the share xi of the energy leaves [mfp], unweighted in xi."""
    return (law.sampler.unclipped(rings.xi, rings.alpha[:, None]) - _quantile(rings),)


def relative_radius(law, rings: Rings) -> Tables:
    """g(xi) over the radius within which the share xi of the energy leaves, minus 1 [-], unweighted in xi."""
    return (law.sampler.unclipped(rings.xi, rings.alpha[:, None]) / _quantile(rings) - 1.0,)


def share(law, rings: Rings) -> Tables:
    """Whole profile: the share of the energy within g(xi), minus xi, unweighted in xi [-]."""
    x = law.sampler.unclipped(rings.xi, rings.alpha[:, None])
    inner = _interpolate(jnp.abs(x), rings.r_edges, rings.cdf) * jnp.sign(x)
    return (inner - rings.xi,)


_ALL = (energy, relative, radial, albedo, reflectance, relative_reflectance, radius, relative_radius, share)
OBJECTIVES: dict[str, Callable] = {objective.__name__: objective for objective in _ALL}


def rings_of(profiles: Profiles, used=None, limits=NO_LIMITS, xi=()) -> Rings:
    """Return the residuals' view of `profiles`.

    Rings with too few effective photons, or outside `used`, do not count, and neither do albedos whose reflectance,
    or whose outermost share of energy in `xi`, rests on too few. InputError if none is left.
    """
    keep = profiles.trusted & (profiles.energy > 0)
    if used is not None:
        keep &= used
    smallest = min([*xi, *(1.0 - np.asarray(xi)), 1.0])
    weight = profiles.albedo_samples * smallest >= FEWEST_EFFECTIVE_SAMPLES
    if not np.any(weight):
        needed = f"{FEWEST_EFFECTIVE_SAMPLES / smallest:.0f}"
        raise InputError(f"too few photons: no albedo rests on {needed} effective ones, as this fit needs; trace more")
    return Rings(
        profiles.alpha,
        profiles.r_edges,
        profiles.energy,
        profiles.beyond,
        keep.astype(float),
        weight.astype(float),
        np.asarray(limits, float),
        np.asarray(xi, float),
        *((surfaces_of(each), surfaces_of(tuple(dict.fromkeys(each)))) if (each := profiles.settings) else ()),
    )


def _quantile(rings: Rings) -> Array:
    """(m, k) radii at the shares xi, linear in the cdf between edges."""
    return _interpolate(jnp.broadcast_to(rings.xi, (rings.alpha.size, rings.xi.size)), rings.cdf, rings.r_edges)


def _interpolate(x: Array, nodes: Values, values: Values) -> Array:
    """Row by row linear interpolation; `nodes` and `values` broadcast to a row for each row of x."""
    nodes = jnp.broadcast_to(nodes, (x.shape[0], nodes.shape[-1]))
    values = jnp.broadcast_to(values, (x.shape[0], values.shape[-1]))
    return eqx.filter_vmap(jnp.interp)(x, nodes, values)
