"""Reflection and refraction at plane interfaces: Snell and Fresnel, for unpolarised light.

Every function takes numbers, numpy arrays or jax arrays, which broadcast, and keeps their precision.
"""

from __future__ import annotations

from typing import Any

from mcml_sim.media.arrays import namespace
from mcml_sim.media.medium import Medium


def fresnel(n1: Any, n2: Any, cos1: Any) -> tuple[Any, Any]:
    """Return the reflectance of an interface [-], and the cosine of the refracted ray to its normal [-].

    Args:
        n1: refractive index on the side the light comes from [-].
        n2: refractive index on the other side [-].
        cos1: cosine of the angle of incidence, 0 ... 1 [-].

    The mean of the two polarisations (Born & Wolf, Principles of Optics, sec. 1.5). Beyond the critical angle the
    reflectance is 1 and the refracted cosine 0; equal indices reflect nothing, at grazing incidence either.
    """
    xp = namespace(n1, n2, cos1)
    ratio = n1 / n2
    sine2_squared = ratio * ratio * ((1 - cos1) * (1 + cos1))
    cos2 = xp.sqrt(xp.maximum(1 - sine2_squared, 0))
    total, matched = cos2 == 0, n1 == n2
    # Both polarisations by products, so that nothing is divided by zero at grazing incidence.
    in1, in2, across1, across2 = n1 * cos1, n2 * cos2, n1 * cos2, n2 * cos1
    s_sum, p_sum = in1 + in2, across1 + across2
    s_part, p_part = (in1 - in2) * p_sum, (across1 - across2) * s_sum
    denominator = s_sum * p_sum
    amplitude = xp.where(total | matched, 1, denominator)
    reflectance = (s_part * s_part + p_part * p_part) / (2 * amplitude * amplitude)
    reflectance = xp.where(matched, 0, xp.where(total, 1, reflectance))
    return reflectance.astype(cos2.dtype), xp.where(matched, cos1 + 0 * cos2, cos2)


def specular_reflectance(medium: Medium) -> float:
    """Return the share of the beam that the surface throws back at once [-] (Wang & Jacques 1995, sec. 3.2).

    Below a first layer of clear glass the light that goes to and fro inside the glass is counted too, all orders of
    it: r1 + (1 - r1)^2 r2 / (1 - r1 r2).
    """
    first, *others = medium.layers
    surface = normal_reflectance(medium.n_above, first.n)
    if first.mu_t > 0:
        return surface
    below = others[0].n if others else first.n if medium.is_half_space else medium.n_below
    back = normal_reflectance(first.n, below)
    return surface + (1 - surface) ** 2 * back / (1 - surface * back)


def normal_reflectance(n1: float, n2: float) -> float:
    """Return Fresnel's reflectance at normal incidence, ((n1 - n2) / (n1 + n2))^2 [-]."""
    return ((n1 - n2) / (n1 + n2)) ** 2
