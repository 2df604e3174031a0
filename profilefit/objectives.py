"""What a fit makes small: one function an objective, from a law and ring energies to residuals, a row an albedo.

Every objective is a differentiable function of the law **and** of the ring energies, weights included, so that the
photon noise of the energies propagates to the constants without another formula. The weighting decides the constants
of a law that is not the truth: it belongs to the objective's name, and each record states it.
"""

from __future__ import annotations

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from mcml_sim.errors import InputError
from profilefit.profiles import FEWEST_EFFECTIVE_SAMPLES, Profiles

Values = Array | NDArray[np.float64]
# A radius [mfp] beyond all light; infinity itself would turn 0 * inf into NaN in a derivative.
EVERYWHERE = 1e9


class Rings(eqx.Module):
    """The part of `Profiles` that residuals read, as one pytree.

    alpha (m,); r_edges (n + 1,) [mfp]; energy (m, n) [-]; beyond (m,) [-]; used (m, n) 1 where a ring counts, else 0
    weight (m,) 1 where an albedo counts, else 0; limits (2,) weights of the energy limit and of the source limit
    xi (k,) shares of energy for quantiles
    """

    alpha: Values
    r_edges: Values
    energy: Values
    beyond: Values
    used: Values
    weight: Values
    limits: Values
    xi: Values

    @property
    def reflectance(self) -> Array:
        """A (m,) [-]."""
        return self.energy.sum(axis=-1) + self.beyond

    @property
    def cdf(self) -> Array:
        """(m, n + 1) share of energy within each edge."""
        inside = jnp.cumsum(self.energy, axis=-1)
        return jnp.concatenate([jnp.zeros_like(inside[:, :1]), inside], axis=-1) / self.reflectance[:, None]


def energy(law, rings: Rings) -> Array:
    """Whole profile: ring energies, each ring's relative error weighted by its share of the energy; and the limits.

    The sum of squares of a profile's rings is the energy-weighted mean of (law/data - 1)^2. Two more rows an albedo
    hold the unscaled law to its limits: total energy A, and 2 pi r R_d -> alpha/2 at the source.
    """
    alpha = rings.alpha[:, None]
    inside = law.unscaled_energy(rings.r_edges, alpha)
    weight = rings.used / jnp.sqrt(jnp.where(rings.energy > 0, rings.energy, 1.0) * rings.reflectance[:, None])
    misfit = weight * (jnp.diff(inside, axis=-1) - rings.energy)
    total = law.unscaled_energy(EVERYWHERE, rings.alpha) / rings.reflectance - 1.0
    source = law.source_strength(rings.alpha) / (0.5 * rings.alpha) - 1.0
    return jnp.concatenate([misfit, (rings.limits[0] * total)[:, None], (rings.limits[1] * source)[:, None]], axis=1)


def radial(law, rings: Rings) -> Array:
    """As published: r R_d at the ring centres, unweighted, over the rings that the trimming (6) keeps."""
    r = 0.5 * (rings.r_edges[1:] + rings.r_edges[:-1])
    a, b, c = law.coefficients(rings.alpha[:, None])
    data = rings.energy / (2.0 * jnp.pi * jnp.diff(rings.r_edges))  # r R_d: the area is 2 pi r dr
    return rings.used * ((a * r + b) / (r + c) - data)


def albedo(law, rings: Rings) -> Array:
    """alpha(A) - alpha, unweighted over the albedos given."""
    return (law.alpha(rings.reflectance) - rings.alpha)[:, None]


def reflectance(law, rings: Rings) -> Array:
    """A(alpha) - A, unweighted over the albedos given."""
    return (law.reflectance(rings.alpha) - rings.reflectance)[:, None]


def radius(law, rings: Rings) -> Array:
    """g(xi) minus the radius within which the share xi of the energy leaves [mfp], unweighted in xi."""
    return law.sampler.unclipped(rings.xi, rings.alpha[:, None]) - _quantile(rings)


def relative_radius(law, rings: Rings) -> Array:
    """g(xi) over the radius within which the share xi of the energy leaves, minus 1 [-], unweighted in xi."""
    return law.sampler.unclipped(rings.xi, rings.alpha[:, None]) / _quantile(rings) - 1.0


def share(law, rings: Rings) -> Array:
    """Whole profile: the share of the energy within g(xi), minus xi, unweighted in xi [-]."""
    x = law.sampler.unclipped(rings.xi, rings.alpha[:, None])
    inner = _interpolate(jnp.abs(x), rings.r_edges, rings.cdf) * jnp.sign(x)
    return inner - rings.xi


_ALL = (energy, radial, albedo, reflectance, radius, relative_radius, share)
OBJECTIVES: dict[str, Callable] = {objective.__name__: objective for objective in _ALL}


def rings_of(profiles: Profiles, used=None, limits=(0.0, 0.0), xi=()) -> Rings:
    """The residuals' view of `profiles`.

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
    )


def _quantile(rings: Rings) -> Array:
    """(m, k) radii at the shares xi, linear in the cdf between edges."""
    return _interpolate(jnp.broadcast_to(rings.xi, (rings.alpha.size, rings.xi.size)), rings.cdf, rings.r_edges)


def _interpolate(x: Array, nodes: Values, values: Values) -> Array:
    """Row by row linear interpolation; `nodes` and `values` broadcast to a row for each row of x."""
    nodes = jnp.broadcast_to(nodes, (x.shape[0], nodes.shape[-1]))
    values = jnp.broadcast_to(values, (x.shape[0], values.shape[-1]))
    return eqx.filter_vmap(jnp.interp)(x, nodes, values)
