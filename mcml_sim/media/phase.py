"""Henyey-Greenstein: how far scattering turns the light.

p(c) = (1 - g^2) / (2 (1 + g^2 - 2 g c)^(3/2)) for the cosine c of the scattering angle, -1 ... 1; its mean is g
(Henyey & Greenstein, Astrophys. J. 93, 1941). All forms here are free of the usual division by g and of its
cancellation: g = 0 is no special case, and 1 - c and 1 + c keep their relative precision near c = 1 and -1.

Every function takes numbers, numpy arrays or jax arrays, which broadcast, and keeps their precision.
"""

from __future__ import annotations

from typing import Any

from mcml_sim.media.fresnel import namespace


def sample_henyey_greenstein(g: Any, xi: Any) -> Any:
    """Cosine of the scattering angle [-] below which lies the share `xi` in [0, 1] of all scatterings."""
    below_one, _ = deflection(g, 2 * xi - 1)
    return 1 - below_one


def pdf_henyey_greenstein(g: Any, cosine: Any) -> Any:
    """Density of the cosine [-]: its integral over -1 ... 1 is 1."""
    xp = namespace(g, cosine)
    square = _square(g, cosine)
    return (1 - g * g) / (2 * square * xp.sqrt(square))


def invert_henyey_greenstein(g: Any, cosine: Any) -> Any:
    """The `xi` whose sample is `cosine`: the cumulative distribution [-]."""
    xp = namespace(g, cosine)
    distance = xp.sqrt(_square(g, cosine))
    return 0.5 + 0.5 * (2 * cosine - 3 * g + g * g * g) / (distance * (1 - g * g + distance))


def deflection(g: Any, v: Any) -> tuple[Any, Any]:
    """1 - c and 1 + c for the sample of xi = (1 + v) / 2, v in [-1, 1]; both >= 0, and g -> -g, v -> -v swaps them."""
    reciprocal = 1 / (1 + g * v)
    half_square = 0.5 * reciprocal * reciprocal
    below_one = (1 - g) * (1 - g) * half_square * ((1 - v) * (2 + g * (1 + v)))
    above_minus_one = (1 + g) * (1 + g) * half_square * ((1 + v) * (2 - g * (1 - v)))
    return below_one, above_minus_one


def _square(g: Any, cosine: Any) -> Any:
    """1 + g^2 - 2 g c, without cancellation at c = 1."""
    return (1 - g) * (1 - g) + 2 * g * (1 - cosine)
